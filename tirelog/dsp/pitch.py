"""From counted teeth to the wheel angle as a function of time, piece by piece.

    pieces of TEETH (n,)
        --local cubic least squares--> KNOT, one in KNOT_STEP_S while the wheel turns quickly
        --scatter about the cubics---> noise of a passage
    knots, pitch errors learnt meanwhile --> AngleFunction

Time as a function of the count is a cubic over the passages within SPAN_S, by least squares.
Smoothing is linear in the times, so the pitch errors are subtracted afterwards: what the same least
squares make of the pitch errors of those counts is the error of the knot.

An edge of a pulse is known to lie between two samples: its error is uniform, of a known size. If a
tooth takes nearly a whole number of samples the errors of neighbours are alike, and the cubic
follows them instead of averaging: what the cubics leave of that size tells how much.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.dsp.filters import runs, sliding_mean
from tirelog.dsp.teeth import PIECE, TEETH, Integers, finite
from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Records, records

# ---- The pitch error of a tone wheel, learnt from the log itself while it streams by.
#
#     pieces of times, counts, stretches (n,)
#         --smooth motion over whole turns--> deviation of each passage [rad]
#         --means over turns, a stretch at a time--> which way and by how many teeth the stretches
#         lie
#                                                    against each other
#         --all together--> table (turn,)
#
# The time of count n is the smooth motion's plus the pitch error over the speed. Smoothing by B
# (2 -
# B), B the mean over one turn, keeps motions up to the third order in the count and has a zero at
# every harmonic of the wheel, so whatever is fixed to the wheel stays in the deviation: errors of
# the
# teeth, the offset between rising and falling passages, and what a once-per-turn change of
# amplitude
# does to them. Its constant part is a convention and left out.
#
# Seen by a wheel that rolls backwards the pattern is reversed, and rising passages are falling
# ones:
# an uneven tone wheel shows its direction.


#: deviations of passages [rad] that were summed: how many, their sum, the sum of their squares
SUMS = np.dtype([("number", "f8"), ("total", "f8"), ("squares", "f8")])

#: turns that a table needs; fewer leave it zero; twice as many leave short drives with the steps
#: of the pattern in their speed
LEAST_TURNS = 4


@dataclass(frozen=True)
class PitchTable:
    """The pitch errors of a tone wheel, learnt from a log.

    `error_rad` (turn,) true angle of a passage minus its nominal angle, zero mean; `turns` it was
    learnt from, 0 for none; `repeats` the share of the deviations' variance that the table explains
    beyond chance, in [0, 1].
    """

    error_rad: FloatArray
    turns: int = 0
    repeats: float = 0.0


def _window_mean(x: FloatArray, turn: int) -> FloatArray:
    """Mean over the turn around each of x (n,) that has one, shape (n - turn,).

    With half weights at the window's ends.
    """
    return np.convolve(x, np.r_[0.5, np.ones(turn - 1), 0.5] / turn, "valid")


def _deviation_sums(
    time: FloatArray, seen: BoolArray, first: int, turn: int, limit: float, sums: Records
) -> None:
    """Adds the deviations of the passages of one stretch to `sums` (counts per turn,) of SUMS.

    By the count modulo the turn, without uneven turns and without the window at each end: `turn`
    counts, of one turn or, as they must be even, of two; none above `limit` [rad]. `time` (n,) [s]
    of the counts `first`, `first` + 1, ..., of those `seen` only.
    """
    half, inner = turn // 2, slice(turn, -turn)
    bent = time - np.linspace(time[0], time[-1], time.size)
    once = _window_mean(bent, turn)
    lap = (time[turn:] - time[:-turn])[half:-half]
    change = time[2 * turn :] - 2 * time[inner] + time[: -2 * turn]
    deviation = bent[inner] - 2 * once[half:-half] + _window_mean(once, turn)
    deviation *= 2 * np.pi * turn / sums.size / lap
    used = seen[inner] & (np.abs(change) < 0.1 * lap) & (np.abs(deviation) < limit)
    place, deviation = (first + np.flatnonzero(used)) % sums.size, deviation[used]
    for power, name in enumerate(("number", "total", "squares")):
        sums[name] += np.bincount(place, deviation**power, sums.size)


#: a stretch of passages between two losses of the count, and where it lies on the wheel: its first
#: and last count and their times, whether it was counted forwards; count x `sign` + `offset` half
#: teeth is the wheel's count, and whether anything `showed` that
STRETCH = np.dtype(
    [("first", "i8"), ("last", "i8"), ("begin_s", "f8"), ("end_s", "f8"), ("forward", "?"),
     ("sign", "i8"), ("offset", "i8"), ("showed", "?")]
)  # fmt: skip


class PitchLearner:
    """Takes teeth piece by piece; what each stretch showed of a wheel of `turn` counts a turn."""

    def __init__(self, turn: int) -> None:
        self.turn = turn
        self._stretches: list[Records] = []
        self._sums: list[Records] = []
        self._held = np.zeros(0, TEETH)

    @property
    def stretches(self) -> Records:
        """The stretches in order of time, (k,) of STRETCH, as they were counted."""
        return np.concatenate([np.zeros(0, STRETCH), *self._stretches])

    def add(self, teeth: Records) -> None:
        """The next teeth, (n,) of TEETH."""
        for part in np.split(teeth, np.flatnonzero(np.diff(teeth["stretch"])) + 1):
            if part.size and part["stretch"][0] == len(self._stretches):
                begin = part[0]
                row = records(
                    STRETCH, first=begin["count"], begin_s=begin["time_s"],
                    forward=begin["forward"], sign=1,
                )  # fmt: skip
                self._stretches.append(row)
                self._sums.append(np.zeros(self.turn, SUMS))
                self._held = part[:0]
            if part.size:
                row = self._stretches[-1]
                row["last"], row["end_s"] = part["count"][-1], part["time_s"][-1]
                if row["forward"][0]:
                    self._learn(part)

    def _learn(self, teeth: Records) -> None:
        """Add teeth of the last stretch to its sums; those near its end wait for the next."""
        held = np.concatenate([self._held, teeth])
        at, time = held["count"], held["time_s"]
        span, turn = at[-1] - at[0], self.turn * (1 + self.turn % 2)
        if span >= 4 * turn and at.size >= 0.75 * span and bool((np.diff(at) > 0).all()):
            whole = np.arange(at[0], at[-1] + 1)
            seen, every = np.isin(whole, at), np.interp(whole, at, time)
            _deviation_sums(every, seen, int(at[0]), turn, 2 * np.pi / self.turn, self._sums[-1])
            held = held[np.searchsorted(at, at[-1] + 1 - 2 * turn) :]
        self._held = held

    def placed(self, ways: IntArray) -> Records:
        """The stretches, each with its place against the one with the most turns.

        By their patterns, and after the stretch before it.

        After a standstill or a hole the count may have lost teeth, and the wheel may roll the other
        way; the tone wheel's own pattern tells. A stretch that is too short, or whose pattern is
        too faint, keeps its counts. `ways` (k,): the direction (1 or -1) of stretches of which it
        is known otherwise, else 0.
        """
        stretches, tables = self.stretches, [_table(sums) for sums in self._sums]
        best = max(tables, key=attrgetter("turns"))
        turned_back, end = not stretches["forward"].all(), -1
        for number, (row, table, way) in enumerate(zip(stretches, tables, ways, strict=True)):
            counted = 1 if row["forward"] else -1
            sign, offset, showed = _placing(best, table) if row["forward"] else (1, 0, True)
            if way == -sign * counted:  # turned, the parity of rising passages changes
                sign = -sign
                offset = end + 1 - sign * int(row["first"])
                offset -= (offset + 1) % 2
            turned_back |= sign < 0
            first = sign * int(row["first"]) + offset
            if number and not turned_back and first <= end:  # the wheel did not roll back
                offset += -(-(end + 1 - first) // self.turn) * self.turn
            row["sign"], row["offset"], row["showed"] = sign, offset, showed or way != 0
            end = sign * int(row["last"]) + offset
        return stretches

    def table(self, stretches: Records) -> PitchTable:
        """The table of all `stretches` that roll forward, laid on one another."""
        total = np.zeros(self.turn, SUMS)
        for sums, row in zip(self._sums, stretches, strict=True):
            if row["sign"] > 0 and row["forward"]:
                for name in SUMS.names or ():
                    total[name] += np.roll(sums[name], row["offset"])
        return _table(total)


def _table(sums: Records) -> PitchTable:
    """The table from number, sum and sum of squares of the deviations of each passage of a turn."""
    number, total, squares = (sums[name].copy() for name in ("number", "total", "squares"))
    turns, size, square = float(np.median(number)), number.size, float(squares.sum())
    if turns < LEAST_TURNS:
        return PitchTable(np.zeros(size))
    mean = total / np.maximum(number, 1.0)
    explained = float(number @ mean**2)
    left = max(square - explained, 0.0) / max(number.sum() - size, 1.0)
    error = np.where(number > 0, mean - mean[number > 0].mean(), 0.0)
    share = max(explained - left * size, 0.0) / max(square, np.finfo(float).tiny)
    return PitchTable(error, int(turns), share)


def _placing(reference: PitchTable, table: PitchTable) -> tuple[int, int, bool]:
    """(sign, offset, whether the pattern showed it) of a stretch against the reference.

    Its passages were counted forwards.
    """
    # tables that explain more than half of their deviations can be laid on one another
    size, clear = table.error_rad.size, min(table.repeats, reference.repeats) > 0.5
    if size % 2 or not (table.turns and clear):  # odd: a counter's, which has one stretch
        return 1, 0, False
    # a passage that is late at count c, seen backwards, is early at count -1 - c: the parity of
    # rising passages changes
    forth, back = (
        _match(pattern, table.error_rad)
        for pattern in (reference.error_rad, -reference.error_rad[::-1])
    )
    best = forth if forth.max() >= back.max() else back
    place = int(np.argmax(best))
    other = float(np.max(np.delete(best, place), initial=0.0))
    # tables are laid on one another where one place is so much better than any other
    better_place = 1.2
    if best[place] < better_place * other:
        return 1, 0, False
    showed = best[place] > better_place * max(min(forth.max(), back.max()), 0.0)
    if best is back and showed:
        return -1, -1 - 2 * place, True
    place = int(np.argmax(forth))
    return 1, 2 * place - (size if 2 * place > size // 2 else 0), bool(showed)


def _match(a: FloatArray, b: FloatArray) -> FloatArray:
    """Correlation of `a` with `b` moved by 0, 2, 4 ... counts.

    Rising and falling passages each without their mean (a level offset shifts all rising ones
    alike).
    """
    result = np.zeros(a.size // 2)
    for k in (0, 1):
        one, other = a[k::2] - a[k::2].mean(), b[k::2] - b[k::2].mean()
        result += np.fft.irfft(np.fft.rfft(one) * np.conj(np.fft.rfft(other)), one.size)
    return result


def steps_that_repeat(
    teeth: Records, steps: int, turn: int, grid_s: float = 0.0, most: int = 256
) -> tuple[int, float, float]:
    """(steps per turn that repeat best, their share of the variance, that of `steps`).

    Of the longest run of `teeth` (n,) of TEETH without a loss, if `turn` are those of `steps`.

    The deviations repeat best with them; the shares of their variance are what is explained beyond
    chance. The passages are smoothed over a few teeth only, so that the turn of the setup is not
    presumed. Of multiples the least that explains as much as the best. Shares are zero if the log
    is too short.

    At a constant speed errors of edges between samples, of standard deviation `grid_s` [s], repeat
    with any number of steps. The best one's share is what they cannot have made.
    """
    even = zip(*runs(np.diff(teeth["count"]) == 1), strict=True)
    parts = [teeth["time_s"][start : stop + 1] for start, stop in even]
    time_s = max(parts, key=len, default=np.zeros(0))
    if time_s.size < 64:
        return steps, 0.0, 0.0
    pace = np.gradient(time_s)
    deviation = ((time_s - sliding_mean(time_s, 9)) / pace)[16:-16]
    deviation -= np.mean(deviation)
    squares = max(float(deviation @ deviation), np.finfo(float).tiny)
    shares = np.zeros(most + 1)
    for candidate in range(4, min(most, deviation.size // 8) + 1):
        size = candidate * turn // steps
        at = np.mod(np.arange(deviation.size), size)
        explained = np.bincount(at, deviation, size) ** 2 / np.bincount(at, minlength=size)
        shares[candidate] = float(np.sum(explained)) / squares - size / deviation.size
    best = int(np.argmax(shares > shares.max() - 0.03))
    share = shares[best] - float(np.sum((grid_s / pace[16:-16]) ** 2)) / squares
    return best, float(share), float(shares[steps]) if steps <= most else 0.0


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
    first = second = third = angle = 0.0
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
            low, high, angle = time[k], time[k + 1], count[k] * unit
            first, last = np.float64(rate[k]), np.float64(rate[k + 1])
            h = high - low if high > low else 1.0
            mean = (count[k + 1] - count[k]) * unit / h
            second, third = (3 * mean - 2 * first - last) / h, (first + last - 2 * mean) / h**2
        s = t - low
        result[i] = angle + s * (first + s * (second + s * third))


@dataclass(frozen=True)
class AngleFunction:
    """Knots of the wheel angle, shape (n,).

    `time_s` ascending, `count` in units of `unit_rad`, `rate_rad_s`, `stretch` the run without a
    loss of the count; `noise_rad` standard deviation of an angle read from it. The types are small:
    an hour has millions of knots.

    The edges of pulses and counts lie between two samples, so such errors grow with the speed and
    are alike from tooth to tooth: `grid_rad` has their standard deviation at each knot, `noise_rad`
    is their median. None for other sensors.
    """

    time_s: FloatArray
    count: NDArray[np.int32] | FloatArray
    unit_rad: float
    rate_rad_s: NDArray[np.float32]
    stretch: NDArray[np.int32]
    noise_rad: float
    grid_rad: NDArray[np.float32] | None = None

    def _knot_at(self, time_s: FloatArray) -> IntArray:
        """The knot before each time, or the first one; NaN counts as the end."""
        at = np.searchsorted(self.time_s, time_s, side="right") - 1
        return np.clip(at, 0, self.time_s.size - 1)

    def noise_at(self, time_s: FloatArray) -> FloatArray:
        """Standard deviation [rad] of the angles at times, of which NaN counts as the end."""
        if self.grid_rad is None:
            return np.full(time_s.shape, self.noise_rad)
        return self.grid_rad[self._knot_at(time_s)].astype(np.float64)

    def shared_noise_at(self, time_s: FloatArray) -> FloatArray:
        """The part of `noise_at` [rad] that angles a patch apart have in common, at times."""
        return np.zeros(time_s.shape) if self.grid_rad is None else self.noise_at(time_s)

    def stretch_at(self, time_s: FloatArray) -> IntArray:
        """Number of the stretch at times, of which NaN counts as the end."""
        return self.stretch[self._knot_at(time_s)].astype(np.int64)

    @cached_property
    def cuts_s(self) -> FloatArray:
        """Times [s] of the last knot of each stretch and of the first of the next, in order."""
        last = np.flatnonzero(np.diff(self.stretch))
        return self.time_s[np.stack([last, last + 1], axis=1).ravel()]

    @cached_property
    def _climbing(self) -> NDArray[np.int32] | FloatArray:
        """The counts, none below one before it.

        A wheel that has rolled back has its angles again later.
        """
        return np.maximum.accumulate(self.count)

    def at(self, time_s: FloatArray) -> FloatArray:
        """Angle [rad] at the times, NaN outside of the knots, shape as given."""
        result = np.full(time_s.shape, np.nan)
        at = finite(time_s).ravel()
        if self.time_s.size > 1:
            _hermite(
                at, self.time_s, self.count, self.rate_rad_s, self.unit_rad, result.reshape(-1)
            )
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


#: knots lie at least so far apart while the motion is even: a cubic follows a wheel that shakes at
#: 20 Hz to a thousandth of a degree; twice as far apart, to sixteen times that
KNOT_STEP_S = 4e-3
#: the local least squares take the passages within this time, at least and at most so many on each
#: side; twice as long averages noise of the teeth over twice as many, and flattens shakes of 20 Hz
SPAN_S, LEAST_REACH, MOST_REACH = 14e-3, 3, 9
#: whole teeth in the window may differ by this factor, for a cubic to follow them; twice as much
#: lays cubics across starts and stops
EVEN = 2.0


def _cubic_weights() -> tuple[FloatArray, FloatArray]:
    """Weights of the least-squares cubic: its value and its slope in the middle.

    At the middle of 2 r + 1 even points, for every reach r; each shape (MOST_REACH + 1, 2
    MOST_REACH + 1), the middle at MOST_REACH. Up to LEAST_REACH the middle point itself is its
    value.
    """
    value, slope = np.zeros((2, MOST_REACH + 1, 2 * MOST_REACH + 1))
    value[:, MOST_REACH] = 1.0
    for reach in range(LEAST_REACH, MOST_REACH + 1):
        here = slice(MOST_REACH - reach, MOST_REACH + reach + 1)
        fit = np.linalg.pinv(np.vander(np.arange(-reach, reach + 1.0), 4, increasing=True))
        value[reach, here], slope[reach, here] = fit[0], fit[1]
    return value, slope


VALUE, SLOPE = _cubic_weights()


#: knots of the wheel angle: time, count, rate [rad/s], stretch and direction as of `TEETH`, the
#: `reach` of the cubic that was laid through it, 0 for none, and how much its passage was behind
#: the cubic, NaN without one
KNOT = np.dtype(
    [("time_s", "f8"), ("count", "i4"), ("rate_rad_s", "f4"), ("stretch", "i4"), ("late_s", "f4"),
     ("forward", "?"), ("reach", "i1")]
)  # fmt: skip


@compiled
def _even_runs(time: FloatArray, count: Integers, stretch: Integers) -> Integers:
    """How many passages before each one, in a row, are even with it.

    Neighbours in count and stretch, and their teeth like each other.
    """
    run = np.zeros(time.size, np.int64)
    for i in range(1, time.size):
        if stretch[i] != stretch[i - 1] or abs(count[i] - count[i - 1]) != 1:
            continue
        run[i] = run[i - 1] + 1
        if run[i] >= 3:
            # from rising to rising passage: their offset from the falling ones is no unevenness
            now, last = time[i] - time[i - 2], time[i - 1] - time[i - 3]
            if (
                not (now < EVEN * last and last < EVEN * now)
                or count[i] + count[i - 2] != 2 * count[i - 1]
            ):
                run[i] = 0
    return run


@compiled
def _local_cubics(
    teeth: Records, unit: float, first: int, stop: int, last: float, knots: Records, sums: Records
) -> int:
    """Fills `knots` of KNOT and gives their number: those of the `teeth` [first, stop).

    They are those KNOT_STEP_S after the one before them, which is at `last` [s], and all beside
    uneven ones. Late is the passage behind its cubic. Where no cubic can be laid the rate is the
    neighbours'.

    `teeth` (n,) of TEETH; `unit` per count [rad]. Added to: what the cubics of each reach left of
    the passages, `sums` (MOST_REACH + 1, classes) of SUMS, by the count modulo the classes.
    """
    time, count, stretch = teeth["time_s"], teeth["count"], teeth["stretch"]
    n, run, classes = time.size, _even_runs(time, count, stretch), sums.shape[1]
    k = 0
    for i in range(first, stop):
        high = i + LEAST_REACH
        even = high < n and run[high] >= 2 * LEAST_REACH
        beside = (
            not even
            or run[i + 1 + LEAST_REACH if high + 1 < n else n - 1] < 2 * LEAST_REACH
            or run[high] == 2 * LEAST_REACH
        )
        if time[i] - last < KNOT_STEP_S and not beside:
            continue
        knot = knots[k]
        knot["count"], knot["stretch"], knot["forward"] = count[i], stretch[i], teeth[i]["forward"]
        knot["time_s"], knot["late_s"] = time[i], np.nan
        if even:
            pace = (time[high] - time[i - LEAST_REACH]) / (2 * LEAST_REACH)
            reach = min(max(int(0.5 * SPAN_S / pace), LEAST_REACH), MOST_REACH)
            while reach > LEAST_REACH and (i + reach >= n or run[i + reach] < 2 * reach):
                reach -= 1
            at, steepness = 0.0, 0.0
            for j in range(-reach, reach + 1):
                at += VALUE[reach, MOST_REACH + j] * (time[i + j] - time[i])
                steepness += SLOPE[reach, MOST_REACH + j] * (time[i + j] - time[i])
            begin = time[i - reach + 2] - time[i - reach]
            end = time[i + reach] - time[i + reach - 2]
            if steepness > 0 and begin < EVEN * end and end < EVEN * begin:
                rate = (count[i + 1] - count[i]) * unit / steepness
                knot["time_s"], knot["late_s"], knot["reach"] = time[i] + at, -at, reach
                knot["rate_rad_s"] = rate
                if abs(at * rate) < 0.2 * unit:
                    left = sums[reach, count[i] % classes]
                    left["number"] += 1
                    left["total"] -= at * rate
                    left["squares"] += (at * rate) ** 2
        if knot["reach"] == 0:
            before = i - 1 if i > 0 and stretch[i - 1] == stretch[i] else i
            after = i + 1 if i + 1 < n and stretch[i + 1] == stretch[i] else i
            if time[after] > time[before]:
                span = time[after] - time[before]
                knot["rate_rad_s"] = (count[after] - count[before]) * unit / span
        last = knot["time_s"]
        k += 1
    return k


class KnotBuilder:
    """Takes teeth piece by piece, and gives the knots of a wheel of `turn` counts a turn."""

    def __init__(self, turn: int) -> None:
        self.turn = turn
        self._parts = [np.zeros(0, KNOT)]
        self._held, self._first = np.zeros(0, TEETH), 0  # the first of them that is no knot yet
        self._last = -np.inf
        self._variance, self._freedom = 0.0, 0.0
        self._laid = np.zeros(MOST_REACH + 1)  # cubics of each reach

    def add(self, new: Records, margin: int = MOST_REACH + 4) -> None:
        """Knots of what is held and the `new` teeth, (n,) of TEETH, but for the last `margin`."""
        teeth = np.concatenate([self._held, new])
        stop = max(teeth.size - margin, self._first)
        unit_rad, knots = 2 * np.pi / self.turn, np.zeros(stop - self._first, KNOT)
        sums = np.zeros((MOST_REACH + 1, self.turn), SUMS)
        number = _local_cubics(teeth, unit_rad, self._first, stop, self._last, knots, sums)
        if number:
            self._last = float(knots["time_s"][number - 1])
            self._parts.append(knots[:number].copy())  # a view would keep the whole array alive
        begin = max(stop - margin, 0)
        self._held, self._first = teeth[begin:], stop - begin
        # what the cubics of each reach left, each class of counts about its own mean: a cubic that
        # keeps w of a passage leaves 1 - w
        count, total, squares = (sums[name] for name in ("number", "total", "squares"))
        left = (squares - total**2 / np.maximum(count, 1.0)).sum(axis=1)[LEAST_REACH:]
        self._variance += float(np.sum(left / (1 - VALUE[LEAST_REACH:, MOST_REACH])))
        self._freedom += float((count - (count > 0))[LEAST_REACH:].sum())
        self._laid += count.sum(axis=1)

    def knots(self) -> Records:
        """All knots, (n,) of KNOT; nothing can be added after."""
        self.add(self._held[:0], 0)
        return np.concatenate(self._parts)

    def noise_rad(self, otherwise: float) -> float:
        """Standard deviation of a knot: from what the cubics leave.

        Of a passage alone, `otherwise`, if the log is too short.
        """
        if self._freedom < 100:
            return otherwise
        kept = float(np.average(VALUE[:, MOST_REACH], weights=self._laid))
        return float(np.sqrt(self._variance / self._freedom * kept))


def angle_function(
    knots: Records,
    error_rad: FloatArray,
    stretches: Records,
    noise_rad: float,
    edge_s: float = 0.0,
) -> AngleFunction:
    """The wheel angle through `knots` (n,) of KNOT, which it changes.

    `error_rad` (turn,) the pitch error of each count of a turn; `stretches` of STRETCH: what makes
    their counts those of the wheel; `noise_rad` standard deviation of a knot; `edge_s` that of the
    time of an edge between two samples, 0 if passages are no edges.
    """
    # the weighted sums of the errors around each count of a turn
    place = np.arange(error_rad.size)[:, None] + np.arange(2 * MOST_REACH + 1) - MOST_REACH
    value, slope = (weights @ error_rad[place % error_rad.size].T for weights in (VALUE, SLOPE))
    unit_rad, latest = 2 * np.pi / error_rad.size, -np.inf
    for start in range(0, knots.size, PIECE):
        piece = knots[start : start + PIECE]
        stretch, reach = stretches[piece["stretch"]], piece["reach"]
        piece["count"] = stretch["sign"] * piece["count"] + stretch["offset"]
        piece["rate_rad_s"] *= stretch["sign"]
        place = np.mod(piece["count"], error_rad.size)
        pace = np.where(piece["rate_rad_s"] == 0, np.inf, piece["rate_rad_s"])
        late = value[reach, place] / pace
        piece["late_s"] -= error_rad[place] / pace - late
        piece["rate_rad_s"] /= 1 - slope[reach, place] / unit_rad
        time = np.maximum.accumulate(np.maximum(piece["time_s"] - late, latest))
        piece["time_s"], latest = time, float(time[-1])
    time, count, rate, stretch = (
        knots[name].copy() for name in ("time_s", "count", "rate_rad_s", "stretch")
    )
    grid = None
    if edge_s:
        grid = np.abs(rate) * _grid_s(knots, edge_s).astype(np.float32)
        noise_rad = float(np.median(grid))
    return AngleFunction(time, count, unit_rad, rate, stretch, noise_rad, grid)


def _grid_s(knots: Records, edge_s: float) -> FloatArray:
    """Standard deviation [s] of the times of knots of edges, shape (n,).

    An edge is uniform between two samples: its variance is known. A cubic that keeps w of its
    middle edge leaves 1 - w of that if edges are independent, and less if neighbours are alike; the
    knot has the rest. Whatever is left, the knot has w / (1 - w) of it at least: chance of any
    other kind is independent from edge to edge.
    """
    laid = knots["reach"] > 0
    # knots around one, with itself, whose scatter tells what the sampling grid does to it: half a
    # second; twice as many tell it to 0.7 of the error, and follow a changing speed half as well
    grid_knots = 129
    share = np.maximum(sliding_mean(laid.astype(np.float64), grid_knots), 0.5 / grid_knots)
    left, kept = (
        sliding_mean(np.where(laid, values, 0.0), grid_knots) / share
        for values in (knots["late_s"].astype(np.float64) ** 2, VALUE[knots["reach"], MOST_REACH])
    )
    variance = np.maximum(edge_s**2 - left, kept / (1 - kept) * left)
    return np.sqrt(np.where(laid, variance, edge_s**2))
