"""Stored counts to values in SI, in one pass: numpy takes four, with an array for each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray


@compiled
def si_of_counts(
    counts: NDArray[np.int32], scale: float, offset: float, lost: int, values: FloatArray
) -> None:
    """Fills `values` (n,) with counts x scale + offset, NaN where a count is `lost`.

    `scale` and `offset` in the channel's SI unit.
    """
    for i in range(counts.size):
        values[i] = np.nan if counts[i] == lost else counts[i] * scale + offset
