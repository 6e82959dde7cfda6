"""The noise floor, and errors in the observable's own unit.

    within    repeatability of revolutions inside a manoeuvre, by angle: noise and the random
              effects of revolutions
    between   scatter between manoeuvres, as these data have it
    floor^2 = within^2 + between^2,   excess^2 = rmse^2 - floor^2

rmse is that of one revolution's value at one angle. A cell's mean shows it as

    rmse^2 = within^2 + mean over revolutions of (|cell mean - model|^2 - noise),

where noise is what noise alone would leave of the square. More revolutions sharpen the excess and
do not move the floor.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc  # tail of F; scipy.stats takes a second to import

from tirelog.errors import ModelError, or_refusal
from tirelog.inference.cells.cells import Cells, model_of, predicted
from tirelog.inference.fit.cells import Fit, priors
from tirelog.inference.metric import (
    LeaveOneOut,
    Normal,
    Offsets,
    Whitener,
    made_of,
    per_group,
    side_by_side,
    whitener,
)
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import STRAIN

# ---- What scatters: load and baseline from manoeuvre to manoeuvre, the load within manoeuvres.
#
# cells, the model fitted to them -> load and baseline of each manoeuvre, and the load of each
#                                    cell, as the residual has them
#     -> less what follows log, speed, acceleration and time, if it surely does (that is physics,
#        and for the candidates to explain)
#     -> standard deviations (of the random effects in the metric), and the deviations themselves
#        (of the floor, which is that of these data)


#: relative step of the load for its derivatives; the error of a central difference is its square:
#: four times as large with twice the step
_STEP = 0.01
#: probability with which manoeuvres that only scatter look as if they followed something: below it
#: they do, and what follows is no scatter. Effects of two floors follow with 1e-8 and less; loads
#: that wander are alike in neighbours, which looks like 1e-3
_FOLLOWS_P = 1e-4
#: flips of signs: 2,000 tell a probability of 0.01 to a fifth; twice as many tell it to a sixth
_FLIPS = 2000


@dataclass(frozen=True)
class Scatter:
    """Random effects of manoeuvres and of cells, as measured.

    `load_sd` and `wander_sd` relative, `baseline_sd` [unit]: standard deviations between
    manoeuvres, of the load between the cells of one, of the baseline between manoeuvres.
    `load` (C,): how far each cell's load is off by them, relative; `load_square`,
    `baseline_square` (C,): their squares as they came out in these cells, less what noise does.
    """

    load_sd: float
    baseline_sd: float
    wander_sd: float
    load: FloatArray
    load_square: FloatArray
    baseline_square: FloatArray

    def square(self, columns: FloatArray) -> FloatArray:
        """Mean square (C, m) [unit^2] that it makes, by `scatter_columns` (C, m, 2)."""
        return (
            self.load_square[:, None] * columns[..., 0] ** 2
            + self.baseline_square[:, None] * columns[..., 1] ** 2
        )


def load_slopes(cells: Cells, fit: Fit) -> tuple[FloatArray, FloatArray]:
    """First and second derivative (C, m) of the prediction by the relative load.

    If the model does not know what a load does, it is the amplitude, which does not bend. For a
    number per revolution only the model of that number counts. Through the fronts of a belt that
    leans, a load also moves a phase shift: far below its noise, but any rest would look like load.
    """
    conditions, model, here = cells.conditions, fit.model, fit.prediction
    if model.beside and cells.phi.shape[1] == 1:
        alone = replace(model, observable=cells.observable, beside=())
        model = model_of(alone, cells.observable, cells.member)
        here = predicted(model, cells)
    load = np.where(
        np.isfinite(conditions.load_N), conditions.load_N, fit.model.values.get("load_N", np.nan)
    )
    up, down = (
        or_refusal(predicted)(
            model, cells, conditions=replace(conditions, load_N=load * (1.0 + s * _STEP))
        )
        for s in (1, -1)
    )
    if not isinstance(up, ModelError) and not isinstance(down, ModelError):
        slope = (up - down) / (2.0 * _STEP)
        if np.isfinite(slope).all() or cells.phi.shape[1] > 1:
            return slope, (up + down - 2.0 * here) / _STEP**2
    return fit.prediction, np.zeros(fit.prediction.shape)


def load_derivative(cells: Cells, fit: Fit) -> FloatArray:
    """Change of the prediction per relative change of the load, (C, m)."""
    return load_slopes(cells, fit)[0]


def scatter_columns(cells: Cells, fit: Fit) -> FloatArray:
    """Columns of the random effects of manoeuvres: relative load, baseline; (C, m, 2)."""
    return np.stack([load_derivative(cells, fit), np.ones_like(cells.phi)], axis=-1)


def measure_scatter(
    cells: Cells, fit: Fit, used: Whitener, columns: FloatArray, missed: float
) -> Scatter:
    """The scatter that a fit in the metric `used` leaves.

    It misses a mean square `missed` [unit^2] besides.
    """
    wander_sd, wander = wander_within(cells, whitener(cells), fit, columns)
    white = whitener(cells, missed, wander_sd * columns[..., 0])
    (load_sd, load), (baseline_sd, baseline) = scatter_between(cells, white, fit, used, columns)
    own = load[cells.manoeuvre]
    # a load that is estimated farther off than this is not what scatters; twice as much would take
    # a fault of the fit for a load
    deviation = np.where(np.abs(own + wander) < 0.2, own + wander, 0.0)
    return Scatter(
        load_sd,
        baseline_sd,
        wander_sd,
        deviation,
        _scaled(load_sd, load)[cells.manoeuvre] + _scaled(wander_sd, wander),
        _scaled(baseline_sd, baseline)[cells.manoeuvre],
    )


def _scaled(sd: float, deviations: FloatArray) -> FloatArray:
    """Squares of the deviations, of which the mean is the variance."""
    square = deviations**2
    mean = float(square.mean())
    return square * (sd**2 / mean) if mean > 0.0 else np.full(square.shape, sd**2)


def trend_columns(cells: Cells) -> FloatArray:
    """What physics may follow, one row per manoeuvre (M, k).

    Each log's level, acceleration, that of curves, time, and v, v^2 log by log. What follows speed
    may follow a log's load, pressure, water or age besides. The last columns come only if enough
    manoeuvres are left to show scatter.
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
    across = mean(np.nan_to_num(c.lateral_acceleration_m_s2))
    columns = [per_log]
    for more in (
        v[:, None],
        a[:, None],
        across[:, None][:, : int(np.any(across))],
        np.stack([v**2, t], axis=1),
        per_log * v[:, None],
        per_log * (v**2)[:, None],
    ):
        if sum(x.shape[1] for x in (*columns, more)) <= 0.6 * M:
            columns.append(more)
    return np.hstack(columns)


