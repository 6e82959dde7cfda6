"""Columns of a table as arrow arrays: NaN and None are null.

They are made out of buffers: `pa.array` would import pandas to ask whether it was given a pandas
object, which takes as long as all the rest.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pc

from tirelog.vocabulary.columns import COLUMNS

#: kind of a column that the vocabulary does not have, by numpy's letter; else text
_KINDS = {"f": "float", "i": "int", "u": "int", "b": "bool"}
TYPES = {"float": pa.float64(), "int": pa.int64(), "bool": pa.bool_(), "text": pa.string()}


def arrow_column(values: np.ndarray, kind: str, digits: int | None) -> pa.Array:
    """One column (n,) of a `kind` of TYPES.

    Floats are rounded to so many significant `digits` (None: as they are).
    """
    if kind == "text":
        return _texts(values.tolist())
    if kind == "float" or values.dtype.kind == "f":
        floats = np.ascontiguousarray(values, dtype=np.float64)
        if digits is not None and kind == "float":
            floats = _rounded(floats, digits)
        array = _plain(pa.float64(), ~np.isnan(floats), floats)
        return array if kind == "float" else array.cast(TYPES[kind])
    known = np.ones(values.size, bool)
    if kind == "bool":
        return _plain(pa.bool_(), known, np.packbits(values.astype(np.bool_), bitorder="little"))
    return _plain(pa.int64(), known, np.ascontiguousarray(values, dtype=np.int64))


def arrow_table(
    name: str, columns: Mapping[str, np.ndarray], rounded: bool, schema: pa.Schema | None
) -> pa.Table:
    """Rows of the table `name`, each column an array (n,); `schema`: of the rows before them.

    `rounded`: floats as text formats have them.
    """
    arrays = []
    for column, values in columns.items():
        known = COLUMNS.get(column)
        kind = _KINDS.get(values.dtype.kind, "text") if known is None else known.kind
        digits = 12 if known is not None and known.unit == "s" else 9
        arrays.append(arrow_column(values, kind, digits if rounded else None))
    of = [arrow_field(c, name, array.type) for c, array in zip(columns, arrays, strict=True)]
    return pa.Table.from_arrays(arrays, schema=pa.schema(of) if schema is None else schema)


def csv_rows(table: pa.Table) -> bytes:
    """The rows as csv, without a header."""
    part = io.BytesIO()
    how = pc.WriteOptions(include_header=False, quoting_style=quoting(table))
    pc.write_csv(table, part, how)
    return part.getvalue()


def arrow_field(name: str, table: str, type: pa.DataType | None = None) -> pa.Field:
    """A table's column with unit and meaning, kept by parquet; the vocabulary's type by default."""
    column = COLUMNS.get(name)
    metadata = {"unit": column.unit, "meaning": column.meaning_in(table)} if column else None
    return pa.field(name, TYPES[COLUMNS[name].kind] if type is None else type, metadata=metadata)


def quoting(table: pa.Table) -> str:
    """Quotes only if a text needs them (arrow's own "needed" quotes every text)."""
    for column in table.columns:
        if pa.types.is_string(column.type):
            for data in (chunk.buffers()[2] for chunk in column.chunks):
                if data is not None and any(
                    mark in data.to_pybytes() for mark in (b'"', b",", b"\r", b"\n")
                ):
                    return "needed"
    return "none"


def _rounded(values: np.ndarray, digits: int) -> np.ndarray:
    """`values` rounded to significant digits."""
    with np.errstate(divide="ignore", invalid="ignore"):
        exponent = digits - 1 - np.floor(np.log10(np.abs(values)))
        scale = 10.0 ** np.clip(np.where(np.isfinite(exponent), exponent, 0.0), -300, 300)
        rounded = np.round(values * scale) / scale
    return np.where(np.isfinite(rounded), rounded, values)


def _plain(type: pa.DataType, known: np.ndarray, data: np.ndarray) -> pa.Array:
    """Numbers or packed bits as an arrow array, null if not `known` (n,)."""
    lost = known.size - int(np.count_nonzero(known))
    valid = pa.py_buffer(np.packbits(known, bitorder="little")) if lost else None
    return pa.Array.from_buffers(type, known.size, [valid, pa.py_buffer(data)], lost)


def _texts(values: Sequence[Any]) -> pa.Array:
    """Texts as an arrow array, null if None."""
    builder = pa.lib.StringBuilder()
    builder.append_values([None if value is None else str(value) for value in values])
    return builder.finish()
