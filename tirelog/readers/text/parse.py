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

import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from decimal import Decimal
from functools import partial

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
    cells,
    collapsed,
    parse_rows,
    separated,
    unquoted,
)
from tirelog.readers.text.layout import LOST_WORDS, Layout
from tirelog.readers.text.times import MISSING, Nanoseconds, column_ns
from tirelog.vocabulary.arrays import FloatArray, IntArray

# ---- What a block of text becomes, and the few steps that both ways of parsing it share.
#
# Plan (what to take out of every block) + block --> Parsed (a block's rows as arrays)


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


def stamps_ns(
    plan: RowPlan, data: NDArray[np.uint8], span: Callable[[int], tuple[IntArray, IntArray]]
) -> Nanoseconds:
    """The stamps of rows, a date plus a time of day if these are two columns.

    `span` gives the first bytes of a column's cells and the bytes behind them.
    """
    columns = plan.columns
    parts = [
        column_ns(data, *span(k), form, plan.us)
        for k, form in ((columns.time, columns.form), (columns.clock, "hms"))
        if k is not None
    ]
    if len(parts) == 1:
        return parts[0]
    date, clock = parts
    return np.where((date == MISSING) | (clock == MISSING), MISSING, date + clock)


def error_counts(block: Block, starts: IntArray, stops: IntArray) -> IntArray:
    """How many error codes of each cell are not 0."""
    cells = [block[a:b].decode("latin-1") for a, b in zip(starts.tolist(), stops.tolist())]
    codes = {cell: len(re.findall(ERROR_CODE, cell)) for cell in set(cells)}
    return np.array([codes[cell] for cell in cells], np.int64)


# ---- A block of text cell by cell.
#
# Rows of any width, and cells that are no numbers, with the line where each stands.
#
#     block --kernels.cells--> cells and their numbers
#         --here: those that take a slower parser--> rows --> Parsed
#
# A row of numbers whose stamp cannot be read keeps its place without one, any other such row is
# left
# out; one of the wrong width keeps its place with NaN; a cell that is no number is NaN.


# Cells one by one, if they are not plain digits: words, extremes, and what is no number at all.


