"""Property: a temporary run read past HDF5's library gives what the library gives."""

import h5py
import numpy as np
import pytest

from tirelog.errors import ReadError
from tirelog.runs.chunks import CHUNK, ChunkWriter
from tirelog.runs.direct import Direct


@pytest.fixture
def run(tmp_path):
    """Two channels whose chunks were written in turns, the last of them not full."""
    path, rng = tmp_path / "run.h5", np.random.default_rng(1)
    with h5py.File(path, "w") as file:
        writer = ChunkWriter(compress=False)
        sets = [
            file.create_dataset(name, (0,), dtype, maxshape=(None,), chunks=(CHUNK,))
            for name, dtype in (("counts", np.int32), ("values", np.float64))
        ]
        at = 0
        for chunks in (1, 3, 1, 2, 0.3):
            count = int(chunks * CHUNK)
            for dataset in sets:
                writer.write(dataset, at, rng.integers(0, 9999, count).astype(dataset.dtype))
            at += count
        for dataset in sets:
            dataset.resize(at, axis=0)
    return path


@pytest.mark.parametrize("name", ["counts", "values"])
def test_slices_are_the_library_s(run, name):
    rng = np.random.default_rng(2)
    with h5py.File(run) as file, open(run, "rb", buffering=0) as whole:
        dataset = file[name]
        read, size = Direct(dataset, whole), dataset.size
        ends = [0, 1, CHUNK - 1, CHUNK, CHUNK + 1, 4 * CHUNK, size - 1, size]
        slices = [(a, b) for a in ends for b in ends if a <= b]
        slices += [tuple(sorted(rng.integers(0, size, 2))) for _ in range(50)]
        for start, stop in slices:
            np.testing.assert_array_equal(read(start, stop), dataset[start:stop])
            assert read(start, stop).dtype == dataset.dtype


def test_a_file_that_was_cut_off_or_closed_is_refused(run):
    with h5py.File(run) as file, open(run, "rb", buffering=0) as whole:
        read, size = Direct(file["values"], whole), file["values"].size
        read(0, size)
        with open(run, "r+b") as cut:
            cut.truncate(run.stat().st_size - 8 * CHUNK)
        with pytest.raises(ReadError, match="cut off"):
            read(0, size)
    with pytest.raises(ReadError, match="closed"):
        read(0, 5)
