"""A model's parameters from cells.

Damped least squares in whitened space, several starts, one free offset per log and block.

    blocks (the cells of an observable, a grating or a channel, and their metric), Model
        -> residuals r = W (y - f), Jacobians J = W df/dtheta (C, m, p), what is beside the model
        --descent over all blocks--> one Fit per block, in the same parameters

Offsets and shared effects are projected out of r and J (they are linear).

One start may end in a local minimum: `fit_blocks` tries several on a few cells and takes the best
two on to all of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from tirelog.errors import ModelError, or_refusal
from tirelog.inference.cells.cells import Cells, lacking, linearised, predicted
from tirelog.inference.metric import RANK, Offsets, Whitener, projected_out, shrinkage
from tirelog.physics.effects.waveform import BY_LOAD
from tirelog.physics.model.model import Model
from tirelog.physics.spectral import Parameter
from tirelog.process_pool import made_apart
from tirelog.vocabulary.arrays import FloatArray

# ---- The one descent of every fit: damped least squares (Levenberg-Marquardt) within bounds.
#
#     LeastSquares, theta (p,) --damped steps, none longer than a parameter's size--> Reached
#
# A parameter that is at a bound and would leave it is held for that step.


#: steps of a descent at most; twice as many only matter to fits that have not settled by then,
#: which is reported
MOST_STEPS = 25
#: a step that gains less than this share of the sum of squares is the last
SETTLED = 1e-4


class LeastSquares(Protocol):
    """What a descent asks of a problem: residuals and slopes in a metric in which they count alike.

    low, high   (p,) bounds of theta
    """

    low: FloatArray
    high: FloatArray

    def left(self, theta: FloatArray) -> FloatArray:
        """Measured less predicted (N,) at a point; ModelError if it is refused."""

    def slopes(self, theta: FloatArray, size: FloatArray) -> FloatArray:
        """Derivatives of the prediction by theta / size, (N, p), where the last residual was."""

    def sizes(self, theta: FloatArray) -> FloatArray:
        """The longest step of each parameter at a point, (p,)."""

    def residual(self, theta: FloatArray) -> FloatArray:
        """`left` at a point to go on from."""
        return self.left(theta)

    def square(self, theta: FloatArray) -> float:
        """Sum of squares of the residual at a point on trial; infinite if it is refused."""
        left = or_refusal(self.left)(theta)
        return float("inf") if isinstance(left, ModelError) else float((left**2).sum())

    def renewed(self) -> bool:
        """Were some of the last slopes those of an earlier point?  None of the next will be."""
        return False


#: where a descent ended: theta (p,), sum of squares, whether more steps would gain little
Reached = tuple[FloatArray, float, bool]


def descend(
    problem: LeastSquares,
    theta: FloatArray,
    *,
    steps: int = MOST_STEPS,
    settled: float = SETTLED,
) -> Reached:
    """The least sum of squares near `theta` (p,) within the bounds.

    ModelError if the start itself is refused; any later point that is refused is a step too far.
    """
    residual, low, high = problem.residual(theta), problem.low, problem.high
    square, damping = float((residual**2).sum()), 1e-3
    for _ in range(steps if theta.size else 0):
        size = problem.sizes(np.clip(theta, low, high))
        slope = problem.slopes(theta, size)
        gram, gradient = slope.T @ slope, slope.T @ residual
        free = ~parameters_leaving(theta, low, high, gradient)
        # dampings tried for one step; twice as many damp further down before a step is given up
        for _ in range(8):
            new = np.clip(theta + _damped(gram, gradient, free, damping) * size, low, high)
            reached = problem.square(new)
            if reached < square:
                break
            damping = max(damping, 1e-6) * 8.0
        else:
            if problem.renewed():
                damping = 1e-3
                continue
            return theta, square, True
        moved = (new - theta) / size
        hoped = float(moved @ (2.0 * gradient - gram @ moved))
        drop, theta, damping = square - reached, new, damping / 10.0
        # slopes of an earlier point are made anew after a step that gains less than this share of
        # what they let hope for; twice as much makes them anew more often
        if drop < 0.1 * hoped:
            problem.renewed()
        residual = problem.residual(theta)
        square = float((residual**2).sum())
        # and less than 0.3 of it (1 is what a parameter costs that is off by its standard error):
        # twice as much may leave a parameter off by 0.8 of its standard error
        if drop < settled * square and drop < 0.3 and not problem.renewed():
            return theta, square, True
    return theta, square, not theta.size


def parameters_leaving(
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


# ---- The one error formula of every fit: how well whitened slopes determine the parameters.
#
# slopes (N, p), variance of a residual -> columns of length one -> eigenvectors of the normal
#     matrix: seen ones give the covariance, unseen ones (blind) the combinations of parameters
#     that the data do not determine


#: eigenvalues of the normal matrix (columns of length one) below this share of the largest are
#: directions that change nothing; twice as much drops directions that are seen 1.4 times as well
NULL = 1e-10
#: a parameter with more than this share (a cosine) in a blind direction is not determined; twice
#: as much tells errors of parameters of which a fifth cannot be seen
UNSEEN = 0.1


@dataclass(frozen=True)
class Errors:
    """What is known of p parameters: standard errors, covariance, blind directions.

    Standard errors (p,), inf if the data are blind; covariance (p, p) along the directions that
    they see; the blind directions (b, p), each of length one in parameters in units of what moves
    the data alike.
    """

    se: FloatArray
    covariance: FloatArray
    blind: FloatArray


def errors_of(slopes: FloatArray, variance: float) -> Errors:
    """Standard errors of what has the whitened `slopes` (N, p), for residuals of this variance."""
    p = slopes.shape[1]
    norm = np.linalg.norm(slopes, axis=0)
    usable = norm > 0
    se, covariance, blind = np.full(p, np.inf), np.zeros((p, p)), np.eye(p)[~usable]
    if not usable.any():
        return Errors(se, covariance, blind)
    unit = slopes[:, usable] / norm[usable]
    values, vectors = np.linalg.eigh(unit.T @ unit)
    good = values > NULL * values[-1]
    hidden = np.abs(vectors[:, ~good]).max(axis=1, initial=0.0) > UNSEEN
    known = np.where(hidden, np.inf, (vectors[:, good] ** 2 / values[good]).sum(axis=1))
    se[usable] = np.sqrt(variance * known) / norm[usable]
    inverse = (vectors[:, good] / values[good]) @ vectors[:, good].T
    covariance[np.ix_(usable, usable)] = variance * inverse / np.outer(norm[usable], norm[usable])
    unseen = np.zeros((int((~good).sum()), p))
    unseen[:, usable] = vectors[:, ~good].T
    return Errors(se, covariance, np.concatenate([blind, unseen]))


#: a condition that changes by less than this share of its mean counts as constant: what follows
#: it cannot be seen; twice the share decides the same in all logs seen
LEAST_CHANGE = 0.02
#: starts: factors on the start values of some parameters
STARTS: tuple[Mapping[str, float], ...] = (
    {},
    {"patch_half_length_m": 0.7},
    {"patch_half_length_m": 1.4, "foundation_stiffness_N_m2": 0.4},
    {"foundation_stiffness_N_m2": 4.0, "flexural_stiffness_N_m2": 0.4},
    {"flexural_stiffness_N_m2": 4.0, "tread_stiffness_N_m2": 0.3},
    {"flexural_stiffness_N_m2": 8.0, "foundation_stiffness_N_m2": 8.0, "lever_arm_m": 8.0},
)
#: the same of a model that learns its form: with it a patch that is too long fits nearly as well
FORM_STARTS: tuple[Mapping[str, float], ...] = (
    {},
    {"patch_half_length_m": 0.85},
    {"patch_half_length_m": 1.15},
)
#: the same for a model below whose critical speed none of its starts is: each doubles that speed
_STIFFER: tuple[Mapping[str, float], ...] = tuple(
    {"flexural_stiffness_N_m2": 4.0**i, "foundation_stiffness_N_m2": 4.0**i} for i in range(5)
)
#: a fit that ends within this share of a bound, and would leave it, is at it: steps along a
#: valley shrink before they arrive; doubling changes nothing seen
AT_BOUND = 5e-3


@dataclass(frozen=True)
class Fit:
    """A model fitted to one block, alone or together with others, in the metric `white`.

    Jacobian of the prediction (C, m, p) in the observable's unit, prediction (C, m) without what is
    `beside` it: offset per log, amplitudes (K,) of the cells' shared effects. Chi-square and
    degrees of freedom (blocks share what the parameters take); `known`: the parameters' errors, of
    all blocks together; `cells` as they were centred. `held`: parameters that stand at a bound and
    would leave it; `stuck`: what is left looks like a step of the parameters that none of their
    values makes.
    """

    model: Model
    names: tuple[str, ...]
    chi2: float
    freedom: float
    prediction: FloatArray
    jacobian: FloatArray
    offsets: FloatArray
    amplitudes: FloatArray
    known: Errors
    settled: bool
    cells: Cells
    held: tuple[str, ...] = ()
    stuck: bool = False

    @property
    def reduced_chi2(self) -> float:
        return self.chi2 / self.freedom

    @property
    def levels(self) -> FloatArray:
        """The offset of each cell, (C,), which is its log's."""
        return self.offsets[np.searchsorted(np.unique(self.cells.log), self.cells.log)]

    @property
    def beside(self) -> FloatArray:
        """What is measured beside the prediction, (C, m): offsets and shared effects."""
        beside = np.zeros(self.prediction.shape) + self.levels[:, None]
        if self.cells.shared is not None:
            beside += self.cells.shared.columns @ self.amplitudes
        return beside

    @property
    def moving(self) -> FloatArray:
        """The Jacobian (C, m, p) with zeros for what is held, or for all if the fit is stuck.

        Whatever data are left out or added, that does not move.
        """
        if self.stuck:
            return np.zeros_like(self.jacobian)
        if not self.held:
            return self.jacobian
        return np.where(np.isin(self.names, self.held), 0.0, self.jacobian)


