"""ROS 2 messages (CDR) as templates.

The definition text is parsed, one message walked, and each wanted number gets its place.

CDR aligns every number to its own size, counted from behind the four bytes of encapsulation;
strings and sequences begin with their length (32 bits), which is all that makes one message's
layout differ from another's.
"""

from __future__ import annotations

import re
import struct
from dataclasses import dataclass
from typing import Any

from google.protobuf.descriptor import FieldDescriptor

from tirelog.readers.mcap.fields import MessagePlan, Place, RequestedField, Token

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
#: elements of a list in a message; one with a longer list has no plan
LONGEST_LIST = 1 << 20
#: structures and texts of one message: the library makes a Python object of each
MOST_PARTS = 1 << 15
FIELD = re.compile(r"^\s*([\w/]+)(?:<=\d+)?(\[(?:<=)?\d*\])?\s+([A-Za-z]\w*)\b\s*(.*)$")


@dataclass(frozen=True)
class CdrMember:
    """A field of a definition.

    `length` is None for one value, -1 for a sequence, else the length of a fixed array.
    """

    type: str
    name: str
    length: int | None


def parse_definitions(name: str, text: str) -> tuple[str, dict[str, list[CdrMember]]]:
    """(name of the root, definitions by `package/Type`) of a concatenated ros2msg schema."""
    definitions: dict[str, list[CdrMember]] = {}
    for key, body in [*BUILTIN_TIME.items(), *_sections(name, text)]:
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


def _sections(name: str, text: str) -> list[tuple[str, str]]:
    sections = []
    for number, part in enumerate(re.split(r"^={3,}\s*$", text, flags=re.MULTILINE)):
        head = re.search(r"^\s*MSG:\s+(\S+)\s*$", part, flags=re.MULTILINE)
        key = _key(head[1]) if head else _key(name) if number == 0 else None
        if key:
            sections.append((key, part[head.end() :] if head else part))
    return sections


def _place(at: int, dtype: str, chosen: int | range) -> Place:
    """The place of one number, or of some of them, of a list of `dtype` from the byte `at` on."""
    width = int(dtype[2])
    if isinstance(chosen, int):
        return Place(at + chosen * width, dtype)
    return Place(at + chosen.start * width, dtype, len(chosen), chosen.step * width, batch=True)


class CdrTemplate:
    """The walk over one message."""

    def __init__(
        self, data: bytes, definitions: dict[str, list[CdrMember]], wants: list[RequestedField]
    ) -> None:
        if len(data) < ENCAPSULATION or data[1] not in (0, 1):
            raise ValueError
        self.data, self.definitions = data, definitions
        self.wants = [(which, want.tokens) for which, want in enumerate(wants)]
        self.order = "<" if data[1] else ">"
        self.at = ENCAPSULATION
        self.parts = 0
        self.plan = MessagePlan(len(data), [None] * len(wants))
        self.plan.guard_exact(data, 0, 2)

    def walk(self, root: str) -> MessagePlan:
        """The plan of the message.  ValueError if it has none."""
        try:
            self._structure(root, self.wants, 0)
        except (struct.error, KeyError, IndexError):
            raise ValueError from None
        return self.plan

    def _structure(self, kind: str, wants: list[tuple[int, tuple[Token, ...]]], depth: int) -> None:
        members = self.definitions[kind]
        if depth > 32:
            raise ValueError
        if not members:
            self.at += 1  # an empty definition is one byte
        for member in members:
            below = [
                (which, tokens[1:])
                for which, tokens in wants
                if tokens and tokens[0] == member.name
            ]
            if member.length is None:
                self._value(member.type, below, depth)
                continue
            length = member.length if member.length >= 0 else self._length()
            if length > LONGEST_LIST:
                raise ValueError
            if member.type in PRIMITIVES:
                self._numbers(PRIMITIVES[member.type], length, below)
            else:
                for k in range(length):
                    if any(tokens and isinstance(tokens[0], slice) for _, tokens in below):
                        raise ValueError
                    self._value(
                        member.type,
                        [
                            (which, tokens[1:])
                            for which, tokens in below
                            if tokens and tokens[0] == k
                        ],
                        depth,
                    )

    def _value(self, kind: str, wants: list[tuple[int, tuple[Token, ...]]], depth: int) -> None:
        self.parts += 1
        if self.parts > MOST_PARTS:
            raise ValueError
        if kind == "string":
            length = self._length()
            self.at += length
        elif kind in PRIMITIVES:
            dtype = PRIMITIVES[kind]
            self._align(int(dtype[1]))
            for which, tokens in wants:
                if not tokens:
                    self.plan.places[which] = Place(self.at, self.order + dtype)
            self.at += int(dtype[1])
        else:
            self._structure(kind, wants, depth + 1)
        if self.at > len(self.data):
            raise ValueError

    def _numbers(self, dtype: str, length: int, wants: list[tuple[int, tuple[Token, ...]]]) -> None:
        width = int(dtype[1])
        if length:
            self._align(width)
        if self.at + length * width > len(self.data):
            raise ValueError
        for which, tokens in wants:
            token = tokens[0] if tokens else slice(None)
            if len(tokens) > 1 or isinstance(token, str):
                continue
            if isinstance(token, int) and token >= length:
                continue
            self.plan.places[which] = _place(self.at, self.order + dtype, range(length)[token])
        self.at += length * width

    def _length(self) -> int:
        self._align(4)
        length = int(struct.unpack_from(self.order + "I", self.data, self.at)[0])
        self.plan.guard_exact(self.data, self.at, self.at + 4)
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
        return len(data) <= MOST_PARTS or bool(CdrTemplate(data, definitions, []).walk(root))
    except ValueError:
        return False


