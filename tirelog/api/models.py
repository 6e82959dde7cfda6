"""Models: read, evaluated, and split into the contributions of their effects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields, replace
from io import StringIO
from itertools import product
from pathlib import Path as File
from typing import Any

import numpy as np

from tirelog.api.logs import Path, SetupLike, as_read, as_setup
from tirelog.data.recording import Conditions, Recording
from tirelog.data.setup import RoadSetup, Setup, Tire
from tirelog.errors import ModelError, UsageError, refuse_unknown
from tirelog.inference.stacks.manoeuvres import conditions_of as revolutions_driven
from tirelog.physics.effects import Effect, serves
from tirelog.physics.effects.base import ROOM_K
from tirelog.physics.model import file
from tirelog.physics.model.file import (
    PRESETS,
    check_conditions,
    check_model,
    known_conditions,
    known_surface,
    refuse_another,
    with_footprint,
    with_gauge_length,
)
from tirelog.physics.model.file import new_model as made_model
from tirelog.physics.model.force_files import (
    FORCES,
    SUFFIXES,
    MagicFormula,
    read_forces,
    sweeps,
    tir_text,
    tydex_text,
)
from tirelog.physics.model.forces import carcass_facts, force_columns, worn_model
from tirelog.physics.model.model import Model, difference_rows, parameter_rows
from tirelog.physics.model.user_effects import catalogue_with, effect_called
from tirelog.storage.whole import LARGEST_BYTES, bounded_input
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.columns import COLUMNS, TABLES
from tirelog.vocabulary.observables import OBSERVABLES, SCALARS
from tirelog.vocabulary.quality import OK

#: a model by path, itself, or as a dict of the file's tables
ModelLike = Model | Path | Mapping[str, Any]
#: angles over a revolution if none are asked for
ANGLES = 1024

#: columns along a revolution, with their observables
_ALONG = {
    "displacement_m": "displacement",
    "strain": "strain",
    "radial_acceleration_m_s2": "radial_acceleration",
    "contact_pressure_N_m": "contact_pressure",
    "shear_traction_N_m": "shear_traction",
    "tangential_displacement_m": "tangential_displacement",
    "strain_slope_1_m": "strain_slope",
    "strain_curvature_1_m2": "strain_curvature",
}


__all__ = [
    "PRESETS", "SCALARS", "SUFFIXES", "Effect", "Model", "ModelLike", "added", "angles", "as_model",
    "carcass_facts", "catalogue_with", "changed", "conditions_of", "contributions",
    "difference_rows", "draw_effects", "draw_modes", "driven_conditions", "forces",
    "given_conditions", "known_surface", "load_model", "modes", "new_model", "numbers",
    "parameter_rows", "passage", "plan", "predict", "read_forces", "refuse_another", "revolutions",
    "save_model", "serves", "steady_drive", "table_columns", "warm", "with_picture", "worn_model",
]  # fmt: skip


def with_picture(model: Model, picture: Path, pitch_m: float, load_N: float) -> Model:
    """`with_footprint` of a text file of numbers, commas between them, a line for each row.

    UsageError: the file is something else, or has more than 16 MB.
    """
    try:
        text = bounded_input(File(picture), 16 * LARGEST_BYTES).decode("utf-8-sig")
        pressure = np.loadtxt(StringIO(text), delimiter=",", ndmin=2)
    except (OSError, ValueError) as problem:
        reason = str(getattr(problem, "strerror", None) or problem)
        raise UsageError(
            f"no picture of a footprint: {reason.split(';')[0].rstrip('.')}",
            allowed="lines of as many numbers each, commas between them, are allowed",
            do="give another",
            file=picture,
        ) from None
    return with_footprint(model, pressure, pitch_m, load_N)


def load_model(path: Path, *, effects: Path | None = None) -> Model:
    """The model in a file.

    Parameters
    ----------
    path : str or os.PathLike
        A model file (``tirelog model new`` makes one).
    effects : str or os.PathLike, optional
        A Python file with effects of your own; it is run. Without it that which the model names,
        if you have had it run before: its bytes are compared.

    Returns
    -------
    Model
        ``parameters`` by name with value, bounds and standard error; immutable: `with_values`,
        `with_effect` and `without_effect` give another one.

    Raises
    ------
    ModelError
        The file is no model; file and line are named.
    """
    return file.load_model(File(path), effects=None if effects is None else File(effects))


def save_model(model: ModelLike, path: Path) -> None:
    """The model as a file, whole or not at all; comments of the file it was read from stay.

    Parameters
    ----------
    model : Model, str, os.PathLike or dict
        The model: itself, the path of its file, or the file's tables.
    path : str or os.PathLike
        The model file to write.

    Returns
    -------
    None

    Raises
    ------
    ModelError
        The path has a file that is no model.
    OutputError
        The file cannot be written.
    """
    file.save_model(as_model(model), File(path))


def as_model(model: ModelLike) -> Model:
    """The model, read from its file or made of a dict if needed.  UsageError: it is none."""
    return as_read(model, Model, file.load_model, file.parse_model)


def new_model(
    carcass: str | None = None,
    setup: SetupLike | None = None,
    *,
    observable: str | Sequence[str] | None = None,
    contact: str | None = None,
    values: Mapping[str, float | str] | None = None,
    preset: str | None = None,
) -> tuple[Model, list[str]]:
    """A new model without effects, and remarks on what its values leave open.

    Parameters
    ----------
    carcass : str, optional
        ``"beam"``, ``"ring"`` or ``"coupled_ring"``; by default the preset's, else a beam.
    setup : str, os.PathLike, Setup or dict, optional
        Tire and conditions.
    observable : str or sequence of str, optional
        What the model predicts; by default the preset's, else what the setup's channels measure,
        else ``"strain"``.
    contact : str, optional
        ``"prescribed"`` or ``"flat_road"``.
    values : mapping of str to float or str, optional
        Values by full name; they go before the setup's, and these before a preset's.
    preset : str, optional
        The numbers of a paper: ``"P1"``, ``"P2"`` or ``"P3"``.

    Returns
    -------
    tuple of (Model, list of str)
        The model and the remarks.

    Raises
    ------
    ModelError, UsageError
        No such carcass, observable, contact, parameter or preset.
    SetupError
        As `open_log`.
    """
    return made_model(
        carcass,
        as_setup(setup),
        observable=observable,
        contact=contact,
        values=values,
        preset=preset,
    )


def given_conditions(conditions: Conditions | Mapping[str, Any] | None, **named: Any) -> Conditions:
    """The conditions, from fields by name: numbers, or arrays of one length, shape (n,).

    UsageError: no such field, or arrays of several lengths.
    """
    if isinstance(conditions, Conditions):
        if not named:
            return conditions
        conditions = vars(conditions)
    conditions = {**(conditions or {}), **named}
    known = [field.name for field in fields(Conditions)]
    for name in conditions:
        refuse_unknown(name, known, f"no condition is called {name!r}", do="choose among them")
    given = {name: np.atleast_1d(np.asarray(v, float)) for name, v in conditions.items()}
    sizes = {values.shape for values in given.values() if values.shape != (1,)} or {(1,)}
    if len(sizes) > 1 or len(next(iter(sizes))) != 1:
        raise UsageError(
            "conditions of several shapes",
            allowed="allowed are numbers and arrays of one length, one value per revolution",
            do=f"{', '.join((f'{k} {v.shape}' for k, v in given.items()))}",
        )
    return Conditions.of(next(iter(sizes))[0], **given)


def conditions_of(
    given: Mapping[str, Sequence[float]],
    setup: Setup | None = None,
    *,
    called: Mapping[str, str] | None = None,
    **more: float,
) -> Conditions:
    """Each given value with each of the others, and what the setup knows besides.

    Parameters
    ----------
    given : mapping of str to sequence of float
        Values by the field of `Conditions`, such as ``{"speed_m_s": [10.0, 20.0]}``.
    setup : Setup, optional
        What of its conditions is not given holds for all.
    called : mapping of str to str, optional
        What a refusal calls a condition.
    **more : float
        Conditions that go before the setup's if it has none of them.

    Raises
    ------
    UsageError
        A condition that no tire is driven under.
    """
    rows = list(product(*given.values()))
    named = {name: [row[i] for row in rows] for i, name in enumerate(given)}
    known = {name: v for name, v in known_conditions(setup).items() if name not in given}
    conditions = Conditions.of(len(rows), **named, **more, **known)
    check_conditions(conditions, called)
    return conditions


def added(
    model: Model,
    effect: str,
    values: Mapping[str, float | str] | None = None,
    *,
    setup: Setup | None = None,
    effects: Path | None = None,
) -> Model:
    """The model with an effect of the catalogue more, or of a Python file of your own.

    Parameters
    ----------
    model : Model
        The model.
    effect : str
        The effect's name.
    values : mapping of str to float or str, optional
        Of its parameters and choices by full names, ``{"stiffening.law": "softens"}``.
    setup : Setup, optional
        Holds a grating's length fixed, if it says one.
    effects : str or os.PathLike, optional
        As for `load_model`.

    Raises
    ------
    ModelError
        No such effect or parameter, or a value out of its bounds.
    """
    file = model.effects_file if effects is None else File(effects)
    found = effect_called(effect, file)
    changed = model.with_effect(found).with_values(dict(values or {}))
    return with_gauge_length(changed, setup) if effect == "gauge_length" else changed


def changed(model: Model, changes: Iterable[tuple[str, str]]) -> Model:
    """The model after changes one after the other, (name, word) as `tirelog model set` has them.

    A word is a number, ``"fixed"``, ``"free"``, ``"MIN:MAX"`` (free within these bounds), a choice
    of an effect, or the use of a nuisance. ModelError: no such name or word.
    """
    uses = [nuisance.name for nuisance in model.nuisances]
    words = [f"{effect.id}.{option}" for effect in model.effects for option in effect.options]
    for name, word in changes:
        refuse_unknown(
            name,
            [*model.parameters, *words, *uses],
            f"the model has no {name!r}",
            do="list: `tirelog model show MODEL`",
            error=ModelError,
        )
        ends = word.split(":")
        if name in uses:
            model = model.with_nuisance(name, word)
        elif name in model.parameters and (word in ("fixed", "free") or len(ends) == 2):
            parameter = replace(model.parameters[name], free=word != "fixed")
            if len(ends) == 2:
                parameter = parameter.within(_number(name, ends[0]), _number(name, ends[1]))
            model = model.with_parameters({name: parameter})
        else:
            model = model.with_values(
                {name: word if name not in model.parameters else _number(name, word)}
            )
    return model


def _number(name: str, word: str) -> float:
    """A word as a number.  ModelError: it is none."""
    try:
        return float(word)
    except ValueError:
        raise ModelError(
            f"{name}={word}", allowed="allowed are a number, fixed, free, MIN:MAX", do="correct it"
        ) from None


def draw_effects(effects: Sequence[Effect], path: Path) -> None:
    """What each effect does to the strain, as a picture.  UsageError: to no strain."""
    from tirelog.plots.answers import signatures

    signatures(effects, File(path))


def draw_modes(columns: Mapping[str, Sequence[Any]], path: Path) -> None:
    """The shapes of the modes that `modes` gave, as a picture."""
    from tirelog.plots.answers import modes_picture

    modes_picture(columns, File(path))


def predict(
    model: ModelLike,
    conditions: Conditions | Mapping[str, Any] | None = None,
    phi_rad: FloatArray | None = None,
    *,
    surface: str = "outer",
    observable: str | None = None,
    **named: Any,
) -> FloatArray:
    """The sensor's reading as the model predicts it.

    Parameters
    ----------
    model : Model, str, os.PathLike or dict
        The model: itself, the path of its file, or the file's tables.
    conditions : Conditions or mapping, optional
        Conditions of n revolutions by name: ``{"speed_m_s": 20.0, "load_N": 3400.0}``, numbers or
        arrays of shape (n,); also as keywords, ``speed_m_s=20.0``. ``speed_m_s`` is needed, for the
        others the model has values of its own. ``acceleration_m_s2`` is negative and ``slip``
        positive in braking.
    phi_rad : array, shape (m,) or (n, m), optional
        Angles from the patch centre [rad], entry negative, exit positive; by default 1024 over
        the revolution, the middles of as many equal bins from -pi to pi.
    surface : str
        ``"outer"`` (groove: minimum in the patch) or ``"inner"`` (liner: maximum).
    observable : str, optional
        Another one than the model's, also ``"displacement"`` and ``"tangential_displacement"``
        [m], ``"strain_slope"`` [1/m], ``"strain_curvature"`` [1/m^2], ``"contact_pressure"`` and
        ``"shear_traction"`` [N/m], the latter positive in braking.

    Returns
    -------
    numpy.ndarray, shape (n, m)
        The observable in SI (strain dimensionless); shape (n, 1) for a number per revolution.

    Raises
    ------
    UsageError, ModelError
        No such condition, one that no tire is driven under, or one that an effect needs and that
        is not known; a speed above the critical one.

    Examples
    --------
    >>> import tirelog
    >>> model = tirelog.Model.new("beam", load_N=3400.0)
    >>> wave = tirelog.predict(model, {"speed_m_s": 20.0})
    >>> wave.shape, float(wave.min()) < 0
    ((1, 1024), True)
    """
    model = as_model(model)
    given = _checked(model, given_conditions(conditions, **named))
    chosen = angles() if phi_rad is None else np.asarray(phi_rad, float)
    return model.predict(
        given,
        None if (observable or model.observable) in SCALARS else chosen,
        surface=surface,
        observable=observable,
    )


def revolutions(
    model: Model,
    conditions: Conditions | Mapping[str, Any],
    *,
    points: int = ANGLES,
    surface: str = "outer",
    modes: int | None = None,
) -> dict[str, FloatArray]:
    """Columns of `tirelog model predict --all`, (n points,): n revolutions one after the other.

    Each goes from half a turn before the patch centre to half a turn after. The columns are all
    that a model gives along it, and the conditions with the model's load. `modes`: the last mode of
    a waveform, all of them by default. UsageError and ModelError as `predict`.
    """
    given, phi = _checked(model, conditions), angles(points)
    columns = {name: np.repeat(v, points) for name, v in _condition_columns(model, given).items()}
    columns["xi_m"] = np.tile(phi * model.parameters["radius_m"].value, len(given))
    columns["phi_deg"] = np.tile(np.degrees(phi), len(given))
    for column, observable in _ALONG.items():
        columns[column] = model.predict(
            given, phi, surface=surface, observable=observable, modes=modes
        ).reshape(-1)
    return columns


def numbers(
    model: Model, conditions: Conditions | Mapping[str, Any], *, surface: str = "outer"
) -> dict[str, FloatArray]:
    """The conditions and the model's observables of one number per revolution, columns (n,).

    Angles are in degrees. UsageError and ModelError as `predict`.
    """
    given = _checked(model, conditions)
    columns = _condition_columns(model, given)
    for name in [name for name in model.observables if name in SCALARS]:
        column = OBSERVABLES[name].column
        values = model.predict(given, surface=surface, observable=name)[:, 0]
        columns[column] = np.degrees(values) if column.endswith("_deg") else values
    return columns


def table_columns(name: str, columns: Mapping[str, Any]) -> dict[str, Any]:
    """Those of the columns that a table of `model predict` has."""
    return {column: columns[column] for column in TABLES[name] if column in columns}


def _condition_columns(model: Model, given: Conditions) -> dict[str, FloatArray]:
    """What revolutions are driven under, columns (n,), the load as the model has it."""
    names = ("speed_m_s", "load_N", "inflation_pressure_Pa", "acceleration_m_s2", "slip")
    return {name: getattr(given, name) for name in names} | {"load_N": model.site_loads_N(given)}


def _checked(model: Model, conditions: Conditions | Mapping[str, Any]) -> Conditions:
    """The conditions.  UsageError: no tire is driven under them; ModelError: no tire's model."""
    given = given_conditions(conditions)
    check_conditions(given)
    check_model(model)
    return given


