"""Times that are written alike, digit for digit: the compiled pass under `times.column_ns`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.readers.text.digits import POWERS, Bytes, Whole
from tirelog.runtime import compiled
from tirelog.vocabulary.arrays import IntArray

#: what a byte of a time is: a byte like the pattern's, or a digit of a field
AS_IT_IS, YEAR, MONTH, DAY, HOUR, MINUTE, SECOND, FRACTION = range(8)
#: years that int64 holds in nanoseconds from 1970
_FIRST_YEAR, _LAST_YEAR = 1678, 2261


@compiled
def _days(year: Whole, month: Whole, day: Whole) -> Whole:
    """Days since 1970 of a proleptic Gregorian date (counted in years that begin in March, so that
    the leap day comes last).

    Month 13 is the next January.
    """
    year -= month <= 2
    month = (month + 9) % 12
    return (
        365 * year + year // 4 - year // 100 + year // 400 + (153 * month + 2) // 5 + day - 719_469
    )


@compiled
def times_alike(
    data: Bytes,
    starts: IntArray,
    pattern: Bytes,
    roles: IntArray,
    dated: bool,
    offset_s: int,
    out: IntArray,
    done: NDArray[np.bool_],
) -> None:
    """Times from the bytes `starts` on that are written like `pattern`: nanoseconds `out`, and True
    in `done`; others are False.

    `dated` ones count from 1970, and lie `offset_s` east of UTC.
    """
    fields = np.empty(8, np.int64)
    decimals = (roles == FRACTION).sum()
    for i in range(starts.size):
        fields[:] = 0
        alike = True
        for k in range(pattern.size):
            byte, role = data[starts[i] + k], roles[k]
            if role == AS_IT_IS:
                alike &= byte == pattern[k]
            else:
                alike &= 48 <= byte <= 57
                fields[role] = fields[role] * 10 + (np.int64(byte) - 48)
        alike &= fields[HOUR] <= 24 and fields[MINUTE] <= 59 and fields[SECOND] <= 60
        seconds = fields[HOUR] * 3600 + fields[MINUTE] * 60 + fields[SECOND] - offset_s
        if dated:
            year, month, day = fields[YEAR], fields[MONTH], fields[DAY]
            alike &= _FIRST_YEAR <= year <= _LAST_YEAR and 1 <= month <= 12 and 1 <= day <= 31
            if day > 28:
                alike &= day <= _days(year, month + 1, 1) - _days(year, month, 1)
            seconds += 86_400 * _days(year, month, day)
        out[i], done[i] = seconds * 1_000_000_000 + fields[FRACTION] * POWERS[9 - decimals], alike
