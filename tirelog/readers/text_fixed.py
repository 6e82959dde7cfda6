"""A block of text whose rows are all alike to the byte: the fastest way, which steps aside for everything else.

    block --first row: where each cell and its decimal point stand--> rows x bytes --eight digits at a time--> Parsed

Instruments write wavelengths with a fixed number of digits, so almost all blocks of such a log are rectangles of bytes.  A number is
(whole part x 10^decimals + decimals) / 10^decimals: both are exact in float64 up to 15 digits and the division is correctly rounded, so the
values are those of any correct parser, to the bit.  A rectangle that is not what it seems gives None, never a wrong number.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.readers.text_rows import Parsed, Plan
from tirelog.recording import FloatArray

#: digits of one load, and of a whole number that float64 holds for certain
_LOAD, _MOST_DIGITS = 8, 15
_ZEROS, _ALL = 0x3030303030303030, 0xFFFFFFFFFFFFFFFF
_NUMBER = re.compile(rb"(\d{1,8})(?:[.,](\d{1,8}))?")

_Words = NDArray[np.uint64]


def fixed(plan: Plan, block: bytes, lines: int) -> Parsed | None:
    """The block of so many lines, None where its rows are not alike, or a wanted cell is anything but plain digits."""
    columns, layout = plan.columns, plan.layout
    if plan.exact or columns.errors is not None or (columns.time is not None and columns.form != "number"):
        return None
    length = block.find(b"\n") + 1
    if length < 2 * _LOAD or len(block) != lines * length:
        return None
    bytes_ = np.frombuffer(block, np.uint8).reshape(lines, length)
    cells = _cells(bytes_, block[:length], layout.separator.encode(), layout.width)
    if cells is None:
        return None
    # a wanted cell is all digits; another one might hold a separator
    if len(plan.wanted) < layout.width and block.count(layout.separator.encode()) != lines * (layout.width - 1):
        return None
    found: dict[int, FloatArray] = {}
    for k in plan.wanted:
        start, stop = cells[k]
        values = _numbers(block, bytes_, start, stop, layout.decimal.encode())
        if values is None:
            return None
        found[k] = values
    out = Parsed({k: found[k] for k in {*columns.values.values()}}, size=lines)
    out.number = None if columns.number is None else found[columns.number]
    out.stamps = None if columns.time is None else found[columns.time]
    return out


def _cells(bytes_: NDArray[np.uint8], row: bytes, separator: bytes, width: int) -> list[tuple[int, int]] | None:
    """(first byte, byte behind) of each cell; None where the rows do not agree about it."""
    end = len(row) - (2 if row.endswith(b"\r\n") else 1)
    cuts = [i for i in range(end) if row[i : i + 1] == separator]
    if len(cuts) != width - 1 or len(separator) != 1:
        return None
    same = [bytes_[:, cut] == separator[0] for cut in cuts] + [bytes_[:, k] == row[k] for k in range(end, len(row))]
    if not all(column.all() for column in same):
        return None
    return list(zip([0] + [cut + 1 for cut in cuts], [*cuts, end], strict=True))


def _numbers(block: bytes, bytes_: NDArray[np.uint8], start: int, stop: int, decimal: bytes) -> FloatArray | None:
    """The numbers in the bytes [start, stop) of every row; None where one is not digits with its point where the first row has it."""
    match = _NUMBER.fullmatch(block[start:stop])
    if not match:
        return None
    whole, behind = len(match[1]), len(match[2] or b"")
    if whole + behind > _MOST_DIGITS or (behind and not (bytes_[:, start + whole] == decimal[0]).all()):
        return None
    digits = _loaded(block, bytes_.shape, start, start + whole)
    if not behind:
        total = _value(digits, whole)
    elif whole + behind <= _LOAD:
        digits >>= np.uint64(8 * behind)
        digits |= _loaded(block, bytes_.shape, stop - behind, stop)
        total = _value(digits, whole + behind)
    else:
        total, decimals = _value(digits, whole), _value(_loaded(block, bytes_.shape, stop - behind, stop), behind)
        total = None if total is None or decimals is None else total * np.uint64(10**behind) + decimals
    return None if total is None else total.astype(np.float64) / 10.0**behind


def _loaded(block: bytes, shape: tuple[int, ...], start: int, stop: int) -> _Words:
    """The bytes [start, stop) of every row, eight at most, as the upper bytes of little-endian words, the first lowest; zeros below."""
    lines, length = shape
    blank = np.uint64(8 * (_LOAD - (stop - start)))
    backward = stop >= _LOAD  # a load that ends at `stop` lies within the block in all rows, one that begins at `start` in all but the last
    words: Any = np.ndarray((lines,), np.dtype("<u8"), block, stop - _LOAD if backward else start, (length,)).astype(np.uint64)
    if backward and blank:
        words >>= blank
    words <<= blank
    return words


def _value(words: _Words, count: int) -> _Words | None:
    """The whole numbers of the `count` digits in the upper bytes of `words` (overwritten), None where a byte is no digit.

    Neighbours are joined to numbers of two, four, eight digits.
    """
    words -= np.uint64(_ZEROS << (8 * (_LOAD - count)) & _ALL)
    above_nine = words + np.uint64(0x7676767676767676)
    above_nine |= words
    if int(np.bitwise_or.reduce(above_nine)) & 0x8080808080808080:
        return None
    upper = above_nine
    for factor, shift, mask in ((10, 8, 0x00FF00FF00FF00FF), (100, 16, 0x0000FFFF0000FFFF), (10_000, 32, 0xFFFFFFFF)):
        np.right_shift(words, np.uint64(shift), out=upper)
        words *= np.uint64(factor)
        words += upper
        words &= np.uint64(mask)
    return words
