"""Where every question starts: cells, metric, floor and the fitted base model, in one value.

Stack, Model -> cells -> fit in the cells' own metric -> scatter between manoeuvres
    -> metric with it -> fit again (a few steps)

Several channels of one tire are fitted together: each has its metric, its scatter and its offsets,
all have the parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.inference.cells.cells import Cells
from tirelog.inference.fit.cells import Fit, fit_channels, fit_model, take_cells
from tirelog.inference.floor import (
    Floor,
    Plain,
    at_mean_speed,
    held_out_losses,
    measure_floor,
    scatter_between,
    scatter_columns,
    wander_within,
)
from tirelog.inference.metric.whitening import Whitener, whitener
from tirelog.inference.nuisances import shared_by
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray

#: before anything is fitted the model may miss this share of the waveform's rms
_FIRST_DISCREPANCY = 0.03
#: a discrepancy below this share of the floor is none
_LEAST_DISCREPANCY = 0.02


@dataclass(frozen=True)
class FittedChannel:
    """A model fitted on the cells of one channel.

    Metrics `white` (significance) and `plain` (size), the floor; `discrepancy` [unit^2], the mean
    square that the model misses.
    """

    cells: Cells
    white: Whitener
    plain: Plain
    floor: Floor
    fit: Fit
    discrepancy: float

    @property
    def model(self) -> Model:
        return self.fit.model

    @property
    def noise(self) -> Whitener:
        """The metric of noise and random effects alone, without what the model misses."""
        scatter = np.array([self.floor.load_sd, self.floor.baseline_sd])
        columns = scatter_columns(self.cells, self.fit)
        return whitener(
            self.cells, scattered=self.floor.wander_sd * columns[..., 0]
        ).with_manoeuvres(self.cells.manoeuvre, columns, scatter)

    @property
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


@dataclass(frozen=True)
class Base(FittedChannel):
    """A fitted channel with held-out losses by manoeuvre (M,).

    `given`: the model as it came, with the values that the search started from.
    """

    held_white: FloatArray
    held_plain: FloatArray
    raw: Cells | None = None
    given: Model | None = None

    @property
    def square_held(self) -> float:
        """Mean square error on manoeuvres left out."""
        return self.floor.within + self.plain.mean_square(self.held_plain)

    @property
    def rmse_held(self) -> float | None:
        """Error on manoeuvres left out; None if there is only one, since none can be left out."""
        return float(np.sqrt(max(self.square_held, 0.0))) if self.cells.manoeuvres > 1 else None

    @property
    def excess(self) -> float:
        """Held-out mean square above the floor; may be slightly negative by chance."""
        return self.square_held - self.floor.square


def prepare(cells: Cells, model: Model, *, several: bool = True) -> Base:
    """The base model fitted, with its floor.

    ModelError if it cannot be computed at these speeds.
    """
    model = model.resolved(cells.conditions)
    (fitted,), (raw,) = _fitted([cells], model, several)
    return replace(_held_out(fitted, raw), given=model)


def fit_together(
    channels: Sequence[Cells], model: Model, *, several: bool = True
) -> list[FittedChannel]:
    """The model fitted to all channels at once; of one channel the fit of `prepare`.

    ModelError if it cannot be computed at these speeds.
    """
    conditions = Conditions.concatenate([cells.conditions for cells in channels])
    return _fitted(channels, model.resolved(conditions), several)[0]


def _fitted(
    channels: Sequence[Cells], model: Model, several: bool
) -> tuple[list[FittedChannel], list[Cells]]:
    """The channels with their scatter, and the cells as the first fit centred them."""
    rough = [_FIRST_DISCREPANCY**2 * float(np.nanmean(cells.values**2)) for cells in channels]
    whites = [whitener(cells, missed) for cells, missed in zip(channels, rough, strict=True)]
    fits = fit_channels(list(zip(channels, whites, strict=True)), model, several=several)
    always = [n.name for n in model.nuisances if n.use == "on"]
    raw = [replace(f.cells, shared=shared_by(f.cells, f, always)) for f in fits]
    return _with_scatter(raw, fits, rough), raw


def _with_scatter(
    raw: Sequence[Cells], fits: Sequence[Fit], missed: Sequence[float]
) -> list[FittedChannel]:
    """The fit with the scatter and the discrepancy that it leaves in metric and floor.

    The cells of each channel are taken at their mean speeds by this fit, the scatter between
    manoeuvres and the discrepancy go into metric and floor, and the model is fitted in them; twice.
    """
    cells = [at_mean_speed(*channel) for channel in zip(raw, fits, strict=True)]
    plain = [Plain.of(channel) for channel in cells]
    for _ in range(2):
        known = [_in_scatter(*channel) for channel in zip(cells, plain, fits, missed, strict=True)]
        fits = fit_channels(
            [(channel.cells, channel.white) for channel in known], fits[0].model, several=False
        )
        cells, missed = [fit.cells for fit in fits], [channel.discrepancy for channel in known]
    return [
        replace(channel, cells=fit.cells, fit=fit) for channel, fit in zip(known, fits, strict=True)
    ]


def _in_scatter(cells: Cells, plain: Plain, fit: Fit, missed: float) -> FittedChannel:
    """A channel in the metric with the scatter and the discrepancy that the fit leaves.

    The fit itself was made with another discrepancy, `missed` [unit^2].
    """
    columns = scatter_columns(cells, fit)
    wander_sd = wander_within(cells, whitener(cells), fit, columns)
    wander = wander_sd * columns[..., 0]
    own = whitener(cells, missed, wander)
    load_sd, baseline_sd = scatter_between(cells, own, fit, columns)
    floor = measure_floor(cells, plain, columns, load_sd, baseline_sd, wander_sd)
    discrepancy = _discrepancy(cells, plain, fit, floor)
    white = whitener(cells, discrepancy, wander).with_manoeuvres(
        cells.manoeuvre, columns, np.array([load_sd, baseline_sd])
    )
    return FittedChannel(cells, white, plain, floor, fit, discrepancy)


def _held_out(channel: FittedChannel, raw: Cells) -> Base:
    """The channel with its losses on manoeuvres left out."""
    held_white, held_plain = held_out_losses(
        channel.cells, channel.white, channel.plain, channel.fit
    )
    return Base(
        channel.cells,
        channel.white,
        channel.plain,
        channel.floor,
        channel.fit,
        channel.discrepancy,
        held_white,
        held_plain,
        raw,
    )


def _discrepancy(cells: Cells, plain: Plain, fit: Fit, floor: Floor) -> float:
    """Mean square [unit^2] that the fit leaves above the floor.

    Nothing if it is too small to matter.
    """
    residual = cells.values - fit.prediction - fit.beside
    left = plain.mean_square((plain(np.nan_to_num(residual)) ** 2).sum()) - floor.between
    return left if left > _LEAST_DISCREPANCY * floor.square else 0.0


def settled(base: Base) -> Base:
    """The same model with the scatter between manoeuvres measured anew.

    Once an effect is in, less is taken for scatter.
    """
    raw = replace(base.raw or base.cells, phi=base.cells.phi, moved=base.cells.moved)
    (anew,) = _with_scatter([raw], [base.fit], [base.discrepancy])
    return replace(_held_out(anew, raw), given=base.given)


def refit(base: Base, model: Model) -> Base:
    """Another model (an effect more, other start values) on the same cells, metric and floor."""
    fit = fit_model(base.cells, base.white, model.resolved(base.cells.conditions), several=False)
    held_white, held_plain = held_out_losses(fit.cells, base.white, base.plain, fit)
    return replace(base, cells=fit.cells, fit=fit, held_white=held_white, held_plain=held_plain)


def thinned(base: Base, most: int) -> Base:
    """The same fit on at most `most` cells, for trying things.

    The cells span logs, manoeuvres and speeds.
    """
    if len(base.cells) <= most:
        return base
    rows = np.unique(np.linspace(0, len(base.cells) - 1, most).round().astype(int))
    cells = take_cells(base.cells, rows)
    cells = replace(cells, manoeuvre=np.unique(cells.manoeuvre, return_inverse=True)[1])
    fit = replace(
        base.fit,
        prediction=base.fit.prediction[rows],
        jacobian=base.fit.jacobian[rows],
        cells=cells,
        residual=base.fit.residual[rows],
    )
    scatter = np.array([base.floor.load_sd, base.floor.baseline_sd])
    columns = scatter_columns(cells, fit)
    white = whitener(
        cells, base.discrepancy, base.floor.wander_sd * columns[..., 0]
    ).with_manoeuvres(cells.manoeuvre, columns, scatter)
    return replace(base, cells=cells, white=white, plain=Plain.of(cells), fit=fit)
