"""MATLAB 5 files (.mat before 7.3, .fig) as HDF5, laid out as MATLAB 7.3 writes it.

    elements --unpacked one at a time, in pieces--> matrices --numbers, slice by slice--> datasets

A variable `x` is the dataset /x; a field of a structure /s/x, of an array of structures /s(2)/x, a
cell /c{3}. Complex, sparse and text arrays and objects are passed over and said.

Why not scipy.io: it makes room for what an array says it is, which in a damaged file may be
anything, and holds all of it at once. Tests hold this one against what scipy writes.
"""

from __future__ import annotations

import math
import re
import struct
import zlib
from pathlib import Path
from typing import BinaryIO

import h5py
import numpy as np
from numpy.typing import NDArray

from tirelog.errors import ReadError
from tirelog.readers.base import Converted
from tirelog.storage.whole import failed_writes

#: bytes of one variable, unpacked: the format itself holds no more
_MOST_BYTES = 1 << 31
#: bytes unpacked of a whole file
_MOST_TOTAL_BYTES = 1 << 33
#: bytes copied at once
_PIECE_BYTES = 1 << 20
#: bytes of one row of an array of three or more axes, which is copied whole
_MOST_ROW_BYTES = 1 << 25
#: arrays of a file, and structures within structures
_MOST_ARRAYS, _MOST_DEPTH = 5000, 16
#: bytes of a name, and axes of an array, that are looked at
_MOST_NAME_BYTES, _MOST_AXES = 1 << 16, 8
_COMPRESSED, _MATRIX = 15, 14
_CELL, _STRUCT, _DOUBLE, _LAST_NUMBER = 1, 2, 6, 15
_COMPLEX = 0x0800
#: how numbers are stored
_TYPES = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
_KINDS = {3: "an object", 5: "sparse", 16: "a function", 17: "an object (a table, a time series)"}
_TEXT, _OPAQUE = 4, 17


#: what h5py raises for a name that cannot be, such as a field of an array
_LIBRARY_ERRORS = (ValueError, OverflowError, TypeError, KeyError, RuntimeError)


class _Damaged(Exception):
    """The file is not what its lengths say."""


def convert(source: Path, target: Path, log: str) -> Converted:
    """Writes the numbers of the MATLAB file `source` to the HDF5 file `target`.

    ReadError: it holds none that can be read.
    """
    with source.open("rb") as file, failed_writes(target), h5py.File(target, "w") as made:
        work = _Conversion(file, made, target.with_name("element"))
        work.run()
    if not work.arrays:
        told = "; ".join([*work.said.losses[:3], *work.said.passed_over[:3]])
        raise ReadError(
            f"holds no array of numbers that can be read{f' ({told})' if told else ''}",
            allowed="allowed are real arrays of numbers",
            do="save them as such, or with -v7.3",
            file=log,
        )
    return work.said


class _Conversion:
    """One file on its way."""

    def __init__(self, file: BinaryIO, made: h5py.File, scratch: Path) -> None:
        self.file, self.made, self.scratch = file, made, scratch
        self.said = Converted()
        self.arrays = 0
        self.left = _MOST_TOTAL_BYTES
        head = file.read(128)
        self.order = "<" if head[126:128] == b"IM" else ">"

    def run(self) -> None:
        """All elements of the file; what is damaged is a loss."""
        at, number = 128, 0
        size = self.file.seek(0, 2)
        while at < size and self.arrays < _MOST_ARRAYS:
            number += 1
            self.file.seek(at)
            try:
                kind, length = struct.unpack(self.order + "II", self.file.read(8))
                self._element(kind, at + 8, min(length, size - at - 8))
                if length > size - at - 8:
                    raise _Damaged("the file is cut off")
            except (_Damaged, struct.error, *_LIBRARY_ERRORS) as problem:
                self.said.losses.append(f"variable {number}: {problem}; copy the file again")
                if at + 8 >= size or isinstance(problem, struct.error):
                    return
            at += 8 + length

    def _element(self, kind: int, start: int, length: int) -> None:
        if kind == _MATRIX:
            _Matrices(self, self.file, start + length).matrix(start, "", 0)
        elif kind == _COMPRESSED:
            with self.scratch.open("w+b") as plain:
                self._unpack(start, length, plain)
                size = plain.tell()
                plain.seek(0)
                head = plain.read(8)
                if len(head) < 8:
                    raise _Damaged("it is cut off")
                inside, many = struct.unpack(self.order + "II", head)
                if inside == _MATRIX:
                    _Matrices(self, plain, min(8 + many, size)).matrix(8, "", 0)
            self.scratch.unlink()

    def _unpack(self, start: int, length: int, plain: BinaryIO) -> None:
        """The element's bytes, as far as they are whole."""
        unpacker, room = zlib.decompressobj(), min(_MOST_BYTES, self.left)
        self.file.seek(start)
        while length > 0 and (rest := self.file.read(min(length, 1 << 16))):
            length -= len(rest)
            while not unpacker.eof:
                try:
                    part = unpacker.decompress(rest, _PIECE_BYTES)
                except zlib.error:
                    raise _Damaged("its packed bytes are damaged") from None
                rest = unpacker.unconsumed_tail
                room -= len(part)
                if room < 0:
                    raise _Damaged(f"it unpacks to more than {_MOST_BYTES >> 20} MB")
                self.left -= len(part)
                plain.write(part)
                if not part and not rest:
                    break


