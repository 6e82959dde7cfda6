"""Where the grating passed the patch, coarsely: pulses that stand out of their surroundings by half of the usual height.

    channel --passage_decimate--> medians of short buckets, patch upward
            --turning points whose rise and fall exceed a height--> peaks, each between two valleys
            --half-level crossings--> Pulses: middle and width [samples], a row a passage

A pulse counts if the signal climbs to it and falls from it by the same least height, found from the log's own heights.  Neither a
baseline nor a period is assumed, so drift, standing still (in the patch or out of it), creeping and hard braking need no special case, and
the shoulders beside the patch are too low.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tirelog.estimators.passage_decimate import Decimated, decimate
from tirelog.recording import BLOCK_SAMPLES, Channel, FloatArray, IntArray

#: buckets that are looked at in one piece
PIECE_BUCKETS = 1 << 18
#: a pulse climbs and falls by this share of the usual height; shoulders reach about 0.3
LEAST_HEIGHT = 0.45
#: and by this many times the noise of a sample
LEAST_SIGMAS = 8.0
#: a pulse whose top lies this share of its height below both neighbours' is the stretch between two patches, seen from its deep shoulders
PLATEAU_SHARE = 0.4
#: radial acceleration outside the patch [m/s^2], over this time [s]; below the least (3 m/s on a car's wheel) nothing is looked for
LEVEL_S, LEAST_LEVEL, LEAST_LEVEL_SIGMAS = 0.5, 30.0, 12.0


@dataclass(frozen=True)
class Pulses:
    """A row a pulse, shape (n,): `middle` of the half-level crossings and `width` between them [samples], `height` [channel's unit],
    `base` the level of the higher valley beside it, patch upward."""

    middle: FloatArray
    width: FloatArray
    height: FloatArray
    base: FloatArray

    def __len__(self) -> int:
        return int(self.middle.size)

    def take(self, which: NDArray[np.bool_]) -> Pulses:
        return Pulses(self.middle[which], self.width[which], self.height[which], self.base[which])


NO_PULSES = Pulses(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0))


def turning_points(values: NDArray[np.floating], least: float) -> IntArray:
    """Places of the alternating extremes of `values` whose rises and falls are at least `least`; the two ends are kept.

    The pair of neighbouring extremes that differ least is removed, until none differs by less: the order does not change the answer.
    """
    if values.size < 3:
        return np.arange(values.size)
    changed = np.concatenate([[0], np.flatnonzero(np.diff(values)) + 1])
    up = np.diff(values[changed]) > 0
    turn = np.flatnonzero(up[1:] != up[:-1]) + 1
    inner = changed[turn]
    points = np.concatenate([[0], inner[(inner > 0) & (inner < values.size - 1)], [values.size - 1]])
    while True:
        size = np.abs(np.diff(values[points]))
        if size.size < 3:
            return points
        inner = size[1:-1]
        pair = np.flatnonzero((inner < least) & (inner < size[:-2]) & (inner <= size[2:])) + 1
        if not pair.size:
            return points
        keep = np.ones(points.size, bool)
        keep[pair] = keep[pair + 1] = False
        points = points[keep]


def _turning_points_by_part(data: Decimated, least: float) -> list[IntArray]:
    """`turning_points` of each gapless part, piece by piece and then of what is left."""
    found = []
    for start, stop in pairwise(np.append(np.minimum(data.parts, data.values.size), data.values.size)):
        pieces = range(int(start), int(stop), PIECE_BUCKETS)
        rough = [first + turning_points(data.values[first : min(first + PIECE_BUCKETS, stop)], least) for first in pieces]
        if rough:
            points = np.concatenate(rough)
            found.append(points[turning_points(data.values[points], least)])
    return found


def usual_height(heights: FloatArray) -> float:
    """The height of a patch among all rises and falls: the median weighted by their squares, so that ripples do not count."""
    order = np.argsort(heights)
    weight = np.cumsum(heights[order] ** 2)
    return float(heights[order][np.searchsorted(weight, 0.5 * weight[-1])])


def find_pulses(data: Decimated) -> Pulses:
    """The pulses of `data`."""
    noise = data.noise
    rough = _turning_points_by_part(data, LEAST_SIGMAS * noise)
    heights = np.concatenate([np.abs(np.diff(data.values[points])).astype(np.float64) for points in rough] or [np.zeros(0)])
    heights = heights[heights >= LEAST_SIGMAS * noise]
    if not heights.size or not heights.max() > 0:
        return NO_PULSES
    least = max(LEAST_HEIGHT * usual_height(heights), LEAST_SIGMAS * noise)
    peaks, left, right = [], [], []
    for points in rough:
        points = points[turning_points(data.values[points], least)]
        level = data.values[points]
        climb, fall = level[1:-1] - level[:-2], level[1:-1] - level[2:]
        top = np.flatnonzero((climb >= least) & (fall >= least)) + 1
        peaks.append(points[top])
        left.append(points[top - 1])
        right.append(points[top + 1])
    return _half_level(data, *_without_plateaus(data.values, *(np.concatenate(p).astype(np.int64) for p in (peaks, left, right))))


def _without_plateaus(values: NDArray[np.float32], peak: IntArray, left: IntArray, right: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """The peaks that are not lower than both neighbours (at the ends: the only neighbour) by much of their own height."""
    if peak.size < 2:
        return peak, left, right
    top = values[peak]
    height = top - np.minimum(values[left], values[right])
    before = np.concatenate([[np.inf], top[:-1]])
    after = np.concatenate([top[1:], [np.inf]])
    kept = top >= np.minimum(before, after) - PLATEAU_SHARE * height
    return peak[kept], left[kept], right[kept]


def search(channel: Channel, sign: float, block_samples: int = BLOCK_SAMPLES) -> tuple[Pulses, Decimated]:
    """The pulses of `channel`, and what they were found in.  `sign` turns the patch upward.

    Radial acceleration, whose pulses grow with the square of the speed, is searched in units of its level outside the patch.
    """
    data = decimate(channel, sign, block_samples)
    if not data.values.size or not np.isfinite(data.noise):
        return NO_PULSES, data
    if channel.kind != "radial_acceleration":
        return find_pulses(data), data
    level = np.maximum(_level(data, channel.axis.rate_Hz), max(LEAST_LEVEL, LEAST_LEVEL_SIGMAS * data.noise))
    pulses = find_pulses(replace(data, values=(data.values / level).astype(np.float32), noise=data.noise / float(np.median(level))))
    scale = level[np.round((pulses.middle - data.index(np.zeros(1))) / data.bucket).astype(np.int64)].astype(np.float64)
    return replace(pulses, height=pulses.height * scale, base=pulses.base * scale), data


def _level(data: Decimated, rate_Hz: float) -> NDArray[np.float32]:
    """Median size of the values over pieces of LEVEL_S, straight lines between, shape (m,)."""
    size = max(int(LEVEL_S * rate_Hz / data.bucket), 1)
    firsts = np.arange(0, data.values.size, size)
    medians = [float(np.median(np.abs(data.values[first : first + size]))) for first in firsts]
    return np.interp(np.arange(data.values.size), firsts + 0.5 * size, medians).astype(np.float32)


def _half_level(data: Decimated, peak: IntArray, left: IntArray, right: IntArray) -> Pulses:
    """Middle and width of the pulses at half of their height, a stretch of the log at a time."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(left // PIECE_BUCKETS)) + 1, [peak.size]])
    parts = [_half_level_piece(data, peak[a:b], left[a:b], right[a:b]) for a, b in pairwise(edges) if b > a]
    return Pulses(*(np.concatenate([np.zeros(0), *column]) for column in zip(*parts, strict=True))) if parts else NO_PULSES


def _half_level_piece(
    data: Decimated, peak: IntArray, left: IntArray, right: IntArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """(middle, width, height, base) of pulses next to one another, by linear interpolation between buckets."""
    first = int(left[0])
    values = data.values[first : int(right[-1]) + 1].astype(np.float64)
    peak, left, right = peak - first, left - first, right - first
    # the higher of the two valleys: a downward jump of the instrument may stand for the other
    base = np.maximum(values[left], values[right])
    level = 0.5 * (values[peak] + base)
    place = np.arange(values.size)
    # the pulse that a bucket belongs to: up to the valley at its right
    owner = np.minimum(np.searchsorted(right, place), peak.size - 1)
    below = values <= level[owner]
    before = np.maximum.accumulate(np.where(below, place, -1))[peak]
    after = np.minimum.accumulate(np.where(below, place, values.size)[::-1])[::-1][peak]
    before, after = np.clip(before, 0, values.size - 2), np.clip(after, 1, values.size - 1)

    def crossing(a: IntArray, b: IntArray) -> FloatArray:
        rise = values[b] - values[a]
        share = np.where(rise != 0, (level - values[a]) / np.where(rise != 0, rise, 1.0), 0.5)
        return data.index(first + a + np.clip(share, 0.0, 1.0) * (b - a))

    entry, leave = crossing(before, before + 1), crossing(after - 1, after)
    return 0.5 * (entry + leave), np.maximum(leave - entry, 1.0), values[peak] - base, base
