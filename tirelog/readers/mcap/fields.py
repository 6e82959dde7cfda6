"""What a message of MCAP holds: the paths that a setup names, and layouts that repeat.

    `topic:field.path[index]` --> RequestedField

"/tire:strain"            a number: one sample per message
"/tire:data[3]"           one element (from 0)
"/tire:samples"           a list of numbers: a batch of samples, in the order of time
"/tire:data[3::16]"       a batch that is every 16th element (rows of 16 laid end to end)
"/tire:rows[:][3]"        a batch over a list of lists; "/tire:rows[:].strain" over a list of
                          objects
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.errors import ReadError
from tirelog.readers.mcap.records import MessageTable, message_rows
from tirelog.vocabulary.arrays import FloatArray, IntArray

Token = str | int | slice


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
    match = re.fullmatch(r"(.+):((?:[^:\[\]]|\[[^\[\]]*\])+)", source.strip())
    if match is None:
        raise ReadError(
            f"source {source!r} names no field",
            allowed='allowed is "topic:field.path[index]"',
            do="mend source",
        )
    return match[1], match[2]


def parse_path(path: str) -> RequestedField:
    """The tokens of a field path.  ReadError if it does not parse."""
    tokens: list[Token] = []
    end = 0
    for match in re.finditer(r"\.?([A-Za-z_]\w*)|\[\s*([-\d:\s]*)\]", path):
        if match.start() != end:
            break
        end = match.end()
        if match[1]:
            tokens.append(match[1])
        elif re.fullmatch(r"\d+\s*", match[2]):
            tokens.append(int(match[2]))
        elif re.fullmatch(r"\d*\s*:?\s*\d*\s*(:\s*[1-9]\d*\s*)?", match[2]) and not re.fullmatch(
            r"\d+\s+\d+\s*", match[2]
        ):
            bounds = [int(part) if part.strip() else None for part in match[2].split(":")]
            tokens.append(slice(*bounds) if len(bounds) > 1 else slice(None))
        else:
            break
    else:
        if end == len(path) and tokens:
            return RequestedField(path, tuple(tokens))
    raise ReadError(
        f"field path {path!r} does not parse",
        allowed="allowed are names, [3], [3::16] and [:]",
        do="mend source",
    )


def number_of(value: Any) -> float:
    """A number of a message as float64; null is a lost sample. FieldError: it is something else."""
    if value is None:
        return float("nan")
    if isinstance(value, bool | int | float):
        try:
            return float(value)
        except OverflowError:
            return float("nan")
    kind = "text" if isinstance(value, str | bytes) else type(value).__name__
    raise FieldError(f"holds {kind} where a number is expected")


def extract(message: Any, tokens: tuple[Token, ...]) -> float | FloatArray:
    """The number, or the batch of numbers shape (k,), at `tokens` of a decoded message.

    FieldError if there is none.
    """
    value = message
    for at, token in enumerate(tokens):
        if isinstance(token, slice):
            items = _list(value)[token]
            rest = tokens[at + 1 :]
            return np.array([_scalar(item, rest) for item in items], np.float64)
        value = _step(value, token)
    if is_list(value):
        return np.array([number_of(item) for item in value], np.float64)
    return number_of(value)


def _scalar(item: Any, tokens: tuple[Token, ...]) -> float:
    found = extract(item, tokens)
    if not isinstance(found, float):
        raise FieldError("has lists within a list; allowed is one axis of time")
    return found


def _step(value: Any, token: str | int | slice) -> Any:
    if isinstance(token, int):
        items = _list(value)
        if token >= len(items):
            raise FieldError(f"has {len(items)} elements, and [{token}] is not one of them")
        return items[token]
    name, known = str(token), value if isinstance(value, dict) else field_names(value)
    if name not in known:  # objects have attributes that are no fields
        raise FieldError(f"has no field {name!r}", field_names(value), name)
    return value[name] if isinstance(value, dict) else getattr(value, name)


def field_names(value: Any) -> tuple[str, ...]:
    """The names of the fields of a decoded message."""
    if isinstance(value, dict):
        return tuple(map(str, value))
    descriptor = getattr(value, "DESCRIPTOR", None)
    if descriptor is not None:
        return tuple(field.name for field in descriptor.fields)
    return tuple(getattr(value, "__slots__", ()))


def is_list(value: Any) -> bool:
    return (
        not isinstance(value, str | bytes | dict)
        and hasattr(value, "__len__")
        and hasattr(value, "__getitem__")
    )


def _list(value: Any) -> Any:
    if not is_list(value) and not isinstance(value, bytes):
        raise FieldError("is no list, so it has no index")
    return value


# ---- Messages whose layout repeats, read with numpy.
#
# One message is walked as a template, the others are compared with it and gathered.
#
#     template (bytes), wanted paths
#         --walk of CDR or protobuf--> Plan: where each number lies, and the bytes that fix the
#         layout
#     Plan, messages of the same size --compare the guard bytes--> which have this layout;
#         --gather--> numbers
#
# A guard is a byte that decides where later fields lie: length prefixes, tags, continuation bits.
# Messages whose guards agree have the same layout, so their numbers lie at the same places.


#: bytes that fix a layout
MOST_GUARDS = 1 << 14


@dataclass(frozen=True)
class Place:
    """Numbers in a message: `count` of `dtype` from byte `offset`, every `step` bytes.

    `dtype` None: a varint of `size` bytes. Or a constant. `batch` is true for a list of numbers.
    """

    offset: int
    dtype: str | None = None
    count: int = 1
    step: int = 0
    size: int = 0
    batch: bool = False
    constant: float | None = None
    zigzag: bool = False


@dataclass
class MessagePlan:
    """The layout of messages of `size` bytes.

    `places[i]` for wanted path i; guards as (byte offset, mask, value).
    """

    size: int
    places: list[Place | None]
    guards: list[tuple[int, int, int]] = field(default_factory=list)

    def guard_exact(self, data: bytes, start: int, stop: int) -> None:
        """Bytes that must be the same.

        ValueError: so many that comparing them is no faster than decoding.
        """
        if len(self.guards) > MOST_GUARDS:
            raise ValueError
        self.guards += [(at, 0xFF, data[at]) for at in range(start, stop)]

    @cached_property
    def _guard_arrays(self) -> tuple[IntArray, NDArray[np.uint8], NDArray[np.uint8]]:
        """(offsets, masks, values) of the guards, of which no more come once this is asked for."""
        table = np.array(self.guards, np.int64).reshape(-1, 3)
        return table[:, 0], table[:, 1].astype(np.uint8), table[:, 2].astype(np.uint8)

    def read(self, table: MessageTable) -> tuple[NDArray[np.bool_], list[FieldColumn]]:
        """(which of the messages have this layout, their numbers for each wanted path).

        All messages are of this size.  ValueError if a wanted path has no place.
        """
        bytes_ = message_rows(table.data, table.starts, self.size)
        at, mask, value = self._guard_arrays
        fits = ((bytes_[:, at] & mask) == value).all(axis=1)
        if not fits.all():
            bytes_ = bytes_[fits]
        columns = []
        for place in self.places:
            if place is None:
                raise ValueError
            values = _numbers(bytes_, place)
            lengths = np.full(values.shape[0], values.shape[1]) if place.batch else None
            columns.append(FieldColumn(values.ravel(), lengths))
        return fits, columns


def _numbers(bytes_: NDArray[np.uint8], place: Place) -> FloatArray:
    """The numbers at a place in each row of messages, shape (m, count), float64."""
    n = bytes_.shape[0]
    if place.constant is not None:
        return np.full((n, 1), place.constant)
    if place.dtype is None:
        return _varint(bytes_[:, place.offset : place.offset + place.size], place)
    if n == 0 or place.count == 0:
        return np.zeros((n, place.count))
    width = np.dtype(place.dtype).itemsize
    view: NDArray[Any] = np.ndarray(
        (n, place.count), place.dtype, bytes_, place.offset, (bytes_.shape[1], place.step or width)
    )
    return view.astype(np.float64)


def _varint(bytes_: NDArray[np.uint8], place: Place) -> FloatArray:
    shifts = np.arange(0, 7 * place.size, 7, dtype=np.uint64)
    value = np.bitwise_or.reduce((bytes_ & 0x7F).astype(np.uint64) << shifts, axis=1)
    signed = value.view(np.int64)
    if place.zigzag:
        signed = (value >> np.uint64(1)).view(np.int64) ^ -(signed & 1)
    numbers: FloatArray = signed.astype(np.float64)[:, None]
    return numbers
