"""The base model's parameters from cells.

Damped least squares in whitened space, several starts, one free offset per log.

    Cells, Model -> residual r = W (y - f), Jacobian J = W df/dtheta (C, m, p),
                    offsets o = W 1 (C, m), each log's its own

Offsets are projected out of r and J (they are linear), steps are damped in the scale of the
parameters, bounds are kept.

Where a parameter stands at a bound and would leave it, it is held. One start may end in a local
minimum: `fit_model` tries several on a few cells and takes the best two on to all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tirelog.errors import ModelError
from tirelog.inference.cells.cells import Cells
from tirelog.inference.metric.offsets import Offsets
from tirelog.inference.metric.whitening import Whitener
from tirelog.physics.model.model import Model
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray

MOST_STEPS = 25
_SETTLED = 1e-4
#: eigenvalues of the normal matrix (columns of length one) below this share of the largest are
#: directions that change nothing
NULL = 1e-10
#: dampings tried for one step
_TRIALS = 8
#: starts: factors on the start values of some parameters
STARTS: tuple[Mapping[str, float], ...] = (
    {},
    {"patch_half_length_m": 0.7},
    {"patch_half_length_m": 1.4, "foundation_stiffness_N_m2": 0.4},
    {"foundation_stiffness_N_m2": 4.0, "flexural_stiffness_N_m2": 0.4},
    {"flexural_stiffness_N_m2": 4.0, "tread_stiffness_N_m2": 0.3},
    {"flexural_stiffness_N_m2": 8.0, "foundation_stiffness_N_m2": 8.0, "lever_arm_m": 8.0},
)
#: a shift below this is left to the linear nuisance [rad]; most centrings in a row
_CENTRED = 1e-3
_CENTRINGS = 8
#: a fit that ends within this share of a bound, and would leave it, stands at it: steps along a
#: valley shrink before they arrive; doubling changes nothing seen
AT_BOUND = 5e-3
#: cells that a start is judged on
_FEW = 12


@dataclass(frozen=True)
class Fit:
    """A fitted model in the metric `white`: whitened residual (C, m) with the offsets taken out,
    Jacobian of the prediction (C, m, p) in the observable's unit, prediction (C, m) without
    offsets, offset per log, chi-square, errors by name; `cells` as they were centred. `held`:
    parameters that stand at a bound and would leave it.
    """

    model: Model
    names: tuple[str, ...]
    chi2: float
    freedom: float
    residual: FloatArray
    prediction: FloatArray
    jacobian: FloatArray
    offsets: FloatArray
    errors: Mapping[str, float]
    settled: bool
    cells: Cells
    held: tuple[str, ...] = ()

    @property
    def reduced_chi2(self) -> float:
        return self.chi2 / self.freedom

    @property
    def moving(self) -> FloatArray:
        """The Jacobian (C, m, p) with zeros for what is held: whatever data are left out or added,
        that does not move.
        """
        if not self.held:
            return self.jacobian
        return np.where(np.isin(self.names, self.held), 0.0, self.jacobian)


def free_names(model: Model, cells: Cells) -> tuple[str, ...]:
    """What the fit moves: the free parameters, less those that nothing in these cells can show."""
    held = set()
    for effect in model.effects:
        if effect.effect.missing(cells.conditions):
            held |= {f"{effect.id}.{p.name}" for p in effect.parameters}
    return tuple(name for name in model.free if name not in held)


class Problem:
    """One fit's data: cells in a metric, offsets taken out."""

    def __init__(self, cells: Cells, white: Whitener) -> None:
        self.cells, self.white = cells, white
        self.offsets = Offsets.of(cells, white)

    def centre(self, model: Model, values: Mapping[str, float]) -> None:
        """Moves the cells' angles to where the model has its patch: a lag or a lopsided load shifts
        its waveform beyond what is linear.
        """
        for _ in range(_CENTRINGS):
            self.cells, farthest = centred(self.cells, self.predict(model, values))
            if farthest < _CENTRED:
                return

    def measured_less(self, prediction: FloatArray) -> FloatArray:
        """Whitened residual (C, m), offsets taken out."""
        return self.offsets.without(self.white(self.cells.values - prediction))

    def predict(self, model: Model, values: Mapping[str, float]) -> FloatArray:
        return model.predict(
            self.cells.conditions, surface=self.cells.surface, values=values, **self.cells.angles
        )

    def linearised(
        self, model: Model, names: Sequence[str], values: Mapping[str, float]
    ) -> tuple[FloatArray, FloatArray]:
        """Prediction (C, m) and Jacobian (C, m, p) in the observable's unit."""
        prediction, slopes = model.linearised(
            self.cells.conditions,
            names=names,
            surface=self.cells.surface,
            values=values,
            **self.cells.angles,
        )
        return prediction, np.ascontiguousarray(np.moveaxis(slopes, 0, -1))

    def offset_of_logs(self, prediction: FloatArray) -> FloatArray:
        """Offset of each log, (logs,)."""
        return self.offsets.fit(self.white(self.cells.values - prediction))