def scatter_between(
    cells: Cells, white: Whitener, fit: Fit, used: Whitener, columns: FloatArray
) -> tuple[tuple[float, FloatArray], tuple[float, FloatArray]]:
    """Of the relative load and of the baseline: (standard deviation, (M,) of each manoeuvre).

    By the method of moments. What the fit took of them, in the metric that it `used`, is a loss of
    degrees of freedom.
    """
    residual = white(cells.values - fit.prediction - fit.beside)
    values, noise = Normal.of(white(columns), residual, cells.manoeuvre).solved()
    trend = trend_columns(cells)
    hat = trend @ np.linalg.pinv(trend)
    other, seen = Offsets.of(cells, used).beside(used(fit.jacobian)), used(columns)
    load, baseline = (
        _deviations(values[:, i], noise[:, i], hat, _taken(cells, other, seen[..., i]))
        for i in range(2)
    )
    # nor do loads scatter by more than themselves: what asks for that is a model that is wrong in
    # size, and as scatter it would hide every misfit. Half and twice say the same of all logs seen
    if load[0] > 1.0:  # the baseline takes the other part of such a misfit
        load = baseline = 0.0, np.zeros(cells.manoeuvres)
    return load, baseline


def _taken(cells: Cells, other: Offsets, column: FloatArray) -> float:
    """How many of the effects of single manoeuvres the fit and the offsets take, at most all.

    By the share of each one's whitened `column` (C, m) that lies in their span.
    """
    basis = other.spans[-1][0].reshape(*column.shape, -1)
    along = per_group((np.swapaxes(basis, 1, 2) @ column[..., None])[..., 0], cells.manoeuvre)
    level = per_group((other.direction * column).sum(axis=1), cells.manoeuvre)
    size = per_group((column**2).sum(axis=1), cells.manoeuvre)
    inside = ((along**2).sum(axis=1) + level**2) / np.maximum(size, 1e-300)
    return float(np.minimum(inside, 1.0).sum())


