"""Models from files, from setups and from the papers' tables; `save_model` writes a file.

    TOML text (contract, "Model file") --`storage.schema`, the kinds below--> tables of parameters
        --> Model

A plain number is a fixed parameter; a table { value, min, max } is free, and carries `se` after a
fit (and `fixed = true` if it is held although it has bounds).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import tomlkit
from tomlkit.exceptions import TOMLKitError

from tirelog.data.recording import Conditions
from tirelog.data.setup import Setup
from tirelog.errors import ModelError, UsageError, choices, refuse_unknown
from tirelog.physics.carcass.numbers import CARCASSES, CONTACTS
from tirelog.physics.effects import BY_ID, Effect
from tirelog.physics.model.model import (
    BY_NAME,
    FORM,
    NUISANCES,
    USES,
    Model,
    ModelEffect,
    Nuisance,
    observables_known,
)
from tirelog.physics.model.user_effects import (
    AMPLITUDE,
    EXPRESSION_ACTS_ON,
    FRAMES,
    LARGEST,
    MOST_NODES,
    SHAPE_ACTS_ON,
    SHAPE_KEYS,
    catalogue_with,
    effect_by_expression,
    effect_by_shape,
)
from tirelog.physics.spectral import Parameter
from tirelog.storage.schema import (
    ANYTHING,
    FINITE,
    FLAG,
    TEXT,
    Document,
    Entries,
    FilePlace,
    FunctionKind,
    KeyKind,
    Named,
    Table,
    ValueKind,
    is_number,
    numbers,
    words,
)
from tirelog.storage.whole import LARGEST_BYTES, toml_tables, toml_text, whole_file
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.conditions import SETUP_KEYS
from tirelog.vocabulary.kinds import STRAIN_KINDS
from tirelog.vocabulary.observables import ACCELERATION, OBSERVABLES, waveform_of

#: free in a new model of acceleration; a file without it holds it at its start value
_MAY_LACK = ("width_m",)


# ---- what a key of a model file may hold


_NUMBER = Table(
    {
        "value": FINITE,
        "min": FINITE,
        "max": FINITE,
        "se": ValueKind("a number", lambda se: isinstance(se, int | float) and se is not True),
        "fixed": FLAG,
    }
)
#: of a user's own, which brings its unit
_OWN_NUMBER = Table({**_NUMBER.keys, "unit": TEXT})


def _number(known: Parameter | None, table: Table = _NUMBER) -> FunctionKind:
    """A parameter: a plain number is fixed, a table is free.

    One that nobody knows has no bounds but those that it brings.
    """
    allowed = "allowed is a finite number or { value, min, max }"

    def read(value: Any, place: FilePlace) -> Parameter:
        usual = _unknown(value, place) if known is None else known
        if isinstance(value, dict):
            given = table.read(value, place)
        elif is_number(value):
            given = {"value": float(value), "fixed": True}
        else:
            raise place.wrong(value, allowed)
        free = not given.pop("fixed", False)
        try:
            return replace(usual, **{"se": None, **given}, free=free).checked()
        except ModelError as problem:
            raise place.moved(problem) from None

    return FunctionKind(allowed, read)


def _unknown(value: Any, place: FilePlace) -> Parameter:
    """A user's own parameter, with a probe of its size."""
    brought = value if isinstance(value, dict) else {"value": value}
    start = brought.get("value", 0.0)
    most = 1e9 * max(1.0, abs(start) if is_number(start) else 1.0)
    ends = [brought.get(end, most) for end in ("min", "max")]
    size = max((abs(end) for end in ends if is_number(end)), default=most)
    probe = float(start) if is_number(start) and start else 0.01 * size
    return Parameter(str(place.path[-1]), "", "the user's own", 0.0, -most, most, probe=probe)


def _use(known: Nuisance) -> FunctionKind:
    """A nuisance of the file: a use, or a table of use and sizes."""

    def read(value: Any, place: FilePlace) -> Nuisance:
        if not isinstance(value, dict):
            return known.used(words(*USES).read(value, place))
        numbers = BY_ID[FORM].parameters if known.name == FORM else ()
        kinds: dict[str, KeyKind] = {p.name: _number(p) for p in (*known.sizes, *numbers)}
        given = Table({"use": words(*USES), **kinds}).read(value, place)
        sizes = tuple(replace(given.get(p.name, p), free=False) for p in known.sizes)
        return replace(known, sizes=sizes, use=given.get("use", USES[0]))

    return FunctionKind(f"allowed are {', '.join(USES)}", read)