def forces(
    model: Model,
    conditions: Conditions | Mapping[str, Any],
    *,
    slip_angle_deg: float | FloatArray = 0.0,
    camber_deg: float | FloatArray = 0.0,
    setup: Setup | None = None,
) -> dict[str, FloatArray]:
    """Columns of `tirelog model forces`, (n,): forces, losses and numbers per revolution.

    The angles are one number or (n,). With a setup that gives viscosity, height and width of the
    tread strip also its powers. UsageError and ModelError as `predict`.
    """
    return force_columns(
        model,
        _checked(model, conditions),
        Tire() if setup is None else setup.tire,
        slip_angle_deg=slip_angle_deg,
        camber_deg=camber_deg,
    )


def forces_against(
    model: Model,
    reference: MagicFormula | Mapping[str, FloatArray] | None,
    conditions: Conditions | None = None,
    *,
    slip_angle_deg: float = 0.0,
    camber_deg: float = 0.0,
    setup: Setup | None = None,
) -> tuple[dict[str, FloatArray], list[str]]:
    """Columns of `forces` beside those of a Magic Formula or a TYDEX table, and remarks.

    A Magic Formula is evaluated under the `conditions`. A TYDEX table has conditions of its own;
    `conditions` of one row give what it does not have, its speed for example. The remarks have the
    root mean square of each difference. Without a reference it is `forces`, without remarks.
    UsageError and ModelError as `forces`.
    """
    if reference is None or isinstance(reference, MagicFormula):
        if conditions is None:
            raise UsageError("no --speed", allowed="a speed in m/s is needed", do="add --speed 20")
        angles_deg = {"slip_angle_deg": slip_angle_deg, "camber_deg": camber_deg}
        columns = forces(model, conditions, **angles_deg, setup=setup)
        if reference is None:
            return columns, []
        found = reference.forces(columns)
    else:
        n, found = len(reference["load_N"]), dict(reference)
        own = {f.name: reference[f.name] for f in fields(Conditions) if f.name in reference}
        # a rig drives at steady speed
        given: dict[str, Any] = {"acceleration_m_s2": 0.0, **known_conditions(setup)}
        if conditions is not None:
            given = {name: value[0] for name, value in asdict(conditions).items()}
        if "speed_m_s" not in {**given, **own}:
            raise UsageError("the TYDEX file has no LONGVEL", do="give the speed with --speed")
        columns = forces(
            model,
            Conditions.of(n, **{**given, **own}),
            slip_angle_deg=reference.get("slip_angle_deg", slip_angle_deg),
            camber_deg=reference.get("camber_deg", camber_deg),
            setup=setup,
        )
    none, remarks = np.full(len(columns["load_N"]), np.nan), []
    for name in FORCES:
        column = f"reference_{name.removeprefix('road_')}"
        columns[column] = found.get(name, none)
        off, largest = columns[name] - columns[column], np.abs(columns[column])
        known = np.isfinite(off)
        if known.any() and largest[known].max() > 0.0:
            unit, rms = COLUMNS[column].unit, np.sqrt(np.mean(off[known] ** 2))
            remarks.append(
                f"{COLUMNS[column].meaning}: the model differs by {rms:.4g} {unit} (root mean "
                f"square of {known.sum()} rows); the largest is {largest[known].max():.4g} {unit}"
            )
    return columns, remarks


