"""Faults: of damaged MCAP good chunks are kept, and what is lost is named."""

import io
import re
import resource
import struct
import tracemalloc
import zlib

import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.reader import make_reader

from tests.readers.logs import flip, spoilt
from tests.readers.mcap_files import (
    LZ4,
    NONE,
    STAMPED,
    START_NS,
    ZSTD,
    protobuf_class,
    read,
    write_json,
    write_protobuf,
    write_ros2,
    writing,
)
from tirelog.drafts.setup import contents
from tirelog.errors import ReadError, TirelogError

N = 3000
SOURCES = {"x": "/t:x", "y": "/t:y[1]"}


@pytest.fixture
def path(tmp_path):
    return tmp_path / "log.mcap"


def messages(n=N):
    noise = np.random.default_rng(1).normal(size=n).tolist()
    return rows(*({"x": i, "y": [noise[i], -noise[i]]} for i in range(n)))


def chunks(path):
    with path.open("rb") as stream:
        return sorted(
            make_reader(stream).get_summary().chunk_indexes, key=lambda c: c.chunk_start_offset
        )


def rows(*messages):
    """Messages of one topic, one after the other."""
    return [("/t", START_NS + 400_000 * i, message) for i, message in enumerate(messages)]


def is_gapless(x):
    return np.array_equal(x, np.arange(x[0], x[0] + x.size))