def _observables(value: Any, place: FilePlace) -> tuple[str, ...]:
    """The model's observable, or a list of those that are fitted together."""
    names = [_OBSERVABLE.read(name, place) for name in (value if type(value) is list else [value])]
    try:
        return observables_known(names)
    except ModelError as problem:
        raise place.moved(problem) from None


_OBSERVABLE = words(*OBSERVABLES)
_HEAD = Table(
    {
        "observable": FunctionKind(_OBSERVABLE.allowed, _observables),
        "carcass": words(*CARCASSES),
        "contact": ANYTHING,
    },
    needed=("observable", "carcass"),
)
_FILE = Table(
    {
        "model": Named(ANYTHING),
        "parameters": Named(ANYTHING),
        "nuisances": Named(ANYTHING),
        FORM: Named(ANYTHING),
        "effects": Entries(ANYTHING),
    }
)
_BY_EXPRESSION = Table(
    {
        "name": TEXT,
        "acts_on": words(*EXPRESSION_ACTS_ON),
        "expression": TEXT,
        "parameters": Named(_number(None, _OWN_NUMBER)),
    }
)
_BY_SHAPE = Table(
    {
        "name": TEXT,
        "shape": words("empirical"),
        "acts_on": words(*SHAPE_ACTS_ON),
        "frame": words(*FRAMES),
        "law": TEXT,
        "nodes": numbers(-LARGEST, LARGEST, MOST_NODES),
        "values": numbers(-LARGEST, LARGEST, MOST_NODES),
        "parameters": Table({AMPLITUDE.name: _number(AMPLITUDE, _OWN_NUMBER)}),
    },
    needed=("frame", "nodes", "values"),
)


# ---- the file


def load_model(path: str | Path, *, effects: Path | None = None) -> Model:
    """The model in the file (contract, "Model file").

    Its effects are ours, installed ones, and the user's own of the Python file `effects`, which is
    run.

    ModelError names file, line and what is allowed.
    """
    path = Path(path)
    text = toml_text(path, ModelError, what="a model", advice="make one with `tirelog model new`")
    return replace(parse_model(text, path, own=effects), path=path)


def parse_model(text: str, path: Path | None = None, *, own: Path | None = None) -> Model:
    """The model that the TOML text describes; `own` is the file with the user's own effects."""
    document = Document(text, ModelError, "a model", path or "model")
    data, place = document.read(_FILE), FilePlace(document)
    try:
        tomlkit.parse(text)  # which writes the model later, and refuses more than tomllib
    except (TOMLKitError, RecursionError) as problem:
        line = getattr(problem, "line", None)
        raise place.error(f"is not TOML ({problem})", "see `tirelog model new`", "correct it").at(
            document.file, line
        ) from None
    catalogue, model = catalogue_with(own), _carcass(data, place)
    nuisances = _nuisances(data, place)
    model = replace(model, nuisances=nuisances, document=text, effects_file=own)
    own_numbers = {p.name for p in BY_ID[FORM].parameters}
    form = {name: x for name, x in data.get(FORM, {}).items() if name in own_numbers}
    tables = [(table, place / "effects" / i) for i, table in enumerate(data.get("effects", ()))]
    tables += [({"name": FORM, **form}, place / FORM)] * bool(form)
    entries = [(_effect(table, catalogue, at), at) for table, at in tables]
    for effect, at in entries:
        try:
            model = model.with_entry(effect, [entry for entry, _ in entries])
        except ModelError as problem:
            raise (at / "name").moved(problem) from None
    return model


def _carcass(data: Mapping[str, Any], place: FilePlace) -> Model:
    """The model of [model] with its own parameters and no effects."""
    head = _HEAD.read(data.get("model", {}), place / "model")
    numbers = data.get("parameters", {})
    model = _bare(head, numbers, place)
    return replace(model, base=_base(numbers, model.base, place / "parameters"))


