"""ROS 2 messages (CDR) whose layout repeats, read together with numpy.

    definition (text), one message, wanted paths --walk--> CdrLayout: where each number lies, and
                                                           the bytes that fix the layout
    CdrLayout, messages of the same size --compare those bytes--> which have this layout; numbers

CDR aligns every number to its own size, counted from behind the four bytes of encapsulation;
strings and sequences begin with their length (32 bits), which is all that makes one message's
layout differ from another's.
"""

from __future__ import annotations

import re
import struct
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tirelog.readers.mcap.fields import FieldColumn, RequestedField, Token
from tirelog.readers.mcap.records import MessageTable, message_rows

PRIMITIVES = {
    "bool": "u1", "byte": "u1", "char": "i1", "uint8": "u1", "int8": "i1", "uint16": "u2",
    "int16": "i2", "uint32": "u4", "int32": "i4", "uint64": "u8", "int64": "i8", "float32": "f4",
    "float64": "f8",
}  # fmt: skip
BUILTIN_TIME = dict.fromkeys(
    ("builtin_interfaces/Time", "builtin_interfaces/Duration"), "int32 sec\nuint32 nanosec"
)
#: bytes before a message's own: byte order and options
ENCAPSULATION = 4
#: structures and texts of one message: the library makes a Python object of each; bytes that fix a
#: layout: comparing more is no faster than decoding
MOST_PARTS = 1 << 15
_MOST_DEPTH = 32
FIELD = re.compile(r"^\s*([\w/]+)(?:<=\d+)?(\[(?:<=)?\d*\])?\s+([A-Za-z]\w*)\b\s*(.*)$")
#: number of a wanted path, and the tokens of it that are left
_Wants = list[tuple[int, tuple[Token, ...]]]


class CdrMember(NamedTuple):
    """A field of a definition.

    `length` is None for one value, -1 for a sequence, else the length of a fixed array.
    """

    type: str
    name: str
    length: int | None


def parse_definitions(name: str, text: str) -> tuple[str, dict[str, list[CdrMember]]]:
    """(name of the root, definitions by `package/Type`) of a concatenated ros2msg schema."""
    sections = list(BUILTIN_TIME.items())
    for number, part in enumerate(re.split(r"^={3,}\s*$", text, flags=re.MULTILINE)):
        head = re.search(r"^\s*MSG:\s+(\S+)\s*$", part, flags=re.MULTILINE)
        if head or number == 0:
            sections.append((_key(head[1] if head else name), part[head.end() if head else 0 :]))
    definitions: dict[str, list[CdrMember]] = {}
    for key, body in sections:
        package = key.split("/")[0]
        members = []
        for line in body.splitlines():
            match = FIELD.match(line.split("#")[0])
            if match is None or match[4].startswith("="):
                continue
            kind = match[1]
            if kind not in PRIMITIVES and kind not in ("string", "wstring"):
                kind = _key(kind if "/" in kind else f"{package}/{kind}")
            digits = re.sub(r"\D", "", match[2] or "")
            fixed = bool(match[2]) and "<" not in match[2] and digits
            members.append(
                CdrMember(kind, match[3], None if not match[2] else int(digits) if fixed else -1)
            )
        definitions[key] = members
    return _key(name), definitions


def _key(name: str) -> str:
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}"


class _Place(NamedTuple):
    """Where numbers lie in a message: so `many` (None: a number alone), every `step` bytes."""

    offset: int
    dtype: str
    many: int | None = None
    step: int = 0


