"""What every wheel, road and day does to a log beside the tire's own physics, as random effects.

    cells, the model fitted to them -> for each nuisance the columns of what it does to the
                                       waveforms, with the size that is ordinary

    wheel      run-out: strain at harmonics 1 to 3 of the wheel; force variation: load at them
    drift      patch length, foundation, bending stiffness and baseline move along a log, with its
               temperature if that varies, else with time
    rolling    the rolling radius is not the setup's, and follows speed and load
    patch_law  the patch grows with another power of the load; a parameter that becomes free, if the
               model has it
    form       contact pressure and stiffness of the tire's own, an effect with priors
    pressure_law  and shrinks with another power of the inflation pressure: likewise, if logs differ
                  in it

The shapes are changes of the fitted model's own prediction, so they are known as well as the model
is. One amplitude serves all manoeuvres (of a log, if it belongs to a log or a mounting): a nuisance
repeats, which is why flips of manoeuvres take it for physics.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Conditions
from tirelog.errors import ModelError, or_refusal
from tirelog.inference.cells.cells import (
    Cells,
    SharedEffects,
    linearised,
    model_of,
    named,
    predicted,
)
from tirelog.inference.fit.cells import LEAST_CHANGE, Fit, free_names
from tirelog.inference.floor import load_derivative
from tirelog.physics.effects import BY_ID
from tirelog.physics.model.model import BY_NAME, Model, Nuisance
from tirelog.physics.model.model import FORM as FORM
from tirelog.physics.spectral import Parameter
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import OWN_ZERO, STRAIN, WAVEFORMS

#: the model's parameter that the patch law is, if it has one: bent too much for a linear effect
PATCH_LAW_PARAMETER = "patch_load_exponent"
#: of each law the parameter, and the condition that it is a power of
_LAWS = {
    "patch_law": (PATCH_LAW_PARAMETER, "load_N"),
    "pressure_law": ("patch_pressure_exponent", "inflation_pressure_Pa"),
}
#: standard deviation of the zero of a log's phase shift: a tenth of a degree, several times what
#: the mean of thirty passages at 10 m/s is off by, and what the estimator tells otherwise of tires
#: of two pressures; twice as much is a free level, beside which the model's own has no value
ZERO, ZERO_SD_RAD = "zero", 2e-3
#: harmonics of the wheel that rims, mounting and uniformity of a tire show; twice as many are as
#: narrow as 30 degrees, and take what belongs to the patch
_HARMONICS = (1, 2, 3)
#: speed [m/s] up to which the size of a change of the rolling radius counts; twice as much makes a
#: quarter of the growth likely
_RADIUS_SPEED = 25.0
#: relative step of a derivative; the error of a central difference is its square: four times as
#: large with twice the step
_STEP = 0.005
#: size of the difference of its mean between logs over that of its slope: logs that warm by 20 K
#: differ by up to half of that in the mean
_LEVEL = 0.3
#: what a drift moves beside the model's parameters
_PRESSURE, _RADIUS, _BASELINE = "inflation_pressure_Pa", "radius_m", "baseline"
#: what warms with the tire, of beam and ring
_DRIFTING = {
    "patch_half_length_m": "patch length",
    "foundation_stiffness_N_m2": "foundation stiffness",
    "radial_stiffness_N_m2": "radial stiffness",
    "tangential_stiffness_N_m2": "tangential stiffness",
    "tread_stiffness_N_m2": "tread stiffness",
    "flexural_stiffness_N_m2": "bending stiffness",
}


#: columns (C, m, K), standard deviations (K,) and names (K,) of what a nuisance does
Columns = tuple[FloatArray, FloatArray, Sequence[str]]


def wheel(cells: Cells, fit: Fit, known: Nuisance, whole: Cells) -> Columns | None:
    """Run-out and force variation at the first harmonics of the wheel's angle."""
    angle = np.nan_to_num(cells.phi)
    if np.isfinite(cells.place_rad):  # one wave, which each grating sees from its place
        angle = angle + cells.place_rad
    phi = angle[..., None] * np.array(_HARMONICS)
    waves = np.concatenate([np.cos(phi), np.sin(phi)], axis=-1)
    load = load_derivative(cells, fit)
    strain = cells.observable == STRAIN
    # the size of run-out in another unit than strain, as a share of the waveform's rms; a size that
    # is likely before anything is measured: twice as much lets twice the run-out pass at the same
    # price
    runout = known.size("run_out") if strain else 0.1 * _rms(fit)
    names = [f"{wave} {k}" for wave in ("cos", "sin") for k in _HARMONICS]
    parts = _parts(cells, whole, 2 * len(names))
    columns = np.concatenate([waves, load[..., None] * waves], axis=-1)
    return (
        np.concatenate([columns * rows[:, None, None] for rows in parts.values()], axis=-1),
        np.tile(np.repeat([runout, known.size("force")], len(names)), len(parts)),
        [
            f"{what} {name} {part}".strip()
            for part in parts
            for what in ("run-out", "force variation")
            for name in names
        ],
    )


