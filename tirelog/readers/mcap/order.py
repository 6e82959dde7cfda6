"""Samples of one clock in the order of their log time.

They are put in order in bounded memory, and handed on as blocks.

    add(keys, stamps, within, values) ...
        --stable sort by key, the older half once the buffer is full--> RawBlock

`key` is the message's log time [ns], by which messages are ordered (equal keys keep the file's
order); `stamp` the time of its first sample [ns]; `within` the sample's number in its batch. A
batch's samples follow its stamp at the period of the rate that setup or message give, or, if
neither does, of the median step between batches.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from tirelog.readers.base import Group, RawBlock
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: values that one group may hold back
HELD_VALUES = 1 << 19


class OrderedGroup:
    """The samples of one group on their way out.

    `period_s` of batches, None if it is to be found from the stamps.
    """

    def __init__(self, group: Group, period_s: float | None) -> None:
        self.group, self.period_s = group, period_s
        self.batched = False
        self.parts: list[tuple[IntArray, IntArray, IntArray, FloatArray]] = []
        self.held = 0
        self.last_key: int | None = None
        self.refused = 0

    def add(self, keys: IntArray, stamps: IntArray, within: IntArray, values: FloatArray) -> None:
        """Takes samples in the file's order.

        `keys`, `stamps`, `within` shape (n,), `values` (n, channels).
        """
        self.parts.append((keys, stamps, within, values))
        self.held += values.size

    @property
    def full(self) -> bool:
        return self.held > HELD_VALUES

    def first_stamp(self) -> int | None:
        """The earliest stamp that is held."""
        return min(
            (int(stamps.min()) for _, stamps, _, _ in self.parts if stamps.size), default=None
        )

    def blocks(self, origin_ns: int, *, everything: bool) -> Iterator[RawBlock]:
        """The older half of what is held (or all of it) as a block."""
        if not self.parts:
            return
        keys, stamps, within, values = (
            np.concatenate(part) for part in zip(*self.parts, strict=True)
        )
        if self.last_key is not None and (late := keys < self.last_key).any():
            self.refused += int(late.sum())
            keys, stamps, within, values = keys[~late], stamps[~late], within[~late], values[~late]
        if (np.diff(keys) < 0).any():
            order = np.argsort(keys, kind="stable")
            keys, stamps, within, values = keys[order], stamps[order], within[order], values[order]
        size = keys.size if everything else keys.size // 2
        self._find_period(stamps, within)
        self.parts = (
            [(keys[size:], stamps[size:], within[size:], values[size:])] if size < keys.size else []
        )
        self.held = values.size - values[:size].size
        if size:
            self.last_key = int(keys[size - 1])
            seconds = (stamps[:size] - origin_ns) * 1e-9
            if self.batched:
                seconds += within[:size] * (self.period_s or 0.0)
            columns = {
                name: np.ascontiguousarray(values[:size, k])
                for k, name in enumerate(self.group.channels)
            }
            yield RawBlock(self.group.name, columns, seconds)

    def _find_period(self, stamps: IntArray, within: IntArray) -> None:
        """The period of a batch's samples from the stamps, if nothing states it."""
        if not self.batched or self.period_s is not None:
            return
        first = np.flatnonzero(within == 0)
        if first.size > 1:
            steps = np.diff(stamps[first]) * 1e-9 / np.diff(first)
            self.period_s = float(np.median(steps))
