"""The form of this log's passages, first from averages.

At several speeds, fitted with the physical family at once.

    some passages of each speed, scaled by the template's height
        --cells along xi--> Average, one a speed
    Averages
        --damped Gauss-Newton, what is the tire's own shared, length and height free per speed-->
        Reference, a start
    (`refine` then goes back to the samples)

Shared: bending length, tread, tilt, and tension and damping as they follow the speed (tension -
inertia v^2: P1 (3); damping d0 + d1 v).
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
#: averages that a start looks at; twice as many take twice as long
MOST_AVERAGES = 4
#: highest wave number times half length that the family keeps
HIGHEST_WAVE = 42.0
#: forms are tabled at speeds between which tension (over sqrt(EJ k)) and length (its logarithm)
#: change by no more than this, at so many speeds at most; twice as coarse, half as many forms are
#: tabled, and more lies between them
TENSION_STEP, LENGTH_STEP, MOST_KNOTS = 0.08, 0.02, 16
#: parameters that all speeds share: bending length, tension at rest, inertia (tension per squared
#: scaled speed), tread, tilt, d0, d1
SHARED = 7
#: weak knowledge of them: mean and standard deviation of a normal prior (bending length over the
#: starting length)
_PRIOR_MEAN = np.array([0.7, 1.0, 0.0, 1.0, 0.0, 0.0, 0.0])
_PRIOR_SD = np.array([2.0, 30.0, 1.0, 30.0, 0.5, 0.3, 0.3])


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
    """Residuals and derivatives of all averages for a vector of parameters.

    Parameters: SHARED, then (length, height, offset, shift) per average.
    """

    def __init__(self, family: EdgeFamily, averages: list[Average], start_length_m: float) -> None:
        self.family, self.averages, self.scale = family, averages, start_length_m
        self.top_speed = max(a.speed_m_s for a in averages)
        # the mean over a cell's samples bends by half of their variance: cos(kappa x) -> cos(kappa
        # x) (1 - kappa^2 spread / 2)
        self.bases = [
            family.basis(a.xi_m) * (1.0 - 0.5 * np.multiply.outer(a.spread_m2, family.kappa_1_m**2))
            for a in averages
        ]
        self.roots = [np.sqrt(a.weight) for a in averages]

    def shape(self, theta: FloatArray, number: int) -> EdgeShape:
        """The form at the speed of average `number`."""
        relative = self.averages[number].speed_m_s / self.top_speed
        ell, tension, inertia, tread, tilt, d0, d1 = theta[:SHARED]
        values = np.array(
            [
                theta[SHARED + 4 * number],
                ell * self.scale,
                tension - inertia * relative**2,
                tread,
                d0 + d1 * relative,
                tilt,
            ]
        )
        return EdgeShape.of(np.clip(values, LOWEST, HIGHEST))

    def evaluate(self, theta: FloatArray, number: int) -> FloatArray:
        """The average `number` as the form predicts it, shape (cells,)."""
        _, height, offset, shift = theta[SHARED + 4 * number : SHARED + 4 * number + 4]
        spectrum = self.family.spectrum(self.shape(theta, number)) * np.exp(
            -1j * self.family.kappa_1_m * shift
        )
        waveform: FloatArray = height * (self.bases[number] @ spectrum).real + offset
        return waveform

    def settled(self, theta: FloatArray) -> FloatArray:
        """`theta` with the height and offset at each speed that fit best.

        They are linear, and leaving them to the steps bends the valley.
        """
        theta = theta.copy()
        for number, (one, root) in enumerate(zip(self.averages, self.roots, strict=True)):
            at = slice(SHARED + 4 * number + 1, SHARED + 4 * number + 3)
            theta[at] = 1.0, 0.0
            design = (
                np.column_stack([self.evaluate(theta, number), np.ones_like(one.values)])
                * root[:, None]
            )
            theta[at] = np.linalg.solve(design.T @ design, design.T @ (one.values * root))
        return theta

    def residuals(self, theta: FloatArray) -> FloatArray:
        parts = [
            root * (a.values - self.evaluate(theta, i))
            for i, (a, root) in enumerate(zip(self.averages, self.roots, strict=True))
        ]
        return np.concatenate([*parts, (_PRIOR_MEAN - theta[:SHARED]) / _PRIOR_SD])

    def jacobian(self, theta: FloatArray) -> FloatArray:
        """Derivatives of the weighted prediction, shape (rows, parameters)."""
        blocks = []
        for number, (average_, root) in enumerate(zip(self.averages, self.roots, strict=True)):
            relative = average_.speed_m_s / self.top_speed
            _, height, _, shift = theta[SHARED + 4 * number : SHARED + 4 * number + 4]
            spectra = self.family.jacobian(self.shape(theta, number))
            turn = np.exp(-1j * self.family.kappa_1_m * shift)
            columns = (
                np.column_stack([spectra, -1j * self.family.kappa_1_m * spectra[:, 0]])
                * turn[:, None]
            )
            waves = (self.bases[number] @ columns).real
            wave, length, ell, tension, tread, damping, tilt, slope = waves.T
            block = np.zeros((root.size, theta.size))
            block[:, :SHARED] = height * np.column_stack(
                [
                    ell * self.scale,
                    tension,
                    -(relative**2) * tension,
                    tread,
                    tilt,
                    damping,
                    relative * damping,
                ]
            )
            block[:, SHARED + 4 * number : SHARED + 4 * number + 4] = np.column_stack(
                [height * length, wave, np.ones_like(wave), height * slope]
            )
            blocks.append(block * root[:, None])
        prior = np.zeros((SHARED, theta.size))
        prior[:, :SHARED] = np.diag(1.0 / _PRIOR_SD)
        return np.vstack([*blocks, prior])


def _bounded(theta: FloatArray, scale: float) -> FloatArray:
    """`theta` within what the family allows."""
    theta = theta.copy()
    theta[0] = np.clip(theta[0], LOWEST[1] / scale, HIGHEST[1] / scale)
    theta[1] = np.clip(theta[1], LOWEST[2], HIGHEST[2])
    theta[3] = np.clip(theta[3], LOWEST[3], HIGHEST[3])
    theta[SHARED::4] = np.clip(theta[SHARED::4], LOWEST[0], HIGHEST[0])
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
        trial = problem.settled(_bounded(theta + step, problem.scale))
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


def _start(averages: list[Average], length_m: float, tread: float) -> FloatArray:
    """Parameters to start from: every speed alike, height from the averages' range."""
    theta = [0.75, 0.3 if tread < 1 else 3.0, 0.1, tread, 0.0, 0.0, 0.0]
    for one in averages:
        known = one.values[one.weight > 0]
        theta += [length_m, float(np.ptp(known)), float(np.median(known)), 0.0]
    return np.array(theta)


