"""The run file: HDF5 that any tool can open, written whole or not at all, checksummed throughout.

    /                   tirelog_run = format version; contents_sha256 (`store_checks`)
    /setup              bytes of the setup's text       /provenance     JSON: source, sha256,
                        version, repairs, remarks, losses
    /groups/<group>     first, start_s, period_s (segments of the time axis) or time_s; attribute
                        rate_Hz, size
    /channels/<name>    samples as the source wrote them: int32 counts of 10^-decimals (INT32_MIN
                        where lost), else float32 or float64 (NaN where lost); attributes group,
                        kind, unit, scale_factor, add_offset (stored number to SI), decimals, sha256
    /flags/<name>       start, stop, word

Data chunks carry fletcher32 (but for those of a temporary run, which no other command reads), and
the file is of HDF5's "v110" kind, whose metadata has checksums too; nothing is of variable length,
as HDF5's heap has none. A flipped bit is found when it is read: a chunk of samples becomes NaN, and
the recording's losses say so; anywhere else the run is refused. Format 1, which kept its texts in
the heap, is not read.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tirelog.data.recording import Channel, Recording, Scaled, TimeAxis
from tirelog.data.setup import ChannelSetup, Setup, parse_setup
from tirelog.errors import ReadError, SetupError, printable
from tirelog.readers.base import LOST_COUNT, Group, RawBlock
from tirelog.readers.hdf5.source import LIBRARY_ERRORS, walk
from tirelog.runs.chunks import CHUNK, ChunkWriter
from tirelog.runs.column import DatasetWriter, scaled_to_si
from tirelog.runs.direct import POSSIBLE, Direct
from tirelog.runs.held import repeats, without_repeats
from tirelog.runs.store_checks import (
    COLUMN_DIGEST,
    DIGEST,
    attribute,
    axis_at,
    check_columns,
    check_open,
    column_digest,
    contents_digest,
    dataset_at,
    flags_at,
    provenance_at,
    text_at,
    text_in,
)
from tirelog.storage.documents import LARGEST_BYTES
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import KINDS
from tirelog.vocabulary.quality import Doubt, Quality

#: of the run's layout; another one is refused
FORMAT_VERSION = 2
#: of a foreign run's words for its doubts at most so many are named, and so many letters of each
MOST_WORDS, MOST_LETTERS = 5, 40
#: samples beyond a slice that are looked at for the readings of a twin grating on either side of a
#: lost one; twice as many bridge gaps in the temperature that are twice as long by a straight line
_TWIN_REACH = 4096
#: decimals of a count: more than any instrument writes, and a power of ten that is finite
MOST_DECIMALS = 64
_CACHE_BYTES = (
    1 << 18
)  # of each dataset, two chunks; the default of HDF5 2 is 8 MB, which many channels multiply


class RunWriter(AbstractContextManager["RunWriter"]):
    """Writes a run, block by block, to `path` (which the caller makes whole or removes).

    `compress` is for runs that are kept: their samples are compressed and carry checksums.
    """

    def __init__(
        self, path: Path, setup: Setup, groups: tuple[Group, ...], *, compress: bool
    ) -> None:
        self.setup, self.groups, self.kept = setup, groups, compress
        self.file = h5py.File(path, "w", libver=("v110", "v110"), rdcc_nbytes=_CACHE_BYTES)
        self.file.attrs["tirelog_run"] = FORMAT_VERSION
        self._chunks = ChunkWriter(compress=compress)
        self._columns = {
            n: DatasetWriter(self.file, n, group.decimals.get(n), self._chunks)
            for group in groups
            for n in group.channels
        }
        self._rows = {group.name: 0 for group in groups}
        self._flags: dict[str, list[Doubt]] = {name: [] for name in self._columns}

    def append(self, block: RawBlock) -> int:
        """Append a block; the number of its samples."""
        start = self._rows[block.group]
        rows = 0
        for name, values in block.values.items():
            self._columns[name].append(values)
            rows = values.size
        for name, first, stop, word in block.flags:
            self._flags[name].append((start + first, start + stop, word))
        self._rows[block.group] += rows
        return rows

    def finish(
        self,
        axes: Mapping[str, TimeAxis],
        flags: Mapping[str, list[Doubt]],
        provenance: Mapping[str, Any],
    ) -> None:
        """Write time axes, flags on whole groups, setup, provenance; the file is then complete."""
        self.flush()
        for group in self.groups:
            self._axis(group.name, axes[group.name])
            for name in group.channels:
                self._columns[name].finish(group.name, self.setup.channels[name])
                self._write_flags(name, self._flags[name] + list(flags.get(group.name, [])))
        self._text("setup", self.setup.text)
        self._text("provenance", json.dumps(provenance, default=str))
        if self.kept:
            self.file.attrs[DIGEST] = np.bytes_(contents_digest(self.file))

    def _text(self, name: str, text: str) -> None:
        stored = np.frombuffer(text.encode("utf-8", "backslashreplace"), np.uint8)
        place = self.file.create_dataset(name, data=stored, chunks=True, fletcher32=True)
        place.attrs["size"] = stored.size

    def _axis(self, name: str, axis: TimeAxis) -> None:
        place = self.file.create_group(f"groups/{name}")
        place.attrs.update(rate_Hz=axis.rate_Hz, size=axis.size)
        options = {"chunks": True, "fletcher32": True}
        if axis.explicit is None:
            for key in ("first", "start_s", "period_s"):
                place.create_dataset(key, data=getattr(axis, key), **options)
            return
        # HDF5 refuses a chunk that is longer than a dataset of fixed size, as a few stamps are
        chunks = (min(CHUNK, axis.size),)
        times = place.create_dataset(
            "time_s", shape=(axis.size,), dtype="f8", chunks=chunks, fletcher32=True
        )
        for start in range(0, axis.size, CHUNK):
            times[start : start + CHUNK] = axis.explicit(start, min(start + CHUNK, axis.size))
        if self.kept:
            times.attrs[COLUMN_DIGEST] = np.bytes_(column_digest(times))

    def _write_flags(self, name: str, doubts: list[Doubt]) -> None:
        if not doubts:
            return
        flags = sorted((start, stop, flag.word) for start, stop, flag in doubts)
        place = self.file.create_group(f"flags/{name}")
        for key, values in (("start", [f[0] for f in flags]), ("stop", [f[1] for f in flags])):
            place.create_dataset(key, data=np.array(values, np.int64), chunks=True, fletcher32=True)
        words = np.array([f[2].encode() for f in flags])
        place.create_dataset("word", data=words, chunks=True, fletcher32=True)

    def flush(self) -> dict[str, int]:
        """How many samples of each channel are lost.

        All samples are in the file after this, and nothing may follow.
        """
        for column in self._columns.values():
            column.flush()
        self._chunks.flush()
        return {name: column.lost for name, column in self._columns.items()}

    def close(self) -> None:
        self._chunks.close()
        self.file.close()

    def __exit__(self, kind: object, value: object, trace: object) -> None:
        self.close()


def is_run(path: Path | str) -> bool:
    """True if `path` is an HDF5 file that `ingest` wrote, and says so."""
    try:
        with h5py.File(path, "r") as file:
            return "tirelog_run" in file.attrs
    except LIBRARY_ERRORS:
        return False


def changed_columns(path: Path | str) -> list[str]:
    """The channels and stamps of a run whose sha256 is not that of what was written.

    The run is read whole.
    """
    try:
        with h5py.File(path, "r") as file:
            return check_columns(file)
    except (ReadError, *LIBRARY_ERRORS):
        return ["what stands in it"]


@contextmanager
def open_run(
    path: Path | str, log: str, setup: Setup | None = None, *, temporary: bool = False
) -> Iterator[Recording]:
    """The run at `path` as a Recording that reads its channels in slices while the context is open.

    `setup` replaces the stored one: tire, conditions and the conversions of channels of the same
    name. `temporary`: nobody but this process has written to it, and its samples are neither
    compressed nor checked. ReadError: not a run, or its inside is damaged.
    """
    try:
        file = h5py.File(path, "r", rdcc_nbytes=_CACHE_BYTES)
    except LIBRARY_ERRORS as problem:
        raise ReadError(
            f"cannot be opened as a run ({_short(problem)})",
            allowed="a run is what `tirelog ingest` writes",
            do="ingest it again",
            file=log,
        ) from None
    with ExitStack() as opened:
        opened.enter_context(file)
        whole = opened.enter_context(open(path, "rb", buffering=0)) if temporary else None
        try:
            recording = _recording(file, log, setup, whole)
        except SetupError:
            raise
        except ReadError as problem:
            raise ReadError(
                f"the run is damaged or none of ours: {problem.message}", file=log
            ) from None
        except (*LIBRARY_ERRORS, RecursionError) as problem:
            raise ReadError(
                f"the run is damaged ({_short(problem)}); its metadata cannot be read",
                do="ingest the log again",
                file=log,
            ) from None
        yield recording


def _short(problem: BaseException) -> str:
    return str(problem).splitlines()[0][:120] if str(problem) else type(problem).__name__


def _recording(
    file: h5py.File, log: str, setup: Setup | None, whole: io.FileIO | None
) -> Recording:
    """What the run says; `whole`: the file, if only this process has written to it."""
    own = whole is not None
    version = attribute(file, "tirelog_run")
    if version != FORMAT_VERSION:
        raise ReadError(
            f"it is of format {version:g}",
            allowed=f"this tirelog reads {FORMAT_VERSION}",
            do="ingest the log again",
        )
    if not own and contents_digest(file) != text_in(file, DIGEST):
        raise ReadError(
            "its contents are not those that were written (sha256)",
            do="copy it again, or ingest the log again",
        )
    provenance = provenance_at(file)
    stored = parse_setup(
        text_at(file, "setup", LARGEST_BYTES), str(provenance.get("setup_file") or log)
    )
    stored = _with_units(stored, file)
    setup = _with_units(setup, file) if setup else stored
    losses: list[str] = provenance["losses"]
    said: list[str] = []
    foreign: set[str] = set()
    axes = {name: axis_at(file, name, own=own) for name in walk(file, "groups")}
    channels: dict[str, Channel] = {}
    held = walk(file, "channels")
    for name, known in stored.channels.items():
        if name in held:
            dataset = dataset_at(file, f"channels/{name}", "if", chunk=CHUNK, own=own)
            axis = axes[text_in(dataset, "group")]
            if dataset.size != axis.size:
                raise ReadError(
                    f"channel {name} has {dataset.size} samples and {axis.size} times",
                    do="ingest the log again",
                )
            used = setup.channels.get(name, known)
            if used.kind != known.kind:
                raise SetupError(
                    f"channel {name} is {known.kind} in the run, {used.kind} in the setup",
                    do="mend the setup",
                    file=log,
                )
            flags = flags_at(file, name, axis.size, foreign, own=own)
            channels[name] = _channel(name, dataset, used, axis, flags, losses, whole)
            # what is damaged is said when it is asked for
            held_values = repeats(_channel(name, dataset, used, axis, flags, [], whole))
            if held_values is not None:
                channels[name] = without_repeats(channels[name], held_values)
                said.append(f"{name}: {held_values.remark}")
    for name, used in setup.channels.items():
        twin = used.temperature_channel
        if name in channels and twin in channels and used.thermal_expansion_1_K:
            channels[name] = _compensated(
                channels[name], channels[twin], used.thermal_expansion_1_K
            )
    order = [name for name in setup.channels if name in channels] + [
        name for name in channels if name not in setup.channels
    ]
    return Recording(
        log,
        {name: channels[name] for name in order},
        setup,
        provenance,
        (*provenance.get("remarks", ()), *said, *_about_foreign(foreign)),
        losses,
    )


def _about_foreign(words: set[str]) -> tuple[str, ...]:
    """What is to be said of doubts whose words are not of the register."""
    if not words:
        return ()
    some = ", ".join(printable(word[:MOST_LETTERS]) for word in sorted(words)[:MOST_WORDS])
    return (
        f"the run has doubts that this version of tirelog does not know ({some}); the rows about "
        f"them are marked {Quality.FOREIGN_DOUBT.word}; read it with the version that wrote it, "
        "or ingest the log again",
    )


def _with_units(setup: Setup, file: h5py.File) -> Setup:
    """The setup with the units that were taken from the log itself, if it names none.

    The run keeps them with its samples.
    """
    channels = dict(setup.channels)
    held = walk(file, "channels")
    for name, channel in setup.channels.items():
        if channel.unit is not None or name not in held:
            continue
        about = walk(file, f"channels/{name}")
        if text_in(about, "kind") == channel.kind:
            unit = text_in(about, "source_unit")
            KINDS[channel.kind].to_si(unit)
            channels[name] = replace(channel, unit=unit)
    return replace(setup, channels=channels)


def _channel(
    name: str,
    dataset: h5py.Dataset,
    channel: ChannelSetup,
    axis: TimeAxis,
    flags: tuple[Doubt, ...],
    losses: list[str],
    whole: io.FileIO | None,
) -> Channel:
    """A channel whose samples are read, and scaled to SI, slice by slice.

    `whole`: as of `_recording`.
    """
    factor, offset = scaled_to_si(channel)
    counts = dataset.dtype.kind == "i"
    decimals = attribute(dataset, "decimals") if counts else 0
    if not (0 <= decimals <= MOST_DECIMALS and decimals == int(decimals)):
        raise ReadError(
            f"channel {name} has counts of {decimals:g} decimals", do="ingest the log again"
        )
    scale = factor / 10.0 ** int(decimals)

    def checked(start: int, stop: int) -> np.ndarray:
        check_open(bool(dataset))
        return _read(dataset, start, stop, name, losses)

    read = checked if whole is None or not POSSIBLE else Direct(dataset, whole)
    lost = LOST_COUNT if counts else None
    samples = Scaled(read, scale, offset, lost, at_hand=whole is not None)
    more = {
        key: getattr(channel, key)
        for key in ("steps", "gauge_length_m")
        if getattr(channel, key) is not None
    }
    resolution = abs(scale) if counts else 0.0
    return Channel(
        name,
        channel.kind,
        KINDS[channel.kind].to_si(channel.source_unit)[2],
        axis,
        samples,
        channel.surface or "outer",
        resolution,
        flags,
        more,
    )


def _read(dataset: h5py.Dataset, start: int, stop: int, name: str, losses: list[str]) -> np.ndarray:
    """Stored numbers [start, stop); a chunk that fails its checksum is lost, and said once."""
    try:
        stored: np.ndarray = dataset[start:stop]
        return stored
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

    return Channel(**{**strain.__dict__, "samples": samples})


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
