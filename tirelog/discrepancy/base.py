"""Where every question starts: cells, metric, floor and the fitted base model, in one value.

    Stack, Model -> cells -> fit in the cells' own metric -> scatter between manoeuvres -> metric with it -> fit again (a few steps)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tirelog.discrepancy.cells import Cells
from tirelog.discrepancy.fitting import Fit, fit_model, free_names
from tirelog.discrepancy.floor import Floor, Plain, held_out_losses, measure_floor, scatter_between, scatter_columns
from tirelog.discrepancy.whitening import Whitener, whitener
from tirelog.physics.model import Model

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Base:
    """A fitted model on its cells: metrics `white` (significance) and `plain` (size), the floor, and held-out losses by manoeuvre (M,)."""

    cells: Cells
    white: Whitener
    plain: Plain
    floor: Floor
    fit: Fit
    held_white: FloatArray
    held_plain: FloatArray

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
    """The base model fitted, with its floor.  ModelError where it cannot be computed at these speeds."""
    model = model.resolved(cells.conditions)
    own = whitener(cells)
    fit = fit_model(cells, own, model, several=several)
    columns = scatter_columns(cells, fit)
    load_sd, baseline_sd = scatter_between(cells, own, fit, columns)
    white = own.with_manoeuvres(cells.manoeuvre, columns, np.array([load_sd, baseline_sd]))
    fit = fit_model(cells, white, fit.model, several=False)
    plain = Plain.of(cells)
    floor = measure_floor(cells, plain, columns, load_sd, baseline_sd)
    held_white, held_plain = held_out_losses(cells, white, plain, fit)
    return Base(cells, white, plain, floor, fit, held_white, held_plain)


def refit(base: Base, model: Model) -> Base:
    """Another model (an effect more, other start values) on the same cells, metric and floor."""
    fit = fit_model(base.cells, base.white, model.resolved(base.cells.conditions), several=False)
    held_white, held_plain = held_out_losses(base.cells, base.white, base.plain, fit)
    return replace(base, fit=fit, held_white=held_white, held_plain=held_plain)


__all__ = ["Base", "free_names", "prepare", "refit"]
