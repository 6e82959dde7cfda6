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

import numpy as np
from numpy.typing import NDArray

from tirelog.readers.base import LOST_COUNT
from tirelog.readers.text.digits import EXACT_POWERS, NIBBLES, POWERS, Bytes, Whole, value_of, word
from tirelog.runtime import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: what is done with a column: nothing, int32 counts, float64, int64 counts of 1e-9, first byte and
#: byte behind
SKIP, COUNT, FLOAT, TICK, SPAN = range(5)
#: columns of the table that guides the reading of rows (`kernels.rows`)
GUIDE = 5
WHAT, SLOT, PLACES, MARKS_LOST, TOO_WIDE = range(GUIDE)
#: columns of a template's table of cells: what, slot, whether 0 is lost, whether the cell is a word
#: for a lost sample; the power of ten that a count or tick is multiplied by, a float divided by;
#: whether negative; first byte and byte behind; whether there are digits before the last eight;
#: places and masks of the words of the last eight digits, and of those before
_CELL = 17
_WHAT, _SLOT, _MARKS_LOST, _WORD, _POWER, _NEGATIVE, _FIRST, _STOP, _LONG, _LAST = range(10)
_EARLIER = 13
#: decimals of a tick
TICK_PLACES = 9
#: rows of more bytes have no template
_LONGEST_ROW = 1 << 12
#: no word is loaded from further before a row
_BEFORE = 8
#: rows that are compared, and then read column by column, at once
_BATCH = 64

Counts = NDArray[np.int32]
#: of each byte of a row: what it is (a digit 0), what sets the highest bit when it is added to any
#: other difference, and that bit
Pattern = NDArray[np.uint8]

_ALL = np.uint64(2**64 - 1)
#: counts are int32, the lowest of them a lost sample
_LARGEST_COUNT = (1 << 31) - 2
LARGEST = np.iinfo(np.int64).max


@compiled
def unlearnt(width: int) -> tuple[Pattern, IntArray]:
    """Room for a template of so many columns: (pattern of the row's bytes, table of its cells)."""
    return np.empty((3, _LONGEST_ROW), np.uint8), np.empty((width, _CELL), np.int64)


@compiled
def _masked(first: Whole, stop: Whole) -> Whole:
    """A mask of the digit values in the bytes first to stop of a word."""
    if first >= stop:
        return 0
    return np.int64((_ALL << np.uint64(8 * first)) & (_ALL >> np.uint64(64 - 8 * stop)) & NIBBLES)


@compiled
def _group(
    cells: IntArray, k: int, at: int, point: Whole, end: Whole, whole: Whole, behind: Whole
) -> None:
    """Sets where a group of digits is loaded from.

    `whole` of them before the byte `point`, `behind` before the byte `end` (both in the row).
    """
    cells[k, at] = point - 8 + behind + _BEFORE
    cells[k, at + 1] = _masked(8 - behind - whole, 8 - behind)
    cells[k, at + 2] = (end if behind else point) - 8 + _BEFORE
    cells[k, at + 3] = _masked(8 - behind, 8)


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
    data: Bytes,
    begin: Whole,
    stop: Whole,
    guides: IntArray,
    separator: int,
    decimal: int,
    pattern: Pattern,
    cells: IntArray,
) -> Whole:
    """Learns the row from `begin` to `stop`, newline included, into `pattern` and `cells`.

    The row has been read before. Returned is how many of its cells are wanted, 0 if it makes no
    template.
    """
    width, used, at = guides.shape[0], 0, begin
    if stop - begin > _LONGEST_ROW - 8 or begin < _BEFORE:
        return 0
    for i in range(stop - begin):
        byte = data[begin + i]
        digit = 48 <= byte <= 57
        pattern[0, i], pattern[1, i], pattern[2, i] = (
            (48, 0x76, 0x80) if digit else (byte, 0x7F, 0x80)
        )
    pattern[2, stop - begin : stop - begin + 8] = 0  # what stands behind the row may be anything
    for c in range(width):
        first = at
        while data[at] != separator and data[at] != 10:
            at += 1
        what, slot, places = guides[c, WHAT], guides[c, SLOT], guides[c, PLACES]
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
        cells[used] = 0
        cells[used, _WHAT], cells[used, _SLOT], cells[used, _MARKS_LOST] = (
            what,
            slot,
            guides[c, MARKS_LOST],
        )
        cells[used, _FIRST], cells[used, _STOP] = first - begin, end - begin
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
            if not plain or (negative and guides[c, MARKS_LOST]):
                if what == TICK:
                    return 0
                for i in range(first - begin, end - begin):
                    pattern[0, i], pattern[1, i] = data[begin + i], 0x7F
                cells[used, _WORD] = 1
            elif up < 0 or whole + behind > _most_digits(what, up):
                return 0
            else:
                cells[used, _POWER], cells[used, _NEGATIVE], cells[used, _LONG] = (
                    up,
                    negative,
                    whole + behind > 8,
                )
                last = min(behind, 8)
                before = min(whole, 8 - last)
                _group(cells, used, _LAST, point - begin, end - begin, before, last)
                _group(
                    cells,
                    used,
                    _EARLIER,
                    point - before - begin,
                    end - 8 - begin,
                    whole - before,
                    behind - last,
                )
        used += 1
    return used if at == stop else 0


