"""Faults: `speed` on logs that lack what it needs; and what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from tests.strain.conftest import make_drive
from tirelog.strain.dissipation import dissipation
from tirelog.strain.passages.find import find_passages
from tirelog.strain.speed import speed_columns
from tirelog.vocabulary.quality import Quality, having

SETUP = """[tire]
unloaded_radius_m = 0.33
[channels.grating]
kind = "strain"
source = "grating"
unit = "strain"
[channels.car]
kind = "vehicle_speed"
source = "car"
unit = "km/h"
[log]
time = "time_s"
"""
CALIBRATE = "--calibrate-radius"


@pytest.fixture
def speed(command):
    """(status, table or None, standard error) of `speed` on a drive at this speed."""

    def call(speed_m_s, seconds, *arguments, setup=SETUP, reference_s=None, **columns):
        d = make_drive([0, seconds], [speed_m_s, speed_m_s], seed=1401)
        time = d.channel.axis.time()
        car = np.where(time < (reference_s or np.inf), 3.6 * speed_m_s, np.nan)
        columns = {"time_s": time, "grating": d.values, "car": car} | columns
        return command(columns, setup, "speed", *arguments)

    return call


def test_the_radius_is_calibrated_or_the_unloaded_one_is_said(speed):
    status, table, err = speed(12.0, 8, CALIBRATE)
    assert status == 0
    assert "note: log.csv: rolling radius 0.3050" in err
    np.testing.assert_allclose(table["speed_m_s"], 12.0, atol=2e-3)
    status, table, err = speed(12.0, 8)
    assert status == 0
    assert "unloaded radius 0.33 m is used" in err
    np.testing.assert_allclose(table["speed_m_s"], 12.0 * 0.33 / 0.305, atol=2e-3)
    assert "unloaded radius" not in speed(12.0, 8, "--quiet")[2]


@pytest.mark.parametrize(
    ("turns", "rows", "known"), [(0.3, 0, 0), (0.9, 1, 0), (1.9, 2, 0), (2.9, 3, 3), (3.9, 4, 4)]
)
def test_few_revolutions(speed, radius_m, turns, rows, known):
    status, table, _ = speed(10.0, turns * 2 * np.pi * radius_m / 10)
    assert status == 0
    assert len(table) == rows
    assert table["speed_m_s"].notna().sum() == known
    assert table["time_s"].notna().all()
    assert (table["quality"][[0, rows - 1] if rows else []] == "edge_of_log").all()


@pytest.mark.parametrize("error", [np.inf, 1e100, 40.0])
def test_an_error_without_bounds_is_blank_and_said(radius_m, error):
    d = make_drive([0, 8], [12, 12], seed=1311)
    found = find_passages(d.channel, radius_m)
    omega_se = found.omega_se_rad_s.copy()
    omega_se[5] = error / radius_m
    wild = replace(found, omega_se_rad_s=omega_se)
    columns = speed_columns("log", wild)
    assert np.flatnonzero(np.isnan(columns["speed_se_m_s"])).tolist() == [5]
    assert np.flatnonzero(columns["quality"] == "error_unknown").tolist() == [5]
    energy = dissipation(d.channel, wild, None, wild.quality)
    unknown = having(energy.quality, Quality.ERROR_UNKNOWN)
    if error > 1e3:  # of the factor
        assert np.isnan(energy.factor_se_1_m[5])
        assert unknown[5]
    assert not np.delete(unknown, 5).any()
