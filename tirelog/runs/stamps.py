"""Stamps put aside, and what passes over them tell.

Period, noise, lasting jumps, the line through them.

    append(stamps) ... -> Stamps --points()--> (k, t) --> rough_period, noise, jumps, fit

k is the clock index of a sample: its own index plus the samples missing before it (known from
sample numbers). r = t - T k is the residual against a clock of period T [s]. A *point* is a sample
whose stamp takes part: all of them, or if many stamps are alike the first one of each bunch that
begins within the log.
Every pass works in chunks, whatever the length of the log.
"""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Iterator
from itertools import chain, pairwise
from typing import TypeAlias

import numpy as np

from tirelog.vocabulary.arrays import FloatArray, IntArray

#: values kept in memory before they go to a file, and stamps looked at at once
_IN_MEMORY, _CHUNK = 1 << 18, 1 << 18


class Spool:
    """Float64 values, appended in order and read in slices [start, stop)."""

    def __init__(self) -> None:
        self.size = 0
        self._file = tempfile.SpooledTemporaryFile(8 * _IN_MEMORY, prefix="tirelog-")  # noqa: SIM115
        weakref.finalize(self, self._file.close)

    def append(self, values: FloatArray) -> None:
        self._file.seek(0, 2)
        self._file.write(np.ascontiguousarray(values, np.float64).tobytes())
        self.size += values.size

    def read(self, start: int, stop: int) -> FloatArray:
        start, stop = max(start, 0), min(stop, self.size)
        self._file.seek(8 * start)
        return np.frombuffer(self._file.read(8 * max(stop - start, 0)), np.float64)


#: a step below this share of the mean one belongs to the bunch before it; with that many of them
#: the stamps come in bunches; twice the first joins steps of up to 0.6 of the mean one to a bunch
_SAME, _BUNCHED = 0.3, 0.45
#: points on each side of a jump that say whether it lasts: for stamps much finer than a period,
#: and for others; twice as many need twice as long between two jumps
_FEW, _MANY = 5, 60
#: two stamps that are but rounded are off by so many last digits at most, and no more than this
#: share of all steps is more; with twice the first a lost sample hides where a period has two
#: digits; with twice the share logs that lose one sample of a hundred count as rounded
_ROUNDED, _JUMPING = 1.1, 0.005
#: stretches of so many stamps, of each of which a tick is known; ticks show where fewer steps than
#: this share are one number of them, as rows that stand twice or lack show where more are; steps
#: are whole ticks to this share of one, and stamps stay this near their line [ticks]
_STRETCHES, _STRETCH, _ALIKE, _WHOLE, _BOUND = 32, 256, 0.97, 1e-3, 1.2


#: a lasting change of level: its first sample behind, and by how much later stamps are from there
#: on than the clock says [s]
Jump: TypeAlias = tuple[int, float]


#: stamps between two lasting jumps: their first sample, means of clock index and stamp [s]
Piece: TypeAlias = tuple[int, float, float]


