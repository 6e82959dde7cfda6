"""Closed form: whitening and held-out solutions against dense linear algebra."""

from dataclasses import replace

import numpy as np

from tests.diagnosis.toy import make_cells, stack
from tirelog.inference.cells.cells import SharedEffects
from tirelog.inference.metric import (
    LeaveOneOut,
    Normal,
    Offsets,
    orthonormal,
    projected_out,
    whitener,
)


def leave_one_out(columns, residual, offset, manoeuvre, log, prior=None):
    columns = np.concatenate([offset[..., None], columns], axis=-1)
    none = np.zeros(columns.shape[-1])
    return LeaveOneOut(
        Normal.of(columns, residual, manoeuvre),
        np.unique(log, return_inverse=True)[1][np.unique(manoeuvre, return_index=True)[1]],
        prior or (none, none),
    )


def test_left_out_solutions_are_those_of_the_other_manoeuvres_with_an_offset_a_log():
    random = np.random.default_rng(0)
    columns, residual = random.standard_normal((12, 5, 3)), random.standard_normal((12, 5))
    offset = 1.0 + 0.2 * random.standard_normal((12, 5))
    manoeuvre, log = (
        np.repeat(np.arange(6), 2),
        np.repeat([4, 4, 7], 4),
    )  # numbers as they come, two manoeuvres or more each
    levelled = leave_one_out(columns, residual, offset, manoeuvre, log)
    both = levelled.left_out()
    (level, *_), theta, loss = both.T, both[:, 1:], levelled.loss(both)
    dense = np.concatenate(
        [columns, offset[..., None] * (log[:, None, None] == np.unique(log))], axis=-1
    )
    for m in range(6):
        keep, out = manoeuvre != m, manoeuvre == m
        wanted = np.linalg.lstsq(
            dense[keep].reshape(-1, 5), residual[keep].reshape(-1), rcond=None
        )[0]
        np.testing.assert_allclose(theta[m], wanted[:3], rtol=1e-9)
        np.testing.assert_allclose(
            level[m], wanted[3 + np.searchsorted([4, 7], log[out][0])], rtol=1e-9
        )
        np.testing.assert_allclose(
            loss[m], ((residual[out] - dense[out] @ wanted) ** 2).sum(), rtol=1e-9
        )


def test_the_step_of_all_data_is_that_of_dense_least_squares_with_an_offset_a_log():
    random = np.random.default_rng(2)
    columns, residual = random.standard_normal((12, 5, 3)), random.standard_normal((12, 5))
    offset = 1.0 + 0.2 * random.standard_normal((12, 5))
    manoeuvre, log = np.repeat(np.arange(6), 2), np.repeat([0, 0, 1], 4)
    both = leave_one_out(columns, residual, offset, manoeuvre, log).step_of_all(2)
    (level, *_), (theta, *_) = both.T, both[:, 1:]
    own = (offset[..., None] * (log[:, None, None] == np.arange(2))).reshape(-1, 2)
    dense = np.concatenate([columns[..., :2].reshape(-1, 2), own], axis=-1)
    wanted = np.linalg.lstsq(dense, residual.reshape(-1), rcond=None)[0]
    alone = np.linalg.lstsq(own, residual.reshape(-1), rcond=None)[0]
    np.testing.assert_allclose(theta, [*wanted[:2], 0.0], rtol=1e-9)
    np.testing.assert_allclose(level, (wanted[2:] - alone)[[0, 0, 0, 0, 1, 1]], rtol=1e-9)


def test_an_offset_that_only_the_held_out_manoeuvre_shows_is_fitted_there():
    random = np.random.default_rng(1)
    columns, log = random.standard_normal((4, 6, 1)), np.array([0, 0, 0, 1])
    residual = 2.0 * columns[..., 0] + np.array([1.0, 1.0, 1.0, 5.0])[:, None]
    both = leave_one_out(columns, residual, np.ones((4, 6)), np.arange(4), log).left_out()
    (level, *_), theta = both.T, both[:, 1:]
    np.testing.assert_allclose([theta[3, 0], level[3], level[0]], [2.0, 5.0, 1.0], rtol=1e-9)


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


def test_random_effects_of_manoeuvres_shrink_along_them_against_the_dense_inverse():
    random = np.random.default_rng(3)
    cells = make_cells(stack(2, manoeuvres=3, m=32))
    cells = replace(cells, manoeuvre=cells.manoeuvre // 2)  # two manoeuvres have cells in common
    own, sd = whitener(cells), np.array([0.01, 0.03])
    columns, x = (random.standard_normal((*cells.phi.shape, k)) for k in (2, 1))
    white = own.with_manoeuvres(cells.manoeuvre, columns, sd)(x)
    for number in range(cells.manoeuvres):
        rows = cells.manoeuvre == number
        effects, before = own(columns)[rows].reshape(-1, 2) * sd, own(x)[rows].ravel()
        covariance = np.eye(before.size) + effects @ effects.T
        square = before @ np.linalg.solve(covariance, before)
        np.testing.assert_allclose((white[rows] ** 2).sum(), square, rtol=1e-9)


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
    level_of_log, amplitudes = offsets.fit(x)
    np.testing.assert_allclose(amplitudes, sized * shared.sd, rtol=1e-7)
    beside = white(shared.columns) @ amplitudes
    rest = (white(np.ones_like(x)) * (x - beside)).sum() / (white(np.ones_like(x)) ** 2).sum()
    np.testing.assert_allclose(level_of_log, [rest], rtol=1e-7)


def test_what_is_known_before_holds_an_effect_that_no_manoeuvre_shows():
    random = np.random.default_rng(12)
    columns, residual = random.standard_normal((4, 6, 2)), random.standard_normal((4, 6))
    columns[..., 1] *= 1e-3
    level, log = np.zeros((4, 6)), np.zeros(4, int)
    prior = (np.array([0.0, 0.0, 1e6]), np.array([0.0, 0.0, 3e6]))
    theta = leave_one_out(columns, residual, level, np.arange(4), log, prior).left_out()[:, 1:]
    np.testing.assert_allclose(theta[:, 1], 3.0, rtol=1e-4)
    others = columns[1:].reshape(-1, 2)
    wanted = np.linalg.solve(
        others.T @ others + np.diag(prior[0][1:]), others.T @ residual[1:].ravel() + prior[1][1:]
    )
    np.testing.assert_allclose(theta[0], wanted, rtol=1e-9)
