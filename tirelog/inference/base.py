"""Where every question starts: cells, metric, floor and the fitted base model, in one value.

Stack, Model -> cells -> fit in the cells' own metric -> scatter between manoeuvres
    -> metric with it -> fit again (a few steps)

Several channels of one tire are fitted together: each has its metric, its scatter and its offsets,
all have the parameters.

Several observables in one question (`prepare_together`) are one Base of `channels`: a list of
blocks, each in its own unit with its own metric and floor, in one fit. Their cells are under each
other in floors (`cells.cells`), so that whatever works on one observable works on several:
candidates, nuisances, held-out losses. `bases_by_observable` gives the base of each observable at
the parameters of the fit to all. The errors of one observable, and what is left of it, are those of
its base.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.errors import ModelError, or_refusal
from tirelog.inference.cells.cells import (
    LEVER,
    Cells,
    SharedEffects,
    at_lever,
    in_bins,
    joined_cells,
    of_all,
    predicted,
    with_ratios,
)
from tirelog.inference.fit.cells import (
    MOST_STEPS,
    UNSEEN,
    Errors,
    Fit,
    fit_blocks,
)
from tirelog.inference.floor import (
    Floor,
    Scatter,
    UnweightedMetric,
    at_mean_speed,
    held_out_losses,
    load_derivative,
    load_slopes,
    losses_of_errors,
    measure_floor,
    measure_scatter,
    scatter_columns,
)
from tirelog.inference.metric import Whitener, stacked, whitener
from tirelog.inference.nuisances import (
    FORM,
    asked_for,
    freed,
    moved_prediction,
    relative_changes,
    shared_by,
)
from tirelog.physics.model.model import Model
from tirelog.physics.spectral import Parameter
from tirelog.runtime import keep_freed
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.observables import STRAIN

# ---- What nuisances do beyond their derivatives.
#
# A patch that grows by 5 %, a radius that is off by 3 %, move the edges of a waveform by as much as
# these are wide. The fit stays linear in a nuisance; what it bends leaves the values instead:
#
#     fitted amplitudes -> relative change of each cell's parameters -> the model computed with it
#                       -> less its columns times the amplitudes: the bend


def bends(cells: Cells, fit: Fit, whole: Cells | None = None) -> FloatArray:
    """What drift and rolling radius do to the cells of a fit beyond their columns, (C, m).

    Zero in a cell that the model cannot be computed for. `whole`: the cells that the nuisances are
    known from, if these are others of the same logs.
    """
    bent = np.zeros(fit.prediction.shape)
    shared, changes = cells.shared, relative_changes(cells, fit, whole)
    if shared is None or not changes:
        return bent
    # groups of nuisances that change parameters of the model
    own = [
        i
        for i, (name, group) in enumerate(zip(shared.plain_names, shared.group, strict=True))
        if group in ("drift", "rolling") and not name.startswith("baseline")
    ]
    linear = shared.columns[..., own] @ fit.amplitudes[own]
    for c in range(len(cells)):
        factors = {name: 1.0 + float(change[c]) for name, change in changes.items()}
        own_cell = cells.take(np.array([c]))
        moved = or_refusal(moved_prediction)(own_cell, fit.model, factors)
        if not isinstance(moved, ModelError):
            change = moved[0] - fit.prediction[c] - linear[c]
            bent[c] = np.where(np.isfinite(change), change, 0.0)
    return bent


#: step of an angle's derivative [rad]; its error is the square of it over that of a pulse's width
_STEP = 1e-3


@dataclass(frozen=True)
class Base:
    """A model fitted on cells.

    Metrics `white` (significance) and `plain` (size), the floor; `discrepancy` [unit^2], the mean
    square that the model misses; `raw`: the cells as the first fit centred them. `given`: the
    model before the fit, with its start values. `held`: losses by manoeuvre left out,
    (M,) in each metric, if they are known from elsewhere. `channels`: of several observables
    together, in floors, each as it was fitted, in its unit.
    """

    cells: Cells
    white: Whitener
    plain: UnweightedMetric
    floor: Floor
    fit: Fit
    discrepancy: float
    raw: Cells
    given: Model
    held: tuple[FloatArray, FloatArray] | None = None
    channels: tuple[Base, ...] = ()

    @property
    def model(self) -> Model:
        return self.fit.model

    @property
    def blocks(self) -> tuple[Base, ...]:
        """What is fitted together, each in its unit: itself, of several observables each."""
        return self.channels or (self,)

    @property
    def noise(self) -> Whitener:
        """The metric of noise and random effects alone, without what the model misses."""
        if self.channels:
            return whiteners_joined([one.noise for one in self.channels], self.cells)
        return _metric(self.cells, 0.0, scatter_columns(self.cells, self.fit), self.floor.scatter)

    @cached_property
    def noise_chi2(self) -> float:
        """Chi-square of the fitted point, against noise and random effects alone."""
        residual = self.noise(self.cells.values - self.fit.prediction - self.fit.beside)
        return float((residual**2).sum())

    @property
    def reduced_chi2(self) -> float:
        """The same per degree of freedom."""
        return self.noise_chi2 / self.fit.freedom

    @property
    def square_fit(self) -> float:
        """Mean square error of a revolution's value on the data the fit saw."""
        residual = self.cells.values - self.fit.prediction - self.fit.beside
        return self.floor.within + self.plain.mean_square((self.plain(residual) ** 2).sum())

    @property
    def square_rounding(self) -> float:
        """Mean square error of a revolution's value from rounding to the source's steps.

        0 if no step is seen.
        """
        return float((self.plain.weights**2 * self.cells.rounding).sum()) / self.plain.weight

    @cached_property
    def _losses(self) -> tuple[FloatArray, FloatArray]:
        return self.held or held_out_losses(self.cells, self.white, self.plain, self.fit)

    @property
    def held_white(self) -> FloatArray:
        """Loss of each manoeuvre left out, (M,), in the metric of significance."""
        return self._losses[0]

    @property
    def held_plain(self) -> FloatArray:
        """The same in the metric of size."""
        return self._losses[1]

    @property
    def square_held(self) -> float:
        """Mean square error on manoeuvres left out."""
        return self.floor.within + self.plain.mean_square(self.held_plain)

    @property
    def rmse_held(self) -> float | None:
        """Error on manoeuvres left out; None if there is only one, since none can be left out."""
        return float(np.sqrt(max(self.square_held, 0.0))) if self.cells.manoeuvres > 1 else None

    @cached_property
    def of_errors(self) -> tuple[float, float]:
        """(mean, standard deviation) of what chance adds to the held-out mean square.

        It holds if nothing is missing. Few manoeuvres decide the parameters, and each scatters: an
        error of the parameters adds to the scatter of one and compensates that of another.
        """
        missed = losses_of_errors(self.cells, self.white, self.plain, self.fit)
        slopes = of_all(self.cells, [load_derivative(one.cells, one.fit) for one in self.blocks])
        columns = np.stack([slopes, np.ones_like(slopes)], axis=-1)
        square = self.floor.scatter.square(np.nan_to_num(columns))
        scattered = (self.plain.weights**2 * square).sum(axis=1)
        between = np.bincount(self.cells.manoeuvre, scattered, self.cells.manoeuvres)
        spread = np.sqrt((missed**2).sum() + 4.0 * (missed * between).sum())
        return float(missed.sum()) / self.plain.weight, float(spread) / self.plain.weight

    @property
    def excess(self) -> float:
        """Held-out mean square above the floor; may be slightly negative by chance."""
        return self.square_held - self.floor.square

    def share(self, removed: float) -> float:
        """What share of the excess a mean square is; none if there is no excess."""
        return removed / self.excess if self.excess > 0.0 else 0.0

    @cached_property
    def with_scatter_estimated(self) -> Base:
        """The same model with the scatter between manoeuvres measured anew, of each observable.

        Once an effect is in, less is taken for scatter.
        """
        anew = _with_scatter(
            [
                replace(
                    one, raw=replace(one.raw, phi=one.cells.phi, moved=one.cells.moved), held=None
                )
                for one in self.blocks
            ]
        )
        return joined_like(anew, self.cells)

    @cached_property
    def held_alone(self) -> tuple[Base, ...]:
        """`bases_by_observable`, once: it is asked for whenever a rule looks at each observable."""
        return tuple(_of_one(self, i) for i in range(len(self.channels)))

    @cached_property
    def held_by_all(self) -> tuple[Base, ...]:
        """`bases_by_observable` with the manoeuvre left out of all observables, once."""
        found = []
        for i, own in enumerate(self.held_alone):
            rows = self.cells.part == i
            white, plain = held_out_losses(self.cells, self.white, self.plain, self.fit, of=rows)
            seen = np.unique(self.cells.manoeuvre[rows])
            held = white[seen], plain[seen] * self.cells.scales[i] ** 2
            found.append(replace(own, held=held))
        return tuple(found)


