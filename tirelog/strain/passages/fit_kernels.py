"""Compiled loops over the windows of passages: the matched fit.

    samples around rows, template
        --read_window, Gauss-Newton--> `found` (n, 7), `used` (n,), `marks` (n, 3)

A window is the row's `spans` (n, 3): samples [first, stop) of the channel, thinned to MOST_SAMPLES,
and what to add to their numbers to find them in `samples`. Their times are `times` if these are
given, else those of `segments` (k, 3): first sample, its time, step. Columns of `rows` (n, 5): time
[s], omega, alpha, standard deviation of the stretch, height.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.runtime import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray

# samples around rows --cubic B-splines over the angle--> normal equations
#     coefficients --> value and slope at any angle
#
# Windows, segments and rows are those of the fit further below.


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
    """Adds the rows' samples to the normal equations of a cubic spline; how many.

    The samples are less `offset` and over the height, the spline is over +-`window_rad`.

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


#: samples per row at most; a creeping wheel's windows are thinned to this
MOST_SAMPLES = 400
#: Gauss-Newton steps of a fit; in the first one wild samples lose their weight
ITERATIONS = 2
#: a sample is wild if it leaves its two neighbours' mean by this many sigmas and by this share
#: of the height: noise does the first once in 1e10, and half of it once in 1000
WILD_SIGMAS, WILD_SHARE = 8.0, 0.06
#: and by this many times the scatter between turns at its angle: the ringing of an edge is no
#: spike.  Half as much would take a third of the passages of a real accelerometer for spiked; twice
#: as much hides spikes at its edges
WILD_SCATTERS = 5.0
#: what is further off than this share of the height is not the tire
FOREIGN_SHARE = 0.35
#: stuck samples are clipped if they lie this many sigmas off
CLIPPED_SIGMAS = 3.0
#: how far a step may shift [window] and stretch
MOST_SHIFT = MOST_STRETCH = 0.3

#: rows of the scratch: a window's samples, and what is known of each
VALUE, TIME, WEIGHT, STUCK, PHI, SHAPE, SLOPE, RESIDUAL, BEND, SCATTER = range(10)
SCRATCH_ROWS = 10


@compiled
def fit_rows(
    samples: FloatArray,
    times: FloatArray,
    segments: FloatArray,
    sign: float,
    low: float,
    high: float,
    noise: float,
    table: FloatArray,
    window_rad: float,
    rows: FloatArray,
    spans: IntArray,
    found: FloatArray,
    used: IntArray,
    marks: NDArray[np.bool_],
    scratch: FloatArray,
) -> None:
    """Fills each row's fit y = a + b T(phi (1 + e) - s) by the template T.

    `table` (g, 3): values, slopes and scatter of T over +-`window_rad`. `found`: time, its standard
    error, omega, its standard error, height, offset, misfit; `marks`: lost, spike, clipped; `low`,
    `high`: the channel's extremes. `scratch` (SCRATCH_ROWS, MOST_SAMPLES) is the caller's.
    """
    for k in range(rows.shape[0]):
        count, lost = read_window(samples, times, segments, sign, low, high, spans[k], scratch)
        marks[k, 0] = lost > 0
        time_s, omega, alpha, height = rows[k, 0], rows[k, 1], rows[k, 2], rows[k, 4]
        for iteration in range(ITERATIONS):
            hold = (max(noise, 1e-12 * height) / (height * rows[k, 3])) ** 2
            _shapes(count, time_s, omega, alpha, table, window_rad, scratch)
            a, b, c, d, variance_c, variance_d = _step(count, hold, scratch)
            if iteration == 0 and _wild(count, abs(height), noise, scratch):
                marks[k, 1] = True
                a, b, c, d, variance_c, variance_d = _step(count, hold, scratch)
            guess = b if abs(b) > 0.05 * height else height
            shift = min(max(-c / guess, -MOST_SHIFT * window_rad), MOST_SHIFT * window_rad)
            time_s += shift / omega
            omega *= 1.0 + min(max(d / guess, -MOST_STRETCH), MOST_STRETCH)
            height = abs(guess)
        square, off, stuck = 0.0, 0.0, 0.0
        for i in range(count):
            if scratch[WEIGHT, i] > 0:
                used[k] += 1
                square += scratch[RESIDUAL, i] ** 2
            if scratch[STUCK, i] > 0:
                stuck += 1.0
                off += abs(scratch[RESIDUAL, i])
        marks[k, 2] = off > CLIPPED_SIGMAS * noise * max(stuck, 1.0)
        found[k, 0] = time_s
        found[k, 1] = noise * np.sqrt(variance_c) / (height * omega)
        found[k, 2] = omega
        found[k, 3] = noise * np.sqrt(variance_d) / height * omega
        found[k, 4] = b
        found[k, 5] = a
        found[k, 6] = np.sqrt(square / max(used[k], 1))


