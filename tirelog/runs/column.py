"""A channel on its way into a run.

Counts while every value is a decimal number of few digits, else floats.

    samples, block after block --joined to whole chunks--> int32 counts, float32 or float64
        --chunks--> dataset

The choice is made by the data: a value that does not come back exactly promotes what has been
written so far.
"""

from __future__ import annotations

import hashlib

import h5py
import numpy as np

from tirelog.data.setup import ChannelSetup
from tirelog.readers.base import LOST_COUNT, Samples, counted_floats, lost_samples
from tirelog.runs.chunks import CHUNK, ChunkWriter
from tirelog.vocabulary.kinds import KINDS, WAVELENGTH_KINDS

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
    factor, offset = _unit_to_si(channel)
    return factor * scale, offset + factor * zero


def _unit_to_si(channel: ChannelSetup) -> tuple[float, float]:
    """(factor, offset): SI value = factor x value in the channel's unit + offset."""
    factor, offset, _ = KINDS[channel.kind].to_si(channel.source_unit)
    if channel.kind not in WAVELENGTH_KINDS:
        return factor, offset
    to_nm = factor * 1e9
    reference = channel.reference_wavelength_nm
    assert reference is not None  # the setup has refused a grating without it
    if channel.kind == "fbg_strain":
        return channel.strain_gain * to_nm / reference, -channel.strain_gain
    return (
        to_nm / channel.temperature_sensitivity_nm_K,
        -reference / channel.temperature_sensitivity_nm_K,
    )


#: whole chunks that are worth a write
_CHUNKS_AT_ONCE = 4


class DatasetWriter:
    """Writes one channel of `decimals` decimals in its source (None: binary floats).

    `lost` counts its lost samples.
    """

    def __init__(
        self, file: h5py.File, name: str, decimals: int | None, chunks: ChunkWriter
    ) -> None:
        self.file, self.name, self.chunks = file, name, chunks
        self.decimals = self._places = decimals
        self.dataset: h5py.Dataset | None = None
        self.lost = 0
        self._power = 1.0 if decimals is None else 10.0**decimals
        self._waiting: list[Samples] = []
        self._held = self._size = 0
        self._digest = hashlib.sha256()

    def append(self, samples: Samples) -> None:
        """Take a block.

        Whole chunks go to the file once there are enough of them to be worth a write.
        """
        self._waiting.append(samples)
        self._held += samples.size
        if self._held >= _CHUNKS_AT_ONCE * CHUNK:
            joined = self._joined()
            self._held = joined.size % CHUNK
            whole = joined.size - self._held
            self._write(joined[:whole])
            self._waiting = [joined[whole:].copy()]

    def _joined(self) -> Samples:
        """What waits, in one piece: counts if all of it is."""
        counts = all(part.dtype == np.int32 for part in self._waiting) and self._waiting
        return np.concatenate(
            self._waiting
            if counts
            else [np.zeros(0), *(counted_floats(part, self._places) for part in self._waiting)]
        )

    def _write(self, samples: Samples) -> None:
        self.lost += lost_samples(samples)
        stored = self._encode(samples)
        if self.dataset is None:
            self.dataset = self._create(self.name, stored.dtype)
        elif stored.dtype != self.dataset.dtype:
            self._promote()
            stored = stored.astype(np.float64)
        self.chunks.write(self.dataset, self._size, stored)
        self._hash(stored)
        self._size += stored.size

    def _hash(self, stored: np.ndarray) -> None:
        if self.chunks.options:  # a temporary run is not looked at again
            self._digest.update(stored.astype(stored.dtype.newbyteorder("<"), copy=False).data)

    def _encode(self, samples: Samples) -> np.ndarray:
        """`samples` as counts, float32 or float64.

        The smallest that this channel's blocks so far and this one fit exactly.
        """
        kind = (
            None
            if self.dataset is None
            else self.dataset.dtype.kind + str(self.dataset.dtype.itemsize)
        )
        if samples.dtype == np.int32 and self.decimals is not None and kind in (None, "i4"):
            return samples
        values = counted_floats(samples, self._places)
        if self.decimals is not None and kind in (None, "i4"):
            lost = np.isnan(values)
            known = np.where(lost, 0.0, values) if lost.any() else values
            with np.errstate(over="ignore"):  # 1e308 is no count, which the next line finds out
                counts = np.rint(known * self._power)
            if max(
                counts.max(initial=0.0), -counts.min(initial=0.0)
            ) < -LOST_COUNT - 1.0 and np.array_equal(counts / self._power, known):
                counts[lost] = LOST_COUNT
                return counts.astype(np.int32)
        self.decimals = None
        if kind in (None, "f4"):
            with np.errstate(over="ignore"):
                single = values.astype(np.float32)
            if np.array_equal(single, values, equal_nan=True):
                return single
        return values

    def _create(self, name: str, dtype: np.dtype) -> h5py.Dataset:
        options = self.chunks.options
        return self.file.create_dataset(
            f"channels/{name}",
            shape=(0,),
            maxshape=(None,),
            chunks=(CHUNK,),
            dtype=dtype,
            **options,
        )

    def _promote(self) -> None:
        """Rewrite what is there as float64."""
        old = self.dataset
        assert old is not None
        self.chunks.flush()
        wide = self._create(f"{self.name}.wide", np.dtype(np.float64))
        self._digest = hashlib.sha256()
        for start in range(0, self._size, CHUNK):
            part = counted_floats(old[start : start + CHUNK], self._places)
            self.chunks.write(wide, start, part)
            self._hash(part)
        self.chunks.flush()
        del self.file[f"channels/{self.name}"]
        self.file.move(f"channels/{self.name}.wide", f"channels/{self.name}")
        self.dataset = self.file[f"channels/{self.name}"]

    def flush(self) -> None:
        """Everything is in the file after this, and nothing may follow."""
        if self._waiting or self.dataset is None:
            self._write(self._joined())
            self._waiting = []

    def finish(self, group: str, channel: ChannelSetup) -> None:
        """What a reader of the file has to know about the channel."""
        assert self.dataset is not None
        factor, offset = scaled_to_si(channel)
        counts = self.dataset.dtype.kind == "i"
        power = self._power if counts else 1.0
        unit = KINDS[channel.kind].to_si(channel.source_unit)[2]
        digest = self._digest.hexdigest()
        words = {"group": group, "kind": channel.kind, "unit": unit, "source": channel.source}
        words |= {"source_unit": channel.source_unit}
        words |= {"sha256": digest} if self.chunks.options else {}
        for name, text in words.items():  # of a fixed length: HDF5's heap has no checksum
            self.dataset.attrs[name] = np.bytes_(text.encode("utf-8", "backslashreplace") or b"\0")
        self.dataset.attrs.update(
            scale_factor=factor / power, add_offset=offset,
            decimals=(self.decimals or 0) if counts else -1,
        )  # fmt: skip
        if counts:
            self.dataset.attrs["_FillValue"] = np.int32(LOST_COUNT)
