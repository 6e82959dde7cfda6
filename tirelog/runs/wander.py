"""A sample clock whose rate wanders, seen through stamps coarser than its samples.

    first sample of each tick, its stamp --missing samples counted in--> (clock index, stamp)
        --one line leaves more than two ticks--> means of some ticks --> times between them

Programs that pace the sampling themselves keep a rate to some percent only. One rate for the whole
log then puts samples seconds away from where they were taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tirelog.runs.stamps import Stamps
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: first samples of ticks that are looked at; of more, every second, third, ...
_MOST_POINTS = 1 << 20
#: ticks averaged to one point of the clock: the first sample of a tick lies anywhere in a period,
#: which the mean of 16 tells to 0.07 of it; twice as many follow a change of rate half as quickly
_TICKS = 16
#: ticks on each side whose median is the usual rate about a tick; twice as many follow a rate that
#: wanders half as quickly
_ABOUT = 15
#: samples per tick below which a stamp is no coarse one; twice as many leave finer stamps to the
#: plain fit
_LEAST_PER_TICK = 4.0
#: stamps of a steady clock stay within one tick of their line; beyond so many its rate wanders;
#: twice as many put a clock that wanders by up to four ticks on one straight line
_STRAYS_TICKS = 2.0
#: samples that a tick lacks before they count as missing: a steady one has one more or less; twice
#: as many leave gaps of up to three samples unsaid
_MISSING = 1.6
#: ticks on each side of a gap that say whether it lasts; twice as many need gaps that are twice as
#: far apart
_LASTS = 5
#: and they lack more than so many times what ticks usually lack or have too many; twice as many
#: leave gaps unsaid that are half as large where ticks scatter
_UNUSUAL = 6.0


@dataclass(frozen=True)
class Wandering:
    """A clock by its points: ascending clock index and time [s], shape (k,) each.

    `gaps` (first sample behind, samples missing); `low_Hz` and `high_Hz` hold nine tenths of it.
    """

    stamps: Stamps
    at: FloatArray
    time_s: FloatArray
    rate_Hz: float
    low_Hz: float
    high_Hz: float
    gaps: tuple[tuple[int, int], ...]

    def times(self, start: int, stop: int) -> FloatArray:
        """Times [s] of the samples [start, stop); the first sample of the log is at 0."""
        return self._time(np.arange(start, stop)) - self._time(np.zeros(1, np.int64))

    def _time(self, index: IntArray) -> FloatArray:
        behind = np.array([first for first, _ in self.gaps], np.int64)
        before = np.cumsum([0, *(missing for _, missing in self.gaps)])
        k = self.stamps.clock_index(index) + before[np.searchsorted(behind, index, side="right")]
        found = np.interp(k, self.at, self.time_s)
        for end, beyond in ((0, k < self.at[0]), (-1, k > self.at[-1])):
            pair = slice(0, 2) if end == 0 else slice(-2, None)
            slope = np.diff(self.time_s[pair])[0] / np.diff(self.at[pair])[0]
            found = np.where(beyond, self.time_s[end] + slope * (k - self.at[end]), found)
        return np.asarray(found, np.float64)


@dataclass(frozen=True)
class Ticks:
    """First samples of ticks: their clock index and stamp [s], shape (n,) each.

    `missing` (n - 1,): samples that lack between one and the next; `gaps` the same as (first sample
    behind, samples missing). `wrong`: [start, stop) of samples whose stamp is not the clock's.
    """

    stamps: Stamps
    k: IntArray
    stamp_s: FloatArray
    missing: IntArray
    gaps: tuple[tuple[int, int], ...]
    wrong: tuple[tuple[int, int], ...] = ()


def coarse_ticks(stamps: Stamps, period: float, resolution_s: float) -> Ticks | None:
    """The ticks of stamps that are coarser than their samples and always rise, else None.

    `period` is roughly the sample's [s], `resolution_s` the tick of the stamps.
    """
    if not stamps.bunched or resolution_s < _LEAST_PER_TICK * period:
        return None
    index, k, stamp = _points(stamps, period)
    if k.size < 4 * _TICKS or not (np.diff(stamp) > 0.0).all():
        return None
    wrong: tuple[tuple[int, int], ...] = ()
    if stamp[-1] - stamp[-2] > stamp[-2] - stamp[0]:  # nothing follows a leap longer than the log
        wrong = ((int(index[-1]), stamps.spool.size),)
        index, k, stamp = index[:-1], k[:-1], stamp[:-1]
    steps, samples = np.diff(stamp), np.diff(k)
    rate = _running_median(samples / steps)
    lacking = steps * rate - samples
    usual = 1.4826 * float(np.median(np.abs(lacking - np.median(lacking))))
    lacks = lacking > max(_MISSING, _UNUSUAL * usual)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], lacks.astype(np.int8), [0]])))
    missing, gaps = np.zeros(lacking.size, np.int64), []
    level = np.concatenate([[0.0], np.cumsum(lacking)])
    # a pace that is not even walks away a little, too, over as many ticks
    walks = level[2 * _LASTS :] - level[: -2 * _LASTS]
    least = max(_MISSING, _UNUSUAL * 1.4826 * float(np.median(np.abs(walks - np.median(walks)))))
    for start, stop in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        # what one tick lacks the next may have too many: a sample late by a moment is not missing
        before = np.median(level[max(start - _LASTS, 0) : start + 1])
        lasting = round(float(np.median(level[stop : stop + _LASTS + 1]) - before))
        if lasting >= least:
            at = start + int(lacking[start:stop].argmax())
            missing[at] = lasting
            gaps.append((int(index[at + 1]), lasting))
    return Ticks(stamps, k, stamp, missing, tuple(gaps), wrong)


def wandering(seen: Ticks, resolution_s: float) -> Wandering | None:
    """The clock behind ticks of `resolution_s` if its rate wanders; None if one rate will do."""
    stamp = seen.stamp_s
    if _strays(seen) <= _STRAYS_TICKS * resolution_s:
        return None
    whole = seen.k + np.concatenate([[0], np.cumsum(seen.missing)])
    groups = whole.size // _TICKS
    at = whole[: groups * _TICKS].reshape(groups, _TICKS).mean(axis=1)
    time = stamp[: groups * _TICKS].reshape(groups, _TICKS).mean(axis=1)
    rates = np.diff(at) / np.diff(time)
    low, middle, high = np.percentile(rates, [5.0, 50.0, 95.0])
    return Wandering(seen.stamps, at, time, float(middle), float(low), float(high), seen.gaps)


def _strays(seen: Ticks) -> float:
    """How far [s] the ticks between two gaps reach about lines of one period, at most."""
    piece = np.concatenate([[0], np.cumsum(seen.missing > 0)])
    size = np.bincount(piece)
    k = seen.k - (np.bincount(piece, seen.k) / size)[piece]
    stamp = seen.stamp_s - (np.bincount(piece, seen.stamp_s) / size)[piece]
    residual = stamp - k * (k @ stamp) / max(float(k @ k), 1.0)
    starts = np.concatenate([[0], np.cumsum(size)[:-1]])
    reach = np.maximum.reduceat(residual, starts) - np.minimum.reduceat(residual, starts)
    return float(reach.max())


def _points(stamps: Stamps, period: float) -> tuple[IntArray, IntArray, FloatArray]:
    """(index, clock index, stamp) of the first samples of ticks, _MOST_POINTS at most."""
    many = sum(index.size for index, _, _ in stamps.points(period))
    stride, seen, parts = -(-many // _MOST_POINTS) or 1, 0, []
    for index, k, stamp in stamps.points(period):
        taken = slice(-seen % stride, None, stride)
        parts.append((index[taken], k[taken], stamp[taken]))
        seen += index.size
    if not parts:
        return np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
    index, k, stamp = (np.concatenate(column) for column in zip(*parts, strict=True))
    return index, k, stamp


def _running_median(values: FloatArray) -> FloatArray:
    """The median of each value and its neighbours, as far as there are any; same shape."""
    padded = np.pad(values, _ABOUT, mode="edge")
    out = np.empty(values.size)
    for start in range(0, values.size, 1 << 16):
        part = padded[start : start + (1 << 16) + 2 * _ABOUT]
        windows = np.lib.stride_tricks.sliding_window_view(part, 2 * _ABOUT + 1)
        out[start : start + windows.shape[0]] = np.median(windows, axis=1)
    return out
