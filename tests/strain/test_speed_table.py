"""Property: columns of the speed table, the channel that tells it, the rolling radius."""

import numpy as np
import pytest

from tests.strain.conftest import make_drive
from tirelog.data.recording import Channel, Recording, TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.products import tables_of
from tirelog.strain.passages.find import find_passages
from tirelog.strain.speed import calibrate_radius, speed_columns

SETUP = '[tire]\n{radius}\n[channels.grating]\nkind = "strain"\nsource = "a"\n'


def speed_tables(*channels, calibrate=False, radius="rolling_radius_m = 0.305"):
    """(columns of each channel, all remarks)."""
    setup = parse_setup(SETUP.format(radius=radius))
    log = Recording("log.csv", {c.name: c for c in channels}, setup)
    parts = list(tables_of(log, {"speed": {"calibrate_radius": calibrate}}))
    return [part.columns for part in parts], [r for part in parts for r in part.remarks]


def vehicle_speed(knots, speeds, *, rate_Hz=10.0, noise=0.0, seed=1):
    time = np.arange(int(knots[-1] * rate_Hz) + 1) / rate_Hz
    scatter = np.random.default_rng(seed).normal(0, noise, time.size)
    values = np.interp(time, knots, speeds) + scatter
    return Channel.of_array("car", "vehicle_speed", values, TimeAxis.uniform(time.size, rate_Hz))


def test_words_beside_a_standstill(radius_m):
    d = make_drive([0, 4, 7, 12, 16, 20], [12, 12, 0, 0, 10, 10], seed=1303)
    columns = speed_columns("log", find_passages(d.channel, radius_m))
    stop = int(np.searchsorted(d.time_s, 9.0))
    assert columns["quality"][stop - 1] == columns["quality"][stop] == "extrapolated;standstill"
    assert set(np.delete(columns["quality"], [0, stop - 1, stop, -1])) == {"ok"}
    off = np.abs(columns["speed_m_s"] - d.speed_m_s) / columns["speed_se_m_s"]
    assert off[stop - 1 : stop + 1].max() < 3


def test_several_gratings_of_one_wheel_agree():
    drives = [
        make_drive([0, 3, 8, 12], [8, 8, 20, 20], seed=1304 + k, start_turns=0.1 + k / 5, surface=s)
        for k, s in enumerate(("outer", "inner", "outer"))
    ]
    channels = [d.with_values(d.values, name=f"g{k}") for k, d in enumerate(drives)]
    first, *others = speed_tables(*channels)[0]
    assert [t["channel"][0] for t in (first, *others)] == ["g0", "g1", "g2"]
    for table in others:
        other = np.interp(table["time_s"], first["time_s"], first["speed_m_s"])
        assert np.sqrt(np.mean((table["speed_m_s"] - other)[2:-2] ** 2)) < 0.02


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_radial_acceleration_tells_the_speed(radius_m, sign):
    d = make_drive([0, 3, 8, 12], [8, 8, 20, 20], seed=1307, rate_Hz=10_000.0)
    speed = np.interp(d.channel.axis.time(), [0, 3, 8, 12], [8, 8, 20, 20])
    noise = np.random.default_rng(1307).normal(0, 3.0, speed.size)
    values = sign * (speed**2 / radius_m * (-d.values / 8e-4 - 1.0) + noise)
    [columns], _ = speed_tables(d.with_values(values, name="a", kind="radial_acceleration"))
    assert len(columns["time_s"]) == len(d.time_s)
    assert np.sqrt(np.mean((columns["speed_m_s"] - d.speed_m_s) ** 2)) < 0.03


def test_radius_is_calibrated_within_its_error(radius_m):
    knots, speeds = [0, 2, 10, 30, 35, 60], [6, 6, 20, 20, 12, 12]
    passages = [find_passages(make_drive(knots, speeds, seed=1308).channel, 0.32)]
    pulls = []
    for seed in range(1310, 1330):
        reference = vehicle_speed(knots, speeds, noise=0.2, seed=seed)
        found_m, se_m, _ = calibrate_radius(reference, passages)
        pulls.append((found_m - radius_m) / se_m)
    assert 0.5 < np.std(pulls) < 1.6
    assert np.abs(pulls).max() < 4


def test_lost_samples_of_the_reference_leave_their_turns_out(radius_m):
    knots, speeds = [0, 40], [15, 15]
    whole = vehicle_speed(knots, speeds, rate_Hz=100.0)
    values = whole.read().copy()
    values[1000:2000] = np.nan
    cut = Channel.of_array("car", "vehicle_speed", values, whole.axis)
    passages = [find_passages(make_drive(knots, speeds, seed=1309).channel, radius_m)]
    found_m, _, turns = calibrate_radius(cut, passages)
    assert found_m == pytest.approx(radius_m, abs=2e-5)
    assert turns < 0.8 * calibrate_radius(whole, passages)[2]