def free_names(model: Model, *blocks: Cells) -> tuple[str, ...]:
    """What the fit moves: the free parameters, less those that some of the cells cannot show."""
    held = set()
    for cells in blocks:
        for effect in model.effects:
            if lacking(effect.effect, model, cells):
                held |= {f"{effect.id}.{p.name}" for p in effect.parameters}
        load = cells.conditions.load_N
        if not np.ptp(load) > LEAST_CHANGE * load.mean():
            held |= {f"form.{name}" for name in BY_LOAD}
    return tuple(name for name in model.free if name not in held)


#: the cells of an observable, a grating or a channel, and their metric
Block = tuple[Cells, Whitener]


class Problem(LeastSquares):
    """The least squares of blocks of cells in the parameters `names` of one model.

    What is beside the model is taken out of residuals and slopes: the offset of each log, each
    block's own, and shared effects, of which those of one name are one to all gratings.
    """

    def __init__(self, blocks: Sequence[Block], model: Model, names: Sequence[str]) -> None:
        self.cells, self.whites = [cells for cells, _ in blocks], [white for _, white in blocks]
        self.levels = [Offsets.of(replace(cells, shared=None), white) for cells, white in blocks]
        #: standard deviations of all shared effects by whose they are, and of each block the places
        #: of its own among them
        sd: dict[str, float] = {}
        self.places: list[list[int]] = []
        for number, cells in enumerate(self.cells):
            own = cells.shared
            sizes = {} if own is None else dict(zip(own.names, own.sd.tolist(), strict=True))
            keyed = {n if cells.member else f"{number}: {n}": size for n, size in sizes.items()}
            sd |= keyed
            self.places.append([list(sd).index(key) for key in keyed])
        self.sd = np.array(list(sd.values()))
        if sd:
            self.basis, self.share, self.turn = shrinkage(self._columns() * self.sd)
        self.model, self.names = model, tuple(names)
        self.low, self.high = bounds(model, names)
        self.known = priors(model, names)[1] > 0.0
        self._last: dict[int, tuple[Cells, dict[str, float], FloatArray]] = {}
        self._kept: FloatArray | None = None
        self._stale = False

    def _columns(self) -> FloatArray:
        """Those of all shared effects, whitened, offsets taken out, (N, K)."""
        columns = []
        for cells, places in zip(self.cells, self.places, strict=True):
            own = cells.shared
            if own is not None and places == list(range(self.sd.size)):
                columns.append(own.columns)  # they may be many: without a copy
                continue
            columns.append(np.zeros((*cells.phi.shape, self.sd.size)))
            if own is not None:
                columns[-1][..., places] = own.columns
        return self._levelled(columns)

    def _levelled(self, each: Sequence[FloatArray]) -> FloatArray:
        """Of each block x (C, m) or (C, m, k), whitened, offsets taken out; all as (N, k)."""
        flat = [
            level.without(white(x)).reshape(x.shape[0] * x.shape[1], -1)
            for level, white, x in zip(self.levels, self.whites, each, strict=True)
        ]
        return flat[0] if len(flat) == 1 else np.concatenate(flat)

    def whitened(self, each: Sequence[FloatArray]) -> FloatArray:
        """The same without what is beside the model, (N, k)."""
        flat = self._levelled(each)
        return projected_out(self.basis, flat, self.share) if self.sd.size else flat

    def measured_less(self, predictions: Sequence[FloatArray]) -> FloatArray:
        """Whitened residual (N,) without what is beside the model."""
        pairs = zip(self.cells, predictions, strict=True)
        return self.whitened([cells.values - there for cells, there in pairs])[:, 0]

    def predictions(self, theta: FloatArray) -> list[FloatArray]:
        """Of each block (C, m); of a point that was tried they are not made again to go on from."""
        values = self.values(theta)
        for i, cells in enumerate(self.cells):
            known = self._last.get(i)
            if known is None or known[0] is not cells or known[1] != values:
                self._last[i] = cells, values, predicted(self.model, cells, values=values)
        return [self._last[i][2] for i in range(len(self.cells))]

    def values(self, theta: FloatArray) -> dict[str, float]:
        return dict(zip(self.names, theta.tolist(), strict=True))

    def sizes(self, theta: FloatArray) -> FloatArray:
        own = [self.model.parameters[name] for name in self.names]
        usual = [0.3 * abs(p.probe) if p.prior is None else p.prior[1] for p in own]
        return np.maximum(np.maximum(np.abs(theta), usual), 1e-12)

    def residual(self, theta: FloatArray) -> FloatArray:
        """`left`, the cells' angles moved to the model's patch centre.

        A lag or a lopsided load shifts its waveform beyond what is linear.
        """
        # a shift below this is left to the linear nuisance [rad]: twice as much is still less than
        # a bin of the angle, 0.025; the rounds end earlier than after the last as a rule
        for _ in range(8):
            pairs = zip(self.cells, self.predictions(theta), strict=True)
            moved = [centred(cells, there) for cells, there in pairs]
            self.cells = [cells for cells, _ in moved]
            if max(farthest for _, farthest in moved) < 1e-3:
                break
        return self.left(theta)

    def slopes(self, theta: FloatArray, size: FloatArray) -> FloatArray:
        """Those of numbers with a prior, which are many, are kept from point to point."""
        values, many = self.values(theta), self.known
        asked = np.full(many.size, self._kept is None) | ~many
        names = [name for name, wanted in zip(self.names, asked, strict=True) if wanted]
        found = [linearised(self.model, c, names, values, rough=True)[1] for c in self.cells]
        made = self.whitened(found)
        slopes = np.empty((len(made), many.size))
        slopes[:, asked] = made
        self._stale = not asked.all()
        if self._kept is not None:
            slopes[:, many] = self._kept
        self._kept = slopes[:, many]
        return np.concatenate([slopes, prior_rows(self.model, self.names, theta)[1]]) * size

    def renewed(self) -> bool:
        """Drops what is kept if the last slopes held some of it, and says so."""
        if self._stale:
            self._kept = None
        return self._stale

    def left(self, theta: FloatArray) -> FloatArray:
        """What is left of the cells, and how far each parameter is from its prior's mean."""
        left = self.measured_less(self.predictions(theta))
        return np.concatenate([left, prior_rows(self.model, self.names, theta)[0]])

    def beside(self, predictions: Sequence[FloatArray]) -> list[tuple[FloatArray, FloatArray]]:
        """Of each block the offset of each log (logs,) and amplitudes of its shared effects."""
        left = [cells.values - there for cells, there in zip(self.cells, predictions, strict=True)]
        amplitudes = np.zeros(0)
        if self.sd.size:
            amplitudes = self.sd * (self.turn @ (self.basis.T @ self._levelled(left)[:, 0]))
        found = []
        for i, cells in enumerate(self.cells):
            mine, rest = amplitudes[self.places[i]], left[i]
            if cells.shared is not None:
                rest = rest - cells.shared.columns @ mine
            found.append((self.levels[i].of_logs(self.whites[i](rest)), mine))
        return found


