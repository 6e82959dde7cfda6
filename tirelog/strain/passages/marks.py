"""What was wrong around each passage.

Words for its window, passages that were lost, breaks between passages.

A word stands in a row only where the trouble lies inside the row's own window (half a patch and its
shoulders on either side).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel
from tirelog.strain.passages.fit import Fit
from tirelog.strain.passages.kinematics import TURN_RAD
from tirelog.vocabulary.arrays import FloatArray, IntArray

NO_WORDS: frozenset[str] = frozenset()
#: at most this many passages in a row are put in as lost
MOST_LOST = 4
#: share of a window's samples that must be lost before a passage counts as lost there
LOST_SHARE = 0.3


def window_words(
    channel: Channel,
    found: Fit,
    others: Mapping[str, NDArray[np.bool_]],
    index: FloatArray,
    reach: FloatArray,
) -> tuple[frozenset[str], ...]:
    """Words for each row; `others`: words that are known already, and where; `index` and `reach`
    [samples] say where its window lies.
    """
    words: defaultdict[int, set[str]] = defaultdict(set)
    known = {
        "lost_peak": found.lost,
        "spike": found.spike,
        "clipped": found.clipped,
        "edge_of_log": found.outside,
        **others,
    }
    for word, where in known.items():
        for row in np.flatnonzero(where).tolist():
            words[row].add(word)
    gaps = [(float(first) - 0.5, float(first) - 0.5, "gap") for first in channel.axis.first[1:]]
    doubts = [(float(start), float(stop - 1), word) for start, stop, word in channel.flags]
    begin, end = index - reach, index + reach
    # the rows are in order, and their windows nearly so: what comes into question stands together
    furthest, nearest = np.maximum.accumulate(end), np.minimum.accumulate(begin[::-1])[::-1]
    for low, high, word in gaps + doubts:
        for row in range(
            int(np.searchsorted(furthest, low)), int(np.searchsorted(nearest, high, side="right"))
        ):
            if end[row] >= low and begin[row] <= high:
                words[row].add(word)
    return with_words([NO_WORDS] * index.size, words)


def with_words(
    rows: Sequence[frozenset[str]], more: Mapping[int, set[str]]
) -> tuple[frozenset[str], ...]:
    """`rows` with `more` words in some of them."""
    result = list(rows)
    for row, words in more.items():
        result[row] = result[row] | words
    return tuple(result)


def lost_between(
    channel: Channel, time_s: FloatArray, omega: FloatArray, turns: FloatArray, window_rad: float
) -> IntArray:
    """Passages that lie in lost samples between each passage and the next, shape (n - 1,).

    `turns` (n - 1,) as the speeds give them. Two to MOST_LOST + 1 turns count, where the samples
    are lost at every place between.
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
    """Share of the samples between two times that are lost; 0 where the recording itself has a gap
    there.
    """
    low, high = round(float(channel.axis.index(begin_s))), round(float(channel.axis.index(end_s)))
    expected = (end_s - begin_s) * channel.axis.rate_Hz
    if high <= low or high - low < 0.8 * expected:
        return 0.0
    return float(np.mean(~np.isfinite(channel.read(low, high + 1))))


def between(t0: float, t1: float, omega0: float, omega1: float, count: int) -> FloatArray:
    """Times of `count` passages evenly spread in angle between two, by the cubic of time over angle
    with the speeds at both ends.
    """
    u = np.arange(1, count + 1) / (count + 1)
    angle = (count + 1) * TURN_RAD
    return (
        t0 * (1 + 2 * u) * (1 - u) ** 2
        + t1 * u**2 * (3 - 2 * u)
        + angle * (u * (1 - u) ** 2 / omega0 - u**2 * (1 - u) / omega1)
    )


def breaks(
    channel: Channel,
    index: FloatArray,
    turns: FloatArray,
    linked: NDArray[np.bool_],
    turned: NDArray[np.bool_],
) -> NDArray[np.str_]:
    """Why a passage and the next are not known to be one turn apart, shape (n,): '' where they are
    (and for the last), else 'gap', 'reversing' (it came back before a turn was done, or passed the
    other way round: `turned`) or 'standstill' (the wheel took longer than its speeds allow).
    """
    why = np.zeros(index.size, "U10")
    gaps = channel.axis.first[1:]
    for k in np.flatnonzero(~linked[:-1]):
        gap = np.searchsorted(gaps, index[k]) != np.searchsorted(gaps, index[k + 1])
        why[k] = "gap" if gap else ("standstill" if turns[k] > 1 and not turned[k] else "reversing")
    return why
