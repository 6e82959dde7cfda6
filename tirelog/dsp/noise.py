"""The noise of one sample, from the log itself.

    a channel's samples --sixth differences of pieces spread over the log--> sigma [unit of the channel]

Sixth differences remove what the tire does, even a patch of ten samples; the median of their size ignores
spikes and steps.  The pieces lie at fixed places of the log, so the answer does not depend on how the log is read.
"""

from __future__ import annotations

from math import comb

import numpy as np

from tirelog.recording import Channel, FloatArray

#: order of the difference; that of white noise has sqrt(binomial(2 order, order)) standard deviations
ORDER = 6
DIFFERENCE_GAIN = comb(2 * ORDER, ORDER) ** 0.5
#: median of |x| of a normal variable, in standard deviations
NORMAL_MEDIAN = 0.6744897501960817
PIECES, PIECE_SAMPLES = 64, 4096


def white_noise(values: FloatArray) -> float:
    """Standard deviation of the white noise on `values`, shape (n,), NaN allowed; NaN where fewer than 7 samples stand in a row."""
    difference = np.abs(np.diff(values, ORDER))
    difference = difference[np.isfinite(difference)]
    if not difference.size:
        return float("nan")
    return float(np.median(difference) / NORMAL_MEDIAN / DIFFERENCE_GAIN)


def sample_noise(channel: Channel, pieces: int = PIECES, piece_samples: int = PIECE_SAMPLES) -> float:
    """Noise sigma of one sample of `channel`, its own unit: the median over pieces spread evenly over the log.

    Never below the rounding of the source, resolution / sqrt(12).  NaN where the log is too short or all lost.
    """
    rounding = channel.resolution / np.sqrt(12.0)
    starts = np.unique(np.linspace(0, max(channel.size - piece_samples, 0), pieces).astype(np.int64))
    sigmas = np.array([white_noise(channel.read(int(start), int(start) + piece_samples)) for start in starts])
    sigmas = sigmas[np.isfinite(sigmas)]
    if not sigmas.size:
        return float("nan")
    return float(max(np.median(sigmas), rounding))
