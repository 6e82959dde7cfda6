"""TOML and JSON text to plain tables.

The one way in for every file that a user, or another program, wrote.

    text --tomllib or json--> tables of bounded depth and numbers of 64 bits, or an error of
                              the file's kind

What is too deep to walk, or too large to be a float, is refused here once, so that nobody behind
has to think of it.
"""

from __future__ import annotations

import json
import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

from tirelog.errors import TirelogError
from tirelog.storage.remote import open_input
from tirelog.storage.whole import taken_as_input

#: a setup, a model or a scenario is a page of text; what is larger is something else
LARGEST_BYTES = 1 << 20
#: tables and lists within each other: no file of ours has more than 6
DEEPEST = 32
#: what TOML promises for a whole number, and far less than the largest float
_LARGEST_INTEGER = 1 << 63
#: a dotted key of more parts than that, which tomllib would work on for minutes before it can be
#: refused
_TOO_DOTTED = re.compile(
    rf"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){{{DEEPEST}}}"""
)
#: what a file of ours is by one of its tables or keys, the first that it has, and where it goes
_ROLES = {
    "campaign": ("a manifest", "`tirelog campaign run {file}` runs it"),
    "model": ("a model", "give it with --model, or see `tirelog model show {file}`"),
    "manoeuvres": ("a scenario", "`tirelog simulate {file} -o LOG.csv` makes its log"),
    "ramp": ("a scenario", "`tirelog simulate {file} -o LOG.csv` makes its log"),
    "channels": (
        "a setup",
        "give it with --setup; `tirelog model new --setup {file} -o MODEL.toml` makes a model",
    ),
}


def refuse_other_role(text: str, what: str, error: type[TirelogError], file: object) -> None:
    """The `error` if the TOML `text` is that of another kind of file than `what` ("a setup")."""
    heads = set(re.findall(r"^\s*\[\[?\s*(\w+)", text, re.MULTILINE))
    for name, (role, use) in _ROLES.items():
        if name in heads:
            if role != what:
                do = use.format(file=shlex.quote(str(file)))
                raise error(f"is {role}", allowed=f"{what} is needed here", do=do, file=file)
            return


def toml_text(path: Path | str, error: type[TirelogError], *, what: str, advice: str) -> str:
    """The text of the TOML file at `path`, without a byte-order mark.

    `error` if it cannot be read, is too large or no UTF-8.

    `what` names the kind of file ("a setup") and `advice` says what to do ("give another with
    --setup").
    """
    taken_as_input(path)
    try:
        with open_input(path) as stream:
            raw = stream.read(LARGEST_BYTES + 1)
    except (OSError, ValueError) as problem:  # ValueError: a NUL in the name
        reason = getattr(problem, "strerror", None) or problem
        raise error(
            f"cannot be read ({reason}); {what} is a TOML file; {advice}", file=path
        ) from None
    if len(raw) > LARGEST_BYTES:
        raise error(
            f"is larger than {LARGEST_BYTES >> 20} MB; {what} is a page of TOML; {advice}",
            file=path,
        )
    try:
        text = raw.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except UnicodeDecodeError:
        raise error(f"is not UTF-8 text; {what} is a TOML file; {advice}", file=path) from None
    refuse_other_role(text, what, error, path)
    return text


def toml_tables(text: str, error: type[TirelogError], *, file: object) -> dict[str, Any]:
    """The tables in TOML `text`; `error` if it is no TOML or goes too far.

    The error names the line if it is known.
    """
    try:
        if _TOO_DOTTED.search(text):
            raise RecursionError
        return dict(_bounded(tomllib.loads(text)))
    except RecursionError:
        message, line = (
            f"is nested deeper than {DEEPEST}; allowed is a page of tables and keys; mend it",
            None,
        )
    except (
        ValueError
    ) as problem:  # tomllib's own error is one; so is an integer of thousands of digits
        where = re.search(r"line (\d+)", str(problem))
        message, line = (
            f"not TOML: {problem}; allowed is TOML in UTF-8; mend the line",
            int(where[1]) if where else None,
        )
    raise error(message, file=file, line=line)


def json_value(text: str | bytes) -> Any:
    """What JSON `text` holds; ValueError if it is no JSON or goes too far."""
    try:
        return _bounded(json.loads(text))
    except RecursionError:
        raise ValueError(f"nested deeper than {DEEPEST}") from None


def json_of(text: str | bytes, shape: Any) -> Any:
    """What JSON `text` holds; ValueError if it is no JSON, goes too far or has another `shape`.

    A shape is a type, a union with None, [shape of each], {str: shape of each}, or {"name": shape,
    "name_that_may_be_missing_or_null?": shape}. A whole number is a float too.
    """
    value = json_value(text)
    _refuse_other(value, shape, "it")
    return value


def _refuse_other(value: Any, shape: Any, place: str) -> None:
    """ValueError if the value at a `place` of the document has another shape."""
    if isinstance(shape, list) and isinstance(value, list):
        for number, one in enumerate(value):
            _refuse_other(one, shape[0], f"{place}[{number}]")
    elif isinstance(shape, dict) and isinstance(value, dict):
        named: dict[str, Any] = dict.fromkeys(value, shape[str]) if str in shape else shape
        for name, one in named.items():
            key = name.removesuffix("?")
            if value.get(key) is not None or (key == name and key in value):
                _refuse_other(value[key], one, f"{place}.{key}")
            elif key == name:
                raise ValueError(f"{place} has no {key}")
    elif isinstance(shape, list | dict) or not (
        (isinstance(value, shape) and (shape in (bool, object) or not isinstance(value, bool)))
        or (type(value) is int and isinstance(0.0, shape))
    ):
        raise ValueError(f"{place} is {type(value).__name__}")


def _bounded(tables: Any) -> Any:
    """`tables` as they are.

    ValueError for what is nested too deep, and for whole numbers of more than 64 bits.
    """
    level = [tables]
    for _ in range(DEEPEST):
        below: list[Any] = []
        for item in level:
            if isinstance(item, dict):
                below += item.values()
            elif isinstance(item, list):
                below += item
            elif isinstance(item, int) and not -_LARGEST_INTEGER <= item < _LARGEST_INTEGER:
                digits = len(str(abs(item))) if item.bit_length() < 10_000 else "thousands of"
                raise ValueError(f"a whole number of {digits} digits, where 19 are allowed")
        if not below:
            return tables
        level = below
    raise RecursionError
