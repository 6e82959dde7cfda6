"""What `tirelog model predict --road | --load-step | --speed-ramp` is given, as numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tirelog.data.setup import RoadSetup, Setup


def road_words(words: str, setup: Setup | None) -> RoadSetup:
    """The road of --road: in words, or `setup` for the setup's [road]."""
    from tirelog.data.setup import parse_road
    from tirelog.errors import UsageError

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
    from math import isfinite

    from tirelog.errors import UsageError

    try:
        numbers = [float(part) for part in text.split(":")]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(isfinite(x) for x in numbers):
        raise UsageError(
            f"{option} {text}", allowed=f"{form} in s and SI units is allowed", do="correct it"
        )
    return numbers


def _later(option: str, text: str, time_s: float, before_s: float) -> None:
    from tirelog.errors import UsageError

    if time_s < before_s:
        raise UsageError(
            f"{option} {text} goes back in time",
            allowed="times that grow, from 0 s on, are allowed",
            do="correct it",
        )
