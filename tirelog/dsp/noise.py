"""The noise of one sample, from the log itself.

    a channel's samples
        --sixth differences of pieces spread over the log--> sigma [unit of the channel]

Sixth differences remove what the tire does, even a patch of ten samples; the median of their size
ignores spikes and steps. The pieces lie at fixed places of the log, so the answer does not depend
on how the log is read.
"""

from __future__ import annotations

from math import comb

import numpy as np

from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray

#: order of the difference; that of white noise has sqrt(binomial(2 order, order)) standard
#: deviations
ORDER = 6
DIFFERENCE_GAIN = comb(2 * ORDER, ORDER) ** 0.5
#: median of |x| of a normal variable, in standard deviations
NORMAL_MEDIAN = 0.6744897501960817
#: pieces that are looked at, and samples per piece; a piece starts at a multiple of its length
PIECES, PIECE_SAMPLES = 64, 4096


@compiled
def sixth_differences(values: FloatArray, sizes: FloatArray) -> int:
    """Fills `sizes` (n,) with sizes of the sixth differences of `values` (n,); how many.

    Only of those that no lost sample is in.
    """
    count = 0
    for i in range(values.size - 6):
        outer, middle, inner = (
            values[i] + values[i + 6],
            values[i + 1] + values[i + 5],
            values[i + 2] + values[i + 4],
        )
        size = abs(outer - 6.0 * middle + 15.0 * inner - 20.0 * values[i + 3])
        if size < np.inf:
            sizes[count] = size
            count += 1
    return count


def white_noise(values: FloatArray) -> float:
    """Standard deviation of the white noise on `values`, shape (n,), NaN allowed.

    NaN if fewer than 7 samples stand in a row.
    """
    sizes = np.empty(values.size)
    count = sixth_differences(values, sizes)
    if not count:
        return float("nan")
    middle = np.partition(sizes[:count], count // 2)
    median = (
        middle[count // 2] if count % 2 else 0.5 * (middle[count // 2] + middle[: count // 2].max())
    )
    return float(median / NORMAL_MEDIAN / DIFFERENCE_GAIN)


class SampleNoise:
    """Gathers the noise of a channel of `size` samples while its blocks pass by.

    `resolution` is the step of the source (0: unknown). Blocks are to start at multiples of
    PIECE_SAMPLES.
    """

    def __init__(self, size: int, resolution: float) -> None:
        self._starts = np.unique(
            np.linspace(0, max(size - PIECE_SAMPLES, 0), PIECES).astype(np.int64)
            // PIECE_SAMPLES
            * PIECE_SAMPLES
        )
        self._rounding = resolution / 12**0.5
        self._sigmas: list[float] = []

    def take(self, start: int, values: FloatArray) -> None:
        """A block that starts at sample `start`."""
        for first in self._starts[(self._starts >= start) & (self._starts < start + values.size)]:
            self._sigmas.append(white_noise(values[first - start : first - start + PIECE_SAMPLES]))

    def sigma(self) -> float:
        """Median over the pieces, never below the rounding of the source.

        That is resolution / sqrt(12); NaN if all is lost or too short.
        """
        finite = [sigma for sigma in self._sigmas if np.isfinite(sigma)]
        return max(float(np.median(finite)), self._rounding) if finite else float("nan")
