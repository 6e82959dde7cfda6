"""What a coupled ring is driven over, put together from events, and its passage as rows of a table.

road, speed, load, load steps, speed ramps --`course_of`--> Course --`transient.drive`--> Transient
--`passage_columns`--> a row per sensor and time
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.data.setup import RoadSetup
from tirelog.errors import UsageError
from tirelog.physics.moving.road import road_of
from tirelog.physics.moving.transient import Course, Schedule, Transient

#: Where an obstacle begins that names no place [m], and how long is driven after it [s]. Twice as
#: much drives that much longer.
_AHEAD_M = 0.5
_AFTER_S = 0.5
#: a step of the load takes so long [s]: far less than a step of the motion; twice as long is still
#: a hundredth of it at most
_STEP_S = 1e-6


def course_of(
    road: RoadSetup,
    folder: Path | None,
    speed_m_s: float,
    load_N: float,
    loads: Sequence[tuple[float, float]] = (),
    ramps: Sequence[tuple[float, float, float]] = (),
    duration_s: float | None = None,
) -> Course:
    """The course of a drive that begins at `speed_m_s` under `load_N`.

    folder      where a road profile's file lies
    loads       (time [s], load [N]) of each step; ramps (from [s], to [s], speed [m/s]) of each
                change of speed; in the order of time
    duration_s  None: half a second past the last event
    UsageError  nothing to drive, or more than 100 s
    """
    at = _AHEAD_M if road.position_m is None else road.position_m
    if road.time_s is not None:
        at = road.time_s * speed_m_s
    load, speed = _stepped(load_N, loads), _ramped(speed_m_s, ramps)
    if duration_s is None:
        reached = at / speed_m_s if road.kind != "flat" and speed_m_s > 0.0 else 0.0
        duration_s = max(reached, load.time_s[-1], speed.time_s[-1]) + _AFTER_S
    if not 0.0 < duration_s <= 100.0:
        raise UsageError(
            f"{duration_s:g} s to drive",
            allowed="above zero and up to 100 s is allowed",
            do="give --duration or a nearer obstacle",
        )
    return Course(speed, load, road_of(road, at, folder=folder), duration_s)


def _stepped(load_N: float, loads: Sequence[tuple[float, float]]) -> Schedule:
    times, values = [0.0], [load_N]
    for time, value in loads:
        times += [time, time + _STEP_S]
        values += [values[-1], value]
    return Schedule(tuple(times), tuple(values))


def _ramped(speed_m_s: float, ramps: Sequence[tuple[float, float, float]]) -> Schedule:
    times, values = [0.0], [speed_m_s]
    for begin, end, value in ramps:
        times += [begin, end]
        values += [values[-1], value]
    return Schedule(tuple(times), tuple(values))


def passage_columns(transient: Transient, sensors_deg: list[float], surface: str) -> dict[str, Any]:
    """The table's columns: the passage once for each sensor.

    Sensors stand at `sensors_deg` on the belt ahead of the patch centre at the start.
    """
    m, course = transient.motion, transient.course
    speed = np.array([course.speed_m_s(t) for t in m.time_s])
    passage = {
        "time_s": m.time_s,
        "distance_m": np.concatenate(
            [[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(m.time_s))]
        )
        + speed[0] * m.time_s[0],
        "speed_m_s": speed,
        "load_N": np.array([course.load_N(t) for t in m.time_s]),
        "wheel_angle_deg": np.degrees(m.psi_rad),
        "hub_displacement_m": m.hub_z_m - m.hub_z_m[0],
        "road_vertical_N": m.force_z_N,
        "road_longitudinal_N": m.force_s_N,
        "spindle_vertical_N": m.spindle_z_N,
        "spindle_longitudinal_N": m.spindle_s_N,
    }
    size = m.time_s.size
    columns: dict[str, Any] = {"sensor_deg": np.repeat(np.asarray(sensors_deg, float), size)}
    columns |= {name: np.tile(values, len(sensors_deg)) for name, values in passage.items()}
    for name, observable in (
        ("strain", "strain"),
        ("radial_acceleration_m_s2", "radial_acceleration"),
    ):
        readings = [
            transient.sensed(observable, np.radians(angle), surface=surface)
            for angle in sensors_deg
        ]
        columns[name] = np.concatenate(readings)
    return columns
