"""From a setup's `source` to one column of numbers in an HDF5 file, and what is refused on the way.

    "/group/data"        a dataset; its longest axis is time, axes of length 1 need no index
    "/group/data[3]"     one column of a 2-D dataset (counted from 0); "[3, 0]" with more axes, "[:,
                         3]" says which axis is time
    "/table:column"      a field of a compound dataset ("column[2]" of an array field), or a column
                         of a pandas or NeXus group

    file, source --walk link by link--> h5py.Dataset --checks--> Column
        --read(start, stop)--> shape (n,), the file's own type

A link may lead to nothing but this file. Nothing is ever unpickled or followed as an object
reference.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from tirelog.errors import ReadError, nearest
from tirelog.readers.base import RATES, rate_Hz

#: bytes of one dataset read at once; an element, all fields of a compound together, has no more
SLAB_BYTES = 1 << 24


class Slabs:
    """One slice of several columns.

    Columns of one dataset are read together, if that reads little beside them.
    """

    def __init__(self, columns: list[SourceColumn], start: int, stop: int) -> None:
        self.start, self.stop = start, stop
        self.shared: dict[Any, list[SourceColumn]] = {}
        for column in columns:
            self.shared.setdefault((column.dataset.id, column.axis), []).append(column)
        self.slabs: dict[Any, NDArray[Any]] = {}

    def read(self, column: SourceColumn) -> NDArray[Any]:
        """The column's stored values in the slice.

        One of LIBRARY_ERRORS if a chunk is damaged.
        """
        key = (column.dataset.id, column.axis)
        together = self.shared.get(key, [])
        fields_of_rows = column.field is not None and column.dataset.ndim == 1
        if (
            column not in together
            or len(together) < 2
            or not (fields_of_rows or self._narrow(column, len(together)))
        ):
            return column.read(self.start, self.stop)
        if key not in self.slabs:
            fields = sorted({c.field for c in together if c.field})
            source = column.dataset.fields(fields) if fields else column.dataset
            wide = [slice(None)] * column.dataset.ndim
            wide[column.axis] = slice(self.start, self.stop)
            self.slabs[key] = source[tuple(wide)]
        slab = self.slabs[key] if column.field is None else self.slabs[key][column.field]
        values = slab[tuple(slice(None) if at is None else at for at in column.index)]
        return column.elements(values)

    def _narrow(self, column: SourceColumn, wanted: int) -> bool:
        """True if the whole rows are few more than what is wanted of them."""
        width = column.dataset.size // max(len(column), 1)
        return (
            column.field is None
            and column.dataset.ndim == 2
            and width <= 4 * wanted
            and width * column.dtype.itemsize * (self.stop - self.start) <= SLAB_BYTES
        )


#: what h5py and libhdf5 raise on a damaged file
LIBRARY_ERRORS = (
    OSError,
    RuntimeError,
    KeyError,
    ValueError,
    TypeError,
    IndexError,
    OverflowError,
    MemoryError,
    SystemError,
    AttributeError,
)
#: a chunk with filters has to be decompressed whole
LARGEST_CHUNK_BYTES = 1 << 26
#: declared / stored bytes: deflate shrinks by 1032 at most, a dataset made larger than what was
#: recorded by some more
LARGEST_RATIO = 1 << 16
#: values looked at together for the first that is there
FIRST_VALUES = 1 << 12
#: soft links followed one after the other; more count as a circle
MOST_LINKS = 32
#: a list of a file's datasets ends at so many of them, or of objects looked at
MOST_NAMES = 5000


@dataclass(frozen=True)
class SourceColumn:
    """Numbers along the axis `axis` of a dataset.

    At `index` (None at `axis`) on the others, `field` and `element` of a compound.
    """

    path: str
    dataset: h5py.Dataset
    axis: int
    index: tuple[int | None, ...]
    field: str | None = None
    element: tuple[int, ...] = ()

    def __len__(self) -> int:
        return int(self.dataset.shape[self.axis])

    @property
    def dtype(self) -> np.dtype[Any]:
        dtype = self.dataset.dtype if self.field is None else self.dataset.dtype[self.field]
        base: np.dtype[Any] = dtype.base
        return base

    @property
    def chunk(self) -> int:
        """Samples per chunk along time (the whole length if there are no chunks)."""
        return int(self.dataset.chunks[self.axis]) if self.dataset.chunks else len(self)

    def elements(self, values: NDArray[Any]) -> NDArray[Any]:
        """The wanted element of values that may be arrays."""
        inside: tuple[Any, ...] = (slice(None), *self.element)
        return values[inside] if self.element else values

    def read(self, start: int, stop: int) -> NDArray[Any]:
        """Stored values [start, stop), shape (stop - start,).

        One of LIBRARY_ERRORS if a chunk is damaged.
        """
        source = self.dataset if self.field is None else self.dataset.fields(self.field)
        selection = tuple(slice(start, stop) if at is None else at for at in self.index)
        return self.elements(source[selection])


def refuse(path: str, what: str, allowed: str, action: str) -> ReadError:
    return ReadError(f"{path} {what}", allowed=f"allowed is {allowed}", do=action)


def refuse_first(path: str, problems: tuple[tuple[bool, str, str, str], ...]) -> None:
    """ReadError: the first of the problems (is it one, what it is, what is allowed, action)."""
    for is_one, *sentence in problems:
        if is_one:
            raise refuse(path, *sentence)


def walk(file: h5py.File, path: str, links: int = MOST_LINKS) -> h5py.Group | h5py.Dataset:
    """The object at `path`, link by link, soft links within the file followed.

    ReadError if a link leaves it or leads nowhere.
    """
    at: Any = file["/"]
    here: list[str] = []
    parts = [part for part in path.split("/") if part not in ("", ".")]
    while parts:
        name = parts.pop(0)
        link = at.get(name, getlink=True) if isinstance(at, h5py.Group) else None
        if link is None:
            raise ReadError(
                f"no dataset {path!r}{nearest(path, names(file))}",
                allowed="a source is a dataset path of the file",
                do="mend source",
            )
        if isinstance(link, h5py.ExternalLink):
            raise refuse(
                path,
                f"is an external link to {link.filename!r}",
                "data inside the log itself",
                "copy the data into one file",
            )
        if isinstance(link, h5py.SoftLink):
            if links == 0:
                raise refuse(
                    path,
                    "is a circle of soft links",
                    f"{MOST_LINKS} links",
                    "name the dataset itself",
                )
            target = link.path if link.path.startswith("/") else "/".join([*here, link.path])
            return walk(file, "/".join([target, *parts]), links - 1)
        here.append(name)
        at = at[name]
    return at


def is_foreign_type(problem: Exception) -> bool:
    """True if h5py says that a type is whole, and none that numpy has.

    H5T_TIME, or floats of quadruple precision.
    """
    return isinstance(problem, TypeError) or "Insufficient precision" in str(problem)


def _fields(dataset: h5py.Dataset) -> tuple[str, ...]:
    """The columns of a compound; none of a type that numpy does not have."""
    try:
        return dataset.dtype.names or ()
    except (TypeError, ValueError):
        return ()


def names(file: h5py.File) -> list[str]:
    """Paths of the datasets (the first MOST_NAMES), without following soft or external links."""
    found: list[str] = []
    todo: list[tuple[str, Any]] = [("", file["/"])]
    seen: set[int] = set()
    while todo and len(found) < MOST_NAMES and len(seen) < MOST_NAMES:
        prefix, group = todo.pop()
        address = h5py.h5o.get_info(group.id).addr
        if address in seen:
            continue
        seen.add(address)
        for name in group:
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                continue
            item = group[name]
            if isinstance(item, h5py.Group):
                todo.append((f"{prefix}/{name}", item))
            elif isinstance(item, h5py.Dataset):
                found.append(f"{prefix}/{name}")
                found.extend(f"{prefix}/{name}:{field}" for field in _fields(item))
    return found[:MOST_NAMES]


def dataset_and_index(
    file: h5py.File, source: str
) -> tuple[str, str | None, tuple[int | None, ...]]:
    """(dataset path, field or column, index) of a source.

    The path is as much of the source as names an object of the file, brackets, colons and blanks
    of its name too. None in the index is ':'. ReadError if it does not parse.
    """
    cuts = [len(source), *(at.start() for at in re.finditer(r"[\[:]", source))]
    length = next((cut for cut in sorted(cuts, reverse=True) if _is_there(file, source[:cut])), 0)
    path = re.escape(source[:length]) or r"[^\[\]:]+?"
    match = re.fullmatch(
        rf"(?P<path>{path})(?::(?P<field>[^\[\]]+))?(?:\[(?P<index>[\d\s,:]+)\])?\s*",
        source if length else source.strip(),
    )
    if match is None:
        raise ReadError(
            f"source {source!r} does not parse",
            allowed='allowed is "/path", "/path[3]", "/path[:, 3]" or "/table:column"',
            do="mend source",
        )
    index: list[int | None] = []
    for part in (match["index"] or "").split(",") if match["index"] else ():
        if part.strip() != ":" and not part.strip().isdigit():
            raise ReadError(
                f"source {source!r} has the index {part!r}",
                allowed="allowed are whole numbers from 0, and ':' for time",
                do="mend source",
            )
        index.append(None if part.strip() == ":" else int(part))
    return match["path"], match["field"], tuple(index)


def _is_there(file: h5py.File, path: str) -> bool:
    """Whether a path leads from link to link; where a soft link leads is not asked."""
    at: Any = file["/"]
    for part in path.split("/"):
        if part in ("", "."):
            continue
        link = at.get(part, getlink=True) if isinstance(at, h5py.Group) else None
        if not isinstance(link, h5py.HardLink):
            return link is not None
        at = at[part]
    return bool(path.strip("/. "))


def column(
    path: str, dataset: h5py.Dataset, field: str | None, index: tuple[int | None, ...]
) -> SourceColumn:
    """The column `index` of `dataset` (of its compound field `field`), checked.

    ReadError says what is refused.
    """
    check_storage(path, dataset)
    dtype = dataset.dtype
    element: tuple[int, ...] = ()
    if dtype.names:
        if field is None and len(dtype.names) == 1:
            field = dtype.names[0]
        if field not in dtype.names:
            near = nearest(field or "", dtype.names)
            raise ReadError(
                f"{path} is a table without a column {field!r}{near}",
                allowed=f"it has {', '.join(dtype.names[:20])}",
                do="add :COLUMN to source",
            )
        dtype = dtype[field]
        if dtype.shape:
            many = math.prod(dtype.shape) > 1
            element = tuple(i or 0 for i in index) if many else (0,) * len(dtype.shape)
            if len(element) != len(dtype.shape) or any(
                i >= n for i, n in zip(element, dtype.shape, strict=True)
            ):
                raise ReadError(
                    f"{path}:{field} holds arrays of shape {dtype.shape}",
                    allowed="allowed is one element [i]",
                    do="mend the index in source",
                )
            index = ()
    elif field is not None:
        raise ReadError(
            f"{path} is no table, so it has no column {field!r}",
            allowed="allowed is a path or an index",
            do="mend source",
        )
    elif dtype.shape:
        raise refuse(
            path,
            f"holds arrays of shape {dtype.shape} as its elements",
            "plain numbers",
            "store it with one more axis",
        )
    check_type(path, dtype.base if dtype.shape else dtype)
    axis, where = time_axis(path, dataset.shape, index)
    found = SourceColumn(path, dataset, axis, where, field, element)
    check_shape(found)
    return found


def check_storage(path: str, dataset: h5py.Dataset) -> None:
    if dataset.external:
        raise refuse(
            path,
            f"keeps its data in the other file {dataset.external[0][0]!r}",
            "data inside the log",
            "run h5repack on it",
        )
    if dataset.is_virtual:
        raise refuse(path, "is virtual", "a dataset that holds its data", "run h5repack on it")
    creation = dataset.id.get_create_plist()
    for which in range(creation.get_nfilters()):
        code, _, _, name = creation.get_filter(which)
        if not h5py.h5z.filter_avail(code):
            label = name.decode("utf-8", "replace") or "unnamed"
            raise refuse(
                path,
                f"is compressed by filter {code} ({label}), not installed here",
                "gzip, lzf, szip",
                "h5repack -f GZIP=4",
            )


def check_type(path: str, dtype: np.dtype[Any]) -> None:
    refuse_first(
        path,
        (
            (
                h5py.check_ref_dtype(dtype) is not None,
                "holds object references",
                "numbers",
                "name the dataset that it refers to",
            ),
            (
                dtype.kind in "SU" or h5py.check_string_dtype(dtype) is not None,
                "holds text",
                "numbers",
                "name another dataset in source",
            ),
            (
                dtype.kind == "O",
                "is an object array (lists of varying length, or pickles)",
                "numbers of one fixed type",
                "store it as numbers",
            ),
            (
                dtype.kind not in "iufb" or dtype.itemsize > 16,
                f"has the type {dtype}",
                "integers or real numbers",
                "name another dataset in source",
            ),
        ),
    )


def time_axis(
    path: str, shape: tuple[int, ...] | None, index: tuple[int | None, ...]
) -> tuple[int, tuple[int | None, ...]]:
    """(time axis, full index) for a dataset of `shape`.

    ':' marks time, else it is the longest axis (the first of equals).
    """
    if not shape:
        raise refuse(
            path,
            "is a single value",
            "a dataset with an axis of time",
            "name another dataset in source",
        )
    others = [i for i in index if i is not None]
    if index.count(None) == 1 and len(index) == len(shape):
        axis = index.index(None)
    else:
        axis = shape.index(max(shape))
        wide = [k for k, n in enumerate(shape) if k != axis and n != 1]
        if None in index or len(others) not in (len(wide), len(shape) - 1):
            what = f"has the shape {shape} and source gives {len(index)} index(es)"
            raise refuse(
                path,
                what,
                f"{len(wide)}, or one an axis with ':' for time",
                f"write e.g. {path}[{', '.join('0' * len(wide)) or ':'}]",
            )
        if len(others) == len(wide):
            given = iter(others)
            others = [next(given) if n != 1 else 0 for k, n in enumerate(shape) if k != axis]
    full: list[int | None] = list(others)
    full.insert(axis, None)
    for at, n in zip(full, shape, strict=True):
        if at is not None and at >= n:
            raise refuse(
                path,
                f"has the shape {shape}",
                f"an index from 0 to {n - 1}",
                f"mend the index {at}",
            )
    return axis, tuple(full)


def check_shape(found: SourceColumn) -> None:
    """Refuses columns that are empty or cannot be read in bounded memory.

    Also such as declare more than their file can hold.
    """
    dataset, path = found.dataset, found.path
    size = dataset.dtype.itemsize
    declared = math.prod(dataset.shape) * size
    stored = dataset.id.get_storage_size()
    chunk = math.prod(dataset.chunks) * size if dataset.chunks else 0
    filtered = dataset.id.get_create_plist().get_nfilters() > 0
    refuse_first(
        path,
        (
            (
                declared == 0,
                "holds no samples",
                "one sample or more",
                "name another dataset in source",
            ),
            (
                stored == 0 or declared > stored * LARGEST_RATIO,
                f"declares {'x'.join(map(str, dataset.shape))} values and stores {stored} bytes",
                "what the file really holds",
                "repair the file where it was written",
            ),
            (
                filtered and chunk > LARGEST_CHUNK_BYTES,
                f"has compressed chunks of {chunk >> 20} MB",
                f"{LARGEST_CHUNK_BYTES >> 20} MB",
                f"h5repack -l {path}:CHUNK=65536",
            ),
            (
                size > SLAB_BYTES,
                f"has rows of {size} bytes",
                f"{SLAB_BYTES} bytes",
                "store fewer columns",
            ),
        ),
    )


def first_number(found: SourceColumn) -> Any:
    """The first stored value that can be read and is a number, or None."""
    stored = first_stored(found)
    good = np.flatnonzero(np.isfinite(stored))
    return stored[good[0]] if good.size else None


def first_stored(found: SourceColumn) -> NDArray[Any]:
    """The first of some stored values, looked at together, that hold a number; none if none do."""
    step = min(found.chunk, FIRST_VALUES)
    for start in range(0, len(found), step):
        stop = min(start + step, len(found))
        try:
            lost = unstored(found, start, stop).any()
            stored = np.zeros(0) if lost else found.read(start, stop)
        except LIBRARY_ERRORS:
            continue
        if np.isfinite(stored).any():
            return stored
    return np.zeros(0)


# ---- Chunks that were never written, which the library gives as if they held a number.


def unstored(found: SourceColumn, start: int, stop: int) -> NDArray[np.bool_]:
    """True for the samples in [start, stop) that were never written, shape (stop - start,)."""
    dataset, lost = found.dataset, np.zeros(stop - start, bool)
    if not dataset.chunks:
        return lost
    each = zip(dataset.shape, dataset.chunks, strict=True)
    if dataset.id.get_num_chunks() >= math.prod(math.ceil(n / c) for n, c in each):
        return lost
    for first in range(start - start % found.chunk, stop, found.chunk):
        corner = tuple(
            first if i is None else i - i % size
            for i, size in zip(found.index, dataset.chunks, strict=True)
        )
        is_lost = dataset.id.get_chunk_info_by_coord(corner).byte_offset is None
        lost[max(first - start, 0) : first + found.chunk - start] = is_lost
    return lost


def kept(found: SourceColumn, step: int) -> int:
    """Samples up to the last one that was written.  Looks at `step` samples at once."""
    for stop in range(len(found), 0, -step):
        lost = unstored(found, max(stop - step, 0), stop)
        if not lost.all():
            return stop - int(np.argmin(lost[::-1]))
    return 0


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
#: of the first sample, in seconds; the first is written by the converters of other formats
START_NAMES = ("start_s", "wf_start_offset")
FILL_NAMES = ("_FillValue", "missing_value")
#: words before the unit's own spelling in attributes such as "seconds since 2026-01-01"
SINCE = re.compile(r"^\s*(\S+)\s+since\s+(.+?)\s*$", re.IGNORECASE)
#: bytes of an attribute; a larger one is not read
MOST_ATTRIBUTE_BYTES = 1 << 16


@dataclass(frozen=True)
class Scale:
    """factor x stored + offset; stored values in `lost` are lost samples."""

    factor: float
    offset: float
    lost: tuple[float, ...]

    def apply(self, stored: NDArray[Any]) -> NDArray[np.float64]:
        values = stored.astype(np.float64)
        gone = np.isin(stored, self.lost) if self.lost else None
        with np.errstate(
            over="ignore", invalid="ignore"
        ):  # a damaged number may leave the range of floats, and is lost then
            inverse = float(np.rint(1.0 / self.factor))
            if inverse and 1.0 / inverse == self.factor:
                values /= inverse  # correctly rounded, as a product with 0.001 is not
            else:
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
    for factor_name, offset_name, offset_first in SCALES:
        factor, offset = attributes.number(factor_name), attributes.number(offset_name)
        if factor is None or factor == 0.0:
            continue
        offset = offset or 0.0
        return Scale(factor, factor * offset if offset_first else offset, lost)
    return Scale(1.0, attributes.number("add_offset") or attributes.number("offset") or 0.0, lost)


def start_of(column: SourceColumn) -> float:
    """When the column's first sample was taken [s], as the file states it, or 0."""
    attributes = Attributes(column.dataset)
    return next((s for s in map(attributes.number, START_NAMES) if s is not None), 0.0)


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
        stored = {} if item is column.dataset else {name.lower(): name for name in item}
        for name, is_period in RATES.items():
            number = attributes.number(name)
            if number is None and name.lower() in stored:
                number = _stored_number(item, stored[name.lower()])
            if (rate := rate_Hz(number, is_period)) is not None:
                return rate
    return None


def _stored_number(group: h5py.Group, name: str) -> float | None:
    """The one number in the dataset `name` of `group`."""
    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
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
