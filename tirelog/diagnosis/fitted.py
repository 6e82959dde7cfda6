"""`model fit`: the fit that `compare` makes, of one channel or several, as a result to write down.

measured revolutions of each channel, Model --cells--> `base.fit_together`
    --> FitResult: of one channel the same values, errors and chi-square as `compare` shows
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import nnls

from tirelog.data.recording import Conditions
from tirelog.diagnosis.answer import AnswerRecord, AnswerTable, in_unit, plain_fields
from tirelog.diagnosis.candidates.nuisances import (
    form_explains,
    groups_of,
    observed,
    with_best_nuisances,
    with_form_errors,
)
from tirelog.diagnosis.compare import (
    Measured,
    measured_pieces,
    remarks_of,
    start_from,
)
from tirelog.diagnosis.obstacles import FittedMotion
from tirelog.diagnosis.rules import QUIET_CHI2
from tirelog.errors import ModelError, UsageError
from tirelog.inference.base import Base, FitResult, result_of
from tirelog.inference.cells.cells import model_of, without_ratios
from tirelog.inference.fit.cells import Fit, bounds, inequalities
from tirelog.inference.nuisances import FORM, bound, frees
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import shown
from tirelog.vocabulary.quality import Quality, marked, quality_text


@dataclass(frozen=True, repr=False)
class FitOfLogs(AnswerRecord):
    """A model fitted to logs.

    model    with values and standard errors
    found    what the fit to steady revolutions says: errors, covariance, correlations, bounds
    learned  what obstacles gave, None without them or if nothing of it is free
    remarks  what a reader should know before believing it
    """

    picture = "fit_figure"
    panel = "correlations"

    model: Model
    found: FitResult
    learned: FittedMotion | None = None
    remarks: tuple[str, ...] = ()

    @property
    def doubts(self) -> tuple[str, ...]:
        """Sentences on what the errors do not cover: the model's form, what shares one scale."""
        form = (
            "what is left is more than noise: the errors hold only as far as the model's form "
            "does; `tirelog diagnose` tells more"
        )
        return (*[form] * (self.found.reduced_chi2 > QUIET_CHI2), *self.found.degenerate)

    def to_json(self) -> dict[str, Any]:
        """Values, standard errors (None: not determined) and units by name, and how good it is."""
        names = (*self.found.names, *(self.learned.names if self.learned else ()))
        errors = dict(zip(self.found.names, self.found.se, strict=True))
        known = {**self.found.model.parameters, **self.model.parameters}
        parameters = {name: known[name] for name in names}
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
        bounds = [f"{name} is at a bound" for name in self.found.at_bound]
        rows = [
            (name, p.value, p.se if p.se is None or np.isfinite(p.se) else "not determined", p.unit)
            for name, p in self.model.parameters.items()
            if p.free
        ]
        fitted = AnswerTable("Parameters as fitted", ["parameter", "value", "error", "unit"], rows)
        return [fitted], [*bounds, *self.doubts, *self.remarks]


def fit_of_logs(measured: Measured, model: Model) -> tuple[FitResult, tuple[str, ...]]:
    """The model's free parameters fitted as `compare` fits them, and remarks on the fit.

    Of several observables or gratings each channel has a scatter of its own.
    ModelError  nothing is free, or a log does not know a condition that an effect of the model
                needs
    UsageError  there is nothing to fit, or it is not what the model predicts
    """
    if not model.free:
        raise ModelError(
            "the model has no free parameter",
            allowed="one with { value, min, max } is needed",
            do="free one in the model file",
        )
    pieces, said = measured_pieces(measured), list[str]()
    for part in pieces:
        missing = model_of(model, part.observable).missing_conditions(part.conditions)
        for effect, fields in missing.items():
            raise ModelError(
                f"effect {effect!r} needs {', '.join(fields)}",
                allowed="every log must know it",
                do="add it to the setup, or remove the effect",
            )
    if len(pieces) > 1:
        said.append(
            f"{len(pieces)} channels are fitted together as if each had a scatter of its own. "
            "Where one load moves all of them, true errors are up to "
            f"{len(pieces) ** 0.5:.2g} times larger"
        )
    base = start_from(pieces, model)
    with_form, of_form = _with_form(base)
    if with_form is not None:
        base = start_from(pieces, with_form)
    result = result_of(base.blocks, with_form_errors(base.blocks[0]))
    found = result.model.parameters
    free = {n: replace(found[n], free=p.free) for n, p in model.parameters.items() if n in found}
    remarks = tuple(dict.fromkeys([*said, *of_form, *remarks_of(base)]))
    return replace(result, model=result.model.with_parameters(free)), remarks


