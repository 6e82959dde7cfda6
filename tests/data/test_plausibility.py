"""Faults: a setup or log that cannot be a tire's is refused with what it probably is."""

from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import Outcome
from tirelog.cli import run
from tirelog.data.setup import parse_setup
from tirelog.errors import SetupError

SETUP = """[tire]
unloaded_radius_m = 0.3126
rolling_radius_m = 0.305
width_m = 0.2
[conditions]
load_N = 3434.0
inflation_pressure_Pa = 2.2e5
[channels.strain_1]
kind = "fbg_strain"
source = "wavelength"
unit = "nm"
reference_wavelength_nm = 1550.0
surface = "outer"
[channels.pressure]
kind = "inflation_pressure"
source = "pressure"
unit = "Pa"
[channels.car]
kind = "vehicle_speed"
source = "car"
unit = "m/s"
[channels.load]
kind = "vertical_load"
source = "load"
unit = "N"
[log]
time = "time_s"
"""
RADIUS_M, SPEED_M_S, RATE_HZ = 0.305, 12.0, 1000.0


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A log of a grating that passes the patch once a turn at 12 m/s for 6 s."""
    time = np.arange(int(6 * RATE_HZ)) / RATE_HZ
    around = 2 * np.pi * RADIUS_M
    xi = (time * SPEED_M_S + 0.3) % around - 0.5 * around
    patch = 0.5 * (np.tanh((xi + 0.055) / 0.02) - np.tanh((xi - 0.055) / 0.02))
    wavelength = 1550.0 - patch + np.random.default_rng(1000).normal(0.0, 0.001, time.size)
    pressure, car, load = (np.full(time.size, value) for value in (2.2e5, SPEED_M_S, 3434.0))
    path = tmp_path_factory.mktemp("plausible")
    write(path / "log.csv", np.column_stack([time, wavelength, pressure, car, load]))
    return path


def write(path, table, first=0):
    """The log of a table, its columns from the `first` on."""
    names = ",".join(["time_s", "wavelength", "pressure", "car", "load"][first:])
    np.savetxt(path, table[:, first:], "%.6f", ",", header=names, comments="")
    return str(path)


@pytest.fixture
def command(folder, monkeypatch, capfd):
    """The outcome of a command on the log under a changed setup."""

    def call(*words, log="log.csv", old="", new=""):
        monkeypatch.chdir(folder)
        assert old in SETUP
        (folder / "log.toml").write_text(SETUP.replace(old, new, 1) if old else SETUP)
        capfd.readouterr()
        return Outcome(run([*words, log, "--setup", "log.toml"]), *capfd.readouterr())

    return call


def test_a_plausible_log_is_only_read(command):
    told = command("speed").ended(0)
    assert told.out.count(",ok\n") > 30
    assert "median" not in told.err


TWIN = """
temperature_channel = "twin"
thermal_expansion_1_K = 2e-05
[channels.twin]
kind = "fbg_temperature"
source = "wavelength"
unit = "nm"
reference_wavelength_nm = 1550.0
temperature_sensitivity_nm_K = 0.010
"""


@pytest.mark.parametrize("both", [False, True])
def test_a_wrong_twin_is_told_before_the_strain_that_it_corrects(command, both):
    """With a wrong unit of its twin the strain is nonsense that is none of its own."""
    unit = 'unit = "nm"\nreference_wavelength_nm = 1550.0\nsurface = "outer"'
    wrong = TWIN.replace('"nm"', '"pm"')
    own = unit.replace('"nm"', '"pm"') if both else unit
    said = "channel twin: wavelengths of 1.55 nm (median) against reference_wave"
    told = command("info", old=unit, new=own + wrong).ended(2, said, 'write unit = "nm"')
    assert "strain_1: wavelengths" not in told.err


def test_a_run_of_it_is_not_written(command, folder):
    wrong = command("ingest", "-o", "run.h5", old='unit = "nm"', new='unit = "pm"')
    wrong.refused('write unit = "nm"')
    assert not (folder / "run.h5").exists()


#: what is wrong: (setup's text, in place of it, what every message names). It is seen before the
#: wheel's passages are.
WRONG = {
    "pm, not nm": (
        'unit = "nm"', 'unit = "pm"', "wavelengths of 1.55 nm (median)",
        "against reference_wavelength_nm = 1550", 'write unit = "nm"',
    ),
    "um, not nm": (
        'unit = "nm"', 'unit = "um"', "wavelengths of 1.55e+06 nm",
        'is the unit nm? write unit = "nm"',
    ),
    "another column's reference": (
        "= 1550.0", "= 1510.0", "against reference_wavelength_nm = 1510",
        "name the grating's own column, or mend reference_wavelength_nm",
    ),
    "neighbour's reference": (
        "= 1550.0", "= 1530.0", "channel strain_1: a median of 0.0166 strain",
        "name the grating's own column, or mend reference_wavelength_nm",
    ),
    "load channel in kN": (
        'unit = "N"', 'unit = "kN"', "a median of 3.434e+06 N", 'write unit = "N"',
    ),
    "load channel of the wrong sign": (
        'unit = "N"', 'unit = "N"\nscale = -1.0', "a median of -3434 N", "scale = -1",
    ),
    "pressure in bar": (
        'unit = "Pa"', 'unit = "bar"', "channel pressure: a median of 2.2e+10 Pa",
        'allowed is 20000 to 2e+06 Pa; is the unit Pa? write unit = "Pa"',
    ),
    "pressure in mbar": (
        'unit = "Pa"', 'unit = "mbar"', "a median of 2.2e+07 Pa", 'write unit = "Pa"',
    ),
    "another column": (
        'source = "car"', 'source = "load"', "channel car: a median of 3434 m/s",
        "mend unit or source in the setup",
    ),
    "stamps in s as us": (
        "[log]", '[log]\ntime_unit = "us"',
        "a sampling rate of 1e+09 Hz; allowed is 100 to 1e+06 Hz", "are the stamps in s or ",
    ),
    "load in kg": ("load_N = 3434.0", "load_N = 350.0", "350 kg would be 3432"),
    "load in lbf": ("load_N = 3434.0", "load_N = 450.0", "450 lbf would be 2001"),
    "load in kN": ("load_N = 3434.0", "load_N = 3.434", "3.434 kN would be 3434"),
    "water in m": (
        "[conditions]", "[conditions]\nwater_depth_mm = 0.0008",
        "0.0008 m would be 0.8; write water_depth_mm = 0.8",
    ),
    "distance in m": (
        "[conditions]", "[conditions]\ndistance_km = 1.2e6",
        "1.2e+06 m would be 1200; write distance_km = 1200",
    ),
}  # fmt: skip
#: the same, and a factor of the log's stamps, 0 for none: what the wheel's passages show
DOUBTED = {
    "stamps in ms": ("", "", 1e3, 'time_unit = "ms"'),
    "stamps in us": ("", "", 1e6, 'time_unit = "us"'),
    "rate a hundredth": (
        '[log]\ntime = "time_s"', "[log]\nsampling_rate_Hz = 10.0", 0,
        "sampling_rate_Hz = 10: mend it",
    ),
    "rate a half, against the vehicle": (
        '[log]\ntime = "time_s"', "[log]\nsampling_rate_Hz = 500.0", 0,
        "its speed over the wheel's gives a rolling radius of 0.61 m, 2 times the rolling radius",
    ),
    "vehicle's m/s as km/h": (
        '"car"\nunit = "m/s"', '"car"\nunit = "km/h"', 1, 'write unit = "m/s"'
    ),
    "vehicle's km/h as m/s": (
        '"car"\nunit = "m/s"', '"car"\nunit = "m/s"\nscale = 3.6', 1, 'unit = "km/h"'
    ),
    "vehicle backwards": (
        '"car"\nunit = "m/s"', '"car"\nunit = "m/s"\nscale = -0.5', 1, "allowed is 0.93 to 1.07",
    ),
}  # fmt: skip


@pytest.fixture(scope="module")
def beam(tmp_path_factory):
    model = ["--carcass", "beam", "--set", "load_N=3434", "--set", "radius_m=0.305"]
    path = str(tmp_path_factory.mktemp("model") / "beam.toml")
    assert run(["model", "new", *model, "-o", path, "--quiet"]) == 0
    return path


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_a_tire_s_is_refused_by_every_command(case, command, beam):
    """Each kind of input that once gave rows `ok` or a verdict."""
    old, new, *named = WRONG[case]
    for words in (["speed"], ["info"], ["setup", "check"], ["compare", "--model", beam], ["slip"]):
        status, out, err = command(*words, old=old, new=new)
        assert (status, ",ok" in out, ",implausible" in out) == (2, False, False), words
        assert [part for part in named if part not in out + err] == [], words


@pytest.mark.parametrize("case", DOUBTED)
def test_what_its_passages_contradict_has_no_ok_row_and_no_verdict(
    case, command, folder, tmp_path, beam
):
    old, new, factor, named = DOUBTED[case]
    log = "log.csv"
    if factor != 1:
        table = np.loadtxt(folder / log, delimiter=",", skiprows=1)
        table[:, 0] *= factor
        log = write(tmp_path / "other.csv", table, int(factor == 0))
    status, out, err = command("speed", log=log, old=old, new=new)
    assert (status, named in err) == (0, True)
    rows = out.splitlines()[1:]
    assert len(rows) > 30
    assert all("implausible" in row for row in rows)
    for words in (["setup", "check"], ["compare", "--model", beam], ["slip"]):
        status, out, err = command(*words, log=log, old=old, new=new)
        assert (status, named in out + err, ",ok\n" in out) == (2, True, False), words


@pytest.mark.parametrize(
    ("case", "name"),
    [
        (WRONG["load in kg"], "load_N"),
        (DOUBTED["vehicle's m/s as km/h"], "vehicle_to_rolling"),
        (WRONG["neighbour's reference"], "fbg_strain"),
    ],
)
def test_who_is_sure_says_so(command, case, name):
    sure = f'unusual = ["{name}"]'
    err = command("speed", old=case[0], new=case[1]).err
    assert f"if it is right, write {sure} under [log]" in err
    Path("log.toml").write_text(SETUP.replace(case[0], case[1], 1) + f"{sure}\n")
    assert run(["speed", "log.csv", "--quiet"]) == 0


def test_an_unusual_quantity_has_a_known_name():
    with pytest.raises(SetupError, match=r"unusual: no quantity is called 'load'"):
        parse_setup(SETUP + 'unusual = ["load"]\n')


def test_a_cutoff_beyond_what_is_sampled(command):
    said = "--cutoff 4000Hz: channel strain_1 is sampled at 1000 Hz and holds nothing"
    command("footprint", "--cutoff", "4000Hz").refused(said, "above 500 Hz")
    command("footprint", "--cutoff", "400Hz").ended(0)


def test_a_calibrated_radius_goes_with_the_unloaded_one(command):
    calibrate, old = ("speed", "--calibrate-radius"), "rolling_radius_m = 0.305\n"
    command(*calibrate, old=old).ended(0)
    old = f"unloaded_radius_m = 0.3126\n{old}"
    told = command(*calibrate, old=old, new="unloaded_radius_m = 0.45\n").ended(
        2,
        "channel car: its speed over the wheel's gives a rolling radius of 0.305 m, 0.678",
        "the unloaded radius of the setup, 0.45 m; allowed is 0.89 to 1.05",
    )
    assert ",ok" not in told.out


def test_a_log_without_a_passage_says_so(command, folder):
    table = np.loadtxt(folder / "log.csv", delimiter=",", skiprows=1)
    table[:, 1] = 1550.0 + 1e-4 * np.random.default_rng(1001).normal(size=len(table))
    write(folder / "still.csv", table)
    said = "still.csv: strain_1: no passage of the patch in this log"
    command("speed", log="still.csv").ended(0, said)


def test_a_speed_below_zero_is_no_speed_of_a_model(folder, monkeypatch, capfd):
    monkeypatch.chdir(folder)
    assert run(["model", "new", "--preset", "P2", "-o", "beam.toml", "--quiet"]) == 0
    assert run(["model", "predict", "beam.toml", "--speed", "-5"]) == 2
    assert "--speed -5; 0 to 200 m/s is allowed" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("load", "pressure", "unloaded", "rolling", "width"),
    [
        (300.0, 1.0e6, 0.34, 0.335, 0.028),
        (50_000.0, 8.5e5, 0.52, 0.5, 0.3),
        (300_000.0, 1.6e6, 0.66, 0.6, 0.5),
        (8_000.0, 4e4, 0.6, 0.55, 0.5),
    ],
    ids=["bicycle", "truck", "aircraft", "farm"],
)
def test_tires_of_all_kinds_are_allowed(load, pressure, unloaded, rolling, width):
    values = {"3434.0": load, "width_m = 0.2": f"width_m = {width}", "2.2e5": pressure}
    text = SETUP
    for old, new in (values | {"0.3126": unloaded, "0.305": rolling}).items():
        text = text.replace(old, str(new))
    assert parse_setup(text).conditions.load_N == load
