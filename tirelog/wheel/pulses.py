"""Where a sensor passed the patch, coarsely: a strain grating or an accelerometer.

Pulses that stand out of their surroundings by half of the usual height.

    channel --decimate--> medians of short buckets, patch upward
            --turning points whose rise and fall exceed a height--> peaks, each between two valleys
            --half-level crossings--> Records: middle and width [samples], one row per passage
            --some of few buckets--> the same with shorter buckets

A pulse counts if the signal climbs to it and falls from it by the same least height, found from the
log's own heights. Neither a baseline nor a period is assumed. So drift, standing still (in the
patch or out of it), creeping and hard braking need no special case. The shoulders beside the patch
are too low.

Samples that are missing in time are bridged as lost ones are: the search goes on behind a gap, and
only a pulse of which the gap takes more than half is none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import BLOCK_SAMPLES, Channel, TimeAxis
from tirelog.dsp.filters import PIECE_SAMPLES, sample_noise
from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray, Records

# ---- Loops of the search for passages.
#
# Samples to medians of buckets, turning points, half-level crossings.
#
#     values (n,) --bucket_medians--> medians (n / bucket,) --turning_points--> places
#         --half_level--> middle, width, height, base


#: a pulse, patch upward: middle of its half-level crossings and width between them [places, later
#: samples], height above the higher valley and that valley's level [channel's unit]
PULSE = np.dtype([("middle", "f8"), ("width", "f8"), ("height", "f8"), ("base", "f8")])


def bucket_medians(
    values: FloatArray, bucket: int, sign: float, medians: NDArray[np.float32]
) -> None:
    """Fills `medians` with the median of the four quarters' means in each bucket.

    Of `values` (n,), times `sign`, into `medians` (ceil(n / bucket),); of those quarters that are
    whole; NaN if none is. `bucket`: a multiple of 4.
    """
    quarter, short = bucket // 4, medians.size * bucket - values.size
    whole = np.pad(values, (0, short), constant_values=np.nan) if short else values
    parts = whole.reshape(-1, quarter)
    total = parts[:, 0].copy()
    for k in range(1, quarter):
        total += parts[:, k]
    fours = total.reshape(-1, 4) * (sign / quarter)
    a, b, c, d = fours.T
    lower = np.maximum(np.minimum(a, b), np.minimum(c, d))
    upper = np.minimum(np.maximum(a, b), np.maximum(c, d))
    medians[:] = 0.5 * (lower + upper)
    lost = np.flatnonzero(np.isnan(medians))
    medians[lost] = _medians(fours[lost])


def running_medians(
    values: FloatArray, first: int, sign: float, medians: NDArray[np.float32]
) -> None:
    """Fills `medians` with the running median of three of `values`, times `sign`.

    From place `first` on; the ends of `values` and the neighbours of lost samples stay as they are.
    """
    out = values.copy()
    before, value, after = values[:-2], values[1:-1], values[2:]
    middle = np.maximum(np.minimum(before, value), np.minimum(np.maximum(before, value), after))
    out[1:-1] = np.where(np.isnan(middle), value, middle)
    medians[:] = sign * out[first : first + medians.size]


@compiled
def turning_points(values: NDArray[np.float32], least: float, points: NDArray[np.int32]) -> int:
    """Fills `points` with places of the alternating extremes of `values`; how many.

    Their rises and falls are at least `least`. The first and the last are the extremes before the
    first and after the last such rise or fall. Of equal extremes the first counts.
    """
    enough = np.float32(least)
    if enough < least or enough == 0.0:  # the least float32 above 0 that is not below `least`
        enough = np.nextafter(enough, np.float32(np.inf))
    low = high = i = 0
    while i < values.size and values[high] - values[low] < enough:
        high = i if values[i] > values[high] else high
        low = i if values[i] < values[low] else low
        i += 1
    if values.size == 0 or values[high] - values[low] < enough:
        return 0
    points[0], count = min(low, high), 1
    # turned over after each, so that there is only one way to go
    place, sign = max(low, high), np.float32(1.0 if high > low else -1.0)
    extreme = sign * values[place]
    for k in range(place + 1, values.size):
        value = sign * values[k]
        if value > extreme:
            place, extreme = k, value
        elif extreme - value >= enough:
            points[count] = place
            count += 1
            place, sign, extreme = k, -sign, -value
    points[count] = place
    return count + 1


@compiled
def half_level(
    values: NDArray[np.float32], peak: IntArray, left: IntArray, right: IntArray, pulses: Records
) -> None:
    """Fills `pulses` (n,) of PULSE with the pulses between two valleys of each `peak` (n,).

    Between the valleys `left` and `right` (n,), places of `values`.
    """
    for k in range(peak.size):
        base = max(np.float64(values[left[k]]), np.float64(values[right[k]]))
        level = 0.5 * (values[peak[k]] + base)
        before = after = peak[k]
        while before > left[k] and values[before] > level:
            before -= 1
        while after < right[k] and values[after] > level:
            after += 1
        entry = before + _share(values[before], values[before + 1], level)
        leave = after - _share(values[after], values[after - 1], level)
        pulse = pulses[k]
        pulse["middle"], pulse["width"] = 0.5 * (entry + leave), leave - entry
        pulse["height"], pulse["base"] = values[peak[k]] - base, base


@compiled
def _share(below: float, above: float, level: float) -> float:
    """Where between two places `level` lies, 0 to 1; half way between equal ones."""
    rise = np.float64(above) - below
    return min(max((level - below) / rise, 0.0), 1.0) if rise != 0.0 else 0.5


# ---- A channel thinned for the search of passages: medians of short buckets.
#
#     channel
#         --block by block, buckets at fixed samples--> Decimated (float32, 1 byte per sample of the
#                                                       log), noise and extremes beside
#         --shorter buckets, if a pulse takes them--> Decimated
#
# The median of a bucket ignores a single wild sample; a bucket that is lost is bridged by a
# straight
# line, which has no extreme.


#: samples read at once: they stay in the cache until they are done with
AT_ONCE = 1 << 17


@dataclass(frozen=True)
class Decimated:
    """The medians of buckets of a channel's samples, patch upward.

    `values` (m,): of buckets of `bucket` samples each; none if the whole channel is lost.

    `parts`: number of the bucket with which the recording begins, and goes on after each long
    interruption; `extremes`: least and largest sample of the channel, as recorded; `noise`: sigma
    of one sample (NaN: not known).
    """

    values: NDArray[np.float32]
    bucket: int
    parts: IntArray
    extremes: tuple[float, float]
    noise: float

    def index(self, place: IntArray | FloatArray) -> FloatArray:
        """The middle of buckets [samples], by their numbers `place` (n,)."""
        return np.asarray(place * float(self.bucket) + 0.5 * (self.bucket - 1))


def decimate(channel: Channel, sign: float, bucket: int = 0) -> Decimated:
    """The channel by buckets of so many samples, else by those of its rate, times `sign`.

    The buckets lie at fixed samples, whatever is read at once.

    A bucket is the median of its four quarters' means, of those that are not lost; a bucket of one
    sample is the median with its neighbours.
    """
    if not bucket:
        # 1, 4, 8, 16 ... samples. At 25 m/s a patch of 0.1 m takes 4 ms; buckets twice as long need
        # shorter ones from half the speed on
        samples = 1.6e-3 * channel.axis.rate_Hz
        bucket = 1 << int(np.log2(samples)) if samples >= 4 else 1
    medians = np.empty(-(-channel.size // bucket), np.float32)
    step, low, high = -(-AT_ONCE // PIECE_SAMPLES) * PIECE_SAMPLES, np.inf, -np.inf
    margin = 1 if bucket == 1 else 0
    for start in range(0, channel.size, step):
        read = channel.read(start - margin, start + step + margin)
        values = np.ascontiguousarray(read, dtype=np.float64)
        own = medians[start // bucket : -(-(start + step) // bucket)]
        if bucket == 1:
            running_medians(values, min(start, 1), sign, own)
        else:
            bucket_medians(values, bucket, sign, own)
        low, high = np.fmin.reduce(values, initial=low), np.fmax.reduce(values, initial=high)
    parts, extremes = _parts(channel.axis, bucket), (float(low), float(high))
    return Decimated(_bridged(medians), bucket, parts, extremes, sample_noise(channel))


def _parts(axis: TimeAxis, bucket: int) -> IntArray:
    """Numbers of the buckets with which the recording begins, and goes on."""
    # a recording that is interrupted for more than a second goes on as another part, as its level
    # may have drifted meanwhile; twice as long takes a drift of twice the size for a pulse's rise
    behind = axis.first[1:][axis.missing[1:] > axis.rate_Hz]
    return np.append(0, np.ceil((behind - 0.5 * (bucket - 1)) / bucket).astype(np.int64))


def _bridged(medians: NDArray[np.float32]) -> NDArray[np.float32]:
    """Lost buckets filled by straight lines, at the ends by the nearest.

    Nothing at all if all are lost.
    """
    lost = ~np.isfinite(medians)
    if lost.any() and not lost.all():  # the places take four times the room of the medians
        known = np.flatnonzero(~lost)
        medians[lost] = np.interp(np.flatnonzero(lost), known, medians[known])
    return medians[: 0 if lost.all() else None]


#: a pulse climbs and falls by this share of the usual height; shoulders reach about 0.3, and half
#: of it would take them for pulses
LEAST_HEIGHT = 0.45
#: pulses on either side whose widths are the usual one; twice as many pulses tell it of a speed
#: that changes over twice as many
REACH = 3


def usual_height(heights: FloatArray) -> float:
    """The height of a patch among all rises and falls.

    The median weighted by their squares, so that ripples do not count.
    """
    ordered = np.sort(heights)
    weight = np.cumsum(ordered**2)
    return float(ordered[np.searchsorted(weight, 0.5 * weight[-1])])


def find_pulses(data: Decimated, without: int = 0) -> Records:
    """The pulses of `data`; `without`: how many times the highest are no patch's heights."""
    noise = data.noise
    bounds = np.append(np.minimum(data.parts, data.values.size), data.values.size)
    rough = []
    room = np.empty(data.values.size + 1, np.int32)
    # and by this many times the noise of a sample; half of it, one sample's noise does by chance
    # once in 3e4
    least_sigmas = 8.0
    for start, stop in pairwise(bounds):
        count = turning_points(data.values[start:stop], least_sigmas * noise, room)
        rough.append(start + room[:count].astype(np.int64))
    heights = np.concatenate(
        [np.abs(np.diff(data.values[points])).astype(np.float64) for points in rough]
    )
    for _ in range(without):
        if heights.size:
            heights = heights[heights < LEAST_HEIGHT * usual_height(heights)]
    if not heights.size:
        return np.zeros(0, PULSE)
    least = max(LEAST_HEIGHT * usual_height(heights), least_sigmas * noise)
    found = []
    for points in rough:
        count = turning_points(data.values[points], least, room)
        points = points[room[:count]]
        top = 1 + np.flatnonzero(data.values[points[1:-1]] > data.values[points[:-2]])
        found.append([points[top], points[top - 1], points[top + 1]])
    places = (np.concatenate(some) for some in zip(*found, strict=True))
    peak, left, right = _without_plateaus(data.values, *places)
    pulses = np.empty(peak.size, PULSE)
    half_level(data.values, peak, left, right, pulses)
    pulses["width"] = np.maximum(data.bucket * pulses["width"], 1.0)
    pulses["middle"] = data.index(pulses["middle"])
    return pulses


