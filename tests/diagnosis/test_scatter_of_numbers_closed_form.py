"""Closed form: the scatter of numbers per revolution, by piece; a few revolutions do not tell the
scatter of their own piece.
"""

from dataclasses import dataclass

import numpy as np
import pytest

from tirelog.inference.cells.cells import scatter_of_numbers
from tirelog.inference.cells.pieces import without_line


@dataclass
class Pieces:
    """What is read of pieces: their scatter (P, 1) and how many values each has (P, 1)."""

    scatter: np.ndarray
    count: np.ndarray


def drawn(true_sd, number, seed=0):
    """Pieces of `number` revolutions each, and their means (P,)."""
    rng = np.random.default_rng(seed)
    values = [sd * rng.standard_normal(number) for sd in true_sd]
    left = [without_line(v) for v in values]
    scatter = np.array([[np.sqrt(one @ one / (number - 2))] for one in left])
    pieces = Pieces(scatter, np.full(scatter.shape, float(number)))
    return pieces, np.array([v.mean() for v in values])


def chi2(true_sd, number):
    pieces, means = drawn(true_sd, number)
    found = scatter_of_numbers(pieces)[:, 0]
    return float(np.mean(means**2 / (found**2 / number)))


@pytest.mark.parametrize("number", [4, 5, 8])
def test_chi_square_of_alike_pieces_is_one(number):
    """By their own scatter it would be (n - 1) / (n - 3): 3 of four revolutions."""
    assert chi2(np.full(4000, 0.02), number) == pytest.approx(1.0, abs=0.07)


def test_chi_square_of_pieces_that_differ_stays_near_one():
    """By a factor of two in the scatter, as from slow to fast."""
    true = np.exp(0.3 * np.random.default_rng(1).standard_normal(4000))
    assert chi2(true, 5) == pytest.approx(1.15, abs=0.15)


def test_a_piece_without_a_scatter_has_that_of_all():
    pieces, _ = drawn(np.full(300, 0.5), 12)
    pieces.scatter[7] = np.nan
    found = scatter_of_numbers(pieces)[:, 0]
    assert found[7] == pytest.approx(0.5, rel=0.05)
    pieces.scatter[:] = np.nan
    assert np.isnan(scatter_of_numbers(pieces)).all()
