"""Compiled loops of the search for passages: samples to medians of buckets, turning points, half-level crossings.

    values (n,) --bucket_medians--> medians (n / bucket,) --turning_points--> places --half_level--> middle, width, height, base

Each goes over its input once and writes into arrays that the caller gives.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.compiled import compiled
from tirelog.recording import FloatArray, IntArray


@compiled
def bucket_medians(values: FloatArray, bucket: int, sign: float, medians: NDArray[np.float32], extremes: FloatArray) -> None:
    """Median of the four quarters' means in each bucket of `values` (n,), times `sign`, into `medians` (ceil(n / bucket),); of those
    quarters that are whole; NaN where none is.  `extremes` (2,): least and largest sample so far.  `bucket`: a multiple of 4."""
    quarter = bucket // 4
    low, high = extremes[0], extremes[1]
    for k in range(medians.size):
        first = k * bucket
        if first + bucket <= values.size:
            if quarter == 1:
                t0, t1, t2, t3 = values[first], values[first + 1], values[first + 2], values[first + 3]
            else:
                t0 = _sum(values, first, quarter)
                t1 = _sum(values, first + quarter, quarter)
                t2 = _sum(values, first + 2 * quarter, quarter)
                t3 = _sum(values, first + 3 * quarter, quarter)
            if np.isfinite(t0 + t1 + t2 + t3):
                # selects, which the compiler makes branchless; min() and max() are not
                low01, high01 = (t0, t1) if t0 < t1 else (t1, t0)
                low23, high23 = (t2, t3) if t2 < t3 else (t3, t2)
                least, second = (low01, low23) if low01 < low23 else (low23, low01)
                largest, third = (high01, high23) if high01 > high23 else (high23, high01)
                medians[k] = sign * 0.5 * (second + third) / quarter
                if quarter == 1:
                    low = least if least < low else low
                    high = largest if largest > high else high
                else:
                    for i in range(first, first + bucket):
                        low = values[i] if values[i] < low else low
                        high = values[i] if values[i] > high else high
                continue
        medians[k] = sign * _median_of_some(values, first, quarter)
        for i in range(first, min(first + bucket, values.size)):
            low = values[i] if values[i] < low else low
            high = values[i] if values[i] > high else high
    extremes[0], extremes[1] = low, high


@compiled
def _sum(values: FloatArray, first: int, count: int) -> float:
    total = 0.0
    for i in range(first, first + count):
        total += values[i]
    return total


@compiled
def _median_of_some(values: FloatArray, first: int, quarter: int) -> float:
    """Median of the means of those of four quarters that are whole, NaN where none is."""
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
def running_medians(values: FloatArray, first: int, sign: float, medians: NDArray[np.float32], extremes: FloatArray) -> None:
    """Running median of three of `values` from place `first` on, times `sign`, into `medians`; the ends of `values` and the neighbours of
    lost samples stay as they are.  `extremes` as for `bucket_medians`."""
    for k in range(medians.size):
        i = first + k
        value = values[i]
        if value < extremes[0]:
            extremes[0] = value
        if value > extremes[1]:
            extremes[1] = value
        if 0 < i < values.size - 1:
            before, after = values[i - 1], values[i + 1]
            if before == before and after == after and value == value:
                value = max(min(before, value), min(max(before, value), after))
        medians[k] = sign * value


@compiled
def turning_points(values: NDArray[np.float32], least: float, points: NDArray[np.int32]) -> int:
    """Places of the alternating extremes of `values` whose rises and falls are at least `least`, into `points`; how many.

    The first and the last are the extremes before the first and after the last such rise or fall.  Of equal extremes the first counts.
    """
    low = high = 0
    count = 0
    direction = 0
    for i in range(1, values.size):
        value = values[i]
        if direction >= 0 and value > values[high]:
            high = i
        if direction <= 0 and value < values[low]:
            low = i
        fall, rise = values[high] - value, value - values[low]
        if direction >= 0 and fall > 0 and fall >= least:
            points[count] = high
            count += 1
            direction, low = -1, i
        elif direction <= 0 and rise > 0 and rise >= least:
            points[count] = low
            count += 1
            direction, high = 1, i
    if direction != 0:
        points[count] = high if direction > 0 else low
        count += 1
    return count


@compiled
def half_level(values: NDArray[np.float32], peak: IntArray, left: IntArray, right: IntArray, pulses: FloatArray) -> None:
    """Pulses between the valleys `left` and `right` of each `peak` (n,), into `pulses` (n, 4): middle of the half-level crossings and
    width between them [places of `values`], height above the higher valley, that valley's level.

    The higher of the two valleys: a downward jump of the instrument may stand for the other.
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
        pulses[k, 0] = 0.5 * (entry + leave)
        pulses[k, 1] = leave - entry
        pulses[k, 2] = values[peak[k]] - base
        pulses[k, 3] = base


@compiled
def _share(below: float, above: float, level: float) -> float:
    """Where between two places `level` lies, 0 to 1; half way between equal ones."""
    rise = np.float64(above) - below
    return min(max((level - below) / rise, 0.0), 1.0) if rise != 0.0 else 0.5


@compiled
def medians_around(values: FloatArray, reach: int, sorted_: FloatArray, medians: FloatArray) -> None:
    """Median of the values that are there within `reach` places on either side, into `medians` (n,), NaN where none is; `sorted_`
    (2 reach + 1,) is scratch."""
    for i in range(values.size):
        there = 0
        for j in range(max(i - reach, 0), min(i + reach + 1, values.size)):
            value = values[j]
            if value == value:
                place = there
                while place > 0 and sorted_[place - 1] > value:
                    sorted_[place] = sorted_[place - 1]
                    place -= 1
                sorted_[place] = value
                there += 1
        medians[i] = 0.5 * (sorted_[(there - 1) // 2] + sorted_[there // 2]) if there > 0 else np.nan
