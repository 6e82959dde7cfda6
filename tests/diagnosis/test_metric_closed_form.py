"""Closed form: whitening, scatter and held-out solutions against dense linear algebra."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.toy import make_cells, stack
from tirelog.diagnosis.candidates.assessment import Variant, flip_test, scores_of
from tirelog.inference.cells.cells import SharedEffects
from tirelog.inference.floor import Scatter, _deviations, agreement
from tirelog.inference.metric import (
    RANK,
    LeaveOneOut,
    Normal,
    Offsets,
    orthonormal,
    projected_out,
    shrinkage,
    solve_scaled,
    whitener,
)


def leave_one_out(columns, residual, offsets, manoeuvre, log, prior=None):
    """Of columns (C, m, p) behind offsets (C, m, n) of the manoeuvres' logs (M,)."""
    none = np.zeros(columns.shape[-1])
    normal = Normal.of(np.concatenate([offsets, columns], axis=-1), residual, manoeuvre)
    return LeaveOneOut(normal, np.asarray(log), prior or (none, none), offsets.shape[-1])


@pytest.mark.parametrize("observables", [1, 2])
def test_solutions_without_each_manoeuvre_are_those_of_dense_least_squares(observables):
    """With an offset for each log and observable, and so is the step of all data."""
    random = np.random.default_rng(observables)
    columns, residual = random.standard_normal((24, 5, 3)), random.standard_normal((24, 5))
    manoeuvre, of_log = np.repeat(np.arange(6), 4), np.array([0, 0, 0, 1, 1, 1])
    part, log = np.arange(24) % observables, of_log[manoeuvre]
    own = 1.0 + 0.2 * random.standard_normal((24, 5, 1))
    offsets = own * (part[:, None, None] == np.arange(observables))
    normal = leave_one_out(columns, residual, offsets, manoeuvre, of_log)
    both, of_all = normal.left_out(), normal.step_of_all(2)
    loss = normal.loss(both)
    levels = own * ((observables * log + part)[:, None, None] == np.arange(2 * observables))
    dense = np.concatenate([columns, levels], axis=-1)

    def solution(rows, *kept):
        design = np.concatenate([dense[rows][..., list(kept)], dense[rows][..., 3:]], axis=-1)
        design = design.reshape(-1, design.shape[-1])
        return np.linalg.lstsq(design, residual[rows].ravel(), rcond=None)[0]

    everything = np.ones(24, bool)
    step, alone = solution(everything, 0, 1), solution(everything)
    np.testing.assert_allclose(of_all[0, observables:], [*step[:2], 0.0], rtol=1e-9)
    for m in range(6):
        mine = np.arange(observables) + observables * of_log[m]
        np.testing.assert_allclose(of_all[m, :observables], (step[2:] - alone)[mine], rtol=1e-9)
        wanted, out = solution(manoeuvre != m, 0, 1, 2), manoeuvre == m
        np.testing.assert_allclose(both[m, observables:], wanted[:3], rtol=1e-9)
        np.testing.assert_allclose(both[m, :observables], wanted[3 + mine], rtol=1e-9)
        left = residual[out] - dense[out] @ wanted
        np.testing.assert_allclose(loss[m], (left**2).sum(), rtol=1e-9)


def test_an_offset_that_only_the_held_out_manoeuvre_shows_is_fitted_there():
    random = np.random.default_rng(1)
    columns, log = random.standard_normal((4, 6, 1)), [0, 0, 0, 1]
    residual = 2.0 * columns[..., 0] + np.array([1.0, 1.0, 1.0, 5.0])[:, None]
    both = leave_one_out(columns, residual, np.ones((4, 6, 1)), np.arange(4), log).left_out()
    np.testing.assert_allclose([*both[3], both[0, 0]], [5.0, 2.0, 1.0], rtol=1e-9)


