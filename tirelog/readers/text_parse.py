"""One block of whole lines to arrays.  Pure functions without state, so that several blocks are parsed at once.

    block (bytes) --text_table: as wide a table as the layout says--> Parsed
                  --text_flat:  cell by cell, where rows differ or cells are no numbers--> Parsed

Both leave the numbers to the same library, so both give the same values; the table is several times as fast and refuses what it
cannot read, the other way then says which line and which cell it was.
"""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pyarrow as pa

from tirelog.readers.text_flat import flat
from tirelog.readers.text_rows import Parsed, Plan, normalized
from tirelog.readers.text_table import Irregular, table
from tirelog.recording import FloatArray

__all__ = ["Parsed", "Plan", "parse"]


def parse(plan: Plan, line: int, ends: int, block: bytes) -> Parsed:
    """The rows of one block, whose first line has the number `line`, and which has so many line `ends`."""
    lines = ends + (not block.endswith(b"\n"))
    block = normalized(plan.layout, block)
    parsed = None
    if not plan.columns.peaks and not plan.layout.ragged:
        with suppress(Irregular, pa.ArrowInvalid):
            parsed = table(plan, block, lines)
    if parsed is None:
        parsed = flat(plan, line, block)
    for column in plan.gratings:
        parsed.values[column] = _without_lost(parsed.values[column])
    return parsed


def _without_lost(wavelengths: FloatArray) -> FloatArray:
    """Wavelengths with NaN for 0 and -1, by which instruments mark a lost peak."""
    if not wavelengths.size or np.fmin.reduce(wavelengths) > 0.0:
        return wavelengths
    return np.where((wavelengths == 0.0) | (wavelengths == -1.0), np.nan, wavelengths)
