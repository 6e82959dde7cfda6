"""From tooth passages to counted teeth.

What is missing, what is too many, where the count was lost.

    pieces of indices (n,)
        --intervals that no smooth motion explains are joined-->
        indices, half teeth of each interval
        --standstills, holes, turning points--> pieces of Teeth: counts (n,) in half teeth,
                                                stretches between losses of the count

A passage through the middle level is half a tooth; a rising one has an even count. Rising and
falling passages take turns, so an interval between neighbours is an odd number of half teeth. A
one-track encoder does not show direction: a turning point is inferred if the signal comes back
from less than its peak, and the stretch after it is counted downwards.

Pieces are cut while the wheel rolls forward evenly, so what is said of a passage does not depend on
where they are cut.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tirelog.dsp.encoder.signal import FOLLOW_S, Crossings, Integers, Probe, Read
from tirelog.dsp.sliding import sliding_mean, sliding_median
from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray

#: a turning wheel shows less than this share of the peak between two passages of the same tooth
#: flank; nearer to one, a slow passage looks like turning back
TURNING_PEAK, PASSED_PEAK = 0.85, 0.95
#: intervals looked at at once: small enough for the cache
PIECE = 1 << 14
#: even passages on both sides of a cut; twice as many cost a little time
CONTEXT = 40
#: half teeth that take longer than this are looked at for a turning point
SLOW_S = 0.06
#: half teeth shorter than this on both sides of a long interval: the wheel did not stand
ROLLING_S = 0.02
#: slow intervals within so many of each other are one place; a car does not roll backwards faster
#: than so many turns per second
SAME_PLACE, FASTEST_BACK_Hz = 12, 4.0
#: intervals on each side that say how long one should be; twice as many reach to where a speed
#: that changes is another
NEIGHBOURS = 3
#: an interval outside of these shares of its neighbours' median is not a single half tooth (pitch
#: errors of 0.5 degree stay inside)
SHORT, LONG = 0.65, 1.5


@dataclass(frozen=True)
class Teeth:
    """Counted tooth passages of one piece of the log.

    index    (n,) fractional sample of the passage, ascending
    count    (n,) position in half teeth, even if the signal rises; falls while the wheel rolls
             backwards
    stretch  (n,) number of the stretch without a loss of the count; between stretches any whole
             number of teeth may be missing
    forward  (n,) False if the wheel was inferred to roll backwards
    missing, extra  passages that were filled in and left out
    """

    index: FloatArray
    count: Integers
    stretch: Integers
    forward: np.ndarray
    missing: int
    extra: int


@dataclass(frozen=True)
class _Piece:
    """Teeth whose counts and stretches begin anywhere.

    `uneven` (n,): the interval after a passage is not even or not forwards; `repairs` (m, 3)
    passage, missing and extra teeth; `open_from` the passage from which the direction is not
    settled yet.
    """

    teeth: Teeth
    uneven: np.ndarray
    repairs: Integers
    open_from: int


def count_teeth(
    read: Read, found: Probe, passages: Iterator[Crossings], rate_Hz: float, steps: int
) -> Iterator[Teeth]:
    """Teeth from the `passages` of an encoder of `steps` teeth per turn, piece by piece.

    `read` gives the signal again, around standstills only.
    """
    held, last, wanted = (
        Crossings(np.zeros(0), np.zeros(0, bool), np.zeros(0, np.int64)),
        None,
        PIECE,
    )
    for new in passages:
        held = Crossings(
            *(np.concatenate([a, b]) for a, b in zip(held.parts, new.parts, strict=True))
        )
        if held.index.size < wanted:
            continue
        piece = _count(read, found, held, rate_Hz, steps)
        cut = _last_cut(piece)
        wanted = 2 * held.size
        if cut > CONTEXT:
            teeth = _continued(piece, cut, last)
            yield _without_context(teeth, last)
            last, held = teeth, held.since(float(teeth.index[-1 - CONTEXT]))
            wanted = held.size + PIECE
    piece = _count(read, found, held, rate_Hz, steps)
    yield _without_context(_continued(piece, piece.teeth.index.size, last), last)


def _last_cut(piece: _Piece) -> int:
    """How many passages of the piece can be settled; 0 if none.

    Up to the last one with CONTEXT even intervals on both sides.
    """
    bad = np.flatnonzero(piece.uneven[: piece.open_from])
    edges = np.concatenate([[-1], bad, [min(piece.open_from, piece.uneven.size)]])
    wide = np.flatnonzero(np.diff(edges) > 2 * CONTEXT + 2)
    return int(edges[wide[-1] + 1]) - CONTEXT if wide.size else 0


def _continued(piece: _Piece, cut: int, last: Teeth | None) -> Teeth:
    """The first `cut` passages, counted on from the piece before.

    They begin with the last CONTEXT + 1 passages of that.
    """
    teeth, begins = piece.teeth, 0 if last is None else CONTEXT
    count, stretch = teeth.count[:cut], teeth.stretch[:cut]
    if last is not None:
        count = count + (last.count[-1 - CONTEXT] - count[0])
        stretch = stretch + (last.stretch[-1 - CONTEXT] - stretch[0])
    repairs = piece.repairs[(piece.repairs[:, 0] >= begins) & (piece.repairs[:, 0] < cut)]
    missing, extra = int(repairs[:, 1].sum()), int(repairs[:, 2].sum())
    return Teeth(teeth.index[:cut], count, stretch, teeth.forward[:cut], missing, extra)


def _without_context(teeth: Teeth, last: Teeth | None) -> Teeth:
    new = slice(None if last is None else CONTEXT + 1, None)
    return Teeth(
        teeth.index[new],
        teeth.count[new],
        teeth.stretch[new],
        teeth.forward[new],
        teeth.missing,
        teeth.extra,
    )


def _count(read: Read, found: Probe, passages: Crossings, rate_Hz: float, steps: int) -> _Piece:
    """Counted teeth of a piece of the log."""
    index, rising, halves, uneven, repairs = _regular(
        passages.index, passages.rising, SLOW_S * rate_Hz
    )
    n = index.size
    if n < 2:
        none = np.zeros(n, np.int64)
        return _Piece(
            Teeth(index, none, none, np.ones(n, bool), 0, 0), np.ones(n, bool), repairs, n
        )
    intervals = np.diff(index)
    if not uneven.any() and not passages.breaks.size and intervals.max() <= SLOW_S * rate_Hz:
        even = np.arange(n) + (not rising[0])
        return _Piece(
            Teeth(index, even, np.zeros(n, np.int64), np.ones(n, bool), 0, 0), uneven, repairs, n
        )
    still = intervals > 0.5 * FOLLOW_S * rate_Hz
    hole = np.zeros(n - 1, bool)
    if passages.breaks.size:
        broken = np.clip(np.searchsorted(index, passages.breaks) - 1, 0, n - 2)
        _bridge(halves, intervals, broken[still[broken]], ROLLING_S * rate_Hz)
        hole[broken[halves[broken] != 1]] = True
        uneven[broken] = True
    fastest = FASTEST_BACK_Hz / rate_Hz * 2 * steps
    slow = np.flatnonzero(intervals > SLOW_S * rate_Hz)
    turned = _turning_points(read, found, index, slow)
    sign, turns = _directions(index, slow, turned, fastest)
    unsettled = [
        at
        for at in turned
        if not (slow > at + SAME_PLACE).any()
        and intervals[at + 1 :].min(initial=np.inf) >= 1 / fastest
    ]
    lost = still | hole | (halves > 2 * steps)
    lost[turns] = True
    stretch = np.zeros(n, np.int64)
    np.cumsum(lost, out=stretch[1:])
    forward = np.concatenate([sign > 0, [True]])
    count = np.zeros(n, np.int64)
    np.cumsum(halves * sign, out=count[1:])
    # rolling forwards a rising passage is even, backwards a falling one
    heads = np.concatenate([[0], np.flatnonzero(lost) + 1])
    wrong = np.mod(count[heads], 2) != (rising[heads] != forward[heads])
    count += wrong[stretch]
    uneven[slow] = True
    uneven[:-1] |= lost | (sign < 0)
    return _Piece(
        Teeth(index, count, stretch, forward, 0, 0), uneven, repairs, min(unsettled, default=n)
    )


def _bridge(halves: Integers, intervals: FloatArray, still: Integers, rolling: float) -> None:
    """Fills in half teeth of long intervals over holes in the signal.

    The holes begin and end in full motion: the mean of both speeds says how many, near enough that
    no turn is lost.
    """
    for at in still.tolist():
        before, after = (
            intervals[max(at - NEIGHBOURS, 0) : at],
            intervals[at + 1 : at + 1 + NEIGHBOURS],
        )
        if before.size and after.size and max(np.median(before), np.median(after)) < rolling:
            length = intervals[at] * 0.5 * (1 / np.median(before) + 1 / np.median(after))
            halves[at] = min(2 * round((length - 1) / 2) + 1, np.iinfo(halves.dtype).max)


def _directions(
    index: FloatArray, slow: Integers, turned: list[int], fastest: float
) -> tuple[Integers, Integers]:
    """(sign of each interval, intervals at which the direction changes).

    A turning point starts a stretch backwards, and the next slow place ends it, seen as a turning
    point or not: a missed one must not turn the rest of the log around. A stretch that is faster
    than `fastest` half teeth per sample, or lasts to the end, was none.
    """
    sign, changes, done = np.ones(index.size - 1, np.int8), [], -1
    for at in turned:
        later = slow[slow > at + SAME_PLACE]
        if at <= done or later.size == 0:
            continue
        inside = [t for t in turned if at + SAME_PLACE < t <= later[0] + 2 * SAME_PLACE]
        end = inside[0] if inside else int(later[0])
        done = end + SAME_PLACE
        if np.diff(index[at + 1 : end + 1]).min(initial=np.inf) < 1 / fastest:
            continue
        sign[at + 1 : end + 1] = -1
        changes += [at, end]
    return sign, np.array(changes, np.int64)


def _regular(
    index: FloatArray, rising: np.ndarray, slowest: float
) -> tuple[FloatArray, np.ndarray, Integers, np.ndarray, Integers]:
    """(indices, rising, half teeth of each interval, uneven intervals, repairs).

    Shapes (n,), (n,), (n - 1,), (n,), (m, 3). A run of intervals that are too long or too short for
    the motion around it becomes one interval: of as many half teeth as its length says, odd or even
    as the passages in it were. If the intervals before and after a run disagree (near standstill),
    it stays.
    """
    steps = np.diff(index)
    halves, uneven, none = (
        np.ones(steps.size, np.int64),
        np.zeros(index.size, bool),
        np.zeros((0, 3), np.int64),
    )
    if steps.size >= 4 * NEIGHBOURS and _all_regular(steps):
        return index, rising, halves, uneven, none
    if steps.size < 4 * NEIGHBOURS:
        return index, rising, halves, ~uneven, none
    ratio = steps / sliding_median(steps, 9)
    odd = ratio < SHORT
    odd[1:] |= ratio[:-1] < SHORT  # the tooth beside a glitch lost what the glitch took
    odd[:-1] |= ratio[1:] < SHORT
    odd |= ratio > LONG
    uneven[:-1] = odd
    odd &= steps < slowest
    edges = np.flatnonzero(np.diff(np.concatenate([[0], odd.view(np.int8), [0]])))
    keep, repairs = np.ones(index.size, bool), []
    for start, stop in zip(edges[::2], edges[1::2], strict=True):
        before, after = steps[max(start - NEIGHBOURS, 0) : start], steps[stop : stop + NEIGHBOURS]
        if before.size == 0 or after.size == 0 or index[stop] - index[start] > 2 * slowest:
            continue
        left, right = float(np.median(before)), float(np.median(after))
        if max(left, right) > 1.6 * min(left, right):
            continue
        n, length = stop - start, float(index[stop] - index[start]) / (0.5 * (left + right))
        whole = max(n + 2 * round((length - n) / 2), 2 - n % 2)
        keep[start + 1 : stop] = False
        halves[start] = whole
        repairs.append((start, max(whole - n, 0) // 2, max(n - whole, 0) // 2))
    place = np.cumsum(keep) - 1
    told = np.array(
        [(place[start], missing, extra) for start, missing, extra in repairs], np.int64
    ).reshape(-1, 3)
    return index[keep], rising[keep], halves[keep[:-1]], uneven[keep], told


@compiled
def _all_regular(steps: FloatArray) -> bool:
    """Whether no interval of `steps` (n,) [samples] differs much from those five before and after.

    At the ends: one of them. Then no closer look is needed.
    """
    n = steps.size
    for i in range(n):
        usual = 0.5 * (steps[i - 5 if i >= 5 else i + 5] + steps[i + 5 if i + 5 < n else i - 5])
        if not SHORT * usual < steps[i] < LONG * usual:
            return False
    return True


def _turning_points(read: Read, found: Probe, index: FloatArray, slow: Integers) -> list[int]:
    """The intervals of `slow` in which the signal turned.

    It came back before its peak, or passed it, came back and passed it again. A turn within a sixth
    of a half tooth of the peak is not seen. Nothing is inferred if the amplitude falls with speed
    (an inductive sensor): there the peak says nothing.
    """
    turned = []
    for at in slow:
        before, after = int(index[max(at - 2, 0)]), int(index[min(at + 3, index.size - 1)]) + 1
        x = read(before, min(after, before + (1 << 20)))
        edges = (np.array([index[at], index[at + 1]]) - before).astype(np.int64)
        if edges[1] + 3 > x.size or edges[0] < 2 or np.isnan(x).any():
            continue
        size = max(int(edges[1] - edges[0]) // 20, 1)
        away = np.abs(sliding_mean(x, size) - 0.5 * float(x.max() + x.min()))
        inner, around = (
            away[edges[0] : edges[1]],
            np.concatenate([away[: edges[0]], away[edges[1] :]]),
        )
        peak = float(around.max())
        if peak < 0.7 * found.amplitude:
            continue
        passed = np.flatnonzero(inner > PASSED_PEAK * peak)
        if inner.max() < TURNING_PEAK * peak or (
            passed.size and inner[passed[0] : passed[-1] + 1].min() < TURNING_PEAK * peak
        ):
            turned.append(int(at))
    return turned
