"""One block of whole lines to arrays.  Pure functions without state, so that several blocks are parsed at once.

    block (bytes) --text_fixed: a rectangle of bytes, where rows are alike to the byte--> Parsed
                  --text_table: as wide a table as the layout says--> Parsed
                  --text_flat:  cell by cell, where rows differ or cells are no numbers--> Parsed

The later two leave the numbers to the same library and the first rounds as correctly, so all give the same values; each is several times
as fast as the next and refuses what it cannot read, the last then says which line and which cell it was.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress

import numpy as np
import pyarrow as pa

from tirelog.readers.text_fixed import fixed
from tirelog.readers.text_flat import flat
from tirelog.readers.text_rows import Parsed, Plan, concatenated, normalized
from tirelog.readers.text_table import Irregular, table
from tirelog.recording import FloatArray

__all__ = ["Parsed", "Plan", "parse"]


#: a block that is no table is parsed in pieces of this size: most of them are tables, and cells need much memory
_PIECE_BYTES = 1 << 18


def parse(plan: Plan, line: int, ends: int, block: bytes) -> Parsed:
    """The rows of one block, whose first line has the number `line`, and which has so many line `ends`."""
    if block.isspace():
        return Parsed({column: np.zeros(0) for column in plan.columns.values.values()})
    parsed = _as_table(plan, ends, block)
    if parsed is None:
        parsed = concatenated([_piece(plan, line + before, piece) for before, piece in _pieces(block)])
    for column in plan.gratings:
        parsed.values[column] = _without_lost(parsed.values[column])
    return parsed


def _as_table(plan: Plan, ends: int, block: bytes) -> Parsed | None:
    """The block by the fast way, None where that refuses it."""
    if not plan.columns.peaks and not plan.layout.ragged:
        with suppress(Irregular, pa.ArrowInvalid):
            block, lines = normalized(plan.layout, block), ends + (not block.endswith(b"\n"))
            return fixed(plan, block, lines) or table(plan, block, lines)
    return None


def _pieces(block: bytes) -> Iterator[tuple[int, bytes]]:
    """(lines before it, piece of whole lines)."""
    start = lines = 0
    while start < len(block):
        stop = block.find(b"\n", start + _PIECE_BYTES) + 1 or len(block)
        yield lines, block[start:stop]
        lines += block.count(b"\n", start, stop)
        start = stop


def _piece(plan: Plan, line: int, piece: bytes) -> Parsed:
    parsed = _as_table(plan, piece.count(b"\n"), piece)
    return flat(plan, line, normalized(plan.layout, piece)) if parsed is None else parsed


def _without_lost(wavelengths: FloatArray) -> FloatArray:
    """Wavelengths with NaN for 0 and -1, by which instruments mark a lost peak."""
    if not wavelengths.size or np.fmin.reduce(wavelengths) > 0.0:
        return wavelengths
    return np.where((wavelengths == 0.0) | (wavelengths == -1.0), np.nan, wavelengths)
