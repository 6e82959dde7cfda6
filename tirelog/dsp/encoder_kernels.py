"""Compiled kernels of the tooth finder: what is done once per sample, and once per tooth.

    samples (size,)
        --extremes of chunks, sliding--> upper, lower (chunks,): the sides of the hysteresis
        --hysteresis--> side of each sample, changes of side
        --sums over windows--> sub-sample places (n,)

Samples are finite, float64, C-contiguous.  Thresholds hold for a chunk of CHUNK samples.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray

Bytes = NDArray[np.int8]
#: deviations of passages [rad] that were summed: how many, their sum, the sum of their squares
SUMS = np.dtype([("number", "f8"), ("total", "f8"), ("squares", "f8")])

#: samples whose extremes are taken together
CHUNK = 64
#: half width of the window, in half periods (the least variance of a sum's zero is at tan m = 2 m,
#: m = 1.17 rad)
WINDOW = 0.35
#: periods on each side whose mean is the middle level; twice as many follow a level that drifts
#: half as quickly
AROUND = 2


@compiled
def extremes(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Largest and least sample per chunk, the last cut short; shape (ceil(size / CHUNK),)."""
    chunks = (x.size + CHUNK - 1) // CHUNK
    high, low = np.empty(chunks), np.empty(chunks)
    for c in range(chunks):
        start, stop = c * CHUNK, min((c + 1) * CHUNK, x.size)
        # four chains of comparisons, which the processor works on side by side
        h0 = h1 = h2 = h3 = l0 = l1 = l2 = l3 = x[start]
        i = start
        while i + 4 <= stop:
            a, b, e, d = x[i], x[i + 1], x[i + 2], x[i + 3]
            h0, l0 = (a if a > h0 else h0), (a if a < l0 else l0)
            h1, l1 = (b if b > h1 else h1), (b if b < l1 else l1)
            h2, l2 = (e if e > h2 else h2), (e if e < l2 else l2)
            h3, l3 = (d if d > h3 else h3), (d if d < l3 else l3)
            i += 4
        while i < stop:
            h0, l0 = max(h0, x[i]), min(l0, x[i])
            i += 1
        high[c], low[c] = max(max(h0, h1), max(h2, h3)), min(min(l0, l1), min(l2, l3))
    return high, low


@compiled
def without_spikes(high: FloatArray) -> FloatArray:
    """Maxima of chunks without those of glitches.

    None is above all of the chunks two and three places away: a glitch lies in one chunk or two,
    not so a tooth.
    """
    n = high.size
    clean = np.empty(n)
    for c in range(n):
        before = max(high[max(c - 3, 0)], high[max(c - 2, 0)])
        after = max(high[min(c + 2, n - 1)], high[min(c + 3, n - 1)])
        clean[c] = min(high[c], max(before, after))
    return clean


@compiled
def sliding_maximum(values: FloatArray, reach: int) -> FloatArray:
    """Largest value within `reach` places on both sides, shape as given.

    By maxima from the edges of blocks of one window.
    """
    n, width = values.size, 2 * reach + 1
    size = n + 2 * reach
    ahead, behind, result = np.empty(size), np.empty(size), np.empty(n)
    for i in range(
        size
        # loops only: every array function that numba has to compile costs memory and time at the
        # first call
    ):
        ahead[i] = behind[i] = values[i - reach] if reach <= i < reach + n else -np.inf
    for i in range(size):
        if i % width:
            ahead[i] = max(ahead[i - 1], ahead[i])
    for i in range(size - 2, -1, -1):
        if (i + 1) % width:
            behind[i] = max(behind[i + 1], behind[i])
    for i in range(n):
        result[i] = max(behind[i], ahead[i + 2 * reach])
    return result


@compiled
def sides(x: FloatArray, upper: FloatArray, lower: FloatArray) -> Bytes:
    """1 if a sample is above its chunk's `upper`, -1 if below its `lower`, else 0.

    Shape (size,).
    """
    side = np.empty(x.size, np.int8)
    for c in range(upper.size):
        part, here = x[c * CHUNK : (c + 1) * CHUNK], side[c * CHUNK : (c + 1) * CHUNK]
        high, low = upper[c], lower[c]
        for i in range(part.size):
            here[i] = (1 if part[i] > high else 0) - (1 if part[i] < low else 0)
    return side


@compiled
def changes(side: Bytes, at: int, last: int) -> tuple[IntArray, IntArray]:
    """Every change of side: last sample on the old side and first on the new one, shape (n,).

    `last` is the side before the first sample (0 if it is not known), `at` (negative) when it
    was taken.
    """
    before, after, n = np.empty(side.size + 1, np.int64), np.empty(side.size + 1, np.int64), 0
    for i in range(side.size):
        # without branches, which the processor would guess wrong at every tooth: what is no change
        # is written over
        now = int(side[i])
        before[n], after[n] = at, i
        n += 1 if now * last < 0 else 0
        at, last = (i if now != 0 else at), (now if now != 0 else last)
    return before[:n], after[:n]


