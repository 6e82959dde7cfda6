"""Faults: lost samples and damage cost a run only what they hit, and never pass as data."""

import h5py
import numpy as np
import pytest

from tests.runs.stored import SIZE, source, write
from tirelog.runs.store import contents_digest, open_run
from tirelog.runs.temporary import CHUNK
from tirelog.vocabulary.quality import Quality


@pytest.mark.parametrize("block", [500, CHUNK])
def test_a_lost_twin_reading_does_not_cost_the_strain(tmp_path, block):
    values = source()
    values["t"] = 1540.0 + np.round(1e-5 * np.arange(SIZE), 4)
    values["t"][20_000:21_000] = np.nan  # bridged
    values["t"][40_000:60_000] = np.nan  # the middle of it is out of reach of any reading
    write(tmp_path / "r.h5", values, block=4000)
    temperature = (1540.0 + 1e-5 * np.arange(SIZE) - 1540) / 0.010
    with open_run(tmp_path / "r.h5", "r.h5") as run:
        strain = np.concatenate([v for _, v in run.channels["s"].blocks(block)])
    want = 1.25 * (values["s"] - 1550) / 1550 - 2e-6 * temperature
    near = np.r_[0:40_000, 60_000:SIZE]
    np.testing.assert_allclose(strain[near], want[near], atol=2e-6 * 0.011)
    assert np.isnan(strain[45_000:55_000]).all()
    assert np.isfinite(strain[41_000:41_010]).any()


@pytest.mark.filterwarnings("error")
def test_a_number_at_the_end_of_floats_warns_nobody(tmp_path):
    values = source()
    values["s"][7], values["v"][8] = 1e308, -1e308
    write(tmp_path / "r.h5", values, block=CHUNK)
    with open_run(tmp_path / "r.h5", "r.h5") as run:
        assert np.isfinite(run.channels["s"].read()[9:100]).any()
        assert np.isnan(run.channels["v"].read(8, 9)).all()  # no speed, as an error code is none


def test_a_word_of_another_version_is_a_foreign_doubt(tmp_path):
    """Nothing is dropped in silence: its samples stay doubted, and the word is told."""
    write(tmp_path / "r.h5", source(), block=CHUNK)
    with h5py.File(tmp_path / "r.h5", "r+") as file:
        words = file["flags/s/word"][:]
        del file["flags/s/word"]
        words = np.array([b"wobbly\x1b", *words[1:]])
        file["flags/s"].create_dataset("word", data=words, chunks=True, fletcher32=True)
        file.attrs["contents_sha256"] = np.bytes_(contents_digest(file))
    with open_run(tmp_path / "r.h5", "r.h5") as run:
        assert run.channels["s"].flags == ((1, 3, Quality.FOREIGN_DOUBT), (5000, 5001, Quality.GAP))
        assert run.channels["t"].flags == ((5000, 5001, Quality.GAP),)
        assert len(run.remarks) == 2
        assert "wobbly" in run.remarks[1]
        assert "foreign_doubt" in run.remarks[1]
