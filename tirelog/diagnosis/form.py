"""The tire's form as a log shows it: contact pressure over the patch, stiffness over wavelength.

    pieces, Model -> the model with its form free, fitted -> values, and by the covariance of the
    fitted numbers a standard error each, beside what the model's formulas give

What a series of eight pressures cannot follow (a step beside the edge, tread blocks) is in no
error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.diagnosis.compare import Measured, measured_pieces, start_from
from tirelog.diagnosis.results import plain_values
from tirelog.diagnosis.rules import QUIET_CHI2
from tirelog.errors import UsageError
from tirelog.inference.fit.errors import Errors
from tirelog.inference.nuisances import FORM, bound, frees
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray

#: places on the patch in half lengths, and waves in a turn, at which the form is written; an edge
#: is never sharper than a twentieth of the half length in a series of eight
_PLACES = np.linspace(-1.2, 1.2, 97)
_WAVES = np.unique(np.geomspace(2.0, 120.0, 30).round())
#: relative step of a derivative; the error of a central difference is its square
_STEP = 1e-4


@dataclass(frozen=True)
class FormProfile:
    """A quantity at n places with its standard error, and what the formulas alone give there.

    `at`, `value`, `se`, `formula` (n,), in SI units.
    """

    at: FloatArray
    value: FloatArray
    se: FloatArray
    formula: FloatArray


@dataclass(frozen=True)
class TireForm:
    """Contact pressure [N/m] over xi [m], positive behind the middle, and stiffness [N/m^2].

    The pressure is per length, at the mean load of the logs and their mean speed; the static
    stiffness of belt and foundation is over the wavelength [m]. `half_length_m` with its standard
    error; `reduced_chi2` of the fit, far above 1 if an effect is missing, whose mean is then in
    the form.
    """

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
    def notes(self) -> tuple[str, ...]:
        """Half length, and whether the form holds more than the tire's own."""
        length = 1e3 * np.array([self.half_length_m, self.half_length_se_m])
        said = f"half length of the patch {length[0]:.2f} ± {length[1]:.2f} mm"
        if self.reduced_chi2 <= QUIET_CHI2:
            return (said,)
        return (
            f"the fit leaves more than noise (reduced chi-square {self.reduced_chi2:.3g}, noise "
            "gives 1): an effect may be missing, and its mean is in the form; see `tirelog "
            "diagnose`",
        )

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
            for numbers in zip(*columns, strict=True):
                rows.append({"quantity": quantity, **dict(zip(names, numbers, strict=True))})
        return rows

    def to_json(self) -> dict[str, Any]:
        """All numbers by name; the model is left out."""
        told = {n: getattr(self, n) for n in self.__dataclass_fields__ if n != "model"}
        profiles = {n: vars(told[n]) for n in ("pressure", "stiffness")}
        plain: dict[str, Any] = plain_values(told | profiles)
        return plain


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
    fitted, known = base.model, base.fit.known
    conditions = base.cells.conditions
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

    names, radius = base.fit.names, fitted.values["radius_m"]
    half_se = _profile(np.zeros(1), lambda m: m.half_length_m(at), fitted, plain, names, known).se
    return TireForm(
        _profile(_PLACES * half, pressure, fitted, plain, names, known),
        _profile(2.0 * np.pi * radius / _WAVES, stiffness, fitted, plain, names, known),
        half,
        float(half_se[0]),
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
    names: tuple[str, ...],
    known: Errors,
) -> FormProfile:
    """A quantity of the fitted model with its error, by its derivatives (p, n)."""
    slopes = np.zeros((len(names), quantity(fitted).size))
    for row, name in enumerate(names):
        own = fitted.parameters[name]
        step = _STEP * max(abs(own.value), abs(own.probe) * 0.1)
        up, down = (
            quantity(fitted.with_parameters({name: _moved(own, sign * step)})) for sign in (1, -1)
        )
        slopes[row] = (up - down) / (2.0 * step)
    variance = np.einsum("in,ij,jn->n", slopes, known.covariance, slopes)
    return FormProfile(at, quantity(fitted), np.sqrt(np.maximum(variance, 0.0)), quantity(plain))


def _moved(parameter: Any, step: float) -> Any:
    """A parameter moved by a step, with bounds that allow it."""
    value = parameter.value + step
    low, high = min(parameter.min, value), max(parameter.max, value)
    return parameter.within(low, high).at(value)