def _without_plateaus(
    values: NDArray[np.float32], peak: IntArray, left: IntArray, right: IntArray
) -> tuple[IntArray, IntArray, IntArray]:
    """The peaks that are not much lower than a neighbour.

    Not lower than both neighbours (at the ends: the only neighbour) by much of their own height.
    """
    top = values[peak]
    height = top - np.minimum(values[left], values[right])
    before, after = np.append(np.inf, top[:-1]), np.append(top[1:], np.inf)
    # a pulse whose top lies this share of its height below both neighbours' is the stretch between
    # two patches, seen from its deep shoulders; twice as much keeps almost every such stretch, half
    # as much drops passages beside higher ones
    kept = (top >= np.minimum(before, after) - 0.4 * height) | (peak.size < 2)
    return peak[kept], left[kept], right[kept]


#: radial acceleration outside the patch by sample: sizes (n,) at fractional samples (n,)
Level = Callable[..., Any]


def pulses_in(
    channel: Channel, data: Decimated, sign: float, without: int = 0
) -> tuple[Records, Decimated]:
    """The pulses of `channel` in its `data`, which has shorter buckets afterwards if it takes them.

    `sign` turns the patch upward, `without` as `find_pulses` has it. Radial acceleration, whose
    pulses grow with the square of the speed, is searched in units of its level outside the patch.
    """
    if not data.values.size or not np.isfinite(data.noise):
        return np.zeros(0, PULSE), data
    level = _level(channel, data) if channel.kind == "radial_acceleration" else None
    pulses = _found(data, level, without)
    # if the usual width is less than so many buckets they are made shorter: a pulse whose middle
    # lies between two buckets looks two wide, however narrow it is, and below 1.2 it may be too low
    # to count.  Half as many would leave such pulses out
    while data.bucket > 1 and (usual(pulses["width"]) < 2.2 * data.bucket).any():
        data = decimate(channel, sign, data.bucket // 4 if data.bucket >= 16 else 1)
        pulses = _found(data, level, without)
    return _seen(channel.axis, pulses), data


def _found(data: Decimated, level: Level | None, without: int) -> Records:
    """The pulses of `data`, searched in units of a `level` if there is one."""
    if level is None:
        return find_pulses(data, without)
    at = level(data.index(np.arange(data.values.size))).astype(np.float32)
    noise = data.noise / float(np.median(at))
    pulses = find_pulses(replace(data, values=data.values / at, noise=noise), without)
    scale = level(pulses["middle"])
    pulses["height"] *= scale
    pulses["base"] *= scale
    return pulses


def _level(channel: Channel, data: Decimated) -> Level:
    """Median size of the values over pieces of half a second, never below the least.

    With straight lines between their middles.
    """
    size = max(int(0.5 * channel.axis.rate_Hz / data.bucket), 1)
    firsts = np.arange(0, data.values.size, size)
    medians = [float(np.median(np.abs(data.values[first : first + size]))) for first in firsts]
    # below 30 m/s^2 (3 m/s on a car's wheel) nothing is looked for; twice the least leaves wheels
    # below 4.2 m/s without passages
    least = max(30.0, 12.0 * data.noise)
    middles = data.index(np.asarray(firsts + 0.5 * size, np.float64))
    return partial(np.interp, xp=middles, fp=np.maximum(medians, least))


def _seen(axis: TimeAxis, pulses: Records) -> Records:
    """The `pulses` of which at least half was recorded, with their widths as in time."""
    half = 0.5 * pulses["width"]
    leave, entry = np.ceil(pulses["middle"] + half), np.floor(pulses["middle"] - half)
    missing = axis.missing_before(leave) - axis.missing_before(entry)
    seen = missing <= pulses["width"]
    pulses["width"] += missing
    return pulses[seen]


def usual(values: FloatArray) -> FloatArray:
    """Median of the values that are there within REACH pulses, shape (n,), NaN if none is."""
    padded = np.pad(np.asarray(values, np.float64), REACH, constant_values=np.nan)
    return _medians(padded[np.arange(values.size)[:, None] + np.arange(2 * REACH + 1)])


def _medians(rows: FloatArray) -> FloatArray:
    """Median of what is there in each of the `rows` (n, m), NaN if nothing is."""
    ordered, row = np.sort(rows, axis=1), np.arange(len(rows))  # NaN come last
    there = (~np.isnan(ordered)).sum(axis=1)
    return np.asarray(0.5 * (ordered[row, (there - 1) // 2] + ordered[row, there // 2]))


# ---- Which way the patch points.


def patch_sign(channel: Channel) -> float:
    """+1 if the patch is a maximum of the recorded signal, -1 if it is a minimum.

    Strain: minimum on the outer surface, maximum on the inner. Radial acceleration: the side on
    which a short stretch's third moment lies. The patch takes some hundredths of a turn and is far
    out of the rest, whichever way the sensor counts. The level outside is not needed: a piezo
    element does not show it.
    """
    if channel.kind == "radial_acceleration":
        return 1.0 if _third_moment(channel) >= 0 else -1.0
    return 1.0 if channel.surface == "inner" else -1.0


def _third_moment(channel: Channel) -> float:
    """Sum of the third moments of pieces of a second from all over the channel.

    Each about its own median, wild samples cut to size.
    """
    # a turn or more above 2 m/s, and the level outside changes little within
    size = min(max(int(channel.axis.rate_Hz), 1), BLOCK_SAMPLES)
    total = 0.0
    for start in np.unique(
        np.linspace(0, max(channel.size - size, 0), 64).astype(np.int64)
    ).tolist():
        some = channel.read(start, start + size)[:: -(-size // 2500)]
        some = some[np.isfinite(some)]
        if some.size:
            # the share of each side that is taken for wild is a fifth of the patch's in a turn
            low, middle, high = np.quantile(some, [0.01, 0.5, 0.99])
            total += float(np.sum((np.clip(some, low, high) - middle) ** 3))
    return total


# ---- The form of pulses: one smooth curve through the samples of many.


def spline(
    place: FloatArray,
    values: FloatArray,
    reach: float,
    intervals: int,
    sizes: FloatArray | float = 1.0,
) -> FloatArray:
    """Coefficients of the least-squares cubic spline through samples, (intervals + 3,).

    Of `values` (s,) at `place` (s,) within +-`reach`, with even knots; they have the spline times
    `sizes`.
    """
    cell, weights = _bumps(place, reach, intervals)
    bumps = [sizes * one for one in weights]
    normal, right = np.zeros((intervals + 3, intervals + 3)), np.zeros(intervals + 3)
    every = np.arange(intervals)
    for a, bump in enumerate(bumps):
        right[every + a] += np.bincount(cell, bump * values, intervals)
        for b, other in enumerate(bumps[: a + 1]):
            products = np.bincount(cell, bump * other, intervals)
            normal[every + a, every + b] += products
            normal[every + b, every + a] += products if a > b else 0.0
    # smoothing: weight of the squared third differences against the samples in a knot interval;
    # twice as much smooths what is narrower than a knot interval further
    rough = np.diff(np.eye(intervals + 3), 3, axis=0)
    normal += 2e-3 * float(np.trace(normal)) / intervals * rough.T @ rough
    return np.asarray(np.linalg.solve(normal + 1e-12 * np.eye(intervals + 3), right), np.float64)


def spline_at(coefficients: FloatArray, place: FloatArray, reach: float) -> FloatArray:
    """The spline of `coefficients` over +-`reach` at `place` (s,), (s,)."""
    cell, weights = _bumps(place, reach, coefficients.size - 3)
    return np.asarray(sum(one * coefficients[cell + a] for a, one in enumerate(weights)))


def _bumps(
    place: FloatArray, reach: float, intervals: int
) -> tuple[IntArray, tuple[FloatArray, ...]]:
    """Interval of each `place` (s,) between even knots over +-`reach`, and its four B-splines."""
    knot = np.clip((place + reach) * (intervals / (2.0 * reach)), 0.0, intervals - 1e-9)
    cell = knot.astype(np.int64)
    u = knot - cell
    return cell, (
        (1.0 - u) ** 3 / 6.0,
        (3.0 * u**3 - 6.0 * u**2 + 4.0) / 6.0,
        (-3.0 * u**3 + 3.0 * u**2 + 3.0 * u + 1.0) / 6.0,
        u**3 / 6.0,
    )
