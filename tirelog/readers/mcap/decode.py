"""Messages of one MCAP channel to numbers, by the paths that a setup names.

    `topic:field.path[index]` --> RequestedField
    Table, wants --plans | library--> FieldColumn per want: `values` flat float64, `lengths` (n,) if
                                      a message holds a batch

"/tire:strain"            a number: one sample per message
"/tire:data[3]"           one element (from 0)
"/tire:samples"           a list of numbers: a batch of samples, in the order of time
"/tire:data[3::16]"       a batch that is every 16th element (rows of 16 laid end to end)
"/tire:rows[:][3]"        a batch over a list of lists; "/tire:rows[:].strain" over a list of
                          objects

Messages are read by layout with numpy if layouts repeat, else by the library one by one, as all
JSON is. The library's decoder is the authority: a plan is used only if it gives the numbers that
the library gives for its template.
"""

from __future__ import annotations

import itertools
import json
import re
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stderr
from dataclasses import dataclass, field
from functools import cached_property
from io import StringIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.errors import ReadError, nearest
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
    name = str(token)
    try:
        return value[name] if isinstance(value, dict) else getattr(value, name)
    except (KeyError, AttributeError):
        raise FieldError(f"has no field {name!r}", field_names(value), name) from None


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


# ---- The messages of one channel.


#: layouts of one channel that are remembered, and templates that may fail before the library does
#: the rest
MOST_PLANS = 64
MOST_FAILURES = 8
#: bytes of messages decoded at once
PIECE_BYTES = 1 << 21
#: bytes of one message: ten seconds of 64 channels at 1 kHz are 5 MB.  A library's decoder makes 30
#: times as much of lists in lists
LARGEST_MESSAGE_BYTES = 1 << 23
#: what a decoder raises on a damaged or foreign message
DECODE_ERRORS = (Exception,)  # three libraries, each with a tree of its own
PlanMaker = Callable[[bytes, list[RequestedField]], MessagePlan]


class ChannelDecoder:
    """Decodes the messages of one channel.

    ReadError if its encoding is not one of JSON, protobuf and ROS 2.
    """

    def __init__(self, topic: str, encoding: str, schema: Any) -> None:
        self.topic, self.encoding = topic, encoding
        self.faults: Counter[str] = Counter()  # messages that gave no number, by what was wrong
        self.refused_size = False
        try:
            decode, self.plan_of = _decoder(encoding, schema)
        except ReadError:
            raise
        except DECODE_ERRORS as problem:
            what = f"{type(problem).__name__}: {problem}".splitlines()[0][:160]
            raise ReadError(
                f"the schema of topic {topic!r} does not parse ({what})",
                allowed="allowed is a whole schema",
                do="record it again",
            ) from None
        if decode is None:
            name = schema.encoding if schema is not None else "none"
            raise ReadError(
                f"topic {topic!r} has the message encoding {encoding!r} with the schema encoding "
                f"{name!r}",
                allowed="allowed are json, protobuf with protobuf, cdr with ros2msg",
                do="record it in one of them",
            )
        self.decode: Callable[[bytes], Any] = decode
        self.plans: list[MessagePlan] = []
        self.failures = 0

    def _add_fault(self, what: str, messages: int = 1) -> None:
        if what in self.faults or len(self.faults) < 100:  # no more kinds are told apart
            self.faults[what] += messages

    def message(self, data: bytes) -> Any:
        """One decoded message.  FieldError if it does not decode."""
        try:
            return self.decode(data)
        except DECODE_ERRORS as problem:
            raise FieldError(f"does not decode ({type(problem).__name__})") from None

    def of_bounded_size(self, table: MessageTable, *, count: bool) -> MessageTable:
        """The table without messages that are too large to be decoded.

        These are counted as faults if `count`.
        """
        small = table.sizes <= LARGEST_MESSAGE_BYTES
        if small.all():
            return table
        self.refused_size = True
        if count:
            self._add_fault(
                f"larger than {LARGEST_MESSAGE_BYTES >> 20} MB; record fewer samples per message",
                int((~small).sum()),
            )
        return table.take(small)

    def read(self, table: MessageTable, wants: list[RequestedField]) -> list[list[FieldColumn]]:
        """The columns of the table's messages, piece by piece."""
        sizes = np.cumsum(table.sizes)
        edges = np.searchsorted(
            sizes, np.arange(PIECE_BYTES, int(sizes[-1]) if sizes.size else 0, PIECE_BYTES)
        )
        cuts = np.unique([0, *edges.tolist(), len(table)]).tolist()
        way = self.read_slowly if self.plan_of is None else self._read_by_plans
        return [way(table.take(slice(a, b)), wants) for a, b in itertools.pairwise(cuts)]

    def read_slowly(self, table: MessageTable, wants: list[RequestedField]) -> list[FieldColumn]:
        """Message by message through the library.

        What gives no number is NaN (one number per message) or an empty batch.
        """
        found: list[list[Any]] = [[] for _ in wants]
        for data in table.messages():
            try:
                message = self.message(data)
            except FieldError as problem:
                self._add_fault(str(problem))
                for values in found:
                    values.append(None)
                continue
            for want, values in zip(wants, found, strict=True):
                try:
                    values.append(extract(message, want.tokens))
                except FieldError as problem:
                    near = nearest(problem.name, problem.known) if problem.known else ""
                    self._add_fault(f"{want.path} {problem}{near}")
                    values.append(None)
        return [_field_column(values) for values in found]

    def _read_by_plans(self, table: MessageTable, wants: list[RequestedField]) -> list[FieldColumn]:
        """Layout by layout; messages for which no plan can be made go to the library."""
        pieces: list[tuple[IntArray, list[FieldColumn]]] = []
        rest = np.arange(len(table))
        tried = 0
        while rest.size:
            while tried < len(self.plans):
                plan = self.plans[tried]
                tried += 1
                right = table.sizes[rest] == plan.size
                if right.any():
                    fits = right.copy()
                    fits[right], columns = plan.read(table.take(rest[right]))
                    pieces.append((rest[fits], columns))
                    rest = rest[~fits]
            if rest.size and not self._learn(table.take(rest[:1]).messages()[0], wants):
                slow = rest if self._given_up() else rest[:1]
                pieces.append((slow, self.read_slowly(table.take(slow), wants)))
                rest = rest[slow.size :]
        return [
            _assemble(len(table), [(rows, columns[k]) for rows, columns in pieces])
            for k in range(len(wants))
        ]

    def _given_up(self) -> bool:
        return self.failures >= MOST_FAILURES or len(self.plans) >= MOST_PLANS

    def _learn(self, data: bytes, wants: list[RequestedField]) -> bool:
        """Add the plan of the message `data`, if it has a true one.

        True is a plan that gives the numbers that the library gives.
        """
        if self._given_up() or self.plan_of is None:
            return False
        try:
            plan, start = self.plan_of(data, wants), np.zeros(1, np.int64)
            _, columns = plan.read(MessageTable(data, start, np.array([len(data)]), start))
            message = self.decode(data)
            for want, column in zip(wants, columns, strict=True):
                truth = extract(message, want.tokens)
                same = np.array_equal(np.atleast_1d(truth), column.values, equal_nan=True)
                if not same or isinstance(truth, float) != (column.lengths is None):
                    raise ValueError
        except DECODE_ERRORS:
            self.failures += 1
            return False
        self.plans.append(plan)
        return True