def _nuisances(data: Mapping[str, Any], place: FilePlace) -> tuple[Nuisance, ...]:
    """All nuisances, with the settings of the file."""
    said = data.get("nuisances", {})
    wrong = [("nuisances", place / "nuisances" / FORM)] * (FORM in said) + [
        ("effects", place / "effects" / number / "name")
        for number, table in enumerate(data.get("effects", ()))
        if isinstance(table, dict) and table.get("name") == FORM
    ]
    for table, at in wrong:
        allowed = 'a table [form] with use = "...", sizes and numbers is allowed'
        raise at.error(f"{FORM} is under {table}", allowed, "write it there")
    uses: dict[str, KeyKind] = {known.name: _use(known) for known in NUISANCES}
    given = Table(uses).read(said, place / "nuisances")
    given[FORM] = uses[FORM].read(data.get(FORM, {}), place / FORM)
    return tuple(given.get(known.name, known) for known in NUISANCES)


def _bare(head: Mapping[str, Any], numbers: Mapping[str, Any], place: FilePlace) -> Model:
    """The model of [model], at its start values.

    Its `contact` is there or in [parameters]; without it a patch length means a prescribed
    patch.
    """
    prescribed = head["carcass"] == "beam" or "patch_half_length_m" in numbers
    table, given = ("parameters", numbers) if "contact" in numbers else ("model", head)
    at = place / table / "contact"
    usual = "prescribed" if prescribed else "flat_road"
    contact = words(*CONTACTS).read(given.get("contact", usual), at)
    try:
        return Model.new(head["carcass"], head["observable"], contact)
    except ModelError as problem:
        length = place / "parameters" / "patch_half_length_m"
        raise (at if "contact" in given else length).moved(problem) from None


def _base(
    numbers: Mapping[str, Any], known: tuple[Parameter, ...], place: FilePlace
) -> tuple[Parameter, ...]:
    """The parameters of the carcass as the file gives them, the others fixed at their start."""
    kinds = {p.name: _number(p) for p in known}
    given = Table({"contact": ANYTHING, **kinds}).read(numbers, place)
    if "reference_load_N" in kinds and "reference_load_N" not in given and "load_N" in given:
        load = given["load_N"].value
        given["reference_load_N"] = kinds["reference_load_N"].read(load, place / "load_N")
    lacking = [p.name for p in known if p.free and p.name not in (*given, *_MAY_LACK)]
    allowed = "a number or { value, min, max } is allowed"
    place.refuse((lacking, "", f"[parameters] lacks {', '.join(lacking)}", allowed, "add it"))
    return tuple(given.get(p.name, p.fixed()) for p in known)


def _effect(table: Any, catalogue: Mapping[str, Effect], place: FilePlace) -> ModelEffect:
    """The effect of one table: of the catalogue, a formula or a measured shape."""
    if not isinstance(table, dict) or not isinstance(table.get("name"), str):
        allowed = '[[effects]] with name = "..." is allowed'
        raise place.error("an effect has no name", allowed, "name it")
    name = table["name"]
    if "expression" in table or "shape" in table:
        return _own_effect(table, place)
    if name not in catalogue:
        near, listed = choices(name, catalogue)
        raise (place / "name").error(
            f"unknown effect {name!r}{near}",
            listed and f"{listed}, or one with an expression",
            "list: `tirelog effects`; for one of your own in Python give --effects FILE",
        )
    effect = catalogue[name]
    options: dict[str, KeyKind] = {key: words(*choices) for key, choices in effect.options.items()}
    numbers: dict[str, KeyKind] = {p.name: _number(p) for p in effect.parameters}
    given = Table({"name": TEXT, **numbers, **options}).read(table, place)
    return ModelEffect(
        effect,
        tuple(given.get(p.name, p) for p in effect.parameters),
        {key: given.get(key, choices[0]) for key, choices in effect.options.items()},
    )


