"""Compiled loops of the search for passages.

Samples to medians of buckets, turning points, half-level crossings.

    values (n,) --bucket_medians--> medians (n / bucket,) --turning_points--> places
        --half_level--> middle, width, height, base

Each goes over its input once and writes into arrays that the caller gives.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray, Records

#: a pulse: middle of its half-level crossings and width between them [places], height above the
#: higher valley and that valley's level [channel's unit]
PULSE = np.dtype([("middle", "f8"), ("width", "f8"), ("height", "f8"), ("base", "f8")])


@compiled
def bucket_medians(
    values: FloatArray, bucket: int, sign: float, medians: NDArray[np.float32]
) -> None:
    """Fills `medians` with the median of the four quarters' means in each bucket.

    Of `values` (n,), times `sign`, into `medians` (ceil(n / bucket),); of those quarters that are
    whole; NaN if none is. `bucket`: a multiple of 4.
    """
    quarter = bucket // 4
    whole = values.size // bucket
    if quarter == 1:
        fours = values[: 4 * whole].reshape(whole, 4)
    else:
        fours = np.empty((whole, 4))
        for k in range(whole):
            for j in range(4):
                fours[k, j] = _sum(values, (4 * k + j) * quarter, quarter)
    lost = _medians_of_four(fours, sign * 0.5 / quarter, medians)
    for k in range(0 if lost > 0 else whole, medians.size):
        if k >= whole or medians[k] != medians[k]:
            medians[k] = sign * _median_of_some(values, k * bucket, quarter)


@compiled
def _medians_of_four(fours: FloatArray, factor: float, medians: NDArray[np.float32]) -> int:
    """Fills `medians` with the middle of each four, scaled; how many are lost.

    The sum of the inner two of each row of `fours` (m, 4), times `factor`; NaN if one of the four
    is lost.
    """
    lost = 0
    for k in range(fours.shape[0]):
        t0, t1, t2, t3 = fours[k, 0], fours[k, 1], fours[k, 2], fours[k, 3]
        # selects, which the compiler makes branchless; min() and max() are not
        low01, high01 = (t0, t1) if t0 < t1 else (t1, t0)
        low23, high23 = (t2, t3) if t2 < t3 else (t3, t2)
        second = low23 if low01 < low23 else low01
        third = high23 if high01 > high23 else high01
        total = t0 + t1 + t2 + t3
        finite = np.isfinite(total)
        medians[k] = factor * (second + third) if finite else np.nan
        lost += not finite
    return lost


@compiled
def _sum(values: FloatArray, first: int, count: int) -> float:
    """The sum of so many of `values` from `first` on, in their order; NaN if one is lost."""
    total = 0.0
    for i in range(first, first + count):
        total += values[i]
    return total


@compiled
def _median_of_some(values: FloatArray, first: int, quarter: int) -> float:
    """Median of the means of those of four quarters that are whole, NaN if none is.

    The quarters begin at `first` and have `quarter` of `values` (n,) each.
    """
    s0 = s1 = s2 = s3 = np.inf
    there = 0
    for begin in range(first, min(first + 4 * quarter, values.size - quarter + 1), quarter):
        total = _sum(values, begin, quarter)
        if total == total:
            there += 1
            s3 = min(s3, max(s2, total))
            s2 = min(s2, max(s1, total))
            s1 = min(s1, max(s0, total))
            s0 = min(s0, total)
    if there == 4:
        return 0.5 * (s1 + s2) / quarter
    if there == 3:
        return s1 / quarter
    if there == 2:
        return 0.5 * (s0 + s1) / quarter
    return s0 / quarter if there == 1 else np.nan


@compiled
def running_medians(
    values: FloatArray, first: int, sign: float, medians: NDArray[np.float32]
) -> None:
    """Fills `medians` with the running median of three of `values`, times `sign`.

    From place `first` on; the ends of `values` and the neighbours of lost samples stay as they are.
    """
    for k in range(medians.size):
        i = first + k
        value = values[i]
        if 0 < i < values.size - 1:
            before, after = values[i - 1], values[i + 1]
            if before == before and after == after and value == value:
                value = max(min(before, value), min(max(before, value), after))
        medians[k] = sign * value


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


@compiled
def medians_around(values: FloatArray, reach: int, least: FloatArray, medians: FloatArray) -> None:
    """Fills `medians` (n,) with the median of the values around each place.

    Of the values that are there within `reach` places on either side, NaN if none is; `least` (2
    reach + 1,) is scratch.
    """
    for i in range(values.size):
        there = 0
        for j in range(max(i - reach, 0), min(i + reach + 1, values.size)):
            least[there] = values[j]
            there += values[j] == values[j]
        # the smaller half in order, by exchanges without branches
        for j in range(there // 2 + 1):
            first = least[j]
            for k in range(j + 1, there):
                other = least[k]
                least[k] = other if other > first else first
                first = first if first < other else other
            least[j] = first
        medians[i] = 0.5 * (least[(there - 1) // 2] + least[there // 2]) if there > 0 else np.nan


@compiled
def fill_lost(values: NDArray[np.float32]) -> bool:
    """Fills lost `values` (n,) by straight lines, at the ends by the nearest; False if all are."""
    before, n = -1, values.size
    for i in range(n):
        if not np.isfinite(values[i]):
            continue
        if before < 0:
            values[:i] = values[i]
        elif i > before + 1:
            first, last = np.float64(values[before]), np.float64(values[i])
            for k in range(before + 1, i):
                values[k] = first + (last - first) / (i - before) * (k - before)
        before = i
    if before >= 0:
        values[before + 1 :] = values[before]
    return before >= 0