def centred(cells: Cells, prediction: FloatArray) -> tuple[Cells, float]:
    """The centred cells, and the largest shift left [rad].

    Their angles are moved by the shift between measurement and prediction.
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


def bounds(model: Model, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    parameters: list[Parameter] = [model.parameters[n] for n in names]
    return np.array([p.min for p in parameters]), np.array([p.max for p in parameters])


def priors(model: Model, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    """Mean (p,) and precision (p,), 1 / variance, of each parameter before any data.

    Precision zero of one without a prior.
    """
    known = [model.parameters[name].prior for name in names]
    return (
        np.array([0.0 if prior is None else prior[0] for prior in known]),
        np.array([0.0 if prior is None else prior[1] ** -2.0 for prior in known]),
    )


def prior_rows(
    model: Model, names: Sequence[str], theta: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Residuals (q,) and slopes (q, p) of what is known of parameters without data.

    In standard deviations: priors, and the inequalities of effects as far as they are broken.
    """
    mean, precision = priors(model, names)
    root = np.sqrt(precision)
    rows, floor = inequalities(model, names)
    above = rows @ theta + floor
    return (
        np.concatenate([root * (mean - theta), np.maximum(-above, 0.0)]),
        np.concatenate([np.diag(root), np.where(above[:, None] < 0.0, rows, 0.0)]),
    )


