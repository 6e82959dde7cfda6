"""Closed form: what an accelerometer's own band makes of what it rides through."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from tirelog.data.recording import Conditions
from tirelog.physics import Model

RADIUS_M, SPEED_M_S, SAMPLES = 0.3, 20.0, 4096
RING = {"radius_m": RADIUS_M, "width_m": 0.14, "load_N": 3500.0}
RATE_HZ = SAMPLES * SPEED_M_S / (2 * np.pi * RADIUS_M)
PHI = (np.arange(SAMPLES) + 0.5) / SAMPLES * 2 * np.pi - np.pi


def read(phi=PHI, acceleration=0.0, **values):
    model = Model.new("ring", "radial_acceleration", **RING, **values)
    conditions = Conditions.of(1, speed_m_s=SPEED_M_S, acceleration_m_s2=acceleration)
    return model.predict(conditions, phi)[0]


def in_time(b, a, turns):
    """The last of many turns through a filter."""
    return lfilter(b, a, np.tile(read(), turns))[-SAMPLES:]


def test_a_low_pass_is_a_second_order_butterworth_without_its_delay():
    cut_Hz = 200.0
    filtered = in_time(*butter(2, cut_Hz, fs=RATE_HZ), turns=4)
    delay = np.sqrt(2.0) / (2 * np.pi * cut_Hz) * SPEED_M_S / RADIUS_M  # [rad]
    early = np.interp(PHI + delay, PHI, filtered, period=2 * np.pi)
    made = read(bandwidth_Hz=cut_Hz)
    unfiltered = read()
    assert np.abs(made - early).max() < 2e-4 * np.ptp(unfiltered)
    assert np.abs(made - unfiltered).max() > 0.05 * np.ptp(unfiltered)


def test_a_high_pass_takes_the_level_and_tilts_what_is_left():
    cut_Hz = 2.0
    filtered = in_time(*butter(1, cut_Hz, "high", fs=RATE_HZ), turns=40)
    made = read(coupling_Hz=cut_Hz)
    assert np.abs(made - filtered).max() < 1e-3 * np.ptp(filtered)
    assert abs(made.mean()) < 1e-6 * np.ptp(made)
    assert np.ptp(made - read()) > 0.03 * np.ptp(made)  # no mere offset


def test_a_level_that_falls_slowly_leaves_its_slope():
    """-v^2/R through i w tau / (1 + i w tau) is tau d/dt of it, while that changes slowly."""
    cut_Hz, acceleration = 5.0, -1.5
    still, braking = (read(coupling_Hz=cut_Hz, acceleration=a).mean() for a in (0.0, acceleration))
    slope = -2.0 * SPEED_M_S * acceleration / RADIUS_M / (2 * np.pi * cut_Hz)
    assert braking - still == pytest.approx(slope, rel=1e-9)


def test_no_band_is_the_model_as_ever():
    assert np.array_equal(read(), read(bandwidth_Hz=1e6, coupling_Hz=0.0))