def _own_effect(table: Mapping[str, Any], place: FilePlace) -> ModelEffect:
    """The user's own effect: by a formula, or by a measured shape along a frame's coordinate."""
    by_formula = "expression" in table
    given = (_BY_EXPRESSION if by_formula else _BY_SHAPE).read(table, place)
    given = {"acts_on": "contact_pressure" if by_formula else "strain", "law": "1", **given}
    name, acts_on, parameters = given["name"], given["acts_on"], given.get("parameters", {})
    try:
        if by_formula:
            formula, numbers = given["expression"], tuple(parameters.values())
            effect = effect_by_expression(name, acts_on, formula, numbers)
        else:
            law = (given["frame"], given["law"], given["nodes"], given["values"])
            amplitude = parameters.get(AMPLITUDE.name, AMPLITUDE)
            effect = effect_by_shape(name, acts_on, *law, amplitude)
    except ModelError as problem:
        raise (place / "name").moved(problem) from None
    keys = ("acts_on", "expression") if by_formula else SHAPE_KEYS
    return ModelEffect(
        effect, effect.parameters, source={key: given[key] for key in keys if key in given}
    )


def shape_entry(
    name: str,
    acts_on: str,
    frame: str,
    law: str,
    shape: tuple[FloatArray, FloatArray],
    amplitude: Parameter = AMPLITUDE,
) -> ModelEffect:
    """A measured shape (nodes, values) as an effect of a model, which a model file can hold."""
    nodes, values = ([float(f"{x:.6g}") for x in given] for given in shape)
    effect = effect_by_shape(name, acts_on, frame, law, nodes, values, amplitude)
    given = ("empirical", acts_on, frame, law, nodes, values)
    return ModelEffect(effect, effect.parameters, {}, dict(zip(SHAPE_KEYS, given, strict=True)))


def with_footprint(model: Model, pressure: FloatArray, pitch_m: float, load_N: float) -> Model:
    """The model with the pressure of a footprint that was measured under a load, not the parabola.

    `pressure` (n, m) in any unit: rows from the entry edge to the exit edge, `pitch_m` apart, and
    places across the tread in columns. The patch is where a row carries a twentieth of what the
    largest does. ModelError: no footprint, or a patch that follows from the contact with the road.
    """
    along = pressure.sum(axis=1) if pressure.ndim == 2 else np.zeros(0)
    held = np.flatnonzero(along > 0.05 * along.max(initial=0.0))
    if held.size < 5 or not np.isfinite(along).all() or pressure.min() < 0.0:
        raise ModelError(
            f"a footprint of {held.size} rows under load",
            allowed="five at least are allowed, of pressures from zero on",
            do="give a finer picture, rows along the tread",
        )
    if "patch_half_length_m" not in model.values:
        raise ModelError(
            "the patch of this model follows from its contact with the road",
            allowed='a model with a patch_half_length_m is allowed, as contact = "prescribed"',
            do="take another",
        )
    inside = along[held[0] : held[-1] + 1]
    place = (np.arange(inside.size) + 0.5) / inside.size * 2.0 - 1.0
    # in half lengths: a thirtieth of it loses nothing that a carcass passes on
    nodes = np.linspace(-1.0, 1.0, 61)
    shape = nodes, np.interp(nodes, place, inside / inside.mean()) - 1.5 * (1.0 - nodes**2)
    half = {"patch_half_length_m": 0.5 * pitch_m * inside.size, "reference_load_N": load_N}
    entry = shape_entry("footprint", "contact_pressure", "patch", "1", shape, AMPLITUDE.fixed())
    return model.with_values(half).with_effect(entry)


# ---- The model file, written: Model to TOML, whole or not at all.
#
# The comments of the document that the model was read from stay.


def save_model(model: Model, path: str | Path) -> None:
    """Writes the model file; the old one stays whole until the new one is complete.

    ModelError: the file there is not a model.
    """
    path = Path(path)
    refuse_another(path)
    text = as_toml(model)
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")


def refuse_another(path: Path) -> None:
    """ModelError: the file at the path is not a model, and must not be overwritten."""
    if not path.is_file() or not path.stat().st_size:
        return
    with suppress(OSError, UnicodeDecodeError, ModelError):
        text = path.read_text(encoding="utf-8-sig") if path.stat().st_size <= LARGEST_BYTES else ""
        if "model" in toml_tables(text, ModelError, file=path):
            return
    raise ModelError(
        "is there and is no model file",
        allowed="a model takes a new name, or the place of a model",
        do="give another -o",
        file=path,
    )