@pytest.mark.parametrize("compression", [NONE, LZ4, ZSTD])
@pytest.mark.parametrize("which", [0, 4, -1])
def test_a_flipped_bit_loses_its_chunk_by_name_and_no_other(path, compression, which):
    write_json(path, messages(), compression=compression)
    good = read(path, SOURCES)[0]
    chunk = chunks(path)[which]
    flip(path, chunk.chunk_start_offset + chunk.chunk_length // 2)
    values, stamps, reader = read(path, SOURCES)
    assert len(reader.report.losses) == 1
    assert f"the chunk at byte {chunk.chunk_start_offset} is lost" in reader.report.losses[0]
    kept = np.isin(good["x"], values["x"])
    first, last = np.flatnonzero(~kept)[[0, -1]]
    assert not kept[first : last + 1].any()  # one stretch
    assert 0.02 < np.mean(~kept) < 0.3
    np.testing.assert_array_equal(values["y"], good["y"][kept])
    assert stamps["clock_1"].size == kept.sum()


@pytest.mark.parametrize(("ahead", "as_stream"), [(1 << 25, True), (1000, False)])
def test_definitions_lost_at_the_begin_come_from_the_end_of_the_file(
    path, monkeypatch, ahead, as_stream
):
    monkeypatch.setattr("tirelog.readers.mcap.reader.READ_AHEAD_BYTES", ahead)
    write_json(path, messages())
    flip(path, chunks(path)[0].chunk_start_offset + 200)
    values, _, reader = read(io.BytesIO(path.read_bytes()) if as_stream else path, SOURCES)
    assert is_gapless(values["x"])
    assert values["x"][-1] == N - 1
    assert len(reader.report.losses) == 1


def test_a_stream_too_long_to_hold_says_that_its_definitions_are_lost(path, monkeypatch):
    monkeypatch.setattr("tirelog.readers.mcap.reader.READ_AHEAD_BYTES", 1000)
    write_json(path, messages())
    flip(path, chunks(path)[0].chunk_start_offset + 200)
    with pytest.raises(ReadError, match=r"messages belong to channels whose definition is lost"):
        read(io.BytesIO(path.read_bytes()), SOURCES)


def test_a_damaged_length_ends_the_log(path):
    write_json(path, messages())
    third = chunks(path)[2].chunk_start_offset
    flip(path, third + 3, 7)  # in the length of the record
    values, _, reader = read(path, SOURCES)
    assert reader.report.losses == [
        f"the file is damaged or cut off at byte {third}; the whole chunks before are used; "
        "copy the log again"
    ]
    assert is_gapless(values["x"])
    assert 0 < values["x"].size < N


def test_a_flip_between_the_chunks_is_seen_by_the_checksum_of_the_whole(path):
    with writing(path, chunk_size=5000, enable_data_crcs=True) as writer:
        channel = writer.register_channel("/t", "json", 0)
        writer.add_attachment(START_NS, START_NS, "note", "text/plain", b"a" * 3000)
        for i in range(100):
            writer.add_message(channel, START_NS + i, b'{"x": 1}', START_NS + i)
    flip(path, path.read_bytes().find(b"aaaaaa") + 1000)
    values, _, reader = read(path, {"x": "/t:x"})
    assert values["x"].size == 100
    assert "checksum of the whole data fails" in reader.report.losses[0]


@pytest.mark.parametrize("compression", [NONE, ZSTD])
def test_a_cut_off_file_gives_its_whole_chunks(path, compression):
    """Twenty places."""
    write_json(path, messages(), compression=compression)
    content, index = path.read_bytes(), chunks(path)
    ends = [c.chunk_start_offset + c.chunk_length for c in index]
    for cut in np.random.default_rng(2).integers(9, ends[-1], 20).tolist():
        whole = sum(end <= cut for end in ends)
        if whole == 0:
            with pytest.raises(ReadError, match="cut off at byte"):
                read(io.BytesIO(content[:cut]), SOURCES)
            continue
        values, _, reader = read(io.BytesIO(content[:cut]), SOURCES)
        assert is_gapless(values["x"])
        last_ns = START_NS + 400_000 * int(values["x"][-1])
        assert last_ns == index[whole - 1].message_end_time
        assert ["cut off at byte" in loss for loss in reader.report.losses] == [True]


def test_a_file_without_its_end_record(path):
    write_json(path, messages())
    for size in (8, 9, 20):
        cut = path.read_bytes()[:-size]
        values, _, reader = read(io.BytesIO(cut), SOURCES)
        assert values["x"].size == N
        assert "cut off" in reader.report.losses[0]


@pytest.mark.parametrize(
    "bad",
    [
        b"{",
        b"",
        b"[1]",
        b"\xff\xfe",
        b'{"x": {"deep": 1}}',
        b'{"x": 1}\n{"x": 2}',
        b'{"x":' + b"[" * 5000,
        b'{"x":' + b"[" * 600 + b"]" * 600 + b"}",
        b'{"x": "high"}',
    ],
)
def test_a_message_that_does_not_decode_is_one_lost_sample(path, bad):
    log = rows(*(bad if i == 20 else {"x": i} for i in range(50)))
    values, _, reader = read(write_json(path, log), {"x": "/t:x"})
    assert np.flatnonzero(np.isnan(values["x"])).tolist() == [20]
    (said,) = reader.report.losses
    assert said.startswith("1 messages of /t: ")
    assert ("x holds text where a number is expected" in said) == (b"high" in bad)


def foreign_log(path, *, good):
    """Topics of a foreign encoding and of a broken schema, and a good one."""
    with writing(path) as writer:
        broken = writer.register_schema("pkg/srv/Event", "ros2msg", b"\xff\xfe no definition ===")
        topics = [(writer.register_channel("/event", "cdr", broken), b"\x00")]
        topics.append((writer.register_channel("/odd", "morse", 0), b"..."))
        if good:
            topics.append((writer.register_channel("/t", "json", 0), b'{"x": %d}'))
        for i in range(20):
            for channel, data in topics:
                data = data % i if b"%" in data else data
                writer.add_message(channel, START_NS + i, data, START_NS + i)


def test_foreign_channels_and_broken_schemas_stop_nothing(path):
    foreign_log(path, good=True)
    values, _, reader = read(path, {"x": "/t:x"})
    np.testing.assert_array_equal(values["x"], np.arange(20))
    assert reader.report.losses == []
    _, _, reader = read(path, {"x": "/t:x", "y": "/odd:z", "z": "/event:a"})
    assert len(reader.report.losses) == 2


def test_a_log_without_a_setup_says_why_a_topic_cannot_be_read(path):
    """Alone it is the error; beside one that can be read it is said."""
    foreign_log(path, good=True)
    found = contents(str(path))
    assert [one.series.source for one in found.found] == ["/t:x"]
    assert found.others == ()
    foreign_log(path, good=False)
    with pytest.raises(ReadError) as caught:
        contents(str(path))
    for said in (" ".join(found.remarks), str(caught.value)):
        assert "topic '/odd' has the message encoding 'morse'" in said
        assert "allowed are json, protobuf" in said


def test_an_absurd_chunk_is_refused_before_it_is_decompressed(path):
    write_json(path, messages())
    content = bytearray(path.read_bytes())
    at = chunks(path)[1].chunk_start_offset
    struct.pack_into("<Q", content, at + 9 + 16, 1 << 50)
    values, _, reader = read(io.BytesIO(content), SOURCES)
    assert "declares 1125899906842624 bytes" in reader.report.losses[0]
    assert values["x"].size > 0.7 * N


def all_kinds(tmp_path):
    """A file an encoding, and sources in it."""
    rng = np.random.default_rng(3)
    times = [START_NS + 400_000 * i for i in range(300)]
    for name, more in (("j", {}), ("n", {"compression": NONE}), ("u", {"use_chunking": False})):
        yield write_json(tmp_path / name, messages(300), chunk_size=3000, **more), SOURCES
    joint = {"names": ["a"], "position": [1.0, 2.0], "counts": [1, 2, 3], "subs": [{}]}
    stamps = ({"stamp": {"sec": 5, "nanosec": i}, "frame_id": "t"} for i in range(300))
    ros = [
        ("/j", t, "my_msgs/msg/Joint", STAMPED, {"header": stamp, **joint})
        for t, stamp in zip(times, stamps, strict=True)
    ]
    sources = {"a": "/j:position[1]", "b": "/j:counts", "c": "/j:last"}
    yield write_ros2(tmp_path / "r", ros, compression=NONE, chunk_size=3000), sources
    proto = [protobuf_class()[0](strain=rng.normal(), steps=i, batch=[1.0, i]) for i in range(300)]
    tire = [("/p", t, m) for t, m in zip(times, proto, strict=True)]
    sources = {"a": "/p:strain", "b": "/p:batch", "c": "/p:steps"}
    yield write_protobuf(tmp_path / "p", tire, compression=LZ4, chunk_size=3000), sources


def test_flips_and_cuts_end_in_a_sentence_or_in_data(tmp_path):
    """Any damage: an error of ours or samples, never another exception, in bounded memory."""
    rng = np.random.default_rng(12)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    outcomes = {"refused": 0, "whole": 0, "loss": 0}
    for path, sources in all_kinds(tmp_path):
        content = path.read_bytes()
        for trial in range(40):
            path.write_bytes(spoilt(content, rng, stop=(400, None)[trial % 2]))
            try:
                reader = read(path, sources)[2]
                outcomes["loss" if reader.report.losses else "whole"] += 1
            except TirelogError:
                outcomes["refused"] += 1
    assert min(outcomes.values()) > 5
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 200_000  # kB


def test_one_flip_in_a_chunk_is_never_silent(path):
    """Eighty places within chunks whose bytes are covered by a checksum."""
    write_json(path, messages(), compression=NONE)
    content, rng = path.read_bytes(), np.random.default_rng(4)
    for chunk in rng.choice(chunks(path), 80).tolist():
        at = chunk.chunk_start_offset + 9 + 40 + int(rng.integers(chunk.chunk_length - 49))
        damaged = bytearray(content)
        damaged[at] ^= 1 << rng.integers(8)
        assert read(io.BytesIO(damaged), SOURCES)[2].report.losses


def record(opcode, body=b""):
    return struct.pack("<BQ", opcode, len(body)) + body


def prefixed(text):
    return struct.pack("<I", len(text)) + text


def packed(records):
    """A chunk record of these records, compressed."""
    stored = zstandard.ZstdCompressor().compress(records)
    head = struct.pack("<QQQI", 0, 1, len(records), zlib.crc32(records)) + prefixed(b"zstd")
    return record(Opcode.CHUNK, head + struct.pack("<Q", len(stored)) + stored)


def schema(number, data):
    words = prefixed(b"a") + prefixed(b"jsonschema") + prefixed(data)
    return record(Opcode.SCHEMA, struct.pack("<H", number) + words)


def message(data, number=0):
    head = struct.pack("<HIQQ", 1, number, START_NS + 10**6 * number, 0)
    return record(Opcode.MESSAGE, head + data)


HEAD = b"\x89MCAP0\r\n" + record(Opcode.HEADER, prefixed(b"") + prefixed(b""))
END = record(Opcode.DATA_END, b"\0" * 4) + record(Opcode.FOOTER, b"\0" * 20) + b"\x89MCAP0\r\n"
JSON = prefixed(b"/t") + prefixed(b"json") + struct.pack("<I", 0)
CHANNEL = schema(1, b"{}") + record(Opcode.CHANNEL, struct.pack("<HH", 1, 1) + JSON)
GOOD = packed(CHANNEL + b"".join(message(b'{"x": %d}' % i, i) for i in range(50)))
SWOLLEN = {
    "a chunk of empty records": (record(Opcode.STATISTICS) * 40_000, "lost (it holds more than"),
    "a chunk of empty messages": (message(b"") * 40_000, "lost (it holds more than"),
    "a large schema": (schema(2, b" " * 3000), "cannot be used (it is larger than"),
    "many schemas": (
        b"".join(schema(i, b" " * 500) for i in range(2, 20)),
        "cannot be used (with it there are more than",
    ),
    "one list of numbers": (
        message(b'{"x": [' + b"0," * 30_000 + b"0]}"),
        "of /t: larger than|no message of at most",
    ),
}


@pytest.mark.parametrize("alone", [False, True])
@pytest.mark.parametrize("what", SWOLLEN)
def test_a_small_file_that_unpacks_to_much_costs_that_chunk(path, monkeypatch, what, alone):
    monkeypatch.setattr("tirelog.readers.mcap.records.LARGEST_DEFINITION_BYTES", 2000)
    monkeypatch.setattr("tirelog.readers.mcap.records.MOST_DEFINITION_BYTES", 4000)
    monkeypatch.setattr("tirelog.readers.mcap.decode.LARGEST_MESSAGE_BYTES", 50_000)
    records, said = SWOLLEN[what]
    chunk = packed(CHANNEL + records) if alone else GOOD + packed(records)
    path.write_bytes(HEAD + chunk + END)
    assert path.stat().st_size < 5000
    said = said.replace("(", "[(]")
    if alone:
        with pytest.raises(ReadError, match=said):
            read(path, {"x": "/t:x"})
        return
    values, _, reader = read(path, {"x": "/t:x"})
    np.testing.assert_array_equal(values["x"], np.arange(50))
    assert re.search(said, reader.report.losses[0])


def test_a_message_of_many_structures_is_not_decoded(path):
    """A byte each in the file, and an object of Python each in memory."""
    definition = "my_msgs/Sub[] subs\nfloat64 x\n" + "=" * 80 + "\nMSG: my_msgs/Sub\nuint8 a\n"
    log = rows(*({"subs": [{"a": 1}] * (40_000 if i == 20 else 3), "x": i} for i in range(21)))
    write_ros2(path, [(topic, at, "my_msgs/M", definition, m) for topic, at, m in log])
    values, _, reader = read(path, {"x": "/t:x"})
    np.testing.assert_array_equal(values["x"], [*range(20), np.nan])
    assert reader.report.losses == ["1 messages of /t: does not decode (ValueError)"]


def test_a_chunk_is_let_go_before_the_next_is_unpacked(path):
    few = b"".join(message(b'{"x": %d}' % i, i) for i in range(2000))
    chunk = packed(few + record(Opcode.STATISTICS, bytes(20 << 20)))
    path.write_bytes(HEAD + CHANNEL + chunk * 4)
    read(path, {"x": "/t:x"})
    tracemalloc.start()
    read(path, {"x": "/t:x"})
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 30 << 20
