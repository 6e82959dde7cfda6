"""Types of the arrays that are passed around; shapes and units stand with each use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
#: an array of named fields; what they are stands beside the dtype
Records = NDArray[np.void]
#: one element of such an array
Record = np.void


@dataclass(frozen=True)
class ColumnSet:
    """Columns of one length: every field is an array with a row per thing."""

    @classmethod
    def empty(cls, n: int) -> Self:
        """`n` rows, nothing known: all NaN."""
        return cls(**{f.name: np.full(n, np.nan) for f in fields(cls)})

    @classmethod
    def concatenate(cls, parts: Sequence[Self]) -> Self:
        """The rows of all `parts`, one after the other."""
        return cls(
            **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)}
        )

    def take(self, which: Any) -> Self:
        """The rows `which` (mask, slice or ordinals)."""
        return type(self)(**{f.name: getattr(self, f.name)[which] for f in fields(self)})

    def put(self, rows: IntArray, other: Self) -> None:
        """Write the rows of `other` at the ordinals `rows`."""
        for f in fields(self):
            getattr(self, f.name)[rows] = getattr(other, f.name)
