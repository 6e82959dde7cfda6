"""The tire's form as a log shows it: contact pressure over the patch, stiffness over wavelength.

    pieces, Model -> the model with its form free, fitted -> values, and by models that are drawn
    with the covariance of its numbers a standard error each, beside what the formulas give

What a series of fourteen pressures cannot follow (tread blocks) is in no error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.diagnosis.answer import AnswerRecord, plain_fields
from tirelog.diagnosis.compare import Measured, measured_pieces, start_from
from tirelog.diagnosis.rules import QUIET_CHI2
from tirelog.errors import UsageError
from tirelog.inference.fit.cells import Fit, bounds, inequalities
from tirelog.inference.nuisances import FORM, bound, frees
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import Quality, marked, quality_text

#: places on the patch in half lengths, and waves in a turn, at which the form is written; an edge
#: is never sharper than a twentieth of the half length in a series of fourteen
_PLACES = np.linspace(-1.2, 1.2, 97)
_WAVES = np.unique(np.geomspace(2.0, 120.0, 30).round())
#: a pressure below zero by more of its errors, or of this share of the highest, is said to pull;
#: twice as many leave a pull of a tenth without a word
_PULLS, _LEAST = 2.0, 0.01
#: models that are drawn for an error: with 200 of them it is known to a twentieth
_DRAWS = 200
#: rounds at most until a drawn model keeps what it must; more only matter if many places pull
_ROUNDS = 20


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
    """Contact pressure [N/m] over xi [m], positive behind the middle, and stiffness [N/m^2].

    The pressure is per length, at the mean load of the logs and their mean speed; the static
    stiffness of belt and foundation is over the wavelength [m]. `half_length_m` with its standard
    error; `reduced_chi2` of the fit, far above 1 if an effect is missing, whose mean is then in
    the form.
    """

    drawn_by = "tirelog.plots.models.form"
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
    def notes(self) -> tuple[str, ...]:
        """Half length, and whether the form holds more than the tire's own."""
        length = 1e3 * np.array([self.half_length_m, self.half_length_se_m])
        said = f"half length of the patch {length[0]:.2f} ± {length[1]:.2f} mm"
        if not self.doubtful:
            return (said,)
        return (
            f"the fit leaves more than noise (reduced chi-square {self.reduced_chi2:.3g}, noise "
            "gives 1): an effect may be missing, and its mean is in the form; see `tirelog "
            "diagnose`",
        )

    @property
    def headline(self) -> str:
        """The half length, or that the form holds more than the tire's own."""
        return self.notes[0]

    def rows(self) -> list[dict[str, Any]]:
        """The two profiles as rows of one table, the columns of the other blank."""
        rows = []
        for quantity, place, unit, profile in (
            ("contact_pressure", "xi_m", "N_m", self.pressure),
            ("stiffness", "wavelength_m", "N_m2", self.stiffness),
        ):
            own = (f"{quantity}_{unit}", f"{quantity}_se_{unit}", f"{quantity}_formula_{unit}")
            names = (place, *own)
            columns = (profile.at, profile.value, profile.se, profile.formula)
            pulls = profile.value < -_PULLS * np.maximum(profile.se, _LEAST * profile.value.max())
            words = marked(pulls | self.doubtful, Quality.FORM_UNCLEAR)
            for *numbers, word in zip(*columns, words, strict=True):
                row = {"quantity": quantity, **dict(zip(names, numbers, strict=True))}
                rows.append(row | {"quality": quality_text(int(word))})
        return rows

    def to_json(self) -> dict[str, Any]:
        """All numbers by name; the model is left out."""
        profiles = {n: vars(getattr(self, n)) for n in ("pressure", "stiffness")}
        return plain_fields({n: v for n, v in vars(self).items() if n != "model"} | profiles)


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
    given = model.with_nuisance(FORM, "on")
    base = start_from(measured_pieces(measured), given)
    fitted, conditions = base.model, base.cells.conditions
    load = conditions.load_N if np.isfinite(conditions.load_N).all() else np.zeros(0)
    at = Conditions.of(
        1,
        speed_m_s=np.array([conditions.speed_m_s.mean()]),
        load_N=np.array([load.mean() if load.size else fitted.values["load_N"]]),
        **_means(conditions, ("inflation_pressure_Pa", "temperature_K", "distance_km", "time_s")),
        acceleration_m_s2=np.zeros(1),
        water_depth_mm=np.zeros(1),
    )
    half, load_N = float(fitted.half_length_m(at)[0]), float(fitted.site_loads_N(at)[0])
    phi = _PLACES * half / fitted.values["radius_m"]
    plain = bound(fitted, model, FORM) if FORM not in [e.id for e in model.effects] else fitted

    def pressure(of: Model) -> FloatArray:
        return np.asarray(of.predict(at, phi, observable="contact_pressure")[0])

    def stiffness(of: Model) -> FloatArray:
        return np.asarray(of.static_stiffness(at)[_WAVES.astype(int)])

    def half_length(of: Model) -> FloatArray:
        return of.half_length_m(at)

    radius, drawn = fitted.values["radius_m"], draws(base.fit)
    places, lengths = _PLACES * half, 2.0 * np.pi * radius / _WAVES
    return TireForm(
        _profile(places, pressure, fitted, plain, drawn),
        _profile(lengths, stiffness, fitted, plain, drawn),
        half,
        float(_profile(np.zeros(1), half_length, fitted, plain, drawn).se[0]),
        load_N,
        float(at.speed_m_s[0]),
        base.reduced_chi2,
        int(base.cells.revolutions.sum()),
        fitted,
    )


def _means(conditions: Conditions, names: tuple[str, ...]) -> dict[str, FloatArray]:
    """The mean of each condition, NaN of one that is not known everywhere."""
    return {name: np.array([getattr(conditions, name).mean()]) for name in names}


def _profile(
    at: FloatArray,
    quantity: Callable[[Model], FloatArray],
    fitted: Model,
    plain: Model,
    drawn: Sequence[Model],
) -> FormProfile:
    """A quantity of the fitted model, and its error by models that the log allows as well."""
    value = quantity(fitted)
    square = np.mean([(quantity(model) - value) ** 2 for model in drawn], axis=0)
    return FormProfile(at, value, np.sqrt(square), quantity(plain))


def draws(fit: Fit) -> list[Model]:
    """Models that a log allows as well as the fitted one, by its covariance.

    Each is moved to where its numbers keep what their effects do, as the fit itself is. A patch
    that is longer moves the steps at its edges, which no derivative of a pressure shows.
    """
    names, covariance = fit.names, fit.known.covariance
    low, high = bounds(fit.model, names)
    rows, floor = inequalities(fit.model, names)
    mean = np.array([fit.model.values[name] for name in names])
    models = []
    for theta in np.random.default_rng(0).multivariate_normal(mean, covariance, _DRAWS):
        moved, below = theta, np.zeros(floor.size, bool)
        for _ in range(_ROUNDS):
            before, below = below, rows @ moved + floor < 0.0
            if np.array_equal(before, below):
                break
            kept = rows[below]
            spread = kept @ covariance
            gain = np.linalg.solve(spread @ kept.T + np.eye(len(kept)), kept @ theta + floor[below])
            moved = theta - spread.T @ gain
        values = np.clip(moved, low, high).tolist()
        models.append(fit.model.with_values(dict(zip(names, values, strict=True))))
    return models