def prepare_together(
    cells: Sequence[Cells], drive: Sequence[IntArray], model: Model, *, several: bool = True
) -> Base:
    """The base model fitted to several observables, each with its floor.

    drive  of each the manoeuvre of its rows, numbered through all observables
    ModelError if it cannot be computed at these speeds.
    """
    channels = fit_together(cells, with_ratios(model, cells), several=several)
    scales = [float(np.sqrt(channel.floor.square)) for channel in channels]
    return _joined(channels, scales, drive)


def joined_like(blocks: Sequence[Base], before: Cells) -> Base:
    """Blocks as one base, with the scales and the manoeuvres of the cells that it had `before`."""
    if not before.parts:
        return blocks[0]
    drive = [before.manoeuvre[before.part == i] for i in range(len(blocks))]
    return _joined(blocks, before.scales, drive)


def _joined(channels: Sequence[Base], scales: Sequence[float], drive: Sequence[IntArray]) -> Base:
    """Fitted channels as one base."""
    cells = joined_cells([channel.cells for channel in channels], scales, drive)
    white = whiteners_joined([channel.white for channel in channels], cells)
    plain = UnweightedMetric.of(cells)
    missed = sum(c.discrepancy / s**2 * len(c.cells) for c, s in zip(channels, scales, strict=True))
    floor = _floor_of_all([channel.floor for channel in channels], scales, plain, cells.part)
    fit = _fit_of_all(cells, [channel.fit for channel in channels])
    own = cells, white, plain, floor, fit, missed / len(cells), cells, channels[0].given
    return Base(*own, channels=tuple(channels))


