"""One topic of an MCAP log that the setup names.

Its first message tells what its channels are, the others give samples.

    first message --> batches or single samples, which field holds the stamp, the rate --> groups
    Table, decoder --> Columns --> samples of each group (`order`)

The time of a sample is the message's `header.stamp` (or the field that [log] time names) if it
has one, else its log time. Of a batch it is the time of its first sample.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from types import MappingProxyType
from typing import Any

import numpy as np

from tirelog.data.setup import Setup
from tirelog.errors import ReadError, SetupError, nearest
from tirelog.readers.base import RATES, Group, ReadReport, rate_Hz
from tirelog.readers.mcap.decode import ChannelDecoder, spread
from tirelog.readers.mcap.records import MessageTable, OrderedGroup
from tirelog.readers.mcap.source import (
    FieldColumn,
    FieldError,
    RequestedField,
    extract,
    field_names,
    parse_path,
)
from tirelog.vocabulary import units
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.kinds import WAVELENGTH_KINDS

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
#: more decimals than this are the digits of a binary number
MOST_DECIMALS = 9


@dataclass(frozen=True)
class _Stamp:
    """Which fields hold the stamp, and how they are read.

    [ns] per unit of each, and what to add to get to the log's clock.
    """

    wants: list[RequestedField]
    factors: list[float]
    shift_ns: int = 0


class Topic:
    """The channels of one topic."""

    def __init__(
        self, name: str, wants: Mapping[str, RequestedField], setup: Setup, report: ReadReport
    ) -> None:
        self.name, self.setup, self.report = name, setup, report
        self.wants = dict(wants)
        self.groups: list[OrderedGroup] = []
        self.stamp = _Stamp([], [])
        self.started = False
        self.failed: dict[str, str] = {}

    def assume(self, used: int) -> None:
        """Sets groups for a topic whose first message is still to come.

        One per channel, which fits whatever comes.
        """
        self.groups = [self._group([name], used + k, None) for k, name in enumerate(self.wants)]

    def start(
        self,
        message: Any,
        log_time_ns: int,
        metadata: Mapping[str, str],
        used: int,
        decimal: Sequence[Any] = (),
    ) -> None:
        """Learn from the first message; `used` groups have names already.

        Channels that it does not hold go to `failed`.

        `decimal` are some first messages of a text encoding, by which the decimals of its numbers
        are told.
        """
        self.started = True
        kinds: dict[str, Any] = {}
        for name, want in list(self.wants.items()):
            try:
                value = extract(message, want.tokens)
            except FieldError as problem:
                self.failed[name] = f"{self.name}:{want.path} {problem}{_near(problem, message)}"
                del self.wants[name]
                continue
            batch = isinstance(value, np.ndarray)
            kinds[name] = value.size if isinstance(value, np.ndarray) else None
            if batch and not any(isinstance(token, slice) for token in want.tokens):
                self.wants[name] = RequestedField(want.path, (*want.tokens, slice(None)))
        self.stamp = self._stamp(message, log_time_ns)
        rate = self._rate(message, metadata)
        members: dict[Any, list[str]] = {}
        for name, kind in kinds.items():
            members.setdefault((kind, self.setup.channels[name].sampling_rate_Hz), []).append(name)
        if self.groups:
            self.groups = [
                self._group(list(g.group.channels), 0, rate, g.group) for g in self.groups
            ]
        else:
            places = {name: decimals_of(decimal, self.wants[name]) for name in kinds}
            self.groups = [
                self._group(names, used + k, rate, places=places)
                for k, names in enumerate(members.values())
            ]
        for group in self.groups:
            group.batched = kinds.get(group.group.channels[0]) is not None

    def _group(
        self,
        names: list[str],
        number: int,
        rate: float | None,
        known: Group | None = None,
        places: Mapping[str, int | None] = MappingProxyType({}),
    ) -> OrderedGroup:
        """`places`: decimals of the channels, for those that are known when the group is made."""
        group = known or Group(
            f"clock_{number + 1}",
            tuple(names),
            rate_Hz=rate,
            decimals={name: places.get(name) for name in names},
        )
        own = (
            self.setup.channels[names[0]].sampling_rate_Hz
            or self.setup.log.sampling_rate_Hz
            or rate
        )
        return OrderedGroup(group, 1.0 / own if own else None)

    def _rate(self, message: Any, metadata: Mapping[str, str]) -> float | None:
        """The sampling rate [Hz] that a field of the message, or the channel's metadata, states."""
        for name, is_period in RATES.items():
            try:
                value = (
                    extract(message, (name,))
                    if name in names_of(message)
                    else float(metadata.get(name, "nan"))
                )
            except ValueError:
                continue
            if isinstance(value, float) and (rate := rate_Hz(value, is_period)) is not None:
                return rate
        return None

    def _stamp(self, message: Any, log_time_ns: int) -> _Stamp:
        """Where this topic's stamps are."""
        named = self.setup.log.time
        if named:
            path = named.split(":", 1)[1] if named.startswith(f"{self.name}:") else named
            try:
                want = parse_path(path)
                value = extract(message, want.tokens)
                factor, _ = units.to_si(self.setup.log.time_unit or "s", "time")
                found = _Stamp([want], [factor * 1e9])
            except (FieldError, ReadError, SetupError) as problem:
                self.report.remarks.append(
                    f"topic {self.name}: no stamp at [log] time = {named!r} ({problem}); "
                    "the log time is used"
                )
                return _Stamp([], [])
            return self._on_one_clock(found, [value], log_time_ns)
        for pair in STAMPS:
            wants = [parse_path(path) for path in pair]
            try:
                values = [extract(message, want.tokens) for want in wants]
            except FieldError:
                continue
            if any(isinstance(v, np.ndarray) for v in values) or not any(values):
                continue  # a stamp of zero was never set
            return self._on_one_clock(_Stamp(wants, [1e9, 1.0]), values, log_time_ns)
        return _Stamp([], [])

    def _on_one_clock(self, found: _Stamp, values: list[Any], log_time_ns: int) -> _Stamp:
        first = _stamp_ns([np.atleast_1d(v) for v in values], found.factors)
        ahead = log_time_ns - int(first[0])
        if abs(ahead) < ONE_CLOCK_NS:
            return found
        self.report.remarks.append(
            f"topic {self.name}: its stamps count from another origin; its first is taken to be "
            "at its log time"
        )
        return _Stamp(found.wants, found.factors, ahead)

    def feed(self, table: MessageTable, decoder: ChannelDecoder) -> None:
        """Decode the messages of a chunk and add their samples to the groups."""
        channels = list(self.wants)
        at = 0
        for columns in decoder.read(table, [*self.wants.values(), *self.stamp.wants]):
            size = _messages(columns[0]) if columns else 0
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
        stamps = (
            _stamp_ns([np.where(lost, 0.0, values) for values in numbers], self.stamp.factors)
            + self.stamp.shift_ns
        )
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
        sizes = [_lengths(column, keys.size) for column in columns]
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
            if self.setup.channels[group.group.channels[k]].kind in WAVELENGTH_KINDS:
                values[~(values[:, k] > 0.0), k] = np.nan
        group.batched |= values.shape[0] != keys.size  # though single samples were expected
        within = np.zeros(keys.size, np.int64)
        if group.batched:
            within = spread(within, lengths)
        return np.repeat(keys, lengths), np.repeat(stamps, lengths), within, values


