"""The 48-step encoder: pulses to teeth, tooth errors, and the angle of the wheel."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray

# ---- The tooth finder: what is done once per sample, and once per tooth.
#
#     samples (size,)
#         --extremes of chunks, sliding--> upper, lower (chunks,): the sides of the hysteresis
#         --hysteresis--> changes of side
#         --sums over windows--> sub-sample places (n,)
#
# Samples are finite.  Thresholds hold for a chunk of CHUNK samples.

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


def extremes(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Largest and least sample per chunk, the last cut short; shape (ceil(size / CHUNK),)."""
    starts = np.arange(0, x.size, CHUNK)
    return np.maximum.reduceat(x, starts), np.minimum.reduceat(x, starts)


def without_spikes(high: FloatArray) -> FloatArray:
    """Maxima of chunks without those of glitches.

    None is above all of the chunks two and three places away: a glitch lies in one chunk or two,
    not so a tooth.
    """
    around = np.pad(high, 3, mode="edge")
    far = np.max([around[:-6], around[1:-5], around[5:-1], around[6:]], axis=0)
    return np.asarray(np.minimum(high, far), np.float64)


def sliding_maximum(values: FloatArray, reach: int) -> FloatArray:
    """Largest value within `reach` places on both sides, shape as given."""
    largest, size = np.pad(values, reach, constant_values=-np.inf), 1
    while size <= reach:  # the windows double as long as two of them make a larger one
        largest, size = np.maximum(largest[:-size], largest[size:]), 2 * size
    rest = 2 * reach + 1 - size
    return np.maximum(largest[: largest.size - rest], largest[rest:])


def changes(
    x: FloatArray, upper: FloatArray, lower: FloatArray, at: int, last: int
) -> tuple[IntArray, IntArray, BoolArray]:
    """Every change of side of the samples: last on the old side, first on the new one, rising.

    Shape (n,) each. A sample is on a side if it is above its chunk's `upper` or below its `lower`.
    `last` is the side before the first sample (1 or -1, 0 if it is not known), `at` (negative)
    when it was taken.
    """
    high, low = (np.repeat(level, CHUNK)[: x.size] for level in (upper, lower))
    side = (x > high).astype(np.int8) - (x < low)
    sure = np.flatnonzero(side)
    place, side = np.append(at, sure), np.append(last, side[sure])
    turned = np.flatnonzero(side[1:] * side[:-1] < 0)
    return place[turned], place[turned + 1], side[turned + 1] > 0


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
    quick = (before >= 0) & (after - before < slow)
    coarse = np.where(quick, 0.5 * (before + after), after - 0.5)
    if square or coarse.size <= 2 * AROUND:
        return coarse
    total = np.concatenate([[0.0], np.cumsum(x)])
    level = _middles(x, total, coarse, before, after, slow)
    low, high = x[np.maximum(before, 0)], x[after]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip((level - low) / (high - low), 0.0, 1.0)
    place = np.where(quick & (high != low), before + share * (after - before), coarse)
    step = np.diff(place)
    sides = np.stack([np.append(step[0], step), np.append(step, step[-1])])
    least, most = sides.min(axis=0), sides.max(axis=0)
    half = np.where(most <= 1.8 * least, 0.5 * (least + most), least)
    centre = (place + 0.5).astype(np.int64)
    reach = np.maximum((WINDOW * half).astype(np.int64), 1)
    inside = (centre >= reach) & (centre < x.size - reach)
    row = np.flatnonzero(quick & (half > 2.0) & (half < slow) & inside)
    centre, k, omega = centre[row], reach[row], np.pi / half[row]
    earlier, later = total[centre] - total[centre - k], total[centre + k + 1] - total[centre + 1]
    area = earlier + later + x[centre] - (2 * k + 1) * level[row]
    near, far = np.tan(0.5 * k * omega), np.tan(0.5 * (k + 1) * omega)
    with np.errstate(divide="ignore", invalid="ignore"):
        tangent = area / (later - earlier) * (2 * near * far / (near + far))
    shift = np.arctan(tangent) / omega
    place[row] = np.where(np.abs(shift) < 0.5 * np.pi / omega, centre - shift, place[row])
    return place


def _middles(
    x: FloatArray,
    total: FloatArray,
    coarse: FloatArray,
    before: IntArray,
    after: IntArray,
    slow: float,
) -> FloatArray:
    """Middle level at each crossing (n,), in the unit of `x` (size,).

    `total` (size + 1,) sums of the first samples. The mean over the whole periods within AROUND on
    both sides, from crossing to crossing; half way between the samples `before` and `after` if they
    are slow.
    """
    place = coarse + 0.5
    whole = np.clip(place.astype(np.int64), 0, x.size - 1)
    below = total[whole] + (place - whole) * x[whole]
    number = np.arange(coarse.size)
    first = np.maximum(number - 2 * AROUND, 0)
    last = np.minimum(number + 2 * AROUND, coarse.size - 1)
    last -= (last - first) % 2
    span = coarse[last] - coarse[first]
    periods = (span > 0) & (span < 8 * slow)
    mean = (below[last] - below[first]) / np.where(periods, span, 1.0)
    return np.where(periods, mean, 0.5 * (x[np.maximum(before, 0)] + x[after]))


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

    def _knot_at(self, time_s: FloatArray) -> IntArray:
        """The knot before each time, or the first one; NaN counts as the end."""
        at = np.searchsorted(self.time_s, time_s, side="right") - 1
        return np.clip(at, 0, self.time_s.size - 1)

    def noise_at(self, time_s: FloatArray) -> FloatArray:
        """Standard deviation [rad] of the angles at times, of which NaN counts as the end."""
        if not self.grid_rad.size:
            return np.full(time_s.shape, self.noise_rad)
        return self.grid_rad[self._knot_at(time_s)].astype(np.float64)

    def shared_noise_at(self, time_s: FloatArray) -> FloatArray:
        """The part of `noise_at` [rad] that angles a patch apart have in common, at times."""
        return self.noise_at(time_s) if self.grid_rad.size else np.zeros(time_s.shape)

    def stretch_at(self, time_s: FloatArray) -> IntArray:
        """Number of the stretch at times, of which NaN counts as the end."""
        return self.stretch[self._knot_at(time_s)].astype(np.int64)

    @cached_property
    def _climbing(self) -> NDArray[np.int32] | FloatArray:
        """The counts, none below one before it.

        A wheel that has rolled back has its angles again later.
        """
        return np.maximum.accumulate(self.count)

    def coarse(self, time_s: FloatArray) -> FloatArray:
        """Angle [rad] at ascending times, straight between the knots; NaN outside of them."""
        first, last = np.searchsorted(self.time_s, time_s[[0, -1]])
        near = slice(max(first - 1, 0), last + 1)
        angle = self.count[near] * self.unit_rad
        return np.interp(time_s, self.time_s[near], angle, left=np.nan, right=np.nan)

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
