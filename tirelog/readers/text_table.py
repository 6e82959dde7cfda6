"""A block of text as a table of the layout's width: the fast way, which refuses what is no such table.

block --pyarrow.csv, only the columns that are wanted--> Parsed
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from tirelog.readers.text_rows import ERROR_CODE, Parsed, Plan, floats, joined, read_cells, stripped
from tirelog.readers.text_time import MISSING, Nanoseconds, column_ns
from tirelog.recording import IntArray


class Irregular(Exception):
    """The block is no table of the layout's width that holds numbers where numbers should be."""


def table(plan: Plan, block: bytes, lines: int) -> Parsed:
    """The block of so many lines as a table.  Irregular or ArrowInvalid where it is none."""
    layout, columns = plan.layout, plan.columns
    names = [str(k) for k in range(layout.width)]
    types: dict[str, Any] = {str(k): pa.float64() for k in plan.wanted}
    times = [] if columns.time is None or columns.form == "number" else [c for c in (columns.time, columns.clock) if c is not None]
    types |= {str(k): pa.binary() for k in (*times, columns.errors) if k is not None}
    if plan.exact:
        types[str(columns.time)] = pa.decimal128(38, 9)
    if any(int(name) >= layout.width for name in types):
        raise Irregular
    rows = read_cells(block, layout.separator, layout.decimal, types, names, blank_lines=False)
    if rows.num_rows != lines:
        raise Irregular
    out = Parsed({}, size=rows.num_rows)
    for k in {*columns.values.values()}:
        out.values[k] = floats(rows.column(str(k)))
    if columns.number is not None:
        out.number = floats(rows.column(str(columns.number)))
    if columns.errors is not None:
        out.errors = _codes(rows.column(str(columns.errors)))
    if times:
        stamps = [_times(rows.column(str(k)), plan, "hms" if k == columns.clock else columns.form) for k in times]
        out.stamps = joined(stamps)
        if (out.stamps == MISSING).any():
            raise Irregular
    elif columns.time is not None:
        out.stamps = _ticks(rows.column(str(columns.time))) if plan.exact else floats(rows.column(str(columns.time)))
        if (out.stamps == MISSING).any() if plan.exact else np.isnan(out.stamps).any():
            raise Irregular
    return out


def _ticks(column: pa.ChunkedArray) -> Nanoseconds:
    """Decimals as int64 in units of 1e-9, MISSING where blank."""
    array = column.combine_chunks() if column.num_chunks != 1 else column.chunk(0)
    words = np.frombuffer(array.buffers()[1], np.int64)[2 * array.offset : 2 * (array.offset + len(array)) : 2]
    return np.where(np.asarray(array.is_valid()), words, MISSING)


def _codes(column: pa.ChunkedArray) -> IntArray:
    """How many error codes of each cell are not 0."""
    found = pc.count_substring_regex(column.cast(pa.string()), ERROR_CODE)
    return np.asarray(pc.fill_null(found, 0)).astype(np.int64)


def _times(column: pa.ChunkedArray, plan: Plan, form: str) -> Nanoseconds:
    """Cells of a time column as ns."""
    array = column.combine_chunks() if column.num_chunks != 1 else column.chunk(0)
    if not len(array):
        return np.zeros(0, np.int64)
    offsets = np.frombuffer(array.buffers()[1], np.int32)[array.offset : array.offset + len(array) + 1].astype(np.int64)
    data = np.frombuffer(array.buffers()[2], np.uint8)
    starts, stops = stripped(data, offsets[:-1], offsets[1:])
    return column_ns(data, starts, stops, form, plan.us)
