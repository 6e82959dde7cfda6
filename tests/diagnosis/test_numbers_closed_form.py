"""Closed form: means of numbers per revolution are known as well as they scatter."""

from dataclasses import replace

import numpy as np
import pytest

from tests.diagnosis.test_together_closed_form import SPEEDS, measured
from tests.diagnosis.toy import make_cells

SCATTER = 1e-3


@pytest.mark.parametrize("alike", [0.0, 0.7])
def test_means_of_neighbours_that_are_alike(alike):
    """Half of the manoeuvres are long, of 32 revolutions, the others of four and eight. (With each
    piece's own scatter, as if neighbours were not alike, chi-square is 1.6 and 3.3.)
    """
    rng, squares, scatters = np.random.default_rng(1077), [], []
    stack = measured("phase_shift", 1, repeats=32)
    lengths = [32] * 4 + [4, 8, 4, 8, 4, 4] * 4
    which = np.repeat(np.arange(len(lengths)), lengths)
    assert which.size == 32 * SPEEDS.size
    for _ in range(60):
        white = rng.standard_normal(which.size + 1)
        values = (white[1:] + alike * white[:-1]) / np.hypot(1.0, alike)
        cells = make_cells(replace(stack, values=SCATTER * values[:, None], manoeuvre=which))
        squares.append((cells.values / cells.sd) ** 2)
        scatters.append(np.sqrt(cells.within))
    assert np.mean(np.concatenate(squares)) == pytest.approx(1.0, abs=0.12)
    assert np.mean(np.concatenate(scatters)) == pytest.approx(SCATTER, rel=0.05)
