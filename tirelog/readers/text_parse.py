"""One block of whole lines to arrays.  Pure functions without state, so that several blocks are parsed at once.

    block (bytes) --table(): as wide a table as the layout says--> Parsed
                  --flat():  cell by cell, where rows differ or cells are no numbers--> Parsed

Both hand the text of a number to pyarrow, which rounds correctly, so both give the same values; `table` is about four times as
fast and refuses what it cannot read, `flat` then says which line and which cell it was.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.csv as csv
from numpy.typing import NDArray

from tirelog.readers.sniff import LOST_WORDS, Layout
from tirelog.readers.text_columns import Columns
from tirelog.readers.text_time import MISSING, Nanoseconds, column_ns
from tirelog.recording import FloatArray, IntArray

_NULLS = sorted({*LOST_WORDS, *(w.upper() for w in LOST_WORDS), *(w.capitalize() for w in LOST_WORDS), "NaN", "-NaN", " ", "  "})
_TIMED = re.compile(rb"(?m)^(\d{1,2}[-:]\d{1,2}[-:]\d{1,2}(?:\.\d+)?):[ \t]+")
#: an error code that is not 0, in a cell that joins several
_CODE = r"(?:^|[;, |])[ +]*0*[1-9-]"


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
    first: IntArray | None = None
    cells: FloatArray | None = None
    counts: IntArray | None = None
    size: int = 0
    bad_rows: list[tuple[int, str]] = field(default_factory=list)
    bad_cells: list[tuple[int, str]] = field(default_factory=list)


class Irregular(Exception):
    """The block is no table of the layout's width that holds numbers where numbers should be."""


@dataclass(frozen=True)
class Plan:
    """What to take out of every block: the layout, the columns, and whether dates have the month first (`us`).

    `exact` reads a numeric time column as decimals of 1e-9 units, where float64 would round its stamps; `peaks_at` is the first
    column of a flat list of peaks.
    """

    layout: Layout
    columns: Columns
    us: bool = False
    exact: bool = False
    peaks_at: int = 0

    @property
    def wanted(self) -> list[int]:
        """The columns of numbers."""
        plain = {*self.columns.values.values(), self.columns.number}
        if self.columns.form == "number" and not self.exact:
            plain.add(self.columns.time)
        return sorted(k for k in plain if k is not None)


def parse(plan: Plan, line: int, block: bytes) -> Parsed:
    """The rows of one block, whose first line has this number."""
    block = normalized(plan.layout, block)
    if not plan.columns.peaks and not plan.layout.ragged:
        try:
            return table(plan, block)
        except (Irregular, pa.ArrowInvalid):
            pass
    return flat(plan, line, block)


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


def _csv(block: bytes, separator: str, decimal: str, types: dict[str, Any], names: list[str], blank_lines: bool) -> pa.Table:
    return csv.read_csv(
        pa.py_buffer(block),
        csv.ReadOptions(use_threads=False, column_names=names, block_size=max(len(block) + 1, 1024)),
        csv.ParseOptions(delimiter=separator, quote_char=False, ignore_empty_lines=not blank_lines),
        csv.ConvertOptions(check_utf8=False, column_types=types, include_columns=list(types), null_values=_NULLS, decimal_point=decimal),
    )


def table(plan: Plan, block: bytes) -> Parsed:
    """The block as a table.  Irregular or ArrowInvalid where it is none."""
    layout, columns = plan.layout, plan.columns
    names = [str(k) for k in range(layout.width)]
    types: dict[str, Any] = {str(k): pa.float64() for k in plan.wanted}
    times = [] if columns.time is None or columns.form == "number" else [c for c in (columns.time, columns.clock) if c is not None]
    types |= {str(k): pa.binary() for k in (*times, columns.errors) if k is not None}
    if plan.exact:
        types[str(columns.time)] = pa.decimal128(38, 9)
    if any(int(name) >= layout.width for name in types):
        raise Irregular
    rows = _csv(block, layout.separator, layout.decimal, types, names, blank_lines=False)
    if rows.num_rows != block.count(b"\n") + (not block.endswith(b"\n")):
        raise Irregular
    out = Parsed({}, size=rows.num_rows)
    for k in {*columns.values.values()}:
        out.values[k] = _floats(rows.column(str(k)))
    if columns.number is not None:
        out.number = _floats(rows.column(str(columns.number)))
    if columns.errors is not None:
        out.errors = _codes(rows.column(str(columns.errors)))
    if times:
        stamps = [_times(rows.column(str(k)), plan, "hms" if k == columns.clock else columns.form) for k in times]
        out.stamps = _joined(stamps)
        if (out.stamps == MISSING).any():
            raise Irregular
    elif columns.time is not None:
        out.stamps = _ticks(rows.column(str(columns.time))) if plan.exact else _floats(rows.column(str(columns.time)))
        if plan.exact and (out.stamps == MISSING).any() or not plan.exact and np.isnan(out.stamps).any():
            raise Irregular
    return out


