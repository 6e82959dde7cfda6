"""A tire in motion: the belt on its hub, on a road, under a load and a torque.

From standing on the road to the end of a drive.

    Belt, Profile --tire_at_rest--> v, hub height at rest under the load
                  --rolling---> RollingTire
                      --run(distance, acceleration, load, torque)--> Motion, a row every few steps

The hub's way forward is the drive's; its height and its spin are free.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tirelog.data.setup import road_points
from tirelog.errors import UsageError
from tirelog.simulation.rolling import step_kernel as kernel
from tirelog.simulation.rolling.belt import Belt
from tirelog.simulation.rolling.step_kernel import MOMENT
from tirelog.simulation.scenario.schema import Road
from tirelog.vocabulary.arrays import FloatArray, Records

# ---- The road's profile under a tire in motion.
#
# `[road]` becomes corners between which the road is straight, or a wave.
#
#     Road (scenario) --profile_of--> Profile: height and slope at any distance x [m] driven since
#     the
#                                     log's start, level before it
#
# A wall has no slope for the tread to press along: steps and cleats have ramps, and what is too
# steep
# or too high for small displacements of the belt is refused.


#: steepest slope of a road [m/m]; twice as steep asks for tread points half as far apart
STEEPEST = 3.0
#: highest rise within one diameter of the tire, over its radius; twice as much would double the
#: strain that a linear belt takes for small
HIGHEST = 0.2


@dataclass(frozen=True)
class TrueProfile:
    """A road's profile: a broken line and a sine.

    `corner_m`, `height_m` (n,) the broken line, level outside; plus amplitude (1 - cos(2 pi
    x/wavelength)) behind the first corner.
    """

    corner_m: FloatArray
    height_m: FloatArray
    amplitude_m: float = 0.0
    wavelength_m: float = 1.0

    @property
    def top_m(self) -> float:
        return float(self.height_m.max()) + 2.0 * max(self.amplitude_m, 0.0)


def profile_of(road: Road, radius_m: float, distance_m: float) -> TrueProfile:
    """The scenario's profile over `distance_m` of driving.

    UsageError for one that a tire of this radius cannot roll over.
    """
    if road.kind == "flat":
        return TrueProfile(np.array([0.0, 1.0]), np.zeros(2))
    begin = (
        _needed(road, "position_m")[0] if road.kind in ("step", "cleat") else road.position_m or 0.0
    )
    if road.kind == "sine":
        return _wave(road, radius_m, begin)
    corner, height = _obstacle(road)
    _check(corner, height, radius_m)
    starts = begins(road, distance_m)
    corner, height = (starts[:, None] + corner).ravel(), np.tile(height, starts.size)
    if np.any(np.diff(corner) <= 0.0):
        raise UsageError(
            f"spacing_m = {road.spacing_m} of the [road] is shorter than what comes again",
            allowed="allowed is more",
            do="mend it",
        )
    _check(corner, height, radius_m)
    return TrueProfile(corner, height)


def begins(road: Road, distance_m: float) -> FloatArray:
    """Where the obstacle begins, each time that it comes within `distance_m`; at least once."""
    first, again = (
        road.position_m or 0.0,
        road.spacing_m if road.kind in ("cleat", "profile") else None,
    )
    count = 1 + int(max(distance_m - first, 0.0) / again) if again else 1
    return np.asarray(first + (again or 0.0) * np.arange(count), float)


def _needed(road: Road, *names: str) -> tuple[float, ...]:
    values = [getattr(road, name) for name in names]
    lacking = [name for name, value in zip(names, values, strict=True) if value is None]
    if lacking:
        raise UsageError(
            f'[road] kind = "{road.kind}" without {" and ".join(lacking)}',
            allowed="allowed is a number in m",
            do="give it",
        )
    return tuple(values)


def _obstacle(road: Road) -> tuple[FloatArray, FloatArray]:
    """Corners [m] behind the obstacle's begin, and heights."""
    if road.kind == "profile":
        if not road.file:
            raise UsageError(
                '[road] kind = "profile" without a file',
                allowed='allowed is file = "PATH" (distance and height, a point a line)',
                do="name it",
            )
        corner, height = road_points(road.file, UsageError)
        grows = "allowed are two points or more, at growing distances"
        for wrong, what in (
            (corner.size < 2, "a road of fewer than two points"),
            (np.any(np.diff(corner) <= 0.0), "distances of the road do not grow"),
        ):
            if wrong:
                raise UsageError(what, allowed=grows, do="mend the rows", file=road.file)
        return corner, height
    height = _needed(road, "height_m")[0]
    # ramp of a step or cleat that names none, as far as its length and the steepest slope allow [m]
    ramp = road.ramp_m or max(0.01, 1.01 * abs(height) / STEEPEST)
    if road.kind == "step":
        return np.array([0.0, ramp]), np.array([0.0, height])
    length = _needed(road, "length_m")[0]
    ramp = road.ramp_m or min(ramp, 0.49 * length)
    if not 0.0 < ramp < 0.5 * length:
        raise UsageError(
            f"ramp_m = {ramp:g} of a cleat {length:g} m long",
            allowed="allowed is above zero and below half of its length_m",
            do="mend it",
        )
    return np.array([0.0, ramp, length - ramp, length]), np.array([0.0, height, height, 0.0])


