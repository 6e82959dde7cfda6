"""Messages of one MCAP channel to numbers, by the paths that a setup names.

messages, wants --library, message by message--> FieldColumn per want: `values` flat float64,
                                                 `lengths` (n,) if a message holds a batch
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stderr
from io import StringIO
from typing import Any

import numpy as np

from tirelog.errors import ReadError, nearest
from tirelog.readers.mcap.fields import FieldColumn, FieldError, RequestedField, extract
from tirelog.readers.mcap.records import Message
from tirelog.vocabulary.arrays import FloatArray

#: bytes of one message: eight seconds of 64 channels at 1 kHz.  A library's decoder makes 30 times
#: as much of lists in lists, and 120 times of lists of structures of a byte
LARGEST_MESSAGE_BYTES = 1 << 22
#: what a decoder raises on a damaged or foreign message
DECODE_ERRORS = (Exception,)  # three libraries, each with a tree of its own


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
        self.decode = decoder

    def _add_fault(self, what: str) -> None:
        if what in self.faults or len(self.faults) < 100:  # no more kinds are separated
            self.faults[what] += 1

    def message(self, data: bytes) -> Any:
        """One decoded message.  FieldError if it does not decode, or is too large for that."""
        if len(data) > LARGEST_MESSAGE_BYTES:
            raise FieldError(
                f"larger than {LARGEST_MESSAGE_BYTES >> 20} MB; record fewer samples per message"
            )
        try:
            return self.decode(data)
        except DECODE_ERRORS as problem:
            raise FieldError(f"does not decode ({type(problem).__name__})") from None

    def read(self, messages: list[Message], wants: list[RequestedField]) -> list[FieldColumn]:
        """A column per want.

        What gives no number is NaN (one number per message) or an empty batch.
        """
        found: list[list[Any]] = [[] for _ in wants]
        for _, data in messages:
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


def _decoder(encoding: str, schema: Any) -> Callable[[bytes], Any] | None:
    """What decodes a message of an encoding; None for one that is not known."""
    if encoding == "json":
        return json.loads
    if encoding == "protobuf":
        from mcap_protobuf.decoder import DecoderFactory as ProtobufFactory

        return ProtobufFactory().decoder_for(encoding, schema)
    if encoding != "cdr":
        return None
    from mcap_ros2.decoder import DecoderFactory as Ros2Factory

    with redirect_stderr(StringIO()):  # its parser writes there before it raises
        return Ros2Factory().decoder_for(encoding, schema)
