"""The 48-step encoder: pulses to teeth, tooth errors, and the angle of the wheel."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel
from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray

# ---- Compiled kernels of the tooth finder: what is done once per sample, and once per tooth.
#
#     samples (size,)
#         --extremes of chunks, sliding--> upper, lower (chunks,): the sides of the hysteresis
#         --hysteresis--> side of each sample, changes of side
#         --sums over windows--> sub-sample places (n,)
#
# Samples are finite, float64, C-contiguous.  Thresholds hold for a chunk of CHUNK samples.

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


# ---- The wheel angle as a smooth function of time.
#
#     knots (n,) with angle and rate
#         --Hermite--> angle at any time, time at any angle, mean rate over a window
#
# Angles grow in the direction of rolling. Between knots the angle is the cubic that has both knots'
# angles and rates, so it is continuous with its rate.


#: counts worked on at once
PIECE = 1 << 15


@compiled
def _hermite(
    at: FloatArray, time: FloatArray, count: Any, rate: Any, unit: float, result: FloatArray
) -> None:
    """Fills `result` (n,) with the cubics' angles [rad] at the times `at` (n,) [s].

    These are in any order; NaN outside of the knots. Ascending times are quickest. Knots (k,):
    `time` [s], ascending, `count` times `unit` [rad], `rate` [rad/s].
    """
    n, k = time.size, 0
    low = high = np.nan
    start = first = second = third = angle = 0.0
    for i in range(at.size):
        t = at[i]
        if not low <= t < high:
            if not time[0] <= t <= time[n - 1]:
                result[i] = np.nan
                continue
            if k + 2 < n and time[k + 1] <= t < time[k + 2]:
                k += 1
            else:
                k = min(np.searchsorted(time, t, side="right") - 1, n - 2)
            low, high = time[k], time[k + 1]
            start, angle, first, last = (
                low,
                count[k] * unit,
                np.float64(rate[k]),
                np.float64(rate[k + 1]),
            )
            h = high - low if high > low else 1.0
            mean = (count[k + 1] - count[k]) * unit / h
            second, third = (3 * mean - 2 * first - last) / h, (first + last - 2 * mean) / h**2
        s = t - start
        result[i] = angle + s * (first + s * (second + s * third))


@dataclass(frozen=True)
class AngleFunction:
    """Knots of the wheel angle, shape (n,).

    `time_s` ascending, `count` in units of `unit_rad`, `rate_rad_s`, `stretch` the run without a
    loss of the count; `noise_rad` standard deviation of an angle read from it. The types are small:
    an hour has millions of knots.

    The edges of pulses and counts lie between two samples, so such errors grow with the speed and
    are alike from tooth to tooth: `grid_rad` has their standard deviation at each knot, `noise_rad`
    is their median. It is empty for other sensors.
    """

    time_s: FloatArray
    count: NDArray[np.int32] | FloatArray
    unit_rad: float
    rate_rad_s: NDArray[np.float32]
    stretch: NDArray[np.int32]
    noise_rad: float
    grid_rad: NDArray[np.float32] = field(default_factory=lambda: np.zeros(0, np.float32))

    def noise_at(self, time_s: FloatArray) -> FloatArray:
        """Standard deviation [rad] of the angles at times, of which NaN counts as the end."""
        if not self.grid_rad.size:
            return np.full(time_s.shape, self.noise_rad)
        at = np.searchsorted(self.time_s, time_s, side="right") - 1
        return self.grid_rad[np.clip(at, 0, self.time_s.size - 1)].astype(np.float64)

    def shared_noise_at(self, time_s: FloatArray) -> FloatArray:
        """The part of `noise_at` [rad] that angles a patch apart have in common, at times."""
        return self.noise_at(time_s) if self.grid_rad.size else np.zeros(time_s.shape)

    def knots(self, low: int, high: int) -> tuple[FloatArray, FloatArray]:
        """Times [s] and angles [rad] of the knots [low, high)."""
        return self.time_s[low:high], np.asarray(
            self.count[low:high] * self.unit_rad, dtype=np.float64
        )

    def stretch_at(self, time_s: FloatArray) -> IntArray:
        """Number of the stretch at times, of which NaN counts as the end."""
        return self.stretch[
            np.clip(np.searchsorted(self.time_s, time_s, side="right") - 1, 0, self.time_s.size - 1)
        ].astype(np.int64)

    @cached_property
    def _climbing(self) -> NDArray[np.int32] | FloatArray:
        """The counts, none below one before it.

        A wheel that has rolled back has its angles again later.
        """
        forward = all(
            bool(np.all(np.diff(self.count[s : s + PIECE + 1]) >= 0))
            for s in range(0, self.count.size, PIECE)
        )
        return self.count if forward else np.maximum.accumulate(self.count)

    def coarse(self, time_s: FloatArray) -> FloatArray:
        """Angle [rad] at ascending times, straight between the knots; NaN outside of them."""
        low, high = np.searchsorted(self.time_s, time_s[[0, -1]])
        times, angles = self.knots(max(int(low) - 1, 0), int(high) + 1)
        return (
            np.interp(time_s, times, angles, left=np.nan, right=np.nan)
            if times.size
            else np.full(time_s.size, np.nan)
        )

    def at(self, time_s: FloatArray) -> FloatArray:
        """Angle [rad] at the times, NaN outside of the knots, shape as given."""
        result = np.empty(time_s.shape)
        if result.size and self.time_s.size > 1:
            _hermite(
                finite(time_s).ravel(),
                self.time_s,
                self.count,
                self.rate_rad_s,
                self.unit_rad,
                result.reshape(-1),
            )
        elif result.size:
            result.fill(np.nan)
        return result

    def time_at(self, angle_rad: FloatArray) -> FloatArray:
        """Time [s] at which a forward-rolling wheel has the angles; NaN outside of the knots."""
        climbing, wanted = self._climbing, angle_rad / self.unit_rad
        # counts up to a whole number are those up to what is wanted; a search for floats would copy
        # millions of counts
        last = (
            np.floor(np.nan_to_num(np.clip(wanted, -2e9, 2e9))).astype(np.int32)
            if climbing.dtype == np.int32
            else wanted
        )
        k = np.clip(np.searchsorted(climbing, last, side="right") - 1, 0, climbing.size - 2)
        start, rise = climbing[k], (climbing[k + 1] - climbing[k]).astype(np.float64)
        u = np.where(rise > 0, (wanted - start) / np.where(rise > 0, rise, 1.0), 0.0)
        h = self.time_s[k + 1] - self.time_s[k]
        inside = (u > -1e-9) & (u < 1 + 1e-9)
        near = np.where(inside, self.time_s[k] + np.clip(u, 0.0, 1.0) * h, self.time_s[0])
        rate = np.where(rise > 0, rise * self.unit_rad / np.where(h > 0, h, 1.0), np.inf)
        for _ in range(2):
            near = np.clip(
                near - (self.at(near) - angle_rad) / rate, self.time_s[k], self.time_s[k + 1]
            )
        return np.where(inside, near, np.nan)

    def mean_rate(self, time_s: FloatArray, span_s: float) -> FloatArray:
        """Rate [rad/s] over a window of `span_s` centred at each time, cut at the ends.

        A low-pass with -3 dB at 0.443 / span_s.
        """
        first, last = (
            np.maximum(time_s - span_s / 2, self.time_s[0]),
            np.minimum(time_s + span_s / 2, self.time_s[-1]),
        )
        span = np.where(last > first, last - first, np.nan)
        return (self.at(last) - self.at(first)) / span


# ---- Counters and angle channels.
#
# The wheel angle is already there, and only its steps must become knots in time.
#
# samples (size,) of counts or angles --changes, unwrapped--> times (n,) [s] and turns (n,) [1]


#: knots per second that an angle channel keeps; twice as many follow twice as quick a shake in
#: twice the memory
ANGLE_KNOTS_Hz = 500.0


def counter_knots(
    channel: Channel, size: float, is_angle: bool
) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """(times [s], turns, backward) of a channel that counts `size` per turn.

    Knots shape (n,), `backward` True if it rolls back.

    A counter that jumps from c to d between two samples has passed (c + d + 1) / 2 in their middle.
    A counter that jumps by more than half of the next power of two has wrapped; one that has been
    below zero has a sign, and twice as many numbers. An angle wraps at a turn.
    """
    times, counts = [], []
    wrap, offset, last = (size, 0.0, np.nan) if is_angle else (0.0, 0.0, np.nan)
    every = max(int(channel.axis.rate_Hz / ANGLE_KNOTS_Hz), 1) if is_angle else 1
    for start, block in channel.blocks():
        index: FloatArray = np.arange(start, start + block.size, dtype=np.float64)
        known = np.isfinite(block)
        x, index = block[known], index[known]
        if x.size == 0:
            continue
        if not is_angle:
            low, high = float(x.min()), float(x.max())
            bits = max(np.ceil(np.log2(max(high + 1.0, -low, 2.0))), 7 if low < 0 else 8)
            wrap = max(wrap, 2.0 ** (bits + (low < 0)))
        before = np.concatenate([[last if np.isfinite(last) else x[0]], x[:-1]])
        step = x - before
        turned = np.where(step < -wrap / 2, wrap, 0.0) - np.where(step > wrap / 2, wrap, 0.0)
        unwrapped = x + offset + np.cumsum(turned)
        offset, last = float(unwrapped[-1] - x[-1]), float(x[-1])
        if is_angle:
            pick = np.arange((-start) % every, x.size, every)
            times.append(channel.axis.at(index[pick]))
            counts.append(unwrapped[pick])
        else:
            change = np.flatnonzero(step + turned)
            times.append(channel.axis.at(np.asarray(index[change] - 0.5)))
            counts.append(unwrapped[change] - 0.5 * (step + turned)[change] + 0.5)
    if not times:
        return np.zeros(0), np.zeros(0), np.zeros(0, bool)
    time, turns = np.concatenate(times), np.concatenate(counts) / size
    if turns.size and turns[-1] < turns[0]:
        turns = -turns  # a count that falls as the wheel rolls forward
    backward = np.concatenate([[False], np.diff(turns) < 0]) if turns.size else np.zeros(0, bool)
    return time, turns, backward
