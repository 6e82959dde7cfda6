"""HDF5 logs of any layout, read in slices.

    path, setup --source--> Column per channel (source, layout) --rate, scale, unit
                            (attributes)
        --channels of one length, rate and time dataset--> Group
            --slices of a bounded size--> RawBlock

A channel that is missing or refused is a loss (status 3) while another one is left, else the log is
unreadable (status 4). Samples in a damaged chunk or in one that was never written are NaN with the
flag `gap`. They are a loss.

This file is longer than others: a list of series leaves out what a log would take for its time.
"""

from __future__ import annotations

import pickletools
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from tirelog.data.setup import Setup
from tirelog.errors import ReadError, SetupError, nearest
from tirelog.readers.base import (
    EARLIEST_DATE_S,
    MOST_SERIES,
    RATES,
    Group,
    RawBlock,
    ReadReport,
    Series,
    SeriesList,
    date_of,
    is_of_other_quantity,
    is_time_name,
    long_form,
    rises_as_time,
    runs,
    signals_of,
    split_unit,
    stated_time_unit,
    unit_by_size,
    unit_in_source,
    with_stated_units,
)
from tirelog.readers.hdf5.source import (
    LIBRARY_ERRORS,
    MOST_NAMES,
    SINCE,
    SLAB_BYTES,
    Attributes,
    Scale,
    Slabs,
    SourceColumn,
    column,
    dataset_and_index,
    first_number,
    first_stored,
    is_foreign_type,
    kept,
    names,
    rate_of,
    scale_of,
    start_of,
    time_axis,
    unit_of,
    unstored,
    walk,
)
from tirelog.readers.other.formats import HEAD_BYTES, name_of
from tirelog.vocabulary import units
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import Quality

# ---- Which dataset a source means, and which dataset holds its time.
#
# pandas    "/df:column" of a `fixed` frame, a `table` frame (column names are read from the
#           pickle's opcodes, never unpickled), or a series
# NeXus     "/entry/data" is the group's signal; its axes hold the time
# others    [log] time of the setup, or a dataset or field called time, t, timestamp beside the data


TIME_NAMES = (
    "time",
    "t",
    "timestamp",
    "timestamps",
    "time_s",
    "time_ms",
    "time_us",
    "time_ns",
    "timestamp_ns",
    "t_s",
    "t_ms",
    "t_us",
    "t_ns",
)
PICKLE_LIST = {
    "MARK",
    "LIST",
    "EMPTY_LIST",
    "APPEND",
    "APPENDS",
    "PUT",
    "BINPUT",
    "MEMOIZE",
    "PROTO",
    "FRAME",
    "STOP",
}
#: numbers at each end of a column that show whether it rises; datasets beside it that are looked
#: at, and members of a group that may be a long table: a time, a name, a value and what describes
#: them
_LOOKED_AT, _MOST_BESIDE, _MOST_OF_LONG = 200, 64, 8
PICKLE_TEXT = {"UNICODE", "BINUNICODE", "SHORT_BINUNICODE"}


@dataclass(frozen=True)
class TimeColumn:
    """Stored stamps: seconds = (stored - first stored) x `step_s`.

    `absolute` if they count from 1970 (or `since`).
    """

    column: SourceColumn
    step_s: float
    unit: str = "s"
    absolute: bool = False
    since: str | None = None


def find_columns(file: h5py.File, source: str) -> SourceColumn:
    """The column that `source` means.  ReadError if there is none, or it is refused."""
    path, field, index = dataset_and_index(file, source)
    item = walk(file, path)
    if isinstance(item, h5py.Dataset):
        return column(path, item, field, index)
    if not isinstance(item, h5py.Group):
        raise ReadError(
            f"{path} is a type, no dataset",
            allowed="a source is a dataset path of the file",
            do="mend source",
        )
    attributes = Attributes(item)
    kind = attributes.text("pandas_type") or ""
    if kind == "frame":
        return _fixed_frame(path, item, field, index)
    if kind.endswith("_table"):
        return _table_frame(file, path, field, index)
    if below := "values" if kind == "series" else _signal(item):
        return column(f"{path}/{below}", _dataset(file, f"{path}/{below}"), field, index)
    near = nearest(path, names(file))
    raise ReadError(
        f"{path} is a group{near}",
        allowed="a source is a dataset, or a group of pandas or NeXus",
        do="mend source",
    )


