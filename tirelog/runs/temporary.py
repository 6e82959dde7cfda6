"""A run while a command is at work: flat files, and what is known of them.

    raw blocks --RunWriter--> Run: samples of each channel, time axes, flags, provenance
    samples, block after block --int32 counts, float32 or float64--> flat file

A channel has counts while every value is a decimal number of few digits, else floats. The choice is
made by the data: a value that does not come back exactly promotes what has been written so far.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import LOST_COUNT, TimeAxis, counted_floats
from tirelog.data.setup import ChannelSetup, Setup
from tirelog.errors import ReadError
from tirelog.readers.base import Group, RawBlock, without_lost_peaks
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import KINDS, WAVELENGTH_KINDS
from tirelog.vocabulary.quality import Doubt

#: samples per chunk of a run
CHUNK = 1 << 15


def check_open(opened: bool) -> None:
    """ReadError if a run is not open any more."""
    if not opened:
        raise ReadError(
            "the recording is closed",
            allowed="its samples can be read while `open_recording` is open, and in a session "
            "until the next log is taken",
            do="read them there, or open it again",
        )


# P1 (1) for gratings, the table of `units` for the rest.
#
# Every conversion is linear in the channel's own sample, so a run keeps the source's exact counts
# beside a factor and an offset; the temperature term of P1 (1) is the one that needs a second
# channel, and is subtracted when samples are read.


def scaled_to_si(channel: ChannelSetup) -> tuple[float, float]:
    """(factor, offset): SI value = factor x recorded value + offset.

    fbg_strain: strain_gain (lambda - lambda_0) / lambda_0 (P1 (1), without its thermal term).
    fbg_temperature: T - T_0 = (lambda - lambda_0) / temperature_sensitivity, in K (P2 section 2).
    """
    scale, zero = channel.scaling
    factor, offset, _ = KINDS[channel.kind].to_si(channel.source_unit)
    if channel.kind in WAVELENGTH_KINDS:
        reference, to_nm = channel.reference_wavelength_nm, factor * 1e9
        factor, offset = channel.strain_gain * to_nm / reference, -channel.strain_gain
        if channel.kind == "fbg_temperature":
            per_K = channel.temperature_sensitivity_nm_K
            factor, offset = to_nm / per_K, -reference / per_K
    return factor * scale, offset + factor * zero


@dataclass(frozen=True)
class FlatFile:
    """Numbers of one type in a file that holds nothing else; a call reads some of them.

    The file is opened for each read, so threads and processes can read at a time. ReadError: the
    file is gone, or shorter than it was.
    """

    path: Path
    dtype: np.dtype[Any]

    def __call__(self, start: int, stop: int) -> NDArray[Any]:
        count, before = max(stop - start, 0), start * self.dtype.itemsize
        try:
            values = np.fromfile(self.path, self.dtype, count, offset=before)
        except FileNotFoundError:
            check_open(False)
            raise
        if values.size != count:
            raise ReadError("the temporary run was cut off", do="run the command again")
        return values

    def append(self, values: NDArray[Any]) -> None:
        """Write `values` (n,) behind those that are there."""
        with self.path.open("ab") as file:
            file.write(np.ascontiguousarray(values, self.dtype).data)


def counts_of(values: FloatArray, decimals: int) -> NDArray[np.int32] | None:
    """Floats as counts of 10^-decimals if these are the very same numbers; else None."""
    lost, power = np.isnan(values), 10.0**decimals
    known = np.where(lost, 0.0, values) if lost.any() else values
    with np.errstate(over="ignore"):  # 1e308 is no count, which the next line finds out
        counts = np.rint(known * power)
    largest = max(counts.max(initial=0.0), -counts.min(initial=0.0))
    if largest >= -LOST_COUNT - 1.0 or not np.array_equal(counts / power, known):
        return None
    counts[lost] = LOST_COUNT
    return counts.astype(np.int32)


class SamplesWriter:
    """Writes one channel.

    `lost` counts its lost samples; `decimals` are those of its counts.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.lost, self.size, self.decimals = path, 0, 0, 0
        self._largest = 0.0  # of what is written
        self._file: FlatFile | None = None

    def append(self, samples: FloatArray) -> None:
        """Write a block."""
        finite = np.isfinite(samples)
        lost = samples.size - int(np.count_nonzero(finite))
        if lost:  # text cannot hold what is infinite, other formats can
            samples = np.where(finite, samples, np.nan)
        file, decimals = self._file, self.decimals
        stored = self._encode(samples)
        self.lost += lost
        self._largest = max(self._largest, float(np.nanmax(np.abs(samples), initial=0.0)))
        if file is None:
            file = FlatFile(self.path, stored.dtype)
        elif (stored.dtype, self.decimals) != (file.dtype, decimals):
            # what is there becomes counts of more decimals, or float64
            wide = FlatFile(self.path.with_suffix(".wide"), stored.dtype)
            for start in range(0, max(self.size, 1), CHUNK):
                part = file(start, min(start + CHUNK, self.size))
                values = counted_floats(part, decimals) if part.dtype.kind == "i" else part
                counts = counts_of(values, self.decimals) if stored.dtype.kind == "i" else None
                wide.append(values if counts is None else counts)
            wide.path.replace(self.path)
            file = FlatFile(self.path, wide.dtype)
        file.append(stored)
        self._file = file
        self.size += stored.size

    def _encode(self, samples: FloatArray) -> NDArray[Any]:
        """`samples` as counts, float32 or float64.

        The smallest that this channel's blocks so far and this one fit exactly; float64 if counts
        are followed by what is none.
        """
        kind = None if self._file is None else self._file.dtype.str[1:]
        if kind in (None, "i4"):
            # up to nine decimals of a count are looked for, in a thousand samples before all
            for decimals in range(self.decimals, 10):
                if self._largest * 10.0**decimals >= -LOST_COUNT - 1.0:
                    break  # what is written would be no counts
                likely = counts_of(samples[:1000], decimals) is not None
                if likely and (counts := counts_of(samples, decimals)) is not None:
                    self.decimals = decimals
                    return counts
        if kind in (None, "f4"):
            with np.errstate(over="ignore"):
                single = samples.astype(np.float32)
            if np.array_equal(single, samples, equal_nan=True):
                return single
        return samples

    def finish(self) -> FlatFile:
        """All samples; nothing may follow."""
        if self._file is None:
            self.append(np.zeros(0))
        assert self._file is not None
        return self._file


