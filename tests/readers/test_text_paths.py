"""Property: the same samples whatever the block size, the wrapping of the bytes, or the way in
which a block is parsed.
"""

import gzip
import io
import lzma

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from tirelog.readers.base import counted_floats
from tirelog.readers.text import source as text_source
from tirelog.readers.text.parse import odd_rows
from tirelog.readers.text.reader import TextReader, open_text
from tirelog.readers.text.source import ByteSource

from .text_logs import Pipe, all_plain, joined, read, setup_of

SETUP = setup_of({"a": {"source": "A"}, "b": {"source": "B", "kind": "strain", "unit": "strain"}})


def log(rows: int = 3000, seed: int = 1) -> bytes:
    rng = np.random.default_rng(seed)
    a = [
        "" if lost else f"{x:.4f}"
        for x, lost in zip(1550 + rng.standard_normal(rows), rng.random(rows) < 0.02)
    ]
    b = [f"{x:.6g}" for x in 1e-3 * rng.standard_normal(rows)]
    return (
        "time_s,A,B\n" + "".join(f"{i / 2500:.4f},{x},{y}\n" for i, (x, y) in enumerate(zip(a, b)))
    ).encode()


def same(one, other) -> None:
    for name in one.values:
        np.testing.assert_array_equal(one.values[name], other.values[name])
    np.testing.assert_array_equal(one.stamps_s, other.stamps_s)
    assert one.flags == other.flags


@pytest.mark.parametrize("size", [64, 1000, 65_536])
def test_any_block_size(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same samples, and losses that are told with the same lines."""
    lines = log().splitlines(keepends=True)
    damaged = b"".join(
        [
            *lines[:700],
            b"\n",
            b"0.1,what,1\n",
            *lines[700:800],
            b"noon,1,2\n",
            *lines[800:],
            b"9.9,155",
        ]
    )
    plain, whole = read(damaged, SETUP)
    original = ByteSource.blocks
    monkeypatch.setattr(text_source, "BLOCK_BYTES", size)
    monkeypatch.setattr(
        ByteSource, "blocks", lambda self, skip, **more: original(self, skip, size, **more)
    )
    monkeypatch.setattr(text_source, "HEAD_BYTES", 4096)
    reader = open_text(Pipe(damaged), SETUP, "-")
    blocks = list(reader.blocks())
    assert len(blocks) > 1 or size > 60_000
    same(joined(blocks, reader), whole)
    assert reader.report.losses == plain.report.losses
    told = " ".join(reader.report.losses)
    assert all(f"line {line}:" in told for line in (702, 803, len(lines) + 4)), told


WRAP = {
    "gzip": gzip.compress,
    "xz": lzma.compress,
    "zstd": zstandard.ZstdCompressor().compress,
    "two members": lambda data: gzip.compress(data[:5000]) + gzip.compress(data[5000:]),
    "two frames": lambda data: zstandard.compress(data[:5000]) + zstandard.compress(data[5000:]),
}


@pytest.mark.parametrize("kind", WRAP)
def test_compressed_and_piped(kind: str) -> None:
    _, whole = read(log(), SETUP)
    reader = open_text(Pipe(WRAP[kind](log())), SETUP, "-")
    same(joined(list(reader.blocks()), reader), whole)
    assert reader.report.losses == []


def parsers(data: bytes) -> TextReader:
    return open_text(io.BytesIO(data), SETUP, "log")


CELL = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.decimals(
        min_value=-2000, max_value=2000, places=5, allow_nan=False, allow_infinity=False
    ).map(str),
    st.integers(-(10**9), 10**9).map(str),
    st.sampled_from(["", "nan", "NaN", "0", "-1", "NULL", "n/a", "inf", " 7.5 "]),
)


@given(st.lists(st.tuples(CELL, CELL), min_size=1, max_size=20))
@settings(max_examples=150, deadline=None)
def test_both_ways_of_parsing_give_the_same_numbers(cells: list[tuple[str, str]]) -> None:
    head = b"time_s,A,B\n" + b"".join(b"%d,1.5,2.5\n" % i for i in range(8))
    rows = "".join(f"{i + 8},{a},{b}\n" for i, (a, b) in enumerate(cells)).encode()
    plan = parsers(head)._plan
    (fast, stop), careful = all_plain(plan, rows), odd_rows(plan, 1, rows)
    assert stop == len(rows)
    assert fast.size == careful.size == len(cells)
    for column in fast.values:
        np.testing.assert_array_equal(
            counted_floats(fast.values[column], plan.places[column]), careful.values[column]
        )
    np.testing.assert_array_equal(fast.stamps, careful.stamps)
    assert not careful.bad_rows
    assert not careful.bad_cells


@given(
    st.decimals(min_value=-2000, max_value=2000, places=6, allow_nan=False, allow_infinity=False)
)
@settings(max_examples=100, deadline=None)
def test_numbers_are_rounded_correctly(number) -> None:
    _, block = read(f"time_s,A,B\n0.0,1550,{number}\n0.1,1550,{number}\n", SETUP)
    assert block.values["b"].tolist() == [float(number)] * 2


def test_one_bad_cell_changes_no_other_sample() -> None:
    _, whole = read(log(), SETUP)
    lines = log().split(b"\n")
    lines[1500] = lines[1500].rsplit(b",", 1)[0] + b",oops"
    reader, block = read(b"\n".join(lines), SETUP)
    rest = np.arange(3000) != 1499
    np.testing.assert_array_equal(block.values["b"][rest], whole.values["b"][rest])
    np.testing.assert_array_equal(block.values["a"], whole.values["a"])
    assert np.isnan(block.values["b"][1499])
    assert reader.report.losses == ["1 cells are no numbers (first in line 1501: 'oops')"]