@compiled
def read_window(
    samples: FloatArray,
    times: FloatArray,
    segments: FloatArray,
    sign: float,
    low: float,
    high: float,
    span: IntArray,
    scratch: FloatArray,
) -> tuple[int, int]:
    """Fills `scratch` with the samples of a `span`, thinned; how many, and how many are lost.

    Their times too. Lost and stuck ones have no weight. Stuck are three or more in a row on the
    channel's least or largest value.
    """
    first, stop, shift = span[0], span[1], span[2]
    stride = -(-(stop - first) // MOST_SAMPLES)
    count = -(-(stop - first) // stride)
    low, high = sign * low, sign * high
    lost = extreme = 0
    for i in range(count):
        value = sign * samples[first + i * stride + shift]
        there = np.isfinite(value)
        scratch[VALUE, i] = value
        scratch[WEIGHT, i] = 1.0 if there else 0.0
        scratch[STUCK, i] = 0.0
        lost += not there
        extreme += (value == low) | (value == high)
    if extreme > 2:
        _without_stuck(count, low, high, scratch)
    if times.size > 0:
        for i in range(count):
            scratch[TIME, i] = times[first + i * stride + shift]
        return count, lost
    i = 0
    for segment in range(segments.shape[0]):
        begin, start_s, period_s = segments[segment, 0], segments[segment, 1], segments[segment, 2]
        end = segments[segment + 1, 0] if segment + 1 < segments.shape[0] else np.inf
        while i < count and first + i * stride < end:
            scratch[TIME, i] = start_s + (first + i * stride - begin) * period_s
            i += 1
    return count, lost


@compiled
def _without_stuck(count: int, low: float, high: float, scratch: FloatArray) -> None:
    """Marks stuck samples and takes their weight."""
    values = scratch[VALUE]
    run = 0
    for i in range(count):
        on = values[i] in (low, high)
        run = run + 1 if on and (run == 0 or values[i] == values[i - 1]) else (1 if on else 0)
        if run >= 3:
            scratch[STUCK, i - 2 : i + 1], scratch[WEIGHT, i - 2 : i + 1] = 1.0, 0.0


@compiled
def _shapes(
    count: int,
    time_s: float,
    omega: float,
    alpha: float,
    table: FloatArray,
    window_rad: float,
    scratch: FloatArray,
) -> None:
    """Fills angle, template, its slope and scatter at each sample.

    Linear between the table's points, constant outside.
    """
    times, phis, shapes, slopes = scratch[TIME], scratch[PHI], scratch[SHAPE], scratch[SLOPE]
    scale, most = (table.shape[0] - 1) / (2.0 * window_rad), table.shape[0] - 1.001
    for i in range(count):
        tau = times[i] - time_s
        phi = (omega + 0.5 * alpha * tau) * tau
        place = (phi + window_rad) * scale
        place = place if place > 0.0 else 0.0
        place = place if place < most else most
        lower = int(place)
        share = place - lower
        phis[i] = phi
        shapes[i] = table[lower, 0] + share * (table[lower + 1, 0] - table[lower, 0])
        slopes[i] = table[lower, 1] + share * (table[lower + 1, 1] - table[lower, 1])
        scratch[SCATTER, i] = table[lower, 2]


@compiled
def _step(
    count: int, hold: float, scratch: FloatArray
) -> tuple[float, float, float, float, float, float]:
    """One Gauss-Newton step: a, b, -b s, b e, and the variances of the last two.

    These are per noise variance; residuals of all samples that are there (0 where lost) go to
    `scratch`. The stretch is held by `hold`; the other three have a prior too weak to matter, for
    rows without samples.
    """
    values, weights, phis, shapes, slopes, residuals = (
        scratch[VALUE], scratch[WEIGHT], scratch[PHI], scratch[SHAPE], scratch[SLOPE],
        scratch[RESIDUAL],
    )  # fmt: skip
    n00 = n10 = n20 = n30 = n11 = n21 = n31 = n22 = n32 = n33 = r0 = r1 = r2 = r3 = 0.0
    for i in range(count):
        if weights[i] > 0:
            value, shape, slope = values[i], shapes[i], slopes[i]
            bent = phis[i] * slope
            n00 += 1.0
            n10 += shape
            n20 += slope
            n30 += bent
            n11 += shape * shape
            n21 += slope * shape
            n31 += bent * shape
            n22 += slope * slope
            n32 += bent * slope
            n33 += bent * bent
            r0 += value
            r1 += value * shape
            r2 += value * slope
            r3 += value * bent
    n33 += hold
    weak = 1e-9 * (n00 + n11 + n22 + n33 + 1e-30)
    solved = _solve(
        (n00 + weak, n11 + weak, n22 + weak, n33 + weak),
        (n10, n20, n30, n21, n31, n32),
        (r0, r1, r2, r3),
    )
    a, b, c, d = solved[0], solved[1], solved[2], solved[3]
    for i in range(count):
        residual = values[i] - (a + b * shapes[i] + (c + d * phis[i]) * slopes[i])
        residuals[i] = residual if np.isfinite(residual) else 0.0
    return solved


@compiled
def _solve(
    diagonal: tuple[float, float, float, float],
    below: tuple[float, float, float, float, float, float],
    right: tuple[float, float, float, float],
) -> tuple[float, float, float, float, float, float]:
    """The solution of four normal equations, and two diagonal elements of the inverse.

    The last two elements, by L D L'. `below` the diagonal: 10, 20, 30, 21, 31, 32. Nothing here is
    a loop or a root: a fit waits for this.
    """
    n10, n20, n30, n21, n31, n32 = below
    r0, r1, r2, r3 = right
    i0 = 1.0 / diagonal[0]
    l10, l20, l30 = n10 * i0, n20 * i0, n30 * i0
    i1 = 1.0 / (diagonal[1] - l10 * n10)
    n21 -= l20 * n10
    n31 -= l30 * n10
    l21, l31 = n21 * i1, n31 * i1
    i2 = 1.0 / (diagonal[2] - l20 * n20 - l21 * n21)
    n32 -= l30 * n20 + l31 * n21
    l32 = n32 * i2
    i3 = 1.0 / (diagonal[3] - l30 * n30 - l31 * n31 - l32 * n32)
    r1 -= l10 * r0
    r2 -= l20 * r0 + l21 * r1
    r3 -= l30 * r0 + l31 * r1 + l32 * r2
    d = r3 * i3
    c = r2 * i2 - l32 * d
    b = r1 * i1 - l21 * c - l31 * d
    return r0 * i0 - l10 * b - l20 * c - l30 * d, b, c, d, i2 + l32 * l32 * i3, i3


@compiled
def _wild(count: int, height: float, noise: float, scratch: FloatArray) -> bool:
    """Whether any samples are wild; takes the weight off these.

    Their residual leaves the mean of its neighbours', by more than theirs do, or they are not the
    tire at all.
    """
    limit, foreign = (
        max(WILD_SIGMAS * noise, WILD_SHARE * height),
        max(WILD_SIGMAS * noise, FOREIGN_SHARE * height),
    )
    values, weights, residuals, bends = (
        scratch[VALUE],
        scratch[WEIGHT],
        scratch[RESIDUAL],
        scratch[BEND],
    )
    most = 0.0
    for i in range(count):
        if scratch[STUCK, i] > 0:
            residuals[i] = 0.0
        size = abs(residuals[i])
        most = size if size > most else most
    if (
        most <= 0.5 * limit
    ):  # no residual leaves its neighbours' mean by more than twice the largest
        return False
    bends[0] = bends[count - 1] = 0.0
    for i in range(1, count - 1):
        bend = abs(residuals[i] - 0.5 * (residuals[i - 1] + residuals[i + 1]))
        bends[i] = bend if np.isfinite(values[i - 1] + values[i] + values[i + 1]) else 0.0
    found = False
    for i in range(count):
        largest = max(bends[max(i - 1, 0)], bends[min(i + 1, count - 1)])
        usual = WILD_SCATTERS * height * scratch[SCATTER, i]
        if (bends[i] > max(limit, usual) and bends[i] >= largest) or abs(residuals[i]) > max(
            foreign, usual
        ):
            weights[i] = 0.0
            found = True
    return found