def _dataset(file: h5py.File, path: str) -> h5py.Dataset:
    item = walk(file, path)
    if not isinstance(item, h5py.Dataset):
        raise ReadError(
            f"{path} leads to a group",
            allowed="a source is a dataset path of the file",
            do="mend source",
        )
    return item


def _signal(group: h5py.Group) -> str | None:
    """The name of a NeXus group's signal.

    Its attribute `signal`, or the dataset with the attribute signal = 1.
    """
    named = Attributes(group).text("signal")
    if named:
        return named
    for name in group:
        if isinstance(group.get(name, getlink=True), h5py.HardLink):
            item = group[name]
            if isinstance(item, h5py.Dataset) and Attributes(item).number("signal") == 1:
                return str(name)
    return None


def _fixed_frame(
    path: str, group: h5py.Group, field: str | None, index: tuple[int | None, ...]
) -> SourceColumn:
    known: list[str] = []
    for block in range(len(group)):
        if f"block{block}_items" not in group:
            break
        labels = column_labels(walk(group.file, f"{path}/block{block}_items"))
        known += labels
        if field in labels:
            values = f"{path}/block{block}_values"
            dataset = _dataset(group.file, values)
            turned = Attributes(dataset).number("transposed") == 1  # stored (samples, columns)
            at = labels.index(field)
            # an index to a frame's column, which has one axis alone, is refused
            time_axis(f"{path}:{field}", dataset.shape[:1] if turned else dataset.shape[1:], index)
            return column(values, dataset, None, (None, at) if turned else (at, None))
    raise _no_label(f"{path} is a pandas frame", field, known)


def _no_label(what: str, field: str | None, known: list[str]) -> ReadError:
    return ReadError(
        f"{what} without {field!r}{nearest(field or '', known)}",
        allowed=f"it has {', '.join(known[:20])}",
        do="mend source",
    )


def column_labels(item: h5py.Group | h5py.Dataset) -> list[str]:
    if (
        not isinstance(item, h5py.Dataset)
        or item.dtype.kind != "S"
        or item.ndim != 1
        or item.size * item.dtype.itemsize > 1 << 24
    ):
        return []
    return [bytes(label).decode("utf-8", "replace") for label in np.asarray(item[:])]


def _table_frame(
    file: h5py.File, path: str, field: str | None, index: tuple[int | None, ...]
) -> SourceColumn:
    where = f"{path}/table"
    table = _dataset(file, where)
    if table.dtype.names and field in table.dtype.names:
        return column(where, table, field, index)
    known: list[str] = []
    for block in table.dtype.names or ():
        labels = pickled_labels(Attributes(table).raw(f"{block}_kind"))
        known += labels
        if field in labels:
            time_axis(f"{path}:{field}", table.shape, index)
            return column(where, table, block, (labels.index(field),))
    raise _no_label(f"{path} is a pandas table", field, known)


def pickled_labels(raw: object) -> list[str]:
    """The texts in a pickled list of texts, read off its opcodes; empty if it is anything else.

    Nothing is executed.
    """
    if not isinstance(raw, bytes):
        return []
    labels = []
    try:
        for opcode, argument, _ in pickletools.genops(raw):
            if opcode.name in PICKLE_TEXT:
                labels.append(str(argument))
            elif opcode.name not in PICKLE_LIST:
                return []
    except (ValueError, UnicodeDecodeError):
        return []
    return labels


