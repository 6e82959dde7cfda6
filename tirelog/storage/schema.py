"""What a file of tables may say: the one reader of setups, scenarios, models and the like.

    TOML text --Document--> tables, and the line of every key
    tables --kinds of their keys--> values, or an error with file, line and what is allowed

A kind says what one key may hold. A `Record` is the schema of a table and holds its values: it
lists the keys, each with its kind and its value if it is absent. So is a dataclass whose fields
have their kinds by `key`, or by their type if that is text or true and false.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from tirelog.errors import TirelogError, choices
from tirelog.storage.whole import toml_tables

#: where a key is: names of tables and keys, and the number of a table in a list
Path = tuple[str | int, ...]
#: so many letters of a wrong value are shown, and of a line are looked at for a key: twice as many
#: make a message of three lines, or cost time with a hostile file
_SHOWN, _LINE = 60, 1000
_PART = r"""(?:"[^"]*"|'[^']*'|[\w-]+)"""
_DOTTED = rf"\s*({_PART}(?:\s*\.\s*{_PART})*)\s*"
_HEADER, _KEY = re.compile(rf"\s*(\[\[?){_DOTTED}\]"), re.compile(rf"{_DOTTED}=")


@dataclass(frozen=True)
class Document:
    """The text of one file, its name, what it is ("a setup"), and its errors' class and advice."""

    text: str
    error: type[TirelogError]
    what: str
    file: object = None
    do: str = "mend it"

    def read(self, kind: KeyKind) -> Any:
        """The value of the whole file."""
        return kind.read(self.tables, FilePlace(self))

    @cached_property
    def tables(self) -> dict[str, Any]:
        """The tables as TOML has them; the error if the text is no TOML or goes too far."""
        return toml_tables(self.text, self.error, file=self.file)

    @cached_property
    def lines(self) -> dict[Path, int]:
        """The line of each table and each key that begins a line."""
        lines: dict[Path, int] = {}
        table: Path = ()
        entries: Counter[Path] = Counter()
        for number, whole in enumerate(self.text.split("\n"), 1):
            line = whole[:_LINE]
            if header := _HEADER.match(line):
                table = ()
                parts = _parts(header[2])
                for index, part in enumerate(parts, 1):
                    table = (*table, part)
                    entries[table] += header[1] == "[[" and index == len(parts)
                    if entries[table]:
                        lines.setdefault(table, number)
                        table = (*table, entries[table] - 1)
                lines.setdefault(table, number)
            elif key := _KEY.match(line):
                path = table
                for part in _parts(key[1]):
                    path = (*path, part)
                    lines.setdefault(path, number)
        return lines

    def line(self, path: Path) -> int | None:
        """The line of the key or table at the path, or of the nearest table around it."""
        ends = range(len(path), 0, -1)
        return next((self.lines[path[:end]] for end in ends if path[:end] in self.lines), None)


def _parts(dotted: str) -> list[str]:
    """The names of a dotted key."""
    return [part.strip("\"'") for part in re.findall(_PART, dotted)]


@dataclass(frozen=True)
class FilePlace:
    """A place of a document, which an error names with the line."""

    document: Document
    path: Path = ()

    def __truediv__(self, key: str | int) -> FilePlace:
        return replace(self, path=(*self.path, key))

    @property
    def table(self) -> str:
        """The table at this place as an error calls it."""
        if not self.path:
            return self.document.what
        *names, last = self.path
        if isinstance(last, int):
            return f"[[{'.'.join(map(str, names))}]] number {last + 1}"
        return f"[{'.'.join(str(name) for name in self.path if isinstance(name, str))}]"

    @property
    def inside(self) -> str:
        """The table that holds the key at this place, as words behind it; none at the top."""
        around = replace(self, path=self.path[:-1])
        return f" in {around.table}" if around.path else ""

    def error(
        self, what: str, allowed: str | Iterable[str] = "", do: str | None = None
    ) -> TirelogError:
        """The error that something at this place is wrong."""
        advice = self.document.do if do is None else do
        return self.moved(self.document.error(what, allowed=allowed, do=advice))

    def moved(self, problem: TirelogError) -> TirelogError:
        """The error at this place of the file."""
        return problem.at(self.document.file, self.document.line(self.path))

    def wrong(
        self, value: Any, allowed: str | Iterable[str], near: str = "", do: str | None = None
    ) -> TirelogError:
        """The error that the key at this place has a `value` that is not allowed."""
        return self.error(f"{self.path[-1]} = {_shown(value)}{self.inside}{near}", allowed, do)

    def refuse(self, *checks: tuple[object, str, str, str, str]) -> None:
        """The error of the first check (wrong, key, what, allowed, do) that is `wrong`."""
        for wrong, name, what, allowed, do in checks:
            if wrong:
                raise (self / name if name else self).error(what, allowed, do or None)


