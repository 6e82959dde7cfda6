"""Numbers put aside while a log streams by, to be read again in slices.

In memory while few, then in a temporary file.
"""

from __future__ import annotations

import tempfile
import weakref
from typing import IO

import numpy as np

from tirelog.vocabulary.arrays import FloatArray

#: values kept in memory before they go to a file
_IN_MEMORY = 1 << 18


class Spool:
    """Float64 values, appended in order and read in slices [start, stop)."""

    def __init__(self) -> None:
        self.size = 0
        self._parts: list[FloatArray] = []
        self._file: IO[bytes] | None = None

    def append(self, values: FloatArray) -> None:
        self.size += values.size
        if self.size <= _IN_MEMORY:
            self._parts.append(np.array(values, np.float64))
            return
        if self._file is None:
            self._file = tempfile.TemporaryFile(prefix="tirelog-")  # noqa: SIM115
            weakref.finalize(self, self._file.close)
        self._file.seek(0, 2)
        for part in (*self._parts, values):
            self._file.write(np.ascontiguousarray(part, np.float64).data)
        self._parts = []

    def read(self, start: int, stop: int) -> FloatArray:
        start, stop = max(start, 0), min(stop, self.size)
        if self._file is not None:
            self._file.seek(8 * start)
            return np.frombuffer(self._file.read(8 * max(stop - start, 0)), np.float64)
        if len(self._parts) != 1:
            self._parts = [np.concatenate([np.zeros(0), *self._parts])]
        return self._parts[0][start:stop]
