"""Closed form: P4's frequency trackers against a known frequency, and against the speed that the
tooth passages give.
"""

import numpy as np
import pytest

from tests.dsp.frequency_trackers import notch, quinn_fernandes, track
from tests.wheel.phase_truth import DYNAMIC, Drive, Encoder, recording
from tirelog.wheel.angle import encoder_of


@pytest.mark.parametrize("tracker", [quinn_fernandes, notch])
@pytest.mark.parametrize("omega", [0.1, 0.4, 1.3, 2.2])
def test_a_long_sine_has_its_frequency(tracker, omega):
    values = np.sin(omega * np.arange(4000) + 0.3)
    assert tracker(values) == pytest.approx(omega, abs=3e-4)


@pytest.mark.parametrize("tracker", [quinn_fernandes, notch])
def test_noise_does_not_bias(tracker):
    random = np.random.default_rng(1000)
    found = [
        tracker(np.sin(0.4 * np.arange(2000) + p) + 0.2 * random.standard_normal(2000))
        for p in np.arange(40)
    ]
    assert np.mean(found) == pytest.approx(0.4, abs=3 * np.std(found) / np.sqrt(40) + 1e-4)


def test_what_does_not_swing_has_no_frequency():
    assert np.isnan(quinn_fernandes(np.zeros(100)))


def test_the_passages_follow_the_speed_better():
    """P4's reference is right to a percent; counted passages on the same low-pass are an order
    better.
    """
    drive = Drive(*DYNAMIC)
    signal = Encoder(pitch_deg=0.2, wobble=0.0, grows=False).signal(drive)
    times, speed = track(signal, 10_000.0, 48)
    true = np.interp(times, drive.time, drive.speed) / drive.radius_m
    reference = np.sqrt(np.nanmean(((speed - true) / true)[2:-2] ** 2))
    wheel = encoder_of(recording(drive, signal))[1]
    ours = np.sqrt(np.mean(((wheel.speed_rad_s(times) - true) / true)[2:-2] ** 2))
    assert reference < 0.02
    assert ours < 0.2 * reference
