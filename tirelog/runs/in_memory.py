"""A channel before it is measured: in memory, without bursts, each held value once.

It is gone through more than once.

    Channel of a run --int32 counts as they are stored--> Channel in memory
    Channel of a log --float64 if it is short--> Channel in memory; a long one stays in the
        temporary run, whose numbers are stored as they are
    any other Channel --float64--> Channel in memory

What is read from the one that is made is what was stored, to the bit. A run's counts are not
unpacked again: of an hour at 2.5 kHz they take 36 MB a channel.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import BLOCK_SAMPLES, Channel, Scaled, TimeAxis
from tirelog.dsp.filters import runs
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.kinds import ACCELERATION_KINDS, STRAIN_KINDS
from tirelog.vocabulary.quality import Doubt, Quality

#: a channel up to this length is read once and held: an hour at 2.5 kHz, of a run 38 MB
HELD_SAMPLES = 9_500_000

Read = Callable[[int, int], FloatArray]


def with_holes(channel: Channel, first: IntArray, stop: IntArray) -> Channel:
    """The channel, its samples lost in the ranges [first, stop), (n,) in order.

    They stay in memory if they are there.
    """

    def holed(read: Read) -> Read:
        def samples(begin: int, end: int) -> FloatArray:
            values = read(begin, end)
            some = slice(np.searchsorted(stop, begin, "right"), np.searchsorted(first, end))
            if some.start < some.stop:
                values = values.copy()
                for low, high in zip(first[some], stop[some], strict=True):
                    values[max(low - begin, 0) : high - begin] = np.nan
            return values

        return samples

    stored = channel.stored and holed(channel.stored)
    return replace(channel, samples=holed(channel.samples), stored=stored)


def in_memory(channel: Channel) -> Channel:
    """The channel in memory, unless it is too long for that.

    Long channels of a log are read from its temporary run each time. For an hour at 2.5 kHz that is
    275 MB in all, and 314 MB with two channels held, at the same cost. (22 November 2026, two
    shared cores, Python 3.11; `tirelog tables` on 4 gratings.)
    """
    # a channel of a log up to this length is held as what it becomes, 50 MB: ten minutes at 10 kHz.
    # Tables go through it ten times, which without it are a seventh of their CPU time; twice as
    # much holds twice as much in each process
    most = 6_300_000 if channel.at_hand else HELD_SAMPLES
    if channel.size > most or channel.stored is not None:
        return channel
    stored = channel.samples
    if isinstance(stored, Scaled) and not channel.at_hand:
        raw = _whole(stored.raw, channel.size, stored.raw(0, 0).dtype)
        return replace(channel, samples=replace(stored, raw=raw), stored=stored)
    held = _whole(stored, channel.size, np.dtype(float))
    return replace(channel, samples=held, stored=stored)


def readable_apart(channel: Channel) -> bool:
    """Whether several processes can read a channel at a time.

    It is in memory, or stored so that no library holds its file's place; its times are counted.
    """
    return (channel.stored is not None or channel.at_hand) and channel.axis.explicit is None


def released(channel: Channel) -> Channel:
    """The channel without the memory that `in_memory` took."""
    stored = channel.stored
    return replace(channel, samples=stored, stored=None) if stored is not None else channel


def _whole(
    read: Callable[[int, int], NDArray[Any]], size: int, dtype: np.dtype[Any]
) -> Callable[[int, int], NDArray[Any]]:
    """All numbers of a channel of `size` from memory."""
    values = np.empty(size, dtype)
    for start in range(0, size, BLOCK_SAMPLES):
        stop = min(start + BLOCK_SAMPLES, size)
        values[start:stop] = read(start, stop)
    return lambda start, stop: values[start:stop]


# ---- Error codes, however long, and bursts of bad samples of up to 8 ms.
#
#     Channel --extremes of cells of 8 ms, in one pass
#             --a number that comes again, off all others by twice their range--> a code, lost
#             --> range of the signal over 2 s, without its few most extreme cells
#             --samples beyond that by twice the range, and not for longer than a cell--> lost
#             --of the rest, the least or largest number several times in a row--> clipped
#
# An instrument's error code or a knock on a plug is no strain. Left in, a burst a hundred times as
# high as the patch is all that a search by height sees. A passage of 8 ms is no burst: its wheel
# runs at 10 m/s and more, and so passes many times in 2 s. Samples alone that are less far off are
# left to whoever reads the channel, who knows their neighbours.


#: cells over which the signal's range is known, 2 s; fewer than FEWEST of them, half a second, tell
#: none; half as many hold a passage or two
AROUND, FEWEST = 250, 62
#: a burst leaves the range by so many times its width; passages in 2 s are seldom twice as high as
#: others.  Twice as much leaves bursts in that are five times as high as the patch, which a search
#: by height bears
FAR = 2.0
#: cells that are left out where more bursts are looked for, those of eight.  Passages leave more
#: than that at a tenth of their height, so these bursts leave the range by so many times its width.
#: Twice as many cells hold whole passages
MANY_LEFT_OUT, VERY_FAR = 16, 10.0
#: samples that hold a code at least; with fewer, two knocks of one height are one
FEWEST_ALIKE = 3
#: a spike of a slow channel lasts this many samples at most, and is so many times as high as usual
#: changes. More than this share of the samples are no spikes
SPIKE_SAMPLES, KINK, OFTEN = 2, 10.0, 0.05
#: samples of a cell of a channel that is too slow for bursts, or has no patch
SLOW_CELL = 64
#: no ranges of samples, (0, 2)
NO_RANGES = np.zeros((0, 2), np.int64)


def without_spikes(channel: Channel) -> Channel:
    """The channel in memory, if it is not too long for that, its bursts lost and flagged.

    A channel without bursts is as it was, to the bit.
    """
    if channel.mended:
        return channel
    channel = replace(in_memory(channel), mended=True)
    recorded, lost = channel.recorded or channel, [NO_RANGES]
    # a burst lasts no longer than this [s]; twice as long, one is as long as passages at 5 m/s, of
    # which there may be only three in 2 s
    size = int(8e-3 * channel.axis.rate_Hz)
    # fewer samples than this in that time show no passage as long; with half as many, the only
    # sample of a fast passage is a burst
    quick = size >= 2
    size = size if quick else SLOW_CELL
    cells = _extremes(channel, size)
    while (codes := error_codes(channel, cells)).size:
        channel = _without(channel, codes)
        lost.append(codes)
        cells = _extremes(channel, size)
    if not quick:
        return channel
    bursts = _bursts(channel, size, *cells)
    # what is lost is no limit of the instrument
    first, stop = np.sort(np.concatenate([*lost, bursts]), axis=0).T
    recorded = with_holes(recorded, first, stop) if first.size else recorded
    channel = _without(channel, bursts)
    clipped = _flags(clipped_ranges(recorded, _extremes(recorded, size)), Quality.CLIPPED)
    return replace(channel, flags=(*channel.flags, *clipped))


def without_codes(channel: Channel, quiet: Channel) -> tuple[Channel, str]:
    """(a slow channel without its codes and spikes, a remark; '' if it has none).

    Such as a pressure. One sample as far off as a code is enough, but a number that comes often may
    be one that was set. `quiet` is the same channel, of whose losses nobody hears.
    """
    codes, spikes = NO_RANGES, NO_RANGES
    # codes and spikes may hide others: a second code, a spike two samples on
    for _ in range(4):
        more = error_codes(quiet, _extremes(quiet, SLOW_CELL), 1, OFTEN)
        codes = np.concatenate([codes, more])
        if not more.size:
            more = _slow_spikes(quiet)
            spikes = np.concatenate([spikes, more])
        if not more.size:
            break
        quiet = _without(quiet, more)
    if np.diff(spikes).sum() > OFTEN * channel.size:
        spikes = NO_RANGES
    found = np.sort(np.concatenate([codes, spikes]), axis=0)
    if not found.size:
        return channel, ""
    many, first_s = int(np.diff(found).sum()), channel.axis.at(int(found[0, 0]))
    return _without(channel, found), (
        f"{many} samples far off those around them were left out as error codes or spikes, the "
        f"first at {float(first_s):.6g} s"
    )


def _slow_spikes(channel: Channel) -> IntArray:
    """Ranges (k, 2) of one or two samples of a slow channel that leave both sides the same way.

    By KINK times the usual change around them. A step leaves one side only, and a signal that turns
    round changes as much beside it.
    """
    parts = []
    for start in range(0, channel.size - 2 * SPIKE_SAMPLES, BLOCK_SAMPLES):
        values = channel.read(start, start + BLOCK_SAMPLES + 2 * SPIKE_SAMPLES)
        before = values[SPIKE_SAMPLES:-SPIKE_SAMPLES] - values[: -2 * SPIKE_SAMPLES]
        after = values[SPIKE_SAMPLES:-SPIKE_SAMPLES] - values[2 * SPIKE_SAMPLES :]
        before, after = (
            np.where(np.isnan(before), after, before),
            np.where(np.isnan(after), before, after),
        )
        least = np.where(before * after > 0.0, np.minimum(np.abs(before), np.abs(after)), 0.0)
        wild = least > KINK * _usual(np.abs(before), channel.resolution)
        parts.append(start + SPIKE_SAMPLES + np.stack(runs(wild), axis=1))
    return joined_ranges(parts)


def _usual(changes: FloatArray, step: float) -> FloatArray:
    """The usual size of the `changes` (n,) around each, (n,), at least a `step` of the signal.

    The largest of the medians of three cells, so that a signal which begins to move is no spike.
    """
    step = max(step, float(changes.min(initial=np.inf, where=changes > 0.0)))
    # mirrored: of zeros in the last cell the noise would be spikes
    room = (0, -changes.size % SLOW_CELL)
    padded = np.pad(np.nan_to_num(changes), room, mode="symmetric").reshape(-1, SLOW_CELL)
    around = np.pad(np.median(padded, axis=1), 1, mode="edge")
    largest = np.maximum.reduce([around[:-2], around[1:-1], around[2:]])
    return np.repeat(np.maximum(largest, step), SLOW_CELL)[: changes.size]


def joined_ranges(parts: Sequence[IntArray]) -> IntArray:
    """The ranges (k, 2) of blocks one behind the other; one that a block's end cut is one."""
    edges, times = np.unique(np.concatenate([np.zeros((0, 2), int), *parts]), return_counts=True)
    joined: IntArray = edges[times == 1].reshape(-1, 2)
    return joined


