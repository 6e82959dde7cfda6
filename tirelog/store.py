"""The run file: HDF5 that any tool can open, written whole or not at all, checksummed throughout.

    /                   tirelog_run = format version
    /setup              text of the setup file          /provenance     JSON: source, sha256, version, repairs, remarks, losses
    /groups/<group>     first, start_s, period_s (segments of the time axis) or time_s; attribute rate_Hz, size
    /channels/<name>    samples as the source wrote them: int32 counts of 10^-decimals (INT32_MIN where lost), else float32 or float64
                        (NaN where lost); attributes group, kind, unit, scale_factor, add_offset (stored number to SI), decimals
    /flags/<name>       start, stop, word

Data chunks carry fletcher32 (but for those of a temporary run, which no other command reads), and the file is of HDF5's "v110" kind,
whose metadata has checksums too: a flipped bit is found when it is read, its chunk becomes NaN, and the recording's losses say so.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from tirelog import units
from tirelog.chunks import CHUNK, ChunkWriter, unfiltered
from tirelog.convert import to_si
from tirelog.errors import ReadError, SetupError
from tirelog.readers import LOST_COUNT, Group, RawBlock
from tirelog.recording import Channel, FloatArray, Recording, Scaled, TimeAxis
from tirelog.setup import KINDS, ChannelSetup, Setup, parse_setup
from tirelog.store_column import Column

FORMAT_VERSION = 1
#: samples beyond a slice that are looked at for the readings of a twin grating on either side of a lost one
_TWIN_REACH = 4096
_CACHE_BYTES = 1 << 18  # of each dataset, two chunks; the default of HDF5 2 is 8 MB, which many channels multiply


class RunWriter:
    """Writes a run, block by block, to `path` (which the caller makes whole or removes).

    `compress` is for runs that are kept: their samples are compressed and carry checksums.
    """

    def __init__(self, path: Path, setup: Setup, groups: tuple[Group, ...], *, compress: bool) -> None:
        self.setup, self.groups = setup, groups
        self.file = h5py.File(path, "w", libver=("v110", "v110"), rdcc_nbytes=_CACHE_BYTES)
        self.file.attrs["tirelog_run"] = FORMAT_VERSION
        self._chunks = ChunkWriter(compress=compress)
        self._columns = {n: Column(self.file, n, group.decimals.get(n), self._chunks) for group in groups for n in group.channels}
        self._rows = {group.name: 0 for group in groups}
        self._flags: dict[str, list[tuple[int, int, str]]] = {name: [] for name in self._columns}

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

    def finish(self, axes: Mapping[str, TimeAxis], flags: Mapping[str, list[tuple[int, int, str]]], provenance: Mapping[str, Any]) -> None:
        """Time axes, flags on whole groups, setup and provenance; the file is complete after this."""
        self.flush()
        for group in self.groups:
            self._axis(group.name, axes[group.name])
            for name in group.channels:
                self._columns[name].finish(group.name, self.setup.channels[name])
                self._write_flags(name, sorted(self._flags[name] + list(flags.get(group.name, []))))
        self.file["setup"] = self.setup.text
        self.file["provenance"] = json.dumps(provenance, default=str)

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
        times = place.create_dataset("time_s", shape=(axis.size,), dtype="f8", chunks=chunks, fletcher32=True)
        for start in range(0, axis.size, CHUNK):
            times[start : start + CHUNK] = axis.explicit(start, min(start + CHUNK, axis.size))

    def _write_flags(self, name: str, flags: list[tuple[int, int, str]]) -> None:
        if not flags:
            return
        place = self.file.create_group(f"flags/{name}")
        for key, values in (("start", [f[0] for f in flags]), ("stop", [f[1] for f in flags])):
            place.create_dataset(key, data=np.array(values, np.int64), chunks=True, fletcher32=True)
        words = np.array([f[2].encode() for f in flags])
        place.create_dataset("word", data=words, chunks=True, fletcher32=True)

    def flush(self) -> dict[str, int]:
        """All samples are in the file after this, and nothing may follow: how many of each channel are lost."""
        for column in self._columns.values():
            column.flush()
        self._chunks.flush()
        return {name: column.lost for name, column in self._columns.items()}

    def close(self) -> None:
        self._chunks.close()
        self.file.close()


def is_run(path: Path | str) -> bool:
    """True where `path` is an HDF5 file that `ingest` wrote."""
    try:
        with h5py.File(path, "r") as file:
            return "tirelog_run" in file.attrs
    except OSError:
        return False


@contextmanager
def open_run(path: Path | str, log: str, setup: Setup | None = None, *, temporary: bool = False) -> Iterator[Recording]:
    """The run at `path` as a Recording that reads its channels in slices while the context is open.

    `setup` replaces the stored one: tire, conditions and the conversions of channels of the same name.  `temporary`: nobody but this
    process has written to it, and its samples are neither compressed nor checked.
    ReadError: not a run, or its inside is damaged.
    """
    try:
        file = h5py.File(path, "r", rdcc_nbytes=_CACHE_BYTES)
    except OSError as problem:
        raise ReadError(
            f"cannot be opened as a run ({_short(problem)}); a run is what `tirelog ingest` writes; ingest it again", file=log
        ) from None
    with file, ExitStack() as more:
        try:
            plain = more.enter_context(open(path, "rb", buffering=0)).fileno() if temporary else None
            recording = _recording(file, plain, log, setup)
        except SetupError:
            raise
        except (OSError, KeyError, ValueError, TypeError, AttributeError, RuntimeError) as problem:
            raise ReadError(
                f"the run is damaged ({_short(problem)}); its metadata cannot be read; ingest the log again", file=log
            ) from None
        yield recording


def _short(problem: BaseException) -> str:
    return str(problem).splitlines()[0][:120] if str(problem) else type(problem).__name__


def _recording(file: h5py.File, plain: int | None, log: str, setup: Setup | None) -> Recording:
    """What the run says; `plain`: the descriptor of a temporary one."""
    version = int(file.attrs["tirelog_run"])
    if version != FORMAT_VERSION:
        raise ReadError(f"is a run of format {version}; this tirelog reads {FORMAT_VERSION}; ingest the log again", file=log)
    provenance = json.loads(file["provenance"][()])
    stored = _with_units(parse_setup(file["setup"].asstr()[()], provenance.get("setup_file")), file)
    setup = _with_units(setup, file) if setup else stored
    losses: list[str] = list(provenance.get("losses", []))
    axes = {name: _read_axis(place) for name, place in file["groups"].items()}
    channels: dict[str, Channel] = {}
    for name, known in stored.channels.items():
        if name in file["channels"]:
            dataset = file["channels"][name]
            used = setup.channels.get(name, known)
            if used.kind != known.kind:
                raise SetupError(f"channel {name} is {known.kind} in the run, {used.kind} in the setup; mend the setup", file=log)
            flags = _read_flags(file, name)
            channels[name] = _channel(name, dataset, plain, used, axes[dataset.attrs["group"]], flags, losses)
    for name, used in setup.channels.items():
        twin = used.temperature_channel
        if name in channels and twin in channels and used.thermal_expansion_1_K:
            channels[name] = _compensated(channels[name], channels[twin], used.thermal_expansion_1_K)
    order = [name for name in setup.channels if name in channels] + [name for name in channels if name not in setup.channels]
    return Recording(log, {name: channels[name] for name in order}, setup, provenance, tuple(provenance.get("remarks", [])), losses)


def _with_units(setup: Setup, file: h5py.File) -> Setup:
    """The setup with the units that were taken from the log itself, where it names none: the run keeps them with its samples."""
    channels = dict(setup.channels)
    for name, channel in setup.channels.items():
        about = file["channels"][name].attrs if name in file["channels"] else {}
        if channel.unit is None and about.get("kind") == channel.kind:
            unit = str(about["source_unit"])
            units.to_si(unit, *KINDS[channel.kind][0])
            channels[name] = replace(channel, unit=unit)
    return replace(setup, channels=channels)


def _read_axis(place: h5py.Group) -> TimeAxis:
    size, rate = int(place.attrs["size"]), float(place.attrs["rate_Hz"])
    if "time_s" in place:
        times, none = place["time_s"], np.zeros(0)
        return TimeAxis(size, rate, none.astype(np.int64), none, none, lambda start, stop: times[start:stop])
    return TimeAxis(size, rate, place["first"][:], place["start_s"][:], place["period_s"][:])


def _read_flags(file: h5py.File, name: str) -> tuple[tuple[int, int, str], ...]:
    if f"flags/{name}" not in file:
        return ()
    place = file[f"flags/{name}"]
    return tuple((int(a), int(b), w.decode()) for a, b, w in zip(place["start"][:], place["stop"][:], place["word"][:], strict=True))


def _channel(
    name: str,
    dataset: h5py.Dataset,
    plain: int | None,
    channel: ChannelSetup,
    axis: TimeAxis,
    flags: tuple[tuple[int, int, str], ...],
    losses: list[str],
) -> Channel:
    """A channel whose samples are read, and scaled to SI, slice by slice; `plain`: as of `_recording`."""
    factor, offset = to_si(channel)
    counts = dataset.dtype.kind == "i"
    scale = factor / 10.0 ** int(dataset.attrs["decimals"]) if counts else factor

    def checked(start: int, stop: int) -> np.ndarray:
        return _read(dataset, start, stop, name, losses)

    raw = checked if plain is None else unfiltered(dataset, plain) or checked
    samples = Scaled(raw, scale, offset, LOST_COUNT if counts else None)
    more = {key: getattr(channel, key) for key in ("steps", "gauge_length_m") if getattr(channel, key) is not None}
    resolution = abs(scale) if counts else 0.0
    return Channel(name, channel.kind, KINDS[channel.kind][1], axis, samples, channel.surface or "outer", resolution, flags, more)


def _read(dataset: h5py.Dataset, start: int, stop: int, name: str, losses: list[str]) -> np.ndarray:
    """Stored numbers [start, stop); a chunk that fails its checksum is lost, and said once."""
    try:
        return dataset[start:stop]
    except OSError:
        missing = LOST_COUNT if dataset.dtype.kind == "i" else np.nan
        out = np.full(max(stop - start, 0), missing, dataset.dtype)
        for first in range(start - start % CHUNK, stop, CHUNK):
            low, high = max(first, start), min(first + CHUNK, stop)
            try:
                out[low - start : high - start] = dataset[low:high]
            except OSError:
                loss = f"channel {name}: samples {first} to {first + CHUNK - 1} are damaged (checksum); they count as lost"
                if loss not in losses:
                    losses.append(loss)
        return out


def _compensated(strain: Channel, twin: Channel, expansion_1_K: float) -> Channel:
    """Strain without the thermal expansion that its unbonded twin grating reads: the last term of P1 (1)."""
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

    Between the nearest readings on either side within reach, else as the one that is, else NaN: what comes out depends on the sample alone
    and not on the slice that is read, so block sizes do not matter.
    """
    known = np.flatnonzero(np.isfinite(values))
    if not known.size:
        return np.full(at.shape, np.nan)
    after = np.searchsorted(known, at)
    left, right = known[np.maximum(after - 1, 0)], known[np.minimum(after, known.size - 1)]
    has_left, has_right = (after > 0) & (at - left <= _TWIN_REACH), (after < known.size) & (right - at <= _TWIN_REACH)
    share = np.where(right > left, (at - left) / np.maximum(right - left, 1), 1.0)
    both = values[left] + share * (values[right] - values[left])
    one = np.where(has_left, values[left], np.where(has_right, values[right], np.nan))
    return np.where(has_left & has_right, both, one)