def _joined(stamps: list[Nanoseconds]) -> Nanoseconds:
    """Date plus time of day."""
    if len(stamps) == 1:
        return stamps[0]
    total = stamps[0] + np.where(stamps[1] == MISSING, 0, stamps[1])
    return np.where((stamps[0] == MISSING) | (stamps[1] == MISSING), MISSING, total)


def _floats(column: pa.ChunkedArray) -> FloatArray:
    """Numbers, NaN where blank."""
    array = column.combine_chunks() if column.num_chunks != 1 else column.chunk(0)
    values = np.asarray(array.to_numpy(zero_copy_only=False), dtype=np.float64)
    infinite = np.isinf(values)
    return np.where(infinite, np.nan, values) if infinite.any() else values


def _ticks(column: pa.ChunkedArray) -> Nanoseconds:
    """Decimals as int64 in units of 1e-9, MISSING where blank."""
    array = column.combine_chunks() if column.num_chunks != 1 else column.chunk(0)
    words = np.frombuffer(array.buffers()[1], np.int64)[2 * array.offset : 2 * (array.offset + len(array)) : 2]
    return np.where(np.asarray(array.is_valid()), words, MISSING)


def _codes(column: pa.ChunkedArray) -> IntArray:
    """How many error codes of each cell are not 0."""
    found = pc.count_substring_regex(column.cast(pa.string()), _CODE)
    return np.asarray(pc.fill_null(found, 0)).astype(np.int64)


def _times(column: pa.ChunkedArray, plan: Plan, form: str) -> Nanoseconds:
    """Cells of a time column as ns."""
    array = column.combine_chunks() if column.num_chunks != 1 else column.chunk(0)
    if not len(array):
        return np.zeros(0, np.int64)
    offsets = np.frombuffer(array.buffers()[1], np.int32)[array.offset : array.offset + len(array) + 1].astype(np.int64)
    data = np.frombuffer(array.buffers()[2], np.uint8)
    starts, stops = _stripped(data, offsets[:-1], offsets[1:])
    return column_ns(data, starts, stops, form, plan.us)


def _stripped(data: NDArray[np.uint8], starts: IntArray, stops: IntArray) -> tuple[IntArray, IntArray]:
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


def flat(plan: Plan, line: int, block: bytes) -> Parsed:
    """The block cell by cell: rows of any width, unreadable cells NaN.

    A row whose stamp cannot be read, or which has too few cells to be one, is left out and told; one that only has the wrong
    width keeps its place with NaN.
    """
    layout, columns = plan.layout, plan.columns
    if not block.endswith(b"\n"):
        block += b"\n"
    data = np.frombuffer(block, np.uint8)
    newline = data == 10
    ends = np.flatnonzero(newline | (data == ord(layout.separator)))
    starts, stops = _stripped(data, np.concatenate([[0], ends[:-1] + 1]), ends)
    first = np.concatenate([[0], np.flatnonzero(newline[ends]) + 1])
    numbers, unread = _numbers(plan, block, data, starts, stops, first)
    out = _Rows(plan, line, block, data, starts, stops, first, numbers, unread)
    return out.parsed()


