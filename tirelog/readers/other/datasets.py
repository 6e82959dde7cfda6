"""What libraries read, as files that are read here: a function for each format of FORMATS.

This file is longer than others, as all formats write columns in one way.
"""

from __future__ import annotations

import datetime as dt
import io
import lzma
import re
import warnings
import zipfile
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from typing import Any, Literal

import h5py
import numpy as np
from numpy.typing import NDArray

from tirelog.readers.base import ReadReport, is_signal_name, several_signals, signals_of, split_unit
from tirelog.readers.other.conversion import MEMORY_BYTES, NoNumbers, one_line

# ---- An HDF5 file of columns, which a converter fills piece by piece.


#: values of a chunk and rows decoded at once, and datasets of a file
_ROWS, _MOST_DATASETS = 1 << 14, 5000
#: letters of a name, and how deep conversions refer to others and structures hold others
_MOST_LETTERS, _MOST_DEPTH = 80, 8


def proper(name: object) -> str:
    """A name that a setup's `source` can spell: no brackets, colons, slashes."""
    plain = "".join(letter for letter in str(name)[: 4 * _MOST_LETTERS] if letter.isprintable())
    plain = re.sub(r"[/\[\]:]+", "_", plain).strip(" .")[:_MOST_LETTERS].strip(" .")
    return plain or "unnamed"


class Datasets:
    """The columns in an HDF5 file; what is no number is passed over in the answer."""

    def __init__(self, file: h5py.File, answer: ReadReport) -> None:
        self.file, self.answer, self.many = file, answer, 0

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
                    free, shape=(0,), maxshape=(None,), dtype=values.dtype, chunks=(_ROWS,)
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
        if (unit := split_unit(str(name))[1]) and not attributes.get("units"):
            made.attrs["units"] = unit
        self.many += 1
        return at

    def _free(self, group: h5py.Group, name: str) -> str:
        free, number = name, 2
        while free in group:
            free, number = f"{name}_{number}", number + 1
        return free


@contextmanager
def new_datasets(path: Path, answer: ReadReport) -> Iterator[Datasets]:
    """The columns of a new HDF5 file at `path`.  NoNumbers: there are none in the end."""
    with h5py.File(path, "w") as file:
        to = Datasets(file, answer)
        yield to
    if not to.many:
        raise NoNumbers("it holds no signal over time")


# ---- A sheet of an Excel workbook (xlsx, xls, xlsb, ods) as text: the first that has rows of
# numbers.
#
# Numbers come as digits that make the same double again, dates and times as ISO 8601.


#: rows of numbers that make a sheet a log, and those of a sheet in which they are looked for
_FEWEST_ROWS, _LOOKED_AT = 2, 10_000


def convert_excel(source: Path, target: Path, answer: ReadReport) -> None:
    """Writes the rows of one sheet to `target`.  NoNumbers: no sheet has rows of numbers."""
    from python_calamine import CalamineWorkbook

    with source.open("rb") as file, CalamineWorkbook.from_filelike(file) as book:
        names = list(book.sheet_names)
        for name in names:
            sheet = book.get_sheet_by_name(name)
            rows = sheet.iter_rows()
            some = [row for row, _ in zip(rows, range(_LOOKED_AT), strict=False)]
            with_numbers = (
                any(isinstance(cell, int | float) and not isinstance(cell, bool) for cell in row)
                for row in some
            )
            if sum(with_numbers) < _FEWEST_ROWS:
                continue
            with target.open("w", encoding="utf-8", newline="\n") as made:
                for row in chain(some, rows):
                    made.write("\t".join(map(_text, row)).rstrip("\t") + "\n")
            others = [one_line(other) for other in names if other != name]
            if others:
                told = ", ".join(others[:5]) + (", ..." if len(others) > 5 else "")
                answer.remarks.append(
                    f"the sheet {one_line(name)} is read, not {told}; "
                    "save another one as a file of its own to read that"
                )
            return
    raise NoNumbers("no sheet has rows of numbers")


def _text(cell: object) -> str:
    if isinstance(cell, bool):
        return str(int(cell))
    if isinstance(cell, int | float):
        return repr(cell)
    if isinstance(cell, dt.timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, dt.datetime | dt.time):
        return cell.isoformat(timespec="microseconds")
    if isinstance(cell, dt.date):
        return cell.isoformat()
    return " ".join(str(cell).split()).replace('"', "'")


