"""The road under a moving tire, of a model and of a simulated one: height and slope of the way.

    RoadSetup (a log's [road], a scenario's, or words of a command) --`road_of`--> RoadProfile

Heights are over `x` [m], the distance in the direction of driving, shapes as asked. Every profile
is continuous: a step and a cleat have a ramp, since tread that presses along the road's normal has
no answer to a wall. What is steeper than `STEEPEST` is refused, and `check_climbable` refuses what
is higher than the tire can climb.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from tirelog.errors import ModelError
from tirelog.storage.schema import Record
from tirelog.storage.whole import LARGEST_BYTES, bounded_input
from tirelog.vocabulary.arrays import FloatArray

#: Steepest slope [m/m] of a ramp. Twice as steep asks for nodes half as far apart to see a ramp as
#: well.
STEEPEST = 3.0
#: Largest rise within one tire diameter, as a share of the radius: the ring's displacements are
#: small ones. Twice as much would double the strain that a linear ring takes for small.
HIGHEST = 0.2
#: Ramp [m] of a step or cleat that names none, as far as its length and the steepest slope allow.
#: Twice as long makes a softer blow: give it in the road's own words if it matters.
RAMP = 0.01


@dataclass(frozen=True)
class RoadProfile:
    """Height over the distance driven; without any numbers it is flat.

    Heights [m] at growing distances [m], straight between them and level outside; a sine, amplitude
    (1 - cos(2 pi x / wavelength)) from x = 0 on, which begins level and rises to twice the
    amplitude. It begins at `at_m`, and comes again every `spacing_m` if that is above zero.
    """

    distance_m: tuple[float, ...] = ()
    height_m: tuple[float, ...] = ()
    amplitude_m: float = 0.0
    wavelength_m: float | None = None
    at_m: float = 0.0
    spacing_m: float = 0.0

    def __post_init__(self) -> None:
        waving = abs(self.amplitude_m) * 2.0 * np.pi / (self.wavelength_m or np.inf)
        slope = max(waving, np.abs(self._slopes).max())
        if slope > STEEPEST:
            raise ModelError(
                f"road with a slope of {slope:.3g}",
                allowed=f"up to {STEEPEST:g} is allowed (the tread presses along the road's "
                "normal)",
                do="give the step a longer ramp",
            )

    @cached_property
    def _slopes(self) -> FloatArray:
        """dh/dx before the first point, between the points, and after the last."""
        slopes = np.diff(self.height_m) / np.diff(self.distance_m)
        return np.concatenate([[0.0], slopes, [0.0]])

    def profile(self, x_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Height [m] and slope [m/m] at `x_m`, each of its shape."""
        x = x_m - self.at_m
        if self.wavelength_m is not None:
            q, x = 2.0 * np.pi / self.wavelength_m, np.maximum(x, 0.0)
            return self.amplitude_m * (1.0 - np.cos(q * x)), self.amplitude_m * q * np.sin(q * x)
        if not self.distance_m:
            return np.zeros_like(x), np.zeros_like(x)
        if self.spacing_m > 0.0:  # a turn ahead of the first obstacle there is none
            x = np.where(x > 0.0, np.mod(x, self.spacing_m), x)
        place = np.searchsorted(self.distance_m, x, side="right")
        return np.interp(x, self.distance_m, self.height_m), self._slopes[place]

    def check_climbable(self, radius_m: float) -> None:
        """ModelError if it rises by more than the tire can take within one of its diameters."""
        x, h = np.array(self.distance_m), np.array(self.height_m)
        wide, wave = 2.0 * radius_m, self.wavelength_m
        rises = [float(np.ptp(h[(x >= begin) & (x <= begin + wide)])) for begin in x]
        rises += [2.0 * abs(self.amplitude_m)] * (wave is not None and wave < 2.0 * wide)
        rise = next((rise for rise in rises if rise > HIGHEST * radius_m), None)
        if rise is not None:
            raise ModelError(
                f"road that rises {rise:.3g} m within one tire diameter",
                allowed=f"up to {HIGHEST * radius_m:.3g} m is allowed for a radius of "
                f"{radius_m:.3g} m (small displacements of the ring)",
                do="give a lower obstacle",
            )


