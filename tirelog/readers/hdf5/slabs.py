"""One slice of the columns of an HDF5 file: what lies together in the file is read together."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from tirelog.readers.hdf5.source import SourceColumn

#: bytes of one dataset read at once
SLAB_BYTES = 1 << 24


class Slabs:
    """One slice of several columns; columns of one dataset are read together, where that reads
    little beside them.
    """

    def __init__(self, columns: list[SourceColumn], start: int, stop: int) -> None:
        self.start, self.stop = start, stop
        self.shared: dict[Any, list[SourceColumn]] = {}
        for column in columns:
            self.shared.setdefault((column.dataset.id, column.axis), []).append(column)
        self.slabs: dict[Any, NDArray[Any]] = {}

    def read(self, column: SourceColumn) -> NDArray[Any]:
        """The column's stored values in the slice.

        One of LIBRARY_ERRORS where a chunk is damaged.
        """
        key = (column.dataset.id, column.axis)
        together = self.shared.get(key, [])
        fields_of_rows = column.field is not None and column.dataset.ndim == 1
        if (
            column not in together
            or len(together) < 2
            or not (fields_of_rows or self._narrow(column, len(together)))
        ):
            return column.read(self.start, self.stop)
        if key not in self.slabs:
            where = tuple(
                slice(self.start, self.stop) if at is None else slice(None) for at in column.index
            )
            if column.field:
                fields = sorted({c.field for c in together if c.field})
                self.slabs[key] = column.dataset.fields(fields)[where]
            else:
                self.slabs[key] = column.dataset[where]
        slab = self.slabs[key] if column.field is None else self.slabs[key][column.field]
        values = slab[tuple(slice(None) if at is None else at for at in column.index)]
        element: tuple[Any, ...] = (slice(None), *column.element)
        return values[element] if column.element else values

    def _narrow(self, column: SourceColumn, wanted: int) -> bool:
        """True where the whole rows are few more than what is wanted of them."""
        width = column.dataset.size // max(len(column), 1)
        return (
            column.field is None
            and column.dataset.ndim == 2
            and width <= 4 * wanted
            and width * column.dtype.itemsize * (self.stop - self.start) <= SLAB_BYTES
        )