# ---- Protobuf messages as templates.
#
# One message's wire bytes are walked with its descriptor, and each wanted number gets its place.
#
# Tags and lengths are guards to the letter; of a varint only the continuation bits are, so that its
# value may change and its size may not. A field that the wire leaves out has its default; such a
# message has a layout of its own.


#: wire types of the format
VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5
F = FieldDescriptor
FIXED = {
    F.TYPE_DOUBLE: "<f8", F.TYPE_FLOAT: "<f4", F.TYPE_FIXED64: "<u8", F.TYPE_SFIXED64: "<i8",
    F.TYPE_FIXED32: "<u4", F.TYPE_SFIXED32: "<i4",
}  # fmt: skip
ZIGZAG = (F.TYPE_SINT32, F.TYPE_SINT64)
#: as varints these may be unsigned or 64 bits wide in ways that float64 of an int64 shows as they
#: are
SIGNED_VARINTS = (F.TYPE_INT32, F.TYPE_INT64, F.TYPE_UINT32, F.TYPE_BOOL, F.TYPE_ENUM, *ZIGZAG)
Wants = list[tuple[int, tuple[Token, ...]]]


class ProtobufTemplate:
    """The walk over one message."""

    def __init__(self, data: bytes, wants: list[RequestedField]) -> None:
        self.data = data
        self.plan = MessagePlan(len(data), [None] * len(wants))

    def message(self, descriptor: Any, wants: Wants, at: int, end: int, depth: int = 0) -> None:
        seen: set[int] = set()
        while at < end:
            begins = at
            tag, at = self._varint(at, end)
            self.plan.guard_exact(self.data, begins, at)
            number, wire = tag >> 3, tag & 7
            field = descriptor.fields_by_number.get(number)
            below = [(i, t[1:]) for i, t in wants if field is not None and t and t[0] == field.name]
            if below and (number in seen or field.type == F.TYPE_GROUP):
                raise ValueError  # an unpacked list, or a field that is merged or set anew
            seen.add(number)
            at = self._value(field, wire, below, at, end, depth)
        for which, tokens in wants:
            name = tokens[0] if tokens and isinstance(tokens[0], str) else ""
            field = descriptor.fields_by_name.get(name)
            if field is not None and field.number not in seen:
                self._absent(field, which, tokens[1:])

    def _absent(self, field: Any, which: int, tokens: tuple[Token, ...]) -> None:
        if (
            is_repeated(field)
            or tokens
            or field.type in (F.TYPE_MESSAGE, F.TYPE_STRING, F.TYPE_BYTES, F.TYPE_GROUP)
        ):
            raise ValueError
        self.plan.places[which] = Place(0, constant=float(field.default_value))

    def _value(self, field: Any, wire: int, wants: Wants, at: int, end: int, depth: int) -> int:
        if wire == VARINT:
            begins = at
            _, at = self._varint(at, end)
            self.plan.guards += [(k, 0x80, self.data[k] & 0x80) for k in range(begins, at)]
            if wants and (field.type not in SIGNED_VARINTS or is_repeated(field)):
                raise ValueError
            for which, tokens in wants:
                if not tokens:
                    self.plan.places[which] = Place(
                        begins, size=at - begins, zigzag=field.type in ZIGZAG
                    )
            return at
        if wire in (FIXED64, FIXED32):
            if wants and (field.type not in FIXED or is_repeated(field)):
                raise ValueError
            for which, tokens in wants:
                if not tokens:
                    self.plan.places[which] = Place(at, FIXED[field.type])
            return self._within(at + (8 if wire == FIXED64 else 4), end)
        if wire != BYTES:
            raise ValueError
        begins = at
        length, at = self._varint(at, end)
        self.plan.guard_exact(self.data, begins, at)
        after = self._within(at + length, end)
        if wants and field.type == F.TYPE_MESSAGE and not is_repeated(field):
            if depth > 32:
                raise ValueError
            self.message(field.message_type, wants, at, after, depth + 1)
        elif wants:
            self._packed(field, wants, at, length)
        return after

    def _packed(self, field: Any, wants: Wants, at: int, length: int) -> None:
        if field.type not in FIXED:
            raise ValueError
        dtype = FIXED[field.type]
        width = int(dtype[2])
        for which, tokens in wants:
            token = tokens[0] if tokens else slice(None)
            if len(tokens) > 1 or isinstance(token, str):
                raise ValueError
            self.plan.places[which] = _place(at, dtype, range(length // width)[token])

    def _varint(self, at: int, end: int) -> tuple[int, int]:
        value = shift = 0
        while at < end and shift < 70:
            byte = self.data[at]
            value |= (byte & 0x7F) << shift
            at, shift = at + 1, shift + 7
            if byte < 0x80:
                return value, at
        raise ValueError

    def _within(self, at: int, end: int) -> int:
        if at > end:
            raise ValueError
        return at


def is_repeated(field: Any) -> bool:
    """True for a list (the name of the property has changed between versions of protobuf)."""
    repeated = getattr(field, "is_repeated", None)
    return bool(repeated) if repeated is not None else field.label == F.LABEL_REPEATED


def protobuf_plan(data: bytes, descriptor: Any, wants: list[RequestedField]) -> MessagePlan:
    """The plan of one protobuf message.  ValueError if it has none."""
    template = ProtobufTemplate(data, wants)
    try:
        template.message(
            descriptor, [(i, want.tokens) for i, want in enumerate(wants)], 0, len(data)
        )
    except IndexError:
        raise ValueError from None
    return template.plan
