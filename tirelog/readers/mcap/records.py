"""The records of an MCAP stream, from its first byte to its last, without seeking.

Whole chunks, checksums verified.

    bytes --record by record--> schemas, channels, chunks
        --decompress, CRC--> Chunk (records, uncompressed)

A chunk whose checksum fails is a loss and is left out. Where the chain of records breaks, the file
is cut off. Messages outside of chunks are gathered into chunks of our own.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, BinaryIO

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Schema
from numpy.typing import NDArray

from tirelog.errors import ReadError
from tirelog.kernels import compiled
from tirelog.readers.base import Group, RawBlock, ReadReport
from tirelog.vocabulary.arrays import FloatArray, IntArray

# ---- Samples of one clock in the order of their log time.
#
# They are put in order in bounded memory, and handed on as blocks.
#
#     add(keys, stamps, within, values) ...
#         --stable sort by key, the older half once the buffer is full--> RawBlock
#
# `key` is the message's log time [ns], by which messages are ordered (equal keys keep the file's
# order); `stamp` the time of its first sample [ns]; `within` the sample's number in its batch. A
# batch's samples follow its stamp at the period of the rate that setup or message give, or, if
# neither does, of the median step between batches.


#: values that one group may hold back
HELD_VALUES = 1 << 19


class OrderedGroup:
    """The samples of one group on their way out.

    `period_s` of batches, None if it is to be found from the stamps.
    """

    def __init__(self, group: Group, period_s: float | None) -> None:
        self.group, self.period_s = group, period_s
        self.batched = False
        self.parts: list[tuple[IntArray, FloatArray]] = []
        self.held = 0
        self.last_key: int | None = None
        self.refused = 0

    def add(self, keys: IntArray, stamps: IntArray, within: IntArray, values: FloatArray) -> None:
        """Takes samples in the file's order.

        `keys`, `stamps`, `within` shape (n,), `values` (n, channels).
        """
        self.parts.append((np.column_stack([keys, stamps, within]), values))
        self.held += values.size

    @property
    def full(self) -> bool:
        return self.held > HELD_VALUES

    def first_stamp(self) -> int | None:
        """The earliest stamp that is held."""
        return min((int(at[:, 1].min()) for at, _ in self.parts if len(at)), default=None)

    def blocks(self, origin_ns: int, *, everything: bool) -> Iterator[RawBlock]:
        """The older half of what is held (or all of it) as a block."""
        if not self.parts:
            return
        at, values = (np.concatenate(part) for part in zip(*self.parts, strict=True))
        if self.last_key is not None and (late := at[:, 0] < self.last_key).any():
            self.refused += int(late.sum())
            at, values = at[~late], values[~late]
        if (np.diff(at[:, 0]) < 0).any():
            order = np.argsort(at[:, 0], kind="stable")
            at, values = at[order], values[order]
        size = len(at) if everything else len(at) // 2
        self._find_period(at[:, 1], at[:, 2])
        self.parts = [(at[size:], values[size:])] if size < len(at) else []
        self.held = values[size:].size
        if size:
            self.last_key = int(at[size - 1, 0])
            seconds = (at[:size, 1] - origin_ns) * 1e-9
            if self.batched:
                seconds += at[:size, 2] * (self.period_s or 0.0)
            columns = {
                name: np.ascontiguousarray(values[:size, k])
                for k, name in enumerate(self.group.channels)
            }
            yield RawBlock(self.group.name, columns, seconds)

    def _find_period(self, stamps: IntArray, within: IntArray) -> None:
        """The period of a batch's samples from the stamps, if nothing states it."""
        if not self.batched or self.period_s is not None:
            return
        first = np.flatnonzero(within == 0)
        if first.size > 1:
            steps = np.diff(stamps[first]) * 1e-9 / np.diff(first)
            self.period_s = float(np.median(steps))


# ---- Where the messages of a chunk are.
#
# chunk (bytes) --chain of record lengths, compiled--> starts (n,) --by channel--> Table per channel


