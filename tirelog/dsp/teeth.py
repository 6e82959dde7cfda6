"""From tooth passages to counted teeth.

What is missing, what is too many, where the count was lost.

    pieces of indices (n,)
        --intervals that no smooth motion explains are joined-->
        indices, half teeth of each interval
        --standstills, holes, turning points--> pieces of TEETH: counts (n,) in half teeth,
                                                stretches between losses of the count

A passage through the middle level is half a tooth; a rising one has an even count. Rising and
falling passages take turns, so an interval between neighbours is an odd number of half teeth. A
one-track encoder does not show direction: a turning point is inferred if the signal comes back
from less than its peak, and the stretch after it is counted downwards.

Pieces are cut while the wheel rolls forward evenly, so what is said of a passage does not depend on
where they are cut.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tirelog.dsp.encoder import (
    AROUND,
    CHUNK,
    changes,
    extremes,
    finite,
    places,
    sliding_maximum,
    without_spikes,
)
from tirelog.dsp.filters import runs, sliding_mean, sliding_median
from tirelog.vocabulary.arrays import FloatArray, IntArray, Records, records

# ---- From an encoder's samples to the times at which its teeth pass, block by block.
#
#     samples (size,) --probe------> what kind of signal it is, its amplitude and its noise (a few
#                                    short pieces of the log)
#                     --crossings--> sub-sample indices (n,) of the passages through the middle
#                     level,
#                                    rising and falling in turn, a piece for every block of samples
#
# A tooth passage is found by hysteresis around a tracked middle level and placed by a sine: the
# samples within a third of a half period have the sum, and the difference between the later and the
# earlier ones, that a sine through that place would have. That window has nearly the least variance
# (white noise: 4 % above the bound of the half period).
#
# Indices are fractional samples from the start of the channel. The result does not depend on the
# size
# of the blocks.


#: samples per block: small enough for the second-level cache
BLOCK = 1 << 17
#: changes of side on each side that the place of one depends on
BESIDE = 2 * AROUND + 2
#: the middle level and the amplitude follow the signal within this time; a slower tooth counts as
#: standstill; twice as long counts slower teeth, and follows a wandering level half as well
FOLLOW_S = 0.3
#: half of the hysteresis, as a share of the amplitude: a noise of 10 % never bridges it twice
HYSTERESIS = 0.4
#: a signal whose range is within so many standard deviations of its noise does not move; twice as
#: many call a weak signal standstill, half as many take noise for teeth
STILL_SIGMA = 6.0
#: amplitudes of a log's pieces, those with so many swings, closer together than this do not follow
#: the speed (a Hall sensor); nearer to one, a Hall sensor whose teeth differ counts as an
#: inductive one
STEADY_AMPLITUDE, LEAST_SWINGS = 0.6, 6
#: samples this near to the upper or the lower level, in half ranges, are on it; a signal with more
#: than this share of its samples there is square. Twice the distance takes a sine for one
ON_LEVEL, SQUARE_SHARE = 0.2, 0.7

Read = Callable[[int, int], FloatArray]
#: whole numbers of whatever size
Integers = NDArray[np.integer[Any]]


@dataclass(frozen=True)
class Probe:
    """What a few pieces of an encoder channel show.

    `form`: 'sine', 'square' (two levels), 'counter' (whole numbers that climb or fall, or an angle)
    or 'dead' (no teeth). `amplitude` is half of the range, `noise` the standard deviation of one
    sample, in the channel's unit. A swing below `least` is no tooth: noise at a standstill, or part
    of a period if the sensor's amplitude does not follow the speed. Levels are taken from a window
    of `follow_s`.
    """

    form: str
    amplitude: float
    noise: float
    least: float = 0.0
    follow_s: float = 0.3


class Crossings(NamedTuple):
    """Tooth passages of one block.

    `index` (n,) fractional sample, `rising` (n,) direction of the signal, `breaks` (m,) sample
    indices of holes in the signal, longer than a few samples, over which a tooth may have gone
    unseen.
    """

    index: FloatArray  # type: ignore[assignment]  # a tuple's own is not used
    rising: np.ndarray
    breaks: IntArray


def probe(read: Read, size: int, pieces: int = 24, length: int = 2048) -> Probe:
    """Form, amplitude and noise of a channel of `size` samples.

    From `pieces` short pieces of it, evenly spread.
    """
    starts = np.unique(np.linspace(0, max(size - length, 0), pieces).astype(np.int64))
    amplitudes, noises, squares, swings, steps = [], [], [], [], []
    ways: list[tuple[float, float]] = []
    lowest, highest = np.inf, -np.inf
    for start in starts:
        x = read(int(start), int(min(start + length, size)))
        x = x[np.isfinite(x)]
        if x.size < 16:
            continue
        low, high = float(x.min()), float(x.max())
        lowest, highest = min(low, lowest), max(high, highest)
        amplitudes.append((high - low) / 2)
        square = _level_share(x, low, high)
        squares.append(square)
        noises.append(_noise(x, square > SQUARE_SHARE))
        swings.append(_swings(x, low, high))
        if high > low:
            change = np.diff(x)
            ways.append((float(np.mean(change >= 0)), float(np.mean(change <= 0))))
            steps.append(float(np.median(np.abs(change[change != 0]))))
    if not amplitudes:
        return Probe("dead", 0.0, 0.0)
    amplitude, noise = float(np.quantile(amplitudes, 0.9)), float(np.quantile(noises, 0.2))
    # slow pulses also go one way within a piece, but never on from there
    # a count goes one way in more than this share of a piece's samples, and over more than so many
    # of its own steps in the log; twice as many do not know a counter that has just begun
    if (
        ways
        and float(np.median(ways, axis=0).max()) > 0.998
        and highest - lowest > 2.5 * float(np.median(steps))
    ):
        return Probe("counter", amplitude, noise)
    if (
        not np.isfinite(amplitude) or not amplitude > STILL_SIGMA * noise
    ):  # also numbers too large to be squared
        return Probe("dead", amplitude, noise)
    # a piece with several swings shows a whole one, however slowly the wheel turns
    turning = (np.array(swings) >= LEAST_SWINGS) & (np.array(amplitudes) > STILL_SIGMA * noise)
    moving = turning if turning.any() else np.array(amplitudes) > 0.3 * amplitude
    usual = float(np.quantile(np.array(amplitudes)[moving], 0.25))
    steady = float(np.min(np.array(amplitudes)[moving])) > STEADY_AMPLITUDE * amplitude
    least = max(STILL_SIGMA * noise, 0.7 * usual if steady else 0.01 * amplitude)
    form = "square" if np.median(np.array(squares)[moving]) > SQUARE_SHARE else "sine"
    # longer if the amplitude does not follow the speed, so that a wheel that begins to turn shows a
    # whole swing; twice as long follows half as well
    return Probe(form, amplitude, noise, least, 1.2 if steady else FOLLOW_S)


def _level_share(x: FloatArray, low: float, high: float) -> float:
    """Share of the samples (n,) that are on the levels `low` or `high`; 0 if these are equal."""
    half = 0.5 * (high - low)
    return float(np.mean(np.abs(x - low - half) > (1 - ON_LEVEL) * half)) if half > 0 else 0.0


def _noise(x: FloatArray, square: bool) -> float:
    """Standard deviation of one sample of `x` (n,), from its fourth differences.

    Of a `square` signal about its two levels: if pulses last a few samples the differences see
    edges only. All of it is noise if it changes at every other sample.
    """
    if not square:
        return float(np.median(np.abs(np.diff(x[: x.size // 2], 4))) / (0.6745 * np.sqrt(70.0)))
    low, high = float(x.min()), float(x.max())
    upper = x > 0.5 * (low + high)
    lasting = np.diff(np.flatnonzero(upper[1:] != upper[:-1]))
    # so many of a square's levels may last one sample only, as a share: pulses last for two and
    # more, a converter that flickers between two codes changes at every other one; half of it
    # refuses a wheel whose pulses last two samples and a half
    if lasting.size and float(np.mean(lasting == 1)) > 0.25:
        return 0.5 * (high - low)
    away = np.abs(x - np.where(upper, np.median(x[upper]), np.median(x[~upper])))
    return float(np.median(away) / 0.6745)


def _swings(x: FloatArray, low: float, high: float) -> int:
    """How often the signal goes from the upper to the lower quarter of its range and back."""
    side = np.sign(x - 0.5 * (high + low)) * (np.abs(x - 0.5 * (high + low)) > 0.25 * (high - low))
    side = side[side != 0]
    return int(np.sum(side[1:] != side[:-1]))


def crossings(
    read: Read, size: int, rate_Hz: float, found: Probe, block: int | None = None
) -> Iterator[Crossings]:
    """Tooth passages of a 'sine' or 'square' channel, block by block.

    Of `size` samples at `rate_Hz`.
    """
    # eight slow half periods, half of the time that the levels follow, and the chunks in which
    # spikes are sought
    margin = CHUNK * (int((0.6 + 0.5 * found.follow_s) * rate_Hz) // CHUNK + 8)
    block = max((block or BLOCK) // CHUNK, 1) * CHUNK
    slow = 0.5 * FOLLOW_S * rate_Hz
    at, last = -1, 0  # the last change: a wheel may stand longer than a block's margin
    for start in range(0, size, block):
        low, stop = max(start - margin, 0), min(start + block, size)
        x, holes = _filled(read(low, min(stop + margin, size)))
        before, after, rising = changes(
            x, *_hysteresis(x, rate_Hz, found), min(at - low, -1), last if at < low else 0
        )
        first, end = np.searchsorted(after, [start - low, stop - low])
        near = slice(max(first - BESIDE, 0), end + BESIDE)
        place = places(x, before[near], after[near], slow, found.form == "square")[
            first - near.start : end - near.start
        ]
        core = slice(first, end)
        if after[core].size:
            at, last = int(after[core][-1]) + low, 1 if rising[core][-1] else -1
        yield Crossings(
            place + low, rising[core], holes[(holes >= start - low) & (holes < stop - low)] + low
        )


def _filled(x: FloatArray) -> tuple[FloatArray, IntArray]:
    """`x` with lost samples bridged, and the first index of every longer hole.

    By straight lines; longer is more than eight samples.
    """
    x = finite(x)
    if np.isfinite(x.sum()):
        return x, np.zeros(0, np.int64)
    starts, stops = runs(~np.isfinite(x))
    known = np.flatnonzero(np.isfinite(x))
    if known.size == 0:
        return np.zeros_like(x), starts
    return np.interp(np.arange(x.size), known, x[known]), starts[stops - starts > 8]


def _hysteresis(x: FloatArray, rate_Hz: float, found: Probe) -> tuple[FloatArray, FloatArray]:
    """Levels above and below which a sample is sure of its side, for every chunk.

    Infinite if the signal does not move.
    """
    reach = int(np.ceil(0.5 * found.follow_s * rate_Hz / CHUNK))
    high, low = extremes(x)
    high, low = (
        sliding_maximum(without_spikes(high), reach),
        -sliding_maximum(without_spikes(-low), reach),
    )
    half, middle = (high - low) / 2, (high + low) / 2
    half = np.where(half > found.least, HYSTERESIS * half, np.inf)
    return middle + half, middle - half


#: a turning wheel shows less than this share of the peak between two passages of the same tooth
#: flank; nearer to one, a slow passage looks like turning back
TURNING_PEAK, PASSED_PEAK = 0.85, 0.95
#: intervals looked at at once: small enough for the cache
PIECE = 1 << 14
#: even passages on both sides of a cut; twice as many cost a little time
CONTEXT = 40
#: half teeth that take longer than this are looked at for a turning point
SLOW_S = 0.06
#: slow intervals within so many of each other are one place; a car does not roll backwards faster
#: than so many turns per second
SAME_PLACE, FASTEST_BACK_Hz = 12, 4.0
#: intervals on each side that say how long one should be; twice as many reach to where a speed
#: that changes is another
NEIGHBOURS = 3
#: an interval outside of these shares of its neighbours' median is not a single half tooth (pitch
#: errors of 0.5 degree stay inside)
SHORT, LONG = 0.65, 1.5


#: a counted tooth passage: fractional sample, ascending; position in half teeth, even if the signal
#: rises, which falls while the wheel rolls backwards; number of the stretch without a loss of the
#: count, between which any whole number of teeth may be missing; False if the wheel was inferred to
#: roll backwards; whether the interval after it is not even or not forwards; passages that were
#: filled in and left out before it
TEETH = np.dtype(
    [("index", "f8"), ("count", "i8"), ("stretch", "i8"), ("forward", "?"), ("uneven", "?"),
     ("missing", "i4"), ("extra", "i4")]
)  # fmt: skip


def count_teeth(
    read: Read, found: Probe, passages: Iterator[Crossings], rate_Hz: float, steps: int
) -> Iterator[Records]:
    """Teeth (n,) of TEETH from `passages` of an encoder of `steps` per turn, piece by piece.

    `read` gives the signal again, around standstills only.
    """
    held = Crossings(np.zeros(0), np.zeros(0, bool), np.zeros(0, np.int64))
    last, wanted = None, PIECE
    for new in passages:
        held = Crossings(*(np.concatenate([a, b]) for a, b in zip(held, new, strict=True)))
        if held.index.size < wanted:
            continue
        teeth, open_from = _count(read, found, held, rate_Hz, steps)
        cut = _last_cut(teeth["uneven"], open_from)
        wanted = 2 * held.index.size
        if cut > CONTEXT:
            teeth = _continued(teeth[:cut], last)
            yield teeth[0 if last is None else CONTEXT + 1 :]
            last, begin = teeth, teeth["index"][-1 - CONTEXT]
            near = held.index >= begin
            breaks = held.breaks[held.breaks >= begin]
            held = Crossings(held.index[near], held.rising[near], breaks)
            wanted = held.index.size + PIECE
    teeth = _continued(_count(read, found, held, rate_Hz, steps)[0], last)
    yield teeth[0 if last is None else CONTEXT + 1 :]


def _last_cut(uneven: np.ndarray, open_from: int) -> int:
    """How many passages of a piece can be settled; 0 if none.

    Up to the last one with CONTEXT even intervals on both sides.
    """
    bad = np.flatnonzero(uneven[:open_from])
    edges = np.concatenate([[-1], bad, [min(open_from, uneven.size)]])
    wide = np.flatnonzero(np.diff(edges) > 2 * CONTEXT + 2)
    return int(edges[wide[-1] + 1]) - CONTEXT if wide.size else 0


def _continued(teeth: Records, last: Records | None) -> Records:
    """The `teeth` (n,) of a piece, counted on from the piece before.

    They begin with the last CONTEXT + 1 passages of that.
    """
    if last is not None:
        for name in ("count", "stretch"):
            teeth[name] += last[name][-1 - CONTEXT] - teeth[name][0]
    return teeth


def _count(
    read: Read, found: Probe, passages: Crossings, rate_Hz: float, steps: int
) -> tuple[Records, int]:
    """(counted teeth of a piece of the log, passage from which the direction is not settled yet).

    Counts and stretches begin anywhere.
    """
    index, rising, halves, uneven, repairs = _regular(
        passages.index, passages.rising, SLOW_S * rate_Hz
    )
    n, intervals = index.size, np.diff(index)
    teeth = records(TEETH, index=index, forward=True, uneven=uneven)
    for place, missing, extra in repairs:
        teeth["missing"][place + 1], teeth["extra"][place + 1] = missing, extra
    if n < 2:
        return teeth, n
    if not uneven.any() and not passages.breaks.size and intervals.max() <= SLOW_S * rate_Hz:
        teeth["count"] = np.arange(n) + (not rising[0])
        return teeth, n
    still = intervals > 0.5 * FOLLOW_S * rate_Hz
    hole = np.zeros(n - 1, bool)
    if passages.breaks.size:
        broken = np.clip(np.searchsorted(index, passages.breaks) - 1, 0, n - 2)
        # half teeth shorter than this on both sides of a long interval: the wheel did not stand
        _bridge(halves, intervals, broken[still[broken]], 0.02 * rate_Hz)
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
    teeth["forward"] = np.append(sign > 0, True)
    teeth["stretch"][1:], teeth["count"][1:] = np.cumsum(lost), np.cumsum(halves * sign)
    # rolling forwards a rising passage is even, backwards a falling one
    heads = np.append(0, np.flatnonzero(lost) + 1)
    wrong = np.mod(teeth["count"][heads], 2) != (rising[heads] != teeth["forward"][heads])
    teeth["count"] += wrong[teeth["stretch"]]
    uneven[slow] = True
    uneven[:-1] |= lost | (sign < 0)
    teeth["uneven"] = uneven
    return teeth, min(unsettled, default=n)


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
) -> tuple[FloatArray, np.ndarray, Integers, np.ndarray, list[tuple[int, int, int]]]:
    """(indices, rising, half teeth of each interval, uneven intervals, repairs).

    Shapes (n,), (n,), (n - 1,), (n,); a repair is the passage before it, missing and extra teeth. A
    run of intervals that are too long or too short for the motion around it becomes one interval:
    of as many half teeth as its length has, odd or even as the passages in it were. If the
    intervals before and after a run disagree (near standstill), it stays.
    """
    steps = np.diff(index)
    halves, uneven = np.ones(steps.size, np.int64), np.zeros(index.size, bool)
    if steps.size >= 4 * NEIGHBOURS and _all_regular(steps):
        return index, rising, halves, uneven, []
    if steps.size < 4 * NEIGHBOURS:
        return index, rising, halves, ~uneven, []
    ratio = steps / sliding_median(steps, 9)
    odd = ratio < SHORT
    odd[1:] |= ratio[:-1] < SHORT  # the tooth beside a glitch lost what the glitch took
    odd[:-1] |= ratio[1:] < SHORT
    odd |= ratio > LONG
    uneven[:-1] = odd
    odd &= steps < slowest
    keep, repairs = np.ones(index.size, bool), []
    for start, stop in zip(*runs(odd), strict=True):
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
    told = [(int(place[start]), missing, extra) for start, missing, extra in repairs]
    return index[keep], rising[keep], halves[keep[:-1]], uneven[keep], told


def _all_regular(steps: FloatArray) -> bool:
    """Whether no interval of `steps` (n,) [samples] differs much from those five before and after.

    At the ends: one of them. Then no closer look is needed.
    """
    before, after = np.append(steps[5:10], steps[:-5]), np.append(steps[5:], steps[-10:-5])
    usual = 0.5 * (before + after)
    return bool(np.all((SHORT * usual < steps) & (steps < LONG * usual)))


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