def time_of(
    file: h5py.File, found: SourceColumn, setup_time: str | None, time_unit: str | None
) -> TimeColumn | None:
    """The stamps of the column's samples, or None.

    ReadError if the setup names a time that cannot be used.
    """
    if setup_time:
        return _stamps(_named_time(file, found, setup_time), time_unit)
    group = found.dataset.parent
    for candidate in _candidates(found, group):
        try:
            stamps = find_columns(file, candidate)
        except (ReadError, *LIBRARY_ERRORS):
            continue
        if (
            len(stamps) == len(found)
            and stamps.dtype.kind in "iuf"
            and (stamps.path, stamps.field) != (found.path, found.field)
        ):
            return _stamps(stamps, None)
    return None


def rising_time(file: h5py.File, found: SourceColumn) -> str:
    """The source of what rises beside the column as nothing but a time does, or ''.

    In a matrix, its first column. Else a dataset of the same length beside the column that rises
    and has a name of time. Else the only one that rises in even steps and whose name is of no other
    quantity.
    """
    path = found.dataset.name
    if found.dataset.ndim == 2 and min(found.dataset.shape) > 1 and found.field is None:
        return f"{path}[0]" if _rises(file, f"{path}[0]", len(found), True) else ""
    group = found.dataset.parent
    base = "" if group.name == "/" else group.name
    beside = [f"{base}/{name}" for name, _ in zip(group, range(_MOST_BESIDE), strict=False)]
    named = [one for one in beside if is_time_name(one.rsplit("/", 1)[-1])]
    rising = [one for one in named if _rises(file, one, len(found), True)]
    even = [one for one in beside if not rising and _rises(file, one, len(found), False)]
    return next(iter(rising), "") or (even[0] if len(even) == 1 else "")


def _rises(file: h5py.File, source: str, size: int, known: bool) -> bool:
    """Whether some numbers at the begin and at the end of a column rise as a time does.

    In even steps, and under a name of no other quantity, unless its place or name makes it `known`.
    """
    try:
        stamps = find_columns(file, source)
        if len(stamps) != size or stamps.dtype.kind not in "iuf":
            return False
        name, unit = split_unit(source.rsplit("/", 1)[-1])
        if not known and is_of_other_quantity(name, unit or unit_of(stamps) or ""):
            return False
        firsts = {max(min(first, size - _LOOKED_AT), 0) for first in (0, size)}
        parts = [stamps.read(first, first + _LOOKED_AT) for first in firsts]
    except (ReadError, *LIBRARY_ERRORS):
        return False
    for part in parts:
        numbers = part.astype(np.float64)
        digit = 1e-6 * float(np.ptp(numbers)) / numbers.size
        if part.dtype.kind == "f":  # of its own type
            digit = max(digit, float(np.spacing(np.abs(part).max())))
        if (numbers == np.rint(numbers)).all():
            digit = 1.0
        if not rises_as_time(numbers, digit, np.inf if known else 0.0):
            return False
    return True


def refuse_long_form(found: SourceColumn) -> None:
    """ReadError: the column holds some signals one after the other, named in a column beside it."""
    beside = _beside(found)
    types = [one.dtype for one in beside.values()]
    kinds = ["number" if dtype.kind in "iuf" else "other" for dtype in types]
    for k, dtype in enumerate(types):
        if h5py.check_string_dtype(dtype) is not None:
            kinds[k] = "text"

    def cells(number: int) -> list[str]:
        stored = [*beside.values()][number]
        ends = max(len(found) - _LOOKED_AT, 0)
        both = [*stored.read(0, _LOOKED_AT), *stored.read(ends, len(found))]
        return [x.decode("utf-8", "replace") if isinstance(x, bytes) else str(x) for x in both]

    column, signals = signals_of([*beside], kinds, cells)
    if signals:
        raise long_form(signals, [*beside][column])


