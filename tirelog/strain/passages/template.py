"""The waveform of a passage, learnt from the log: one smooth curve over the wheel angle.

    samples of a few hundred passages (angle from the centre, value scaled to height 1)
        --cubic splines--> Template

The angle, not the time, is the abscissa, so one template serves every speed. Its zero is the middle
between the two places where it crosses half of its height: the *patch centre* of every command. An
odd part of the waveform moves that middle less than the extremum.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tirelog.strain.passages.fit_kernels import POINT, spline_curve
from tirelog.vocabulary.arrays import FloatArray, Records

#: knots over the template's window, and points of its table; twice as many knots follow edges
#: twice as sharp, with half of the samples for each
INTERVALS, TABLE = 40, 4096
#: smoothing: weight of the squared third differences against the mean number of samples in a knot
#: interval; twice as much smooths what is narrower than a knot interval further
SMOOTHING = 1e-3
#: the fit's window in half widths (half level): edges and shoulders, where the slope is
WINDOW_HALF_WIDTHS = 1.8
#: bounds of that window on either side of the middle [rad]; half of the first is 1.5 cm on a car's
#: wheel, twice the second a quarter of a turn
NARROWEST_RAD, WIDEST_RAD = 0.1, 0.8
#: half of the contact length over half of the width at half level, roughly, for both carcasses
LENGTH_TO_WIDTH = 1.25


@dataclass(frozen=True)
class Template:
    """The waveform at even angles, shape (g,); height 1, patch upward.

    `values` and `slope` [1/rad] at `phi_rad` over +-`window_rad`.

    `half_width_rad`: half of the distance between the half-level crossings, which lie at
    -half_width_rad and +half_width_rad. `scatter` (g,): standard deviation between turns beyond the
    noise, over the height; None: not known, as if there were none.
    """

    phi_rad: FloatArray
    values: FloatArray
    slope: FloatArray
    window_rad: float
    half_width_rad: float
    scatter: FloatArray | None = None

    @property
    def table(self) -> Records:
        """The template as the kernels take it, (g,) of POINT."""
        table = np.empty(self.values.size, POINT)
        table["value"], table["slope"] = self.values, self.slope
        table["scatter"] = 0.0 if self.scatter is None else self.scatter
        return table

    def mirrored(self) -> Template:
        """The waveform of a wheel that rolls backwards."""
        scatter = None if self.scatter is None else self.scatter[::-1].copy()
        return replace(
            self, values=self.values[::-1].copy(), slope=-self.slope[::-1], scatter=scatter
        )


class CurveSums:
    """Normal equations of the least-squares spline through the samples.

    `normal` (s, s) upper triangle, `right` (s,), so many samples.
    """

    def __init__(self) -> None:
        self.normal = np.zeros((INTERVALS + 3, INTERVALS + 3))
        self.right = np.zeros(INTERVALS + 3)
        self.count = 0

    def coefficients(self) -> FloatArray:
        """The spline's coefficients, (INTERVALS + 3,)."""
        size = self.right.size
        rough = np.diff(np.eye(size), 3, axis=0)
        normal = self.normal + np.triu(self.normal, 1).T + 1e-12 * np.eye(size)
        normal += SMOOTHING * max(self.count / INTERVALS, 1.0) * rough.T @ rough
        return np.asarray(np.linalg.solve(normal, self.right), np.float64)


def _curve(coefficients: FloatArray, phi: FloatArray, window: float) -> FloatArray:
    """Value and slope [1/rad] of the spline at `phi`, shape (2, n)."""
    curve = np.empty((2, phi.size))
    spline_curve(coefficients, window, phi, *curve)
    return curve


def half_height(phi: FloatArray, values: FloatArray) -> tuple[float, float] | None:
    """(middle, half width) of the crossings of half of the height, or None without such.

    The height is above the ends' mean.
    """
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


def learned_template(sums: CurveSums, window: float) -> Template | None:
    """The template of the samples in `sums`, within +-`window` [rad], or None.

    None if the curve has no two half-level crossings. Its table covers a window of
    WINDOW_HALF_WIDTHS half widths around the middle of the crossings, as far as `window` allows.
    """
    coefficients = sums.coefficients()
    grid = np.linspace(-window, window, TABLE)
    found = half_height(grid, _curve(coefficients, grid, window)[0])
    if found is None:
        return None
    middle, half_width = found
    reach = min(
        float(np.clip(WINDOW_HALF_WIDTHS * half_width, NARROWEST_RAD, WIDEST_RAD)),
        window - abs(middle),
    )
    table = np.linspace(-reach, reach, TABLE)
    curve, slope = _curve(coefficients, table + middle, window)
    base = 0.5 * (curve[0] + curve[-1])
    height = curve.max() - base
    return Template(table, (curve - base) / height, slope / height, reach, half_width)
