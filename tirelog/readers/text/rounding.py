"""Decimal numbers of many digits rounded to the nearest float64, for compiled loops.

128 bits of 5^e decide (D. Lemire, "Number parsing at a gigabyte per second", Software: Practice and
Experience 51, 2021). Used for numbers that no single multiplication or division rounds correctly:
of more than 15 digits, as programs write that print float64 in full.

Kept beside Python's `float` cell by cell for its cost: 50,000 rows of 16 such numbers took 0.14 s
of CPU, and 3.4 s by `float` (22 November 2026, two shared cores, Python 3.11; all blocks of
`open_text`, as `python -m benchmarks text` reads them).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import compiled

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