def _check(corner: FloatArray, height: FloatArray, radius_m: float) -> None:
    slope = float(np.abs(np.diff(height) / np.diff(corner)).max())
    if slope > STEEPEST:
        raise UsageError(
            f"a road with a slope of {slope:.3g}",
            allowed=f"allowed is up to {STEEPEST:g}",
            do="give it a longer ramp",
        )
    # the highest rise within a window stands in one that begins or ends at a corner
    for begin in (corner, corner - 2.0 * radius_m):
        first, end = (
            np.searchsorted(corner, x, side="left") for x in (begin, begin + 2.0 * radius_m)
        )
        edges = np.stack(
            [np.interp(begin, corner, height), np.interp(begin + 2.0 * radius_m, corner, height)],
            axis=1,
        )
        for i, j, edge in zip(first, end, edges, strict=True):
            _check_rise(float(np.ptp(np.append(edge, height[i:j]))), radius_m)


def _check_rise(rise_m: float, radius_m: float) -> None:
    if rise_m > HIGHEST * radius_m:
        raise UsageError(
            f"a road that rises {rise_m:.3g} m within one diameter of the tire",
            allowed=f"allowed is up to {HIGHEST * radius_m:.3g} m for a radius of {radius_m:.3g} m",
            do="give a lower obstacle",
        )


def _wave(road: Road, radius_m: float, begin_m: float) -> TrueProfile:
    amplitude, wavelength = _needed(road, "amplitude_m", "wavelength_m")
    if not wavelength > 0.0:
        raise UsageError(
            "wavelength_m = 0 in [road]", allowed="allowed is a length above zero", do="give one"
        )
    slope = abs(amplitude) * 2.0 * np.pi / wavelength
    if slope > STEEPEST:
        raise UsageError(
            f"a road with a slope of {slope:.3g}",
            allowed=f"allowed is up to {STEEPEST:g}",
            do="give a longer wave",
        )
    if wavelength < 4.0 * radius_m:
        _check_rise(2.0 * abs(amplitude), radius_m)
    return TrueProfile(np.array([begin_m, begin_m + 1.0]), np.zeros(2), amplitude, wavelength)


#: tread points on an element of the belt
POINTS = 8


#: a tire at rest on a level road at height 0: coefficients (N,), height of the hub [m], contact
#: length [m]
AtRest: TypeAlias = tuple[FloatArray, float, float]


