"""What a run says of itself, checked before any of it is believed: whoever made the file.

    file --walk, storage, shapes (as of any HDF5 log)--> datasets
        --digest--> texts, axes, flags, samples of sizes that agree

`contents_digest` covers every group, name, link, attribute, type, shape and stored number of a run
but for the long columns (samples and explicit times), whose own sha256 stand in their attributes;
it is compared each time a run is opened. `check_columns` reads the long ones and compares theirs.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Iterator
from typing import Any

import h5py
import numpy as np

from tirelog.data.recording import TimeAxis
from tirelog.errors import ReadError
from tirelog.readers.hdf5.layout import MOST_ATTRIBUTE_BYTES, as_number
from tirelog.readers.hdf5.source import (
    LIBRARY_ERRORS,
    SourceColumn,
    check_shape,
    check_storage,
    check_type,
    refuse,
    walk,
)
from tirelog.storage.whole import json_of
from tirelog.vocabulary.quality import Doubt, Quality, flag_of

#: samples per chunk of a run
CHUNK = 1 << 15
#: what of a run may be there
_WRITTEN = "what `tirelog ingest` writes"
DIGEST = "contents_sha256"
COLUMN_DIGEST = "sha256"
#: bytes of the provenance's text: one line for each chunk of ten hours that is damaged takes less
LARGEST_TEXT_BYTES = 1 << 24
#: numbers of a small dataset: a segment or a flag each
LARGEST_LIST = 1 << 24
#: objects in a run: ten thousand channels with their flags
MOST_OBJECTS = 1 << 16
#: seconds from a log's start: a clock that jumps from 1970 to today stays below
LATEST_S = 1e11
#: largest rate that a run may state [Hz]
FASTEST_HZ = 1e9
#: what a provenance is made of, as far as commands rely on it
_PROVENANCE = {
    "losses?": [object],
    "remarks?": [object],
    "repairs?": {str: {str: int}},
    "counts?": {str: int},
}


def _refuse(path: str, *checks: tuple[object, str, str]) -> None:
    """ReadError for the first check (wrong, what, what is allowed) that is `wrong`."""
    for wrong, what, allowed in checks:
        if wrong:
            raise refuse(path, what, allowed, "ingest the log again")


def dataset_at(
    file: h5py.File, path: str, kind: str = "", chunk: int | None = None
) -> h5py.Dataset:
    """The dataset at `path`, one axis long, of numbers of a `kind`. ReadError says what is refused.

    `chunk` is the length that its chunks must have: what is read at once is then bounded.
    """
    return _checked(path, walk(file, path), kind, chunk)


def _checked(path: str, item: Any, kind: str = "", chunk: int | None = None) -> h5py.Dataset:
    """The dataset `item`, as of `dataset_at`."""
    _refuse(path, (not isinstance(item, h5py.Dataset), "is no dataset", _WRITTEN))
    check_storage(path, item)
    text, size = item.dtype.kind == "S", item.dtype.itemsize
    if not text:
        check_type(path, item.dtype)
    plain = item.ndim == 1 and size <= (256 if text else 8) and item.dtype.kind in (kind or "iufbS")
    chunks = f"has chunks of {item.chunks} values"
    _refuse(
        path,
        (not plain, f"has the shape {item.shape} and the type {item.dtype}", "a list of numbers"),
        (chunk is not None and item.chunks != (chunk,), chunks, f"{chunk}"),
    )
    if item.size:
        check_shape(SourceColumn(path, item, 0, (None,)))
    if item.size and item.chunks:
        most, largest = item.chunks[0] * size, [0]
        item.id.chunk_iter(lambda stored: largest.__setitem__(0, max(largest[0], stored.size)))
        # larger than the filters make of one, it would grow without end
        grows = largest[0] > most + most // 64 + 64
        inside = f"has a chunk of {largest[0]} bytes for {most}"
        _refuse(path, (grows, inside, "what the chunk holds"))
    return item


def text_at(file: h5py.File, path: str, largest: int) -> str:
    """The text at `path`, as the bytes of a dataset."""
    dataset = dataset_at(file, path, "u")
    what = f"has {dataset.size} values of the type {dataset.dtype}"
    plain = dataset.dtype == np.uint8 and dataset.size <= largest
    other = attribute(dataset, "size") != dataset.size
    _refuse(
        path,
        (not plain, what, f"{largest} bytes of text"),
        (other, "has another size than it says", "one size"),
    )
    return bytes(dataset[:]).decode("utf-8")


def _plain(item: h5py.Group | h5py.Dataset, name: str) -> Any:
    """An attribute's value, None if there is none.

    Also None if it lies in the heap, which has no checksum.
    """
    try:
        handle = item.attrs.get_id(name)
        kind = handle.dtype
        if (
            kind.kind not in "iufbS"
            or math.prod(handle.shape) * kind.itemsize > MOST_ATTRIBUTE_BYTES
        ):
            return None
        value = np.empty(handle.shape, kind)
        handle.read(value)
    except LIBRARY_ERRORS:
        return None
    return value[()]


def attribute(item: h5py.Group | h5py.Dataset, name: str) -> float:
    """A number among the attributes.  ReadError: there is none."""
    value = as_number(_plain(item, name))
    _refuse(str(item.name), (value is None, f"has no number {name}", _WRITTEN))
    assert value is not None
    return value


def text_in(item: h5py.Group | h5py.Dataset, name: str) -> str:
    """A text among the attributes, '' if there is none."""
    value = _plain(item, name)
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else ""


def provenance_at(file: h5py.File) -> dict[str, Any]:
    """The provenance.  ValueError: a part is not of the kind that the commands rely on."""
    told: dict[str, Any] = json_of(text_at(file, "provenance", LARGEST_TEXT_BYTES), _PROVENANCE)
    lines = {key: [str(line) for line in told.get(key) or ()] for key in ("losses", "remarks")}
    return {**told, **lines}


def axis_at(file: h5py.File, name: str) -> TimeAxis:
    """The time axis of a group: finite, forwards, as long as it says."""
    path = f"groups/{name}"
    place = walk(file, path)
    _refuse(path, (not isinstance(place, h5py.Group), "is no group", _WRITTEN))
    size, rate = attribute(place, "size"), attribute(place, "rate_Hz")
    wrong = size != int(size) or size < 0 or not 0.0 < rate <= FASTEST_HZ
    _refuse(path, (wrong, f"has {size:g} samples at {rate:g} Hz", "a whole number and a rate"))
    if "time_s" in place:
        return _explicit(file, f"{path}/time_s", int(size), rate)
    kinds = {"first": "iu", "start_s": "f", "period_s": "f"}
    parts = [dataset_at(file, f"{path}/{key}", kind) for key, kind in kinds.items()]
    sizes = [part.size for part in parts]
    wrong = len(set(sizes)) > 1 or not 0 < sizes[0] <= LARGEST_LIST
    _refuse(path, (wrong, f"has segments of {sizes} parts", "one number each"))
    first, start, period = (part[:] for part in parts)
    apart = "has segments that do not follow each other"
    in_order = first[0] == 0 and (np.diff(first) > 0).all() and first[-1] <= max(int(size) - 1, 0)
    steps = (period > 0).all() and period.max() <= LATEST_S
    wrong = not (in_order and steps and _rises(start))
    _refuse(path, (wrong, apart, "times that grow"))
    first, start, period = first.astype(np.int64), start.astype(float), period.astype(float)
    return TimeAxis(int(size), rate, first, start, period)


def _rises(times_s: np.ndarray, last_s: float = -LATEST_S) -> bool:
    """Whether times [s], shape (n,), are finite and none is before another or `last_s`."""
    steps = np.diff(times_s, prepend=last_s)
    return bool((steps >= 0.0).all() and (np.abs(times_s) <= LATEST_S).all())


def _explicit(file: h5py.File, path: str, size: int, rate: float) -> TimeAxis:
    """An axis of one time for each sample.

    All are looked at: a damaged one has no time to lose it at.
    """
    times = dataset_at(file, path, "f", chunk=max(min(CHUNK, size), 1))
    _refuse(path, (times.size != size, f"has {times.size} times for {size} samples", "one each"))
    last = -LATEST_S
    for start in range(0, size, CHUNK):
        part = times[start : start + CHUNK]
        falls = not _rises(part, last)
        _refuse(path, (falls, "has times that do not follow each other", "times that grow"))
        last = part[-1]
    none = np.zeros(0)

    def explicit(start: int, stop: int) -> np.ndarray:
        check_open(bool(times))
        stored: np.ndarray = times[start:stop].astype(np.float64)
        return stored

    return TimeAxis(size, rate, none.astype(np.int64), none, none, explicit)


def flags_at(file: h5py.File, name: str, size: int, foreign: set[str]) -> tuple[Doubt, ...]:
    """The flags of a channel of `size` samples.

    A word that is not of the register comes to `foreign`, and is a foreign doubt.
    """
    path = f"flags/{name}"
    if "flags" not in file or name not in walk(file, "flags"):
        return ()
    kinds = {"start": "iu", "stop": "iu", "word": "S"}
    start, stop, words = (dataset_at(file, f"{path}/{key}", kind) for key, kind in kinds.items())
    same = start.size == stop.size == words.size <= LARGEST_LIST
    _refuse(path, (not same, "has flags of several sizes", "one size"))
    texts = [word.decode("utf-8") for word in words[:]]
    foreign |= {text for text in texts if flag_of(text) is None}
    found = tuple(
        (int(a), int(b), flag_of(text) or Quality.FOREIGN_DOUBT)
        for a, b, text in zip(start[:], stop[:], texts, strict=True)
    )
    outside = any(not 0 <= a <= b <= size for a, b, _ in found)
    _refuse(path, (outside, f"has flags outside of the {size} samples", "flags of samples"))
    return found


def check_open(opened: bool) -> None:
    """ReadError if a run is not open any more."""
    if not opened:
        raise ReadError(
            "the recording is closed",
            allowed="its samples can be read while `open_recording` is open, and in a session "
            "until the next log is taken",
            do="read them there, or open it again",
        )


# ---- digests -------------------------------------------------------------------------------------


def contents_digest(file: h5py.File) -> str:
    """sha256 of all that stands in the file but for the long columns' numbers."""
    found = hashlib.sha256()
    for path, item in _objects(file):
        what = "group" if isinstance(item, h5py.Group) else f"{item.dtype.str}{item.shape}"
        found.update(f"{path}\0{what}\0".encode())
        for name in sorted(item.attrs):
            if path or name != DIGEST:
                value = _plain(item, name)
                inside = "numbers and short texts"
                _refuse(f"{path}.{name}", (value is None, "is no plain attribute", inside))
                value = np.asarray(value)
                found.update(f"{name}\0{value.dtype.str}{value.shape}\0".encode() + value.tobytes())
        if isinstance(item, h5py.Dataset) and not is_long(path):
            found.update(_checked(path, item)[:].tobytes())
    return found.hexdigest()


