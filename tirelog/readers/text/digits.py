"""Decimal numbers out of bytes, for compiled loops.

A mantissa and an exponent of ten, both whole, so that nothing is rounded on the way.

    bytes --number: sign, digits, point, exponent--> m, e          value = m 10^e, |m| < 2^63
    m, e --as_count--> int32 counts of 10^-places                  exact, or WIDE
    m, e --as_float--> float64                                     correctly rounded, or none

If |m| <= 2^53 and |e| <= 22, m and 10^|e| are float64 numbers, so that one multiplication or
division rounds once, as a correct parser does. Else `rounding` decides; if even it leaves a doubt,
or the result is no ordinary number, the caller has to ask a slower parser.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import compiled
from tirelog.readers.text.rounding import MOST_POWER, rounded

#: in place of a count, if none holds the number
WIDE = 1 << 31
#: powers of ten that int64, and that float64, hold exactly; a mantissa from the last number on
#: takes no further digit
POWERS = 10 ** np.arange(19, dtype=np.int64)
EXACT_POWERS = np.array([float(10**k) for k in range(23)])
_FULL = (1 << 63) // 10
_EXACT = 1 << 53
_MOST_PLACES = 9

_ZEROS = np.uint64(0x3030303030303030)
_TO_HIGH, _HIGH = np.uint64(0x7676767676767676), np.uint64(0x8080808080808080)
#: what of each byte a digit's value is
NIBBLES = np.uint64(0x0F0F0F0F0F0F0F0F)
_TENS = (np.uint64(0x00FF00FF00FF00FF), np.uint64(0x0000FFFF0000FFFF), np.uint64(0xFFFFFFFF))
_10, _100, _10000 = np.uint64(10), np.uint64(100), np.uint64(10_000)
_8, _16, _32, _NONE, _1 = (np.uint64(k) for k in (8, 16, 32, 0, 1))
_56, _ONES = np.uint64(56), np.uint64(0x0101010101010101)

Block = bytes | bytearray
Bytes = NDArray[np.uint8]
#: whatever whole number the compiler makes of it
Whole = Any


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
    return np.int64((values * _10000 + (values >> _32)) & _TENS[2])


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
    below = ((others & (~others + _1)) - _1) & _ONES
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
def as_count(m: Whole, e: Whole, places: Whole) -> Whole:
    """m 10^e in units of 10^-places (at most 9), or WIDE.

    WIDE if int32 does not hold it or it is written with more places. m = 0 is 0.
    """
    up = e + places
    if m == 0:
        return 0
    if up < 0 or up > _MOST_PLACES or m > WIDE or m < -WIDE:
        return WIDE
    count = m * POWERS[up]
    return count if -WIDE + 1 < count < WIDE - 1 else WIDE


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
