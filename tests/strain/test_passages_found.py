"""Property: every passage is found once and none invented, at its time and its speed."""

import numpy as np
import pytest

from tests.strain.conftest import beam_pulse, make_drive, ring_pulse
from tirelog.data.recording import TimeAxis
from tirelog.runs import in_memory as held
from tirelog.strain.passages import match as passage_match
from tirelog.strain.passages.find import find_passages
from tirelog.strain.speed import speed_quality
from tirelog.vocabulary.quality import Quality, good, having
from tirelog.wheel import pulses


def found_once(d, radius_m, within_m):
    """The passages, a row for each true one, within so much of road; none is doubted."""
    found = find_passages(d.channel, radius_m)
    assert d.nearest(found.time_s).tolist() == list(range(len(d.time_s)))
    off = (found.time_s - d.time_s) * np.abs(d.speed_m_s)
    assert np.abs(off - np.median(off)).max() < within_m
    assert found.doubt == ""
    return found


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


def short_patch(xi_m, speed_m_s):
    """75 mm at half level: at 2.5 kHz and 50 m/s half of a patch has four samples."""
    return beam_pulse(1.5 * xi_m, speed_m_s)


MANOEUVRES = ([0, 2, 8, 16, 19, 24, 40], [6, 6, 25, 25, 12, 12, 20])
#: standing start, hard drive, cruise, brake, coast; and slow changes as a driver's foot makes them
PAPERS = ([0, 3, 9, 15, 18, 24, 34, 40], [6, 6, 25, 25, 9, 9, 22, 16])
RING = {"pulse": ring_pulse}
FAST = {"pulse": short_patch, "drift": 0.0}
#: knots [s], speeds [m/s], what else is different; most that a place [m] and, root mean square,
#: speeds [m/s] may be off
DRIVES = {
    "manoeuvres": (*MANOEUVRES, {}, 1.5e-3, 0.01),
    "on the liner": (*MANOEUVRES, {"surface": "inner"}, 1.5e-3, 0.01),
    "ring": (*MANOEUVRES, RING, 1.5e-3, 0.01),
    "ring on the liner": (*MANOEUVRES, RING | {"surface": "inner"}, 1.5e-3, 0.01),
    "drift of six patches": (*MANOEUVRES, {"drift": 5e-3}, 1.5e-3, 0.01),
    "the papers'": (*PAPERS, {}, 1.5e-3, 0.01),
    "the papers', ring": (*PAPERS, RING, 1.5e-3, 0.01),
    "1 kHz": ([0, 5, 15, 20], [5, 5, 15, 15], {"rate_Hz": 1000.0}, 1e-3, 0.01),
    "10 kHz": ([0, 5, 15, 20], [5, 5, 15, 15], {"rate_Hz": 10_000.0}, 1e-3, 0.01),
    "standing starts": (
        [0, 5, 10, 15, 18, 25, 30, 35, 40], [0, 0, 20, 20, 0, 0, 15, 15, 0], {}, 1e-3, 0.01,
    ),
    "coasting": ([0, 30], [20, 2], {}, 1e-3, 2e-3),
    "creeping": ([0, 60], [0.3, 0.3], {}, 1e-3, 1e-3),
    "creeping start": ([0, 20, 40], [0.1, 0.5, 10], {}, 1e-3, 0.01),
    "hard braking": ([0, 10, 12.5, 15], [25, 25, 0, 0], {}, 1e-3, 0.01),
    "town": ([0, 3, 6, 9, 12, 15, 18, 21], [0, 5, 0, 4, 0, 6, 1, 5], {}, 1e-3, 0.05),
    "three passages": ([0, 0.5], [12, 12], {}, 1e-3, 0.01),
    "start": ([0, 4], [0, 12], {}, 1e-3, 0.01),
    "144 km/h": ([0, 20], [40, 40], {}, 1e-3, 0.01),
    "216 km/h": ([0, 8], [60, 60], {"rate_Hz": 5000.0}, 1e-3, 0.01),
    "becomes fast": ([0, 20], [5, 70], {"rate_Hz": 5000.0}, 5e-3, 0.1),
    "180 km/h, 2.5 kHz": ([0, 4.4], [50, 50], FAST, 5e-3, 0.1),
    "162 km/h, 5 kHz": ([0, 4.4], [45, 45], FAST | {"rate_Hz": 5000.0}, 5e-3, 0.1),
    "270 km/h, 5 kHz": ([0, 4.4], [75, 75], FAST | {"rate_Hz": 5000.0}, 5e-3, 0.1),
    "270 km/h, 20 kHz": ([0, 4.4], [75, 75], FAST | {"rate_Hz": 20_000.0}, 5e-3, 0.1),
}  # fmt: skip