def _text(name: bytes) -> str:
    return name.decode("latin-1")


class _Matrices:
    """The arrays of one element, in a file that ends at `end`."""

    def __init__(self, work: _Conversion, file: BinaryIO, end: int) -> None:
        self.work, self.file, self.end, self.order = work, file, end, work.order

    def _tag(self, at: int) -> tuple[int, int, int, int]:
        """(kind, bytes, first byte, byte behind with padding) of the sub-element at `at`."""
        if at + 8 > self.end:
            raise _Damaged("it is cut off")
        self.file.seek(at)
        kind, length = struct.unpack(self.order + "II", self.file.read(8))
        if kind >> 16:  # small ones keep their bytes in the tag
            return kind & 0xFFFF, min(kind >> 16, 4), at + 4, at + 8
        return kind, length, at + 8, at + 8 + (length + 7) // 8 * 8

    def _bytes(self, at: int, most: int) -> tuple[bytes, int]:
        """(what a small sub-element holds, byte behind it)."""
        _, length, first, behind = self._tag(at)
        if length > most or first + length > self.end:
            raise _Damaged("a length in it is wrong")
        self.file.seek(first)
        return self.file.read(length), behind

    def _whole(self, at: int, most: int) -> tuple[tuple[int, ...], int]:
        held, behind = self._bytes(at, 4 * most)
        count = len(held) // 4
        return struct.unpack(f"{self.order}{count}i", held[: 4 * count]), behind

    def matrix(self, at: int, path: str, depth: int) -> int:
        """Converts the matrix whose first sub-element is at `at`; the byte behind it."""
        if at + 8 > self.end:
            return self.end
        flags, at = self._whole(at, 2)
        kind = flags[0] & 0xFF if flags else 0
        if kind == _OPAQUE:  # which has no axes
            name, _ = self._bytes(at, _MOST_NAME_BYTES)
            self.work.said.passed_over.append(f"{path or '/' + _text(name)} is {_KINDS[kind]}")
            return self.end
        dims, at = self._whole(at, _MOST_AXES)
        name, at = self._bytes(at, _MOST_NAME_BYTES)
        if not kind or len(dims) < 2 or min(dims) < 0:
            raise _Damaged("its head is damaged")
        if not path and not name:  # what MATLAB keeps of its objects, behind the variables
            return self.end
        path = path or f"/{_text(name)}"
        if _DOUBLE <= kind <= _LAST_NUMBER and not flags[0] & _COMPLEX:
            return self._numbers(at, path, dims)
        if kind == _STRUCT and depth < _MOST_DEPTH:
            return self._structures(at, path, math.prod(dims), depth)
        if kind == _CELL and depth < _MOST_DEPTH:
            return self._cells(at, path, math.prod(dims), depth)
        deep = "structures within structures" if kind in (_STRUCT, _CELL) else "an unknown kind"
        told = "complex" if flags[0] & _COMPLEX else _KINDS.get(kind, deep)
        if kind != _TEXT:
            self.work.said.passed_over.append(f"{path} is {told}")
        return self.end

    def _nested(self, at: int, path: str, depth: int) -> int:
        """The matrix within another at `at`, under the name `path`; the byte behind it."""
        kind, length, first, behind = self._tag(at)
        if kind != _MATRIX:
            raise _Damaged(f"{path} is damaged")
        if length:
            inner = _Matrices(self.work, self.file, min(first + length, self.end))
            inner.matrix(first, path, depth)
        return behind

    def _structures(self, at: int, path: str, many: int, depth: int) -> int:
        (size, *_), at = self._whole(at, 1)
        names, at = self._bytes(at, _MOST_NAME_BYTES)
        if not 0 < size <= _MOST_NAME_BYTES:
            raise _Damaged(f"{path} is damaged")
        fields = [_text(names[k : k + size].split(b"\0")[0]) for k in range(0, len(names), size)]
        for k in range(many if fields else 0):
            for field in fields:
                if at >= self.end or self.work.arrays >= _MOST_ARRAYS:
                    return self.end
                one = path if many == 1 else f"{path}({k + 1})"
                at = self._nested(at, f"{one}/{field}", depth + 1)
        return at

    def _cells(self, at: int, path: str, many: int, depth: int) -> int:
        for k in range(many):
            if at >= self.end or self.work.arrays >= _MOST_ARRAYS:
                return self.end
            at = self._nested(at, f"{path}{{{k + 1}}}", depth + 1)
        return at

    def _numbers(self, at: int, path: str, dims: tuple[int, ...]) -> int:
        """A real array, axes turned round as MATLAB 7.3 does."""
        kind, length, first, behind = self._tag(at)
        total = math.prod(dims)
        if kind not in _TYPES:
            raise _Damaged(f"{path} is damaged")
        if not total:
            return behind
        dtype = np.dtype(self.order + _TYPES[kind])
        there = max(min(length, self.end - first), 0) // dtype.itemsize
        parts = re.split(r"/", path[1:])
        if not all(re.fullmatch(r"[A-Za-z]\w{0,62}[\w(){}]{0,40}", part) for part in parts):
            self.work.said.passed_over.append(f"{path[:40]!r} has no proper name")
            return behind
        shape = dims[::-1]
        if there < total:
            missing = f"{path}: {total - there} of {total} numbers are not in the file"
            rows = there // (total // shape[0])
            self.work.said.losses.append(f"{missing}; copy it again")
            shape = (rows, *shape[1:])
            if len(dims) == 2 and shape[0] * shape[1] == 0 and dims[1] == 1:
                shape = (1, there)  # a column that is cut keeps what is there
            total = math.prod(shape)
            if not total:
                return behind
        if path in self.work.made:
            self.work.said.passed_over.append(f"{path} is there twice; the first is taken")
            return behind
        if len(shape) > 2 and math.prod(shape[1:]) * dtype.itemsize > _MOST_ROW_BYTES:
            self.work.said.passed_over.append(
                f"{path} has rows of more than {_MOST_ROW_BYTES >> 20} MB"
            )
            return behind
        self._copy(path, dtype, first, shape)
        self.work.arrays += 1
        return behind

    def _copy(self, path: str, dtype: np.dtype, first: int, shape: tuple[int, ...]) -> None:
        """Numbers from the byte `first` on to a dataset of this shape, piece by piece."""
        rows, row = shape[0], math.prod(shape[1:])
        self.file.seek(first)
        stored = self.work.made.create_dataset(path, shape=shape, dtype=dtype.newbyteorder("<"))
        at_once = max(_PIECE_BYTES // (row * dtype.itemsize), 1)
        if row * dtype.itemsize <= _PIECE_BYTES or len(shape) > 2:
            for start in range(0, rows, at_once):
                stop = min(start + at_once, rows)
                stored[start:stop] = self._next(dtype, (stop - start) * row).reshape(
                    stop - start, *shape[1:]
                )
            return
        step = _PIECE_BYTES // dtype.itemsize
        for k in range(rows):
            for start in range(0, row, step):
                stored[k, start : start + step] = self._next(dtype, min(step, row - start))

    def _next(self, dtype: np.dtype, count: int) -> NDArray[np.generic]:
        held = self.file.read(count * dtype.itemsize)
        if len(held) < count * dtype.itemsize:
            raise _Damaged("it is cut off")
        return np.frombuffer(held, dtype)