def _fit_of_all(cells: Cells, fits: Sequence[Fit]) -> Fit:
    """The fits of blocks as one of all their `cells`, in floors."""
    known = [(fit.cells.shared, fit.amplitudes) for fit in fits]
    found = {n: a for own, x in known if own for n, a in zip(own.names, x, strict=True)}
    names = () if cells.shared is None else cells.shared.names
    levels = [fit.levels / s for fit, s in zip(fits, cells.scales, strict=True)]
    first = np.unique(cells.log, return_index=True)[1]
    return replace(
        fits[0],
        chi2=sum(fit.chi2 for fit in fits),
        freedom=sum(fit.freedom for fit in fits),
        prediction=of_all(cells, [fit.prediction for fit in fits], np.nan),
        jacobian=of_all(cells, [fit.jacobian for fit in fits]),
        offsets=np.concatenate(levels)[first],
        amplitudes=np.array([found[name] for name in names]),
        cells=cells,
    )


def _floor_of_all(
    floors: Sequence[Floor], scales: Sequence[float], plain: UnweightedMetric, part: IntArray
) -> Floor:
    """The mean floor of all, each in floors as it was at first, weighted as its cells are."""
    share = np.bincount(part, (plain.weights**2).sum(axis=1)) / plain.weight / np.square(scales)
    within, between = share @ np.array([(floor.within, floor.between) for floor in floors])
    scatters = [floor.scatter for floor in floors]
    baseline = [s.baseline_square / c**2 for s, c in zip(scatters, scales, strict=True)]
    rows = [[s.load for s in scatters], [s.load_square for s in scatters], baseline]
    scatter = Scatter(0.0, 0.0, 0.0, *map(np.concatenate, rows))
    # by angle it is each observable's own (`bases_by_observable`)
    return Floor(float(within), float(between), np.zeros(0), scatter)


