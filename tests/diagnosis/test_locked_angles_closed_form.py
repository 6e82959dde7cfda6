"""Samples that lock to fixed angles: the mean waveform of a cell follows the truth, however close
two bins' angles are.
"""

import numpy as np

from tests.diagnosis.toy import waveform
from tirelog.inference.cells.pieces import one_waveform


def locked_revolutions(
    seed: int, k: int = 75, m: int = 256, noise: float = 0.004
) -> tuple[np.ndarray, ...]:
    """Values, angles and counts (k, m): at a bin's edge on the flank nearly all samples lie to one
    side, two of them to the other.
    """
    random = np.random.default_rng(seed)
    width = 2.0 * np.pi / m
    grid = (np.arange(m) + 0.5) * width - np.pi
    phi = np.broadcast_to(grid, (k, m)).copy()
    count = np.ones((k, m), np.int64)
    edge = int(np.searchsorted(grid, 0.2))
    phi[:, edge] = grid[edge] - 0.48 * width
    phi[:, edge - 1] = grid[edge - 1] + 0.46 * width
    count[:-2, edge - 1] = 0
    count[-2:, edge] = 0
    size = 1.0 + 0.03 * random.standard_normal((k, 1))
    values = size * (waveform(phi) + noise * random.standard_normal((k, m)))
    return np.where(count > 0, values, np.nan), phi, count


def test_two_bins_at_one_place_do_not_make_a_slope():
    for seed in range(8):
        values, phi, count = locked_revolutions(seed)
        part = one_waveform(values, phi, np.zeros_like(phi), count, np.full(len(values), 20.0))
        truth = waveform(part.phi)
        near = np.abs(part.phi) < 0.4
        assert (
            np.abs(part.mean - truth * np.mean(part.mean * truth) / np.mean(truth**2))[near].max()
            < 0.02
        )
        steepest = np.abs(np.gradient(waveform(part.phi), part.phi)).max()
        assert np.abs(part.shift).max() < 1.3 * steepest