def _with_form(base: Base) -> tuple[Model | None, list[str]]:
    """The model with the tire's form if that earns its place, and what to say of it."""
    auto = any(n.name == FORM and n.use == "auto" for n in base.given.nuisances)
    if not (auto and frees(base.given, FORM)):
        return None, []
    best = with_best_nuisances(base)
    if FORM not in groups_of(best) or FORM in groups_of(base):
        return None, []
    factor, unit = shown(*observed(base))
    with_it, without = (in_unit(own.rmse_held, factor) for own in (best, base))
    errors = f"held-out error {with_it} {unit} with it, {without} without"
    if not form_explains(best, base):
        leaves = f"a form of the tire's own is not in the fit: {errors}, more than the noise floor"
        return None, [f"{leaves}; `tirelog diagnose` tells why"]
    said = f'the fit includes a form of the tire\'s own: {errors}; [form] use = "off" leaves it out'
    return without_ratios(best.model), [said]


# ---- The tire's form as a log shows it: contact pressure over the patch, stiffness over
# wavelength.
#
#     pieces, Model -> the model with its form free, fitted -> values, and by models that are drawn
#     with the covariance of its numbers a standard error each, beside what the formulas give
#
# What a series of fourteen pressures cannot follow (tread blocks) is in no error.


#: places on the patch in half lengths, and waves in a turn, at which the form is written; an edge
#: is never sharper than a twentieth of the half length in a series of fourteen
_PLACES = np.linspace(-1.2, 1.2, 97)
_WAVES = np.unique(np.geomspace(2.0, 120.0, 30).round())


@dataclass(frozen=True)
class FormProfile:
    """A quantity at n places with its standard error, and what the formulas alone give there.

    `at`, `value`, `se`, `formula` (n,), in SI units.
    """

    at: FloatArray
    value: FloatArray
    se: FloatArray
    formula: FloatArray


@dataclass(frozen=True, repr=False)
class TireForm(AnswerRecord):
    """Contact pressure [N/m] over xi [m] and stiffness [N/m^2].

    xi is from the centre of pressure, positive towards the exit. The pressure is per length, at the
    mean load of the logs and their mean speed; the static stiffness of belt and foundation is over
    the wavelength [m]. `half_length_m` with its standard error; `reduced_chi2` of the fit, far
    above 1 if an effect is missing, whose mean is then in the form.
    """

    picture = "form_figure"
    panel = "over_patch"

    pressure: FormProfile
    stiffness: FormProfile
    half_length_m: float
    half_length_se_m: float
    load_N: float
    speed_m_s: float
    reduced_chi2: float
    revolutions: int
    model: Model

    @property
    def doubtful(self) -> bool:
        """Does the fit leave more than noise?"""
        return self.reduced_chi2 > QUIET_CHI2

    @property
    def headline(self) -> str:
        """The half length, or that the form holds more than the tire's own."""
        if self.doubtful:
            return (
                f"the fit leaves more than noise (reduced chi-square {self.reduced_chi2:.3g}, "
                "noise gives 1). An effect may be missing, and its mean is in the form: see "
                "`tirelog diagnose`"
            )
        half, error = 1e3 * self.half_length_m, 1e3 * self.half_length_se_m
        return f"half length of the patch {half:.2f} ± {error:.2f} mm"

    def rows(self) -> list[dict[str, Any]]:
        """The two profiles as rows of one table, the columns of the other blank."""
        rows = []
        for quantity, place, unit, profile in (
            ("contact_pressure", "xi_m", "N_m", self.pressure),
            ("stiffness", "wavelength_m", "N_m2", self.stiffness),
        ):
            own = (f"{quantity}_{unit}", f"{quantity}_se_{unit}", f"{quantity}_formula_{unit}")
            columns = (profile.at, profile.value, profile.se, profile.formula)
            # a pressure below zero by more of its errors, or of this share of the highest, is noted
            # to pull; twice as many leave a pull of a tenth without a word
            pulls = profile.value < -2.0 * np.maximum(profile.se, 0.01 * profile.value.max())
            words = map(quality_text, marked(pulls | self.doubtful, Quality.FORM_UNCLEAR).tolist())
            names = ("quantity", place, *own, "quality")
            rows += [
                dict(zip(names, (quantity, *row), strict=True))
                for row in zip(*columns, words, strict=True)
            ]
        return rows


