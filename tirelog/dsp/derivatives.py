"""Low-passed time derivatives of windows around the passages, by their spectra.

    windows (n, m) --lost samples bridged, ends brought to zero, FFT--> spectra (n, m // 2 + 1)
                   --gain x (2 pi i f)^k, zero-padded inverse--> both derivatives (n, m x upsample)

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
def _derived(
    spectra: ComplexArray, step_Hz: float, cutoff_Hz: FloatArray, count: int, upsample: int,
    out: ComplexArray, noise: FloatArray,
) -> None:  # fmt: skip
    """Fills `out` (2, n, f): spectra of the first and second derivative of low-passed rows.

    `spectra` (n, f) of `count` samples, frequencies `step_Hz` apart, `cutoff_Hz` (n,). Also filled:
    `noise` (n, 2), as `derivatives` tells it. In one pass, as the low-pass is what takes long.
    """
    last = spectra.shape[1] - 1
    for row in range(spectra.shape[0]):
        second = third = 0.0
        for k in range(last + 1):
            turning = 2.0 * np.pi * k * step_Hz
            passed = gain(k * step_Hz, cutoff_Hz[row])
            square = turning**2
            power = (passed * square) ** 2
            second += power
            third += power * square
            one = passed * upsample * turning * spectra[row, k]
            out[0, row, k] = complex(-one.imag, one.real)
            out[1, row, k] = -turning * one
        if count % 2 == 0:  # the highest frequency has no phase, and two halves between samples
            out[0, row, last] = 0.0
            out[1, row, last] *= 0.5 if upsample > 1 else 1.0
        noise[row, 0], noise[row, 1] = np.sqrt(2.0 / count * second), np.sqrt(2.0 / count * third)


def window_spectra(windows: FloatArray) -> ComplexArray:
    """FFT of the rows of `windows`, closed."""
    return np.fft.rfft(closed(windows), axis=1)


def derivatives(
    spectra: ComplexArray, rate_Hz: float, cutoff_Hz: FloatArray, count: int, upsample: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """First and second time derivative of rows, low-passed at `cutoff_Hz` (n,); what noise does.

    Of rows of `count` samples with `spectra`, at `upsample` x `count` points, (n, m) each; standard
    deviations (n, 2) of the second and of the third derivative, for noise of one per sample.
    """
    shaped = np.empty((2, *spectra.shape), np.complex128)
    noise = np.empty((len(spectra), 2))
    _derived(spectra, rate_Hz / count, cutoff_Hz, count, upsample, shaped, noise)
    first, second = (np.fft.irfft(one, n=count * upsample, axis=1) for one in shaped)
    return first, second, noise


def lowpassed(
    spectra: ComplexArray, rate_Hz: float, cutoff_Hz: FloatArray, count: int, upsample: int
) -> FloatArray:
    """The rows of `spectra` low-passed, (n, m), arguments as of `derivatives`."""
    ratio = np.fft.rfftfreq(count, 1.0 / rate_Hz) / cutoff_Hz[:, None]
    shaped = spectra * (upsample / (1.0 + ratio ** (2 * ORDER)))
    if count % 2 == 0:
        shaped[:, -1] *= 0.5 if upsample > 1 else 1.0
    return np.fft.irfft(shaped, n=count * upsample, axis=1)