# ---- The text in a zip archive, as it is.


#: bytes unpacked at once: what precedes damage is kept
_PIECE_BYTES = 1 << 12


def convert_zip(source: Path, target: Path, answer: ReadReport) -> None:
    """Writes the first file to `target`; folders and what a Mac adds do not count."""
    with zipfile.ZipFile(source) as archive:
        names = [name for name in archive.namelist() if not name.startswith("__MACOSX/")]
        files = [name for name in names if not name.endswith("/")]
        if not files:
            raise NoNumbers("it holds no file")
        if len(files) > 1:
            answer.losses.append(f"it holds a second file, {files[1]!r}, and one is read")
        with archive.open(files[0]) as member, target.open("wb") as made:
            try:
                while part := member.read(_PIECE_BYTES):
                    made.write(part)
            except (zipfile.BadZipFile, zlib.error, lzma.LZMAError, EOFError) as problem:
                answer.losses.append(
                    f"the archive is damaged ({one_line(problem)}); copy the log again"
                )
            if not made.tell():
                raise NoNumbers("nothing of it can be unpacked")


# ---- Parquet tables and Arrow files (Feather 2) as text, in which names and times are found.
#
# Numbers come as digits that make the same double again. Columns of text and of nested types are
# not handed on.


#: arrow's names of types of words
_WORDS = re.compile(r"(dictionary<values=)?(large_)?string")


def convert_arrow(source: Path, target: Path, answer: ReadReport) -> None:
    """Writes the columns of numbers and of times to `target`.

    NoNumbers: it has none, or a column of words says that they are of several signals.
    """
    import pyarrow as pa
    from pyarrow import csv

    schema, batches = _arrow_batches(source)
    kinds = {field.name: _written_kind(field.type) for field in schema}
    if len(kinds) < len(schema):
        raise NoNumbers("the table has a column name twice; save those under names of their own")
    kept = pa.schema([(name, kind) for name, kind in kinds.items() if kind is not None])
    if not kept.names:
        raise NoNumbers("the table has no column of numbers")
    words = [field.name for field in schema if _WORDS.match(str(field.type))]
    named, signals = [name for name in words if is_signal_name(name)], set[str]()
    left_out = [one_line(name) for name, kind in kinds.items() if kind is None]
    if left_out:
        answer.remarks.append(
            f"not read, as they hold neither numbers nor times: {', '.join(left_out[:5])}"
            + (", ..." if len(left_out) > 5 else "")
        )
    options = csv.WriteOptions(include_header=False, delimiter="\t")
    rows = 0
    with target.open("wb") as made, csv.CSVWriter(made, kept, write_options=options) as writer:
        made.write(("\t".join(_titles(schema, kept.names)) + "\n").encode())
        try:
            for batch in batches:
                if not rows and len(named) == 1:  # as many as show names in turns
                    cells = batch.column(named[0])[:400].to_pylist()
                    of_kinds = ["text", *["number"] * len(kept)]
                    signals = signals_of([*named, *kept.names], of_kinds, [cells].__getitem__)[1]
                if len(named) == 1 and len(kept) <= 2:
                    signals.update(filter(None, batch.column(named[0]).unique().to_pylist()))
                if len(signals) > 1:
                    raise NoNumbers(several_signals(signals, named[0]))
                some = batch.select(kept.names)
                some.validate(full=True)
                writer.write_batch(some.cast(kept))
                rows += len(batch)
        except MemoryError:
            raise
        except (pa.ArrowException, OSError, ValueError, KeyError, TypeError) as problem:
            if not rows:
                raise
            answer.losses.append(
                f"cannot be read to its end ({one_line(problem)}); what follows is lost; "
                "copy it again"
            )


def _arrow_batches(source: Path) -> tuple[Any, Iterator[Any]]:
    """(schema, batches of rows) of an Arrow or a Parquet file."""
    import pyarrow.ipc as ipc
    import pyarrow.parquet as pq

    if source.open("rb").read(4) == b"PAR1":
        table = pq.ParquetFile(
            source, memory_map=False, pre_buffer=False, page_checksum_verification=True
        )
        return table.schema_arrow, table.iter_batches(batch_size=_ROWS, use_threads=False)
    file = ipc.open_file(source.open("rb"), options=ipc.IpcReadOptions(use_threads=False))
    return file.schema, (file.get_batch(k) for k in range(file.num_record_batches))


