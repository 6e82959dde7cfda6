"""Types of the arrays that are passed around; shapes and units stand with each use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
#: an array of named fields; what they are is beside the dtype
Records = NDArray[np.void]
#: one element of such an array
Record = np.void


def records(dtype: np.dtype[Any], **columns: Any) -> Records:
    """Rows of a `dtype` out of columns by name, (n,) or numbers; what is not given is 0."""
    rows = np.zeros(np.broadcast(*columns.values()).size, dtype)
    for name, column in columns.items():
        rows[name] = column
    return rows


@dataclass(frozen=True)
class TableRows:
    """Rows that one channel gives a table, by column, and sentences on them."""

    columns: dict[str, Any]
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class ColumnSet:
    """Columns of one length: every field is an array with a row per thing."""

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """The rows of all `parts`, one after the other."""
        return cls(
            **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)}
        )

    def take(self, which: Any) -> Self:
        """The rows `which` (mask, slice or ordinals)."""
        return type(self)(**{f.name: getattr(self, f.name)[which] for f in fields(self)})
