"""Property: what is packed beside HDF5 is what HDF5 itself would store: plain h5py reads it back,
checksums and all.
"""

import zlib
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tirelog.data.recording import TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.readers.base import LOST_COUNT, Group, RawBlock, counted_floats
from tirelog.runs import chunks
from tirelog.runs.chunks import CHUNK, FILTERS, ChunkWriter, fletcher32
from tirelog.runs.store import RunWriter


def slow_fletcher32(data: bytes) -> int:
    """As HDF5's specification words it."""
    low = high = 0
    for word in np.frombuffer(data + b"\0" * (len(data) % 2), ">u2").tolist():
        low += word
        high += low
        low, high = (low & 0xFFFF) + (low >> 16), (high & 0xFFFF) + (high >> 16)
    return (high << 16) | low


@given(st.binary(max_size=2000))
@settings(max_examples=200, deadline=None)
def test_the_checksum(data: bytes) -> None:
    assert fletcher32(data) == slow_fletcher32(data)


@pytest.mark.parametrize(
    "data",
    [b"\xff" * 2, b"\xff" * 131_070, b"\0" * 9, b"\xff\xfe\0\1", bytes(range(256)) * 999 + b"\1"],
)
def test_the_checksum_where_it_wraps(data: bytes) -> None:
    assert fletcher32(data) == slow_fletcher32(data)


def written(path: Path, values: np.ndarray, piece: int, *, compress: bool = True) -> None:
    writer = ChunkWriter(compress=compress)
    with h5py.File(path, "w") as file:
        dataset = file.create_dataset(
            "x", shape=(0,), maxshape=(None,), chunks=(CHUNK,), dtype=values.dtype, **writer.options
        )
        for start in range(0, values.size, piece):
            writer.write(dataset, start, values[start : start + piece])
        writer.flush()
        writer.close()


@pytest.mark.parametrize("deflate", [chunks.deflate, zlib.compress])
@pytest.mark.parametrize("dtype", ["i4", "f4", "f8"])
@pytest.mark.parametrize("size", [1, CHUNK - 1, CHUNK, 70 * CHUNK + 17])
def test_h5py_reads_it_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, deflate, dtype: str, size: int
) -> None:
    monkeypatch.setattr(chunks, "deflate", deflate)
    noise = np.random.default_rng(size).standard_normal(size)
    values = (1e4 * noise).astype(dtype)
    for compress in (True, False):
        written(tmp_path / "x.h5", values, 4 * CHUNK, compress=compress)
        with h5py.File(tmp_path / "x.h5") as file:
            dataset = file["x"]
            np.testing.assert_array_equal(dataset[:], values)
            assert (dataset.compression, dataset.shuffle, dataset.fletcher32) == (
                ("gzip", True, True) if compress else (None, False, False)
            )


def test_the_same_bytes_as_of_hdf5_but_for_the_compression(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(chunks, "deflate", zlib.compress)
    values = np.arange(2 * CHUNK, dtype=np.int32) // 7
    written(tmp_path / "ours.h5", values, CHUNK)
    with h5py.File(tmp_path / "theirs.h5", "w") as file:
        file.create_dataset("x", data=values, chunks=(CHUNK,), **FILTERS)
    with h5py.File(tmp_path / "ours.h5") as ours, h5py.File(tmp_path / "theirs.h5") as theirs:
        for at in (0, CHUNK):
            mine, other = (file["x"].id.read_direct_chunk((at,)) for file in (ours, theirs))
            assert mine[0] == other[0] == 0
            assert zlib.decompress(mine[1][:-4]) == zlib.decompress(other[1][:-4])
            assert other[1][-4:] == fletcher32(other[1][:-4]).to_bytes(4, "little")


def test_a_flipped_bit_in_a_packed_chunk_is_found(tmp_path: Path) -> None:
    path = tmp_path / "x.h5"
    written(path, np.arange(CHUNK, dtype=np.int32), CHUNK)
    with h5py.File(path) as file:
        chunk = file["x"].id.get_chunk_info(0)
    data = bytearray(path.read_bytes())
    data[chunk.byte_offset + chunk.size // 2] ^= 4
    path.write_bytes(data)
    with h5py.File(path) as file, pytest.raises(OSError):
        file["x"][:]


SETUP = parse_setup(
    '[tire]\nunloaded_radius_m = 0.3\n[channels.t]\nkind = "temperature"\nsource = "a"\n'
)
COUNTS = np.arange(300_000, dtype=np.int32)


@pytest.mark.parametrize("compress", [True, False])
@pytest.mark.parametrize(
    ("late", "dtype"),
    [
        (COUNTS[:5], "i4"),
        (np.array([0.25, np.nan]), "i4"),
        (np.array([0.125]), "f8"),
        (np.array([1.0, 1e-9]), "f8"),
    ],
)
def test_counts_and_floats_of_one_channel(
    tmp_path: Path, compress: bool, late: np.ndarray, dtype: str
) -> None:
    """Counts go into the run as they are; floats that are such counts join them, others make floats
    of all, to the bit.
    """
    counts = COUNTS.copy()
    counts[::1000] = LOST_COUNT
    writer = RunWriter(
        tmp_path / "r.h5", SETUP, (Group("g", ("t",), decimals={"t": 2}),), compress=compress
    )
    for part in (counts[:1000], counts[1000:], late, counts[:10]):
        writer.append(RawBlock("g", {"t": part}))
    whole = np.concatenate([counted_floats(part, 2) for part in (counts, late, counts[:10])])
    assert writer.flush() == {"t": np.isnan(whole).sum()}
    writer.finish({"g": TimeAxis.uniform(whole.size, 100.0)}, {}, {})
    writer.close()
    with h5py.File(tmp_path / "r.h5") as file:
        stored = file["channels/t"]
        assert stored.dtype == dtype
        np.testing.assert_array_equal(counted_floats(stored[:], 2), whole)