def drift(cells: Cells, fit: Fit, known: Nuisance, whole: Cells) -> Columns | None:
    """Patch length, stiffnesses and baseline along each log, or along all logs alike if many."""
    names = [name for name in _DRIFTING if name in fit.model.parameters]
    shapes = {name: _relative_slopes(cells, fit.model, [name])[..., 0] for name in names}
    if (by_pressure := _moved_slope(cells, fit.model, _PRESSURE)) is not None:
        shapes[_PRESSURE] = by_pressure
    shapes[_BASELINE] = np.ones_like(cells.phi)
    sizes = dict.fromkeys(shapes, known.size("relative"))
    sizes[_BASELINE] = known.size("baseline") * _rms(fit)
    changes = _drifts(cells, whole, list(shapes))
    if not changes:
        return None
    return (
        np.stack([shapes[of] * factor[:, None] for of, factor, _ in changes.values()], axis=-1),
        np.array([size * sizes[of] for of, _, size in changes.values()]),
        list(changes),
    )


def _drifts(
    cells: Cells, whole: Cells, names: Sequence[str]
) -> dict[str, tuple[str, FloatArray, float]]:
    """The amplitudes of a drift of these things; none if no log has a way along it.

    Of each: what it moves, the relative change (C,) of each cell per unit of amplitude, its size
    over that of a slope along a log.
    """
    along, driven = _along_log(cells, whole)
    if not driven:
        return {}
    # whatever of it the model has: the fit and its sentences ask alike
    parts = _parts(cells, whole, 3 * (len(_DRIFTING) + 2))
    # warming slows down: a straight line and a bend about it; and one log is warmer than another
    # size of the bend of a drift over that of its slope; twice as much lets a drift bend twice as
    # far at the same price
    factors = {"along": (along, 1.0), "bend along": (4.0 * along**2 - 0.5, 0.3)}
    if len(parts) > 1:
        factors["level in"] = (np.ones(len(cells)), _LEVEL)
    words = _DRIFTING | {_PRESSURE: "inflation pressure", _BASELINE: "baseline"}
    return {
        f"{words[name]} {word} {part or 'each log'}": (name, np.where(rows, factor, 0.0), size)
        for part, rows in parts.items()
        for word, (factor, size) in factors.items()
        for name in names
    }


def rolling(cells: Cells, fit: Fit, known: Nuisance, whole: Cells) -> Columns | None:
    """A rolling radius that is not the setup's: a level, with speed squared, with load."""
    slope = _moved_slope(cells, fit.model, _RADIUS)
    if slope is None:
        return None
    factors = _radius_factors(cells, whole)
    return (
        slope[..., None] * np.stack(list(factors.values()), axis=-1)[:, None, :],
        np.full(len(factors), known.size("radius")),
        [f"radius {name}" for name in factors],
    )


def _radius_factors(cells: Cells, whole: Cells) -> dict[str, FloatArray]:
    """Relative change (C,) of each cell's rolling radius per unit of each amplitude."""
    factors = {"level": np.ones(len(cells))}
    if np.ptp(whole.conditions.speed_m_s) > 0.03 * _RADIUS_SPEED:
        factors["with speed"] = (cells.conditions.speed_m_s / _RADIUS_SPEED) ** 2
    mean = _varied(whole.conditions.load_N)
    if mean is not None:
        factors["with load"] = cells.conditions.load_N / mean - 1.0
    return factors


