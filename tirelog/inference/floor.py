"""The noise floor, and errors in the observable's own unit.

    within    repeatability of revolutions inside a manoeuvre, by angle: noise and the random
              effects of revolutions
    between   scatter between manoeuvres: load (amplitude and width together) and baseline, as
              random effects about what follows speed, acceleration and time (which is physics, and
              for the candidates to explain); and of the load between the cells of a manoeuvre,
              which is what a grade or wind does to it
    floor^2 = within^2 + between^2,   excess^2 = rmse^2 - floor^2

rmse is that of one revolution's value at one angle. A cell's mean shows it as
    rmse^2 = within^2 + mean over revolutions of (|cell mean - model|^2 - what noise alone would
        leave of it)
so more revolutions sharpen the excess and do not move the floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tirelog.errors import ModelError
from tirelog.inference.cells.cells import Cells
from tirelog.inference.cells.shared import SharedEffects
from tirelog.inference.fit.cells import Fit
from tirelog.inference.metric.offsets import Levelled, Nuisance, Offsets
from tirelog.inference.metric.projection import Normal, in_blocks, side_by_side, solve_scaled
from tirelog.inference.metric.whitening import Whitener
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import STRAIN

#: relative step of the load for its derivative
_STEP = 0.01
#: degrees of freedom of cells within manoeuvres that a wander of the load is told from; twice as
#: many would leave short logs without it
FEWEST_WANDERING = 8.0
#: standard deviations of chi-square by which it must be told: nulls stay below 2, a wander of 3 %
#: shows with 18 and more; below it, what the model's shape lacks would pass for a wander
SURE_SIGMAS = 4.0
#: cells whose columns are worked on at a time, about
_SOME_CELLS = 64


@dataclass(frozen=True)
class Plain:
    """The metric of size.

    What is free in a cell (its shift) is removed, along `direction` (C, m, k); each cell is
    weighted by its revolutions, so that sums of squares are mean squares times `weight`.
    """

    cells: Cells
    weights: FloatArray
    direction: FloatArray
    weight: float
    bias: float

    @classmethod
    def of(cls, cells: Cells) -> Plain:
        good = np.isfinite(cells.values) & np.isfinite(cells.sd)
        number = np.maximum(good.sum(axis=1), 1)
        weights = np.where(good, np.sqrt(cells.revolutions / number)[:, None], 0.0)
        direction = _orthonormal_in_cells(np.where(good[..., None], cells.taken, 0.0))
        spread = np.einsum("cmi,cij,cmj->cm", cells.scattering, cells.random_cov, cells.scattering)
        noise = np.where(good, cells.sd, 0.0) ** 2
        taken = (direction**2).sum(axis=-1)
        bias = (weights**2 * (noise + spread)).sum() - (weights**2 * noise * taken).sum()
        return cls(cells, weights, direction, float(cells.revolutions.sum()), float(bias))

    def __call__(self, x: FloatArray) -> FloatArray:
        """x (C, m) or (C, m, k) in this metric."""
        flat = x.ndim == 2
        x = in_blocks(self._of_cells, x[..., None] if flat else x)
        return x[..., 0] if flat else x

    def _of_cells(self, rows: slice, x: FloatArray) -> FloatArray:
        weights, direction = self.weights[rows, :, None], self.direction[rows]
        x = np.where(weights > 0, x, 0.0)
        return (x - direction @ (np.swapaxes(direction, 1, 2) @ x)) * weights

    def some(self, rows: NDArray[np.int64], manoeuvres: slice) -> Plain:
        """The metric of some cells alone; the manoeuvres are for the other metric."""
        return replace(self, weights=self.weights[rows], direction=self.direction[rows])

    def mean_square(self, losses: FloatArray) -> float:
        """Mean square error of a revolution's value above `within`.

        From sums of squares (M,) of cell means.
        """
        return (float(np.sum(losses)) - self.bias) / self.weight


def _orthonormal_in_cells(columns: FloatArray) -> FloatArray:
    """The columns (C, m, k) of each cell made orthogonal and of length one; zero where they are."""
    result = np.zeros_like(columns)
    for i in range(columns.shape[-1]):
        column, before = columns[..., i], result[..., :i]
        if i:
            column = column - (before @ (np.swapaxes(before, 1, 2) @ column[..., None]))[..., 0]
        norm = np.linalg.norm(column, axis=1, keepdims=True)
        result[..., i] = np.divide(column, norm, out=np.zeros_like(column), where=norm > 0)
    return result


@dataclass(frozen=True)
class Floor:
    """The noise floor: mean squares [unit^2] within, between, and by angle (m,).

    `load_sd` relative, `baseline_sd` [unit]: scatter between manoeuvres; `wander_sd` relative: of
    the load between the cells of a manoeuvre.
    """

    within: float
    between: float
    within_by_angle: FloatArray
    between_by_angle: FloatArray
    load_sd: float
    baseline_sd: float
    wander_sd: float = 0.0

    @property
    def square(self) -> float:
        return self.within + self.between


def load_derivative(cells: Cells, fit: Fit) -> FloatArray:
    """Change of the prediction per relative change of the load, (C, m).

    Its amplitude if the model does not know what a load does.
    """
    conditions = cells.conditions
    load = np.where(
        np.isfinite(conditions.load_N), conditions.load_N, fit.model.values.get("load_N", np.nan)
    )
    try:
        ends = [
            fit.model.predict(
                replace(conditions, load_N=load * (1.0 + s * _STEP)),
                surface=cells.surface,
                observable=cells.observable,
                **cells.angles,
            )
            for s in (1, -1)
        ]
    except ModelError:
        return fit.prediction
    slope = (ends[0] - ends[1]) / (2.0 * _STEP)
    return slope if np.isfinite(slope).all() or cells.phi.shape[1] > 1 else fit.prediction


def at_mean_speed(cells: Cells, fit: Fit) -> Cells:
    """The cells with their values moved to the cell's mean speed by the fitted model.

    A bin's samples have a mean speed of their own, and a waveform that bends with speed does not
    average to that at the mean. What amplitude, width, shift and baseline of single revolutions
    took along with the speed is gone from the values already. And a wheel that speeds up is slower
    at the entry edge than at the exit edge. And if samples lock to fixed angles, those at one speed
    lie to one side of a bin and those at another to the other. Only for waveforms.
    """
    if cells.phi.shape[1] == 1:
        return cells
    step = np.clip(np.sqrt(cells.speed_square.mean(axis=1)), 0.05, 1.0)
    speed = cells.conditions.speed_m_s
    try:
        up, down = (
            fit.model.predict(
                replace(cells.conditions, speed_m_s=speed + s * step),
                surface=cells.surface,
                observable=cells.observable,
                **cells.angles,
            )
            for s in (1.0, -1.0)
        )
    except ModelError:
        return cells
    slope = (up - down) / (2.0 * step[:, None])
    taken = np.concatenate([cells.random, cells.shift[..., None]], axis=-1)
    weight = np.isfinite(cells.values)[..., None]
    columns, slope_left = np.where(weight, taken, 0.0), np.where(weight[..., 0], slope, 0.0)
    gram = np.swapaxes(columns, 1, 2) @ columns
    slope_left = (
        slope_left
        - (columns @ solve_scaled(gram, np.einsum("cmk,cm->ck", columns, slope_left))[..., None])[
            ..., 0
        ]
    )
    travelled = np.nan_to_num(cells.phi) * fit.model.values["radius_m"]
    faster = (cells.conditions.acceleration_m_s2 / speed)[:, None] * travelled
    bend = (up + down - 2.0 * fit.prediction) / step[:, None] ** 2
    return replace(
        cells,
        values=cells.values
        - slope_left * cells.speed_mean
        - slope * faster
        - 0.5 * bend * cells.speed_square
        - _along_the_angle(cells, slope_left) * cells.speed_angle,
    )


def _along_the_angle(cells: Cells, values: FloatArray) -> FloatArray:
    """Derivative of values (C, m) by the angle [1/rad], by differences of neighbouring bins.

    Only of cells whose bins hold other angles at other speeds; zero in the others.
    """
    result = np.zeros(values.shape)
    m = values.shape[1]
    grid = (np.arange(m) + 0.5) * (2.0 * np.pi / m) - np.pi
    for i in np.flatnonzero(np.any(cells.speed_angle != 0.0, axis=1)):
        good = np.isfinite(cells.values[i]) & np.isfinite(cells.phi[i])
        even = np.interp(grid, cells.phi[i, good], values[i, good], period=2.0 * np.pi)
        result[i] = (np.roll(even, -1) - np.roll(even, 1)) * (0.25 * m / np.pi)
    return result


def scatter_columns(cells: Cells, fit: Fit) -> FloatArray:
    """Columns of the random effects of manoeuvres: relative load, baseline; (C, m, 2)."""
    return np.stack([load_derivative(cells, fit), np.ones_like(cells.phi)], axis=-1)


def trend_columns(cells: Cells) -> FloatArray:
    """What physics may follow, one row per manoeuvre (M, k).

    Each log's level, acceleration, time, and v, v^2 log by log. What follows speed may follow a
    log's load, pressure, water or age besides. The last columns come only if enough manoeuvres are
    left to show scatter.
    """
    M = cells.manoeuvres
    number = np.bincount(cells.manoeuvre, cells.revolutions, M)
    log = np.zeros(M, np.int64)
    log[cells.manoeuvre] = cells.log
    per_log = (log[:, None] == np.unique(cells.log)).astype(float)

    def mean(x: FloatArray) -> FloatArray:
        level = np.bincount(cells.manoeuvre, cells.revolutions * x, M) / number
        scaled: FloatArray = (level - level.mean()) / (level.std() + 1e-12)
        return scaled

    c = cells.conditions
    v, a, t = mean(c.speed_m_s), mean(c.acceleration_m_s2), mean(c.time_s)
    columns = [per_log]
    for more in (
        v[:, None],
        a[:, None],
        np.stack([v**2, t], axis=1),
        per_log * v[:, None],
        per_log * (v**2)[:, None],
    ):
        if sum(x.shape[1] for x in (*columns, more)) <= 0.6 * M:
            columns.append(more)
    return np.hstack(columns)


def scatter_between(
    cells: Cells, white: Whitener, fit: Fit, columns: FloatArray
) -> tuple[float, float]:
    """Standard deviations between manoeuvres of the relative load and the baseline.

    By the method of moments.
    """
    residual = Nuisance.of(Offsets.of(cells, white), white(fit.jacobian)).without(
        white(cells.values - fit.prediction)
    )
    normal = Normal.of(white(columns), residual, cells.manoeuvre)
    coefficients = solve_scaled(normal.gram, normal.right)
    trend = trend_columns(cells)
    hat = trend @ np.linalg.pinv(trend)
    freedom = float(trend.shape[0] - np.trace(hat))
    if freedom < 2.0:
        return 0.0, 0.0
    inverse = np.stack(
        [solve_scaled(normal.gram, np.broadcast_to(e, normal.right.shape)) for e in np.eye(2)],
        axis=-1,
    )
    result = []
    for i in range(2):
        left = np.asarray(coefficients[:, i] - hat @ coefficients[:, i], dtype=np.float64)
        expected = float(((1.0 - np.diag(hat)) * inverse[:, i, i]).sum())
        result.append(float(np.sqrt(max((float(left @ left) - expected) / freedom, 0.0))))
    return result[0], result[1]


def wander_within(cells: Cells, white: Whitener, fit: Fit, columns: FloatArray) -> float:
    """Standard deviation of the relative load between the cells of a manoeuvre.

    By the method of moments, weighted by what each cell knows (DerSimonian and Laird 1986, with
    covariates). Each manoeuvre has its own level, and what follows speed is no wander; 0 if too few
    cells are left to show one, or they do not surely. Only of strain: an acceleration's size
    follows the speed squared, so that a speed that is 0.3 % off looks like a load.
    """
    if cells.phi.shape[1] == 1 or cells.observable != STRAIN:
        return 0.0
    residual = Nuisance.of(Offsets.of(cells, white), white(fit.jacobian)).without(
        white(cells.values - fit.prediction)
    )
    own = np.arange(len(cells))
    normal = Normal.of(white(columns), residual, own)
    load = solve_scaled(normal.gram, normal.right)[:, 0]
    variance = solve_scaled(normal.gram, np.broadcast_to([1.0, 0.0], normal.right.shape))[:, 0]
    known = variance > 0.0
    variance = variance + _load_of_revolutions(cells, columns[..., 0])
    speed = cells.conditions.speed_m_s / max(float(np.mean(cells.conditions.speed_m_s)), 1e-9) - 1.0
    level = (cells.manoeuvre[:, None] == np.arange(cells.manoeuvres)).astype(float)
    design = np.column_stack([level, speed, speed**2])[known]
    weight = 1.0 / variance[known]
    root = np.sqrt(weight)[:, None] * design
    hat = root @ np.linalg.pinv(root)
    freedom = float(weight.size - np.trace(hat))
    if freedom < FEWEST_WANDERING:
        return 0.0
    scaled = np.sqrt(weight) * load[known]
    left = scaled - hat @ scaled
    spread = float((weight * (1.0 - np.diag(hat))).sum())
    if float(left @ left) < freedom + SURE_SIGMAS * np.sqrt(2.0 * freedom):
        return 0.0
    return float(np.sqrt(max((float(left @ left) - freedom) / max(spread, 1e-300), 0.0)))


def _load_of_revolutions(cells: Cells, load: FloatArray) -> FloatArray:
    """Variance (C,) of each cell's relative load from the scatter of its revolutions.

    Amplitude, width and baseline scatter together as far as a load does it: their covariance along
    what a `load` derivative (C, m) is made of.
    """
    good = np.isfinite(cells.values)[..., None]
    columns, slope = np.where(good, cells.random, 0.0), np.where(good[..., 0], load, 0.0)
    made_of = solve_scaled(
        np.swapaxes(columns, 1, 2) @ columns, np.einsum("cmk,cm->ck", columns, slope)
    )
    along = np.einsum("ck,ckl,cl->c", made_of, cells.random_cov, made_of)
    return np.asarray(along / np.maximum((made_of**2).sum(axis=1), 1e-300) ** 2, dtype=np.float64)


def measure_floor(
    cells: Cells,
    plain: Plain,
    columns: FloatArray,
    load_sd: float,
    baseline_sd: float,
    wander_sd: float = 0.0,
) -> Floor:
    """The floor from the cells' repeatability and the scatter between manoeuvres."""
    share = plain.weights**2
    total = np.maximum(share.sum(axis=0), 1e-300)
    within = np.where(share > 0, cells.within, 0.0)
    load_square = load_sd**2 + wander_sd**2
    scatter = load_square * columns[..., 0] ** 2 + (baseline_sd * columns[..., 1]) ** 2
    scatter = np.where(share > 0, scatter, 0.0)
    return Floor(
        float((share * within).sum() / plain.weight),
        float((share * scatter).sum() / plain.weight),
        (share * within).sum(axis=0) / total,
        (share * scatter).sum(axis=0) / total,
        load_sd,
        baseline_sd,
        wander_sd,
    )


