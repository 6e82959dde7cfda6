"""Rows of a table as csv by a compiled loop, to the byte as arrow writes them.

Kept beside arrow's writer for its memory: `tirelog tables` on an hour of 4 gratings takes 275 MB,
and 313 MB with arrow, of 300 MB that tables may take; and `tirelog speed` on 4 minutes of 16
gratings from a run 2.7 s of CPU and 202 MB, with arrow 3.0 s and 238 MB (22 November 2026, two
shared cores, Python 3.11).

    columns (n,)
        --numbers as they are, texts and truth values as numbers of words-->
        cells (columns, some rows)
        --digits of each column: how many are significant, or WHOLE, or WORD--> bytes

A number becomes the fewest digits that say what its first significant digits say: 0.5, 12,
0.0000369, 3.7e-8. What cannot be written here is left to arrow: numbers but 0 outside of +-[1e-14,
1e9) (12 digits: 1e-11), whole ones beyond 2^53, marks that want quotes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: rows worked on at once: cells and bytes stay in the cache
AT_ONCE = 2048
#: what a column's cells are, if they are not numbers of so many significant digits
WHOLE, WORD = 0, -1
#: bytes that a number and its comma take at most
LONGEST = 25
#: 10^k for k from -EXACT to EXACT; from 1 on they are exact
EXACT = 22
POWERS = np.array([float(f"1e{k}") for k in range(-EXACT, EXACT + 1)])
#: a number of a smaller decimal exponent is written with an e; the first that is too large; the
#: first whole one that is
LEAST_EXPONENT, BEYOND, BEYOND_WHOLE = -6, 1e9, 2.0**53
MOST_DIGITS = 12
TENS = 10 ** np.arange(MOST_DIGITS + 1)
ZERO, POINT, MINUS, COMMA, NEWLINE, LETTER = b"0.-,\ne"

Bytes = NDArray[np.uint8]


class _Known(dict[Any, int]):
    """The place of each value among those that were asked for."""

    def __missing__(self, value: Any) -> int:
        return self.setdefault(value, len(self))


@dataclass(frozen=True)
class Words:
    """A column of few different texts.

    The `texts`, and the place in them of each row's, shape (n,).
    """

    texts: Sequence[str]
    places: IntArray

    @classmethod
    def of(cls, values: NDArray[Any]) -> Words:
        """The `values` (n,) as text; None is an empty field."""
        listed = [values[0]] if values.size and values.strides == (0,) else values.tolist()
        known = _Known()
        places = np.fromiter(map(known.__getitem__, listed), np.int64, len(listed))
        return cls(
            ["" if value is None else str(value) for value in known],
            np.broadcast_to(places, values.shape),
        )

    @property
    def plain(self) -> bool:
        """True if no text wants quotes."""
        return not any(mark in text for text in self.texts for mark in '",\r\n')


class Rows:
    """The rows of some `columns`: each the digits and the numbers (n,), or Words."""

    def __init__(self, columns: Iterable[tuple[int, NDArray[Any]] | Words]) -> None:
        texts: list[bytes] = []
        self._columns, digits, self._longest = [], [], 0
        for column in columns:
            if isinstance(column, Words):
                self._columns.append(column.places + len(texts))
                digits.append(WORD)
                texts += [text.encode() for text in column.texts]
                self._longest += 1 + max(
                    map(len, texts), default=0
                )  # of this column's words or an earlier one's
            else:
                self._columns.append(column[1])
                digits.append(column[0])
                self._longest += LONGEST
        self._digits = np.array(digits, np.int64)
        self._texts = np.frombuffer(b"".join(texts) or b" ", np.uint8)
        self._begins = np.cumsum([0, *map(len, texts)])

    def written(self, rows: slice) -> Bytes | None:
        """Some rows as csv, None if a number is arrow's to write."""
        cells = np.array([column[rows] for column in self._columns], np.float64)
        out = np.empty(self._longest * cells.shape[1], np.uint8)
        size = write_rows(cells, self._digits, self._texts, self._begins, out)
        return out[:size] if size >= 0 else None


