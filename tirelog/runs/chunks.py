"""Chunks of an HDF5 dataset, packed as HDF5's own filters would and written past them.

Several are packed at once, outside of HDF5's lock.

    values --shuffle--> bytes of one place together --deflate--> smaller
        --fletcher32--> 4 bytes more --write_direct_chunk--> file

Any tool reads the file, as its filters are the ordinary ones: shuffle, gzip, fletcher32 (HDF5
specification, III.I "Filter pipeline").
"""

from __future__ import annotations

import os
from collections import deque
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from io import FileIO
from typing import Any

import h5py
import numpy as np

from tirelog.errors import ReadError

try:  # the same format, at a tenth of the cost
    from isal.isal_zlib import compress as deflate
except ImportError:  # no such wheel for this platform
    from zlib import compress as deflate

#: samples per chunk
CHUNK = 1 << 15
_LEVEL = 1
#: chunks that wait to be written, and threads that pack them
_WAITING, _THREADS = 64, 2
#: what `create_dataset` takes for chunks that `packed` makes
FILTERS = {"compression": "gzip", "compression_opts": _LEVEL, "shuffle": True, "fletcher32": True}


def packed(values: np.ndarray) -> bytes:
    """The stored bytes of a whole chunk of `values`, shape (CHUNK,)."""
    places = values.view(np.uint8).reshape(-1, values.itemsize)
    small = bytes(deflate(places.T.tobytes(), _LEVEL))
    return small + fletcher32(small).to_bytes(4, "little")


def fletcher32(data: bytes) -> int:
    """HDF5's checksum of at most a few megabytes.

    The sum of big-endian words of 16 bits, and the sum of that sum's running values. Both modulo
    65535; only zeros give 0, all else 65535 in its place.
    """
    words = np.frombuffer(data + b"\0" * (len(data) % 2), ">u2")
    running = np.cumsum(words, dtype=np.uint64)
    return (_folded(int(running.sum())) << 16) | _folded(int(running[-1]) if running.size else 0)


def _folded(total: int) -> int:
    return (total - 1) % 65535 + 1 if total else 0


class ChunkWriter:
    """Writes whole chunks of datasets.

    Packed if `compress`, else as they are, for datasets without filters.
    """

    def __init__(self, *, compress: bool) -> None:
        self._pool = ThreadPoolExecutor(_THREADS, "tirelog-pack") if compress else None
        self._waiting: deque[tuple[h5py.Dataset, int, Future[bytes]]] = deque()
        self.options: dict[str, Any] = dict(FILTERS) if compress else {}

    def write(self, dataset: h5py.Dataset, start: int, values: np.ndarray) -> None:
        """Write `values` from sample `start` on, a multiple of CHUNK.

        Behind a last part of a chunk nothing may follow.
        """
        dataset.resize(start + values.size, axis=0)
        for at in range(0, values.size, CHUNK):
            part = np.ascontiguousarray(values[at : at + CHUNK])
            if part.size < CHUNK:
                part = np.concatenate([part, np.zeros(CHUNK - part.size, part.dtype)])
            if self._pool is None:
                dataset.id.write_direct_chunk((start + at,), part)
            else:
                self._waiting.append((dataset, start + at, self._pool.submit(packed, part)))
                self._drain(_WAITING)

    def flush(self) -> None:
        """Everything is in the file after this."""
        self._drain(0)

    def _drain(self, leave: int) -> None:
        while len(self._waiting) > leave:
            dataset, start, chunk = self._waiting.popleft()
            dataset.id.write_direct_chunk((start,), chunk.result())

    def close(self) -> None:
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)


@dataclass(frozen=True)
class Unfiltered:
    """Numbers of a dataset whose chunks are in the file as they are.

    Read past HDF5: in it one thread would wait for another. `places`: the byte at which each chunk
    begins.
    """

    file: FileIO
    dtype: np.dtype
    size: int
    places: tuple[int, ...]

    def __call__(self, start: int, stop: int) -> np.ndarray:
        """The numbers [start, stop).

        ReadError: the recording is closed. OSError: the file is shorter than it was.
        """
        if self.file.closed:
            raise recording_closed()
        stop, wide = min(stop, self.size), self.dtype.itemsize
        out = np.empty(max(stop - start, 0), self.dtype)
        room, at = out.view(np.uint8), start
        while at < stop:
            first = last = at // CHUNK
            while (last + 1) * CHUNK < stop and self.places[last + 1] == self.places[
                last
            ] + CHUNK * wide:
                last += 1
            end = min((last + 1) * CHUNK, stop)
            part = room[(at - start) * wide : (end - start) * wide]
            if (
                os.preadv(
                    self.file.fileno(),
                    [part.data],
                    self.places[first] + (at - first * CHUNK) * wide,
                )
                != part.size
            ):
                raise OSError("the file ends early")
            at = end
        return out


def recording_closed() -> ReadError:
    """What a recording says that is read after its end."""
    return ReadError(
        "the recording is closed",
        allowed="its samples can be read while `open_recording` is open, and in a session until "
        "the next log is taken",
        do="read them there, or open it again",
    )


def unfiltered(dataset: h5py.Dataset, file: FileIO) -> Unfiltered | None:
    """A reader of a dataset without filters in the open `file`, or None.

    None if a chunk, or the system's call, is missing.
    """
    if not hasattr(os, "preadv"):
        return None
    places = [-1] * -(-dataset.size // CHUNK)
    dataset.id.chunk_iter(
        lambda chunk: places.__setitem__(chunk.chunk_offset[0] // CHUNK, chunk.byte_offset)
    )
    return None if -1 in places else Unfiltered(file, dataset.dtype, dataset.size, tuple(places))