def _messages(column: FieldColumn) -> int:
    return int(column.values.size if column.lengths is None else column.lengths.size)


def _lengths(column: FieldColumn | None, n: int) -> IntArray:
    """Samples per message."""
    if column is None:
        return np.zeros(n, np.int64)
    return np.ones(n, np.int64) if column.lengths is None else column.lengths


def _stamp_ns(numbers: list[FloatArray], factors: list[float]) -> IntArray:
    """Whole nanoseconds; seconds and nanoseconds are added as integers."""
    total = np.zeros(numbers[0].size, np.int64)
    for values, factor in zip(numbers, factors, strict=True):
        whole = np.floor(values)
        within_range = (
            np.clip(whole, -9e9, 9e9)
            if factor == 1e9
            else np.clip(whole, -9e18 / factor, 9e18 / factor)
        )
        total += within_range.astype(np.int64) * round(factor) + np.rint(
            (values - whole) * factor
        ).astype(np.int64)
    return total


def decimals_of(messages: Sequence[Any], want: RequestedField) -> int | None:
    """The decimals with which a number is written in `messages` of text.

    None if they are no decimals of an instrument.
    """
    most = None
    for message in messages:
        try:
            numbers = np.atleast_1d(extract(message, want.tokens))
        except FieldError:
            continue
        for value in numbers[np.isfinite(numbers)].tolist():
            most = max(most or 0, -int(Decimal(repr(value)).normalize().as_tuple().exponent))
    return most if most is not None and most <= MOST_DECIMALS else None


def names_of(message: Any) -> tuple[str, ...]:
    return tuple(map(str, message)) if isinstance(message, dict) else field_names(message)


def _near(problem: FieldError, message: Any) -> str:
    known = problem.known or names_of(message)
    near = nearest(problem.name, known) if problem.name else ""
    return f"{near}; it has {', '.join(known[:20])}" if problem.name and known else ""
