"""Property: what the hardened foundation takes balances its load, whatever rows stand together."""

import numpy as np
import pytest
from scipy.fft import irfft, rfft

from tirelog.errors import ModelError
from tirelog.physics.carcass.structures import hardened_load
from tirelog.physics.pressure import parabola
from tirelog.physics.spectral import MODES

R = 0.305
#: loads [N] and speeds [m/s] that lie as far apart as those of a log
LOADS = np.array([[900.0], [2000.0], [3600.0], [3700.0], [6500.0]])
SPEEDS = np.array([[4.0], [8.0], [16.0], [24.0], [29.0]])


def problem(loads=LOADS, speeds=SPEEDS, damped=0.0, lopsided=0.0):
    """Load and compliance of a beam (n, K), and its foundation's stiffness."""
    q, k = np.arange(MODES) / R, 2e6
    Z = 4.0 * q**4 - 4.5 * speeds**2 * q**2 + k + 2j * 4.5 * speeds * damped * q
    tilt = 1.0 + 1j * lopsided * np.minimum(np.arange(MODES) / 30.0, 1.0)
    return parabola(loads, np.full(loads.shape, 0.055), R) * tilt, 1.0 / Z, k


def wave(modes):
    return irfft(modes[:, :128], 512, axis=1, norm="forward")


@pytest.mark.parametrize("cubic", [-60.0, 1.0, 3e3, 1e5])
@pytest.mark.parametrize("shape", [{}, {"damped": 30.0, "lopsided": 0.2}])
def test_the_reaction_is_that_of_the_deflection_under_what_is_left(cubic, shape):
    load, compliance, k = problem(**shape)
    left, _ = hardened_load(load, compliance, k * cubic)
    w = wave(left * compliance)
    reaction = k * cubic * rfft(w**3, axis=1, norm="forward")[:, :128]
    missed = np.abs((load - left)[:, :128] - reaction).max(axis=1)
    assert (missed < 1e-8 * np.abs(load).max(axis=1)).all()
    assert np.array_equal(left[:, 128:], load[:, 128:])


@pytest.mark.parametrize("cubic", [-60.0, 3e3, 1e5])
def test_a_row_is_the_same_alone_and_beside_others(cubic):
    load, compliance, k = problem(damped=30.0)
    together, _ = hardened_load(load, compliance, k * cubic)
    for i in range(len(load)):
        alone, _ = hardened_load(load[i : i + 1], compliance[i : i + 1], k * cubic)
        assert np.abs(alone[0] - together[i]).max() < 1e-9 * np.abs(load[i]).max()


def test_a_start_from_other_numbers_ends_at_the_same():
    load, compliance, k = problem()
    _, before = hardened_load(1.3 * load, compliance, k * 8e3)
    fresh, _ = hardened_load(load, compliance, k * 3e3)
    again, _ = hardened_load(load, compliance, k * 3e3, before)
    assert np.abs(again - fresh).max() < 1e-9 * np.abs(load).max()


def test_a_foundation_that_hardens_holds_the_patch_back_and_one_that_softens_lets_it_go():
    load, compliance, k = problem()
    soft = wave(load * compliance).max(axis=1)
    for cubic, sign in ((3e3, -1.0), (-60.0, 1.0)):
        left, _ = hardened_load(load, compliance, k * cubic)
        assert (sign * (wave(left * compliance).max(axis=1) - soft) > 0.0).all()


def test_one_row_whose_foundation_gives_way_refuses_all():
    load, compliance, k = problem()
    with pytest.raises(ModelError, match="gives way"):
        hardened_load(load * np.array([[1.0], [1.0], [1.0], [1.0], [6.0]]), compliance, -300.0 * k)
