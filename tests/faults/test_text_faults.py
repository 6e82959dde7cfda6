"""Faults: broken, foreign and hostile text logs, and what the reader says of each."""

import gzip
import lzma
import tracemalloc

import numpy as np
import pytest
import zstandard

from tests.readers.text_logs import Pipe, piped, read, setup_of
from tirelog.readers.text import source as text_source
from tirelog.readers.text.reader import open_text

SETUP = setup_of({"a": "A", "b": "B"})
HEADER = "time_s,A,B\n"


def rows(n=200, start=0):
    return [f"{i / 2500:.4f},{1550 + i / 1000:.4f},1542.0000" for i in range(start, start + n)]


def log(change=None, n=200):
    lines = rows(n)
    for i, text in (change or {}).items():
        lines[i] = text
    return HEADER + "\n".join(lines) + "\n"


CUT_OFF = "line 201: the last row is cut off"
SHORT = "1 row does not parse (first in line 102: not 3 cells)"
NO_TIME = "1 row does not parse (first in line 9: no readable time)"
IN_102 = "(first in line 102"
#: a log, how many rows are kept, what is said
LOST = {
    "cut in a row": (log()[:-12], 199, CUT_OFF),
    "cut in the last number": (log()[:-3], 199, CUT_OFF),
    "cut behind the last separator": (log()[: -len("1542.0000") - 1], 199, CUT_OFF),
    "a short row": (log({100: "0.0400,1550.1"}), 200, SHORT),
    "a short row where separators stand behind": (
        log({100: "0.0400"}).replace("\n", ",\n"),
        200,
        SHORT.replace("3 cells", "4 cells"),
    ),
    "a long row": (log({100: "0.0400,1550.1,1542.0,9,9"}), 200, SHORT),
    "text for a number": (
        log({7: "0.0028,ERR,1542.0", 9: "0.0036,ERR,1542.0"}),
        200,
        "2 cells are no numbers (first in line 9: 'ERR')",
    ),
    "text for a stamp": (log({7: "noon,1550.0,1542.0"}), 200, NO_TIME),
    "nul bytes inside": (log({150: "\0" * 50}, 9000), 8999, "1 row does not parse"),
}
#: what a power cut leaves, a block that was never written, in the part by which a layout is told
NUL = {
    "a byte in a row": (log({100: "0.0400,15\x0050.1,1542.0"}), 200, f"is no number {IN_102}"),
    "a byte in a stamp": (log({100: "0.04\x0000,1550.1,1542.0"}), 200, f"{IN_102}: no readable"),
    "a hole in the middle": (
        log({100: "0.04" + "\0" * 3000 + "1,1542.0"}),
        199,
        f"1 row does not parse {IN_102}",
    ),
    "a padded tail": (log() + "\0" * 4096, 200, "line 202: the last row is cut off"),
    "a padded tail behind half a row": (log()[:-8] + "\0" * 4096, 199, CUT_OFF),
    "a byte in the first row": (log({0: "0.0000,1550.0,15\x0042"}), 199, "line 2 holds NUL bytes"),
    "a byte in a header that stands twice": (
        "time_s,A\0,B\n" + log(),
        200,
        "line 1 holds NUL bytes",
    ),
}
DAMAGED = {name: (*case, 2000) for name, case in LOST.items()}
DAMAGED |= {name: (*case, text_source.HEAD_BYTES) for name, case in NUL.items()}


@pytest.mark.parametrize("name", DAMAGED)
def test_what_is_lost_is_told_and_no_other_row_is(name, monkeypatch):
    text, kept, message, head = DAMAGED[name]
    monkeypatch.setattr(text_source, "HEAD_BYTES", head)
    reader, block = read(text, SETUP)
    assert block.values["a"].size == kept
    assert [message in loss for loss in reader.report.losses] == [True]
    good = ~np.isnan(block.values["a"] + block.stamps_s)
    assert good.sum() >= kept - (2 if name in LOST else 1)
    first = 1 if "first row" in name else 0
    wanted = 1550 + (np.round(block.stamps_s[good] * 2500) + first) / 1000
    np.testing.assert_allclose(block.values["a"][good], wanted, atol=1e-9)