def _beside(found: SourceColumn) -> dict[str, SourceColumn]:
    """The columns of as many rows in the table or the group of one, by name, itself among them.

    None of a group with more members than a long table has.
    """
    dataset, group = found.dataset, found.dataset.parent
    beside: dict[str, SourceColumn] = {}
    if found.field is None:
        for name in group if len(group) <= _MOST_OF_LONG else ():
            item = group[name] if isinstance(group.get(name, getlink=True), h5py.HardLink) else None
            if isinstance(item, h5py.Dataset) and item.shape == (len(found),):
                beside[name] = SourceColumn(item.name, item, 0, (None,))
        return beside
    attributes = Attributes(dataset)
    for field in dataset.dtype.names:
        labels = pickled_labels(attributes.raw(f"{field}_kind"))
        for k, label in enumerate(labels or [field]):
            element = (k,) if dataset.dtype[field].shape else ()
            beside[label] = replace(found, field=field, element=element)
    return beside


def _named_time(file: h5py.File, found: SourceColumn, name: str) -> SourceColumn:
    problem: ReadError | None = None
    beside = found.dataset.parent.name
    for candidate in (name, f"{beside}/{name}", f"{found.path}:{name}"):
        try:
            stamps = find_columns(file, candidate)
        except ReadError as error:
            problem = problem or error
            continue
        if len(stamps) != len(found):
            raise ReadError(
                f"time {name!r} has {len(stamps)} stamps and {found.path} {len(found)} samples",
                allowed="allowed is one stamp a sample",
                do="mend [log] time or give sampling_rate_Hz",
            )
        return stamps
    raise ReadError(f"time {name!r} of the setup: {problem.message if problem else 'not found'}")


def _candidates(found: SourceColumn, group: h5py.Group) -> list[str]:
    """Sources that may hold the column's time, likeliest first."""
    base = group.name if group.name != "/" else ""
    listed = [
        f"{found.path}:{name}"
        for name in found.dataset.dtype.names or ()
        if name.lower() in TIME_NAMES
    ]
    if (
        found.path.endswith("/table")
        and "index_kind" in Attributes(found.dataset).names
        and _counts_time(found.dataset, "index_kind")
    ):
        listed.append(f"{found.path}:index")
    for name in ("axis1", "index"):
        if (
            name in group
            and Attributes(group).text("pandas_type")
            and _counts_time(group[name], "kind")
        ):
            listed.append(f"{base}/{name}")
    axes = Attributes(found.dataset).text("axes") or Attributes(group).text("axes")
    listed += [
        f"{base}/{name.strip()}"
        for name in re.split(r"[:,]", axes or "")
        if name.strip() not in ("", ".")
    ]
    lower = {name.lower(): name for name in group}
    return listed + [f"{base}/{lower[name]}" for name in TIME_NAMES if name in lower]


def _counts_time(item: h5py.Dataset, attribute: str) -> bool:
    kind = Attributes(item).text(attribute) or ""
    return kind.startswith("datetime64") or kind == "float"


def _stamps(stamps: SourceColumn, time_unit: str | None) -> TimeColumn:
    """Step and origin of stored stamps.

    By the setup's unit, the file's, the one in the name, or seconds.
    """
    unit = time_unit or unit_of(stamps) or ""
    since = SINCE.match(unit)
    if since:
        unit = since[1]
    attributes = Attributes(stamps.dataset)
    kind = attributes.text("index_kind" if stamps.field else "kind") or ""
    date = re.fullmatch(r"datetime64(?:\[(\w+)\])?", kind)
    if date:
        unit = date[1] if date[1] in ("s", "ms", "us") else "ns"
        return TimeColumn(stamps, units.UNITS[unit][1], unit, absolute=True)
    if not unit:
        name = stamps.field or stamps.path.rsplit("/", 1)[-1]
        first = first_stored(stamps).astype(np.float64)
        unit = stated_time_unit(name, "") or unit_by_size(first)
    try:
        step, _ = units.to_si(unit, "time")
    except SetupError as problem:
        raise ReadError(f"time {stamps.path}: {problem.message}") from None
    unit = units.canonical(unit) or unit
    return TimeColumn(stamps, step, unit, since=since[2] if since else None)