@compiled
def _sums(x: FloatArray) -> FloatArray:
    """Sums of the first 0, 1, ..., size samples, shape (size + 1,).

    Four at a time, so that each sum waits for one addition only.
    """
    total = np.empty(x.size + 1)
    total[0] = s = 0.0
    i = 0
    while i + 4 <= x.size:
        a = x[i]
        b = a + x[i + 1]
        c = b + x[i + 2]
        d = c + x[i + 3]
        total[i + 1], total[i + 2], total[i + 3] = s + a, s + b, s + c
        s += d
        total[i + 4] = s
        i += 4
    while i < x.size:
        s += x[i]
        i += 1
        total[i] = s
    return total


def places(
    x: FloatArray, before: IntArray, after: IntArray, slow: float, square: bool
) -> FloatArray:
    """Fractional index in `x` of each change of side, shape (n,).

    The change lies between the samples `before` and `after`. Half a sample ahead of `after` if the
    change took `slow` samples or longer; half way if the signal is square or there are too few
    changes; else the zero of the sine whose samples around it have the same sum, and the same
    difference between the k samples after the middle one and the k before it. For A sin(omega (i -
    t)) the sum over its factor is A sin, the difference over its factor A cos of omega (centre -
    t); the quotient of the factors is 2 / (cot(k omega / 2) + cot((k + 1) omega / 2)).
    """
    coarse = np.where((before >= 0) & (after - before < slow), 0.5 * (before + after), after - 0.5)
    if square or coarse.size <= 2 * AROUND:
        return coarse
    rough, centre, k, omega, quotient = _windows(x, coarse, before, after, slow)
    near, far = np.tan(0.5 * k * omega), np.tan(0.5 * (k + 1) * omega)
    shift = np.arctan(quotient * (2 * near * far / (near + far))) / omega
    return np.where(np.abs(shift) < 0.5 * np.pi / omega, centre - shift, rough)


class Sines(NamedTuple):
    """A sine around each crossing of the middle level, (n,) each; NaN if none can be laid.

    rough     the crossing by a straight line [samples]
    centre    the middle of the window [samples]; reach: k, samples on either side of it
    omega     [rad per sample]
    quotient  the samples' sum over their difference
    """

    rough: FloatArray
    centre: FloatArray
    reach: FloatArray
    omega: FloatArray
    quotient: FloatArray


@compiled
def _windows(
    x: FloatArray, coarse: FloatArray, before: IntArray, after: IntArray, slow: float
) -> Sines:
    """The middle level's crossing by a straight line, and the sine around it.

    `x` (size,); `coarse` (n,) places, `before` and `after` (n,) samples of each change of side,
    between which the crossing lies; `slow` [samples].
    """
    n, total = coarse.size, _sums(x)
    level = _middles(x, total, coarse, before, after, slow)
    rough, middle, k_of, omega_of, quotient = (
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
        np.empty(n),
    )
    for k in range(n):
        low, high = x[max(before[k], 0)], x[after[k]]
        span = after[k] - before[k]
        share = (level[k] - low) / (high - low)
        rough[k] = (
            before[k] + min(max(share, 0.0), 1.0) * span
            if before[k] >= 0 and span < slow and high != low
            else coarse[k]
        )
    for k in range(n):
        left = rough[max(k, 1)] - rough[max(k, 1) - 1]
        right = rough[min(k, n - 2) + 1] - rough[min(k, n - 2)]
        half = (
            0.5 * (left + right) if max(left, right) <= 1.8 * min(left, right) else min(left, right)
        )
        centre, reach = int(rough[k] + 0.5), max(int(WINDOW * half), 1)
        middle[k] = k_of[k] = omega_of[k] = quotient[k] = np.nan
        near = before[k] >= 0 and after[k] - before[k] < slow and 2.0 < half < slow
        if near and centre >= reach and centre < x.size - reach:
            earlier, later = (
                total[centre] - total[centre - reach],
                total[centre + reach + 1] - total[centre + 1],
            )
            if later != earlier:
                omega = np.pi / half
                area = earlier + later + x[centre] - (2 * reach + 1) * level[k]
                middle[k], k_of[k], omega_of[k], quotient[k] = (
                    centre,
                    reach,
                    omega,
                    area / (later - earlier),
                )
    return Sines(rough, middle, k_of, omega_of, quotient)


@compiled
def _middles(
    x: FloatArray,
    total: FloatArray,
    coarse: FloatArray,
    before: IntArray,
    after: IntArray,
    slow: float,
) -> FloatArray:
    """Middle level at each crossing (n,), in the unit of `x` (size,).

    `total` (size + 1,) of `_sums`. The mean over the whole periods within AROUND on both sides,
    from crossing to crossing; half way between the samples `before` and `after` if they are slow.
    """
    n = coarse.size
    below, level = np.empty(n), np.empty(n)
    for k in range(n):
        place = coarse[k] + 0.5
        whole = min(int(place), x.size - 1)
        below[k] = total[whole] + (place - whole) * x[whole]
    for k in range(n):
        first, last = max(k - 2 * AROUND, 0), min(k + 2 * AROUND, n - 1)
        last -= (last - first) % 2
        span = coarse[last] - coarse[first]
        if 0 < span < 8 * slow:
            level[k] = (below[last] - below[first]) / span
        else:
            level[k] = 0.5 * (x[max(before[k], 0)] + x[after[k]])
    return level


def finite(x: Any) -> FloatArray:
    """`x` as the kernels take it: float64, contiguous, writable (a copy if it is not)."""
    return np.require(x, np.float64, ["C", "W"])
