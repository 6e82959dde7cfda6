"""What was wrong around each passage.

Words for its window, passages that were lost, breaks between passages.

A word stands in a row only if the trouble lies inside the row's own window (half a patch and its
shoulders on either side).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel, TimeAxis
from tirelog.strain.passages.fit import PassageFit
from tirelog.strain.passages.kinematics import TURN_RAD
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.quality import Quality, QualityFlags, marked

#: at most this many passages in a row are put in as lost; twice as many number turns by a speed
#: that may have changed over as many
MOST_LOST = 4
#: share of a window's samples that must be lost before a passage counts as lost there; twice as
#: much asks for most of a window, and passages lost by a third of it stay uncounted
LOST_SHARE = 0.3
#: deceleration [m/s^2] at which a wheel that rolls on may stop within a turn (a car's: from 7.8
#: m/s), half as much again as a dry road allows; faster ones did not stop between two passages.
#: Twice as much takes for a stop what was not found at 11 m/s
STOPPING_M_S2 = 16.0
#: turns that a time may be off whole ones, by the turns before and after, which may differ by this
#: ratio.  Twice as much takes any time for whole turns; of twice the ratio, turns at either end of
#: a hard braking tell nothing of those in between
NEARLY_WHOLE, ALIKE_TURNS = 0.25, 1.5


def window_quality(
    channel: Channel, found: PassageFit, index: FloatArray, reach: FloatArray
) -> QualityFlags:
    """Quality words of each row's window, which lies within `reach` [samples] of `index`; (n,)."""
    flags = (
        marked(found.lost, Quality.LOST_PEAK)
        | marked(found.spike, Quality.SPIKE)
        | marked(found.clipped, Quality.CLIPPED)
        | marked(found.outside, Quality.EDGE_OF_LOG)
    )
    flags |= marked(in_gap(channel.axis, index, reach), Quality.GAP)
    for word in {word for _, _, word in channel.flags}:
        flags |= marked(doubted(channel, word, index - reach, index + reach), word)
    return flags


def in_gap(
    axis: TimeAxis, index: FloatArray, reach: FloatArray, longer: float = 0.0
) -> NDArray[np.bool_]:
    """Whether the recording has a gap within `reach` [samples] of each `index`, (n,).

    `longer` than so many samples; 0 takes every gap.
    """
    gaps = np.asarray(axis.first[1:], float) - 0.5
    if longer > 0.0:
        gaps = gaps[axis.missing[1:] > longer]
    return _touched(index - reach, index + reach, gaps, gaps)


def doubted(
    channel: Channel, word: Quality, begin: FloatArray, end: FloatArray
) -> NDArray[np.bool_]:
    """Which stretches [begin, end] (n,) [samples] of `channel` hold what the `word` was said of."""
    ranges = [(a, b - 1) for a, b, own in channel.flags if own == word]
    return _touched(begin, end, *np.array(ranges, float).reshape(-1, 2).T)


def _touched(
    begin: FloatArray, end: FloatArray, low: FloatArray, high: FloatArray
) -> NDArray[np.bool_]:
    """Which windows [begin, end] (n,) share a place with one of the ranges [low, high] (m,)."""
    if not low.size:
        return np.zeros(begin.size, bool)
    order = np.argsort(low)
    furthest = np.maximum.accumulate(high[order])
    # of the ranges that begin before a window ends, the one that ends last decides
    before = np.searchsorted(low[order], end, side="right")
    reached: NDArray[np.bool_] = furthest[np.maximum(before, 1) - 1] >= begin
    return (before > 0) & reached


def rolled_on(omega: FloatArray, radius_m: float) -> NDArray[np.bool_]:
    """Whether the wheel was too fast to stop between each passage and the next, (n - 1,)."""
    slower = radius_m * np.minimum(omega[1:], omega[:-1])
    return np.asarray(slower > np.sqrt(2.0 * STOPPING_M_S2 * TURN_RAD * radius_m))