def tire_form(measured: Measured, model: Model) -> TireForm:
    """The form of a tire from its measured waveforms.

    UsageError: the model has no waveform to learn a form from.
    """
    if not frees(model, FORM):
        raise UsageError(
            f"a model of {model.observable} shows no form",
            allowed="allowed is a model of strain or radial_acceleration with a patch",
            do="make one with `tirelog model new`",
        )
    base = start_from(measured_pieces(measured), model.with_nuisance(FORM, "on"))
    fitted, conditions = base.model, base.cells.conditions
    known = bool(np.isfinite(conditions.load_N).all())
    means = ("inflation_pressure_Pa", "temperature_K", "distance_km", "time_s", "speed_m_s")
    at = Conditions.of(
        1,
        load_N=np.array([conditions.load_N.mean() if known else fitted.values["load_N"]]),
        **{name: np.array([getattr(conditions, name).mean()]) for name in means},
        acceleration_m_s2=np.zeros(1),
        water_depth_mm=np.zeros(1),
    )
    half, radius = float(fitted.half_length_m(at)[0]), fitted.values["radius_m"]
    phi = _PLACES * half / radius
    plain = bound(fitted, model, FORM) if FORM not in [e.id for e in model.effects] else fitted

    def pressure(of: Model) -> FloatArray:
        """From its own centre: a log hardly shows where in the wheel the patch is."""
        there = of.predict(at, phi, observable="contact_pressure")[0]
        centre = phi @ there / there.sum()
        return np.asarray(of.predict(at, phi + centre, observable="contact_pressure")[0])

    drawn = draws(base.fit)

    def profile(at: FloatArray, quantity: Callable[[Model], FloatArray]) -> FormProfile:
        """Of the fitted model, with errors by models that the log allows as well."""
        value = quantity(fitted)
        squares = np.mean([(quantity(one) - value) ** 2 for one in drawn], axis=0)
        return FormProfile(at, value, np.asarray(np.sqrt(squares)), quantity(plain))

    return TireForm(
        pressure=profile(_PLACES * half, pressure),
        stiffness=profile(
            2.0 * np.pi * radius / _WAVES, lambda of: of.static_stiffness(at)[_WAVES.astype(int)]
        ),
        half_length_m=half,
        half_length_se_m=float(profile(phi, lambda of: of.half_length_m(at)).se[0]),
        load_N=float(fitted.site_loads_N(at)[0]),
        speed_m_s=float(at.speed_m_s[0]),
        reduced_chi2=base.reduced_chi2,
        revolutions=int(base.cells.revolutions.sum()),
        model=fitted,
    )


def draws(fit: Fit) -> list[Model]:
    """Models that a log allows as well as the fitted one, by its covariance.

    Each is moved to where its numbers keep what their effects do, as the fit itself is. A patch
    that is longer moves the steps at its edges, which no derivative of a pressure shows.
    """
    names, covariance, models = fit.names, fit.known.covariance, []
    low, high = bounds(fit.model, names)
    rows, floor = inequalities(fit.model, names)
    mean = np.array([fit.model.values[name] for name in names])
    se = np.sqrt(np.diagonal(covariance))
    # eigenvectors of similar values turn with the rounding of a machine, a triangle does not
    unit = np.where(se > 0.0, se, 1.0)
    root = np.linalg.cholesky(covariance / np.outer(unit, unit) + 1e-12 * np.eye(len(se)))
    # the nearest model in standard errors, and of what is kept in standard deviations: pushed off
    # by what is broken, never pulled
    spread = covariance @ rows.T
    triangle = np.linalg.cholesky(rows @ spread + np.eye(floor.size))
    # models that are drawn for an error: with 200 of them it is known to a twentieth
    for normal in np.random.default_rng(0).standard_normal((200, len(se))):
        theta = mean + unit * (root @ normal)
        broken = np.linalg.solve(triangle, -(rows @ theta + floor))
        # nnls of nothing would end the process
        pushed = nnls(triangle.T, broken, maxiter=100 * floor.size)[0] if floor.size else floor
        values = np.clip(theta + spread @ pushed, low, high).tolist()
        models.append(fit.model.with_values(dict(zip(names, values, strict=True))))
    return models
