"""Closed form: scatter of manoeuvres, its errors, and the least extra error."""

from types import SimpleNamespace

import numpy as np
import pytest

from tirelog.diagnosis.residual_structure import extra_errors
from tirelog.inference.floor import Scatter, _deviations, agreement
from tirelog.inference.metric import RANK, LeaveOneOut, Normal, Whitener, solve_scaled


def hat_of(columns):
    return columns @ np.linalg.pinv(columns)


def test_manoeuvres_that_only_scatter_keep_all_of_it():
    random = np.random.default_rng(3)
    speed = np.linspace(-1.0, 1.0, 24)
    hat = hat_of(np.stack([np.ones(24), speed, speed**2], axis=1))
    values = 0.02 * random.standard_normal(24)
    sd, left = _deviations(values, np.zeros(24), hat, 1.0)
    # with their mean, which no parameter took
    np.testing.assert_allclose(left, values)
    np.testing.assert_allclose(sd, np.sqrt((values**2).sum() / 23.0))
    # a mean beyond their scatter is none of it, but a load that is wrong
    _, left = _deviations(values + 0.1, np.zeros(24), hat, 1.0)
    np.testing.assert_allclose(left, values - values.mean(), atol=1e-15)


def test_what_surely_follows_is_no_scatter():
    random = np.random.default_rng(4)
    speed = np.linspace(-1.0, 1.0, 24)
    hat = hat_of(np.stack([np.ones(24), speed, speed**2], axis=1))
    scatter = 0.001 * random.standard_normal(24)
    sd, left = _deviations(0.03 * speed**2 + scatter, np.zeros(24), hat, 1.0)
    np.testing.assert_allclose(left, scatter - hat @ scatter, atol=1e-12)
    assert 0.0006 < sd < 0.0014


def test_what_follows_the_speed_in_one_manoeuvre_alone_follows_it_in_none():
    manoeuvre = np.repeat(np.arange(12), 5)
    log = np.repeat([0, 1], 30)
    alike = 1.0 + 0.1 * np.random.default_rng(8).standard_normal(60)
    # of 4,096 flips four are as alike: each of the two logs up or down as a whole
    assert abs(agreement(alike, manoeuvre, log) - 4 / 4096) < 0.002
    assert agreement(np.where(log, -alike, alike), manoeuvre, log) < 0.003
    lone = alike * np.repeat([9.0, -1.0, 1.0, -2.0, 1.0, -1.0, 1.0, -1.0, 2.0, -8.0, 1.0, -1.0], 5)
    assert agreement(lone, manoeuvre, log) > 0.2


def test_what_noise_does_is_taken_off():
    hat = hat_of(np.ones((10, 1)))
    values = np.tile([1.0, -1.0], 5)
    sd, _ = _deviations(values, np.full(10, 0.75), hat, 1.0)
    np.testing.assert_allclose(sd**2, (10.0 - 0.75 * 9.0) / 9.0)


def test_scatter_weighs_each_cell_with_its_own_deviation():
    load, baseline = np.array([1e-4, 9e-4]), np.array([0.0, 4.0])
    scatter = Scatter(0.02, 0.0, 0.0, np.sqrt(load), load, baseline)
    columns = np.ones((2, 3, 2)) * np.array([2.0, 0.5])
    wanted = [[4e-4] * 3, [3.6e-3 + 1.0] * 3]
    np.testing.assert_allclose(scatter.square(columns), wanted, rtol=1e-12)


def test_errors_of_parameters_add_the_trace_of_their_covariance():
    random = np.random.default_rng(5)
    manoeuvre, log = np.repeat(np.arange(5), 2), np.zeros(5, int)
    residual, none = random.standard_normal((10, 4)), np.zeros(3)
    white, plain = (random.standard_normal((10, 4, 4)) for _ in range(2))
    white[..., 0] = plain[..., 0] = 0.0  # no offset
    fitted, judged = (
        LeaveOneOut(Normal.of(columns, residual, manoeuvre), log, (none, none))
        for columns in (white, plain)
    )
    for m, added in enumerate(fitted.of_errors(judged)):
        others, own = white[manoeuvre != m, :, 1:], plain[manoeuvre == m, :, 1:]
        covariance = np.linalg.inv(np.einsum("cmi,cmj->ij", others, others))
        np.testing.assert_allclose(added, np.einsum("cmi,ij,cmj->", own, covariance, own))


