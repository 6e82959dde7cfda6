"""`model fit`: the fit that `compare` makes, of one channel or several, as a result to write down.

measured revolutions of each channel, Model --cells--> `base.fit_together`
    --> FitResult: of one channel the same values, errors and chi-square as `compare` shows
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tirelog.diagnosis.answer import AnswerRecord, AnswerTable, in_unit, plain_fields
from tirelog.diagnosis.candidates.beside import (
    form_explains,
    groups_of,
    with_best_nuisances,
    with_form_errors,
)
from tirelog.diagnosis.candidates.nuisance_sizes import observed
from tirelog.diagnosis.compare import (
    Measured,
    measured_pieces,
    observables_of,
    other_observable,
    remarks_of,
    start_from,
)
from tirelog.diagnosis.obstacles.learn import Learned
from tirelog.errors import ModelError
from tirelog.inference.base import FittedChannel, TogetherBase, fit_together
from tirelog.inference.cells.cells import Cells, cells_of, with_nuisances
from tirelog.inference.cells.levers import without_ratios
from tirelog.inference.cells.pieces import Pieces
from tirelog.inference.cells.together import PiecesTogether, model_of
from tirelog.inference.fit.result import FitResult, result_of
from tirelog.inference.motion import without_motion_parameters
from tirelog.inference.nuisances import FORM, frees
from tirelog.physics.model.model import Model
from tirelog.vocabulary.observables import WAVEFORMS, shown

#: what a fit takes out of each mean of like revolutions unless asked otherwise, as `compare` does
AS_COMPARE = ("shift",)
#: reduced chi-square above which what a fit leaves is no noise, as for "nothing missing" in
#: `diagnose`; twice as high would leave unsaid a misfit as large as the noise itself
FORM_IN_DOUBT = 1.2


@dataclass(frozen=True, repr=False)
class FitOfLogs(AnswerRecord):
    """A model fitted to logs.

    model    with values and standard errors
    found    what the fit to steady revolutions says: errors, covariance, correlations, bounds
    learned  what obstacles told, None without them or if nothing of it is free
    remarks  what a reader should know before believing it
    """

    drawn_by = "tirelog.plots.models.fit"
    panel = "correlations"

    model: Model
    found: FitResult
    learned: Learned | None = None
    remarks: tuple[str, ...] = ()

    @property
    def doubts(self) -> tuple[str, ...]:
        """Sentences on what the errors do not cover: the model's form, what shares one scale."""
        form = (
            "what is left is more than noise: the errors hold only as far as the model's form "
            "does; `tirelog diagnose` tells more",
        )
        in_doubt = self.found.reduced_chi2 > FORM_IN_DOUBT
        return (*(form if in_doubt else ()), *self.found.degenerate)

    def to_json(self) -> dict[str, Any]:
        """Values, standard errors (None: not determined) and units by name, and how good it is."""
        parameters = self.model.parameters
        names = (*self.found.names, *(self.learned.names if self.learned else ()))
        errors = dict(zip(self.found.names, self.found.se, strict=True))
        return plain_fields(
            {
                "observable": self.model.observable,
                "parameters": {
                    name: {
                        "value": parameters[name].value,
                        "se": errors.get(name, parameters[name].se),
                        "se_with_form": parameters[name].se_with_form,
                        "unit": parameters[name].unit,
                    }
                    for name in names
                },
                "reduced_chi2": self.found.reduced_chi2,
                "freedom": self.found.freedom,
                "revolutions": self.found.revolutions,
                "correlations": self.found.correlations,
                "at_bound": self.found.at_bound,
                "degenerate": self.found.degenerate,
                "hits": self.learned.hits if self.learned else 0,
                "remarks": self.remarks,
            }
        )

    @property
    def headline(self) -> str:
        """How much was fitted, and how well."""
        found = self.found
        return f"{found.revolutions} revolutions, reduced chi-square {found.reduced_chi2:.3f}"

    def below(self) -> tuple[list[AnswerTable], list[str]]:
        """The parameters as fitted; bounds, doubts and remarks."""
        bounds = [f"{name} stands at a bound" for name in self.found.at_bound]
        rows = [
            (name, p.value, p.se if p.se is None or np.isfinite(p.se) else "not determined", p.unit)
            for name, p in self.model.parameters.items()
            if p.free
        ]
        names = ["parameter", "value", "error", "unit"]
        fitted = AnswerTable("Parameters as fitted", names, rows)
        return [fitted], [*bounds, *self.doubts, *self.remarks]


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
    said = _remarks(len(pieces), nuisances)
    start = without_motion_parameters(model)
    fitted: Sequence[FittedChannel] | None = None
    if set(nuisances) == set(AS_COMPARE):
        start, fitted, of_form = _with_form(channels, start)
        said += of_form
    if fitted is None:
        cells = [with_nuisances(cells_of(channel), nuisances) for channel in pieces]
        if "amplitude" in nuisances:
            cells, start = _amplitudes_of_model(cells, start)
        fitted = fit_together(cells, start, several="amplitude" not in nuisances)
    for channel in fitted:
        said += remarks_of(channel)
    result = result_of(fitted, with_form_errors(fitted[0]))
    own = {name: p.free for name, p in model.parameters.items()}
    free = {
        name: replace(p, free=own.get(name, p.free)) for name, p in result.model.parameters.items()
    }
    return replace(result, model=result.model.with_parameters(free)), tuple(dict.fromkeys(said))


def _with_form(
    channels: Sequence[Measured], model: Model
) -> tuple[Model, Sequence[FittedChannel] | None, list[str]]:
    """The model, with the tire's form if that earns its place, and what to say of it.

    Also the fit, where `compare` made the same.
    """
    of_model = [
        pieces
        for pieces in map(measured_pieces, channels)
        if observables_of(pieces) == model.observables
    ]
    auto = any(n.name == FORM and n.use == "auto" for n in model.nuisances)
    if not (of_model and auto and frees(model, FORM)):
        return model, None, []
    base = start_from(of_model[0], model)
    best = with_best_nuisances(base)
    names = [name for name in groups_of(best) if name not in groups_of(base)]
    alone = len(channels) == 1 and not isinstance(base, TogetherBase)
    if FORM not in names:
        return model, [base] if alone else None, []
    factor, unit = shown(*observed(base))
    with_it, without = (in_unit(own.rmse_held, factor) for own in (best, base))
    errors = f"held-out error {with_it} {unit} with it, {without} without"
    if not form_explains(best, base):
        leaves = f"a form of the tire's own is not in the fit: {errors}, more than the noise floor"
        return model, [base] if alone else None, [f"{leaves}; `tirelog diagnose` tells why"]
    said = f'the fit includes a form of the tire\'s own: {errors}; [form] use = "off" leaves it out'
    return without_ratios(best.model), None, [said]


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
