"""A channel in memory, in as few bytes as its numbers need: it is gone through more than once.

    Channel of a run --counts, piece by piece, above the least of the piece: two bytes a sample where they fit--> Channel in memory
    any other Channel --float64--> Channel in memory

What is read from the one in memory is what was stored, to the bit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.recording import Channel, FloatArray, Scaled

#: a channel up to this length is read once and held: an hour at 2.5 kHz, of a run 19 MB
HELD_SAMPLES = 9_500_000
#: samples a piece
PIECE = 1 << 17
_MOST = np.iinfo(np.uint16).max - 1

Read = Callable[[int, int], NDArray[Any]]


@dataclass(frozen=True)
class _Held:
    """The samples of a channel from memory, and where they were `stored`."""

    values: Callable[[int, int], FloatArray]
    stored: Callable[[int, int], FloatArray]

    def __call__(self, start: int, stop: int) -> FloatArray:
        return self.values(start, stop)


def held(channel: Channel) -> Channel:
    """The channel in memory, where it is not too long for that."""
    if channel.size > HELD_SAMPLES or isinstance(channel.samples, _Held):
        return channel
    stored = channel.samples
    if isinstance(stored, Scaled):
        return replace(channel, samples=_Held(replace(stored, raw=_kept(stored.raw, channel.size, stored.lost)), stored))
    return replace(channel, samples=_Held(_kept(stored, channel.size, None), stored))


def released(channel: Channel) -> Channel:
    """The channel without the memory that `held` took."""
    return replace(channel, samples=channel.samples.stored) if isinstance(channel.samples, _Held) else channel


def _kept(read: Read, size: int, lost: int | None) -> Read:
    """All that `read` gives, from memory."""
    pieces = [_packed(read(start, min(start + PIECE, size)), lost) for start in range(0, size, PIECE)]

    def kept(start: int, stop: int) -> NDArray[Any]:
        first = start // PIECE
        parts = [
            piece(max(start - n * PIECE, 0), stop - n * PIECE) for n, piece in enumerate(pieces[first : -(-stop // PIECE)], start=first)
        ]
        return parts[0] if len(parts) == 1 else np.concatenate(parts) if parts else read(0, 0)

    return kept


def _packed(raw: NDArray[Any], lost: int | None) -> Read:
    """Slices of `raw`: counts (`lost` is not None) within 65,534 of each other from two bytes each."""
    if lost is not None:
        known = raw[raw != lost]
        least, most = (int(known.min()), int(known.max())) if known.size else (0, 0)
        if most - least < _MOST:
            short, kind = np.where(raw == lost, 0, raw - (least - 1)).astype(np.uint16), raw.dtype  # not `raw`, which is to go

            def counts(start: int, stop: int) -> NDArray[Any]:
                some = short[start:stop]
                return np.where(some == 0, lost, some + np.int32(least - 1)).astype(kind)

            return counts
    return lambda start, stop: raw[start:stop]