@pytest.mark.parametrize("noise_pm", [0.8, 8.0])
@pytest.mark.parametrize("name", DRIVES)
def test_every_passage_is_found_at_its_time_and_speed(radius_m, name, noise_pm):
    knots, speeds, more, within_m, most_m_s = DRIVES[name]
    d = make_drive(knots, speeds, seed=1001, noise_pm=noise_pm, **more)
    found = found_once(d, radius_m, within_m)
    assert rms(found.speed_m_s - d.speed_m_s) < most_m_s
    if min(speeds) > 0.0:
        assert not speed_quality(found)[1:-1].any()


#: a wheel that stands, or turns back, once a turn: times and speeds at the knots
PARKING = {
    "back and forth": ([0, 3, 6, 9, 12, 15], [0, 1, 0, -1, 0, 1.5]),
    "a stop each turn": (np.arange(0.0, 60.0), np.arange(60) % 2 * 2.0),
    "hardly a stop": (np.arange(0.0, 60.0), 2.0 - np.arange(60) % 2 * 1.33),
    "long stops": (np.arange(0.0, 60.0, 2.5), np.arange(24) % 2 * 2.0),
}


@pytest.mark.parametrize("name", PARKING)
def test_turns_in_which_the_wheel_stood_give_no_speed_that_is_ok(radius_m, name):
    drive = make_drive(*PARKING[name], seed=1002)
    found = find_passages(drive.channel, radius_m)
    true = np.abs(drive.speed_m_s[drive.nearest(found.time_s)])
    ok = good(speed_quality(found)) & np.isfinite(found.speed_m_s)
    off = np.abs(found.speed_m_s - true)[ok]
    if name == "back and forth":  # three passages: too few for a waveform, and no doubt
        found_once(drive, radius_m, 1e-3)
    assert not ((off > 5.0 * found.speed_se_m_s[ok]) & (off > 0.01 * true[ok])).any()


@pytest.mark.parametrize(
    ("speed", "noise_pm", "most_m_s"),
    [*((v, 0.8, 2e-4) for v in (6.0, 11.0, 15.0, 20.0, 25.0)), (15.0, 8.0, 2e-3)],
)
def test_constant_speeds_and_their_errors(radius_m, speed, noise_pm, most_m_s):
    d = make_drive([0, 60], [speed, speed], seed=1200 + int(speed + noise_pm), noise_pm=noise_pm)
    found = found_once(d, radius_m, 2e-3)
    off = found.speed_m_s - speed
    assert rms(off) < most_m_s
    inside = np.mean(np.abs(off) < found.speed_se_m_s)
    assert inside == pytest.approx(0.68, abs=0.05 + 1.0 / np.sqrt(off.size))


def test_standard_errors_cover_in_the_manoeuvres(radius_m):
    """All rows of six drives with kinks at different places."""
    pulls = []
    for seed in range(1250, 1256):
        rng = np.random.default_rng(seed)
        knots = np.concatenate([[0], np.cumsum(rng.uniform(3, 8, 8))])
        speeds = rng.uniform(6, 25, 9)
        speeds[[2, 5]] = speeds[[1, 4]]
        d = make_drive(knots, speeds, seed=seed)
        found = found_once(d, radius_m, 1.5e-3)
        pulls.append(np.abs(found.speed_m_s - d.speed_m_s) / found.speed_se_m_s)
    pull = np.concatenate(pulls)
    assert np.mean(pull < 1) == pytest.approx(0.68, abs=0.05)
    assert np.mean(pull < 2) > 0.92


