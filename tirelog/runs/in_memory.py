"""A channel in memory, in as few bytes as its numbers need: it is gone through more than once.

    Channel of a run
        --counts, piece by piece, above the least of the piece: two bytes per sample if they fit-->
        Channel in memory
    Channel of a log --float64 if it is short--> Channel in memory; a long one stays in the
        temporary run, whose numbers are stored as they are
    any other Channel --float64--> Channel in memory

What is read from the one that is made is what was stored, to the bit.

Two bytes per sample are kept for what they buy: with four, and so half as long channels held in the
same memory, `tirelog tables` on an hour's run of 4 gratings takes 10.1 s of CPU for 5.5 (22
November 2026, two shared cores, Python 3.11).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel, Scaled
from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: a channel up to this length is read once and held: an hour at 2.5 kHz, of a run 19 MB
HELD_SAMPLES = 9_500_000
#: a channel of a log up to this length is held as what it becomes, 50 MB: ten minutes at 10 kHz.
#: Tables go through it ten times, which without it are a seventh of their CPU time; twice as much
#: holds twice as much in each process
HELD_FLOATS = 6_300_000
#: samples a piece
PIECE = 1 << 17
_MOST = np.iinfo(np.uint16).max - 1

Read = Callable[[int, int], FloatArray]


@dataclass(frozen=True)
class _Packed:
    """A piece of a channel as counts above a `least` one, 0 if a sample is lost."""

    short: NDArray[np.uint16]
    least: int
    scale: float
    offset: float

    def __call__(self, start: int, stop: int) -> FloatArray:
        some = self.short[start:stop]
        return self.into(start, np.empty(some.size))

    def into(self, start: int, out: FloatArray) -> FloatArray:
        """The samples from `start` on into `out`, which is given back."""
        unpacked(self.short[start : start + out.size], self.least, self.scale, self.offset, out)
        return out


@dataclass(frozen=True)
class _Held:
    """The samples of a channel from memory, piece by piece, and where they were `stored`."""

    pieces: tuple[Read, ...]
    stored: Read

    def __call__(self, start: int, stop: int) -> FloatArray:
        parts = [
            (self.pieces[n], max(start - n * PIECE, 0), stop - n * PIECE)
            for n in range(start // PIECE, -(-stop // PIECE))
        ]
        if len(parts) == 1:
            piece, begin, end = parts[0]
            return piece(begin, end)
        out, at = np.empty(max(stop - start, 0)), 0
        for piece, begin, end in parts:
            size = min(end, PIECE) - begin
            if isinstance(piece, _Packed):
                piece.into(begin, out[at : at + size])
            else:
                out[at : at + size] = piece(begin, end)
            at += size
        return out


@dataclass(frozen=True)
class _Whole:
    """The samples of a channel, and where they were `stored`."""

    values: FloatArray
    stored: Read

    def __call__(self, start: int, stop: int) -> FloatArray:
        return self.values[start:stop]


@dataclass(frozen=True)
class _Holed:
    """Samples as they were `stored`, but lost in the ranges [first, stop), (n,) in order."""

    stored: Read
    first: IntArray
    stop: IntArray

    def __call__(self, start: int, stop: int) -> FloatArray:
        values = self.stored(start, stop)
        some = slice(np.searchsorted(self.stop, start, "right"), np.searchsorted(self.first, stop))
        if some.start < some.stop:
            values = values.copy()
            for begin, end in zip(self.first[some], self.stop[some], strict=True):
                values[max(begin - start, 0) : end - start] = np.nan
        return values


def with_holes(samples: Read, size: int, first: IntArray, stop: IntArray) -> Read:
    """The `samples` of a channel of `size`, lost in the ranges [first, stop), (n,) in order.

    They stay in memory if they are there.
    """
    if isinstance(samples, _Whole):
        return _Whole(_Holed(samples, first, stop)(0, size), _Holed(samples.stored, first, stop))
    holed = _Holed(samples, first, stop)
    if not isinstance(samples, _Held):
        return holed
    pieces = list(samples.pieces)
    for begin, end in zip(first.tolist(), stop.tolist(), strict=True):
        for n in range(begin // PIECE, (end - 1) // PIECE + 1):
            pieces[n] = _piece(holed, n * PIECE, min((n + 1) * PIECE, size))
    return _Held(tuple(pieces), _Holed(samples.stored, first, stop))


def in_memory(channel: Channel) -> Channel:
    """The channel in memory, unless it is too long for that.

    Long channels of a log are read from its temporary run each time: for an hour at 2.5 kHz that is
    275 MB in all, and 314 MB with two channels held, at the same cost (22 November 2026, two shared
    cores, Python 3.11; `tirelog tables` on 4 gratings).
    """
    stored = channel.samples
    if channel.size > HELD_SAMPLES or isinstance(stored, _Held | _Whole):
        return channel
    if isinstance(stored, Scaled) and stored.at_hand:
        if channel.size > HELD_FLOATS:
            return channel
        return replace(channel, samples=_Whole(stored.whole(channel.size), stored))
    pieces = tuple(
        _piece(stored, start, min(start + PIECE, channel.size))
        for start in range(0, channel.size, PIECE)
    )
    return replace(channel, samples=_Held(pieces, stored))


def readable_apart(channel: Channel) -> bool:
    """Whether several processes can read a channel at a time.

    It is in memory, or stored so that no library holds its file's place; its times are counted.
    """
    stored = channel.samples
    if isinstance(stored, _Holed):
        stored = stored.stored
    at_hand = isinstance(stored, Scaled) and stored.at_hand
    return (at_hand or isinstance(stored, _Held | _Whole)) and channel.axis.explicit is None


def released(channel: Channel) -> Channel:
    """The channel without the memory that `in_memory` took."""
    return (
        replace(channel, samples=channel.samples.stored)
        if isinstance(channel.samples, _Held | _Whole)
        else channel
    )


def _piece(stored: Read, start: int, stop: int) -> Read:
    """The samples [start, stop) from memory, counted from `start`."""
    if not isinstance(stored, Scaled):
        values = stored(start, stop)
        return lambda a, b: values[a:b]
    raw = stored.raw(start, stop)
    packed = None if stored.lost is None else _packed(raw, stored.lost)
    if packed is None:
        return replace(stored, raw=lambda a, b: raw[a:b])
    return _Packed(*packed, stored.scale, stored.offset)


def _packed(raw: NDArray[Any], lost: int) -> tuple[NDArray[np.uint16], int] | None:
    """(counts above a base, the base), or None if two bytes do not hold them.

    The base is one below the least count; a count that is `lost` becomes 0.
    """
    least, most = (int(raw.min()), int(raw.max())) if raw.size else (0, 0)
    if lost in (least, most):
        known = raw[raw != lost]
        least, most = (int(known.min()), int(known.max())) if known.size else (0, 0)
    if most - least >= _MOST:
        return None
    short = np.empty(raw.size, np.uint16)
    pack(raw, lost, least - 1, short)
    return short, least - 1


@compiled
def pack(raw: NDArray[Any], lost: int, least: int, short: NDArray[np.uint16]) -> None:
    """Fills `short` (n,) with how far each count of `raw` (n,) is above `least`, 0 if `lost`."""
    for i in range(raw.size):
        short[i] = np.uint16(0) if raw[i] == lost else np.uint16(raw[i] - least)


@compiled
def unpacked(
    short: NDArray[np.uint16], least: int, scale: float, offset: float, out: FloatArray
) -> None:
    """Fills `out` (n,) with what `pack` made, in SI; NaN for a lost count.

    (short + least) x scale + offset, `scale` and `offset` in the channel's SI unit.
    """
    for i in range(short.size):
        out[i] = np.nan if short[i] == 0 else (np.int64(short[i]) + least) * scale + offset
