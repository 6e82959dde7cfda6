"""The wheel angle as a smooth function of time, from counted tooth passages.

    times (n,), counts (n,), pitch errors --local cubic least squares--> knots with angle and rate --Hermite--> angle at any time

Angles grow with the counts, in the direction of rolling.  A run of knots is smoothed where the passages come quickly; between
knots the angle is the cubic that has both knots' angles and rates, so it is continuous with its rate.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tirelog.recording import FloatArray, IntArray

#: passages on each side in the local least squares
REACH = 3
#: value and slope, at the middle, of the least-squares cubic through seven even points
CUBIC_VALUE = np.array([-2.0, 3.0, 6.0, 7.0, 6.0, 3.0, -2.0]) / 21.0
CUBIC_SLOPE = np.array([22.0, -67.0, -58.0, 0.0, 58.0, 67.0, -22.0]) / 252.0


@dataclass(frozen=True)
class AngleFunction:
    """Knots of the wheel angle: `time_s` (n,) ascending, `angle_rad` (n,), `rate_rad_s` (n,), `stretch` (n,) the run without a loss
    of the count, `noise_rad` standard deviation of an angle read from it."""

    time_s: FloatArray
    angle_rad: FloatArray
    rate_rad_s: FloatArray
    stretch: IntArray
    noise_rad: float

    def position(self, time_s: FloatArray) -> tuple[IntArray, FloatArray]:
        """(knot before, share of the way to the next one) of ascending times; shares leave [0, 1] outside of the knots."""
        at = np.clip(np.searchsorted(self.time_s, time_s, side="right") - 1, 0, self.time_s.size - 2)
        return at, (time_s - self.time_s[at]) / (self.time_s[at + 1] - self.time_s[at])

    def at(self, time_s: FloatArray) -> FloatArray:
        """Angle [rad] at the times, NaN outside of the knots, shape as given."""
        k, u = self.position(time_s)
        h = self.time_s[k + 1] - self.time_s[k]
        rise = self.angle_rad[k + 1] - self.angle_rad[k]
        a, b = self.rate_rad_s[k] * h - rise, rise - self.rate_rad_s[k + 1] * h
        angle = self.angle_rad[k] + u * rise + u * (1 - u) * ((1 - u) * a + u * b)
        return np.where((u >= 0) & (u <= 1), angle, np.nan)

    def time_at(self, angle_rad: FloatArray) -> FloatArray:
        """Time [s] at which a forward-rolling wheel has ascending angles; NaN outside of the knots."""
        climbing = np.maximum.accumulate(self.angle_rad)
        k = np.clip(np.searchsorted(climbing, angle_rad, side="right") - 1, 0, climbing.size - 2)
        start, rise = climbing[k], climbing[k + 1] - climbing[k]
        u = np.where(rise > 0, (angle_rad - start) / np.where(rise > 0, rise, 1.0), 0.0)
        h = self.time_s[k + 1] - self.time_s[k]
        time = self.time_s[k] + u * h
        inside = (u >= 0) & (u <= 1)
        near = np.where(inside, time, self.time_s[0])
        rate = np.where(rise > 0, rise / h, np.inf)
        near = near - (self.at(near) - angle_rad) / rate
        return np.where(inside, np.clip(near, self.time_s[k], self.time_s[k + 1]), np.nan)

    def mean_rate(self, time_s: FloatArray, span_s: float) -> FloatArray:
        """Rate [rad/s] over a window of `span_s` centred at each time, cut at the ends: a low-pass with -3 dB at 0.443 / span_s."""
        first, last = np.maximum(time_s - span_s / 2, self.time_s[0]), np.minimum(time_s + span_s / 2, self.time_s[-1])
        span = np.where(last > first, last - first, np.nan)
        return (self.at(last) - self.at(first)) / span


def smooth_angle(
    time_s: FloatArray, count: IntArray, pitch_rad: FloatArray, step_rad: float, stretch: IntArray, noise_rad: float
) -> AngleFunction:
    """Knots from passages: times, counts and stretches of shape (n,), the pitch errors (n,) of these passages, the angle of a count,
    and the standard deviation of one passage (used where the log is too short to show it).

    Each time is first brought to the nominal angle of its count; then time as a function of the count is a cubic over
    2 REACH + 1 passages.  Left as it is at the ends of a stretch, beside missing passages and where the motion is too uneven for a cubic
    (near standstill).
    """
    nominal = np.asarray(count * step_rad, dtype=np.float64)
    if time_s.size < 2 * REACH + 1:
        rate = np.gradient(nominal, time_s) if time_s.size > 1 else np.zeros(time_s.size)
        return AngleFunction(time_s, np.asarray(nominal + pitch_rad), rate, stretch, noise_rad)
    rise = np.gradient(nominal)
    pace = np.where(rise == 0, 0.0, np.gradient(time_s) / np.where(rise == 0, 1.0, rise))
    time = np.maximum.accumulate(time_s - pitch_rad * pace)
    n, width = time.size, 2 * REACH + 1
    inner = np.arange(REACH, n - REACH)
    longest, shortest = np.zeros(inner.size), np.full(inner.size, np.inf)
    regular = stretch[width - 1 :] == stretch[: n - width + 1]
    regular &= np.abs(count[width - 1 :] - count[: n - width + 1]) == width - 1
    value, slope = np.zeros(inner.size), np.zeros(inner.size)
    for k in range(width):
        part = time[k : n - width + 1 + k] - time[inner]
        value += CUBIC_VALUE[k] * part
        slope += CUBIC_SLOPE[k] * part
        if k:
            step = time[k : n - width + 1 + k] - time[k - 1 : n - width + k]
            longest, shortest = np.maximum(longest, step), np.minimum(shortest, step)
    regular &= (longest < 2.0 * shortest) & (slope > 0)
    smoothed, rate = time.copy(), np.where(pace == 0, 0.0, 1.0 / np.where(pace == 0, 1.0, pace))
    at = inner[regular]
    smoothed[at] += value[regular]
    rate[at] = step_rad * np.sign(count[at + 1] - count[at]) / slope[regular]
    kept = float(np.sum(CUBIC_VALUE**2))
    if at.size > 100:  # what the cubics leave is the rest of the passages' noise
        left = value[regular] * rate[at]
        noise_rad = float(np.median(np.abs(left))) / 0.6745 / np.sqrt(1 - kept)
    return AngleFunction(np.maximum.accumulate(smoothed), nominal, rate, stretch, noise_rad * float(np.sqrt(kept)))
