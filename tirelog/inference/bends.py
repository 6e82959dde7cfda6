"""What nuisances do beyond their derivatives.

A patch that grows by 5 %, a radius that is off by 3 %, move the edges of a waveform by as much as
these are wide. The fit stays linear in a nuisance; what it bends leaves the values instead:

    fitted amplitudes -> relative change of each cell's parameters -> the model computed with it
                      -> less its columns times the amplitudes: the bend
"""

from __future__ import annotations

import numpy as np

from tirelog.errors import ModelError, or_refusal
from tirelog.inference.cells.cells import Cells
from tirelog.inference.fit.cells import Fit, take_cells
from tirelog.inference.nuisances import moved_prediction, relative_changes
from tirelog.vocabulary.arrays import FloatArray

#: groups of nuisances that change parameters of the model
_BENDING = ("drift", "rolling")


def bends(cells: Cells, fit: Fit, whole: Cells | None = None) -> FloatArray:
    """What drift and rolling radius do to the cells of a fit beyond their columns, (C, m).

    Zero in a cell that the model cannot be computed for. `whole`: the cells that the nuisances are
    known from, if these are others of the same logs.
    """
    bent = np.zeros(fit.prediction.shape)
    shared, changes = cells.shared, relative_changes(cells, fit, whole)
    if shared is None or not changes:
        return bent
    own = [
        i
        for i, (name, group) in enumerate(zip(shared.plain_names, shared.group, strict=True))
        if group in _BENDING and not name.startswith("baseline")
    ]
    linear = shared.columns[..., own] @ fit.amplitudes[own]
    for c in range(len(cells)):
        factors = {name: 1.0 + float(change[c]) for name, change in changes.items()}
        own_cell = take_cells(cells, np.array([c]))
        moved = or_refusal(moved_prediction)(own_cell, fit.model, factors)
        if not isinstance(moved, ModelError):
            change = moved[0] - fit.prediction[c] - linear[c]
            bent[c] = np.where(np.isfinite(change), change, 0.0)
    return bent
