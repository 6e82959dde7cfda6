"""Where the grating passed the patch, coarsely.

Pulses that stand out of their surroundings by half of the usual height.

    channel --decimate--> medians of short buckets, patch upward
            --turning points whose rise and fall exceed a height--> peaks, each between two valleys
            --half-level crossings--> Pulses: middle and width [samples], one row per passage
            --those of few buckets--> the same with shorter buckets there

A pulse counts if the signal climbs to it and falls from it by the same least height, found from the
log's own heights. Neither a baseline nor a period is assumed, so drift, standing still (in the
patch or out of it), creeping and hard braking need no special case, and the shoulders beside the
patch are too low.

Samples that are missing in time are bridged as lost ones are: the search goes on behind a gap, and
only a pulse of which the gap takes more than half is none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel, TimeAxis
from tirelog.strain.passages.decimate import AT_ONCE, Decimated, decimate, refined
from tirelog.strain.passages.search_kernels import (
    PULSE,
    half_level,
    medians_around,
    turning_points,
)
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: a pulse climbs and falls by this share of the usual height; shoulders reach about 0.3, and half
#: of it would take them for pulses
LEAST_HEIGHT = 0.45
#: and by this many times the noise of a sample; half of it, one sample's noise does by chance once
#: in 3e4
LEAST_SIGMAS = 8.0
#: a pulse whose top lies this share of its height below both neighbours' is the stretch between
#: two patches, seen from its deep shoulders; twice as much keeps almost every such stretch, half
#: as much drops passages beside higher ones
PLATEAU_SHARE = 0.4
#: pulses whose usual width is less than so many buckets are searched with shorter ones: a pulse
#: whose middle lies between two buckets looks two wide, however narrow it is, and below 1.2 it may
#: be too low to count.  Half as many would leave such pulses out
FEWEST_BUCKETS = 2.2
#: pulses on either side whose widths are the usual one; twice as many pulses tell it of a speed
#: that changes over twice as many
REACH = 3
#: radial acceleration outside the patch [m/s^2], over this time [s]; below the least (3 m/s on a
#: car's wheel) nothing is looked for; twice the least leaves wheels below 4.2 m/s without passages
LEVEL_S, LEAST_LEVEL, LEAST_LEVEL_SIGMAS = 0.5, 30.0, 12.0


@dataclass(frozen=True)
class Pulses:
    """One row per pulse, shape (n,), patch upward.

    `middle` of the half-level crossings and `width` between them [samples], `height` [channel's
    unit], `base` the level of the higher valley beside it.
    """

    middle: FloatArray
    width: FloatArray
    height: FloatArray
    base: FloatArray

    def __len__(self) -> int:
        return int(self.middle.size)

    def take(self, which: NDArray[np.bool_]) -> Pulses:
        return Pulses(self.middle[which], self.width[which], self.height[which], self.base[which])


NO_PULSES = Pulses(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0))


def _turning_points(values: NDArray[np.float32], least: float) -> IntArray:
    """Places of the alternating extremes of `values` whose rises and falls are at least `least`."""
    points = np.empty(values.size + 1, np.int32)
    return points[: turning_points(values, least, points)].astype(np.int64)


def usual_height(heights: FloatArray) -> float:
    """The height of a patch among all rises and falls.

    The median weighted by their squares, so that ripples do not count.
    """
    ordered = np.sort(heights)
    weight = np.cumsum(ordered**2)
    return float(ordered[np.searchsorted(weight, 0.5 * weight[-1])])


def find_pulses(data: Decimated, without: int = 0) -> Pulses:
    """The pulses of `data`; `without`: how many times the highest are no patch's heights."""
    noise = data.noise
    bounds = np.append(np.minimum(data.parts, data.values.size), data.values.size)
    rough = [
        start + _turning_points(data.values[start:stop], LEAST_SIGMAS * noise)
        for start, stop in pairwise(bounds)
    ]
    heights = np.concatenate(
        [np.abs(np.diff(data.values[points])).astype(np.float64) for points in rough]
    )
    for _ in range(without):
        if heights.size:
            heights = heights[heights < LEAST_HEIGHT * usual_height(heights)]
    if not heights.size:
        return NO_PULSES
    least = max(LEAST_HEIGHT * usual_height(heights), LEAST_SIGMAS * noise)
    found = []
    for points in rough:
        points = points[_turning_points(data.values[points], least)]
        top = 1 + np.flatnonzero(data.values[points[1:-1]] > data.values[points[:-2]])
        found.append([points[top], points[top - 1], points[top + 1]])
    return _half_level(
        data,
        *_without_plateaus(
            data.values, *(np.concatenate(places) for places in zip(*found, strict=True))
        ),
    )


