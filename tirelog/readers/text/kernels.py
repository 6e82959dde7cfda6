"""Compiled passes over the bytes of a text log.

    rows       a block of rows to columns: counts, floats, ticks, spans of bytes; stops at a row
               that is not like the others
    unquoted   a block without quotes

`parse_rows` takes a cell to be written as the one above it, so that the next cell's place is known
before this one's digits are; one that is not is measured a word at a time, and only one that is
written otherwise is read byte by byte.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray, Records

# ---- Decimal numbers of many digits rounded to the nearest float64, for compiled loops.
#
# 128 bits of 5^e decide (D. Lemire, "Number parsing at a gigabyte per second", Software: Practice
# and
# Experience 51, 2021). Used for numbers that no single multiplication or division rounds correctly:
# of more than 15 digits, as programs write that print float64 in full.
#
# Kept beside Python's `float` cell by cell for its cost: 50,000 rows of 16 such numbers took 0.14 s
# of CPU, and 3.4 s by `float` (22 November 2026, two shared cores, Python 3.11; all blocks of
# `open_text`, as `python -m benchmarks text` reads them).


#: the largest power of ten, up or down
MOST_POWER = 100
_1, _3, _32, _63 = (np.uint64(k) for k in (1, 3, 32, 63))
_LOW_HALF = np.uint64(0xFFFFFFFF)
_TOP_BIT, _BELOW, _ALL = np.uint64(1 << 63), np.uint64((1 << 9) - 1), np.uint64(2**64 - 1)
#: whatever whole number the compiler makes of it
Whole = Any


def _powers_of_five() -> NDArray[np.uint64]:
    """The first 128 bits of 5^e, upper and lower half; shape (2 MOST_POWER + 1, 2).

    Rounded up if e is negative.
    """
    found = []
    for e in range(-MOST_POWER, MOST_POWER + 1):
        five = 5 ** abs(e)
        if e >= 0:
            bits = five << 128 >> five.bit_length()
        else:  # five has no divisor in common with 2, so that the quotient is never whole
            bits = (1 << (five.bit_length() + 127)) // five + 1
        found.append((bits >> 64, bits & (2**64 - 1)))
    return np.array(found, np.uint64)


_FIVES = _powers_of_five()


@compiled
def _product(a: Whole, b: Whole) -> tuple[Whole, Whole]:
    """(upper, lower) 64 bits of a product."""
    a_low, a_high, b_low, b_high = a & _LOW_HALF, a >> _32, b & _LOW_HALF, b >> _32
    low, cross, other = a_low * b_low, a_low * b_high, a_high * b_low
    middle = (low >> _32) + (cross & _LOW_HALF) + (other & _LOW_HALF)
    return a_high * b_high + (cross >> _32) + (other >> _32) + (middle >> _32), (middle << _32) | (
        low & _LOW_HALF
    )


@compiled
def rounded(m: Whole, e: Whole) -> tuple[float, bool]:
    """m 10^e, rounded to nearest, ties to even, for 0 < m < 2^63.

    (NaN, False) if 128 bits of the power do not decide.
    """
    shift = 0
    while m < _TOP_BIT:
        m <<= _1
        shift += 1
    upper, lower = _product(m, _FIVES[e + MOST_POWER, 0])
    if upper & _BELOW == _BELOW:  # the digits behind decide
        more, _ = _product(m, _FIVES[e + MOST_POWER, 1])
        lower += more
        upper += np.uint64(lower < more)
    if lower == _ALL and not -27 <= e <= 55:
        return np.nan, False
    top = np.int64(upper >> _63)
    drop = np.uint64(top + 9)
    mantissa = upper >> drop  # 54 bits: one more than are kept
    if lower <= _1 and -4 <= e <= 23 and mantissa & _3 == _1 and mantissa << drop == upper:
        mantissa &= ~_1  # half way, exactly: to even
    mantissa = (mantissa + (mantissa & _1)) >> _1
    power = ((217706 * e) >> 16) + 63 + top - shift - 52
    if power < -1022 or power > 970:
        return np.nan, False
    return math.ldexp(np.float64(mantissa), int(power)), True


# ---- Decimal numbers out of bytes, for compiled loops.
#
# A mantissa and an exponent of ten, both whole, so that nothing is rounded on the way.
#
#     bytes --number: sign, digits, point, exponent--> m, e          value = m 10^e, |m| < 2^63
#     m, e --as_float--> float64                                     correctly rounded, or none
#
# If |m| <= 2^53 and |e| <= 22, m and 10^|e| are float64 numbers, so that one multiplication or
# division rounds once, as a correct parser does. Else `rounding` decides; if even it leaves a
# doubt,
# or the result is no ordinary number, the caller has to ask a slower parser.


#: powers of ten that int64, and that float64, hold exactly; a mantissa from the last number on
#: takes no further digit
POWERS = 10 ** np.arange(19, dtype=np.int64)
EXACT_POWERS = np.array([float(10**k) for k in range(23)])
_FULL = (1 << 63) // 10
_EXACT = 1 << 53

_ZEROS = np.uint64(0x3030303030303030)
_TO_HIGH, _HIGH = np.uint64(0x7676767676767676), np.uint64(0x8080808080808080)
#: what of each byte a digit's value is
NIBBLES = np.uint64(0x0F0F0F0F0F0F0F0F)
_TENS = (np.uint64(0x00FF00FF00FF00FF), np.uint64(0x0000FFFF0000FFFF), np.uint64(0xFFFFFFFF))
_10, _100, _10000 = np.uint64(10), np.uint64(100), np.uint64(10_000)
_8, _16, _digits_32, _NONE, _digits_1 = (np.uint64(k) for k in (8, 16, 32, 0, 1))
_56, _ONES = np.uint64(56), np.uint64(0x0101010101010101)

Block = bytes | bytearray
Bytes = NDArray[np.uint8]
#: whatever whole number the compiler makes of it


def bytes_of(block: Block) -> Bytes:
    """The block as an array, which is never written to.

    So kernels are compiled for one kind of array.
    """
    data = np.frombuffer(block, np.uint8)
    data.flags.writeable = False
    return data


@compiled
def word(data: Bytes, at: Whole) -> Whole:
    """The eight bytes from the place `at` of `data` on as a little-endian word.

    By unsigned places, which cannot count from the end: so the compiler makes one load of it.
    """
    found, first = np.uint64(0), np.uint64(at)
    for k in range(8):
        found |= np.uint64(data[first + np.uint64(k)]) << np.uint64(8 * k)
    return found


@compiled
def value_of(values: Whole) -> Whole:
    """The number whose eight digits are the bytes of a word, the highest place in the lowest byte.

    Neighbours are joined to numbers of two, four, eight digits.
    """
    values = (values * _10 + (values >> _8)) & _TENS[0]
    values = (values * _100 + (values >> _16)) & _TENS[1]
    return np.int64((values * _10000 + (values >> _digits_32)) & _TENS[2])


@compiled
def not_digits(word: Whole) -> Whole:
    """The highest bit of each of a word's eight bytes that is no ASCII digit.

    Above the first one that is none, a carry may tell lies.
    """
    values = word ^ _ZEROS
    return ((values + _TO_HIGH) | values) & _HIGH


@compiled
def leading_digits(word: Whole) -> Whole:
    """How many of a word's eight bytes, lowest first, are ASCII digits before one that is not."""
    others = np.uint64(not_digits(word))
    if others == _NONE:
        return np.int64(8)
    below = ((others & (~others + _digits_1)) - _digits_1) & _ONES
    return np.int64((below * _ONES) >> _56) - 1