def inequalities(model: Model, names: Sequence[str]) -> tuple[FloatArray, FloatArray]:
    """Rows (q, p) and floor (q,) of the effects' inequalities, in standard deviations.

    rows @ theta + floor is negative by chance only. Numbers outside of `names` are in the floor.
    """
    rows, floor = np.zeros((0, len(names))), np.zeros(0)
    for effect in (e.effect for e in model.effects):
        if effect.constraints is None:
            continue
        own, least = effect.constraints()
        of = [f"{effect.id}.{p.name}" for p in effect.parameters]
        asked = np.array([[n == name for name in names] for n in of], np.float64)
        fixed = np.array([0.0 if n in names else model.values[n] for n in of])
        rows = np.concatenate([rows, own @ asked])
        floor = np.concatenate([floor, least + own @ fixed])
    return rows, floor


#: where a descent of blocks ended: the problem as it was centred, the model there, chi-square,
#: whether it settled
End = tuple[Problem, Model, float, bool]


def descended(
    blocks: Sequence[Block], model: Model, names: Sequence[str], steps: int = MOST_STEPS
) -> End:
    """The best model over all blocks, from the model's values on.

    A point that the physics refuses is a step too far; ModelError only if the start itself is
    refused.
    """
    problem = Problem(blocks, model, names)
    theta, square, settled = descend(
        problem, np.array([model.values[n] for n in names]), steps=steps
    )
    return problem, model.with_values(problem.values(theta)), square, settled


