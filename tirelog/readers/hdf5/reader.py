"""HDF5 logs of any layout, read in slices.

    path, setup --source--> Column per channel (source, layout) --rate, scale, unit
                            (attributes)
        --channels of one length, rate and time dataset--> Group
            --slices of a bounded size--> RawBlock

A channel that is missing or refused is a loss (status 3) while another one is left, else the log is
unreadable (status 4). Samples in a damaged chunk, in one that was never written or behind the cut
of a file are NaN with the flag `gap`, and a loss.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from tirelog.data.setup import Setup
from tirelog.errors import ReadError
from tirelog.readers.base import (
    MOST_SERIES,
    RATES,
    Group,
    RawBlock,
    ReadReport,
    Series,
    SeriesList,
    with_stated_units,
)
from tirelog.readers.hdf5.layout import (
    TIME_NAMES,
    Scale,
    TimeColumn,
    find_columns,
    rate_of,
    scale_of,
    time_of,
    unit_of,
)
from tirelog.readers.hdf5.source import (
    LIBRARY_ERRORS,
    SLAB_BYTES,
    PaddedFile,
    Slabs,
    SourceColumn,
    declared_size,
    first_number,
    is_foreign_type,
    kept,
    names,
    unstored,
)
from tirelog.readers.other.formats import HEAD_BYTES, is_hdf5
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import WAVELENGTH_KINDS
from tirelog.vocabulary.quality import Quality

#: values per block over all channels of a group
BLOCK_VALUES = 1 << 20
#: chunk cache of each dataset; a chunk that is larger is read past it
CACHE_BYTES = 1 << 20
#: a first stamp above this (1990) counts from 1970
EARLIEST_DATE_S = 631152000.0


@dataclass(frozen=True)
class _Channel:
    name: str
    kind: str
    column: SourceColumn
    scale: Scale


#: what the library says of a file that another process has open for writing
_BEING_WRITTEN = re.compile("already open for|unable to lock file")


@dataclass(frozen=True)
class _Clock:
    """A group with what its blocks are read from.

    `first` is the first stored stamp, `origin_s` its time in the log.
    """

    group: Group
    channels: tuple[_Channel, ...]
    size: int
    time: TimeColumn | None
    first: Any = 0
    origin_s: float = 0.0


def open_hdf5(path: Path | str, setup: Setup, log_name: str) -> Hdf5Log:
    """The log at `path`; `log_name` is its name in messages.

    ReadError if nothing in it can be read.
    """
    return Hdf5Log(Path(path), setup, log_name)


def refuse_damaged(path: Path, log_name: str) -> None:
    """ReadError: an HDF5 file that is cut off, or does not even say what it holds."""
    with path.open("rb") as raw:
        if not is_hdf5(raw.read(HEAD_BYTES)):
            return
    file, end, declared = opened(path, log_name)
    with file:
        if end is not None:
            raise ReadError(
                f"is cut off at {end} of {declared} bytes", do="copy it again", file=log_name
            )
        try:
            list(file.attrs.items()), list(file.items())
        except LIBRARY_ERRORS as problem:
            raise _unreadable(problem, log_name) from None


def opened(path: Path, log_name: str) -> tuple[h5py.File, int | None, int | None]:
    """(the file, its size and what that should be if it is cut off).

    One that is being written by SWMR is open in that mode. ReadError: it cannot be opened.
    """
    try:
        size = path.stat().st_size
    except OSError as problem:
        raise ReadError(
            f"cannot be opened ({problem.strerror})",
            allowed="a log is a readable file",
            do="mend the path",
            file=log_name,
        ) from None
    if size == 0:
        raise ReadError(
            "is empty", allowed="allowed is an HDF5 file", do="record it again", file=log_name
        )
    try:
        return h5py.File(path, "r", rdcc_nbytes=CACHE_BYTES), None, None
    except LIBRARY_ERRORS as problem:
        if _BEING_WRITTEN.search(str(problem)):
            return _being_written(path, log_name), None, None
        declared = declared_size(problem)
        if declared is None or declared <= size:
            raise _unreadable(problem, log_name) from None
    try:
        return h5py.File(PaddedFile(path, declared), "r", rdcc_nbytes=CACHE_BYTES), size, declared
    except LIBRARY_ERRORS:
        raise ReadError(
            f"is cut off at {size} of {declared} bytes, before its index",
            do="copy it again",
            file=log_name,
        ) from None


def _being_written(path: Path, log_name: str) -> h5py.File:
    """The file that a writer has open, as far as it is written.  ReadError: it is locked."""
    try:
        return h5py.File(path, "r", swmr=True, rdcc_nbytes=CACHE_BYTES)
    except LIBRARY_ERRORS:
        raise ReadError(
            "is still being recorded, or its writer ended without closing it",
            allowed="allowed is a file that is closed, or written in SWMR mode",
            do="wait until the recording has ended",
            file=log_name,
        ) from None


def _unreadable(problem: BaseException, log_name: str) -> ReadError:
    return ReadError(
        f"is no readable HDF5 file ({problem})",
        allowed="allowed is HDF5",
        do="repair it or record it again",
        file=log_name,
    )


class Hdf5Log:
    """An open HDF5 log (see `tirelog.readers.base.LogReader`)."""

    def __init__(self, path: Path, setup: Setup, log_name: str) -> None:
        self.report = ReadReport(format="hdf5")
        self.log_name, self.setup = log_name, setup
        self.stated: dict[str, str] = {}  # units, by channel, as the file spells them
        # `end`: size of a file that was cut off
        self.file, self.end, declared = opened(path, log_name)
        if self.file.swmr_mode:
            self.report.losses.append(
                "the file is still being recorded; samples written from now on are not read; read "
                "it again when the recording has ended"
            )
        if self.end is not None:
            self.report.losses.append(
                f"the file is cut off at {self.end} of {declared} bytes; samples behind the cut "
                "are lost; copy it again"
            )
        try:
            self.clocks = self._clocks(self._channels())
        except LIBRARY_ERRORS as problem:
            raise self._error(
                f"cannot be read ({problem}); the file is damaged", do="record it again"
            ) from None
        self.setup, said = with_stated_units(setup, self.stated)
        self.report.remarks += said
        self.groups = tuple(clock.group for clock in self.clocks)

    def _error(self, what: str, *, allowed: str = "", do: str = "") -> ReadError:
        return ReadError(what, allowed=allowed, do=do, file=self.log_name)

    def _channels(self) -> list[_Channel]:
        channels, problems = [], []
        for name, channel in self.setup.channels.items():
            try:
                column = find_columns(self.file, channel.source)
                channels.append(_Channel(name, channel.kind, column, scale_of(column)))
                if channel.scaled and (channels[-1].scale.factor, channels[-1].scale.offset) != (
                    1.0,
                    0.0,
                ):
                    self.report.remarks.append(
                        f"channel {name}: the file has a scale of its own; the setup's scale and "
                        "offset act on what it gives"
                    )
                if unit := unit_of(column):
                    self.stated[name] = unit
            except ReadError as problem:
                problems.append(f"channel {name}: {problem.message}")
            except LIBRARY_ERRORS as problem:
                what, do = (
                    ("cannot be read here", "allowed are numbers; store it as such")
                    if is_foreign_type(problem)
                    else ("cannot be read", "the file is damaged; record it again")
                )
                problems.append(f"channel {name}: {channel.source} {what} ({problem}); {do}")
        if not channels:
            raise self._error(
                "; ".join(self.report.losses + problems[:3]) or "the setup has no channels"
            )
        self.report.losses += problems
        return channels

    def _clocks(self, channels: list[_Channel]) -> list[_Clock]:
        """The channels in groups of one length, rate and time."""
        gathered: dict[tuple[Any, ...], tuple[list[_Channel], TimeColumn | None, float | None]] = {}
        for channel in channels:
            time = self._time(channel)
            rate = rate_of(channel.column)
            source = (time.column.path, time.column.field, time.column.index) if time else None
            key = (
                len(channel.column),
                rate,
                source,
                self.setup.channels[channel.name].sampling_rate_Hz,
            )
            gathered.setdefault(key, ([], time, rate))[0].append(channel)
        clocks = []
        for number, (members, time, rate) in enumerate(gathered.values(), 1):
            decimals = {c.name: c.scale.decimals for c in members}
            group = Group(
                f"clock_{number}", tuple(c.name for c in members), rate_Hz=rate, decimals=decimals
            )
            size = max(kept(c.column, self.end, BLOCK_VALUES) for c in members)
            if size == 0:
                self.report.losses.append(
                    f"nothing is stored of {', '.join(group.channels)}; record the log again"
                )
                continue
            if size < (whole := len(members[0].column)):
                self.report.losses.append(
                    f"{', '.join(group.channels)}: {whole - size} of {whole} samples at the end "
                    "are not in the file"
                )
            first = first_number(time.column, self._is_lost) if time else 0
            if first is None:
                self.report.losses.append(
                    f"the stamps of {', '.join(group.channels)} cannot be read; "
                    "give sampling_rate_Hz in the setup"
                )
                time, first = None, 0
            clocks.append(_Clock(group, tuple(members), size, time, first))
        if not clocks:
            raise self._error("; ".join(self.report.losses))
        return self._common_origin(clocks)

    def _is_lost(self, column: SourceColumn, start: int, stop: int) -> bool:
        return bool(unstored(column, start, stop, self.end))

    def _time(self, channel: _Channel) -> TimeColumn | None:
        try:
            return time_of(self.file, channel.column, self.setup.log.time, self.setup.log.time_unit)
        except ReadError as problem:
            self.report.losses.append(f"channel {channel.name}: {problem.message}")
            return None

    def _common_origin(self, clocks: list[_Clock]) -> list[_Clock]:
        """The clocks with times from the first stamp of any of them.

        Clocks of dates and clocks of seconds each have their own.
        """
        starts = [float(c.first) * c.time.step_s if c.time else 0.0 for c in clocks]
        dated = [
            bool(c.time and (c.time.absolute or start > EARLIEST_DATE_S))
            for c, start in zip(clocks, starts, strict=True)
        ]
        stamped = [d for c, d in zip(clocks, dated, strict=True) if c.time]
        if len(set(stamped)) > 1:
            self.report.remarks.append(
                "some channels have dates and others seconds; each kind is taken to start with "
                "the log"
            )
        shifted = []
        for clock, start, date in zip(clocks, starts, dated, strict=True):
            origin = min(
                (s for c, s, d in zip(clocks, starts, dated, strict=True) if c.time and d == date),
                default=start,
            )
            shifted.append(replace(clock, origin_s=start - origin))
            if clock.time and start == origin and (date or clock.time.since):
                self.report.start = _absolute(clock.time, start)
        return shifted

    def blocks(self) -> Iterator[RawBlock]:
        """Slices of each group, one group after the other."""
        for clock in self.clocks:
            step = _rows(clock)
            lost = {"samples": 0, "stamps": 0}
            for start in range(0, clock.size, step):
                block, samples, stamps = self._block(clock, start, min(start + step, clock.size))
                lost["samples"] += samples
                lost["stamps"] += stamps
                yield block
            names = ", ".join(clock.group.channels)
            for what, count in lost.items():
                if count:
                    self.report.losses.append(
                        f"{count} {what} of {names} lie in damaged or missing chunks and are "
                        "lost; copy the log again"
                    )
                    self.report.counts[f"{what}_lost"] = (
                        self.report.counts.get(f"{what}_lost", 0) + count
                    )

    def _block(self, clock: _Clock, start: int, stop: int) -> tuple[RawBlock, int, int]:
        """Samples [start, stop) of a group, how many samples and how many stamps are lost.

        A sample is lost in any channel, and counted once in each.
        """
        values: dict[str, FloatArray] = {}
        flags: list[tuple[str, int, int, Quality]] = []
        gone = np.zeros(stop - start, bool)
        slabs = Slabs([c.column for c in clock.channels], start, stop)
        for channel in clock.channels:
            stored, missing = self._read(channel.column, start, stop, slabs)
            numbers = channel.scale.apply(stored)
            if channel.kind in WAVELENGTH_KINDS:
                numbers[~(numbers > 0.0)] = np.nan
            for first, last in missing:
                numbers[first - start : last - start] = np.nan
                gone[first - start : last - start] = True
                flags.append((channel.name, first - start, last - start, Quality.GAP))
            values[channel.name] = numbers
        stamps, stamps_gone = self._stamps(clock, start, stop, slabs) if clock.time else (None, 0)
        return (
            RawBlock(clock.group.name, values, stamps, None, tuple(flags)),
            int(gone.sum()),
            stamps_gone,
        )

    def _read(
        self, column: SourceColumn, start: int, stop: int, slabs: Slabs
    ) -> tuple[NDArray[Any], list[tuple[int, int]]]:
        """Stored values [start, stop), and the ranges of them that are lost.

        The values in these mean nothing.
        """
        missing = unstored(column, start, stop, self.end)
        if not missing:
            try:
                return slabs.read(column), []
            except LIBRARY_ERRORS:
                pass  # a damaged chunk: find out which
        stored = np.zeros(stop - start, column.dtype)
        for first in range(start - start % column.chunk, stop, column.chunk):
            low, high = max(first, start), min(first + column.chunk, stop)
            if any(a < high and low < b for a, b in missing):
                if column.dataset.chunks:
                    continue
                high = max(min(high, missing[0][0]), low)
            try:
                stored[low - start : high - start] = column.read(low, high)
            except LIBRARY_ERRORS:
                missing.append((low, high))
        return stored, missing

    def _stamps(self, clock: _Clock, start: int, stop: int, slabs: Slabs) -> tuple[FloatArray, int]:
        """Seconds from the first stamp of the log, NaN for lost stamps, and how many are lost."""
        assert clock.time is not None
        stored, missing = self._read(clock.time.column, start, stop, slabs)
        if stored.dtype.kind in "iu":
            counted = (stored.astype(np.int64) - int(clock.first)).astype(
                np.float64
            )  # exact for nanoseconds since 1970
        else:
            counted = stored.astype(np.float64) - float(clock.first)
        stamps = counted * clock.time.step_s + clock.origin_s
        for first, last in missing:
            stamps[first - start : last - start] = np.nan
        return stamps, sum(last - first for first, last in missing)


def _rows(clock: _Clock) -> int:
    """Samples per block: whole chunks if these are small, never more than the budget."""
    columns = [c.column for c in clock.channels]
    widest = max(c.dataset.dtype.itemsize if c.field else c.dtype.itemsize for c in columns)
    rows = max(min(BLOCK_VALUES // len(columns), SLAB_BYTES // widest), 1)
    chunk = max((c.chunk for c in columns if c.dataset.chunks), default=1)
    return rows - rows % chunk if chunk <= rows else rows


def _absolute(time: TimeColumn, start_s: float) -> str | None:
    """The start of the log as ISO 8601.

    Stamps count from 1970, or from the date that the file names.
    """
    try:
        since = (
            datetime.fromisoformat(time.since) if time.since else datetime(1970, 1, 1, tzinfo=UTC)
        )
        return (since + timedelta(seconds=start_s)).isoformat()
    except (OverflowError, ValueError):
        return None


# ---- The datasets of an HDF5 log that hold columns of numbers.


#: columns of one dataset that are listed
_MOST_COLUMNS = 32
#: datasets so many times shorter than the longest are properties, not signals
_SHORT = 1000
_BESIDE = {*TIME_NAMES, *(name.lower() for name in RATES)}


def datasets(path: Path, log: str) -> SeriesList:
    """Datasets of numbers, and columns of those that have some.  ReadError: not to be read."""
    try:
        with opened(path, log)[0] as file:
            sized = [one for name in names(file) for one in _columns(file, name)]
            times = [name for name in names(file) if _last(name) in TIME_NAMES]
    except LIBRARY_ERRORS as problem:
        raise _unreadable(problem, log) from None
    longest = max((size for _, size in sized), default=0)
    found = [one for one, size in sized if size * _SHORT >= longest]
    short = [one.source for one, size in sized if size * _SHORT < longest]
    return SeriesList(
        tuple(found[:MOST_SERIES]), times[0] if times else "", tuple(short[:MOST_SERIES])
    )


def _last(name: str) -> str:
    return name.replace(":", "/").rsplit("/", 1)[-1].lower()


def _columns(file: h5py.File, name: str) -> list[tuple[Series, int]]:
    """The columns of a dataset with their lengths.

    None if it holds a time, a rate or no numbers.
    """
    if _last(name) in _BESIDE:
        return []
    item = file.get(name.split(":")[0])
    shape = getattr(item, "shape", None)
    wide = [n for n in shape or () if n > 1]
    sources = [name]
    if len(wide) == 2 and ":" not in name:
        sources = [f"{name}[{k}]" for k in range(min(min(wide), _MOST_COLUMNS))]
    series = []
    for source in sources:
        try:
            if (size := len(find_columns(file, source))) > 1:
                # a channel of WAV has a number and no path
                series.append((Series(re.sub(r"^/(?=#\d+$)", "", source)), size))
        except (ReadError, *LIBRARY_ERRORS):
            return series
    return series
