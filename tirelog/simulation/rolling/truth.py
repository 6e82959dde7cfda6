"""The truth of a log whose tire moved.

What holds at a sensor's passages, when obstacles were met, how the tire rings.

Times are the log's own stamps; angles grow in the direction of rolling.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.simulation.rolling.tire import begins
from tirelog.simulation.rolling.world import RolledWorld
from tirelog.simulation.steady.truth import steady_truth
from tirelog.vocabulary.arrays import FloatArray


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
    sensor, motion, ridden = world.scenario.channels[name], world.motion, world.ridden[name]
    row, share = _under_axle(ridden.s_m, ridden.z_m)
    time = motion.time_s[row] + share * (motion.time_s[row + 1] - motion.time_s[row])
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


def _under_axle(s_m: FloatArray, z_m: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
    """(row before each passage of the axle, share of that row's step to it).

    The place passes the axle from ahead to behind.
    """
    row = np.flatnonzero((s_m[:-1] < 0.0) & (s_m[1:] >= 0.0) & (z_m[:-1] < 0.0))
    return row, -s_m[row] / (s_m[row + 1] - s_m[row])


def _dissipation(world: RolledWorld, name: str, time_s: FloatArray) -> FloatArray:
    """int strain'^2 ds over the turn around each passage [1/m].

    NaN at the log's ends, and for an accelerometer.
    """
    motion = world.motion
    if world.scenario.channels[name].kind == "radial_acceleration":
        return np.full(time_s.size, np.nan)
    rate = np.gradient(world.ridden[name].strain, motion.time_s)
    way = np.maximum(motion.spin_rad_s, 1e-3) * world.belt.radius_m
    total = np.concatenate(([0.0], np.cumsum(rate[:-1] ** 2 / way[:-1] * np.diff(motion.time_s))))
    middle = np.interp(time_s, motion.time_s, motion.angle_rad)
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
    logged = (motion.time_s >= 0.0) & (motion.time_s <= scenario.duration_s)
    time = motion.time_s[logged]
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
        "standing_contact_length_m": world.standing.contact_length_m,
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
    road = world.scenario.road
    if road.kind not in ("step", "cleat"):
        return []
    driven = float(world.distance(np.array([world.scenario.duration_s]))[0])
    return [_met(world, float(place)) for place in begins(road, driven) if place < driven]


def _met(world: RolledWorld, place_m: float) -> dict[str, float | None]:
    """One cleat or step, as it was met.

    When it is first touched, when its begin is under the axle, when it is left; the largest force
    meanwhile.
    """
    motion, road = world.motion, world.scenario.road
    corner = world.profile.corner_m
    length = float((road.length_m or 0.0) if road.kind == "cleat" else corner[1] - corner[0])
    way = world.distance(motion.time_s)
    met = (way - motion.entry_m > place_m) & (way - motion.exit_m < place_m + length)
    rows = np.flatnonzero(met)
    over = way[-1] > place_m > way[0]
    out: dict[str, float | None] = {
        "position_m": place_m,
        "touched_s": float(motion.time_s[rows[0]]) if rows.size else None,
        "under_axle_s": float(np.interp(place_m, way, motion.time_s)) if over else None,
        "left_s": float(motion.time_s[rows[-1]])
        if rows.size and rows[-1] < motion.time_s.size - 1
        else None,
        "largest_force_N": float(motion.force_z_N[rows].max()) if rows.size else None,
    }
    return {key: value if value is None else float(f"{value:.10g}") for key, value in out.items()}
