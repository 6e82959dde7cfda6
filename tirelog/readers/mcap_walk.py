"""Where the messages of a chunk are: the chain of records followed with numpy instead of a step a message.

    chunk (bytes) --chain of record lengths--> starts (n,) --by channel--> Table a channel

A record's header holds its length, so where the headers at an equal stride repeat, they are the chain: by induction from the first.
"""

from __future__ import annotations

import itertools
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.recording import IntArray

HEAD = struct.Struct("<BQ")
LENGTH = struct.Struct("<Q")
#: opcode, length; channel, sequence, log time, publish time
MESSAGE_HEAD_BYTES = 9 + 22
MESSAGE = 5
LONGEST_PERIOD = 64


@dataclass(frozen=True)
class Table:
    """Messages of one channel in a chunk: `data[starts[i] : starts[i] + sizes[i]]` is message i.  All shape (n,), int64; log time in ns."""

    data: bytes
    starts: IntArray
    sizes: IntArray
    log_time_ns: IntArray

    def __len__(self) -> int:
        return int(self.starts.size)

    def take(self, which: Any) -> Table:
        return Table(self.data, self.starts[which], self.sizes[which], self.log_time_ns[which])

    def messages(self) -> list[bytes]:
        data = self.data
        return [data[a:b] for a, b in zip(self.starts.tolist(), (self.starts + self.sizes).tolist(), strict=True)]


def record_starts(data: bytes) -> tuple[IntArray, int]:
    """(starts of the records, end of the last whole one)."""
    parts: list[IntArray] = []
    at, steps = 0, 16
    while True:
        walked, at, whole = _step(data, at, steps)
        parts.append(np.array(walked, np.int64))
        if not whole:
            return np.concatenate(parts), at
        run = _repeat(data, [*walked, at])
        parts.append(run)
        if run.size:
            at = int(run[-1]) + 9 + HEAD.unpack_from(data, int(run[-1]))[1]
        steps = 16 if run.size > 256 else min(2 * steps, 4096)


def _step(data: bytes, at: int, steps: int) -> tuple[list[int], int, bool]:
    """Up to `steps` records from `at`: (their starts, the end, whether there may be more)."""
    walked: list[int] = []
    append, unpack, whole = walked.append, LENGTH.unpack_from, len(data)
    for _ in range(steps):
        if at > whole - 9:
            return walked, at, False
        after = at + 9 + unpack(data, at + 1)[0]
        if after > whole:
            return walked, at, False
        append(at)
        at = after
    return walked, at, True


def _repeat(data: bytes, starts: list[int]) -> IntArray:
    """The starts that follow while the records repeat with the period of the last ones."""
    lengths = [b - a for a, b in itertools.pairwise(starts)]
    for period in range(1, min(LONGEST_PERIOD, len(lengths) // 2) + 1):
        if lengths[-period:] == lengths[-2 * period : -period]:
            break
    else:
        return np.zeros(0, np.int64)
    end, stride = starts[-1], sum(lengths[-period:])
    turns = (len(data) - end) // stride
    offsets = np.cumsum([0, *lengths[-period:-1]])
    same = turns
    for offset, length in zip(offsets.tolist(), lengths[-period:], strict=True):
        if same == 0:
            break
        stated = np.ndarray((same,), "<u8", data, end + offset + 1, (stride,))
        wrong = stated != length - 9
        same = int(np.argmax(wrong)) if wrong.any() else same
    return (end + stride * np.arange(same)[:, None] + offsets).ravel()


def gather(data: bytes, starts: IntArray, dtype: str) -> NDArray[Any]:
    """The numbers of type `dtype` at the byte offsets `starts`, shape (n,)."""
    size = np.dtype(dtype).itemsize
    return rows(data, starts, size).view(dtype)[:, 0] if starts.size else np.zeros(0, dtype)


def rows(data: bytes, starts: IntArray, size: int) -> NDArray[np.uint8]:
    """The `size` bytes from each of `starts`, shape (n, size), contiguous."""
    steps = np.diff(starts)
    if steps.size and (steps == steps[0]).all():
        return np.ascontiguousarray(np.ndarray((starts.size, size), np.uint8, data, int(starts[0]), (int(steps[0]), 1)))
    if starts.size == 0 or size == 0:
        return np.zeros((starts.size, size), np.uint8)
    anywhere = np.ndarray((len(data) - size + 1,), f"V{size}", data, 0, (1,))  # every offset as the start of a row
    return anywhere[starts].view(np.uint8).reshape(starts.size, size)


def split(data: bytes) -> tuple[dict[int, Table], list[tuple[int, bytes]], int]:
    """(messages by channel id, the other records as (opcode, body), bytes at the end that are no whole record)."""
    starts, end = record_starts(data)
    opcodes = gather(data, starts, "u1")
    others = []
    for start in starts[opcodes != MESSAGE].tolist():
        length = HEAD.unpack_from(data, start)[1]
        others.append((data[start], data[start + 9 : start + 9 + length]))
    starts = starts[opcodes == MESSAGE]
    sizes = gather(data, starts + 1, "<u8").astype(np.int64) - 22
    starts, sizes = starts[sizes >= 0], sizes[sizes >= 0]
    ids = gather(data, starts + 9, "<u2")
    times = np.minimum(gather(data, starts + 15, "<u8"), np.uint64(2**63 - 1)).astype(np.int64)
    tables = {}
    for channel in np.unique(ids).tolist():
        which = ids == channel
        tables[channel] = Table(data, starts[which] + MESSAGE_HEAD_BYTES, sizes[which], times[which])
    return tables, others, len(data) - end