def _written_kind(kind: Any) -> Any:
    """The type that a column is written in; None if it is no number and no time."""
    from pyarrow import float64, int64, types, uint8

    if types.is_dictionary(kind):
        kind = kind.value_type
    if types.is_floating(kind):
        return float64()
    if types.is_boolean(kind):
        return uint8()
    if types.is_duration(kind):
        return int64()
    times = types.is_timestamp(kind) or types.is_date(kind) or types.is_time(kind)
    return kind if types.is_integer(kind) or types.is_decimal(kind) or times else None


def _titles(schema: Any, names: list[str]) -> Iterator[str]:
    """The names of columns as a header of text has them, a span of time with its unit."""
    from pyarrow import types

    for name in names:
        kind = schema.field(name).type
        span = types.is_duration(kind)
        if span and name.startswith("__index_level_"):  # as pandas calls an index without a name
            name = "index time"
        yield " ".join(name.split()).replace('"', "'") + (f" [{kind.unit}]" if span else "")


# ---- MDF measurements (versions 3 and 4) as HDF5: a group per clock, its channels and their times.
#
# Numbers go through the conversions that the file states. One that is a formula is handed to
# numexpr,
# which evaluates text; so only sums and products of numbers and X are let through.


#: records read at once
_RECORDS = 1 << 18
_FORMULA = re.compile(r"(?:[-+*/() \t]|\d+\.?\d*(?:[eE][-+]?\d+)?|[Xx]1?)*")
_MDF_LETTERS = 200


def convert_mdf(source: Path, target: Path, answer: ReadReport) -> None:
    """Writes the channels of numbers to `target`, with the times of each group."""
    from asammdf import MDF

    with MDF(source) as file, new_datasets(target, answer) as to:
        answer.start = file.start_time.isoformat()
        masters = file.masters_db
        for number, group in enumerate(file.groups):
            records = int(group.channel_group.cycles_nr)
            if not records:
                continue
            name = getattr(group.channel_group, "acq_name", "") or f"group_{number + 1}"
            made = to.group(name)
            for index, channel in enumerate(group.channels):
                is_time = masters.get(number) == index
                if not is_time and (formula := unsafe_formula(channel.conversion)):
                    answer.passed_over.append(
                        f"{proper(channel.name)} is converted by the formula {formula!r}"
                    )
                    continue
                unit: list[str] = []
                pieces = _pieces(file, number, index, records, unit)
                try:
                    first = next(pieces, None)
                    if first is None:
                        continue
                    to.add(
                        made,
                        "time" if is_time else channel.name,
                        chain([first], pieces),
                        {"units": "s" if is_time else unit[0]},
                    )
                except MemoryError:
                    raise
                # one channel that is damaged is no reason to lose the others
                except Exception as problem:
                    kind = type(problem).__name__
                    answer.losses.append(f"{proper(channel.name)} cannot be read ({kind})")


def _pieces(
    file: Any, group: int, index: int, records: int, unit: list[str]
) -> Iterator[NDArray[Any]]:
    """The channel's values, NaN where the file says that they are none; `unit` is filled."""
    for start in range(0, records, _RECORDS):
        signal = file.get(
            group=group,
            index=index,
            record_offset=start,
            record_count=min(_RECORDS, records - start),
            ignore_invalidation_bits=True,
        )
        unit.append(str(signal.unit or ""))
        values = signal.samples
        if signal.invalidation_bits is not None and values.dtype.kind in "iufb":
            values = np.where(np.asarray(signal.invalidation_bits, bool), np.nan, values)
        yield values
        if not values.size:
            return


def unsafe_formula(conversion: Any, depth: int = 0) -> str:
    """A formula in a conversion, or in those that it refers to, that is more than arithmetic."""
    if conversion is None:
        return ""
    formula = getattr(conversion, "formula", "") or ""
    if isinstance(formula, bytes):
        formula = formula.decode("latin-1")
    long = len(formula) > _MDF_LETTERS or depth > _MOST_DEPTH
    if long or "**" in formula or not _FORMULA.fullmatch(formula):
        return str(formula)[:40] or "of formulas"
    inside = getattr(conversion, "referenced_blocks", None) or {}
    found = (
        unsafe_formula(one, depth + 1)
        for one in inside.values()
        if not isinstance(one, bytes | str)
    )
    return next((formula for formula in found if formula), "")


