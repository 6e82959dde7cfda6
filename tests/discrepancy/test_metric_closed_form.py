"""Whitening and held-out solutions against dense linear algebra."""

import numpy as np

from tests.discrepancy.toy import stack
from tirelog.discrepancy.cells import make_cells
from tirelog.discrepancy.projection import Normal, left_out, orthonormal, solve_scaled, without
from tirelog.discrepancy.whitening import whitener


def test_whitener_is_the_inverse_root_of_noise_and_random_effects():
    cells = make_cells(stack(1, manoeuvres=2, m=32))
    white = whitener(cells, discrepancy=1e-6)
    m = cells.values.shape[1]
    operator = white(np.broadcast_to(np.eye(m), (len(cells), m, m)).copy())
    for c in range(len(cells)):
        covariance = np.diag(cells.sd[c] ** 2 + 1e-6) + cells.random[c] @ cells.random_cov[c] @ cells.random[c].T
        covariance += 0.05**2 * np.outer(cells.shift[c], cells.shift[c])
        np.testing.assert_allclose(operator[c] @ covariance @ operator[c].T, np.eye(m), atol=1e-6)


def test_random_effects_of_manoeuvres_tie_their_cells_together():
    cells = make_cells(stack(2, manoeuvres=3, m=32))
    own = whitener(cells)
    columns = np.ones((*cells.values.shape, 1))
    white = own.with_manoeuvres(cells.manoeuvre, columns, np.array([0.01]))
    for number in range(cells.manoeuvres):
        rows = np.flatnonzero(cells.manoeuvre == number)
        before = own(columns)[rows].reshape(-1)
        after = white(columns)[rows].reshape(-1)
        size = before @ before
        np.testing.assert_allclose(after, before / np.sqrt(1.0 + 0.01**2 * size), rtol=1e-9)


def test_left_out_solutions_are_those_of_the_other_manoeuvres():
    random = np.random.default_rng(0)
    columns, residual = random.standard_normal((12, 5, 3)), random.standard_normal((12, 5))
    manoeuvre = np.repeat(np.arange(4), 3)
    normal = Normal.of(columns, residual, manoeuvre)
    theta = left_out(normal, np.zeros(3, bool))
    for m in range(4):
        keep, out = manoeuvre != m, manoeuvre == m
        wanted = np.linalg.lstsq(columns[keep].reshape(-1, 3), residual[keep].reshape(-1), rcond=None)[0]
        np.testing.assert_allclose(theta[m], wanted, rtol=1e-9)
        loss = ((residual[out] - columns[out] @ wanted) ** 2).sum()
        np.testing.assert_allclose(normal.loss(theta)[m], loss, rtol=1e-9)


def test_an_offset_that_only_the_held_out_manoeuvre_shows_is_fitted_there():
    random = np.random.default_rng(1)
    columns = np.zeros((4, 6, 2))
    columns[..., 0] = random.standard_normal((4, 6))
    columns[3, :, 1] = 1.0
    residual = 2.0 * columns[..., 0] + 5.0 * columns[..., 1]
    theta = left_out(Normal.of(columns, residual, np.arange(4)), np.array([False, True]))
    np.testing.assert_allclose(theta[3], [2.0, 5.0], rtol=1e-9)


def test_projection_leaves_nothing_in_the_span_and_ignores_scale():
    random = np.random.default_rng(2)
    columns = random.standard_normal((6, 7, 3)) * np.array([1e-9, 1.0, 1e9])
    basis = orthonormal(columns)
    np.testing.assert_allclose(basis.T @ basis, np.eye(3), atol=1e-12)
    left = without(basis, columns)
    assert np.abs(left / np.array([1e-9, 1.0, 1e9])).max() < 1e-9


def test_solve_scaled_leaves_unsupported_directions_at_zero():
    gram = np.diag([4.0, 0.0])
    np.testing.assert_allclose(solve_scaled(gram, np.array([8.0, 0.0])), [2.0, 0.0])