def road_of(words: Record, at_m: float = 0.0, *, folder: Path | None = None) -> RoadProfile:
    """The road that the words describe, its obstacle beginning at `at_m`.

    ModelError if its kind lacks a number, or cannot be rolled over. A profile's file is sought in
    `folder`, unless its path is absolute.
    """
    if words.kind == "flat":
        return RoadProfile()
    if words.kind == "sine":
        amplitude, wavelength = _needed(words, "amplitude_m", "wavelength_m")
        return RoadProfile(amplitude_m=amplitude, wavelength_m=wavelength, at_m=at_m)
    if words.kind != "profile":
        road = _obstacle(words)
    elif words.file is not None:
        road = load_road((folder or Path()) / words.file)
    else:
        raise ModelError(
            "road profile without a file",
            allowed='file = "PATH" is allowed (distance and height, a point a line)',
            do="name it",
        )
    spacing, length = 0.0 if words.kind == "step" else words.spacing_m or 0.0, road.distance_m[-1]
    if 0.0 < spacing <= length:
        raise ModelError(
            f"spacing_m = {spacing:g} of the road is shorter than what comes again ({length:g} m)",
            allowed="a longer spacing is allowed",
            do="correct it",
        )
    return replace(road, at_m=at_m, spacing_m=spacing)


def _obstacle(words: Record) -> RoadProfile:
    """A change of level, or a bar with a ramp on either side."""
    needed = ("height_m",) if words.kind == "step" else ("height_m", "length_m")
    height, *foot = _needed(words, *needed)
    ramp = words.ramp_m or max(RAMP, 1.01 * abs(height) / STEEPEST)
    if not foot:
        return RoadProfile((0.0, ramp), (0.0, height))
    ramp = words.ramp_m or min(ramp, 0.49 * foot[0])
    if not 0.0 < ramp < 0.5 * foot[0]:
        raise ModelError(
            f"cleat with ramps of {ramp:g} m",
            allowed="above zero and below half of its length_m is allowed",
            do="correct ramp_m",
        )
    return RoadProfile((0.0, ramp, foot[0] - ramp, foot[0]), (0.0, height, height, 0.0))


def _needed(words: Record, *names: str) -> tuple[float, ...]:
    """The numbers of these names.  ModelError if one is lacking."""
    values = [getattr(words, name) for name in names]
    lacking = [name for name, value in zip(names, values) if value is None]
    if lacking:
        raise ModelError(
            f"road of kind {words.kind} without {' and '.join(lacking)}",
            allowed="a number in m is allowed",
            do="give it",
        )
    return tuple(values)


def load_road(path: str | Path) -> RoadProfile:
    """A road profile from a text file.

    Two columns, distance [m] and height [m], comma or blanks between; `#` begins a remark.
    ModelError: no such file, or lines that are no points.
    """
    try:
        text = bounded_input(path, 16 * LARGEST_BYTES).decode("utf-8-sig")
    except (OSError, ValueError) as problem:
        raise ModelError(
            f"road profile cannot be read ({getattr(problem, 'strerror', None) or problem})",
            allowed="a text file of a distance and a height in m in each line is allowed",
            do="give another",
            file=path,
        ) from None
    rows = []
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split("#")[0].replace(",", " ").split()
        try:
            values = [float(word) for word in words]
        except ValueError:
            values = []
        if words and len(values) != 2:
            raise ModelError(
                f"{line[:40].strip()!r} of a road profile",
                allowed="a distance and a height in m are allowed in each line",
                do="correct or remove it",
            ).at(path, number)
        rows += [values] * bool(words)
    points = np.array(rows, dtype=np.float64)
    two = points.ndim == 2 and points.shape[1] == 2 and len(points) > 1
    if not (two and np.isfinite(points).all() and (np.diff(points[:, 0]) > 0.0).all()):
        raise ModelError(
            "road profile that is not two points or more whose distances grow",
            allowed="a distance and a height in m in each line are allowed",
            do="sort the rows, one height each",
            file=path,
        )
    try:
        return RoadProfile(tuple(points[:, 0].tolist()), tuple(points[:, 1].tolist()))
    except ModelError as problem:
        raise problem.at(path) from None
