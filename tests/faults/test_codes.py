"""Faults: error codes beside the sensor, and values beyond reason, move no number."""

import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

import tirelog
from tirelog.data.recording import BLOCK_SAMPLES, Channel, TimeAxis
from tirelog.dsp.filters import sliding_mean
from tirelog.runs.in_memory import without_codes, without_spikes
from tirelog.strain.passages.passage_flags import may_have_stopped
from tirelog.vocabulary.quality import Quality

SAMPLES = Path(__file__).parents[2] / "sample_data"


def slips(folder, spoil):
    """(the log, slip of it, slip of encoder.h5), the log with a vehicle's speed that was spoilt."""
    hit, setup = folder / "encoder.h5", SAMPLES / "encoder.toml"
    shutil.copy(SAMPLES / "encoder.h5", hit)
    with h5py.File(hit, "r+") as file:
        values = file["vehicle/speed"][()]
        spoil(values)
        file["vehicle/speed"][...] = values
    return hit, *(tirelog.slip(log, setup=setup) for log in (hit, SAMPLES / "encoder.h5"))


@pytest.mark.parametrize(("code", "many"), [(9999.0, 30), (-99.0, 30), (65535.0, 1)])
def test_codes_in_the_vehicle_s_speed_move_no_slip(tmp_path, code, many):
    def spoil(values):
        values[np.random.default_rng(7301).choice(values.size, many, replace=False)] = code

    hit, own, clean = slips(tmp_path, spoil)
    with tirelog.open_log(hit, SAMPLES / "encoder.toml") as log:
        said = f"vehicle_speed: {many} samples far off those around them were left"
        assert said in log.remarks[0]
    off = np.abs(own.slip - clean.slip) / clean.slip_se
    assert np.nanmax(off) < 2.0  # two samples of the thirteen of a turn are lost
    assert (own.quality == clean.quality).all()


def test_spikes_in_the_vehicle_s_speed_move_no_slip(tmp_path):
    def spoil(values):
        random = np.random.default_rng(7302)
        hits = random.choice(values.size - 1, 30, replace=False)
        values[hits] *= random.uniform(0.0, 3.0, 30)
        values[hits[:5] + 1] = np.nan  # lost beside the spike

    _, own, clean = slips(tmp_path, spoil)
    # ten usual changes of white noise are 9.5 sigma, and of a mean of 13 samples 2.6 of its errors
    assert np.nanmax(np.abs(own.slip - clean.slip) / clean.slip_se) < 2.7
    assert np.mean(own.quality == "ok") > 0.98


def slow(values):
    """What is left of a vehicle's speed at 100 Hz."""
    axis = TimeAxis.uniform(values.size, 100.0)
    channel = Channel.of_array("v", "vehicle_speed", values, axis)
    return without_codes(channel, channel)[0].read()


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_car_that_starts_after_a_long_stop_is_no_spike(noise):
    random, n = np.random.default_rng(7303), 200_000
    ramp = np.clip((np.arange(n) - 0.98 * n) / 1000.0, 0.0, 12.0)
    values = ramp + np.where(ramp > 0.0, 0.05, noise) * random.standard_normal(n)
    assert np.isfinite(slow(values)).all()


@pytest.mark.parametrize(
    "values",
    [
        np.repeat([2000.0, 3500.0, 3505.0, 3510.0, 5000.0], 4000),
        np.round(2.2e5 + 2e3 * np.sin(np.arange(3600) / 300), -3),
        np.interp(np.arange(36_000) / 100, np.arange(361), 10.0 + np.sin(1e4 * np.arange(361))),
        np.where(np.arange(3600) < 3000, 2.2e5, 1e5 * np.exp((3000 - np.arange(3600)) / 5)),
    ],
    ids=["set", "coarse steps", "resampled", "air lost at once"],
)
def test_steps_and_kinks_are_neither_codes_nor_spikes(values):
    assert np.isfinite(slow(values)).all()


@pytest.mark.parametrize("border", [BLOCK_SAMPLES, 2 * BLOCK_SAMPLES])
def test_codes_and_spikes_at_a_border_of_blocks_are_lost(border):
    random = np.random.default_rng(7304)
    values = 20.0 + 0.01 * random.standard_normal(3 * BLOCK_SAMPLES)
    for place in range(-3, 4):
        hit = values.copy()
        hit[border + place] = 21.0
        hit[border + 100 + place : border + 130 + place] = 655.35
        lost = np.flatnonzero(np.isnan(slow(hit)))
        assert {border + place, *range(border + 100 + place, border + 130 + place)} <= {*lost}
        assert lost.size == 31


