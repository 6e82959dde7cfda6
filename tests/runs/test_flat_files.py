"""Property: a temporary run's samples are read as they were written, in any slices."""

from pathlib import Path

import numpy as np
import pytest

from tirelog.errors import ReadError
from tirelog.runs.temporary import FlatFile

SIZE = 70_000


@pytest.mark.parametrize("dtype", ["i4", "f4", "f8"])
def test_slices_are_those_of_what_was_written(tmp_path: Path, dtype: str) -> None:
    rng = np.random.default_rng(2)
    values = rng.integers(0, 9999, SIZE).astype(dtype)
    file = FlatFile(tmp_path / "samples", values.dtype)
    for start in (0, 1, 30_000):
        stop = {0: 1, 1: 30_000, 30_000: SIZE}[start]
        file.append(values[start:stop])
    ends = [0, 1, 30_000, SIZE - 1, SIZE]
    slices = [(a, b) for a in ends for b in ends if a <= b]
    slices += [tuple(sorted(rng.integers(0, SIZE, 2))) for _ in range(50)]
    for start, stop in slices:
        np.testing.assert_array_equal(file(start, stop), values[start:stop])
        assert file(start, stop).dtype == values.dtype


def test_a_file_that_was_cut_off_or_removed_is_refused(tmp_path: Path) -> None:
    file = FlatFile(tmp_path / "samples", np.dtype(np.float64))
    file.append(np.arange(100.0))
    with open(file.path, "r+b") as cut:
        cut.truncate(60 * 8)
    with pytest.raises(ReadError, match="cut off"):
        file(0, 100)
    file.path.unlink()
    with pytest.raises(ReadError, match="closed"):
        file(0, 5)
