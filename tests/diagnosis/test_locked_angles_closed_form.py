"""Closed form: means follow the truth when samples lock to fixed angles."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.toy import make_cells, stack, waveform
from tirelog.data.recording import Channel, Conditions, TimeAxis
from tirelog.inference.cells.pieces import one_waveform
from tirelog.inference.floor import at_mean_speed
from tirelog.inference.stacks.align import Samples, refine_passages
from tirelog.physics.model.model import Model


def locked_revolutions(seed, k=75, m=256, noise=0.004):
    """Values, angles, counts (k, m): nearly all samples lie to one side of a bin's edge."""
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
        given = values, phi, np.zeros_like(phi), count, np.full(len(values), 20.0)
        part = SimpleNamespace(**one_waveform(*given))
        truth = waveform(part.phi)
        near = np.abs(part.phi) < 0.4
        size = np.mean(part.values * truth) / np.mean(truth**2)
        assert np.abs(part.values - truth * size)[near].max() < 0.02
        steepest = np.abs(np.gradient(waveform(part.phi), part.phi)).max()
        assert np.abs(part.shift).max() < 1.3 * steepest


def constant_wheel(samples_per_turn, turns=60, rate_Hz=2500.0):
    """Values of a wheel at constant speed, and its passage times."""
    period = samples_per_turn / rate_Hz
    time = np.arange(int(turns * samples_per_turn)) / rate_Hz
    values = waveform(2.0 * np.pi * (time / period - 0.3))
    values += 1e-4 * np.random.default_rng(1).standard_normal(time.size)
    return values, period * (0.3 + np.arange(turns))


def toy_samples(values, rate_Hz=2500.0):
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


def two_cruises(samples, k=40, m=256):
    """Angles and counts (2 k, m) of two cruises half a sample apart, and which are the first's."""
    phi, count = np.zeros((2 * k, m)), np.zeros((2 * k, m), np.int64)
    first = np.arange(2 * k) < k
    for rows, number, start in ((first, samples[0], 0.25), (~first, samples[1], 0.75)):
        angle = (np.arange(number) + start) * 2.0 * np.pi / number - np.pi
        place = ((angle + np.pi) * m / (2.0 * np.pi)).astype(int)
        phi[np.ix_(rows, place)], count[np.ix_(rows, place)] = angle, 1
    return phi, count, first


@pytest.mark.parametrize("samples", [128, 150])
def test_what_revolutions_between_those_of_others_have_more_of_is_seen(samples):
    phi, count, first = two_cruises((samples, samples))
    random = np.random.default_rng(3)
    size = np.where(first, 0.99, 1.01)[:, None]
    values = size * waveform(phi) + 0.002 * random.standard_normal(phi.shape)
    part = one_waveform(
        np.where(count > 0, values, np.nan), phi, np.zeros_like(phi), count, np.full(len(phi), 26.0)
    )
    amplitude = part["coefficients"][:, 0]
    assert amplitude[~first].mean() - amplitude[first].mean() == pytest.approx(0.02, abs=1e-3)


def test_speeds_at_either_side_of_a_bin_leave_the_waveform_of_the_mean_speed():
    """Without noise: values of a model, whose waveform another speed changes, at both speeds."""
    model = Model.new("beam", radius_m=0.3)
    phi, count, slower = two_cruises((181, 179))
    speed = np.where(slower, 26.0, 26.3)
    made = stack(1, manoeuvres=1, revolutions=len(speed), m=phi.shape[1])
    driven = Conditions.of(len(speed), speed_m_s=speed, acceleration_m_s2=0.0, time_s=0.0)
    values = model.predict(driven, phi)
    seen, at = (np.where(count > 0, x, np.nan) for x in (values, phi))
    cells = make_cells(replace(made, values=seen, phi_mean=at, count=count, conditions=driven))
    prediction = model.predict(cells.conditions, surface=cells.surface, **cells.angles)
    fit = SimpleNamespace(model=model, prediction=prediction)
    left = at_mean_speed(cells, fit).values - prediction  # type: ignore[arg-type]
    columns = np.concatenate([cells.random, cells.shift[..., None]], axis=-1)[0]
    full = np.isfinite(left[0])
    left, columns = left[0, full], columns[full]
    left = left - columns @ np.linalg.lstsq(columns, left, rcond=None)[0]
    both = cells.phi_variance[0, full] > 2e-5  # a sample of either cruise in the bin
    assert both.sum() > 40
    assert np.abs(left[both]).max() < 2e-5 * np.ptp(values[count > 0])
