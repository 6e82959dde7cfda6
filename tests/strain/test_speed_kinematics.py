"""Closed form: what the parabola through three passages gives exactly, and its errors."""

from __future__ import annotations

import numpy as np
import pytest

from tirelog.strain.passages.passage_flags import (
    TURN_RAD,
    kinematics,
    may_have_stopped,
    turns_between,
)


def passage_times(omega0, alpha, turns):
    """Times at which omega0 t + alpha t^2 / 2 reaches each of `turns` x 2 pi."""
    angle = TURN_RAD * np.asarray(turns, float)
    return 2 * angle / (omega0 + np.sqrt(omega0**2 + 2 * alpha * angle))


@pytest.mark.parametrize("error_s", [0.0, 1e-6])
@pytest.mark.parametrize("alpha", [-9.0, 0.0, 4.0, 15.0])
def test_constant_acceleration_is_exact_at_every_passage(alpha, error_s):
    time = passage_times(60.0, alpha, range(20))
    found = kinematics(time, np.full(20, error_s), np.append(np.ones(19), 0.0))
    np.testing.assert_allclose(found["omega_rad_s"], 60.0 + alpha * time, rtol=1e-9)
    np.testing.assert_allclose(found["alpha_rad_s2"], alpha, atol=1e-7)
    assert found["sides"].tolist() == [1] + [2] * 18 + [1]


def test_missing_passages_count_their_turns():
    turns = np.array([0, 1, 2, 5, 6, 8, 9])
    time = passage_times(50.0, 3.0, turns)
    found = kinematics(time, np.full(7, 1e-6), np.append(np.diff(turns), 0.0))
    np.testing.assert_allclose(found["omega_rad_s"], 50.0 + 3.0 * time, rtol=1e-9)


def test_a_break_parts_the_stretches():
    first, second = passage_times(50.0, 0.0, range(5)), 100.0 + passage_times(20.0, 2.0, range(5))
    after = np.array([1, 1, 1, 1, 0, 1, 1, 1, 1, 0.0])
    found = kinematics(np.concatenate([first, second]), np.full(10, 1e-6), after)
    np.testing.assert_allclose(found["omega_rad_s"][:5], 50.0, rtol=1e-9)
    np.testing.assert_allclose(found["omega_rad_s"][5:], 20.0 + 2.0 * (second - 100.0), rtol=1e-9)
    assert found["sides"][[0, 4, 5, 9]].tolist() == [1, 1, 1, 1]


@pytest.mark.parametrize("n", [0, 1, 2])
def test_fewer_than_three_passages_have_no_speed(n):
    found = kinematics(np.arange(float(n)), np.full(n, 1e-6), np.ones(n))
    assert np.isnan(found["omega_rad_s"]).all()
    assert found["omega_rad_s"].size == n


def test_noise_alone_has_the_error_of_the_centred_difference():
    """omega (2 pi / omega = T): sigma_omega = omega sigma_t / (sqrt 2 T), from the two outer
    passages.
    """
    time = passage_times(60.0, 0.0, range(400))
    found = kinematics(time, np.full(400, 2e-6), np.append(np.ones(399), 0.0))
    np.testing.assert_allclose(
        found["omega_se_rad_s"][2:-2], 60.0 * 2e-6 / np.sqrt(2) / (TURN_RAD / 60.0), rtol=1e-9
    )


def test_a_kink_goes_into_the_error_around_it_only():
    """The acceleration jumps from 0 to 15 rad/s^2 at passage 20."""
    first = passage_times(60.0, 0.0, range(21))
    time = np.concatenate([first, first[-1] + passage_times(60.0, 15.0, range(1, 20))])
    truth = 60.0 + 15.0 * np.maximum(time - first[-1], 0.0)
    found = kinematics(time, np.full(40, 1e-7), np.append(np.ones(39), 0.0))
    off = np.abs(found["omega_rad_s"] - truth)
    near = np.abs(np.arange(40) - 20) <= 1
    assert (off[near] < 2.0 * found["omega_se_rad_s"][near]).all()
    away = np.abs(np.arange(40) - 20) > 5
    assert off[away].max() < 1e-6
    assert found["omega_se_rad_s"][away][1:-1].max() < 1e-3 * found["omega_se_rad_s"][near].max()


def test_turns_by_the_mean_speed():
    time = passage_times(10.0, 6.0, range(6))
    np.testing.assert_allclose(turns_between(time, 10.0 + 6.0 * time), 1.0, rtol=1e-9)


def test_a_wheel_of_exactly_one_speed_has_never_stopped() -> None:
    """Its rate of change is 0, and the time that it has to rest infinite: no warning, no stop."""
    assert not may_have_stopped(0.125 * np.arange(12.0)).any()


@pytest.mark.parametrize("noise_s", [1e-5, 3e-5])
def test_no_speed_beside_a_sharp_end_of_a_ramp_is_beyond_five_errors(noise_s):
    """Before the change of acceleration was in the error, 5 to 9 of these speeds were."""
    draw, worst = np.random.default_rng(3100), 0.0
    for _ in range(60):
        begin, alpha = draw.uniform(20.0, 60.0), draw.uniform(2.0, 12.0)
        knots = np.cumsum([0.0, *draw.uniform(2.5, 5.0, 3)])
        at_knots = begin + alpha * np.array([0.0, 0.0, knots[2] - knots[1], knots[2] - knots[1]])
        time = np.arange(0.0, knots[-1], 1e-4)
        omega = np.interp(time, knots, at_knots)
        angle = np.concatenate([[0.0], np.cumsum(0.5 * (omega[1:] + omega[:-1]) * 1e-4)])
        turns = np.arange(TURN_RAD * draw.uniform(0.1, 1.0), angle[-1], TURN_RAD)
        exact = np.interp(turns, angle, time)
        seen = exact + noise_s * draw.standard_normal(exact.size)
        one = np.append(np.ones(exact.size - 1), 0.0)
        found = kinematics(seen, np.full(exact.size, noise_s), one)
        error = (
            np.abs(found["omega_rad_s"] - np.interp(exact, knots, at_knots))
            / found["omega_se_rad_s"]
        )
        worst = max(worst, float(error[1:-1].max()))
    assert worst < 5.0, worst