def bases_by_observable(base: Base, *, held_by_all: bool = False) -> tuple[Base, ...]:
    """The base of each observable, in its unit; (the base itself,) if there is but one.

    Held-out losses are those of each alone about the fit to all, or `held_by_all`: those that it
    has if the manoeuvre is left out of all observables.
    """
    if not base.channels:
        return (base,)
    return base.held_by_all if held_by_all else base.held_alone


def _of_one(base: Base, number: int) -> Base:
    """The base of one observable, with the model as that sees it."""
    one = base.channels[number]
    own = one.cells.observable
    others = tuple(name for name in base.model.observables if name != own)
    seen = at_lever(replace(base.model, observable=own, beside=others), one.cells.member)
    given = replace(base.given, observable=own, beside=others)
    return replace(one, fit=replace(one.fit, model=seen), given=given)


def whiteners_joined(whites: Sequence[Whitener], cells: Cells) -> Whitener:
    """The metrics of several observables as one on all their cells; none couples two of them."""
    width, most = cells.phi.shape[1], max(white.basis.shape[2] for white in whites)
    inverse, basis, shrink, groups, group_basis = [], [], [], [], []
    for i, (white, scale) in enumerate(zip(whites, cells.scales, strict=True)):
        m, more = white.inverse_sd.shape[1], (0, most - white.basis.shape[2])
        inverse.append(in_bins(white.inverse_sd * scale, width, 0.0))
        basis.append(in_bins(np.pad(white.basis, ((0, 0), (0, 0), more)), width, 0.0))
        shrink.append(np.pad(white.shrink, ((0, 0), more)))
        groups += [np.flatnonzero(cells.part == i)[group] for group in white.groups]
        angles = [one.reshape(-1, m, one.shape[-1]) for one in white.group_basis]
        group_basis += [stacked(in_bins(one, width, 0.0)) for one in angles]
    return Whitener(
        np.concatenate(inverse),
        np.concatenate(basis),
        np.concatenate(shrink),
        tuple(groups),
        tuple(group_basis),
        tuple(one for white in whites for one in white.group_shrink),
    )


def prepare(cells: Cells, model: Model, *, several: bool = True) -> Base:
    """The base model fitted, with its floor.

    ModelError if it cannot be computed at these speeds.
    """
    return fit_together([cells], model, several=several)[0]


def fit_together(channels: Sequence[Cells], model: Model, *, several: bool = True) -> list[Base]:
    """The model fitted to all channels at once, each with its floor and its scatter.

    ModelError if it cannot be computed at these speeds.
    """
    keep_freed()
    conditions = Conditions.concatenate([cells.conditions for cells in channels])
    given = model.resolved(conditions)
    # before anything is fitted the model may miss this share of the waveform's rms; it weighs
    # channels and cells for the first fit alone: with twice as much, noisy and quiet ones count
    # more alike in it
    rough = [0.03**2 * float(np.nanmean(cells.values**2)) for cells in channels]
    whites = [whitener(cells, missed) for cells, missed in zip(channels, rough, strict=True)]
    always = asked_for(given, conditions)
    blocks = list(zip(channels, whites, strict=True))
    fits = fit_blocks(blocks, freed(given, always), several=several)
    begun = []
    for white, fit, missed in zip(whites, fits, rough, strict=True):
        raw = replace(fit.cells, shared=shared_by(fit.cells, fit, always))
        unknown = Floor(0.0, 0.0, np.zeros(0), Scatter(0.0, 0.0, 0.0, *np.zeros((3, len(raw)))))
        plain = UnweightedMetric.of(raw)
        begun.append(Base(raw, white, plain, unknown, fit, missed, raw, given))
    return _with_scatter(begun)


