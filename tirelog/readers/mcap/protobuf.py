"""Protobuf messages as templates.

One message's wire bytes are walked with its descriptor, and each wanted number gets its place.

Tags and lengths are guards to the letter; of a varint only the continuation bits are, so that its
value may change and its size may not. A field that the wire leaves out has its default; such a
message has a layout of its own.
"""

from __future__ import annotations

from typing import Any

from google.protobuf.descriptor import FieldDescriptor

from tirelog.readers.mcap.source import Token, Want
from tirelog.readers.mcap.templates import MessagePlan, NoPlanError, Place

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

    def __init__(self, data: bytes, wants: list[Want]) -> None:
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
                raise NoPlanError  # an unpacked list, or a field that is merged or set anew
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
            raise NoPlanError
        self.plan.places[which] = Place(0, constant=float(field.default_value))

    def _value(self, field: Any, wire: int, wants: Wants, at: int, end: int, depth: int) -> int:
        if wire == VARINT:
            begins = at
            _, at = self._varint(at, end)
            self.plan.guards += [(k, 0x80, self.data[k] & 0x80) for k in range(begins, at)]
            if wants and (field.type not in SIGNED_VARINTS or is_repeated(field)):
                raise NoPlanError
            for which, tokens in wants:
                if not tokens:
                    self.plan.places[which] = Place(
                        begins, size=at - begins, zigzag=field.type in ZIGZAG
                    )
            return at
        if wire in (FIXED64, FIXED32):
            if wants and (field.type not in FIXED or is_repeated(field)):
                raise NoPlanError
            for which, tokens in wants:
                if not tokens:
                    self.plan.places[which] = Place(at, FIXED[field.type])
            return self._within(at + (8 if wire == FIXED64 else 4), end)
        if wire != BYTES:
            raise NoPlanError
        begins = at
        length, at = self._varint(at, end)
        self.plan.guard_exact(self.data, begins, at)
        after = self._within(at + length, end)
        if wants and field.type == F.TYPE_MESSAGE and not is_repeated(field):
            if depth > 32:
                raise NoPlanError
            self.message(field.message_type, wants, at, after, depth + 1)
        elif wants:
            self._packed(field, wants, at, length)
        return after

    def _packed(self, field: Any, wants: Wants, at: int, length: int) -> None:
        if field.type not in FIXED:
            raise NoPlanError
        dtype = FIXED[field.type]
        width = int(dtype[2])
        for which, tokens in wants:
            token = tokens[0] if tokens else slice(None)
            if len(tokens) > 1 or isinstance(token, str):
                raise NoPlanError
            chosen = range(length // width)[token]
            if isinstance(chosen, int):
                self.plan.places[which] = Place(at + chosen * width, dtype)
            else:
                self.plan.places[which] = Place(
                    at + chosen.start * width, dtype, len(chosen), chosen.step * width, batch=True
                )

    def _varint(self, at: int, end: int) -> tuple[int, int]:
        value = shift = 0
        while at < end and shift < 70:
            byte = self.data[at]
            value |= (byte & 0x7F) << shift
            at, shift = at + 1, shift + 7
            if byte < 0x80:
                return value, at
        raise NoPlanError

    def _within(self, at: int, end: int) -> int:
        if at > end:
            raise NoPlanError
        return at


def is_repeated(field: Any) -> bool:
    """True for a list (the name of the property has changed between versions of protobuf)."""
    repeated = getattr(field, "is_repeated", None)
    return bool(repeated) if repeated is not None else field.label == F.LABEL_REPEATED


def protobuf_plan(data: bytes, descriptor: Any, wants: list[Want]) -> MessagePlan:
    """The plan of one protobuf message.  NoPlanError if it has none."""
    template = ProtobufTemplate(data, wants)
    try:
        template.message(
            descriptor, [(i, want.tokens) for i, want in enumerate(wants)], 0, len(data)
        )
    except IndexError:
        raise NoPlanError from None
    return template.plan