def patch_law(cells: Cells, fit: Fit, known: Nuisance, whole: Cells) -> Columns | None:
    """Another exponent of the patch's law of load or pressure, if that differs.

    And if the model's is not free. A patch without a law of the load grows as a load does.
    """
    parameter, condition = _LAWS[known.name]
    mean = _varied(getattr(whole.conditions, condition))
    held = parameter in fit.model.parameters
    if mean is None or parameter in fit.names or not (held or condition == "load_N"):
        return None
    ratio = getattr(cells.conditions, condition) / mean
    power = np.log(ratio if condition == "load_N" else 1.0 / ratio)[:, None, None]
    by_length = ["patch_half_length_m"]
    slope = (
        _relative_slopes(cells, fit.model, by_length)
        if held
        else load_derivative(cells, fit)[..., None]
    )
    return slope * power, np.array([known.size("exponent")]), ["exponent"]


def form(cells: Cells, fit: Fit, known: Nuisance, whole: Cells) -> Columns | None:
    """The tire's own contact pressure and stiffness, if the model has none of its own."""
    names = frees(fit.model, FORM)
    if not names or names[0] in fit.model.parameters:
        return None
    model = freed(fit.model, [FORM])
    shown = free_names(model, whole)
    names = tuple(name for name in names if name in shown)
    sd = np.array([prior[1] for n in names if (prior := model.parameters[n].prior) is not None])
    return linearised(model, cells, names, {})[1], sd, names


#: every nuisance, by the word of the model file
_COLUMNS: Mapping[str, Callable[[Cells, Fit, Nuisance, Cells], Columns | None]] = {
    "wheel": wheel,
    "drift": drift,
    "rolling": rolling,
    "patch_law": patch_law,
    "pressure_law": patch_law,
    FORM: form,
}


def shared_effects(
    cells: Cells, fit: Fit, name: str, whole: Cells | None = None
) -> SharedEffects | None:
    """What a nuisance of the fitted model does to cells; None if these cannot show it.

    `whole`: the cells that it is known from, if these are others of the same logs.
    """
    model = fit.model
    if model.beside or cells.member:
        fit = replace(fit, model=model_of(model, cells.observable, cells.member))
    known = next((n for n in fit.model.nuisances if n.name == name), None)
    if known is None or cells.phi.shape[1] == 1:
        return None
    found = or_refusal(_COLUMNS[name])(cells, fit, known, cells if whole is None else whole)
    if found is None or isinstance(found, ModelError):
        return None
    columns, sd, names = found
    columns = np.where(np.isfinite(cells.values)[..., None], columns, 0.0)
    effects = SharedEffects(columns, sd, tuple(names), (name,) * len(names))
    return named(effects, model, cells) if np.isfinite(columns).all() else None


def relative_changes(cells: Cells, fit: Fit, whole: Cells | None = None) -> dict[str, FloatArray]:
    """What the nuisances beside a fitted model change of its parameters, relative, (C,) each.

    Those of `drift` and `rolling`; none if the cells have neither, or it was fitted without them.
    """
    if cells.shared is None or fit.amplitudes.size != len(cells.shared):
        return {}
    amplitudes = dict(zip(cells.shared.plain_names, fit.amplitudes.tolist(), strict=True))
    changes: dict[str, FloatArray] = {}
    whole = cells if whole is None else whole
    moving = [name for name in (*_DRIFTING, _PRESSURE) if name in fit.model.parameters]
    for name, (of, factor, _) in _drifts(cells, whole, moving).items():
        changes[of] = changes.get(of, 0.0) + amplitudes.get(name, 0.0) * factor
    for name, factor in _radius_factors(cells, whole).items():
        moved = amplitudes.get(f"radius {name}", 0.0) * factor
        changes[_RADIUS] = changes.get(_RADIUS, 0.0) + moved
    return {name: change for name, change in changes.items() if np.any(change)}


def moved_prediction(cells: Cells, model: Model, factors: Mapping[str, float]) -> FloatArray:
    """The prediction (C, m) of a model whose parameters are moved by these factors.

    A pressure is a condition too, and so is a speed: it is an angle times the radius.
    """
    c = cells.conditions
    conditions = replace(
        c,
        speed_m_s=c.speed_m_s * factors.get(_RADIUS, 1.0),
        inflation_pressure_Pa=c.inflation_pressure_Pa * factors.get(_PRESSURE, 1.0),
    )
    moved = model.with_values({name: model.values[name] * x for name, x in factors.items()})
    return predicted(moved, cells, conditions=conditions)