# ---- A log.


#: values per block over all channels of a group
BLOCK_VALUES = 1 << 20
#: chunk cache of each dataset; a chunk that is larger is read past it
CACHE_BYTES = 1 << 20
#: a channel's name, its column, and how what is stored there becomes values
_Channel = tuple[str, SourceColumn, Scale]


#: what the library says of a file that another process has open for writing
_BEING_WRITTEN = re.compile("already open for|unable to lock file")
#: and of one that is shorter than it says itself
_CUT_OFF = re.compile(r"truncated file.*stored_eof = (\d+)")


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

    @property
    def start_s(self) -> float:
        """The first stamp [s], 0 without one."""
        return float(self.first) * self.time.step_s if self.time else 0.0

    @property
    def is_dated(self) -> bool:
        """True if the stamps count from 1970."""
        return self.time is not None and (self.time.absolute or self.start_s > EARLIEST_DATE_S)


def refuse_damaged(path: Path, log_name: str) -> None:
    """ReadError: an HDF5 file that is cut off, or does not even say what it holds."""
    with path.open("rb") as raw:
        if name_of(raw.read(HEAD_BYTES)) != "HDF5":
            return
    with opened(path, log_name) as file:
        try:
            list(file.attrs.items()), list(file.items())
        except LIBRARY_ERRORS as problem:
            raise _unreadable(problem, log_name) from None


