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
from scipy.linalg import lu_factor, lu_solve

from tirelog.errors import UsageError
from tirelog.simulation.scenario.schema import BENDING_N_M2, Scenario, Warming
from tirelog.simulation.steady.loads import ComplexArray, Instants, Ring
from tirelog.vocabulary.arrays import FloatArray

#: lengths over which the other forms of damping and tension act [m]
DAMPED_LENGTH_M, SHEAR_LENGTH_M = 0.02, 0.02


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
        for _ in range(200):
            stiffening = self.hardening[:, None] * (np.abs(w) if self.hardens_linearly else w * w)
            image = self.ring.inverse(
                free + softer * self.ring.transform((mean[:, None] - stiffening) * w)
            )
            residual = image - w
            if np.abs(residual).max() < 1e-8 * np.abs(image).max():
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


def curvature_operator(scenario: Scenario, ring: Ring) -> ComplexArray:
    """Strain per metre of lever arm from inward w, shape (m,).

    -w'' (beam), -(w'' + w/R^2) (ring); inner surface positive.
    """
    second = -ring.derivatives[2]
    if scenario.truth == "ring":
        second = second - ring.derivatives[0] / scenario.tire.rolling_radius_m**2
    return second


def _derivatives(ring: Ring, at: Instants) -> Sequence[ComplexArray]:
    """Transforms of the derivatives by xi along the belt as long as it is, (b, m) each."""
    return [d / at.stretch[:, None] ** m for m, d in enumerate(ring.derivatives)]


def _warmed(value: float, per_K: float, at: Instants) -> FloatArray:
    """A stiffness at the tire's temperature, (b, 1)."""
    return value * (1.0 + per_K * at.temperature_K[:, None])


def _added(scenario: Scenario, ring: Ring, at: Instants, stiffness: FloatArray) -> ComplexArray:
    """Radial restoring operators that effects and damping add, (b, m).

    Force inwards per inward displacement.
    """
    mass = scenario.tire.line_mass_kg_m
    one, d1, d2, d3, _ = _derivatives(ring, at)
    total = np.zeros((len(at), one.shape[-1]), complex)
    rate = 2.0 * mass * at.speed[:, None]
    if scenario.truth == "beam":
        total += rate * scenario.tire.damping_rate_1_s * d1
    # the discrete Hilbert operator: every wave e^(i kappa xi), kappa > 0, times i, but the shortest
    quarter_turn = 1j * np.ones(one.shape[-1])
    quarter_turn[[0, -1]] = 0.0
    for effect in scenario.effects:
        if effect.name == "viscous_damping":
            # other: part of the loss in bending, where short waves weigh more
            loss = 0.4 * d1 - 2.0 * DAMPED_LENGTH_M**2 * d3 if effect.other else d1
            total += rate * effect["damping_rate_1_s"] * loss
        elif effect.name == "hysteresis":
            weight = 0.75 * one - 2.0 * DAMPED_LENGTH_M**2 * d2 if effect.other else one
            total += stiffness * effect["loss_factor"] * quarter_turn * weight
        elif effect.name == "belt_tension":
            tension = effect["tension_N"] + effect["tension_mass_kg_m"] * at.speed[:, None] ** 2
            shear = 1.0 - SHEAR_LENGTH_M**2 * d2 if effect.other else one
            total -= tension * d2 / shear
        elif effect.name == "thermal_drift":
            total += stiffness * (effect["stiffness"] * at.warmed)[:, None] * one
    return total


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


# ---- One-sided contact of the ring with a flat road through the tread's springs, by an active set.
#
#     load F --> height of the road such that the springs that are pressed carry F, and none pulls
#         --> pressure on the grid
#
# The road is flat: a point of the belt at angle phi, moved by w outwards and v along, is at the
# depth
# (R + w) cos phi - v sin phi below the axle.


#: contact is looked for within these angles of the patch centre, the next if the one before is
#: too narrow [rad]
SECTORS_RAD = (0.3, 0.6)
#: compliances kept: those of a chunk of knots, which is solved at three loads
KEPT = 128


