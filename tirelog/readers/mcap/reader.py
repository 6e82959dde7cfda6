"""MCAP logs from a path or a stream that cannot seek, in one pass.

    stream --records--> chunks --walk--> messages by channel --decode--> numbers
        --topic, order--> RawBlock

Groups have to be known before the first block: chunks are read ahead until every topic of the setup
has shown its first message, or READ_AHEAD_BYTES have been read. Channels of one topic with batches
of one length form a group. Topics that the setup does not name are never decoded, so nothing
foreign can stop the reading.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO

from mcap.exceptions import McapError

from tirelog.data.setup import Setup
from tirelog.errors import ReadError, nearest
from tirelog.readers.base import MOST_SERIES, Group, RawBlock, ReadReport, Series, SeriesList
from tirelog.readers.mcap.decode import LARGEST_MESSAGE_BYTES, ChannelDecoder
from tirelog.readers.mcap.records import (
    RECORD_ERRORS,
    MessageTable,
    RecordChunk,
    Records,
    split_pieces,
)
from tirelog.readers.mcap.source import (
    FieldError,
    RequestedField,
    field_names,
    is_list,
    parse_path,
    topic_and_field,
)
from tirelog.readers.mcap.topic import Topic

#: bytes of chunks that are held until every topic of the setup has begun; twice as many take twice
#: the memory if a topic comes late or never
READ_AHEAD_BYTES = 1 << 23
#: stamps beyond this [ns since 1970] are dates: 1990; smaller ones count from some start
EARLIEST_DATE_NS = 631_152_000_000_000_000


def open_mcap(
    source: Path | str | BinaryIO, setup: Setup, log_name: str, path: Path | None = None
) -> McapLog:
    """The log in a file or a stream; `log_name` is its name in messages.

    `path` is the file that a stream reads, if there is one: from its end come the definitions
    that a damaged chunk took away. ReadError if nothing in it can be read.
    """
    if isinstance(source, Path | str):
        try:
            stream = open(source, "rb")  # noqa: SIM115  # closed with its last block
            try:
                log = McapLog(stream, setup, log_name, Path(source))
            except BaseException:
                stream.close()
                raise
        except OSError as problem:
            raise ReadError(
                f"cannot be opened ({problem.strerror})",
                allowed="a log is a readable file",
                do="mend the path",
                file=log_name,
            ) from None
        log.owned = stream
        return log
    return McapLog(source, setup, log_name, path)


class McapLog:
    """An open MCAP log (see `tirelog.readers.base.LogReader`)."""

    def __init__(self, stream: BinaryIO, setup: Setup, log_name: str, path: Path | None) -> None:
        self.report = ReadReport(format="mcap")
        self.setup, self.log_name, self.path = setup, log_name, path
        self.topics = self._topics()
        self.records = Records(stream, self.report, log_name)
        self.decoders: dict[int, ChannelDecoder | None] = {}
        self.owned: BinaryIO | None = None  # a file to close at the end: it was opened here
        self.undecodable: set[str] = set()  # topics of which that was said
        self.unknown: dict[int, int] = {}
        self.origin_ns: int | None = None
        self.samples = 0
        self.source = self.records.chunks()
        self.ahead: deque[RecordChunk] = deque()
        self._read_ahead()
        self.groups: tuple[Group, ...] = tuple(
            group.group for topic in self.topics.values() for group in topic.groups
        )

    def _topics(self) -> dict[str, Topic]:
        wants: dict[str, dict[str, RequestedField]] = {}
        for name, channel in self.setup.channels.items():
            try:
                topic, field = topic_and_field(channel.source)
                wants.setdefault(topic, {})[name] = parse_path(field)
            except ReadError as problem:
                self.report.losses.append(f"channel {name}: {problem.message}")
        if not wants:
            raise ReadError("; ".join(self.report.losses), file=self.log_name)
        return {
            topic: Topic(topic, fields, self.setup, self.report) for topic, fields in wants.items()
        }

    def _read_ahead(self) -> None:
        """Chunks up to the one in which the last topic begins; then the groups of all topics."""
        size = 0
        while size < READ_AHEAD_BYTES and not all(topic.started for topic in self.topics.values()):
            chunk = next(self.source, None)
            if chunk is None:  # the end of the file has repeated definitions that damage took away
                for earlier in self.ahead if self.unknown else ():
                    self._start_topics(earlier)
                break
            self.ahead.append(chunk)
            size += len(chunk.data)
            self._start_topics(chunk)
        if size >= READ_AHEAD_BYTES:
            for topic in self.topics.values():
                if not topic.started:
                    topic.assume(self._group_count())
        if not any(topic.groups for topic in self.topics.values()):
            self._missing()
            raise ReadError("; ".join(self.report.losses), file=self.log_name)

    def _start_topics(self, chunk: RecordChunk) -> None:
        for topic, decoder, table in self._messages(chunk, count=False):
            if not topic.started:
                self._start(topic, decoder, table)

    def _group_count(self) -> int:
        return sum(len(topic.groups) for topic in self.topics.values())

    def _start(self, topic: Topic, decoder: ChannelDecoder, table: MessageTable) -> None:
        """Learn what a topic holds from the first of its messages that decodes."""
        for row in range(min(len(table), 100)):
            try:
                message = decoder.message(table.take(slice(row, row + 1)).messages()[0])
            except FieldError:
                continue
            metadata = next(
                (c.metadata for c in self.records.channels.values() if c.topic == topic.name), {}
            )
            decimal = (
                decoder.some(table.take(slice(row, row + 100)))
                if decoder.encoding == "json"
                else []
            )
            topic.start(
                message, int(table.log_time_ns[row]), metadata, self._group_count(), decimal
            )
            self.report.losses += [
                f"channel {name}: {what}; mend source" for name, what in topic.failed.items()
            ]
            return

    def _messages(
        self, chunk: RecordChunk, *, count: bool = True
    ) -> Iterator[tuple[Topic, ChannelDecoder, MessageTable]]:
        """The messages of the topics wanted; a topic that was not met before starts with them."""
        tables, definitions, rest = split_pieces(chunk.data)
        for opcode, body in definitions:
            try:
                self.records.define(opcode, body)
            except RECORD_ERRORS as problem:
                self.records.lose(
                    f"a definition in the chunk at byte {chunk.offset} cannot be used "
                    f"({problem}); copy the log again"
                )
        if rest and count:
            self.records.lose(
                f"{rest} bytes at the end of the chunk at byte {chunk.offset} are no whole "
                "record; copy the log again"
            )
        for number, table in tables.items():
            if number not in self.records.channels:
                self._definitions_from_the_end()
            if number not in self.records.channels:
                self.unknown[number] = self.unknown.get(number, 0) + (len(table) if count else 0)
                continue
            topic = self.topics.get(self.records.channels[number].topic)
            decoder = self._decoder(number) if topic is not None else None
            if topic is not None and decoder is not None:
                yield topic, decoder, decoder.of_bounded_size(table, count=count)

    def _decoder(self, number: int) -> ChannelDecoder | None:
        if number not in self.decoders:
            channel = self.records.channels[number]
            schema = self.records.schemas.get(channel.schema_id)
            try:
                self.decoders[number] = ChannelDecoder(
                    channel.topic, channel.message_encoding, schema
                )
            except ReadError as problem:
                self.report.losses.append(problem.message)
                self.undecodable.add(channel.topic)
                self.decoders[number] = None
        return self.decoders[number]

    def _definitions_from_the_end(self) -> None:
        """Channels and schemas that the summary at the end of the file repeats, once."""
        if self.path is None:
            return
        path, self.path = self.path, None
        try:
            with path.open("rb") as stream:
                from mcap.reader import SeekingReader

                summary = SeekingReader(stream, record_size_limit=READ_AHEAD_BYTES).get_summary()
        except (OSError, McapError, *RECORD_ERRORS):
            return
        if summary is not None:
            self.records.schemas = {**summary.schemas, **self.records.schemas}
            self.records.channels = {**summary.channels, **self.records.channels}

    def blocks(self) -> Iterator[RawBlock]:
        """Blocks of every group, in the order of log time within each."""
        try:
            while self._feed_chunk():
                if any(group.full for topic in self.topics.values() for group in topic.groups):
                    yield from self._emit(everything=False)
            yield from self._emit(everything=True)
            self._finish()
        finally:
            if self.owned is not None:
                self.owned.close()

    def _feed_chunk(self) -> bool:
        """Feed the next chunk to its topics, and let go of it; False at the end of the log."""
        chunk = self.ahead.popleft() if self.ahead else next(self.source, None)
        if chunk is None:
            return False
        for topic, decoder, table in self._messages(chunk):
            if not topic.started:
                self._start(topic, decoder, table)
            if topic.started:
                topic.feed(table, decoder)
        return True

    def _emit(self, *, everything: bool) -> Iterator[RawBlock]:
        groups = [group for topic in self.topics.values() for group in topic.groups]
        if self.origin_ns is None:
            self.origin_ns = min(
                (first for group in groups if (first := group.first_stamp()) is not None),
                default=None,
            )
            if self.origin_ns is not None and self.origin_ns > EARLIEST_DATE_NS:
                self.report.start = datetime.fromtimestamp(self.origin_ns / 1e9, UTC).isoformat()
        for group in groups:
            if self.origin_ns is not None and (everything or group.full):
                for block in group.blocks(self.origin_ns, everything=everything):
                    self.samples += next(iter(block.values.values())).size
                    yield block

    def _finish(self) -> None:
        """What only the end of the log tells."""
        for topic in self.topics.values():
            refused = sum(group.refused for group in topic.groups)
            if refused:
                self.report.counts["messages_out_of_order"] = (
                    self.report.counts.get("messages_out_of_order", 0) + refused
                )
                self.report.losses.append(
                    f"topic {topic.name}: {refused} samples came too late to be put in order and "
                    "are left out"
                )
        for decoder in filter(None, self.decoders.values()):
            for what, count in decoder.faults.items():
                self.report.losses.append(f"{count} messages of {decoder.topic}: {what}")
        if total := sum(self.unknown.values()):
            self.report.losses.append(
                f"{total} messages belong to channels whose definition is lost; copy the log again"
            )
        self._missing()
        if not self.samples:
            raise ReadError(
                "; ".join(self.report.losses) or "holds no samples; record it again",
                file=self.log_name,
            )

    def _missing(self) -> None:
        """Say which topics of the setup the log does not have."""
        known = sorted({channel.topic for channel in self.records.channels.values()})
        for topic in self.topics.values():
            if topic.started or topic.name in self.undecodable:
                continue
            names = ", ".join(topic.wants)
            has = f"; the log has {', '.join(known[:20])}" if known else ""
            large = any(
                decoder.refused_size
                for decoder in self.decoders.values()
                if decoder and decoder.topic == topic.name
            )
            decodes = (
                "has no message that "
                f"decodes{f' and is at most {LARGEST_MESSAGE_BYTES >> 20} MB' if large else ''}"
            )
            state = (
                decodes if topic.name in known else f"is not in the log{nearest(topic.name, known)}"
            )
            self.report.losses.append(
                f"channel {names}: topic {topic.name!r} {state}{has}; mend source"
            )


# ---- The numbers in the messages of an MCAP log, by the first message of each topic.


#: bytes of chunks in which topics are looked for, and fields of one message that are listed
_MOST_BYTES, _MOST_FIELDS, _MOST_DEPTH = 1 << 24, 64, 4
#: a list of so many numbers is taken for sensors side by side; a longer one for samples in a row
_MOST_SIDE_BY_SIDE = 16
#: fields that tell times or how a list is laid out
_BESIDE = {"header", "stamp", "timestamp", "layout", "sec", "nanosec", "nsec"}


def fields(path: Path, log: str) -> SeriesList:
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
    return SeriesList(tuple(found[:MOST_SERIES]), "the messages' stamps", others, why)


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