def tire_at_rest(belt: Belt, load_N: float) -> AtRest:
    """The least of elastic energy, tread springs and load, by Newton's method.

    UsageError if the tire cannot carry the load.
    """
    points = belt.splines.elements * POINTS
    spacing = 2.0 * np.pi / points
    angle = (np.arange(points) + 0.5) * spacing
    near = np.flatnonzero(np.cos(angle) > np.cos(kernel.FAR))
    sin, cos, radius = np.sin(angle[near]), np.cos(angle[near]), belt.radius_m
    # height of a point: hub - (R + w) cos + v sin, with w = -v'
    rise = np.stack(
        [
            belt.splines.functional(a, {0: s, 1: c})
            for a, s, c in zip(angle[near], sin, cos, strict=True)
        ]
    )
    rise = np.hstack([rise, np.ones((near.size, 1))])
    size, stiffness = belt.splines.elements, belt.tire.tread_stiffness_N_m2 * radius * spacing
    held = np.zeros((size + 1, size + 1))
    held[:size, :size] = belt.full(belt.stiffness)
    q = np.append(np.zeros(size), radius - 0.005)
    pressed = np.zeros(near.size, bool)
    # Newton's iterations for the standing tire
    for _ in range(60):
        depth = radius * cos - rise @ q
        touching = depth > 0.0
        if (touching == pressed).all():
            break
        pressed = touching
        springs = rise[pressed]
        right = stiffness * springs.T @ (radius * cos[pressed])
        right[size] -= load_N
        if not pressed.any():
            q[size] -= 0.002
            continue
        q = np.linalg.solve(held + stiffness * springs.T @ springs, right)
    else:
        raise UsageError(
            f"the tire does not settle under {load_N:.0f} N",
            allowed="allowed is a load that it can carry",
            do="lower it",
        )
    place = angle[near[pressed]]
    place = np.where(place > np.pi, place - 2.0 * np.pi, place)
    if np.abs(place).max() > 0.95 * kernel.FAR:
        raise UsageError(
            f"at {load_N:.0f} N the contact is wider than +-{np.degrees(kernel.FAR):.0f} degrees",
            allowed="allowed is a load that the tire can carry",
            do="lower it, or give a stiffer tire",
        )
    return q[:size], float(q[size]), radius * (float(np.ptp(place)) + spacing)


