"""Property: the columns of the speed table, which channel tells the speed, and the rolling radius
against a vehicle's speed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tirelog.data.recording import Channel, Recording, TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.errors import UsageError
from tirelog.products import tables_of
from tirelog.strain.dissipation import dissipation
from tirelog.strain.passages.find import find_passages
from tirelog.strain.speed import calibrate_radius, speed_columns
from tirelog.vocabulary.columns import TABLES
from tirelog.vocabulary.quality import Quality, having
from tirelog.wheel.rolling import Odometer

SETUP = '[tire]\n{radius}\n[channels.grating]\nkind = "strain"\nsource = "a"\n'


def recording(*channels, radius="rolling_radius_m = 0.305"):
    return Recording(
        "log.csv", {c.name: c for c in channels}, parse_setup(SETUP.format(radius=radius))
    )


def speed_tables(recording, calibrate=False):
    """(columns of each channel, all remarks)."""
    parts = list(tables_of(recording, {"speed": {"calibrate_radius": calibrate}}))
    return [part.columns for part in parts], [r for part in parts for r in part.remarks]


def vehicle_speed(knots, speeds, *, rate_Hz=10.0, noise=0.0, seed=1, factor=1.0):
    time = np.arange(int(knots[-1] * rate_Hz) + 1) / rate_Hz
    values = factor * np.interp(time, knots, speeds) + np.random.default_rng(seed).normal(
        0, noise, time.size
    )
    return Channel.of_array("car", "vehicle_speed", values, TimeAxis.uniform(time.size, rate_Hz))


def test_columns_are_those_of_the_contract(drive):
    d = drive([0, 5], [10, 12], seed=1301)
    [columns], remarks = speed_tables(recording(d.channel))
    assert tuple(columns) == TABLES["speed"]
    assert {len(np.atleast_1d(v)) for v in columns.values()} == {len(d.time_s)}
    assert remarks == []
    assert columns["revolution"].tolist() == list(range(len(d.time_s)))
    assert columns["quality"][0] == columns["quality"][-1] == "edge_of_log"
    assert set(columns["quality"][1:-1]) == {"ok"}
    np.testing.assert_allclose(
        columns["period_s"][1:-1], 0.5 * (columns["time_s"][2:] - columns["time_s"][:-2])
    )


def test_words_beside_a_standstill(drive, radius_m):
    d = drive([0, 4, 7, 12, 16, 20], [12, 12, 0, 0, 10, 10], seed=1303)
    columns = speed_columns("log", find_passages(d.channel, radius_m))
    stop = int(np.searchsorted(d.time_s, 9.0))
    assert columns["quality"][stop - 1] == columns["quality"][stop] == "extrapolated;standstill"
    assert set(np.delete(columns["quality"], [0, stop - 1, stop, -1])) == {"ok"}
    near = slice(stop - 1, stop + 1)
    off = np.abs(columns["speed_m_s"] - d.speed_m_s)[near]
    assert (off < 3 * columns["speed_se_m_s"][near]).all()


def test_several_gratings_of_one_wheel_agree(drive):
    kinds = [
        drive([0, 3, 8, 12], [8, 8, 20, 20], seed=1304 + k, start_turns=0.1 + 0.2 * k, surface=s)
        for k, s in enumerate(("outer", "inner", "outer"))
    ]
    channels = [
        Channel.of_array(f"g{k}", "strain", d.values, d.channel.axis, surface=d.channel.surface)
        for k, d in enumerate(kinds)
    ]
    tables = list(speed_tables(recording(*channels))[0])
    assert [t["channel"][0] for t in tables] == ["g0", "g1", "g2"]
    for table in tables[1:]:
        other = np.interp(table["time_s"], tables[0]["time_s"], tables[0]["speed_m_s"])
        assert np.sqrt(np.mean((table["speed_m_s"] - other)[2:-2] ** 2)) < 0.02


def test_radial_acceleration_tells_the_speed(drive, radius_m):
    d = drive([0, 3, 8, 12], [8, 8, 20, 20], seed=1307, rate_Hz=10_000.0)
    speed = np.interp(d.channel.axis.time(), [0, 3, 8, 12], [8, 8, 20, 20])
    level = speed**2 / radius_m
    shape = -d.values / 8e-4
    values = level * (shape - 1.0) + np.random.default_rng(1307).normal(0, 3.0, speed.size)
    channel = Channel.of_array("a", "radial_acceleration", values, d.channel.axis)
    for sign in (1.0, -1.0):
        turned = Channel.of_array("a", "radial_acceleration", sign * values, d.channel.axis)
        [columns], _ = speed_tables(recording(turned))
        assert len(columns["time_s"]) == len(d.time_s)
        assert np.sqrt(np.mean((columns["speed_m_s"] - d.speed_m_s) ** 2)) < 0.03
    assert channel.kind == "radial_acceleration"


def test_distance_of_a_ramp_is_exact():
    meter = Odometer.of(vehicle_speed([0, 10], [0, 20], rate_Hz=7.0))
    distance, holes = meter.at(np.array([0.0, 1.23, 5.0, 9.9]))
    np.testing.assert_allclose(distance, np.array([0.0, 1.23, 5.0, 9.9]) ** 2, atol=1e-9)
    assert holes.tolist() == [0, 0, 0, 0]
    assert np.isnan(meter.at(np.array([11.0]))[0]).all()


def test_radius_is_calibrated_within_its_error(drive, radius_m):
    knots, speeds = [0, 2, 10, 30, 35, 60], [6, 6, 20, 20, 12, 12]
    d = drive(knots, speeds, seed=1308)
    ratios = []
    for seed in range(1310, 1330):
        reference = vehicle_speed(knots, speeds, noise=0.2, seed=seed)
        found_m, se_m, _ = calibrate_radius(reference, [find_passages(d.channel, 0.32)])
        ratios.append((found_m - radius_m) / se_m)
    assert 0.5 < np.std(ratios) < 1.6
    assert np.abs(ratios).max() < 4


def test_calibrated_speeds_and_their_errors(drive):
    knots, speeds = [0, 40], [15, 15]
    d = drive(knots, speeds, seed=1309)
    logs = recording(
        d.channel, vehicle_speed(knots, speeds, noise=0.1), radius="unloaded_radius_m = 0.33"
    )
    [columns], remarks = speed_tables(logs, calibrate=True)
    assert "calibrated against car over" in remarks[0]
    assert np.abs(columns["speed_m_s"] - 15.0).max() < 4 * columns["speed_se_m_s"].max()
    assert columns["speed_se_m_s"].min() > 1e-3


def test_lost_samples_of_the_reference_leave_their_turns_out(drive, radius_m):
    knots, speeds = [0, 40], [15, 15]
    d = drive(knots, speeds, seed=1309)
    whole = vehicle_speed(knots, speeds, rate_Hz=100.0)
    values = whole.read().copy()
    values[1000:2000] = np.nan
    cut = Channel.of_array("car", "vehicle_speed", values, whole.axis)
    passages = [find_passages(d.channel, radius_m)]
    found_m, _, turns = calibrate_radius(cut, passages)
    assert found_m == pytest.approx(radius_m, abs=2e-5)
    assert turns < 0.8 * calibrate_radius(whole, passages)[2]


def test_nothing_to_calibrate_against(drive):
    d = drive([0, 10], [10, 10], seed=1302)
    with pytest.raises(UsageError, match="no vehicle speed"):
        speed_tables(recording(d.channel), calibrate=True)
    with pytest.raises(UsageError, match="fewer than 10 whole turns"):
        speed_tables(recording(d.channel, vehicle_speed([0, 1], [10, 10])), calibrate=True)


def test_a_wrong_surface_of_the_second_channel_is_said_before_the_first_one_s_rows(drive):
    d = drive([0, 8], [12, 12], seed=1310)
    second = replace(d.with_values(-d.values), name="second")
    log = recording(d.channel, second)
    for name in ("speed", "footprint", "dissipation"):
        with pytest.raises(UsageError, match="channel second shows a maximum"):
            next(tables_of(log, {name: {}}, refused_first=True))


@pytest.mark.parametrize("error", [np.inf, 1e100, 40.0])
def test_an_error_without_bounds_is_blank_and_said(drive, radius_m, error):
    d = drive([0, 8], [12, 12], seed=1311)
    found = find_passages(d.channel, radius_m)
    omega_se = found.omega_se_rad_s.copy()
    omega_se[5] = error / radius_m
    wild = replace(found, omega_se_rad_s=omega_se)
    columns = speed_columns("log", wild)
    assert np.flatnonzero(np.isnan(columns["speed_se_m_s"])).tolist() == [5]
    assert np.flatnonzero(columns["quality"] == "error_unknown").tolist() == [5]
    energy = dissipation(d.channel, wild, None, wild.quality)
    if error > 1e3:  # of the factor
        assert np.isnan(energy.factor_se_1_m[5])
        assert having(energy.quality, Quality.ERROR_UNKNOWN)[5]
    assert not having(np.delete(energy.quality, 5), Quality.ERROR_UNKNOWN).any()