def starts(
    model: Model, names: Sequence[str], every: Sequence[Mapping[str, float]] = ()
) -> list[Model]:
    """The model's own values, and others around them that stay within the bounds."""
    result = []
    for factors in every or (FORM_STARTS if np.any(priors(model, names)[1]) else STARTS):
        moved = {n: f * model.values[n] for n, f in factors.items() if n in names}
        if factors and not moved:
            continue
        clipped = {
            n: float(np.clip(v, model.parameters[n].min, model.parameters[n].max))
            for n, v in moved.items()
        }
        result.append(model.with_values(clipped))
    return result


def fit_blocks(
    blocks: Sequence[Block],
    model: Model,
    *,
    several: bool = True,
    steps: int = MOST_STEPS,
) -> list[Fit]:
    """The model fitted to all blocks at once.  ModelError if no start can be computed."""
    names = free_names(model, *(cells for cells, _ in blocks))
    tried: list[End | ModelError] = []
    for begins in _begins(blocks, names, model) if several else ([model],):
        tried += [or_refusal(descended)(blocks, begin, names, steps) for begin in begins]
        ends = [end for end in tried if not isinstance(end, ModelError)]
        if ends:
            break
    else:
        raise next(end for end in reversed(tried) if isinstance(end, ModelError))
    fits = _finished(ends)
    return _from_within(blocks, model, fits) if several and fits[0].held else fits


