"""From an encoder's samples to counted teeth, pieces (n,) of one table, TEETH.

    samples --probe--> its form: sine, square, counter or dead
    sine, square --crossings--> places of the passages, rising and falling in turn
        --intervals that no smooth motion explains are joined--> half teeth of each interval
        --standstills, holes, turning points--> counts in half teeth, stretches between losses of
                                                the count
    counter --its changes, unwrapped--> times and counts

A passage through the middle level is half a tooth; a rising one has an even count. Rising and
falling passages take turns, so an interval between neighbours is an odd number of half teeth. A
one-track encoder does not show direction: a turning point is inferred if the signal comes back
from less than its peak, and the stretch after it is counted downwards.

Pieces are cut while the wheel rolls forward evenly, so the result for a passage does not depend
on where they are cut.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from tirelog.data.recording import Channel
from tirelog.dsp.filters import runs, sliding_mean
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Records, records

#: whole numbers of whatever size
Integers = NDArray[np.integer[Any]]

# ---- The tooth finder: what is done once per sample, and once per tooth.
#
#     samples (size,)
#         --extremes of chunks, sliding--> upper, lower (chunks,): the sides of the hysteresis
#         --hysteresis--> changes of side
#         --sums over windows--> sub-sample places (n,)
#
# Samples are finite.  Thresholds hold for a chunk of CHUNK samples.

#: samples whose extremes are taken together
CHUNK = 64
#: half width of the window, in half periods (the least variance of a sum's zero is at tan m = 2 m,
#: m = 1.17 rad)
WINDOW = 0.35
#: periods on each side whose mean is the middle level; twice as many follow a level that drifts
#: half as quickly
AROUND = 2


def without_spikes(high: FloatArray) -> FloatArray:
    """Maxima of chunks without those of glitches.

    None is above all of the chunks two and three places away: a glitch lies in one chunk or two,
    not so a tooth.
    """
    around = np.pad(high, 3, mode="edge")
    far = np.max([around[:-6], around[1:-5], around[5:-1], around[6:]], axis=0)
    return np.asarray(np.minimum(high, far), np.float64)


def sliding_maximum(values: FloatArray, reach: int) -> FloatArray:
    """Largest value within `reach` places on both sides, shape as given."""
    padded = np.pad(values, reach, constant_values=-np.inf)
    return np.asarray(sliding_window_view(padded, 2 * reach + 1).max(axis=1))


def changes(
    x: FloatArray, upper: FloatArray, lower: FloatArray, at: int, last: int
) -> tuple[IntArray, IntArray, BoolArray]:
    """Every change of side of the samples: last on the old side, first on the new one, rising.

    Shape (n,) each. A sample is on a side if it is above its chunk's `upper` or below its `lower`.
    `last` is the side before the first sample (1 or -1, 0 if it is not known), `at` (negative)
    when it was taken.
    """
    high, low = (np.repeat(level, CHUNK)[: x.size] for level in (upper, lower))
    side = (x > high).astype(np.int8) - (x < low)
    sure = np.flatnonzero(side)
    place, side = np.append(at, sure), np.append(last, side[sure])
    turned = np.flatnonzero(side[1:] * side[:-1] < 0)
    return place[turned], place[turned + 1], side[turned + 1] > 0


def places(
    x: FloatArray, before: IntArray, after: IntArray, slow: float, square: bool
) -> FloatArray:
    """Fractional index in `x` of each change of side, shape (n,).

    The change lies between the samples `before` and `after`. Half a sample ahead of `after` if the
    change took `slow` samples or longer; half way if the signal is square or there are too few
    changes; else the zero of a sine. The samples of this sine have the same sum, and the same
    difference between the k after the middle one and the k before it. For A sin(omega (i - t)) the
    sum over its factor is A sin, the difference over its factor A cos of omega (centre - t); the
    quotient of the factors is 2 / (cot(k omega / 2) + cot((k + 1) omega / 2)).
    """
    quick = (before >= 0) & (after - before < slow)
    coarse = np.where(quick, 0.5 * (before + after), after - 0.5)
    if square or coarse.size <= 2 * AROUND:
        return coarse
    total = np.concatenate([[0.0], np.cumsum(x)])
    level = _middles(x, total, coarse, before, after, slow)
    low, high = x[np.maximum(before, 0)], x[after]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.clip((level - low) / (high - low), 0.0, 1.0)
    place = np.where(quick & (high != low), before + share * (after - before), coarse)
    step = np.diff(place)
    sides = np.stack([np.append(step[0], step), np.append(step, step[-1])])
    least, most = sides.min(axis=0), sides.max(axis=0)
    half = np.where(most <= 1.8 * least, 0.5 * (least + most), least)
    centre = (place + 0.5).astype(np.int64)
    reach = np.maximum((WINDOW * half).astype(np.int64), 1)
    inside = (centre >= reach) & (centre < x.size - reach)
    row = np.flatnonzero(quick & (half > 2.0) & (half < slow) & inside)
    centre, k, omega = centre[row], reach[row], np.pi / half[row]
    earlier, later = total[centre] - total[centre - k], total[centre + k + 1] - total[centre + 1]
    area = earlier + later + x[centre] - (2 * k + 1) * level[row]
    near, far = np.tan(0.5 * k * omega), np.tan(0.5 * (k + 1) * omega)
    with np.errstate(divide="ignore", invalid="ignore"):
        tangent = area / (later - earlier) * (2 * near * far / (near + far))
    shift = np.arctan(tangent) / omega
    place[row] = np.where(np.abs(shift) < 0.5 * np.pi / omega, centre - shift, place[row])
    return place


def _middles(
    x: FloatArray,
    total: FloatArray,
    coarse: FloatArray,
    before: IntArray,
    after: IntArray,
    slow: float,
) -> FloatArray:
    """Middle level at each crossing (n,), in the unit of `x` (size,).

    `total` (size + 1,) sums of the first samples. The mean over the whole periods within AROUND on
    both sides, from crossing to crossing; half way between the samples `before` and `after` if they
    are slow.
    """
    place = coarse + 0.5
    whole = np.clip(place.astype(np.int64), 0, x.size - 1)
    below = total[whole] + (place - whole) * x[whole]
    number = np.arange(coarse.size)
    first = np.maximum(number - 2 * AROUND, 0)
    last = np.minimum(number + 2 * AROUND, coarse.size - 1)
    last -= (last - first) % 2
    span = coarse[last] - coarse[first]
    periods = (span > 0) & (span < 8 * slow)
    mean = (below[last] - below[first]) / np.where(periods, span, 1.0)
    return np.where(periods, mean, 0.5 * (x[np.maximum(before, 0)] + x[after]))


def finite(x: Any) -> FloatArray:
    """`x` as the kernels take it: float64, contiguous, writable (a copy if it is not)."""
    return np.require(x, np.float64, ["C", "W"])


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
#: a signal whose range is within so many standard deviations of its noise does not move; twice as
#: many call a weak signal standstill, half as many take noise for teeth
STILL_SIGMA = 6.0
#: a signal with more than this share of its samples near one of its two levels is square
SQUARE_SHARE = 0.7


@dataclass(frozen=True)
class Probe:
    """What a few pieces of an encoder channel show.

    `form`: 'sine', 'square' (two levels), 'counter' (whole numbers that climb or fall, or an angle)
    or 'dead' (no teeth). `amplitude` is half of the range, `noise` the standard deviation of one
    sample, in the channel's unit. A swing below `least` is no tooth: noise at a standstill, or part
    of a period if the sensor's amplitude does not follow the speed. Levels are taken from a window
    of `follow_s`. `duty` is the share of a square's samples on the upper level, `middle` the level
    between both.
    """

    form: str
    amplitude: float
    noise: float
    least: float = 0.0
    follow_s: float = 0.3
    duty: float = 0.5
    middle: float = 0.0

    @property
    def pulsed(self) -> bool:
        """True for pulses that are much shorter, or longer, than the gaps between them."""
        # share of a square's samples on one level below which edges of one kind are counted: then a
        # median of half teeth, one short and one long, is either; at 0.3 both ways see the same
        # teeth
        return not 0.25 <= self.duty <= 0.75


#: a tooth passage: fractional sample, ascending, and its time; whether the signal rises; whether a
#: hole of more than a few samples lies before it, over which a tooth may have gone unseen.  By
#: `count_teeth`: position in half teeth, even if the signal rises, which falls while the wheel
#: rolls backwards; number of the stretch without a loss of the count, from 0, between which any
#: whole number of teeth may be missing; False if the wheel was inferred to roll backwards; half
#: teeth to the passage after it, and whether that interval is not even or not forwards; passages
#: that were filled in and left out before it
TEETH = np.dtype(
    [("index", "f8"), ("time_s", "f8"), ("rising", "?"), ("hole", "?"), ("count", "i8"),
     ("stretch", "i8"), ("forward", "?"), ("halves", "i8"), ("uneven", "?"), ("missing", "i4"),
     ("extra", "i4")]
)  # fmt: skip


def probe(channel: Channel, pieces: int = 24, length: int = 2048) -> Probe:
    """Form, amplitude and noise of a channel, from `pieces` short pieces of it, evenly spread."""
    starts = np.linspace(0, max(channel.size - length, 0), pieces).astype(np.int64)
    read = [channel.read(int(start), int(start) + length) for start in np.unique(starts)]
    rows = [_piece(x[np.isfinite(x)]) for x in read if np.isfinite(x).sum() >= 16]
    if not rows:
        return Probe("dead", 0.0, 0.0)
    low, high, noises, on_level, swings, up, down, steps, upper = np.array(rows).T
    amplitudes, moves = (high - low) / 2, high > low
    amplitude, noise = float(np.quantile(amplitudes, 0.9)), float(np.quantile(noises, 0.2))
    # slow pulses also go one way within a piece, but never on from there
    # a count goes one way in more than this share of a piece's samples, and over more than so many
    # of its own steps in the log; twice as many do not know a counter that has just begun
    if (
        moves.any()
        and max(np.median(up[moves]), np.median(down[moves])) > 0.998
        and high.max() - low.min() > 2.5 * float(np.median(steps[moves]))
    ):
        return Probe("counter", amplitude, noise)
    if (
        not np.isfinite(amplitude) or not amplitude > STILL_SIGMA * noise
    ):  # also numbers too large to be squared
        return Probe("dead", amplitude, noise)
    # a piece with several swings shows a whole one, however slowly the wheel turns
    turning = (swings >= 6) & (amplitudes > STILL_SIGMA * noise)
    moving = turning if turning.any() else amplitudes > 0.3 * amplitude
    usual = float(np.quantile(amplitudes[moving], 0.25))
    # amplitudes of pieces closer together than this do not follow the speed (a Hall sensor); nearer
    # to one, a Hall sensor whose teeth differ counts as an inductive one
    steady = float(np.min(amplitudes[moving])) > 0.6 * amplitude
    least = max(STILL_SIGMA * noise, 0.7 * usual if steady else 0.01 * amplitude)
    form = "square" if np.median(on_level[moving]) > SQUARE_SHARE else "sine"
    # longer if the amplitude does not follow the speed, so that a wheel that begins to turn shows a
    # whole swing; twice as long follows half as well
    follow_s, duty = 1.2 if steady else FOLLOW_S, 0.5
    if form == "square" and steady:
        duty = float(np.mean(upper[moving]))
    middle = float(np.median(0.5 * (low + high)[moving]))
    return Probe(form, amplitude, noise, least, follow_s, duty, middle)


def _piece(x: FloatArray) -> tuple[float, ...]:
    """What finite samples (n,) of a piece show, as numbers.

    Items in order:

    least and largest; noise; share on the two levels;
    how often the signal goes from the upper to the lower quarter of its range and back;
    shares of the steps that do not fall and do not rise; median size of the steps that are not 0;
    share of the samples above the middle.
    """
    low, high, step = float(x.min()), float(x.max()), np.diff(x)
    away, half = x - 0.5 * (low + high), 0.5 * (high - low)
    # samples this near to the upper or the lower level, in half ranges, are on it; twice the
    # distance takes a sine for a square
    on_level = float(np.mean(np.abs(away) > (1 - 0.2) * half))
    side = away[np.abs(away) > 0.5 * half] > 0
    moved = np.abs(step[step != 0])
    return (
        low,
        high,
        _noise(x, on_level > SQUARE_SHARE),
        on_level,
        float(np.sum(side[1:] != side[:-1])),
        float(np.mean(step >= 0)),
        float(np.mean(step <= 0)),
        float(np.median(moved)) if moved.size else 0.0,
        float(np.mean(away > 0.0)),
    )


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


def crossings(channel: Channel, found: Probe) -> Iterator[Records]:
    """Tooth passages of a 'sine' or 'square' channel, block by block, (n,) of TEETH.

    Of short pulses, or short gaps, the edges at which they begin, and the places half way between.
    """
    pieces = _every_crossing(channel, found)
    return _of_one_kind(pieces, rising=found.duty < 0.5) if found.pulsed else pieces


def _of_one_kind(pieces: Iterator[Records], *, rising: bool) -> Iterator[Records]:
    """The edges that rise, or those that fall, as rising ones, and a falling one before each."""
    last = np.zeros(0, TEETH)
    for piece in pieces:
        edges = np.concatenate([last, piece[piece["rising"] == rising]])
        edges["rising"] = True
        between = edges[1:].copy()
        between["index"] = 0.5 * (edges["index"][:-1] + edges["index"][1:])
        between["rising"] = False
        first = edges[: edges.size - between.size - last.size]  # of the log alone
        last = edges[-1:]
        yield np.concatenate([first, np.stack([between, edges[1:]], axis=1).ravel()])


def _every_crossing(channel: Channel, found: Probe) -> Iterator[Records]:
    """All passages through the middle, block by block, (n,) of TEETH."""
    rate_Hz, size = channel.axis.rate_Hz, channel.size
    # eight slow half periods, half of the time that the levels follow, and the chunks in which
    # spikes are sought
    margin = CHUNK * (int((0.6 + 0.5 * found.follow_s) * rate_Hz) // CHUNK + 8)
    block = BLOCK // CHUNK * CHUNK
    slow = 0.5 * FOLLOW_S * rate_Hz
    at, last = -1, 0  # the last change: a wheel may stand longer than a block's margin
    pending = np.zeros(0, np.int64)  # holes after the last passage
    for start in range(0, size, block):
        low, stop = max(start - margin, 0), min(start + block, size)
        x, holes = _filled(channel.read(low, min(stop + margin, size)))
        before, after, rising = changes(
            x, *_hysteresis(x, rate_Hz, found), min(at - low, -1), last if at < low else 0
        )
        first, end = np.searchsorted(after, [start - low, stop - low])
        near = slice(max(first - BESIDE, 0), end + BESIDE)
        place = places(x, before[near], after[near], slow, found.form == "square")[
            first - near.start : end - near.start
        ]
        if end > first:
            at, last = int(after[end - 1]) + low, 1 if rising[end - 1] else -1
        teeth = records(TEETH, index=place + low, rising=rising[first:end])
        holes = holes[(holes >= start - low) & (holes < stop - low)]
        behind = np.concatenate([pending, np.searchsorted(place, holes)])
        teeth["hole"][behind[behind < place.size]] = True
        pending = 0 * behind[behind >= place.size]
        yield teeth


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
    starts = np.arange(0, x.size, CHUNK)
    high, below = (
        sliding_maximum(without_spikes(np.maximum.reduceat(one, starts)), reach) for one in (x, -x)
    )
    low = -below
    half, middle = (high - low) / 2, (high + low) / 2
    if found.pulsed:  # a pulse may be as short as a spike is
        half, middle = np.full(half.size, found.amplitude), np.full(half.size, found.middle)
    # half of the hysteresis, as a share of the amplitude: a noise of 10 % never bridges it twice
    half = np.where(half > found.least, 0.4 * half, np.inf)
    return middle + half, middle - half


# ---- Counters and angle channels.
#
# The wheel angle is already there, and only its steps must become passages in time.
#
# samples (size,) of counts or angles --changes, unwrapped--> times (n,) [s] and turns (n,) [1]


def turns_of_counts(
    channel: Channel, size: float, is_angle: bool = False
) -> tuple[FloatArray, FloatArray]:
    """(times [s], turns), (n,) each, of a channel that counts `size` per turn.

    A counter that jumps from c to d between two samples has passed (c + d + 1) / 2 in their middle.
    A counter that jumps by more than half of the next power of two has wrapped; one that has been
    below zero has a sign, and twice as many numbers. An angle wraps at a turn.
    """
    times, counts = [np.zeros(0)], [np.zeros(0)]
    wrap, offset, last = size if is_angle else 0.0, 0.0, np.nan
    # times per second that an angle channel keeps; twice as many follow twice as quick a shake in
    # twice the memory
    every = max(int(channel.axis.rate_Hz / 500.0), 1)
    for start, block in channel.blocks():
        known = np.flatnonzero(np.isfinite(block))
        x, index = block[known], (start + known).astype(np.float64)
        if x.size == 0:
            continue
        if not is_angle:
            low, high = float(x.min()), float(x.max())
            bits = max(np.ceil(np.log2(max(high + 1.0, -low, 2.0))), 7 if low < 0 else 8)
            wrap = max(wrap, 2.0 ** (bits + (low < 0)))
        step = np.diff(x, prepend=last if np.isfinite(last) else x[0])
        turned = np.where(step < -wrap / 2, wrap, 0.0) - np.where(step > wrap / 2, wrap, 0.0)
        step, unwrapped = step + turned, x + offset + np.cumsum(turned)
        offset, last = float(unwrapped[-1] - x[-1]), float(x[-1])
        if is_angle:
            pick = np.arange((-start) % every, x.size, every)
            times.append(channel.axis.at(index[pick]))
            counts.append(unwrapped[pick])
        else:
            change = np.flatnonzero(step)
            times.append(channel.axis.at(index[change] - 0.5))
            counts.append((unwrapped - 0.5 * step + 0.5)[change])
    turns = np.concatenate(counts) / size
    # a count may fall as the wheel rolls forward
    return np.concatenate(times), -turns if turns.size and turns[-1] < turns[0] else turns


def teeth_of_counter(channel: Channel, steps: int) -> tuple[Records, int]:
    """(passages (n,) of TEETH, counts per turn) of a counter of `steps` per turn.

    If it jumps from one sample to the next it passes halves of its numbers.
    """
    time_s, turns = turns_of_counts(channel, float(steps))
    count = np.rint(2 * steps * turns).astype(np.int64)
    turn = 2 * steps if (count % 2).any() else steps
    count = count * turn // (2 * steps)
    forward = np.diff(count, prepend=count[:1]) >= 0
    return records(TEETH, time_s=time_s, count=count, forward=forward), turn


#: intervals or passages looked at at once: small enough for the cache
PIECE = 1 << 14
#: even passages on both sides of a cut; twice as many cost a little time
CONTEXT = 40
#: half teeth that take longer than this are looked at for a turning point
SLOW_S = 0.06
#: slow intervals within so many of each other are one place; a car does not roll backwards faster
#: than so many turns per second
SAME_PLACE, FASTEST_BACK_Hz = 12, 4.0
#: half teeth on each side that say how long one should be: edges between samples tell it to 2 %;
#: twice as many reach to where a speed that changes is another
NEIGHBOURS = 16


def count_teeth(channel: Channel, found: Probe, steps: int) -> Iterator[Records]:
    """Counted teeth (n,) of TEETH of an encoder of `steps` per turn, piece by piece."""
    held, last, wanted = np.zeros(0, TEETH), None, PIECE
    for new in crossings(channel, found) if found.form != "dead" else ():
        held = np.concatenate([held, new])
        if held.size < wanted:
            continue
        teeth, open_from = _count(channel, found, held, steps)
        cut = _last_cut(teeth["uneven"], open_from)
        wanted = 2 * held.size
        if cut > CONTEXT:
            yield _continued(teeth[:cut], last)
            last = teeth[:cut]
            held = held[held["index"] >= last["index"][-1 - CONTEXT]]
            wanted = held.size + PIECE
    yield _continued(_count(channel, found, held, steps)[0], last)


def _last_cut(uneven: np.ndarray, open_from: int) -> int:
    """How many passages of a piece can be settled; 0 if none.

    Up to the last one with CONTEXT even intervals on both sides.
    """
    bad = np.flatnonzero(uneven[:open_from])
    edges = np.concatenate([[-1], bad, [min(open_from, uneven.size)]])
    wide = np.flatnonzero(np.diff(edges) > 2 * CONTEXT + 2)
    return int(edges[wide[-1] + 1]) - CONTEXT if wide.size else 0


def _continued(teeth: Records, last: Records | None) -> Records:
    """The `teeth` (n,) of a piece, counted on from the `last` piece, without those of that.

    They begin with the last CONTEXT + 1 passages of it.
    """
    if last is None:
        return teeth
    for name in ("count", "stretch"):
        teeth[name] += last[name][-1 - CONTEXT] - teeth[name][0]
    return teeth[CONTEXT + 1 :]


def _count(channel: Channel, found: Probe, passages: Records, steps: int) -> tuple[Records, int]:
    """(counted teeth of a piece of the log, passage from which the direction is not settled yet).

    Counts and stretches begin anywhere. A gap in the time axis ends a stretch.
    """
    rate_Hz = channel.axis.rate_Hz
    teeth = _regular(passages.copy(), SLOW_S * rate_Hz)
    index, halves, n = teeth["index"].copy(), teeth["halves"][:-1], teeth.size
    teeth["time_s"] = channel.axis.at(index)
    teeth["forward"] = True
    if n < 2:
        return teeth, n
    intervals, hole = np.diff(index), teeth["hole"][1:]
    still = intervals > 0.5 * FOLLOW_S * rate_Hz
    # half teeth shorter than this on both sides of a long interval: the wheel did not stand
    _bridge(halves, intervals, np.flatnonzero(hole & still), 0.02 * rate_Hz)
    fastest = FASTEST_BACK_Hz / rate_Hz * 2 * steps
    slow = np.flatnonzero(intervals > SLOW_S * rate_Hz)
    turned = [] if found.pulsed else _turning_points(channel, found, index, slow)
    sign, turns = _directions(index, slow, turned, fastest)
    unsettled = [
        at
        for at in turned
        if not (slow > at + SAME_PLACE).any()
        and intervals[at + 1 :].min(initial=np.inf) >= 1 / fastest
    ]
    gap = np.diff(np.searchsorted(channel.axis.first[1:], index, side="right")) > 0
    lost = still | gap | (hole & (halves != 1)) | (halves > 2 * steps)
    lost[turns] = True
    teeth["forward"][:-1] = sign > 0
    teeth["stretch"][1:], teeth["count"][1:] = np.cumsum(lost), np.cumsum(halves * sign)
    # rolling forwards a rising passage is even, backwards a falling one
    heads = np.append(0, np.flatnonzero(lost) + 1)
    wrong = np.mod(teeth["count"][heads], 2) != (teeth["rising"] != teeth["forward"])[heads]
    teeth["count"] += wrong[teeth["stretch"]]
    teeth["uneven"][:-1] |= hole | lost | (sign < 0) | (intervals > SLOW_S * rate_Hz)
    return teeth, min(unsettled, default=n)


def _bridge(halves: Integers, intervals: FloatArray, still: Integers, rolling: float) -> None:
    """Fills in half teeth of long intervals over holes in the signal.

    The holes begin and end in full motion: the mean of both speeds says how many, near enough that
    no turn is lost.
    """
    for at in still.tolist():
        before, after = _beside(intervals, at, at + 1, halves > 1)
        if before.size and after.size and max(np.mean(before), np.mean(after)) < rolling:
            length = intervals[at] * 0.5 * (1 / np.mean(before) + 1 / np.mean(after))
            halves[at] = min(2 * round((length - 1) / 2) + 1, np.iinfo(halves.dtype).max)


def _beside(
    intervals: FloatArray, start: int, stop: int, odd: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """The `intervals` (n,) before `start` and from `stop` on that are not `odd`, of whole teeth."""
    first = max(start - NEIGHBOURS, 0)
    bad = np.flatnonzero(odd[first:start]) + first
    left = intervals[bad[-1] + 1 if bad.size else first : start]
    bad = np.flatnonzero(odd[stop : stop + NEIGHBOURS])
    right = intervals[stop:][: bad[0] if bad.size else NEIGHBOURS]
    # half teeth may be unlike in pairs; one alone is better than none
    return left[-max(left.size // 2 * 2, 1) :], right[: max(right.size // 2 * 2, 1)]


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


def _regular(teeth: Records, slowest: float) -> Records:
    """The `teeth` (n,) with their half teeth, uneven intervals and repairs; fewer than were given.

    A run of intervals that are too long or too short for the motion around it becomes one interval:
    of as many half teeth as its length has, odd or even as the passages in it were. If the
    intervals before and after a run disagree (near standstill), it stays.
    """
    steps = np.diff(teeth["index"])
    teeth["halves"] = 1
    if steps.size < 12:
        teeth["uneven"] = True
        return teeth
    # if no interval differs much from those five before and after, no closer look is needed
    before, after = np.append(steps[5:10], steps[:-5]), np.append(steps[5:], steps[-10:-5])
    share = steps / (0.5 * (before + after))
    # an interval outside of these shares of its neighbours' median is not a single half tooth
    # (pitch errors of 0.5 degree stay inside)
    short, long = 0.65, 1.5
    if np.all((share > short) & (share < long)):
        return teeth
    # half teeth may be unlike in pairs: each is held against the two before and after of its kind
    around = sliding_window_view(np.pad(steps, 4, mode="reflect"), 9)[:, ::2]
    ratio = steps / np.median(around, axis=1)
    odd = ratio < short
    odd[1:] |= ratio[:-1] < short  # the tooth beside a glitch lost what the glitch took
    odd[:-1] |= ratio[1:] < short
    odd |= ratio > long
    teeth["uneven"][:-1] = odd
    odd &= steps < slowest
    keep = np.ones(teeth.size, bool)
    for start, stop in zip(*runs(odd), strict=True):
        before, after = _beside(steps, start, stop, odd)
        taken = float(teeth["index"][stop] - teeth["index"][start])
        if before.size == 0 or after.size == 0 or taken > 2 * slowest:
            continue
        left, right = float(np.mean(before)), float(np.mean(after))
        if max(left, right) > 1.6 * min(left, right):
            continue
        n = stop - start
        whole = max(n + 2 * round((taken / (0.5 * (left + right)) - n) / 2), 2 - n % 2)
        keep[start + 1 : stop] = False
        teeth["halves"][start] = whole
        teeth["hole"][stop] = teeth["hole"][start + 1 : stop + 1].any()
        teeth["missing"][stop], teeth["extra"][stop] = (
            max(whole - n, 0) // 2,
            max(n - whole, 0) // 2,
        )
    return teeth[keep]


def _turning_points(channel: Channel, found: Probe, index: FloatArray, slow: Integers) -> list[int]:
    """The intervals of `slow` in which the signal turned.

    It came back before its peak, or passed it, came back and passed it again. A turn within a sixth
    of a half tooth of the peak is not seen. Nothing is inferred if the amplitude falls with speed
    (an inductive sensor): there the peak says nothing.
    """
    turned = []
    for at in slow:
        before, after = int(index[max(at - 2, 0)]), int(index[min(at + 3, index.size - 1)]) + 1
        x = channel.read(before, min(after, before + (1 << 20)))
        edges = (np.array([index[at], index[at + 1]]) - before).astype(np.int64)
        if edges[1] + 3 > x.size or edges[0] < 2 or np.isnan(x).any():
            continue
        size = max(int(edges[1] - edges[0]) // 20, 1)
        away = np.abs(sliding_mean(x, size) - 0.5 * float(x.max() + x.min()))
        inner = away[edges[0] : edges[1]]
        peak = float(np.delete(away, slice(*edges)).max())
        if peak < 0.7 * found.amplitude:
            continue
        passed = np.flatnonzero(inner > 0.95 * peak)
        least = inner[passed[0] : passed[-1] + 1].min() if passed.size else inner.max()
        # a turning wheel shows less than this share of the peak between two passages of the same
        # tooth flank; nearer to one, a slow passage looks like turning back
        if least < 0.85 * peak:
            turned.append(int(at))
    return turned
