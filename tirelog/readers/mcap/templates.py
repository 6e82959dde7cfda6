"""Messages whose layout repeats, read with numpy.

One message is walked as a template, the others are compared with it and gathered.

    template (bytes), wanted paths
        --walk of CDR or protobuf--> Plan: where each number lies, and the bytes that fix the layout
    Plan, messages of the same size --compare the guard bytes--> which have this layout;
        --gather--> numbers

A guard is a byte that decides where later fields lie: length prefixes, tags, continuation bits.
Messages whose guards agree have the same layout, so their numbers lie at the same places.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.readers.mcap.walk import MessageTable, message_rows
from tirelog.vocabulary.arrays import FloatArray

#: bytes that fix a layout
MOST_GUARDS = 1 << 14


class NoPlanError(ValueError):
    """The wanted numbers of this message have no places of their own: it has to be decoded."""


@dataclass(frozen=True)
class Place:
    """Numbers in a message: `count` of `dtype` from byte `offset`, every `step` bytes.

    `dtype` None: a varint of `size` bytes. Or a constant. `batch` is true for a list of numbers.
    """

    offset: int
    dtype: str | None = None
    count: int = 1
    step: int = 0
    size: int = 0
    batch: bool = False
    constant: float | None = None
    zigzag: bool = False


@dataclass
class MessagePlan:
    """The layout of messages of `size` bytes.

    `places[i]` for wanted path i; guards as (byte offset, mask, value).
    """

    size: int
    places: list[Place | None]
    guards: list[tuple[int, int, int]] = field(default_factory=list)

    def guard_exact(self, data: bytes, start: int, stop: int) -> None:
        """Bytes that must be the same.

        NoPlanError: so many that comparing them is no faster than decoding.
        """
        if len(self.guards) > MOST_GUARDS:
            raise NoPlanError
        self.guards += [(at, 0xFF, data[at]) for at in range(start, stop)]

    def freeze(self) -> FrozenPlan:
        """The plan as arrays.  NoPlanError if a wanted path has no place."""
        if any(place is None for place in self.places):
            raise NoPlanError
        table = np.array(self.guards, np.int64).reshape(-1, 3)
        places = [place for place in self.places if place is not None]
        return FrozenPlan(
            self.size,
            places,
            table[:, 0],
            table[:, 1].astype(np.uint8),
            table[:, 2].astype(np.uint8),
        )


@dataclass(frozen=True)
class FrozenPlan:
    size: int
    places: list[Place]
    at: NDArray[np.int64]
    mask: NDArray[np.uint8]
    value: NDArray[np.uint8]

    def read(self, table: MessageTable) -> tuple[NDArray[np.bool_], list[FloatArray]]:
        """(which of the messages have this layout, their numbers for each wanted path).

        All messages are of this size; the numbers have shape (m, count).
        """
        bytes_ = message_rows(table.data, table.starts, self.size)
        fits = ((bytes_[:, self.at] & self.mask) == self.value).all(axis=1)
        if not fits.all():
            bytes_ = bytes_[fits]
        return fits, [_numbers(bytes_, place) for place in self.places]


def _numbers(bytes_: NDArray[np.uint8], place: Place) -> FloatArray:
    """The numbers at a place in each row of messages, shape (m, count), float64."""
    n = bytes_.shape[0]
    if place.constant is not None:
        return np.full((n, 1), place.constant)
    if place.dtype is None:
        return _varint(bytes_[:, place.offset : place.offset + place.size], place)
    if n == 0 or place.count == 0:
        return np.zeros((n, place.count))
    width = np.dtype(place.dtype).itemsize
    view: NDArray[Any] = np.ndarray(
        (n, place.count), place.dtype, bytes_, place.offset, (bytes_.shape[1], place.step or width)
    )
    return view.astype(np.float64)


def _varint(bytes_: NDArray[np.uint8], place: Place) -> FloatArray:
    shifts = np.arange(0, 7 * place.size, 7, dtype=np.uint64)
    value = np.bitwise_or.reduce((bytes_ & 0x7F).astype(np.uint64) << shifts, axis=1)
    signed = value.view(np.int64)
    if place.zigzag:
        signed = (value >> np.uint64(1)).view(np.int64) ^ -(signed & 1)
    numbers: FloatArray = signed.astype(np.float64)[:, None]
    return numbers