def opened(path: Path, log_name: str) -> h5py.File:
    """The open file.  ReadError: it cannot be opened."""
    try:
        return h5py.File(path, "r", rdcc_nbytes=CACHE_BYTES)
    except LIBRARY_ERRORS as problem:
        if _BEING_WRITTEN.search(str(problem)):
            raise ReadError(
                "is still being recorded, or its writer ended without closing it",
                allowed="allowed is a file that is closed",
                do="wait until the recording has ended",
                file=log_name,
            ) from None
        whole = _CUT_OFF.search(str(problem))
        if whole is None:
            raise _unreadable(problem, log_name) from None
        raise ReadError(
            f"is cut off at {path.stat().st_size} of {whole[1]} bytes",
            allowed="allowed is a whole file",
            do="copy it again",
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
        self.file = opened(path, log_name)
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
                scale = scale_of(column)
                with suppress(*LIBRARY_ERRORS):  # what is damaged beside a column names nothing
                    refuse_long_form(column)
                channels.append((name, column, scale))
                if channel.scaled and (scale.factor, scale.offset) != (1.0, 0.0):
                    self.report.remarks.append(
                        f"channel {name}: the file has a scale of its own; the setup's scale and "
                        "offset act on what it gives"
                    )
                if unit := unit_of(column) or unit_in_source(channel.source):
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
        gathered: dict[tuple[Any, ...], tuple[list[_Channel], TimeColumn | None]] = {}
        starts = [start_of(column) for _, column, _ in channels]
        for channel, start_s in zip(channels, starts, strict=True):
            name, column, _ = channel
            rate = rate_of(column)
            time = self._time(name, column) or self._guessed_time(column, rate)
            source = (time.column.path, time.column.field, time.column.index) if time else None
            declared = self.setup.channels[name].sampling_rate_Hz
            key = (rate, start_s - min(starts), len(column), source, declared)
            gathered.setdefault(key, ([], time))[0].append(channel)
        clocks = []
        for number, ((rate, begin_s, *_), (members, time)) in enumerate(gathered.items(), 1):
            group = Group(
                f"clock_{number}",
                tuple(name for name, _, _ in members),
                rate,
                start_s=begin_s,
                time_example='"/PATH" (its dataset)',
            )
            size = max(kept(column, BLOCK_VALUES) for _, column, _ in members)
            if size == 0:
                self.report.losses.append(
                    f"nothing is stored of {', '.join(group.channels)}; record the log again"
                )
                continue
            if size < (whole := len(members[0][1])):
                self.report.losses.append(
                    f"{', '.join(group.channels)}: {whole - size} of {whole} samples at the end "
                    "are not in the file"
                )
            first = first_number(time.column) if time else 0
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

    def _time(self, name: str, column: SourceColumn) -> TimeColumn | None:
        try:
            return time_of(self.file, column, self.setup.log.time, self.setup.log.time_unit)
        except ReadError as problem:
            self.report.losses.append(f"channel {name}: {problem.message}")
            return None

    def _guessed_time(self, column: SourceColumn, rate: float | None) -> TimeColumn | None:
        """The time guessed for a column without a rate, with a remark."""
        log = self.setup.log
        if rate is not None or log.time is not None or log.sampling_rate_Hz is not None:
            return None
        source = rising_time(self.file, column)
        if not source:
            return None
        time = _stamps(find_columns(self.file, source), log.time_unit)
        said = (
            f"{source} rises as a time does and is taken for the time in {time.unit}; if it is "
            "none, name another as time under [log] in the setup"
        )
        if said not in self.report.remarks:
            self.report.remarks.append(said)
        return time

    def _common_origin(self, clocks: list[_Clock]) -> list[_Clock]:
        """The clocks with times from the first stamp of any of them.

        Clocks of dates and clocks of seconds each have their own.
        """
        stamped: dict[bool, list[float]] = {}  # first stamps of clocks of dates, and of seconds
        for clock in clocks:
            if clock.time:
                stamped.setdefault(clock.is_dated, []).append(clock.start_s)
        if len(stamped) > 1:
            self.report.remarks.append(
                "some channels have dates and others seconds; each kind is taken to start with "
                "the log"
            )
        shifted = []
        for clock in clocks:
            origin = min(stamped[clock.is_dated]) if clock.time else clock.start_s
            shifted.append(replace(clock, origin_s=clock.start_s - origin))
            if clock.time and clock.start_s == origin and (clock.is_dated or clock.time.since):
                self.report.start = _absolute(clock.time, origin)
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
        slabs = Slabs([column for _, column, _ in clock.channels], start, stop)
        for name, source, scale in clock.channels:
            stored, lost = self._read(source, start, stop, slabs)
            values[name] = scale.apply(stored)
            values[name][lost] = np.nan
            gone |= lost
            flags += [(name, first, last, Quality.GAP) for first, last in runs(lost)]
        stamps, stamps_gone = self._stamps(clock, start, stop, slabs) if clock.time else (None, 0)
        return (
            RawBlock(clock.group.name, values, stamps, None, tuple(flags)),
            int(gone.sum()),
            stamps_gone,
        )

    def _read(
        self, column: SourceColumn, start: int, stop: int, slabs: Slabs
    ) -> tuple[NDArray[Any], NDArray[np.bool_]]:
        """(stored values [start, stop), which of them are lost, and mean nothing)."""
        lost = unstored(column, start, stop)
        if not lost.any():
            try:
                return slabs.read(column), lost
            except LIBRARY_ERRORS:
                pass  # a damaged chunk: find out which
        stored = np.zeros(stop - start, column.dtype)
        for first in range(start - start % column.chunk, stop, column.chunk):
            low, high = max(first, start), min(first + column.chunk, stop)
            part = slice(low - start, high - start)
            if not lost[part].all():
                try:
                    stored[part] = column.read(low, high)
                except LIBRARY_ERRORS:
                    lost[part] = True
        return stored, lost

    def _stamps(self, clock: _Clock, start: int, stop: int, slabs: Slabs) -> tuple[FloatArray, int]:
        """Seconds from the first stamp of the log, NaN for lost stamps, and how many are lost."""
        assert clock.time is not None
        stored, lost = self._read(clock.time.column, start, stop, slabs)
        if stored.dtype.kind in "iu":
            counted = (stored.astype(np.int64) - int(clock.first)).astype(
                np.float64
            )  # exact for nanoseconds since 1970
        else:
            counted = stored.astype(np.float64) - float(clock.first)
        stamps = counted * clock.time.step_s + clock.origin_s
        stamps[lost] = np.nan
        return stamps, int(lost.sum())


def _rows(clock: _Clock) -> int:
    """Samples per block: whole chunks if these are small, never more than the budget."""
    columns = [column for _, column, _ in clock.channels]
    widest = max(c.dataset.dtype.itemsize if c.field else c.dtype.itemsize for c in columns)
    rows = max(min(BLOCK_VALUES // len(columns), SLAB_BYTES // widest), 1)
    chunk = max((c.chunk for c in columns if c.dataset.chunks), default=1)
    return rows - rows % chunk if chunk <= rows else rows


def _absolute(time: TimeColumn, start_s: float) -> str | None:
    """The start of the log as ISO 8601.

    Stamps count from 1970, or from the date that the file names.
    """
    if not time.since:
        return date_of(start_s / time.step_s, time.unit)
    try:
        return (datetime.fromisoformat(time.since) + timedelta(seconds=start_s)).isoformat()
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
        with opened(path, log) as file:
            objects = _matlab_objects(file)
            sized = [one for name in names(file) for one in _columns(file, name, objects)]
            times = [
                name for name in names(file) if _last(name) in TIME_NAMES and name not in objects
            ]
            guessed = {} if times else _guessed_times(file, sized)
    except LIBRARY_ERRORS as problem:
        raise _unreadable(problem, log) from None
    times += guessed
    sized = [(one, size) for one, size in sized if one.source not in guessed]
    longest = max((size for _, size in sized), default=0)
    found = [one for one, size in sized if size * _SHORT >= longest]
    short = [one.source for one, size in sized if size * _SHORT < longest]
    some = ", ".join(f"{name} ({kind})" for name, kind in [*objects.items()][:5] if kind)
    unread = f"{some}: objects of MATLAB; save their numbers, as T.Variables or table2array(T)"
    return SeriesList(
        tuple(found[:MOST_SERIES]),
        times[0] if times else "",
        tuple(short[:MOST_SERIES]),
        (unread,) if some else (),
    )


def _guessed_times(file: h5py.File, sized: list[tuple[Series, int]]) -> dict[str, None]:
    """The sources of what is taken for the time of series without a rate, in order."""
    places: dict[tuple[str, int], str] = {}
    for one, size in sized:
        column = find_columns(file, one.source)
        wide = column.dataset.name if column.dataset.ndim == 2 else column.dataset.parent.name
        if (wide, size) not in places:
            rate = rate_of(column)
            places[wide, size] = "" if rate is not None else rising_time(file, column)
    return dict.fromkeys(source for source in places.values() if source)


def _last(name: str) -> str:
    return name.replace(":", "/").rsplit("/", 1)[-1].lower()


def _matlab_objects(file: h5py.File) -> dict[str, str]:
    """The variables that are no arrays of numbers, with what they are; '' for MATLAB's own."""
    found = dict.fromkeys(("/#refs#", "/#subsystem#"), "")
    for name, _ in zip(file, range(MOST_NAMES), strict=False):
        if not isinstance(file.get(name, getlink=True), h5py.HardLink):
            continue
        attributes = Attributes(file[name])
        kind = attributes.text("MATLAB_class") or ""
        if "matlab_sparse" in attributes.names:
            found[f"/{name}"] = "sparse"
        elif kind == "char" or "matlab_object_decode" in attributes.names:
            found[f"/{name}"] = kind
    return found


def _columns(file: h5py.File, name: str, objects: Mapping[str, str]) -> list[tuple[Series, int]]:
    """The columns of a dataset with their lengths.

    None if it holds a time, a rate or no numbers, or is inside of one of MATLAB's `objects`.
    """
    if _last(name) in _BESIDE or f"/{name.split('/')[1]}" in objects:
        return []
    item = file.get(name)
    shape = getattr(item, "shape", None)
    wide = [n for n in shape or () if n > 1]
    sources = [name]
    if len(wide) == 2:
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