def as_toml(model: Model) -> str:
    """The model as TOML, in the document it was read from, if there is one."""
    document = tomlkit.parse(model.document) if model.document else tomlkit.document()
    head = document.setdefault("model", tomlkit.table())
    _set(head, "observable", list(model.observables) if model.beside else model.observable)
    _set(head, "carcass", model.carcass)
    numbers = document.setdefault("parameters", tomlkit.table())
    read: dict[str, Parameter] = {}
    if model.document:
        old = Document(model.document, ModelError, "a model", model.path or "model")
        read = {p.name: p for p in _carcass(old.read(_FILE), FilePlace(old)).base}
    if model.contact != "prescribed" and "contact" not in numbers and "contact" not in head:
        numbers["contact"] = model.contact
    for parameter in model.base:
        if parameter.name in numbers or parameter != read.get(parameter.name) or parameter.free:
            _put(numbers, parameter, read.get(parameter.name))
    _put_effects(document, model)
    _put_nuisances(document, model)
    return tomlkit.dumps(document)


def _set(table: Any, key: str, value: Any, remark: str = "") -> None:
    """Writes a value in the place of another, or a new one with a remark."""
    old = table.get(key)
    if old == value:
        return
    item = tomlkit.inline_table() if isinstance(value, dict) else tomlkit.item(value)
    if isinstance(value, dict):
        item.update(value)
    if remark and old is None:
        item.comment(remark)
    table[key] = item


def _put_effects(document: Any, model: Model) -> None:
    """Removes, changes and adds [[effects]], leaving what stays in place with its comments."""
    wanted = {e.id: e for e in model.effects if e.id != FORM}
    tables = document.setdefault("effects", tomlkit.aot())
    for index in reversed(range(len(tables))):
        if tables[index]["name"] not in wanted:
            del tables[index]
    held = {table["name"]: table for table in tables}
    for name, effect in wanted.items():
        table = held.get(name, tomlkit.table())
        if name not in held:
            table.update({"name": name, **effect.source, **effect.options})
        for option, word in effect.options.items():
            if table.get(option, effect.effect.options[option][0]) != word:
                table[option] = word
        numbers = table
        if effect.source and effect.parameters:
            numbers = table.setdefault("parameters", tomlkit.inline_table())
        for parameter, usual in zip(effect.parameters, effect.effect.parameters, strict=True):
            _put(numbers, parameter, usual, remark=not effect.source)
        if name not in held:
            tables.append(table)
    if not tables:
        del document["effects"]


def _put_nuisances(document: Any, model: Model) -> None:
    """Writes the nuisances that are used otherwise than by default, or are there already.

    [form] also has its numbers, if the model has them.
    """
    form = next((e for e in model.effects if e.id == FORM), None)
    for nuisance in model.nuisances:
        name, use, of_form = nuisance.name, nuisance.use, nuisance.name == FORM
        held = (document if of_form else document.get("nuisances", {})).get(name)
        if of_form and held is None and (form is not None or use != USES[0]):
            held = document.setdefault(FORM, tomlkit.table())
        if isinstance(held, dict):
            if held.get("use", USES[0]) != use or (of_form and not held):
                held["use"] = use
        elif not of_form and (held is not None or nuisance != BY_NAME[name]):
            table = document.setdefault("nuisances", tomlkit.table())
            _set(table, name, use, nuisance.description)
    for parameter in BY_ID[FORM].parameters if form is None else form.parameters:
        if form is not None:
            _put(document[FORM], parameter)
        elif FORM in document:
            document[FORM].pop(parameter.name, None)


