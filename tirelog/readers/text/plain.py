"""Rows of a block that are like the layout says, in one compiled pass.

This is the way that nearly all rows of nearly all logs take.

    block, first byte --kernels.rows--> columns of counts, floats, ticks, spans
                      --flat: cells that take a slower parser; times: stamps-->
                      Parsed, byte behind

A channel whose column has few decimals comes as int32 counts of 10^-decimals, which a run stores as
they are; it comes as floats if a number of the block is not such a count.
"""

from __future__ import annotations

import re

import numpy as np

from tirelog.readers.base import Samples, counted_floats
from tirelog.readers.text.digits import Block, bytes_of
from tirelog.readers.text.flat import cell_numbers
from tirelog.readers.text.kernels import (
    CELL_SPAN,
    COUNT,
    FLOAT,
    GUIDE,
    HARD,
    SPAN,
    TICK,
    parse_rows,
)
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
            out.errors = self._errors(columns.errors)
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
        data = bytes_of(self.block)
        parts = [(columns.time, columns.form), (columns.clock, "hms")]
        return joined_blocks(
            [
                column_ns(data, *self._spans(k), form, self.plan.us)
                for k, form in parts
                if k is not None
            ]
        )

    def _spans(self, k: int) -> tuple[IntArray, IntArray]:
        spans = self.spans[self.slots[k], : self.size]
        return spans["first"], spans["stop"]

    def _errors(self, k: int) -> IntArray:
        """How many error codes of each row are not 0."""
        cells = [
            self.block[a:b].decode("latin-1")
            for a, b in zip(*(edge.tolist() for edge in self._spans(k)))
        ]
        codes = {cell: len(re.findall(ERROR_CODE, cell)) for cell in set(cells)}
        return np.array([codes[cell] for cell in cells], np.int64)


_OUTPUTS = (COUNT, FLOAT, TICK, SPAN)
