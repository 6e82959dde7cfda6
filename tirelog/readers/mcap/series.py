"""The numbers in the messages of an MCAP log, by the first message of each topic."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tirelog.errors import ReadError
from tirelog.readers.base import ReadReport
from tirelog.readers.mcap.decode import ChannelDecoder
from tirelog.readers.mcap.records import RECORD_ERRORS, Records
from tirelog.readers.mcap.source import FieldError, field_names, is_list
from tirelog.readers.mcap.walk import split_pieces
from tirelog.readers.series import MOST_SERIES, Listed, Series

#: bytes of chunks in which topics are looked for, and fields of one message that are listed
_MOST_BYTES, _MOST_FIELDS, _MOST_DEPTH = 1 << 24, 64, 4
#: a list of so many numbers is taken for sensors side by side; a longer one for samples in a row
_MOST_SIDE_BY_SIDE = 16
#: fields that tell times or how a list is laid out
_BESIDE = {"header", "stamp", "timestamp", "layout", "sec", "nanosec", "nsec"}


def fields(path: Path, log: str) -> Listed:
    """Numbers of the messages, topic by topic.  ReadError: not to be read."""
    series: dict[str, list[Series]] = {}
    unread: dict[str, str] = {}
    size = 0
    with path.open("rb") as stream:
        records = Records(stream, ReadReport(), log)
        for chunk in records.chunks():
            size += len(chunk.data)
            tables, definitions, _ = split_pieces(chunk.data)
            for opcode, body in definitions:
                try:
                    records.define(opcode, body)
                except RECORD_ERRORS:
                    continue
            for number, table in tables.items():
                channel = records.channels.get(number)
                if channel is None or channel.topic in series or not len(table):
                    continue
                schema = records.schemas.get(channel.schema_id)
                try:
                    series[channel.topic] = _of_topic(
                        channel.topic, channel.message_encoding, schema, table
                    )
                except ReadError as problem:
                    series[channel.topic], unread[channel.topic] = [], problem.message
            if size > _MOST_BYTES:
                break
    found = [one for topic in sorted(series) for one in series[topic]]
    others = tuple(topic for topic in sorted(series) if not series[topic] and topic not in unread)
    why = tuple(unread[topic] for topic in sorted(unread))
    return Listed(tuple(found[:MOST_SERIES]), "the messages' stamps", others, why)


def _of_topic(topic: str, encoding: str, schema: Any, table: Any) -> list[Series]:
    """What the topic's first message holds.  ReadError: it does not decode."""
    decoder = ChannelDecoder(topic, encoding, schema)
    some = decoder.of_bounded_size(table, count=False)
    if not len(some):
        return []
    try:
        message = decoder.message(some.take(slice(0, 1)).messages()[0])
    except FieldError as problem:
        raise ReadError(f"topic {topic!r}: its first message {problem}") from None
    return [
        Series(f"{topic}:{path}", note=note)
        for (path, note), _ in zip(_numbers(message, "", 0), range(_MOST_FIELDS), strict=False)
    ]


def _numbers(value: Any, path: str, depth: int) -> Iterator[tuple[str, str]]:
    """(path, note) of each number in a message."""
    if isinstance(value, bool | int | float):
        yield path, ""
    elif isinstance(value, str | bytes) or value is None or depth > _MOST_DEPTH:
        return
    elif isinstance(value, dict) or field_names(value):
        names = tuple(map(str, value)) if isinstance(value, dict) else field_names(value)
        for name in names:
            if name.lower() not in _BESIDE and name.isidentifier():
                below = value[name] if isinstance(value, dict) else getattr(value, name)
                yield from _numbers(below, f"{path}.{name}" if path else name, depth + 1)
    elif (
        is_list(value) and len(value) and all(isinstance(x, bool | int | float) for x in value[:4])
    ):
        if len(value) > _MOST_SIDE_BY_SIDE:
            yield path, f"{len(value)} samples per message"
        else:
            for k in range(len(value)):
                yield f"{path}[{k}]", f"one of {len(value)} numbers per message"
