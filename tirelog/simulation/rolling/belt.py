"""The belt of a tire in motion, by finite elements.

In the frame that turns with the hub: its stiffness, inertia and natural vibrations.

    TrueTire, inflation pressure --Splines--> Belt (stencils)
        --> static shape under a load, natural frequencies

theta is the material's place on the belt, psi the hub's angle, phi = theta + psi the place in
space, 0 at the bottom, growing in the direction of rolling; e_r = (sin phi, -cos phi) outwards, e_t
= (cos phi, sin phi), in (backwards, upwards). A point of the belt is at

    r = H + (R + w) e_r + v e_t,      w = -dv/dtheta     (the belt does not stretch)

so that v holds everything: its mean is the wind-up against the hub, its first harmonic the belt's
translation, the rest bends. By virtual work, per angle, with b = w' - v the turning of the tangent
times R, and the hoop force that closes the curve to second order (a belt that turns by b/R loses
b^2/(2 R) of its radius, which centrifugal force and pressure resist):

    kinetic    rho A R/2 [(w_t - W v)^2 + (v_t + W (R + w))^2 - W^2 b^2],  W = dpsi/dt
    elastic    EI/(2 R^3) (w + w'')^2 + p b/2 (v''^2 - v'^2) + R/2 (k_v v^2 + k_w w^2)
    lost       R/2 (c_v v_t^2 + c_w w_t^2)

The pressure's term is minus its work on the area that the curve encloses. Stretch, gravity on the
belt and tread inertia are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from tirelog.errors import UsageError
from tirelog.simulation.rolling.splines import Splines, circulant
from tirelog.simulation.scenario.schema import TrueTire
from tirelog.vocabulary.arrays import FloatArray

#: flexural stiffness [N m^2] if the tire names none
FLEXURAL_STIFFNESS_N_M2 = 2.0
#: rates of growth [1/s] below this are the eigenvalue solver's rounding
_ROUNDING_1_S = 0.02
#: vibrations listed in the truth reach to this frequency [Hz]; twice as high lists about twice as
#: many
_LISTED_HZ = 300.0


@dataclass(frozen=True)
class Belt:
    """The belt's stencils on `splines`; `tension_N` is p b R.  UsageError for what cannot move."""

    tire: TrueTire
    tension_N: float
    splines: Splines

    def __post_init__(self) -> None:
        if not self.tire.line_mass_kg_m > 0.0:
            raise UsageError(
                "line_mass_kg_m = 0 in [tire]",
                allowed="a belt that moves has a mass above zero",
                do="give one",
            )

    # ---- stencils, shape (11,), per integral over theta ------------------------------------------

    @property
    def radius_m(self) -> float:
        return self.tire.rolling_radius_m

    @property
    def mass_kg(self) -> float:
        return 2.0 * np.pi * self.radius_m * self.tire.line_mass_kg_m

    @cached_property
    def inertia(self) -> FloatArray:
        """rho A R (v v + w w)."""
        g = self.splines.gram
        return self.tire.line_mass_kg_m * self.radius_m * (g(0, 0) + g(1, 1))

    @cached_property
    def swirl(self) -> FloatArray:
        """The antisymmetric matrix of the belt's angular momentum beside the rigid one.

        v_t . swirl v is rho A R int (w v_t - v w_t).
        """
        return -2.0 * self.tire.line_mass_kg_m * self.radius_m * self.splines.gram(0, 1)

    @cached_property
    def centrifugal(self) -> FloatArray:
        """Times W^2: rho A R (v v + w w - b b)."""
        g = self.splines.gram
        # b = -(v'' + v); int v v'' = -int v' v'
        turned = g(2, 2) - 2.0 * g(1, 1) + g(0, 0)
        return self.tire.line_mass_kg_m * self.radius_m * (g(0, 0) + g(1, 1) - turned)

    @cached_property
    def stiffness(self) -> FloatArray:
        """Stiffness of the belt from bending, pressure and sidewall."""
        tire, g, radius = self.tire, self.splines.gram, self.radius_m
        bending = (
            FLEXURAL_STIFFNESS_N_M2
            if tire.flexural_stiffness_N_m2 is None
            else tire.flexural_stiffness_N_m2
        )
        bent = g(1, 1) - 2.0 * g(2, 2) + g(3, 3)
        sidewall = tire.tangential_stiffness_N_m2 * g(0, 0) + tire.radial_stiffness_N_m2 * g(1, 1)
        return (
            bending / radius**3 * bent
            + self.tension_N / radius * (g(2, 2) - g(1, 1))
            + radius * sidewall
        )

    @cached_property
    def damping(self) -> FloatArray:
        tire, g = self.tire, self.splines.gram
        return self.radius_m * (
            tire.tangential_damping_N_s_m2 * g(0, 0) + tire.radial_damping_N_s_m2 * g(1, 1)
        )

    # ---- coupling to the hub ---------------------------------------------------------------------

    @property
    def carried(self) -> float:
        """Momentum of the belt along a direction, over a sum of rates [kg].

        The sum is sum_j dc_j/dt sin(middle_j + psi) (upwards) or cos (backwards).
        """
        return 2.0 * self.tire.line_mass_kg_m * self.radius_m * self.splines.first_harmonic

    @property
    def translation(self) -> float:
        """Coefficients of a rigid translation of 1 m.

        They are this times sin(middle_j + psi) (upwards) or cos (backwards).
        """
        return self.splines.step_rad / self.splines.first_harmonic

    @property
    def held(self) -> tuple[float, float]:
        """Sidewall's force on the hub over the sums of `carried`: spring [N/m], damper [N s/m]."""
        tire, share = self.tire, self.radius_m * self.splines.first_harmonic
        spring = tire.tangential_stiffness_N_m2 + tire.radial_stiffness_N_m2
        return share * spring, share * (tire.tangential_damping_N_s_m2 + tire.radial_damping_N_s_m2)

    # ---- natural vibrations ----------------------------------------------------------------------

    def full(self, stencil: FloatArray) -> FloatArray:
        return circulant(stencil, self.splines.elements)

    def natural_frequencies(self) -> list[dict[str, float]]:
        """Vibrations at rest in the air with the hub free, up to 300 Hz, lowest first.

        `frequency_Hz`, `lobes` (0 wind-up, 1 translation). The hub's two displacements and its turn
        stand behind the coefficients.
        """
        size, middle = self.splines.elements, self.splines.middle_rad
        M, K = (
            linalg.block_diag(self.full(a), np.zeros((3, 3)))
            for a in (self.inertia, self.stiffness)
        )
        hub, wound = (
            self.tire.hub_mass_kg,
            self.tire.line_mass_kg_m * self.radius_m**2 * self.splines.step_rad,
        )
        for row, wave in ((size, np.cos(middle)), (size + 1, np.sin(middle))):
            M[row, :size] = M[:size, row] = self.carried * wave
            M[row, row] = hub + self.mass_kg
        M[size + 2, :size] = M[:size, size + 2] = wound
        M[size + 2, size + 2] = self.tire.hub_inertia_kg_m2 + self.mass_kg * self.radius_m**2
        values, shapes = linalg.eigh(K, M)
        return [
            {"frequency_Hz": float(np.sqrt(value) / (2.0 * np.pi)), "lobes": _lobes(shape[:size])}
            for value, shape in zip(values, shapes.T, strict=True)
            if 0.1 < np.sqrt(max(value, 0.0)) / (2.0 * np.pi) <= _LISTED_HZ
        ]

    def vibrations(
        self, spin_rad_s: float
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
        """Eigenvalues (k,) [1/s] and shapes (N, k) of the belt that turns on a held hub.

        As its own material feels them.
        """
        size = self.splines.elements
        inertia = self.full(self.inertia)
        rate = self.full(2.0 * spin_rad_s * self.swirl + self.damping)
        place = self.full(self.stiffness - spin_rad_s**2 * self.centrifugal)
        system = np.zeros((2 * size, 2 * size))
        system[:size, size:] = np.eye(size)
        system[size:] = -linalg.solve(inertia, np.hstack((place, rate)), assume_a="pos")
        values, shapes = linalg.eig(system)
        return values, shapes[:size]

    @property
    def coarse(self) -> Belt:
        """The same belt on at most 64 elements.

        Its slow vibrations come to 1e-5, a hundred times sooner.
        """
        return Belt(self.tire, self.tension_N, Splines(min(self.splines.elements, 64)))

    def check_speed(self, speed_m_s: float) -> None:
        """UsageError if the turning belt's own vibrations grow.

        They do beyond the critical speed, which is found between 0 and `speed_m_s`.
        """
        coarse = self.coarse

        def grows(speed: float) -> bool:
            return bool(coarse.vibrations(speed / self.radius_m)[0].real.max() > _ROUNDING_1_S)

        if not grows(speed_m_s):
            return
        low, high = 0.0, speed_m_s
        while high - low > 0.005 * speed_m_s:
            middle = 0.5 * (low + high)
            low, high = (low, middle) if grows(middle) else (middle, high)
        raise UsageError(
            f"the belt whirls in its sidewall at {speed_m_s:.1f} m/s",
            allowed=f"allowed is a drive below the critical speed of about {low:.1f} m/s",
            do="drive slower, or give a stiffer sidewall or less damping",
        )


def _lobes(shape: FloatArray) -> int:
    """The harmonic that carries most of the displacement, v and w counted."""
    power = np.abs(np.fft.rfft(shape)) ** 2
    return int(np.argmax(power * (1.0 + np.arange(power.size) ** 2)))