@compiled
def digits_number(data: Bytes, at: Whole, decimal: int) -> tuple[Whole, Whole, Whole]:
    """(m, e, place behind) of the number at `at`; place -1 without one.

    Also -1 with too many digits. Some byte that is no part of a number has to stand behind it.
    """
    negative = data[at] == 45
    if negative or data[at] == 43:
        at += 1
    first, m = at, np.int64(0)
    while 48 <= data[at] <= 57 and m < _FULL:
        m = m * 10 + (np.int64(data[at]) - 48)
        at += 1
    whole = at - first
    behind = np.int64(0)
    if data[at] == decimal:
        at += 1
        first = at
        while 48 <= data[at] <= 57 and m < _FULL:
            m = m * 10 + (np.int64(data[at]) - 48)
            at += 1
        behind = at - first
        while data[at] == 48:
            at += 1
    if whole + behind == 0 or 48 <= data[at] <= 57:
        return np.int64(0), 0, -1
    e: Whole = -behind
    if data[at] == 69 or data[at] == 101:
        at += 1
        falling = data[at] == 45
        if falling or data[at] == 43:
            at += 1
        first, power = at, np.int64(0)
        while 48 <= data[at] <= 57 and at - first < 5:
            power = power * 10 + (np.int64(data[at]) - 48)
            at += 1
        if at == first or at - first == 5:
            return np.int64(0), 0, -1
        e += -power if falling else power
    return -m if negative else m, e, at


