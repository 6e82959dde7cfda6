"""The model file, read: TOML to Model (contract, "Model file"); `save` writes one.

Unknown keys are refused with the nearest allowed ones and the line. A plain number is a fixed
parameter; a table { value, min, max } is free, and carries `se` after a fit (and `fixed = true` if
it is held although it has bounds).

The file is longer than others: it reads every table of a model file.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path, PureWindowsPath
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from tirelog.errors import ModelError, nearest
from tirelog.physics.carcass.numbers import CARCASSES, CONTACTS, carcass_parameters
from tirelog.physics.effects import BY_ID, Effect
from tirelog.physics.model.entry import ModelEffect
from tirelog.physics.model.model import COUPLED_STANDS, Model, observables_known
from tirelog.physics.model.nuisances import FORM, NUISANCES, USES, Nuisance
from tirelog.physics.model.own import empirical
from tirelog.physics.model.own.dimensions import BASE, dimension_of, unit_disagreements
from tirelog.physics.model.own.user_effects import (
    EXPRESSION_ACTS_ON,
    catalogue_with,
    effect_by_expression,
)
from tirelog.physics.parameters import Parameter
from tirelog.storage.documents import toml_tables, toml_text
from tirelog.vocabulary.observables import OBSERVABLES

#: key of [model]: the Python file with the user's own effects
EFFECTS_FILE = "effects_file"
_NUMBER_KEYS = ("value", "min", "max", "se", "fixed")


class _Text:
    """The file's text, to say where a key stands."""

    def __init__(self, text: str, path: Path | None) -> None:
        self.lines, self.path = text.splitlines(), path

    def error(
        self,
        what: str,
        key: str | None = None,
        after: int = 0,
        *,
        allowed: str | Iterable[str] = "",
        do: str = "correct it",
    ) -> ModelError:
        return self.here(ModelError(what, allowed=allowed, do=do), key, after)

    def here(self, problem: ModelError, key: str | None, after: int = 0) -> ModelError:
        """The error at the line of `key`, the first one after `after`."""
        return problem.at(self.path or "model", self.line(key, after) if key else None)

    def line(self, key: str, after: int = 0) -> int | None:
        pattern = re.compile(
            rf"(^|[\s{{,\[\"'.]){re.escape(key)}[\"']?\s*(=|\]|\.)|=\s*[\"']{re.escape(key)}[\"']"
        )
        found = (
            number
            for number, line in enumerate(self.lines, 1)
            if number > after and pattern.search(line.split("#")[0])
        )
        return next(found, None)


def load_model(
    path: str | Path,
    *,
    catalogue: Mapping[str, Effect] | None = None,
    effects: Path | None = None,
) -> Model:
    """The model in the file (contract, "Model file").

    Its effects are those of the `catalogue`, by default ours, installed ones, and the user's own
    of the Python file `effects`, which is run; without one of that which the model names, if the
    user has let it run before.

    ModelError names file, line and what is allowed.
    """
    path = Path(path)
    text = toml_text(path, ModelError, what="a model", advice="make one with `tirelog model new`")
    return replace(parse_model(text, path, catalogue=catalogue, own=effects), path=path)


def parse_model(
    text: str,
    path: Path | None = None,
    *,
    catalogue: Mapping[str, Effect] | None = None,
    own: Path | None = None,
) -> Model:
    """The model that the TOML text describes; `own` is the file with the user's own effects."""
    source = _Text(text, path)
    toml_tables(
        text, ModelError, file=path or "model"
    )  # tomlkit, which keeps the comments, follows any depth and any number
    try:
        document = tomlkit.parse(text).unwrap()
    except (TOMLKitError, RecursionError) as problem:
        raise ModelError(
            f"is not TOML ({problem})",
            allowed="see `tirelog model new`",
            do="correct it",
            file=path or "model",
            line=getattr(problem, "line", None),
        ) from None
    named = ("model", "parameters", "nuisances", FORM)
    _only(document, (*named, "effects"), source, "a model file")
    head, numbers, beside, form = (document.get(name, {}) for name in named)
    effects = document.get("effects", [])
    tables = all(isinstance(table, dict) for table in (head, numbers, beside, form))
    if not (tables and isinstance(effects, list)):
        raise source.error(
            "[model], [parameters], [nuisances], [form] are tables, [[effects]] a list of tables",
            allowed="no other form is allowed",
        )
    beside, effects = _with_form(form, beside, effects, source)
    _only(head, ("observable", "carcass", "contact", EFFECTS_FILE), source, "[model]")
    carcass = _word(head, "carcass", CARCASSES, None, source)
    observables = _observables(head, source)
    contact = _contact(head, numbers, carcass, source)
    known = carcass_parameters(
        carcass, *observables, flat_road=contact == "flat_road", point=contact == "point"
    )
    base = _base(numbers, known, source)
    nuisances = _nuisances(beside, source)
    lead, *others = observables
    model = Model(
        lead,
        carcass,
        contact,
        base,
        nuisances=nuisances,
        document=text,
        beside=tuple(others),
    )
    if catalogue is None:
        asked, own = own is not None, own or _effects_file(head, source)
        catalogue = _catalogue(own, source, asked=asked)
        model = replace(model, effects_file=own if own is not None and own.is_file() else None)
    after = 0
    entries: list[tuple[ModelEffect, int]] = []
    for table in effects:
        if not isinstance(table, dict) or not isinstance(table.get("name"), str):
            raise source.error(
                "an effect has no name",
                "effects",
                allowed='[[effects]] with name = "..." is allowed',
                do="name it",
            )
        after = source.line(table["name"], after) or after
        entries.append((_effect(table, catalogue, source, after), after))
    for effect, after in entries:
        try:
            model = model.with_entry(effect, [entry for entry, _ in entries])
        except ModelError as problem:
            raise source.here(problem, effect.id, after - 1) from None
    return model