def held_out_losses(
    cells: Cells, white: Whitener, plain: Plain, fit: Fit, *more: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Losses (M,) of each manoeuvre when all the others decide the parameters.

    They come in whitened units and in the plain metric. One step from the fitted point, which is
    where leaving one manoeuvre out moves it. `more` (C, m, k) each add columns to the model. What
    the same step would gain on all data is no part of it: the fit could not take it (bounds, a bent
    way), so leaving data out cannot.
    """
    in_white, in_plain = (_levelled(cells, metric, fit, more) for metric in (white, plain))
    theta, offset = in_white.left_out()
    of_all, level_of_all = in_white.step_of_all(fit.jacobian.shape[-1] + fit.amplitudes.size)
    theta, offset = theta - of_all, offset - level_of_all
    return in_white.loss(theta, offset), in_plain.loss(theta, offset)


def _levelled(
    cells: Cells, metric: Whitener | Plain, fit: Fit, more: Sequence[FloatArray]
) -> Levelled:
    """The normal equations of every manoeuvre.

    No metric couples two of them, so some are worked on at a time.
    """
    shared = cells.shared if cells.shared is not None and len(cells.shared) else None
    parts = [fit.moving, *([] if shared is None else [shared.columns]), *more]
    made = []
    beside = 0.0 if shared is None else shared.columns @ fit.amplitudes
    prediction = fit.prediction + beside
    level = float(cells.phi.shape[1] > 1)  # a number per revolution has no offset of its own
    last = (
        np.searchsorted(np.sort(cells.manoeuvre), np.arange(cells.manoeuvres), side="right")
        // _SOME_CELLS
    )
    for numbers in np.split(np.arange(cells.manoeuvres), np.flatnonzero(np.diff(last)) + 1):
        manoeuvres = slice(int(numbers[0]), int(numbers[-1]) + 1)
        rows = np.flatnonzero(
            (cells.manoeuvre >= manoeuvres.start) & (cells.manoeuvre < manoeuvres.stop)
        )
        some, values = metric.some(rows, manoeuvres), cells.values[rows]
        residual = some(np.where(np.isfinite(values), values - prediction[rows], 0.0))
        columns, offset = (
            side_by_side(some, [part[rows] for part in parts]),
            some(np.full(values.shape, level)),
        )
        made.append(
            Levelled.of(
                columns, residual, offset, cells.manoeuvre[rows] - manoeuvres.start, cells.log[rows]
            )
        )
    log = np.zeros(cells.manoeuvres, np.int64)
    log[cells.manoeuvre] = np.unique(cells.log, return_inverse=True)[1]
    return Levelled.joined(made, log, _prior(fit, shared, sum(part.shape[-1] for part in parts)))


def _prior(
    fit: Fit, shared: SharedEffects | None, columns: int
) -> tuple[FloatArray, FloatArray] | None:
    """What is known of the columns before any manoeuvre: of the shared effects, their size."""
    if shared is None:
        return None
    precision, pull = np.zeros(columns), np.zeros(columns)
    own = slice(fit.jacobian.shape[-1], fit.jacobian.shape[-1] + len(shared))
    precision[own] = 1.0 / shared.sd**2
    pull[own] = -fit.amplitudes / shared.sd**2
    return precision, pull
