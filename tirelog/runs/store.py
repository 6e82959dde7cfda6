"""A run: what a log becomes, in flat files while a command is at work, or kept as one HDF5 file.

    raw blocks --RunWriter--> Run of flat files --recording_of--> Recording
                                   |     ^
                              write_file  open_run
                                   v     |
    HDF5 that any tool can open, written whole or not at all, checksummed throughout:

    /                   tirelog_run = format version; contents_sha256
    /setup              bytes of the setup's text       /provenance     JSON: source, sha256,
                        version, repairs, remarks, losses
    /groups/<group>     first, start_s, period_s (segments of the time axis) or time_s; attribute
                        rate_Hz, size
    /channels/<name>    samples as the source wrote them: int32 counts of 10^-decimals (INT32_MIN
                        where lost), else float32 or float64 (NaN where lost); attributes group,
                        kind, unit, scale_factor, add_offset (stored number to SI), decimals
    /flags/<name>       start, stop, word

Data chunks carry fletcher32, and the file is of HDF5's "v110" kind, whose metadata has checksums
too; nothing is of variable length, as HDF5's heap has none. A flipped bit is found when it is read:
a chunk of samples becomes NaN, and the recording's losses say so; anywhere else the run is refused.
Format 1, which kept its texts in the heap, is not read.

A run is checked before any of it is believed: `contents_digest` covers every group, name, link,
attribute, type, shape and stored number but for the long columns. These are samples and explicit
times, which have the checksums of their chunks. The digest is compared each time a run is opened,
after which its contents are what `ingest` wrote. How the file stores them is checked for each
dataset, as of any HDF5 file.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import LOST_COUNT, Channel, Recording, Scaled, TimeAxis
from tirelog.data.setup import ChannelSetup, Setup, parse_setup
from tirelog.dsp.filters import even_axis
from tirelog.errors import ReadError, SetupError, printable
from tirelog.readers.hdf5.source import (
    LIBRARY_ERRORS,
    MOST_ATTRIBUTE_BYTES,
    SourceColumn,
    as_number,
    check_shape,
    check_storage,
    check_type,
    refuse,
    walk,
)
from tirelog.runs.in_memory import without_codes, without_repeats
from tirelog.runs.temporary import CHUNK, Run, Stored, check_open, scaled_to_si
from tirelog.storage.whole import json_of
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import KINDS, SLOW_KINDS, STRAIN_KINDS
from tirelog.vocabulary.quality import Doubt, Quality, flag_of

#: of the run's layout; another one is refused
FORMAT_VERSION = 2
#: samples beyond a slice that are looked at for the readings of a twin grating on either side of a
#: lost one; twice as many bridge gaps in the temperature that are twice as long by a straight line
_TWIN_REACH = 4096
#: of each dataset, two chunks; the default of HDF5 2 is 8 MB, which many channels multiply
_CACHE_BYTES = 1 << 18
#: how a kept run's samples are stored
_FILTERS = {"compression": "gzip", "compression_opts": 1, "shuffle": True, "fletcher32": True}
#: what of a run may be there
_WRITTEN = "what `tirelog ingest` writes"
DIGEST = "contents_sha256"
#: what a provenance is made of, as far as commands rely on it
_PROVENANCE = {
    "losses?": [object],
    "remarks?": [object],
    "repairs?": {str: {str: int}},
    "counts?": {str: int},
    "sha256?": str,
    "bytes?": int,
}


def write_file(run: Run, path: Path) -> None:
    """Write a run to `path`, which the caller makes whole or removes."""
    with h5py.File(path, "w", libver=("v110", "v110"), rdcc_nbytes=_CACHE_BYTES) as file:
        file.attrs["tirelog_run"] = FORMAT_VERSION
        for name, axis in run.axes.items():
            _write_axis(file.create_group(f"groups/{name}"), axis)
        for name, stored in run.channels.items():
            _write_channel(file, name, stored, run.setup.channels[name])
            if stored.flags:
                flags = file.create_group(f"flags/{name}")
                starts, stops, words = zip(*stored.flags, strict=True)
                columns = {"start": np.array(starts, np.int64), "stop": np.array(stops, np.int64)}
                columns |= {"word": np.array([flag.word.encode() for flag in words])}
                for key, values in columns.items():
                    flags.create_dataset(key, data=values, chunks=True, fletcher32=True)
        _write_text(file, "setup", run.setup.text)
        _write_text(file, "provenance", json.dumps(run.provenance, default=str))
        file.attrs[DIGEST] = np.bytes_(contents_digest(file))


def _write_text(file: h5py.File, name: str, text: str) -> None:
    stored = np.frombuffer(text.encode("utf-8", "backslashreplace"), np.uint8)
    file.create_dataset(name, data=stored, chunks=True, fletcher32=True)


def _write_axis(place: h5py.Group, axis: TimeAxis) -> None:
    place.attrs.update(rate_Hz=axis.rate_Hz, size=axis.size)
    if axis.rate_error:
        place.attrs["rate_error"] = axis.rate_error
    if axis.explicit is not None:
        # HDF5 refuses a chunk that is longer than a dataset of fixed size, as a few stamps are
        chunks = (min(CHUNK, axis.size),)
        times = place.create_dataset(
            "time_s", shape=(axis.size,), dtype="f8", chunks=chunks, fletcher32=True
        )
        _write_column(times, axis.explicit)
        return
    for key in ("first", "start_s", "period_s"):
        place.create_dataset(key, data=getattr(axis, key), chunks=True, fletcher32=True)


def _write_column(dataset: h5py.Dataset, read: Callable[[int, int], NDArray[Any]]) -> None:
    """Fill a long column."""
    for start in range(0, dataset.size, CHUNK):
        dataset[start : start + CHUNK] = read(start, min(start + CHUNK, dataset.size))


def _write_channel(file: h5py.File, name: str, stored: Stored, channel: ChannelSetup) -> None:
    """The samples, and what a reader of the file has to know about them."""
    dataset = file.create_dataset(
        f"channels/{name}",
        shape=(stored.size,),
        maxshape=(None,),
        chunks=(CHUNK,),
        dtype=stored.dtype,
        **_FILTERS,
    )
    _write_column(dataset, lambda start, stop: stored.read(start, stop, []))
    factor, offset = scaled_to_si(channel)
    unit = KINDS[channel.kind].to_si(channel.source_unit)[2]
    words = {"group": stored.group, "kind": channel.kind, "unit": unit, "source": channel.source}
    words |= {"source_unit": channel.source_unit}
    for key, text in words.items():  # of a fixed length: HDF5's heap has no checksum
        dataset.attrs[key] = np.bytes_(text.encode("utf-8", "backslashreplace") or b"\0")
    scale = factor / 10.0 ** max(stored.decimals, 0)
    dataset.attrs.update(scale_factor=scale, add_offset=offset, decimals=stored.decimals)
    if stored.dtype.kind == "i":
        dataset.attrs["_FillValue"] = np.int32(LOST_COUNT)


def is_run(path: Path | str) -> bool:
    """True if `path` is an HDF5 file that `ingest` wrote, and says so."""
    try:
        with h5py.File(path, "r") as file:
            return "tirelog_run" in file.attrs
    except LIBRARY_ERRORS:
        return False


@contextmanager
def open_run(path: Path | str, log: str, setup: Setup | None = None) -> Iterator[Recording]:
    """The run at `path` as a Recording that reads its channels in slices while the context is open.

    `setup` as of `recording_of`. ReadError: not a run, or its inside is damaged.
    """
    with ExitStack() as opened:
        try:
            file = opened.enter_context(h5py.File(path, "r", rdcc_nbytes=_CACHE_BYTES))
            recording = recording_of(_checked_run(file, log), log, setup)
        except (ReadError, *LIBRARY_ERRORS, RecursionError) as problem:
            raise ReadError(
                f"the run is damaged or none of ours ({getattr(problem, 'what', _short(problem))})",
                allowed="a run is what `tirelog ingest` writes",
                do="copy it again, or ingest the log again",
                file=log,
            ) from None
        yield recording


def _short(problem: BaseException) -> str:
    return str(problem).splitlines()[0][:120] if str(problem) else type(problem).__name__


def _checked_run(file: h5py.File, log: str) -> Run:
    """What the file says, once all of it but the samples is known to be what was written."""
    version = attribute(file, "tirelog_run")
    if version != FORMAT_VERSION:
        raise ReadError(
            f"it is of format {version:g}",
            allowed=f"this tirelog reads {FORMAT_VERSION}",
            do="ingest the log again",
        )
    if contents_digest(file) != text_in(file, DIGEST):
        raise ReadError(
            "its contents are not those that were written (sha256)",
            do="copy it again, or ingest the log again",
        )
    # ValueError: a part is not of the kind that the commands rely on
    provenance = {"bytes": 0} | json_of(text_at(file, "provenance"), _PROVENANCE)
    for key in ("losses", "remarks"):
        provenance[key] = [str(line) for line in provenance.get(key) or ()]
    setup = parse_setup(text_at(file, "setup"), str(provenance.get("setup_file") or log))
    axes = {name: axis_at(file, name) for name in walk(file, "groups")}
    foreign: set[str] = set()
    held = walk(file, "channels")
    channels = {
        name: _stored_at(file, name, axes, foreign) for name in setup.channels if name in held
    }
    return Run(setup, axes, channels, provenance, foreign)


def _stored_at(
    file: h5py.File, name: str, axes: Mapping[str, TimeAxis], foreign: set[str]
) -> Stored:
    """A channel of a file, whose samples are checked when they are read."""
    dataset = dataset_at(file, f"channels/{name}", "if", chunk=CHUNK)
    group = text_in(dataset, "group")
    size = axes[group].size
    what = f"has {dataset.size} samples and {size} times"
    _refuse(f"channel {name}", (dataset.size != size, what, "one each"))

    def read(start: int, stop: int, losses: list[str]) -> NDArray[Any]:
        check_open(bool(dataset))
        return _read(dataset, start, stop, name, losses)

    return Stored(
        group,
        text_in(dataset, "kind"),
        text_in(dataset, "source_unit"),
        size,
        dataset.dtype,
        attribute(dataset, "decimals"),
        read,
        flags_at(file, name, foreign),
    )


def recording_of(run: Run, log: str, setup: Setup | None = None) -> Recording:
    """A run as a Recording.

    `setup` replaces the run's own: tire, conditions and the conversions of channels of the same
    name. SetupError: a channel of it is of another kind.
    """
    own = _with_units(run.setup, run)
    setup = _with_units(setup, run) if setup else own
    losses: list[str] = run.provenance["losses"]
    said: list[str] = []
    channels: dict[str, Channel] = {}
    for name, known in own.channels.items():
        if name not in run.channels:
            continue
        stored = run.channels[name]
        used = setup.channels.get(name, known)
        if used.kind != known.kind:
            raise SetupError(
                f"channel {name} is {known.kind} in the run, {used.kind} in the setup",
                do="mend the setup",
                file=log,
            )
        axis = run.axes[stored.group]
        # what is damaged is reported when it is asked for
        quiet = _channel(name, stored, used, axis, [])
        whole = _channel(name, stored, used, axis, losses)
        mended = without_codes if used.kind in SLOW_KINDS else without_repeats
        channels[name], remark = mended(whole, quiet)
        said += [f"{name}: {remark}"] if remark else []
    for name, used in setup.channels.items():
        twin = used.temperature_channel
        if name in channels and twin in channels and used.thermal_expansion_1_K:
            channels[name] = _compensated(
                channels[name], channels[twin], used.thermal_expansion_1_K
            )
    for name, channel in channels.items():
        even = even_axis(channel) if channel.kind in STRAIN_KINDS else None
        if even is not None:
            channels[name] = replace(channel, axis=even)
            said.append(f"{name}: its samples are even, the stamps scatter about their times")
    if run.foreign:
        # a foreign run may have many words, and long ones
        some = sorted(run.foreign)[:5]
        shown = ", ".join(printable(word[:40]) for word in some)
        said.append(
            f"the run has doubts that this version of tirelog does not know ({shown}); the rows "
            f"about them are marked {Quality.FOREIGN_DOUBT.word}; read it with the version that "
            "wrote it, or ingest the log again"
        )
    order = dict.fromkeys([*setup.channels, *channels])
    return Recording(
        log,
        {name: channels[name] for name in order if name in channels},
        setup,
        run.provenance,
        (*run.provenance.get("remarks", ()), *said),
        losses,
    )


def _with_units(setup: Setup, run: Run) -> Setup:
    """The setup with the units that were taken from the log itself, if it names none.

    The run keeps them with its samples.
    """
    channels = dict(setup.channels)
    for name, channel in setup.channels.items():
        stored = run.channels.get(name)
        if channel.unit is None and stored is not None and stored.kind == channel.kind:
            KINDS[channel.kind].to_si(stored.unit)
            channels[name] = replace(channel, unit=stored.unit)
    return replace(setup, channels=channels)


def _channel(
    name: str, stored: Stored, channel: ChannelSetup, axis: TimeAxis, losses: list[str]
) -> Channel:
    """A channel whose samples are read, and scaled to SI, slice by slice."""
    factor, offset = scaled_to_si(channel)
    counts = stored.dtype.kind == "i"
    scale = factor / 10.0 ** max(int(stored.decimals), 0)
    samples = Scaled(
        lambda start, stop: stored.read(start, stop, losses),
        scale,
        offset,
        LOST_COUNT if counts else None,
    )
    more = {
        key: getattr(channel, key)
        for key in ("steps", "gauge_length_m")
        if getattr(channel, key) is not None
    }
    return Channel(
        name,
        channel.kind,
        KINDS[channel.kind].to_si(channel.source_unit)[2],
        axis,
        samples,
        channel.surface or "outer",
        abs(scale) if counts else 0.0,
        stored.flags,
        more,
        at_hand=stored.at_hand,
    )


def _read(dataset: h5py.Dataset, start: int, stop: int, name: str, losses: list[str]) -> np.ndarray:
    """Stored numbers [start, stop); a chunk that fails its checksum is lost, with one loss."""
    try:
        return np.asarray(dataset[start:stop])
    except LIBRARY_ERRORS:
        missing = LOST_COUNT if dataset.dtype.kind == "i" else np.nan
        out = np.full(max(stop - start, 0), missing, dataset.dtype)
        for first in range(start - start % CHUNK, stop, CHUNK):
            low, high = max(first, start), min(first + CHUNK, stop)
            try:
                out[low - start : high - start] = dataset[low:high]
            except LIBRARY_ERRORS:
                loss = (
                    f"channel {name}: samples {first} to {first + CHUNK - 1} are damaged "
                    "(checksum); they count as lost"
                )
                if loss not in losses:
                    losses.append(loss)
        return out


def _compensated(strain: Channel, twin: Channel, expansion_1_K: float) -> Channel:
    """Strain without the thermal expansion that its unbonded twin grating reads.

    That is the last term of P1 (1).
    """
    plain: Callable[[int, int], FloatArray] = strain.samples

    def samples(start: int, stop: int) -> FloatArray:
        at = np.arange(start, stop, dtype=np.float64)
        if twin.axis is not strain.axis:
            at = twin.axis.index(strain.axis.time(start, stop))
        low = max(int(at.min(initial=0.0)) - _TWIN_REACH, 0)
        near = twin.read(low, int(at.max(initial=0.0)) + 2 + _TWIN_REACH)
        return plain(start, stop) - expansion_1_K * _bridged(near, at - low)

    return replace(strain, samples=samples, at_hand=False, recorded=strain)


def _bridged(values: FloatArray, at: FloatArray) -> FloatArray:
    """`values` at fractional indices, straight over lost samples: temperature is slow.

    Between the nearest readings on either side within reach, else as the one that is, else NaN:
    what comes out depends on the sample alone and not on the slice that is read, so block sizes do
    not matter.
    """
    known = np.flatnonzero(np.isfinite(values))
    if not known.size:
        return np.full(at.shape, np.nan)
    after = np.searchsorted(known, at)
    left, right = known[np.maximum(after - 1, 0)], known[np.minimum(after, known.size - 1)]
    has_left, has_right = (
        (after > 0) & (at - left <= _TWIN_REACH),
        (after < known.size) & (right - at <= _TWIN_REACH),
    )
    share = np.where(right > left, (at - left) / np.maximum(right - left, 1), 1.0)
    both = values[left] + share * (values[right] - values[left])
    one = np.where(has_left, values[left], np.where(has_right, values[right], np.nan))
    return np.where(has_left & has_right, both, one)


# ---- what a run says of itself, each part checked -----------------------------------------------


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
    _refuse(
        path,
        (not plain, f"has the shape {item.shape} and the type {item.dtype}", "a list of numbers"),
        (
            chunk is not None and item.chunks != (chunk,),
            f"has chunks of {item.chunks} values",
            f"{chunk}",
        ),
    )
    if item.size:
        check_shape(SourceColumn(path, item, 0, (None,)))
    if item.size and item.chunks:
        most, largest = item.chunks[0] * size, [0]
        item.id.chunk_iter(lambda stored: largest.__setitem__(0, max(largest[0], stored.size)))
        # larger than the filters make of one, it would grow without end
        grows = largest[0] > most + most // 64 + 64
        what = f"has a chunk of {largest[0]} bytes for {most}"
        _refuse(path, (grows, what, "what the chunk holds"))
    return item


def text_at(file: h5py.File, path: str) -> str:
    """The text at `path`, as the bytes of a dataset."""
    return bytes(dataset_at(file, path, "u")[:]).decode("utf-8")


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


def axis_at(file: h5py.File, name: str) -> TimeAxis:
    """The time axis of a group."""
    path = f"groups/{name}"
    place = walk(file, path)
    size, rate = int(attribute(place, "size")), attribute(place, "rate_Hz")
    if "time_s" in place:
        times = dataset_at(file, f"{path}/time_s", "f", chunk=max(min(CHUNK, size), 1))
        _refuse(path, (times.size != size, f"has {times.size} times", f"{size}"))
        for at in range(0, size, CHUNK):
            _ = times[at]  # a damaged one has no time to lose it at: the run is refused

        def explicit(first: int, stop: int) -> np.ndarray:
            check_open(bool(times))
            return np.asarray(times[first:stop], np.float64)

        return TimeAxis.read_by(explicit, size, rate)
    columns = {
        key: dataset_at(file, f"{path}/{key}")[:] for key in ("first", "start_s", "period_s")
    }
    vague = attribute(place, "rate_error") if "rate_error" in place.attrs else 0.0
    return TimeAxis(size, rate, **columns, rate_error=vague)


def flags_at(file: h5py.File, name: str, foreign: set[str]) -> tuple[Doubt, ...]:
    """The flags of a channel.

    A word that is not of the register comes to `foreign`, and is a foreign doubt.
    """
    if "flags" not in file or name not in walk(file, "flags"):
        return ()
    keys = ("start", "stop", "word")
    start, stop, words = (dataset_at(file, f"flags/{name}/{key}")[:].tolist() for key in keys)
    texts = [word.decode("utf-8") for word in words]
    foreign |= {text for text in texts if flag_of(text) is None}
    return tuple(
        (a, b, flag_of(text) or Quality.FOREIGN_DOUBT)
        for a, b, text in zip(start, stop, texts, strict=True)
    )


# ---- digests -------------------------------------------------------------------------------------


def contents_digest(file: h5py.File) -> str:
    """sha256 of the whole content of the file but for the long columns' numbers."""
    found = hashlib.sha256()
    for path, item in _objects(file):
        what = "group" if isinstance(item, h5py.Group) else f"{item.dtype.str}{item.shape}"
        found.update(f"{path}\0{what}\0".encode())
        for name in sorted(item.attrs):
            if path or name != DIGEST:
                value = np.asarray(_plain(item, name))
                foreign = value.dtype.kind == "O"
                what = "is no plain attribute"
                _refuse(f"{path}.{name}", (foreign, what, "numbers and short texts"))
                found.update(f"{name}\0{value.dtype.str}{value.shape}\0".encode() + value.tobytes())
        if isinstance(item, h5py.Dataset) and not is_long(path):
            found.update(_checked(path, item)[:].tobytes())
    return found.hexdigest()


def is_long(path: str) -> bool:
    """True for samples and explicit times, which are not read when a run is opened."""
    return path.startswith("channels/") or path.endswith("/time_s")


def _objects(file: h5py.File) -> list[tuple[str, Any]]:
    """(path, object) of all that a file holds, in the order of their paths; links are none."""
    found: dict[str, Any] = {}
    file.visititems(found.__setitem__)  # which returns None, or the visit would end
    paths = sorted(found, key=lambda path: path.split("/"))
    return [("", file["/"]), *((path, found[path]) for path in paths)]
