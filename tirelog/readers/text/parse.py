"""One block of whole lines to arrays.

Pure functions without state, so that several blocks are parsed at once.

    block (bytes) --plain_rows: rows like the layout says, as far as they go--> Parsed
                  --odd_rows: a piece cell by cell, if a row differs--> Parsed
                                and on with the next row

Both give the same values: numbers are rounded to the nearest float64. The second way is the
simplest code, as few rows take it; it says which line and which cell it could not read.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from decimal import Decimal
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.readers.base import Samples, counted_floats
from tirelog.readers.text.columns import Columns
from tirelog.readers.text.kernels import (
    BETWEEN,
    CELL_SPAN,
    COUNT,
    FLOAT,
    GUIDE,
    HARD,
    LARGEST,
    SPAN,
    TICK,
    TICK_PLACES,
    Block,
    bytes_of,
    collapsed,
    parse_rows,
    unquoted,
)
from tirelog.readers.text.layout import LOST_WORDS, Layout
from tirelog.readers.text.times import MISSING, Nanoseconds, column_ns
from tirelog.vocabulary.arrays import FloatArray, IntArray

# ---- What a block of text becomes, and the few steps that both ways of parsing it share.
#
# RowPlan (what to take out of every block) + block --> Parsed (a block's rows as arrays)


_TIMED = re.compile(rb"(?m)^(\d{1,2}[-:]\d{1,2}[-:]\d{1,2}(?:\.\d+)?):[ \t]+")
#: an error code that is not 0, in a cell that may join several
ERROR_CODE = rb"(?:^|[;, |])[ +]*0*[1-9-]"


@dataclass
class Parsed:
    """A block's rows.

    `values[column]` shape (n,), NaN where blank or unreadable (or counts, see `RawBlock`); `stamps`
    shape (n,): int64 ns (MISSING where unreadable) for times, float64 in the column's unit for
    numbers; `number` shape (n,); `errors` shape (n,): error codes that are not 0; `peaks` shape (n,
    most): the list of peaks, NaN behind its end; `counts` shape (n,
    fibres). `bad_rows` and `bad_cells` are (line, what stands there); `lines` were read, blank ones
    too.
    """

    values: dict[int, Samples]
    stamps: Nanoseconds | FloatArray | None = None
    number: FloatArray | None = None
    errors: IntArray | None = None
    peaks: FloatArray | None = None
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
    widest = max((part.peaks.shape[1] for part in parts if part.peaks is not None), default=0)
    for part in parts:
        if part.peaks is not None:
            room = ((0, 0), (0, widest - part.peaks.shape[1]))
            part.peaks = np.pad(part.peaks, room, constant_values=np.nan)
    own: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("stamps", "number", "errors", "peaks", "counts")
        if getattr(first, name) is not None
    }
    return Parsed(
        {
            column: _column([part.values[column] for part in parts], places.get(column))
            for column in first.values
        },
        size=sum(part.size for part in parts),
        bad_rows=[bad for part in parts for bad in part.bad_rows],
        bad_cells=[bad for part in parts for bad in part.bad_cells],
        **own,
    )


def _column(parts: list[Samples], places: int | None) -> Samples:
    counts = all(part.dtype == np.int32 for part in parts)
    return np.concatenate(parts if counts else [counted_floats(part, places) for part in parts])


#: peaks of a row that are read as others are beyond those of the widest row of the sample
_MORE_PEAKS = 8


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

        Up to the last one that is wanted if rows differ in width anyway, else all but a blank one
        at the end.
        """
        columns, layout = self.columns, self.layout
        if not layout.ragged and not columns.peaks:
            return layout.width - (layout.kinds[layout.width - 1] == "blank")
        values = () if layout.ragged else columns.values.values()
        used = (columns.number, columns.time, columns.clock, *values)
        return max((k for k in used if k is not None), default=-1) + 1

    @property
    def across(self) -> int:
        """Columns that are looked at; in a list of peaks there may be more than in other rows."""
        if self.columns.peaks:
            return len(self.layout.kinds) + _MORE_PEAKS
        return max(self._wanted) + 1 if self.layout.ragged else self.layout.width

    @property
    def regular(self) -> bool:
        """True if each column is for one use."""
        wanted, columns = self._wanted, self.columns
        inside = self.layout.ragged or max(wanted, default=0) < self.layout.width
        if columns.peaks:
            inside = max(columns.values.values(), default=-1) < self.peaks_at
        return len(wanted) == len({*wanted}) and inside

    @property
    def fronts(self) -> range:
        """Columns of peak counts."""
        return range(self.layout.counts_at, self.layout.counts_at + self.layout.counts)

    def listed(self, most: int) -> list[int]:
        """Columns of a list of peaks in rows of so many cells, without those of words."""
        if not self.columns.peaks:
            return []
        kinds = self.layout.kinds
        return [
            k
            for k in range(self.peaks_at, most)
            if k >= len(kinds) or kinds[k] in ("number", "blank")
        ]

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