def is_drift(shared: SharedEffects, amplitudes: FloatArray) -> bool:
    """Do fitted amplitudes of a drift differ between logs by less than they move along them?

    What differs from log to log and moves in none belongs to the logs: their load, their
    pressure, or physics that follows them.
    """
    sized = dict(zip(shared.names, (amplitudes / shared.sd).tolist(), strict=True))
    moved = sum(x * x for name, x in sized.items() if " along " in name and " bend " not in name)
    levels: dict[str, list[float]] = {}
    for name, x in sized.items():
        if " level in " in name:
            levels.setdefault(name.split(" level in ")[0], []).append(_LEVEL * x)
    apart = sum(float(((np.array(x) - np.mean(x)) ** 2).sum()) for x in levels.values())
    return bool(apart <= moved)


def frees(model: Model, name: str) -> tuple[str, ...]:
    """The parameters that a nuisance makes free; none if it is a linear effect.

    The form's are those of an effect that the model need not have yet, and the law by which the
    patch grows with the load.
    """
    parameter, _ = _LAWS.get(name, _LAWS["patch_law"])
    law = (parameter,) if parameter in model.parameters else ()
    if name != FORM:
        return law if name in _LAWS else ()
    shaped = any(o in WAVEFORMS for o in model.observables) and model.contact != "point"
    return (*(f"{FORM}.{p.name}" for p in BY_ID[FORM].parameters), *law) if shaped else ()


def freed(model: Model, names: Sequence[str]) -> Model:
    """The model with the parameters free that these nuisances make so."""
    for name in names:
        own = frees(model, name)
        if name == FORM and own and own[0] not in model.parameters:
            model = model.with_effect(FORM)
        free = {n: replace(model.parameters[n], free=True) for n in own}
        if name == FORM:
            free = {n: _with_prior(model, p, n) for n, p in free.items()}
        model = model.with_parameters(free)
    return model


def _with_prior(model: Model, parameter: Parameter, name: str) -> Parameter:
    """A number of the form with its mean and standard deviation before any data."""
    known = {nuisance.name: nuisance for nuisance in model.nuisances}
    if name == PATCH_LAW_PARAMETER:
        prior = (parameter.value, known["patch_law"].size("exponent"))
        return replace(parameter, prior=parameter.prior or prior)
    size = "stiffness" if ".stiffness" in name else "pressure"
    by_size = known[FORM].size(size) / BY_NAME[FORM].size(size)
    ordinary = next(p.prior for p in BY_ID[FORM].parameters if name == f"{FORM}.{p.name}")
    assert ordinary is not None
    return replace(parameter, prior=(0.0, ordinary[1] * by_size))


def bound(model: Model, given: Model, name: str) -> Model:
    """The model with the parameters that a nuisance made free as they were given."""
    own = frees(model, name)
    if name == FORM and own:
        model, own = model.without_effect(FORM), own[len(BY_ID[FORM].parameters) :]
    return model.with_parameters({n: given.parameters[n] for n in own})


def zeros(cells: Cells) -> SharedEffects | None:
    """What each log's own zero may be off by, if there are several logs and the numbers have one.

    Not a nuisance that a model names: without it, the scatter of a log's zero is that of nothing.
    """
    logs = np.unique(cells.log)
    if cells.observable not in OWN_ZERO or logs.size < 2:
        return None
    columns = (cells.log[:, None] == logs)[:, None, :] * np.isfinite(cells.values)[..., None]
    return SharedEffects(
        columns.astype(np.float64),
        np.full(logs.size, ZERO_SD_RAD),
        tuple(f"zero of log {log + 1}" for log in logs),
        (ZERO,) * logs.size,
    )


def shared_by(
    cells: Cells, fit: Fit, names: Sequence[str], whole: Cells | None = None
) -> SharedEffects | None:
    """Several nuisances at once, as far as they are linear; None if these cells can show none."""
    found = [
        shared_effects(cells, fit, name, whole) for name in names if not frees(fit.model, name)
    ]
    joined = SharedEffects.joined([*found, zeros(cells)])
    return joined and named(joined, fit.model, cells)


