"""What a file is, by its first bytes; of what is not read, the one line that converts it."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tirelog.data.setup import Setup
from tirelog.errors import ReadError
from tirelog.readers.other.conversion import FORMATS, extra_format
from tirelog.readers.text.reader import TextReader
from tirelog.readers.text.source import ByteSource

HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"
MCAP_MAGIC = b"\x89MCAP0\r\n"
PARQUET_MAGIC = b"PAR1"
#: bytes by which a format is told: magic numbers stand at the start
HEAD_BYTES = 4096

#: columns are the longer axis, and fields of records have names
_NUMPY = (
    "python -c \"import numpy, pandas; a = numpy.load('FILE'); "
    "a = a.T if a.ndim == 2 and len(a) < a.shape[1] else a; "
    "pandas.DataFrame(a).to_csv('log.csv', index=False, header=bool(a.dtype.names))\""
)
#: first bytes -> (name, how to make of it what is read)
_FOREIGN: tuple[tuple[bytes, str, str], ...] = (
    (b"\x93NUMPY", "a numpy array", _NUMPY),
    (b"LOGG\x90\0\0\0", "a CAN log of Vector (.blf)", "export it as csv or mat"),
    (b"\x80\x04\x95", "a Python pickle, which is never opened", "save it as csv or HDF5"),
    (b"BZh91AY&SY", "compressed by bzip2", "bunzip2 -k FILE"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-zip archive", "7z x FILE"),
    (b"Rar!\x1a\x07", "a RAR archive", "unrar x FILE"),
)


def is_hdf5(head: bytes) -> bool:
    return any(head[at : at + 8] == HDF5_MAGIC for at in (0, 512, 1024, 2048))


def name_of(head: bytes) -> str:
    """HDF5, MCAP, ..., a name of `FORMATS`, or '' for a log of text."""
    tests = {
        "HDF5": is_hdf5(head),
        "MATLAB": head[124:128] in (b"\x00\x01IM", b"\x01\x00MI"),  # 5 to 7.2; 7.3 is HDF5
        "Parquet": head.startswith(PARQUET_MAGIC),
        "WAV": head[:4] in (b"RIFF", b"RF64", b"BW64") and head[8:12] == b"WAVE",
        "MCAP": head.startswith(MCAP_MAGIC),
    }
    return next((name for name, found in tests.items() if found), "") or extra_format(head)


def refuse_foreign(head: bytes, log: str) -> None:
    """ReadError: a format that is known and not read."""
    found = next((one for one in _FOREIGN if head.startswith(one[0])), None)
    if found is not None:
        with_extras = ", ".join(name for name, one in FORMATS.items() if one.extra)
        raise ReadError(
            f"is {found[1]}",
            allowed="read are text, MCAP, HDF5, MATLAB, Parquet, Feather and WAV, and with an "
            f"extra {with_extras}",
            do=f"convert it first: {found[2]}",
            file=log,
        )


# ---- Parquet tables as the text that they would be: names, units and times are found as there.
#
#     row groups --batches of some rows--> arrow's CSV writer --> bytes that `readers.text` reads
#
# Numbers come as digits that make the same double again. Columns of text and of nested types are
# not
# handed on.


#: rows decoded at once
_ROWS = 1 << 14
#: unpacked bytes of one column in one row group; writers make some MB of it
_MOST_CHUNK_BYTES = 1 << 28
_SEPARATOR = "\t"


def open_parquet(path: Path, setup: Setup, name: str) -> TextReader:
    """A reader of the table at `path`.  ReadError: it is none, or holds no numbers."""
    source, table = text_of(path, name)
    reader = TextReader(source, setup, name)
    reader.report.format = "parquet"
    if table.left_out:
        reader.report.remarks.append(
            f"not read, as they hold neither numbers nor times: {', '.join(table.left_out[:5])}"
            + (", ..." if len(table.left_out) > 5 else "")
        )
    return reader


def text_of(path: Path, name: str) -> tuple[ByteSource, ParquetText]:
    """(the table at `path` as bytes of text, the table).  ReadError as for `open_parquet`."""
    table = ParquetText(path, name)
    return ByteSource(io.BufferedReader(table), name), table


class ParquetText(io.RawIOBase):
    """A Parquet file as a stream of text, read forward only.

    `left_out` are the names of columns that are no numbers or times. ReadError: not to be read.
    """

    def __init__(self, path: Path, name: str) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        self.name, self._pa = name, pa
        self._errors = (pa.ArrowException, OSError, ValueError, KeyError, MemoryError, TypeError)
        try:
            self._file = pq.ParquetFile(
                path, memory_map=False, pre_buffer=False, page_checksum_verification=True
            )
            schema = self._file.schema_arrow
            kinds = {field.name: self._target(field.type) for field in schema}
        except self._errors as problem:
            raise self._damaged(problem) from None
        twice = len(kinds) < len(schema)
        self._kinds = {n: kind for n, kind in kinds.items() if kind is not None}
        self.left_out = [n for n in kinds if n not in self._kinds]
        if not self._kinds or twice:
            what = "has a column name twice" if twice else "has no column of numbers"
            raise ReadError(
                f"the table {what}",
                allowed="allowed are columns of numbers and times",
                do="save those columns under names of their own",
                file=name,
            )
        self._check_size()
        self._parts, self._rest = self._text(), b""

    def _damaged(self, problem: Exception) -> ReadError:
        what = (str(problem).splitlines() or [type(problem).__name__])[0][:120]
        return ReadError(
            f"is no readable Parquet file ({what})",
            allowed="allowed is Parquet",
            do="copy it again, or save it again",
            file=self.name,
        )

    def _check_size(self) -> None:
        """ReadError: a column of one row group unpacks to more than memory should hold."""
        about = self._file.metadata
        for group in range(about.num_row_groups):
            rows = about.row_group(group)
            for k in range(rows.num_columns):
                size = rows.column(k).total_uncompressed_size
                if size > _MOST_CHUNK_BYTES:
                    raise ReadError(
                        f"row group {group} holds {size >> 20} MB of one column",
                        allowed=f"allowed are {_MOST_CHUNK_BYTES >> 20} MB",
                        do="write it with row_group_size=1000000",
                        file=self.name,
                    )

    def _target(self, kind: Any) -> Any:
        """The type that a column is written in; None if it is no number and no time."""
        pa = self._pa
        if pa.types.is_dictionary(kind):
            kind = kind.value_type
        if pa.types.is_floating(kind):
            return pa.float64()
        if pa.types.is_boolean(kind):
            return pa.uint8()
        if pa.types.is_duration(kind):
            return pa.int64()
        times = pa.types.is_timestamp(kind) or pa.types.is_date(kind) or pa.types.is_time(kind)
        return kind if pa.types.is_integer(kind) or pa.types.is_decimal(kind) or times else None

    def _text(self) -> Iterator[bytes]:
        """The header and the rows, piece by piece.  ReadError: damaged before the first row."""
        pa = self._pa
        from pyarrow import csv

        names = [" ".join(name.split()).replace('"', "'") for name in self._kinds]
        units = [
            f" [{kind.unit}]" if pa.types.is_duration(kind) else ""
            for kind in (self._file.schema_arrow.field(name).type for name in self._kinds)
        ]
        header = (name + unit for name, unit in zip(names, units, strict=True))
        yield (_SEPARATOR.join(header) + "\n").encode()
        options = csv.WriteOptions(include_header=False, delimiter=_SEPARATOR)
        schema = pa.schema(list(self._kinds.items()))
        try:
            for batch in self._file.iter_batches(
                batch_size=_ROWS, columns=list(self._kinds), use_threads=False
            ):
                table = pa.Table.from_batches([batch]).select(list(self._kinds)).cast(schema)
                sink = pa.BufferOutputStream()
                csv.write_csv(table, sink, options)
                yield sink.getvalue().to_pybytes()
        except self._errors as problem:
            # as the system says that a file cannot be read on: what came before is kept
            raise OSError(5, self._damaged(problem).what) from None

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        while not self._rest:
            part = next(self._parts, None)
            if part is None:
                return 0
            self._rest = part
        got = min(len(self._rest), len(buffer))
        buffer[:got], self._rest = self._rest[:got], self._rest[got:]
        return got