@compiled
def as_float(m: Whole, e: Whole, negative: bool) -> tuple[float, bool]:
    """(m 10^e, True), or (NaN, False) if that is left to a slower parser.

    `negative` gives zero its sign.
    """
    if m == 0:
        return (-0.0 if negative else 0.0), True
    if -_EXACT <= m <= _EXACT and -22 <= e <= 22:
        return (m / EXACT_POWERS[-e] if e < 0 else m * EXACT_POWERS[e]), True
    if e < -MOST_POWER or e > MOST_POWER:
        return np.nan, False
    value, good = rounded(np.uint64(abs(m)), e)
    return (-value if negative else value), good


#: what is done with a column: nothing, float64, int64 counts, first byte and byte behind
SKIP, FLOAT, TICK, SPAN = range(4)
#: what to do with a column: `what` of the above, its slot in that output, places of ticks; and set
#: on the way: digits before and behind the decimal sign of the last cell that has one, 0 if there
#: was none
GUIDE = np.dtype(
    [("what", "i8"), ("slot", "i8"), ("places", "i8"), ("whole", "i8"), ("behind", "i8")]
)
#: first byte of a cell and the byte behind it
CELL_SPAN = np.dtype([("first", "i8"), ("stop", "i8")])
#: most decimals of a tick, an int64 count
TICK_PLACES = 9
LARGEST = np.iinfo(np.int64).max
#: what is known about a cell: not yet anything, a number, that it is blank
_UNREAD, _NUMBER, _BLANK = range(3)
#: a cell that is left to the caller: its row and column, first byte and byte behind
HARD = np.dtype([("row", "i8"), ("column", "i8"), ("first", "i8"), ("stop", "i8")])
#: what is between cells in place of a separator that quoted cells hold, too: the unit separator
BETWEEN = 31
#: bytes at the end of a block that are not loaded as words
_TAIL = 48


@compiled
def unquoted(data: Bytes, quote: int, separator: int, out: Bytes) -> int:
    """Copies `data` to `out` without quotes, and with BETWEEN between cells; the bytes written.

    A separator inside of quotes is part of the cell. They open where a cell begins, twice a quote
    inside of them is none, and no cell goes on behind its line.
    """
    size, inside, begins, closed = 0, False, True, False
    for byte in data:
        if byte == quote and (inside or begins or closed):
            inside = not inside
            begins, closed = False, not inside
            continue
        closed = False
        if byte == 10 or (byte == separator and not inside):
            inside, begins = False, True
        elif byte != 32:
            begins = False
        out[size] = BETWEEN if byte == separator and begins else byte
        size += 1
    return size


@compiled
def _after_blanks(data: Bytes, at: Whole, separator: int) -> Whole:
    """The first place from `at` on that is not skipped.

    Skipped are carriage returns and, unless blanks separate, blanks.
    """
    while data[at] == 13 or (data[at] == 32 and separator != 32):
        at += 1
    return at


@compiled
def _is_lost(data: Bytes, start: Whole, stop: Whole) -> bool:
    """True for a blank cell and for `nan` in any case."""
    if stop - start == 3:
        spelt: bool = (
            data[start] | 32 == 110 and data[start + 1] | 32 == 97 and data[start + 2] | 32 == 110
        )
        return spelt
    return bool(stop == start)


@compiled
def _together(front: Whole, back: Whole, whole: Whole, behind: Whole) -> Whole:
    """The number whose digits before and behind the decimal sign begin two words."""
    front = (front & NIBBLES) << np.uint64(64 - 8 * whole)
    if behind == 0:
        return value_of(front)
    back = (back & NIBBLES) << np.uint64(64 - 8 * behind)
    if whole + behind <= 8:
        return value_of((front >> np.uint64(8 * behind)) | back)
    return value_of(front) * POWERS[behind] + value_of(back)


@compiled
def _are_digits(word: Whole, count: Whole) -> bool:
    """True if the first `count` of a word's eight bytes, 1 to 8, are ASCII digits."""
    found: bool = np.uint64(not_digits(word)) << np.uint64(64 - 8 * count) == np.uint64(0)
    return found