def _best(
    family: EdgeFamily, averages: list[Average], length_m: float
) -> tuple[_Problem, FloatArray]:
    """The problem of all averages, and the parameters that solve it.

    The best of several starts on the average with the most samples, then all averages from there.
    """
    richest = int(np.argmax([a.weight.sum() for a in averages]))
    single = _Problem(family, [averages[richest]], length_m)
    found = []
    for tread, factor in ((0.1, 1.0), (2.5, 0.85)):
        theta = _start([averages[richest]], length_m * factor, tread)
        found.append(_descend(single, single.settled(theta)))
    theta_one, _ = min(found, key=lambda result: result[1])
    if len(averages) == 1:
        return single, theta_one
    problem = _Problem(family, averages, length_m)
    theta = np.concatenate([theta_one[:SHARED], np.tile(theta_one[SHARED:], len(averages))])
    # the single fit's inertia and damping hold at its own speed: spread them over the common scale
    theta[1], theta[2] = theta_one[1] - theta_one[2], 0.0
    theta[5], theta[6] = theta_one[5] + theta_one[6], 0.0
    return problem, _descend(problem, theta)[0]


def fit_averages(averages: list[Average], radius_m: float, start_length_m: float) -> Reference:
    """The family (its straight member) fitted to some of the `averages`.

    These are of ascending speed; `start_length_m` is a rough half length.
    """
    family = EdgeFamily(radius_m, HIGHEST_WAVE / (0.8 * start_length_m))
    some = [
        averages[k] for k in np.unique(np.linspace(0, len(averages) - 1, MOST_AVERAGES).astype(int))
    ]
    problem, theta = _best(family, some, start_length_m)
    shapes = tuple(problem.shape(theta, i) for i in range(len(some)))
    speed = np.array([a.speed_m_s for a in some])
    heights, shifts = theta[SHARED + 1 :: 4], theta[SHARED + 3 :: 4]
    found = Reference(
        family,
        speed,
        shapes,
        shifts,
        float(theta[2]) / problem.top_speed**2,
        heights,
        np.zeros(speed.size),
    )
    return found.at_speeds(np.array([a.speed_m_s for a in averages]))
