"""What a message of MCAP holds: the paths that a setup names, and the numbers there.

    `topic:field.path[index]` --> RequestedField

"/tire:strain"            a number: one sample per message
"/tire:data[3]"           one element (from 0)
"/tire:samples"           a list of numbers: a batch of samples, in the order of time
"/tire:data[3::16]"       a batch that is every 16th element (rows of 16 laid end to end)
"/tire:FBG 1 [nm]"        a field of that name, which only JSON has
"/tire:rows[:][3]"        a batch over a list of lists; "/tire:rows[:].strain" over a list of
                          objects
"""

from __future__ import annotations

import re
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from tirelog.errors import ReadError
from tirelog.vocabulary.arrays import FloatArray, IntArray

Token = str | int | slice
#: a name, one index, or first : behind : step, each of which may be left out
_TOKEN = re.compile(
    r"\.?([A-Za-z_]\w*)|\[\s*(\d+)\s*\]"
    r"|\[\s*(?:(\d*)\s*:\s*(\d*)\s*(?::\s*([1-9]\d*)?\s*)?)?\]"
)
#: a field of a source: what has a colon outside of brackets cannot be named
FIELD = r"(?:[^:\[\]]|\[[^\[\]]*\])+"


@dataclass(frozen=True)
class RequestedField:
    """One number, or one list of numbers, in each message of a topic."""

    path: str
    tokens: tuple[Token, ...]


@dataclass(frozen=True)
class FieldColumn:
    """Numbers that the messages of one topic hold for one want.

    `lengths` shape (n,) if each message holds a batch; `values` are then the batches end to end.
    """

    values: FloatArray
    lengths: IntArray | None = None

    @property
    def sizes(self) -> IntArray:
        """Numbers per message."""
        return np.ones(self.values.size, np.int64) if self.lengths is None else self.lengths


class FieldError(ValueError):
    """A message that has no number at a path.

    `what` says why, `known` are the names that it has there.
    """

    def __init__(self, what: str, known: tuple[str, ...] = (), name: str = "") -> None:
        super().__init__(what)
        self.known, self.name = known, name


def topic_and_field(source: str) -> tuple[str, str]:
    """(topic, field path) of a source.  ReadError if it does not parse."""
    match = re.fullmatch(rf"(.+):({FIELD})", source.strip())
    if match is None:
        raise ReadError(
            f"source {source!r} names no field",
            allowed='allowed is "topic:field.path[index]"',
            do="mend source",
        )
    return match[1], match[2]


def parse_path(path: str) -> RequestedField:
    """The tokens of a field path; what does not parse is a name as it is."""
    tokens: list[Token] = []
    end = 0
    while match := _TOKEN.match(path, end):
        name, number, *bounds = match.groups()
        if name or number:
            tokens.append(name or int(number))
        else:
            tokens.append(slice(*(int(bound) if bound else None for bound in bounds)))
        end = match.end()
    # JSON may have any name
    return RequestedField(path, tuple(tokens) if end == len(path) else (path,))


def number_of(value: Any) -> float:
    """A number of a message as float64; null is a lost sample. FieldError: it is something else."""
    if value is None:
        return float("nan")
    if isinstance(value, bool | int | float):
        try:
            return float(value)
        except OverflowError:
            return float("nan")
    if is_list(value):
        raise FieldError("has lists within a list; allowed is one axis of time")
    kind = "text" if isinstance(value, str | bytes) else type(value).__name__
    raise FieldError(f"holds {kind} where a number is expected")


def extract(message: Any, tokens: tuple[Token, ...]) -> float | FloatArray:
    """The number, or the batch of numbers shape (k,), at `tokens` of a decoded message.

    FieldError if there is none.
    """
    value = message
    for at, token in enumerate(tokens):
        if isinstance(token, str):
            names = value if isinstance(value, dict) else field_names(value)
            if token not in names:  # objects have attributes that are no fields
                raise FieldError(f"has no field {token!r}", tuple(names), token)
            value = field_of(value, token)
            continue
        if not is_list(value) and not isinstance(value, bytes):
            raise FieldError("is no list, so it has no index")
        if isinstance(token, slice):
            return _batch(value[token], tokens[at + 1 :])
        if token >= len(value):
            raise FieldError(f"has {len(value)} elements, and [{token}] is not one of them")
        value = value[token]
    if isinstance(value, float):  # as most are
        return value
    return _batch(value, ()) if is_list(value) else number_of(value)


def _batch(items: Any, tokens: tuple[Token, ...]) -> FloatArray:
    """The number at `tokens` of each item, shape (k,).  FieldError if one has none."""
    if not tokens and {*map(type, items)} <= {float, int, bool}:
        with suppress(OverflowError):
            return np.fromiter(items, np.float64, len(items))
    found = [extract(item, tokens) if tokens else number_of(item) for item in items]
    if not all(isinstance(number, float) for number in found):
        raise FieldError("has lists within a list; allowed is one axis of time")
    return np.array(found, np.float64)


def field_names(value: Any) -> tuple[str, ...]:
    """The names of the fields of a decoded message."""
    return tuple(value) if isinstance(value, dict) else _names_of(value.__class__)


def field_of(value: Any, name: str) -> Any:
    """The field of a decoded message that has it."""
    return value[name] if isinstance(value, dict) else getattr(value, name)


@cache
def _names_of(kind: Any) -> tuple[str, ...]:
    """The names of the fields of a message of this kind."""
    descriptor = getattr(kind, "DESCRIPTOR", None)
    if descriptor is not None:
        return tuple(field.name for field in descriptor.fields)
    return tuple(getattr(kind, "__slots__", ()))


def is_list(value: Any) -> bool:
    return (
        not isinstance(value, str | bytes | dict)
        and hasattr(value, "__len__")
        and hasattr(value, "__getitem__")
    )