# ---- LabVIEW's TDMS as HDF5: /group/channel, with its unit and the step of its samples.


_SECOND = np.timedelta64(1, "s")


def convert_tdms(source: Path, target: Path, answer: ReadReport) -> None:
    """Writes the channels of numbers and of times to `target`."""
    from nptdms import TdmsFile

    # a stream, not a path: beside that the library looks for an index, which may be another's
    with (
        source.open("rb") as stream,
        TdmsFile.open(stream) as file,
        new_datasets(target, answer) as to,
    ):
        begins = {
            channel.path: when.astype("M8[us]")
            for group in file.groups()
            for channel in group.channels()
            if isinstance(when := channel.properties.get("wf_start_time"), np.datetime64)
            and "wf_increment" in channel.properties
            and not np.isnat(when)
        }
        first = min(begins.values(), default=None)
        answer.start = None if first is None else f"{first}+00:00"
        for group in file.groups():
            made, channels = to.group(group.name), group.channels()
            dated = [one.name for one in channels if len(one) and one.dtype.kind == "M"]
            for channel in channels:
                said = channel.properties
                own = begins.get(channel.path, first)
                after_s = 0.0 if own is None or first is None else (own - first) / _SECOND
                unit = said.get("unit_string") or said.get("NI_UnitDescription")
                attributes = {
                    "units": unit if isinstance(unit, str) else None,
                    "wf_increment": _number(said.get("wf_increment")),
                    "start_s": after_s + (_number(said.get("wf_start_offset")) or 0.0),
                }
                if len(channel) and channel.dtype.kind == "M":
                    attributes = {"units": "ns since 1970-01-01T00:00:00+00:00"}
                if len(channel) and channel.dtype.kind not in "iufbM":
                    answer.passed_over.append(f"{proper(channel.name)} holds no real numbers")
                else:
                    name = "time" if dated == [channel.name] else channel.name
                    to.add(made, name, _tdms_pieces(channel), attributes)
        if file.file_status.incomplete_final_segment:
            answer.losses.append(
                "the file is cut off in its last segment, whose end is lost; copy it again"
            )


def _tdms_pieces(channel: Any) -> Iterator[NDArray[Any]]:
    """The samples as the file's segments hold them; times as whole nanoseconds."""
    for chunk in channel.data_chunks():
        values = chunk[:]
        yield values.astype("M8[ns]").astype(np.int64) if values.dtype.kind == "M" else values


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float | np.number) else None


# ---- MATLAB 5 to 7.2 as HDF5, laid out as MATLAB 7.3 writes it: axes turned round.
#
# A variable `x` is the dataset /x; a field of a structure /s/x, of an array of structures /s(2)/x,
# a cell /c{3}. No object is made and no function called: those are passed over by name.


#: bytes of one variable in the file: the library needs up to three times as many at once
_MOST_VARIABLE_BYTES = MEMORY_BYTES // 4
_MATLAB_PATH = re.compile(r"(/[A-Za-z]\w{0,62}[(){}\d]{0,40})+", re.ASCII)
#: what is not read, by the library's class; all others are sparse
_NOT_READ = {
    "MatlabObject": "an object",
    "MatlabOpaque": "an object (a table, a time series)",
    "MatlabFunction": "a function",
}


