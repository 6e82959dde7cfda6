"""The pitch error of a tone wheel, learnt from the log itself.

    times (n,), counts (n,) --smooth motion over whole turns--> deviation of each passage [rad] --mean over turns--> table (2 steps,)

The time of count n is the smooth motion's plus the pitch error over the speed.  Smoothing by B (2 - B), B the mean over one turn,
keeps motions up to the third order in the count and has a zero at every harmonic of the wheel, so whatever is fixed to the wheel
stays in the deviation: errors of the teeth, the offset between rising and falling passages, and what a once-per-turn change of
amplitude does to them.  Its constant part is a convention and left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import uniform_filter1d

from tirelog.dsp.encoder_signal import Integers
from tirelog.recording import FloatArray

#: turns that a table needs; fewer leave it zero
LEAST_TURNS = 4
#: so many turns at once, and of a long log only so many altogether, evenly spread: by then the table's error is a thousandth of a degree
TURNS_AT_ONCE, MOST_TURNS = 100, 800
#: tables that explain more of their deviations than this can be laid on one another
CLEAR = 0.5


@dataclass(frozen=True)
class PitchTable:
    """`error_rad` (2 steps,) true angle of a passage minus its nominal angle, zero mean; `se_rad` its standard error (a number);
    `turns` it was learnt from; `scatter_rad` standard deviation of one passage about the table; `repeats` the share of the
    deviations' variance that the table explains beyond chance, in [0, 1]."""

    error_rad: FloatArray
    se_rad: float
    turns: int
    scatter_rad: float
    repeats: float

    @classmethod
    def zero(cls, steps: int) -> PitchTable:
        return cls(np.zeros(2 * steps), 0.0, 0, 0.0, 0.0)


def deviations(time_s: FloatArray, count: Integers, steps: int) -> tuple[Integers, FloatArray]:
    """(counts, deviations [rad]) of one stretch of ascending counts, without the turn at each end; and without uneven turns.

    `time_s`, `count` shape (n,).  Passages that are missing are bridged for the smoothing and left out of the result.
    """
    turn = 2 * steps
    if count.size < 3 * turn or count[-1] - count[0] < 4 * turn or not (np.diff(count) > 0).all():
        return np.zeros(0, np.int64), np.zeros(0)
    whole = np.arange(count[0], count[-1] + 1)
    time = time_s if whole.size == count.size else np.interp(whole, count, time_s)
    line = np.linspace(time[0], time[-1], time.size)
    bent = time - line
    # a window of an even number of steps needs half weights at its ends to be centred
    once = _turn_mean(bent, turn)
    smooth = 2 * once - _turn_mean(once, turn) + line
    lap = np.full(whole.size, np.nan)
    lap[steps:-steps] = (time[turn:] - time[:-turn])[: whole.size - turn]
    rate = 2 * np.pi / lap
    change = np.full(whole.size, np.nan)
    change[turn:-turn] = np.abs(lap[turn + steps : -turn + steps] - lap[turn - steps : -turn - steps]) / lap[turn:-turn]
    good = np.isfinite(change) & (change < 0.1)
    if whole.size != count.size:
        good &= np.isin(whole, count, assume_unique=True)
    return whole[good], ((time - smooth) * rate)[good]


def _turn_mean(x: FloatArray, turn: int) -> FloatArray:
    wide = uniform_filter1d(x, turn, mode="nearest")
    return 0.5 * (wide + np.concatenate([wide[1:], wide[-1:]]))


