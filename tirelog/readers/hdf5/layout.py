"""Which dataset a source means, and which dataset holds its time.

In the layouts that have a structure of their own.

pandas    "/df:column" of a `fixed` frame, a `table` frame (column names are read from the pickle's
          opcodes, never unpickled), or a series
NeXus     "/entry/data" is the group's signal; its axes hold the time
others    [log] time of the setup, or a dataset or field called time, t, timestamp beside the data
"""

from __future__ import annotations

import math
import pickletools
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from tirelog.errors import ReadError, SetupError, nearest
from tirelog.readers.base import RATES, rate_Hz, unit_by_size
from tirelog.readers.hdf5.source import (
    LIBRARY_ERRORS,
    SourceColumn,
    column,
    dataset_and_index,
    first_number,
    names,
    time_axis,
    walk,
)
from tirelog.vocabulary import units

# ---- What the attributes of a dataset say: scale, unit, sampling rate.
#
# One table of names each, matched without regard to case.
#
# value = factor x stored + offset          (NeXus: factor x (stored + offset))
# rate: an attribute of the dataset, of the groups above it, of the file; or a number stored
# beside it
# (MATLAB keeps `Fs` so)


#: (name of the factor, name of the offset, True if the offset is added before the factor)
SCALES = (
    ("scale_factor", "add_offset", False),  # netCDF, CF
    ("scaling_factor", "offset", True),  # NeXus
    ("scale", "offset", False),
    ("factor", "offset", False),
    ("slope", "intercept", False),
    ("slope", "offset", False),
    ("wf_scale", "wf_offset", False),
    ("wf_slope", "wf_intercept", False),
    ("adc_factor", "adc_offset", False),
    ("conversion_factor", "conversion_offset", False),
    ("conversion", "offset", False),  # NWB
    ("lsb", "offset", False),
    ("NI_Scale[0]_Linear_Slope", "NI_Scale[0]_Linear_Y_Intercept", False),  # LabVIEW
)
UNIT_NAMES = ("unit", "units", "unit_string", "wf_unit", "unit_y", "yunit", "physical_unit", "EU")
FILL_NAMES = ("_FillValue", "missing_value")
#: words before the unit's own spelling in attributes such as "seconds since 2026-01-01"
SINCE = re.compile(r"^\s*(\S+)\s+since\s+(.+?)\s*$", re.IGNORECASE)
#: bytes of an attribute; a larger one is not read
MOST_ATTRIBUTE_BYTES = 1 << 16


@dataclass(frozen=True)
class Scale:
    """factor x stored + offset; stored values in `lost` are lost samples.

    `decimals` if the stored numbers are decimal counts.
    """

    factor: float = 1.0
    offset: float = 0.0
    lost: tuple[float, ...] = ()
    decimals: int | None = None

    def apply(self, stored: NDArray[Any]) -> NDArray[np.float64]:
        values = stored.astype(np.float64)
        gone = np.isin(stored, self.lost) if self.lost else None
        with np.errstate(
            over="ignore", invalid="ignore"
        ):  # a damaged number may leave the range of floats, and is lost then
            if self.decimals is not None:
                values /= 10.0**self.decimals  # correctly rounded, as a product with 0.001 is not
            elif self.factor != 1.0:
                values *= self.factor
            if self.offset:
                values += self.offset
        if gone is not None:
            values[gone] = np.nan
        return values


class Attributes:
    """The attributes of an object by lower-cased name; large and unreadable ones are left alone."""

    def __init__(self, item: h5py.Group | h5py.Dataset) -> None:
        self.item = item
        try:
            self.names = {name.lower(): name for name in item.attrs}
        except LIBRARY_ERRORS:
            self.names = {}

    def raw(self, name: str) -> Any:
        """The attribute's value, or None."""
        exact = name if name in self.names.values() else self.names.get(name.lower())
        if exact is None:
            return None
        try:
            handle = self.item.attrs.get_id(exact)
            if handle.dtype.kind not in "iufbS" and h5py.check_string_dtype(handle.dtype) is None:
                return (
                    None  # references and lists are of no use here, and damaged ones crash libhdf5
                )
            if math.prod(handle.shape) * max(handle.dtype.itemsize, 1) > MOST_ATTRIBUTE_BYTES:
                return None
            return self.item.attrs[exact]
        except LIBRARY_ERRORS:
            return None

    def number(self, name: str) -> float | None:
        return as_number(self.raw(name))

    def text(self, name: str) -> str | None:
        """A text attribute (the first if there are several), or None."""
        value = self.raw(name)
        if isinstance(value, np.ndarray) and value.size:
            value = value.flat[0]
        if isinstance(value, bytes):
            value = value.decode("utf-8", "replace")
        return value.strip("\0 ") if isinstance(value, str) else None


