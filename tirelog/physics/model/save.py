"""The model file, written: Model to TOML, whole or not at all.

The comments of the document that the model was read from stay.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import tomlkit

from tirelog.errors import ModelError
from tirelog.physics.effects import BY_ID
from tirelog.physics.model.file import EFFECTS_FILE
from tirelog.physics.model.model import Model
from tirelog.physics.model.nuisances import BY_NAME, FORM, USES
from tirelog.physics.model.own.user_effects import installed_effects
from tirelog.physics.parameters import Parameter
from tirelog.storage.documents import LARGEST_BYTES, toml_tables
from tirelog.storage.whole import whole_file


def save_model(model: Model, path: str | Path) -> None:
    """Writes the model file; the old one stays whole until the new one is complete.

    ModelError: what stands there is no model.
    """
    path = Path(path)
    refuse_another(path)
    text = as_toml(model, path.parent)
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")


def refuse_another(path: Path) -> None:
    """ModelError: what stands at the path is no model, and is not to be written over."""
    if not _may_be_replaced(path):
        raise ModelError(
            "is there and is no model file",
            allowed="a model takes a new name, or the place of a model",
            do="give another -o",
            file=path,
        )


def _may_be_replaced(path: Path) -> bool:
    """False if a file is there that holds something else than a model."""
    if not path.is_file() or not path.stat().st_size:
        return True
    try:
        text = path.read_text(encoding="utf-8-sig") if path.stat().st_size <= LARGEST_BYTES else ""
        return "model" in toml_tables(text, ModelError, file=path)
    except (OSError, UnicodeDecodeError, ModelError):
        return False


def as_toml(model: Model, folder: Path | None = None) -> str:
    """The model as TOML, in the document it was read from, if there is one.

    A Python file with the user's own effects is named from `folder`, by default that of the model.
    """
    document = tomlkit.parse(model.document) if model.document else tomlkit.document()
    observable = list(model.observables) if model.beside else model.observable
    _update(document, "model", {"observable": observable, "carcass": model.carcass})
    _put_effects_file(document, model, folder)
    numbers = document.setdefault("parameters", tomlkit.table())
    if (
        model.contact != "prescribed"
        and "contact" not in numbers
        and "contact" not in document["model"]
    ):
        numbers["contact"] = model.contact
    for parameter in model.base:
        if parameter.name in numbers or not model.document or parameter.free:
            _put(numbers, parameter)
    _put_effects(document, model)
    _put_nuisances(document, model)
    _put_form(document, model)
    return tomlkit.dumps(document)


def _update(document: Any, table: str, values: Mapping[str, Any]) -> None:
    held = document.setdefault(table, tomlkit.table())
    for key, value in values.items():
        if held.get(key) != value:
            held[key] = value


def _put_effects_file(document: Any, model: Model, folder: Path | None) -> None:
    """Names the Python file with the user's own effects, if the model has one of them."""
    if model.effects_file is None:
        return
    if folder is None:
        folder = model.path.parent if model.path is not None else Path()
    known = {**BY_ID, **installed_effects()}
    own = any(not e.source and e.id not in known for e in model.effects)
    if not own and EFFECTS_FILE not in document["model"]:
        return
    with suppress(ValueError):  # on another drive
        name = os.path.relpath(model.effects_file.resolve(), folder.resolve())
        _update(document, "model", {EFFECTS_FILE: Path(name).as_posix()})


def _put_effects(document: Any, model: Model) -> None:
    """Removes, changes and adds [[effects]], leaving what stays in place with its comments."""
    tables = document.get("effects")
    held = {table["name"]: table for table in tables} if tables is not None else {}
    wanted = {e.id: e for e in model.effects if e.id != FORM}
    if tables is not None:
        for index in reversed(range(len(tables))):
            if tables[index]["name"] not in wanted:
                del tables[index]
        if not len(tables):
            del document["effects"]
            tables = None
    for name, effect in wanted.items():
        if name in held:
            numbers = held[name].get("parameters", held[name]) if effect.source else held[name]
            for parameter in effect.parameters:
                _put(numbers, parameter, remark=not effect.source)
            continue
        table = tomlkit.table()
        table["name"] = name
        for key, value in {**effect.source, **effect.options}.items():
            table[key] = value
        numbers = table if not effect.source else tomlkit.inline_table()
        for parameter in effect.parameters:
            _put(numbers, parameter, remark=not effect.source)
        if effect.source:
            table["parameters"] = numbers
        if tables is None:
            tables = tomlkit.aot()
            document["effects"] = tables
            tables = document["effects"]
        tables.append(table)


def _put_nuisances(document: Any, model: Model) -> None:
    """Writes the nuisances that are used otherwise than they are by default, or stand there."""
    for nuisance in model.nuisances:
        if nuisance.name == FORM:
            continue
        held = document.get("nuisances", {}).get(nuisance.name)
        if held is None and nuisance == BY_NAME[nuisance.name]:
            continue
        use = held.get("use", USES[0]) if isinstance(held, dict) else held
        if use == nuisance.use:
            continue
        table = document.setdefault("nuisances", tomlkit.table())
        if isinstance(held, dict):
            held["use"] = nuisance.use
        else:
            item = tomlkit.item(nuisance.use)
            if held is None:
                item.comment(nuisance.description)
            table[nuisance.name] = item


def _put_form(document: Any, model: Model) -> None:
    """Writes [form]: its use, and its numbers if the model has them."""
    use = next(n.use for n in model.nuisances if n.name == FORM)
    numbers = [p for e in model.effects if e.id == FORM for p in e.parameters]
    if FORM not in document and use == USES[0] and not numbers:
        return
    table = document.setdefault(FORM, tomlkit.table())
    if table.get("use", USES[0]) != use or not len(table):
        table["use"] = use
    for parameter in BY_ID[FORM].parameters:
        if not numbers:
            table.pop(parameter.name, None)
    for parameter in numbers:
        _put(table, parameter)


def _put(table: Any, parameter: Parameter, *, remark: bool = True) -> None:
    """Writes one parameter, leaving an unchanged one (and every comment) as it stands."""
    old = table.get(parameter.name)
    if parameter.free or parameter.se is not None or isinstance(old, dict):
        wanted: dict[str, Any] = {
            "value": parameter.value,
            "min": parameter.min,
            "max": parameter.max,
        }
        wanted |= {"se": parameter.se} if parameter.se is not None else {}
        wanted |= {} if parameter.free else {"fixed": True}
        if not remark and parameter.unit:  # a user's own, which has no other place for it
            wanted |= {"unit": parameter.unit}
        if not isinstance(old, dict):
            new = tomlkit.inline_table()
            new.update(wanted)
            _assign(table, parameter, new, remark and old is None)
            return
        for key in list(old):
            if key not in wanted:
                del old[key]
        for key, value in wanted.items():
            if (key in old or key not in ("min", "max")) and old.get(key) != value:
                old[key] = value
    elif old is None or float(old) != parameter.value:
        _assign(table, parameter, parameter.value, remark and old is None)


def _assign(table: Any, parameter: Parameter, value: Any, remark: bool) -> None:
    item = tomlkit.item(value)
    if remark:
        unit = "" if parameter.unit in ("", "1") else f" [{parameter.unit}]"
        item.comment(f"{parameter.description}{unit}")
    table[parameter.name] = item