def _put(
    table: Any, parameter: Parameter, usual: Parameter | None = None, *, remark: bool = True
) -> None:
    """Writes one parameter; an unchanged one, every comment and bounds as `usual` stay."""
    name, old = parameter.name, table.get(parameter.name)
    unit = "" if parameter.unit in ("", "1") else f" [{parameter.unit}]"
    words = f"{parameter.description}{unit}" if remark else ""
    if not (parameter.free or parameter.se is not None or isinstance(old, dict)):
        _set(table, name, parameter.value, words)
        return
    wanted = {
        "value": parameter.value,
        "min": parameter.min,
        "max": parameter.max,
        "se": parameter.se,
        "fixed": None if parameter.free else True,
        # of a user's own, which has no other place for it
        "unit": None if remark else parameter.unit or None,
    }
    wanted = {key: value for key, value in wanted.items() if value is not None}
    if isinstance(old, dict):  # usual bounds are not written
        wanted = {
            key: value
            for key, value in wanted.items()
            if key in old or key not in ("min", "max") or value != getattr(usual, key, value)
        }
    _set(table, name, wanted, words)


# ---- Models from what a setup knows of the tire and the drive, and from the papers' tables.


#: Models with the numbers of the papers' tables, in files below `presets`; each names its table and
#: what was corrected.
PRESETS = ("P1", "P2", "P3")
#: numbers that are this tire's or this drive's own, so that a start value is a guess
_OWN = ("load_N", "radius_m", "inflation_pressure_Pa", "width_m")


def new_model(
    carcass: str | None,
    setup: Setup | None = None,
    *,
    observable: str | Sequence[str] | None = None,
    contact: str | None = None,
    values: Mapping[str, float | str] | None = None,
    preset: str | None = None,
) -> tuple[Model, list[str]]:
    """(A model without effects, remarks on guessed values).

    `values` go before what the setup knows, this before a preset's numbers, these before start
    values.

    carcass     None: the preset's, else a beam
    observable  what the model predicts, one or several; None: the preset's, else what the setup's
                channels measure, else strain
    ModelError  no such carcass, observable, contact or parameter, or a pressure that is none in Pa
    UsageError  no such preset, or one of another carcass
    """
    if preset is None:
        model = Model.new(carcass or "beam", observable or measured_waveform(setup), contact)
        printed: dict[str, float] = {}
    else:
        model = preset_model(preset, observable=observable, contact=contact)
        printed = model.values
        if carcass not in (None, model.carcass):
            raise UsageError(
                f"the preset {preset} is a {model.carcass}, and --carcass says {carcass}",
                allowed="one of the two is allowed",
                do="leave --carcass out, or --preset",
            )
    given = {**known_numbers(model, setup), **(values or {})}
    model = model.with_values(given)
    check_pressure(model.values.get("inflation_pressure_Pa"))
    guessed = [
        f"{name} = {model.values[name]:g}"
        for name in _OWN
        if name in model.parameters and name not in {**printed, **given}
    ]
    notes = []
    if guessed:
        notes.append(
            f"neither the setup nor --set gives {', '.join(guessed)}: a guess, not this tire's; "
            f"give it in the setup's [tire] or [conditions], or with --set NAME=VALUE"
        )
    if model.carcass == "beam" and ACCELERATION in model.observables:
        notes.append(
            "a beam does not lie flat in the patch, where an accelerometer reads nothing; "
            "a ring does: --carcass ring"
        )
    return model, notes


def preset_model(
    name: str, *, observable: str | Sequence[str] | None = None, contact: str | None = None
) -> Model:
    """The model that a paper's table describes, without effects.

    With another observable or contact than the paper's, the numbers that such a model has.

    UsageError: no such preset.
    """
    refuse_unknown(name, PRESETS, f"unknown preset {name!r}", do="choose one of them")
    printed = load_model(Path(__file__).parent / "presets" / f"{name}.toml")
    if observable in (None, printed.observable) and contact in (None, printed.contact):
        return printed
    other = Model.new(printed.carcass, observable or printed.observable, contact or printed.contact)
    return other.with_values({k: v for k, v in printed.values.items() if k in other.parameters})


def measured_waveform(setup: Setup | None) -> str:
    """The waveform that a setup's channels measure: radial acceleration if no channel is strain."""
    kinds = {channel.kind for channel in setup.channels.values()} if setup is not None else set()
    return waveform_of(kinds)