def force_file(
    model: Model, columns: Mapping[str, FloatArray], suffix: str
) -> tuple[str, list[str]]:
    """Columns of `forces` as text of a .tdx file; as .tir a fitted Magic Formula, with remarks.

    The Magic Formula is that of the model's brush, at the loads of the rows and the first speed.
    """
    if suffix == ".tdx":
        return tydex_text(columns), []
    names = [field.name for field in fields(Conditions) if field.name in columns]
    first, swept = {name: columns[name][0] for name in names}, []
    for rows in sweeps(columns["load_N"]):
        under = {**first, "load_N": rows["load_N"], "slip": rows["slip"]}
        brushed = forces(model, under, slip_angle_deg=rows["slip_angle_deg"])
        swept.append({**brushed, **rows})
    text, (along, across) = tir_text(swept, model.values["radius_m"])
    return text, [
        f"a Magic Formula leaves {100.0 * along:.2g} % of the largest longitudinal force and "
        f"{100.0 * across:.2g} % of the largest lateral one (root mean squares)"
    ]


def passage(
    model: Model,
    conditions: Conditions | Mapping[str, Any],
    road: RoadSetup,
    *,
    folder: File | None = None,
    loads: Sequence[tuple[float, float]] = (),
    duration_s: float | None = None,
    sensors_deg: Sequence[float] = (),
    surface: str = "outer",
) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Columns of `tirelog model predict --road`, a drive of a coupled ring in time, and remarks.

    `conditions` hold at its start; `loads`, `duration_s` and `folder` as `course_of`, `sensors_deg`
    as `passage_columns` (180 by default). UsageError and ModelError as `predict`, and if the tire
    cannot drive there.
    """
    from tirelog.physics.moving.transient import course_of, driven, passage_columns

    given = _checked(model, conditions)
    load_N = float(given.load_N[0]) if given.known("load_N") else model.values["load_N"]
    course = course_of(road, folder, float(given.speed_m_s[0]), load_N, loads, duration_s)
    motion = driven(model, given, course)
    return passage_columns(motion, list(sensors_deg) or [180.0], surface), tuple(motion.remarks)


def modes(model: Model, *, speed_m_s: float = 0.0, **asked: Any) -> dict[str, list[Any]]:
    """Columns of `tirelog model modes`: frequencies, damping and shapes of a ring.

    `asked` as `modes_of_model`. ModelError as that.
    """
    from tirelog.physics.moving.ring import modes_of_model

    rows = [
        {"support": support, "speed_m_s": speed_m_s, **asdict(mode)}
        for support, mode in modes_of_model(model, speed_m_s=speed_m_s, **asked)
    ]
    return {name: [row[name] for row in rows] for name in TABLES["modes"]}


def plan(
    model: Model, conditions: Conditions | Mapping[str, Any]
) -> tuple[dict[str, list[Any]], list[str]]:
    """Columns of `tirelog model plan`, and remarks: what each test of a tire determines.

    `conditions` of driving. UsageError and ModelError as `predict`; no number is free.
    """
    from tirelog.physics.plan import plan_rows

    return plan_rows(model, _checked(model, conditions))


def steady_drive(
    setup: Setup | None, duration_s: float, speed_m_s: float, load_N: float | None = None
) -> Conditions:
    """A drive at one speed in 240 equal steps, with the conditions that the setup knows."""
    time_s = np.linspace(0.0, duration_s, 241)
    loads = {} if load_N is None else {"load_N": load_N}
    given = {"acceleration_m_s2": 0.0, **known_conditions(setup), **loads}
    drive = Conditions.of(time_s.size, **{**given, "speed_m_s": speed_m_s, "time_s": time_s})
    check_conditions(drive)
    return drive


def driven_conditions(recording: Recording) -> Conditions:
    """What each revolution of a log was driven under, in order of time; rows that are `ok`.

    UsageError: no speed that is known.
    """
    from tirelog.api.parts import parts_of

    parts = (part.columns for part in parts_of(recording, "speed", {}))
    rows: Any = max(filter(None, parts), key=lambda columns: len(columns["time_s"]), default={})
    good = np.asarray(rows.get("quality", [])) == OK
    if good.sum() < 16:
        raise UsageError(
            f"{recording.log}: {good.sum()} revolutions with a speed",
            allowed="16 are needed",
            do="see `tirelog speed`",
        )
    names = ("time_s", "speed_m_s", "acceleration_m_s2")
    return revolutions_driven(recording, *(np.asarray(rows[name])[good] for name in names))


def warm(
    model: Model,
    drive: Conditions,
    *,
    ambient_K: float = ROOM_K,
    **heat: float | None,
) -> tuple[dict[str, FloatArray], list[str]]:
    """Columns of `tirelog model warm` and remarks: temperature and losses over a drive.

    `heat` has `heat_capacity` [J/K] and `cooling` [W/K]. What is None is fitted to the drive's
    temperature, and then how warm the tire begins; else it begins cold. UsageError and ModelError
    as `predict`, or if it cannot be fitted.
    """
    from tirelog.physics.thermal import fitted_heat, thinned, warm_columns

    given = {name: value for name, value in heat.items() if value is not None}
    rows, remarks = thinned(_checked(model, drive)), []
    units = {"heat_capacity": "J/K", "cooling": "W/K", "start": "K above the surroundings"}
    if len(given) < len(heat):
        for name, (value, error) in fitted_heat(model, rows, given).items():
            given[name] = value
            text = f"{name.replace('_', ' ')} {value:.5g} +- {error:.2g} {units[name]}"
            remarks += [text] * (error > 0.0)
    columns = warm_columns(
        model, rows, given["heat_capacity"], given["cooling"], ambient_K, given.get("start", 0.0)
    )
    constant = given["heat_capacity"] / given["cooling"]
    end, resistance = columns["temperature_K"][-1], columns["rolling_resistance_N"]
    remarks.append(
        f"time constant {constant:.4g} s; {end:.3g} K above the surroundings at the end; rolling "
        f"resistance {resistance[0]:.4g} N at the start, {resistance[-1]:.4g} N at the end"
    )
    return columns, remarks


def angles(count: int = ANGLES) -> FloatArray:
    """The middles of `count` equal bins over a revolution [rad], shape (count,)."""
    return np.linspace(-np.pi, np.pi, count, endpoint=False) + np.pi / count


def contributions(
    model: ModelLike,
    conditions: Conditions | Mapping[str, Any] | None = None,
    phi_rad: FloatArray | None = None,
    *,
    surface: str = "outer",
    observable: str | None = None,
    **named: Any,
) -> dict[str, FloatArray]:
    """The prediction by effect: the bare carcass, each effect, and what they do together.

    A tire's effects do not add up: a stiffer foundation changes what the same pressure does. So
    this is no split of the waveform into independent parts. An effect's contribution is marginal,
    the whole model less the model without that effect; ``"interaction"`` is what is left of the
    whole, and is as large as the effects depend on one another. It is zero (to rounding) with at
    most one effect, and if all effects are added to the reading. If it is as large as the
    contributions themselves, read them as "what is lost if this one is dropped", and no more.

    Parameters
    ----------
    model, conditions, phi_rad, surface, observable
        As for `predict`.

    Returns
    -------
    dict of str to numpy.ndarray, shape (n, m)
        ``"base"`` (the model without effects), each effect by its name, ``"interaction"``; their
        sum is `predict` of the same arguments.

    Raises
    ------
    UsageError, ModelError
        As `predict`; also if the model cannot be evaluated without one of its effects.

    Examples
    --------
    >>> import tirelog
    >>> model = tirelog.Model.new("beam").with_effect("water_film", amplitude=0.05)
    >>> parts = tirelog.contributions(model, {"speed_m_s": 20.0, "water_depth_mm": 1.0})
    >>> list(parts), float(abs(parts["interaction"]).max()) < 1e-12
    (['base', 'water_film', 'interaction'], True)
    """
    given = given_conditions(conditions, **named)
    # what depends on all revolutions, once for every part
    settled = as_model(model).resolved(given)

    def predicted(one: Model) -> FloatArray:
        return predict(one, given, phi_rad, surface=surface, observable=observable)

    whole = predicted(settled)
    parts = {"base": predicted(replace(settled, effects=()))}
    for effect in settled.effects:
        others = tuple(e for e in settled.effects if e.id != effect.id)
        parts[effect.id] = whole - predicted(replace(settled, effects=others))
    parts["interaction"] = whole - sum(parts.values())
    return parts
