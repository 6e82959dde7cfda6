"""Property and faults: a run gives back what was written to the last bit, and a flipped bit never
passes as data.
"""

from pathlib import Path

import h5py
import numpy as np
import pytest

from tirelog.data.recording import TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.errors import ReadError, SetupError
from tirelog.readers.base import Group, RawBlock
from tirelog.runs.chunks import CHUNK
from tirelog.runs.store import RunWriter, is_run, open_run
from tirelog.runs.store_checks import contents_digest
from tirelog.vocabulary.quality import Quality

SETUP = """[tire]
unloaded_radius_m = 0.3
[channels.s]
kind = "fbg_strain"
source = "a"
reference_wavelength_nm = 1550.0
strain_gain = 1.25
thermal_expansion_1_K = 2e-6
temperature_channel = "t"
[channels.t]
kind = "fbg_temperature"
source = "b"
reference_wavelength_nm = 1540.0
[channels.v]
kind = "vehicle_speed"
source = "c"
unit = "km/h"
"""
SIZE = 2 * CHUNK + 777


def source() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(3)
    s = np.round(1550 + 0.5 * rng.standard_normal(SIZE), 4)
    s[rng.random(SIZE) < 0.01] = np.nan
    t = np.round(1540 + 0.01 * rng.standard_normal(SIZE), 4)
    v = rng.random(SIZE).astype(np.float32).astype(float)
    return {"s": s, "t": t, "v": v}


def write(
    path: Path,
    values: dict[str, np.ndarray],
    *,
    block: int,
    compress: bool = True,
    decimals: int | None = 4,
) -> None:
    group = Group("g", ("s", "t", "v"), decimals={"s": decimals, "t": 4, "v": None})
    writer = RunWriter(path, parse_setup(SETUP), (group,), compress=compress)
    for start in range(0, SIZE, block):
        part = {name: v[start : start + block] for name, v in values.items()}
        flags = (("s", 1, 3, Quality.SPURIOUS_PEAK),) if start == 0 else ()
        writer.append(RawBlock("g", part, flags=flags))
    axis = TimeAxis(SIZE, 2500.0, np.array([0, 5000]), np.array([0.0, 3.0]), np.array([4e-4, 4e-4]))
    writer.finish(
        {"g": axis},
        {"g": [(5000, 5001, Quality.GAP)]},
        {"sha256": "00", "remarks": ["a remark"], "losses": ["a loss"]},
    )
    writer.close()


@pytest.mark.parametrize("block", [333, CHUNK, 10 * CHUNK])
def test_a_run_gives_back_the_source_in_si(tmp_path: Path, block: int) -> None:
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
def test_irregular_stamps_come_back_however_few(tmp_path: Path, size: int) -> None:
    times = np.cumsum(np.random.default_rng(size).uniform(0.005, 0.05, size))
    none = np.zeros(0)
    writer = RunWriter(
        tmp_path / "r.h5", parse_setup(SETUP), (Group("g", ("s", "t", "v")),), compress=True
    )
    writer.append(RawBlock("g", {name: np.full(size, 1550.0) for name in ("s", "t", "v")}))
    axis = TimeAxis(
        size, 36.0, none.astype(np.int64), none, none, lambda start, stop: times[start:stop]
    )
    writer.finish({"g": axis}, {}, {})
    writer.close()
    with open_run(tmp_path / "r.h5", "r.h5") as run:
        np.testing.assert_array_equal(run.channels["v"].axis.time(0, size), times)


@pytest.mark.parametrize("late", [1550.00001, 5e5, 1550 + 1 / 3])
def test_a_value_that_no_count_can_hold_promotes_the_channel(tmp_path: Path, late: float) -> None:
    values = source()
    values["s"][-1] = late
    write(tmp_path / "r.h5", values, block=1000)
    with h5py.File(tmp_path / "r.h5") as file:
        stored = file["channels/s"][:]
        assert file["channels/s"].dtype == np.float64
        np.testing.assert_array_equal(stored, values["s"])
        assert sorted(file["channels"]) == ["s", "t", "v"]


def test_slices_are_the_whole(tmp_path: Path) -> None:
    write(tmp_path / "r.h5", source(), block=4000)
    with open_run(tmp_path / "r.h5", "r.h5") as run:
        channel = run.channels["s"]
        np.testing.assert_array_equal(
            np.concatenate([v for _, v in channel.blocks(999)]), channel.read()
        )


@pytest.mark.parametrize("block", [500, CHUNK])
def test_a_lost_twin_reading_does_not_cost_the_strain(tmp_path: Path, block: int) -> None:
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


def test_another_setup_changes_the_conversion_and_not_the_counts(tmp_path: Path) -> None:
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


def test_a_flipped_bit_is_never_data(tmp_path: Path) -> None:
    """Every flip is refused, or costs whole chunks that are NaN and named; what is read is what was
    written.
    """
    path = tmp_path / "r.h5"
    write(path, source(), block=CHUNK)
    with open_run(path, "r.h5") as run:
        truth = {name: channel.read() for name, channel in run.channels.items()}
    clean = path.read_bytes()
    rng = np.random.default_rng(8)
    met = {"refused": 0, "lost": 0, "harmless": 0}
    for _ in range(120):
        damaged = bytearray(clean)
        damaged[rng.integers(len(clean))] ^= 1 << int(rng.integers(8))
        path.write_bytes(damaged)
        try:
            with open_run(path, "r.h5") as run:
                read = {name: channel.read() for name, channel in run.channels.items()}
                losses = [loss for loss in run.losses if "checksum" in loss]
        except (ReadError, SetupError):
            met["refused"] += 1
            continue
        different = [
            name for name in truth if not np.array_equal(read[name], truth[name], equal_nan=True)
        ]
        for name in different:
            changed = ~(
                (read[name] == truth[name]) | (np.isnan(read[name]) & np.isnan(truth[name]))
            )
            bridged = (name == "s") & (
                np.abs(read[name] - truth[name]) < 2e-5
            )  # temperature from the nearest twin readings
            assert (np.isnan(read[name]) | bridged)[changed].all()
        assert bool(losses) >= bool(different)
        met["lost" if losses else "harmless"] += 1
    assert met["lost"] > 60


@pytest.mark.parametrize("keep", [0, 8, 100, 1000, 5000, 50_000])
def test_a_run_that_was_cut_off(tmp_path: Path, keep: int) -> None:
    path = tmp_path / "r.h5"
    write(path, source(), block=CHUNK)
    path.write_bytes(path.read_bytes()[:keep])
    assert not is_run(path)
    with pytest.raises(ReadError, match="ingest it again"), open_run(path, "r.h5"):
        pass


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("decimals", [None, 4])
def test_a_number_at_the_end_of_floats_warns_nobody(tmp_path: Path, decimals: int | None) -> None:
    values = source()
    values["s"][7], values["v"][8] = 1e308, -1e308
    write(tmp_path / "r.h5", values, block=CHUNK, decimals=decimals)
    with open_run(tmp_path / "r.h5", "r.h5") as run:
        assert np.isfinite(run.channels["s"].read()[9:100]).any()
        assert not np.isnan(run.channels["v"].read(8, 9)).any()


def test_a_word_of_another_version_is_a_foreign_doubt(tmp_path: Path) -> None:
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
