"""`model fit`: the fit that `compare` makes, as a result to write down.

measured revolutions, Model --`comparison.start`--> Base
    --> FitResult: the same values, errors and chi-square as `compare` shows
"""

from __future__ import annotations

import numpy as np

from tirelog.diagnosis.compare import Measured, measured_pieces, remarks_of, start
from tirelog.errors import ModelError
from tirelog.inference.base import Base
from tirelog.inference.fit.result import FitResult, result_of
from tirelog.inference.metric.offsets import Offsets
from tirelog.physics.model.model import Model


def fit_measured(measured: Measured, model: Model) -> tuple[FitResult, tuple[str, ...]]:
    """The model's free parameters fitted to measured revolutions, and remarks on the fit.

    ModelError  nothing is free, or a log does not know a condition that an effect of the model
                needs
    """
    if not model.free:
        raise ModelError(
            "the model has no free parameter; one with { value, min, max } is needed; "
            "free one in the model file"
        )
    pieces = measured_pieces(measured)
    for log in np.unique(pieces.log):
        for effect, lacking in model.missing_conditions(
            pieces.conditions.take(pieces.log == log)
        ).items():
            raise ModelError(
                f"effect {effect!r} needs {', '.join(lacking)}, which {pieces.logs[log]} does "
                "not know; every log must know it; add it to the setup, or remove the effect"
            )
    base = start(pieces, model)
    return _result(base), tuple(remarks_of(base))


def _result(base: Base) -> FitResult:
    fit = base.fit
    slopes = Offsets.of(base.cells, base.white).without(base.white(fit.moving))
    return result_of(
        fit.model,
        fit.names,
        slopes.reshape(-1, len(fit.names)),
        np.array([fit.errors[name] for name in fit.names]),
        reduced_chi2=base.reduced_chi2,
        scale=max(fit.reduced_chi2, 1.0),
        freedom=int(fit.freedom),
        revolutions=int(base.cells.revolutions.sum()),
    )