def _numbers(
    plan: Plan, block: bytes, data: NDArray[np.uint8], starts: IntArray, stops: IntArray, first: IntArray
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """(every cell as a number, NaN where it is none; True where it is neither number, blank, nor in a column of text)."""
    text = np.zeros(starts.size, bool)
    for k, kind in enumerate(plan.layout.kinds):
        if kind not in ("number", "blank"):
            at = first[:-1] + k
            text[at[at < first[1:]]] = True
    lines = np.where(data == ord(plan.layout.separator), 10, data).astype(np.uint8)
    covered = np.zeros(data.size + 1, np.int64)
    np.add.at(covered, starts[text], 1)
    np.add.at(covered, stops[text], -1)
    lines[np.cumsum(covered[:-1]) > 0] = ord("0")
    try:
        column = _csv(lines.tobytes(), "\x1f", plan.layout.decimal, {"0": pa.float64()}, ["0"], blank_lines=True).column("0")
        numbers, unread = _floats(column), np.zeros(starts.size, bool)
    except pa.ArrowInvalid:
        numbers, unread = _one_by_one(plan, block, starts, stops, text)
    numbers[text] = np.nan
    return numbers, unread


def _one_by_one(
    plan: Plan, block: bytes, starts: IntArray, stops: IntArray, text: NDArray[np.bool_]
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """The same, each cell by itself."""
    numbers, unread = np.full(starts.size, np.nan), np.zeros(starts.size, bool)
    for i in np.flatnonzero(~text):
        cell = block[starts[i] : stops[i]].decode("latin-1").replace(plan.layout.decimal, ".")
        if cell.lower() in LOST_WORDS:
            continue
        try:
            numbers[i] = float(cell) if "_" not in cell else np.nan
        except ValueError:
            pass
        unread[i] = np.isnan(numbers[i])
        numbers[i] = np.nan if np.isinf(numbers[i]) else numbers[i]
    return numbers, unread


@dataclass
class _Rows:
    """The cells of a block, on their way to columns.  Row i has the cells first[i] to first[i + 1]."""

    plan: Plan
    line: int
    block: bytes
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
            good &= readable
        wide = size >= self._least()
        if not layout.ragged and not columns.peaks:
            wide &= self._as_wide(size)
        self._tell(out.bad_rows, good & ~wide, f"not {layout.width} cells")
        if stamps is None and not columns.peaks:
            pass  # on the sample clock the row keeps its place
        rows = np.flatnonzero(good)
        at = {k: self._column(rows, k, wide) for k in {*columns.values.values(), columns.number} - {None}}
        for k in columns.values.values():
            out.values[k] = at[k]
            self._tell_cells(out.bad_cells, rows, k)
        out.number = None if columns.number is None else at[columns.number]
        out.stamps = None if stamps is None else stamps[rows]
        if columns.errors is not None:
            out.errors = self._errors(rows, columns.errors)
        if columns.peaks:
            self._peaks(out, rows)
        out.size = rows.size
        return out

    def _least(self) -> int:
        used = [*self.plan.columns.values.values(), self.plan.columns.number, self.plan.columns.time, self.plan.columns.clock]
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
        return ~short & (beyond == 0)

    def _column(self, rows: IntArray, k: int, wide: NDArray[np.bool_]) -> FloatArray:
        """Column k of these rows, NaN where the row has no such cell or the wrong width."""
        cell = self.first[rows] + k
        there = (cell < self.first[rows + 1]) & wide[rows]
        return np.where(there, self.numbers[np.minimum(cell, self.numbers.size - 1)], np.nan)

    def _span(self, rows: IntArray, k: int) -> tuple[IntArray, IntArray]:
        """(start, stop) of the cells of column k, empty where a row has none."""
        cell = np.minimum(self.first[rows] + k, self.starts.size - 1)
        there = self.first[rows] + k < self.first[rows + 1]
        return self.starts[cell], np.where(there, self.stops[cell], self.starts[cell])

    def _stamps(self) -> Nanoseconds | FloatArray | None:
        columns = self.plan.columns
        if columns.time is None:
            return None
        rows = np.arange(self.first.size - 1)
        if columns.form != "number":
            parts = [(columns.time, columns.form), (columns.clock, "hms")]
            return _joined([column_ns(self.data, *self._span(rows, k), form, self.plan.us) for k, form in parts if k is not None])
        if not self.plan.exact:
            return self._column(rows, columns.time, np.ones(rows.size, bool))
        text = [self.block[a:b].decode("latin-1").replace(self.plan.layout.decimal, ".") for a, b in zip(*self._span(rows, columns.time))]
        return np.array([_tick(cell) for cell in text], np.int64)

    def _errors(self, rows: IntArray, k: int) -> IntArray:
        cells = [self.block[a:b].decode("latin-1") for a, b in zip(*self._span(rows, k))]
        return np.array([len(re.findall(_CODE, cell)) for cell in cells], np.int64)

    def _peaks(self, out: Parsed, rows: IntArray) -> None:
        """The flat list of peaks behind the other columns, and the counts in front of it."""
        layout = self.plan.layout
        begin = np.minimum(self.first[rows] + self.plan.peaks_at, self.first[rows + 1])
        many = self.first[rows + 1] - begin
        cell = np.repeat(begin - np.concatenate([[0], np.cumsum(many)[:-1]]), many) + np.arange(many.sum())
        out.cells = self.numbers[cell]
        out.first = np.concatenate([[0], np.cumsum(many)])
        if layout.counts:
            fronts = [self._column(rows, layout.counts_at + k, np.ones(self.first.size - 1, bool)) for k in range(layout.counts)]
            out.counts = np.nan_to_num(np.column_stack(fronts)).astype(np.int64)
        bad = np.flatnonzero(self.unread)
        row = np.searchsorted(self.first, bad, side="right") - 1
        for i, r in zip(bad, row):
            out.bad_cells.append((self.line + int(r), self._text(i)))

    def _tell(self, told: list[tuple[int, str]], rows: NDArray[np.bool_], why: str) -> None:
        for i in np.flatnonzero(rows):
            told.append((self.line + int(i), why))

    def _tell_cells(self, told: list[tuple[int, str]], rows: IntArray, k: int) -> None:
        cell = self.first[rows] + k
        bad = np.flatnonzero(self.unread[np.minimum(cell, self.unread.size - 1)] & (cell < self.first[rows + 1]))
        for i in bad:
            told.append((self.line + int(rows[i]), self._text(cell[i])))

    def _text(self, cell: int) -> str:
        shown = self.block[self.starts[cell] : self.stops[cell]].decode(self.plan.layout.encoding, errors="replace")
        return repr(shown[:40])


def _tick(cell: str) -> int:
    """A decimal in units of 1e-9."""
    from decimal import Decimal, InvalidOperation

    try:
        value = Decimal(cell)
        return int(value.scaleb(9)) if value.is_finite() else MISSING
    except (InvalidOperation, ValueError):
        return MISSING
