"""Rows that are written alike, byte for byte but for their digits.

So are nearly all rows of nearly all logs of an instrument.

    the row above --learn--> a template: which byte stands where, or that a digit does; from where
                             the digits of each cell are loaded
    bytes --alike_rows-----> the rows that fit the template, into columns

A row is compared as a whole, many bytes at once; then nothing in it needs to be looked for or
checked, and a cell costs two loads and a few multiplications. The first row that does not fit is
left to `kernels.rows`, which takes it cell by cell.

A number's digits are taken in *groups* of eight: the last eight, and up to eight before them. A
group is put together from two words, one that ends before the decimal sign's place and one that
ends with the group, each masked:

    1550.0003  ->  "....1550" (the word that ends 4 bytes behind the sign, less what is behind)
                   and "....0003"  ->  15500003
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tirelog.readers.base import LOST_COUNT
from tirelog.readers.text.digits import EXACT_POWERS, NIBBLES, POWERS, Bytes, Whole, value_of, word
from tirelog.runtime import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray, Record, Records

#: what is done with a column: nothing, int32 counts, float64, int64 counts of 1e-9, first byte and
#: byte behind
SKIP, COUNT, FLOAT, TICK, SPAN = range(5)
#: what to do with a column: `what` of the above, its slot in that output, places of counts, whether
#: 0 and -1 are lost; set to True: a count could not hold a number
GUIDE = np.dtype(
    [("what", "i8"), ("slot", "i8"), ("places", "i8"), ("marks_lost", "?"), ("too_wide", "?")],
    align=True,
)
#: first byte of a cell and the byte behind it
CELL_SPAN = np.dtype([("first", "i8"), ("stop", "i8")])
#: a cell of a template: `what` and slot of its column; the power of ten that a count or tick is
#: multiplied by, a float divided by; first byte and byte behind in the row; whether 0 is lost,
#: whether it is a word for a lost sample, whether it is negative, whether there are digits before
#: the last eight
CELL = np.dtype(
    [("what", "i8"), ("slot", "i8"), ("power", "i8"), ("first", "i8"), ("stop", "i8"),
     ("marks_lost", "?"), ("word", "?"), ("negative", "?"), ("long", "?")],
    align=True,
)  # fmt: skip
#: where a group of digits is loaded from, in bytes of the row + _BEFORE: the word that holds those
#: before the decimal sign, the one that holds those behind it, and which of their bytes count
GROUP = np.dtype([("whole_at", "i8"), ("whole", "u8"), ("behind_at", "i8"), ("behind", "u8")])
#: decimals of a tick
TICK_PLACES = 9
#: rows of more bytes have no template
_LONGEST_ROW = 1 << 12
#: no word is loaded from further before a row
_BEFORE = 8
#: rows that are compared, and then read column by column, at once
_BATCH = 64

Counts = NDArray[np.int32]


class Template(NamedTuple):
    """How a row is written, and what its cells are.

    usual, above, bit  of each byte of the row: what it is (a digit 0), what sets the highest bit
                       when it is added to any other difference, and that bit
    cells              (columns,) of CELL, of which those that are wanted come first
    last, earlier      (columns,) of GROUP: each cell's last eight digits, and those before
    """

    usual: Bytes
    above: Bytes
    bit: Bytes
    cells: Records
    last: Records
    earlier: Records


_ALL = np.uint64(2**64 - 1)
_LARGEST_COUNT = (1 << 31) - 2
LARGEST = np.iinfo(np.int64).max


@compiled
def unlearnt(width: int) -> Template:
    """Room for a template of so many columns."""
    return Template(
        np.empty(_LONGEST_ROW, np.uint8), np.empty(_LONGEST_ROW, np.uint8),
        np.empty(_LONGEST_ROW, np.uint8), np.empty(width, CELL), np.empty(width, GROUP),
        np.empty(width, GROUP),
    )  # fmt: skip


@compiled
def _masked(first: Whole, stop: Whole) -> Whole:
    """A mask of the digit values in the bytes first to stop of a word."""
    if first >= stop:
        return np.uint64(0)
    return (_ALL << np.uint64(8 * first)) & (_ALL >> np.uint64(64 - 8 * stop)) & NIBBLES


@compiled
def _group(group: Record, point: Whole, end: Whole, whole: Whole, behind: Whole) -> None:
    """Sets where a GROUP of digits is loaded from.

    `whole` of them before the byte `point`, `behind` before the byte `end` (both in the row).
    """
    group["whole_at"] = point - 8 + behind + _BEFORE
    group["whole"] = _masked(8 - behind - whole, 8 - behind)
    group["behind_at"] = (end if behind else point) - 8 + _BEFORE
    group["behind"] = _masked(8 - behind, 8)


@compiled
def _most_digits(what: Whole, power: Whole) -> Whole:
    """Digits of a cell that two groups give and that int64 holds.

    It has to hold them times the power of ten; a tick may be too large even so.
    """
    if what == FLOAT:
        return 15
    return min(16, (19 if what == TICK else 18) - power)


@compiled
def learn_alike(
    data: Bytes, begin: Whole, stop: Whole, guides: Records, separator: int, decimal: int,
    template: Template,
) -> Whole:  # fmt: skip
    """Learns the row from `begin` to `stop`, newline included, into `template`.

    The row has been read before. Returned is how many of its cells are wanted, 0 if it makes no
    template. `guides` (columns,) of GUIDE.
    """
    width, used, at = guides.size, 0, begin
    if stop - begin > _LONGEST_ROW - 8 or begin < _BEFORE:
        return 0
    for i in range(stop - begin):
        byte = data[begin + i]
        digit = 48 <= byte <= 57
        template.usual[i], template.above[i] = (48, 0x76) if digit else (byte, 0x7F)
        template.bit[i] = 0x80
    template.bit[stop - begin : stop - begin + 8] = 0  # what stands behind the row may be anything
    for c in range(width):
        first = at
        while data[at] != separator and data[at] != 10:
            at += 1
        guide = guides[c]
        what, places, marks_lost = guide["what"], guide["places"], guide["marks_lost"]
        end = at
        while first < end and (data[first] == 13 or (data[first] == 32 and separator != 32)):
            first += 1
        while end > first and (data[end - 1] == 32 or data[end - 1] == 13):
            end -= 1
        if data[at] == 10 and (c + 1 < width or at + 1 != stop):
            return 0
        at += 1
        if what == SKIP:
            continue
        cell, last, earlier = template.cells[used], template.last[used], template.earlier[used]
        cell["what"], cell["slot"], cell["marks_lost"] = what, guide["slot"], marks_lost
        cell["first"], cell["stop"] = first - begin, end - begin
        cell["power"], cell["word"], cell["negative"], cell["long"] = 0, False, False, False
        _group(last, 0, 0, 0, 0)
        _group(earlier, 0, 0, 0, 0)
        if what != SPAN:
            negative = data[first] == 45
            digits = first + (negative or data[first] == 43)
            point = digits
            while 48 <= data[point] <= 57:
                point += 1
            behind, whole = 0, point - digits
            if data[point] == decimal and point < end:
                while 48 <= data[point + 1 + behind] <= 57:
                    behind += 1
            plain = (
                whole + behind > 0
                and point + behind + (data[point] == decimal and point < end) == end
            )
            up = behind if what == FLOAT else (places if what == COUNT else TICK_PLACES) - behind
            if not plain or (negative and marks_lost):
                if what == TICK:
                    return 0
                for i in range(first - begin, end - begin):
                    template.usual[i], template.above[i] = data[begin + i], 0x7F
                cell["word"] = True
            elif up < 0 or whole + behind > _most_digits(what, up):
                return 0
            else:
                cell["power"], cell["negative"] = up, negative
                cell["long"] = whole + behind > 8
                late = min(behind, 8)
                before = min(whole, 8 - late)
                _group(last, point - begin, end - begin, before, late)
                _group(
                    earlier,
                    point - before - begin,
                    end - 8 - begin,
                    whole - before,
                    behind - late,
                )
        used += 1
    return used if at == stop else 0


@compiled
def _fitting(data: Bytes, at: Whole, size: Whole, most: Whole, template: Template) -> Whole:
    """How many rows, `most` at most, of `size` bytes from `at` on fit the template."""
    usual, above, bit = (
        template.usual.view(np.uint64),
        template.above.view(np.uint64),
        template.bit.view(np.uint64),
    )
    words = (size + 7) // 8
    for n in range(most):
        if at + 8 * words > data.size:
            return n
        other = np.uint64(0)
        for i in range(words):
            rest = word(data, at + 8 * i) ^ usual[i]
            other |= ((rest + above[i]) | rest) & bit[i]  # carries leave a byte whose bit is set
        if other != 0:
            return n
        at += size
    return most


@compiled
def _gathered(
    data: Bytes, base: Whole, size: Whole, n: Whole, group: Record, numbers: IntArray, times: Whole
) -> None:
    """Adds the numbers that a GROUP of digits is in `n` rows of `size` bytes, multiplied."""
    one, before = base + group["whole_at"], group["whole"]
    other, behind = base + group["behind_at"], group["behind"]
    for i in range(n):
        numbers[i] += times * value_of(
            (word(data, one + i * size) & before) | (word(data, other + i * size) & behind)
        )


@compiled
def alike_rows(
    data: Bytes, at: Whole, size: Whole, template: Template, wanted: Whole, row: Whole,
    begins: IntArray, counts: Counts, floats: FloatArray, ticks: IntArray, spans: Records,
) -> tuple[Whole, Whole]:  # fmt: skip
    """Rows of `size` bytes like the one learnt into columns; (row, byte) behind them.

    The one learnt lies before them, with so many cells `wanted`; they go into columns from `row` on
    (see `kernels.parse_rows`). Ends before a row that does
    not fit, and before some whose numbers may be too large.
    """
    numbers = np.empty(_BATCH, np.int64)
    r = row
    while True:
        n = _fitting(data, at, size, min(_BATCH, begins.size - r), template)
        too_large = False
        for i in range(n):
            begins[r + i] = at + i * size
        for k in range(wanted):
            cell = template.cells[k]
            what, slot, power = cell["what"], cell["slot"], cell["power"]
            times = 1 if what == FLOAT else POWERS[power]
            sign = -1 if cell["negative"] else 1
            if what == SPAN:
                for i in range(n):
                    span = spans[slot, r + i]
                    span["first"] = begins[r + i] + cell["first"]
                    span["stop"] = begins[r + i] + cell["stop"]
                continue
            numbers[:n] = 0
            _gathered(data, at - _BEFORE, size, n, template.last[k], numbers, times)
            if cell["long"]:
                high = 100_000_000 * times
                _gathered(data, at - _BEFORE, size, n, template.earlier[k], numbers, high)
            if what == COUNT:
                zero = (
                    counts[slot, r - 1]
                    if cell["word"]
                    else np.int32(LOST_COUNT if cell["marks_lost"] else 0)
                )
                for i in range(n):
                    too_large |= numbers[i] > _LARGEST_COUNT
                    counts[slot, r + i] = zero if numbers[i] == 0 else np.int32(sign * numbers[i])
            elif what == FLOAT:
                divisor = sign * EXACT_POWERS[power]
                nought = (
                    floats[slot, r - 1]
                    if cell["word"]
                    else (np.nan if cell["marks_lost"] else 0.0 / divisor)
                )
                for i in range(n):
                    floats[slot, r + i] = nought if numbers[i] == 0 else numbers[i] / divisor
            else:
                for i in range(n):
                    too_large |= numbers[i] < 0  # beyond 2^63, and below 2^64
                    ticks[slot, r + i] = sign * numbers[i]
        if n == 0 or too_large:
            return r, at
        r += n
        at += n * size
