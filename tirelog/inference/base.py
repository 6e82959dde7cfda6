"""Where every question starts: cells, metric, floor and the fitted base model, in one value.

Stack, Model -> cells -> fit in the cells' own metric -> scatter between manoeuvres
    -> metric with it -> fit again (a few steps)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tirelog.inference.cells.cells import Cells
from tirelog.inference.fit.cells import Fit, fit_model, take_cells
from tirelog.inference.floor import (
    Floor,
    Plain,
    at_mean_speed,
    held_out_losses,
    measure_floor,
    scatter_between,
    scatter_columns,
)
from tirelog.inference.metric.whitening import Whitener, whitener
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray

#: before anything is fitted the model may miss this share of the waveform's rms; and a discrepancy
#: below this share of the floor is none
_FIRST_DISCREPANCY = 0.03
_LEAST_DISCREPANCY = 0.02


@dataclass(frozen=True)
class Base:
    """A fitted model on its cells: metrics `white` (significance) and `plain` (size), the floor,
    and held-out losses by manoeuvre (M,). `given`: the model as it came, with the values that the
    search started from.
    """

    cells: Cells
    white: Whitener
    plain: Plain
    floor: Floor
    fit: Fit
    held_white: FloatArray
    held_plain: FloatArray
    discrepancy: float = 0.0
    raw: Cells | None = None
    given: Model | None = None

    @property
    def reduced_chi2(self) -> float:
        """Of the fitted point, against noise and random effects alone."""
        scatter = np.array([self.floor.load_sd, self.floor.baseline_sd])
        noise = whitener(self.cells).with_manoeuvres(
            self.cells.manoeuvre, scatter_columns(self.cells, self.fit), scatter
        )
        residual = noise(self.cells.values - self.fit.prediction - self.offset_of_cell[:, None])
        return float((residual**2).sum()) / self.fit.freedom

    @property
    def model(self) -> Model:
        return self.fit.model

    @property
    def square_fit(self) -> float:
        """Mean square error of a revolution's value on the data the fit saw."""
        residual = self.cells.values - self.fit.prediction - self.offset_of_cell[:, None]
        return self.floor.within + self.plain.mean_square((self.plain(residual) ** 2).sum())

    @property
    def square_held(self) -> float:
        """Mean square error on manoeuvres left out."""
        return self.floor.within + self.plain.mean_square(self.held_plain)

    @property
    def square_rounding(self) -> float:
        """Mean square error that rounding to the source's steps leaves in a revolution's value; 0
        where no step is seen.
        """
        return float((self.plain.weights**2 * self.cells.rounding).sum()) / self.plain.weight

    @property
    def rmse_held(self) -> float | None:
        """Error on manoeuvres left out; None if there is only one, since none can be left out."""
        return float(np.sqrt(max(self.square_held, 0.0))) if self.cells.manoeuvres > 1 else None

    @property
    def excess(self) -> float:
        """Held-out mean square above the floor; may be slightly negative by chance."""
        return self.square_held - self.floor.square

    @property
    def offset_of_cell(self) -> FloatArray:
        """The offset of each cell's log, (C,)."""
        if not self.fit.offsets.size:
            return np.zeros(len(self.cells))
        return self.fit.offsets[np.searchsorted(np.unique(self.cells.log), self.cells.log)]


def prepare(cells: Cells, model: Model, *, several: bool = True) -> Base:
    """The base model fitted, with its floor.

    ModelError where it cannot be computed at these speeds.
    """
    model = model.resolved(cells.conditions)
    rough = (_FIRST_DISCREPANCY**2) * float(np.nanmean(cells.values**2))
    fit = fit_model(cells, whitener(cells, rough), model, several=several)
    return replace(_with_scatter(fit.cells, fit, rough), given=model)


def _with_scatter(raw: Cells, fit: Fit, discrepancy: float) -> Base:
    """Cells at their mean speeds by this fit; metric and floor with the scatter between manoeuvres
    and the discrepancy that this fit leaves, and the model fitted in them; twice.
    """
    cells = at_mean_speed(raw, fit)
    plain = Plain.of(cells)
    for _ in range(2):
        own = whitener(cells, discrepancy)
        columns = scatter_columns(cells, fit)
        load_sd, baseline_sd = scatter_between(cells, own, fit, columns)
        floor = measure_floor(cells, plain, columns, load_sd, baseline_sd)
        discrepancy = _discrepancy(cells, plain, fit, floor)
        white = whitener(cells, discrepancy).with_manoeuvres(
            cells.manoeuvre, columns, np.array([load_sd, baseline_sd])
        )
        fit = fit_model(cells, white, fit.model, several=False)
        cells = fit.cells
    held_white, held_plain = held_out_losses(cells, white, plain, fit)
    return Base(cells, white, plain, floor, fit, held_white, held_plain, discrepancy, raw)


def _discrepancy(cells: Cells, plain: Plain, fit: Fit, floor: Floor) -> float:
    """Mean square [unit^2] that the fit leaves above the floor; nothing where it is too small to
    matter.
    """
    offsets = (
        fit.offsets[np.searchsorted(np.unique(cells.log), cells.log)]
        if fit.offsets.size
        else np.zeros(len(cells))
    )
    left = (
        plain.mean_square(
            (plain(np.nan_to_num(cells.values - fit.prediction - offsets[:, None])) ** 2).sum()
        )
        - floor.between
    )
    return left if left > _LEAST_DISCREPANCY * floor.square else 0.0


def settled(base: Base) -> Base:
    """The same model with the scatter between manoeuvres measured anew: once an effect is in, less
    is taken for scatter.
    """
    raw = base.raw or base.cells
    anew = _with_scatter(
        replace(raw, phi=base.cells.phi, moved=base.cells.moved), base.fit, base.discrepancy
    )
    return replace(anew, given=base.given)


def refit(base: Base, model: Model) -> Base:
    """Another model (an effect more, other start values) on the same cells, metric and floor."""
    fit = fit_model(base.cells, base.white, model.resolved(base.cells.conditions), several=False)
    held_white, held_plain = held_out_losses(fit.cells, base.white, base.plain, fit)
    return replace(base, cells=fit.cells, fit=fit, held_white=held_white, held_plain=held_plain)


def thinned(base: Base, most: int) -> Base:
    """The same fit on at most `most` cells that span logs, manoeuvres and speeds, for trying
    things.
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
        residual=base.fit.residual[rows],
    )
    scatter = np.array([base.floor.load_sd, base.floor.baseline_sd])
    white = whitener(cells, base.discrepancy).with_manoeuvres(
        cells.manoeuvre, scatter_columns(cells, fit), scatter
    )
    return replace(base, cells=cells, white=white, plain=Plain.of(cells), fit=fit)
