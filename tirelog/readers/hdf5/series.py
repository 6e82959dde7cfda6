"""The datasets of an HDF5 log that hold columns of numbers."""

from __future__ import annotations

from pathlib import Path

import h5py

from tirelog.errors import ReadError
from tirelog.readers.hdf5.layout import TIME_NAMES, find_columns
from tirelog.readers.hdf5.reader import opened
from tirelog.readers.hdf5.source import LIBRARY_ERRORS, names
from tirelog.readers.rates import RATES
from tirelog.readers.series import MOST_SERIES, Listed, Series

#: columns of one dataset that are listed
_MOST_COLUMNS = 32
#: datasets so many times shorter than the longest are properties, not signals
_SHORT = 1000
_BESIDE = {*TIME_NAMES, *(name.lower() for name in RATES)}


def datasets(path: Path, log: str) -> Listed:
    """Datasets of numbers, and columns of those that have some.  ReadError: not to be read."""
    try:
        with opened(path, log)[0] as file:
            sized = [one for name in names(file) for one in _columns(file, name)]
            times = [name for name in names(file) if _last(name) in TIME_NAMES]
    except LIBRARY_ERRORS as problem:
        raise ReadError(
            f"is no readable HDF5 file ({str(problem)[:120]})",
            allowed="allowed is HDF5",
            do="repair it or record it again",
            file=log,
        ) from None
    longest = max((size for _, size in sized), default=0)
    found = [one for one, size in sized if size * _SHORT >= longest]
    short = [one.source for one, size in sized if size * _SHORT < longest]
    return Listed(tuple(found[:MOST_SERIES]), times[0] if times else "", tuple(short[:MOST_SERIES]))


def _last(name: str) -> str:
    return name.replace(":", "/").rsplit("/", 1)[-1].lower()


def _columns(file: h5py.File, name: str) -> list[tuple[Series, int]]:
    """The columns of a dataset with their lengths.

    None if it holds a time, a rate or no numbers.
    """
    if _last(name) in _BESIDE:
        return []
    item = file.get(name.split(":")[0])
    shape = getattr(item, "shape", None)
    wide = [n for n in shape or () if n > 1]
    sources = [name]
    if len(wide) == 2 and ":" not in name:
        sources = [f"{name}[{k}]" for k in range(min(min(wide), _MOST_COLUMNS))]
    series = []
    for source in sources:
        try:
            if (size := len(find_columns(file, source))) > 1:
                series.append((Series(source), size))
        except (ReadError, *LIBRARY_ERRORS):
            return series
    return series
