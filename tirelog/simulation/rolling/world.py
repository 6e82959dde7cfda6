"""The world of a tire in motion.

The drive as impulses on the hub, the belt stepped through the whole log, and what sensors read of
it.

    Drive, [[load_steps]], roughness --> distance, acceleration, load, torque at every step
        --RollingTire--> Motion on its own clock
    Motion --a sensor's place, second differences, lag, bandwidth--> its clean series
        --spline in time--> values at the moments of sampling

The drive's speed is the hub's way forward; wheel angle and spin are what the tire makes of it. The
log begins on a tire that has rolled for SETTLING_S under a damper that is then taken away.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from tirelog.errors import UsageError
from tirelog.simulation.rolling.belt import Belt, Splines
from tirelog.simulation.rolling.step_kernel import DRIVE, MOMENT
from tirelog.simulation.rolling.tire import RollingTire, begins, profile_of, tire_at_rest
from tirelog.simulation.scenario.drive import Fluctuation, TrueDrive
from tirelog.simulation.scenario.schema import Scenario, Sensor
from tirelog.simulation.sensors.sampling import RIDING, Times, lagrange
from tirelog.simulation.simulate import steady_truth
from tirelog.simulation.steady.waveforms import World
from tirelog.vocabulary.arrays import FloatArray, Records
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2

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
#: rows of the motion that its interpolation in time takes
ROW_POINTS = 6
#: margins about the log for the interpolation in time [s], and step of the wheel angle's spline
_MARGIN_S, _ANGLE_STEP_S = 0.01, 1e-3
#: share of the friction that a drive may ask for; the rest is left to a load that changes on the
#: road
_GRIP = 0.95


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

    def load(self, time_s: FloatArray) -> FloatArray:
        """Load [N] without the road's roughness: as of other truths, with the scenario's steps."""
        load, steps = super().load(time_s), self.scenario.load_steps
        ordered = np.full(np.shape(time_s), self.scenario.conditions.load_N)
        for step in steps:
            share = np.clip((time_s - step.time_s) / step.rise_s, 0.0, 1.0)
            ordered = ordered + (step.load_N - ordered) * (0.5 - 0.5 * np.cos(np.pi * share))
        return np.asarray(load * ordered / self.scenario.conditions.load_N)

    def distance(self, time_s: FloatArray) -> FloatArray:
        """The hub's way forward from the log's start [m]."""
        return np.asarray(self._way.angle_at(time_s) * self._way.radius_m, float)

    def fluctuation(self, time_s: FloatArray) -> FloatArray:
        if not self.scenario.road.roughness:
            return np.zeros_like(time_s)
        return self.roughness(self.distance(time_s))

    def _orders(self, time_s: FloatArray) -> Records:
        """The drive at the steps, (n,) of DRIVE, with the distance at the steps' ends."""
        drive, tire = self._way, self.scenario.tire
        acceleration = np.where(
            (time_s >= 0.0) & (time_s <= drive.time_s[-1]), drive.acceleration_at(time_s), 0.0
        )
        load = self.load(time_s) * (1.0 + self.fluctuation(time_s))
        force = self.longitudinal_force(time_s)
        if np.any(np.abs(force) > _GRIP * tire.friction * load):
            worst = float(np.abs(force).max())
            raise UsageError(
                f"the drive asks the wheel for {worst:.0f} N along the road",
                allowed=f"allowed is up to {_GRIP * tire.friction:.2f} of its load",
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
        early = max((scenario.late_s(s) + 8.0 * s.jitter_s for s in riding.values()), default=0.0)
        before = np.ceil((early + _MARGIN_S) / step) * step
        behind = max((8.0 * s.jitter_s for s in riding.values()), default=0.0) + _MARGIN_S
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
        steps = int((before + scenario.duration_s + behind) / step / every + 1) * every
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

    def _rider(self, sensor: Sensor, angle_rad: float) -> FloatArray:
        """What reads the belt at one place.

        v, w = -v' and the strain -y (v' + v''')/R^2 (y towards the axle).
        """
        radius, splines = self.belt.radius_m, self.belt.splines
        gauge = self._sensor_effects(sensor)[0] or 0.0
        length = gauge if isinstance(gauge, float) else gauge["length_m"]
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
        row = np.clip(
            np.floor(place).astype(np.intp), ROW_POINTS // 2 - 1, series.size - ROW_POINTS // 2 - 1
        )
        total = np.zeros(place.size)
        for i, weight in enumerate(lagrange(place - row, ROW_POINTS)):
            total += weight * series[row + (i - ROW_POINTS // 2 + 1)]
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

    def _passed_on(self, series: FloatArray, sensor: Sensor) -> FloatArray:
        """A series (k,) behind the instrument's first-order lag and within its bandwidth.

        The bandwidth is a second-order magnitude without delay.
        """
        _, lag = self._sensor_effects(sensor)
        if lag is None and sensor.bandwidth_Hz is None:
            return series
        tau = 0.0 if lag is None else lag if isinstance(lag, float) else lag["lag_s"]
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
    """The whole truth of a log: that of other truths, and `coupled_ring`."""
    truth = steady_truth(world, pitch_rad, partial(_passages, world))
    return {
        **truth,
        "load_steps": [asdict(step) for step in world.scenario.load_steps],
        "coupled_ring": moving(world),
    }


def _passages(world: RolledWorld, name: str, late: float) -> dict[str, FloatArray]:
    """What is true when the sensor's place passes under the axle, each (n,).

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
    fastest = float(world.drive.speed_at(time).max())
    return {
        "step_s": scenario.step_s,
        "elements": world.belt.splines.elements,
        "natural_frequencies_at_rest": world.belt.natural_frequencies(),
        "travelling_waves_on_held_hub": {
            "speed_m_s": fastest,
            "waves": travelling_waves(world, fastest),
        },
        "load_applied_N": float(load.mean()),
        "load_carried_N": float(motion.force_z_N[logged].mean()),
        "longitudinal_force_N": float(motion.force_x_N[logged].mean()),
        "contact_length_m": float(np.nanmedian(motion.exit_m[logged] - motion.entry_m[logged])),
        "standing_contact_length_m": world.standing[2],
        "effective_rolling_radius_m": way / turned if turned > 2.0 * np.pi else None,
        "obstacles": _obstacles(world),
    }


def travelling_waves(world: RolledWorld, speed_m_s: float) -> list[dict[str, float | str]]:
    """The belt's waves of 1 to 6 lobes on a held hub at a speed.

    What the belt feels, and what an observer beside the tire hears [Hz].
    """
    spin = speed_m_s / world.belt.radius_m
    values, shapes = world.belt.coarse.vibrations(spin)
    waves: list[dict[str, float | str]] = []
    for value, shape in zip(values, shapes.T, strict=True):
        # shape times e^(i omega t), omega > 0: a harmonic e^(i n theta) of negative n runs towards
        # growing theta
        power = np.abs(np.fft.fft(shape)) ** 2
        number = np.fft.fftfreq(shape.size, 1.0 / shape.size)
        lobes = int(number[np.argmax(power)])
        if value.imag <= 0.0 or not 1 <= abs(lobes) <= 6:
            continue
        heard = value.imag - lobes * spin
        entry = {
            "lobes": abs(lobes),
            "felt_Hz": value.imag / (2 * np.pi),
            "heard_Hz": abs(heard) / (2 * np.pi),
            "decay_1_s": -value.real,
        }
        waves.append(
            {
                **{k: float(f"{v:.8g}") for k, v in entry.items()},
                "direction": "with" if lobes * heard < 0 else "against",
            }
        )
    return sorted(waves, key=lambda wave: (wave["lobes"], wave["felt_Hz"]))


def _obstacles(world: RolledWorld) -> list[dict[str, float | None]]:
    """Each cleat or step, as it was met."""
    road = world.scenario.road
    if road.kind not in ("step", "cleat"):
        return []
    driven = float(world.distance(np.array([world.scenario.duration_s]))[0])
    return [_met(world, float(place)) for place in begins(road, driven) if place < driven]


def _met(world: RolledWorld, place_m: float) -> dict[str, float | None]:
    """When a cleat or step is first touched, when its begin is under the axle, when it is left.

    And the largest force meanwhile.
    """
    motion, road = world.motion, world.scenario.road
    corner = world.profile.corner_m
    length = float((road.length_m or 0.0) if road.kind == "cleat" else corner[1] - corner[0])
    way = world.distance(world.time_s)
    met = (way - motion.entry_m > place_m) & (way - motion.exit_m < place_m + length)
    rows = np.flatnonzero(met)
    over = way[-1] > place_m > way[0]
    out: dict[str, float | None] = {
        "position_m": place_m,
        "touched_s": float(world.time_s[rows[0]]) if rows.size else None,
        "under_axle_s": float(np.interp(place_m, way, world.time_s)) if over else None,
        "left_s": float(world.time_s[rows[-1]])
        if rows.size and rows[-1] < world.time_s.size - 1
        else None,
        "largest_force_N": float(motion.force_z_N[rows].max()) if rows.size else None,
    }
    return {key: value if value is None else float(f"{value:.10g}") for key, value in out.items()}