@compiled
def _fitting(data: Bytes, at: Whole, size: Whole, most: Whole, pattern: Pattern) -> Whole:
    """How many rows, `most` at most, of `size` bytes from `at` on fit the pattern."""
    usual, above, bit = (
        pattern[0].view(np.uint64),
        pattern[1].view(np.uint64),
        pattern[2].view(np.uint64),
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
    data: Bytes,
    base: Whole,
    size: Whole,
    n: Whole,
    cell: IntArray,
    at: int,
    numbers: IntArray,
    times: Whole,
) -> None:
    """Adds the numbers that a group of digits is in `n` rows of `size` bytes, multiplied."""
    one, before, other, behind = (
        base + cell[at],
        np.uint64(cell[at + 1]),
        base + cell[at + 2],
        np.uint64(cell[at + 3]),
    )
    for i in range(n):
        numbers[i] += times * value_of(
            (word(data, one + i * size) & before) | (word(data, other + i * size) & behind)
        )


@compiled
def alike_rows(
    data: Bytes, at: Whole, size: Whole, pattern: Pattern, cells: IntArray, row: Whole,
    begins: IntArray, counts: Counts, floats: FloatArray, ticks: IntArray, spans: IntArray,
) -> tuple[Whole, Whole]:  # fmt: skip
    """Rows of `size` bytes like the one learnt into columns; (row, byte) behind them.

    The one learnt lies before them; they go into columns from `row` on. Ends before a row that does
    not fit, and before some whose numbers may be too large.
    """
    numbers = np.empty(_BATCH, np.int64)
    r = row
    while True:
        n = _fitting(data, at, size, min(_BATCH, begins.size - r), pattern)
        too_large = False
        for i in range(n):
            begins[r + i] = at + i * size
        for k in range(cells.shape[0]):
            cell = cells[k]
            what, slot, times = (
                cell[_WHAT],
                cell[_SLOT],
                1 if cell[_WHAT] == FLOAT else POWERS[cell[_POWER]],
            )
            sign = -1 if cell[_NEGATIVE] else 1
            if what == SPAN:
                for i in range(n):
                    spans[slot, r + i, 0], spans[slot, r + i, 1] = (
                        begins[r + i] + cell[_FIRST],
                        begins[r + i] + cell[_STOP],
                    )
                continue
            numbers[:n] = 0
            _gathered(data, at - _BEFORE, size, n, cell, _LAST, numbers, times)
            if cell[_LONG]:
                _gathered(data, at - _BEFORE, size, n, cell, _EARLIER, numbers, 100_000_000 * times)
            if what == COUNT:
                zero = (
                    counts[slot, r - 1]
                    if cell[_WORD]
                    else np.int32(LOST_COUNT if cell[_MARKS_LOST] else 0)
                )
                for i in range(n):
                    too_large |= numbers[i] > _LARGEST_COUNT
                    counts[slot, r + i] = zero if numbers[i] == 0 else np.int32(sign * numbers[i])
            elif what == FLOAT:
                divisor = sign * EXACT_POWERS[cell[_POWER]]
                nought = (
                    floats[slot, r - 1]
                    if cell[_WORD]
                    else (np.nan if cell[_MARKS_LOST] else 0.0 / divisor)
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