def _assemble(n: int, pieces: list[tuple[IntArray, FieldColumn]]) -> FieldColumn:
    """One column of `n` messages from the columns of some of them each."""
    if len(pieces) == 1:
        return pieces[0][1]
    lengths = np.zeros(n, np.int64)
    for rows, column in pieces:
        lengths[rows] = column.sizes
    ends = np.cumsum(lengths)
    values = np.full(int(ends[-1]) if n else 0, np.nan)
    for rows, column in pieces:
        values[spread(ends[rows] - lengths[rows], lengths[rows])] = column.values
    batched = any(column.lengths is not None for _, column in pieces)
    return FieldColumn(values, lengths if batched else None)


def spread(starts: IntArray, lengths: IntArray) -> IntArray:
    """starts[i], starts[i] + 1, ... for lengths[i] numbers, one after the other."""
    before = np.cumsum(lengths) - lengths
    return np.repeat(starts - before, lengths) + np.arange(int(lengths.sum()))


def _field_column(values: list[float | FloatArray | None]) -> FieldColumn:
    """A column from what messages gave: a number, a batch, or nothing (NaN, or an empty batch)."""
    if not any(isinstance(value, np.ndarray) for value in values):
        return FieldColumn(
            np.array([np.nan if value is None else value for value in values], np.float64)
        )
    batches = [np.zeros(0) if value is None else np.atleast_1d(value) for value in values]
    return FieldColumn(
        np.concatenate(batches), np.array([batch.size for batch in batches], np.int64)
    )


def _decoder(encoding: str, schema: Any) -> tuple[Callable[[bytes], Any] | None, PlanMaker | None]:
    """(decoder of one message, maker of plans) of an encoding.

    (None, None) for one that is not known.
    """
    if encoding == "json":
        return json.loads, None
    if encoding == "protobuf":
        from mcap_protobuf.decoder import DecoderFactory as ProtobufFactory

        from tirelog.readers.mcap.serial import protobuf_plan

        decode = ProtobufFactory().decoder_for(encoding, schema)
        if decode is None:
            return None, None
        descriptor = decode(b"").DESCRIPTOR
        return decode, lambda data, wants: protobuf_plan(data, descriptor, wants)
    if encoding == "cdr":
        from mcap_ros2.decoder import DecoderFactory as Ros2Factory

        from tirelog.readers.mcap.serial import (
            MOST_PARTS,
            CdrTemplate,
            is_bounded,
            parse_definitions,
        )

        with redirect_stderr(StringIO()):  # its parser writes there before it raises
            decode = Ros2Factory().decoder_for(encoding, schema)
        if decode is None:
            return None, None
        root, definitions = parse_definitions(schema.name, schema.data.decode())

        def decode_bounded(data: bytes) -> Any:
            if not is_bounded(data, root, definitions):
                raise ValueError(f"more than {MOST_PARTS} structures")
            return decode(data)

        return decode_bounded, lambda data, wants: CdrTemplate(data, definitions, wants).walk(root)
    return None, None
