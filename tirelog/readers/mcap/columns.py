"""Numbers that the messages of one topic hold for one channel."""

from __future__ import annotations

from dataclasses import dataclass

from tirelog.vocabulary.arrays import FloatArray, IntArray


@dataclass(frozen=True)
class FieldColumn:
    """Numbers for one want.

    `lengths` shape (n,) if each message holds a batch; `values` are then the batches end to end.
    """

    values: FloatArray
    lengths: IntArray | None = None
