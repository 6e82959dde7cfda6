"""Property: the commands `footprint` and `dissipation`."""

import numpy as np
import pytest

from tests.strain.conftest import make_drive
from tests.strain.strain_truth import Beam

SETUP = """[tire]
rolling_radius_m = 0.305
section_height_m = 0.018
width_m = 0.215
viscosity_Pa_s = 2000.0
static_footprint_length_m = 0.112
[conditions]
load_N = 3600.0
[channels.grating]
kind = "strain"
source = "grating"
unit = "strain"
[channels.pressure]
kind = "inflation_pressure"
source = "pressure"
unit = "bar"
[log]
time = "time_s"
"""


def log_of(knots, speeds, truth, **more):
    """The columns of a drive with this truth."""
    made = make_drive(knots, speeds, pulse=truth, height=1.0, drift=0.0, **more)
    return {"time_s": made.channel.axis.time(), "grating": made.values, "pressure": 2.2}


@pytest.fixture(scope="module")
def rolling():
    return log_of([0, 6, 9, 15], [8, 8, 14, 14], Beam(), seed=1900)


@pytest.mark.parametrize("speed", [0.4, 0.25])
def test_a_creeping_wheel_is_measured_or_said_to_be_too_slow(command, speed):
    truth = Beam(speeds=(speed, speed))
    columns = log_of([0, 60], [speed, speed], truth, seed=1902, rate_Hz=200.0)
    status, table, err = command(columns, SETUP, "footprint")
    assert status == 0
    assert "too few passages" not in err
    if speed > 0.3:
        inner = table.iloc[1:-1]
        assert (inner.quality == "ok").all()
        assert inner.length_m.median() == pytest.approx(2 * truth.half_length_m, rel=0.02)
    else:
        assert f"{len(table)} of {len(table)} passages are slower than 0.3 m/s" in err


def test_footprint(command, rolling):
    status, table, err = command(
        rolling, SETUP, "footprint", "--cutoff", "400Hz", "--plot", "page.svg"
    )
    assert status == 0
    assert table.columns[0] == "log"
    assert table.columns[-1] == "quality"
    assert (table["quality"] == "ok").mean() > 0.9
    assert table["length_m"].median() == pytest.approx(0.11, rel=0.005)
    assert (table["slip_onset_m"].notna() | table["slip_onset_reason"].notna()).all()
    assert "low-pass 400Hz = 400 Hz" in err
    assert "static footprint 112.0 mm" in err
    with open("page.svg") as page:
        assert "best estimate" in page.read()


@pytest.mark.parametrize(
    ("knots", "source"), [([0, 3, 6, 16], "s at rest"), ([0, 0.01, 0.02, 12], "far side")]
)
def test_a_cutoff_by_the_spectrum_at_rest(command, knots, source):
    """A hum above 280 Hz, stronger than what the passages have there (P2 4.3, a standing start)."""
    columns = log_of(knots, [0, 0, 8, 8], Beam(speeds=(0.5, 9.0)), seed=1907, noise_pm=0.4)
    hum = np.random.default_rng(1908).normal(0, 4e-6, columns["grating"].size)
    spectrum = np.fft.rfft(hum)
    spectrum[np.fft.rfftfreq(hum.size, 4e-4) < 280.0] = 0.0
    columns["grating"] = columns["grating"] + np.fft.irfft(spectrum, n=hum.size)
    tables = {}
    for cutoff in ("rest", "1kHz"):
        status, tables[cutoff], err = command(columns, SETUP, "footprint", "--cutoff", cutoff)
        assert status == 0
        if cutoff == "rest":
            assert source in err
            assert 180 < float(err.partition("low-pass ")[2].partition("Hz")[0]) < 330
    rows = tables["rest"].iloc[3:-1]
    wild = tables["1kHz"].iloc[3:-1]
    assert rows.length_d2_m.std() < 0.25 * wild.length_d2_m.std()


@pytest.mark.parametrize(("power", "saddle"), [(6.0, 0.0), (2.0, 2.2), (20.0, 0.0)])
def test_lengths_of_a_tire_whose_pressure_is_no_parabola(command, power, saddle):
    """Flat, saddled, a box: within the errors told, and without a trend over the speed."""
    truth = Beam(power=power, saddle=saddle)
    columns = log_of([0, 6, 8, 14, 17, 22], [7, 7, 12, 12, 21, 21], truth, seed=1905)
    status, table, _ = command(columns, SETUP, "footprint")
    rows = table[table.quality == "ok"]
    error = rows.length_m / (2 * truth.half_length_m) - 1
    told = np.hypot(rows.length_se_m, rows.length_form_se_m) / (2 * truth.half_length_m)
    assert status == 0
    assert len(rows) > 0.95 * len(table)
    assert np.mean(np.abs(error) < told) > 0.6
    assert np.mean(np.abs(error) < 2 * told) > 0.9
    assert told.median() < 0.15
    slow, fast = rows.speed_m_s < 9, rows.speed_m_s > 18
    assert abs(error[fast].median() - error[slow].median()) < 0.003


def test_dissipation_and_its_lines(command, rolling):
    status, table, err = command(rolling, SETUP, "dissipation", "--plot", "page.png")
    assert status == 0
    assert "section height x width" in err
    strip = {"power_W", "rolling_resistance_N", "rolling_resistance_coefficient"}
    assert {f"strip_{name}" for name in strip} <= set(table.columns)
    with open("page.png", "rb") as page:
        assert page.read(4) == b"\x89PNG"
    status, lines, _ = command(rolling, SETUP, "dissipation", "--fit")
    assert status == 0
    assert lines["quantity"].tolist() == ["dissipation_factor_1_m", "specific_power_m3_s2"]
