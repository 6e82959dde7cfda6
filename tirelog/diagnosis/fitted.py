"""`model fit`: the fit that `compare` makes, of one channel or several, as a result to write down.

measured revolutions of each channel, Model --cells--> `base.fit_together`
    --> FitResult: of one channel the same values, errors and chi-square as `compare` shows
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tirelog.diagnosis.compare import Measured, measured_pieces, other_observable, remarks_of
from tirelog.errors import ModelError
from tirelog.inference.base import fit_together
from tirelog.inference.cells.cells import Cells, cells_of, with_nuisances
from tirelog.inference.cells.pieces import Pieces
from tirelog.inference.cells.together import PiecesTogether, model_of
from tirelog.inference.fit.result import FitResult, result_of
from tirelog.inference.motion import without_motion_parameters
from tirelog.physics.model.model import Model
from tirelog.vocabulary.observables import WAVEFORMS

#: what a fit takes out of each mean of like revolutions unless asked otherwise, as `compare` does
AS_COMPARE = ("shift",)


def fit_channels_measured(
    channels: Sequence[Measured], model: Model, nuisances: Sequence[str] = AS_COMPARE
) -> tuple[FitResult, tuple[str, ...]]:
    """The model's free parameters fitted to all channels at once, and remarks on the fit.

    channels    strain and radial acceleration of one tire may stand beside each other; each channel
                has its own noise, scatter and offset per log
    nuisances   taken out of each mean of like revolutions: 'offset', 'amplitude' (by some 10 %),
                'shift'. Beside free amplitudes little shows the lever arm, and its error says so
    ModelError  nothing is free, a log does not know a condition that an effect of the model needs,
                or an unknown nuisance
    UsageError  there is nothing to fit, or it is not what the model predicts
    """
    pieces = [part for channel in channels for part in measured_parts(measured_pieces(channel))]
    _refuse(pieces, model)
    cells = [with_nuisances(cells_of(channel), nuisances) for channel in pieces]
    start = without_motion_parameters(model)
    if "amplitude" in nuisances:
        cells, start = _amplitudes_of_model(cells, start)
    fitted = fit_together(cells, start, several="amplitude" not in nuisances)
    said = _remarks(len(cells), nuisances)
    for channel in fitted:
        said += remarks_of(channel)
    result = result_of(fitted)
    parameters = result.model.parameters
    free = {n: replace(parameters[n], free=model.parameters[n].free) for n in parameters}
    return replace(result, model=result.model.with_parameters(free)), tuple(dict.fromkeys(said))


def _refuse(channels: Sequence[Pieces], model: Model) -> None:
    """An error if there is nothing to fit, or to fit to."""
    if not model.free:
        raise ModelError(
            "the model has no free parameter",
            allowed="one with { value, min, max } is needed",
            do="free one in the model file",
        )
    same = [pieces.observable in model.observables for pieces in channels]
    for pieces, is_same in zip(channels, same, strict=True):
        beside = any(same) and {pieces.observable, model.observable} <= set(WAVEFORMS)
        if not is_same and not beside:
            raise other_observable(pieces, model)
        for log in np.unique(pieces.log):
            known = pieces.conditions.take(pieces.log == log)
            one = model_of(model, pieces.observable) if model.beside else model
            for effect, lacking in one.missing_conditions(known).items():
                raise ModelError(
                    f"effect {effect!r} needs {', '.join(lacking)}, which {pieces.logs[log]} does "
                    "not know",
                    allowed="every log must know it",
                    do="add it to the setup, or remove the effect",
                )


def measured_parts(pieces: Pieces | PiecesTogether) -> tuple[Pieces, ...]:
    """The pieces of each observable."""
    return pieces.parts if isinstance(pieces, PiecesTogether) else (pieces,)


def _amplitudes_of_model(cells: Sequence[Cells], model: Model) -> tuple[list[Cells], Model]:
    """The cells with amplitudes along the model's waveforms, and the model so fitted.

    The waveforms are those of the model fitted without free amplitudes. Along the measured
    waveforms, noise and all, a model that predicts nothing would fit best.
    """
    plain = [with_nuisances(c, [name for name in c.free if name != "amplitude"]) for c in cells]
    fitted = fit_together(plain, model)
    own = [
        replace(c, random=np.concatenate([f.fit.prediction[..., None], c.random[..., 1:]], axis=-1))
        for c, f in zip(cells, fitted, strict=True)
    ]
    return own, fitted[0].model


def _remarks(channels: int, nuisances: Sequence[str]) -> list[str]:
    """What sets this fit apart from that of `compare`."""
    said = []
    if channels > 1:
        said.append(
            f"{channels} channels are fitted together as if each had a scatter of its own; where "
            f"one load moves all of them, errors are up to {channels**0.5:.2g} times what is said"
        )
    if set(nuisances) != set(AS_COMPARE):
        said.append(
            f"taken out of each mean of like revolutions: {', '.join(nuisances) or 'nothing'}; "
            "`compare` takes out the shift, so its parameters, errors and chi-square differ"
        )
    return said
