"""Compiled loops of a template: the sums that it is learnt from, and the curve that it is.

    samples around rows --cubic B-splines over the angle--> normal equations
    coefficients --> value and slope at any angle

Windows, segments and rows are those of `fit_kernels`.
"""

from __future__ import annotations

from tirelog.runtime import compiled
from tirelog.strain.passages.fit_kernels import TIME, VALUE, WEIGHT, read_window
from tirelog.vocabulary.arrays import FloatArray, IntArray


@compiled
def spline_sums(
    samples: FloatArray,
    times: FloatArray,
    segments: FloatArray,
    sign: float,
    low: float,
    high: float,
    rows: FloatArray,
    offset: FloatArray,
    spans: IntArray,
    window_rad: float,
    normal: FloatArray,
    right: FloatArray,
    scratch: FloatArray,
) -> int:
    """Adds the rows' samples, less `offset` and over the height, to the normal equations of a cubic
    spline over +-`window_rad`; how many.

    `normal` (s, s), of which the upper triangle is filled, `right` (s,), s three more than the knot
    intervals.
    """
    intervals = right.size - 3
    used = 0
    for k in range(rows.shape[0]):
        count, _ = read_window(samples, times, segments, sign, low, high, spans[k], scratch)
        for i in range(count):
            tau = scratch[TIME, i] - rows[k, 0]
            phi = (rows[k, 1] + 0.5 * rows[k, 2] * tau) * tau
            value = (scratch[VALUE, i] - offset[k]) / rows[k, 4]
            if scratch[WEIGHT, i] > 0 and abs(phi) < window_rad and abs(value) < 2.0:
                place = min(
                    max((phi + window_rad) * (intervals / (2.0 * window_rad)), 0.0),
                    intervals - 1e-9,
                )
                cell = int(place)
                for a in range(4):
                    weight = basis(place - cell, a)
                    right[cell + a] += weight * value
                    for b in range(a, 4):
                        normal[cell + a, cell + b] += weight * basis(place - cell, b)
                used += 1
    return used


@compiled
def spline_curve(
    coefficients: FloatArray, window_rad: float, phi: FloatArray, curve: FloatArray
) -> None:
    """Value and slope [1/rad] of the spline at `phi` (n,), into `curve` (n, 2)."""
    intervals = coefficients.size - 3
    scale = intervals / (2.0 * window_rad)
    for i in range(phi.size):
        place = min(max((phi[i] + window_rad) * scale, 0.0), intervals - 1e-9)
        cell = int(place)
        u = place - cell
        c0, c1, c2, c3 = (
            coefficients[cell],
            coefficients[cell + 1],
            coefficients[cell + 2],
            coefficients[cell + 3],
        )
        curve[i, 0] = basis(u, 0) * c0 + basis(u, 1) * c1 + basis(u, 2) * c2 + basis(u, 3) * c3
        slope = (
            (3 * u**2 - 4 * u) * c1 - (1 - u) ** 2 * c0 + (-3 * u**2 + 2 * u + 1) * c2 + u**2 * c3
        )
        curve[i, 1] = 0.5 * scale * slope


@compiled
def basis(u: float, which: int) -> float:
    """The four cubic B-splines that are not zero at the fraction `u` in [0, 1] between knots."""
    if which == 0:
        return (1 - u) ** 3 / 6.0
    if which == 1:
        return (3 * u**3 - 6 * u**2 + 4) / 6.0
    if which == 2:
        return (-3 * u**3 + 3 * u**2 + 3 * u + 1) / 6.0
    return u**3 / 6.0
