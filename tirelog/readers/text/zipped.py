"""The one file of a zip archive, unpacked forward only, so that a pipe serves as well.

    bytes --local headers--> members --inflate, checksum--> the bytes of the one that counts

Folders and the resource files that a Mac adds do not count. A second file is not read, and said.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

_MEMBER, _DIRECTORY = b"PK\3\4", (b"PK\1\2", b"PK\5\6", b"PK\6\6", b"PK\6\7")
#: numbers of the format: methods of packing, bits of the flags, and a size that stands elsewhere
_STORED, _DEFLATED = 0, 8
_ENCRYPTED, _SIZES_BEHIND = 1, 8
_UNKNOWN_SIZE = 0xFFFFFFFF
#: bytes behind a member that its sizes and its checksum may take
_MOST_BEHIND = 24


class NotReadOn(Exception):
    """A sentence on why an archive was not read further."""


class _Feed:
    """Bytes that are taken from pieces."""

    def __init__(self, pieces: Iterator[bytes]) -> None:
        self._pieces, self._held = pieces, b""

    def some(self, most: int) -> bytes:
        """At least one byte and `most` at most, of one piece.  EOFError: there is none."""
        if not self._held:
            self._held = next((piece for piece in self._pieces if piece), b"")
            if not self._held:
                raise EOFError
        part, self._held = self._held[:most], self._held[most:]
        return part

    def take(self, size: int) -> bytes:
        """Just so many bytes.  EOFError: there are fewer."""
        parts = b""
        while len(parts) < size:
            parts += self.some(size - len(parts))
        return parts

    def back(self, data: bytes) -> None:
        """Gives bytes back, to be taken again."""
        self._held = data + self._held


def unzipped(pieces: Iterator[bytes]) -> Iterator[bytes]:
    """What the archive's one file holds.

    EOFError: cut off. NotReadOn: more files than one, or a kind of packing that is not read.
    ValueError: damaged.
    """
    feed, found = _Feed(pieces), False
    while True:
        mark = feed.take(4)
        if mark in _DIRECTORY:
            return
        if mark != _MEMBER:
            raise ValueError("no file where one should begin")
        _, flags, method, _, _, crc, packed, _, letters, extra = struct.unpack(
            "<HHHHHIIIHH", feed.take(26)
        )
        name = feed.take(letters).decode("utf-8", "replace")
        feed.take(extra)
        counts = not (name.endswith("/") or name.startswith("__MACOSX/"))
        if counts and found:
            raise NotReadOn(f"the zip archive holds a second file, {name[:80]!r}, and one is read")
        if flags & _ENCRYPTED:
            raise NotReadOn("the zip archive is encrypted")
        if method == _DEFLATED:
            data = _inflated(feed)
        elif method == _STORED and not flags & _SIZES_BEHIND and packed != _UNKNOWN_SIZE:
            data = _stored(feed, packed)
        else:
            raise NotReadOn(f"the zip archive is packed by method {method}, and deflate is read")
        found |= counts
        sum_ = 0
        for part in data:
            sum_ = zlib.crc32(part, sum_)
            if counts:
                yield part
        if flags & _SIZES_BEHIND:
            crc = _behind(feed)
        if sum_ != crc:
            raise ValueError("its checksum is wrong")


def _inflated(feed: _Feed) -> Iterator[bytes]:
    unpacker = zlib.decompressobj(wbits=-15)
    while not unpacker.eof:
        if part := unpacker.decompress(feed.some(1 << 11)):
            yield part
    feed.back(unpacker.unused_data)


def _stored(feed: _Feed, size: int) -> Iterator[bytes]:
    while size:
        part = feed.some(min(size, 1 << 16))
        size -= len(part)
        yield part


def _behind(feed: _Feed) -> int:
    """The checksum that stands behind a member, and the feed at what follows.

    With or without a mark of its own, and sizes of 4 or 8 bytes.
    """
    held = feed.take(12)
    while len(held) <= _MOST_BEHIND:
        held += feed.take(4)
        if held[-4:] in (_MEMBER, *_DIRECTORY):
            feed.back(held[-4:])
            at = 4 if held[:4] == b"PK\7\x08" else 0
            return int(struct.unpack("<I", held[at : at + 4])[0])
    raise ValueError("no file where one should begin")
