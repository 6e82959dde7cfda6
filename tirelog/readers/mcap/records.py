"""The records of an MCAP stream, from its first byte to its last, without seeking.

Whole chunks, checksums verified.

    bytes --record by record--> schemas, channels, chunks
        --decompress, CRC--> Chunk (records, uncompressed)

A chunk whose checksum fails is a loss and is left out. If the chain of records breaks, the next
chunk is looked for; if none follows, the file is cut off there. Messages outside of chunks are
gathered into chunks of our own.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import BinaryIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Schema, Statistics

from tirelog.errors import ReadError
from tirelog.readers.base import ReadReport
from tirelog.readers.mcap.walk import HEAD, LARGEST_DEFINITION_BYTES, MOST_RECORDS, record_starts

MAGIC = b"\x89MCAP0\r\n"
#: a chunk has to be decompressed whole to check it
LARGEST_CHUNK_BYTES = 1 << 28
#: bytes of messages outside of chunks that make up a chunk of our own
LOOSE_BYTES = 1 << 20
#: schemas and channels that a file may define
MOST_DEFINITIONS = 1 << 16
#: bytes of all schemas and channels that are kept: those of real logs are below 1 MB
MOST_DEFINITION_BYTES = 1 << 25
#: records that a chunk may hold beside so many per stored byte: a message that differs from its
#: neighbours costs a packer 2 bytes or more
FEW_RECORDS, RECORDS_PER_BYTE = 1 << 14, 4
CHUNK_HEAD = struct.Struct("<QQQII")
RECORD_ERRORS = (
    McapError,
    struct.error,
    UnicodeDecodeError,
    ValueError,
    EOFError,
    OverflowError,
    MemoryError,
)
#: damaged places that are told one by one
MOST_SAID = 5
#: opcodes from here on are free for private use
PRIVATE = 0x80


@dataclass(frozen=True)
class RecordChunk:
    """Uncompressed records, and where in the file they began."""

    data: bytes
    offset: int


class Records:
    """One pass over an MCAP stream.  `schemas` and `channels` by id grow as it goes."""

    def __init__(self, stream: BinaryIO, report: ReadReport, log_name: str) -> None:
        self.stream, self.report, self.log_name = stream, report, log_name
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self._definition_bytes: dict[tuple[int, bytes], int] = {}  # by opcode and id
        self._defined_bytes = 0
        self.held = b""  # read, and not used yet
        self.offset = 0
        self.crc, self.crc_runs = 0, True
        self.chunks_met, self.messages_lost = 0, 0
        self.unchecked = self.whole_checked = False
        self.ended = False
        magic = self._take(len(MAGIC))
        if magic != MAGIC:
            what = "is empty" if not magic else "does not begin as an MCAP file"
            raise ReadError(
                f"{what}", allowed="allowed is MCAP", do="record it again", file=log_name
            )

    def _take(self, size: int) -> bytes:
        """The next `size` bytes, fewer at the end."""
        parts, wanted = [], size
        if self.held:
            parts.append(self.held[:size])
            self.held = self.held[size:]
            wanted -= len(parts[0])
        while wanted > 0:
            part = self.stream.read(min(wanted, LARGEST_CHUNK_BYTES))
            if not part:
                break
            parts.append(part)
            wanted -= len(part)
        taken = parts[0] if len(parts) == 1 else b"".join(parts)
        self.offset += len(taken)
        if self.crc_runs:
            self.crc = zlib.crc32(taken, self.crc)
        return taken

    def lose(self, what: str) -> None:
        """A sentence in the report, the first few of a kind."""
        self.report.counts["damaged_places"] = count = (
            self.report.counts.get("damaged_places", 0) + 1
        )
        if count <= MOST_SAID:
            self.report.losses.append(what)

    def chunks(self) -> Iterator[RecordChunk]:
        """The chunks in the file's order; messages outside of chunks in chunks of their own."""
        loose: list[bytes] = []
        size, began = 0, 0
        while not self.ended:
            at, crc = self.offset, self.crc
            opcode, record = self._record(at)
            if opcode == Opcode.MESSAGE:
                began = began if loose else at
                loose.append(record)
                size += len(record)
                self.unchecked = True
            if loose and (opcode != Opcode.MESSAGE or size >= LOOSE_BYTES):
                yield RecordChunk(b"".join(loose), began)
                loose, size = [], 0
            if opcode == Opcode.CHUNK:
                chunk = self._chunk(record[HEAD.size :], at)
                if chunk is not None:
                    yield chunk
                chunk = None  # not kept while the next one is unpacked
            elif opcode not in (None, Opcode.MESSAGE):
                self._other(opcode, record[HEAD.size :], at, crc)
        if self.unchecked and not self.whole_checked:
            self.report.remarks.append(
                "some messages carry no checksum: damage to them cannot be seen"
            )
        if (said := self.report.counts.get("damaged_places", 0)) > MOST_SAID:
            self.report.losses.append(f"{said - MOST_SAID} more damaged places")

    def _record(self, at: int) -> tuple[int | None, bytes]:
        """(opcode, whole record) that begins at `at`.

        (None, b"") if it is passed over, broken, or the file ends.
        """
        head = self._take(HEAD.size)
        if not head:
            self._cut_off(at)
            return None, b""
        opcode, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)
        if opcode == Opcode.ATTACHMENT or opcode >= PRIVATE:
            self._skip(length, at)
            return None, b""
        possible = 0 < opcode <= Opcode.DATA_END and length <= LARGEST_CHUNK_BYTES
        body = self._take(length) if possible else b""
        if not possible or len(body) != length:
            self._broken(head + body, at)
            return None, b""
        return opcode, head + body

    def _other(self, opcode: int, body: bytes, at: int, crc: int) -> None:
        """Any record but chunks, messages and attachments."""
        try:
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self.define(opcode, body)
            elif opcode == Opcode.DATA_END:
                stated = DataEnd.read(_reader(body)).data_section_crc
                if stated and self.crc_runs and stated != crc:
                    self.lose(
                        f"the checksum of the whole data fails at byte {at}: something before it "
                        "is damaged; copy the log again"
                    )
                self.whole_checked = stated != 0 and self.crc_runs
                self.crc = 0
            elif opcode == Opcode.STATISTICS:
                counted = Statistics.read(_reader(body)).chunk_count
                if counted > self.chunks_met and "damaged_places" not in self.report.counts:
                    self.lose(
                        f"{counted - self.chunks_met} of {counted} chunks are missing; "
                        "copy the log again"
                    )
            elif opcode == Opcode.FOOTER:
                self._footer(body, at, crc)
        except RECORD_ERRORS as problem:
            self.lose(
                f"record {opcode} at byte {at} does not parse ({_short(problem)}); "
                "copy the log again"
            )

    def _footer(self, body: bytes, at: int, crc: int) -> None:
        self.ended = True
        footer = Footer.read(_reader(body))
        stated = footer.summary_crc
        if (
            stated
            and self.crc_runs
            and zlib.crc32(HEAD.pack(Opcode.FOOTER, len(body)) + body[:16], crc) != stated
        ):
            self.lose(
                f"the checksum of the summary fails at byte {at}; its messages are checked chunk "
                "by chunk; copy the log again"
            )
        if self._take(len(MAGIC)) != MAGIC:
            self._cut_off(self.offset)

    def define(self, opcode: int, body: bytes) -> None:
        """Keep a schema or a channel.  ValueError: it is too large, or one too many."""
        key, size = (opcode, body[:2]), len(body)
        if size > LARGEST_DEFINITION_BYTES:
            raise ValueError(f"it is larger than {LARGEST_DEFINITION_BYTES >> 20} MB")
        more = size - self._definition_bytes.get(key, 0)
        if (
            self._defined_bytes + more > MOST_DEFINITION_BYTES
            or len(self._definition_bytes) > MOST_DEFINITIONS
        ):
            raise ValueError(
                f"with it there are more than {MOST_DEFINITION_BYTES >> 20} MB or "
                f"{MOST_DEFINITIONS} of them"
            )
        self._definition_bytes[key] = size
        self._defined_bytes += more
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(_reader(body))
            self.schemas[schema.id] = schema
        else:
            channel = Channel.read(_reader(body))
            self.channels[channel.id] = channel

    def _skip(self, length: int, at: int) -> None:
        while length > 0:
            part = self._take(min(length, 1 << 20))
            if not part:
                self._cut_off(at)
                return
            length -= len(part)

    def _cut_off(self, at: int) -> None:
        self.ended = True
        self.lose(
            f"the file is cut off at byte {at}; the whole chunks before are used; "
            "copy the log again"
        )

    def _broken(self, taken: bytes, at: int) -> None:
        """The chain of records breaks at `at`; `taken` was read from there.

        Goes on at the next chunk, if there is one.
        """
        self.crc_runs = False
        behind = taken[1:] + self._take(1 << 20)
        skipped = 1
        while True:
            found = find_chunk(behind)
            if found is not None:
                self.held = behind[found:] + self.held
                self.offset = at + skipped + found
                self.lose(
                    f"bytes {at} to {self.offset} are damaged; the log goes on with the chunk "
                    "behind; copy the log again"
                )
                return
            keep = behind[-64:]
            more = self._take(1 << 20)
            if not more:
                self._cut_off(at)
                return
            skipped += len(behind) - len(keep)
            behind = keep + more

    def _chunk(self, body: bytes, at: int) -> RecordChunk | None:
        self.chunks_met += 1
        try:
            _, _, size, crc, name_size = CHUNK_HEAD.unpack_from(body)
            name_end = CHUNK_HEAD.size + name_size
            compression = body[CHUNK_HEAD.size : name_end].decode("ascii")
            stored = memoryview(body)[name_end + 8 :]
            if struct.unpack_from("<Q", body, name_end)[0] != len(stored):
                raise ValueError("its length is wrong")
            if size > LARGEST_CHUNK_BYTES:
                raise ValueError(
                    f"it declares {size} bytes, and at most {LARGEST_CHUNK_BYTES} are allowed"
                )
            data = decompress(compression, stored, size)
            if len(data) != size or (crc and zlib.crc32(data) != crc):
                raise ValueError("its checksum fails")
            most = min(MOST_RECORDS, FEW_RECORDS + RECORDS_PER_BYTE * len(stored))
            if record_starts(data, most + 1)[0].size > most:
                raise ValueError(f"it holds more than {most} records in {len(stored)} stored bytes")
        except RECORD_ERRORS as problem:
            self.lose(f"the chunk at byte {at} is lost ({_short(problem)}); copy the log again")
            return None
        self.unchecked |= not crc
        return RecordChunk(data, at)


