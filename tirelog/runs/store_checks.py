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
from collections.abc import Iterator
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
from tirelog.storage.whole import json_value
from tirelog.vocabulary.quality import Doubt, Quality, flag_of

#: samples per chunk of a run
CHUNK = 1 << 15
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
_PROVENANCE = {"losses": list, "remarks": list, "repairs": dict, "counts": dict}


def dataset_at(
    file: h5py.File, path: str, kind: str = "", chunk: int | None = None
) -> h5py.Dataset:
    """The dataset at `path`, one axis long, of numbers of a `kind`. ReadError says what is refused.

    `chunk` is the length that its chunks must have: what is read at once is then bounded.
    """
    return _checked(path, walk(file, path), kind, chunk)


def _checked(path: str, item: Any, kind: str = "", chunk: int | None = None) -> h5py.Dataset:
    """The dataset `item`, as of `dataset_at`."""
    if not isinstance(item, h5py.Dataset):
        raise refuse(path, "is no dataset", "what `tirelog ingest` writes", "ingest the log again")
    check_storage(path, item)
    if item.dtype.kind != "S":
        check_type(path, item.dtype)
    wide = item.dtype.itemsize > (256 if item.dtype.kind == "S" else 8)
    if item.ndim != 1 or wide or (kind and item.dtype.kind not in kind):
        raise refuse(
            path,
            f"has the shape {item.shape} and the type {item.dtype}",
            "a list of plain numbers",
            "ingest the log again",
        )
    if chunk is not None and item.chunks != (chunk,):
        raise refuse(
            path, f"has chunks of {item.chunks} values", f"{chunk}", "ingest the log again"
        )
    if item.size:
        check_shape(SourceColumn(path, item, 0, (None,)))
        _check_chunks(path, item)
    return item


def _check_chunks(path: str, dataset: h5py.Dataset) -> None:
    """Refuses a stored chunk that is larger than the filters make of one.

    It would grow without end.
    """
    if not dataset.chunks:
        return
    most = dataset.chunks[0] * dataset.dtype.itemsize
    largest = [0]
    dataset.id.chunk_iter(lambda chunk: largest.__setitem__(0, max(largest[0], chunk.size)))
    if largest[0] > most + most // 64 + 64:
        raise refuse(
            path,
            f"has a chunk of {largest[0]} bytes for {most}",
            "what the chunk holds",
            "ingest the log again",
        )


def text_at(file: h5py.File, path: str, largest: int) -> str:
    """The text at `path`, as the bytes of a dataset."""
    dataset = dataset_at(file, path, "u")
    if dataset.dtype != np.uint8 or dataset.size > largest:
        raise refuse(
            path,
            f"has {dataset.size} values of the type {dataset.dtype}",
            f"{largest} bytes of text",
            "ingest the log again",
        )
    if attribute(dataset, "size") != dataset.size:
        raise refuse(path, "has another size than it says", "one size", "ingest the log again")
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
    if value is None:
        raise refuse(
            str(item.name),
            f"has no number {name}",
            "what `tirelog ingest` writes",
            "ingest the log again",
        )
    return value


def text_in(item: h5py.Group | h5py.Dataset, name: str) -> str:
    """A text among the attributes, '' if there is none."""
    value = _plain(item, name)
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else ""


def provenance_at(file: h5py.File) -> dict[str, Any]:
    """The provenance, each part of the kind that the commands rely on."""
    told = json_value(text_at(file, "provenance", LARGEST_TEXT_BYTES))
    if not isinstance(told, dict):
        raise ReadError(
            "the run's provenance is no table",
            allowed="allowed is what `tirelog ingest` writes",
            do="ingest the log again",
        )
    for key, kind in _PROVENANCE.items():
        if not isinstance(told.get(key, kind()), kind):
            raise ReadError(
                f"the run's provenance has {key} that are no {kind.__name__}",
                do="ingest the log again",
            )
    repairs = told.get("repairs", {}).values()
    counts = [told.get("counts", {}), *repairs]
    if not all(
        isinstance(table, dict) and all(isinstance(n, int) for n in table.values())
        for table in counts
    ):
        raise ReadError(
            "the run's provenance counts what are no numbers", do="ingest the log again"
        )
    lines = {key: [str(line) for line in told.get(key, [])] for key in ("losses", "remarks")}
    return {**told, **lines}


