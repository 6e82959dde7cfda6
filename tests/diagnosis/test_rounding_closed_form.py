"""Closed form: how well means of values in steps are known, against known truth."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.test_together_closed_form import SPEEDS, measured
from tests.diagnosis.toy import make_cells, stack, waveform
from tirelog.data.recording import Channel, TimeAxis
from tirelog.inference.cells.cells import scatter_of_numbers
from tirelog.inference.stacks.align import step_of


def locked(noise, seed, level=0.5):
    """Revolutions in steps of one, always sampled at the same angles, and the truth (C, m)."""
    random = np.random.default_rng(seed)
    made = stack(seed, manoeuvres=4, revolutions=75, m=128)
    moved = made.phi_rad + random.uniform(-0.4, 0.4, (4, 128)) * 2 * np.pi / 128
    phi = np.repeat(moved, 75, axis=0)
    truth = 3000.0 * (waveform(phi) + level * np.cos(phi))
    values = np.round(truth + noise * random.standard_normal(truth.shape))
    none, ones = np.zeros_like(phi), np.ones(phi.shape, np.int64)
    named = {"phi_mean": phi, "phi_variance": none, "count": ones, "step": 1.0}
    return replace(made, values=values, **named), truth[::75]


@pytest.mark.parametrize("noise", [0.05, 0.2, 0.3, 0.6])
def test_means_of_locked_samples_have_the_error_that_is_said(noise):
    ratio = []
    for seed in range(3):
        revolutions, truth = locked(noise, seed)
        cells = make_cells(revolutions)
        far = np.abs(revolutions.phi_rad) > 1.2
        error = (cells.values - truth)[:, far]
        ratio.append(np.mean((error / cells.sd[:, far]) ** 2))
    assert 0.8 < np.mean(ratio) < 1.25


def test_a_single_revolution_is_never_nearer_than_its_steps():
    revolutions, _ = locked(0.05, seed=2)
    cells = make_cells(revolutions)
    assert np.mean(cells.within) > 0.9 / 12.0
    assert np.mean(make_cells(replace(revolutions, step=0.0)).within) < 0.5 / 12.0
    np.testing.assert_allclose(cells.rounding, 1.0 / 12.0, rtol=1e-12)


@pytest.mark.parametrize("step", [1e-3, 1e-4])
def test_the_step_of_a_grating_is_found(step):
    random = np.random.default_rng(3)
    wavelength = 1550.0 + 1.5 * waveform(np.arange(20_000) * 0.013)
    wavelength = step * np.round((wavelength + 3e-4 * random.standard_normal(20_000)) / step)
    wavelength[500:600] = np.nan
    strain = 1.27 * (wavelength / 1550.0 - 1.0)
    axis = TimeAxis.uniform(strain.size, 2500.0)
    found, level = step_of(Channel.of_array("a", "strain", strain, axis))
    assert found == pytest.approx(1.27 * step / 1550.0, rel=1e-6)
    steps = (strain[np.isfinite(strain)] - level) / found
    np.testing.assert_allclose(steps, np.round(steps), atol=0.02)
    smooth = strain + 1e-7 * random.standard_normal(strain.size)
    assert step_of(Channel.of_array("a", "strain", smooth, axis)) == (0.0, 0.0)


def test_values_that_are_few_or_lost_have_no_step():
    axis = TimeAxis.uniform(1000, 2500.0)
    for values in (np.full(1000, np.nan), np.zeros(1000), np.arange(1000) % 5.0):
        assert step_of(Channel.of_array("a", "strain", values, axis)) == (0.0, 0.0)
    empty = Channel.of_array("a", "strain", np.zeros(0), TimeAxis.uniform(0, 2500.0))
    assert step_of(empty) == (0.0, 0.0)


@pytest.mark.parametrize("alike", [0.0, 0.7])
def test_means_of_neighbours_that_are_alike(alike):
    """Half of the manoeuvres are long, of 32 revolutions, the others of four and eight."""
    rng, squares, scatters = np.random.default_rng(1077), [], []
    stack = measured("phase_shift", 1, repeats=32)
    lengths = [32] * 4 + [4, 8, 4, 8, 4, 4] * 4
    which = np.repeat(np.arange(len(lengths)), lengths)
    assert which.size == 32 * SPEEDS.size
    for _ in range(60):
        white = rng.standard_normal(which.size + 1)
        values = (white[1:] + alike * white[:-1]) / np.hypot(1.0, alike)
        cells = make_cells(replace(stack, values=1e-3 * values[:, None], manoeuvre=which))
        squares.append((cells.values / cells.sd) ** 2)
        scatters.append(np.sqrt(cells.within))
    assert np.mean(np.concatenate(squares)) == pytest.approx(1.0, abs=0.12)
    assert np.mean(np.concatenate(scatters)) == pytest.approx(1e-3, rel=0.05)


def test_a_piece_without_a_scatter_has_that_of_all():
    differ = np.exp(0.8 * np.random.default_rng(1).standard_normal((300, 1)))
    pieces = SimpleNamespace(scatter=0.5 * differ, count=np.full((300, 1), 12.0))
    pieces.scatter[7] = np.nan
    assert 0.3 < scatter_of_numbers(pieces)[7, 0] < 0.6  # 0.12 as if it had told something
    pieces.scatter[:] = np.nan
    assert np.isnan(scatter_of_numbers(pieces)).all()