def is_long(path: str) -> bool:
    """True for samples and explicit times, which have digests of their own."""
    return path.startswith("channels/") or path.endswith("/time_s")


def _objects(file: h5py.File) -> Iterator[tuple[str, Any]]:
    """(path, object) of all that a file holds, in the order of their paths.

    ReadError: a link that is no plain one.
    """
    todo: list[tuple[str, Any]] = [("", file["/"])]
    seen = 0
    while todo:
        path, item = todo.pop()
        yield path, item
        seen += 1
        if isinstance(item, h5py.Group):
            names = sorted(item, reverse=True)
            many = seen + len(todo) + len(names) > MOST_OBJECTS
            _refuse("/", (many, "holds too many objects", f"{MOST_OBJECTS}"))
            for name in names:
                elsewhere = not isinstance(item.get(name, getlink=True), h5py.HardLink)
                what = "is a link to elsewhere"
                _refuse(f"{path}/{name}", (elsewhere, what, "data inside the run"))
            todo += [(f"{path}/{name}".lstrip("/"), item[name]) for name in names]


def digest_of(parts: Iterable[np.ndarray]) -> str:
    """sha256 of the numbers of a long column, part by part, little-endian, in their order."""
    found = hashlib.sha256()
    for part in parts:
        found.update(part.astype(part.dtype.newbyteorder("<"), copy=False).tobytes())
    return found.hexdigest()


def check_columns(file: h5py.File) -> list[str]:
    """Names of the long columns that are not what was written, each read whole."""
    wrong = []
    for path, item in _objects(file):
        if isinstance(item, h5py.Dataset) and is_long(path):
            column, starts = _checked(path, item), range(0, item.size, 4 * CHUNK)
            try:
                digest = digest_of(column[start : start + 4 * CHUNK] for start in starts)
            except OSError:
                digest = "damaged"
            if digest != text_in(item, COLUMN_DIGEST):
                wrong.append(path.removeprefix("channels/"))
    return wrong
