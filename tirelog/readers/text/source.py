"""Bytes of a text log, whatever wraps them.

Plain, gzip, zstd or xz, from a file or from standard input.

    path or stream --magic bytes--> ByteSource --cut at newlines--> pieces of 2 MB

Nothing seeks, so standard input serves as well as a file. A compressed stream that is
cut off or damaged gives what could be unpacked; `ByteSource.problem` then says so.
"""

from __future__ import annotations

import lzma
import zlib
from codecs import iterdecode
from collections.abc import Iterator
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO

from tirelog.errors import ReadError

#: bytes that sniffing may look at
HEAD_BYTES = 1 << 18
#: bytes per block that is parsed at once: larger ones are no faster and hold more memory
BLOCK_BYTES = 2 << 20
#: a line longer than this is no text row
LONGEST_LINE_BYTES = 8 << 20
#: compressed bytes unpacked at once: zstd turns 4 bytes into 128 KB, so 2 KB become 64 MB at most
_UNPACKED_BYTES = 1 << 11
#: unpacked bytes, a second's, in which damage is looked for that may have spoilt the head; twice as
#: many keep who has misspelt a setup waiting for twice as long
_LOOKED_BYTES = 1 << 28

_MAGIC = {
    "gzip": b"\x1f\x8b",
    "zstd": b"\x28\xb5\x2f\xfd",
    "xz": b"\xfd7zXZ\x00",
}


def _unpacker(kind: str) -> Any:
    """A fresh incremental decompressor with `decompress`, `eof` and `unused_data`."""
    if kind == "gzip":
        return zlib.decompressobj(wbits=31)
    if kind == "xz":
        return lzma.LZMADecompressor()
    import zstandard

    return zstandard.ZstdDecompressor().decompressobj()


def _unpack(kind: str, pieces: Iterator[bytes]) -> Iterator[bytes]:
    """Unpacked bytes of one or several members after one another.

    EOFError if the last member is not whole.
    """
    unpacker = _unpacker(kind)
    for piece in pieces:
        rest = piece
        while rest:
            if unpacker.eof:
                if not rest.startswith(_MAGIC[kind][:2]):
                    rest = rest.lstrip(b"\0")  # padding behind the last member
                    if not rest:
                        break
                unpacker = _unpacker(kind)
            yield unpacker.decompress(rest)
            rest = unpacker.unused_data if unpacker.eof else b""
    if not unpacker.eof:
        raise EOFError


def _as_utf_8(pieces: Iterator[bytes]) -> Iterator[bytes]:
    """Pieces of UTF-16 as UTF-8, as their first letters show it; others as they are."""
    first = next(pieces, b"")
    encoding = _utf_16(first[:4096])
    if not encoding:
        yield first
        yield from pieces
        return
    for text in iterdecode(chain([first], pieces), encoding, "replace"):
        yield text.encode()


def _utf_16(head: bytes) -> str:
    """The encoding of text that is UTF-16, by its mark or as every other byte is 0; else ''."""
    if head.startswith((b"\xff\xfe\0\0", b"\0\0\xfe\xff")):  # UTF-32
        return ""
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    even, odd = head[::2].count(0), head[1::2].count(0)
    if max(even, odd) <= len(head) // 5 or min(even, odd) * 9 >= max(even, odd):
        return ""
    return "utf-16-be" if even > odd else "utf-16-le"


class ByteSource:
    """The unpacked bytes of a log, read forward only.

    `kind` is plain, gzip, zstd or xz; `problem` is a sentence if the compressed stream ended
    early or is damaged; `endless` is true if a line has no end within LONGEST_LINE_BYTES (a hole in
    the file), and neither it nor what follows was given.
    """

    def __init__(self, source: Path | str | BinaryIO, name: str) -> None:
        self.name, self.problem, self.endless, self.unpacked_bytes = name, "", False, 0
        self._file: BinaryIO = open(source, "rb") if isinstance(source, str | Path) else source  # noqa: SIM115
        self._owned = isinstance(source, str | Path)
        start = self._file.read(_UNPACKED_BYTES)
        self.kind = next(
            (kind for kind, magic in _MAGIC.items() if start.startswith(magic)), "plain"
        )
        self._pieces = _as_utf_8(self._read(start))
        self._held = b""

    def _read(self, start: bytes) -> Iterator[bytes]:
        """Unpacked pieces, none of which is longer than a block."""
        size = BLOCK_BYTES if self.kind == "plain" else _UNPACKED_BYTES
        raw = chain([start], iter(partial(self._file.read, size), b""))
        try:
            for piece in raw if self.kind == "plain" else _unpack(self.kind, raw):
                for at in range(0, len(piece), BLOCK_BYTES):  # it may unpack to very much
                    part = piece[at : at + BLOCK_BYTES]
                    self.unpacked_bytes += len(part)
                    yield part
        except EOFError:
            self.problem = (
                f"the {self.kind} stream is cut off after {self.unpacked_bytes} unpacked bytes"
            )
        # zlib.error, lzma.LZMAError, zstandard.ZstdError: each library has its own tree
        except Exception as problem:
            if isinstance(problem, OSError):
                raise
            self.problem = (
                f"the {self.kind} stream is damaged after {self.unpacked_bytes} unpacked bytes "
                f"({problem})"
            )

    def head(self) -> bytes:
        """The first bytes, which `blocks` gives again.  ReadError: none could be unpacked."""
        parts, have = [self._held], len(self._held)
        while have < HEAD_BYTES and (piece := next(self._pieces, b"")):
            parts.append(piece)
            have += len(piece)
        self._held = b"".join(parts)
        if self.problem and not self._held.strip():
            raise ReadError(
                f"{self.problem}; nothing before that could be unpacked",
                do="copy the log again",
                file=self.name,
            )
        return self._held[:HEAD_BYTES]

    def damage(self) -> str:
        """`problem`, after reading on: a checksum follows the data that it covers.

        Nothing can be read after this.
        """
        packed = self.kind != "plain"
        while packed and self.unpacked_bytes < _LOOKED_BYTES and next(self._pieces, b""):
            pass
        return self.problem

    def blocks(
        self, skip: int, size: int = BLOCK_BYTES, *, returns: bool = False
    ) -> Iterator[bytes]:
        """Whole lines from byte `skip` to the end, `size` bytes or more.

        `returns` takes carriage returns for the ends of lines. A last line without its end comes as
        it is.
        """
        parts: list[bytes | memoryview] = []
        have = unended = 0
        for piece in chain([self._held[skip:]], self._pieces):
            lines = piece.replace(b"\r", b"\n") if returns else piece
            have += len(lines)
            cut = lines.rfind(b"\n") + 1
            if cut and have >= size:
                yield b"".join([*parts, memoryview(lines)[:cut]])
                parts, have = [lines[cut:]], len(lines) - cut
            else:
                parts.append(lines)
            unended = (0 if cut else unended) + len(lines) - cut
            self.endless = unended > LONGEST_LINE_BYTES
            if self.endless:
                break
        block = b"".join(parts)
        block = block[: block.rfind(b"\n") + 1] if self.endless else block
        if block:
            yield block

    def close(self) -> None:
        """Closes a file that this object opened."""
        if self._owned:
            self._file.close()
