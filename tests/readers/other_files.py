"""Logs of one channel in formats of other programs: read, or refused."""

from pathlib import Path

import numpy as np
import pytest

from tests.readers.logs import setup_of
from tirelog.errors import ReadError, TirelogError
from tirelog.runs.ingest import open_recording

N = 4000

A = np.sin(np.arange(N) * 0.37) + 1e-3 * np.arange(N)


def read(data: bytes, folder: Path, source: str = "a", **keys: object) -> tuple[np.ndarray, str]:
    """(samples, what was lost)."""
    path = folder / "log"
    path.write_bytes(data)
    setup = setup_of({"a": source}, "sampling_rate_Hz = 100.0", **{"kind": "signal", **keys})
    with open_recording(str(path), setup) as recording:
        return recording.channels["a"].read(), "; ".join(recording.losses)


def outcome(data: bytes, folder: Path, source: str = "a") -> tuple[int, str]:
    """(samples read, what is said): a refusal of ours, or what was lost."""
    try:
        values, said = read(data, folder, source)
    except TirelogError as problem:
        return 0, str(problem)
    return values.size, said


def refusal(data: bytes, folder: Path, source: str = "a") -> str:
    with pytest.raises(ReadError) as caught:
        read(data, folder, source)
    assert str(caught.value).startswith(f"{folder / 'log'}: ")
    return str(caught.value)
