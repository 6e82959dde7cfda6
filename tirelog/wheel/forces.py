"""Force maps: F_z = f_z(patch width), F_x = f_x(phase shift) (P4 section III).

For logs that have force channels.

regressors and measured forces of several logs
    --least squares, degree by cross-validation--> ForceMap --> force and its error
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tirelog.vocabulary.arrays import FloatArray
from tirelog.wheel.phase_shift import EdgeTimes

#: passages that a map needs, and contiguous parts that are left out in turn: each part is judged
#: by a map of the other four fifths; twice as many refuse short drives; in twice as many parts a
#: part tells less
LEAST, FOLDS = 40, 5


@dataclass(frozen=True)
class ForceMap:
    """Force [N] as a polynomial in (regressor - centre_deg), lowest power first.

    `covariance` of the coefficients; valid from `low_deg` to `high_deg`; `rms_N` the residual on
    held-out parts of the logs, which holds what the regressor does not know.
    """

    centre_deg: float
    coefficients: FloatArray
    covariance: FloatArray
    low_deg: float
    high_deg: float
    rms_N: float


def fit_force(
    logs: Sequence[EdgeTimes], regressors: Sequence[FloatArray], kind: str
) -> ForceMap | None:
    """The map of one force; None if the logs have no such channel, or too few passages."""
    xs, ys = [], []
    for p, x in zip(logs, regressors, strict=True):
        if kind in p.forces_N:
            rows = p.good & np.isfinite(x) & np.isfinite(p.forces_N[kind])
            xs.append(x[rows])
            ys.append(p.forces_N[kind][rows])
    x, y = (np.concatenate(part) if part else np.zeros(0) for part in (xs, ys))
    if x.size < LEAST:
        return None
    centre = float(np.mean(x))
    fold = np.arange(x.size) * FOLDS * 4 // x.size % FOLDS
    errors = {}
    for degree in (1, 2):
        design = np.vander(x - centre, degree + 1, increasing=True)
        held = np.empty(x.size)
        for k in range(FOLDS):
            train = fold != k
            held[~train] = (
                y[~train] - design[~train] @ np.linalg.lstsq(design[train], y[train], rcond=None)[0]
            )
        errors[degree] = float(np.sqrt(np.mean(held**2)))
    degree = 2 if errors[2] < 0.98 * errors[1] else 1
    design = np.vander(x - centre, degree + 1, increasing=True)
    solved = np.asarray(np.linalg.lstsq(design, y, rcond=None)[0], dtype=np.float64)
    residual = y - design @ solved
    rho = float(
        np.clip(
            np.sum(residual[1:] * residual[:-1]) / max(float(residual @ residual), 1e-300),
            0.0,
            0.95,
        )
    )
    variance = float(residual @ residual) / max(x.size - degree - 1, 1) * (1 + rho) / (1 - rho)
    covariance = np.asarray(variance * np.linalg.pinv(design.T @ design), dtype=np.float64)
    return ForceMap(centre, solved, covariance, float(x.min()), float(x.max()), errors[degree])


def predict_force(
    force: ForceMap, x: FloatArray, x_se: FloatArray
) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """(force, standard error, outside of the map's range), shape (n,).

    The error is that of a single passage: the map's, and what held-out passages scattered, which
    holds the regressor's usual noise; more if the passage is noisier than its range allows.
    """
    degree = force.coefficients.size - 1
    design = np.vander(np.nan_to_num(x) - force.centre_deg, degree + 1, increasing=True)
    value = np.where(np.isfinite(x), design @ force.coefficients, np.nan)
    slope = design[:, :-1] @ (force.coefficients[1:] * np.arange(1, degree + 1))
    own = np.einsum("ni,ij,nj->n", design, force.covariance, design)
    se = np.sqrt(own + np.maximum(force.rms_N**2, (slope * x_se) ** 2))
    with np.errstate(invalid="ignore"):
        margin = 0.05 * (force.high_deg - force.low_deg)
        outside = (x < force.low_deg - margin) | (x > force.high_deg + margin)
    return value, np.where(np.isfinite(x), se, np.nan), outside
