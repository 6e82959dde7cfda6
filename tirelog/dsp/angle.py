"""The wheel angle as a smooth function of time, from counted tooth passages.

    times (n,), counts (n,), pitch errors --local cubic least squares--> knots with angle and rate --Hermite--> angle at any time

Angles grow with the counts, in the direction of rolling.  A run of knots is smoothed where the passages come quickly; between
knots the angle is the cubic that has both knots' angles and rates, so it is continuous with its rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from tirelog.dsp.encoder_signal import Integers
from tirelog.recording import FloatArray, IntArray

#: times worked on at once: small enough for the cache
PIECE = 1 << 15
#: passages on each side in the local least squares
REACH = 3
#: value and slope, at the middle, of the least-squares cubic through seven even points
CUBIC_VALUE = np.array([-2.0, 3.0, 6.0, 7.0, 6.0, 3.0, -2.0]) / 21.0
CUBIC_SLOPE = np.array([22.0, -67.0, -58.0, 0.0, 58.0, 67.0, -22.0]) / 252.0


@dataclass(frozen=True)
class AngleFunction:
    """Knots of the wheel angle, shape (n,): `time_s` ascending, `count` in units of `unit_rad`, `rate_rad_s`, `stretch` the run without a
    loss of the count; `noise_rad` standard deviation of an angle read from it.  The types are small: an hour has millions of knots."""

    time_s: FloatArray
    count: Integers | FloatArray
    unit_rad: float
    rate_rad_s: NDArray[np.float32]
    stretch: NDArray[np.int16]
    noise_rad: float

    def knots(self, low: int, high: int) -> tuple[FloatArray, FloatArray]:
        """Times [s] and angles [rad] of the knots [low, high)."""
        return self.time_s[low:high], np.asarray(self.count[low:high] * self.unit_rad, dtype=np.float64)

    def stretch_at(self, time_s: FloatArray) -> IntArray:
        """Number of the stretch at times, of which NaN counts as the end."""
        return self.stretch[np.clip(np.searchsorted(self.time_s, time_s, side="right") - 1, 0, self.time_s.size - 1)].astype(np.int64)

    @cached_property
    def _climbing(self) -> Integers | FloatArray:
        """The counts, none below one before it: a wheel that has rolled back has its angles again later."""
        forward = all(bool(np.all(np.diff(self.count[s : s + PIECE + 1]) >= 0)) for s in range(0, self.count.size, PIECE))
        return self.count if forward else np.maximum.accumulate(self.count)

    def _knot(self, time_s: FloatArray) -> IntArray:
        """The knot before each of the times."""
        if time_s.size > 1000 and bool(np.all(time_s[1:] >= time_s[:-1])):
            low, high = np.searchsorted(self.time_s, time_s[[0, -1]], side="right")
            if time_s.size > 2 * (high - low):  # denser than the knots: place the knots among the times
                starts = np.searchsorted(time_s, self.time_s[low:high], side="left")
                runs = np.diff(np.concatenate([[0], starts, [time_s.size]]))
                return np.clip(np.repeat(np.arange(low - 1, high), runs), 0, self.time_s.size - 2)
        return np.clip(np.searchsorted(self.time_s, time_s, side="right") - 1, 0, self.time_s.size - 2)

    def coarse(self, time_s: FloatArray) -> FloatArray:
        """Angle [rad] at ascending times, straight between the knots; NaN outside of them."""
        low, high = np.searchsorted(self.time_s, time_s[[0, -1]])
        times, angles = self.knots(max(int(low) - 1, 0), int(high) + 1)
        return np.interp(time_s, times, angles, left=np.nan, right=np.nan) if times.size else np.full(time_s.size, np.nan)

    def at(self, time_s: FloatArray) -> FloatArray:
        """Angle [rad] at the times, NaN outside of the knots, shape as given."""
        if time_s.size == 0:
            return np.zeros(0)
        if time_s.size > PIECE:
            return np.concatenate([self.at(time_s[start : start + PIECE]) for start in range(0, time_s.size, PIECE)])
        knot = self._knot(time_s)
        low, high = int(knot.min()), int(knot.max()) + 1
        if high - low > time_s.size:  # few times, spread over a long log: the cubics of their own knots only
            start, angle, first, quadratic, cubic = self._cubics(knot)
        else:
            start, angle, first, quadratic, cubic = (c[knot - low] for c in self._cubics(np.arange(low, high)))
        s = time_s - start
        angle = angle + s * (first + s * (quadratic + s * cubic))
        outside = ~((time_s >= self.time_s[0]) & (time_s <= self.time_s[-1]))
        if outside.any():
            angle[outside] = np.nan
        return angle

    def _cubics(self, at: IntArray) -> tuple[FloatArray, ...]:
        """(time, angle, rate, and the coefficients of the square and the cube of the time since) of the cubics that begin at the knots."""
        start, first, last = self.time_s[at], self.rate_rad_s[at].astype(np.float64), self.rate_rad_s[at + 1].astype(np.float64)
        h, rise = self.time_s[at + 1] - start, (self.count[at + 1] - self.count[at]) * self.unit_rad
        h = np.where(h > 0, h, 1.0)
        mean = rise / h
        return start, np.asarray(self.count[at] * self.unit_rad), first, (3 * mean - 2 * first - last) / h, (first + last - 2 * mean) / h**2

    def time_at(self, angle_rad: FloatArray) -> FloatArray:
        """Time [s] at which a forward-rolling wheel has the angles; NaN outside of the knots."""
        climbing, wanted = self._climbing, angle_rad / self.unit_rad
        # counts up to a whole number are those up to what is wanted; a search for floats would copy millions of counts
        last = np.floor(np.nan_to_num(np.clip(wanted, -2e9, 2e9))).astype(np.int32) if climbing.dtype == np.int32 else wanted
        k = np.clip(np.searchsorted(climbing, last, side="right") - 1, 0, climbing.size - 2)
        start, rise = climbing[k], (climbing[k + 1] - climbing[k]).astype(np.float64)
        u = np.where(rise > 0, (wanted - start) / np.where(rise > 0, rise, 1.0), 0.0)
        h = self.time_s[k + 1] - self.time_s[k]
        inside = (u > -1e-9) & (u < 1 + 1e-9)
        near = np.where(inside, self.time_s[k] + np.clip(u, 0.0, 1.0) * h, self.time_s[0])
        rate = np.where(rise > 0, rise * self.unit_rad / np.where(h > 0, h, 1.0), np.inf)
        near = near - (self.at(near) - angle_rad) / rate
        return np.where(inside, np.clip(near, self.time_s[k], self.time_s[k + 1]), np.nan)

    def mean_rate(self, time_s: FloatArray, span_s: float) -> FloatArray:
        """Rate [rad/s] over a window of `span_s` centred at each time, cut at the ends: a low-pass with -3 dB at 0.443 / span_s."""
        first, last = np.maximum(time_s - span_s / 2, self.time_s[0]), np.minimum(time_s + span_s / 2, self.time_s[-1])
        span = np.where(last > first, last - first, np.nan)
        return (self.at(last) - self.at(first)) / span


def smooth_angle(
    time_s: FloatArray, count: Integers, table_rad: FloatArray, unit_rad: float, stretch: Integers, noise_rad: float
) -> AngleFunction:
    """Knots from passages: times, counts and stretches of shape (n,); `table_rad` the pitch error of each count modulo its size; the angle
    of a count; the standard deviation of one passage (used where the log is too short to show it).  `time_s` becomes the knots' array.

    Each time is first brought to the nominal angle of its count; then time as a function of the count is a cubic over
    2 REACH + 1 passages.  Left as it is at the ends of a stretch, beside missing passages and where the motion is too uneven for a cubic
    (near standstill).
    """
    n, margin = time_s.size, REACH + 2
    rate = np.empty(n, np.float32)
    noises, latest, before = [], -np.inf, time_s[:0].copy()
    for start in range(0, n, PIECE):
        low, stop, high = max(start - margin, 0), min(start + PIECE, n), min(start + PIECE + margin, n)
        piece = slice(low, high)
        error = table_rad[np.mod(count[piece], table_rad.size)]
        raw = np.concatenate([before, time_s[start:high]])
        before = time_s[max(stop - margin, 0) : stop].copy()  # as they were
        smoothed, slope, left = _smoothed(raw, count[piece].astype(np.int64), error, unit_rad, stretch[piece])
        time_s[start:stop] = np.maximum.accumulate(np.maximum(smoothed[start - low : stop - low], latest))
        rate[start:stop] = slope[start - low : stop - low]
        latest = float(time_s[stop - 1])
        if left.size > 100:
            noises.append(float(np.median(np.abs(left[::5]))) / 0.6745)
    kept = float(np.sum(CUBIC_VALUE**2))
    if noises:  # what the cubics leave is the rest of the passages' noise
        noise_rad = float(np.median(noises) / np.sqrt(1 - kept))
    small = count.astype(np.int32) if np.issubdtype(count.dtype, np.integer) else count
    return AngleFunction(time_s, small, unit_rad, rate, stretch.astype(np.int16), noise_rad * float(np.sqrt(kept)))


def _smoothed(
    time_s: FloatArray, count: Integers, error_rad: FloatArray, unit_rad: float, stretch: Integers
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(times at the nominal angles, rates [rad/s], what smoothing took away [rad]) of one piece."""
    if time_s.size < 2:
        return time_s, np.zeros(time_s.size), np.zeros(0)
    rise = np.gradient(count * unit_rad)
    pace = np.where(rise == 0, 0.0, np.gradient(time_s) / np.where(rise == 0, 1.0, rise))
    time = time_s - error_rad * pace
    rate = np.where(pace == 0, 0.0, 1.0 / np.where(pace == 0, 1.0, pace))
    width, steps = 2 * REACH + 1, np.diff(time)
    if time.size <= width:
        return time, rate, np.zeros(0)
    inner = slice(REACH, time.size - REACH)
    value = np.convolve(time - time[0], CUBIC_VALUE, "valid") + time[0]
    slope = np.convolve(time - time[0], -CUBIC_SLOPE, "valid")
    span = slice(REACH, REACH + value.size)
    longest, shortest = maximum_filter1d(steps, width - 1)[span], minimum_filter1d(steps, width - 1)[span]
    regular = (stretch[width - 1 :] == stretch[: 1 - width]) & (np.abs(count[width - 1 :] - count[: 1 - width]) == width - 1)
    regular &= (longest < 2.0 * shortest) & (slope > 0)
    sign = np.sign(count[REACH + 1 : time.size - REACH + 1] - count[inner])
    rate[inner][regular] = (unit_rad * sign)[regular] / slope[regular]
    left = (time[inner] - value)[regular] * rate[inner][regular]
    time[inner][regular] = value[regular]
    return time, rate, left
