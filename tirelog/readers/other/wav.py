"""WAV recordings: samples as shares of full scale, at the rate that the file states.

    RIFF chunks --fmt, data--> frames, piece by piece --> RawBlock

Sources are `#1`, `#2`, ... or `channel_1`, `left`, `right`. PCM of 8 to 32 bits and floats; 16 bits
of 0.5 are 16384. `scale` of the setup says what full scale is worth.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from tirelog.data.setup import ChannelSetup, Setup
from tirelog.errors import ReadError
from tirelog.readers.base import MOST_SERIES, Group, RawBlock, ReadReport, Series, SeriesList
from tirelog.vocabulary.arrays import FloatArray

GROUP = "frames"
#: bytes of frames read at once
_BLOCK_BYTES = 1 << 20
#: bytes of a chunk beside the samples that are looked at; more are passed over
_CHUNK_BYTES = 1 << 12
_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
_MOST_CHANNELS = 1024
#: a length that says that the file's end is the end of the samples (streams, files beyond 4 GB)
_OPEN_END = 0xFFFFFFFF


@dataclass(frozen=True)
class _Format:
    """How a frame is written: `size` bytes per sample, `floats` or whole numbers."""

    channels: int
    rate_Hz: float
    size: int
    floats: bool

    @property
    def frame(self) -> int:
        return self.channels * self.size


def channels(path: Path, log: str) -> SeriesList:
    """The channels of the recording at `path`.  ReadError: it is none."""
    first = Setup(channels={"first": ChannelSetup(kind="signal", source="#1")})
    with path.open("rb") as stream:
        many = WavReader(stream, first, log).many
    return SeriesList(tuple(Series(f"#{k + 1}") for k in range(min(many, MOST_SERIES))))


class WavReader:
    """An open WAV recording (`tirelog.readers.base.LogReader`)."""

    def __init__(self, stream: BinaryIO, setup: Setup, name: str) -> None:
        self.name, self.setup, self._stream = name, setup, stream
        self.report = ReadReport(format="wav")
        self._format, self._bytes = self._header()
        wanted = {c: self._place(what.source) for c, what in setup.channels.items()}
        allowed = f"#1 to #{self._format.channels}"
        missing = {c: setup.channels[c].source for c, place in wanted.items() if place is None}
        self._places = {c: place for c, place in wanted.items() if place is not None}
        told = [
            f"channel {c}: no channel {source!r}; allowed are {allowed}"
            for c, source in missing.items()
        ]
        if not self._places:
            raise ReadError("; ".join(told[:3]), do="mend source in the setup", file=name)
        self.report.losses += told
        self.groups = (Group(GROUP, tuple(self._places), rate_Hz=self._format.rate_Hz),)

    @property
    def many(self) -> int:
        """How many channels the file has."""
        return self._format.channels

    def _place(self, source: str) -> int | None:
        names = {"left": 1, "right": 2}
        match = re.fullmatch(r"(?:#|channel[_ ]?)(\d{1,4})", source.strip().lower())
        number = int(match[1]) if match else names.get(source.strip().lower(), 0)
        return number - 1 if 1 <= number <= self._format.channels else None

    def _error(self, what: str, do: str = "record it again") -> ReadError:
        return ReadError(
            f"{what}", allowed="allowed is WAV of PCM or float samples", do=do, file=self.name
        )

    def _read(self, size: int) -> bytes:
        """That many bytes, or as many as there are."""
        parts = []
        while size and (part := self._stream.read(min(size, _BLOCK_BYTES))):
            parts.append(part)
            size -= len(part)
        return b"".join(parts)

    def _header(self) -> tuple[_Format, int | None]:
        """(format, bytes of samples or None for all that follow), the stream at the first one."""
        self._read(12)
        found = None
        while len(tag := self._read(8)) == 8:
            kind, size = tag[:4], struct.unpack("<I", tag[4:])[0]
            if kind == b"data":
                if found is None:
                    raise self._error("is a WAV file without a format before its samples")
                return found, None if size in (0, _OPEN_END) else size
            held = self._read(min(size + size % 2, _CHUNK_BYTES))
            if kind == b"fmt ":
                found = self._parsed(held)
            self._pass(size + size % 2 - len(held))
        raise self._error("is a WAV file without samples")

    def _pass(self, size: int) -> None:
        """Reads on over `size` bytes."""
        while size > 0 and (part := self._stream.read(min(size, _BLOCK_BYTES))):
            size -= len(part)

    def _parsed(self, chunk: bytes) -> _Format:
        if len(chunk) < 16:
            raise self._error("is a WAV file whose format is cut off")
        code, channels, rate, _, frame, bits = struct.unpack("<HHIIHH", chunk[:16])
        if code == _EXTENSIBLE and len(chunk) >= 26:
            code = struct.unpack("<H", chunk[24:26])[0]
        size = frame // channels if channels else 0
        good = (
            (code == _PCM and size in (1, 2, 3, 4)) or (code == _FLOAT and size in (4, 8))
        ) and frame == size * channels
        if not good or not 0 < channels <= _MOST_CHANNELS or not rate:
            raise self._error(
                f"is a WAV file of code {code}, {channels} channels, {bits} bits, {rate} Hz",
                do="save it as PCM",
            )
        return _Format(channels, float(rate), size, code == _FLOAT)

    def blocks(self) -> Iterator[RawBlock]:
        """Frames, block by block."""
        left, done, frame = self._bytes, 0, self._format.frame
        at_once = max(_BLOCK_BYTES // frame, 1) * frame
        while left is None or left > 0:
            data = self._read(at_once if left is None else min(at_once, left))
            if left is not None:
                left -= len(data)
            whole = len(data) // frame * frame
            if whole:
                done += whole // frame
                values = self._values(data[:whole])
                yield RawBlock(GROUP, {c: values[:, k].copy() for c, k in self._places.items()})
            if len(data) < at_once and (left is None or left > 0 or whole < len(data)):
                if left or whole < len(data):
                    missing = "a frame" if left is None else f"{(left or 0) // frame + 1} frames"
                    self.report.losses.append(
                        f"the file is cut off behind frame {done}: {missing} at the end are lost; "
                        "copy it again"
                    )
                return

    def _values(self, data: bytes) -> FloatArray:
        """Samples (frames, channels) as shares of full scale, floats as they are."""
        form = self._format
        if form.floats:
            stored: NDArray[np.float64] = np.frombuffer(data, f"<f{form.size}").astype(np.float64)
        elif form.size == 1:  # the one that is not signed
            stored = (np.frombuffer(data, np.uint8).astype(np.float64) - 128.0) / 128.0
        elif form.size == 3:
            wide = np.zeros((len(data) // 3, 4), np.uint8)
            wide[:, 1:] = np.frombuffer(data, np.uint8).reshape(-1, 3)
            stored = wide.view("<i4").reshape(-1) / 2.0**31
        else:
            whole = np.frombuffer(data, f"<i{form.size}")
            stored = whole / 2.0 ** (8 * form.size - 1)
        with np.errstate(invalid="ignore"):
            stored[~np.isfinite(stored)] = np.nan
        return np.asarray(stored, np.float64).reshape(-1, form.channels)
