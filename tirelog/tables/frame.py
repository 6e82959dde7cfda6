"""Tables in memory: columns, or a file that tirelog wrote -> pandas DataFrame.

A file is read back with the types of the vocabulary, part by part, behind one guard: a cell that
is not of its column's kind, or bytes that are no table, are a ReadError of the file.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tirelog.errors import ReadError
from tirelog.storage.remote import open_input
from tirelog.tables.writer import table_format
from tirelog.vocabulary.columns import COLUMNS, OPTIONAL, TABLES


def frame_of(columns: Mapping[str, Any]) -> pd.DataFrame:
    """Columns of one length, scalars repeated, as a DataFrame."""
    rows = max((np.shape(v)[0] for v in columns.values() if np.ndim(v)), default=1)
    return pd.DataFrame(
        {
            name: np.broadcast_to(np.asarray(v), (rows,)) if np.ndim(v) == 0 else v
            for name, v in columns.items()
        }
    )


def whole_frame(name: str, parts: Sequence[pd.DataFrame]) -> pd.DataFrame:
    """The parts of the table `name` as one; without a part its columns without rows.

    `attrs["units"]` and `attrs["descriptions"]` hold unit and meaning of every column, by name.
    """
    if parts:
        frame = pd.concat(parts, ignore_index=True) if len(parts) > 1 else parts[0]
    else:
        frame = pd.DataFrame({c: [] for c in TABLES[name] if c not in OPTIONAL})
    known = [str(c) for c in frame.columns if c in COLUMNS]
    frame.attrs = {
        "units": {c: COLUMNS[c].unit for c in known},
        "descriptions": {c: COLUMNS[c].meaning_in(name) for c in known},
    }
    return frame


def read_table(path: Path | str) -> pd.DataFrame:
    """A table that tirelog (or another tool) wrote, each column of its kind in the vocabulary.

    The suffix decides, '-' is csv on standard input. ReadError: nothing there, or not a table.
    """
    parts = list(table_parts(path))
    return parts[0] if len(parts) == 1 else pd.concat(parts, ignore_index=True)


def table_parts(
    path: Path | str, unused: Collection[str] = (), words: bool = False
) -> Iterator[pd.DataFrame]:
    """A table as `read_table` gives it, without the `unused` columns: at least one part.

    A part is what the file holds together, of parquet a group of rows. With `words` every cell is
    its text. ReadError as `read_table`.
    """
    format = "csv" if str(path) == "-" else table_format(path, None)
    try:
        for part in _parts(os.fspath(path), format, unused, words):
            if not part.columns.is_unique:
                raise ValueError("two columns have one name")
            yield (
                part.astype(str)
                if words
                else part.assign(
                    **{str(c): _of_kind(part[c], COLUMNS[c].kind) for c in part if c in COLUMNS}
                )
            )
    except Exception as problem:  # of damaged bytes pandas and arrow each raise what they like
        told = " ".join(str(problem).split())[:300]  # of several lines, now and then
        raise ReadError(
            f"is not a table ({told})",
            allowed="csv, ndjson, json and parquet are read",
            do="write one with -o",
            file=path,
        ) from None


def _parts(path: str, format: str, unused: Collection[str], words: bool) -> Iterator[pd.DataFrame]:
    """What a file of the `format` holds, as its library reads it."""
    if format == "parquet":
        import pyarrow.parquet as pq

        with open_input(path) as stream, pq.ParquetFile(stream) as file:
            names = [str(name) for name in file.schema_arrow.names if name not in unused]
            for group in range(file.num_row_groups):
                yield file.read_row_group(group, columns=names, use_threads=False).to_pandas()
            if not file.num_row_groups:
                yield file.schema_arrow.empty_table().select(names).to_pandas()
        return
    if format == "csv":
        known = COLUMNS.values()
        with open_input(path) as stream:
            table = pd.read_csv(
                stream,
                dtype="str" if words else {c.name: "str" for c in known if c.kind == "text"},
                keep_default_na=False,
                na_values={} if words else {c.name: [""] for c in known if c.kind != "text"},
            )
        if not isinstance(table.index, pd.RangeIndex):  # the first cells were taken for row names
            raise ValueError("its rows have more cells than its header has names")
    else:
        with open_input(path) as stream:
            table = pd.read_json(stream, orient="records", lines=format == "ndjson")
    yield table.drop(columns=[name for name in table if name in unused])


def _of_kind(values: pd.Series, kind: str) -> pd.Series:
    """A column whose cells are of the `kind`.  ValueError: one is not."""
    if kind == "text":
        plain = pd.api.types.infer_dtype(values, skipna=True) in ("string", "empty")
        return values if plain else values.where(values.isna(), values.map(str))
    if kind == "bool":
        wrong = ~values.isna() & ~values.map(lambda value: value in (True, False))
    else:
        numbers = pd.to_numeric(values, errors="coerce")
        wrong = numbers.isna() & ~values.isna()
        if pd.api.types.is_bool_dtype(values) or not pd.api.types.is_numeric_dtype(numbers):
            wrong |= ~values.isna()
        elif kind == "int":
            wrong |= ~numbers.isna() & (numbers % 1 != 0)
        values = numbers
    if wrong.any():
        row = int(np.flatnonzero(wrong)[0])
        raise ValueError(f"row {row + 1}, column {values.name}: no {kind}")
    return values
