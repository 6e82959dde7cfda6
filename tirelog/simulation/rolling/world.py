"""The world of a tire in motion.

The drive as impulses on the hub, the belt stepped through the log, and what sensors read of it.

    Drive, roughness --> distance, acceleration, load, torque at every step
        --RollingTire--> Motion on its own clock
    Motion --a sensor's place, second differences, lag, bandwidth--> its clean series
        --spline in time--> values at the moments of sampling

The drive's speed is the hub's way forward; wheel angle and spin are what the tire makes of it. The
log begins on a tire that has rolled for SETTLING_S under a damper that is then taken away.

The tire is a belt on its hub, on a road, under a load and a torque, from standing to the end of a
drive:

    Belt, Profile --tire_at_rest--> v, hub height at rest under the load
                  --rolling---> RollingTire
                      --run(distance, acceleration, load, torque)--> Motion, a row every few steps
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from tirelog.data.road import RoadProfile, road_of
from tirelog.errors import ModelError, UsageError
from tirelog.simulation.rolling import step_kernel as kernel
from tirelog.simulation.rolling.belt import Belt, Splines, waves_of
from tirelog.simulation.rolling.step_kernel import DRIVE, MOMENT
from tirelog.simulation.scenario.schema import Scenario
from tirelog.simulation.sensors.sampling import (
    ANGLE_POINTS,
    RIDING,
    Times,
    lagrange,
    steady_truth,
)
from tirelog.simulation.steady.waveforms import Fluctuation, TrueDrive, World
from tirelog.storage.schema import Record
from tirelog.vocabulary.arrays import FloatArray, Records
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2

# ---- The road's profile under a tire in motion.
#
# `[road]` becomes corners between which the road is straight, or a wave.
#
#     Road (scenario) --profile_of--> RoadProfile, with each obstacle of the drive in its line


def profile_of(road: Record, radius_m: float, distance_m: float) -> RoadProfile:
    """The scenario's profile over `distance_m` of driving.

    UsageError for one that a tire of this radius cannot roll over.
    """
    if road.kind in ("step", "cleat") and road.position_m is None:
        raise UsageError(
            f'[road] kind = "{road.kind}" without position_m',
            allowed="allowed is a number in m",
            do="give it",
        )
    starts = begins(road, distance_m)
    try:
        once = road_of(road, road.position_m or 0.0)
        corner = (starts[:, None] + np.array(once.distance_m)).ravel()
        height = np.tile(once.height_m, starts.size)
        line = tuple(corner.tolist()), tuple(height.tolist())
        whole = RoadProfile(*line) if corner.size else once
        whole.check_climbable(radius_m)
    except ModelError as problem:
        raise UsageError(
            problem.what, allowed=problem.allowed, do=problem.do, file=problem.file,
            line=problem.line,
        ) from None  # fmt: skip
    return whole


def begins(road: Record, distance_m: float) -> FloatArray:
    """Where the obstacle begins, each time that it comes within `distance_m`; at least once."""
    first, again = road.position_m or 0.0, 0.0
    if road.kind in ("cleat", "profile"):
        again = road.spacing_m or 0.0
    count = 1 + int(max(distance_m - first, 0.0) / again) if again else 1
    return np.asarray(first + again * np.arange(count), float)


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
        profile: RoadProfile,
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
        self.belt, self.step_s = belt, step_s
        # the wave of a road without a line begins at the first of two level corners
        self.corner_m = np.array(profile.distance_m or (profile.at_m, profile.at_m + 1.0))
        self.height_m = np.array(profile.height_m or (0.0, 0.0))
        splines, tire, points = belt.splines, belt.tire, belt.splines.elements * POINTS
        self.v = start[0].copy()
        # at rest in space, the belt's material passes through the shape
        spin = speed_m_s / belt.radius_m
        slope = belt.full(splines.gram(0, 1)) @ start[0]
        self.u: FloatArray = np.asarray(
            spin * np.linalg.solve(belt.full(splines.gram(0, 0)), slope), float
        )
        self.now = 1
        cosines, sines = waves_of(splines.elements)
        self._stencils = kernel.Stencils(
            belt.inertia, belt.swirl, belt.centrifugal, belt.stiffness, belt.damping.copy(),
            cosines, sines,
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
            # coefficients of a rigid translation of 1 m, over sin(middle_j + psi) or cos
            "translation": splines.step_rad / splines.first_harmonic,
            "spring_N_m": spring,
            "damper_N_s_m": damper,
            "mean_inertia_kg": tire.line_mass_kg_m * belt.radius_m * splines.step_rad,
            "top_m": self.height_m.max() + 2.0 * max(profile.amplitude_m, 0.0),
            "amplitude_m": profile.amplitude_m,
            "wave_1_m": 2.0 * np.pi / (profile.wavelength_m or np.inf),
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
        """A damper between the hub and a fixed point above it."""
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
            self._middles, self.corner_m, self.height_m, self._tread, drive,
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


# ---- The world of a tire in motion.


#: the tire rolls on the level so long before anything is kept [s], its hub held by so much of the
#: critical damping
SETTLING_S, HELD = 0.6, 0.7
#: damping of the sidewall beside its own meanwhile, in equal parts of that time [N s/m^2]: without
#: it an undamped belt rings from the start
QUIETED_N_S_M2 = (500.0, 500.0, 300.0, 150.0, 60.0, 20.0, 0.0)
#: steps that are taken at once
_BLOCK = 8192
#: rows of the motion in a period of the fastest sampling, at least
_ROWS = 4
#: margins about the log for the interpolation in time [s], and step of the wheel angle's spline
_MARGIN_S, _ANGLE_STEP_S = 0.01, 1e-3


class RolledWorld(World):
    """One scenario with truth = "coupled_ring", rolled from begin to end.

    UsageError if the physics refuses it.
    """

    def __init__(self, scenario: Scenario, drive: TrueDrive, roughness: Fluctuation) -> None:
        super().__init__(scenario, drive, roughness)
        #: the drive as ordered, its angle the distance over the radius; `drive` has the wheel's own
        #: angle once it has rolled
        self._way = drive
        tire, radius = scenario.tire, scenario.tire.rolling_radius_m
        tension = scenario.conditions.inflation_pressure_Pa * tire.width_belt_m * radius
        self.belt = Belt(tire, tension, Splines(scenario.grid_points // 8))
        self.profile = profile_of(scenario.road, radius, float(self.distance(drive.time_s[-1:])[0]))
        self.belt.check_speed(float(drive.speed_at(drive.time_s).max()))
        self.standing = tire_at_rest(self.belt, float(self.load(np.zeros(1))[0]))
        #: the motion (k,) of MOMENT at `time_s` (k,), and of each riding sensor's belt, over the
        #: same times: its place beside the hub, backwards and upwards, and its strain, (3, k)
        self.time_s, self.motion, self.ridden = self._rolled()
        time = self.time_s
        grid = np.arange(time[0], time[-1], _ANGLE_STEP_S)
        self.drive = replace(drive, angle=CubicSpline(grid, self._at(grid, self.motion.angle_rad)))

    # ---- conditions ------------------------------------------------------------------------------

    def distance(self, time_s: FloatArray) -> FloatArray:
        """The hub's way forward from the log's start [m]."""
        return np.asarray(self._way.angle_at(time_s) * self._way.radius_m, float)

    def _orders(self, time_s: FloatArray) -> Records:
        """The drive at the steps, (n,) of DRIVE, with the distance at the steps' ends."""
        drive, tire = self._way, self.scenario.tire
        acceleration = np.where(
            (time_s >= 0.0) & (time_s <= drive.time_s[-1]), drive.acceleration_at(time_s), 0.0
        )
        load = self.load(time_s) * (1.0 + self.fluctuation(time_s))
        force = self.longitudinal_force(time_s)
        # a load that changes on the road needs the rest of the friction
        grip = 0.95 * tire.friction
        if np.any(np.abs(force) > grip * load):
            worst = float(np.abs(force).max())
            raise UsageError(
                f"the drive asks the wheel for {worst:.0f} N along the road",
                allowed=f"allowed is up to {grip:.2f} of its load",
                do="brake or drive more gently, or raise friction",
            )
        spun = tire.hub_inertia_kg_m2 + self.belt.mass_kg * self.belt.radius_m**2
        torque = force * self.belt.radius_m + spun * acceleration / self.belt.radius_m
        end = self.distance(time_s + self.scenario.step_s)
        orders = np.empty(time_s.size, DRIVE)
        orders["distance_m"], orders["acceleration_m_s2"] = end, acceleration
        orders["load_N"], orders["torque_N_m"] = load, torque
        return orders

    # ---- the roll --------------------------------------------------------------------------------

    def _rolled(self) -> tuple[FloatArray, Any, dict[str, FloatArray]]:
        """The motion from just before the log to just behind it, and every riding sensor's."""
        scenario, step = self.scenario, self.scenario.step_s
        riding = {name: s for name, s in scenario.channels.items() if s.kind in RIDING}
        early = max((scenario.late_s(s) for s in riding.values()), default=0.0)
        before = np.ceil((early + _MARGIN_S) / step) * step
        start = float(-before - SETTLING_S)
        speed = float(self._way.speed_at(np.array(start)))
        tire = RollingTire(
            self.belt,
            self.profile,
            self.standing,
            speed_m_s=speed,
            distance_m=float(self.distance(np.array(start))),
            step_s=step,
        )
        self._settle(tire, start)
        zero = float(tire.state["angle_rad"] + before * tire.state["spin_rad_s"])
        riders = tuple(self._rider(s, -zero - np.radians(s.angle_deg)) for s in riding.values())
        fastest = max(s.sampling_rate_Hz for s in scenario.channels.values())
        every = max(1, int(1.0 / (_ROWS * fastest * step)))
        steps = int((before + scenario.duration_s + _MARGIN_S) / step / every + 1) * every
        block = _BLOCK // every * every or every
        moments = np.empty(steps // every, MOMENT)
        read = np.empty((moments.size, sum(rider.shape[0] for rider in riders)))
        for first in range(0, steps, block):
            last = min(first + block, steps)
            moment = -before + step * np.arange(float(first), last)
            kept = slice(first // every, last // every)
            moments[kept], read[kept] = tire.run(self._orders(moment), every=every, riders=riders)
        moments["angle_rad"] -= zero
        times = -before + step * every * np.arange(moments.size)
        ridden = {}
        for k, (name, s) in enumerate(riding.items()):
            v, w, strain = read[:, 3 * k : 3 * k + 3].T
            phi = moments["angle_rad"] - np.radians(s.angle_deg)
            arm = self.belt.radius_m + w
            back, up = arm * np.sin(phi) + v * np.cos(phi), v * np.sin(phi) - arm * np.cos(phi)
            ridden[name] = np.stack([back, up, strain])
        return times, moments.view(np.recarray), ridden

    def _settle(self, tire: RollingTire, start_s: float) -> None:
        """Rolls for SETTLING_S, belt and hub quieted.

        The hub by a share of critical damping (its mass on the standing tire's spring).
        """
        scenario, step = self.scenario, self.scenario.step_s
        spring = scenario.conditions.load_N / max(self.belt.radius_m - self.standing[1], 1e-4)
        tire.damp_hub(
            float(HELD * 2.0 * np.sqrt(spring * (scenario.tire.hub_mass_kg + self.belt.mass_kg)))
        )
        parts = np.array_split(np.arange(float(round(SETTLING_S / step))), len(QUIETED_N_S_M2))
        for damping, part in zip(QUIETED_N_S_M2, parts, strict=True):
            tire.damp_belt(damping)
            tire.run(self._orders(np.asarray(start_s + step * part, float)), every=part.size)
        tire.damp_hub(scenario.vehicle.suspension_damping_N_s_m)

    def _rider(self, sensor: Record, angle_rad: float) -> FloatArray:
        """What reads the belt at one place.

        v, w = -v' and the strain -y (v' + v''')/R^2 (y towards the axle).
        """
        radius, splines = self.belt.radius_m, self.belt.splines
        gauge, _ = self.sensor_effects(sensor)
        length = gauge["length_m"] if gauge is not None else 0.0
        bent = -self.lever(sensor) / radius**2 if sensor.kind != "radial_acceleration" else 0.0
        strain = splines.functional(angle_rad, {1: bent, 3: bent}, length / radius)
        return np.stack(
            [
                splines.functional(angle_rad, {0: 1.0}),
                splines.functional(angle_rad, {1: -1.0}),
                strain,
            ]
        )

    # ---- what sensors read -----------------------------------------------------------------------

    def values(self, moments: Times) -> dict[str, FloatArray]:
        """Clean values in SI of the channels that feel the belt, at their `moments` (n,) [s].

        Those that ride on it, and the hub's forces.
        """
        out = {}
        for name, time in moments.items():
            sensor = self.scenario.channels[name]
            if sensor.kind == "radial_acceleration":
                out[name] = self._at(time, self._passed_on(self._outwards(name), sensor))
            elif sensor.kind in RIDING:
                strain = self._at(time, self._passed_on(self.ridden[name][2], sensor))
                out[name] = strain + self.baseline(time, sensor)
            elif sensor.kind == "vertical_load":
                out[name] = np.interp(time, self.time_s, self.motion.spindle_z_N)
            elif sensor.kind == "longitudinal_force":
                out[name] = np.interp(time, self.time_s, self.motion.spindle_x_N)
        return out

    def _at(self, time_s: FloatArray, series: FloatArray) -> FloatArray:
        """A series (k,) over the motion's rows at any times (n,), by the six rows around each."""
        begin, step = self.time_s[0], self.time_s[1] - self.time_s[0]
        place = (np.asarray(time_s, float) - begin) / step
        half = ANGLE_POINTS // 2
        row = np.clip(np.floor(place).astype(np.intp), half - 1, series.size - half - 1)
        total = np.zeros(place.size)
        for i, weight in enumerate(lagrange(place - row, ANGLE_POINTS)):
            total += weight * series[row + (i - half + 1)]
        return total

    def _outwards(self, name: str) -> FloatArray:
        """Acceleration minus gravity along the outward radius [m/s^2], (k,).

        By second differences of the place.
        """
        (back, up, _), step = self.ridden[name], self.time_s[1] - self.time_s[0]

        def bent(place: FloatArray) -> FloatArray:
            inside = (place[2:] - 2.0 * place[1:-1] + place[:-2]) / step**2
            return np.concatenate((inside[:1], inside, inside[-1:]))

        forward = self._way.acceleration_at(self.time_s)
        phi = self.motion.angle_rad - np.radians(self.scenario.channels[name].angle_deg)
        upwards = bent(up + self.motion.hub_z_m) + STANDARD_GRAVITY_M_S2
        return np.asarray((bent(back) - forward) * np.sin(phi) - upwards * np.cos(phi), float)

    def _passed_on(self, series: FloatArray, sensor: Record) -> FloatArray:
        """A series (k,) behind the instrument's first-order lag and within its bandwidth.

        The bandwidth is a second-order magnitude without delay.
        """
        _, lag = self.sensor_effects(sensor)
        if lag is None and sensor.bandwidth_Hz is None:
            return series
        tau = lag["lag_s"] if lag is not None else 0.0
        step = float(self.time_s[1] - self.time_s[0])
        size = 2 * series.size
        frequency = np.fft.rfftfreq(size, step)
        gain = 1.0 / (1.0 + 2j * np.pi * frequency * tau)
        if sensor.bandwidth_Hz is not None:
            gain = gain / np.sqrt(1.0 + (frequency / sensor.bandwidth_Hz) ** 4)
        # mirrored, so that the begin does not feel the end
        return np.asarray(
            np.fft.irfft(np.fft.rfft(np.concatenate((series, series[::-1]))) * gain, n=size)[
                : series.size
            ],
            float,
        )


# ---- The truth of a log whose tire moved.
#
# What holds at a sensor's passages, when obstacles were met, how the tire rings.
#
# Times are the log's own stamps; angles grow in the direction of rolling.


def truth_of_rolled(world: RolledWorld, pitch_rad: Mapping[str, FloatArray]) -> dict[str, Any]:
    """The whole truth of a log, with the table `coupled_ring`."""
    truth = steady_truth(world, pitch_rad, partial(_passages, world))
    return {**truth, "coupled_ring": moving(world)}


def _passages(world: RolledWorld, name: str, late: float) -> dict[str, FloatArray]:
    """True values at the sensor's passages under the axle, each (n,).

    `time_s` in the channel's own stamps.
    """
    sensor, motion = world.scenario.channels[name], world.motion
    back, up, _ = world.ridden[name]
    # the place passes the axle from ahead to behind: the row before, and share of its step
    row = np.flatnonzero((back[:-1] < 0.0) & (back[1:] >= 0.0) & (up[:-1] < 0.0))
    share = -back[row] / (back[row + 1] - back[row])
    time = world.time_s[row] + share * (world.time_s[row + 1] - world.time_s[row])
    inside = (time >= 0.0) & (time < world.scenario.duration_s - late)
    row, share, time = row[inside], share[inside], time[inside]

    def at(series: FloatArray) -> FloatArray:
        return np.asarray((1.0 - share) * series[row] + share * series[row + 1], float)

    speed, angle = world.drive.speed_at(time), at(motion.angle_rad)
    entry, exit_ = at(motion.entry_m), at(motion.exit_m)
    behind = angle - np.radians(sensor.angle_deg)
    radius = world.belt.radius_m
    return {
        "time_s": time + late,
        "speed_m_s": speed,
        "acceleration_m_s2": world.drive.acceleration_at(time),
        "load_N": at(motion.force_z_N),
        "longitudinal_force_N": at(motion.force_x_N),
        "slip": 1.0 - at(motion.spin_rad_s) * radius / np.maximum(speed, 1e-3),
        "contact_length_m": exit_ - entry,
        "entry_m": entry,
        "exit_m": exit_,
        "slip_onset_m": np.full(time.size, np.nan),
        "dissipation_factor_1_m": _dissipation(world, name, time),
        "wheel_angle_rad": angle,
        "phase_shift_deg": np.degrees(behind - 2.0 * np.pi * np.round(behind / (2.0 * np.pi))),
        "patch_width_deg": np.degrees((exit_ - entry) / radius),
    }


def _dissipation(world: RolledWorld, name: str, time_s: FloatArray) -> FloatArray:
    """int strain'^2 ds over the turn around each passage [1/m].

    NaN at the log's ends, and for an accelerometer.
    """
    motion = world.motion
    if world.scenario.channels[name].kind == "radial_acceleration":
        return np.full(time_s.size, np.nan)
    rate = np.gradient(world.ridden[name][2], world.time_s)
    way = np.maximum(motion.spin_rad_s, 1e-3) * world.belt.radius_m
    total = np.concatenate(([0.0], np.cumsum(rate[:-1] ** 2 / way[:-1] * np.diff(world.time_s))))
    middle = np.interp(time_s, world.time_s, motion.angle_rad)
    rising = np.maximum.accumulate(motion.angle_rad)
    ends = [
        np.interp(middle + turn, rising, total, left=np.nan, right=np.nan)
        for turn in (-np.pi, np.pi)
    ]
    return np.asarray(ends[1] - ends[0], float)


def moving(world: RolledWorld) -> dict[str, Any]:
    """The tire's vibrations and what the whole log did.

    Forces are means over the log, `contact_length_m` its median.
    """
    motion, scenario = world.motion, world.scenario
    logged = (world.time_s >= 0.0) & (world.time_s <= scenario.duration_s)
    time = world.time_s[logged]
    turned = float(np.ptp(motion.angle_rad[logged]))
    way = float(world.distance(time[-1]) - world.distance(time[0]))
    load = world.load(time) * (1.0 + world.fluctuation(time))
    return {
        "step_s": scenario.step_s,
        "elements": world.belt.splines.elements,
        "natural_frequencies_at_rest": world.belt.natural_frequencies(),
        "load_applied_N": float(load.mean()),
        "load_carried_N": float(motion.force_z_N[logged].mean()),
        "longitudinal_force_N": float(motion.force_x_N[logged].mean()),
        "contact_length_m": float(np.nanmedian(motion.exit_m[logged] - motion.entry_m[logged])),
        "standing_contact_length_m": world.standing[2],
        "effective_rolling_radius_m": way / turned if turned > 2.0 * np.pi else None,
        "obstacles": _obstacles(world),
    }


def _obstacles(world: RolledWorld) -> list[dict[str, float | None]]:
    """Each cleat or step that the axle passed over, and when."""
    road = world.scenario.road
    if road.kind not in ("step", "cleat"):
        return []
    driven = float(world.distance(np.array([world.scenario.duration_s]))[0])
    way = world.distance(world.time_s)
    places = [float(place) for place in begins(road, driven) if place < driven]
    return [
        {"position_m": place, "under_axle_s": float(np.interp(place, way, world.time_s))}
        for place in places
    ]
