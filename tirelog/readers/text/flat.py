"""A block of text cell by cell.

Rows of any width, and cells that are no numbers, with the line where each stands.

    block --kernels.cells--> cells and their numbers
        --here: those that take a slower parser--> rows --> Parsed

A row of numbers whose stamp cannot be read keeps its place without one, any other such row is left
out; one of the wrong width keeps its place with NaN; a cell that is no number is NaN.
"""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from tirelog.readers.base import counted_floats
from tirelog.readers.text.digits import Block, bytes_of
from tirelog.readers.text.kernels import LARGEST, cells, separated
from tirelog.readers.text.layout import LOST_WORDS
from tirelog.readers.text.rows import (
    ERROR_CODE,
    Parsed,
    RowPlan,
    between,
    joined_blocks,
    without_lost,
)
from tirelog.readers.text.times import MISSING, Nanoseconds, column_ns
from tirelog.vocabulary.arrays import FloatArray, IntArray

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
            out.errors = self._errors(rows, columns.errors)
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
            parts = [(columns.time, columns.form), (columns.clock, "hms")]
            return joined_blocks(
                [
                    column_ns(self.data, *self._span(rows, k), form, self.plan.us)
                    for k, form in parts
                    if k is not None
                ]
            )
        if not self.plan.exact:
            return self._column(rows, columns.time, np.ones(rows.size, bool))
        text = [
            self.block[a:b].decode("latin-1").replace(self.plan.layout.decimal, ".")
            for a, b in zip(*self._span(rows, columns.time))
        ]
        return np.array([_tick(cell, self.plan.tick_places) for cell in text], np.int64)

    def _errors(self, rows: IntArray, k: int) -> IntArray:
        cells = [self.block[a:b].decode("latin-1") for a, b in zip(*self._span(rows, k))]
        return np.array([len(re.findall(ERROR_CODE, cell)) for cell in cells], np.int64)

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