def test_equations_are_solved_on_the_directions_that_have_support():
    random = np.random.default_rng(6)
    columns = random.standard_normal((3, 20, 6))
    columns[1, :, 5] = columns[1, :, 4] + 1e-6 * random.standard_normal(20)  # two nearly one
    columns[2, :, 0] = 0.0
    target = random.standard_normal((3, 20))
    gram = np.swapaxes(columns, 1, 2) @ columns
    right = np.einsum("nki,nk->ni", columns, target)
    # a column of zeros makes all of a batch singular, two that are nearly one only themselves
    for found in (solve_scaled(gram, right), solve_scaled(gram[:2], right[:2])):
        for i, solution in enumerate(found):
            scale = np.linalg.norm(columns[i], axis=0)
            scale[scale == 0.0] = np.inf
            wanted = np.linalg.lstsq(columns[i] / scale, target[i], rcond=np.sqrt(RANK))[0] / scale
            np.testing.assert_allclose(solution, wanted, atol=1e-9)


CELLS, ANGLES, NOISE = 40, 128, 2e-6


def base_of(left, slope=None):
    """A base of strain that leaves `left` (C, m), with white noise and one parameter of value 2."""
    phi = np.tile(np.linspace(-np.pi, np.pi, ANGLES), (CELLS, 1))
    cells = SimpleNamespace(
        phi=phi, values=left, observable="strain", member="", label="strain", logs=("a", "b"),
        log=np.arange(CELLS) // (CELLS // 2), regime=np.full(CELLS, "cruise"),
        conditions=SimpleNamespace(speed_m_s=np.where(np.arange(CELLS) % 2, 9.0, 21.0)),
    )  # fmt: skip
    none = np.zeros((CELLS, ANGLES, 0))
    fit = SimpleNamespace(
        prediction=np.zeros_like(left), beside=np.zeros_like(left), freedom=float(left.size),
        names=("stiffness",) if slope is not None else (),
        moving=none if slope is None else np.broadcast_to(slope[:, None], (CELLS, ANGLES, 1)),
    )  # fmt: skip
    model = SimpleNamespace(
        values={"radius_m": 0.3, "stiffness": 2.0}, beside=(), half_length_m=lambda c: 0.06
    )
    noise = Whitener(np.full(left.shape, 1.0 / NOISE), none, np.zeros((CELLS, 0)))
    return SimpleNamespace(cells=cells, fit=fit, model=model, noise=noise)


def noise(seed=3):
    return NOISE * np.random.default_rng(seed).standard_normal((CELLS, ANGLES))


def sizes(base):
    return {(row["of"], row["name"]): row["size"] for row in extra_errors(base)}


def test_noise_needs_none():
    assert set(sizes(base_of(noise())).values()) == {0.0}


def test_an_error_in_one_zone_is_found_there_in_its_size():
    left = noise()
    patch = np.abs(np.linspace(-np.pi, np.pi, ANGLES)) <= 0.1
    left[:, patch] += 5e-6 * np.random.default_rng(4).standard_normal((CELLS, int(patch.sum())))
    found = sizes(base_of(left))
    # the least: two standard deviations of chi-square below the size that was planted
    assert found["zone", "patch"] == pytest.approx(5e-6, rel=0.3)
    assert found["zone", "patch"] < 5.2e-6
    assert found["zone", "entry"] == found["zone", "away"] == 0.0


def test_an_error_of_one_log_is_found_in_that_log():
    left = noise()
    left[CELLS // 2 :] *= 3.0
    found = sizes(base_of(left))
    assert found["log", "a"] == 0.0
    assert found["log", "b"] == pytest.approx(np.sqrt(8.0) * NOISE, rel=0.05)


def test_a_parameter_that_changes_from_cell_to_cell_is_found_by_its_scatter():
    slope = 1e-5 * np.sin(np.linspace(-np.pi, np.pi, ANGLES))
    scatter = np.tile([0.5, -0.5], CELLS // 2)  # of a value of two: a quarter
    found = sizes(base_of(noise() + scatter[:, None] * slope, slope))
    # of 40 cells 40 s^2 / w^2 is left, and so much may be beside what this noise has
    may_be = CELLS * ANGLES + 2.0 * np.sqrt(2.0 * CELLS * ANGLES) - (noise() ** 2).sum() / NOISE**2
    wanted = 0.25 * np.sqrt(CELLS / (CELLS + may_be))
    assert found["parameter", "stiffness"] == pytest.approx(wanted, rel=0.05)
    # an odd slope explains nothing even
    even = 1e-5 * np.cos(np.linspace(-np.pi, np.pi, ANGLES))
    assert sizes(base_of(noise() + even, slope))["parameter", "stiffness"] is None
