"""An HDF5 file of columns, which a converter fills piece by piece."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import h5py
import numpy as np
from numpy.typing import NDArray

from tirelog.readers.extra.child import Answer, NoNumbers

#: values of a chunk, and datasets of a file
_CHUNK, _MOST_DATASETS = 1 << 14, 5000
#: letters of a name
_MOST_LETTERS = 80


def proper(name: object) -> str:
    """A name that a setup's `source` can spell: no brackets, colons, slashes."""
    plain = "".join(letter for letter in str(name)[: 4 * _MOST_LETTERS] if letter.isprintable())
    plain = re.sub(r"[/\[\]:]+", "_", plain).strip(" .")[:_MOST_LETTERS].strip(" .")
    return plain or "unnamed"


class Datasets:
    """The HDF5 file at `path`; what is no number is passed over in the answer."""

    def __init__(self, path: Path, answer: Answer) -> None:
        self.file, self.answer, self.many = h5py.File(path, "w"), answer, 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        problem: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Closes the file.  NoNumbers: there is none in it."""
        self.file.close()
        if kind is None and not self.many:
            raise NoNumbers("it holds no signal over time")

    def group(self, name: object) -> h5py.Group:
        """A group of that name, or of one like it if it is taken."""
        return self.file.create_group(self._free(self.file, proper(name)))

    def add(
        self,
        group: h5py.Group,
        name: object,
        pieces: Iterable[NDArray[Any]],
        attributes: Mapping[str, str | float | None],
    ) -> int:
        """Writes one column; how many values it has (0: it was passed over)."""
        if self.many >= _MOST_DATASETS:
            raise NoNumbers(f"has more than {_MOST_DATASETS} channels")
        made: h5py.Dataset | None = None
        at = 0
        told = proper(name)
        for piece in pieces:
            values = np.asarray(piece)
            if values.dtype.kind == "b":
                values = values.astype(np.uint8)
            if values.dtype.kind not in "iuf" or values.dtype.itemsize > 8 or values.ndim != 1:
                self.answer.passed_over.append(f"{told} is no column of numbers ({values.dtype})")
                break
            if made is None and values.size:
                free = self._free(group, told)
                made = group.create_dataset(
                    free, shape=(0,), maxshape=(None,), dtype=values.dtype, chunks=(_CHUNK,)
                )
            if made is not None:
                made.resize(at + values.size, axis=0)
                made[at:] = values
                at += values.size
        if made is None:
            return 0
        for word, value in attributes.items():
            if isinstance(value, str):
                made.attrs[word] = value[:_MOST_LETTERS]
            elif value is not None and np.isfinite(value):
                made.attrs[word] = float(value)
        self.many += 1
        return at

    def _free(self, group: h5py.Group, name: str) -> str:
        free, number = name, 2
        while free in group:
            free, number = f"{name}_{number}", number + 1
        return free