class Stamps:
    """All stamps of a group [s], NaN if unknown.

    With the samples that are known to be missing between them.
    """

    def __init__(self) -> None:
        self.spool = Spool()
        self.bunched = False
        self._behind = np.zeros(0, np.int64)  # first sample behind each run of missing ones
        self._before = np.zeros(1, np.int64)  # samples missing before it and all earlier ones

    def know_missing(self, missing: list[tuple[int, int]]) -> None:
        """Take (index of the first sample behind, samples missing) of each run of missing ones."""
        self._behind = np.array([index for index, _ in missing], np.int64)
        self._before = np.concatenate([[0], np.cumsum([number for _, number in missing])]).astype(
            np.int64
        )

    def clock_index(self, index: IntArray | int) -> IntArray:
        """Ticks of the sample clock since the first sample."""
        if not self._behind.size:
            return np.asarray(index)
        return np.asarray(index) + self._before[np.searchsorted(self._behind, index, side="right")]

    def known(self) -> Iterator[tuple[IntArray, FloatArray]]:
        """(index, stamp) of the samples that have one, chunk by chunk."""
        for start in range(0, self.spool.size, _CHUNK):
            stamps = self.spool.read(start, start + _CHUNK)
            if not np.isnan(stamps.sum()):
                yield np.arange(start, start + stamps.size), stamps
            elif (index := np.flatnonzero(~np.isnan(stamps))).size:
                yield start + index, stamps[index]

    def points(self, period: float) -> Iterator[tuple[IntArray, IntArray, FloatArray]]:
        """(index, clock index, stamp) of the points, chunk by chunk."""
        last = np.nan  # the log may begin in the midst of a bunch: its first stamp is no point
        for index, stamps in self.known():
            if self.bunched:
                begins = np.abs(np.diff(stamps, prepend=last)) > _SAME * period
                last = stamps[-1]
                index, stamps = index[begins], stamps[begins]
            if index.size:
                yield index, self.clock_index(index), stamps

    def reach(self, period: float, passing: list[tuple[int, int]]) -> int:
        """Ticks of the sample clock from the first point to the last, 1 at least.

        Of those that are in no range [start, stop) of stamps that left the clock.
        """
        edges = np.array(passing, np.int64).reshape(-1)
        ends = [0, 0]
        for index, k, _ in self.points(period):
            own = k[np.searchsorted(edges, index, side="right") % 2 == 0]
            if own.size:
                ends = [ends[0] or int(own[0]), int(own[-1])]
        return max(ends[1] - ends[0], 1)

    def ticks(self) -> tuple[float, float]:
        """(least, largest) step [s] that the stamps themselves show; (0, 0) if they show none.

        Of floats of few bits it grows along the log.
        """
        firsts = np.linspace(0, max(self.spool.size - _STRETCH, 0), _STRETCHES).astype(np.int64)
        found = [_tick(self.spool.read(first, first + _STRETCH)) for first in np.unique(firsts)]
        ticks = [tick for tick in found if tick]
        return (min(ticks), max(ticks)) if len(ticks) > 1 else (0.0, 0.0)

    def ends(self) -> tuple[tuple[int, float], tuple[int, float]] | None:
        """(index, stamp) of the first and of the last known stamp; None below two."""
        first = last = None
        for index, stamps in self.known():
            first = first or (int(index[0]), float(stamps[0]))
            last = int(index[-1]), float(stamps[-1])
        return (first, last) if first and last and first[0] != last[0] else None

    def rough_period(self) -> float:
        """T from differences over long stretches, by their median; 0 if stamps do not rise.

        Sets `bunched`.
        """
        size = self.spool.size
        period, steps, small = 0.0, 0, 0
        for lag in sorted({max(1, min(size // 8, 4096)), max(1, size // 2)}):
            starts = np.unique(
                np.linspace(0, size - 1 - lag, min(4000, size - lag)).astype(np.int64)
            )
            span = (self.clock_index(starts + lag) - self.clock_index(starts)).astype(float)
            slopes = (self._at(starts + lag) - self._at(starts)) / span
            found = float(np.nanmedian(slopes)) if np.isfinite(slopes).any() else 0.0
            if found <= 0.0:
                continue
            period = found
            if np.nanmedian(np.abs(slopes - found) * span) < 0.02 * found * lag:
                break
        for index, stamps in self.known():
            steps += max(index.size - 1, 0)
            paces = np.diff(stamps) / np.diff(self.clock_index(index))
            small += int(np.count_nonzero(np.abs(paces) < _SAME * period))
        self.bunched = small > _BUNCHED * max(steps, 1)
        if not self.bunched or period <= 0.0:
            return period
        # first stamps of bunches lie on the clock more closely than stamps in general
        pace = []
        for _, k, stamps in self.points(period):
            lag = min(k.size // 4, 1024)
            if lag:
                pace.append((stamps[lag:] - stamps[:-lag]) / (k[lag:] - k[:-lag]))
        return float(np.median(np.concatenate(pace))) if pace else period

    def _at(self, index: IntArray) -> FloatArray:
        """Stamps at ascending indices."""
        out = np.empty(index.size)
        for start in range(0, self.spool.size, _CHUNK):
            here = slice(*np.searchsorted(index, [start, start + _CHUNK]))
            if here.stop > here.start:
                out[here] = self.spool.read(start, start + _CHUNK)[index[here] - start]
        return out

    def noise(self, period: float, digit: float) -> tuple[float, bool]:
        """(standard deviation of a stamp [s], whether it is but rounding to a last `digit` [s]).

        From successive residuals: their median, so that jumps do not count; rounding alone never
        moves one by more than a digit.
        """
        found, total, large = [], 0, 0
        for _, k, stamps in self.points(period):
            if k.size > 1:
                steps = np.abs(np.diff(stamps - period * k))
                total, large = total + steps.size, large + int((steps > _ROUNDED * digit).sum())
                found.append(np.median(steps, overwrite_input=True))
        noise = float(np.median(found)) * 1.4826 / np.sqrt(2.0) if found else 0.0
        return noise, large <= _JUMPING * total

    def jumps(
        self, period: float, noise: float, rounding: float | None = None
    ) -> tuple[list[Jump], list[tuple[int, int]]]:
        """(lasting jumps, [start, stop) of samples whose stamps left the clock and came back).

        Or left it so near an end of the log that nothing tells whether they come back.
        `rounding`: the last digit of the stamps [s] if nothing else moves them.
        """
        # the first stamp of a tick lies anywhere in a period, so that one lost sample does not show
        # where it was lost
        stray = 6.0 * noise * np.sqrt(2.0) if rounding is None else _ROUNDED * rounding
        threshold = max((1.6 if self.bunched else 0.6) * period, stray)
        window = _FEW if noise < 0.05 * period else _MANY
        size = self.spool.size
        whole = size, period, period * float(self.clock_index(size))
        found: list[Jump] = []
        passing: list[tuple[int, int]] = []
        at, residual, seen = np.zeros(0, np.int64), np.zeros(0), -1
        for index, k, stamps in chain(
            self.points(period), [(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))]
        ):
            at = np.concatenate([at, index])
            residual = np.concatenate([residual, stamps - period * k])
            keep = max(0, at.size - window - 1)
            for a, b in _clusters(residual, threshold, window):
                if at[a] <= seen:
                    continue
                if index.size and b + window > at.size and b - a < _CHUNK:
                    keep = min(keep, max(0, a - window))  # what follows decides whether it lasts
                    break
                jump, off = _judge(
                    at, residual, a, b, window, threshold, rounding is not None, whole
                )
                found += [jump] if jump else []
                passing += [off] if off[1] > off[0] else []
                seen = int(at[b])
            at, residual = at[keep:], residual[keep:]
        return _unpaired(found, passing, threshold)

    def fit(
        self, period: float, jumps: list[Jump], passing: list[tuple[int, int]]
    ) -> tuple[float, float, float, list[Piece]]:
        """(T, its standard error, scatter of the stamps about their lines, pieces).

        By least squares with one T; the scatter is a standard deviation. Sums are kept from each
        piece's first point on, so that no digits cancel in long logs.
        """
        edges = np.array([index for index, _ in jumps], np.int64)
        starts, stops = (np.array([span[end] for span in passing], np.int64) for end in (0, 1))
        first = np.full((2, edges.size + 1), np.nan)  # k and r of the first point of each piece
        sums = np.zeros((6, edges.size + 1))  # of 1, k, r, k k, k r, r r, by piece
        for index, k, stamps in self.points(period):
            if passing:
                begun, ended = (np.searchsorted(at, index, side="right") for at in (starts, stops))
                on = begun == ended
                index, k, stamps = index[on], k[on], stamps[on]
            cuts = np.searchsorted(index, edges).tolist()
            for piece, (begin, stop) in enumerate(pairwise([0, *cuts, index.size])):
                if begin == stop:
                    continue
                x = k[begin:stop].astype(float)
                y = stamps[begin:stop] - period * x
                if np.isnan(first[0, piece]):
                    first[:, piece] = x[0], y[0]
                x, y = x - first[0, piece], y - first[1, piece]
                # stamps beyond 1e150 make a clock that is not finite, and is not used
                with np.errstate(over="ignore", invalid="ignore"):
                    sums[:, piece] += x.size, x.sum(), y.sum(), x @ x, x @ y, y @ y
        count, by_k, by_r, by_kk, by_kr, by_rr = sums
        with np.errstate(over="ignore", invalid="ignore"):
            mean_k, mean_r = means = sums[1:3] / np.maximum(count, 1.0)
            total = float((by_kk - by_k * mean_k).sum())
            cross = float((by_kr - by_k * mean_r).sum())
            square = float((by_rr - by_r * mean_r).sum())
        slope = cross / total if total > 0 else 0.0
        free = max(count.sum() - count.size - 1, 1.0)
        spread = float(np.sqrt(max(square - slope * cross, 0.0) / free))
        middles = (np.nan_to_num(first) + means).T.tolist()
        pieces = [
            (begin, middle_k, middle_r + period * middle_k)
            for begin, (middle_k, middle_r) in zip([0, *edges.tolist()], middles, strict=True)
        ]
        return period + slope, spread / np.sqrt(total) if total > 0 else np.inf, spread, pieces

    def rising(self) -> tuple[FloatArray, int, float, list[int]]:
        """(stamps made to rise, number repaired, median step [s], samples behind pauses).

        The first sample behind each long pause. A stamp that is unknown, or not later than all
        before it, lies evenly between its neighbours; before the first and behind the last that is
        good at the usual step.
        """
        stamps = self.spool.read(0, self.spool.size)
        before = np.fmax.accumulate(np.concatenate([[-np.inf], stamps]))[:-1]
        at = np.flatnonzero(stamps > before)
        known = stamps[at]
        # over some samples, as stamps that tremble have short steps and few long ones
        lag = min(64, max(at.size // 2, 1))
        steps = (known[lag:] - known[:-lag]) / (at[lag:] - at[:-lag])
        step = float(np.median(steps)) if steps.size else 1.0
        first, last = int(at[0]), int(at[-1])
        times = np.interp(np.arange(stamps.size), at, known)
        times[:first] = known[0] - step * np.arange(first, 0, -1)
        times[last:] = known[-1] + step * np.arange(stamps.size - last)
        # a pause is named if samples without a clock leave out this many usual steps; twice as
        # many leave pauses of up to twenty steps unsaid
        far = np.flatnonzero(np.diff(times, prepend=times[0]) > 10.0 * step)
        return times, stamps.size - at.size, step, far.tolist()


def _tick(stamps: FloatArray) -> float:
    """The step [s] that stamps (n,) in a row are rounded to, 0 if none shows."""
    steps = np.diff(stamps)
    tick = float(steps.min(initial=np.inf, where=steps > 0.0))
    if steps.size < _FEW or not np.isfinite(steps.sum() + tick):
        return 0.0
    with np.errstate(over="ignore", invalid="ignore"):
        many = np.rint(steps / tick)
        k = np.arange(stamps.size) - 0.5 * (stamps.size - 1)
        strays = np.ptp(stamps - k * (k @ stamps) / (k @ k)) > _BOUND * tick
        whole = np.abs(steps / tick - many).max() < _WHOLE
    usual = float(np.median(many))
    alike = usual > 0.0 and np.count_nonzero(many == usual) > _ALIKE * steps.size
    return 0.0 if alike or strays or not whole else tick


def _clusters(residual: FloatArray, threshold: float, window: int) -> list[tuple[int, int]]:
    """(first, last) position of steps above the threshold that stand closer than a window."""
    steps = np.flatnonzero(np.abs(np.diff(residual)) > threshold) + 1
    if not steps.size:
        return []
    cuts = np.flatnonzero(np.diff(steps) > window)
    return list(
        zip(
            steps[np.concatenate([[0], cuts + 1])].tolist(),
            steps[np.concatenate([cuts, [steps.size - 1]])].tolist(),
        )
    )


def _midmean(values: FloatArray) -> float:
    """The mean of the middle half: of numbers that are rounded, the median leaps by a digit."""
    cut = values.size // 4
    return float(np.sort(values)[cut : values.size - cut].mean())


def _judge(
    at: IntArray,
    residual: FloatArray,
    a: int,
    b: int,
    window: int,
    threshold: float,
    rounded: bool,
    whole: tuple[int, float, float],
) -> tuple[Jump | None, tuple[int, int]]:
    """(the lasting jump of the steps at positions a to b, [start, stop) of samples off the clock).

    `whole`: the log's number of samples, its period and its length [s].

    No jump if the residual comes back.  A few stamps at an end of the log are wrong, and no jump,
    if they fall, or leave the clock by more than the log is long, or are but `rounded`.
    """
    before, after = residual[max(0, a - window) : a], residual[b : b + window]
    level = _midmean if rounded else np.median
    size = float(level(after) - level(before))
    between = int(at[a]), int(at[b])
    if abs(size) < 0.8 * threshold:
        return None, between
    samples, period_s, length_s = whole
    falls = size < -1.5 * period_s  # by less a row is repeated
    if min(before.size, after.size) < _FEW and (rounded or falls or size > length_s):
        return None, (0, between[1]) if before.size < after.size else (between[0], samples)
    steps = np.diff(residual[a - 1 : b + 1]) * np.sign(size)
    return (int(at[a + int(np.argmax(steps))]), size), between


def _unpaired(
    jumps: list[Jump], passing: list[tuple[int, int]], threshold: float
) -> tuple[list[Jump], list[tuple[int, int]]]:
    """(lasting jumps, stretches of late or early stamps).

    A rise that the next jump takes back is a stretch of late stamps (a fall that is taken back, of
    early ones).
    """
    kept: list[Jump] = []
    for jump in jumps:
        if kept and abs(kept[-1][1] + jump[1]) < threshold:
            passing.append((kept.pop()[0], jump[0]))
        else:
            kept.append(jump)
    return kept, sorted(passing)
