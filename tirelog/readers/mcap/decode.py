"""Messages of one MCAP channel to numbers, by the paths that a setup names.

    Table, wants --library | layouts--> FieldColumn per want: `values` flat float64, `lengths` (n,)
                                        if a message holds a batch

The library decodes message by message. ROS 2 messages, of which it decodes some 30,000 a second,
are read by layout with numpy if layouts repeat: a layout is used only if it gives the numbers that
the library gives for the message that it was made from.
"""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stderr
from io import StringIO
from typing import Any

import numpy as np

from tirelog.errors import ReadError, nearest
from tirelog.readers.mcap.cdr import MOST_PARTS, CdrLayout, is_bounded, parse_definitions
from tirelog.readers.mcap.fields import FieldColumn, FieldError, RequestedField, extract
from tirelog.readers.mcap.records import MessageTable
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: messages of one channel from which a layout is learned before the library does the rest
MOST_LEARNED = 64
#: bytes of messages decoded at once
PIECE_BYTES = 1 << 21
#: bytes of one message: ten seconds of 64 channels at 1 kHz are 5 MB.  A library's decoder makes 30
#: times as much of lists in lists
LARGEST_MESSAGE_BYTES = 1 << 23
#: what a decoder raises on a damaged or foreign message
DECODE_ERRORS = (Exception,)  # three libraries, each with a tree of its own
LayoutMaker = Callable[[bytes, list[RequestedField]], CdrLayout]


class ChannelDecoder:
    """Decodes the messages of one channel.

    ReadError if its encoding is not one of JSON, protobuf and ROS 2.
    """

    def __init__(self, topic: str, encoding: str, schema: Any) -> None:
        self.topic, self.encoding = topic, encoding
        self.faults: Counter[str] = Counter()  # messages that gave no number, by what was wrong
        try:
            decoder = _decoder(encoding, schema)
        except DECODE_ERRORS as problem:
            what = f"{type(problem).__name__}: {problem}".splitlines()[0][:160]
            raise ReadError(
                f"the schema of topic {topic!r} does not parse ({what})",
                allowed="allowed is a whole schema",
                do="record it again",
            ) from None
        if decoder is None:
            name = schema.encoding if schema is not None else "none"
            raise ReadError(
                f"topic {topic!r} has the message encoding {encoding!r} with the schema encoding "
                f"{name!r}",
                allowed="allowed are json, protobuf with protobuf, cdr with ros2msg",
                do="record it in one of them",
            )
        self.decode, self.layout_of = decoder
        self.layouts: list[CdrLayout] = []
        self.learned = 0

    def _add_fault(self, what: str, messages: int = 1) -> None:
        if what in self.faults or len(self.faults) < 100:  # no more kinds are separated
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
        way = self.read_slowly if self.layout_of is None else self._read_by_layouts
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

    def _read_by_layouts(
        self, table: MessageTable, wants: list[RequestedField]
    ) -> list[FieldColumn]:
        """Layout by layout; a message of a layout that is not known goes to the library."""
        pieces: list[tuple[IntArray, list[FieldColumn]]] = []
        rest = np.arange(len(table))
        tried = 0
        while rest.size:
            for layout in self.layouts[tried:]:
                right = table.sizes[rest] == layout.size
                if right.any():
                    fits = right.copy()
                    fits[right], columns = layout.read(table.take(rest[right]))
                    pieces.append((rest[fits], columns))
                    rest = rest[~fits]
            tried = len(self.layouts)
            if rest.size:
                full = self.learned >= MOST_LEARNED
                slow = table.take(rest if full else rest[:1])
                pieces.append((rest[: len(slow)], self.read_slowly(slow, wants)))
                rest = rest[len(slow) :]
                if not full:
                    self._learn(slow, wants, pieces[-1][1])
        return [
            _assemble(len(table), [(rows, columns[k]) for rows, columns in pieces])
            for k in range(len(wants))
        ]

    def _learn(
        self, one: MessageTable, wants: list[RequestedField], truth: list[FieldColumn]
    ) -> None:
        """Adds the layout of a message of which the library gave `truth`, if it gives that too."""
        assert self.layout_of is not None
        self.learned += 1
        try:
            layout = self.layout_of(one.messages()[0], wants)
        except ValueError:
            return
        same = [
            np.array_equal(own.values, its.values, equal_nan=True)
            and (own.lengths is None) == (its.lengths is None)
            for own, its in zip(layout.read(one)[1], truth, strict=True)
        ]
        if all(same):
            self.layouts.append(layout)


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


def _decoder(
    encoding: str, schema: Any
) -> tuple[Callable[[bytes], Any], LayoutMaker | None] | None:
    """(decoder of one message, maker of layouts) of an encoding; None for one that is not known."""
    if encoding == "json":
        return json.loads, None
    if encoding == "protobuf":
        from mcap_protobuf.decoder import DecoderFactory as ProtobufFactory

        decode = ProtobufFactory().decoder_for(encoding, schema)
        return (decode, None) if decode else None
    if encoding != "cdr":
        return None
    from mcap_ros2.decoder import DecoderFactory as Ros2Factory

    with redirect_stderr(StringIO()):  # its parser writes there before it raises
        decode = Ros2Factory().decoder_for(encoding, schema)
    if decode is None:
        return None
    root, definitions = parse_definitions(schema.name, schema.data.decode())

    def decode_bounded(data: bytes) -> Any:
        if not is_bounded(data, root, definitions):
            raise ValueError(f"more than {MOST_PARTS} structures")
        return decode(data)

    def layout_of(data: bytes, wants: list[RequestedField]) -> CdrLayout:
        return CdrLayout(data, root, definitions, wants)

    return decode_bounded, layout_of
