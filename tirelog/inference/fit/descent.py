"""The one descent of every fit: damped least squares (Levenberg-Marquardt) within bounds.

    LeastSquares, theta (p,) --damped steps, each no longer than the parameters' sizes--> Reached

A parameter that stands at a bound and would leave it is held for that step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tirelog.vocabulary.arrays import FloatArray

#: steps of a descent at most; twice as many only matter to fits that have not settled by then,
#: which is said
MOST_STEPS = 25
#: a step that gains less than this share of the sum of squares, and less than this of it (1 is
#: what a parameter costs that is off by its standard error), is the last; twice as much of the
#: latter may leave a parameter off by 0.8 of its standard error
SETTLED = 1e-4
_SETTLED_BY = 0.3
#: slopes of an earlier point are made anew after a step that gains less than this share of what
#: they let hope for; twice as much makes them anew more often
_POOR = 0.1
#: dampings tried for one step; twice as many damp further down before a step is given up
_TRIALS = 8


class LeastSquares(Protocol):
    """What a descent asks of a problem.

    Residuals and slopes are in a metric in which they count alike, N values.
    """

    def residual(self, theta: FloatArray) -> FloatArray:
        """Measured less predicted (N,) at a point to go on from; ModelError if it is refused."""

    def slopes(self, theta: FloatArray, size: FloatArray) -> FloatArray:
        """Derivatives of the prediction by theta / size, (N, p), where the last residual was."""

    def square(self, theta: FloatArray) -> float:
        """Sum of squares of the residual at a point on trial; infinite if it is refused."""


@dataclass(frozen=True)
class Reached:
    """Where a descent ended: point (p,), sum of squares, whether more steps would gain little."""

    theta: FloatArray
    square: float
    settled: bool


def descend(
    problem: LeastSquares,
    theta: FloatArray,
    low: FloatArray,
    high: FloatArray,
    sizes: Callable[[FloatArray], FloatArray],
    *,
    steps: int = MOST_STEPS,
    settled: float = SETTLED,
    renewed: Callable[[], bool] = lambda: False,
) -> Reached:
    """The least sum of squares near `theta` (p,) within `low` and `high` (p,).

    sizes       sizes (p,) of the parameters at a point: the longest step
    renewed     were some of the last slopes those of an earlier point?  None of the next will be
    ModelError  the start itself is refused; any later point that is refused is a step too far
    """
    residual = problem.residual(theta)
    square, damping = float((residual**2).sum()), 1e-3
    for _ in range(steps if theta.size else 0):
        size = sizes(np.clip(theta, low, high))
        slope = problem.slopes(theta, size)
        gram, gradient = slope.T @ slope, slope.T @ residual
        free = ~leaving(theta, low, high, gradient)
        for _ in range(_TRIALS):
            new = np.clip(theta + _damped(gram, gradient, free, damping) * size, low, high)
            reached = problem.square(new)
            if reached < square:
                break
            damping = max(damping, 1e-6) * 8.0
        else:
            if renewed():
                damping = 1e-3
                continue
            return Reached(theta, square, True)
        moved = (new - theta) / size
        hoped = float(moved @ (2.0 * gradient - gram @ moved))
        drop, theta, damping = square - reached, new, damping / 10.0
        if drop < _POOR * hoped:
            renewed()
        residual = problem.residual(theta)
        square = float((residual**2).sum())
        if drop < settled * square and drop < _SETTLED_BY and not renewed():
            return Reached(theta, square, True)
    return Reached(theta, square, not theta.size)


def leaving(
    theta: FloatArray, low: FloatArray, high: FloatArray, gradient: FloatArray
) -> NDArray[np.bool_]:
    """Which parameters stand at a bound that the next step would cross.

    `gradient` (p,) points to where the sum of squares falls.
    """
    return ((theta <= low) & (gradient < 0)) | ((theta >= high) & (gradient > 0))


def _damped(
    gram: FloatArray, gradient: FloatArray, free: NDArray[np.bool_], damping: float
) -> FloatArray:
    """A damped step of the free parameters in units of their sizes, at most one size each."""
    step = np.zeros(gradient.size)
    square = gram[np.ix_(free, free)]
    square = square + damping * np.diag(np.diag(square) + 1e-9 * np.trace(gram))
    step[free] = np.linalg.lstsq(square, gradient[free], rcond=1e-12)[0]
    return np.clip(step, -1.0, 1.0)
