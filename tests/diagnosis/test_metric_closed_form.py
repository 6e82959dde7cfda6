"""Closed form: whitening, scatter and held-out solutions against dense linear algebra."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from tests.diagnosis.toy import make_cells, stack
from tirelog.diagnosis.candidates.assessment import Variant, flip_test, scores_of
from tirelog.inference.cells.cells import SharedEffects
from tirelog.inference.floor import agreement
from tirelog.inference.metric import (
    LeaveOneOut,
    Normal,
    Offsets,
    orthonormal,
    projected_out,
    shrinkage,
    whitener,
)


def leave_one_out(columns, residual, offsets, manoeuvre, log, prior=None):
    """Of columns (C, m, p) behind offsets (C, m, n) of the manoeuvres' logs (M,)."""
    none = np.zeros(columns.shape[-1])
    normal = Normal.of(np.concatenate([offsets, columns], axis=-1), residual, manoeuvre)
    return LeaveOneOut(normal, np.asarray(log), prior or (none, none), offsets.shape[-1])


def test_an_offset_that_only_the_held_out_manoeuvre_shows_is_fitted_there():
    random = np.random.default_rng(1)
    columns, log = random.standard_normal((4, 6, 1)), [0, 0, 0, 1]
    residual = 2.0 * columns[..., 0] + np.array([1.0, 1.0, 1.0, 5.0])[:, None]
    both = leave_one_out(columns, residual, np.ones((4, 6, 1)), np.arange(4), log).left_out()
    np.testing.assert_allclose([*both[3], both[0, 0]], [5.0, 2.0, 1.0], rtol=1e-9)


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


def test_what_follows_the_speed_in_one_manoeuvre_alone_follows_it_in_none():
    manoeuvre = np.repeat(np.arange(12), 5)
    log = np.repeat([0, 1], 30)
    alike = 1.0 + 0.1 * np.random.default_rng(8).standard_normal(60)
    # of 4,096 flips four are as alike: each of the two logs up or down as a whole
    assert abs(agreement(alike, manoeuvre, log) - 4 / 4096) < 0.002
    assert agreement(np.where(log, -alike, alike), manoeuvre, log) < 0.003
    lone = alike * np.repeat([9.0, -1.0, 1.0, -2.0, 1.0, -1.0, 1.0, -1.0, 2.0, -8.0, 1.0, -1.0], 5)
    assert agreement(lone, manoeuvre, log) > 0.2


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
