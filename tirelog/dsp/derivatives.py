"""Time derivatives of windows around the passages, by their spectra.

    windows (n, m) --ends brought to zero, FFT, (2 pi i f)^k, zero-padded inverse--> derivatives (n, m x upsample)

A row's result depends on its own samples only.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.recording import FloatArray


def fill_lost(windows: FloatArray) -> FloatArray:
    """`windows` shape (n, m) with NaN replaced by linear interpolation along the row (the nearest sample at its ends); rows that are
    all NaN become 0."""
    lost = np.isnan(windows)
    rows = np.flatnonzero(lost.any(axis=1))
    if not rows.size:
        return windows
    filled = windows.copy()
    place = np.arange(windows.shape[1])
    for row in rows:
        known = ~lost[row]
        filled[row] = np.interp(place, place[known], windows[row, known]) if known.any() else 0.0
    return filled


def window_spectrum(windows: FloatArray) -> NDArray[np.complex128]:
    """FFT of the rows of `windows` (n, m) after the line through their ends has been taken off, so that they close without a step."""
    count = windows.shape[1]
    edge = max(count // 32, 1)
    first, last = windows[:, :edge].mean(axis=1), windows[:, -edge:].mean(axis=1)
    ramp = np.linspace(0.0, 1.0, count)
    return np.fft.rfft(windows - first[:, None] - (last - first)[:, None] * ramp, axis=1)


def derivative(spectrum: NDArray[np.complex128], rate_Hz: float, order: int, count: int, upsample: int) -> FloatArray:
    """The `order`-th time derivative of rows of `count` samples with `spectrum` (n, count // 2 + 1), at `upsample` x `count` points."""
    response = (2j * np.pi * np.fft.rfftfreq(count, 1.0 / rate_Hz)) ** order * upsample
    if count % 2 == 0:
        response[-1] = response[-1].real * (0.5 if upsample > 1 else 1.0)
    return np.fft.irfft(spectrum * response, n=count * upsample, axis=1)
