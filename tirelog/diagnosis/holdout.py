"""A fitted model against manoeuvres that nothing had touched: the one number to believe."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from tirelog.diagnosis.candidates.nuisance_selection import groups_of
from tirelog.errors import ModelError, or_refusal
from tirelog.inference.base import Base, bases_by_observable, bends
from tirelog.inference.cells.cells import cells_of
from tirelog.inference.cells.joint import JointPieces, predicted
from tirelog.inference.cells.pieces import Pieces
from tirelog.inference.fit.cells import centred
from tirelog.inference.floor import UnweightedMetric, at_mean_speed
from tirelog.inference.nuisances import shared_by

if TYPE_CHECKING:
    pass


Measurement = TypeVar("Measurement", Pieces, JointPieces, Pieces | JointPieces)


def locked_away(
    pieces: Measurement, first: int, every: int, least: int
) -> tuple[Measurement, Measurement | None]:
    """(what a search may see, what nothing touches): each so many-th manoeuvre from the `first`.

    Nothing is locked away if fewer than `least` would be left.
    """
    numbers = np.unique(pieces.manoeuvre)
    chosen = numbers[first::every]
    if numbers.size - chosen.size < least:
        return pieces, None
    mask = np.isin(pieces.manoeuvre, chosen)
    return pieces.take(~mask), pieces.take(mask)


@or_refusal
def untouched(after: Base, locked: Pieces | JointPieces) -> tuple[float, float] | ModelError:
    """(rmse of the model on the locked manoeuvres, the floor there), or why it has none there.

    The offsets are as fitted on the others. Of several observables both are in floors.
    """
    if isinstance(locked, JointPieces):
        return _untouched_several(after, locked)
    cells = cells_of(locked)
    for _ in range(3):
        cells, _farthest = centred(cells, _fit_on(after, cells).prediction)
    cells = at_mean_speed(cells, _fit_on(after, cells))
    fit = _fit_on(after, cells)
    plain = UnweightedMetric.of(cells)
    offsets = np.zeros(len(cells))
    if after.fit.offsets.size:
        seen = np.unique(after.cells.log)
        offsets = np.array(
            [
                after.fit.offsets[np.searchsorted(seen, log)] if log in seen else 0.0
                for log in cells.log
            ]
        )
    beside = shared_by(cells, fit, groups_of(after), after.cells)
    nuisances = np.zeros(cells.values.shape)
    if beside is not None:
        cells = replace(cells, shared=beside)
        nuisances = beside.columns @ after.fit.amplitudes + bends(cells, fit, after.cells)
    left = plain(np.nan_to_num(cells.values - fit.prediction - offsets[:, None] - nuisances))
    share = plain.weights**2
    within = float((share * np.where(share > 0, cells.within, 0.0)).sum() / plain.weight)
    rmse = float(np.sqrt(max(within + plain.mean_square((left**2).sum()), 0.0)))
    return rmse, float(np.sqrt(within + after.floor.between))


def _untouched_several(after: Base, locked: JointPieces) -> tuple[float, float]:
    """The root mean square over the observables, weighted by their revolutions."""
    layout = after.cells.together
    assert layout is not None
    squares, weights = [], []
    for part, own, scale in zip(
        bases_by_observable(after), locked.parts, layout.scales, strict=True
    ):
        if len(own):
            there = untouched(part, own)
            if isinstance(there, ModelError):
                raise there
            squares.append(np.square(there) / scale**2)
            weights.append(float(own.number.sum()))
    rmse, floor = np.sqrt(np.average(squares, axis=0, weights=weights)).tolist()
    return rmse, floor


def _fit_on(after: Base, cells: Any) -> Any:
    """The fitted model's prediction on other cells."""
    return replace(
        after.fit,
        prediction=predicted(after.model, cells),
    )