def _chance_of_following(of_all: float, of_rest: float, more: float, rest: float) -> float:
    """The probability that `more` columns take so much of a sum of squares by chance alone.

    `of_rest`: what they leave, with so many degrees of freedom. One if there is nothing to tell.
    """
    if more < 0.5 or rest < 0.5:
        return 1.0
    ratio = (of_all - of_rest) / more / max(of_rest / rest, 1e-300)
    return float(fdtrc(more, rest, max(ratio, 0.0)))


def _deviations(
    values: FloatArray, noise: FloatArray, hat: FloatArray, taken: float
) -> tuple[float, FloatArray]:
    """Standard deviation, and deviations (M,), of values that scatter by more than their `noise`.

    `noise` (M,) variances; `hat` (M, M) projects onto what they may follow, `taken` of them are
    free no more.
    """
    followed = float(np.trace(hat))
    free, rest = max(values.size - max(taken, 1.0), 2.0), values.size - followed
    if rest < 2.0:
        return 0.0, np.zeros(values.size)
    left, about = values - hat @ values, values - values.mean()
    of_all, of_rest = float(about @ about), float(left @ left)
    if _chance_of_following(of_all, of_rest, followed - 1.0, rest) > _FOLLOWS_P:
        expected = float(noise.sum()) * free / values.size
        sd = float(np.sqrt(max((of_all - expected) / free, 0.0)))
        if abs(values.mean()) > sd:
            return sd, about
        # a mean that no parameter could take is the scatter's own: loads that wander are few
        return float(np.sqrt(max((float(values @ values) - expected) / free, 0.0))), values
    expected = float(((1.0 - np.diag(hat)) * noise).sum())
    return float(np.sqrt(max((of_rest - expected) / rest, 0.0))), left


