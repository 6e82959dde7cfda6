"""The columns of a text log, and the gratings in a list of peaks."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from tirelog.data.setup import Setup
from tirelog.errors import ReadError
from tirelog.readers.series import MOST_SERIES, Listed, Series
from tirelog.readers.text.columns import clock_columns, name_of_column, placed
from tirelog.readers.text.layout import Layout, sniff
from tirelog.readers.text.source import ByteSource

#: peaks further apart than this are of two gratings [nm]; those of a fibre lie 5 to 40 nm apart
_APART_NM = 1.0
#: share of the rows in which a grating's peak stands
_OFTEN = 0.3
#: wavelengths that gratings are written at [nm]
_WAVELENGTHS_NM = (600.0, 2500.0)


def columns(source: ByteSource, log: str) -> Listed:
    """The columns of numbers, or the gratings of a list of peaks.  ReadError: no rows."""
    try:
        head = source.head()
        if source.problem and not head.strip():
            raise ReadError(
                f"{source.problem}; nothing before that could be unpacked",
                do="copy the log again",
                file=log,
            )
        layout = placed(sniff(head, log))
    finally:
        source.close()
    taken, time = clock_columns(layout, Setup())
    if layout.counts or layout.ragged or layout.misfit:
        found = _gratings(layout, layout.counts_at + layout.counts, taken)
        if found:
            return Listed(found, time)
    kinds = layout.kinds[: layout.width]
    numbers = [k for k, kind in enumerate(kinds) if kind == "number" and k not in taken]
    series = [Series(name_of_column(layout, k), place=f"#{k + 1}") for k in numbers]
    others = tuple(
        name_of_column(layout, k)
        for k, kind in enumerate(kinds)
        if kind == "text" and k not in taken
    )
    return Listed(tuple(series[:MOST_SERIES]), time, others)


def _gratings(layout: Layout, begin: int, taken: set[int]) -> tuple[Series, ...]:
    """The gratings whose peaks stand in the sample rows, by wavelength."""
    peaks = []
    for row in layout.rows:
        for k in range(begin, len(row)):
            with suppress(ValueError):
                peaks.append(float(row[k].replace(layout.decimal, ".")) if k not in taken else 0.0)
    low, high = _WAVELENGTHS_NM
    values = np.sort([peak for peak in peaks if low < peak < high])
    if not values.size:
        return ()
    groups = np.split(values, np.flatnonzero(np.diff(values) > _APART_NM) + 1)
    often = [group for group in groups if group.size >= _OFTEN * len(layout.rows)]
    middles = [float(np.median(group)) for group in often]
    series = []
    for k, middle in enumerate(middles):
        gaps = [abs(middle - other) for j, other in enumerate(middles) if j != k]
        reach = min([3.0, *(0.45 * gap for gap in gaps)])
        window = (round(middle - reach, 3), round(middle + reach, 3))
        series.append(Series(f"peak_{middle:.0f}nm", window, "found by wavelength"))
    return tuple(series[:MOST_SERIES])
