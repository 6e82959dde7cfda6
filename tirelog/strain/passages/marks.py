"""What was wrong around each passage.

Words for its window, passages that were lost, breaks between passages.

A word stands in a row only if the trouble lies inside the row's own window (half a patch and its
shoulders on either side).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel
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
    gaps = np.asarray(channel.axis.first[1:], float) - 0.5
    flags |= marked(_touched(index - reach, index + reach, gaps, gaps), Quality.GAP)
    for word in {word for _, _, word in channel.flags}:
        doubted = np.array([(a, b - 1) for a, b, own in channel.flags if own == word], float)
        touched = _touched(index - reach, index + reach, *doubted.T)
        flags |= marked(touched, word)
    return flags


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


def lost_between(
    channel: Channel, time_s: FloatArray, omega: FloatArray, turns: FloatArray, window_rad: float
) -> IntArray:
    """Passages that lie in lost samples between each passage and the next, shape (n - 1,).

    `turns` (n - 1,) as the speeds give them. Two to MOST_LOST + 1 turns count, if the samples are
    lost around every place of such a passage.
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
    """Share of the samples between two times that are lost.

    0 if the recording itself has a gap there.
    """
    low, high = round(float(channel.axis.index(begin_s))), round(float(channel.axis.index(end_s)))
    expected = (end_s - begin_s) * channel.axis.rate_Hz
    if high <= low or high - low < 0.8 * expected:
        return 0.0
    return float(np.mean(~np.isfinite(channel.read(low, high + 1))))


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
    linked: NDArray[np.bool_],
    turned: NDArray[np.bool_],
    untimed: NDArray[np.bool_],
) -> QualityFlags:
    """Why a passage and the next are not known to be one turn apart, shape (n,).

    No word if they are (and for the last), else gap, reversing (it came back before a turn was
    done, or passed the other way round: `turned`) or standstill (the wheel took longer than its
    speeds allow). Where the clock was set back (`untimed`) that is as a gap.
    """
    apart = ~linked[:-1]
    gap = untimed | (np.diff(np.searchsorted(channel.axis.first[1:], index)) != 0)
    still = (turns > 1) & ~turned
    why = (
        marked(apart & gap, Quality.GAP)
        | marked(apart & ~gap & still, Quality.STANDSTILL)
        | marked(apart & ~gap & ~still, Quality.REVERSING)
    )
    return np.append(why, np.uint32(0))
