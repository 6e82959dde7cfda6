"""Cells one by one, for the few that are not written as plain digits.

Words, extremes, and what is no number at all.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from tirelog.readers.text.digits import Block
from tirelog.readers.text.layout import LOST_WORDS
from tirelog.vocabulary.arrays import FloatArray, IntArray


def cell_numbers(
    block: Block, starts: IntArray, stops: IntArray, decimal: str
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """(each cell as a number, NaN where it is none or infinite; True where it is neither a number
    nor a word for a lost one).
    """
    numbers, unread = np.full(starts.size, np.nan), np.zeros(starts.size, bool)
    for i, (start, stop) in enumerate(zip(starts.tolist(), stops.tolist())):
        cell = block[start:stop].decode("latin-1").replace(decimal, ".")
        if cell.lower() in LOST_WORDS:
            continue
        with suppress(ValueError):
            numbers[i] = float(cell) if "_" not in cell else np.nan
        unread[i] = np.isnan(numbers[i])
        numbers[i] = np.nan if np.isinf(numbers[i]) else numbers[i]
    return numbers, unread
