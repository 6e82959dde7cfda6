"""From counted passages to the knots of the wheel angle, piece by piece.

    pieces of times, counts, stretches (n,)
        --local cubic least squares--> knots, one in KNOT_STEP_S while the wheel turns quickly
        --scatter about the cubics---> noise of a passage
    knots, pitch errors learnt meanwhile --> AngleFunction

Time as a function of the count is a cubic over the passages within SPAN_S, by least squares.
Smoothing is linear in the times, so the pitch errors are taken off afterwards: what the same least
squares make of the pitch errors of those counts is the error of the knot.

An edge of a pulse is known to lie between two samples: its error is uniform, of a known size. If a
tooth takes nearly a whole number of samples the errors of neighbours are alike, and the cubic
follows them instead of averaging: what the cubics leave of that size tells how much.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.dsp.encoder import SUMS, AngleFunction
from tirelog.dsp.filters import sliding_mean
from tirelog.dsp.teeth import Integers
from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Records

# ---- The pitch error of a tone wheel, learnt from the log itself while it streams by.
#
#     pieces of times, counts, stretches (n,)
#         --smooth motion over whole turns--> deviation of each passage [rad]
#         --means over turns, a stretch at a time--> which way and by how many teeth the stretches
#         lie
#                                                    against each other
#         --all together--> table (2 steps,)
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


#: turns that a table needs; fewer leave it zero; twice as many leave short drives with the steps
#: of the pattern in their speed
LEAST_TURNS = 4
#: tables that explain more of their deviations than this can be laid on one another, if one place
#: is so much better than any other
CLEAR, BETTER_PLACE = 0.5, 1.2
#: passages of the longest stretch that are kept to doubt the number of steps, in turns; twice as
#: many take twice the memory
KEPT_TURNS = 200


@dataclass(frozen=True)
class PitchTable:
    """The pitch errors of a tone wheel, learnt from a log.

    `error_rad` (2 steps,) true angle of a passage minus its nominal angle, zero mean; `se_rad` its
    standard error (a number); `turns` it was learnt from; `scatter_rad` standard deviation of one
    passage about the table; `repeats` the share of the deviations' variance that the table explains
    beyond chance, in [0, 1].
    """

    error_rad: FloatArray
    se_rad: float
    turns: int
    scatter_rad: float
    repeats: float

    @classmethod
    def zero(cls, steps: int) -> PitchTable:
        return cls(np.zeros(2 * steps), 0.0, 0, 0.0, 0.0)


def _window_mean(x: FloatArray, turn: int) -> FloatArray:
    """Mean over the turn around each of x (n,) that has one, shape (n - turn,).

    With half weights at the window's ends.
    """
    return np.convolve(x, np.r_[0.5, np.ones(turn - 1), 0.5] / turn, "valid")


def _deviation_sums(
    time: FloatArray, seen: BoolArray, first: int, turn: int, limit: float, sums: Records
) -> None:
    """Adds the deviations of the passages of one stretch to `sums` (turn,) of SUMS.

    By the count modulo the turn, without the turn at each end and without uneven turns; none above
    `limit` [rad]. `time` (n,) [s] of the counts `first`, `first` + 1, ..., of those `seen` only.
    """
    half, inner = turn // 2, slice(turn, -turn)
    bent = time - np.linspace(time[0], time[-1], time.size)
    once = _window_mean(bent, turn)
    lap = (time[turn:] - time[:-turn])[half:-half]
    change = time[2 * turn :] - 2 * time[inner] + time[: -2 * turn]
    deviation = bent[inner] - 2 * once[half:-half] + _window_mean(once, turn)
    deviation *= 2 * np.pi / lap
    used = seen[inner] & (np.abs(change) < 0.1 * lap) & (np.abs(deviation) < limit)
    place, deviation = (first + np.flatnonzero(used)) % turn, deviation[used]
    for power, name in enumerate(("number", "total", "squares")):
        sums[name] += np.bincount(place, deviation**power, turn)


@dataclass
class StretchSums:
    """What a stretch showed of the tone wheel.

    Its number, first and last count and their times, whether it was counted forwards, the sums of
    its deviations.
    """

    number: int
    first: int
    last: int
    begin_s: float
    end_s: float
    forward: bool
    sums: Records


@dataclass(frozen=True)
class Placing:
    """Where a stretch lies on the wheel: count x `sign` + `offset` half teeth.

    `told`: the pattern showed it.
    """

    sign: int
    offset: int
    told: bool


@dataclass
class PitchLearner:
    """Takes passages piece by piece; `stretches` in order of time."""

    steps: int
    stretches: list[StretchSums] = field(default_factory=list)
    sample: tuple[FloatArray, Integers] = field(
        default_factory=lambda: (np.zeros(0), np.zeros(0, np.int64))
    )
    _held: tuple[FloatArray, Integers] = field(
        default_factory=lambda: (np.zeros(0), np.zeros(0, np.int64))
    )
    _begin: tuple[FloatArray, Integers] = field(
        default_factory=lambda: (np.zeros(0), np.zeros(0, np.int64))
    )

    def add(
        self, time_s: FloatArray, count: Integers, stretch: Integers, forward: np.ndarray
    ) -> None:
        """The next passages, shape (n,) each."""
        if time_s.size == 0:
            return
        ends = np.flatnonzero(np.diff(stretch)) + 1
        for low, high in zip([0, *ends.tolist()], [*ends.tolist(), time_s.size], strict=True):
            number = int(stretch[low])
            if not self.stretches or self.stretches[-1].number != number:
                sums = np.zeros(2 * self.steps, SUMS)
                begin = float(time_s[low])
                self.stretches.append(
                    StretchSums(
                        number,
                        int(count[low]),
                        int(count[low]),
                        begin,
                        begin,
                        bool(forward[low]),
                        sums,
                    )
                )
                self._held = self._begin = (np.zeros(0), np.zeros(0, np.int64))
            self.stretches[-1].last, self.stretches[-1].end_s = (
                int(count[high - 1]),
                float(time_s[high - 1]),
            )
            if self.stretches[-1].forward:
                self._learn(time_s[low:high], count[low:high])

    def _learn(self, time_s: FloatArray, count: Integers) -> None:
        """Add passages of the last stretch to its sums; those near its end wait for the next."""
        turn = 2 * self.steps
        time, at = (
            np.concatenate([a, b]) for a, b in zip(self._held, (time_s, count), strict=True)
        )
        if self._begin[0].size < KEPT_TURNS * turn:
            begin, first = (
                np.concatenate([a, b])[: KEPT_TURNS * turn]
                for a, b in zip(self._begin, (time_s, count), strict=True)
            )
            self._begin = begin, first
            self.sample = max(self.sample, self._begin, key=lambda kept: kept[0].size)
        if at[-1] - at[0] >= 4 * turn and at.size >= 3 * turn and bool((np.diff(at) > 0).all()):
            whole = np.arange(at[0], at[-1] + 1)
            seen, every = np.isin(whole, at), np.interp(whole, at, time)
            limit, sums = np.pi / self.steps, self.stretches[-1].sums
            _deviation_sums(every, seen, int(at[0]), turn, limit, sums)
            late = int(np.searchsorted(at, at[-1] + 1 - 2 * turn))
            time, at = time[late:], at[late:]
        self._held = time, at

    def placings(self, ways: dict[int, int] | None = None) -> list[Placing]:
        """Where each stretch lies against the one with the most turns.

        By their patterns, and after the stretch before it.

        After a standstill or a hole the count may have lost teeth, and the wheel may roll the other
        way; the tone wheel's own pattern tells. A stretch that is too short, or whose pattern is
        too faint, keeps its counts. `ways`: the direction (1 or -1) of stretches of which it is
        known otherwise.
        """
        ways = ways or {}
        tables = [_table(stretch.sums) for stretch in self.stretches]
        best = max(range(len(tables)), key=lambda k: tables[k].turns, default=0)
        placed: list[Placing] = []
        turned_back = any(not stretch.forward for stretch in self.stretches)
        end = -1
        for stretch, table in zip(self.stretches, tables, strict=True):
            placing = _placing(tables[best], table) if stretch.forward else Placing(1, 0, True)
            way = ways.get(stretch.number, 0)
            if way and way != placing.sign * (
                1 if stretch.forward else -1
            ):  # turned, the parity of rising passages changes
                placing = Placing(-placing.sign, end + 1 + placing.sign * stretch.first, True)
                placing = replace(placing, offset=placing.offset - (placing.offset + 1) % 2)
            elif way:
                placing = replace(placing, told=True)
            turned_back |= placing.sign < 0
            first = placing.sign * stretch.first + placing.offset
            if placed and not turned_back and first <= end:  # the wheel did not roll back
                turns = -(-(end + 1 - first) // (2 * self.steps))
                placing = Placing(
                    placing.sign, placing.offset + turns * 2 * self.steps, placing.told
                )
            placed.append(placing)
            end = placing.sign * stretch.last + placing.offset
        return placed

    def table(self, placings: list[Placing]) -> PitchTable:
        """The table of all stretches that roll forward, laid on one another."""
        total = np.zeros(2 * self.steps, SUMS)
        for stretch, placing in zip(self.stretches, placings, strict=True):
            if placing.sign > 0 and stretch.forward:
                for name in SUMS.names or ():
                    total[name] += np.roll(stretch.sums[name], placing.offset)
        return _table(total)


def _table(sums: Records) -> PitchTable:
    """The table from number, sum and sum of squares of the deviations of each passage of a turn."""
    number, total, squares = (sums[name].copy() for name in ("number", "total", "squares"))
    turns, size, square = float(np.median(number)), number.size, float(squares.sum())
    if turns < LEAST_TURNS:
        return PitchTable.zero(size // 2)
    mean = total / np.maximum(number, 1.0)
    explained = float(number @ mean**2)
    left = max(square - explained, 0.0) / max(number.sum() - size, 1.0)
    error = np.where(number > 0, mean - mean[number > 0].mean(), 0.0)
    share = max(explained - left * size, 0.0) / max(square, np.finfo(float).tiny)
    return PitchTable(error, float(np.sqrt(left / turns)), int(turns), float(np.sqrt(left)), share)


def _placing(reference: PitchTable, table: PitchTable) -> Placing:
    """How a stretch whose passages were counted forwards lies against the reference."""
    if not (table.turns and table.repeats > CLEAR and reference.repeats > CLEAR):
        return Placing(1, 0, False)
    size = table.error_rad.size
    # a passage that is late at count c, seen backwards, is early at count -1 - c: the parity of
    # rising passages changes
    forth, back = (
        _match(pattern, table.error_rad)
        for pattern in (reference.error_rad, -reference.error_rad[::-1])
    )
    best = forth if forth.max() >= back.max() else back
    place = int(np.argmax(best))
    other = float(np.max(np.delete(best, place), initial=0.0))
    if best[place] < BETTER_PLACE * other:
        return Placing(1, 0, False)
    told = best[place] > BETTER_PLACE * max(min(forth.max(), back.max()), 0.0)
    if best is forth or not told:
        place = int(np.argmax(forth))
        return Placing(1, 2 * place - (size if 2 * place > size // 2 else 0), told)
    return Placing(-1, -1 - 2 * place, True)


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
    sample: tuple[FloatArray, Integers], steps: int, grid_s: float = 0.0, most: int = 256
) -> tuple[int, float, float]:
    """(steps per turn that repeat best, their share of the variance, that of `steps`).

    The deviations repeat best with them; the shares of their variance are what is explained beyond
    chance. The passages are smoothed over a few teeth only, so that the turn of the setup is not
    presumed. Of multiples the least that explains as much as the best. Shares are zero if the log
    is too short.

    At a constant speed errors of edges between samples, of standard deviation `grid_s` [s], repeat
    with any number of steps. The best one's share is what they cannot have made.
    """
    time_s, count = sample
    if count.size < 64 or count[-1] - count[0] != count.size - 1:
        return steps, 0.0, 0.0
    pace = np.gradient(time_s)
    deviation = ((time_s - sliding_mean(time_s, 9)) / pace)[16:-16]
    grid = float(np.sum((grid_s / pace[16:-16]) ** 2))
    deviation = deviation - np.mean(deviation)
    squares = float(deviation @ deviation)
    shares = np.zeros(most + 1)
    for candidate in range(4, most + 1):
        size = 2 * candidate
        if deviation.size < 4 * size:
            break
        at = np.mod(np.arange(deviation.size), size)
        explained = float(
            np.sum(np.bincount(at, deviation, size) ** 2 / np.bincount(at, minlength=size))
        )
        shares[candidate] = (explained - squares * size / deviation.size) / max(
            squares, np.finfo(float).tiny
        )
    best = int(np.argmax(shares > shares.max() - 0.03))
    share = shares[best] - grid / max(squares, np.finfo(float).tiny)
    return best, float(share), float(shares[steps]) if steps <= most else 0.0


#: knots lie at least so far apart while the motion is even: a cubic follows a wheel that shakes at
#: 20 Hz to a thousandth of a degree; twice as far apart, to sixteen times that
KNOT_STEP_S = 4e-3
#: the local least squares take the passages within this time, at least and at most so many on each
#: side; twice as long averages noise of the teeth over twice as many, and flattens shakes of 20 Hz
SPAN_S, LEAST_REACH, MOST_REACH = 14e-3, 3, 9
#: knots around one, with itself, whose scatter tells what the sampling grid does to it: half a
#: second; twice as many tell it to 0.7 of the error, and follow a changing speed half as well
GRID_KNOTS = 129
#: whole teeth in the window may differ by this factor, for a cubic to follow them; twice as much
#: lays cubics across starts and stops
EVEN = 2.0


def _cubic_weights() -> tuple[FloatArray, FloatArray]:
    """Weights of the least-squares cubic: its value and its slope in the middle.

    At the middle of 2 r + 1 even points, for every reach r; each shape (MOST_REACH + 1, 2
    MOST_REACH + 1), the middle at MOST_REACH. Up to LEAST_REACH the middle point itself is its
    value.
    """
    value, slope = (
        np.zeros((MOST_REACH + 1, 2 * MOST_REACH + 1)),
        np.zeros((MOST_REACH + 1, 2 * MOST_REACH + 1)),
    )
    value[:, MOST_REACH] = 1.0
    for reach in range(LEAST_REACH, MOST_REACH + 1):
        here = slice(MOST_REACH - reach, MOST_REACH + reach + 1)
        fit = np.linalg.pinv(np.vander(np.arange(-reach, reach + 1.0), 4, increasing=True))
        value[reach, here], slope[reach, here] = fit[0], fit[1]
    return value, slope


VALUE, SLOPE = _cubic_weights()
#: passages worked on at once
PIECE = 1 << 14


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
        if (
            i >= 3 and run[i] >= 3
        ):  # from rising to rising passage: their offset from the falling ones is no unevenness
            now, last = time[i] - time[i - 2], time[i - 1] - time[i - 3]
            if (
                not (now < EVEN * last and last < EVEN * now)
                or count[i] + count[i - 2] != 2 * count[i - 1]
            ):
                run[i] = 0
    return run


@compiled
def _local_cubics(
    time: FloatArray,
    count: Integers,
    stretch: Integers,
    unit: float,
    first: int,
    stop: int,
    last: float,
    sums: Records,
) -> tuple[IntArray, FloatArray, FloatArray, NDArray[np.int8], FloatArray]:
    """Which passages become knots (k,); their times, rates [rad/s], reaches, and lateness [s].

    Of the passages [first, stop) those KNOT_STEP_S after the one before them, which is at `last`
    [s], and all beside uneven ones. Late is the passage behind its cubic. Reach 0: no cubic could
    be laid, the rate is the neighbours', and the lateness NaN.

    `time` (n,) [s], `count` and `stretch` (n,); `unit` per count [rad]. Added to: what the cubics
    of each reach left of the passages, `sums` (MOST_REACH + 1, classes) of SUMS, by the count
    modulo the classes.
    """
    n, run, classes = time.size, _even_runs(time, count, stretch), sums.shape[1]
    knot, smooth, rate, reaches, late = (
        np.empty(stop - first, np.int64),
        np.empty(n),
        np.empty(n),
        np.zeros(n, np.int8),
        np.empty(n),
    )
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
        knot[k] = i
        reach = 0
        if even:
            pace = (time[high] - time[i - LEAST_REACH]) / (2 * LEAST_REACH)
            reach = min(max(int(0.5 * SPAN_S / pace), LEAST_REACH), MOST_REACH)
            while reach > LEAST_REACH and (i + reach >= n or run[i + reach] < 2 * reach):
                reach -= 1
            here, at, steepness = time[i], 0.0, 0.0
            for j in range(-reach, reach + 1):
                at += VALUE[reach, MOST_REACH + j] * (time[i + j] - here)
                steepness += SLOPE[reach, MOST_REACH + j] * (time[i + j] - here)
            begin, end = (
                time[i - reach + 2] - time[i - reach],
                time[i + reach] - time[i + reach - 2],
            )
            if steepness > 0 and begin < EVEN * end and end < EVEN * begin:
                smooth[k], reaches[k], late[k] = here + at, reach, -at
                rate[k] = (count[i + 1] - count[i]) * unit / steepness
                residual = -at * rate[k]
                if abs(residual) < 0.2 * unit:
                    place = count[i] % classes
                    left = sums[reach, place]
                    left["number"] += 1
                    left["total"] += residual
                    left["squares"] += residual * residual
        if reaches[k] == 0:
            before = i - 1 if i > 0 and stretch[i - 1] == stretch[i] else i
            after = i + 1 if i + 1 < n and stretch[i + 1] == stretch[i] else i
            span = time[after] - time[before]
            smooth[k], rate[k], late[k] = (
                time[i],
                (count[after] - count[before]) * unit / span if span > 0 else 0.0,
                np.nan,
            )
        last = smooth[k]
        k += 1
    return (
        knot[:k],
        smooth[:k].copy(),
        rate[:k],
        reaches[:k].copy(),
        late[:k],
    )  # views would keep the whole arrays alive


@dataclass(frozen=True)
class Knots:
    """Knots of a piece or of a log, arrays of shape (n,).

    What `TEETH` says of them, `rate_rad_s`, the `reach` of the cubic that was laid through it, 0
    for none, and how much `late_s` its passage was behind the cubic, empty if it does not matter.
    """

    time_s: FloatArray
    count: NDArray[np.int32]
    rate_rad_s: NDArray[np.float32]
    stretch: NDArray[np.int32]
    forward: BoolArray
    reach: NDArray[np.int8]
    late_s: NDArray[np.float32]


class KnotBuilder:
    """Takes passages piece by piece, and gives their knots.

    `unit_rad` per count and `classes` counts per turn (1 if the counts have no pitch errors);
    `edges` if the passages are edges between two samples.
    """

    def __init__(self, unit_rad: float, classes: int, edges: bool = False) -> None:
        self.unit_rad, self.classes, self.edges = unit_rad, classes, edges
        self._parts: list[Knots] = []
        self._held: tuple[Any, ...] | None = None
        self._first = 0  # of the held passages, the first that is not a knot yet
        self._last = -np.inf
        self._variance, self._freedom = 0.0, 0.0
        self._kept = np.zeros(MOST_REACH + 1)

    def add(
        self, time_s: FloatArray, count: Integers, stretch: Integers, forward: np.ndarray
    ) -> None:
        """The next passages, shape (n,) each."""
        for start in range(0, time_s.size, PIECE):
            piece = slice(start, start + PIECE)
            self._add(
                (
                    time_s[piece],
                    count[piece].astype(np.int64),
                    stretch[piece].astype(np.int64),
                    forward[piece],
                ),
                last=False,
            )

    def _add(self, new: tuple[Any, ...], last: bool) -> None:
        margin = MOST_REACH + 4
        parts: tuple[Any, ...] = (
            new
            if self._held is None
            else tuple(np.concatenate([a, b]) for a, b in zip(self._held, new, strict=True))
        )
        time, count, stretch, forward = parts
        first, stop = self._first, time.size if last else time.size - margin
        if stop <= first:
            self._held = parts
            return
        sums = np.zeros((MOST_REACH + 1, self.classes), SUMS)
        at, smooth, rate, reach, late = _local_cubics(
            time, count, stretch, self.unit_rad, first, stop, self._last, sums
        )
        self._note_scatter(sums)
        if at.size:
            self._last = float(smooth[-1])
            small = (
                count[at].astype(np.int32),
                rate.astype(np.float32),
                stretch[at].astype(np.int32),
            )
            kept = late.astype(np.float32) if self.edges else np.zeros(0, np.float32)
            self._parts.append(Knots(smooth, *small, forward[at], reach, kept))
        begin = max(stop - margin, 0)
        self._held, self._first = tuple(p[begin:] for p in parts), stop - begin

    def _note_scatter(self, sums: Records) -> None:
        """Notes what the cubics of each reach left.

        Each class of counts about its own mean: a cubic that keeps w of a passage leaves 1 - w.
        """
        number, total, squares = (sums[name].copy() for name in ("number", "total", "squares"))
        kept = VALUE[:, MOST_REACH]
        left = (squares - total**2 / np.maximum(number, 1.0)).sum(axis=1)[LEAST_REACH:]
        freedom = (number.sum(axis=1) - (number > 0).sum(axis=1))[LEAST_REACH:]
        self._variance += float(np.sum(left / (1 - kept[LEAST_REACH:])))
        self._freedom += float(freedom.sum())
        self._kept += number.sum(axis=1) * kept

    def knots(self) -> Knots:
        """All knots; nothing can be added after."""
        if self._held is not None:
            self._add(tuple(p[:0] for p in self._held), last=True)
        fields = zip(*(vars(part).values() for part in self._parts), strict=True)
        return Knots(*(np.concatenate(pieces) for pieces in fields))

    def noise_rad(self, otherwise: float) -> float:
        """Standard deviation of a knot: from what the cubics leave.

        Of a passage alone, `otherwise`, if the log is too short.
        """
        if self._freedom < 100:
            return otherwise
        number = float(
            self._kept.sum() / max(float((self._kept / VALUE[:, MOST_REACH]).sum()), 1.0)
        )
        return float(np.sqrt(self._variance / self._freedom * number))


def angle_function(
    knots: Knots,
    error_rad: FloatArray,
    sign: Integers,
    offset: Integers,
    unit_rad: float,
    noise_rad: float,
    sample_s: float = 0.0,
) -> AngleFunction:
    """The wheel angle through `knots`, whose arrays it keeps and changes.

    `error_rad` the pitch error of each count modulo its size; `sign`, `offset` of shape
    (stretches,): what makes the counts of a stretch those of the wheel; `noise_rad` standard
    deviation of a knot; `sample_s` the time between two samples, for knots of edges.
    """
    value, slope = (
        np.stack([_around(error_rad, row) for row in weights]) for weights in (VALUE, SLOPE)
    )
    time, latest = knots.time_s, -np.inf
    for start in range(0, time.size, PIECE):
        piece = slice(start, start + PIECE)
        count, rate, stretch, reach = (
            knots.count[piece],
            knots.rate_rad_s[piece],
            knots.stretch[piece],
            knots.reach[piece],
        )
        count[:] = sign[stretch] * count + offset[stretch]
        rate *= sign[stretch]
        place = np.mod(count, error_rad.size)
        pace = np.where(rate == 0, np.inf, rate)
        late = value[reach, place] / pace
        if knots.late_s.size:
            knots.late_s[piece] -= (error_rad[place] - value[reach, place]) / pace
        rate /= 1 - slope[reach, place] / unit_rad
        time[piece] = np.maximum.accumulate(np.maximum(time[piece] - late, latest))
        latest = float(time[piece][-1])
    grid = np.zeros(0, np.float32)
    if knots.late_s.size:
        grid = np.abs(knots.rate_rad_s) * _grid_s(knots, sample_s).astype(np.float32)
        noise_rad = float(np.median(grid))
    return AngleFunction(
        time, knots.count, unit_rad, knots.rate_rad_s, knots.stretch, noise_rad, grid
    )


def _grid_s(knots: Knots, sample_s: float) -> FloatArray:
    """Standard deviation [s] of the times of knots of edges, shape (n,).

    An edge is uniform between two samples: its variance is known. A cubic that keeps w of its
    middle edge leaves 1 - w of that if edges are independent, and less if neighbours are alike; the
    knot has the rest. Whatever is left, the knot has w / (1 - w) of it at least: chance of any
    other kind is independent from edge to edge.
    """
    laid = knots.reach > 0
    share = np.maximum(sliding_mean(laid.astype(np.float64), GRID_KNOTS), 0.5 / GRID_KNOTS)
    left, kept = (
        sliding_mean(np.where(laid, values, 0.0), GRID_KNOTS) / share
        for values in (knots.late_s.astype(np.float64) ** 2, VALUE[knots.reach, MOST_REACH])
    )
    alone = sample_s**2 / 12
    variance = np.maximum(alone - left, kept / (1 - kept) * left)
    return np.sqrt(np.where(laid, variance, alone))


def _around(error_rad: FloatArray, weights: FloatArray) -> FloatArray:
    """The weighted sum of the errors around each count of a turn, shape as given."""
    place = np.arange(error_rad.size)
    return np.asarray(
        sum(w * error_rad[(place + j - MOST_REACH) % error_rad.size] for j, w in enumerate(weights))
    )
