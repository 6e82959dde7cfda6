"""Samples that lock to fixed angles: the mean waveform of a cell follows the truth, however close
two bins' angles are.
"""

import numpy as np
import pytest

from tests.diagnosis.toy import waveform
from tirelog.data.recording import Channel, TimeAxis
from tirelog.inference.cells.pieces import one_waveform
from tirelog.inference.stacks.align import refine_passages
from tirelog.inference.stacks.samples import Samples
from tirelog.vocabulary.arrays import FloatArray


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


def constant_wheel(
    samples_per_turn: float, turns: int = 60, rate_Hz: float = 2500.0
) -> tuple[FloatArray, FloatArray]:
    """Values of a wheel at constant speed, and its passage times."""
    period = samples_per_turn / rate_Hz
    time = np.arange(int(turns * samples_per_turn)) / rate_Hz
    values = waveform(2.0 * np.pi * (time / period - 0.3))
    values += 1e-4 * np.random.default_rng(1).standard_normal(time.size)
    return values, period * (0.3 + np.arange(turns))


def toy_samples(values: FloatArray, rate_Hz: float = 2500.0) -> Samples:
    return Samples(
        Channel.of_array("toy", "strain", values, TimeAxis.uniform(values.size, rate_Hz))
    )


@pytest.mark.parametrize(("samples_per_turn", "classes"), [(199.5, 2), (184.0 + 2.0 / 3.0, 3)])
def test_turns_whose_samples_lie_between_those_of_others_are_not_shifted_against_them(
    samples_per_turn, classes
):
    values, truth = constant_wheel(samples_per_turn)
    shifted = truth + 3e-5 * (np.arange(truth.size) % classes == 0)
    error = (refine_passages(toy_samples(values), shifted) - truth)[2:-2]
    assert np.ptp(error) < 3e-6


@pytest.mark.parametrize("wrong", [0, 30, 59])
def test_a_passage_with_half_of_its_front_lost_lies_on_the_course_of_the_others(wrong):
    values, truth = constant_wheel(311.7)
    at = int(truth[wrong] * 2500.0)
    values[at - 26 : at + 9] = np.nan
    rough = truth.copy()
    rough[wrong] += 0.0055
    error = refine_passages(toy_samples(values), rough) - truth
    assert np.ptp(error[max(0, wrong - 3) : wrong + 4]) < 5e-5
