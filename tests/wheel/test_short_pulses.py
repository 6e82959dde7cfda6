"""Property: pulses of any share of a step tell the speed; clocks that run wrong are told."""

import h5py
import numpy as np
import pytest

from tirelog.data.recording import Channel, TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.runs.ingest import open_recording
from tirelog.wheel.angle import wheel_angle
from tirelog.wheel.phase_shift import encoder_speed
from tirelog.wheel.rolling import off_clock

RATE_HZ, RADIUS_M = 10_000.0, 0.3


def turns(ramp):
    """The wheel's turns at each sample, shape (n,): at 20 per second, or from 8 to 25."""
    time = np.arange(60_000) / RATE_HZ
    return 8.0 * time + 0.5 * 17.0 / 6.0 * time**2 if ramp else 20.0 * time


@pytest.mark.parametrize("ramp", [False, True])
@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("steps", [1, 6])
@pytest.mark.parametrize("duty", [0.02, 0.06, 0.2, 0.5, 0.8, 0.94, 0.98])
def test_pulses_tell_the_speed(tmp_path, duty, steps, noise, ramp):
    if steps * 25 / RATE_HZ > 0.4 * min(duty, 1 - duty):
        pytest.skip("a pulse of fewer than three samples")
    angle = turns(ramp)
    signal = 5.0 * ((steps * angle + 0.3) % 1.0 < duty)
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["tach"] = signal + noise * np.random.default_rng(2).standard_normal(signal.size)
        file.attrs["fs"] = RATE_HZ
    setup = parse_setup(
        f'[tire]\nrolling_radius_m = {RADIUS_M}\n[channels.e]\nkind = "wheel_encoder"\n'
        f'source = "tach"\nunit = "V"\nsteps = {steps}\n',
        "log.toml",
    )
    with open_recording(str(tmp_path / "log.h5"), setup) as recording:
        columns, _, remarks = encoder_speed(recording)
    rate = np.gradient(angle, 1.0 / RATE_HZ)
    truth = np.interp(columns["time_s"], np.arange(angle.size) / RATE_HZ, rate)
    assert set(columns["quality"]) == {"ok"}
    assert columns["time_s"].size >= angle[-1] - 3.0
    error = columns["speed_m_s"] / (2.0 * np.pi * RADIUS_M * truth) - 1.0
    assert np.abs(error).max() < 0.01
    assert np.abs(np.mean(error)) < 2e-4
    assert not any("repaired" in remark for remark in remarks)
    assert any("edges of one kind" in said for said in remarks) == (not 0.25 < duty < 0.75)


@pytest.mark.parametrize("duty", [0.34, 0.5, 0.66])
@pytest.mark.parametrize("hole_s", [0.0, 0.009])
def test_no_tooth_is_lost_of_uneven_pulses(duty, hole_s):
    """Neither where a long log is cut into pieces, nor in a hole of some teeth."""
    time = np.arange(150_000) / RATE_HZ
    angle = 10.45 * time
    signal = 5.0 * ((100 * angle + 0.3) % 1.0 < duty)
    signal[(time > 5.0) & (time < 5.0 + hole_s)] = np.nan
    axis = TimeAxis.uniform(time.size, RATE_HZ)
    tone = {"settings": {"steps": 100}}
    wheel = wheel_angle(Channel.of_array("e", "wheel_encoder", signal, axis, **tone))
    some = time[1000:-1000:50]
    some = some[np.abs(some - 5.0) > 0.05]
    off = wheel.angle.at(some) / (2.0 * np.pi) - 10.45 * some
    assert np.ptp(off) < 0.3 / 100


TURN_M = 2.0
#: the jump is while the wheel gains or loses speed
SECONDS, JUMP_S = 40.0, 35.0


def steady_turns(knots_s, speeds_m_s):
    """Ends of the turns [s] of a wheel that drives so."""
    fine = np.arange(0.0, SECONDS, 1e-3)
    turned = np.cumsum(np.interp(fine, knots_s, speeds_m_s)) * 1e-3 / TURN_M
    return np.interp(np.arange(1, int(turned[-1])), turned, fine)


def marked(stamps_s, ends_s):
    return off_clock(TimeAxis.of_times(stamps_s), ends_s[:-1], ends_s[1:])


DRIVES = {
    "constant": ([0, 40], [10, 10]),
    "faster": ([0, 32, 38, 40], [6, 6, 16, 16]),
    "slower": ([0, 32, 38, 40], [16, 16, 6, 6]),
}


@pytest.mark.parametrize("drive", DRIVES)
def test_a_clock_that_runs_slow_is_found_and_no_instrument_that_is_slower(drive):
    """Whatever the wheel does."""
    true, ends = np.arange(SECONDS * 2500.0) / 2500.0, steady_turns(*DRIVES[drive])
    slower = np.concatenate([true[true < JUMP_S], np.arange(JUMP_S, SECONDS, 1.0 / 2400.0)])
    assert not marked(slower, ends).any()
    stamps = np.where(true < JUMP_S, true, JUMP_S + 1.06 * (true - JUMP_S))
    late, found = ends[:-1] > JUMP_S, marked(stamps, np.interp(ends, true, stamps))
    assert found[late][1:].all()
    assert not found[~late][:-1].any()


@pytest.mark.parametrize(("first", "stop"), [(0, 1), (0, 2), (-3, -1), (-2, -1), (20, 24)])
def test_a_clock_that_runs_slow_for_a_turn_or_two_is_found_at_the_ends_too(first, stop):
    true, ends = np.arange(SECONDS * 2500.0) / 2500.0, steady_turns(*DRIVES["constant"])
    begin_s, end_s = ends[first], ends[stop]
    stamps = true + 0.1 * (np.clip(true, begin_s, end_s) - begin_s)
    found = marked(stamps, np.interp(ends, true, stamps))
    late = (ends[:-1] > begin_s - 1e-9) & (ends[1:] < end_s + 1e-9)
    np.testing.assert_array_equal(found, late)