@compiled
def write_rows(
    cells: FloatArray, digits: IntArray, texts: Bytes, begins: IntArray, out: Bytes
) -> int:
    """Writes the rows of `cells` (columns, n) into `out`; how many bytes.

    -1 if a number cannot be written. `digits` (columns,): how many are significant, WHOLE or WORD;
    `begins` (words + 1,): where in `texts` each word begins, and the end of the last.
    """
    at = 0
    exponents = np.zeros(
        digits.size, np.int64
    )  # each as in the row before, from where the next is not far
    for row in range(cells.shape[1]):
        for column in range(digits.size):
            value, kind = cells[column, row], digits[column]
            size = abs(value)
            if kind == WORD:
                for i in range(begins[int(value)], begins[int(value) + 1]):
                    out[at] = texts[i]
                    at += 1
            elif kind == WHOLE and value == value:
                if size >= BEYOND_WHOLE or size != np.floor(size):
                    return -1
                at = _whole(value, out, at)
            elif size == 0.0:
                at = _sign(value, out, at)
                out[at] = ZERO
                at += 1
            elif value == value:
                if not POWERS[kind - 1] <= size < BEYOND:
                    return -1
                exponent = exponents[column]
                while size < POWERS[exponent + EXACT]:
                    exponent -= 1
                while size >= POWERS[exponent + EXACT + 1]:
                    exponent += 1
                exponents[column] = exponent
                at = _number(value, kind, exponent, out, at)
            out[at] = COMMA
            at += 1
        out[at - 1] = NEWLINE
    return at


@compiled
def _sign(value: float, out: Bytes, at: int) -> int:
    """The minus of a negative number or zero; the place of the next byte, as everywhere here."""
    if np.copysign(1.0, value) > 0.0:
        return at
    out[at] = MINUS
    return at + 1


@compiled
def _whole(value: float, out: Bytes, at: int) -> int:
    """A whole number."""
    at = _sign(value, out, at) if value != 0.0 else at
    whole, count, power = np.int64(abs(value)), 1, 10
    while whole >= power:
        count, power = count + 1, power * 10
    for i in range(count):
        out[at + count - 1 - i], whole = ZERO + whole % 10, whole // 10
    return at + count


@compiled
def _number(value: float, digits: int, exponent: int, out: Bytes, at: int) -> int:
    """Writes a number by its first `digits`.

    Its size is at least 10^exponent, and less than ten times that.
    """
    at = _sign(value, out, at)
    whole = np.int64(np.rint(abs(value) * POWERS[digits - 1 - exponent + EXACT]))
    if whole == TENS[digits]:
        whole, exponent = TENS[digits - 1], exponent + 1
    point = exponent if exponent >= LEAST_EXPONENT else 0
    first = at + 1  # the first digit, with a place for the point or a 0 before it
    if point < 0:
        for i in range(
            at, at + 1 - LEAST_EXPONENT
        ):  # as many for all, which is faster than as many as are wanted
            out[i] = ZERO
        first -= point
    _twelve_digits(np.uint64(whole * TENS[MOST_DIGITS - digits]), out, first)
    if point >= 0:
        for i in range(at, at + point + 1):
            out[i] = out[i + 1]
    behind = at + 1 + max(point, 0)
    out[behind] = POINT
    end = first + digits
    while out[end - 1] == ZERO and end > behind + 1:
        end -= 1
    end = end if end > behind + 1 else behind
    return end if exponent == point else _exponent(exponent, out, end)


@compiled
def _exponent(exponent: int, out: Bytes, at: int) -> int:
    """The exponent of a number, -1 to -99."""
    out[at], out[at + 1], at = LETTER, MINUS, at + 2
    if exponent <= -10:
        out[at], at = ZERO + -exponent // 10, at + 1
    out[at] = ZERO + -exponent % 10
    return at + 1


@compiled
def _twelve_digits(whole: np.uint64, out: Bytes, at: int) -> None:
    """The digits of `whole`, in four threes that do not wait for one another."""
    million = np.uint64(1_000_000)
    high = whole // million
    low = np.uint32(whole - high * million)
    _six_digits(np.uint32(high), out, at)
    _six_digits(low, out, at + 6)


@compiled
def _six_digits(six: np.uint32, out: Bytes, at: int) -> None:
    """The digits of `six`, below a million, from place `at` on."""
    thousand = np.uint32(1000)
    high = np.uint32(six // thousand)
    _three_digits(high, out, at)
    _three_digits(np.uint32(six - high * thousand), out, at + 3)


@compiled
def _three_digits(three: np.uint32, out: Bytes, at: int) -> None:
    """The digits of `three`, below a thousand, from place `at` on."""
    ten = np.uint32(10)
    two = np.uint32(three // ten)
    one = np.uint32(two // ten)
    out[at], out[at + 1], out[at + 2] = (
        ZERO + one,
        ZERO + (two - one * ten),
        ZERO + (three - two * ten),
    )