def axis_at(file: h5py.File, name: str) -> TimeAxis:
    """The time axis of a group: finite, forwards, as long as it says."""
    path = f"groups/{name}"
    place = walk(file, path)
    if not isinstance(place, h5py.Group):
        raise refuse(path, "is no group", "what `tirelog ingest` writes", "ingest the log again")
    size, rate = attribute(place, "size"), attribute(place, "rate_Hz")
    if size != int(size) or size < 0 or not 0.0 < rate <= FASTEST_HZ:
        raise refuse(
            path,
            f"has {size:g} samples at {rate:g} Hz",
            "a whole number and a rate",
            "ingest the log again",
        )
    if "time_s" in place:
        return _explicit(file, f"{path}/time_s", int(size), rate)
    kinds = {"first": "iu", "start_s": "f", "period_s": "f"}
    parts = [dataset_at(file, f"{path}/{key}", kind) for key, kind in kinds.items()]
    if len({part.size for part in parts}) > 1 or not 0 < parts[0].size <= LARGEST_LIST:
        raise refuse(
            path,
            f"has segments of {[part.size for part in parts]} parts",
            "one number each",
            "ingest the log again",
        )
    first, start, period = (part[:] for part in parts)
    forwards = first[0] == 0 and (np.diff(first) > 0).all() and first[-1] <= max(int(size) - 1, 0)
    finite = (
        np.isfinite(start).all() and np.abs(start).max() <= LATEST_S and np.isfinite(period).all()
    )
    if (
        not forwards
        or not finite
        or not (np.diff(start) >= 0).all()
        or not (period > 0).all()
        or period.max() > LATEST_S
    ):
        raise refuse(
            path,
            "has segments that do not follow each other",
            "times that grow",
            "ingest the log again",
        )
    return TimeAxis(
        int(size), rate, first.astype(np.int64), start.astype(np.float64), period.astype(np.float64)
    )


def _explicit(file: h5py.File, path: str, size: int, rate: float) -> TimeAxis:
    """An axis of one time for each sample.

    All are looked at: a damaged one has no time to lose it at.
    """
    times = dataset_at(file, path, "f", chunk=max(min(CHUNK, size), 1))
    if times.size != size:
        raise refuse(
            path, f"has {times.size} times for {size} samples", "one each", "ingest the log again"
        )
    last = -np.inf
    for start in range(0, size, CHUNK):
        part = times[start : start + CHUNK]
        if (
            not np.isfinite(part).all()
            or part[0] < last
            or (np.diff(part) < 0).any()
            or np.abs(part).max() > LATEST_S
        ):
            raise refuse(
                path,
                "has times that do not follow each other",
                "times that grow",
                "ingest the log again",
            )
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
    if not start.size == stop.size == words.size <= LARGEST_LIST:
        raise refuse(path, "has flags of several sizes", "one size", "ingest the log again")
    texts = [word.decode("utf-8") for word in words[:]]
    foreign |= {text for text in texts if flag_of(text) is None}
    found = tuple(
        (int(a), int(b), flag_of(text) or Quality.FOREIGN_DOUBT)
        for a, b, text in zip(start[:], stop[:], texts, strict=True)
    )
    if any(not 0 <= a <= b <= size for a, b, _ in found):
        raise refuse(
            path,
            f"has flags outside of the {size} samples",
            "flags of samples",
            "ingest the log again",
        )
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
                if value is None:
                    raise refuse(
                        f"{path}.{name}",
                        "is no plain attribute",
                        "numbers and short texts",
                        "ingest the log again",
                    )
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
            if seen + len(todo) + len(names) > MOST_OBJECTS:
                raise refuse(
                    "/", "holds too many objects", f"{MOST_OBJECTS}", "ingest the log again"
                )
            for name in names:
                if not isinstance(item.get(name, getlink=True), h5py.HardLink):
                    raise refuse(
                        f"{path}/{name}",
                        "is a link to elsewhere",
                        "data inside the run",
                        "ingest the log again",
                    )
            todo += [(f"{path}/{name}".lstrip("/"), item[name]) for name in names]


def column_digest(dataset: h5py.Dataset) -> str:
    """sha256 of a long column's numbers, little-endian, in their order."""
    found = hashlib.sha256()
    for start in range(0, dataset.size, 4 * CHUNK):
        part = dataset[start : start + 4 * CHUNK]
        found.update(part.astype(part.dtype.newbyteorder("<"), copy=False).tobytes())
    return found.hexdigest()


def check_columns(file: h5py.File) -> list[str]:
    """Names of the long columns that are not what was written, each read whole."""
    wrong = []
    for path, item in _objects(file):
        if isinstance(item, h5py.Dataset) and is_long(path):
            try:
                same = column_digest(_checked(path, item)) == text_in(item, COLUMN_DIGEST)
            except OSError:
                same = False
            wrong += [] if same else [path.removeprefix("channels/")]
    return wrong
