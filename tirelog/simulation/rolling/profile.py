"""The road's profile under a tire in motion.

`[road]` becomes corners between which the road is straight, or a wave.

    Road (scenario) --profile_of--> Profile: height and slope at any distance x [m] driven since the
                                    log's start, level before it

A wall has no slope for the tread to press along: steps and cleats have ramps, and what is too steep
or too high for small displacements of the belt is refused.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tirelog.errors import UsageError
from tirelog.simulation.scenario.schema import Road
from tirelog.storage.remote import open_input
from tirelog.storage.whole import taken_as_input
from tirelog.vocabulary.arrays import FloatArray

#: steepest slope of a road [m/m]; twice as steep asks for tread points half as far apart
STEEPEST = 3.0
#: highest rise within one diameter of the tire, over its radius; twice as much would double the
#: strain that a linear belt takes for small
HIGHEST = 0.2
#: ramp of a step or cleat that names none, as far as its length and the steepest slope allow [m]
RAMP_M = 0.01


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
        return _read(Path(road.file))
    height = _needed(road, "height_m")[0]
    ramp = road.ramp_m or max(RAMP_M, 1.01 * abs(height) / STEEPEST)
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


def _read(path: Path) -> tuple[FloatArray, FloatArray]:
    """Two columns of text, distance and height [m], comma or blanks between, # begins a remark."""
    try:
        taken_as_input(path)
        with open_input(path) as stream:
            text = stream.read().decode()
    except (OSError, UnicodeDecodeError) as problem:
        raise UsageError(
            f"the road's profile cannot be read ({problem})",
            allowed="allowed is a text file",
            do="mend the [road]'s file",
            file=path,
        ) from None
    points = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#")[0].replace(",", " ").split()
        if not words:
            continue
        try:
            distance, height = (float(word) for word in words)
        except ValueError:
            distance = height = np.nan
        if not (np.isfinite(distance) and np.isfinite(height)):
            advice = "allowed are a distance and a height in m; mend it"
            raise UsageError(
                f"{line.strip()!r} is no point of a road", do=f"{advice}", file=path, line=number
            )
        points.append((distance, height))
    if len(points) < 2:
        raise UsageError(
            "a road of fewer than two points",
            allowed="allowed are two or more",
            do="add some",
            file=path,
        )
    corner, height = np.array(points).T
    if np.any(np.diff(corner) <= 0.0):
        raise UsageError(
            "distances of the road do not grow",
            allowed="allowed are growing ones, one height each",
            do="sort the rows",
            file=path,
        )
    return corner, height


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
