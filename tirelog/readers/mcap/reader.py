"""MCAP logs from a path or a stream that cannot seek, in one pass.

    stream --records--> chunks of messages by channel --decode--> numbers
        --Topic: batches or single samples, stamps--> samples of each group, in order --> RawBlock

Groups have to be known before the first block: chunks are read ahead until every topic of the setup
has shown its first message, or READ_AHEAD_BYTES have been read. Channels of one topic with batches
of one length form a group. Topics that the setup does not name are never decoded, so nothing
foreign can stop the reading.

The time of a sample is the message's `header.stamp` (or the field that [log] time names) if it
has one, else its log time. Of a batch it is the time of its first sample.
"""

from __future__ import annotations

import re
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from mcap.exceptions import McapError

from tirelog.data.setup import Setup
from tirelog.errors import ReadError, SetupError, nearest
from tirelog.readers.base import (
    MOST_SERIES,
    RATES,
    Group,
    RawBlock,
    ReadReport,
    Series,
    SeriesList,
    date_of,
    long_form,
    rate_Hz,
    signals_of,
    unit_in_source,
    with_stated_units,
)
from tirelog.readers.mcap.decode import LARGEST_MESSAGE_BYTES, ChannelDecoder, spread
from tirelog.readers.mcap.fields import (
    FIELD,
    FieldColumn,
    FieldError,
    RequestedField,
    extract,
    field_names,
    field_of,
    is_list,
    parse_path,
    topic_and_field,
)
from tirelog.readers.mcap.records import RECORD_ERRORS, MessageTable, OrderedGroup, Records
from tirelog.vocabulary import units
from tirelog.vocabulary.arrays import FloatArray, IntArray

# ---- One topic that the setup names.
#
# Its first message tells what its channels are, the others give samples.


#: pairs of fields (seconds, nanoseconds) that hold a stamp, in the order in which they are looked
#: for
STAMPS = tuple(
    (f"{where}.{seconds}", f"{where}.{nanoseconds}")
    for where in ("header.stamp", "stamp", "timestamp", "header.timestamp")
    for seconds, nanoseconds in (
        ("sec", "nanosec"),
        ("sec", "nsec"),
        ("secs", "nsecs"),
        ("seconds", "nanos"),
    )
)
#: header stamps that are further than this from the log time count from an origin of their own
ONE_CLOCK_NS = 3_600_000_000_000


