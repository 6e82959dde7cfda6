"""Regressions of the dissipation on speed, through the means of the stretches of constant speed.

rows of constant speed --cut when the speed has moved on, mean of each piece--> points
    --line, weights from the scatter within and between stretches (Paule, Mandel), t quantiles-->
    Regression

Revolutions of one stretch share its road, temperature and load, so they are no independent
witnesses of a line: a stretch counts once, and the error of the slope is what the means of the
stretches scatter about the line.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.vocabulary.arrays import FloatArray, IntArray

#: rows of constant speed that a regression needs; half as many would leave a parabola one degree
#: of freedom, twice as many refuse short tests
LEAST_ROWS = 8
#: a stretch is cut when its speed has moved by this much [m/s]: a slow coast-down is no single
#: speed; twice as much halves the points of such a stretch and leaves others alone
PIECE_M_S = 1.0
#: means nearer than this are of one speed [m/s]: under one speed's scatter from stretch to
#: stretch, above the steps of a test plan; twice as much takes steps of less than 1 m/s for one
#: speed
SAME_SPEED_M_S = 0.5
#: probability that an interval covers; and the one of the test whether a parabola is needed; half
#: the rest, 0.975, makes intervals a seventh wider
COVERED = 0.95
#: a line is said to miss a mean that lies further off than this many of the mean's own standard
#: errors: by noise alone one line in a thousand does; at twice as many only a line that is visibly
#: wrong
FAR_OFF = 4.0
#: said of a line whose errors hold although its means lie far off
SCATTERED = "stretches scatter more than their revolutions, which the errors count"
#: halvings of the interval that holds the scatter between stretches
_HALVINGS = 60


@dataclass(frozen=True)
class Regression:
    """The line quantity = intercept + slope x speed, and what can be said of it.

    Through the means of `points` pieces of `stretches` stretches at `speeds` speeds.

    Standard errors from the scatter of the means about the line, with `degrees_of_freedom` (points
    - 2); NaN if that is 0. The slope lies between `slope_lower` and `slope_upper` with 95 %.
    `scatter`: standard deviation of the revolutions about the line; `miss`: the largest distance of
    a mean from the line, and `miss_sigmas` that in standard errors of the means themselves.
    `parabola`: coefficients (3,) of 1, speed, speed^2 through the same means, `curvature_se` the
    last one's error; NaN with fewer than three speeds. `judgement`: what can be said of the line.
    The means themselves: `speed_m_s`, `means`, `mean_se` (points,).
    """

    quantity: str
    intercept: float
    intercept_se: float
    slope: float
    slope_se: float
    slope_lower: float
    slope_upper: float
    scatter: float
    rows: int
    stretches: int
    points: int
    speeds: int
    degrees_of_freedom: int
    slowest_m_s: float
    fastest_m_s: float
    miss: float
    miss_sigmas: float
    parabola: tuple[float, float, float]
    curvature_se: float
    judgement: str
    speed_m_s: FloatArray
    means: FloatArray
    mean_se: FloatArray

    @property
    def curvature(self) -> float:
        """Coefficient of the squared speed of the parabola."""
        return self.parabola[2]

    @property
    def doubtful(self) -> bool:
        """Whether the line is not tested, or misses its means."""
        return bool(self.judgement) and not self.judgement.startswith(SCATTERED)


#: columns of the table that stand in a Regression
COLUMNS = (
    "quantity", "intercept", "intercept_se", "slope", "slope_se", "slope_lower", "slope_upper",
    "scatter", "rows", "stretches", "points", "speeds", "degrees_of_freedom", "slowest_m_s",
    "fastest_m_s", "miss", "miss_sigmas", "curvature", "curvature_se", "judgement",
)  # fmt: skip


@dataclass(frozen=True)
class _Line:
    """Coefficients and covariance of a polynomial through weighted means; degrees of freedom."""

    coefficients: FloatArray
    covariance: FloatArray
    free: int

    @property
    def errors(self) -> FloatArray:
        """Standard errors, NaN without a degree of freedom."""
        return np.sqrt(np.diag(self.covariance))


def _reach(free: int) -> float:
    """Half of the COVERED interval in standard errors: the t quantile for `free` degrees."""
    from scipy.special import stdtrit  # a tenth of a second that the table alone does without

    return float(stdtrit(max(free, 1), 0.5 + 0.5 * COVERED))


def pieces(speed_m_s: FloatArray, stretch: IntArray) -> IntArray:
    """Number of the piece of each row of sorted `stretch` (n,).

    A piece is a stretch, cut when its speed has moved by PIECE_M_S.
    """
    out, number, low, high = np.zeros(stretch.size, np.int64), 0, speed_m_s[0], speed_m_s[0]
    for row in range(1, stretch.size):
        low, high = min(low, speed_m_s[row]), max(high, speed_m_s[row])
        if stretch[row] != stretch[row - 1] or high - low > PIECE_M_S:
            number, low, high = number + 1, speed_m_s[row], speed_m_s[row]
        out[row] = number
    return out


def _through(design: FloatArray, means: FloatArray, variance: FloatArray) -> _Line:
    """Least squares of `means` (m,) on `design` (m, k).

    `variance` (m,): of each mean, from the scatter within its stretch.

    The scatter between stretches is what makes the weighted residuals as large as their degrees of
    freedom (Paule, Mandel); the covariance is scaled by those residuals (Knapp, Hartung), so that
    with a t quantile its intervals hold for few means.
    """
    free = means.size - design.shape[1]

    def solved(between: float) -> tuple[FloatArray, FloatArray, float]:
        weight = 1.0 / (variance + between)
        inverse = np.asarray(np.linalg.inv(design.T @ (weight[:, None] * design)), dtype=np.float64)
        found = inverse @ (design.T @ (weight * means))
        return found, inverse, float((weight * (means - design @ found) ** 2).sum())

    if free < 1:
        found, inverse, _ = solved(0.0)
        return _Line(found, np.full_like(inverse, np.nan), 0)
    low, high = 0.0, float(np.ptp(means)) ** 2
    if solved(low)[2] > free:
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if solved(middle)[2] > free else (low, middle)
    else:
        high = 0.0
    found, inverse, left = solved(high)
    return _Line(found, inverse * (left / free), free)


def regression(
    quantity: str, speed_m_s: FloatArray, values: FloatArray, stretch: IntArray
) -> Regression | None:
    """The line of `values` on `speed_m_s` (n,) through the means of the stretches.

    None if rows are too few or of one speed. `stretch` (n,): number of each row's stretch of
    constant speed; rows outside of stretches have -1 and are left out.
    """
    good = (stretch >= 0) & np.isfinite(values) & np.isfinite(speed_m_s)
    v, y, group = speed_m_s[good], values[good], stretch[good]
    if v.size < LEAST_ROWS:
        return None
    order = np.argsort(group, kind="stable")
    v, y, group = v[order], y[order], group[order]
    piece = pieces(v, group)
    count = np.bincount(piece)
    speed, means = np.bincount(piece, v) / count, np.bincount(piece, y) / count
    speeds = 1 + int((np.diff(np.sort(speed)) > SAME_SPEED_M_S).sum())
    if speeds < 2:
        return None
    within = float(((y - means[piece]) ** 2).sum()) / max(v.size - count.size, 1)
    # rounding alone is no scatter, and weights need one
    variance = np.maximum(within, (1e-12 * float(np.abs(means).max())) ** 2 + 1e-300) / count
    middle = float(speed.mean())
    powers = np.vander(speed - middle, 3, increasing=True)
    line = _through(powers[:, :2], means, variance)
    left = means - powers[:, :2] @ line.coefficients
    to_zero = np.array([1.0, -middle])
    slope, slope_se = float(line.coefficients[1]), float(line.errors[1])
    reach = slope_se * _reach(line.free)
    parabola, curvature_se, bent = (float("nan"),) * 3, float("nan"), False
    if speeds >= 3:
        curve = _through(powers, means, variance)
        a, b, c = (float(x) for x in curve.coefficients)
        parabola, curvature_se = (
            (a - b * middle + c * middle**2, b - 2.0 * c * middle, c),
            float(curve.errors[2]),
        )
        bent = curve.free > 0 and abs(c) > curvature_se * _reach(curve.free)
    sigmas = np.abs(left) / np.sqrt(variance)
    about = y - (line.coefficients[0] + slope * (v - middle))
    return Regression(
        quantity,
        float(to_zero @ line.coefficients),
        float(np.sqrt(to_zero @ line.covariance @ to_zero)),
        slope,
        slope_se,
        slope - reach,
        slope + reach,
        float(np.sqrt((about**2).sum() / (v.size - 2))),
        int(v.size),
        int(np.unique(group).size),
        int(count.size),
        speeds,
        line.free,
        float(v.min()),
        float(v.max()),
        float(np.abs(left).max()),
        float(sigmas.max()),
        parabola,
        curvature_se,
        _judgement(speeds, line.free, bent, float(sigmas.max())),
        speed,
        means,
        np.sqrt(variance),
    )


def _judgement(speeds: int, free: int, bent: bool, sigmas: float) -> str:
    """What can be said of a line through means at some `speeds`.

    Empty if nothing speaks against it.
    """
    far = f"the line misses a mean by {sigmas:.0f} of its errors" if sigmas > FAR_OFF else ""
    if speeds < 3 or free <= 1:
        untested = f"{speeds} speeds: a line is not tested"
        return f"{untested}; {far}, a parabola may follow them" if free > 0 and far else untested
    if bent:
        return "the line misses the means, a parabola follows them" + (f"; {far}" if far else "")
    return f"{SCATTERED} ({far})" if far else ""


def regression_table(lines: list[Regression]) -> dict[str, NDArray[Any]]:
    """The columns of some regressions."""
    return {name: np.array([getattr(line, name) for line in lines]) for name in COLUMNS}
