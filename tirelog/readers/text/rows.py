"""What a block of text becomes, and the few steps that both ways of parsing it share.

Plan (what to take out of every block) + block --> Parsed (a block's rows as arrays)
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from tirelog.readers.base import Samples, counted_floats
from tirelog.readers.text.columns import Columns
from tirelog.readers.text.digits import Block, bytes_of
from tirelog.readers.text.kernels import BETWEEN, TICK_PLACES, collapsed, unquoted
from tirelog.readers.text.layout import Layout
from tirelog.readers.text.times import MISSING, Nanoseconds
from tirelog.vocabulary.arrays import FloatArray, IntArray

_TIMED = re.compile(rb"(?m)^(\d{1,2}[-:]\d{1,2}[-:]\d{1,2}(?:\.\d+)?):[ \t]+")
#: an error code that is not 0, in a cell that may join several
ERROR_CODE = r"(?:^|[;, |])[ +]*0*[1-9-]"


@dataclass
class Parsed:
    """A block's rows.

    `values[column]` shape (n,), NaN where blank or unreadable (or counts, see `RawBlock`); `stamps`
    shape (n,): int64 ns (MISSING where unreadable) for times, float64 in the column's unit for
    numbers; `number` shape (n,); `errors` shape (n,): error codes that are not 0; `first` shape (n
    + 1,) and `cells`: the peaks of row i are cells[first[i]:first[i + 1]]; `counts` shape (n,
    fibres). `bad_rows` and `bad_cells` are (line, what stands there); `lines` were read, blank ones
    too.
    """

    values: dict[int, Samples]
    stamps: Nanoseconds | FloatArray | None = None
    number: FloatArray | None = None
    errors: IntArray | None = None
    first: IntArray = field(default_factory=lambda: np.zeros(1, np.int64))
    cells: FloatArray = field(default_factory=lambda: np.zeros(0))
    counts: IntArray | None = None
    size: int = 0
    lines: int = 0
    bad_rows: list[tuple[int, str]] = field(default_factory=list)
    bad_cells: list[tuple[int, str]] = field(default_factory=list)


def concatenated_rows(parts: list[Parsed], places: Mapping[int, int | None]) -> Parsed:
    """The rows of several pieces after one another.

    A column of which a piece is no counts is all floats.
    """
    first = parts[0]
    if len(parts) == 1:
        return first
    starts = np.cumsum([0] + [part.cells.size for part in parts])
    return Parsed(
        {
            column: _column([part.values[column] for part in parts], places.get(column))
            for column in first.values
        },
        None if first.stamps is None else np.concatenate([_stamps(part) for part in parts]),
        None
        if first.number is None
        else np.concatenate([part.number for part in parts if part.number is not None]),
        None
        if first.errors is None
        else np.concatenate([part.errors for part in parts if part.errors is not None]),
        np.concatenate(
            [[0], *(part.first[1:] + start for part, start in zip(parts, starts))]
        ).astype(np.int64),
        np.concatenate([part.cells for part in parts]),
        None
        if first.counts is None
        else np.concatenate([part.counts for part in parts if part.counts is not None]),
        sum(part.size for part in parts),
        bad_rows=[bad for part in parts for bad in part.bad_rows],
        bad_cells=[bad for part in parts for bad in part.bad_cells],
    )


def _column(parts: list[Samples], places: int | None) -> Samples:
    counts = all(part.dtype == np.int32 for part in parts)
    return np.concatenate(parts if counts else [counted_floats(part, places) for part in parts])


def _stamps(part: Parsed) -> Nanoseconds | FloatArray:
    return np.zeros(0) if part.stamps is None else part.stamps


@dataclass(frozen=True)
class RowPlan:
    """What to take out of every block.

    The layout, the columns, and whether dates have the month first (`us`).

    `exact` reads a numeric time column as whole numbers of `tick_places` decimals, if float64 would
    round its stamps; `peaks_at` is the first column of a flat list of peaks; `gratings` are the
    columns of wavelengths, in which 0 and -1 are lost peaks; `places` are the decimals of the
    channels' columns (None: written with exponents). `uncounted` grows: columns that held numbers
    which no count can hold; it saves work, and the numbers are the same without.
    """

    layout: Layout
    columns: Columns
    us: bool = False
    exact: bool = False
    peaks_at: int = 0
    gratings: tuple[int, ...] = ()
    places: Mapping[int, int | None] = field(default_factory=dict)
    uncounted: set[int] = field(default_factory=set)
    tick_places: int = TICK_PLACES

    @property
    def least(self) -> int:
        """Cells that a row needs.

        Up to its stamp if rows differ in width anyway, else all but a blank one at the end.
        """
        columns, layout = self.columns, self.layout
        if not layout.ragged:
            return layout.width - (layout.kinds[layout.width - 1] == "blank")
        return (
            max(
                (k for k in (columns.number, columns.time, columns.clock) if k is not None),
                default=-1,
            )
            + 1
        )

    @property
    def across(self) -> int:
        """Columns that are looked at."""
        return max(self._wanted) + 1 if self.layout.ragged else self.layout.width

    @property
    def regular(self) -> bool:
        """True if columns, not lists of peaks, make up a row, each for one use."""
        wanted = self._wanted
        return (
            not self.columns.peaks
            and len(wanted) == len({*wanted})
            and (self.layout.ragged or max(wanted) < self.layout.width)
        )

    @property
    def _wanted(self) -> list[int]:
        columns = self.columns
        more = [columns.time, columns.clock, columns.number, columns.errors]
        return [*{*columns.values.values()}, *(k for k in more if k is not None)]


def normalized(layout: Layout, block: Block) -> Block:
    """The block with `between(layout)` between cells and without quotes.

    A newline stands behind its last row.
    """
    quote = layout.quote.encode()
    if layout.enclosed:
        data = bytes_of(block)
        out = np.empty(data.size, np.uint8)
        block = out[: unquoted(data, ord(quote), ord(layout.separator), out)].tobytes()
    elif quote in block:
        block = block.translate(None, quote)
    if layout.timed:
        block = _TIMED.sub(rb"\1" + bytes([between(layout)]), block)
    if not block.endswith(b"\n"):
        block += b"\n"
    if layout.separator == " ":
        data = bytes_of(block)
        out = np.empty(data.size, np.uint8)
        block = out[: collapsed(data, out)].tobytes()
    return block


def between(layout: Layout) -> int:
    """The byte between the cells of a normalized block."""
    return BETWEEN if layout.enclosed else ord(layout.separator)


def without_lost(wavelengths: FloatArray) -> FloatArray:
    """Wavelengths with NaN for 0 and -1, by which instruments mark a lost peak."""
    if not wavelengths.size or np.fmin.reduce(wavelengths) > 0.0:
        return wavelengths
    return np.where((wavelengths == 0.0) | (wavelengths == -1.0), np.nan, wavelengths)


def joined_blocks(stamps: list[Nanoseconds]) -> Nanoseconds:
    """Date plus time of day."""
    if len(stamps) == 1:
        return stamps[0]
    total = stamps[0] + np.where(stamps[1] == MISSING, 0, stamps[1])
    return np.where((stamps[0] == MISSING) | (stamps[1] == MISSING), MISSING, total)