@compiled
def parse_rows(
    data: Bytes, at: Whole, guides: Records, separator: int, decimal: int, least: int, rest: bool,
    begins: IntArray, floats: FloatArray, ticks: IntArray, spans: Records, hard: Records,
) -> tuple[Whole, Whole, Whole]:  # fmt: skip
    """Rows from the byte `at` on into columns; (rows, byte behind them, `hard` cells).

    guides  (columns,) of GUIDE
    least   cells that a row has to have; `rest` allows cells behind the columns
    begins  (n,) first byte of each row, of n at most; floats, ticks: (slots, n); spans: (slots, n)
            of CELL_SPAN
    hard    (h,) of HARD

    Ends before a row of another width, before one whose tick is no plain number, or if `hard`
    has no room. A newline ends `data`. One long function, since an array that is passed on costs
    more than a cell.
    """
    width, used, safe = guides.size, 0, data.size - _TAIL
    r = 0
    while True:
        if r == begins.size:
            return r, at, used
        begin, kept = at, used
        begins[r] = at
        if (
            used + width > hard.size
            or at >= data.size
            or data[_after_blanks(data, at, separator)] == 10
        ):
            return r, begin, kept
        ended = False
        for c in range(width):
            guide = guides[c]
            what, slot = guide["what"], guide["slot"]
            mark = separator if c + 1 < width else 10
            if at < safe and not ended and what == FLOAT:
                negative = data[at] == 45
                first = at + negative
                whole, behind = guide["whole"], guide["behind"]
                front, back = word(data, first), word(data, first + whole + 1)
                end = first + whole + 1 + behind
                last = data[end] == mark or (mark == 10 and data[end] == 13)
                alike = last and whole > 0 and data[first + whole] == decimal
                if not (alike and _are_digits(front, whole) and _are_digits(back, behind)):
                    whole, behind = leading_digits(front), np.int64(0)
                    if data[first + whole] == decimal:
                        back = word(data, first + whole + 1)
                        behind = leading_digits(back)
                    if behind > 0:
                        guide["whole"], guide["behind"] = whole, behind
                    end = first + whole + behind + (behind > 0)
                    last = data[end] == mark or (mark == 10 and data[end] == 13)
                if last and whole > 0 and whole + behind <= 15:
                    m = _together(front, back, whole, behind)
                    value = m / EXACT_POWERS[behind]
                    floats[slot, r] = -value if negative else value
                    at = end + (c + 1 < width)
                    continue
            m, e, state, negative = np.int64(0), np.int64(0), _BLANK if ended else _UNREAD, False
            start = stop = at
            if not ended and FLOAT <= what <= TICK:
                start = _after_blanks(data, at, separator)
                m, e, stop = digits_number(data, start, decimal)
                if stop >= 0:
                    end = _after_blanks(data, stop, separator)
                    if data[end] == separator or data[end] == 10:
                        at, negative, state = end, data[start] == 45, _NUMBER
            if state == _UNREAD:
                start = _after_blanks(data, at, separator)
                at = start
                while data[at] != separator and data[at] != 10:
                    at += 1
                stop = at
                while stop > start and (data[stop - 1] == 32 or data[stop - 1] == 13):
                    stop -= 1
                if what != SPAN and _is_lost(data, start, stop):
                    state = _BLANK
            if what == FLOAT:
                value = np.nan
                if state == _NUMBER:
                    value, good = as_float(m, e, negative)
                    state = _NUMBER if good else _UNREAD
                floats[slot, r] = value
            elif what == TICK:
                places = guide["places"]
                up = e + places
                if state != _NUMBER or up < 0 or up > places or abs(m) > LARGEST // POWERS[up]:
                    return r, begin, kept
                ticks[slot, r] = m * POWERS[up]
            elif what == SPAN:
                span = spans[slot, r]
                span["first"], span["stop"], state = start, stop, _NUMBER
            if state == _UNREAD and what != SKIP:
                left = hard[used]
                left["row"], left["column"], left["first"], left["stop"] = r, c, start, stop
                used += 1
            if data[at] == 10:
                ended = True
                if c + 1 < least:
                    return r, begin, kept
            elif c + 1 < width:
                at += 1
        if data[at] == 13:
            at = _after_blanks(data, at, separator)
        while rest and data[at] != 10:
            at += 1
        if data[at] != 10:
            return r, begin, kept
        at += 1
        r += 1