def convert_matlab(source: Path, target: Path, answer: ReadReport) -> None:
    """Writes the real arrays of numbers to `target`, one variable after the other."""
    from scipy.io import loadmat

    with source.open("rb") as file, new_datasets(target, answer) as to:
        head, size, at, number = file.read(128), source.stat().st_size, 128, 0
        while at + 8 <= size:
            number += 1
            order: Literal["little", "big"] = "little" if head.endswith(b"IM") else "big"
            length = 8 + int.from_bytes(file.read(8)[4:], order)
            file.seek(at)
            at += length
            if length > _MOST_VARIABLE_BYTES:
                answer.passed_over.append(f"variable {number} is large; save it with -v7.3")
                file.seek(at)
                continue
            try:
                read = loadmat(io.BytesIO(head + file.read(length)))
                # what begins so MATLAB or the library keep for themselves
                arrays = {n: value for n, value in read.items() if not n.startswith("__")}
                if any(isinstance(value, str) for value in arrays.values()):
                    raise ValueError  # so the library says what it cannot read
            # the library's errors are of several trees, one for want of memory among them
            except Exception as problem:
                answer.losses.append(
                    f"variable {number} cannot be read ({type(problem).__name__}); copy the file "
                    "again, or save it with -v7.3"
                )
                continue
            for name, value in arrays.items():
                opaque = type(value).__name__ == "MatlabOpaque"  # which has its name inside
                name = value["s0"][0].decode("latin-1") if opaque else name
                _add_matlab(to, f"/{proper(name)}", value, 0)


def _add_matlab(to: Datasets, path: str, value: Any, depth: int) -> None:
    """Writes an array of numbers, or those in a structure or a cell."""
    inside: list[tuple[str, Any]] = []
    what = ""
    if type(value) is not np.ndarray:
        what = f"is {_NOT_READ.get(type(value).__name__, 'sparse')}"
    elif value.dtype.names:
        for k, one in enumerate(value.ravel("F"), 1):
            at = path if value.size == 1 else f"{path}({k})"
            inside += [(f"{at}/{field}", one[field]) for field in value.dtype.names]
    elif value.dtype.kind == "O":
        inside = [(f"{path}{{{k}}}", one) for k, one in enumerate(value.ravel("F"), 1)]
    elif value.dtype.kind == "c":
        what = "is complex"
    elif value.dtype.kind in "iuf" and value.size and to.many < _MOST_DATASETS:
        if not _MATLAB_PATH.fullmatch(path):
            what = "has no proper name"
        elif path in to.file:
            what = "is there twice; the first is taken"
        else:
            dtype = value.dtype.newbyteorder("<")
            to.file.create_dataset(path, data=value.T.astype(dtype, copy=False))
            to.many += 1
    if inside and depth >= _MOST_DEPTH:
        what, inside = "is structures within structures", []
    if what:
        to.answer.passed_over.append(f"{path[:_MOST_LETTERS]} {what}")
    for place, one in inside:
        _add_matlab(to, place, one, depth + 1)


# ---- WAV as HDF5: #1, #2, ... of shares of full scale, at the rate that the file states.


#: bytes of a recording, which the library reads whole: 24 bits take three times as many
_MOST_WAV_BYTES = 320 << 20


def convert_wav(source: Path, target: Path, answer: ReadReport) -> None:
    """Writes the channels to `target`, as shares of full scale."""
    from scipy.io import wavfile

    with source.open("rb") as file:
        head = file.read(8)
    if head.startswith(b"RIFF") and head[4:] in (bytes(4), b"\xff" * 4):
        raise NoNumbers("its header states no length, as a stream's does; save it as a file")
    if source.stat().st_size > _MOST_WAV_BYTES:
        raise MemoryError
    with warnings.catch_warnings(record=True) as warned:
        warnings.simplefilter("always")
        rate, frames = wavfile.read(source)
    if any("prematurely" in str(one.message) for one in warned):
        answer.losses.append("the file is cut off; copy it again")
    frames = frames.reshape(len(frames), -1)
    full = 1.0 if frames.dtype.kind == "f" else 2.0 ** (8 * frames.dtype.itemsize - 1)
    middle = full if frames.dtype.kind == "u" else 0.0
    with new_datasets(target, answer) as to, np.errstate(invalid="ignore"):
        for k in range(frames.shape[1]):
            # piece by piece, as floats take more room than what is stored
            pieces = (
                (frames[at : at + _RECORDS, k].astype(np.float64) - middle) / full
                for at in range(0, len(frames), _RECORDS)
            )
            finite = (np.where(np.isfinite(piece), piece, np.nan) for piece in pieces)
            to.add(to.file, f"#{k + 1}", finite, {"sampling_rate_Hz": float(rate)})
            others = [f"channel_{k + 1}", *(["left", "right"][k : k + 1])]
            to.file.update({other: h5py.SoftLink(f"/#{k + 1}") for other in others})
