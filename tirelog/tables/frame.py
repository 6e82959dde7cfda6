"""Tables in memory: columns, or a file that tirelog wrote -> pandas DataFrame.

A file is read back with the types of the vocabulary, part by part, behind one guard: a cell that
is not of its column's kind, or bytes that are no table, are a ReadError of the file.
"""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from tirelog.errors import ReadError, UsageError
from tirelog.storage.whole import open_input
from tirelog.tables.writer import table_format
from tirelog.vocabulary.columns import COLUMNS, OPTIONAL, TABLES, TableColumn


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


# ---- `check`: does a table still hold what an earlier one held?
#
#     two tables --match rows by key--> differences beyond each column's tolerance, largest first
#
# A row's key is what names it (log, channel, revolution, step, effect, ...: the key columns that
# both tables have; without any, the row number). A float may move by its column's absolute +
# relative tolerance (`columns.COLUMNS`), anything else not at all; rows that only one table has are
# differences too.
#
# The column `log` is the path as it was typed, so the same log has another key from another folder.
# `of_like_logs` takes the file's name in its place when not one row has the same path in both.


KEYS = (
    "log",
    "table",
    "channel",
    "revolution",
    "step",
    "effect",
    "manoeuvre",
    "regime",
    "quantity",
    "angle",
    "name",
)
#: a column that the register of columns does not know, with its tolerance
_UNKNOWN = TableColumn("", "", "float", "")
#: the word for the key of a whole column, and for the column of a whole row
_ALL_ROWS, _ROW = "(all rows)", "(row)"


@dataclass(frozen=True)
class Difference:
    """One value that moved.

    `excess` is its difference over what is allowed (inf if the values cannot be compared).
    """

    key: str
    column: str
    value: str
    against: str
    excess: float


def differences(
    table: pd.DataFrame, against: pd.DataFrame, tolerance: Mapping[str, float] | None = None
) -> list[Difference]:
    """What moved between `against` (the older table) and `table`, largest first.

    `tolerance` replaces a column's own tolerance by an absolute one. UsageError: a tolerance for a
    column that is not there.
    """
    tolerance = dict(tolerance or {})
    for name in tolerance:
        if name not in against.columns:
            raise UsageError(
                f"--tolerance {name}: no such column",
                allowed=f"allowed are {', '.join(map(str, against.columns))}",
                do="correct the name",
            )
    keys = [k for k in KEYS if k in table.columns and k in against.columns]
    table, against = _indexed(table, keys), _indexed(against, keys)
    sides = (("absent", "present", table, against), ("present", "absent", against, table))
    found = [
        Difference(_ALL_ROWS, str(c), here, there, np.inf)
        for here, there, new, old in sides
        for c in old.columns.difference(new.columns)
    ] + [
        Difference(str(key), _ROW, here, there, np.inf)
        for here, there, new, old in sides
        for key in old.index.difference(new.index)
    ]
    common = against.index.intersection(table.index)
    for name in [c for c in against.columns if c in table.columns]:
        found += _moved(
            str(name), table.loc[common, name], against.loc[common, name], tolerance.get(str(name))
        )
    return sorted(found, key=lambda d: -d.excess)


def of_like_logs(
    table: pd.DataFrame, against: pd.DataFrame
) -> tuple[pd.DataFrame, pd.DataFrame, str]:
    """(both tables with keys by which rows match, a sentence on the keys).

    The sentence is empty if the keys have the paths of the logs: a single row with the same key in
    both tables is enough. Else `log` is the file's name in both, or that name without its suffixes
    (a log and the run made of it). Rows have to match then, and no two logs of a table may have one
    name.
    """
    keys = [k for k in KEYS if k in table.columns and k in against.columns]
    if "log" in keys and not _share_rows(table, against, keys):
        for name_of, words in (
            (_file_name, "file name"),
            (_stem, "file name without its suffixes"),
        ):
            new, old = (t.assign(log=t["log"].map(name_of)) for t in (table, against))
            distinct = (
                new["log"].nunique() == table["log"].nunique()
                and old["log"].nunique() == against["log"].nunique()
            )
            if distinct and _share_rows(new, old, keys):
                said = "no row has the path of its log in common; logs are matched by"
                return new, old, f"{said} {words}"
    return table, against, ""


