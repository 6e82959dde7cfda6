"""The road's profile under a tire in motion: `[road] kind` becomes corners between which the road is straight, or a wave.

    Road (scenario) --profile_of--> Profile: height and slope at any distance x [m] driven since the log's start, level before it

A wall has no slope for the tread to press along: steps and cleats have ramps, and what is too steep or too high for small displacements
of the belt is refused.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tirelog.errors import UsageError
from tirelog.simulation.scenario import Road

FloatArray = NDArray[np.float64]

STEEPEST = 3.0
#: highest rise within one diameter of the tire, over its radius
HIGHEST = 0.2


@dataclass(frozen=True)
class Profile:
    """`corner_m`, `height_m` (n,) a broken line, level outside; plus amplitude (1 - cos(2 pi x/wavelength)) from x = 0 on."""

    corner_m: FloatArray
    height_m: FloatArray
    amplitude_m: float = 0.0
    wavelength_m: float = 1.0

    @property
    def top_m(self) -> float:
        return float(self.height_m.max()) + 2.0 * max(self.amplitude_m, 0.0)


def profile_of(road: Road, radius_m: float) -> Profile:
    """The scenario's profile.  UsageError for one that a tire of this radius cannot roll over."""
    if road.kind == "sine":
        return _checked_sine(road, radius_m)
    if road.kind == "file":
        corner, height = _read(Path(road.file))
    elif road.kind in ("cleat", "step"):
        corner, height = _bars(road) if road.kind == "cleat" else _steps(road)
    else:
        corner, height = np.array([0.0, 1.0]), np.zeros(2)
    if np.any(np.diff(corner) <= 0.0):
        raise UsageError("places of the [road] overlap or do not grow; allowed are growing distances; move them apart")
    _check(corner, height, radius_m)
    return Profile(corner, height)


def _places(road: Road) -> FloatArray:
    if not road.at_m:
        raise UsageError(f'[road] kind = "{road.kind}" without a place; allowed is at_m = 20.0, or a list of distances in m; add it')
    return np.sort(np.asarray(road.at_m, float))


def _bars(road: Road) -> tuple[FloatArray, FloatArray]:
    """Bars that begin at every `at_m`: `width_m` at the foot, a ramp on either side."""
    if not 0.0 < road.ramp_m < 0.5 * road.width_m:
        raise UsageError(f"ramp_m = {road.ramp_m:g} of a cleat; allowed is above zero and below half of its width_m; mend it")
    foot = np.array([0.0, road.ramp_m, road.width_m - road.ramp_m, road.width_m])
    corner = (_places(road)[:, None] + foot).ravel()
    return corner, np.tile([0.0, road.height_m, road.height_m, 0.0], len(road.at_m))


def _steps(road: Road) -> tuple[FloatArray, FloatArray]:
    """The level changes by `height_m` at every `at_m`."""
    if not road.ramp_m > 0.0:
        raise UsageError("ramp_m = 0 of a step; allowed is above zero (the tread presses along the road's normal); give the step a ramp")
    places = _places(road)
    levels = road.height_m * np.arange(places.size + 1)
    return np.stack([places, places + road.ramp_m], axis=1).ravel(), np.repeat(levels, 2)[1:-1]


def _read(path: Path) -> tuple[FloatArray, FloatArray]:
    """Two columns of text, distance and height [m], comma or blanks between, # begins a remark."""
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise UsageError(f"the road's profile cannot be read ({problem}); allowed is a text file; mend [road] file", file=path) from None
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
            raise UsageError(f"{line.strip()!r} is no point of a road; {advice}", file=path, line=number)
        points.append((distance, height))
    if len(points) < 2:
        raise UsageError("a road of fewer than two points; allowed are two or more; add some", file=path)
    corner, height = np.array(points).T
    return corner, height


def _check(corner: FloatArray, height: FloatArray, radius_m: float) -> None:
    slope = float(np.abs(np.diff(height) / np.diff(corner)).max())
    if slope > STEEPEST:
        raise UsageError(f"a road with a slope of {slope:.3g}; allowed is up to {STEEPEST:g}; give it a longer ramp")
    # the highest rise within a window stands in one that begins or ends at a corner
    for begin in (corner, corner - 2.0 * radius_m):
        first, end = (np.searchsorted(corner, x, side="left") for x in (begin, begin + 2.0 * radius_m))
        edges = np.stack([np.interp(begin, corner, height), np.interp(begin + 2.0 * radius_m, corner, height)], axis=1)
        for i, j, edge in zip(first, end, edges, strict=True):
            _check_rise(float(np.ptp(np.append(edge, height[i:j]))), radius_m)


def _check_rise(rise_m: float, radius_m: float) -> None:
    if rise_m > HIGHEST * radius_m:
        raise UsageError(
            f"a road that rises {rise_m:.3g} m within one diameter of the tire; allowed is up to {HIGHEST * radius_m:.3g} m for a "
            f"radius of {radius_m:.3g} m; give a lower obstacle"
        )


def _checked_sine(road: Road, radius_m: float) -> Profile:
    if not (road.wavelength_m > 0.0 and road.amplitude_m != 0.0):
        raise UsageError('[road] kind = "sine" without its wave; allowed are amplitude_m and wavelength_m above zero; add them')
    slope = abs(road.amplitude_m) * 2.0 * np.pi / road.wavelength_m
    if slope > STEEPEST:
        raise UsageError(f"a road with a slope of {slope:.3g}; allowed is up to {STEEPEST:g}; give a longer wave")
    if road.wavelength_m < 4.0 * radius_m:
        _check_rise(2.0 * abs(road.amplitude_m), radius_m)
    return Profile(np.array([0.0, 1.0]), np.zeros(2), road.amplitude_m, road.wavelength_m)