def _shown(value: Any) -> str:
    """A value of a file as a message shows it."""
    said = repr(value)
    return said if len(said) <= _SHOWN else f"{said[:_SHOWN]}..."


class KeyKind(Protocol):
    """What a key may hold."""

    @property
    def allowed(self) -> str:
        """What is allowed, as a clause."""

    def read(self, value: Any, place: FilePlace) -> Any:
        """The value as the code wants it; the document's error if it is not allowed."""


@dataclass(frozen=True)
class ValueKind:
    """A value in words, whether one fits, and what is made of it."""

    words: str
    fits: Callable[[Any], bool]
    made: Callable[[Any], Any] = lambda value: value

    @property
    def allowed(self) -> str:
        return f"allowed is {self.words}"

    def read(self, value: Any, place: FilePlace) -> Any:
        if not self.fits(value):
            raise place.wrong(value, self.allowed)
        return self.made(value)


@dataclass(frozen=True)
class FunctionKind:
    """A value that a function reads, with what it allows."""

    allowed: str
    read: Callable[[Any, FilePlace], Any]


@dataclass(frozen=True)
class OneOf:
    """One of a few words; if `several`, a list of some of them, and a tuple of these."""

    choices: tuple[str, ...]
    several: bool = False

    @property
    def allowed(self) -> str:
        plain = all(word[:1].isalnum() for word in self.choices)
        return f"allowed are {', '.join(word if plain else repr(word) for word in self.choices)}"

    def read(self, value: Any, place: FilePlace) -> Any:
        if self.several:
            if not isinstance(value, list) or not value:
                raise place.wrong(value, f"{self.allowed}, in a list")
            return tuple(OneOf(self.choices).read(one, place) for one in value)
        if not isinstance(value, str) or value not in self.choices:
            near, listed = choices(value, self.choices)
            raise place.wrong(value, listed and self.allowed, near, "choose one")
        return value


@dataclass(frozen=True)
class Table:
    """A table: the kinds of its keys, what is made of their values, and keys that it needs."""

    keys: Mapping[str, KeyKind]
    made: Callable[..., Any] = dict
    needed: tuple[str, ...] = ()

    @property
    def allowed(self) -> str:
        return f"allowed are {', '.join(self.keys)} under it"

    def read(self, value: Any, place: FilePlace) -> Any:
        if not isinstance(value, Mapping):
            raise place.error(f"{place.table} is not a table", self.allowed)
        for name in value:
            if name not in self.keys:
                near, known = choices(name, self.keys)
                what = f"unknown key {_shown(name)} in {place.table}{near}"
                raise (place / name).error(what, known, "correct or remove it")
        for name in self.needed:
            if name not in value:
                raise place.error(f"{place.table} has no {name}", self.keys[name].allowed, "add it")
        return self.made(**{k: self.keys[k].read(v, place / k) for k, v in value.items()})


@dataclass(frozen=True)
class Entries:
    """A list of tables, [[name]]; a tuple of their values."""

    entry: KeyKind
    allowed = "allowed is a list of tables"

    def read(self, value: Any, place: FilePlace) -> tuple[Any, ...]:
        if not isinstance(value, list | tuple):
            begin = f"allowed are entries that begin with [{place.table}]"
            raise place.error(f"{place.path[-1]} is not a list of tables", begin)
        return tuple(self.entry.read(one, place / number) for number, one in enumerate(value))