def test_a_header_with_a_byte_that_no_encoding_knows():
    """0x81 is no letter of cp1252; the rows begin where they begin all the same."""
    data = log().encode().replace(b"time_s,A,B", b"time_s,A,B \x81\x8d\xb0C")
    reader, block = read(data, {"a": "A"})
    assert block.values["a"].size == 200
    assert block.values["a"][0] == 1550.0
    assert reader.report.losses == []


CUT = {
    "gzip": lambda data: gzip.compress(data)[:-2000],
    "zstd": lambda data: zstandard.ZstdCompressor().compress(data)[:-2000],
    "xz": lambda data: lzma.compress(data)[:-2000],
    "gzip, one bit": lambda data: flipped(gzip.compress(data)),
    "gzip, checksum": lambda data: gzip.compress(data)[:-8] + b"\0" * 8,
}


def flipped(data):
    at = len(data) // 2
    return data[:at] + bytes([data[at] ^ 8]) + data[at + 1 :]


@pytest.mark.parametrize("kind", CUT)
def test_a_damaged_compressed_log_gives_what_came_before(kind):
    noise = np.random.default_rng(5).random(20_000)
    text = "".join(f"{i / 2500:.4f},{1550 + x:.4f},1542.0000\n" for i, x in enumerate(noise))
    reader, block = piped(CUT[kind]((HEADER + text).encode()), SETUP)
    size = block.values["a"].size
    # a flipped bit may repeat what came before
    assert 1000 < size <= (30_000 if "bit" in kind else 20_000)
    assert any("stream is" in loss for loss in reader.report.losses)
    if "bit" not in kind:
        np.testing.assert_array_equal(block.values["a"], np.round(1550 + noise[:size], 4))


def test_a_channel_without_one_reading_and_a_constant_one():
    reader, block = read(HEADER + "".join(f"{i / 10},,1542.0\n" for i in range(50)), SETUP)
    assert np.isnan(block.values["a"]).all()
    assert (block.values["b"] == 1542.0).all()
    assert reader.report.losses == []


@pytest.mark.parametrize(
    ("data", "kept", "said"),
    [
        (log(n=4000).encode() + b"\0" * (40 << 20), 4000, "has no end within 8 MB"),
        (gzip.compress(log(n=1000).encode() + b"\n" * (40 << 20)), 1000, ""),
    ],
    ids=["a hole of the disk", "a small file that unpacks to much"],
)
def test_what_is_no_log_does_not_fill_the_memory(data, kept, said):
    tracemalloc.start()
    reader = open_text(Pipe(data, 1 << 16), SETUP, "-")
    size = sum(block.values["a"].size for block in reader.blocks())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert size == kept
    assert peak < 60 << 20
    assert said in " ".join(reader.report.losses)


def test_zeros_that_a_few_bytes_unpack_to_are_not_all_held(monkeypatch):
    packer, zeros = zstandard.ZstdCompressor().compressobj(), bytes(1 << 22)
    pieces = [packer.compress(part) for part in (log().encode(), *[zeros] * 48)]
    data = b"".join(pieces) + packer.flush()
    assert len(data) < 20_000
    held, unpacked = [], text_source._unpack

    def unpack(kind, pieces):
        for piece in unpacked(kind, pieces):
            held.append(len(piece))
            yield piece

    monkeypatch.setattr(text_source, "_unpack", unpack)
    for _ in text_source.ByteSource(Pipe(data), "log.csv").blocks(0):
        pass
    assert max(held) < 100 << 20  # of 192 MB


def test_a_lone_mark_above_a_header_is_passed_over():
    reader, block = read("#\n" + log().replace(",", "\t"), SETUP)
    assert block.values["a"].size == 200
    assert not reader.report.losses