def whole_turns(
    time_s: FloatArray, linked: NDArray[np.bool_], rolled: NDArray[np.bool_]
) -> IntArray:
    """Whole turns from each passage to the next, as the turns around tell; 0 if they do not.

    Of a wheel that `rolled` on (n - 1,), at a speed between those of the nearest pairs before and
    after that are `linked` (n - 1,), which are one turn apart.
    """
    period = np.diff(time_s)
    known = np.append(np.flatnonzero(linked), -1)
    pair = np.arange(period.size)
    before = known[np.searchsorted(known[:-1], pair) - 1]
    after = known[np.searchsorted(known[:-1], pair, side="right")]
    sides = np.where([before >= 0, after >= 0], period[[before, after]], np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):  # stamps that repeat have no period
        turns = period / sides.mean(axis=0)
    whole = np.rint(turns)
    sure = rolled & (np.abs(turns - whole) < NEARLY_WHOLE) & (whole <= MOST_LOST + 1)
    sure &= sides.max(axis=0) < ALIKE_TURNS * sides.min(axis=0)
    return np.where(sure, whole, 0.0).astype(np.int64)


def lost_between(
    channel: Channel, time_s: FloatArray, omega: FloatArray, turns: FloatArray, window_rad: float
) -> IntArray:
    """Passages that lie in lost samples between each passage and the next, shape (n - 1,).

    `turns` (n - 1,) as the speeds give them. Two to MOST_LOST + 1 turns count, if the samples are
    lost or missing around every place of such a passage.
    """
    whole = np.rint(turns)
    lost = np.zeros(turns.size, np.int64)
    likely = np.flatnonzero(
        (whole >= 2) & (whole <= MOST_LOST + 1) & (np.abs(turns - whole) < 0.15 * whole)
    )
    for k in likely:
        count = int(whole[k]) - 1
        times = between(time_s[k], time_s[k + 1], omega[k], omega[k + 1], count)
        reach = window_rad / omega[k]
        if all(_lost_share(channel, t - reach, t + reach) > LOST_SHARE for t in times):
            lost[k] = count
    return lost


def _lost_share(channel: Channel, begin_s: float, end_s: float) -> float:
    """Share of the samples between two times that are lost, or missing in a gap."""
    low, high = round(float(channel.axis.index(begin_s))), round(float(channel.axis.index(end_s)))
    expected = float(high - low)
    if channel.axis.explicit is None:
        expected = max(expected, (end_s - begin_s) * channel.axis.rate_Hz)
    there = np.count_nonzero(np.isfinite(channel.read(low, high + 1)))
    return 1.0 - there / (expected + 1.0)


def between(t0: float, t1: float, omega0: float, omega1: float, count: int) -> FloatArray:
    """Times of `count` passages evenly spread in angle between two.

    By the cubic of time over angle with the speeds at both ends.
    """
    u = np.arange(1, count + 1) / (count + 1)
    angle = (count + 1) * TURN_RAD
    return (
        t0 * (1 + 2 * u) * (1 - u) ** 2
        + t1 * u**2 * (3 - 2 * u)
        + angle * (u * (1 - u) ** 2 / omega0 - u**2 * (1 - u) / omega1)
    )


def clock_between(channel: Channel, index: FloatArray) -> NDArray[np.bool_]:
    """Whether the clock was set back between each passage at `index` (n,) and the next, (n - 1,).

    Its time runs on, as if no sample lacked or came twice: what lies between is not known.
    """
    doubts = [
        (start, stop - 1) for start, stop, why in channel.flags if why == Quality.CLOCK_SET_BACK
    ]
    low, high = np.array(doubts, float).reshape(-1, 2).T
    return _touched(index[:-1], index[1:], low, high)


def breaks(
    channel: Channel,
    index: FloatArray,
    turns: FloatArray,
    shortest_s: FloatArray,
    linked: NDArray[np.bool_],
    turned: NDArray[np.bool_],
    rolled: NDArray[np.bool_],
    untimed: NDArray[np.bool_],
) -> QualityFlags:
    """Why a passage and the next are not known to be one turn apart, shape (n,).

    No word if they are (and for the last), else gap (so long that a passage may lie in it, of
    which LOST_SHARE of `shortest_s` is enough, or the clock was set back: `untimed`), lost_peak
    (the wheel `rolled` on, and passages between were not found), reversing (it came back before a
    turn was done, or passed the other way round: `turned`) or standstill (the wheel took longer
    than its speeds allow).
    """
    apart = ~linked[:-1]
    missing_s = np.diff(channel.axis.missing_before(index)) / channel.axis.rate_Hz
    gap = untimed | (missing_s > LOST_SHARE * shortest_s)
    still = (turns > 1) & ~turned
    why = np.select(
        [~apart, gap, rolled & ~turned, still],
        [0, Quality.GAP, Quality.LOST_PEAK, Quality.STANDSTILL],
        Quality.REVERSING,
    )
    return np.append(why, 0).astype(np.uint32)
