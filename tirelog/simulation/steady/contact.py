"""One-sided contact of the ring with a flat road through the tread's springs, by an active set.

    load F --> height of the road such that the springs that are pressed carry F, and none pulls
        --> pressure on the grid

The road is flat: a point of the belt at angle phi, moved by w outwards and v along, is at the depth
(R + w) cos phi - v sin phi below the axle.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.linalg import lu_factor, lu_solve

from tirelog.errors import UsageError
from tirelog.simulation.scenario.schema import Scenario, Warming
from tirelog.simulation.steady.carcass import Carcass, carcass
from tirelog.simulation.steady.loads import Instants
from tirelog.simulation.steady.operators import Ring
from tirelog.vocabulary.arrays import FloatArray

#: contact is looked for within these angles of the patch centre, the next if the one before is
#: too narrow [rad]
SECTORS_RAD = (0.3, 0.6)
#: compliances kept: those of a chunk of knots, which is solved at three loads
KEPT = 128
LARGEST_ITERATIONS = 60


@dataclass(frozen=True)
class Touch:
    """Contact at b instants: pressure and edges.

    `pressure` (b, points) [N/m], never negative; `entry_m`, `exit_m` (b,) its edges, below the
    grid's step.
    """

    pressure: FloatArray
    entry_m: FloatArray
    exit_m: FloatArray


class _TooNarrow(Exception):
    """The contact reaches the end of the sector."""


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

    def touch(self, at: Instants) -> Touch:
        """The contact at every instant, at its load; lengths are the grid's (`Instants.on_grid`).

        UsageError if the load is more than the ring can carry.
        """
        for angle_rad in SECTORS_RAD:
            if angle_rad > self.angle_rad:
                self._look_within(angle_rad)
            with suppress(_TooNarrow):
                return self._touch(at)
        raise UsageError(
            f"at {at.load.max():.0f} N the contact is wider than +-"
            f"{np.degrees(self.angle_rad):.0f} degrees",
            allowed="allowed is a load that the ring can carry",
            do="lower it, or give a stiffer ring",
        )

    def _touch(self, at: Instants) -> Touch:
        pressure = np.zeros((len(at), self.ring.points))
        entry, exit_ = np.zeros(len(at)), np.zeros(len(at))
        for i in range(len(at)):
            force, depth = self._solve(
                self._response(at.take(slice(i, i + 1))), float(at.load[i]), float(at.stretch[i])
            )
            pressure[i, self.sector] = force
            entry[i], exit_[i] = self._edges(depth)
        return Touch(pressure, entry, exit_)

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
            self._kept[key] = self._assembled(
                carcass(self.scenario, self.ring, at), float(tangential)
            )
        return self._kept[key]

    def _assembled(self, body: Carcass, tangential_N_m2: float) -> FloatArray:
        d1 = self.ring.derivatives[1] * self.radius
        # inward w is R dv/dxi: from the transforms of w back to v; the mean of v comes from
        # tangential loads alone
        along = np.zeros_like(d1)
        along[1:-1] = 1.0 / d1[1:-1]
        v_q = body.tangential[0] * along
        v_q[0] = 1.0 / tangential_N_m2
        w_p, w_q, v_p, v_q = (
            self.ring.inverse(kernel)[self._lag]
            for kernel in (body.radial[0], body.tangential[0], body.radial[0] * along, v_q)
        )
        # a road force f pushes inwards with f cos phi and along with f sin phi
        rise: FloatArray = self.cos[:, None] * (w_p * self.cos + w_q * self.sin)
        rise += self.sin[:, None] * (v_p * self.cos + v_q * self.sin)
        return rise

    def _solve(
        self, compliance: FloatArray, load: float, stretch: float
    ) -> tuple[FloatArray, FloatArray]:
        """Line force (n,) and pressed depth of the springs (n,).

        The depth is negative where the tread is clear of the road.
        """
        step, stiffness = self.ring.step_m, self.scenario.tire.tread_stiffness_N_m2
        above = stretch * self.above
        active = self._active
        for _ in range(LARGEST_ITERATIONS):
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
                raise _TooNarrow
            if (again == active).all():
                self._active = active
                return force, pressed
            active = again
        raise UsageError(
            f"the contact at {load:.0f} N did not settle",
            allowed="allowed is a load that the ring can carry",
            do="lower it",
        )

    def _edges(self, pressed: FloatArray) -> tuple[float, float]:
        """Entry and exit [m], where the pressed depth crosses zero, linear between grid points."""
        xi = self.ring.xi_m[self.sector]
        inside = np.flatnonzero(pressed > 0)
        first, last = inside[0], inside[-1]
        entry = xi[first] - self.ring.step_m * pressed[first] / (
            pressed[first] - pressed[first - 1]
        )
        return float(entry), float(
            xi[last] + self.ring.step_m * pressed[last] / (pressed[last] - pressed[last + 1])
        )