def _with_scatter(known: Sequence[Base]) -> list[Base]:
    """The fit with the scatter and the discrepancy that it leaves in metric and floor.

    This fit takes the raw cells of each channel to their mean speeds. The scatter between
    manoeuvres and the discrepancy go into metric and floor, and the model is fitted in them. This
    repeats until loads have settled.
    """
    known = [replace(one, cells=at_mean_speed(one.raw, one.fit)) for one in known]
    values = [one.cells.values for one in known]
    # rounds of a fit and the scatter that it leaves, at most: scatter of 3 % takes five, none two;
    # twice as many take longer only if none of them settles
    for number in range(7):
        before, known = known, list(map(_in_scatter, known, values))
        settled = number > 0 and all(map(_unmoved, known, before))
        # steps of a fit in one round, since the next measures the scatter anew; once it has
        # settled, the fit is finished. Twice as many take longer and end at the same
        known = _fitted_again(known, 3)
        if settled:
            break
    return known if known[0].fit.settled else _fitted_again(known, MOST_STEPS)


def _fitted_again(channels: Sequence[Base], steps: int) -> list[Base]:
    """The channels with the model fitted to all of them from where it is, in so many steps."""
    in_metric = [(one.cells, one.white) for one in channels]
    fits = fit_blocks(in_metric, channels[0].model, several=False, steps=steps)
    return [replace(one, cells=fit.cells, fit=fit) for one, fit in zip(channels, fits, strict=True)]


def _unmoved(now: Base, then: Base) -> bool:
    """Have loads, and what they and the nuisances bend, settled since the round before?"""
    moved = np.abs(now.floor.scatter.load - then.floor.scatter.load).max()
    turned = (now.plain(now.cells.values - then.cells.values) ** 2).sum() / now.plain.weight
    # loads that move by less from round to round, relative, have settled: a waveform bends by the
    # tenth part of that; with twice as much, chi-square is 0.02 more where loads scatter by 3 %
    # mean square by which the bends move from round to round, over the floor's: settled below it;
    # twice as much ends a round earlier, with bends off by up to a thirteenth of the floor
    return bool(moved < 0.004 and turned < 0.003 * now.floor.square)


def _in_scatter(base: Base, values: FloatArray) -> Base:
    """A channel in the metric with the scatter and the discrepancy that its fit leaves.

    The fit itself was made in the metric and with the discrepancy that the base still has. Random
    effects are linear, a waveform is not quite: of the measured `values` (C, m) goes what its load
    and its nuisances bend. The columns of these are of the fitted model.
    """
    fit, plain = base.fit, base.plain
    cells = _with_shift_of(fit, base.cells)
    if cells.shared is not None:  # the columns as the fitted model has them
        anew = shared_by(cells, fit, cells.shared.groups)
        if anew is not None and set(cells.shared.names) <= set(anew.names):
            cells = replace(cells, shared=anew.of([*map(anew.names.index, cells.shared.names)]))
    slope, bend = load_slopes(cells, fit)
    columns = np.stack([slope, np.ones_like(slope)], axis=-1)
    scatter = measure_scatter(cells, fit, base.white, columns, base.discrepancy)
    bent = 0.5 * bend * scatter.load[:, None] ** 2 + bends(cells, fit)
    cells = replace(cells, values=values - bent)
    floor = measure_floor(cells, plain, columns, scatter)
    left = np.nan_to_num(cells.values - fit.prediction - fit.beside)
    beyond = plain.mean_square((plain(left) ** 2).sum()) - floor.between
    # a discrepancy below this share of the floor is none; twice as much passes over up to 4 % of
    # the floor's square
    missed = beyond if beyond > 0.02 * floor.square else 0.0
    white = _metric(cells, missed, columns, scatter)
    return replace(base, cells=cells, white=white, floor=floor, discrepancy=missed)


def _with_shift_of(fit: Fit, cells: Cells) -> Cells:
    """The cells with the shift of the fitted model's own waveform as what is free in them.

    Only of a model with a form: the measured waveform's differs by noise and by what the model
    misses, and a form would shift its patch by the difference.
    """
    formed = any(effect.id == FORM for effect in fit.model.effects)
    if not formed or cells.phi.shape[1] == 1:
        return cells
    up, down = (
        predicted(fit.model, replace(cells, phi=cells.phi + step)) for step in (_STEP, -_STEP)
    )
    return replace(cells, shift=np.nan_to_num((down - up) / (2.0 * _STEP)))