def known_numbers(model: Model, setup: Setup | None) -> dict[str, float]:
    """What a setup knows of a model's numbers."""
    if setup is None:
        return {}
    tire, conditions = setup.tire, setup.conditions
    static = tire.static_footprint_length_m
    known = {
        "radius_m": tire.rolling_radius_m or tire.unloaded_radius_m,
        "width_m": tire.width_m,
        "load_N": conditions.load_N,
        "reference_load_N": conditions.load_N,
        "inflation_pressure_Pa": conditions.inflation_pressure_Pa,
        "reference_pressure_Pa": conditions.inflation_pressure_Pa,
        "patch_half_length_m": None if static is None else static / 2.0,
    }
    return {
        name: value
        for name, value in known.items()
        if value is not None and name in model.parameters
    }


def with_gauge_length(model: Model, setup: Setup | None) -> Model:
    """The model with gauge_length held at the length of the setup's gratings.

    Only if it has this effect and the gratings agree on one length.
    """
    name = "gauge_length.length_m"
    if setup is None or name not in model.parameters:
        return model
    lengths = {c.gauge_length_m for c in setup.channels.values() if c.kind in STRAIN_KINDS}
    length = lengths.pop() if len(lengths) == 1 else None
    if length is None:
        return model
    return model.with_parameters({name: model.parameters[name].at(length).fixed()})


def known_conditions(setup: Setup | None) -> dict[str, float]:
    """What a setup says of the conditions of a whole log, by the field of `Conditions`."""
    if setup is None:
        return {}
    known = {name: getattr(setup.conditions, name) for name in SETUP_KEYS}
    return {name: value for name, value in known.items() if value is not None}


def known_surface(setup: Setup | None) -> str | None:
    """The surface that a setup's first strain channel is on; None: it has none."""
    if setup is None:
        return None
    return next(
        (c.surface for c in setup.channels.values() if c.kind in STRAIN_KINDS and c.surface), None
    )


# ---- What a tire is driven under: beyond it a number is in another unit, and is refused.

#: least, most and unit of each condition: beyond them a number is in another unit. Twice the speed
#: lets 400 km/h pass for m/s; a time of 1e7 s is a third of a year, a change of 300 K would burn
#: the rubber
_DRIVEN = {
    "speed_m_s": (0.0, 200.0, "m/s"),
    "acceleration_m_s2": (-100.0, 100.0, "m/s^2"),
    "time_s": (0.0, 1e7, "s"),
    "temperature_K": (-300.0, 300.0, "K of change"),
    "slip": (-1.0, 1.0, "(positive in braking)"),
}


def check_pressure(pressure_Pa: float | None) -> None:
    """ModelError for an inflation pressure that is none in Pa; nothing at all (0) is allowed."""
    # a tire at less rests on its rim, and bar, psi and kPa taken for Pa all lie below it: a fifth
    # would let 1000 (kPa) pass, twice as much is 0.1 bar, which sand and snow are driven at
    least = 5e3
    if pressure_Pa is not None and not (pressure_Pa == 0.0 or pressure_Pa >= least):
        raise ModelError(
            f"inflation_pressure_Pa = {pressure_Pa:g} is not a plausible pressure of a tire in Pa",
            allowed=f"0, or {least:g} and more, is allowed",
            do="write it in Pa (2.2 bar is 2.2e5)",
        )


def check_model(model: Model) -> None:
    """ModelError for a model whose inflation pressure is none in Pa."""
    check_pressure(model.values.get("inflation_pressure_Pa"))


def check_conditions(conditions: Conditions, called: Mapping[str, str] | None = None) -> None:
    """UsageError for conditions that no tire is driven under, ModelError for such a pressure.

    What is not known (NaN) passes, but for the speed. `called`: how the user gave a condition.
    """
    for name, (low, high, unit) in _DRIVEN.items():
        values = np.asarray(getattr(conditions, name))
        outside = (values < low) | (values > high)
        if name == "speed_m_s":
            outside |= np.isnan(values)
        if outside.any():
            name = (called or {}).get(name, name)
            raise UsageError(
                f"{name} {float(values[outside][0]):g}",
                allowed=f"{low:g} to {high:g} {unit} is allowed",
                do="correct it",
            )
    for pressure in np.unique(conditions.inflation_pressure_Pa):
        check_pressure(None if np.isnan(pressure) else float(pressure))
