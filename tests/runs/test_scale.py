"""Closed form: what is recorded in V, counts or pF becomes a channel's unit, and that SI."""

import h5py
import numpy as np
import pytest

from tirelog.data.setup import parse_setup
from tirelog.runs.ingest import open_recording, write_run

RAW = np.round(np.sin(np.arange(500) * 0.37), 4)
#: keys of a channel -> (SI value of what is recorded, SI unit)
KEYS = {
    'kind = "inflation_pressure"\nunit = "bar"\nscale = 0.625\noffset = 2.0': (
        lambda x: (0.625 * x + 2.0) * 1e5,
        "Pa",
    ),
    'kind = "temperature"\nunit = "degC"\nscale = 100.0\noffset = -40.0': (
        lambda x: 100.0 * x - 40.0 + 273.15,
        "K",
    ),
    'kind = "strain"\nunit = "microstrain"\nscale = -1250.0': (lambda x: -1250.0e-6 * x, ""),
    'kind = "strain"\nscale = 2e-3\noffset = 1e-4': (lambda x: 2e-3 * x + 1e-4, ""),
    'kind = "radial_acceleration"\nunit = "g"\nscale = 0.0078125': (
        lambda x: 0.0078125 * x * 9.80665,
        "m/s^2",
    ),
    'kind = "vertical_load"\nunit = "kN"\nscale = 2.0\noffset = 3.4': (
        lambda x: (2.0 * x + 3.4) * 1e3,
        "N",
    ),
    'kind = "signal"\nunit = "mV"': (lambda x: 1e-3 * x, "V"),
    'kind = "signal"\nunit = "pF"\nscale = 10.0\noffset = 95.0': (lambda x: 10.0 * x + 95.0, "pF"),
    'kind = "signal"': (lambda x: x, "1"),
    'kind = "fbg_strain"\nunit = "nm"\nreference_wavelength_nm = 1550.0\nstrain_gain = 1.25\n'
    "scale = 0.5\noffset = 1550.0": (lambda x: 1.25 * 0.5 * x / 1550.0, ""),
    'kind = "fbg_temperature"\nunit = "pm"\nreference_wavelength_nm = 1542.0\n'
    "temperature_sensitivity_nm_K = 0.01\nscale = 500.0\noffset = 1542000.0": (
        lambda x: 0.5 * x / 0.01,
        "K",
    ),
}


def setup_of(keys):
    return parse_setup(f'[channels.x]\n{keys}\nsource = "x"\nsampling_rate_Hz = 100.0\n')


def text_log(path, header="x,y"):
    path.write_text(header + "\n" + "".join(f"{x:.4f},0.5\n" for x in RAW))
    return path


@pytest.mark.parametrize("keys", KEYS)
def test_scale_and_offset_give_the_unit_and_that_si(keys, tmp_path):
    value, unit = KEYS[keys]
    log, run = text_log(tmp_path / "log.csv"), tmp_path / "run.h5"
    wanted = np.where(RAW == 0.0, np.nan, value(RAW)) if "fbg" in keys else value(RAW)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["x"] = RAW
    write_run(str(log), setup_of(keys), run)
    for path in (log, tmp_path / "log.h5", run):
        with open_recording(str(path), setup_of(keys)) as recording:
            channel = recording.channels["x"]
            got = channel.read()
            assert channel.unit == unit
        # gratings also lose what is not above 0
        there = np.isfinite(got)
        assert there.sum() > 200
        np.testing.assert_allclose(got[there], wanted[there], rtol=1e-12, atol=1e-12)


def test_a_grating_is_found_by_the_wavelength_that_the_scale_gives(tmp_path):
    """Raw peaks are 1552 - wavelength; the window is the wavelength's own."""
    log = tmp_path / "peaks.csv"
    rows = (f"{i / 100:.2f}\t{2.0 + x / 1000:.4f}" for i, x in enumerate(RAW))
    log.write_text("".join(row + "\t9.5000" * (i % 3 > 0) + "\n" for i, row in enumerate(rows)))
    keys = (
        'kind = "fbg_strain"\nunit = "nm"\nreference_wavelength_nm = 1550.0\nstrain_gain = 1.0\n'
        "scale = -1.0\noffset = 1552.0\nwindow_nm = [1549.0, 1551.0]"
    )
    setup = parse_setup(f'[channels.x]\n{keys}\nsource = "x"\n[log]\ntime = "#1"\n')
    with open_recording(str(log), setup) as recording:
        got = recording.channels["x"].read()
    np.testing.assert_allclose(got, -np.round(RAW / 1000, 4) / 1550.0, atol=2e-7)


def test_the_header_s_unit_is_that_of_what_is_recorded(tmp_path):
    log = text_log(tmp_path / "log.csv", "x [V],y")
    keys = 'kind = "vertical_load"\nscale = 1e4\noffset = 4e4'
    with open_recording(str(log), setup_of(keys + '\nunit = "N"')) as recording:
        assert recording.remarks == ()
    kilo = text_log(tmp_path / "kilo.csv", "x [kN],y")
    with open_recording(str(kilo), setup_of(keys)) as recording:
        assert "taken to give 'N', not the file's 'kN'" in recording.remarks[0]


@pytest.mark.parametrize(("header", "unit"), [("[pF]", "pF"), ("[mV]", "V"), ("", "1")])
def test_a_signal_takes_any_unit_of_the_header(header, unit, tmp_path):
    log = text_log(tmp_path / "log.csv", f"x {header},y")
    with open_recording(str(log), setup_of('kind = "signal"')) as recording:
        assert recording.channels["x"].unit == unit
        assert recording.remarks == ()


def test_a_file_s_own_scale_comes_before_the_setup_s(tmp_path):
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["x"] = np.arange(100, dtype=np.int16)
        file["x"].attrs["scale_factor"] = 0.5
    keys = 'kind = "signal"\nunit = "V"\nscale = 10.0\noffset = 1.0'
    with open_recording(str(tmp_path / "log.h5"), setup_of(keys)) as recording:
        np.testing.assert_allclose(recording.channels["x"].read(), 5.0 * np.arange(100) + 1.0)
        assert "scale of its own" in recording.remarks[0]