class RollingTire:
    """State of one tire; `run` moves it on.  UsageError for an unstable step."""

    def __init__(
        self,
        belt: Belt,
        profile: TrueProfile,
        start: AtRest,
        *,
        speed_m_s: float,
        distance_m: float,
        step_s: float,
    ) -> None:
        # half of the longest stable step: slopes of the road stiffen the contact
        stiffness = belt.tire.tread_stiffness_N_m2 + belt.tire.bristle_stiffness_N_m2
        longest = 0.5 * 2.0 / np.sqrt(stiffness / belt.tire.line_mass_kg_m)
        if not 0.0 < step_s <= longest:
            raise UsageError(
                f"step_s = {step_s:g} is unstable for this tread and line mass",
                allowed=f"allowed is up to {longest:.2g} s",
                do="give a shorter step",
            )
        self.belt, self.profile, self.step_s = belt, profile, step_s
        splines, tire, points = belt.splines, belt.tire, belt.splines.elements * POINTS
        self.v = start[0].copy()
        # standing in space, the belt's material passes through the shape
        spin = speed_m_s / belt.radius_m
        slope = belt.full(splines.gram(0, 1)) @ start[0]
        self.u: FloatArray = np.asarray(
            spin * np.linalg.solve(belt.full(splines.gram(0, 0)), slope), float
        )
        self.now = 1
        self._stencils = kernel.Stencils(
            *(
                np.array(stencil, float)
                for stencil in (
                    belt.inertia, belt.swirl, belt.centrifugal, belt.stiffness, belt.damping
                )
            )
        )  # fmt: skip
        place = (np.arange(POINTS) + 0.5) / POINTS
        self._basis = splines.local(place), splines.local(place, 1)
        self._circle = _directions((np.arange(points) + 0.5) * (2.0 * np.pi / points))
        self._middles = _directions(splines.middle_rad)
        self._tread = np.zeros(points, kernel.POINT)
        spring, damper = belt.held
        self.constants = np.zeros(1, kernel.CONSTANTS)[0]
        for name, value in {
            "radius_m": belt.radius_m,
            "pressed_N_m2": tire.tread_stiffness_N_m2,
            "bristle_N_m2": tire.bristle_stiffness_N_m2,
            "friction": tire.friction,
            "pitch_m": 2.0 * np.pi * belt.radius_m / points,
            "hub_mass_kg": tire.hub_mass_kg,
            "hub_inertia_kg_m2": tire.hub_inertia_kg_m2,
            "spin_inertia_kg_m2": tire.hub_inertia_kg_m2 + belt.mass_kg * belt.radius_m**2,
            "carried_kg": belt.carried,
            "translation": belt.translation,
            "spring_N_m": spring,
            "damper_N_s_m": damper,
            "mean_inertia_kg": tire.line_mass_kg_m * belt.radius_m * splines.step_rad,
            "top_m": profile.top_m,
            "amplitude_m": profile.amplitude_m,
            "wave_1_m": 2.0 * np.pi / profile.wavelength_m,
        }.items():
            self.constants[name] = value
        self.state = np.zeros(1, kernel.STATE)[0]
        self.state["spin_rad_s"], self.state["hub_z_m"] = spin, start[1]
        self.state["hub_x_m"] = distance_m
        self.state["momentum_N_m_s"] = self._momentum()

    def _momentum(self) -> float:
        """The spin's momentum of this state."""
        belt, spin = self.belt, self.state["spin_rad_s"]
        pulled = self.v @ belt.full(belt.centrifugal) @ self.v
        own = self.u @ belt.full(belt.swirl) @ self.v
        mean = belt.radius_m * self.constants["mean_inertia_kg"] * self.u.sum()
        return float((self.constants["spin_inertia_kg_m2"] + pulled) * spin + own + mean)

    def damp_hub(self, damper_N_s_m: float) -> None:
        """A damper between the hub and something that stands still above it."""
        self.constants["hub_damping_N_s_m"] = damper_N_s_m

    def damp_belt(self, damping_N_s_m2: float) -> None:
        """Damping of the sidewall, radial and tangential, beside the tire's own."""
        belt, gram = self.belt, self.belt.splines.gram
        self._stencils.damping[:] = belt.damping + belt.radius_m * damping_N_s_m2 * (
            gram(0, 0) + gram(1, 1)
        )
        more = 2.0 * belt.radius_m * belt.splines.first_harmonic * damping_N_s_m2
        self.constants["damper_N_s_m"] = belt.held[1] + more

    def run(
        self, drive: Records, *, every: int = 1, riders: tuple[FloatArray, ...] = ()
    ) -> tuple[Records, FloatArray]:
        """Kept moments, of the steps' begins: (k,) of MOMENT, readings (k, r); k = ceil(n/every).

        One step per order of `drive` (n,) of DRIVE. UsageError if the belt leaves what small
        displacements can say.
        """
        rows = np.concatenate(riders) if riders else np.zeros((0, self.v.size))
        moments = np.empty(-(-drive.size // every), MOMENT)
        read = np.empty((moments.size, rows.shape[0]))
        told = kernel.run_steps(
            self.v, self.u, self.state, self.constants, self._stencils, self._basis, self._circle,
            self._middles, self.profile.corner_m, self.profile.height_m, self._tread, drive,
            rows, self.step_s, self.now, every, np.empty(1, kernel.CONTACT)[0], moments,
            read,
        )  # fmt: skip
        self.now += drive.size
        if told != kernel.FINE:
            what = (
                f"touches the road beyond +-{np.degrees(kernel.FAR):.0f} degrees"
                if told == kernel.TOO_WIDE
                else "leaves its sidewall"
            )
            raise UsageError(
                f"the belt {what} near {self.state['hub_x_m']:.1f} m of the drive",
                allowed="allowed are loads and obstacles of small displacements",
                do="lower them, or give a stiffer tire",
            )
        return moments, read


def _directions(angle_rad: NDArray[np.floating[Any]]) -> Records:
    """Directions (n,) as the kernels take them."""
    made = np.empty(angle_rad.size, kernel.DIRECTION)
    made["cos"], made["sin"] = np.cos(angle_rad), np.sin(angle_rad)
    return made
