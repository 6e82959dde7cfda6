"""Logs of one channel in formats of other programs: read, or refused."""

from pathlib import Path

import numpy as np
import pytest

from tirelog.data.setup import Setup, parse_setup
from tirelog.errors import ReadError
from tirelog.runs.ingest import open_recording

N = 4000

A = np.sin(np.arange(N) * 0.37) + 1e-3 * np.arange(N)


def setup_of(source: str = "a") -> Setup:
    return parse_setup(
        f'[channels.a]\nkind = "signal"\nsource = "{source}"\n[log]\nsampling_rate_Hz = 100.0\n'
    )


def read(data: bytes, folder: Path, source: str = "a") -> tuple[np.ndarray, str]:
    """(samples, what was lost)."""
    path = folder / "log"
    path.write_bytes(data)
    with open_recording(str(path), setup_of(source)) as recording:
        return recording.channels["a"].read(), "; ".join(recording.losses)


def refusal(data: bytes, folder: Path, source: str = "a") -> str:
    with pytest.raises(ReadError) as caught:
        read(data, folder, source)
    assert str(caught.value).startswith(f"{folder / 'log'}: ")
    return str(caught.value)