def stamps_ns(
    plan: RowPlan, spans: Callable[[int], tuple[NDArray[np.uint8], IntArray, IntArray]]
) -> Nanoseconds:
    """The stamps of rows, a date plus a time of day if these are two columns.

    `spans` gives bytes, and in these the first ones of a column's cells and those behind them.
    """
    columns = plan.columns
    parts = [
        column_ns(*spans(k), form, plan.us)
        for k, form in ((columns.time, columns.form), (columns.clock, "hms"))
        if k is not None
    ]
    if len(parts) == 1:
        return parts[0]
    date, clock = parts
    return np.where((date == MISSING) | (clock == MISSING), MISSING, date + clock)


def error_counts(cells: list[bytes]) -> IntArray:
    """How many error codes of each cell are not 0."""
    codes = {cell: len(re.findall(ERROR_CODE, cell)) for cell in set(cells)}
    return np.array([codes[cell] for cell in cells], np.int64)


def unreadable(stamps: Nanoseconds | FloatArray) -> NDArray[np.bool_]:
    """True where a stamp could not be read."""
    return np.isnan(stamps) if stamps.dtype == np.float64 else stamps == MISSING


# ---- A block of text row by row.
#
# Rows of any width, and cells that are no numbers, with the line where each stands. A row of
# numbers whose stamp cannot be read keeps its place without one, any other such row is left out;
# one of the wrong width keeps its place with NaN; a cell that is no number is NaN.


def number_of(cell: bytes, decimal: str) -> tuple[float, bool]:
    """(the number in a cell, whether it is neither a number nor a word for a lost one).

    NaN if it is none or infinite.
    """
    text = cell.decode("latin-1").replace(decimal, ".")
    if text.lower() in LOST_WORDS:
        return math.nan, False
    number = math.nan
    with suppress(ValueError):
        number = float(text) if "_" not in text else number
    return (math.nan if math.isinf(number) else number), math.isnan(number)


