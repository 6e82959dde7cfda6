"""Faults: `tirelog speed` on logs without a radius, with channels that tell no speed, few
revolutions, or nothing in the strain; and its radius option.
"""

from __future__ import annotations

import numpy as np
import pytest

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


def columns_of(d, speed_m_s):
    time = d.channel.axis.time()
    return {"time_s": time, "grating": d.values, "car": np.full(time.size, 3.6 * speed_m_s)}


def test_calibrate_radius(drive, command):
    d = drive([0, 8], [12, 12], seed=1401)
    status, table, err = command(columns_of(d, 12.0), SETUP, "speed", "--calibrate-radius")
    assert status == 0
    assert "note: log.csv: rolling radius 0.3050" in err
    np.testing.assert_allclose(table["speed_m_s"], 12.0, atol=2e-3)


def test_without_it_the_unloaded_radius_is_said(drive, command):
    d = drive([0, 8], [12, 12], seed=1401)
    status, table, err = command(columns_of(d, 12.0), SETUP, "speed")
    assert status == 0
    assert "unloaded radius 0.33 m is used" in err
    np.testing.assert_allclose(table["speed_m_s"], 12.0 * 0.33 / 0.305, atol=2e-3)
    assert "unloaded radius" not in command(columns_of(d, 12.0), SETUP, "speed", "--quiet")[2]


@pytest.mark.parametrize(
    ("turns", "rows", "known"), [(0.3, 0, 0), (0.9, 1, 0), (1.9, 2, 0), (2.9, 3, 3), (3.9, 4, 4)]
)
def test_few_revolutions(drive, command, radius_m, turns, rows, known):
    d = drive([0, turns * 2 * np.pi * radius_m / 10], [10, 10], seed=1402)
    status, table, _ = command(columns_of(d, 10.0), SETUP, "speed")
    assert status == 0
    assert len(table) == rows
    assert table["speed_m_s"].notna().sum() == known
    assert table["time_s"].notna().all()
    assert (table["quality"][[0, rows - 1] if rows else []] == "edge_of_log").all()


@pytest.mark.parametrize("fill", [np.nan, 0.0])
def test_an_empty_or_constant_channel_gives_an_empty_table(drive, command, fill):
    d = drive([0, 2], [10, 10], seed=1403)
    status, table, err = command({**columns_of(d, 10.0), "grating": fill}, SETUP, "speed")
    assert status == 0
    assert len(table) == 0
    assert "Traceback" not in err


def test_nothing_that_tells_the_speed(drive, command):
    d = drive([0, 2], [10, 10], seed=1404)
    setup = SETUP.replace('kind = "strain"', 'kind = "temperature"').replace(
        'unit = "strain"', 'unit = "K"'
    )
    status, table, err = command(columns_of(d, 10.0), setup, "speed")
    assert status == 2
    assert table is None
    assert (
        "no channel tells the speed; allowed are strain, wheel_encoder and radial_acceleration"
        in err
    )