def _finished(ends: Sequence[End]) -> list[Fit]:
    """The fit at the best end."""
    problem, best, _, settled = min(ends, key=lambda end: end[2])
    return finish(problem, best, settled)


def _begins(blocks: Sequence[Block], names: Sequence[str], model: Model) -> Iterator[list[Model]]:
    """Where to begin: the most promising starts; if none can be computed all, then stiffer ones."""
    every = starts(model, names)
    yield _promising(blocks, names, every) if len(every) > 1 else every
    yield every
    yield from ([start] for start in starts(model, names, _STIFFER)[1:])


def _from_within(blocks: Sequence[Block], model: Model, fits: list[Fit]) -> list[Fit]:
    """The best of this fit, which ended at a bound, and of fits from within.

    Those begin with the parameters at a bound brought back to their start values.
    """
    names, held = fits[0].names, fits[0].held
    values = {tuple(start.values[name] for name in held) for start in starts(model, names)}
    inner = [
        fits[0].model.with_values(dict(zip(held, inside, strict=True))) for inside in sorted(values)
    ]
    begins = _promising(blocks, names, inner)
    tried = [or_refusal(descended)(blocks, begin, names) for begin in begins]
    least = sum(fit.chi2 for fit in fits)
    ends = [end for end in tried if not isinstance(end, ModelError) and end[2] < least]
    return _finished(ends) if ends else fits


def _promising(
    blocks: Sequence[Block], names: Sequence[str], candidates: list[Model]
) -> list[Model]:
    """The two best of the starts after a few steps on a few cells."""
    ends = made_apart([partial(_tried, blocks, names, start) for start in candidates])
    reached = [end for end in ends if not isinstance(end, ModelError)]
    reached.sort(key=lambda result: result[1])
    distinct = [
        r
        for i, r in enumerate(reached)
        if i == 0 or abs(r[1] - reached[0][1]) > 0.02 * reached[0][1]
    ]
    return [r[0] for r in distinct[:2]] or candidates