@dataclass(frozen=True)
class Named:
    """Tables by names of the user's own, [name.X]; a mapping of their values."""

    entry: KeyKind
    allowed = "allowed is a table with names of your own under it"

    def read(self, value: Any, place: FilePlace) -> dict[str, Any]:
        if not isinstance(value, Mapping):
            raise place.error(f"{place.table} is not a table", self.allowed)
        return {name: self.entry.read(one, place / name) for name, one in value.items()}


def is_number(value: Any) -> bool:
    """Whether a value is a finite number, and not true or false."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _within(low: float, high: float, above: bool, whole: bool, value: Any) -> bool:
    return (
        is_number(value)
        and (low < value if above else low <= value)
        and value <= high
        and (value == int(value) or not whole)
    )


def _range(low: float, high: float, above: bool = False) -> str:
    """A range as an error calls it."""
    return f"{'above' if above else 'from'} {low:g}" + (f" to {high:g}" if high < math.inf else "")


def number(low: float, high: float, *, above: bool = False, whole: bool = False) -> ValueKind:
    """A number in [low, high], or (low, high] if `above`."""
    fits = partial(_within, low, high, above, whole)
    said = f"a {'whole ' * whole}number {_range(low, high, above)}"
    return ValueKind(said, fits, int if whole else float)


def numbers(
    low: float, high: float = math.inf, most: float = math.inf, *, whole: bool = False
) -> ValueKind:
    """A list of at most `most` numbers in [low, high]; a tuple of them."""
    one = number(low, high, whole=whole)
    at_most = f"at most {most} " if most < math.inf else ""
    return ValueKind(
        f"a list of {at_most}{'whole ' * whole}numbers {_range(low, high)}",
        lambda value: isinstance(value, list) and len(value) <= most and all(map(one.fits, value)),
        lambda value: tuple(map(one.made, value)),
    )


TEXT = ValueKind("text in quotes", lambda value: isinstance(value, str))
FLAG = ValueKind("true or false", lambda value: isinstance(value, bool))
FINITE = ValueKind("a finite number", is_number, float)
#: text that is not empty and has no control characters
LINE = ValueKind(
    "text of one line in quotes",
    lambda value: isinstance(value, str) and bool(value.strip()) and value.isprintable(),
)
#: for what somebody else checks
ANYTHING = ValueKind("any value", lambda value: True)


def words(*choices: str) -> OneOf:
    """One of these words."""
    return OneOf(choices)


def key(kind: KeyKind | None, default: Any = None) -> Any:
    """A dataclass's field that is a key of a table; with the kind None it is no key."""
    return field(default=default, metadata={"kind": kind})


def kinds_of(cls: type[Any]) -> dict[str, KeyKind]:
    """The keys of the table that a dataclass describes."""
    plain = {"str": TEXT, "bool": FLAG}
    kinds = {
        f.name: f.metadata.get("kind", plain.get(str(f.type).removesuffix(" | None")))
        for f in fields(cls)
    }
    return {name: kind for name, kind in kinds.items() if kind is not None}


class Record:
    """The values of a table, by its keys: a subclass lists them, each with its kind and default.

    Each subclass is a frozen dataclass whose fields are these keys, in their order.
    """

    keys: ClassVar[Mapping[str, tuple[KeyKind | None, Any]]]
    __dataclass_fields__: ClassVar[dict[str, Any]]

    def __init_subclass__(cls) -> None:
        cls.__annotations__ = dict.fromkeys(cls.keys, Any)
        for name, (kind, default) in cls.keys.items():
            setattr(cls, name, key(kind, default))
        dataclass(frozen=True)(cls)

    if TYPE_CHECKING:

        def __init__(self, *values: Any, **named: Any) -> None: ...
        def __getattr__(self, name: str) -> Any: ...


def table_of(cls: type[Any], *needed: str) -> Table:
    """The table that a dataclass describes, with the keys that it needs."""
    return Table(kinds_of(cls), cls, needed)
