"""One block of whole lines to arrays.

Pure functions without state, so that several blocks are parsed at once.

    block (bytes) --plain_rows: pyarrow, if all rows are like the layout says--> Parsed
                  --its halves, if one is not, down to a piece
                    --odd_rows: cell by cell--> Parsed

Both give the same values: numbers are rounded to the nearest float64. The second way is the
simplest code, as few rows take it; it says which line and which cell it could not read.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from decimal import Decimal
from functools import cached_property
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow.csv import ConvertOptions, ParseOptions, ReadOptions, read_csv

from tirelog.readers.text.columns import Columns
from tirelog.readers.text.layout import LOST_WORDS, Layout, split_cells, ungrouped
from tirelog.readers.text.times import MISSING, Nanoseconds, bytes_of, column_ns
from tirelog.vocabulary.arrays import FloatArray, IntArray

# ---- What a block of text becomes, and the few steps that both ways of parsing it share.
#
# RowPlan (what to take out of every block) + block --> Parsed (a block's rows as arrays)


#: what is between cells in place of a separator that quoted cells hold, too: the unit separator
BETWEEN = "\x1f"
#: most decimals of a tick, an int64 count
TICK_PLACES = 9
LARGEST = np.iinfo(np.int64).max
_TIMED = re.compile(rb"(?m)^(\d{1,2}[-:]\d{1,2}[-:]\d{1,2}(?:\.\d+)?):[ \t]+")
#: an error code that is not 0, in a cell that may join several
ERROR_CODE = rb"(?:^|[;, |])[ +]*0*[1-9-]"


@dataclass
class Parsed:
    """A block's rows.

    `values[column]` shape (n,), NaN where blank or unreadable; `stamps` shape (n,): int64 ns
    (MISSING where unreadable) for times, float64 in the column's unit for numbers; `number` shape
    (n,); `errors` shape (n,): error codes that are not 0; `peaks` shape (n, most): the list of
    peaks, NaN behind its end; `counts` shape (n, fibres). `bad_rows` are (line, what is wrong) and
    `bad_cells` (line, cell as shown); `lines` were read, blank ones too.
    """

    values: dict[int, FloatArray]
    stamps: Nanoseconds | FloatArray | None = None
    number: FloatArray | None = None
    errors: IntArray | None = None
    peaks: FloatArray | None = None
    counts: IntArray | None = None
    size: int = 0
    lines: int = 0
    bad_rows: list[tuple[int, str]] = field(default_factory=list)
    bad_cells: list[tuple[int, str]] = field(default_factory=list)


def concatenated_rows(parts: list[Parsed]) -> Parsed:
    """The rows of several pieces after one another."""
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
        {k: np.concatenate([part.values[k] for part in parts]) for k in first.values},
        size=sum(part.size for part in parts),
        bad_rows=[bad for part in parts for bad in part.bad_rows],
        bad_cells=[bad for part in parts for bad in part.bad_cells],
        **own,
    )


@dataclass(frozen=True)
class RowPlan:
    """What to take out of every block.

    The layout, the columns, and whether dates have the month first (`us`).

    `exact` reads a numeric time column as whole numbers of `tick_places` decimals, if float64 would
    round its stamps; `peaks_at` is the first column of a flat list of peaks.
    """

    layout: Layout
    columns: Columns
    us: bool = False
    exact: bool = False
    peaks_at: int = 0
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
        """Columns that are looked at; in a list of peaks those of the widest row of the sample."""
        if self.columns.peaks:
            return len(self.layout.kinds)
        return max(self._wanted) + 1 if self.layout.ragged else self.layout.width

    @property
    def regular(self) -> bool:
        """True if each column is for one use."""
        wanted, columns = self._wanted, self.columns
        inside = self.layout.ragged or max(wanted, default=0) < self.layout.width
        if columns.peaks:
            inside = max(columns.values.values(), default=-1) < self.peaks_at
        return len(wanted) == len({*wanted}) and inside

    @cached_property
    def types(self) -> dict[int, pa.DataType]:
        """What is made of each column that is wanted: floats, counts of ticks, bytes."""
        columns, count = self.columns, pa.decimal128(19, self.tick_places)
        types = dict.fromkeys(columns.values.values(), pa.float64())
        types |= {k: pa.binary() for k in (columns.clock, columns.errors) if k is not None}
        if columns.time is not None:
            number = count if self.exact else pa.float64()
            types[columns.time] = number if columns.form == "number" else pa.binary()
        if columns.number is not None:
            types[columns.number] = pa.float64()
        if columns.peaks:
            types |= dict.fromkeys([*self.fronts, *self.listed(self.across)], pa.float64())
        return types

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


def between(layout: Layout) -> str:
    """What is between the cells of a normalized block."""
    return BETWEEN if layout.enclosed else layout.separator


def normalized(layout: Layout, block: bytes) -> bytes:
    """The block with `between(layout)` between cells, without quotes and blanks around them.

    Its last row ends with a newline.
    """
    separator = between(layout).encode()
    if layout.grouping:
        text = block.decode(layout.encoding, errors="surrogateescape")
        text = ungrouped(text, *layout.grouping)
        block = text.encode(layout.encoding, errors="surrogateescape")
    if layout.enclosed:
        block = unquoted(layout, block)
    elif layout.quote.encode() in block:
        block = block.translate(None, layout.quote.encode())
    if layout.timed:
        block = _TIMED.sub(rb"\1" + separator, block)
    if not block.endswith(b"\n"):
        block += b"\n"
    if layout.separator == " ":
        return single_blanks(block)
    around = (b" " + separator, separator + b" ", b"\n ")
    if b" " in block and any(pair in block for pair in around):
        block = re.sub(rb" *([\r\n" + re.escape(separator) + rb"]) *", rb"\1", block)
    return block


def unquoted(layout: Layout, block: bytes) -> bytes:
    """A block whose cells hold separators within quotes, with BETWEEN between them."""
    lines = block.decode("latin-1").split("\n")
    rows = list[list[str]]()
    with suppress(csv.Error):
        read = csv.reader(
            lines, delimiter=layout.separator, quotechar=layout.quote, skipinitialspace=True
        )
        rows = list(read)
    if len(rows) != len(lines):  # quotes that do not end with their line
        alike = (line.replace(layout.quote, '"') for line in lines)
        rows = [split_cells(line, layout.separator) for line in alike]
    return "\n".join(map(BETWEEN.join, rows)).encode("latin-1")


def single_blanks(block: bytes) -> bytes:
    """A block, which a newline ends, with one blank for each run of blanks and tabs.

    At the ends of lines there is none.
    """
    block = block.replace(b"\t", b" ")
    while b"  " in block:
        block = block.replace(b"  ", b" ")
    block = block.replace(b" \r\n", b"\r\n").replace(b" \n", b"\n")
    return block.replace(b"\n ", b"\n").removeprefix(b" ")


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


def taken_out(
    plan: RowPlan,
    numbers: Callable[[int], FloatArray],
    texts: Callable[[int], list[bytes]],
    listed: list[int],
    size: int,
) -> Parsed:
    """What the plan takes out of `size` rows, but their stamps.

    By their columns of `numbers` and of `texts`; `listed` are those of a list of peaks.
    """
    columns = plan.columns
    out = Parsed({k: numbers(k) for k in columns.values.values()}, size=size)
    if columns.number is not None:
        out.number = numbers(columns.number)
    if columns.errors is not None:
        out.errors = error_counts(texts(columns.errors))
    if columns.peaks:
        out.peaks = np.reshape([numbers(k) for k in listed], (len(listed), size)).T
        fronts = [numbers(k) for k in plan.fronts]
        out.counts = np.nan_to_num(np.column_stack(fronts)).astype(np.int64) if fronts else None
    return out


def unreadable(stamps: Nanoseconds | FloatArray) -> NDArray[np.bool_]:
    """True where a stamp could not be read."""
    return np.isnan(stamps) if stamps.dtype == np.float64 else stamps == MISSING


# ---- A block of text row by row.
#
# Rows of any width, and cells that are no numbers, with the line of each. A row of
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


def odd_rows(plan: RowPlan, line: int, block: bytes) -> Parsed:
    """The block, which a newline ends, row by row; `line` is the number of its first line."""
    layout, columns, decimal = plan.layout, plan.columns, plan.layout.decimal
    separator = between(layout).encode()
    lines = [
        (number, [cell.strip(b" \r") for cell in text.split(separator)])
        for number, text in enumerate(block.split(b"\n")[:-1], line)
        if text.strip(b" \r")  # blank lines by the million cost no lists of cells
    ]
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

    def texts(k: int) -> list[bytes]:
        return [lines[i][1][k] if k < len(lines[i][1]) else b"" for i in kept]

    most = max(map(len, rows), default=0)
    taken = taken_out(plan, column, texts, plan.listed(most), len(rows))
    stamps = None if stamps is None else stamps[kept]
    return replace(taken, stamps=stamps, bad_rows=out.bad_rows, bad_cells=out.bad_cells)


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


# ---- Rows of a block that are like the layout says, by pyarrow's reader of CSV.
#
# This is the way that nearly all rows of nearly all logs take.
#
#     block --padded--> rows of one width --pyarrow--> columns of floats, ticks, bytes
#                                         --times: stamps--> Parsed


#: words for a lost number in the spellings that are looked for; others are read cell by cell
_LOST = [spelt(word) for word in LOST_WORDS for spelt in (str, str.upper, str.capitalize)]


def plain_rows(plan: RowPlan, block: bytes) -> Parsed:
    """The rows of a normalized block.  ValueError: one is not like the layout says."""
    layout, columns = plan.layout, plan.columns
    table = read_csv(
        pa.BufferReader(_padded(plan, block)),
        ReadOptions(
            use_threads=False,
            block_size=2 * len(block) + 1024,
            column_names=[str(k) for k in range(plan.across)],
        ),
        ParseOptions(delimiter=between(layout), quote_char=False),
        ConvertOptions(
            column_types={str(k): kind for k, kind in plan.types.items()},
            include_columns=[str(k) for k in plan.types],
            null_values=_LOST,
            decimal_point=layout.decimal,
            check_utf8=False,
        ),
    )

    def numbers(k: int) -> FloatArray:
        valid, stored = table[str(k)].combine_chunks().buffers()
        found = np.frombuffer(stored, np.float64, table.num_rows)
        if np.isinf(found).any():
            raise ValueError("a number that is none")
        if valid is None:
            return found
        known = np.unpackbits(bytes_of(valid), count=table.num_rows, bitorder="little")
        return np.where(known, found, np.nan)

    def cells(k: int) -> tuple[NDArray[np.uint8], IntArray, IntArray]:
        _, offsets, data = table[str(k)].combine_chunks().buffers()
        places = np.frombuffer(offsets, np.int32, table.num_rows + 1).astype(np.int64)
        return bytes_of(data or b""), places[:-1], places[1:]

    def texts(k: int) -> list[bytes]:
        found: list[bytes] = table[str(k)].to_pylist()
        return found

    stamps: Nanoseconds | FloatArray | None = None
    if columns.time is not None and columns.form != "number":
        stamps = stamps_ns(plan, cells)
    elif columns.time is not None:
        stamps = _ticks(table[str(columns.time)]) if plan.exact else numbers(columns.time)
    if stamps is not None and unreadable(stamps).any():
        raise ValueError("no readable time")
    out = taken_out(plan, numbers, texts, plan.listed(plan.across), table.num_rows)
    out.stamps = stamps
    return out


def _padded(plan: RowPlan, block: bytes) -> bytes:
    """The block with rows of as many cells as are looked at, if not all of them have so many.

    ValueError: a row lacks cells that are wanted, or has more than the layout allows.
    """
    if plan.least == plan.across and not plan.layout.ragged:
        return block
    separator, rows = between(plan.layout).encode(), []
    for line in block.split(b"\n"):
        line = line.rstrip(b" \r")
        more = plan.across - 1 - line.count(separator)
        if line and more < 0 and plan.layout.ragged and not plan.columns.peaks:
            line = separator.join(line.split(separator, plan.across)[: plan.across])
        elif line and not 0 <= more <= plan.across - plan.least:
            raise ValueError("a row of another width")
        rows.append(line + separator * more if line else line)
    return b"\n".join(rows)


def _ticks(column: pa.ChunkedArray) -> IntArray:
    """Decimals as counts of their last place.  ValueError: one is none that int64 holds."""
    stored = column.combine_chunks().buffers()[1]
    halves = np.frombuffer(stored, np.int64, 2 * len(column)).reshape(-1, 2)
    if column.null_count or (halves[:, 1] != halves[:, 0] >> 63).any():
        raise ValueError("no readable time")
    return halves[:, 0]


#: bytes that are read cell by cell, at most, if one of their rows is unlike the others
_PIECE_BYTES = 1 << 12


def parse_block(plan: RowPlan, block: bytes) -> Parsed:
    """The rows of one block, whose lines count from 0."""
    parsed = concatenated_rows(_parts(plan, 0, normalized(plan.layout, block)))
    parsed.lines = block.count(b"\n")
    return parsed


def _parts(plan: RowPlan, line: int, block: bytes) -> list[Parsed]:
    """The rows of a block of whole lines, of which the first has the number `line`."""
    if plan.regular:
        with suppress(ValueError):
            return [plain_rows(plan, block)]
    half = block.find(b"\n", len(block) // 2) + 1
    if len(block) <= _PIECE_BYTES or half == len(block) or not block.strip():
        return [odd_rows(plan, line, block)]
    first, second = block[:half], block[half:]
    return _parts(plan, line, first) + _parts(plan, line + first.count(b"\n"), second)
