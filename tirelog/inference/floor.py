"""The noise floor, and errors in the observable's own unit.

    within    repeatability of revolutions inside a manoeuvre, by angle: noise and the random
              effects of revolutions
    between   scatter between manoeuvres (`tirelog.inference.scatter`), as it came out in these data
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

from tirelog.errors import ModelError, or_refusal
from tirelog.inference.cells.cells import Cells, SharedEffects
from tirelog.inference.cells.joint import predicted
from tirelog.inference.fit.cells import Fit, priors
from tirelog.inference.metric import (
    LeaveOneOut,
    Normal,
    Whitener,
    in_blocks,
    per_group,
    side_by_side,
    solve_scaled,
)
from tirelog.inference.scatter import Scatter
from tirelog.vocabulary.arrays import FloatArray

#: cells whose columns are worked on at a time, about
_SOME_CELLS = 64


@dataclass(frozen=True)
class UnweightedMetric:
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
    def of(cls, cells: Cells) -> UnweightedMetric:
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
        return in_blocks(self._of_cells, x)

    def _of_cells(self, rows: slice, x: FloatArray) -> FloatArray:
        weights, direction = self.weights[rows, :, None], self.direction[rows]
        x = np.where(weights > 0, x, 0.0)
        return (x - direction @ (np.swapaxes(direction, 1, 2) @ x)) * weights

    def only(self, rows: NDArray[np.bool_]) -> UnweightedMetric:
        """The metric in which only these cells count."""
        return replace(self, weights=np.where(rows[:, None], self.weights, 0.0))

    def some(self, rows: NDArray[np.int64]) -> UnweightedMetric:
        """The metric of some cells alone."""
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
    """The noise floor: mean squares [unit^2] within, between, and that by angle (m,).

    `scatter`: the random effects that `between` is made of.
    """

    within: float
    between: float
    between_by_angle: FloatArray
    scatter: Scatter

    @property
    def square(self) -> float:
        return self.within + self.between


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
    up, down = (
        or_refusal(predicted)(
            fit.model, cells, conditions=replace(cells.conditions, speed_m_s=speed + s * step)
        )
        for s in (1.0, -1.0)
    )
    if isinstance(up, ModelError) or isinstance(down, ModelError):
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


def measure_floor(
    cells: Cells, plain: UnweightedMetric, columns: FloatArray, scatter: Scatter
) -> Floor:
    """The floor from the cells' repeatability and the scatter of manoeuvres as it came out."""
    share = plain.weights**2
    total = np.maximum(share.sum(axis=0), 1e-300)
    within = np.where(share > 0, cells.within, 0.0)
    between = np.where(share > 0, scatter.square(columns), 0.0)
    return Floor(
        float((share * within).sum() / plain.weight),
        float((share * between).sum() / plain.weight),
        (share * between).sum(axis=0) / total,
        scatter,
    )


