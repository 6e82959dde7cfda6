"""A band-limited differentiator for whole channels.

With it its response, and what white noise brings through it.

    samples, block by block --lost and wild samples bridged-->
                            --FIR, zero-phase (`differentiator`)--> time derivative

The filter is antisymmetric, so it has no delay.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray

#: half length of the filter in half periods of its pass edge, at least and at most [samples]
HALF_PERIODS, SHORTEST, LONGEST = 10.0, 10, 400
#: the stop band begins at this multiple of the pass edge; its weight against the pass band's
#: relative error
STOP, STOP_WEIGHT = 1.3, 0.02


def averaging_gain(omega: FloatArray, averaged: int) -> FloatArray:
    """Gain of the mean of `averaged` samples at `omega` [rad per mean] of the means' own rate."""
    fine = np.asarray(omega, float) / averaged
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(
            fine == 0, 1.0, np.sin(0.5 * averaged * fine) / (averaged * np.sin(0.5 * fine))
        )


def differentiator(rate_Hz: float, edge_Hz: float, averaged: int = 1) -> FloatArray:
    """Coefficients of the derivative [1/s] of what lies below `edge_Hz`, (2 k + 1,).

    np.convolve(values, coefficients, 'valid') is the derivative.

    Least squares: relative error in the pass band, size in the stop band. `averaged`: `values` are
    means of so many samples, whose droop is made up for.
    """
    half = int(np.clip(np.ceil(HALF_PERIODS * rate_Hz / (2.0 * edge_Hz)), SHORTEST, LONGEST))
    place = np.arange(1, half + 1)
    edge = 2.0 * np.pi * edge_Hz / rate_Hz
    passed = (np.arange(8 * half) + 0.5) / (8 * half) * edge
    stopped = np.linspace(min(STOP * edge, np.pi), np.pi, 8 * half, endpoint=False)
    passing = 2.0 * np.sin(np.multiply.outer(passed, place)) / passed[:, None]
    stopping = 2.0 * STOP_WEIGHT / edge * np.sin(np.multiply.outer(stopped, place))
    design = np.vstack([passing, stopping])
    wanted = np.concatenate([1.0 / averaging_gain(passed, averaged), np.zeros(stopped.size)])
    side = np.linalg.lstsq(design, wanted, rcond=None)[0] * rate_Hz
    return np.concatenate([side[::-1], [0.0], -side])


def bridged(values: FloatArray, wild: float) -> FloatArray:
    """`values` (n,) with lost and wild samples replaced.

    Wild are such as leave the cubic through their four neighbours by more than `wild` and more than
    those leave theirs. Replaced by that cubic if the neighbours are there, else linearly. `values`
    themselves if all are good; zeros if all are lost.
    """
    if not _doubtful(values, wild):
        return values
    filled, lost = values.copy(), np.empty(values.size, bool)
    return filled if _bridge(values, wild, lost, filled) else np.zeros_like(values)


@compiled
def _doubtful(values: FloatArray, wild: float) -> bool:
    """True if any of `values` (n,) is lost or leaves its neighbours' cubic by more than `wild`."""
    count, most = 0, 6.0 * wild
    for i in range(min(values.size, 2)):
        count += (
            values[i] != values[i] or values[values.size - 1 - i] != values[values.size - 1 - i]
        )
    if values.size > 4:
        # slices, so that the compiler knows that no place is counted from the end
        a, b, c, d, e = values[:-4], values[1:-3], values[2:-2], values[3:-1], values[4:]
        for i in range(a.size):
            count += not abs(a[i] + e[i] - 4.0 * (b[i] + d[i]) + 6.0 * c[i]) <= most
    return count > 0


@compiled
def _bend(values: FloatArray, i: int) -> float:
    """How far sample `i` is off the cubic of its four neighbours; 0 if that is not known."""
    if i < 2 or i >= values.size - 2:
        return 0.0
    bend = (
        abs(values[i - 2] + values[i + 2] - 4.0 * (values[i - 1] + values[i + 1]) + 6.0 * values[i])
        / 6.0
    )
    return bend if bend == bend else 0.0


@compiled
def _bridge(values: FloatArray, wild: float, lost: NDArray[np.bool_], filled: FloatArray) -> bool:
    """`bridged` into `filled`, a copy of `values`; `lost` says which; False if nothing is left."""
    n, known = values.size, 0
    for i in range(n):
        lost[i] = values[i] != values[i]
        bend = _bend(values, i)
        if bend > wild and bend >= _bend(values, i - 1) and bend >= _bend(values, i + 1):
            lost[i] = True
        known += not lost[i]
    before = -1
    after = 0
    for i in range(n):
        if not lost[i]:
            before = i
        elif 2 <= i < n - 2 and not (lost[i - 2] or lost[i - 1] or lost[i + 1] or lost[i + 2]):
            filled[i] = (
                4.0 * (values[i - 1] + values[i + 1]) - values[i - 2] - values[i + 2]
            ) / 6.0
        else:
            after = max(after, i)
            while after < n and lost[after]:
                after += 1
            if before >= 0 and after < n:
                filled[i] = values[before] + (values[after] - values[before]) * (i - before) / (
                    after - before
                )
            elif known > 0:
                filled[i] = values[before] if before >= 0 else values[after]
    return known > 0
