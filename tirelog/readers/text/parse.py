"""One block of whole lines to arrays.

Pure functions without state, so that several blocks are parsed at once.

    block (bytes) --plain: rows like the layout says, as far as they go--> Parsed
                  --flat:  a piece cell by cell, if rows differ--> Parsed
                                and on with the next row

Both take their numbers from the same compiled scanner, and those that it leaves from the same
slower parser, so that they give the same values; the careful way says which line and which cell it
could not read.
"""

from __future__ import annotations

import numpy as np

from tirelog.readers.text.digits import Block
from tirelog.readers.text.flat import flat
from tirelog.readers.text.plain import plain_rows
from tirelog.readers.text.rows import Parsed, RowPlan, concatenated_rows, normalized

__all__ = ["Parsed", "RowPlan", "parse_block"]


#: bytes that are read carefully at once, from a row on that is unlike the others: more if the
#: next such row follows soon, and at most so many, as cells need much memory
_PIECE_BYTES, _MOST_PIECE_BYTES = 1 << 12, 1 << 18


def parse_block(plan: RowPlan, block: Block) -> Parsed:
    """The rows of one block, whose lines count from 0."""
    if block.isspace():
        return Parsed(
            {column: np.zeros(0) for column in plan.columns.values.values()},
            lines=block.count(b"\n"),
        )
    block = normalized(plan.layout, block)
    parts, line, at, piece, careful = (
        [],
        0,
        0,
        _PIECE_BYTES if plan.regular else _MOST_PIECE_BYTES,
        True,
    )
    while at < len(block):
        if plan.regular:
            begin = at
            parsed, at, careful = plain_rows(plan, block, at)
            parsed.bad_cells = [(line + row, what) for row, what in parsed.bad_cells]
            line += parsed.size
            parts.append(parsed)
            piece = _PIECE_BYTES if at - begin > piece else min(4 * piece, _MOST_PIECE_BYTES)
        if careful and at < len(block):
            stop = block.find(b"\n", at + piece) + 1 or len(block)
            parts.append(flat(plan, line, block[at:stop]))
            line += block.count(b"\n", at, stop)
            at = stop
    parsed = concatenated_rows(parts, plan.places)
    parsed.lines = line
    return parsed