@pytest.mark.parametrize("size", [20, 25, 3 * BLOCK_SAMPLES + 30])
def test_noise_that_fills_no_cell_has_no_spikes(size):
    for seed in range(7310, 7330):
        values = 2.4e5 + 1e3 * np.random.default_rng(seed).standard_normal(size)
        assert np.isfinite(slow(values)).all()


def strain(values, rate_Hz, twin=None):
    """The strain that is left of `values`, of which a `twin` was taken off."""
    axis = TimeAxis.uniform(values.size, rate_Hz)
    recorded = Channel.of_array("s", "fbg_strain", values, axis)
    if twin is None:
        return without_spikes(recorded)
    taken = Channel.of_array("s", "fbg_strain", values - twin, axis)
    return without_spikes(replace(taken, recorded=recorded))


@pytest.mark.parametrize("twin", [False, True])
@pytest.mark.parametrize("disturbed", ["codes", "burst"])
def test_a_limit_is_seen_beside_codes_and_bursts(disturbed, twin):
    random = np.random.default_rng(7305)
    turn = (np.arange(50_000) * 5 / 2500.0) % 1.0 - 0.5
    values = -600e-6 * np.exp(-((turn / 0.03) ** 2)) + 1e-6 * random.standard_normal(turn.size)
    values = np.maximum(values, -300e-6)
    if disturbed == "codes":
        values[20_000:20_040] = -9.0
    else:
        values[20_100:20_104] = 0.1
    other = 1e-6 * random.standard_normal(turn.size) if twin else None
    flags = [one for one in strain(values, 2500.0, other).flags if one[2] is Quality.CLIPPED]
    assert len(flags) > 90  # of a hundred passages


@pytest.mark.parametrize("rate_Hz", [100.0, 2500.0])
def test_a_code_behind_a_code_is_lost(rate_Hz):
    values = 1e-5 * np.random.default_rng(7306).standard_normal(4000)
    values[::400], values[200::400] = 9.0, 0.05
    assert np.nanmax(strain(values, rate_Hz).read()) < 1e-3


def test_very_many_codes_share_their_flags():
    values = np.random.default_rng(7307).standard_normal(400_000)
    values[::3] = 9999.0
    left = strain(values, 2500.0)
    assert np.flatnonzero(np.isnan(left.read())).size == values[::3].size
    assert len(left.flags) < 10


def test_what_is_infinite_is_lost(tmp_path):
    values = np.arange(400.0)
    values[[7, 80]] = np.inf, -np.inf
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["x"] = values
        file["x"].attrs["sampling_rate_Hz"] = 100.0
    (tmp_path / "log.toml").write_text(
        '[tire]\nrolling_radius_m = 0.3\n[channels.x]\nkind = "signal"\nsource = "/x"\n'
    )
    with tirelog.open_log(tmp_path / "log.h5") as log:
        read = log.channels["x"].read()
    assert np.flatnonzero(np.isnan(read)).tolist() == [7, 80]
    assert np.isfinite(np.delete(read, [7, 80])).all()


quiet = pytest.mark.filterwarnings("error::RuntimeWarning")


@quiet
def test_a_clock_beyond_all_time():
    axis = TimeAxis(10, 1.0, np.zeros(1, np.int64), np.array([1e308]), np.array([1e308]))
    assert axis.at(9.0) == np.inf
    still = TimeAxis(10, 1.0, np.zeros(1, np.int64), np.zeros(1), np.zeros(1))
    assert still.index(np.array([1.0])) == 9.0


@quiet
def test_stamps_that_repeat_are_no_stop():
    assert may_have_stopped(np.zeros(9)).tolist() == [False] * 8
    assert not may_have_stopped(0.125 * np.arange(12.0)).any()  # exactly one speed
    assert may_have_stopped(np.repeat([0.0, 1.0, 1.5], 4)).shape == (11,)


@quiet
def test_a_mean_of_values_beyond_all_sums():
    assert not np.isfinite(sliding_mean(np.full(9, 1e308), 3)).any()
    np.testing.assert_allclose(sliding_mean(np.full(9, 1e300), 3), 1e300)
