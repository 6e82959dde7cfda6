"""Property: a run gives back what was written to the last bit; damage costs what it hits."""

import h5py
import numpy as np
import pytest

from tests.runs.stored import SETUP, SIZE, source, write
from tirelog.data.recording import LOST_COUNT, TimeAxis, counted_floats
from tirelog.data.setup import parse_setup
from tirelog.errors import SetupError
from tirelog.readers.base import Group, RawBlock
from tirelog.runs.store import contents_digest, open_run, write_file
from tirelog.runs.temporary import CHUNK, RunWriter
from tirelog.vocabulary.quality import Quality


@pytest.mark.parametrize("block", [333, CHUNK, 10 * CHUNK])
def test_a_run_gives_back_the_source_in_si(tmp_path, block):
    values = source()
    write(tmp_path / "r.h5", values, block=block)
    with open_run(tmp_path / "r.h5", "r.h5") as run:
        temperature = (values["t"] - 1540) / 0.010
        np.testing.assert_allclose(
            run.channels["s"].read(),
            1.25 * (values["s"] - 1550) / 1550 - 2e-6 * temperature,
            rtol=1e-9,
            atol=1e-14,
        )
        np.testing.assert_allclose(
            run.channels["v"].read(10, 20), values["v"][10:20] / 3.6, rtol=1e-15
        )
        assert run.channels["s"].flags == ((1, 3, Quality.SPURIOUS_PEAK), (5000, 5001, Quality.GAP))
        assert run.channels["s"].axis.gaps() == [(5000, pytest.approx(3.0 - 4999 * 4e-4))]
        assert run.channels["s"].resolution == pytest.approx(1.25e-4 / 1550)
        assert run.remarks == ("a remark",)
        assert run.losses == ["a loss"]
    with h5py.File(tmp_path / "r.h5") as file:
        assert file["channels/s"].dtype == np.int32
        assert file["channels/v"].dtype == np.float32


@pytest.mark.parametrize("size", [2, 69, CHUNK - 1, CHUNK, CHUNK + 1])
def test_irregular_stamps_come_back_however_few(tmp_path, size):
    times = np.cumsum(np.random.default_rng(size).uniform(0.005, 0.05, size))
    writer = RunWriter(tmp_path, parse_setup(SETUP), (Group("g", ("s", "t", "v")),))
    writer.append(RawBlock("g", {name: np.full(size, 1550.0) for name in ("s", "t", "v")}))
    write_file(writer.finish({"g": TimeAxis.of_times(times)}, {}, {}), tmp_path / "r.h5")
    with open_run(tmp_path / "r.h5", "r.h5") as run:
        np.testing.assert_array_equal(run.channels["v"].axis.time(0, size), times)


def test_another_setup_changes_the_conversion_and_not_the_counts(tmp_path):
    write(tmp_path / "r.h5", source(), block=4000)
    other = parse_setup(SETUP.replace("1.25", "2.5").replace("2e-6", "0.0"))
    with open_run(tmp_path / "r.h5", "r.h5", other) as run:
        np.testing.assert_allclose(
            run.channels["s"].read(), 2.5 * (source()["s"] - 1550) / 1550, rtol=1e-9, atol=1e-14
        )
    with (
        pytest.raises(SetupError, match="is vehicle_speed in the run"),
        open_run(
            tmp_path / "r.h5",
            "r.h5",
            parse_setup(SETUP.replace("vehicle_speed", "strain").replace('unit = "km/h"', "")),
        ),
    ):
        pass


@pytest.mark.parametrize(
    ("late", "dtype", "decimals"),
    [
        (np.zeros(0), "i4", 2),
        (np.array([0.25, np.nan]), "i4", 2),
        (np.array([0.125]), "i4", 3),
        (np.array([1.0, 1e-9]), "f8", 0),
    ],
)
def test_counts_and_floats_of_one_channel(tmp_path, late, dtype, decimals):
    """Decimals are counts behind lost samples and behind zeros."""
    counts = np.arange(300_000, dtype=np.int32)
    counts[::1000] = LOST_COUNT
    values = counted_floats(counts, 2)
    setup = parse_setup(
        '[tire]\nunloaded_radius_m = 0.3\n[channels.t]\nkind = "temperature"\nsource = "a"\n'
    )
    writer = RunWriter(tmp_path, setup, (Group("g", ("t",)),))
    parts = [np.full(70, np.nan), np.zeros(900), values[:1000], values[1000:], late, values[:10]]
    for part in parts:
        writer.append(RawBlock("g", {"t": part}))
    whole = np.concatenate(parts)
    assert writer.lost == {"t": np.isnan(whole).sum()}
    run = writer.finish({"g": TimeAxis.uniform(whole.size, 100.0)}, {}, {})
    write_file(run, tmp_path / "r.h5")
    with h5py.File(tmp_path / "r.h5") as file:
        stored = file["channels/t"]
        assert stored.dtype == dtype
        read = counted_floats(stored[:], decimals) if dtype == "i4" else stored[:]
        np.testing.assert_array_equal(read, whole)


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