def _holding(channel: Channel, number: float) -> IntArray:
    """The ranges of samples, (k, 2), that hold a number exactly."""
    held = [(start, runs(values == number)) for start, values in channel.blocks()]
    return joined_ranges([start + np.stack(ends, axis=1) for start, ends in held])


def _without(channel: Channel, ranges: IntArray) -> Channel:
    """The channel, the samples of these ranges (k, 2) lost and flagged."""
    if not ranges.size:
        return channel
    flags = _flags(ranges, Quality.SPIKE)
    return replace(with_holes(channel, *ranges.T), flags=(*channel.flags, *flags))


def _flags(ranges: IntArray, word: Quality) -> tuple[Doubt, ...]:
    """The word for each of these ranges (k, 2); of very many, near ones share it."""
    # flags of a channel; of more, those within a slow cell are one: each takes a hundred bytes
    if len(ranges) > 100_000:
        ranges = _merged(ranges, SLOW_CELL)
    return tuple((int(first), int(stop), word) for first, stop in ranges)


def _extremes(channel: Channel, size: int) -> tuple[FloatArray, FloatArray]:
    """The least and the largest of each `size` samples of a channel, shape (m,) each."""
    low, high = np.empty((2, -(-channel.size // size)))
    step = max(BLOCK_SAMPLES // size, 1)
    for cell in range(0, low.size, step):
        part = slice(cell, min(cell + step, low.size))
        values = channel.read(part.start * size, part.stop * size)
        low[part], high[part] = cell_extremes(values, size)
    return low, high


def error_codes(
    channel: Channel,
    cells: tuple[FloatArray, FloatArray],
    fewest: int = FEWEST_ALIKE,
    most_share: float = 1.0,
) -> IntArray:
    """Ranges (k, 2) of samples that hold an error code: its first and the one behind its last.

    A code is a number that comes exactly, at least `fewest` times and at most in this share of the
    samples. Its distance from all other samples is FAR times their range. A clipped signal
    has samples beside its limit, and so has none. `cells` are the least and the largest of the
    channel's cells, (m,) each.
    """
    low, high = (cells_[np.isfinite(cells_)] for cells_ in cells)
    if not low.size:
        return NO_RANGES
    ends = float(low.min()), float(high.max())
    inner = np.concatenate([low, high])
    inner = inner[~np.isin(inner, ends)]
    if not inner.size or not _far(ends, float(inner.min()), float(inner.max())):
        return NO_RANGES
    least, most = np.inf, -np.inf
    for _, values in channel.blocks():
        others = values[~np.isin(values, ends) & np.isfinite(values)]
        least, most = others.min(initial=least), others.max(initial=most)
    found = NO_RANGES
    for end in _far(ends, float(least), float(most)):
        ranges = _holding(channel, end)
        if fewest <= np.diff(ranges).sum() <= most_share * channel.size:
            found = np.concatenate([found, ranges])
    return np.sort(found, axis=0)


def _far(ends: tuple[float, float], least: float, most: float) -> list[float]:
    """Which of the `ends` are far from what lies between `least` and `most`, which has a width."""
    far = FAR * (most - least)
    below, above = least - ends[0], ends[1] - most
    return [end for end, gap in zip(ends, (below, above), strict=True) if gap > far > 0.0]


def clipped_ranges(channel: Channel, cells: tuple[FloatArray, FloatArray]) -> IntArray:
    """Ranges (k, 2) of samples at an end of the instrument's range.

    FEWEST_ALIKE and more in a row hold the channel's least or largest number, at as many places at
    least. Of a signal that turns round there, more samples lie just beside that number. `cells` are
    the least and the largest of the channel's cells, (m,) each.
    """
    found = NO_RANGES
    low, high = (cells_[np.isfinite(cells_)] for cells_ in cells)
    for limit, own in ((low.min(), low), (high.max(), high)) if low.size else ():
        if np.count_nonzero(own == limit) < FEWEST_ALIKE:
            continue
        nearest = np.inf
        for _, values in channel.blocks():
            off = np.abs(values - limit)
            nearest = off.min(initial=nearest, where=off > 0.0)
        # a limit of the instrument has fewer samples beside it than a quarter of those at it,
        # within this share of the signal's range or so many steps; a pulse as flat as x^4 has twice
        # as many
        width = max(0.02 * float(high.max() - low.min()), 5.0 * nearest)
        near = sum(int(np.sum(np.abs(values - limit) <= width)) for _, values in channel.blocks())
        ranges = _holding(channel, limit)
        beside = near - int(np.diff(ranges).sum())
        ranges = ranges[np.diff(ranges)[:, 0] >= FEWEST_ALIKE]
        samples = int(np.diff(ranges).sum())
        many = len(ranges) >= FEWEST_ALIKE
        # a quarter of all samples is the level between passages, and no limit
        if many and 4 * beside < samples < 0.25 * channel.size:
            found = np.concatenate([found, ranges])
    return found


def _bursts(channel: Channel, size: int, low: FloatArray, high: FloatArray) -> IntArray:
    """First sample of each burst of `channel`, and the one behind its last, apart; (k, 2).

    `low` and `high` (m,): the least and the largest of its cells of `size` samples.
    """
    found: set[tuple[int, int]] = set()
    # cells that the range leaves out at either end: those of three bursts; of passages of 8 ms
    # there are more.  Twice as many take six passages for bursts
    bottom, top = cell_ranges(low, high, AROUND, 6)
    lowest, highest = cell_ranges(low, high, AROUND, MANY_LEFT_OUT)
    with np.errstate(invalid="ignore", over="ignore"):
        odd = _beyond(low, high, bottom, top, FAR)
        many = _beyond(low, high, lowest, highest, VERY_FAR) & ~odd
        # what no passage of the log leaves by so much
        never = VERY_FAR * float(np.fmax.reduce(highest - lowest, initial=0.0))
    bottom, top = np.where(many, lowest, bottom), np.where(many, highest, top)
    for cell in np.flatnonzero(odd | many).tolist():
        found.update(_bursts_of_cell(channel, size, cell, bottom[cell], top[cell], never))
    return _merged(np.array(sorted(found), np.int64).reshape(-1, 2), 0)


def _merged(ranges: IntArray, apart: int) -> IntArray:
    """The ranges (k, 2), in order; those no more than `apart` behind another are one with it."""
    ends = np.maximum.accumulate(ranges[:, 1])
    begins = ranges[1:, 0] - ends[:-1] > apart
    first = ranges[np.append(True, begins)[: len(ranges)], 0]
    return np.stack([first, ends[np.append(begins, True)[: len(ranges)]]], axis=1)


def _beyond(
    low: FloatArray, high: FloatArray, bottom: FloatArray, top: FloatArray, far: float
) -> NDArray[np.bool_]:
    """Which cells (m,) leave the range from `bottom` to `top` by so many times its width."""
    most = far * (top - bottom)
    return (high > top + most) | (low < bottom - most)


def _bursts_of_cell(
    channel: Channel, size: int, cell: int, bottom: float, top: float, never: float
) -> list[tuple[int, int]]:
    """Bursts around the most extreme sample of a `cell`: their first samples and those behind.

    None if they last longer than bursts do, or stand upon something else that is high. `bottom` and
    `top`: the signal's range there; `never`: how far no passage of the log leaves it.
    """
    begin = max((cell - 4) * size, 0)
    values = channel.read(begin, (cell + 5) * size)
    with np.errstate(invalid="ignore", over="ignore"):
        off = np.nan_to_num(np.maximum(values - top, bottom - values), nan=-np.inf)
        range_ = top - bottom
    own = slice(cell * size - begin, (cell + 1) * size - begin)
    peak = own.start + int(np.argmax(off[own]))
    near = slice(max(peak - 2 * size, 0), peak + 2 * size + 1)
    sides = [side for side in (off[: near.start], off[near.stop :]) if side.size]
    # a burst is so many times as far off as the middle of what is beside it: a spike upon a
    # slow passage takes nothing else of it away.  Twice as much leaves in what is six times as far
    # off
    beside = 3.0 * max([0.0, *(float(np.median(side)) for side in sides)])
    high = np.count_nonzero(off[near] > 0.5 * off[peak])
    longest = 2 * size if off[peak] > never else size
    if high > longest or not off[peak] > max(FAR * range_, beside):
        return []
    # its other samples leave the range by half of it; twice as much leaves the flanks of a burst in
    wild = near.start + np.flatnonzero(off[near] > max(0.5 * range_, 0.5 * beside))
    # two samples in a row may lie within the range, in the midst of a burst; twice as many make one
    # of two with some good samples between
    parts = np.split(wild, np.flatnonzero(np.diff(wild) > 3) + 1)
    return [(begin + int(part[0]), begin + int(part[-1]) + 1) for part in parts]


def cell_extremes(values: FloatArray, size: int) -> tuple[FloatArray, FloatArray]:
    """The least and the largest of each `size` of `values` (n,), shape (m,) each.

    Of those that are not lost; NaN if all are. The last cell may hold fewer.
    """
    lost = np.full(-values.size % size, np.nan)
    cells = np.ascontiguousarray(np.concatenate([values, lost]).reshape(-1, size).T)
    return np.fmin.reduce(cells), np.fmax.reduce(cells)


def cell_ranges(
    low: FloatArray, high: FloatArray, around: int, left_out: int
) -> tuple[FloatArray, FloatArray]:
    """The least and the largest, shape (m,) each, of the `around` cells about each cell.

    Of the cells' `low` and `high` (m,), NaN where lost. The most extreme `left_out` at either end
    do not count, or as large a share of the cells that are there; NaN if these are too few. The
    same for all cells of half of `around`.
    """
    half, count = around // 2, low.size
    first = np.clip(np.arange(0, count, half) - half // 2, 0, max(count - around, 0))
    windows = first[:, None] + np.arange(min(around, count))
    # ascending, lost ones behind all others
    bottoms, tops = np.sort(low[windows]), np.sort(-high[windows])
    known = np.count_nonzero(~np.isnan(bottoms), axis=1)
    # of few cells those that one burst can lie in; twice as many leave a passage out
    share = np.maximum(known * left_out // around, 2)[:, None]
    share[known < FEWEST] = -1
    ends = (np.take_along_axis(sorted_, share, axis=1) for sorted_ in (bottoms, tops))
    bottom, top = (np.repeat(np.where(share < 0, np.nan, end)[:, 0], half)[:count] for end in ends)
    return bottom, -top


# ---- A channel whose logger repeats each value, as the values that its instrument took.
#
#     stored numbers, axis --does a change follow a change?--> the channel as it is
#         --places where the value changes--> every how many samples a value is new
#         --the first sample of each value--> places, and a time axis of their own
#
# A logger that is faster than its instrument writes each value several times, or, if it joins
# several instruments by their times, leaves blanks between them. Such a staircase has
# no derivative, and its noise is not a sample's. Changes are compared on the stored numbers, so it
# does not matter which format they came in, and a channel is asked for itself: others of its log
# may be as fast as the logger.
#
# If each value is there equally often, all changes lie at multiples of that number: one change
# elsewhere and it is none, so values that are alike by chance and the rounding of a signal do not
# matter. If the numbers of samples vary (2, 3, 2, 3: the two clocks are no multiples), they have to
# be neighbours nearly everywhere.


#: changes that tell something; with half as many a quantised signal's changes could be multiples
#: of two once in 1e15, twice as many need a probe of faster signals
_FEWEST = 100
#: share of changes that may follow each other at once: rows that a log has lost; twice as many
#: lets rounded signals be looked at as a whole
_SINGLE = 0.02


def without_repeats(channel: Channel, quiet: Channel) -> tuple[Channel, str]:
    """(the channel with each value that is held once, a remark, '' if there is none).

    Asked of channels in which a patch is found and of encoders, if their samples are `Scaled`. An
    encoder of few levels holds each for long by itself, at any number of samples. `quiet` is the
    same channel, of whose losses nobody hears.
    """
    stored, looked_at = channel.samples, quiet.samples
    found, held = None, True
    patch = channel.kind in (*STRAIN_KINDS, *ACCELERATION_KINDS)
    if (patch or channel.kind == "wheel_encoder") and isinstance(looked_at, Scaled):
        # an encoder of two levels, and noise or ringing on them, has fewer than these
        if patch or np.unique(looked_at.raw(0, min(channel.size, BLOCK_SAMPLES))).size > 32:
            found = sample_and_hold(looked_at, channel.axis, evenly=not patch)
        if patch and found is None:
            found, held = sample_and_hold(looked_at, channel.axis, held=False), False
    if found is None or not isinstance(stored, Scaled):
        return channel, ""
    raw, (at, axis, least, most) = stored.raw, found

    def once(start: int, stop: int) -> NDArray[Any]:
        some = at[start:stop]
        return raw(int(some[0]), int(some[-1]) + 1)[some - some[0]] if some.size else raw(0, 0)

    flags = tuple(_moved(doubt, at) for doubt in channel.flags)
    often = f"{least}" if least == most else f"{least} to {most}"
    what = (
        f"the log repeats each value {often} times: it was taken once, at its first time"
        if held
        else f"the log has a value every {often} rows, blanks between"
    )
    return (
        replace(channel, samples=replace(stored, raw=once), axis=axis, flags=flags),
        f"{what}, {axis.rate_Hz:.4g} values per second",
    )


def _moved(doubt: Doubt, at: IntArray) -> Doubt:
    """A doubt on samples as one on the values that they hold."""
    start, stop, word = doubt
    first, last = np.searchsorted(at, [start, max(stop - 1, start)], side="right") - 1
    return max(int(first), 0), max(int(last), 0) + 1, word


def sample_and_hold(
    stored: Scaled, axis: TimeAxis, *, held: bool = True, evenly: bool = False
) -> tuple[IntArray, TimeAxis, int, int] | None:
    """How the values of a channel are `held`, or lie between blanks; None if they do not.

    `evenly`: only if each is held for as many samples.

    (m,) the first sample of each value; their times; least and most samples from one to the next,
    as a rule.
    """
    changes = _all_changes(stored, axis.size, held)
    if changes is None:
        return None
    segments = list(pairwise([*(axis.first.tolist() or [0]), axis.size]))
    own = [changes[(changes > first) & (changes < end)] for first, end in segments]
    steps = np.concatenate([np.diff(some) for some in own])
    if steps.size < _FEWEST:
        return None
    every = int(np.gcd.reduce(steps))
    if every > 1:
        parts = [
            np.arange(first + (int(some[0]) - first if some.size else 0) % every, end, every)
            for (first, end), some in zip(segments, own, strict=True)
        ]
        return np.concatenate(parts), _axis(axis, parts, float(every)), every, every
    if evenly:
        return None
    usual = int(np.bincount(np.minimum(steps, BLOCK_SAMPLES)).argmax())
    near = steps[np.abs(steps - usual) <= 1]
    # share of a channel's samples that must lie between changes as far apart as usual, or a sample
    # nearer or further; a rounded signal does not change for most of a turn; with more, values that
    # are alike by chance speak against it
    if usual < 2 or near.sum() < 0.9 * steps.sum():
        return None
    period = float(near.mean())
    parts = [
        _places(np.unique([first, *some.tolist(), end]), period)
        for (first, end), some in zip(segments, own, strict=True)
    ]
    common = np.flatnonzero(np.bincount(near) > _SINGLE * near.size)
    return np.concatenate(parts), _axis(axis, parts, period), int(common[0]), int(common[-1])


def _all_changes(stored: Scaled, size: int, held: bool) -> IntArray | None:
    """The places of all new values; None if too many follow each other."""
    parts, single, count = [], 0, 0
    for start in range(0, size, BLOCK_SAMPLES):
        some = _changes(stored, max(start - 1, 0), min(start + BLOCK_SAMPLES, size), held)
        single += int(np.count_nonzero(np.diff(some) == 1))
        count += some.size
        parts.append(some)
        if single > _SINGLE * max(count, _FEWEST):
            return None
    return np.concatenate(parts)


def _changes(stored: Scaled, start: int, stop: int, held: bool) -> IntArray:
    """Places in [start, stop) of known values, if `held` of those that differ from the one before.

    Without the first place.
    """
    raw = stored.raw(start, stop)
    known = np.isfinite(raw) if stored.lost is None else raw != stored.lost
    new = (raw[1:] != raw[:-1]) & known[1:] & known[:-1] if held else known[1:]
    places: IntArray = start + 1 + np.flatnonzero(new)
    return places


def _places(edges: IntArray, period: float) -> IntArray:
    """First samples of the values between `edges`, each of which lasts some `period`."""
    steps = np.diff(edges)
    values = np.maximum(np.rint(steps / period), 1.0).astype(np.int64)
    within = np.arange(int(values.sum())) - np.repeat(np.cumsum(values) - values, values)
    whole = np.repeat(steps, values) * within // np.repeat(values, values)
    return np.repeat(edges[:-1], values) + whole


def _axis(axis: TimeAxis, parts: list[IntArray], period: float) -> TimeAxis:
    """The times of the samples `parts`, one array for each segment of `axis`.

    Even ones, if they leave the line of one `period` [samples] by no more than a sample's rounding;
    a value was new up to a sample before it was first written.
    """
    parts = [part for part in parts if part.size]
    at = np.concatenate(parts)
    if axis.explicit is not None:
        return TimeAxis.of_times(axis.time()[at])
    longest = max(parts, key=lambda part: part.size)
    if np.ptp(longest - period * np.arange(longest.size)) > 0.0:
        period = float(np.polyfit(np.arange(longest.size), longest, 1)[0])
    off = [part - period * np.arange(part.size) for part in parts]
    # places of new values lie on one line if they leave it by this many samples of the logger in
    # all: one is the logger's own rounding; twice as many put an instrument that slips on one line
    if max(float(np.ptp(some)) for some in off) > 2.0:
        return TimeAxis.of_times(axis.at(at.astype(float)))
    sizes = [part.size for part in parts]
    begin = np.array([float(some.mean()) for some in off])
    segment = np.searchsorted(axis.first, [int(part[0]) for part in parts], side="right") - 1
    start_s = axis.start_s[segment] + (begin - axis.first[segment]) * axis.period_s[segment]
    return TimeAxis(
        sum(sizes),
        axis.rate_Hz / period,
        np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64),
        start_s,
        axis.period_s[segment] * period,
    )