class Topic:
    """The channels of one topic."""

    def __init__(
        self, name: str, wants: Mapping[str, RequestedField], setup: Setup, report: ReadReport
    ) -> None:
        self.name, self.setup, self.report = name, setup, report
        self.wants = dict(wants)
        self.groups: list[OrderedGroup] = []
        self.stamps: list[tuple[RequestedField, float]] = []  # with ns per unit of each
        self.shift_ns = 0  # from the stamps to the log's clock
        self.started = False

    def assume(self, used: int) -> None:
        """Sets groups for a topic whose first message is still to come.

        One per channel, which fits whatever comes.
        """
        self.groups = [self._group([name], used + k, None) for k, name in enumerate(self.wants)]

    def start(self, message: Any, log_time_ns: int, metadata: Mapping[str, str], used: int) -> None:
        """Learn from the first message; `used` groups have names already.

        Channels that it does not hold are losses.
        """
        self.started = True
        kinds: dict[str, Any] = {}
        for name, want in list(self.wants.items()):
            if want.path in field_names(message):  # though it may look like an index or a path
                want = self.wants[name] = RequestedField(want.path, (want.path,))
            try:
                value = extract(message, want.tokens)
            except FieldError as problem:
                near = _near(problem, message)
                if want.tokens == (want.path,) and not want.path.isidentifier():
                    near += "; allowed are names, [3], [3::16] and [:]"
                self.report.losses.append(
                    f"channel {name}: {self.name}:{want.path} {problem}{near}; mend source"
                )
                del self.wants[name]
                continue
            batch = isinstance(value, np.ndarray)
            kinds[name] = value.size if isinstance(value, np.ndarray) else None
            if batch and not any(isinstance(token, slice) for token in want.tokens):
                self.wants[name] = RequestedField(want.path, (*want.tokens, slice(None)))
        self.stamps = self._stamp_fields(message)
        if self.stamps:
            values = [np.atleast_1d(extract(message, want.tokens)) for want, _ in self.stamps]
            ahead = log_time_ns - int(self._ns(values)[0])
            if abs(ahead) >= ONE_CLOCK_NS:
                self.shift_ns = ahead
                self.report.remarks.append(
                    f"topic {self.name}: its stamps count from another origin; its first is taken "
                    "to be at its log time"
                )
        rate = self._rate(message, metadata)
        members: dict[Any, list[str]] = {}
        for name, kind in kinds.items():
            members.setdefault((kind, self.setup.channels[name].sampling_rate_Hz), []).append(name)
        if self.groups:
            for group in self.groups:
                group.period_s = self._period_s(group.group.channels, rate)
        else:
            self.groups = [
                self._group(names, used + k, rate) for k, names in enumerate(members.values())
            ]
        for group in self.groups:
            group.batched = kinds.get(group.group.channels[0]) is not None

    def _group(self, names: list[str], number: int, rate: float | None) -> OrderedGroup:
        group = Group(f"clock_{number + 1}", tuple(names), rate_Hz=rate)
        return OrderedGroup(group, self._period_s(group.channels, rate))

    def _period_s(self, names: Sequence[str], rate: float | None) -> float | None:
        """The period of a batch's samples [s] by the setup, or by the rate that the log states."""
        setup = self.setup
        own = setup.channels[names[0]].sampling_rate_Hz or setup.log.sampling_rate_Hz or rate
        return 1.0 / own if own else None

    def _rate(self, message: Any, metadata: Mapping[str, str]) -> float | None:
        """The sampling rate [Hz] that a field of the message, or the channel's metadata, states."""
        for name, is_period in RATES.items():
            try:
                value = (
                    extract(message, (name,))
                    if name in field_names(message)
                    else float(metadata.get(name, "nan"))
                )
            except ValueError:
                continue
            if isinstance(value, float) and (rate := rate_Hz(value, is_period)) is not None:
                return rate
        return None

    def _stamp_fields(self, message: Any) -> list[tuple[RequestedField, float]]:
        """The fields that hold this topic's stamp, with [ns] per unit of each."""
        named = self.setup.log.time
        if named:
            path = named.split(":", 1)[1] if named.startswith(f"{self.name}:") else named
            try:
                want = parse_path(path)
                extract(message, want.tokens)
                factor, _ = units.to_si(self.setup.log.time_unit or "s", "time")
            except (FieldError, ReadError, SetupError) as problem:
                self.report.remarks.append(
                    f"topic {self.name}: no stamp at [log] time = {named!r} ({problem}); "
                    "the log time is used"
                )
                return []
            return [(want, factor * 1e9)]
        for pair in STAMPS:
            wants = [parse_path(path) for path in pair]
            try:
                values = [extract(message, want.tokens) for want in wants]
            except FieldError:
                continue
            # a stamp of zero was never set
            if any(values) and not any(isinstance(v, np.ndarray) for v in values):
                return list(zip(wants, (1e9, 1.0), strict=True))
        return []

    def _ns(self, numbers: list[FloatArray]) -> IntArray:
        """Whole nanoseconds of stamps; seconds and nanoseconds are added as integers."""
        total = np.zeros(numbers[0].size, np.int64)
        for values, (_, factor) in zip(numbers, self.stamps, strict=True):
            whole = np.floor(values)
            most = 9e9 if factor == 1e9 else 9e18 / factor
            total += np.clip(whole, -most, most).astype(np.int64) * round(factor)
            total += np.rint((values - whole) * factor).astype(np.int64)
        return total

    def feed(self, table: MessageTable, decoder: ChannelDecoder) -> None:
        """Decode the messages of a chunk and add their samples to the groups."""
        channels = list(self.wants)
        at = 0
        wants = [*self.wants.values(), *(want for want, _ in self.stamps)]
        for columns in decoder.read(table, wants):
            size = columns[0].sizes.size if columns else 0
            keys = table.log_time_ns[at : at + size]
            at += size
            stamps = self._stamps(columns[len(channels) :], keys)
            by_name = dict(zip(channels, columns, strict=False))
            for group in self.groups:
                present = [by_name.get(name) for name in group.group.channels]
                if any(column is not None for column in present):
                    group.add(*self._samples(group, present, keys, stamps))

    def _stamps(self, columns: list[FieldColumn], keys: IntArray) -> IntArray:
        """The messages' stamps [ns] on the log's clock; the log time if a message has none."""
        if not columns:
            return keys
        numbers = [column.values for column in columns]
        if any(values.size != keys.size for values in numbers):
            return keys
        lost = np.any([~np.isfinite(values) for values in numbers], axis=0)
        stamps = self._ns([np.where(lost, 0.0, values) for values in numbers]) + self.shift_ns
        return np.where(lost, keys, stamps)

    def _samples(
        self,
        group: OrderedGroup,
        columns: list[FieldColumn | None],
        keys: IntArray,
        stamps: IntArray,
    ) -> tuple[IntArray, IntArray, IntArray, FloatArray]:
        """keys, stamps, within, values of every sample.

        Batches of unlike length are filled up with NaN.
        """
        none = np.zeros(keys.size, np.int64)
        sizes = [none if column is None else column.sizes for column in columns]
        lengths = np.max(sizes, axis=0)
        values = np.full((int(lengths.sum()), len(columns)), np.nan)
        starts = np.cumsum(lengths) - lengths
        for k, (column, own) in enumerate(zip(columns, sizes, strict=True)):
            if column is None:
                continue
            if np.array_equal(own, lengths):
                values[:, k] = column.values
            else:
                values[spread(starts, own), k] = column.values
        group.batched |= values.shape[0] != keys.size  # though single samples were expected
        within = spread(none, lengths) if group.batched else none
        return np.repeat(keys, lengths), np.repeat(stamps, lengths), within, values


