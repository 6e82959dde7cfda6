"""An HDF5 file that was cut off, opened up to the cut.

The chunks before the cut can be read; which samples stand behind it is told.
"""

from __future__ import annotations

import math
import re
import weakref
from pathlib import Path

import h5py
import numpy as np

from tirelog.readers.hdf5.source import SourceColumn, chunks_of


class Padded:
    """A cut file as libhdf5 expects it: `size` bytes long, zeros behind the cut.

    What lies there is never used as data.
    """

    def __init__(self, path: Path, size: int) -> None:
        self.stream = path.open("rb")
        weakref.finalize(self, self.stream.close)
        self.end = self.stream.seek(0, 2)
        self.size, self.at = size, 0

    def seek(self, offset: int, whence: int = 0) -> int:
        self.at = offset + (0, self.at, self.size)[whence]
        return self.at

    def tell(self) -> int:
        return self.at

    def readinto(self, buffer: memoryview) -> int:
        view = memoryview(buffer).cast("B")
        want = min(len(view), max(self.size - self.at, 0))
        self.stream.seek(min(self.at, self.end))
        got = self.stream.readinto(view[:want])
        view[got:want] = bytes(want - got)
        self.at += want
        return want

    def read(self, size: int = -1) -> bytes:
        buffer = bytearray(self.size - self.at if size < 0 else size)
        return bytes(buffer[: self.readinto(memoryview(buffer))])

    def truncate(self, size: int) -> None:
        """Part of the interface; a log is never changed."""

    def write(self, data: bytes) -> int:
        raise OSError("a log is read only")

    def flush(self) -> None:
        """Part of the interface; nothing is kept back."""


def declared_size(problem: Exception) -> int | None:
    """The size that a file should have, from what libhdf5 says; None if it says else.

    It says so of a file that was cut off.
    """
    match = re.search(r"truncated file.*stored_eof = (\d+)", str(problem))
    return int(match[1]) if match else None


def unstored(found: SourceColumn, start: int, stop: int, end: int | None) -> list[tuple[int, int]]:
    """Sample ranges in [start, stop) that the file does not hold.

    They were never written, or lie behind `end` (the size of a file that was cut).
    """
    dataset = found.dataset
    if dataset.is_virtual:
        return []
    if dataset.chunks:
        expected = math.prod(
            math.ceil(n / c) for n, c in zip(dataset.shape, dataset.chunks, strict=True)
        )
        if end is None and dataset.id.get_num_chunks() >= expected:
            return []
        return [(a, b) for a, b, info in chunks_of(found, start, stop) if _is_lost(info, end)]
    offset = dataset.id.get_offset()
    if end is None or offset is None:
        return []
    size = dataset.dtype.itemsize
    strides = [math.prod(dataset.shape[axis + 1 :]) * size for axis in range(dataset.ndim)]
    base = offset + sum(
        at * step for at, step in zip(found.index, strides, strict=True) if at is not None
    )
    whole = max((end - base - size) // strides[found.axis] + 1, 0)
    return [(max(start, whole), stop)] if whole < stop else []


def kept(found: SourceColumn, end: int | None, step: int) -> int:
    """Samples up to the last one that is stored: what lies behind it was never written or cut off.

    Looks at `step` samples at once.
    """
    stop = len(found)
    while stop > 0:
        start = max(stop - step, 0)
        lost = np.zeros(stop - start, bool)
        for first, last in unstored(found, start, stop, end):
            lost[first - start : last - start] = True
        if not lost.all():
            return stop - int(np.argmin(lost[::-1]))
        stop = start
    return 0


def _is_lost(info: h5py.h5d.StoreInfo, end: int | None) -> bool:
    return info.byte_offset is None or (end is not None and info.byte_offset + info.size > end)
