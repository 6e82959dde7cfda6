"""Closed form: strain against pressure over ramps, stops and leaks (P2 Fig. 15)."""

import numpy as np
import pytest

from tirelog.data.recording import Channel, Recording, TimeAxis
from tirelog.data.setup import Setup, Tire
from tirelog.strain.inflation import inflation, inflation_of

SLOPE_1_Pa = 2.4e-9
RATE_HZ = 2500.0


def ramp(seed=1800, noise=6e-7, bend=0.0):
    """Strain and pressure: 1.7 to 2.3 bar in three ramps, two stops that leak 1000 Pa."""
    time = np.arange(0, 12, 1 / RATE_HZ)
    at_s = [0, 1, 5.5, 6.5, 8, 9, 11, 12]
    bar = [1.7, 1.7, 2.05, 2.04, 2.2, 2.19, 2.3, 2.3]
    pressure = 1e5 * np.interp(time, at_s, bar)
    over, rng = pressure - 1.7e5, np.random.default_rng(seed)
    strain = SLOPE_1_Pa * over * (1 + bend * over / 6e4) + rng.normal(0, noise, time.size)
    axis = TimeAxis.uniform(time.size, RATE_HZ)
    gauge = Channel.of_array("p", "inflation_pressure", pressure, axis, unit="Pa")
    return Channel.of_array("s", "strain", strain, axis), gauge


def test_slope_linearity_and_leaks():
    test, _ = inflation(*ramp())
    assert test["stretch"].tolist() == ["whole", *["stop", "ramp"] * 3, "stop"]
    assert test["strain_slope_1_Pa"][0] == pytest.approx(SLOPE_1_Pa, rel=1e-3)
    assert abs(test["strain_slope_1_Pa"][0] - SLOPE_1_Pa) < 4 * test["strain_slope_se_1_Pa"][0]
    assert test["nonlinearity"][0] < 0.005
    stops = test["leak"][test["stretch"] == "stop"]
    np.testing.assert_allclose(stops[1:3], SLOPE_1_Pa * 1000, rtol=0.15)
    np.testing.assert_array_equal(stops[[0, 3]], 0.0)


def test_a_leak_has_an_error_that_holds_and_a_tight_stop_none():
    """30 tests of a minute: 5 microstrain lost at one stop, nothing at the other two."""
    time = np.arange(0, 60, 1 / 100.0)
    strain = np.interp(time, [0, 8, 24, 34, 50, 60], [0.0, 0.0, 3e-4, 2.95e-4, 6e-4, 6e-4])
    axis = TimeAxis.uniform(time.size, 100.0)
    pulls = []
    for seed in range(1840, 1870):
        noisy = strain + np.random.default_rng(seed).normal(0, 1e-6, time.size)
        test, _ = inflation(Channel.of_array("s", "strain", noisy, axis), None)
        assert test["stretch"].tolist() == ["whole", *["stop", "ramp"] * 2, "stop"]
        leak, error = test["leak"][1::2], test["leak_se"][1::2]
        assert leak[[0, 2]].tolist() == [0.0, 0.0]
        pulls.append((leak[1] - 5e-6) / error[1])
    assert abs(np.mean(pulls)) < 3.0 / np.sqrt(30.0)
    assert 0.7 < np.sqrt(np.mean(np.square(pulls))) < 1.4


def test_without_a_channel_rates_are_known():
    rates, _ = inflation(ramp()[0], None)
    assert np.isnan(rates["strain_slope_1_Pa"]).all()
    assert rates["strain_rate_1_s"][2] == pytest.approx(SLOPE_1_Pa * 0.35e5 / 4.5, rel=0.02)
    assert 0.0 < rates["nonlinearity"][2] < 0.03  # of the ramp on time


def test_lost_samples_do_no_harm_and_a_bent_line_is_called_bent():
    strain, pressure = ramp(bend=0.3)
    values = strain.read().copy()
    values[5000:5600] = np.nan
    bent, _ = inflation(Channel.of_array("s", "strain", values, strain.axis), pressure)
    whole, _ = inflation(strain, pressure)
    assert bent["strain_slope_1_Pa"][0] == pytest.approx(whole["strain_slope_1_Pa"][0], rel=5e-3)
    assert bent["nonlinearity"][0] > 0.03


def test_the_table_says_what_leaked():
    strain, pressure = ramp()
    setup = Setup(Tire(rolling_radius_m=0.3, static_footprint_length_m=0.126))
    (table,) = inflation_of(Recording("i.csv", {"s": strain, "p": pressure}, setup))
    assert table.columns["quality"].tolist().count("leak") == 2
    assert any("126.0 mm" in remark for remark in table.remarks)
    assert any("microstrain/bar" in remark for remark in table.remarks)