@or_refusal
def _tried(blocks: Sequence[Block], names: Sequence[str], start: Model) -> tuple[Model, float]:
    """Where a start leads on a few cells, and chi-square there."""
    return descended([_few(*one) for one in blocks], start, names, steps=15)[1:3]


def _few(cells: Cells, white: Whitener) -> Block:
    """A few cells that span speeds and logs, without the scatter between manoeuvres."""
    order = np.lexsort((cells.conditions.speed_m_s, cells.log))
    # cells that a start is judged on; twice as many judge a start better and take twice as long
    rows = np.unique(order[np.linspace(0, order.size - 1, min(12, order.size)).astype(int)])
    few = Whitener(white.inverse_sd[rows], white.basis[rows], white.shrink[rows])
    return cells.take(rows), few


def finish(problem: Problem, model: Model, settled: bool) -> list[Fit]:
    """Everything about the fitted point, block by block."""
    names, blocks = problem.names, problem.cells
    points = [linearised(model, cells, names, {}) for cells in blocks]
    predictions = [prediction for prediction, _ in points]
    residual = problem.measured_less(predictions)
    theta, precision = np.array([model.values[n] for n in names]), priors(model, names)[1]
    beside, of_beside = prior_rows(model, names, theta)
    slope = np.concatenate([problem.whitened([jacobian for _, jacobian in points]), of_beside])
    left = np.concatenate([residual, beside])
    ends = np.cumsum([cells.phi.size for cells in blocks])[:-1]
    chi2 = [float((own**2).sum()) for own in np.split(residual, ends)]
    low, high = bounds(model, names)
    out = parameters_leaving(
        theta,
        low + AT_BOUND * np.abs(low),
        high - AT_BOUND * np.abs(high),
        slope.T @ left,
    )
    stuck = _stuck(model, names, np.where(out, 0.0, slope), left)
    known = errors_of(np.where(out, 0.0, slope), 1.0)
    # a number with a prior takes a freedom only as far as the data and not the prior decide it
    decided = 1.0 - precision * np.where(precision > 0.0, known.se, 0.0) ** 2
    moved = float(decided[~out].sum()) / len(blocks)
    chi2[0] += float((beside**2).sum())
    freedom = [
        float(max(white.freedom - level.taken - moved, 1.0))
        for white, level in zip(problem.whites, problem.levels, strict=True)
    ]
    known = errors_of(np.where(out, 0.0, slope), max(1.0, sum(chi2) / sum(freedom)))
    fitted = model.with_values(
        {n: model.values[n] for n in names}, se=dict(zip(names, known.se.tolist(), strict=True))
    )
    held = tuple(name for name, outwards in zip(names, out, strict=True) if outwards)
    taken = problem.beside(predictions)
    return [
        Fit(
            fitted,
            names,
            chi2[i],
            freedom[i],
            *points[i],
            *taken[i],
            known,
            settled,
            cells,
            held,
            stuck,
        )
        for i, cells in enumerate(blocks)
    ]


def _stuck(model: Model, names: Sequence[str], slope: FloatArray, left: FloatArray) -> bool:
    """Would the tangent take much of what is `left` (N,), by values that the bounds refuse?

    `slope` (N, p): whitened derivatives, zero for what is held.
    """
    moving = np.linalg.norm(slope, axis=0) > 0.0
    if not moving.any():
        return False
    scaled = slope[:, moving] / np.linalg.norm(slope[:, moving], axis=0)
    step = np.linalg.lstsq(scaled, left, rcond=RANK)[0]
    # a fit is stuck if the tangent at its point would take this share of chi-square by a step
    # beyond the bounds: the way there is bent. Where a descent has settled it is below 1e-3; half
    # and twice the share say the same of all logs seen
    if left @ (scaled @ step) < 0.3 * (left @ left):
        return False
    low, high = (bound[moving] for bound in bounds(model, names))
    there = np.array([model.values[n] for n in names])[moving]
    there = there + step / np.linalg.norm(slope[:, moving], axis=0)
    return bool(((there < low) | (there > high)).any())