def as_number(value: Any) -> float | None:
    """`value` as one finite number, or None."""
    if isinstance(value, np.ndarray):
        value = value.flat[0] if value.size == 1 else None
    if isinstance(value, bytes | str):
        text = value.decode("latin-1") if isinstance(value, bytes) else value
        value = (
            float(text)
            if re.fullmatch(r"\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*", text)
            else None
        )
    if isinstance(value, int | float | np.integer | np.floating) and math.isfinite(value):
        return float(value)
    return None


def scale_of(column: SourceColumn) -> Scale:
    """How the column's stored numbers become values."""
    attributes = Attributes(column.dataset)
    lost = tuple(v for v in map(attributes.number, FILL_NAMES) if v is not None)
    integer = column.dtype.kind in "iu"
    for factor_name, offset_name, offset_first in SCALES:
        factor, offset = attributes.number(factor_name), attributes.number(offset_name)
        if factor is None or factor == 0.0:
            continue
        offset = offset or 0.0
        exponent = round(-math.log10(abs(factor)))
        decimal = (
            integer and offset == 0.0 and 0 <= exponent <= 15 and factor == float(f"1e-{exponent}")
        )
        return Scale(
            factor, factor * offset if offset_first else offset, lost, exponent if decimal else None
        )
    offset = attributes.number("add_offset") or attributes.number("offset") or 0.0
    return Scale(1.0, offset, lost, 0 if integer and offset == 0.0 else None)


def unit_of(column: SourceColumn) -> str | None:
    """The unit that the file itself gives, as it spells it."""
    attributes = Attributes(column.dataset)
    return next((text for text in map(attributes.text, UNIT_NAMES) if text), None)


def above(column: SourceColumn) -> Iterator[h5py.Group]:
    """The groups above the column's dataset, nearest first, the file's root last."""
    group = column.dataset.parent
    while True:
        yield group
        if group.name in (None, "/"):
            return
        group = group.parent


def rate_of(column: SourceColumn) -> float | None:
    """The sampling rate [Hz] that the file states for the column, or None."""
    for item in (column.dataset, *above(column)):
        attributes = Attributes(item)
        for name, is_period in RATES.items():
            if (rate := rate_Hz(attributes.number(name), is_period)) is not None:
                return rate
    for group in above(column):
        stored = {name.lower(): name for name in group}
        for name, is_period in RATES.items():
            if (
                rate := rate_Hz(_stored_number(group, stored.get(name.lower())), is_period)
            ) is not None:
                return rate
    return None


def _stored_number(group: h5py.Group, name: str | None) -> float | None:
    """The one number in the dataset `name` of `group`."""
    if name is None or not isinstance(group.get(name, getlink=True), h5py.HardLink):
        return None
    item = group[name]
    if (
        not isinstance(item, h5py.Dataset)
        or item.size != 1
        or item.dtype.kind not in "iuf"
        or item.external
        or item.is_virtual
    ):
        return None
    return as_number(np.asarray(item[()]))


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
PICKLE_TEXT = {"UNICODE", "BINUNICODE", "SHORT_BINUNICODE"}


@dataclass(frozen=True)
class TimeColumn:
    """Stored stamps: seconds = (stored - first stored) x `step_s`.

    `absolute` if they count from 1970 (or `since`).
    """

    column: SourceColumn
    step_s: float
    absolute: bool = False
    since: str | None = None


def find_columns(file: h5py.File, source: str) -> SourceColumn:
    """The column that `source` means.  ReadError if there is none, or it is refused."""
    path, field, index = dataset_and_index(source)
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
        return TimeColumn(
            stamps, {"s": 1.0, "ms": 1e-3, "us": 1e-6}.get(date[1] or "ns", 1e-9), absolute=True
        )
    suffix = re.search(r"_(s|ms|us|ns)$", stamps.field or stamps.path)
    if not unit:
        unit = suffix[1] if suffix else unit_by_size(first_number(stamps, lambda *_: False))
    try:
        step, _ = units.to_si(unit or "s", "time")
    except SetupError as problem:
        raise ReadError(f"time {stamps.path}: {problem.message}") from None
    return TimeColumn(stamps, step, since=since[2] if since else None)