@pytest.mark.parametrize("start_turns", [0.5, 0.95, 1.0, 1.05])
def test_standing_with_the_grating_in_the_patch_adds_nothing(radius_m, start_turns):
    d = make_drive([0, 10, 15], [0, 0, 12], seed=1003, start_turns=start_turns)
    assert len(d.time_s) - len(find_passages(d.channel, radius_m)) in (0, 1)
    still = make_drive([0, 5], [0, 0], seed=1003, start_turns=start_turns)
    assert len(find_passages(still.channel, radius_m)) == 0


def test_stamped_samples_give_the_same_rows(radius_m):
    d = make_drive([0, 5, 15], [5, 5, 15], seed=1006)
    stamped = d.with_values(d.values, TimeAxis.of_times(d.channel.axis.time()))
    one, other = (find_passages(channel, radius_m).time_s for channel in (stamped, d.channel))
    np.testing.assert_allclose(one, other, atol=1e-8)


@pytest.mark.parametrize("block_samples", [1000, 33_333, 1 << 20])
def test_the_same_rows_whatever_the_block_size(radius_m, block_samples, monkeypatch):
    d = make_drive([0, 5, 15, 20], [0, 12, 20, 20], seed=1007)
    values = d.values.copy()
    values[np.random.default_rng(1).choice(values.size, 400, replace=False)] = np.nan
    channel = d.with_values(values)
    whole = find_passages(channel, radius_m)
    # as a long log is read: never held in memory, fitted block by block
    monkeypatch.setattr(held, "HELD_SAMPLES", 0)
    for module in (passage_match, pulses):
        monkeypatch.setattr(module, "AT_ONCE", block_samples)
    parts = find_passages(channel, radius_m)
    for name in ("index", "time_s", "omega_se_rad_s", "height", "turn_after", "quality"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(parts, name))


QUICK = ([0, 12, 15, 18, 20], [8, 8, 0, -8, -8])


@pytest.mark.parametrize(
    ("plan", "start_turns", "pulse", "most_m_s"),
    [
        (([0, 5, 8, 10, 12, 18, 20], [8, 8, 0, -3, -3, -3, 0]), 0.4, beam_pulse, 0.3),
        *(
            (QUICK, turns, pulse, 0.02)
            for turns in (0.82, 0.9)
            for pulse in (beam_pulse, ring_pulse)
        ),
    ],
)
def test_a_wheel_that_rolls_back_is_told_from_its_waveform(
    radius_m, plan, start_turns, pulse, most_m_s
):
    """By the times alone the next passage might be a turn on."""
    d = make_drive(*plan, seed=1010, start_turns=start_turns, pulse=pulse)
    found = found_once(d, radius_m, 0.01)
    back = d.speed_m_s < 0
    assert having(found.quality, Quality.REVERSING).tolist() == back.tolist()
    last = int(np.argmax(back)) - 1
    assert not found.turn_after[last]
    assert found.break_after[last] == Quality.REVERSING
    off = np.abs(found.speed_m_s - np.abs(d.speed_m_s))
    assert off[last - 2 : last + 4].max() < most_m_s


@pytest.mark.parametrize("start_turns", [0.1, 0.3, 0.5, 0.7])
def test_stop_and_go_is_not_taken_for_a_way_back(radius_m, start_turns):
    d = make_drive([0, 8, 10, 12, 20], [6, 6, 0, 6, 6], seed=1011, start_turns=start_turns)
    found = find_passages(d.channel, radius_m)
    assert not having(found.quality | found.break_after, Quality.REVERSING).any()
