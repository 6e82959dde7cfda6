"""The form of this log's passages, first from an average of some.

some passages of one speed, scaled by the template's height
    --cells along xi--> Average
    --damped Gauss-Newton with the physical family--> Reference, a start for all speeds
(`refine` then goes back to the samples)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tirelog.strain.footprint.family import HIGHEST, LOWEST, EdgeFamily, EdgeShape
from tirelog.vocabulary.arrays import FloatArray

#: cells along xi over the window; twice as many have half of the samples each and take twice as
#: long
CELLS = 120
#: Levenberg-Marquardt steps from one start, at most; twice as many only help a start that has not
#: settled by then
ITERATIONS = 25
#: a start is good enough if the next step gains less of the squared misfit; `refine` does the
#: rest; twice as much leaves up to that much more for it
GOOD_ENOUGH = 1.0
#: highest wave number times half length that the family keeps
HIGHEST_WAVE = 42.0
#: forms are tabled at speeds between which tension (over sqrt(EJ k)) and length (its logarithm)
#: change by no more than this, at so many speeds at most; twice as coarse, half as many forms are
#: tabled, and more lies between them
TENSION_STEP, LENGTH_STEP, MOST_KNOTS = 0.08, 0.02, 16
#: what is weakly known of a start: mean and standard deviation of normal priors of its first
#: parameters, the bending length over a rough half length, tension, tread, damping, tilt; behind
#: them come the half length, height, offset and shift
_PRIOR_MEAN = np.array([0.7, 1.0, 1.0, 0.0, 0.0])
_PRIOR_SD = np.array([2.0, 30.0, 30.0, 0.4, 0.5])
_KNOWN, _LENGTH, _SCALED = 5, 5, slice(6, 8)
#: starts: tread, and half length over the rough one
_STARTS = ((0.1, 1.0), (2.5, 0.85))


@dataclass(frozen=True)
class Average:
    """Mean passage at one speed, by cells along the tread.

    `xi_m` (cells,) mean abscissa of each cell's samples, `values` (cells,) their mean, height about
    one and patch downward, `weight` (cells,) inverse variance of the mean (0 if a cell holds
    nothing), `spread_m2` variance of the abscissae.
    """

    speed_m_s: float
    xi_m: FloatArray
    values: FloatArray
    weight: FloatArray
    spread_m2: FloatArray


@dataclass(frozen=True)
class Reference:
    """The log's form at some speeds.

    `speed_m_s` (k,) ascending, `shapes` at each, `shifts_m` (k,) of the form behind the passages'
    centres; `inertia`: fall of the tension with the squared speed [s^2/m^2]; `heights` (k,) of the
    passages it was learnt from. After `refine`: `length_se_m` (k,), the error of a full length from
    not knowing the form's parameters better; `misfit`, squared residual per degree of `freedom`;
    `residuals` (k, cells) at `residual_xi_m`, what the form leaves of the passages in units of
    their height (None if that is noise).
    """

    family: EdgeFamily
    speed_m_s: FloatArray
    shapes: tuple[EdgeShape, ...]
    shifts_m: FloatArray
    inertia: float
    heights: FloatArray
    length_se_m: FloatArray
    misfit: float = float("nan")
    freedom: float = 0.0
    residual_xi_m: FloatArray | None = None
    residuals: FloatArray | None = None

    def at_speeds(self, speed_m_s: FloatArray) -> Reference:
        """The same reference at other speeds (ascending).

        Tension by the inertia, the rest linear between its own speeds.
        """
        own, values = self.speed_m_s, np.array([shape.array() for shape in self.shapes])
        at_rest = values[:, 2] + self.inertia * own**2
        columns = [
            np.interp(speed_m_s, own, column)
            for column in (values[:, 0], values[:, 1], at_rest, *values[:, 3:].T)
        ]
        columns[2] = columns[2] - self.inertia * speed_m_s**2
        shapes = tuple(
            EdgeShape.of(np.clip(row, LOWEST, HIGHEST)) for row in np.column_stack(columns)
        )
        left = self.residuals
        if left is not None:
            left = np.column_stack([np.interp(speed_m_s, own, column) for column in left.T])
        shifts, heights, errors = (
            np.interp(speed_m_s, own, column)
            for column in (self.shifts_m, self.heights, self.length_se_m)
        )
        return replace(
            self,
            speed_m_s=speed_m_s,
            shapes=shapes,
            shifts_m=shifts,
            residuals=left,
            heights=heights,
            length_se_m=errors,
        )

    def knots(self, slowest_m_s: float, fastest_m_s: float) -> FloatArray:
        """Speeds from slowest to fastest, close enough for straight lines between them.

        Form and tension are straight in the squared speed from one to the next.
        """
        fall = abs(self.inertia) * (fastest_m_s**2 - slowest_m_s**2)
        lengths = np.array(
            [
                shape.half_length_m
                for shape in self.at_speeds(np.array([slowest_m_s, fastest_m_s])).shapes
            ]
        )
        count = int(
            np.clip(
                np.ceil(
                    max(fall / TENSION_STEP, np.abs(np.log(lengths[1] / lengths[0])) / LENGTH_STEP)
                ),
                1,
                MOST_KNOTS,
            )
        )
        squares = slowest_m_s**2 + (np.arange(count) + 0.5) / count * (
            fastest_m_s**2 - slowest_m_s**2
        )
        return np.sqrt(squares)


def average(
    xi_m: FloatArray,
    values: FloatArray,
    noise: FloatArray,
    speed_m_s: float,
    half_window_m: float,
    cells: int = CELLS,
) -> Average:
    """Mean of samples `values` in cells of equal width.

    Samples of any shape, height about one, at `xi_m` with standard deviations `noise`.
    """
    good = np.isfinite(values) & (np.abs(xi_m) < half_window_m)
    xi, value, weight = xi_m[good], values[good], noise[good] ** -2.0
    cell = (
        ((xi + half_window_m) * (cells / (2.0 * half_window_m))).astype(np.int64).clip(0, cells - 1)
    )
    total: FloatArray = np.bincount(cell, weight, cells).astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean_xi = np.bincount(cell, weight * xi, cells) / total
        mean = np.bincount(cell, weight * value, cells) / total
        spread = np.bincount(cell, weight * xi**2, cells) / total - mean_xi**2
    middle = (np.arange(cells) + 0.5) * (2.0 * half_window_m / cells) - half_window_m
    empty = total == 0
    return Average(
        speed_m_s,
        np.where(empty, middle, mean_xi),
        np.where(empty, 0.0, mean),
        total,
        np.where(empty, 0.0, np.maximum(spread, 0.0)),
    )


class _Problem:
    """Residuals and derivatives of an average for a vector of parameters (_PRIOR_MEAN)."""

    def __init__(self, family: EdgeFamily, average: Average, scale_m: float) -> None:
        self.family, self.average, self.scale_m = family, average, scale_m
        # the mean over a cell's samples bends by half of their variance: cos(kappa x) -> cos(kappa
        # x) (1 - kappa^2 spread / 2)
        self.basis = family.basis(average.xi_m) * (
            1.0 - 0.5 * np.multiply.outer(average.spread_m2, family.kappa_1_m**2)
        )
        self.root = np.sqrt(average.weight)

    def shape(self, theta: FloatArray) -> EdgeShape:
        """The form."""
        values = np.array([theta[_LENGTH], theta[0] * self.scale_m, *theta[1:_KNOWN]])
        return EdgeShape.of(np.clip(values, LOWEST, HIGHEST))

    def evaluate(self, theta: FloatArray) -> FloatArray:
        """The average as the form predicts it, (cells,)."""
        height, offset, shift = theta[_LENGTH + 1 :]
        turn = np.exp(-1j * self.family.kappa_1_m * shift)
        waveform: FloatArray = (
            height * (self.basis @ (self.family.spectrum(self.shape(theta)) * turn)).real + offset
        )
        return waveform

    def settled(self, theta: FloatArray) -> FloatArray:
        """`theta` with the height and offset that fit best.

        They are linear, and leaving them to the steps bends the valley.
        """
        theta = theta.copy()
        theta[_SCALED] = 1.0, 0.0
        wave = self.evaluate(theta)
        design = np.column_stack([wave, np.ones_like(wave)]) * self.root[:, None]
        theta[_SCALED] = np.linalg.solve(
            design.T @ design, design.T @ (self.average.values * self.root)
        )
        return theta

    def residuals(self, theta: FloatArray) -> FloatArray:
        """Weighted residual, and that of what is known, (cells + 5,)."""
        left = self.root * (self.average.values - self.evaluate(theta))
        return np.concatenate([left, (_PRIOR_MEAN - theta[:_KNOWN]) / _PRIOR_SD])

    def jacobian(self, theta: FloatArray) -> FloatArray:
        """Derivatives of the weighted prediction, (cells + 5, parameters)."""
        height, _, shift = theta[_LENGTH + 1 :]
        spectra, turning = self.family.jacobian(self.shape(theta)), 1j * self.family.kappa_1_m
        columns = np.column_stack([spectra, -turning * spectra[:, 0]])
        waves = (self.basis @ (columns * np.exp(-turning * shift)[:, None])).real
        wave, length, ell, tension, tread, damping, tilt, slope = waves.T
        block = np.column_stack(
            [
                *(height * wave for wave in (ell * self.scale_m, tension, tread, damping, tilt)),
                *(height * length, wave, np.ones_like(wave), height * slope),
            ]
        )
        known = np.zeros((_KNOWN, theta.size))
        known[:, :_KNOWN] = np.diag(1.0 / _PRIOR_SD)
        return np.vstack([block * self.root[:, None], known])


def _bounded(theta: FloatArray, scale_m: float) -> FloatArray:
    """`theta` within what the family allows."""
    theta = theta.copy()
    theta[0] = np.clip(theta[0], LOWEST[1] / scale_m, HIGHEST[1] / scale_m)
    theta[1:3] = np.clip(theta[1:3], LOWEST[2:4], HIGHEST[2:4])
    theta[_LENGTH] = np.clip(theta[_LENGTH], LOWEST[0], HIGHEST[0])
    return theta


def _descend(problem: _Problem, theta: FloatArray) -> tuple[FloatArray, float]:
    """Levenberg-Marquardt from `theta`: the best parameters and their cost."""
    damping, residual = 1e-3, problem.residuals(theta)
    cost = float(residual @ residual)
    jacobian = problem.jacobian(theta)
    for _ in range(ITERATIONS):
        normal, gradient = jacobian.T @ jacobian, jacobian.T @ residual
        step = np.linalg.solve(
            normal + damping * np.diag(np.diag(normal) + 1e-12 * np.trace(normal)), gradient
        )
        trial = problem.settled(_bounded(theta + step, problem.scale_m))
        new = problem.residuals(trial)
        new_cost = float(new @ new)
        if new_cost < cost:
            done = cost - new_cost < GOOD_ENOUGH + 1e-2 * new_cost
            theta, residual, cost, damping = trial, new, new_cost, max(0.2 * damping, 1e-9)
            jacobian = problem.jacobian(theta)
            if done:
                break
        else:
            damping *= 6.0
            if damping > 1e6:
                break
    return theta, cost


def fit_average(
    average: Average, speed_m_s: FloatArray, radius_m: float, start_length_m: float
) -> Reference:
    """The family (its straight member) fitted to an average; alike at all of `speed_m_s` (k,).

    The best of several starts; `start_length_m` is a rough half length.
    """
    family = EdgeFamily(radius_m, HIGHEST_WAVE / (0.8 * start_length_m))
    problem = _Problem(family, average, start_length_m)
    height = float(np.ptp(average.values[average.weight > 0]))
    found = []
    for tread, factor in _STARTS:
        tension, length_m = 0.3 if tread < 1 else 3.0, start_length_m * factor
        start = np.array([0.75, tension, tread, 0.0, 0.0, length_m, height, 0.0, 0.0])
        found.append(_descend(problem, problem.settled(start)))
    theta, _ = min(found, key=lambda result: result[1])
    alike = np.ones(speed_m_s.size)
    return Reference(
        family,
        speed_m_s,
        (problem.shape(theta),) * speed_m_s.size,
        theta[-1] * alike,
        0.0,
        theta[_LENGTH + 1] * alike,
        0.0 * alike,
    )
