"""Closed form: what the parabola through three passages gives exactly, and its errors."""

import numpy as np
import pytest

from tirelog.strain.passages.passage_flags import TURN_RAD, kinematics


def passage_times(omega0, alpha, turns):
    """Times at which omega0 t + alpha t^2 / 2 reaches each of `turns` x 2 pi."""
    angle = TURN_RAD * np.asarray(turns, float)
    return 2 * angle / (omega0 + np.sqrt(omega0**2 + 2 * alpha * angle))


def motion(time, error_s, turns_after=1):
    """Kinematics of passages that are one turn apart, or so many."""
    after = np.broadcast_to(turns_after, time.shape).astype(float)
    return kinematics(time, np.full(time.size, error_s), np.append(after[:-1], 0.0))


@pytest.mark.parametrize("error_s", [0.0, 1e-6])
@pytest.mark.parametrize("alpha", [-9.0, 0.0, 4.0, 15.0])
def test_constant_acceleration_is_exact_at_every_passage(alpha, error_s):
    """Missing passages count their turns."""
    for turns in (np.arange(20), np.array([0, 1, 2, 5, 6, 8, 9])):
        time = passage_times(60.0, alpha, turns)
        found = motion(time, error_s, np.append(np.diff(turns), 0))
        np.testing.assert_allclose(found["omega_rad_s"], 60.0 + alpha * time, rtol=1e-9)
        np.testing.assert_allclose(found["alpha_rad_s2"], alpha, atol=1e-7)
        assert found["sides"].tolist() == [1] + [2] * (time.size - 2) + [1]


def test_noise_alone_has_the_error_of_the_centred_difference():
    """2 pi / omega = T: sigma_omega = omega sigma_t / (sqrt 2 T), of the outer passages."""
    error = motion(passage_times(60.0, 0.0, range(400)), 2e-6)["omega_se_rad_s"]
    expected = 60.0 * 2e-6 / np.sqrt(2) / (TURN_RAD / 60.0)
    np.testing.assert_allclose(error[2:-2], expected, rtol=1e-9)