def centred(cells: Cells, prediction: FloatArray) -> tuple[Cells, float]:
    """The cells with their angles moved by the shift between measurement and prediction, and the
    largest shift left [rad].
    """
    if cells.phi.shape[1] == 1:
        return cells, 0.0
    weight = np.where(np.isfinite(cells.values) & np.isfinite(cells.sd), cells.shift, 0.0)
    left = np.nan_to_num(cells.values - prediction)
    left = left - left.mean(axis=1, keepdims=True)
    shift = np.clip(
        (weight * left).sum(axis=1) / np.maximum((weight**2).sum(axis=1), 1e-300), -0.03, 0.03
    )
    return replace(cells, phi=cells.phi - shift[:, None], moved=cells.moved + shift), float(
        np.abs(shift).max()
    )


def _sizes(model: Model, names: Sequence[str]) -> FloatArray:
    """The scale in which a parameter's step is damped."""
    parameters = model.parameters
    return np.array(
        [max(abs(parameters[n].value), 0.3 * abs(parameters[n].probe), 1e-12) for n in names]
    )


def _bounds(model: Model, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    parameters: list[Parameter] = [model.parameters[n] for n in names]
    return np.array([p.min for p in parameters]), np.array([p.max for p in parameters])


def _leaving(
    theta: FloatArray, low: FloatArray, high: FloatArray, gradient: FloatArray
) -> NDArray[np.bool_]:
    """Which parameters stand at a bound and would leave it; `gradient` (p,) points to where
    chi-square falls.
    """
    return ((theta <= low) & (gradient < 0)) | ((theta >= high) & (gradient > 0))


def descend(
    problem: Problem, model: Model, names: Sequence[str], steps: int = MOST_STEPS
) -> tuple[Model, float, bool]:
    """Levenberg-Marquardt from the model's values; the best model, its chi-square, whether it
    settled.

    A point that the physics refuses is a step too far; ModelError only where the start itself is
    refused.
    """
    theta = np.array([model.values[n] for n in names])
    low, high = _bounds(model, names)
    values, damping, settled = dict(zip(names, theta, strict=True)), 1e-3, not len(names)
    jacobian, residual = _at(problem, model, names, values)
    chi2 = float((residual**2).sum())
    for _ in range(steps if len(names) else 0):
        size = _sizes(
            model.with_values(dict(zip(names, np.clip(theta, low, high), strict=True))), names
        )
        slope = problem.offsets.without(problem.white(jacobian * size)).reshape(-1, len(names))
        gram, gradient = slope.T @ slope, slope.T @ residual.reshape(-1)
        free = ~_leaving(theta, low, high, gradient)
        for _ in range(_TRIALS):
            new = np.clip(theta + _damped(gram, gradient, free, damping) * size, low, high)
            reached = _chi2_at(problem, model, dict(zip(names, new, strict=True)))
            if reached < chi2:
                break
            damping = max(damping, 1e-6) * 8.0
        else:
            settled = True
            break
        drop, theta, damping = chi2 - reached, new, damping / 10.0
        values = dict(zip(names, theta, strict=True))
        jacobian, residual = _at(problem, model, names, values)
        chi2 = float((residual**2).sum())
        if drop < _SETTLED * chi2 and drop < 0.3:
            settled = True
            break
    return model.with_values(values), chi2, settled


def _at(
    problem: Problem, model: Model, names: Sequence[str], values: Mapping[str, float]
) -> tuple[FloatArray, FloatArray]:
    """Jacobian (observable's unit) and whitened residual at a point, with cells centred there."""
    problem.centre(model, values)
    prediction, jacobian = problem.linearised(model, names, values)
    return jacobian, problem.measured_less(prediction)


def _chi2_at(problem: Problem, model: Model, values: Mapping[str, float]) -> float:
    """Chi-square at a point; infinite where the physics refuses it."""
    try:
        return float((problem.measured_less(problem.predict(model, values)) ** 2).sum())
    except ModelError:
        return float("inf")


def _damped(
    gram: FloatArray, gradient: FloatArray, free: NDArray[np.bool_], damping: float
) -> FloatArray:
    """A damped step of the free parameters in units of their sizes, at most one size each."""
    step = np.zeros(gradient.size)
    square = gram[np.ix_(free, free)]
    square = square + damping * np.diag(np.diag(square) + 1e-9 * np.trace(gram))
    step[free] = np.linalg.lstsq(square, gradient[free], rcond=1e-12)[0]
    return np.clip(step, -1.0, 1.0)


def starts(model: Model, names: Sequence[str]) -> list[Model]:
    """The model's own values, and others around them that stay within the bounds."""
    result = []
    for factors in STARTS:
        moved = {n: f * model.values[n] for n, f in factors.items() if n in names}
        if factors and not moved:
            continue
        clipped = {
            n: float(np.clip(v, model.parameters[n].min, model.parameters[n].max))
            for n, v in moved.items()
        }
        result.append(model.with_values(clipped))
    return result


def few_cells(cells: Cells) -> NDArray[np.int64]:
    """Some cells that span the speeds and logs, for judging starts."""
    order = np.lexsort((cells.conditions.speed_m_s, cells.log))
    return np.unique(order[np.linspace(0, order.size - 1, min(_FEW, order.size)).astype(int)])


def fit_model(cells: Cells, white: Whitener, model: Model, *, several: bool = True) -> Fit:
    """The model fitted to the cells.  ModelError where no start can be computed."""
    names = free_names(model, cells)
    candidates = starts(model, names) if several else [model]
    if len(candidates) > 1:
        candidates = _promising(cells, white, names, candidates)
    problem = Problem(cells, white)
    results, refused = [], None
    for start in candidates:
        try:
            results.append(descend(problem, start, names))
        except ModelError as problem_of_start:
            refused = problem_of_start
    if not results:
        raise refused or ModelError(
            "the model could not be fitted; a model that predicts these speeds is allowed; "
            "change its start values"
        )
    best, _, settled = min(results, key=lambda result: result[1])
    fit = finish(problem, best, names, settled)
    if several and fit.held:
        fit = _from_within(cells, white, model, fit)
    return fit


def _from_within(cells: Cells, white: Whitener, model: Model, fit: Fit) -> Fit:
    """The best of this fit, which ended at a bound, and of fits that begin with what stands there
    brought back to its start values.
    """
    values = {tuple(start.values[name] for name in fit.held) for start in starts(model, fit.names)}
    inner = [
        fit.model.with_values(dict(zip(fit.held, inside, strict=True))) for inside in sorted(values)
    ]
    best = fit
    for begin in _promising(cells, white, fit.names, inner):
        problem = Problem(cells, white)
        try:
            found, reached, settled = descend(problem, begin, fit.names)
        except ModelError:
            continue
        if reached < best.chi2:
            best = finish(problem, found, fit.names, settled)
    return best


def _promising(
    cells: Cells, white: Whitener, names: Sequence[str], candidates: list[Model]
) -> list[Model]:
    """The two best of the starts after a few steps on a few cells."""
    rows = few_cells(cells)
    problem = Problem(
        take_cells(cells, rows),
        Whitener(white.inverse_sd[rows], white.basis[rows], white.shrink[rows]),
    )
    reached = []
    for start in candidates:
        try:
            reached.append(descend(problem, start, names, steps=15))
        except ModelError:
            continue
    reached.sort(key=lambda result: result[1])
    distinct = [
        r
        for i, r in enumerate(reached)
        if i == 0 or abs(r[1] - reached[0][1]) > 0.02 * reached[0][1]
    ]
    return [r[0] for r in distinct[:2]] or candidates


def take_cells(cells: Cells, rows: NDArray[np.int64]) -> Cells:
    """Some of the cells."""
    names = (
        "values", "phi", "phi_variance", "sd", "random", "random_cov", "shift", "revolutions",
        "log", "manoeuvre", "regime", "within", "speed_mean", "moved", "speed_square", "rounding",
    )  # fmt: skip
    return replace(
        cells,
        conditions=cells.conditions.take(rows),
        **{name: getattr(cells, name)[rows] for name in names},
    )


def finish(problem: Problem, model: Model, names: Sequence[str], settled: bool) -> Fit:
    """Everything about the fitted point."""
    prediction, jacobian = problem.linearised(model, names, {})
    residual = problem.measured_less(prediction)
    slope = problem.offsets.without(problem.white(jacobian)).reshape(-1, len(names))
    chi2 = float((residual**2).sum())
    low, high = _bounds(model, names)
    theta = np.array([model.values[n] for n in names])
    leaving = _leaving(
        theta,
        low + AT_BOUND * np.abs(low),
        high - AT_BOUND * np.abs(high),
        slope.T @ residual.reshape(-1),
    )
    slope = np.where(leaving, 0.0, slope)
    freedom = max(
        problem.white.values
        - problem.white.removed
        - problem.offsets.count
        - (len(names) - leaving.sum()),
        1.0,
    )
    errors = _errors(slope, max(1.0, chi2 / freedom))
    return Fit(
        model.with_values(
            {n: model.values[n] for n in names}, se=dict(zip(names, errors, strict=True))
        ),
        tuple(names),
        chi2,
        freedom,
        residual,
        prediction,
        jacobian,
        problem.offset_of_logs(prediction),
        dict(zip(names, errors, strict=True)),
        settled,
        problem.cells,
        tuple(name for name, out in zip(names, leaving, strict=True) if out),
    )


def _errors(slope: FloatArray, scale: float) -> list[float]:
    """Standard errors from the whitened Jacobian (N, p); infinite along directions that the data
    cannot see.
    """
    norm = np.linalg.norm(slope, axis=0)
    usable = norm > 0
    if not usable.any():
        return [float("inf")] * slope.shape[1]
    unit = slope[:, usable] / norm[usable]
    values, vectors = np.linalg.eigh(unit.T @ unit)
    good = values > NULL * values[-1]
    variance = np.where(
        np.abs(vectors[:, ~good]).max(axis=1, initial=0.0) > 0.1,
        np.inf,
        (vectors[:, good] ** 2 / values[good]).sum(axis=1),
    )
    errors = np.full(slope.shape[1], np.inf)
    errors[usable] = np.sqrt(scale * variance) / norm[usable]
    return [float(e) for e in errors]
