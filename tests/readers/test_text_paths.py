"""Property: the same samples whatever the block size or the wrapping of the bytes."""

import gzip
import lzma

import numpy as np
import pytest
import zstandard

from tests.readers.text_logs import Pipe, joined, piped, read, setup_of
from tirelog.readers.text import source as text_source
from tirelog.readers.text.reader import open_text
from tirelog.readers.text.source import ByteSource

SETUP = setup_of({"a": "A", "b": {"source": "B", "kind": "strain", "unit": "strain"}})


def log(rows=3000):
    rng = np.random.default_rng(1)
    lost = rng.random(rows) < 0.02
    a = np.where(lost, "", [f"{x:.4f}" for x in 1550 + rng.standard_normal(rows)])
    b = [f"{x:.6g}" for x in 1e-3 * rng.standard_normal(rows)]
    lines = (f"{i / 2500:.4f},{x},{y}\n" for i, (x, y) in enumerate(zip(a, b)))
    return ("time_s,A,B\n" + "".join(lines)).encode()


def same(one, other):
    for name in one.values:
        np.testing.assert_array_equal(one.values[name], other.values[name])
    np.testing.assert_array_equal(one.stamps_s, other.stamps_s)
    assert one.flags == other.flags


@pytest.mark.parametrize("size", [64, 1000, 65_536])
def test_any_block_size(size, monkeypatch):
    """The same samples, and losses that are told with the same lines."""
    lines = log().splitlines(keepends=True)
    lines[800:800] = [b"noon,1,2\n"]
    lines[700:700] = [b"\n", b"0.1,what,1\n"]
    damaged = b"".join(lines) + b"9.9,155"
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
    assert all(f"line {line}:" in told for line in (702, 803, len(lines) + 1)), told


WRAP = {
    "gzip": gzip.compress,
    "xz": lzma.compress,
    "zstd": zstandard.ZstdCompressor().compress,
    "two members": lambda data: gzip.compress(data[:5000]) + gzip.compress(data[5000:]),
    "two frames": lambda data: zstandard.compress(data[:5000]) + zstandard.compress(data[5000:]),
}


@pytest.mark.parametrize("kind", WRAP)
def test_compressed_and_piped(kind):
    reader, block = piped(WRAP[kind](log()), SETUP)
    same(block, read(log(), SETUP)[1])
    assert reader.report.losses == []
