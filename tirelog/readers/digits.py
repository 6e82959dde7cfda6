"""Decimal numbers out of bytes, for compiled loops: a mantissa and an exponent of ten, both whole, so that nothing is rounded on the way.

    bytes --number: sign, digits, point, exponent--> m, e          value = m 10^e
    m, e --as_count--> int32 counts of 10^-places                  exact, or WIDE
    m, e --as_float--> float64                                     correctly rounded, or HARD

With at most 18 digits m is exact in int64.  Where |m| < 2^53 and |e| <= 22, m and 10^|e| are float64 numbers, so that one multiplication or
division rounds once, as a correct parser does.  Everything else is HARD: the caller leaves it to a parser that is slower.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.compiled import compiled

#: in place of a count, where none holds the number
WIDE = 1 << 31
#: digits of a mantissa that int64 holds whatever they are; powers of ten that int64, and that float64, hold exactly
MOST_DIGITS = 18
POWERS = 10 ** np.arange(MOST_DIGITS + 1, dtype=np.int64)
EXACT_POWERS = np.array([float(10**k) for k in range(23)])
_EXACT = 1 << 53
_MOST_PLACES = 9

_ZEROS = np.uint64(0x3030303030303030)
_TO_HIGH, _HIGH = np.uint64(0x7676767676767676), np.uint64(0x8080808080808080)
_TENS = (np.uint64(0x00FF00FF00FF00FF), np.uint64(0x0000FFFF0000FFFF), np.uint64(0xFFFFFFFF))
_10, _100, _10000 = np.uint64(10), np.uint64(100), np.uint64(10_000)
_8, _16, _32, _NONE = np.uint64(8), np.uint64(16), np.uint64(32), np.uint64(0)

Block = bytes | bytearray
Bytes = NDArray[np.uint8]
Words = NDArray[np.uint64]
#: whatever whole number the compiler makes of it
Whole = Any


def bytes_of(block: Block) -> Bytes:
    """The block as an array, which is never written to, so that kernels are compiled for one kind of array."""
    data = np.frombuffer(block, np.uint8)
    data.flags.writeable = False
    return data


def words_of(data: Bytes) -> Words:
    """The eight bytes from each place of `data` on as little-endian words, without a copy; shape (data.size - 7,)."""
    return np.ndarray((max(data.size - 7, 0),), np.dtype("<u8"), data, 0, (1,))


@compiled
def digits(word: Whole, count: Whole) -> Whole:
    """The whole number of the `count` ASCII digits that are the upper bytes of a word, zero bytes below; -1 where one is no digit.

    Neighbours are joined to numbers of two, four, eight digits.
    """
    values = word - (_ZEROS << np.uint64(64 - 8 * count))
    if ((values + _TO_HIGH) | values) & _HIGH != _NONE:
        return -1
    values = (values * _10 + (values >> _8)) & _TENS[0]
    values = (values * _100 + (values >> _16)) & _TENS[1]
    return np.int64((values * _10000 + (values >> _32)) & _TENS[2])


@compiled
def number(data: Bytes, at: Whole, decimal: int) -> tuple[Whole, Whole, Whole, Whole]:
    """(m, e, digits before the decimal sign, place behind) of the number at `at`; the place is -1 where there is none, or too many digits.

    Some byte that is no part of a number has to stand behind it.
    """
    negative = data[at] == 45
    if negative or data[at] == 43:
        at += 1
    first, m = at, np.int64(0)
    while 48 <= data[at] <= 57 and at - first <= MOST_DIGITS:
        m = m * 10 + (np.int64(data[at]) - 48)
        at += 1
    whole = at - first
    behind = 0
    if data[at] == decimal:
        at += 1
        first = at
        while 48 <= data[at] <= 57 and whole + at - first <= MOST_DIGITS:
            m = m * 10 + (np.int64(data[at]) - 48)
            at += 1
        behind = at - first
    if whole + behind == 0 or whole + behind > MOST_DIGITS:
        return np.int64(0), 0, 0, -1
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
            return np.int64(0), 0, 0, -1
        e += -power if falling else power
    return -m if negative else m, e, whole, at


@compiled
def as_count(m: Whole, e: Whole, places: Whole) -> Whole:
    """m 10^e in units of 10^-places (at most 9), WIDE where int32 does not hold it or it is written with more places.  m = 0 is 0."""
    up = e + places
    if m == 0:
        return 0
    if up < 0 or up > _MOST_PLACES or m > WIDE or m < -WIDE:
        return WIDE
    count = m * POWERS[up]
    return count if -WIDE + 1 < count < WIDE - 1 else WIDE


@compiled
def as_float(m: Whole, e: Whole, negative: bool) -> tuple[float, bool]:
    """(m 10^e, True), or (NaN, False) where that could be rounded twice.  `negative` gives zero its sign."""
    if m > _EXACT or m < -_EXACT or e < -22 or e > 22:
        return np.nan, False
    if m == 0:
        return (-0.0 if negative else 0.0), True
    return (m / EXACT_POWERS[-e] if e < 0 else m * EXACT_POWERS[e]), True
