"""What a block of text becomes, and the few steps that both ways of parsing it share.

    Plan (what to take out of every block) + block --> Parsed (a block's rows as arrays)

Numbers are left to pyarrow, which rounds correctly.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as csv
from numpy.typing import NDArray

from tirelog.readers.sniff import LOST_WORDS, Layout
from tirelog.readers.text_columns import Columns
from tirelog.readers.text_time import MISSING, Nanoseconds
from tirelog.recording import FloatArray, IntArray

_NULLS = sorted({*LOST_WORDS, *(w.upper() for w in LOST_WORDS), *(w.capitalize() for w in LOST_WORDS), "NaN", "-NaN", " ", "  "})
_TIMED = re.compile(rb"(?m)^(\d{1,2}[-:]\d{1,2}[-:]\d{1,2}(?:\.\d+)?):[ \t]+")
#: an error code that is not 0, in a cell that may join several
ERROR_CODE = r"(?:^|[;, |])[ +]*0*[1-9-]"


@dataclass
class Parsed:
    """A block's rows.

    `values[column]` shape (n,), NaN where blank or unreadable; `stamps` shape (n,): int64 ns (MISSING where unreadable) for
    times, float64 in the column's unit for numbers; `number` shape (n,); `errors` shape (n,): error codes that are not 0;
    `first` shape (n + 1,) and `cells`: the peaks of row i are cells[first[i]:first[i + 1]]; `counts` shape (n, fibres).
    `bad_rows` and `bad_cells` are (line, what stands there).
    """

    values: dict[int, FloatArray]
    stamps: Nanoseconds | FloatArray | None = None
    number: FloatArray | None = None
    errors: IntArray | None = None
    first: IntArray = field(default_factory=lambda: np.zeros(1, np.int64))
    cells: FloatArray = field(default_factory=lambda: np.zeros(0))
    counts: IntArray | None = None
    size: int = 0
    bad_rows: list[tuple[int, str]] = field(default_factory=list)
    bad_cells: list[tuple[int, str]] = field(default_factory=list)


def concatenated(parts: list[Parsed]) -> Parsed:
    """The rows of several pieces after one another."""
    first = parts[0]
    starts = np.cumsum([0] + [part.cells.size for part in parts])
    return Parsed(
        {column: np.concatenate([part.values[column] for part in parts]) for column in first.values},
        None if first.stamps is None else np.concatenate([_stamps(part) for part in parts]),
        None if first.number is None else np.concatenate([part.number for part in parts if part.number is not None]),
        None if first.errors is None else np.concatenate([part.errors for part in parts if part.errors is not None]),
        np.concatenate([[0], *(part.first[1:] + start for part, start in zip(parts, starts))]).astype(np.int64),
        np.concatenate([part.cells for part in parts]),
        None if first.counts is None else np.concatenate([part.counts for part in parts if part.counts is not None]),
        sum(part.size for part in parts),
        [bad for part in parts for bad in part.bad_rows],
        [bad for part in parts for bad in part.bad_cells],
    )


def _stamps(part: Parsed) -> Nanoseconds | FloatArray:
    return np.zeros(0) if part.stamps is None else part.stamps


@dataclass(frozen=True)
class Plan:
    """What to take out of every block: the layout, the columns, and whether dates have the month first (`us`).

    `exact` reads a numeric time column as decimals of 1e-9 units, where float64 would round its stamps; `peaks_at` is the first
    column of a flat list of peaks; `gratings` are the columns of wavelengths, where 0 and -1 are lost peaks.
    """

    layout: Layout
    columns: Columns
    us: bool = False
    exact: bool = False
    peaks_at: int = 0
    gratings: tuple[int, ...] = ()

    @property
    def wanted(self) -> list[int]:
        """The columns of numbers."""
        plain = {*self.columns.values.values(), self.columns.number}
        if self.columns.form == "number" and not self.exact:
            plain.add(self.columns.time)
        return sorted(k for k in plain if k is not None)


def normalized(layout: Layout, block: bytes) -> bytes:
    """The block with one byte between cells and without quotes."""
    if b'"' in block:
        block = block.replace(b'"', b"")
    if layout.timed:
        block = _TIMED.sub(rb"\1" + layout.separator.encode(), block)
    if layout.separator == " ":
        block = re.sub(rb"(?m)^[ \t]+|[ \t]+(?=\r?$)", b"", block)
        block = re.sub(rb"[ \t]+", b" ", block)
    return block


def read_cells(block: bytes, separator: str, decimal: str, types: dict[str, Any], names: list[str], blank_lines: bool) -> pa.Table:
    return csv.read_csv(
        pa.py_buffer(block),
        csv.ReadOptions(use_threads=False, column_names=names, block_size=max(len(block) + 1, 1024)),
        csv.ParseOptions(delimiter=separator, quote_char=False, ignore_empty_lines=not blank_lines),
        csv.ConvertOptions(check_utf8=False, column_types=types, include_columns=list(types), null_values=_NULLS, decimal_point=decimal),
    )


def floats(column: pa.ChunkedArray) -> FloatArray:
    """Numbers, NaN where blank."""
    array = column.combine_chunks() if column.num_chunks != 1 else column.chunk(0)
    values = np.asarray(array.to_numpy(zero_copy_only=False), dtype=np.float64)
    infinite = np.isinf(values)
    return np.where(infinite, np.nan, values) if infinite.any() else values


def joined(stamps: list[Nanoseconds]) -> Nanoseconds:
    """Date plus time of day."""
    if len(stamps) == 1:
        return stamps[0]
    total = stamps[0] + np.where(stamps[1] == MISSING, 0, stamps[1])
    return np.where((stamps[0] == MISSING) | (stamps[1] == MISSING), MISSING, total)


def stripped(data: NDArray[np.uint8], starts: IntArray, stops: IntArray) -> tuple[IntArray, IntArray]:
    """Cells without blanks and carriage returns around them."""
    starts, stops = starts.copy(), stops.copy()
    last = data.size - 1
    for edge, step in ((stops, -1), (starts, 1)):
        while True:
            byte = data[np.clip(edge + (step - 1) // 2, 0, last)]
            blank = ((byte == 32) | (byte == 13)) & (stops > starts)
            if not blank.any():
                break
            edge[blank] += step
    return starts, stops