def _share_rows(table: pd.DataFrame, against: pd.DataFrame, keys: list[str]) -> bool:
    return not _indexed(table, keys).index.intersection(_indexed(against, keys).index).empty


def _file_name(path: object) -> str:
    return str(path).rstrip("/").rpartition("/")[2]


def _stem(path: object) -> str:
    """The name before its first dot, other than a leading one: `drive` for `logs/drive.csv.gz`."""
    return re.sub(r"(?<=.)\..*", "", _file_name(path), flags=re.DOTALL)


def summary(found: Sequence[Difference]) -> str:
    """One line: how many values moved, how many rows or columns only one of the tables has."""
    counted = {
        "values moved beyond their tolerance": [
            d for d in found if d.column != _ROW and d.key != _ALL_ROWS
        ],
        "rows are new": [d for d in found if d.column == _ROW and d.value == "present"],
        "rows are missing": [d for d in found if d.column == _ROW and d.value == "absent"],
        "columns are new": [d for d in found if d.key == _ALL_ROWS and d.value == "present"],
        "columns are missing": [d for d in found if d.key == _ALL_ROWS and d.value == "absent"],
    }
    said = [f"{len(some)} {words}" for words, some in counted.items() if some]
    one = {"1 rows are": "1 row is", "1 columns are": "1 column is"}
    one["1 values moved beyond their"] = "1 value moved beyond its"
    return ", ".join(
        next((text.replace(a, b) for a, b in one.items() if text.startswith(a)), text)
        for text in said
    )


def _indexed(table: pd.DataFrame, keys: list[str]) -> pd.DataFrame:
    """The table with its key as index: `log=a.csv channel=strain_1 revolution=3`.

    Numbered if keys repeat.
    """
    if not keys:
        return table.set_axis([f"row={i}" for i in range(len(table))], axis=0)
    key = table[keys[0]].map(lambda v: f"{keys[0]}={v}")
    for name in keys[1:]:
        key = key + table[name].map(lambda v, name=name: f" {name}={v}")
    again = key.groupby(key).cumcount()
    key = key.where(again == 0, key + " #" + (again + 1).astype(str))
    return table.drop(columns=keys).set_axis(key.to_numpy(), axis=0)


def _moved(name: str, new: pd.Series, old: pd.Series, tolerance: float | None) -> list[Difference]:
    """The values of one column that differ by more than is allowed."""
    numbers = pd.api.types.is_float_dtype(new) or pd.api.types.is_float_dtype(old)
    if not (numbers and pd.api.types.is_numeric_dtype(new) and pd.api.types.is_numeric_dtype(old)):
        same = (new.astype(str) == old.astype(str)) | (new.isna() & old.isna())
        return [
            Difference(str(k), name, str(new[k]), str(old[k]), np.inf)
            for k in new.index[~same.to_numpy()]
        ]
    a, b = new.to_numpy(float), old.to_numpy(float)
    column = COLUMNS.get(name, _UNKNOWN)
    allowed = column.absolute + column.relative * np.abs(b) if tolerance is None else tolerance
    one_missing = np.isnan(a) != np.isnan(b)
    with np.errstate(invalid="ignore", divide="ignore"):
        excess = np.where(one_missing, np.inf, np.where(a == b, 0.0, np.abs(a - b) / allowed))
    excess = np.where(np.isnan(a) & np.isnan(b), 0.0, excess)
    return [
        Difference(str(new.index[int(i)]), name, f"{a[i]:.9g}", f"{b[i]:.9g}", float(excess[i]))
        for i in np.flatnonzero(excess > 1.0)
    ]


def as_table(found: list[Difference]) -> dict[str, Any]:
    """The differences as columns."""
    words = ("key", "column", "value", "against")
    columns = {name: np.array([getattr(d, name) for d in found], dtype=object) for name in words}
    return columns | {"excess": np.array([d.excess for d in found], float)}
