"""Property: every passage is found and none invented, whatever the drive and the instrument do.

Seeds from 1000: none was used for tuning.
"""

from __future__ import annotations

import numpy as np
import pytest

from tirelog.data.recording import TimeAxis
from tirelog.runs import in_memory as held
from tirelog.strain.passages import match as passage_match
from tirelog.strain.passages.find import Passages, find_passages
from tirelog.vocabulary.quality import Quality, having

MANOEUVRES = ([0, 2, 8, 16, 19, 24, 40], [6, 6, 25, 25, 12, 12, 20])


def one_to_one(found: Passages, drive, within_m: float = 0.005) -> np.ndarray:
    """Index of the true passage of each row; asserts one for each and the times to some millimetres
    of road.
    """
    nearest = drive.nearest(found.time_s)
    assert nearest.tolist() == list(range(len(drive.time_s)))
    off = (found.time_s - drive.time_s) * np.abs(drive.speed_m_s)
    assert np.abs(off - np.median(off)).max() < within_m
    return nearest


@pytest.mark.parametrize("noise_pm", [0.8, 8.0])
@pytest.mark.parametrize(
    ("surface", "shape"),
    [("outer", "beam"), ("inner", "beam"), ("outer", "ring"), ("inner", "ring")],
)
def test_all_in_the_manoeuvres(drive, pulses, radius_m, noise_pm, surface, shape):
    d = drive(*MANOEUVRES, seed=1001, noise_pm=noise_pm, surface=surface, pulse=pulses[shape])
    one_to_one(find_passages(d.channel, radius_m), d, 0.0015)


@pytest.mark.parametrize(
    ("knots", "speeds"),
    [
        ([0, 5, 10, 15, 18, 25, 30, 35, 40], [0, 0, 20, 20, 0, 0, 15, 15, 0]),
        ([0, 60], [0.3, 0.3]),
        ([0, 20, 40], [0.1, 0.5, 10]),
        ([0, 10, 12.5, 15], [25, 25, 0, 0]),
        ([0, 20], [40, 40]),
    ],
    ids=["standing starts", "creeping", "creeping start", "hard braking", "144 km/h"],
)
def test_all_in_hard_drives(drive, radius_m, knots, speeds):
    d = drive(knots, speeds, seed=1002)
    one_to_one(find_passages(d.channel, radius_m), d)


@pytest.mark.parametrize("start_turns", [0.5, 0.95, 1.0, 1.05])
def test_standing_with_the_grating_in_the_patch_adds_nothing(drive, radius_m, start_turns):
    d = drive([0, 10, 15], [0, 0, 12], seed=1003, start_turns=start_turns)
    assert len(d.time_s) - len(find_passages(d.channel, radius_m)) in (0, 1)
    still = drive([0, 5], [0, 0], seed=1003, start_turns=start_turns)
    assert len(find_passages(still.channel, radius_m)) == 0


def test_drift_of_six_times_the_patch(drive, radius_m):
    d = drive(*MANOEUVRES, seed=1004, drift=5e-3)
    one_to_one(find_passages(d.channel, radius_m), d, 0.0015)


@pytest.mark.parametrize("rate_Hz", [1000.0, 10_000.0])
def test_other_rates(drive, radius_m, rate_Hz):
    d = drive([0, 5, 15, 20], [5, 5, 15, 15], seed=1005, rate_Hz=rate_Hz)
    one_to_one(find_passages(d.channel, radius_m), d, 0.001)


def test_stamped_samples_give_the_same_rows(drive, radius_m):
    d = drive([0, 5, 15], [5, 5, 15], seed=1006)
    stamped = d.with_values(d.values, TimeAxis.of_times(d.channel.axis.time()))
    np.testing.assert_allclose(
        find_passages(stamped, radius_m).time_s,
        find_passages(d.channel, radius_m).time_s,
        atol=1e-8,
    )


@pytest.mark.parametrize("block_samples", [1000, 4096, 33_333, 1 << 20])
def test_the_same_rows_whatever_the_block_size(drive, radius_m, block_samples, monkeypatch):
    d = drive([0, 5, 15, 20], [0, 12, 20, 20], seed=1007)
    values = d.values.copy()
    values[np.random.default_rng(1).choice(values.size, 400, replace=False)] = np.nan
    channel = d.with_values(values)
    whole = find_passages(channel, radius_m)
    # as a long log is read: never held in memory, fitted block by block
    monkeypatch.setattr(held, "HELD_SAMPLES", 0)
    monkeypatch.setattr(passage_match, "AT_ONCE", block_samples)
    parts = find_passages(channel, radius_m, block_samples)
    for name in (
        "index",
        "time_s",
        "time_se_s",
        "omega_rad_s",
        "omega_se_rad_s",
        "height",
        "turn_after",
        "measured",
    ):
        np.testing.assert_array_equal(getattr(whole, name), getattr(parts, name))
    np.testing.assert_array_equal(whole.quality, parts.quality)


def test_a_rolling_tire_backwards_is_told_from_its_waveform(drive, radius_m):
    d = drive([0, 5, 8, 10, 12, 18, 20], [8, 8, 0, -3, -3, -3, 0], seed=1008)
    found = find_passages(d.channel, radius_m)
    one_to_one(found, d, 0.01)
    assert having(found.quality, Quality.REVERSING).tolist() == (d.speed_m_s < 0).tolist()


@pytest.mark.parametrize("start_turns", [0.82, 0.86, 0.9])
@pytest.mark.parametrize("shape", ["beam", "ring"])
def test_a_quick_stop_and_back_within_what_might_have_been_one_turn(
    drive, pulses, radius_m, start_turns, shape
):
    """The wheel stops some third of a turn behind the patch: by the times alone the next passage
    might be a turn on.
    """
    d = drive(
        [0, 12, 15, 18, 20],
        [8, 8, 0, -8, -8],
        seed=1010,
        start_turns=start_turns,
        pulse=pulses[shape],
    )
    found = find_passages(d.channel, radius_m)
    one_to_one(found, d, 0.01)
    back = d.speed_m_s < 0
    assert having(found.quality, Quality.REVERSING).tolist() == back.tolist()
    last = int(np.argmax(back)) - 1
    away = (
        0.5
        * (d.speed_m_s[last] - d.speed_m_s[last + 1])
        / (2 * np.pi * radius_m)
        * (d.time_s[last + 1] - d.time_s[last])
    )
    assert 0.7 < away < 1.4
    assert not found.turn_after[last]
    assert found.break_after[last] == Quality.REVERSING
    off = np.abs(found.speed_m_s - np.abs(d.speed_m_s))
    assert off[last - 2 : last + 4].max() < 0.02


@pytest.mark.parametrize("start_turns", [0.1, 0.3, 0.5, 0.7])
def test_stop_and_go_is_not_taken_for_a_way_back(drive, radius_m, start_turns):
    d = drive([0, 8, 10, 12, 20], [6, 6, 0, 6, 6], seed=1011, start_turns=start_turns)
    found = find_passages(d.channel, radius_m)
    assert not having(found.quality, Quality.REVERSING).any()
    assert not having(found.break_after, Quality.REVERSING).any()


def test_the_centre_is_the_same_angle_at_every_speed(drive, radius_m):
    """The odd part of the waveform grows with speed; the centre follows it by less than a
    millimetre from 6 to 25 m/s.
    """
    centres = []
    for speed in (6.0, 25.0):
        d = drive([0, 20], [speed, speed], seed=1009)
        found = find_passages(d.channel, radius_m)
        centres.append(np.median((found.time_s - d.time_s) * speed))
    assert abs(centres[1] - centres[0]) < 1e-3