class FlatRoadContact:
    """The contact problem of one scenario's ring.

    It remembers compliances, and the last contact as the next one's start.
    """

    def __init__(self, scenario: Scenario, ring: Ring) -> None:
        self.scenario, self.ring = scenario, ring
        self.radius = scenario.tire.rolling_radius_m
        tire, planted = scenario.tire, {effect.name for effect in scenario.effects}
        damped = tire.radial_damping_N_s_m2 or tire.tangential_damping_N_s_m2
        nuisances = scenario.nuisances
        self._speed_matters = bool(
            damped
            or planted & {"viscous_damping", "belt_tension"}
            or nuisances.rolling_radius.growth
        )
        self._warmth_matters = nuisances.warming != Warming()
        self._look_within(SECTORS_RAD[0])

    def _look_within(self, angle_rad: float) -> None:
        """Set the sector of possible contact."""
        self.angle_rad = angle_rad
        self.sector = np.flatnonzero(np.abs(self.ring.xi_m) < angle_rad * self.radius)
        phi = self.ring.xi_m[self.sector] / self.radius
        self.cos, self.sin = np.cos(phi), np.sin(phi)
        self.above = self.radius * (1.0 - self.cos)
        self._lag = (self.sector[:, None] - self.sector[None, :]) % self.ring.points
        self._kept: dict[tuple[float, float, float], FloatArray] = {}
        self._active = self.ring.xi_m[self.sector] ** 2 < 0.05**2

    def touch(self, at: Instants) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(pressure (b, points) [N/m], entry and exit (b,) [m], finer than the grid), at the load.

        The pressure is never negative; lengths are the grid's (`loads.on_grid`).

        UsageError if the load is more than the ring can carry.
        """
        for angle_rad in SECTORS_RAD:
            if angle_rad > self.angle_rad:
                self._look_within(angle_rad)
            if (found := self._touch(at)) is not None:
                return found
        raise UsageError(
            f"at {at.load.max():.0f} N the contact is wider than +-"
            f"{np.degrees(self.angle_rad):.0f} degrees",
            allowed="allowed is a load that the ring can carry",
            do="lower it, or give a stiffer ring",
        )

    def _touch(self, at: Instants) -> tuple[FloatArray, FloatArray, FloatArray] | None:
        """As `touch`; None if a contact reaches the end of the sector."""
        pressure = np.zeros((len(at), self.ring.points))
        entry, exit_ = np.zeros(len(at)), np.zeros(len(at))
        for i in range(len(at)):
            response = self._response(at[i : i + 1])
            found = self._solve(response, float(at.load[i]), float(at.stretch[i]))
            if found is None:
                return None
            pressure[i, self.sector], depth = found
            # where the pressed depth crosses zero, linear between grid points
            inside, xi, step = (
                np.flatnonzero(depth > 0),
                self.ring.xi_m[self.sector],
                self.ring.step_m,
            )
            first, last = inside[0], inside[-1]
            entry[i] = xi[first] - step * depth[first] / (depth[first] - depth[first - 1])
            exit_[i] = xi[last] + step * depth[last] / (depth[last] - depth[last + 1])
        return pressure, entry, exit_

    def _response(self, at: Instants) -> FloatArray:
        """How far a point of the sector rises [m] per unit of line force [N/m] at another.

        Shape (n, n), at one instant.
        """
        key = (
            float(at.speed[0]) if self._speed_matters else 0.0,
            float(at.warmed[0]),
            float(at.temperature_K[0]) if self._warmth_matters else 0.0,
        )
        if key not in self._kept:
            if len(self._kept) >= KEPT:
                self._kept.clear()
            warming = 1.0 + self.scenario.nuisances.warming.stiffness_per_K * at.temperature_K[0]
            tangential = self.scenario.tire.tangential_stiffness_N_m2 * warming
            body = carcass(self.scenario, self.ring, at)
            d1 = self.ring.derivatives[1] * self.radius
            # inward w is R dv/dxi: from the transforms of w back to v; the mean of v comes from
            # tangential loads alone
            along = np.zeros_like(d1)
            along[1:-1] = 1.0 / d1[1:-1]
            v_q = body.tangential[0] * along
            v_q[0] = 1.0 / float(tangential)
            w_p, w_q, v_p, v_q = (
                self.ring.inverse(kernel)[self._lag]
                for kernel in (body.radial[0], body.tangential[0], body.radial[0] * along, v_q)
            )
            # a road force f pushes inwards with f cos phi and along with f sin phi
            rise: FloatArray = self.cos[:, None] * (w_p * self.cos + w_q * self.sin)
            rise += self.sin[:, None] * (v_p * self.cos + v_q * self.sin)
            self._kept[key] = rise
        return self._kept[key]

    def _solve(
        self, compliance: FloatArray, load: float, stretch: float
    ) -> tuple[FloatArray, FloatArray] | None:
        """Line force (n,) and pressed depth of the springs (n,); None beyond the sector.

        The depth is negative where the tread is clear of the road.
        """
        step, stiffness = self.ring.step_m, self.scenario.tire.tread_stiffness_N_m2
        above = stretch * self.above
        active = self._active
        for _ in range(60):
            size = int(active.sum())
            system = np.zeros((size + 1, size + 1))
            system[:size, :size] = compliance[np.ix_(active, active)]
            system[np.arange(size), np.arange(size)] += 1.0 / stiffness
            system[:size, size] = -1.0
            system[size, :size] = step
            solution = lu_solve(
                lu_factor(system, check_finite=False),
                np.append(-above[active], load),
                check_finite=False,
            )
            force = np.zeros(active.size)
            force[active] = solution[:size]
            depth = solution[size] - above - compliance @ force
            # a pressed spring shows its own force, a free one the depth of the road inside the
            # tread
            pressed = np.where(active, force / stiffness, depth)
            again = pressed > 0
            if again[0] or again[-1] or not again.any():
                return None
            if (again == active).all():
                self._active = active
                return force, pressed
            active = again
        raise UsageError(
            f"the contact at {load:.0f} N did not settle",
            allowed="allowed is a load that the ring can carry",
            do="lower it",
        )