def aligned(stretches: list[tuple[FloatArray, Integers]], steps: int) -> list[int]:
    """Half teeth (even numbers) to add to each stretch's counts so that its pitch errors fall on those of the longest one.

    After a standstill or a hole the count may have lost teeth; the tone wheel's own pattern gives them back.  Zero where a stretch is
    too short or the pattern too faint to tell.
    """
    tables = [learn([stretch], steps) for stretch in stretches]
    best = max(range(len(tables)), key=lambda k: tables[k].turns, default=0)
    shifts = []
    for table in tables:
        shift = 0
        if table.turns and table.repeats > CLEAR and tables[best].repeats > CLEAR:
            match = np.sum([_match(tables[best].error_rad[k::2], table.error_rad[k::2]) for k in (0, 1)], axis=0)
            first = int(np.argmax(match))
            if match[first] > 1.2 * np.max(np.delete(match, first)):
                shift = 2 * first - (2 * steps if 2 * first > steps else 0)
        shifts.append(shift)
    return shifts


def _match(a: FloatArray, b: FloatArray) -> FloatArray:
    """Correlation of `a` with `b` moved by 0, 1, ... places, each without its mean (a level offset shifts all rising passages alike)."""
    return np.fft.irfft(np.fft.rfft(a - a.mean()) * np.conj(np.fft.rfft(b - b.mean())), a.size)


def learn(stretches: list[tuple[FloatArray, Integers]], steps: int) -> PitchTable:
    """The table from (times, counts) of all stretches."""
    size = 2 * steps
    total, squares, number = np.zeros(size), 0.0, np.zeros(size)
    every = max(sum(count.size for _, count in stretches) // (MOST_TURNS * size), 1)
    for time_s, count in stretches:
        for start in range(0, count.size, every * TURNS_AT_ONCE * size):
            piece = slice(max(start - 2 * size, 0), start + (TURNS_AT_ONCE + 2) * size)
            at, deviation = deviations(time_s[piece], count[piece], steps)
            near = np.abs(deviation) < np.pi / steps
            at, deviation = np.mod(at[near], size), deviation[near]
            total += np.bincount(at, deviation, size)
            number += np.bincount(at, minlength=size)
            squares += float(deviation @ deviation)
    turns = float(np.median(number))
    if turns < LEAST_TURNS:
        return PitchTable.zero(steps)
    table = total / np.maximum(number, 1.0)
    explained = float(number @ table**2)
    left = max(squares - explained, 0.0) / max(number.sum() - size, 1.0)
    table = np.where(number > 0, table - table[number > 0].mean(), 0.0)
    chance = left * size
    share = max(explained - chance, 0.0) / max(squares, np.finfo(float).tiny)
    return PitchTable(table, float(np.sqrt(left / turns)), int(turns), float(np.sqrt(left)), share)


def steps_that_repeat(stretches: list[tuple[FloatArray, Integers]], steps: int, most: int = 256) -> tuple[int, float, float]:
    """(steps a turn with which the deviations repeat best, share of their variance that these explain beyond chance, the same of `steps`).

    The passages are smoothed over a few teeth only, so that the turn of the setup is not presumed.  Of multiples the least that explains as
    much as the best.  Shares are zero where the log is too short.
    """
    time_s, count = max(stretches, key=lambda s: s[1].size)
    time_s, count = time_s[: 400 * steps], count[: 400 * steps]
    if count.size < 64 or count[-1] - count[0] != count.size - 1:
        return steps, 0.0, 0.0
    deviation = ((time_s - uniform_filter1d(time_s, 9)) / np.gradient(time_s))[16:-16]
    deviation = deviation - np.mean(deviation)
    squares = float(deviation @ deviation)
    shares = np.zeros(most + 1)
    for candidate in range(4, most + 1):
        size = 2 * candidate
        if deviation.size < 4 * size:
            break
        at = np.mod(np.arange(deviation.size), size)
        explained = float(np.sum(np.bincount(at, deviation, size) ** 2 / np.bincount(at, minlength=size)))
        shares[candidate] = (explained - squares * size / deviation.size) / max(squares, np.finfo(float).tiny)
    best = int(np.argmax(shares > shares.max() - 0.03))
    return best, float(shares[best]), float(shares[steps]) if steps <= most else 0.0
