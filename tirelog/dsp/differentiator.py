"""A band-limited differentiator for whole channels, its response, and what white noise brings through it.

    samples, block by block --lost and wild samples bridged--> --FIR, zero-phase--> time derivative

The filter is antisymmetric, so it has no delay.
"""

from __future__ import annotations

import numpy as np

from tirelog.recording import FloatArray

#: half length of the filter in half periods of its pass edge, at least and at most [samples]
HALF_PERIODS, SHORTEST, LONGEST = 10.0, 10, 400
#: the stop band begins at this multiple of the pass edge; its weight against the pass band's relative error
STOP, STOP_WEIGHT = 1.3, 0.02


def averaging_gain(omega: FloatArray, averaged: int) -> FloatArray:
    """Gain of the mean of `averaged` samples at `omega` [rad per mean] of the means' own rate."""
    fine = np.asarray(omega, float) / averaged
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(fine == 0, 1.0, np.sin(0.5 * averaged * fine) / (averaged * np.sin(0.5 * fine)))


def differentiator(rate_Hz: float, edge_Hz: float, averaged: int = 1) -> FloatArray:
    """Coefficients, shape (2 k + 1,): np.convolve(values, coefficients, 'valid') is the derivative [1/s] of what lies below `edge_Hz`.

    Least squares: relative error in the pass band, size in the stop band.  `averaged`: `values` are means of so many samples, whose
    droop is made up for.
    """
    half = int(np.clip(np.ceil(HALF_PERIODS * rate_Hz / (2.0 * edge_Hz)), SHORTEST, LONGEST))
    place = np.arange(1, half + 1)
    edge = 2.0 * np.pi * edge_Hz / rate_Hz
    passed = (np.arange(8 * half) + 0.5) / (8 * half) * edge
    stopped = np.linspace(min(STOP * edge, np.pi), np.pi, 8 * half, endpoint=False)
    design = np.vstack([2.0 * np.sin(np.multiply.outer(passed, place)) / passed[:, None],
                        2.0 * STOP_WEIGHT / edge * np.sin(np.multiply.outer(stopped, place))])  # fmt: skip
    wanted = np.concatenate([1.0 / averaging_gain(passed, averaged), np.zeros(stopped.size)])
    side = np.linalg.lstsq(design, wanted, rcond=None)[0] * rate_Hz
    return np.concatenate([side[::-1], [0.0], -side])


def response(coefficients: FloatArray, rate_Hz: float, frequency_Hz: FloatArray) -> FloatArray:
    """Gain of the filter over that of an ideal derivative at `frequency_Hz`."""
    half = coefficients.size // 2
    omega = 2.0 * np.pi * np.asarray(frequency_Hz, float) / rate_Hz
    place = np.arange(1, half + 1)
    gain = 2.0 * np.sin(np.multiply.outer(omega, place)) @ coefficients[:half][::-1]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(omega == 0, 1.0, gain / (omega * rate_Hz))


def bridged(values: FloatArray, wild: float) -> tuple[FloatArray, int]:
    """`values` (n,) with lost samples, and such as leave the cubic through their four neighbours by more than `wild` and more than those
    leave theirs, replaced: by that cubic where the neighbours are there, else linearly.  Second: how many were replaced."""
    lost = np.isnan(values)
    if values.size >= 5:
        # in place: this is the longest step of a whole channel
        bend = values[1:-3] + values[3:-1]
        bend *= -4.0
        bend += values[:-4]
        bend += values[4:]
        bend /= 6.0
        bend += values[2:-2]
        np.abs(bend, out=bend)
        high = np.flatnonzero(bend > wild)
        if high.size:
            around = np.nan_to_num(np.pad(bend, 1))
            largest = (around[high + 1] >= around[high]) & (around[high + 1] >= around[high + 2])
            lost[high[largest] + 2] = True
    gone = np.flatnonzero(lost)
    if not gone.size or gone.size == values.size:
        return (np.zeros_like(values) if gone.size else values), int(gone.size)
    filled = values.copy()
    known = np.flatnonzero(~lost)
    filled[gone] = np.interp(gone, known, values[known])
    alone = gone[(gone >= 2) & (gone < values.size - 2)]
    alone = alone[~(lost[alone - 2] | lost[alone - 1] | lost[alone + 1] | lost[alone + 2])]
    filled[alone] = (4.0 * (values[alone - 1] + values[alone + 1]) - values[alone - 2] - values[alone + 2]) / 6.0
    return filled, int(gone.size)