def _effects_file(head: Mapping[str, Any], source: _Text) -> Path | None:
    """The Python file with effects that the model names, None if none."""
    if EFFECTS_FILE not in head:
        return None
    name = head[EFFECTS_FILE]
    if not isinstance(name, str) or not name or PureWindowsPath(name).anchor or name[0] == "/":
        raise source.error(
            f"{EFFECTS_FILE} = {name!r}",
            EFFECTS_FILE,
            allowed="a path that starts from the model file's folder is allowed",
        )
    return (source.path.parent if source.path is not None else Path()) / name


def _catalogue(own: Path | None, source: _Text, *, asked: bool) -> Mapping[str, Effect]:
    """All effects, with those of the user's own file; a model's line where it names it in vain."""
    try:
        return catalogue_with(own, asked=asked)
    except ModelError as problem:
        if asked or problem.line is not None:
            raise
        raise source.error(
            f"{EFFECTS_FILE}: {own} {problem.what}",
            EFFECTS_FILE,
            allowed=problem.allowed,
            do=problem.do,
        ) from None


def _with_form(
    form: Mapping[str, Any], beside: Mapping[str, Any], effects: list[Any], source: _Text
) -> tuple[dict[str, Any], list[Any]]:
    """The nuisances and the effects with what [form] says: use and sizes, and numbers."""
    named = [e.get("name") for e in effects if isinstance(e, dict)]
    for table, names in (("nuisances", beside), ("effects", named)):
        if FORM in names:
            raise source.error(
                f"{FORM} is under {table}",
                FORM,
                (source.line(table) or 1) - 1,
                allowed='a table [form] with use = "...", sizes and numbers is allowed',
                do="write it there",
            )
    own = [p.name for p in BY_ID[FORM].parameters]
    numbers = {name: value for name, value in form.items() if name in own}
    said = {name: value for name, value in form.items() if name not in own}
    return {**beside, FORM: said}, effects + [{"name": FORM, **numbers}] * bool(numbers)


def _nuisances(table: Mapping[str, Any], source: _Text) -> tuple[Nuisance, ...]:
    """All nuisances, with what the file says of them: a use, or a table of use and sizes."""
    _only(table, (nuisance.name for nuisance in NUISANCES), source, "[nuisances]")
    after = (source.line("nuisances") or 1) - 1
    return tuple(
        _nuisance(table[known.name], known, source, after) if known.name in table else known
        for known in NUISANCES
    )


def _nuisance(given: Any, known: Nuisance, source: _Text, after: int) -> Nuisance:
    own = given if isinstance(given, dict) else {"use": given}
    after = (source.line(FORM) or 1) - 1 if known.name == FORM else after
    _only(own, ("use", *(p.name for p in known.sizes)), source, f"nuisance {known.name}", after)
    sizes = tuple(
        replace(_number(own[p.name], p, source, p.name, after), free=False) if p.name in own else p
        for p in known.sizes
    )
    try:
        for size in sizes:
            size.checked(f"nuisance {known.name}: {size.name}")
    except ModelError as problem:
        raise source.here(problem, known.name, after) from None
    use = own.get("use", USES[0])
    if use not in USES:
        raise source.error(
            f"nuisance {known.name}: {use!r} is no use of it",
            known.name,
            after,
            allowed=USES,
            do="choose one",
        )
    return replace(known, sizes=sizes, use=use)


