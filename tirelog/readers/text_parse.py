"""One block of whole lines to arrays.  Pure functions without state, so that several blocks are parsed at once.

    block (bytes) --text_table: as wide a table as the layout says--> Parsed
                  --text_flat:  cell by cell, where rows differ or cells are no numbers--> Parsed

Both leave the numbers to the same library, so both give the same values; the table is several times as fast and refuses what it
cannot read, the other way then says which line and which cell it was.
"""

from __future__ import annotations

from contextlib import suppress

import pyarrow as pa

from tirelog.readers.text_flat import flat
from tirelog.readers.text_rows import Parsed, Plan, normalized
from tirelog.readers.text_table import Irregular, table

__all__ = ["Parsed", "Plan", "parse"]


def parse(plan: Plan, line: int, block: bytes) -> Parsed:
    """The rows of one block, whose first line has this number."""
    block = normalized(plan.layout, block)
    if not plan.columns.peaks and not plan.layout.ragged:
        with suppress(Irregular, pa.ArrowInvalid):
            return table(plan, block)
    return flat(plan, line, block)