@dataclass(frozen=True)
class Stored:
    """A channel of a run as its source wrote it.

    `read(start, stop, losses)` gives stored numbers, and says in `losses` what is damaged;
    `decimals`: of counts, -1 of floats; `kind` and `unit`: what the source's numbers are; `at_hand`
    if reading costs little.
    """

    group: str
    kind: str
    unit: str
    size: int
    dtype: np.dtype[Any]
    decimals: float
    read: Callable[[int, int, list[str]], NDArray[Any]]
    flags: tuple[Doubt, ...]
    at_hand: bool = False


@dataclass(frozen=True)
class Run:
    """A run while it is open.

    `axes` by group; `foreign`: words of its flags that no register has.
    """

    setup: Setup
    axes: Mapping[str, TimeAxis]
    channels: Mapping[str, Stored]
    provenance: Mapping[str, Any]
    foreign: set[str] = field(default_factory=set)


class RunWriter:
    """Writes a run of flat files, block by block, into the caller's `folder`."""

    def __init__(self, folder: Path, setup: Setup, groups: tuple[Group, ...]) -> None:
        self.folder, self.setup, self.groups = folder, setup, groups
        names = [name for group in groups for name in group.channels]
        self._columns = {
            name: SamplesWriter(folder / f"{number}.samples") for number, name in enumerate(names)
        }
        self._flags: dict[str, list[Doubt]] = {name: [] for name in self._columns}

    def append(self, block: RawBlock) -> int:
        """Append a block; the number of its samples."""
        for name, first, stop, word in block.flags:
            start = self._columns[name].size
            self._flags[name].append((start + first, start + stop, word))
        for name, values in block.values.items():
            self._columns[name].append(without_lost_peaks(values, self.setup.channels[name]))
        return max((values.size for values in block.values.values()), default=0)

    @property
    def lost(self) -> dict[str, int]:
        """How many samples of each channel are lost so far."""
        return {name: column.lost for name, column in self._columns.items()}

    def finish(
        self,
        axes: Mapping[str, TimeAxis],
        flags: Mapping[str, list[Doubt]],
        provenance: Mapping[str, Any],
    ) -> Run:
        """The run, with time axes, flags on whole groups and provenance; nothing may follow."""
        return Run(
            self.setup,
            {
                group.name: self._axis(number, axes[group.name])
                for number, group in enumerate(self.groups)
            },
            {
                name: self._stored(group.name, name, flags.get(group.name, []))
                for group in self.groups
                for name in group.channels
            },
            {**provenance, "losses": provenance.get("losses", [])},
        )

    def _stored(self, group: str, name: str, more: list[Doubt]) -> Stored:
        column, channel = self._columns[name], self.setup.channels[name]
        file = column.finish()
        flags = sorted([*self._flags[name], *more], key=lambda doubt: (*doubt[:2], doubt[2].word))
        return Stored(
            group,
            channel.kind,
            channel.source_unit,
            column.size,
            file.dtype,
            column.decimals if file.dtype.kind == "i" else -1,
            lambda start, stop, _: file(start, stop),
            tuple(flags),
            at_hand=True,
        )

    def _axis(self, number: int, axis: TimeAxis) -> TimeAxis:
        """The axis, of explicit times one that several processes can read."""
        if axis.explicit is None:
            return axis
        times = FlatFile(self.folder / f"{number}.times", np.dtype(np.float64))
        for start in range(0, axis.size, CHUNK):
            times.append(axis.explicit(start, min(start + CHUNK, axis.size)))
        return replace(axis, explicit=times)
