"""Where the messages of a chunk are.

chunk (bytes) --chain of record lengths, compiled--> starts (n,) --by channel--> Table per channel
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import compiled
from tirelog.readers.text.digits import Bytes, Whole, bytes_of
from tirelog.vocabulary.arrays import IntArray

HEAD = struct.Struct("<BQ")
#: opcode, length; channel, sequence, log time, publish time
MESSAGE_HEAD_BYTES = 9 + 22
SCHEMA, CHANNEL, MESSAGE = 3, 4, 5
#: the descriptors of the largest robots are some hundred kilobytes
LARGEST_DEFINITION_BYTES = 1 << 22
#: records of one chunk: writers close one at some megabytes, which is below 100,000 messages.  A
#: table of a million takes 100 MB
MOST_RECORDS = 1 << 20
_8 = np.uint64(8)


@dataclass(frozen=True)
class MessageTable:
    """Messages of one channel in a chunk: `data[starts[i] : starts[i] + sizes[i]]` is message i.

    All shape (n,), int64; log time in ns.
    """

    data: bytes
    starts: IntArray
    sizes: IntArray
    log_time_ns: IntArray

    def __len__(self) -> int:
        return int(self.starts.size)

    def take(self, which: Any) -> MessageTable:
        return MessageTable(
            self.data, self.starts[which], self.sizes[which], self.log_time_ns[which]
        )

    def messages(self) -> list[bytes]:
        data = self.data
        return [
            data[a:b]
            for a, b in zip(self.starts.tolist(), (self.starts + self.sizes).tolist(), strict=True)
        ]


def record_starts(data: bytes, most: int = MOST_RECORDS) -> tuple[IntArray, int]:
    """(starts of the first `most` records, end of the last of these that is whole)."""
    found = np.empty(min(len(data) // HEAD.size, most), np.int64)
    many, end = _chain(bytes_of(data), found)
    return found[:many].copy(), int(end)


@compiled
def _chain(data: Bytes, starts: IntArray) -> tuple[int, Whole]:
    """Write the starts of the records in a row: (how many, end of the last whole one)."""
    at, many = np.int64(0), 0
    while at <= data.size - 9 and many < starts.size:
        length = np.uint64(0)
        for place in range(8, 0, -1):
            length = (length << _8) | np.uint64(data[at + place])
        if length > np.uint64(data.size - 9 - at):
            break
        starts[many] = at
        many += 1
        at += 9 + np.int64(length)
    return many, at


def gather(data: bytes, starts: IntArray, dtype: str) -> NDArray[Any]:
    """The numbers of type `dtype` at the byte offsets `starts`, shape (n,)."""
    size = np.dtype(dtype).itemsize
    return message_rows(data, starts, size).view(dtype)[:, 0] if starts.size else np.zeros(0, dtype)


def message_rows(data: bytes, starts: IntArray, size: int) -> NDArray[np.uint8]:
    """The `size` bytes from each of `starts`, shape (n, size), contiguous."""
    steps = np.diff(starts)
    if steps.size and (steps == steps[0]).all():
        return np.ascontiguousarray(
            np.ndarray((starts.size, size), np.uint8, data, int(starts[0]), (int(steps[0]), 1))
        )
    if starts.size == 0 or size == 0:
        return np.zeros((starts.size, size), np.uint8)
    anywhere = np.ndarray(
        (len(data) - size + 1,), f"V{size}", data, 0, (1,)
    )  # every offset as the start of a row
    return anywhere[starts].view(np.uint8).reshape(starts.size, size)


def split_pieces(data: bytes) -> tuple[dict[int, MessageTable], Iterator[tuple[int, bytes]], int]:
    """(messages by channel id, definitions one by one, bytes at the end that are no record).

    Definitions as (opcode, body). Of one that is too large to be kept comes no more than shows that
    it is.
    """
    starts, end = record_starts(data)
    opcodes = gather(data, starts, "u1")
    definitions = _definitions(data, starts[(opcodes == SCHEMA) | (opcodes == CHANNEL)].tolist())
    starts = starts[opcodes == MESSAGE]
    sizes = gather(data, starts + 1, "<u8").astype(np.int64) - 22
    starts, sizes = starts[sizes >= 0], sizes[sizes >= 0]
    ids = gather(data, starts + 9, "<u2")
    times = np.minimum(gather(data, starts + 15, "<u8"), np.uint64(2**63 - 1)).astype(np.int64)
    tables = {}
    for channel in np.unique(ids).tolist():
        which = ids == channel
        tables[channel] = MessageTable(
            data, starts[which] + MESSAGE_HEAD_BYTES, sizes[which], times[which]
        )
    return tables, definitions, len(data) - end


def _definitions(data: bytes, starts: list[int]) -> Iterator[tuple[int, bytes]]:
    for start in starts:
        length = min(HEAD.unpack_from(data, start)[1], LARGEST_DEFINITION_BYTES + 1)
        yield data[start], data[start + 9 : start + 9 + length]
