"""Conditions and drives as options of `tirelog model predict` give them, as numbers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from tirelog.errors import UsageError

if TYPE_CHECKING:
    from tirelog.data.recording import Conditions
    from tirelog.data.setup import RoadSetup, Setup

#: revolutions that one command computes, and rows that it writes of them; twice as many rows take
#: twice the memory, some 500 MB
MOST, MOST_ROWS = 2000, 2_100_000
_FIELDS = {
    "speed": "speed_m_s",
    "load": "load_N",
    "pressure": "inflation_pressure_Pa",
    "acceleration": "acceleration_m_s2",
    "slip": "slip",
}


def values_of(text: str, option: str) -> list[float]:
    """The values that an option gives.  UsageError: words that are none."""
    try:
        numbers = [float(part) for part in text.split(":" if ":" in text else ",")]
        if all(map(math.isfinite, numbers)) and len(numbers) <= MOST:
            if ":" not in text:
                return numbers
            low, high, step = numbers
            count = math.floor((high - low) / step + 1e-9) + 1
            if 1 <= count <= MOST:
                return [low + i * step for i in range(count)]
    except (ValueError, ZeroDivisionError, OverflowError):
        pass
    raise UsageError(
        f"{option} {text}",
        allowed=f"allowed are a number, several with commas, or FROM:TO:STEP, {MOST} at most",
        do=f"write {option} 20, {option} 10,20 or {option} 5:25:5",
    )


def refuse_many(conditions: int, points: int) -> None:
    """UsageError for more rows than memory is meant for: so many `points` of each condition."""
    rows = conditions * points
    if rows > MOST_ROWS:
        raise UsageError(
            f"{rows} rows",
            allowed=f"{MOST_ROWS} are allowed in one command",
            do="ask for fewer --points or conditions at once",
        )


def conditions_given(
    setup: Setup | None, more: Mapping[str, float | None], **options: str | None
) -> Conditions:
    """Each value of each option with each of the others, and what the setup knows besides.

    UsageError: no number, one that no tire is driven under, or more than MOST of them together.
    """
    from tirelog.api.models import conditions_of

    given = {
        _FIELDS[name]: values_of(text, f"--{name}")
        for name, text in options.items()
        if text is not None
    }
    count = math.prod(len(values) for values in given.values())
    if count > MOST:
        raise UsageError(
            f"{count} conditions",
            allowed=f"{MOST} are allowed in one command",
            do="ask for fewer values at once",
        )
    other = {name: value for name, value in more.items() if value is not None}
    called = {_FIELDS[name]: f"--{name}" for name in options} | {
        "time_s": "--time",
        "temperature_K": "--temperature",
    }
    return conditions_of(given, setup, called=called, **other)


def road_words(words: str, setup: Setup | None) -> RoadSetup:
    """The road of --road: in words, or `setup` for the setup's [road]."""
    from tirelog.data.setup import parse_road

    if words != "setup":
        return parse_road(words)
    if setup is None or setup.road.kind == "flat":
        raise UsageError(
            "--road setup, and the setup has no [road]",
            allowed="a road in words is allowed, such as cleat,height_m=0.01,length_m=0.04",
        )
    return setup.road


def load_steps(words: list[str]) -> list[tuple[float, float]]:
    """(time [s], load [N]) of each --load-step TIME:LOAD.  UsageError: words that are none."""
    steps: list[tuple[float, float]] = []
    before = 0.0
    for text in words:
        time, load = _numbers(text, "--load-step", "TIME:LOAD", 2)
        _later("--load-step", text, time, before)
        before = time + 1e-6  # a step takes a moment
        steps.append((time, load))
    return steps


def speed_ramps(words: list[str]) -> list[tuple[float, float, float]]:
    """(from [s], to [s], speed [m/s]) of each --speed-ramp FROM:TO:SPEED.

    UsageError: words that are none.
    """
    ramps: list[tuple[float, float, float]] = []
    before = 0.0
    for text in words:
        begin, end, speed = _numbers(text, "--speed-ramp", "FROM:TO:SPEED", 3)
        _later("--speed-ramp", text, begin, before)
        _later("--speed-ramp", text, end, begin)
        before = end
        ramps.append((begin, end, speed))
    return ramps


def _numbers(text: str, option: str, form: str, count: int) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(":")]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise UsageError(
            f"{option} {text}", allowed=f"{form} in s and SI units is allowed", do="correct it"
        )
    return numbers


def _later(option: str, text: str, time_s: float, before_s: float) -> None:
    if time_s < before_s:
        raise UsageError(
            f"{option} {text} goes back in time",
            allowed="times that grow, from 0 s on, are allowed",
            do="correct it",
        )