def held_out_losses(
    cells: Cells,
    white: Whitener,
    plain: UnweightedMetric,
    fit: Fit,
    *more: FloatArray,
    of: NDArray[np.bool_] | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Losses (M,) of each manoeuvre when all the others decide the parameters.

    They come in whitened units and in the plain metric. One step from the fitted point, which is
    where leaving one manoeuvre out moves it. `more` (C, m, k) each add columns to the model. What
    the same step would gain on all data is no part of it: the fit could not take it (bounds, a bent
    way), so leaving data out cannot. `of` (C,): the cells whose losses count, if not all; the
    parameters are decided by all.
    """
    return held_out_losses_with(cells, white, plain, fit, [more], of=of)[0]


def held_out_losses_with(
    cells: Cells,
    white: Whitener,
    plain: UnweightedMetric,
    fit: Fit,
    additions: Sequence[Sequence[FloatArray]],
    *,
    of: NDArray[np.bool_] | None = None,
) -> list[tuple[FloatArray, FloatArray]]:
    """`held_out_losses` with each of several additions to the model, alone.

    The model's own columns, which are most, are brought into the metrics once for all.
    """
    first = fit.jacobian.shape[-1] + fit.amplitudes.size + _own_levels(cells).shape[-1]
    metrics = (white, plain) if of is None else (white, white.only(of), plain.only(of))
    losses = []
    for levelled in zip(
        *(_levelled(cells, metric, fit, additions) for metric in metrics), strict=True
    ):
        theta = levelled[0].left_out() - levelled[0].step_of_all(first)
        losses.append((levelled[-2].loss(theta), levelled[-1].loss(theta)))
    return losses


def _own_levels(cells: Cells) -> FloatArray:
    """Columns (C, m, k) of the offsets that a log has beside its first.

    Each observable of a log has its own; with one observable there is none.
    """
    if cells.together is None:
        return np.zeros((*cells.phi.shape, 0))
    first: dict[int, int] = {}
    columns = []
    level = cells.level
    for log in np.unique(cells.log):
        rows = cells.log == log
        if level[rows].any() and first.setdefault(int(cells.drive[rows][0]), int(log)) != log:
            columns.append(np.where(rows[:, None], level, 0.0))
    return np.stack(columns, axis=-1) if columns else np.zeros((*cells.phi.shape, 0))


def steps_left_out(cells: Cells, white: Whitener, fit: Fit) -> FloatArray:
    """How far the free parameters move (M, p) if each manoeuvre is left out in its turn.

    One step from the fitted point, as for held-out losses; zero for what stands at a bound.
    """
    (in_white,) = _levelled(cells, white, fit, [()])
    p = fit.jacobian.shape[-1]
    moved: FloatArray = in_white.left_out() - in_white.step_of_all(p + fit.amplitudes.size)
    return moved[:, 1 : 1 + p]


def losses_of_errors(
    cells: Cells, white: Whitener, plain: UnweightedMetric, fit: Fit
) -> FloatArray:
    """What the errors of the parameters add to held-out losses in the plain metric, (M,).

    In the mean, if nothing is missing: manoeuvres are few, and each scatters.
    """
    (in_white,), (in_plain,) = (_levelled(cells, metric, fit, [()]) for metric in (white, plain))
    return in_white.of_errors(in_plain)


def _levelled(
    cells: Cells,
    metric: Whitener | UnweightedMetric,
    fit: Fit,
    additions: Sequence[Sequence[FloatArray]],
) -> list[LeaveOneOut]:
    """The normal equations of every manoeuvre, with each of the additions (C, m, k) to the model.

    No metric couples two manoeuvres, so some are worked on at a time.
    """
    shared = cells.shared if cells.shared is not None and len(cells.shared) else None
    own, level = _own_levels(cells), cells.level  # of a number per revolution there is none
    prediction = fit.prediction + (0.0 if shared is None else shared.columns @ fit.amplitudes)
    if own.shape[-1]:  # if nothing decides these, they stay as they are
        prediction, level = fit.prediction + fit.beside, level - own.sum(axis=-1)
    parts = [level[..., None], fit.moving, *([own] if own.shape[-1] else [])]
    parts += [] if shared is None else [shared.columns]
    made: list[list[Normal]] = [[] for _ in additions]
    last = (
        np.searchsorted(np.sort(cells.manoeuvre), np.arange(cells.manoeuvres), side="right")
        // _SOME_CELLS
    )
    for numbers in np.split(np.arange(cells.manoeuvres), np.flatnonzero(np.diff(last)) + 1):
        rows = np.flatnonzero(np.isin(cells.manoeuvre, numbers))
        some, values = metric.some(rows), cells.values[rows]
        residual = some(np.where(np.isfinite(values), values - prediction[rows], 0.0))
        columns = side_by_side(some, [part[rows] for part in parts])
        manoeuvre = cells.manoeuvre[rows] - numbers[0]
        of_model = Normal.of(columns, residual, manoeuvre)
        for more, of_more in zip(additions, made, strict=True):
            normal = of_model
            if more:
                added = side_by_side(some, [part[rows] for part in more])
                crossed = per_group(np.swapaxes(columns, 1, 2) @ added, manoeuvre)
                normal = normal.beside(Normal.of(added, residual, manoeuvre), crossed)
            of_more.append(normal)
    log = np.zeros(cells.manoeuvres, np.int64)
    log[cells.manoeuvre] = np.unique(cells.drive, return_inverse=True)[1]
    return [
        LeaveOneOut(normal, log, _prior(fit, shared, own.shape[-1], normal.right.shape[1]))
        for normal in map(Normal.joined, made)
    ]


def _prior(
    fit: Fit, shared: SharedEffects | None, levels: int, columns: int
) -> tuple[FloatArray, FloatArray]:
    """What is known of the columns before any manoeuvre: of the shared effects, their size.

    Of a parameter, its prior.
    """
    mean, known = priors(fit.model, fit.names)
    precision, pull = np.zeros(columns), np.zeros(columns)
    p = 1 + len(fit.names)
    precision[1:p] = known
    pull[1:p] = known * (mean - [fit.model.values[name] for name in fit.names])
    if shared is not None:
        own = slice(p + levels, p + levels + len(shared))
        precision[own] = 1.0 / shared.sd**2
        pull[own] = -fit.amplitudes / shared.sd**2
    return precision, pull
