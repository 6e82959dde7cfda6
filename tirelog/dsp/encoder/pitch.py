"""The pitch error of a tone wheel, learnt from the log itself while it streams by.

    pieces of times, counts, stretches (n,)
        --smooth motion over whole turns--> deviation of each passage [rad]
        --means over turns, a stretch at a time--> which way and by how many teeth the stretches lie
                                                   against each other
        --all together--> table (2 steps,)

The time of count n is the smooth motion's plus the pitch error over the speed. Smoothing by B (2 -
B), B the mean over one turn, keeps motions up to the third order in the count and has a zero at
every harmonic of the wheel, so whatever is fixed to the wheel stays in the deviation: errors of the
teeth, the offset between rising and falling passages, and what a once-per-turn change of amplitude
does to them. Its constant part is a convention and left out.

Seen by a wheel that rolls backwards the pattern is reversed, and rising passages are falling ones:
an uneven tone wheel shows its direction.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from tirelog.dsp.encoder.kernels import SUMS
from tirelog.dsp.encoder.signal import Integers
from tirelog.dsp.sliding import sliding_mean
from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, Records

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


@compiled
def _window_mean(x: FloatArray, turn: int) -> FloatArray:
    """Mean over the turn around each of x (n,), half weights at the window's ends.

    NaN within half a turn of the ends.
    """
    half, mean = turn // 2, np.full(x.size, np.nan)
    total = 0.0
    for i in range(turn):
        total += x[i]
    for i in range(half, x.size - half):
        mean[i] = (total + 0.5 * (x[i + half] - x[i - half])) / turn
        total += x[i + half] - x[i - half]
    return mean


@compiled
def _deviation_sums(
    time: FloatArray, seen: NDArray[np.bool_], first: int, turn: int, limit: float, sums: Records
) -> None:
    """Adds the deviations of the passages of one stretch to `sums` (turn,) of SUMS.

    By the count modulo the turn, without the turn at each end and without uneven turns; none above
    `limit` [rad]. `time` (n,) [s] of the counts `first`, `first` + 1, ..., of those `seen` only.
    """
    n, half = time.size, turn // 2
    pace = (time[n - 1] - time[0]) / (n - 1)
    bent = np.empty(n)
    for i in range(n):
        bent[i] = time[i] - (time[0] + pace * i)
    once = _window_mean(bent, turn)
    twice = _window_mean(once[half : n - half], turn)
    for i in range(turn, n - turn):
        lap, before, after = (
            time[i + half] - time[i - half],
            time[i] - time[i - turn],
            time[i + turn] - time[i],
        )
        if seen[i] and abs(after - before) < 0.1 * lap:
            deviation = (bent[i] - 2 * once[i] + twice[i - half]) * 2 * np.pi / lap
            if abs(deviation) < limit:
                k = (first + i) % turn
                sums[k]["number"] += 1
                sums[k]["total"] += deviation
                sums[k]["squares"] += deviation * deviation


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
            seen = np.ones(whole.size, bool)
            if whole.size != at.size:
                seen[:] = False
                seen[at - at[0]] = True
            at_each = time if whole.size == at.size else np.interp(whole, at, time)
            _deviation_sums(
                at_each, seen, int(at[0]), turn, np.pi / self.steps, self.stretches[-1].sums
            )
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