HEAD = struct.Struct("<BQ")
#: opcode, length; channel, sequence, log time, publish time
MESSAGE_HEAD = struct.Struct("<BQHIQQ")
#: the descriptors of the largest robots are some hundred kilobytes
LARGEST_DEFINITION_BYTES = 1 << 22
#: records of one chunk: writers close one at some megabytes, which is below 100,000 messages.  A
#: table of a million takes 100 MB
MOST_RECORDS = 1 << 20
_8 = np.uint64(8)


@dataclass(frozen=True)
class MessageTable:
    """Messages of one channel in a chunk: `data[starts[i] : starts[i] + sizes[i]]` is message i.

    All shape (n,), int64; log time in ns.
    """

    data: bytes
    starts: IntArray
    sizes: IntArray
    log_time_ns: IntArray

    def __len__(self) -> int:
        return int(self.starts.size)

    def take(self, which: Any) -> MessageTable:
        return MessageTable(
            self.data, self.starts[which], self.sizes[which], self.log_time_ns[which]
        )

    def messages(self) -> list[bytes]:
        data = self.data
        return [
            data[a:b]
            for a, b in zip(self.starts.tolist(), (self.starts + self.sizes).tolist(), strict=True)
        ]


@compiled
def _chain(data: NDArray[np.uint8], starts: IntArray) -> tuple[int, Any]:
    """Write the starts of the records in a row: (how many, end of the last whole one)."""
    at, many = np.int64(0), 0
    while at <= data.size - 9 and many < starts.size:
        length = np.uint64(0)
        for place in range(8, 0, -1):
            length = (length << _8) | np.uint64(data[at + place])
        if length > np.uint64(data.size - 9 - at):
            break
        starts[many] = at
        many += 1
        at += 9 + np.int64(length)
    return many, at


def gather(data: bytes, starts: IntArray, dtype: str) -> NDArray[Any]:
    """The numbers of type `dtype` at the byte offsets `starts`, shape (n,)."""
    size = np.dtype(dtype).itemsize
    return message_rows(data, starts, size).view(dtype)[:, 0] if starts.size else np.zeros(0, dtype)


def message_rows(data: bytes, starts: IntArray, size: int) -> NDArray[np.uint8]:
    """The `size` bytes from each of `starts`, shape (n, size), contiguous."""
    steps = np.diff(starts)
    if steps.size and (steps == steps[0]).all():
        return np.ascontiguousarray(
            np.ndarray((starts.size, size), np.uint8, data, int(starts[0]), (int(steps[0]), 1))
        )
    if starts.size == 0 or size == 0:
        return np.zeros((starts.size, size), np.uint8)
    anywhere = np.ndarray(
        (len(data) - size + 1,), f"V{size}", data, 0, (1,)
    )  # every offset as the start of a row
    return anywhere[starts].view(np.uint8).reshape(starts.size, size)


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
#: damaged places that are reported one by one
MOST_SAID = 5
#: opcodes from here on are free for private use
PRIVATE = 0x80


