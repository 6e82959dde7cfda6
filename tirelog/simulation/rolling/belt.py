"""The belt of a tire in motion, by finite elements.

In the frame that turns with the hub: its stiffness, inertia and natural vibrations.

    TrueTire, inflation pressure --Splines--> Belt (stencils)
        --> static shape under a load, natural frequencies

theta is the material's place on the belt, psi the hub's angle, phi = theta + psi the place in
space. phi is 0 at the bottom and grows in the direction of rolling. With e_r = (sin phi, -cos phi)
outwards and e_t = (cos phi, sin phi), in (backwards, upwards), a point of the belt is at

    r = H + (R + w) e_r + v e_t,      w = -dv/dtheta     (the belt does not stretch)

so that v holds everything: its mean is the wind-up against the hub, its first harmonic the belt's
translation, the rest bends. b = w' - v is the turning of the tangent times R. The hoop force closes
the curve to second order: a belt that turns by b/R loses b^2/(2 R) of its radius, which centrifugal
force and pressure resist. By virtual work, per angle:

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
from scipy.interpolate import BSpline

from tirelog.errors import UsageError
from tirelog.kernels import compiled
from tirelog.simulation.scenario.schema import BENDING_N_M2
from tirelog.storage.schema import Record
from tirelog.vocabulary.arrays import FloatArray

# ---- Compiled: products with circulants of eleven bands, and with their inverses.
#
# The waves around the belt are the eigenvectors of all circulants, whose inverses are circulants
# too: an inverse is one column.
#
#     stencil (11,) --invert: once for each change of it--> column --solve--> x (N,)
#     stencil (11,) --apply_circulant--> its product with x


#: degree of the belt's splines, whose bending and its shear are continuous; and half width of every
#: stencil
DEGREE = HALF = 5


@compiled
def invert(stencil: FloatArray, cosines: FloatArray, sines: FloatArray, column: FloatArray) -> None:
    """Fills `column` (2 N,): the first one of the inverse of a stencil's circulant, twice.

    `cosines`, `sines` (N, N // 2 + 1): the waves around the belt, as of `waves_of`.
    """
    size, waves = cosines.shape
    real, imaginary = np.zeros(waves), np.zeros(waves)
    for d in range(-HALF, HALF + 1):
        real += stencil[d + HALF] * cosines[d % size]
        imaginary += stencil[d + HALF] * sines[d % size]
    share = np.full(waves, 2.0 / size)
    share[0] = 1.0 / size
    if size % 2 == 0:
        share[-1] = 1.0 / size
    share /= real**2 + imaginary**2
    column[:size] = np.dot(cosines, real * share) + np.dot(sines, imaginary * share)
    column[size:] = column[:size]


@compiled
def solve(column: FloatArray, right: FloatArray, x: FloatArray) -> None:
    """x (N,) of the circulant whose inverse is `column`, as of `invert`, for `right` (N,)."""
    size = right.size
    x[:] = 0.0
    # four at a time: what is summed is loaded once for all of them
    for j in range(0, size - 3, 4):
        a, b, c, d = right[j], right[j + 1], right[j + 2], right[j + 3]
        if a == 0.0 and b == 0.0 and c == 0.0 and d == 0.0:  # most of the belt has no load
            continue
        answer = column[size - j - 3 : 2 * size - j]
        for i in range(size):
            x[i] += a * answer[i + 3] + b * answer[i + 2] + c * answer[i + 1] + d * answer[i]
    for j in range(size - size % 4, size):
        answer = column[size - j : 2 * size - j]
        for i in range(size):
            x[i] += right[j] * answer[i]


@compiled
def apply_circulant(stencil: FloatArray, x: FloatArray, out: FloatArray) -> None:
    """The circulant of `stencil` times x (N,)."""
    around = np.concatenate((x[-HALF:], x, x[:HALF]))
    for i in range(x.size):
        value = 0.0
        for d in range(2 * HALF + 1):
            value += stencil[d] * around[i + d]
        out[i] = value


# ---- Finite elements on a closed belt: periodic splines of degree five on equal elements.
#
#     coefficients c (N,) --basis--> v(theta) = sum_j c_j B((theta - theta_0)/step - j), four times
#                                    continuously differentiable
#
# B_j lives on the elements j .. j + 5, so that element e sees the coefficients e - 5 .. e (modulo
# N).
# All elements are equal: a matrix of basis integrals is circulant and banded, and is kept as its
# stencil, shape (11,), offsets -5 .. 5.


_BASIS = BSpline.basis_element(np.arange(DEGREE + 2.0), extrapolate=False)


@dataclass(frozen=True)
class Splines:
    """`elements` equal elements around the belt, angles in [rad]."""

    elements: int

    @property
    def step_rad(self) -> float:
        return 2.0 * np.pi / self.elements

    @cached_property
    def middle_rad(self) -> FloatArray:
        """Where each basis function has its middle, shape (N,)."""
        return np.asarray((np.arange(self.elements) + 0.5 * (DEGREE + 1)) * self.step_rad, float)

    def local(self, place: FloatArray, derivative: int = 0) -> FloatArray:
        """The six functions that live at a place of an element, shape (n, 6).

        Or a derivative of them by the angle; `place` (n,) in [0, 1).
        """
        x = np.asarray(place, float)[:, None] + np.arange(DEGREE, -1, -1.0)
        basis = _BASIS.derivative(derivative) if derivative else _BASIS
        return np.asarray(np.nan_to_num(basis(x)) / self.step_rad**derivative, float)

    def gram(self, left: int, right: int) -> FloatArray:
        """Stencil of int B_i^(left) B_k^(right) dtheta, shape (11,).

        Over offsets k - i = -5 .. 5, by Gauss's rule (exact).
        """
        points, weights = np.polynomial.legendre.leggauss(DEGREE + 1)
        a, b = (self.local(0.5 * (points + 1.0), m) for m in (left, right))
        # a[:, i] is the function that began DEGREE - i elements ago
        shared = 0.5 * self.step_rad * (a * weights[:, None]).T @ b
        return np.array([np.trace(shared, offset) for offset in range(-DEGREE, DEGREE + 1)])

    @property
    def first_harmonic(self) -> float:
        """int B_j sin(theta) dtheta over sin(middle of B_j)."""
        half = 0.5 * self.step_rad
        return float(self.step_rad * (np.sin(half) / half) ** (DEGREE + 1))

    def functional(
        self, angle_rad: float, weights: dict[int, float], length_rad: float = 0.0
    ) -> FloatArray:
        """Row (N,) that reads sum_m weights[m] v^(m) at `angle_rad`.

        Or its mean over `length_rad` around it.
        """
        points, shares = (
            np.polynomial.legendre.leggauss(24) if length_rad else (np.zeros(1), np.full(1, 2.0))
        )
        place = ((angle_rad + 0.5 * length_rad * points) / self.step_rad) % self.elements
        element = np.clip(place.astype(int), 0, self.elements - 1)
        row = np.zeros(self.elements)
        index = (element[:, None] - DEGREE + np.arange(DEGREE + 1)) % self.elements
        for derivative, weight in weights.items():
            np.add.at(
                row, index, 0.5 * weight * shares[:, None] * self.local(place - element, derivative)
            )
        return row


def waves_of(elements: int) -> tuple[FloatArray, FloatArray]:
    """Cosines and sines of whole waves around a belt of N elements, (N, N // 2 + 1) each."""
    turns = np.outer(np.arange(elements), np.arange(elements // 2 + 1)) % elements / elements
    return np.cos(2.0 * np.pi * turns), np.sin(2.0 * np.pi * turns)


def circulant(stencil: FloatArray, size: int) -> FloatArray:
    """The full matrix (size, size) of a stencil."""
    half = stencil.size // 2
    column = np.zeros((size, size))
    rows = np.arange(size)
    for offset, value in zip(range(-half, half + 1), stencil, strict=True):
        column[rows, (rows + offset) % size] += value
    return column


@dataclass(frozen=True)
class Belt:
    """The belt's stencils on `splines`; `tension_N` is p b R.  UsageError for what cannot move."""

    tire: Record
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
        bending = tire.flexural_stiffness_N_m2 or BENDING_N_M2["ring"]
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
        follow the coefficients.
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
            if 0.1 < np.sqrt(max(value, 0.0)) / (2.0 * np.pi) <= 300.0
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

    def check_speed(self, speed_m_s: float) -> None:
        """UsageError if the turning belt's own vibrations grow.

        They do beyond the critical speed, which is found between 0 and `speed_m_s`.
        """
        # on 64 elements its slow vibrations come to 1e-5, a hundred times sooner
        coarse = Belt(self.tire, self.tension_N, Splines(min(self.splines.elements, 64)))

        def grows(speed: float) -> bool:
            # the eigenvalue solver's rounding grows by less than 0.02 per second
            return bool(coarse.vibrations(speed / self.radius_m)[0].real.max() > 0.02)

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
