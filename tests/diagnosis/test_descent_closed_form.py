"""Closed form: the one descent and the one error formula, on problems whose answers are known."""

import numpy as np
import pytest

from tirelog.errors import ModelError
from tirelog.inference.fit.cells import descend, errors_of

RANDOM = np.random.default_rng(7)
X = RANDOM.standard_normal((60, 3)) * [1.0, 1e-3, 1e4]
TRUTH = np.array([2.0, -3e3, 5e-4])
Y = X @ TRUTH + 0.1 * RANDOM.standard_normal(60)
LOW, HIGH = np.full(3, -1e9), np.full(3, 1e9)


class Line:
    """Y less X theta; what lies beyond `edge` in the first number is refused."""

    def __init__(self, edge=np.inf):
        self.edge = edge

    def residual(self, theta):
        if theta[0] > self.edge:
            raise ModelError("beyond")
        return Y - X @ theta

    def slopes(self, theta, size):
        return X * size

    def square(self, theta):
        return np.inf if theta[0] > self.edge else float((self.residual(theta) ** 2).sum())


def sizes(theta):
    return np.maximum(np.abs(theta), np.abs(TRUTH))


def test_a_line_is_fitted_as_least_squares_fits_it():
    reached = descend(Line(), np.zeros(3), LOW, HIGH, sizes, settled=1e-12)
    wanted, square, _, _ = np.linalg.lstsq(X, Y, rcond=None)
    assert reached.settled
    assert reached.theta == pytest.approx(wanted, rel=1e-6)
    assert reached.square == pytest.approx(square[0], rel=1e-9)


def test_a_bound_is_kept_and_the_others_are_fitted_beside_it():
    high = np.array([1.5, 1e9, 1e9])
    reached = descend(Line(), np.zeros(3), LOW, high, sizes, settled=1e-12)
    others = np.linalg.lstsq(X[:, 1:], Y - 1.5 * X[:, 0], rcond=None)[0]
    assert reached.theta[0] == 1.5
    assert reached.theta[1:] == pytest.approx(others, rel=1e-6)


def test_a_refused_point_is_a_step_too_far_and_a_refused_start_an_error():
    reached = descend(Line(edge=1.9), np.zeros(3), LOW, HIGH, sizes)
    assert 1.0 < reached.theta[0] <= 1.9
    with pytest.raises(ModelError, match="beyond"):
        descend(Line(edge=-1.0), np.zeros(3), LOW, HIGH, sizes)


class Kept(Line):
    """The same, with slopes of the wrong size in one number until they are renewed."""

    wrong = True

    def slopes(self, theta, size):
        return X * size * ([1.0, 40.0, 1.0] if self.wrong else [1.0, 1.0, 1.0])

    def renewed(self):
        was, self.wrong = self.wrong, False
        return was


def test_a_descent_with_kept_slopes_ends_where_new_ones_lead():
    kept = Kept()
    reached = descend(kept, np.zeros(3), LOW, HIGH, sizes, settled=1e-3, renewed=kept.renewed)
    wanted, square, _, _ = np.linalg.lstsq(X, Y, rcond=None)
    assert reached.settled
    assert reached.square == pytest.approx(square[0], rel=1e-6)
    assert reached.theta == pytest.approx(wanted, rel=1e-4)


def test_errors_are_those_of_the_normal_equations():
    known = errors_of(X, 0.04)
    assert known.covariance == pytest.approx(0.04 * np.linalg.inv(X.T @ X), rel=1e-8)
    assert known.se == pytest.approx(np.sqrt(np.diag(known.covariance)))
    assert known.undetermined("abc") == []


def test_what_the_data_do_not_see_has_no_error_and_is_named():
    slopes = np.column_stack([X, 3.0 * X[:, 1], np.zeros(60)])
    known = errors_of(slopes, 1.0)
    assert np.isinf(known.se).tolist() == [False, True, False, True, True]
    assert sorted(known.undetermined("abcde")) == [("b", "d"), ("e",)]
    assert known.se[[0, 2]] == pytest.approx(errors_of(X, 1.0).se[[0, 2]], rel=1e-6)