class Records:
    """One pass over an MCAP stream.  `schemas` and `channels` by id grow as it goes."""

    def __init__(self, stream: BinaryIO, report: ReadReport, log_name: str) -> None:
        self.stream, self.report, self.log_name = stream, report, log_name
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self._definition_bytes: dict[tuple[int, bytes], int] = {}  # by opcode and id
        self._defined_bytes = 0
        self.offset = self.crc = 0
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
        taken = self.stream.read(size)  # a buffered stream gives less only at its end
        self.offset += len(taken)
        self.crc = zlib.crc32(taken, self.crc)
        return taken

    def lose(self, what: str) -> None:
        """A sentence in the report, the first few of a kind."""
        self.report.counts["damaged_places"] = count = (
            self.report.counts.get("damaged_places", 0) + 1
        )
        if count <= MOST_SAID:
            self.report.losses.append(what)

    def chunks(self) -> Iterator[tuple[dict[int, MessageTable], int]]:
        """(messages by channel id, bytes that they take) of each chunk, in the file's order.

        Messages outside of chunks make chunks of their own. What a chunk defines is kept.
        """
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
                yield self._tables(b"".join(loose), size, began), size
                loose, size = [], 0
            if opcode == Opcode.CHUNK:
                # nothing of a chunk is kept here while the next one is unpacked
                yield from self._chunk(record[HEAD.size :], at)
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
        opcode, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, 0)
        if opcode == Opcode.ATTACHMENT or opcode >= PRIVATE:
            self._skip(length, at)
            return None, b""
        possible = 0 < opcode <= Opcode.DATA_END and length <= LARGEST_CHUNK_BYTES
        body = self._take(length) if possible else b""
        if not possible or len(body) != length:
            self._cut_off(at)
            return None, b""
        return opcode, head + body

    def _other(self, opcode: int, body: bytes, at: int, crc: int) -> None:
        """Any record but chunks, messages and attachments."""
        try:
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                self.define(opcode, body)
            elif opcode == Opcode.DATA_END:
                stated = DataEnd.read(_reader(body)).data_section_crc
                if stated and stated != crc:
                    self.lose(
                        f"the checksum of the whole data fails at byte {at}: something before it "
                        "is damaged; copy the log again"
                    )
                self.whole_checked = stated != 0
                self.crc = 0
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
        if stated and zlib.crc32(HEAD.pack(Opcode.FOOTER, len(body)) + body[:16], crc) != stated:
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
            f"the file is damaged or cut off at byte {at}; the whole chunks before are used; "
            "copy the log again"
        )

    def _chunk(self, body: bytes, at: int) -> Iterator[tuple[dict[int, MessageTable], int]]:
        """The chunk, if it is whole."""
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
            tables = self._tables(data, len(stored), at)
        except RECORD_ERRORS as problem:
            self.lose(f"the chunk at byte {at} is lost ({_short(problem)}); copy the log again")
            return
        self.unchecked |= not crc
        yield tables, size

    def _tables(self, data: bytes, stored: int, offset: int) -> dict[int, MessageTable]:
        """The messages of a chunk by channel id.

        The chunk takes `stored` bytes of the file and begins at its byte `offset`. ValueError: it
        holds more records than so many bytes do.
        """
        most = min(MOST_RECORDS, FEW_RECORDS + RECORDS_PER_BYTE * stored)
        found = np.empty(min(len(data) // HEAD.size, most + 1), np.int64)
        many, end = _chain(np.frombuffer(data, np.uint8), found)
        if many > most:
            raise ValueError(f"it holds more than {most} records in {stored} stored bytes")
        starts = found[:many].copy()
        opcodes = gather(data, starts, "u1")
        for start in starts[(opcodes == Opcode.SCHEMA) | (opcodes == Opcode.CHANNEL)].tolist():
            # of one that is too large to be kept no more than shows that it is
            length = min(HEAD.unpack_from(data, start)[1], LARGEST_DEFINITION_BYTES + 1)
            try:
                self.define(data[start], data[start + HEAD.size : start + HEAD.size + length])
            except RECORD_ERRORS as problem:
                self.lose(
                    f"a definition in the chunk at byte {offset} cannot be used ({problem}); "
                    "copy the log again"
                )
        if end < len(data):
            self.lose(
                f"{len(data) - end} bytes at the end of the chunk at byte {offset} are no whole "
                "record; copy the log again"
            )
        starts = starts[opcodes == Opcode.MESSAGE]
        sizes = gather(data, starts + 1, "<u8").astype(np.int64) + HEAD.size - MESSAGE_HEAD.size
        starts, sizes = starts[sizes >= 0], sizes[sizes >= 0]
        ids = gather(data, starts + 9, "<u2")
        times = np.minimum(gather(data, starts + 15, "<u8"), np.uint64(2**63 - 1)).astype(np.int64)
        tables = {}
        for channel in np.unique(ids).tolist():
            which = ids == channel
            tables[channel] = MessageTable(
                data, starts[which] + MESSAGE_HEAD.size, sizes[which], times[which]
            )
        return tables


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
