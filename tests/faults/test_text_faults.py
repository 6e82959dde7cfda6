"""Faults: broken, foreign and hostile text logs, and what the reader says of each."""

import gzip
import lzma
import tracemalloc
from collections.abc import Iterator

import numpy as np
import pytest
import zstandard

from tests.readers.text_logs import Pipe, joined, read, setup_of
from tirelog.errors import ReadError
from tirelog.readers.text import source as text_source
from tirelog.readers.text.reader import open_text
from tirelog.runs.clock import ClockFit

SETUP = setup_of({"a": {"source": "A"}, "b": {"source": "B"}})
HEADER = "time_s,A,B\n"


def rows(n: int = 200, start: int = 0) -> list[str]:
    return [f"{i / 2500:.4f},{1550 + i / 1000:.4f},1542.0000" for i in range(start, start + n)]


def log(change: dict[int, str] | None = None, n: int = 200) -> str:
    lines = rows(n)
    for i, text in (change or {}).items():
        lines[i] = text
    return HEADER + "\n".join(lines) + "\n"


NOTHING = {
    "empty": (b"", "is empty"),
    "blank": (b" \n\n\n", "is empty"),
    "header only": (HEADER.encode(), "holds no rows of numbers"),
    "prose": (b"Dear Sir,\nthe log is lost.\n" * 20, "holds no rows of numbers"),
    "binary": (bytes(range(256)) * 100, "is not text"),
    "control characters": (b"\x01\x02\x03\x04abc\n" * 100, "is not text"),
    "nul in every row": (
        log().replace(",1542", ",15\x0042").encode(),
        "is not text .a NUL byte at",
    ),
    "nothing but nul": (HEADER.encode() + b"\0" * 4096, "is not text .a NUL byte at"),
    "utf-32": (log().encode("utf-32"), "UTF-32.*iconv -f UTF-32"),
    "utf-32 big-endian": (b"\0\0\xfe\xff" + log().encode("utf-32-be"), "iconv -f UTF-32"),
    "gzip cut off at once": (gzip.compress(log().encode())[:12], "gzip stream is cut off"),
    "zstd magic alone": (b"\x28\xb5\x2f\xfd", "zstd stream is cut off"),
    "xz damaged": (lzma.compress(log().encode())[:30] + b"\xff" * 50, "xz stream is damaged"),
    "gzip of binary": (gzip.compress(bytes(range(256)) * 100), "is not text"),
    "no column": (log().replace("A,B", "C,D").encode(), "no column 'A'.*no column 'B'"),
}


@pytest.mark.parametrize("cell", ["Tuesday 29", "12.03.24 11:59:59", "11h59", "2024-03-12T25h"])
def test_a_first_cell_that_cannot_be_read_is_told_with_its_line(cell: str) -> None:
    text = "time,A,B\n" + "".join(f"{cell},{1550 + i / 1000},1542.0\n" for i in range(30))
    with pytest.raises(ReadError) as caught:
        read(text, SETUP)
    assert str(caught.value).startswith(f"log.csv:2: the first cell {cell!r} is no number and no")
    assert "allowed are 2024-03-12 13:00:00.5" in str(caught.value)


@pytest.mark.parametrize("name", NOTHING)
def test_nothing_can_be_read(name: str) -> None:
    data, message = NOTHING[name]
    with pytest.raises(ReadError, match=message) as caught:
        read(data, SETUP)
    assert caught.value.exit_status == 4
    assert str(caught.value).startswith("log.csv: ")
    assert caught.value.message.count(";") >= 1


CUT_OFF = "line 201: the last row is cut off"
SHORT = "1 rows do not parse (first in line 102: not 3 cells)"
NO_TIME = "1 rows do not parse (first in line 9: no readable time)"
LOST = {
    "cut in a row": (log()[:-12], 199, CUT_OFF),
    "cut in the last number": (log()[:-3], 199, CUT_OFF),
    "cut behind the last separator": (log()[: -len("1542.0000") - 1], 199, CUT_OFF),
    "a short row": (log({100: "0.0400,1550.1"}), 200, SHORT),
    "a long row": (log({100: "0.0400,1550.1,1542.0,9,9"}), 200, SHORT),
    "text for a number": (
        log({7: "0.0028,ERR,1542.0", 9: "0.0036,ERR,1542.0"}),
        200,
        "2 cells are no numbers (first in line 9: 'ERR')",
    ),
    "text for a stamp": (log({7: "noon,1550.0,1542.0"}), 200, NO_TIME),
    "two rows run together": (
        log({7: rows()[7] + rows()[8]}),
        200,
        "1 rows do not parse (first in line 9: not 3 cells)",
    ),
    "nul bytes inside": (log({150: "\0" * 50}, 9000), 8999, "1 rows do not parse"),
}