def odd_rows(plan: RowPlan, line: int, block: Block) -> Parsed:
    """The block, which a newline ends, row by row; `line` is the number of its first line."""
    layout, columns, decimal = plan.layout, plan.columns, plan.layout.decimal
    separator = bytes([between(layout)])
    lines = [
        (number, [cell.strip(b" \r") for cell in text.split(separator)])
        for number, text in enumerate(bytes(block).split(b"\n")[:-1], line)
    ]
    lines = [(number, cells) for number, cells in lines if cells != [b""]]
    stamps = _stamps_of(plan, [cells for _, cells in lines])
    missing = np.zeros(len(lines), bool) if stamps is None else unreadable(stamps)
    out = Parsed({})
    rows, kept = [], []
    for i, (number, cells) in enumerate(lines):
        if missing[i]:
            out.bad_rows.append((number, "no readable time"))
            if not _is_like_rows(plan, cells):
                continue
        loose = layout.ragged or columns.peaks
        wide = len(cells) >= plan.least and (bool(loose) or not any(cells[layout.width :]))
        if not wide and not missing[i]:
            out.bad_rows.append((number, f"not {layout.width} cells"))
        kept.append(i)
        rows.append(cells if wide else [])
        places = [k for k in columns.values.values() if wide and k < len(cells)]
        places += plan.listed(len(cells))
        out.bad_cells += [
            (number, shown(layout, cells[k])) for k in places if number_of(cells[k], decimal)[1]
        ]

    def column(k: int) -> FloatArray:
        cells = (row[k] if k < len(row) else b"" for row in rows)
        return np.array([number_of(cell, decimal)[0] for cell in cells], np.float64)

    out.values = {
        k: without_lost(column(k)) if k in plan.gratings else column(k)
        for k in columns.values.values()
    }
    out.stamps = None if stamps is None else stamps[kept]
    out.number = None if columns.number is None else column(columns.number)
    if (k := columns.errors) is not None:
        out.errors = error_counts([lines[i][1][k] if k < len(lines[i][1]) else b"" for i in kept])
    if columns.peaks:
        rows = [lines[i][1] for i in kept]
        most = max(map(len, rows), default=0)
        peaks = [column(k) for k in plan.listed(most)]
        out.peaks = np.column_stack(peaks) if peaks else np.zeros((len(rows), 0))
        counts = [column(k) for k in plan.fronts]
        out.counts = np.nan_to_num(np.column_stack(counts)).astype(np.int64) if counts else None
    out.size = len(rows)
    return out


def _stamps_of(plan: RowPlan, rows: list[list[bytes]]) -> Nanoseconds | FloatArray | None:
    """The stamps of rows of cells."""
    columns, decimal = plan.columns, plan.layout.decimal
    if columns.time is None:
        return None

    def column(k: int) -> list[bytes]:
        return [row[k] if k < len(row) else b"" for row in rows]

    def spans(k: int) -> tuple[NDArray[np.uint8], IntArray, IntArray]:
        cells = column(k)
        lengths = np.array([len(cell) for cell in cells], np.int64)
        stops = np.cumsum(lengths)
        return bytes_of(b"".join(cells)), stops - lengths, stops

    if columns.form != "number":
        return stamps_ns(plan, spans)
    if not plan.exact:
        return np.array([number_of(cell, decimal)[0] for cell in column(columns.time)], np.float64)
    text = [cell.decode("latin-1").replace(decimal, ".") for cell in column(columns.time)]
    return np.array([_tick(cell, plan.tick_places) for cell in text], np.int64)


def _is_like_rows(plan: RowPlan, cells: list[bytes]) -> bool:
    """True for a row that holds numbers about as the others do, though not in each cell.

    A sample was taken then, whatever became of its stamp: a header or a footer is none.
    """
    layout = plan.layout
    if layout.ragged or plan.columns.peaks or abs(len(cells) - layout.width) > 1:
        return False
    usual = sum(kind == "number" for kind in layout.kinds[: layout.width])
    kinds = [*layout.kinds, *["number"] * len(cells)]
    numbers = sum(
        kind in ("number", "blank") and not math.isnan(number_of(cell, layout.decimal)[0])
        for cell, kind in zip(cells, kinds, strict=False)
    )
    return numbers > 0 and 2 * numbers >= usual


def shown(layout: Layout, cell: bytes) -> str:
    """A cell as a sentence shows it."""
    return repr(cell.decode(layout.encoding, errors="replace")[:40])


def _tick(cell: str, places: int) -> int:
    """A decimal as a count of 10^-places, MISSING if it is none that int64 holds."""
    try:
        value = Decimal(cell).scaleb(places)
        return int(value) if abs(value) <= LARGEST else MISSING
    except (ArithmeticError, ValueError):
        return MISSING


# ---- Rows of a block that are like the layout says, in one compiled pass.
#
# This is the way that nearly all rows of nearly all logs take.
#
#     block, first byte --kernels.rows--> columns of counts, floats, ticks, spans
#                       --flat: cells that take a slower parser; times: stamps-->
#                       Parsed, byte behind
#
# A channel whose column has few decimals comes as int32 counts of 10^-decimals, which a run
# stores as
# they are; it comes as floats if a number of the block is not such a count.