def wander_within(
    cells: Cells, white: Whitener, fit: Fit, columns: FloatArray
) -> tuple[float, FloatArray]:
    """Of the relative load between the cells of a manoeuvre: standard deviation, and (C,) each.

    By the method of moments, weighted by what each cell knows (DerSimonian and Laird 1986, with
    covariates). Each manoeuvre has its own level, and what surely follows speed, log by log, is no
    wander; 0 if too few cells are left to show one, or they do not surely. Only of strain: an
    acceleration's size follows the speed squared, so that a speed that is 0.3 % off looks like a
    load.
    """
    none = 0.0, np.zeros(len(cells))
    if cells.phi.shape[1] == 1 or cells.observable != STRAIN:
        return none
    residual = white(cells.values - fit.prediction - fit.beside)
    solved = Normal.of(white(columns), residual, np.arange(len(cells))).solved()
    load, variance = (part[:, 0] for part in solved)
    known = variance > 0.0
    variance = variance + _load_of_revolutions(cells, columns[..., 0])
    speed = cells.conditions.speed_m_s / max(float(np.mean(cells.conditions.speed_m_s)), 1e-9) - 1.0
    level = (cells.manoeuvre[:, None] == np.arange(cells.manoeuvres)).astype(float)
    log = (cells.log[:, None] == np.unique(cells.log)).astype(float)
    weight = 1.0 / variance[known]
    root, scaled = np.sqrt(weight), np.sqrt(weight) * load[known]
    followed = np.hstack([level, log * speed[:, None], log * speed[:, None] ** 2])[known]
    hat, left = _left_beside(root[:, None] * level[known], scaled)
    hat_followed, left_followed = _left_beside(root[:, None] * followed, scaled)
    more = float(np.trace(hat_followed) - np.trace(hat))
    rest = float(weight.size - np.trace(hat_followed))
    with_speed = _left_beside(root[:, None] * level[known], root * speed[known])[1]
    p = _chance_of_following(float(left @ left), float(left_followed @ left_followed), more, rest)
    # if cells were a sample, a load surely follows the speed with the first probability (misfits do
    # with 1e-6 to 1e-31), and a wander, alike in neighbours, looks like 1e-5; between the two it
    # does if manoeuvres agree by chance with the last at most
    if p <= 1e-6 or (
        p <= _FOLLOWS_P
        and agreement(with_speed * left, cells.manoeuvre[known], cells.log[known]) <= 0.01
    ):
        hat, left = hat_followed, left_followed
    freedom = float(weight.size - np.trace(hat))
    # degrees of freedom of cells within manoeuvres that a wander of the load is seen in; twice as
    # many would leave short logs without it
    if freedom < 8.0:
        return none
    spread = float((weight * (1.0 - np.diag(hat))).sum())
    # standard deviations of chi-square by which it must be seen: nulls stay below 2, a wander of 3
    # % shows with 18 and more; below it, what the model's shape lacks would pass for a wander;
    # twice as many would leave wanders of up to 2 % unsaid
    if float(left @ left) < freedom + 4.0 * np.sqrt(2.0 * freedom):
        return none
    deviations = np.zeros(len(cells))
    deviations[known] = left / root
    square = max((float(left @ left) - freedom) / max(spread, 1e-300), 0.0)
    return float(np.sqrt(square)), deviations


def agreement(products: FloatArray, manoeuvre: NDArray[np.int64], log: NDArray[np.int64]) -> float:
    """How often chance alone makes a log's manoeuvres agree so well on load against speed.

    `products` (n,) of cells: load x speed, whitened. A load that wanders is alike in neighbouring
    cells. So it follows the speed within one manoeuvre, up in this and down in the next. The
    manoeuvres are therefore the sample, and their signs are flipped.
    """
    scores = np.bincount(manoeuvre, products)
    of_log = np.zeros((scores.size, int(log.max()) + 1))
    of_log[manoeuvre, log] = 1.0
    square = np.maximum(scores**2 @ of_log, 1e-300)
    signs = np.random.default_rng(0).choice([-1.0, 1.0], (_FLIPS, scores.size))
    flipped = ((signs * scores @ of_log) ** 2 / square).sum(axis=1)
    measured = ((scores @ of_log) ** 2 / square).sum()
    return (1.0 + float(np.sum(flipped >= measured * (1.0 - 1e-12)))) / (1.0 + _FLIPS)


