"""Closed form: scatter of manoeuvres, and its errors."""

import numpy as np

from tirelog.inference.floor import Scatter, _deviations, agreement
from tirelog.inference.metric import RANK, LeaveOneOut, Normal, solve_scaled


def hat_of(columns):
    return columns @ np.linalg.pinv(columns)


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
