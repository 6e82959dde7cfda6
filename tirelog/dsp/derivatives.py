"""Low-passed time derivatives of windows around the passages, by their spectra.

    windows (n, m) --lost samples bridged, ends brought to zero, FFT--> spectra (n, m // 2 + 1)
                   --gain x (2 pi i f)^k, zero-padded inverse--> derivatives (n, m x upsample)

A row's result depends on its own samples only.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray

ComplexArray = NDArray[np.complex128]

#: order of the Butterworth filter; forwards and backwards it acts twice
ORDER = 4


@compiled
def gain(frequency_Hz: float, cutoff_Hz: float) -> float:
    """Gain of the zero-phase low-pass, 1/2 at the cut-off."""
    ratio2 = (frequency_Hz / cutoff_Hz) ** 2
    power = 1.0
    for _ in range(ORDER):
        power *= ratio2
    return 1.0 / (1.0 + power)


@compiled
def closed(windows: FloatArray) -> FloatArray:
    """`windows` (n, m) with NaN bridged, closed without a step.

    Bridged by straight lines (the nearest sample at the ends); less the line through the means of
    the first and the last m / 32, so that they close. Rows that are all NaN become 0.
    """
    count = windows.shape[1]
    edge = max(count // 32, 1)
    out = windows.copy()
    for row in out:
        known = -1
        for k in range(count):
            if not np.isnan(row[k]):
                for lost in range(known + 1, k):
                    share = (lost - known) / (k - known)
                    row[lost] = row[k] if known < 0 else row[known] + share * (row[k] - row[known])
                known = k
        for k in range(known + 1, count):
            row[k] = row[known] if known >= 0 else 0.0
        first, last = 0.0, 0.0
        for k in range(edge):
            first += row[k] / edge
            last += row[count - 1 - k] / edge
        for k in range(count):
            row[k] -= first + (last - first) * k / (count - 1)
    return out


@compiled
def _shaped(
    spectra: ComplexArray, factor: ComplexArray, step_Hz: float, cutoff_Hz: FloatArray
) -> ComplexArray:
    """`spectra` (n, f) times the low-pass of each row, `cutoff_Hz` (n,), and `factor` (f,).

    Frequencies are `step_Hz` apart.
    """
    out = np.empty_like(spectra)
    for row in range(spectra.shape[0]):
        for k in range(factor.size):
            out[row, k] = spectra[row, k] * factor[k] * gain(k * step_Hz, cutoff_Hz[row])
    return out


def window_spectra(windows: FloatArray) -> ComplexArray:
    """FFT of the rows of `windows`, closed."""
    return np.fft.rfft(closed(windows), axis=1)


def derivative(
    spectra: ComplexArray,
    rate_Hz: float,
    cutoff_Hz: FloatArray,
    order: int,
    count: int,
    upsample: int,
) -> FloatArray:
    """The `order`-th time derivative of rows, low-passed at `cutoff_Hz` (n,).

    Of rows of `count` samples with `spectra`, at `upsample` x `count` points.
    """
    factor: ComplexArray = (2j * np.pi * np.fft.rfftfreq(count, 1.0 / rate_Hz)).astype(
        np.complex128
    ) ** order * upsample
    if count % 2 == 0:
        factor[-1] = factor[-1].real * (0.5 if upsample > 1 else 1.0)
    return np.fft.irfft(
        _shaped(spectra, factor, rate_Hz / count, cutoff_Hz), n=count * upsample, axis=1
    )


@compiled
def noise_gains(count: int, rate_Hz: float, cutoff_Hz: FloatArray) -> FloatArray:
    """Standard deviations of the derivatives of low-passed white noise, shape (n, 2).

    Of the second and of the third time derivative, for noise of one per sample in windows of
    `count` samples.
    """
    out = np.zeros((cutoff_Hz.size, 2))
    for row in range(cutoff_Hz.size):
        for k in range(count // 2 + 1):
            square = (2.0 * np.pi * k * rate_Hz / count) ** 2
            power = (gain(k * rate_Hz / count, cutoff_Hz[row]) * square) ** 2
            out[row, 0] += power
            out[row, 1] += power * square
        for k in range(2):
            out[row, k] = np.sqrt(2.0 / count * out[row, k])
    return out