def _observables(head: Mapping[str, Any], source: _Text) -> tuple[str, ...]:
    """What the model is of: one observable, or a list of those that are fitted together."""
    given = head.get("observable")
    if not isinstance(given, list):
        return (_word(head, "observable", tuple(OBSERVABLES), None, source),)
    for name in given:
        _word({"observable": name}, "observable", tuple(OBSERVABLES), None, source)
    try:
        return observables_known(given)
    except ModelError as problem:
        raise source.here(problem, "observable", 0) from None


def _contact(
    head: Mapping[str, Any], numbers: Mapping[str, Any], carcass: str, source: _Text
) -> str:
    """The contact that the model's file asks for: prescribed, solved, or a point.

    `contact` stands in [model] or in [parameters]; without it a patch length means a prescribed
    patch.
    """
    default = "prescribed" if carcass == "beam" or "patch_half_length_m" in numbers else "flat_road"
    contact = _word(numbers if "contact" in numbers else head, "contact", CONTACTS, default, source)
    if carcass == "beam" and contact == "flat_road":
        raise source.error(
            'contact = "flat_road" needs a ring',
            "contact",
            allowed='"prescribed" and "point" are allowed for a beam',
        )
    if carcass == "coupled_ring" and contact != "flat_road":
        raise source.error(
            COUPLED_STANDS, "contact" if "contact" in {**head, **numbers} else "patch_half_length_m"
        )
    return contact


def _word(
    table: Mapping[str, Any],
    key: str,
    allowed: tuple[str, ...],
    default: str | None,
    source: _Text,
    after: int = 0,
) -> str:
    value = table.get(key, default)
    if not isinstance(value, str) or value not in allowed:
        near = nearest(value, allowed) if isinstance(value, str) else ""
        raise source.error(
            f"{key} = {value!r}{near}",
            key,
            after,
            allowed=allowed,
            do="choose one",
        )
    return value


def _only(
    table: Mapping[str, Any], allowed: Iterable[str], source: _Text, where: str, after: int = 0
) -> None:
    allowed = list(allowed)
    for key in table:
        if key not in allowed:
            raise source.error(
                f"unknown key {key!r} in {where}{nearest(key, allowed)}",
                key,
                after,
                allowed=allowed,
            )


#: free in a new model of acceleration; a file without it holds it at its start value
_MAY_LACK = ("width_m",)


def _base(
    numbers: Mapping[str, Any], known: tuple[Parameter, ...], source: _Text
) -> tuple[Parameter, ...]:
    _only(numbers, ("contact", *(p.name for p in known)), source, "[parameters]")
    given = dict(numbers)
    if "reference_load_N" not in given and "load_N" in given:
        given["reference_load_N"] = _number(given["load_N"], known[0], source, "load_N").value
    lacking = [p.name for p in known if p.free and p.name not in (*given, *_MAY_LACK)]
    if lacking:
        raise source.error(
            f"[parameters] lacks {', '.join(lacking)}",
            allowed="a number or { value, min, max } is allowed",
            do="add it",
        )
    return tuple(
        _number(given[p.name], p, source, p.name) if p.name in given else p.fixed() for p in known
    )


def _number(value: Any, known: Parameter, source: _Text, label: str, after: int = 0) -> Parameter:
    """A parameter from a plain number (fixed) or a table."""
    table = value if isinstance(value, dict) else {"value": value}
    _only(table, _NUMBER_KEYS, source, label, after)
    for key, number in table.items():
        wrong = (
            not isinstance(number, bool)
            if key == "fixed"
            else (isinstance(number, bool) or not isinstance(number, int | float))
        )
        if wrong or (key not in ("fixed", "se") and not math.isfinite(number)):
            raise source.error(
                f"{label}: {key} = {number!r}",
                label,
                after,
                allowed=f"a finite number{' (fixed: true or false)' * (key == 'fixed')} is allowed",
            )
    free = isinstance(value, dict) and not table.get("fixed", False)
    low, high = (float(table.get(key, getattr(known, key))) for key in ("min", "max"))
    parameter = replace(
        known,
        value=float(table.get("value", known.value)),
        min=low,
        max=high,
        free=free,
        se=table.get("se"),
    )
    if not isinstance(value, dict) and label != known.name:
        return parameter  # a number that only lends its value
    try:
        return parameter.checked(label)
    except ModelError as problem:
        raise source.here(problem, label, after) from None


