"""The waveform of a passage, learnt from the log: one smooth curve over the wheel angle.

    samples of a few hundred passages (angle from the centre, value scaled to height 1) --cubic splines--> Template

The angle, not the time, is the abscissa, so one template serves every speed.  Its zero is the middle between the two places where it
crosses half of its height: the *patch centre* of every command.  An odd part of the waveform moves that middle less than the extremum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tirelog.recording import FloatArray

#: knots over the template's window, and points of its table
INTERVALS, TABLE = 40, 4096
#: smoothing: weight of the squared third differences against the mean number of samples in a knot interval
SMOOTHING = 1e-3
#: the fit's window in half widths (half level): edges and shoulders, where the slope is
WINDOW_HALF_WIDTHS = 1.8
NARROWEST_RAD, WIDEST_RAD = 0.1, 0.8


@dataclass(frozen=True)
class Template:
    """`values` and `slope` [1/rad], shape (g,), at `phi_rad` (g,), evenly spaced over +-`window_rad`; height 1, patch upward.

    `half_width_rad`: half of the distance between the half-level crossings, which lie at -half_width_rad and +half_width_rad.
    """

    phi_rad: FloatArray
    values: FloatArray
    slope: FloatArray
    window_rad: float
    half_width_rad: float

    def mirrored(self) -> Template:
        """The waveform of a wheel that rolls backwards."""
        return replace(self, values=self.values[::-1].copy(), slope=-self.slope[::-1])

    def __call__(self, phi_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Value and slope at `phi_rad`, linear between the table's points, constant outside."""
        place = (phi_rad - self.phi_rad[0]) * ((self.phi_rad.size - 1) / (self.phi_rad[-1] - self.phi_rad[0]))
        place = np.clip(place, 0.0, self.phi_rad.size - 1.001)
        low = place.astype(np.int64)
        share = place - low
        values, slope = self.values, self.slope
        return (
            values[low] + share * (values[low + 1] - values[low]),
            slope[low] + share * (slope[low + 1] - slope[low]),
        )


def _basis(place: FloatArray) -> FloatArray:
    """The four cubic B-splines that are not zero at the fraction `place` in [0, 1] of a knot interval, shape (4, n)."""
    u = place
    return np.array([(1 - u) ** 3, 3 * u**3 - 6 * u**2 + 4, -3 * u**3 + 3 * u**2 + 3 * u + 1, u**3]) / 6.0


def _basis_slope(place: FloatArray) -> FloatArray:
    """Derivatives of `_basis` by `place`, shape (4, n)."""
    u = place
    return np.array([-((1 - u) ** 2), 3 * u**2 - 4 * u, -3 * u**2 + 2 * u + 1, u**2]) / 2.0


def _knots(phi: FloatArray, window: float) -> tuple[np.ndarray, FloatArray]:
    """Knot interval (integer) and the fraction in it for angles within +-window."""
    place = np.clip((phi + window) * (INTERVALS / (2 * window)), 0.0, INTERVALS - 1e-9)
    interval = place.astype(np.int64)
    return interval, place - interval


def smooth_curve(phi: FloatArray, values: FloatArray, window: float) -> FloatArray:
    """Spline coefficients, shape (INTERVALS + 3,), of the least-squares curve through the samples within +-window."""
    inside = np.abs(phi) < window
    interval, place = _knots(phi[inside], window)
    basis = _basis(place)
    size = INTERVALS + 3
    normal, right = np.zeros((size, size)), np.zeros(size)
    for i in range(4):
        right += np.bincount(interval + i, basis[i] * values[inside], size)
        for j in range(4):
            cell = np.bincount((interval + i) * size + interval + j, basis[i] * basis[j], size * size)
            normal += cell.reshape(size, size)
    rough = np.diff(np.eye(size), 3, axis=0)
    normal += SMOOTHING * max(inside.sum() / INTERVALS, 1.0) * rough.T @ rough + 1e-12 * np.eye(size)
    return np.asarray(np.linalg.solve(normal, right), np.float64)


def evaluate(coefficients: FloatArray, phi: FloatArray, window: float) -> tuple[FloatArray, FloatArray]:
    """Value and slope [1/rad] of the spline at `phi`."""
    interval, place = _knots(phi, window)
    near = coefficients[interval + np.arange(4)[:, None]]
    return (_basis(place) * near).sum(0), (_basis_slope(place) * near).sum(0) * INTERVALS / (2 * window)


def half_level(phi: FloatArray, values: FloatArray) -> tuple[float, float] | None:
    """(middle, half width) of the crossings of half of the height above the ends' mean, or None where it has none."""
    base = 0.5 * (values[0] + values[-1])
    top = int(np.argmax(values))
    below = values < 0.5 * (values[top] + base)
    if not below[:top].any() or not below[top:].any():
        return None
    a = int(np.flatnonzero(below[:top])[-1])
    b = top + int(np.flatnonzero(below[top:])[0])
    level = 0.5 * (values[top] + base)
    entry = np.interp(level, values[[a, a + 1]], phi[[a, a + 1]])
    leave = np.interp(level, values[[b, b - 1]], phi[[b, b - 1]])
    return float(0.5 * (entry + leave)), float(0.5 * (leave - entry))


def learn(phi: FloatArray, values: FloatArray, window: float) -> Template | None:
    """The template of samples at `phi` [rad] within +-`window`; None where the curve has no two half-level crossings.

    Its table covers a window of WINDOW_HALF_WIDTHS half widths around the middle of the crossings, as far as `window` allows.
    """
    coefficients = smooth_curve(phi, values, window)
    grid = np.linspace(-window, window, TABLE)
    curve, _ = evaluate(coefficients, grid, window)
    found = half_level(grid, curve)
    if found is None:
        return None
    middle, half_width = found
    reach = min(float(np.clip(WINDOW_HALF_WIDTHS * half_width, NARROWEST_RAD, WIDEST_RAD)), window - abs(middle))
    table = np.linspace(-reach, reach, TABLE)
    curve, slope = evaluate(coefficients, table + middle, window)
    base = 0.5 * (curve[0] + curve[-1])
    height = curve.max() - base
    return Template(table, (curve - base) / height, slope / height, reach, half_width)
