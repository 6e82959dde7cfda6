"""A fit to several observables as the fits of each, in its unit, at the same parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tirelog.inference.cells.joint import at_lever, own_amplitudes, own_rows, parts_of
from tirelog.inference.fit.cells import Fit


def fits_apart(fit: Fit) -> tuple[Fit, ...]:
    """The fit of each observable; (the fit itself,) if there is but one.

    Prediction, slopes and residual are those of the fit to all; degrees of freedom are shared out.
    """
    cells, layout = fit.cells, fit.cells.together
    if layout is None:
        return (fit,)
    logs = np.unique(cells.log)
    found = []
    for i, own in enumerate(parts_of(cells)):
        residual = own_rows(cells, i, fit.residual, 0)
        mine = logs // len(layout.logs) == i
        waves = layout.widths[i] > 1 and fit.offsets.size
        amplitudes = fit.amplitudes[:0]
        if cells.shared is not None and fit.amplitudes.size:
            amplitudes = fit.amplitudes[own_amplitudes(cells.shared, cells, i)]
        others = tuple(name for name in fit.model.observables if name != own.observable)
        found.append(
            replace(
                fit,
                model=at_lever(
                    replace(fit.model, observable=own.observable, beside=others), own.member
                ),
                chi2=float((residual**2).sum()),
                freedom=fit.freedom * residual.size / max(fit.residual.size, 1),
                residual=residual,
                prediction=own_rows(cells, i, fit.prediction),
                jacobian=own_rows(cells, i, fit.jacobian),
                offsets=fit.offsets[mine] * layout.scales[i] if waves else np.zeros(0),
                amplitudes=amplitudes,
                cells=own,
            )
        )
    return tuple(found)