def _metric(cells: Cells, missed: float, columns: FloatArray, scatter: Scatter) -> Whitener:
    """The metric of cells in which a model misses `missed` [unit^2] and manoeuvres scatter."""
    return whitener(cells, missed, scatter.wander_sd * columns[..., 0]).with_manoeuvres(
        cells.manoeuvre, columns, np.array([scatter.load_sd, scatter.baseline_sd])
    )


@or_refusal
def change_to(base: Base, model: Model) -> FloatArray:
    """What another model predicts beyond the fitted one, (C, m), or why it cannot be computed."""
    there = [predicted(model, one.cells) for one in base.blocks]
    return of_all(base.cells, there, np.nan) - base.fit.prediction


@or_refusal
def refit_without(base: Base, *effects: str) -> Base | ModelError:
    """The base without some of its effects, fitted again, or why that cannot be."""
    return refit(base, base.model.without_effect(*effects))


@or_refusal
def refit(
    base: Base,
    model: Model,
    *,
    several: bool = False,
    shared: Sequence[SharedEffects | None] | None = None,
) -> Base:
    """Another model on the same cells, metric and floor, or why it cannot be computed.

    It may have an effect more, or other start values; `shared`: of each block the effects beside
    it, if these are others than so far.
    """
    model, cells = model.resolved(base.cells.conditions), [one.cells for one in base.blocks]
    if shared is not None:
        cells = [replace(own, shared=new) for own, new in zip(cells, shared, strict=True)]
    whites = [one.white for one in base.blocks]
    return with_fits(base, fit_blocks(list(zip(cells, whites)), model, several=several))


def with_fits(
    base: Base, fits: Sequence[Fit], held: tuple[FloatArray, FloatArray] | None = None
) -> Base:
    """The base with a fit of each of its blocks, in the metric and with the floor that it has."""
    anew = []
    for one, fit in zip(base.blocks, fits, strict=True):
        raw = replace(one.raw, shared=fit.cells.shared)
        anew.append(replace(one, cells=fit.cells, raw=raw, fit=fit, held=None))
    return replace(joined_like(anew, base.cells), held=held)


def with_fewer_cells(base: Base, most: int) -> Base:
    """The same fit on about `most` cells, for trying things.

    The cells span logs, manoeuvres and speeds; no observable goes without.
    """
    if len(base.cells) <= most:
        return base
    blocks, chosen = [], []
    for number, one in enumerate(base.blocks):
        few = max(2, round(most * len(one.cells) / len(base.cells)))
        rows = np.unique(np.linspace(0, len(one.cells) - 1, few).round().astype(int))
        chosen.append(np.flatnonzero(base.cells.part == number)[rows])
        cells = one.cells.take(rows)
        cells = replace(cells, manoeuvre=np.unique(cells.manoeuvre, return_inverse=True)[1])
        prediction, jacobian = one.fit.prediction[rows], one.fit.jacobian[rows]
        fit = replace(one.fit, cells=cells, prediction=prediction, jacobian=jacobian)
        columns = scatter_columns(cells, fit)
        white = _metric(cells, one.discrepancy, columns, one.floor.scatter)
        plain = UnweightedMetric.of(cells)
        blocks.append(replace(one, cells=cells, white=white, plain=plain, fit=fit, held=None))
    few_cells = base.cells.take(np.concatenate(chosen))
    return joined_like(blocks, few_cells)


# ---- What a fit says: values with errors, correlations, bounds.
#
# And combinations that the data do not determine.