def find_chunk(data: bytes) -> int | None:
    """Place of a record in `data` that is beyond doubt a chunk.

    Its two lengths agree, and its compression is one that exists.
    """
    at = data.find(b"\x06")
    while at >= 0:
        if len(data) < at + HEAD.size + CHUNK_HEAD.size + 16:
            return None
        length = HEAD.unpack_from(data, at)[1]
        name_size = struct.unpack_from("<I", data, at + HEAD.size + 28)[0]
        if name_size <= 4:
            begins = at + HEAD.size + CHUNK_HEAD.size
            name = data[begins : begins + name_size]
            stored = struct.unpack_from("<Q", data, begins + name_size)[0]
            if (
                name in (b"", b"lz4", b"zstd")
                and stored + CHUNK_HEAD.size + name_size + 8 == length <= LARGEST_CHUNK_BYTES + 64
            ):
                return at
        at = data.find(b"\x06", at + 1)
    return None


def decompress(compression: str, stored: memoryview, size: int) -> bytes:
    """`size` bytes of records.  ValueError if they cannot be had."""
    if compression == "":
        return bytes(stored)
    if compression == "zstd":
        import zstandard

        try:
            if zstandard.get_frame_parameters(stored).content_size not in (
                size,
                zstandard.CONTENTSIZE_UNKNOWN,
            ):
                raise ValueError("its length is wrong")
            return zstandard.ZstdDecompressor().decompress(stored, max_output_size=size)
        except zstandard.ZstdError as problem:
            raise ValueError(str(problem)) from None
    if compression == "lz4":
        import lz4.frame

        try:
            whole: bytes = lz4.frame.LZ4FrameDecompressor().decompress(stored, max_length=size + 1)
            return whole
        except RuntimeError as problem:
            raise ValueError(str(problem)) from None
    raise ValueError(f"compression {compression!r}; allowed are none, lz4, zstd")


def _reader(body: bytes) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(body))


def _short(problem: BaseException) -> str:
    return (str(problem).splitlines() or [type(problem).__name__])[0][:120]
