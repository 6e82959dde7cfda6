"""`tirelog model predict --road | --load-step | --speed-ramp`.

A coupled ring driven in time, as a table:

    words of the options --`course_of`--> Course --physics--> Transient
        --`rows`--> a row per sensor and time
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from tirelog.data.setup import RoadSetup, Setup
    from tirelog.physics.moving.transient import Course, Schedule, Transient

#: Where an obstacle begins that names no place [m], and how long is driven after it [s].
_AHEAD_M = 0.5
_AFTER_S = 0.5


def road_words(words: str, setup: Setup | None) -> RoadSetup:
    """The road of --road: in words, or `setup` for the setup's [road]."""
    from tirelog.data.setup import parse_road
    from tirelog.errors import UsageError

    if words != "setup":
        return parse_road(words)
    if setup is None or setup.road.kind == "flat":
        raise UsageError(
            "--road setup, and the setup has no [road]; a road in words is allowed, such as "
            "cleat,height_m=0.01,length_m=0.04"
        )
    return setup.road


def course_of(
    road: RoadSetup,
    folder: Path | None,
    speed_m_s: float,
    load_N: float,
    loads: list[str],
    ramps: list[str],
    duration_s: float | None,
) -> Course:
    """The course that the options describe; UsageError and ModelError for words that are none."""
    from tirelog.errors import UsageError
    from tirelog.physics.moving.road import road_of
    from tirelog.physics.moving.transient import Course

    at = _AHEAD_M if road.position_m is None else road.position_m
    if road.time_s is not None:
        at = road.time_s * speed_m_s
    load, speed = _load(load_N, loads), _speed(speed_m_s, ramps)
    if duration_s is None:
        reached = at / speed_m_s if road.kind != "flat" and speed_m_s > 0.0 else 0.0
        duration_s = max(reached, load.time_s[-1], speed.time_s[-1]) + _AFTER_S
    if not 0.0 < duration_s <= 100.0:
        raise UsageError(
            f"{duration_s:g} s to drive; above zero and up to 100 s is allowed; give --duration "
            "or a nearer obstacle"
        )
    return Course(speed, load, road_of(road, at, folder=folder), duration_s)


def _load(load_N: float, words: list[str]) -> Schedule:
    """--load-step TIME:LOAD, one after the other."""
    from tirelog.physics.moving.transient import Schedule

    times, values = [0.0], [load_N]
    for text in words:
        time, value = _numbers(text, "--load-step", "TIME:LOAD", 2)
        _later("--load-step", text, time, times[-1])
        times += [time, time + 1e-6]
        values += [values[-1], value]
    return Schedule(tuple(times), tuple(values))


def _speed(speed_m_s: float, words: list[str]) -> Schedule:
    """--speed-ramp FROM:TO:SPEED, one after the other."""
    from tirelog.physics.moving.transient import Schedule

    times, values = [0.0], [speed_m_s]
    for text in words:
        begin, end, value = _numbers(text, "--speed-ramp", "FROM:TO:SPEED", 3)
        _later("--speed-ramp", text, begin, times[-1])
        _later("--speed-ramp", text, end, begin)
        times += [begin, end]
        values += [values[-1], value]
    return Schedule(tuple(times), tuple(values))


def _numbers(text: str, option: str, form: str, count: int) -> list[float]:
    from math import isfinite

    from tirelog.errors import UsageError

    try:
        numbers = [float(part) for part in text.split(":")]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(isfinite(x) for x in numbers):
        raise UsageError(f"{option} {text}; {form} in s and SI units is allowed; correct it")
    return numbers


def _later(option: str, text: str, time_s: float, before_s: float) -> None:
    from tirelog.errors import UsageError

    if time_s < before_s:
        raise UsageError(
            f"{option} {text} goes back in time; times that grow, from 0 s on, are allowed; "
            "correct it"
        )


def rows(transient: Transient, sensors_deg: list[float], surface: str) -> dict[str, Any]:
    """The table's columns: the passage once for each sensor, at `sensors_deg` on the belt ahead of
    the patch centre at the start.
    """
    import numpy as np

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