def _without_plateaus(
    values: NDArray[np.float32], peak: IntArray, left: IntArray, right: IntArray
) -> tuple[IntArray, IntArray, IntArray]:
    """The peaks that are not much lower than a neighbour.

    Not lower than both neighbours (at the ends: the only neighbour) by much of their own height.
    """
    if peak.size < 2:
        return peak, left, right
    top = values[peak]
    height = top - np.minimum(values[left], values[right])
    before = np.concatenate([[np.inf], top[:-1]])
    after = np.concatenate([top[1:], [np.inf]])
    kept = top >= np.minimum(before, after) - PLATEAU_SHARE * height
    return peak[kept], left[kept], right[kept]


@dataclass(frozen=True)
class _Level:
    """Radial acceleration outside the patch: sizes (k,) at samples (k,), straight lines between."""

    index: FloatArray
    size: FloatArray

    def at(self, index: FloatArray) -> NDArray[np.float32]:
        return np.interp(index, self.index, self.size).astype(np.float32)


def search_passages(
    channel: Channel, sign: float, block_samples: int = AT_ONCE
) -> tuple[Pulses, Decimated]:
    """The pulses of `channel`, and what they were found in. `sign` turns the patch upward."""
    return pulses_in(channel, decimate(channel, sign, block_samples), sign)


def pulses_in(
    channel: Channel, data: Decimated, sign: float, without: int = 0
) -> tuple[Pulses, Decimated]:
    """The pulses of `channel` in its `data`, and those with shorter buckets where it takes them.

    `without` as `find_pulses` has it. Radial acceleration, whose pulses grow with the square of
    the speed, is searched in units of its level outside the patch.
    """
    if not data.values.size or not np.isfinite(data.noise):
        return NO_PULSES, data
    level = _level(channel, data) if channel.kind == "radial_acceleration" else None
    pulses = _found(data, level, without)
    while (stretches := _fast_stretches(channel, data, pulses)).size:
        data = refined(channel, data, sign, stretches)
        pulses = _found(data, level, without)
    return _seen(channel.axis, pulses), data


def _found(data: Decimated, level: _Level | None, without: int) -> Pulses:
    """The pulses of `data`, searched in units of a `level` if there is one."""
    if level is None:
        return find_pulses(data, without)
    at = level.at(data.index(np.arange(data.values.size)))
    noise = data.noise / float(np.median(at))
    pulses = find_pulses(replace(data, values=data.values / at, noise=noise), without)
    scale = level.at(pulses.middle).astype(np.float64)
    return replace(pulses, height=pulses.height * scale, base=pulses.base * scale)


def _level(channel: Channel, data: Decimated) -> _Level:
    """Median size of the values over pieces of LEVEL_S, never below the least."""
    size = max(int(LEVEL_S * channel.axis.rate_Hz / data.bucket[0]), 1)
    firsts = np.arange(0, data.values.size, size)
    medians = [float(np.median(np.abs(data.values[first : first + size]))) for first in firsts]
    least = max(LEAST_LEVEL, LEAST_LEVEL_SIGMAS * data.noise)
    middles = data.index(np.asarray(firsts + 0.5 * size, np.float64))
    return _Level(middles, np.maximum(medians, least))


def _fast_stretches(channel: Channel, data: Decimated, pulses: Pulses) -> IntArray:
    """Samples [from, to) in which pulses are too narrow for their buckets, (n, 2).

    With REACH pulses on either side, between which and the others none was overlooked.
    """
    bucket = data.bucket[np.searchsorted(data.first[1:], pulses.middle, side="right")]
    narrow = (usual(pulses.width / bucket) < FEWEST_BUCKETS) & (bucket > 1)
    if not narrow.any():
        return np.zeros((0, 2), np.int64)
    around = np.convolve(narrow, np.ones(2 * REACH + 1))[REACH:-REACH] > 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], around, [False]])))
    between = 0.5 * (pulses.middle[1:] + pulses.middle[:-1])
    bounds = np.concatenate([[0.0], between, [float(channel.size)]])
    return bounds[edges].astype(np.int64).reshape(-1, 2)


def _seen(axis: TimeAxis, pulses: Pulses) -> Pulses:
    """The `pulses` of which at least half was recorded, with their widths as in time."""
    entry, leave = pulses.middle - 0.5 * pulses.width, pulses.middle + 0.5 * pulses.width
    missing = axis.missing_before(np.ceil(leave)) - axis.missing_before(np.floor(entry))
    return replace(pulses, width=pulses.width + missing).take(missing <= pulses.width)


def usual(values: FloatArray) -> FloatArray:
    """Median of the values within REACH pulses, shape (n,)."""
    medians = np.empty(values.size)
    medians_around(values, REACH, np.empty(2 * REACH + 1), medians)
    return medians


def _half_level(data: Decimated, peak: IntArray, left: IntArray, right: IntArray) -> Pulses:
    """The pulses at `peak` between the valleys `left` and `right`.

    By linear interpolation between buckets.
    """
    pulses = np.empty(peak.size, PULSE)
    half_level(data.values, peak, left, right, pulses)
    middle, width, height, base = (pulses[name].copy() for name in PULSE.names or ())
    width = np.maximum(data.samples(middle) * width, 1.0)
    return Pulses(data.index(middle), width, height, base)
