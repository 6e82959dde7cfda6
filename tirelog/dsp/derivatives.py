"""Low-passed time derivatives of windows around the passages, and where they are extreme between the samples.

    windows (n, m) --ends brought to zero, FFT, gain x (2 pi i f)^k, zero-padded inverse--> derivatives (n, m x upsample)
    derivative rows, search ranges --least sample, parabola through its neighbours--> position, height, curvature, shape (n,)

All passages of a block at once; a row's result depends on its own samples only.
"""

from __future__ import annotations

from dataclasses import dataclass

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


def derivative(spectrum: NDArray[np.complex128], gains: FloatArray, rate_Hz: float, order: int, count: int, upsample: int) -> FloatArray:
    """The `order`-th time derivative of rows with `spectrum` (n, count // 2 + 1), times `gains`, at `upsample` x `count` points."""
    frequency = np.fft.rfftfreq(count, 1.0 / rate_Hz)
    response = gains * (2j * np.pi * frequency) ** order
    if count % 2 == 0:
        response[:, -1] = response[:, -1].real * (0.5 if upsample > 1 else 1.0)
    return np.fft.irfft(spectrum * response, n=count * upsample, axis=1) * upsample


@dataclass(frozen=True)
class Extremum:
    """Minima of rows: `place` in columns (NaN where it lies at the border of its range), `height`, `curvature` per column^2."""

    place: FloatArray
    height: FloatArray
    curvature: FloatArray


def least(rows: FloatArray, low: FloatArray, high: FloatArray) -> Extremum:
    """The least value of each row between the columns `low` and `high` (n,), with the parabola through three columns."""
    count = rows.shape[1]
    column = np.arange(count)
    outside = (column < np.ceil(low)[:, None]) | (column > np.floor(high)[:, None])
    index = np.argmin(np.where(outside, np.inf, rows), axis=1)
    row = np.arange(rows.shape[0])
    inner = (index > np.ceil(low)) & (index < np.floor(high)) & (index > 0) & (index < count - 1)
    safe = np.clip(index, 1, count - 2)
    a, b, c = rows[row, safe - 1], rows[row, safe], rows[row, safe + 1]
    curvature = a - 2.0 * b + c
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = np.where(curvature > 0, 0.5 * (a - c) / curvature, 0.0)
    shift = np.clip(shift, -0.5, 0.5)
    place = np.where(inner & (curvature > 0), safe + shift, np.nan)
    return Extremum(place, b - 0.25 * (a - c) * shift, np.where(curvature > 0, curvature, np.nan))