def _near(problem: FieldError, message: Any) -> str:
    known = problem.known or field_names(message)
    near = nearest(problem.name, known) if problem.name else ""
    return f"{near}; it has {', '.join(known[:20])}" if problem.name and known else ""


def _several_signals(decoder: ChannelDecoder, table: MessageTable, message: Any) -> str:
    """What is wrong with a topic that has some signals in turn, by a name in each message, or ''.

    `message` is one of its first, which are in the `table`.
    """
    names = field_names(message)
    of_type = {str: "text", int: "number", float: "number"}
    kinds = [of_type.get(type(field_of(message, name)), "other") for name in names]

    def cells(number: int) -> list[str]:
        found = []
        # as many as show signals in turn, of up to thirty
        for data in table.take(slice(0, 200)).messages():
            with suppress(FieldError, KeyError):
                found.append(str(field_of(decoder.message(data), names[number])))
        return found

    column, signals = signals_of(names, kinds, cells)
    return long_form(signals, names[column]).message if signals else ""


# ---- A log.


#: bytes of chunks that are held until every topic of the setup has begun; twice as many take twice
#: the memory if a topic comes late or never
READ_AHEAD_BYTES = 1 << 23


class McapLog:
    """An open MCAP log (see `tirelog.readers.base.LogReader`); `log_name` is its name in messages.

    `path` is the file that the stream reads, if there is one: from its end come the definitions
    that a damaged chunk took away. ReadError if nothing in it can be read.
    """

    def __init__(
        self, stream: BinaryIO, setup: Setup, log_name: str, path: Path | None = None
    ) -> None:
        self.report = ReadReport(format="mcap")
        self.setup, self.log_name, self.path = setup, log_name, path
        self.topics = self._topics()
        self.records = Records(stream, self.report, log_name)
        self.decoders: dict[int, ChannelDecoder | None] = {}
        self.undecodable: set[str] = set()  # topics of which that was reported
        self.unknown: dict[int, int] = {}
        self.origin_ns: int | None = None
        self.samples = 0
        self.source = self.records.chunks()
        self.ahead: deque[dict[int, MessageTable]] = deque()
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
        units_of = {name: unit_in_source(one.source) for name, one in self.setup.channels.items()}
        stated = {name: unit for name, unit in units_of.items() if unit}
        self.setup, said = with_stated_units(self.setup, stated)
        self.report.remarks += said
        return {
            topic: Topic(topic, fields, self.setup, self.report) for topic, fields in wants.items()
        }

    def _read_ahead(self) -> None:
        """Chunks up to the one in which the last topic begins; then the groups of all topics."""
        size = 0
        while size < READ_AHEAD_BYTES and not all(topic.started for topic in self.topics.values()):
            tables, bytes_ = next(self.source, (None, 0))
            if tables is None:  # the end of the file has repeated definitions that damage took
                for earlier in self.ahead if self.unknown else ():
                    self._start_topics(earlier)
                break
            self.ahead.append(tables)
            size += bytes_
            self._start_topics(tables)
        if size >= READ_AHEAD_BYTES:
            for topic in self.topics.values():
                if not topic.started:
                    topic.assume(self._group_count())
        if not any(topic.groups for topic in self.topics.values()):
            self._missing()
            raise ReadError("; ".join(self.report.losses), file=self.log_name)

    def _start_topics(self, tables: dict[int, MessageTable]) -> None:
        for topic, decoder, table in self._messages(tables, count=False):
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
            if signals := _several_signals(decoder, table, message):
                self.report.losses.append(f"topic {topic.name!r}: {signals}")
                topic.wants.clear()
            metadata = next(
                (c.metadata for c in self.records.channels.values() if c.topic == topic.name), {}
            )
            topic.start(message, int(table.log_time_ns[row]), metadata, self._group_count())
            return

    def _messages(
        self, tables: dict[int, MessageTable], *, count: bool = True
    ) -> Iterator[tuple[Topic, ChannelDecoder, MessageTable]]:
        """The messages of the topics wanted; a topic that was not met before starts with them."""
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
        while self._feed_chunk():
            if any(group.full for topic in self.topics.values() for group in topic.groups):
                yield from self._emit(everything=False)
        yield from self._emit(everything=True)
        self._finish()

    def _feed_chunk(self) -> bool:
        """Feed the next chunk to its topics, and let go of it; False at the end of the log."""
        tables = self.ahead.popleft() if self.ahead else next(self.source, (None, 0))[0]
        if tables is None:
            return False
        for topic, decoder, table in self._messages(tables):
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
            if self.origin_ns is not None:
                self.report.start = date_of(self.origin_ns, "ns")
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
        """Add a loss for each topic of the setup that the log does not have."""
        known = sorted({channel.topic for channel in self.records.channels.values()})
        for topic in self.topics.values():
            if topic.started or topic.name in self.undecodable:
                continue
            names = ", ".join(topic.wants)
            has = f"; the log has {', '.join(known[:20])}" if known else ""
            state = f"is not in the log{nearest(topic.name, known)}"
            if topic.name in known:
                state = f"has no message of at most {LARGEST_MESSAGE_BYTES >> 20} MB that decodes"
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
        for tables, bytes_ in records.chunks():
            size += bytes_
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
    if signals := _several_signals(decoder, some, message):
        raise ReadError(f"topic {topic!r}: {signals}")
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
        for name in field_names(value):
            own = name.isidentifier() or (not path and re.fullmatch(rf"(?! ){FIELD}(?<! )", name))
            if name.lower() not in _BESIDE and own:
                below = f"{path}.{name}" if path else name
                yield from _numbers(field_of(value, name), below, depth + 1)
    elif (
        is_list(value) and len(value) and all(isinstance(x, bool | int | float) for x in value[:4])
    ):
        if len(value) > _MOST_SIDE_BY_SIDE:
            yield path, f"{len(value)} samples per message"
        else:
            for k in range(len(value)):
                yield f"{path}[{k}]", f"one of {len(value)} numbers per message"