def _left_beside(design: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The projection (n, n) onto a design's columns, and what it leaves of values (n,)."""
    hat = design @ np.linalg.pinv(design)
    return hat, values - hat @ values


def _load_of_revolutions(cells: Cells, load: FloatArray) -> FloatArray:
    """Variance (C,) of each cell's relative load from the scatter of its revolutions.

    Amplitude, width and baseline scatter together as far as a load does it: their covariance along
    what a `load` derivative (C, m) is made of.
    """
    good = np.isfinite(cells.values)[..., None]
    columns, slope = np.where(good, cells.random, 0.0), np.where(good[..., 0], load, 0.0)
    share = made_of(columns, slope)
    along = np.einsum("ck,ckl,cl->c", share, cells.random_cov, share)
    square = (share**2).sum(axis=1) ** 2  # zero where a load changes nothing
    return np.asarray(along / np.maximum(square, 1e-300), dtype=np.float64)


# ---- The metric of size, the floor, and losses on manoeuvres left out.


#: cells whose columns are worked on at a time, about
_SOME_CELLS = 64


@dataclass(frozen=True, kw_only=True)
class UnweightedMetric(Whitener):
    """The metric of size.

    What is free in a cell (its shift) is removed; each cell is weighted by its revolutions, so that
    sums of squares are mean squares times `weight`. `noise` (C, m): what noise and the scatter of
    revolutions leave of each square.
    """

    noise: FloatArray
    weight: float

    @classmethod
    def of(cls, cells: Cells) -> UnweightedMetric:
        good = np.isfinite(cells.values) & np.isfinite(cells.sd)
        number = np.maximum(good.sum(axis=1), 1)
        weights = np.where(good, np.sqrt(cells.revolutions / number)[:, None], 0.0)
        shift = np.where(good, cells.shift, 0.0)
        size = np.linalg.norm(shift, axis=1, keepdims=True)
        direction = shift / np.where(size > 0.0, size, np.inf)
        spread = np.einsum("cmi,cij,cmj->cm", cells.random, cells.random_cov, cells.random)
        noise = weights**2 * (np.where(good, cells.sd, 0.0) ** 2 * (1.0 - direction**2) + spread)
        weight = float(cells.revolutions.sum())
        return cls(weights, direction[..., None], np.ones(size.shape), noise=noise, weight=weight)

    @property
    def bias(self) -> float:
        """What noise leaves of a sum of squares."""
        return float(self.noise.sum())

    @property
    def weights(self) -> FloatArray:
        """Root of the number of revolutions behind each value, (C, m); zero if empty."""
        return self.inverse_sd

    def mean_square(self, losses: FloatArray) -> float:
        """Mean square error of a revolution's value above `within`.

        From sums of squares (M,) of cell means.
        """
        return (float(np.sum(losses)) - self.bias) / self.weight


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
    slope_left = slope_left - (columns @ made_of(columns, slope_left)[..., None])[..., 0]
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
    """The floor from the cells' repeatability and the measured scatter of manoeuvres."""
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
    precision: float = 0.0,
) -> list[tuple[FloatArray, FloatArray]]:
    """`held_out_losses` with each of several additions to the model, alone.

    The model's own columns, which are most, are brought into the metrics once for all. `precision`
    [1/unit^2] is that of the additions' strengths before any manoeuvre, about zero.
    """
    first = fit.jacobian.shape[-1] + fit.amplitudes.size
    metrics = (white, plain) if of is None else (white, white.only(of), plain.only(of))
    losses = []
    for normals in zip(
        *(_left_out_of(cells, metric, fit, additions, precision) for metric in metrics),
        strict=True,
    ):
        theta = normals[0].left_out() - normals[0].step_of_all(first)
        losses.append((normals[-2].loss(theta), normals[-1].loss(theta)))
    return losses


def steps_left_out(cells: Cells, white: Whitener, fit: Fit) -> FloatArray:
    """How far the free parameters move (M, p) if each manoeuvre is left out in its turn.

    One step from the fitted point, as for held-out losses; zero for parameters at a bound.
    """
    (normal,) = _left_out_of(cells, white, fit, [()])
    p = fit.jacobian.shape[-1]
    moved: FloatArray = normal.left_out() - normal.step_of_all(p + fit.amplitudes.size)
    return moved[:, normal.offsets : normal.offsets + p]


def losses_of_errors(
    cells: Cells, white: Whitener, plain: UnweightedMetric, fit: Fit
) -> FloatArray:
    """What the errors of the parameters add to held-out losses in the plain metric, (M,).

    In the mean, if nothing is missing: manoeuvres are few, and each scatters.
    """
    (in_white,), (in_plain,) = (_left_out_of(cells, one, fit, [()]) for one in (white, plain))
    # one offset a log is in the scatter of manoeuvres; those of further observables are estimated
    return _further_as_columns(in_white).of_errors(_further_as_columns(in_plain))


