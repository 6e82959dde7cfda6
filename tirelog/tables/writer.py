"""Tidy tables out: columns -> rows of csv, ndjson, json or parquet.

On standard output or as a whole file.

    with TableWriter("speed", output, format, metadata=...) as table:
        table.write({"log": ..., "time_s": array, ...})     as often as there are parts; every part
                                                            has the same columns

A part is a mapping of equally long arrays (or scalars, repeated). NaN is an empty field (null).
Text formats round floats to nine significant digits (twelve for times), which is below every
column's tolerance; parquet keeps them as they are, and carries unit and meaning of every column,
tirelog's version and the hashes of the inputs in its metadata.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, suppress
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from tirelog.errors import UsageError, printable, refuse_unknown
from tirelog.storage.whole import whole_file
from tirelog.version import __version__
from tirelog.vocabulary.columns import COLUMNS, TABLES
from tirelog.vocabulary.tables import TABLE_FORMATS

if TYPE_CHECKING:
    import pyarrow as pa


_SUFFIXES = {
    ".csv": "csv",
    ".ndjson": "ndjson",
    ".jsonl": "ndjson",
    ".parquet": "parquet",
    ".json": "json",
}
#: rows of a table that are written at once
_ROWS_A_PART = 20_000


def table_format(output: Path | str | None, format: str | None) -> str:
    """The format asked for, or the one of the file's suffix, or csv.  UsageError: not a format."""
    if format is not None:
        refuse_unknown(format, TABLE_FORMATS, f"--format {format}", do="choose one")
        return format
    if output is None:
        return "csv"
    suffix = Path(output).suffix.lower()
    if suffix not in _SUFFIXES:
        raise UsageError(
            f"{output}: no format has the suffix {suffix!r}",
            allowed=f"allowed are {', '.join(_SUFFIXES)}",
            do="rename it or give --format",
        )
    return _SUFFIXES[suffix]


class TableWriter(AbstractContextManager["TableWriter"]):
    """Writes one table, part by part.

    `output` None is standard output; `name` is a key of `columns.TABLES` or a new table's name.
    """

    def __init__(
        self,
        name: str,
        output: Path | str | None,
        format: str | None,
        *,
        metadata: Mapping[str, Any] | None = None,
    ) -> None:
        self.name, self.output, self.format = name, output, table_format(output, format)
        self.metadata = dict(metadata or {})
        self.rows = 0
        self._names: tuple[str, ...] | None = None
        self._schema: pa.Schema | None = None
        self._parquet: Any = None
        self._stream: BinaryIO
        self._leaving = ExitStack()
        if output is None:
            self._stream = sys.stdout.buffer
            self._leaving.callback(self._stream.flush)
        else:
            self._stream = self._leaving.enter_context(whole_file(output)).open("wb")
            self._leaving.callback(self._stream.close)

    def write(self, columns: Mapping[str, Any]) -> None:
        """Append rows.

        The first part fixes the columns (a later one may lack some); the table's own order wins
        over the mapping's.

        UsageError: a part has columns that the first one has not.
        """
        rows = max((np.asarray(v).shape[0] for v in columns.values() if np.ndim(v) > 0), default=1)
        order = self._names or [c for c in TABLES.get(self.name, tuple(columns)) if c in columns]
        more = [c for c in columns if c not in order]
        if self._names and more:
            raise UsageError(
                f"has {', '.join(more)}, which the logs before have not (their setups say less)",
                allowed="a table has the columns of its first log",
                do="put the log with most of them first, or make a table of each",
                file=str(next(iter(np.atleast_1d(columns["log"])), "-"))
                if "log" in columns
                else None,
            )
        for start in range(0, max(rows, 1), _ROWS_A_PART):
            part = {}
            for name in (*order, *more):
                # a text or a number that some rows have not
                none = None if name in COLUMNS and COLUMNS[name].kind == "text" else np.nan
                values = np.asarray(columns.get(name, none))
                values = values if values.ndim else np.broadcast_to(values, (rows,))
                part[name] = values[start : start + _ROWS_A_PART]
            self._write(part)

    def _write(self, columns: Mapping[str, np.ndarray]) -> None:
        """Some rows, each column an array (n,)."""
        from tirelog.tables.arrow import arrow_table, csv_rows

        table = arrow_table(self.name, columns, self.format != "parquet", self._schema)
        self._begin(table.schema)
        if self.format == "parquet":
            self._parquet.write_table(table)
        elif self.format == "csv":
            self._stream.write(csv_rows(table))
        else:
            lines = [json.dumps(row, ensure_ascii=False) for row in table.to_pylist()]
            text = (
                "".join(line + "\n" for line in lines)
                if self.format == "ndjson"
                else ("," if self.rows else "") + ",\n".join(lines)
            )
            self._stream.write(text.encode())
        self.rows += table.num_rows

    def _begin(self, schema: pa.Schema) -> None:
        """Writes the text before the first row of a table of these columns."""
        if self._names is not None:
            return
        self._names = tuple(schema.names)
        if self.format == "parquet":
            import pyarrow.parquet as pq

            about = {"version": __version__, "table": self.name, **self.metadata}
            self._schema = schema.with_metadata({"tirelog": json.dumps(about, default=str)})
            self._parquet = pq.ParquetWriter(self._stream, self._schema, compression="zstd")
        elif self.format == "csv":
            self._stream.write((",".join(self._names) + "\n").encode())
        elif self.format == "json":
            self._stream.write(b"[")

    def __exit__(self, kind: Any, value: Any, trace: Any) -> None:
        # what the last bytes may meet (a full disk) is the file's to say, as what the first may
        with self._leaving:
            if value is not None:
                with suppress(Exception):  # else it complains when it is forgotten
                    if self._parquet is not None:
                        self._parquet.close()
                raise value
            self._end()

    def _end(self) -> None:
        """Writes the text behind the last row; for a table without rows its columns."""
        if self._names is None:
            import pyarrow as pa

            from tirelog.tables.arrow import arrow_field

            names = TABLES.get(self.name, ())
            self._begin(pa.schema([arrow_field(name, self.name) for name in names]))
        if self._parquet is not None:
            self._parquet.close()
        elif self.format == "json":
            self._stream.write(b"]\n")


# ---- Results as a notebook shows them: plain HTML, every text escaped.


def document(title: str, tables: Iterable[str], remarks: Iterable[str] = ()) -> str:
    """A title, tables, and remarks below them."""
    notes = "".join(f"<li>{_text(remark)}</li>" for remark in remarks)
    return f"<p><b>{_text(title)}</b></p>{''.join(tables)}" + (f"<ul>{notes}</ul>" if notes else "")


def table(names: Sequence[str], rows: Iterable[Iterable[Any]]) -> str:
    """A table with a row of names on top."""
    head = "".join(f"<th>{_text(name)}</th>" for name in names)
    body = "".join(f"<tr>{''.join(f'<td>{_text(cell)}</td>' for cell in row)}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def shown_cell(cell: Any) -> str:
    """A cell to read: four digits of a number, nothing if there is none."""
    if cell is None or (isinstance(cell, float) and not np.isfinite(cell)):
        return ""
    return f"{cell:.4g}" if isinstance(cell, float) else str(cell)


def _text(cell: Any) -> str:
    return escape(printable(shown_cell(cell)))