def _parts(cells: Cells, whole: Cells, columns: int) -> dict[str, NDArray[np.bool_]]:
    """The cells of each log, by its name; all of them together, without one, if that is too much.

    Between two logs a tire may have been mounted anew, and a day has passed.
    """
    logs = np.unique(whole.log)
    # values that the columns of a nuisance have at most if each log has its own: 64 MB
    if logs.size == 1 or logs.size * columns * whole.phi.size > 8_000_000:
        return {"": np.ones(len(cells), bool)}
    return {f"log {log + 1}": cells.log == log for log in logs}


def _varied(values: FloatArray) -> float | None:
    """The mean of a condition, if it is known everywhere and differs."""
    varied = np.isfinite(values).all() and np.ptp(values) > LEAST_CHANGE * values.mean()
    return float(values.mean()) if varied else None


def asked_for(model: Model, conditions: Conditions) -> list[str]:
    """The nuisances that the model has beside it from the start.

    The law of the pressure only if pressures differ: of one pressure nothing tells it. The form
    also where the model has its numbers.
    """
    one = _varied(conditions.inflation_pressure_Pa) is None
    effects = [effect.id for effect in model.effects]
    return [
        n.name
        for n in model.nuisances
        if (n.use == "on" or n.name in effects) and not (n.name == "pressure_law" and one)
    ]


def condition_slopes(cells: Cells, fit: Fit) -> dict[str, FloatArray]:
    """Change of the prediction per relative change of load, rolling radius and pressure, (C, m).

    A pressure acts through the foundation, which it stretches. What the model cannot be computed
    with is left out.
    """
    if cells.phi.shape[1] == 1:
        return {}
    beam = "foundation_stiffness_N_m2" in fit.model.parameters
    stiffness = "foundation_stiffness_N_m2" if beam else "radial_stiffness_N_m2"
    pressure = or_refusal(_relative_slopes)(cells, fit.model, [stiffness])
    found = {
        "load": load_derivative(cells, fit),
        "inflation pressure": None if isinstance(pressure, ModelError) else pressure[..., 0],
        "rolling radius": or_refusal(_moved_slope)(cells, fit.model, _RADIUS),
    }
    return {name: x for name, x in found.items() if isinstance(x, np.ndarray)}


def _rms(fit: Fit) -> float:
    return float(np.sqrt(np.nanmean(fit.prediction**2)))


def _along_log(cells: Cells, whole: Cells) -> tuple[FloatArray, bool]:
    """Place of each cell along its log, (C,), and whether any log has a way.

    Of span one over the `whole` log, zero in its middle: by temperature if it varies there, else by
    time.
    """
    along, driven = np.zeros(len(cells)), False
    for log in np.unique(whole.log):
        own, rows = whole.log == log, cells.log == log
        name = "temperature_K"
        driver = getattr(whole.conditions, name)[own]
        # a temperature that varies by more than this [K] within a log is what drifts follow there;
        # with twice as much, logs that warm by 3 K drift with the time instead
        if not np.isfinite(driver).all() or np.ptp(driver) < 2.0:
            name = "time_s"
            driver = whole.conditions.time_s[own]
        if np.isfinite(driver).all() and np.ptp(driver) > 0.0:
            along[rows] = (getattr(cells.conditions, name)[rows] - driver.mean()) / np.ptp(driver)
            driven = True
    return along, driven


def _relative_slopes(cells: Cells, model: Model, names: Sequence[str]) -> FloatArray:
    """Change of the prediction per relative change of each parameter, (C, m, k)."""
    values = np.array([model.values[name] for name in names])
    return np.asarray(linearised(model, cells, names, {})[1] * values)


def _moved_slope(cells: Cells, model: Model, name: str) -> FloatArray | None:
    """Change of the prediction per relative change of the inflation pressure or the radius, (C, m).

    The radius with which the tread passes: speeds and lengths are angles times it, and a ring is
    as large. None if nothing of the model depends on it.
    """
    if name not in model.parameters:
        return None
    up, down = (moved_prediction(cells, model, {name: 1.0 + s}) for s in (_STEP, -_STEP))
    slope: FloatArray = (up - down) / (2.0 * _STEP)
    return slope if np.any(slope[np.isfinite(slope)]) else None
