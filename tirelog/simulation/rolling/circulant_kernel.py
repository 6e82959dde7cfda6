"""Compiled: banded circulant systems, solved by elimination of all but the last five unknowns.

stencil (11,) --factor: once for each change of it--> Factors --solve--> x (N,)
apply: the stencil times x
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray

#: half width of every stencil
HALF = 5


class Factors(NamedTuple):
    """A circulant of n + 5 unknowns, factored.

    stencil  (11,): the row of the circulant, its diagonal in the middle
    lower    (n, 5), upper (n, 6): the band, pivots of `upper` inverted
    border   (n, 5): what the last five unknowns cost the rest
    foot     (5, 5): the inverse of what is left for these
    """

    stencil: FloatArray
    lower: FloatArray
    upper: FloatArray
    border: FloatArray
    foot: FloatArray


@compiled
def factors(size: int) -> Factors:
    """Room for the factors of a circulant of `size` = n + 5 unknowns."""
    n = size - HALF
    return Factors(
        np.zeros(2 * HALF + 1),
        np.zeros((n, HALF)),
        np.zeros((n, HALF + 1)),
        np.zeros((n, HALF)),
        np.zeros((HALF, HALF)),
    )


@compiled
def factor(system: Factors) -> None:
    """Fills the factors of the circulant of the stencil that stands in `system`."""
    stencil, lower, upper, border, foot = system
    n = lower.shape[0]
    size = n + HALF
    for i in range(n):
        for m in range(HALF):
            ahead = n + m - i
            border[i, m] = (
                stencil[ahead + HALF]
                if ahead <= HALF
                else (stencil[ahead - size + HALF] if size - ahead <= HALF else 0.0)
            )
        row = np.zeros(2 * HALF + 1)
        for d in range(-HALF, HALF + 1):
            if 0 <= i + d < n:
                row[d + HALF] = stencil[d + HALF]
        for d in range(-HALF, 0):
            k = i + d
            if k < 0:
                continue
            share = row[d + HALF] * upper[k, 0]
            lower[i, d + HALF] = share
            for e in range(1, HALF + 1):
                row[d + HALF + e] -= share * upper[k, e]
            for m in range(HALF):
                border[i, m] -= share * border[k, m]
        upper[i, 0] = 1.0 / row[HALF]
        for e in range(1, HALF + 1):
            upper[i, e] = row[HALF + e]
    for i in range(n - 1, -1, -1):
        for m in range(HALF):
            value = border[i, m]
            for e in range(1, min(HALF, n - 1 - i) + 1):
                value -= upper[i, e] * border[i + e, m]
            border[i, m] = value * upper[i, 0]
    left = np.zeros((HALF, HALF))
    for m in range(HALF):
        for k in range(HALF):
            left[m, k] = stencil[k - m + HALF]
        for d in range(-HALF, HALF + 1):
            i = (n + m + d) % size
            if i < n:
                for k in range(HALF):
                    left[m, k] -= stencil[d + HALF] * border[i, k]
    foot[:, :] = np.linalg.inv(left)


@compiled
def solve(system: Factors, right: FloatArray, x: FloatArray) -> None:
    """x (N,) of the factored system for `right` (N,)."""
    stencil, lower, upper, border, foot = system
    n = lower.shape[0]
    size = n + HALF
    for i in range(n):
        value = right[i]
        for d in range(min(HALF, i), 0, -1):
            value -= lower[i, HALF - d] * x[i - d]
        x[i] = value
    for i in range(n - 1, -1, -1):
        value = x[i]
        for e in range(min(HALF, n - 1 - i), 0, -1):
            value -= upper[i, e] * x[i + e]
        x[i] = value * upper[i, 0]
    rest = np.zeros(HALF)
    for m in range(HALF):
        value = right[n + m]
        for d in range(-HALF, HALF + 1):
            i = (n + m + d) % size
            if i < n:
                value -= stencil[d + HALF] * x[i]
        rest[m] = value
    for m in range(HALF):
        value = 0.0
        for k in range(HALF):
            value += foot[m, k] * rest[k]
        x[n + m] = value
    for i in range(n):
        value = x[i]
        for m in range(HALF):
            value -= border[i, m] * x[n + m]
        x[i] = value


@compiled
def apply_circulant(stencil: FloatArray, x: FloatArray, out: FloatArray) -> None:
    """The circulant of `stencil` times x (N,)."""
    size = x.size
    for i in range(HALF, size - HALF):
        value = 0.0
        for d in range(2 * HALF + 1):
            value += stencil[d] * x[i + d - HALF]
        out[i] = value
    for j in range(-HALF, HALF):
        value = 0.0
        for d in range(2 * HALF + 1):
            value += stencil[d] * x[(j + d - HALF) % size]
        out[j % size] = value