@dataclass(frozen=True)
class FitResult:
    """A fitted model and how well it is known.

    model           with values and both standard errors;  names (p,) what was fitted;  values,
                    se (p,); se is inf if the data are blind and at a bound
    covariance      (p, p); scaled by the reduced chi-square if that is above 1
    correlations    (name, name, r) with |r| > 0.9;  at_bound, the parameters that stand at a bound
    degenerate      sentences on combinations that share one scale or that the data do not determine
    reduced_chi2    chi-square over degrees of freedom;  freedom, the latter;  revolutions, of all
                    logs and channels
    """

    model: Model
    names: tuple[str, ...]
    values: FloatArray
    se: FloatArray
    covariance: FloatArray
    correlations: tuple[tuple[str, str, float], ...]
    at_bound: tuple[str, ...]
    degenerate: tuple[str, ...]
    reduced_chi2: float
    freedom: int
    revolutions: int


def result_of(channels: Sequence[Base], model: Model | None = None) -> FitResult:
    """The result of channels that were fitted together.

    `model` is the fitted one with further errors of its parameters, if there are any.
    """
    fit = channels[0].fit
    model = fit.model if model is None else model
    parameters, known, freedom = (
        fit.model.parameters,
        fit.known,
        sum(c.fit.freedom for c in channels),
    )
    errors = dict(zip(fit.names, known.se.tolist(), strict=True))
    at_bound = tuple(n for n in fit.names if n in fit.held or _at_bound(parameters[n]))
    shared = (
        _shared_scale(fit.model, fit.names)
        if all(c.cells.observable == STRAIN for c in channels)
        else []
    )
    return FitResult(
        model=model.with_parameters(
            {
                n: replace(model.parameters[n], se=s if np.isfinite(s) else None)
                for n, s in errors.items()
            }
        ),
        names=fit.names,
        values=np.array([parameters[name].value for name in fit.names]),
        se=known.se,
        covariance=known.covariance,
        correlations=_correlated(fit.names, known),
        at_bound=at_bound,
        degenerate=(*shared, *_undetermined(fit.names, known, fit.held)),
        reduced_chi2=sum(c.noise_chi2 for c in channels) / freedom,
        freedom=int(freedom),
        revolutions=sum(int(c.cells.revolutions.sum()) for c in channels),
    )


def _at_bound(p: Parameter) -> bool:
    return any(
        abs(p.value - bound) <= min(1e-6 * (p.max - p.min), 1e-3 * abs(p.probe))
        for bound in (p.min, p.max)
    )


def _undetermined(names: Sequence[str], known: Errors, held: Sequence[str]) -> list[str]:
    """Sentences on what the data do not determine; parameters at a bound are listed elsewhere."""
    directions = [list(compress(names, np.abs(row) > UNSEEN)) for row in known.blind]
    return [
        f"the data do not determine {' with '.join(members)}: "
        f"fix {members[0] if len(members) == 1 else 'all but one'}."
        for members in directions
        if not set(members) <= set(held)
    ]


def _correlated(names: Sequence[str], known: Errors) -> tuple[tuple[str, str, float], ...]:
    se = np.where(np.isfinite(known.se) & (known.se > 0), known.se, np.inf)
    r = np.tril(known.covariance / np.outer(se, se), -1)
    # correlations beyond this are named: a combination of the two is known far better than each;
    # 3.2 times better at 0.9, and 4.5 times at 0.95
    pairs = np.argwhere(np.abs(r) > 0.9)
    return tuple((names[j], names[i], float(r[i, j])) for i, j in pairs)


def _shared_scale(model: Model, names: Sequence[str]) -> list[str]:
    """The scale that stiffness, mass, lever arm and load share in a strain waveform."""
    if LEVER not in names:
        return []
    ratio = (
        "EJ, k, mu, the lever arm and the load"
        if model.carcass == "beam"
        else "EI, k_w, k_v, p0, k_t, the lever arm and the load"
    )
    held = [n for n in ("line_mass_kg_m", "load_N") if n not in names]
    said = (
        f"{' and '.join(held)} {'are' if len(held) > 1 else 'is'} held, and the others are "
        f"relative to {'them' if len(held) > 1 else 'it'}"
    )
    return [
        f"{ratio} share one scale in a strain waveform: "
        f"{said if held else 'nothing is held, so fix line_mass_kg_m and load_N'}."
    ]
