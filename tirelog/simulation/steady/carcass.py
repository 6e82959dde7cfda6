"""The two true carcasses.

A beam on a foundation and an inextensible ring, as circulant systems of difference operators.

    line load p(xi) [N/m, inwards], tangential load q(xi) [N/m, towards the exit] --> inward
    displacement w(xi) [m]

Everything is steady in the road's frame: material passes as xi = c t, so that a time derivative is
c d/dxi (errata). Arrays of transforms are (b, points/2 + 1); b instants.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tirelog.errors import UsageError
from tirelog.simulation.scenario.planted import Planted
from tirelog.simulation.scenario.schema import Scenario
from tirelog.simulation.steady.loads import Instants
from tirelog.simulation.steady.operators import ComplexArray, Ring
from tirelog.vocabulary.arrays import FloatArray

#: EJ of a scenario that gives none, by its truth [N m^2]
BENDING_N_M2 = {"beam": 4.0, "ring": 2.0}
#: lengths over which the other forms of damping and tension act [m]
DAMPED_LENGTH_M, SHEAR_LENGTH_M = 0.02, 0.02
#: iterations for the hardening foundation, and the change at which they end, over the largest
#: displacement
LARGEST_ITERATIONS, RELATIVE_CHANGE = 200, 1e-8


@dataclass(frozen=True)
class Carcass:
    """Admittances of one carcass at b instants.

    `radial` and `tangential` (b, m) give the transform of w per transform of p and q; `hardening`
    (b,) is the cubic coefficient [N/m^4] of the foundation, zero if it is linear; `foundation` k
    [N/m^2].
    """

    ring: Ring
    radial: ComplexArray
    tangential: ComplexArray
    hardening: FloatArray
    hardens_linearly: bool

    def displacement(
        self, p: FloatArray, q: FloatArray | None = None, start: FloatArray | None = None
    ) -> FloatArray:
        """w (b, points) under the loads (b, points)."""
        free = self.radial * self.ring.transform(p)
        if q is not None:
            free = free + self.tangential * self.ring.transform(q)
        w = self.ring.inverse(free)
        if not self.hardening.any():
            return w
        return self._hardened(free, w if start is None else start)

    def _hardened(self, free: ComplexArray, w: FloatArray) -> FloatArray:
        """Fixed point w = A (p - (hardening(w) - mean) w)/(1 + mean A).

        A mean hardening is taken into the linear operator A; each row mixes its last two iterates
        so that their residual is least (Anderson's method, depth one).
        """
        peak = np.abs(w).max(axis=1)
        mean = self.hardening * (0.8 * peak if self.hardens_linearly else 1.1 * peak**2)
        softer = self.radial / (1.0 + mean[:, None] * self.radial)
        free = free / (1.0 + mean[:, None] * self.radial)
        before: tuple[FloatArray, FloatArray] | None = None
        for _ in range(LARGEST_ITERATIONS):
            stiffening = self.hardening[:, None] * (np.abs(w) if self.hardens_linearly else w * w)
            image = self.ring.inverse(
                free + softer * self.ring.transform((mean[:, None] - stiffening) * w)
            )
            residual = image - w
            if np.abs(residual).max() < RELATIVE_CHANGE * np.abs(image).max():
                return image
            w = image
            if before is not None:
                change = residual - before[1]
                share = (residual * change).sum(axis=1) / np.maximum(
                    (change * change).sum(axis=1), 1e-300
                )
                w = image - np.clip(share, -2.0, 2.0)[:, None] * (image - before[0])
            before = image, residual
        raise UsageError(
            "the stiffening foundation did not settle",
            allowed="allowed is a hardening of up to about its own stiffness",
            do="plant less",
        )

    def shape(self, w: FloatArray, derivative: int) -> ComplexArray:
        """Transform of a derivative of w."""
        return self.ring.derivatives[derivative] * self.ring.transform(w)


def curvature_operator(scenario: Scenario, ring: Ring) -> ComplexArray:
    """Strain per metre of lever arm from inward w, shape (m,).

    -w'' (beam), -(w'' + w/R^2) (ring); inner surface positive.
    """
    second = -ring.derivatives[2]
    if scenario.truth == "ring":
        second = second - ring.derivatives[0] / scenario.tire.rolling_radius_m**2
    return second


def _derivatives(ring: Ring, at: Instants) -> Sequence[ComplexArray]:
    """Transforms of the derivatives by xi along the belt as long as it is, (m,) or (b, m)."""
    if not at.stretches:
        return ring.derivatives
    return [d / at.stretch[:, None] ** m for m, d in enumerate(ring.derivatives)]


def _warmed(value: float, per_K: float, at: Instants) -> FloatArray:
    """A stiffness at the tire's temperature, (b, 1)."""
    warm: FloatArray = value * (1.0 + per_K * at.temperature_K[:, None])
    return warm


def _added(scenario: Scenario, ring: Ring, at: Instants, stiffness: FloatArray) -> ComplexArray:
    """Radial restoring operators that effects and damping add, (b, m).

    Force inwards per inward displacement.
    """
    mass = scenario.tire.line_mass_kg_m
    one, d1, *_ = derivatives = _derivatives(ring, at)
    total = np.zeros((len(at), one.shape[-1]), complex)
    rate = 2.0 * mass * at.speed[:, None]
    if scenario.truth == "beam":
        total += rate * scenario.tire.damping_rate_1_s * d1
    for effect in scenario.effects:
        quarter = ring.quarter_turn
        total += _structural(effect, derivatives, quarter, at, stiffness, rate)
        if effect.name == "thermal_drift" and effect["stiffness"]:
            total += stiffness * (effect["stiffness"] * at.warmed)[:, None] * one
    return total


def _structural(
    effect: Planted,
    derivatives: Sequence[ComplexArray],
    quarter_turn: ComplexArray,
    at: Instants,
    stiffness: FloatArray,
    rate: FloatArray,
) -> ComplexArray | float:
    """One effect's operator, (b, m)."""
    one, d1, d2, d3, _ = derivatives
    if effect.name == "viscous_damping":
        # other: part of the loss in bending, where short waves weigh more
        loss = 0.4 * d1 - 2.0 * DAMPED_LENGTH_M**2 * d3 if effect.other else d1
        return rate * effect["damping_rate_1_s"] * loss
    if effect.name == "hysteresis":
        weight = 0.75 * one - 2.0 * DAMPED_LENGTH_M**2 * d2 if effect.other else one
        return stiffness * effect["loss_factor"] * quarter_turn * weight
    if effect.name == "belt_tension":
        tension = effect["tension_N"] + effect["tension_mass_kg_m"] * at.speed[:, None] ** 2
        shear = 1.0 - SHEAR_LENGTH_M**2 * d2 if effect.other else one
        return -tension * d2 / shear
    return 0.0


def _hardening(scenario: Scenario, stiffness: FloatArray) -> tuple[FloatArray, bool]:
    effect = scenario.planted("stiffening")
    if effect is None:
        return np.zeros(stiffness.shape[0]), False
    # other: hardening with |w| instead of w^2, the same at 8 mm
    scale = 0.008 if effect.other else 1.0
    return stiffness[:, 0] * effect["cubic_1_m2"] * scale, effect.other


def carcass(scenario: Scenario, ring: Ring, at: Instants) -> Carcass:
    """The scenario's carcass at these instants.

    UsageError if a beam runs at or above its critical speed.
    """
    return _ring(scenario, ring, at) if scenario.truth == "ring" else _beam(scenario, ring, at)


def _beam(scenario: Scenario, ring: Ring, at: Instants) -> Carcass:
    """EJ w'''' + mu c^2 w'' + k w (+ what effects add) = p."""
    tire, warming = scenario.tire, scenario.nuisances.warming
    cold = tire.flexural_stiffness_N_m2 or BENDING_N_M2["beam"]
    bending = _warmed(cold, warming.bending_per_K, at)
    stiffness = _warmed(tire.foundation_stiffness_N_m2, warming.stiffness_per_K, at)
    one, _, d2, _, d4 = _derivatives(ring, at)
    added = _added(scenario, ring, at, stiffness)
    operator = (
        bending * d4 + tire.line_mass_kg_m * at.speed[:, None] ** 2 * d2 + stiffness * one + added
    )
    if (operator.real.min(axis=1) <= 0.02 * stiffness[:, 0]).any():
        top = float(at.speed.max())
        raise UsageError(
            f"the beam is near or above its critical speed at {top:.1f} m/s",
            allowed="allowed is a drive below about 0.95 of it",
            do="drive slower, or give a stiffer tire",
        )
    hardening, linearly = _hardening(scenario, stiffness)
    return Carcass(ring, 1.0 / operator, np.zeros_like(operator), hardening, linearly)


def _ring(scenario: Scenario, ring: Ring, at: Instants) -> Carcass:
    """The inextensible ring: tangential displacement v, inward w = R dv/dxi.

    By virtual work, in the angle phi = xi/R,

        EI/R^4 B'B v + (p0 b/R) (d4 + d2) v + k_v v - k_w d2 v + Omega (c_v d1 - c_w d3) v
            = q - dq_w/dphi,    B = d1 + d3.

    Inertia (Coriolis, centripetal) and the centrifugal hoop force of the steadily flowing belt
    cancel (errata) and are left out.
    """
    tire, warming = scenario.tire, scenario.nuisances.warming
    one, *others = ring.derivatives
    # by the angle: as long as the belt is, it goes round once
    d1, d2, d3, d4 = (tire.rolling_radius_m**m * d for m, d in enumerate(others, 1))
    radius = tire.rolling_radius_m * at.stretch[:, None]
    cold = tire.flexural_stiffness_N_m2 or BENDING_N_M2["ring"]
    bending = _warmed(cold, warming.bending_per_K, at) / radius**4
    pressure = _warmed(scenario.conditions.inflation_pressure_Pa, warming.pressure_per_K, at)
    hoop = pressure * tire.width_belt_m / radius
    radial = _warmed(tire.radial_stiffness_N_m2, warming.stiffness_per_K, at)
    tangential = _warmed(tire.tangential_stiffness_N_m2, warming.stiffness_per_K, at)
    spin = at.speed[:, None] / radius
    bent = d1 + d3
    added = _added(scenario, ring, at, radial)
    operator = (
        bending * np.abs(bent) ** 2
        + hoop * (d4 + d2)
        + tangential * one
        + np.abs(d1) ** 2 * (radial + added)
        + spin * (tire.tangential_damping_N_s_m2 * d1 - tire.radial_damping_N_s_m2 * d3)
    )
    hardening, linearly = _hardening(scenario, radial)
    return Carcass(ring, np.abs(d1) ** 2 / operator, d1 / operator, hardening, linearly)