def _effect(
    table: Mapping[str, Any], catalogue: Mapping[str, Effect], source: _Text, after: int
) -> ModelEffect:
    name = table["name"]
    own = {}
    if "expression" in table:
        effect = _by_expression(table, source, after)
        given, own = table.get("parameters", {}), {k: table[k] for k in ("acts_on", "expression")}
    elif "shape" in table:
        effect = _by_shape(table, source, after)
        given, own = (
            table.get("parameters", {}),
            {k: table[k] for k in empirical.KEYS if k in table},
        )
    elif name not in catalogue:
        raise source.error(
            f"unknown effect {name!r}{nearest(name, catalogue)}",
            name,
            after - 1,
            allowed=f"allowed are {', '.join(catalogue)}, or one with an expression",
            do="for one of your own in Python give --effects FILE",
        )
    else:
        effect = catalogue[name]
        given = {k: v for k, v in table.items() if k != "name" and k not in effect.options}
    _only(given, (p.name for p in effect.parameters), source, f"effect {name!r}", after - 1)
    parameters = tuple(
        _number(_unitless(given[p.name]) if own else given[p.name], p, source, p.name, after - 1)
        if p.name in given
        else p
        for p in effect.parameters
    )
    options = {
        key: _word(table, key, words, words[0], source, after - 1)
        for key, words in effect.options.items()
    }
    return ModelEffect(effect, parameters, options, own)


def _by_expression(table: Mapping[str, Any], source: _Text, after: int) -> Effect:
    _only(
        table,
        ("name", "acts_on", "expression", "parameters"),
        source,
        f"effect {table['name']!r}",
        after - 1,
    )
    given = _own_numbers(table, "expression", source, after)
    parameters = tuple(
        _number(_unitless(value), _unknown(key, value, source, after), source, key, after - 1)
        for key, value in given.items()
    )
    parameters = tuple(
        replace(p, probe=p.value or 0.01 * max(abs(p.min), abs(p.max))) for p in parameters
    )
    place = _word(table, "acts_on", EXPRESSION_ACTS_ON, "contact_pressure", source, after - 1)
    try:
        return effect_by_expression(table["name"], place, table["expression"], parameters)
    except ModelError as problem:
        raise source.here(problem, table["name"], after - 1) from None


def _own_numbers(
    table: Mapping[str, Any], text: str, source: _Text, after: int
) -> Mapping[str, Any]:
    """The [parameters] of an effect of the user's own; an error if its `text` is none."""
    given = table.get("parameters", {})
    if not isinstance(table.get(text, ""), str) or not isinstance(given, dict):
        raise source.error(
            f"{text} is a text and parameters a table",
            text,
            after - 1,
            allowed="no other form is allowed",
        )
    return given


def _by_shape(table: Mapping[str, Any], source: _Text, after: int) -> Effect:
    """The effect of a measured shape: numbers along a frame's coordinate, times a law."""
    what = f"effect {table['name']!r}"
    _only(table, ("name", *empirical.KEYS, "parameters"), source, what, after - 1)
    _word(table, "shape", ("empirical",), None, source, after - 1)
    _own_numbers(table, "law", source, after)
    frame = _word(table, "frame", tuple(empirical.FRAMES), None, source, after - 1)
    place = _word(table, "acts_on", empirical.ACTS_ON, "strain", source, after - 1)
    law = table.get("law", "1")
    try:
        return empirical.effect_by_shape(
            table["name"], place, frame, law, table.get("nodes"), table.get("values")
        )
    except ModelError as problem:
        raise source.here(problem, table["name"], after - 1) from None


def _unknown(key: str, value: Any, source: _Text, after: int) -> Parameter:
    """A user's own parameter has no bounds and no unit but those that it brings."""
    start = value.get("value", 0.0) if isinstance(value, dict) else value
    unit = value.get("unit", "") if isinstance(value, dict) else ""
    if not isinstance(unit, str) or (unit and dimension_of(unit) is None):
        raise source.error(
            f"{key}: unit = {unit!r}",
            key,
            after - 1,
            allowed=f"powers and products of {', '.join(BASE)} are allowed, such as N/m^2",
            do="correct it, or leave it out",
        )
    size = max(1.0, abs(start)) if isinstance(start, int | float) else 1.0
    return Parameter(key, unit, "the user's own", 0.0, -1e9 * size, 1e9 * size, probe=1.0)


def _unitless(value: Any) -> Any:
    """The numbers of a user's own parameter, without its unit."""
    return {k: v for k, v in value.items() if k != "unit"} if isinstance(value, dict) else value


def unit_remarks(model: Model) -> list[str]:
    """Sentences on the user's own formulas whose units do not agree, with file and line."""
    source = _Text(model.document or "", model.path)
    remarks = []
    for name, wrong in unit_disagreements(model).items():
        after = source.line(name) or 0
        line = source.line("expression", after) if model.document else None
        place = f"{model.path or 'model'}{f':{line}' if line else ''}"
        remarks.append(f"{place}: the units of effect {name!r} do not agree: {wrong}")
    return remarks