class CdrLayout:
    """The layout of one message, by a walk over it, for those that are like it.

    ValueError: the message has no layout that repeats. `places` are those of the wanted paths.
    """

    def __init__(
        self,
        data: bytes,
        root: str,
        definitions: dict[str, list[CdrMember]],
        wants: list[RequestedField],
    ) -> None:
        if len(data) < ENCAPSULATION or data[1] not in (0, 1):
            raise ValueError
        self.data, self.size, self.definitions = data, len(data), definitions
        self.order = "<" if data[1] else ">"
        self.at = ENCAPSULATION
        self.parts = 0
        self.places: dict[int, _Place] = {}
        self.fixed = [0, 1]  # places of bytes that are the same in all messages of this layout
        try:
            self._structure(root, [(which, want.tokens) for which, want in enumerate(wants)], 0)
        except (struct.error, KeyError, IndexError):
            raise ValueError from None
        if len(self.places) < len(wants):
            raise ValueError

    def read(self, table: MessageTable) -> tuple[NDArray[np.bool_], list[FieldColumn]]:
        """(which of the messages have this layout, their numbers for each wanted path).

        All messages are of this size.
        """
        bytes_ = message_rows(table.data, table.starts, self.size)
        own = np.frombuffer(self.data, np.uint8)[self.fixed]
        fits = (bytes_[:, self.fixed] == own).all(axis=1)
        bytes_ = bytes_ if fits.all() else bytes_[fits]
        columns = []
        for _, place in sorted(self.places.items()):
            shape = len(bytes_), 1 if place.many is None else place.many
            values = np.zeros(shape)
            if values.size:
                steps = self.size, place.step
                values[:] = np.ndarray(shape, place.dtype, bytes_, place.offset, steps)
            lengths = None if place.many is None else np.full(len(bytes_), place.many)
            columns.append(FieldColumn(values.ravel(), lengths))
        return fits, columns

    def _structure(self, kind: str, wants: _Wants, depth: int) -> None:
        members = self.definitions[kind]
        if depth > _MOST_DEPTH:
            raise ValueError
        if not members:
            self.at += 1  # an empty definition is one byte
        for member in members:
            below = [(i, tokens[1:]) for i, tokens in wants if tokens[:1] == (member.name,)]
            if member.length is None:
                self._value(member.type, below, depth)
                continue
            length = member.length if member.length >= 0 else self._length()
            if member.type in PRIMITIVES:
                self._numbers(PRIMITIVES[member.type], length, below)
                continue
            if any(isinstance(token, slice) for _, tokens in below for token in tokens[:1]):
                raise ValueError
            for k in range(length):
                inside = [(i, tokens[1:]) for i, tokens in below if tokens[:1] == (k,)]
                self._value(member.type, inside, depth)

    def _value(self, kind: str, wants: _Wants, depth: int) -> None:
        self.parts += 1
        if self.parts > MOST_PARTS:
            raise ValueError
        if kind == "string":
            length = self._length()  # which moves on by itself
            self.at += length
        elif kind in PRIMITIVES:
            dtype = PRIMITIVES[kind]
            self._align(int(dtype[1]))
            self.places |= {i: _Place(self.at, self.order + dtype) for i, left in wants if not left}
            self.at += int(dtype[1])
        else:
            self._structure(kind, wants, depth + 1)
        if self.at > self.size:
            raise ValueError

    def _numbers(self, dtype: str, length: int, wants: _Wants) -> None:
        width = int(dtype[1])
        if length:
            self._align(width)
        if self.at + length * width > self.size:
            raise ValueError
        for which, tokens in wants:
            token = tokens[0] if tokens else slice(None)
            if len(tokens) > 1 or isinstance(token, str):
                continue
            chosen = range(length)[token]
            if isinstance(chosen, int):
                self.places[which] = _Place(self.at + chosen * width, self.order + dtype)
            else:
                first, step = self.at + chosen.start * width, chosen.step * width
                self.places[which] = _Place(first, self.order + dtype, len(chosen), step)
        self.at += length * width

    def _length(self) -> int:
        self._align(4)
        length = int(struct.unpack_from(self.order + "I", self.data, self.at)[0])
        self.fixed += range(self.at, self.at + 4)
        if len(self.fixed) > MOST_PARTS:
            raise ValueError
        self.at += 4
        return length

    def _align(self, size: int) -> None:
        self.at += -(self.at - ENCAPSULATION) % size


def is_bounded(data: bytes, root: str, definitions: dict[str, list[CdrMember]]) -> bool:
    """True if a message can be decoded in bounded memory.

    It is small, or can be walked and holds no more than MOST_PARTS parts beside its plain lists of
    numbers.
    """
    try:
        return len(data) <= MOST_PARTS or bool(CdrLayout(data, root, definitions, []))
    except ValueError:
        return False