#: rows of one pass, and cells that it may leave to a slower parser
_ROWS, _HARD = 1 << 16, 1 << 15
#: more decimals than this are no counts of int32
_MOST_PLACES = 9


def plain_rows(plan: RowPlan, block: Block, at: int) -> tuple[Parsed, int, bool]:
    """(rows from the byte `at` on, byte behind them, whether a row for the careful way follows).

    A newline ends the block; `plan.regular` is true.  Lines of `bad_cells` count from 0 at `at`.
    """
    table = _Table(plan, block, at)
    while table.too_wide:
        plan.uncounted.update(table.too_wide)
        table = _Table(plan, block, at)
    table.resolve()
    stamps = table.stamps()
    if stamps is not None:
        unread = np.flatnonzero(unreadable(stamps))
        if unread.size:  # the rows before it are good
            table.cut(int(unread[0]))
            stamps = stamps[: table.size]
    return table.parsed(stamps), table.stop, table.stop < len(block) and not table.full


class _Table:
    """What the compiled pass made of the rows of a block: `size` rows, up to the byte `stop`."""

    def __init__(self, plan: RowPlan, block: Block, at: int) -> None:
        self.plan, self.block, self.columns = plan, block, plan.columns
        self.listed = plan.listed(plan.across)
        self.whats, self.slots = self._roles()
        guides = np.zeros(plan.across, GUIDE)
        for k, what in self.whats.items():
            places = plan.tick_places if what == TICK else plan.places.get(k) or 0
            guides[k] = what, self.slots[k], places, k in plan.gratings, False, 0, 0
        data = bytes_of(block)
        lines = min(
            (len(block) - at) // (block.find(b"\n", at) + 1 - at) + 1, _ROWS
        )  # of the first one's length
        counts, floats, ticks, spans = (list(self.whats.values()).count(what) for what in _OUTPUTS)
        self.begins = np.empty(lines, np.int64)
        self.counts, self.floats = np.empty((counts, lines), np.int32), np.empty((floats, lines))
        self.ticks, self.spans = (
            np.empty((ticks, lines), np.int64),
            np.empty((spans, lines), CELL_SPAN),
        )
        hard = np.empty(_HARD + plan.across, HARD)
        self.size, self.stop, used = parse_rows(
            data, at, guides, between(plan.layout), ord(plan.layout.decimal), plan.least,
            plan.layout.ragged and not plan.columns.peaks, self.begins, self.counts, self.floats,
            self.ticks, self.spans, hard,
        )  # fmt: skip
        self.full = used > _HARD or self.size == lines
        if 2 * self.size < lines:  # what is kept must not hold what is not
            self.counts, self.floats = (
                self.counts[:, : self.size].copy(),
                self.floats[:, : self.size].copy(),
            )
            self.ticks, self.spans = (
                self.ticks[:, : self.size].copy(),
                self.spans[:, : self.size].copy(),
            )
        self.hard = hard[:used].copy()
        self.too_wide = {k for k in self.whats if guides["too_wide"][k]}

    def _roles(self) -> tuple[dict[int, int], dict[int, int]]:
        """What to do with each column that is wanted, and its place among those of its kind."""
        whats = {}
        for k in self.columns.values.values():
            places = self.plan.places.get(k)
            whats[k] = (
                COUNT
                if places is not None and places <= _MOST_PLACES and k not in self.plan.uncounted
                else FLOAT
            )
        columns = self.columns
        whats |= {k: SPAN for k in (columns.clock, columns.errors) if k is not None}
        if columns.time is not None:
            number = TICK if self.plan.exact else FLOAT
            whats[columns.time] = number if columns.form == "number" else SPAN
        if columns.number is not None:
            whats[columns.number] = FLOAT
        if columns.peaks:
            whats |= dict.fromkeys([*self.plan.fronts, *self.listed], FLOAT)
        slots = dict.fromkeys(_OUTPUTS, 0)
        places_of = {}
        for k, what in whats.items():
            places_of[k], slots[what] = slots[what], slots[what] + 1
        return whats, places_of

    def resolve(self) -> None:
        """Reads the cells that were left."""
        found = [
            number_of(bytes(self.block[start:stop]), self.plan.layout.decimal)
            for start, stop in self.hard[["first", "stop"]].tolist()
        ]
        self.found = np.array([number for number, _ in found])
        self.unread = np.array([unread for _, unread in found], bool)
        for k, what in self.whats.items() if self.hard.size else ():
            if what == FLOAT:
                mine = self.hard["column"] == k
                self.floats[self.slots[k], self.hard["row"][mine]] = self._lost_of(
                    k, self.found[mine]
                )

    def _lost_of(self, k: int, numbers: FloatArray) -> FloatArray:
        return without_lost(numbers) if k in self.plan.gratings else numbers

    def cut(self, size: int) -> None:
        """Leaves only the first rows; the next one is not good."""
        self.size, self.stop, self.full = size, int(self.begins[size]), False
        kept = self.hard["row"] < size
        self.hard, self.found, self.unread = self.hard[kept], self.found[kept], self.unread[kept]

    def parsed(self, stamps: Nanoseconds | FloatArray | None) -> Parsed:
        columns = self.columns
        out = Parsed(
            {k: self._samples(k) for k in {*columns.values.values()}}, stamps, size=self.size
        )
        if columns.number is not None:
            out.number = self.floats[self.slots[columns.number], : self.size]
        if columns.errors is not None:
            _, starts, stops = self._spans(columns.errors)
            cells = zip(starts.tolist(), stops.tolist(), strict=True)
            out.errors = error_counts([bytes(self.block[a:b]) for a, b in cells])
        if columns.peaks:
            out.peaks = self._floats(self.listed)
            fronts = np.nan_to_num(self._floats(self.plan.fronts)).astype(np.int64)
            out.counts = fronts if self.plan.fronts else None
        for row, column, start, stop in self.hard[self.unread].tolist():
            if column in out.values or column in self.listed:
                out.bad_cells.append((row, shown(self.plan.layout, bytes(self.block[start:stop]))))
        return out

    def _floats(self, columns: Iterable[int]) -> FloatArray:
        """Columns side by side, shape (size, columns)."""
        slots = [self.slots[k] for k in columns]
        return np.ascontiguousarray(self.floats[slots, : self.size].T)

    def _samples(self, k: int) -> Samples:
        """A channel's column."""
        if self.whats[k] == FLOAT:
            return self.floats[self.slots[k], : self.size]
        counts = self.counts[self.slots[k], : self.size]
        mine = self.hard["column"] == k
        if not self.hard.size or not mine.any():
            return counts
        values = counted_floats(counts, self.plan.places[k] or 0)
        values[self.hard["row"][mine]] = self._lost_of(k, self.found[mine])
        return values

    def stamps(self) -> Nanoseconds | FloatArray | None:
        """The time column: float64 in its unit, or int64 ns."""
        columns = self.columns
        if columns.time is None:
            return None
        if columns.form == "number":
            return (self.ticks if self.plan.exact else self.floats)[
                self.slots[columns.time], : self.size
            ]
        return stamps_ns(self.plan, self._spans)

    def _spans(self, k: int) -> tuple[NDArray[np.uint8], IntArray, IntArray]:
        spans = self.spans[self.slots[k], : self.size]
        return bytes_of(self.block), spans["first"], spans["stop"]


_OUTPUTS = (COUNT, FLOAT, TICK, SPAN)


__all__ = ["Parsed", "RowPlan", "parse_block"]


#: bytes that are read carefully at once, from a row on that is unlike the others: more if the
#: next such row follows soon, and at most so many, as cells need much memory
_PIECE_BYTES, _MOST_PIECE_BYTES = 1 << 12, 1 << 18


def parse_block(plan: RowPlan, block: Block) -> Parsed:
    """The rows of one block, whose lines count from 0."""
    if not block.strip():
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
            parts.append(odd_rows(plan, line, block[at:stop]))
            line += block.count(b"\n", at, stop)
            at = stop
    parsed = concatenated_rows(parts, plan.places)
    parsed.lines = line
    return parsed
