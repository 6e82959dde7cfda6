"""Closed form: WAV of 24 bits and converted numpy arrays are read to the bit."""

import io
import struct

import numpy as np
import pytest
from scipy.io import wavfile

from tests.readers.other_files import A, N, read, refusal


def test_samples_of_24_bits(tmp_path):
    whole = np.array([0, 1, -1, 1 << 22, -(1 << 23), (1 << 23) - 1])
    body = b"".join(int(x).to_bytes(3, "little", signed=True) for x in whole)
    head = b"RIFF\x44\0\0\0WAVEfmt \x10\0\0\0" + struct.pack("<HHIIHH", 1, 1, 100, 300, 3, 24)
    data = head + b"LIST\x05\0\0\0abcde\0" + b"data" + struct.pack("<I", len(body)) + body
    np.testing.assert_array_equal(read(data, tmp_path, "#1")[0], whole / 2.0**23)


def test_negative_shares_of_a_wavelength_are_no_lost_peaks(tmp_path):
    shares = np.array([0.5, 0.25, 0.0, -0.25, -1.0])
    file = io.BytesIO()
    wavfile.write(file, 100, shares.astype(np.float32))
    grating = {"kind": "fbg_temperature", "scale": 4.0, "offset": 1550.0}
    values, _ = read(file.getvalue(), tmp_path, "left", **grating)
    np.testing.assert_array_equal(np.isfinite(values), shares != 0.0)  # as in other formats


ARRAYS = {
    "columns": np.column_stack([np.arange(N) / 100.0, A]),
    "rows": np.vstack([np.arange(N) / 100.0, A]),
    "records": np.rec.fromarrays([np.arange(N) / 100.0, A], names="t,a"),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_the_line_that_converts_a_numpy_array_does(name, tmp_path, monkeypatch):
    np.save(tmp_path / "log", ARRAYS[name])
    (tmp_path / "log.npy").rename(tmp_path / "log")
    message = refusal((tmp_path / "log").read_bytes(), tmp_path)
    code = message.split('convert it first: python -c "')[1].removesuffix('"')
    monkeypatch.chdir(tmp_path)
    exec(code.replace("FILE", "log"), {})  # what a shell would hand to Python
    data = (tmp_path / "log.csv").read_bytes()
    np.testing.assert_array_equal(read(data, tmp_path, "a" if name == "records" else "#2")[0], A)