@pytest.mark.parametrize("name", LOST)
def test_what_is_lost_is_told_and_the_rest_is_kept(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tirelog.readers.text.source.HEAD_BYTES", 2000)
    text, kept, message = LOST[name]
    reader, block = read(text, SETUP)
    assert block.values["a"].size == kept
    assert len(reader.report.losses) == 1
    assert message in reader.report.losses[0]
    good = ~np.isnan(block.values["a"] + block.stamps_s)
    assert good.sum() >= kept - 2
    np.testing.assert_allclose(
        block.values["a"][good], 1550 + np.round(block.stamps_s[good] * 2500) / 1000, atol=1e-9
    )


IN_102 = "(first in line 102"
NUL = {
    "a byte in a row": (log({100: "0.0400,15\x0050.1,1542.0"}), 200, f"no numbers {IN_102}"),
    "a byte in a stamp": (log({100: "0.04\x0000,1550.1,1542.0"}), 200, f"{IN_102}: no readable"),
    "a hole in the middle": (
        log({100: "0.04" + "\0" * 3000 + "1,1542.0"}),
        199,
        f"1 rows do not parse {IN_102}",
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


@pytest.mark.parametrize("name", NUL)
def test_nul_bytes_cost_their_row_and_no_other(name: str) -> None:
    """What a power cut leaves: a block that was never written, in the part of the log by which its
    layout is told.
    """
    text, kept, message = NUL[name]
    reader, block = read(text, SETUP)
    assert block.values["a"].size == kept
    assert [message in loss for loss in reader.report.losses] == [True]
    good = ~np.isnan(block.values["a"] + block.stamps_s)
    assert good.sum() >= kept - 1
    first = 1551.0 / 1000 - 1.55 if "first" in name else 0.0
    np.testing.assert_allclose(
        block.values["a"][good], 1550 + first + block.stamps_s[good] * 2.5, atol=1e-9
    )


def test_a_header_with_a_byte_that_no_encoding_knows() -> None:
    """0x81 is no letter of cp1252; the rows begin where they begin all the same."""
    data = log().encode().replace(b"time_s,A,B", b"time_s,A,B \x81\x8d\xb0C")
    reader, block = read(data, setup_of({"a": {"source": "A"}}))
    assert block.values["a"].size == 200
    assert block.values["a"][0] == 1550.0
    assert reader.report.losses == []


def test_a_last_row_without_its_line_end_is_a_row() -> None:
    reader, block = read(log()[:-1], SETUP)
    assert block.values["a"].size == 200
    assert reader.report.losses == []


CUT = {
    "gzip": lambda data: gzip.compress(data)[:-2000],
    "zstd": lambda data: zstandard.ZstdCompressor().compress(data)[:-2000],
    "xz": lambda data: lzma.compress(data)[:-2000],
    "gzip, one bit": lambda data: flipped(gzip.compress(data)),
    "gzip, checksum": lambda data: gzip.compress(data)[:-8] + b"\0" * 8,
}


def flipped(data: bytes) -> bytes:
    at = len(data) // 2
    return data[:at] + bytes([data[at] ^ 8]) + data[at + 1 :]


@pytest.mark.parametrize("kind", CUT)
def test_a_damaged_compressed_log_gives_what_came_before(kind: str) -> None:
    noise = np.random.default_rng(5).random(60_000)
    text = HEADER + "".join(
        f"{i / 2500:.4f},{1550 + x:.4f},1542.0000\n" for i, x in enumerate(noise)
    )
    reader = open_text(Pipe(CUT[kind](text.encode())), SETUP, "-")
    block = joined(list(reader.blocks()), reader)
    size = block.values["a"].size
    assert (
        1000 < size <= (90_000 if "bit" in kind else 60_000)
    )  # a flipped bit may repeat what came before
    assert any("stream is" in loss for loss in reader.report.losses)
    if "bit" not in kind:
        np.testing.assert_array_equal(block.values["a"], np.round(1550 + noise[:size], 4))


def test_one_channel_of_two_is_missing() -> None:
    reader, block = read(log(), setup_of({"a": {"source": "A"}, "c": {"source": "AX"}}))
    assert list(block.values) == ["a"]
    assert reader.groups[0].channels == ("a",)
    assert reader.report.losses == [
        "channel c: no column 'AX' (nearest: A); the log's columns are time_s, A, B"
    ]


def test_a_channel_without_one_reading_and_a_constant_one() -> None:
    reader, block = read(HEADER + "".join(f"{i / 10},,1542.0\n" for i in range(50)), SETUP)
    assert np.isnan(block.values["a"]).all()
    assert (block.values["b"] == 1542.0).all()
    assert reader.report.losses == []


def test_no_grating_in_its_window_leaves_the_others() -> None:
    text = "Timestamp\tWL 1[nm]\n" + "".join(
        f"{i / 10}\t1550.0\t1560.0" + "\t1570.0" * (i % 2) + "\n" for i in range(50)
    )
    wrong = {"window_nm": [1500.0, 1501.0], "source": ""}
    reader, block = read(text, setup_of({"a": {"source": "peak"}, "w": wrong}))
    assert not np.isnan(block.values["a"]).any()
    assert "no peak between 1500 and 1501" in reader.report.losses[0]
    reader, block = read(text, setup_of({"w": wrong}))
    assert np.isnan(block.values["w"]).all()
    assert "peaks were seen at about 1550, 1560, 1570" in reader.report.losses[0]


@pytest.mark.parametrize(
    ("change", "repaired"),
    [
        ({i: rows(1, i - 50)[0] for i in range(100, 200)}, "clock_set_back"),
        ({100: rows(1, 20)[0]}, "stamps_repaired"),
        ({i: rows(1, i - 1)[0] for i in range(100, 200)}, "repeated_stamps"),
    ],
)
def test_time_that_runs_backwards_or_stands(change: dict[int, str], repaired: str) -> None:
    reader, block = read(log(change), SETUP)
    clock = ClockFit(resolution_s=reader.groups[0].stamp_resolution_s)
    clock.add(block.stamps_s, None, 200)
    times = clock.axis.time()
    assert clock.repairs == {repaired: 1}
    assert (np.diff(times) > 0).all()
    assert clock.axis.rate_Hz == 2500.0


def test_a_hole_of_the_disk_does_not_fill_the_memory() -> None:
    hole = log(n=40_000).encode() + b"\0" * (40 << 20)
    tracemalloc.start()
    reader = open_text(Pipe(hole, 1 << 16), SETUP, "-")
    size = sum(block.values["a"].size for block in reader.blocks())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert size == 40_000
    assert peak < 60 << 20
    assert "has no end within 8 MB" in " ".join(reader.report.losses)


def test_a_small_file_that_unpacks_to_much_stays_small() -> None:
    bomb = gzip.compress(log(n=1000).encode() + b"\n" * (100 << 20))
    tracemalloc.start()
    reader = open_text(Pipe(bomb, 1 << 16), SETUP, "-")
    size = sum(block.values["a"].size for block in reader.blocks())
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert size == 1000
    assert peak < 100 << 20


def test_zeros_that_a_few_bytes_unpack_to_are_not_all_held(monkeypatch: pytest.MonkeyPatch) -> None:
    packer = zstandard.ZstdCompressor().compressobj()
    zeros = bytes(1 << 22)
    data = (
        packer.compress(log().encode())
        + b"".join(packer.compress(zeros) for _ in range(48))
        + packer.flush()
    )
    assert len(data) < 20_000
    held = []

    def unpack(kind: str, pieces: Iterator[bytes]) -> Iterator[bytes]:
        for piece in unpacked(kind, pieces):
            held.append(len(piece))
            yield piece

    unpacked = text_source._unpack
    monkeypatch.setattr(text_source, "_unpack", unpack)
    for _ in text_source.ByteSource(Pipe(data), "log.csv").blocks(0):
        pass
    assert max(held) < 100 << 20  # of 192 MB