def cell_numbers(
    block: Block, starts: IntArray, stops: IntArray, decimal: str
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """(each cell as a number, whether it is neither a number nor a word for a lost one).

    NaN if it is none or infinite.
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


def flat(plan: RowPlan, line: int, block: Block) -> Parsed:
    """The block, which a newline ends, cell by cell; `line` is the number of its first line."""
    layout = plan.layout
    data = bytes_of(block)
    text = np.array([kind not in ("number", "blank") for kind in layout.kinds])
    lines, many = block.count(b"\n"), separated(data, between(layout))
    starts, stops, first = (
        np.empty(many, np.int64),
        np.empty(many, np.int64),
        np.empty(lines + 1, np.int64),
    )
    numbers, unread = np.empty(many), np.empty(many, bool)
    cells(
        data,
        between(layout),
        ord(layout.decimal),
        text,
        starts,
        stops,
        first,
        numbers,
        unread,
    )
    hard = np.flatnonzero(unread)
    if hard.size:
        numbers[hard], unread[hard] = cell_numbers(block, starts[hard], stops[hard], layout.decimal)
    out = _Rows(plan, line, block, data, starts, stops, first, numbers, unread).parsed()
    for column in plan.gratings:
        out.values[column] = without_lost(counted_floats(out.values[column], None))
    return out


@dataclass
class _Rows:
    """The cells of a block, on their way to columns.

    Row i has the cells first[i] to first[i + 1].
    """

    plan: RowPlan
    line: int
    block: Block
    data: NDArray[np.uint8]
    starts: IntArray
    stops: IntArray
    first: IntArray
    numbers: FloatArray
    unread: NDArray[np.bool_]

    def parsed(self) -> Parsed:
        layout, columns = self.plan.layout, self.plan.columns
        size = np.diff(self.first)
        empty = (size == 1) & (self.starts[self.first[:-1]] == self.stops[self.first[:-1]])
        good = ~empty
        out = Parsed({})
        stamps = self._stamps()
        if stamps is not None:
            readable = ~np.isnan(stamps) if stamps.dtype == np.float64 else stamps != MISSING
            self._tell(out.bad_rows, good & ~readable, "no readable time")
            good &= readable | self._like_rows(size)
        wide = size >= self._least()
        if not layout.ragged and not columns.peaks:
            wide &= self._as_wide(size)
        told = good & ~wide if stamps is None else good & ~wide & readable
        self._tell(out.bad_rows, told, f"not {layout.width} cells")
        rows = np.flatnonzero(good)
        at = {
            k: self._column(rows, k, wide)
            for k in {*columns.values.values(), columns.number}
            if k is not None
        }
        for k in columns.values.values():
            out.values[k] = at[k]
            self._tell_cells(out.bad_cells, rows[wide[rows]], k)
        out.number = None if columns.number is None else at[columns.number]
        out.stamps = None if stamps is None else stamps[rows]
        if columns.errors is not None:
            out.errors = error_counts(self.block, *self._span(rows, columns.errors))
        if columns.peaks:
            self._peaks(out, rows)
        out.size = rows.size
        return out

    def _like_rows(self, size: IntArray) -> NDArray[np.bool_]:
        """True for rows that hold numbers about as the others do, though not in each cell.

        A sample was taken then, whatever became of its stamp: a header or a footer is none.
        """
        layout = self.plan.layout
        if layout.ragged or self.plan.columns.peaks:
            return np.zeros(size.size, bool)
        until = np.concatenate([[0], np.cumsum(~np.isnan(self.numbers))])
        numbers = until[self.first[1:]] - until[self.first[:-1]]
        usual = sum(kind == "number" for kind in layout.kinds[: layout.width])
        like: NDArray[np.bool_] = (
            (np.abs(size - layout.width) < 2) & (numbers > 0) & (2 * numbers >= usual)
        )
        return like

    def _least(self) -> int:
        """Cells that a row needs.

        Up to its stamp if rows differ in width anyway, else up to the last column that is wanted.
        """
        columns = self.plan.columns
        used = [
            columns.number,
            columns.time,
            columns.clock,
            *([] if self.plan.layout.ragged else columns.values.values()),
        ]
        return max((k for k in used if k is not None), default=-1) + 1

    def _as_wide(self, size: IntArray) -> NDArray[np.bool_]:
        """True for rows of the layout's width, but for blank cells at the end."""
        width = self.plan.layout.width
        blank = self.starts == self.stops
        until = np.concatenate([[0], np.cumsum(~blank)])
        beyond = until[self.first[1:]] - until[np.minimum(self.first[:-1] + width, self.first[1:])]
        short = size < width
        if self.plan.layout.kinds[width - 1] == "blank":
            short = size < width - 1
        short_rows: NDArray[np.bool_] = ~short & (beyond == 0)
        return short_rows

    def _column(self, rows: IntArray, k: int, wide: NDArray[np.bool_]) -> FloatArray:
        """Column k of these rows, NaN if the row has no such cell or the wrong width."""
        cell = self.first[rows] + k
        there = (cell < self.first[rows + 1]) & wide[rows]
        return np.where(there, self.numbers[np.minimum(cell, self.numbers.size - 1)], np.nan)

    def _span(self, rows: IntArray, k: int) -> tuple[IntArray, IntArray]:
        """(start, stop) of the cells of column k, empty if a row has none."""
        cell = np.minimum(self.first[rows] + k, self.starts.size - 1)
        there = self.first[rows] + k < self.first[rows + 1]
        return self.starts[cell], np.where(there, self.stops[cell], self.starts[cell])

    def _stamps(self) -> Nanoseconds | FloatArray | None:
        columns = self.plan.columns
        if columns.time is None:
            return None
        rows = np.arange(self.first.size - 1)
        if columns.form != "number":
            return stamps_ns(self.plan, self.data, partial(self._span, rows))
        if not self.plan.exact:
            return self._column(rows, columns.time, np.ones(rows.size, bool))
        text = [
            self.block[a:b].decode("latin-1").replace(self.plan.layout.decimal, ".")
            for a, b in zip(*self._span(rows, columns.time))
        ]
        return np.array([_tick(cell, self.plan.tick_places) for cell in text], np.int64)

    def _peaks(self, out: Parsed, rows: IntArray) -> None:
        """The flat list of peaks behind the other columns, and the counts in front of it."""
        layout = self.plan.layout
        begin = np.minimum(self.first[rows] + self.plan.peaks_at, self.first[rows + 1])
        many = self.first[rows + 1] - begin
        cell = np.repeat(begin - np.concatenate([[0], np.cumsum(many)[:-1]]), many) + np.arange(
            many.sum()
        )
        out.cells = self.numbers[cell]
        out.first = np.concatenate([[0], np.cumsum(many)])
        if layout.counts:
            fronts = [
                self._column(rows, layout.counts_at + k, np.ones(self.first.size - 1, bool))
                for k in range(layout.counts)
            ]
            out.counts = np.nan_to_num(np.column_stack(fronts)).astype(np.int64)
        bad = np.flatnonzero(self.unread)
        row = np.searchsorted(self.first, bad, side="right") - 1
        for i, r in zip(bad.tolist(), row.tolist()):
            out.bad_cells.append((self.line + r, self._text(i)))

    def _tell(self, told: list[tuple[int, str]], rows: NDArray[np.bool_], why: str) -> None:
        for i in np.flatnonzero(rows):
            told.append((self.line + int(i), why))

    def _tell_cells(self, told: list[tuple[int, str]], rows: IntArray, k: int) -> None:
        cell = self.first[rows] + k
        bad = np.flatnonzero(
            self.unread[np.minimum(cell, self.unread.size - 1)] & (cell < self.first[rows + 1])
        )
        for i in bad:
            told.append((self.line + int(rows[i]), self._text(int(cell[i]))))

    def _text(self, cell: int) -> str:
        shown = self.block[self.starts[cell] : self.stops[cell]].decode(
            self.plan.layout.encoding, errors="replace"
        )
        return repr(shown[:40])


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
        unread = np.flatnonzero(
            np.isnan(stamps) if stamps.dtype == np.float64 else stamps == MISSING
        )
        if unread.size:  # the rows before it are good
            table.cut(int(unread[0]))
            stamps = stamps[: table.size]
    return table.parsed(stamps), table.stop, table.stop < len(block) and not table.full


class _Table:
    """What the compiled pass made of the rows of a block: `size` rows, up to the byte `stop`."""

    def __init__(self, plan: RowPlan, block: Block, at: int) -> None:
        self.plan, self.block, self.columns = plan, block, plan.columns
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
            plan.layout.ragged, self.begins, self.counts, self.floats, self.ticks, self.spans, hard,
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
        slots = dict.fromkeys(_OUTPUTS, 0)
        places_of = {}
        for k, what in whats.items():
            places_of[k], slots[what] = slots[what], slots[what] + 1
        return whats, places_of

    def resolve(self) -> None:
        """Reads the cells that were left."""
        self.found, self.unread = cell_numbers(
            self.block, self.hard["first"], self.hard["stop"], self.plan.layout.decimal
        )
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
            out.errors = error_counts(self.block, *self._spans(columns.errors))
        for row, column, start, stop in self.hard[self.unread].tolist():
            if column in out.values:
                out.bad_cells.append(
                    (
                        row,
                        repr(
                            self.block[start:stop].decode(
                                self.plan.layout.encoding, errors="replace"
                            )[:40]
                        ),
                    )
                )
        return out

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
        return stamps_ns(self.plan, bytes_of(self.block), self._spans)

    def _spans(self, k: int) -> tuple[IntArray, IntArray]:
        spans = self.spans[self.slots[k], : self.size]
        return spans["first"], spans["stop"]


_OUTPUTS = (COUNT, FLOAT, TICK, SPAN)


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
