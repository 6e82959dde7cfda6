"""Where the grating passed the patch, coarsely: pulses that stand out of their surroundings by half of the usual height.

    channel --median of short buckets--> Decimated, patch upward (float32, 1 byte a sample of the log)
            --turning points whose rise and fall exceed a height--> peaks, each between two valleys
            --half-level crossings--> Pulses: middle and width [samples], a row a passage

A pulse counts if the signal climbs to it and falls from it by the same least height, found from the log's own heights.  Neither a
baseline nor a period is assumed, so drift, standing still (in the patch or out of it), creeping and hard braking need no special case, and
the shoulders beside the patch are too low.  The median of a bucket ignores a single wild sample; lost samples are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tirelog.dsp.noise import PIECE_SAMPLES, SampleNoise
from tirelog.recording import BLOCK_SAMPLES, Channel, FloatArray, IntArray

#: length of a bucket [s]: at 25 m/s a patch of 0.1 m takes 4 ms
BUCKET_S = 1.6e-3
#: a pulse climbs and falls by this share of the usual height; shoulders reach about 0.3
LEAST_HEIGHT = 0.45
#: and by this many times the noise of a sample
LEAST_SIGMAS = 8.0
#: a pulse whose top lies this share of its height below both neighbours' is the stretch between two patches, seen from its deep shoulders
PLATEAU_SHARE = 0.4
#: radial acceleration outside the patch [m/s^2], over this time [s]; below the least (3 m/s on a car's wheel) nothing is looked for
LEVEL_S, LEAST_LEVEL, LEAST_LEVEL_SIGMAS = 0.5, 30.0, 12.0


@dataclass(frozen=True)
class Decimated:
    """`values` shape (m,): the medians of buckets, patch upward, lost buckets left out; `index` (m,): the bucket's middle [samples];
    `part` (m,): the number of the gapless segment; `extremes`: least and largest sample of the channel, as recorded; `noise`: sigma of
    one sample (NaN: not known)."""

    values: NDArray[np.float32]
    index: FloatArray
    part: IntArray
    bucket: int
    extremes: tuple[float, float]
    noise: float


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


def bucket_samples(rate_Hz: float) -> int:
    """Samples a bucket: 1, 4, 8, 16 ..."""
    samples = BUCKET_S * rate_Hz
    return 1 << int(np.log2(samples)) if samples >= 4 else 1


def _bucket_medians(values: FloatArray, bucket: int) -> FloatArray:
    """Median of the four quarters' means in each bucket, shape (len // bucket,); NaN only where all of it is lost."""
    rows = values.reshape(-1, bucket)
    quarter = bucket // 4
    if quarter > 1:
        rows = rows.reshape(-1, 4, quarter).mean(axis=2)
    a, b, c, d = (rows[:, k] for k in range(4))
    median = 0.5 * (np.maximum(np.minimum(a, b), np.minimum(c, d)) + np.minimum(np.maximum(a, b), np.maximum(c, d)))
    lost = np.flatnonzero(np.isnan(median))
    if lost.size:
        some = rows[lost]
        whole = ~np.isnan(some).all(axis=1)
        median[lost[whole]] = np.nanmedian(some[whole], axis=1)
    return median


def _of_three(values: FloatArray) -> FloatArray:
    """Running median of three; the ends and the neighbours of lost samples stay as they are."""
    result = values.copy()
    if values.size < 3:
        return result
    a, b, c = values[:-2], values[1:-1], values[2:]
    median = np.maximum(np.minimum(a, b), np.minimum(np.maximum(a, b), c))
    result[1:-1] = np.where(np.isnan(median), b, median)
    return result


