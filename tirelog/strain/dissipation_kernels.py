"""Compiled loop of the dissipation.

Samples to the energy of their derivative in each revolution, in one pass.

values (n,) --antisymmetric FIR--> slope (n,)
    --square, and square of its own change, fours of samples first--> sums over each row's samples
"""

from __future__ import annotations

from tirelog.runtime import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: what a block's first sample has to be a multiple of, so that the fours are the same wherever the
#: values were cut
FOUR = 4
#: rows of the scratch: slope, energy and bend of four samples
SCRATCH_ROWS = 3
#: samples that stay in the fastest cache while all coefficients pass over them
_TILE = 512


@compiled
def revolution_sums(
    values: FloatArray,
    first: int,
    side: FloatArray,
    scratch: FloatArray,
    rows: IntArray,
    low: IntArray,
    high: IntArray,
    sums: FloatArray,
) -> None:
    """Adds to `sums` (m, 2) of the `rows` (k,) the squared derivative of `values` (n,) over [low,
    high) (k,), and its squared change from one place to the next. Places count as `first` does, the
    place of the first value.

    derivative[i] = sum over k of side[k - 1] (values[i + k] - values[i - k]), 0 where that leaves
    `values`; `scratch` (SCRATCH_ROWS, n or more). Sums go four by four at multiples of FOUR, so
    that they do not depend on where the values were cut, if at such places.
    """
    n = values.size
    slope, energies, bends = scratch[0, :n], scratch[1], scratch[2]
    _derivative(values, side, slope)
    begin = FOUR - first % FOUR  # the first four that has a neighbour before it
    _fours(slope, begin, energies, bends)
    for j in range(rows.size):
        energy, bend = sums[rows[j], 0], sums[rows[j], 1]
        i, end = max(low[j] - first, 1), min(high[j] - first, n - 1)
        while i < end:
            if (i - begin) % FOUR == 0 and i + FOUR <= end:
                four = (i - begin) // FOUR
                stop = four + (end - i) // FOUR
                for k in range(four, stop):
                    energy += energies[k]
                    bend += bends[k]
                i += (stop - four) * FOUR
            else:
                change = 0.5 * (slope[i + 1] - slope[i - 1])
                energy += slope[i] * slope[i]
                bend += change * change
                i += 1
        sums[rows[j], 0], sums[rows[j], 1] = energy, bend


@compiled
def _derivative(values: FloatArray, side: FloatArray, slope: FloatArray) -> None:
    """The derivative of `values` (n,) into `slope` (n,)."""
    half, n = side.size, values.size
    slope[:] = 0.0
    for begin in range(half, n - half, _TILE):
        end = min(begin + _TILE, n - half)
        out = slope[begin:end]
        k = 1
        while k + 4 <= half:  # five at a time, which `out` is read and written once for
            s0, s1, s2, s3, s4 = side[k - 1], side[k], side[k + 1], side[k + 2], side[k + 3]
            a, b = values[begin + k : end + k + 4], values[begin - k - 4 : end - k]
            for i in range(out.size):
                some = (
                    out[i]
                    + s0 * (a[i] - b[i + 4])
                    + s1 * (a[i + 1] - b[i + 3])
                    + s2 * (a[i + 2] - b[i + 2])
                )
                out[i] = some + s3 * (a[i + 3] - b[i + 1]) + s4 * (a[i + 4] - b[i])
            k += 5
        while k <= half:
            s0, a, b = side[k - 1], values[begin + k : end + k], values[begin - k : end - k]
            for i in range(out.size):
                out[i] += s0 * (a[i] - b[i])
            k += 1


@compiled
def _fours(slope: FloatArray, begin: int, energies: FloatArray, bends: FloatArray) -> None:
    """Squares of `slope`, and of half of its change over two places, summed over four places from
    `begin` on, and so on.
    """
    around = slope[begin - 1 :]
    for k in range((slope.size - begin - 1) // FOUR):
        i = FOUR * k
        before, s0, s1, s2, s3, after = (
            around[i],
            around[i + 1],
            around[i + 2],
            around[i + 3],
            around[i + 4],
            around[i + 5],
        )
        c0, c1, c2, c3 = s1 - before, s2 - s0, s3 - s1, after - s2
        energies[k] = (s0 * s0 + s1 * s1) + (s2 * s2 + s3 * s3)
        bends[k] = 0.25 * ((c0 * c0 + c1 * c1) + (c2 * c2 + c3 * c3))
