"""Property: `info` tells what is in any log without a setup, and `setup` drafts and checks one."""

import json

import h5py
import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat, wavfile

from tests.cli.conftest import pulse_rows
from tests.readers.mcap_files import START_NS, write_json
from tirelog.data.setup import load_setup

ROWS = np.array([[float(x) for x in row.split(",")] for row in pulse_rows(1.6)])
T, STRAIN = ROWS[:, 0], ROWS[:, 1]
TWIN = 1542.0 + 2e-4 * np.sin(T)
SPEED, LOAD = 12.0 + 0.1 * np.sin(T), 3.4 + 0.01 * np.cos(T)


def text(path):
    table = pd.DataFrame(
        {"time_s": T, "CH1": STRAIN, "CH2": TWIN, "speed [km/h]": 3.6 * SPEED, "odd": LOAD}
    )
    table.to_csv(path, index=False, float_format="%.5f")


def peaks(path):
    rows = (
        f"{t:.4f}\t{a:.4f}\t{b:.4f}\n" if k % 9 else f"{t:.4f}\t{b:.4f}\n"
        for k, (t, a, b) in enumerate(zip(T, TWIN, STRAIN, strict=True))
    )
    path.write_text("".join(rows))


def hdf5(path):
    with h5py.File(path, "w") as file:
        file["/fbg/both"] = np.column_stack([STRAIN, TWIN])
        file["/fbg/both"].attrs["fs"] = 2500.0
        file["/vehicle/speed"] = 3.6 * SPEED
        file["/vehicle/speed"].attrs.update(units="km/h", fs=2500.0)
        file["/note"] = "a drive"


def matlab(path):
    savemat(path, {"run": {"CH1": STRAIN, "CH2": TWIN, "speed": SPEED, "t": T}})


def mcap(path):
    messages = []
    for t, strain, twin, speed in zip(T, STRAIN, TWIN, SPEED, strict=True):
        at = START_NS + round(t * 1e9)
        both = {"gratings": [round(strain, 4), round(twin, 5)], "note": "x"}
        messages += [("/tire", at, both), ("/vehicle", at, {"speed": round(speed, 4)})]
    write_json(path, messages)


def wav(path):
    wavfile.write(path, 2500, (1e4 * np.sin(T)).astype(np.int16))


def frame():
    return pd.DataFrame({"t": T, "CH1": STRAIN, "CH2": TWIN, "v": SPEED})


def kinds_of(strain, twin, speed="", **more):
    """Sources with their likely kinds."""
    speed_too = {speed: "vehicle_speed"} if speed else {}
    return {strain: "fbg_strain", twin: "fbg_temperature", **speed_too, **more}


#: suffix: (writes the log, sources with their likely kinds)
LOGS = {
    "csv": (text, kinds_of("CH1", "CH2", "speed", odd="signal")),
    "txt": (peaks, kinds_of("peak_1550nm", "peak_1542nm")),
    "parquet": (lambda path: frame().to_parquet(path), kinds_of("CH1", "CH2", v="signal")),
    "h5": (hdf5, kinds_of("/fbg/both[0]", "/fbg/both[1]", "/vehicle/speed")),
    "mat": (matlab, kinds_of("/run/CH1", "/run/CH2", "/run/speed")),
    "mcap": (mcap, kinds_of("/tire:gratings[0]", "/tire:gratings[1]", "/vehicle:speed")),
    "wav": (wav, {"#1": "signal"}),
    "feather": (lambda path: frame().to_feather(path), kinds_of("CH1", "CH2", v="signal")),
}


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("suffix", LOGS)
def test_info_lists_every_series_of_a_log_without_a_setup(suffix, place, tirelog):
    write, kinds = LOGS[suffix]
    write(place / f"drive.{suffix}")
    told = tirelog("info", f"drive.{suffix}").ended(0)
    assert told.err == ""
    assert all(source in told.out for source in kinds)
    assert "tirelog setup new" in told.out
    rows = json.loads(tirelog("info", f"drive.{suffix}", "--format", "json").out)
    assert {row["source"]: row["likely_kind"] for row in rows} == kinds
    assert all(abs(row["rate_Hz"] - 2500.0) < 0.1 for row in rows)
    assert all(row["lowest"] < row["highest"] for row in rows)


@pytest.mark.parametrize("suffix", ["csv", "mcap"])
def test_a_drafted_setup_reads_the_log_and_gives_its_speed(suffix, place, tirelog):
    LOGS[suffix][0](place / f"drive.{suffix}")
    tirelog("setup", "new", f"drive.{suffix}", "-o", "drive.toml").ended(0, "guesses to check")
    draft = (place / "drive.toml").read_text()
    setup = load_setup(place / "drive.toml")
    strain = next(one for one in setup.channels.values() if one.kind == "fbg_strain")
    assert strain.surface == "outer"
    assert setup.channels[strain.temperature_channel].kind == "fbg_temperature"
    assert abs(strain.reference_wavelength_nm - 1550.0) < 0.5
    checked = tirelog("setup", "check", f"drive.{suffix}").ended(0)
    assert "missing: [tire] rolling_radius_m" in checked.out
    assert f"{draft.count('# guessed')} guesses are still marked" in checked.out
    draft = draft.replace("# rolling_radius_m", "rolling_radius_m").replace("guessed", "looked at")
    (place / "drive.toml").write_text(draft)
    assert "guess" not in tirelog("setup", "check", f"drive.{suffix}").out
    rows = json.loads(tirelog("speed", f"drive.{suffix}", "--format", "json").out)
    speeds = [row["speed_m_s"] for row in rows if row["quality"] == "ok"]
    assert len(speeds) > 3
    np.testing.assert_allclose(speeds, 12.0, rtol=2e-3)


def test_check_says_what_is_implausible_and_unused(place, tirelog):
    text(place / "drive.csv")
    tirelog("setup", "new", "drive.csv", "-o", "drive.toml")
    draft = (place / "drive.toml").read_text()
    (place / "drive.toml").write_text(
        draft.replace('surface = "outer"', 'surface = "inner"\nlateral_m = 0.03')
        .replace("reference_wavelength_nm = 1542.0", "reference_wavelength_nm = 1442.0")
        .replace("[channels.speed]", "[channels.other]")
        .replace('source = "speed"', 'source = "odd"')
        .replace('unit = "km/h"', 'unit = "m/s"')
    )
    told = tirelog("setup", "check", "drive.csv").ended(2)
    assert 'surface = "inner"; is it "outer"?' in told.out
    assert "implausible: channel CH2: wavelengths of 1542" in told.out
    assert "unused: 1 series of the log: speed" in told.out
    assert "unused: lateral_m of CH1: models have no width, no number depends on it" in told.out


def test_names_that_toml_would_trip_over(place, tirelog):
    names = ['say "hi"', "a = [1", "back\\slash", "# note", "\x1b[31mred", "öl", ""]
    header = "\t".join(["time", *names])
    rows = "".join(
        f"{k / 10}\t" + "\t".join(f"{(k * (j + 3)) % 11}" for j in range(len(names))) + "\n"
        for k in range(80)
    )
    (place / "l.csv").write_text(header + "\n" + rows)
    assert tirelog("setup", "new", "l.csv", "-o", "l.toml").status == 0
    setup = load_setup(place / "l.toml")
    assert len(setup.channels) == len(names)
    told = tirelog("info", "l.csv").ended(0)
    assert "\x1b" not in told.out + told.err
