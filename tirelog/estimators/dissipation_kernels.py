"""Compiled loop of the dissipation: samples to the energy of their derivative in each revolution, in one pass.

values (n,) --antisymmetric FIR--> slope (n,) --square, and square of its own change--> sums over each row's samples
"""

from __future__ import annotations

from tirelog.compiled import compiled
from tirelog.recording import FloatArray, IntArray


@compiled
def revolution_sums(
    values: FloatArray, side: FloatArray, slope: FloatArray, rows: IntArray, low: IntArray, high: IntArray, sums: FloatArray
) -> None:
    """Adds to `sums` (m, 2) of the `rows` (k,) the squared derivative of `values` (n,) over [low, high) (k, places in `values`), and its
    squared change from one place to the next.

    derivative[i] = sum over k of side[k - 1] (values[i + k] - values[i - k]), 0 where that leaves `values`; `slope` (n,) is scratch.
    Sums go sample by sample, so that they do not depend on where the values were cut.
    """
    half, n = side.size, values.size
    slope[:n] = 0.0
    # some samples at a time, which stay in the fastest cache while all coefficients pass over them
    for begin in range(half, n - half, 512):
        end = min(begin + 512, n - half)
        out = slope[begin:end]
        for k in range(1, half + 1):
            factor, ahead, behind = side[k - 1], values[begin + k : end + k], values[begin - k : end - k]
            for i in range(out.size):
                out[i] += factor * (ahead[i] - behind[i])
    for j in range(rows.size):
        energy, bend = sums[rows[j], 0], sums[rows[j], 1]
        for i in range(max(low[j], 1), min(high[j], n - 1)):
            change = 0.5 * (slope[i + 1] - slope[i - 1])
            energy += slope[i] * slope[i]
            bend += change * change
        sums[rows[j], 0], sums[rows[j], 1] = energy, bend
