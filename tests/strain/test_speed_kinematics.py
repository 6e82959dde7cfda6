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


@pytest.mark.parametrize(("noise_s", "usual"), [(1e-5, 0.52), (3e-5, 0.87)])
def test_speeds_beside_a_sharp_end_of_a_ramp_are_within_their_errors(noise_s, usual):
    """None is beyond five errors; 5 to 9 were without the change of acceleration in the error."""
    draw, pulls, beside = np.random.default_rng(3100), [], []
    for _ in range(60):
        begin, alpha = draw.uniform(20.0, 60.0), draw.uniform(2.0, 12.0)
        knots = np.cumsum([0.0, *draw.uniform(2.5, 5.0, 3)])
        at_knots = begin + alpha * np.array([0.0, 0.0, knots[2] - knots[1], knots[2] - knots[1]])
        time = np.arange(0.0, knots[-1], 1e-4)
        omega = np.interp(time, knots, at_knots)
        angle = np.concatenate([[0.0], np.cumsum(0.5 * (omega[1:] + omega[:-1]) * 1e-4)])
        turns = np.arange(TURN_RAD * draw.uniform(0.1, 1.0), angle[-1], TURN_RAD)
        exact = np.interp(turns, angle, time)
        found = motion(exact + noise_s * draw.standard_normal(exact.size), noise_s)
        off = np.abs(found["omega_rad_s"] - np.interp(exact, knots, at_knots))
        pulls.append((off / found["omega_se_rad_s"])[1:-1])
        away = np.abs(exact[1:-1, None] - knots[1:3]).min(axis=1)
        beside.append(away < 1.5 * TURN_RAD / omega.max())
    pull, near = np.concatenate(pulls), np.concatenate(beside)
    assert pull.max() < 5.0
    assert near.sum() > 200
    assert np.sqrt(np.mean(pull[near] ** 2)) == pytest.approx(usual, abs=0.1)