def decimate(channel: Channel, sign: float, block_samples: int = BLOCK_SAMPLES) -> Decimated:
    """The channel by buckets, times `sign`.  The buckets lie at fixed samples, whatever `block_samples`."""
    bucket = bucket_samples(channel.axis.rate_Hz)
    step = -(-block_samples // PIECE_SAMPLES) * PIECE_SAMPLES
    margin = 2 if bucket == 1 else 0
    noise = SampleNoise(channel.size, channel.resolution)
    parts: list[NDArray[np.float32]] = []
    low, high = np.inf, -np.inf
    for start in range(0, channel.size, step):
        first = max(start - margin, 0)
        values = np.asarray(channel.read(first, min(start + step + margin, channel.size)), dtype=np.float64)
        low, high = float(np.fmin.reduce(values, initial=low)), float(np.fmax.reduce(values, initial=high))
        noise.take(start, values[start - first : start - first + step])
        if bucket == 1:
            some = _of_three(values)[start - first : start - first + step]
        else:
            short = -values.size % bucket
            some = _bucket_medians(np.pad(values, (0, short), constant_values=np.nan) if short else values, bucket)
        parts.append((sign * some).astype(np.float32))
    medians = np.concatenate(parts) if parts else np.zeros(0, np.float32)
    kept = np.flatnonzero(np.isfinite(medians))
    index = kept.astype(np.float64) * bucket + 0.5 * (bucket - 1)
    begins = np.searchsorted(index, channel.axis.first[1:])
    part = np.cumsum(np.bincount(begins[begins < kept.size], minlength=kept.size)).astype(np.int64)
    return Decimated(medians[kept], index, part, bucket, (low, high), noise.sigma())


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
    """`turning_points` of each gapless part."""
    edges = np.concatenate([[0], np.flatnonzero(np.diff(data.part)) + 1, [data.values.size]])
    return [start + turning_points(data.values[start:stop], least) for start, stop in pairwise(edges)]


def usual_height(heights: FloatArray) -> float:
    """The height of a patch among all rises and falls: the median weighted by their squares, so that ripples do not count."""
    order = np.argsort(heights)
    weight = np.cumsum(heights[order] ** 2)
    return float(heights[order][np.searchsorted(weight, 0.5 * weight[-1])])


def find_pulses(data: Decimated) -> Pulses:
    """The pulses of `data`."""
    noise = data.noise
    empty = np.zeros(0)
    rough = _turning_points_by_part(data, LEAST_SIGMAS * noise)
    heights = np.concatenate([np.abs(np.diff(data.values[points])).astype(np.float64) for points in rough] or [empty])
    heights = heights[heights >= LEAST_SIGMAS * noise]
    if not heights.size or not heights.max() > 0:
        return Pulses(empty, empty, empty, empty)
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
        empty = np.zeros(0)
        return Pulses(empty, empty, empty, empty), data
    if channel.kind != "radial_acceleration":
        return find_pulses(data), data
    level = np.maximum(_level(data, channel.axis.rate_Hz), max(LEAST_LEVEL, LEAST_LEVEL_SIGMAS * data.noise))
    levelled = replace(data, values=(data.values / level).astype(np.float32), noise=data.noise / float(np.median(level)))
    pulses = find_pulses(levelled)
    scale = np.interp(pulses.middle, data.index, level)
    return replace(pulses, height=pulses.height * scale, base=pulses.base * scale), data


def _level(data: Decimated, rate_Hz: float) -> FloatArray:
    """Median size of the values over pieces of LEVEL_S, straight lines between, shape (m,)."""
    piece = (data.index / (LEVEL_S * rate_Hz)).astype(np.int64)
    first = np.concatenate([[0], np.flatnonzero(np.diff(piece)) + 1])
    medians = [float(np.median(np.abs(some))) for some in np.split(data.values, first[1:])]
    return np.interp(data.index, (piece[first] + 0.5) * LEVEL_S * rate_Hz, medians)


def _half_level(data: Decimated, peak: IntArray, left: IntArray, right: IntArray) -> Pulses:
    """Middle and width of the pulses at half of their height, by linear interpolation between buckets."""
    if not peak.size:
        empty = np.zeros(0)
        return Pulses(empty, empty, empty, empty)
    values, index = data.values.astype(np.float64), data.index
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
        return index[a] + np.clip(share, 0.0, 1.0) * (index[b] - index[a])

    entry, leave = crossing(before, before + 1), crossing(after - 1, after)
    return Pulses(0.5 * (entry + leave), np.maximum(leave - entry, 1.0), values[peak] - base, base)
