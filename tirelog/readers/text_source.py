"""Bytes of a text log, whatever wraps them: plain, gzip, zstd or xz, from a file or from standard input.

    path or stream --magic bytes--> ByteSource --cut at newlines--> (first line's number, bytes) pieces of about 2 MB

Nothing seeks, so standard input serves as well as a file.  A compressed stream that is cut off or damaged gives what could be
unpacked; `ByteSource.problem` then says so.
"""

from __future__ import annotations

import lzma
import zlib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from tirelog.errors import ReadError

#: bytes that sniffing may look at
HEAD_BYTES = 1 << 18
#: bytes a block that is parsed at once: larger ones are no faster and hold more memory
BLOCK_BYTES = 2 << 20
#: a line longer than this is no text row
LONGEST_LINE_BYTES = 8 << 20
#: compressed bytes unpacked at once
_PIECE_BYTES = 1 << 14

_MAGIC = {"gzip": b"\x1f\x8b", "zstd": b"\x28\xb5\x2f\xfd", "xz": b"\xfd7zXZ\x00"}


def _unpacker(kind: str) -> Any:
    """A fresh incremental decompressor with `decompress`, `eof` and `unused_data`."""
    if kind == "gzip":
        return zlib.decompressobj(wbits=31)
    if kind == "xz":
        return lzma.LZMADecompressor()
    import zstandard

    return zstandard.ZstdDecompressor().decompressobj()


def _unpack(kind: str, pieces: Iterator[bytes]) -> Iterator[bytes]:
    """Unpacked bytes of one or several members after one another.  EOFError where the last member is not whole."""
    unpacker, started = _unpacker(kind), False
    for piece in pieces:
        rest = piece
        while rest:
            if unpacker.eof:
                if not rest.startswith(_MAGIC[kind][:2]):
                    rest = rest.lstrip(b"\0")  # padding behind the last member
                    if not rest:
                        break
                unpacker, started = _unpacker(kind), False
            started = True
            yield unpacker.decompress(rest)
            rest = unpacker.unused_data if unpacker.eof else b""
    if started and not unpacker.eof:
        raise EOFError


class ByteSource:
    """The unpacked bytes of a log, read forward only.

    `kind` is plain, gzip, zstd or xz; `problem` is a sentence where the compressed stream ended early or is damaged.
    """

    def __init__(self, source: Path | str | BinaryIO, name: str) -> None:
        self.name, self.problem, self.unpacked_bytes = name, "", 0
        try:
            self._file: BinaryIO = open(source, "rb") if isinstance(source, str | Path) else source  # noqa: SIM115
            self._owned = isinstance(source, str | Path)
            start = self._file.read(_PIECE_BYTES)
        except OSError as problem:
            raise ReadError(f"cannot be read ({problem.strerror}); a log is a readable file or -; check the path", file=name) from None
        self.kind = next((kind for kind, magic in _MAGIC.items() if start.startswith(magic)), "plain")
        self._pieces = self._read(start)
        self._held: list[bytes] = []

    def _read(self, start: bytes) -> Iterator[bytes]:
        size = _PIECE_BYTES if self.kind != "plain" else BLOCK_BYTES

        def raw() -> Iterator[bytes]:
            yield start
            while piece := self._file.read(size):
                yield piece

        if self.kind == "plain":
            yield from raw()
            return
        try:
            for piece in _unpack(self.kind, raw()):  # a piece may unpack to nothing yet, or to very much
                for at in range(0, len(piece), BLOCK_BYTES):
                    yield piece[at : at + BLOCK_BYTES]
        except EOFError:
            self.problem = f"the {self.kind} stream is cut off after {self.unpacked_bytes} unpacked bytes"
        except Exception as problem:  # zlib.error, lzma.LZMAError, zstandard.ZstdError: each library has its own tree
            if isinstance(problem, OSError):
                raise
            self.problem = f"the {self.kind} stream is damaged after {self.unpacked_bytes} unpacked bytes ({problem})"

    def head(self) -> bytes:
        """The first bytes, which `blocks` gives again."""
        while sum(map(len, self._held)) < HEAD_BYTES and (piece := self._next()):
            self._held.append(piece)
        self._held = [b"".join(self._held)]
        return self._held[0][:HEAD_BYTES]

    def _next(self) -> bytes:
        """Another piece; empty at the end."""
        piece = next(self._pieces, b"")
        self.unpacked_bytes += len(piece)
        return piece

    def blocks(self, skip: int, line: int, size: int = BLOCK_BYTES, *, returns: bool = False) -> Iterator[tuple[int, int, bytes]]:
        """(number of the first line, line ends, whole lines) from byte `skip`, which begins line `line`, to the end.

        `returns` takes carriage returns for the ends of lines.  A last line without its end comes as it is.  A line without end
        (a hole in the file) is given up: `problem` says where.
        """
        rest = b"".join(self._held)[skip:]
        rest = rest.replace(b"\r", b"\n") if returns else rest
        self._held = []
        parts, have = [rest], len(rest)
        while piece := self._next():
            parts.append(piece.replace(b"\r", b"\n") if returns else piece)
            have += len(piece)
            if have < size:
                continue
            joined = b"".join(parts)
            cut = joined.rfind(b"\n") + 1
            if cut:
                block = joined[:cut]
                ends = _line_ends(block)
                yield line, ends, block
                line += ends
            rest = joined[cut:]
            parts, have = [rest], len(rest)
            if have > LONGEST_LINE_BYTES:
                self.problem = f"line {line} has no end within {LONGEST_LINE_BYTES >> 20} MB; the rest was not read"
                return
        if have:
            block = b"".join(parts)
            yield line, _line_ends(block), block

    def close(self) -> None:
        """Closes a file that this object opened."""
        if self._owned:
            with suppress(OSError):
                self._file.close()


def _line_ends(block: bytes) -> int:
    return int(np.count_nonzero(np.frombuffer(block, np.uint8) == 10))
