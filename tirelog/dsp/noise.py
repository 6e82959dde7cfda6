"""The noise of one sample, from the log itself.

    a channel's samples --third differences of pieces spread over the log--> sigma [unit of the channel]

Third differences remove whatever the tire does slowly; the median of their size ignores the patch, spikes and steps.  The pieces lie
at fixed places of the log, so the answer does not depend on how the log is read.
"""

from __future__ import annotations

import numpy as np

from tirelog.recording import Channel, FloatArray

#: third difference 1 -3 3 -1 of white noise: sqrt(1 + 9 + 9 + 1) standard deviations
THIRD_DIFFERENCE_GAIN = np.sqrt(20.0)
#: median of |x| of a normal variable, in standard deviations
NORMAL_MEDIAN = 0.6744897501960817
PIECES, PIECE_SAMPLES = 64, 4096


def white_noise(values: FloatArray) -> float:
    """Standard deviation of the white noise on `values`, shape (n,), NaN allowed; NaN where fewer than 4 samples stand in a row."""
    third = np.abs(np.diff(values, 3))
    third = third[np.isfinite(third)]
    if not third.size:
        return float("nan")
    return float(np.median(third) / NORMAL_MEDIAN / THIRD_DIFFERENCE_GAIN)


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