def _further_as_columns(own: LeaveOneOut) -> LeaveOneOut:
    """The same with each log's offsets beyond the first as columns of its own."""
    further, size = own.offsets - 1, own.normal.right.shape[1]
    more = further * (int(own.log.max()) + 1)
    turn = np.zeros((own.log.size, size - further + more, size))
    rows, each = np.arange(own.log.size)[:, None], np.arange(further)
    turn[:, 0, 0] = 1.0
    turn[rows, 1 + own.log[:, None] * further + each, 1 + each] = 1.0
    parameters = np.arange(size - own.offsets)
    turn[:, 1 + more + parameters, own.offsets + parameters] = 1.0
    gram, right, square = own.normal
    normal = Normal(
        turn @ gram @ np.swapaxes(turn, 1, 2), (turn @ right[..., None])[..., 0], square
    )
    known, pull = (np.pad(part, (more, 0)) for part in own.prior)
    return replace(own, normal=normal, prior=(known, pull), offsets=1)


def _left_out_of(
    cells: Cells,
    metric: Whitener,
    fit: Fit,
    additions: Sequence[Sequence[FloatArray]],
    precision: float = 0.0,
) -> list[LeaveOneOut]:
    """The normal equations of every manoeuvre, with each of the additions (C, m, k) to the model.

    No metric couples two manoeuvres, so some are worked on at a time. `precision` as
    `held_out_losses_with`.
    """
    columns, prediction = [fit.moving], fit.prediction
    mean, known = priors(fit.model, fit.names)
    pull = known * (mean - [fit.model.values[name] for name in fit.names])
    if (shared := cells.shared) is not None:
        columns.append(shared.columns)
        prediction = prediction + shared.columns @ fit.amplitudes
        known = np.append(known, shared.sd**-2.0)
        pull = np.append(pull, -fit.amplitudes / shared.sd**2)
    # a number per revolution has no offset
    waves = [i for i, one in enumerate(cells.members) if one.phi.shape[1] > 1] or [0]
    levels = cells.level[..., None] * (cells.part[:, None, None] == np.array(waves))
    made: list[list[Normal]] = [[] for _ in additions]
    last = np.searchsorted(np.sort(cells.manoeuvre), np.arange(cells.manoeuvres), side="right")
    cuts = np.flatnonzero(np.diff(last // _SOME_CELLS)) + 1
    for numbers in np.split(np.arange(cells.manoeuvres), cuts):
        rows = np.flatnonzero(np.isin(cells.manoeuvre, numbers))
        some, manoeuvre = metric.some(rows), cells.manoeuvre[rows] - numbers[0]
        values = cells.values[rows]
        residual = some(np.where(np.isfinite(values), values - prediction[rows], 0.0))
        own = side_by_side(some, [part[rows] for part in (levels, *columns)])
        of_model = Normal.of(own, residual, manoeuvre)
        for more, of_more in zip(additions, made, strict=True):
            normal = of_model
            if more:
                added = side_by_side(some, [part[rows] for part in more])
                crossed = per_group(np.swapaxes(own, 1, 2) @ added, manoeuvre)
                normal = normal.beside(Normal.of(added, residual, manoeuvre), crossed)
            of_more.append(normal)
    drive = np.zeros(cells.manoeuvres, np.int64)
    drive[cells.manoeuvre] = np.unique(cells.log % len(cells.log_names), return_inverse=True)[1]
    normals = [Normal(*map(np.concatenate, zip(*parts, strict=True))) for parts in made]
    left = [normal.right.shape[1] - levels.shape[-1] - known.size for normal in normals]
    before = [
        (np.pad(known, (0, k), constant_values=precision), np.pad(pull, (0, k))) for k in left
    ]
    return [
        LeaveOneOut(normal, drive, prior, levels.shape[-1])
        for normal, prior in zip(normals, before, strict=True)
    ]