def test_whitened_values_have_the_covariance_one():
    """Noise, the random effects of revolutions, and a shift that is free; as dense matrices."""
    cells = make_cells(stack(1, manoeuvres=2, m=32))
    white = whitener(cells, discrepancy=1e-6)
    operator = white(np.broadcast_to(np.eye(32), (len(cells), 32, 32)).copy())
    for c, own in enumerate(operator):
        covariance = np.diag(cells.sd[c] ** 2 + 1e-6)
        covariance += cells.random[c] @ cells.random_cov[c] @ cells.random[c].T
        covariance += 0.05**2 * np.outer(cells.shift[c], cells.shift[c])
        np.testing.assert_allclose(own @ covariance @ own.T, np.eye(32), atol=1e-6)


def test_shared_effects_shrink_as_their_covariance_says():
    """x' (I + B S^2 B')^-1 x, offsets projected out, against the dense matrices."""
    random = np.random.default_rng(11)
    cells = make_cells(stack(1, manoeuvres=4, m=32))
    shared = SharedEffects(
        random.standard_normal((*cells.phi.shape, 3)) * np.array([1e-3, 1.0, 1e3]),
        np.array([200.0, 0.3, 1e-5]),
        ("a", "b", "c"),
        ("one", "one", "two"),
    )
    white = whitener(cells)
    offsets = Offsets.of(replace(cells, shared=shared), white)
    x = random.standard_normal(cells.phi.shape)
    level = orthonormal(white(np.ones((*cells.phi.shape, 1))))
    columns = projected_out(level, white(shared.columns) * shared.sd).reshape(-1, 3)
    left = projected_out(level, x).ravel()
    inverse = np.linalg.inv(np.eye(left.size) + columns @ columns.T)
    found = offsets.without(x)
    np.testing.assert_allclose((found**2).sum(), left @ inverse @ left, rtol=1e-9)
    sized = columns.T @ inverse @ left
    basis, _, turn = shrinkage(columns)
    np.testing.assert_allclose(turn @ (basis.T @ left), sized, rtol=1e-7)
    ones = white(np.ones_like(x))
    np.testing.assert_allclose(offsets.of_logs(x), (ones * x).sum() / (ones**2).sum(), rtol=1e-9)


def test_a_strength_that_does_what_the_model_does_adds_nothing_to_the_evidence():
    random = np.random.default_rng(9)
    cells = make_cells(stack(5, manoeuvres=4, m=32))
    slopes, column = random.standard_normal((2, *cells.phi.shape, 1))
    fit = SimpleNamespace(moving=slopes, prediction=np.zeros(cells.phi.shape))
    base = SimpleNamespace(cells=cells, white=whitener(cells), fit=fit)
    both = np.concatenate([column, 3.0 * slopes], axis=-1)
    of_both, alone = (
        Variant(SimpleNamespace(id="wear"), ("a", "b")[: x.shape[-1]], {}, x, False)
        for x in (both, column)
    )
    _, (scores, wanted), _ = scores_of(base, [of_both, alone])
    np.testing.assert_allclose(scores.step(), [wanted.step()[0], 0.0], rtol=1e-9, atol=1e-12)
    found, expected = flip_test([scores], 4), flip_test([wanted], 4)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_what_is_known_before_holds_an_effect_that_no_manoeuvre_shows():
    random = np.random.default_rng(12)
    columns, residual = random.standard_normal((4, 6, 2)), random.standard_normal((4, 6))
    columns[..., 1] *= 1e-3
    prior = (np.array([0.0, 1e6]), np.array([0.0, 3e6]))
    none = np.zeros((4, 6, 1))
    theta = leave_one_out(columns, residual, none, np.arange(4), np.zeros(4, int), prior).left_out()
    np.testing.assert_allclose(theta[:, 2], 3.0, rtol=1e-4)
    others = columns[1:].reshape(-1, 2)
    wanted = np.linalg.solve(
        others.T @ others + np.diag(prior[0]), others.T @ residual[1:].ravel() + prior[1]
    )
    np.testing.assert_allclose(theta[0, 1:], wanted, rtol=1e-9)


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
