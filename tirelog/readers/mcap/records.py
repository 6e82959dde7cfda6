"""The records of an MCAP stream, from its first byte to its last, without seeking.

Whole chunks, checksums verified.

    bytes --record by record--> schemas, channels, chunks
        --decompress, CRC--> messages by channel

A chunk whose checksum fails is a loss and is left out. If the chain of records breaks, the file is
cut off there. Messages outside of chunks are gathered.

The library's own walk takes a cut record for a whole one, and unpacks a chunk to any size; so the
walk is here, and the library parses what it finds.
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from typing import Any, BinaryIO

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Schema, Statistics

from tirelog.errors import ReadError
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


# ---- The records of a stream, one after the other, and the messages of each chunk.


MAGIC = b"\x89MCAP0\r\n"
#: of a record: opcode, length; of a message: channel, sequence, log time, publish time
HEAD, MESSAGE_HEAD = struct.Struct("<BQ"), struct.Struct("<HIQQ")
#: of a chunk: first and last time, bytes unpacked, checksum, length of the compression's name
CHUNK_HEAD = struct.Struct("<QQQII")
#: a chunk has to be decompressed whole to check it
LARGEST_CHUNK_BYTES = 1 << 28
#: bytes of messages outside of chunks that are gathered
LOOSE_BYTES = 1 << 20
#: bytes of all schemas and channels that are kept: those of real logs are below 1 MB, and the
#: descriptors of the largest robots are some hundred kilobytes
MOST_DEFINITION_BYTES = 1 << 25
#: records that a chunk may hold: writers close one at some megabytes, which is below 100,000
#: messages; and no more beside the first few than so many per stored byte: a message that differs
#: from its neighbours costs a packer 2 bytes or more
MOST_RECORDS, FEW_RECORDS, RECORDS_PER_BYTE = 1 << 20, 1 << 14, 4
RECORD_ERRORS = (
    McapError,
    struct.error,
    UnicodeDecodeError,
    ValueError,
    EOFError,
    OverflowError,
    MemoryError,
    RuntimeError,  # of lz4
    zstandard.ZstdError,
)
#: damaged places that are reported one by one
MOST_SAID = 5
#: opcodes from here on are free for private use
PRIVATE = 0x80
#: log time [ns] and data of a message
Message = tuple[int, bytes]
#: messages by the number of their channel
Messages = dict[int, list[Message]]


class Records:
    """One pass over an MCAP stream.  `schemas` and `channels` by id grow as it goes."""

    def __init__(self, stream: BinaryIO, report: ReadReport, log_name: str) -> None:
        self.stream, self.report, self.log_name = stream, report, log_name
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self._definition_bytes: dict[tuple[int, bytes], int] = {}  # by opcode and id
        self._defined_bytes = 0
        self.offset, self.crc = 0, 0
        self.chunks_met = 0
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

    def chunks(self) -> Iterator[tuple[Messages, int]]:
        """(messages, bytes that they take) of each chunk, in the file's order.

        Those outside of chunks are gathered. What a chunk defines is kept.
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
                yield self._messages(b"".join(loose), size, began), size
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
            end = self.offset + length
            while self.offset < end and self._take(min(end - self.offset, 1 << 20)):
                pass
            self._cut_off(at, self.offset < end)
            return None, b""
        possible = 0 < opcode <= Opcode.DATA_END and length <= LARGEST_CHUNK_BYTES
        body = self._take(length) if possible else b""
        self._cut_off(at, not possible or len(body) != length)
        return (None, b"") if self.ended else (opcode, head + body)

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
        stated = Footer.read(_reader(body)).summary_crc
        if stated and zlib.crc32(HEAD.pack(Opcode.FOOTER, len(body)) + body[:16], crc) != stated:
            self.lose(
                f"the checksum of the summary fails at byte {at}; its messages are checked chunk "
                "by chunk; copy the log again"
            )
        self._cut_off(self.offset, self._take(len(MAGIC)) != MAGIC)

    def define(self, opcode: int, body: bytes) -> None:
        """Keep a schema or a channel.  ValueError: with it there is too much to be kept."""
        key = opcode, body[:2]
        self._defined_bytes += len(body) - self._definition_bytes.get(key, 0)
        self._definition_bytes[key] = len(body)
        if self._defined_bytes > MOST_DEFINITION_BYTES:
            raise ValueError(f"with it there are more than {MOST_DEFINITION_BYTES >> 20} MB")
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(_reader(body))
            self.schemas[schema.id] = schema
        else:
            channel = Channel.read(_reader(body))
            self.channels[channel.id] = channel

    def _cut_off(self, at: int, is_cut: bool) -> None:
        """Ends the walk at a record that is not whole, or cannot be one."""
        if is_cut:
            self.ended = True
            self.lose(
                f"the file is cut off at byte {at}, or damaged; the whole chunks before are used; "
                "copy the log again"
            )

    def _chunk(self, body: bytes, at: int) -> Iterator[tuple[Messages, int]]:
        """The messages of a chunk, if it is whole."""
        self.chunks_met += 1
        try:
            _, _, size, crc, name_size = CHUNK_HEAD.unpack_from(body)
            name_end = CHUNK_HEAD.size + name_size
            compression = body[CHUNK_HEAD.size : name_end].decode("ascii")
            stored = body[name_end + 8 :]
            if struct.unpack_from("<Q", body, name_end)[0] != len(stored):
                raise ValueError("its length is wrong")
            if size > LARGEST_CHUNK_BYTES:
                raise ValueError(
                    f"it declares {size} bytes, and at most {LARGEST_CHUNK_BYTES} are allowed"
                )
            data = decompressed(compression, stored, size)
            if len(data) != size or (crc and zlib.crc32(data) != crc):
                raise ValueError("its checksum fails")
            messages = self._messages(data, len(stored), at)
        except RECORD_ERRORS as problem:
            self.lose(f"the chunk at byte {at} is lost ({_short(problem)}); copy the log again")
            return
        self.unchecked |= not crc
        yield messages, size

    def _messages(self, data: bytes, stored: int, offset: int) -> Messages:
        """The messages among records, and what these define.

        They take `stored` bytes of the file and begin at its byte `offset`. ValueError: they are
        more than so many bytes hold.
        """
        most = min(MOST_RECORDS, FEW_RECORDS + RECORDS_PER_BYTE * stored)
        found: Messages = {}
        many = end = 0
        while len(data) >= (begin := end + HEAD.size):
            opcode, length = HEAD.unpack_from(data, end)
            many += 1
            if begin + length > len(data):
                break
            if many > most:
                raise ValueError(f"it holds more than {most} records in {stored} stored bytes")
            end = begin + length
            if opcode == Opcode.MESSAGE and length >= MESSAGE_HEAD.size:
                number, _, time_ns, _ = MESSAGE_HEAD.unpack_from(data, begin)
                message = min(time_ns, 2**63 - 1), data[begin + MESSAGE_HEAD.size : end]
                found.setdefault(number, []).append(message)
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                try:
                    self.define(opcode, data[begin:end])
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
        return found


def decompressed(compression: str, stored: bytes, size: int) -> bytes:
    """The records of a chunk, at most a byte more than `size`.  ValueError: they cannot be had."""
    packed: Any = io.BytesIO(stored)
    if compression == "zstd":
        packed = zstandard.ZstdDecompressor().stream_reader(packed)
    elif compression == "lz4":
        packed = lz4.frame.LZ4FrameFile(packed)
    elif compression:
        raise ValueError(f"compression {compression!r}; allowed are none, lz4, zstd")
    data: bytes = packed.read(size + 1)
    return data


def _reader(body: bytes) -> ReadDataStream:
    return ReadDataStream(io.BytesIO(body))


def _short(problem: BaseException) -> str:
    return (str(problem).splitlines() or [type(problem).__name__])[0][:120]
