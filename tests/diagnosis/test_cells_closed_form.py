"""Closed form: means of bins and cells, and their errors, against known truth."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks.cases import Case, case
from tests.diagnosis.test_long_logs_property import same
from tests.diagnosis.test_together_closed_form import SPEEDS, measured
from tests.diagnosis.toy import channel, make_cells, stack, waveform
from tirelog.data.recording import Channel, Conditions, Recording, TimeAxis
from tirelog.data.setup import Setup, Tire
from tirelog.inference import floor
from tirelog.inference.base import prepare
from tirelog.inference.cells.cells import cells_of, scatter_of_numbers
from tirelog.inference.cells.pieces import one_waveform, pieces_of_all
from tirelog.inference.floor import at_mean_speed, held_out_losses
from tirelog.inference.stacks.align import (
    PassageAngle,
    Samples,
    refine_passages,
    split_turns,
    step_of,
)
from tirelog.inference.stacks.cut import joined, stacks_from_logs
from tirelog.physics.model.model import Model
from tirelog.simulation import simulate, to_recording


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
    prediction = model.predict(cells.conditions, cells.angles, surface=cells.surface)
    fit = SimpleNamespace(model=model, prediction=prediction)
    left = at_mean_speed(cells, fit).values - prediction  # type: ignore[arg-type]
    columns = np.concatenate([cells.random, cells.shift[..., None]], axis=-1)[0]
    full = np.isfinite(left[0])
    left, columns = left[0, full], columns[full]
    left = left - columns @ np.linalg.lstsq(columns, left, rcond=None)[0]
    both = cells.phi_variance[0, full] > 2e-5  # a sample of either cruise in the bin
    assert both.sum() > 40
    assert np.abs(left[both]).max() < 2e-5 * np.ptp(values[count > 0])


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
    found = step_of(Channel.of_array("a", "strain", strain, axis))
    assert found == pytest.approx(1.27 * step / 1550.0, rel=1e-6)
    smooth = strain + 1e-7 * random.standard_normal(strain.size)
    assert step_of(Channel.of_array("a", "strain", smooth, axis)) == 0.0


def test_values_that_are_few_or_lost_have_no_step():
    axis = TimeAxis.uniform(1000, 2500.0)
    for values in (np.full(1000, np.nan), np.zeros(1000), np.arange(1000) % 5.0):
        assert step_of(Channel.of_array("a", "strain", values, axis)) == 0.0
    empty = Channel.of_array("a", "strain", np.zeros(0), TimeAxis.uniform(0, 2500.0))
    assert step_of(empty) == 0.0


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


@pytest.fixture(scope="module")
def recording():
    toy, _ = channel(6, seconds=30.0)
    return Recording("toy.csv", {"toy": toy}, Setup(tire=Tire(rolling_radius_m=0.3)))


def test_stretches_of_a_log_are_its_stack_to_the_bit(recording):
    whole, parts = stacks_from_logs([recording]), stacks_from_logs([recording], most=30)
    assert len(whole) == 1
    assert max(len(part) for part in parts) <= 30
    same(joined(parts), whole[0])


def test_bins_hold_the_samples_of_their_revolution_and_angle(recording):
    stack = joined(stacks_from_logs([recording], angles=32, most=40))
    toy = recording.channels["toy"]
    # of the revolutions' own passages
    angle = PassageAngle.through(stack.conditions.time_s)
    values, (turn, phi) = toy.read(), split_turns(angle.theta(toy.axis.time()))
    seen = 0
    for i in range(3, len(stack) - 3):
        for b in range(0, 32, 5):
            mine = (turn == i) & (np.abs(phi - stack.phi_rad[b]) < np.pi / 32 - 1e-6)
            assert abs(stack.count[i, b] - mine.sum()) <= 1
            if stack.count[i, b] == mine.sum() > 1:
                seen += 1
                assert stack.values[i, b] == pytest.approx(values[mine].mean(), abs=1e-9)
                assert stack.phi_mean[i, b] == pytest.approx(phi[mine].mean(), abs=5e-4)
                assert stack.phi_variance[i, b] == pytest.approx(phi[mine].var(), abs=2e-5)
    assert seen > 300


def test_losses_of_some_manoeuvres_at_a_time_are_those_of_all(monkeypatch):
    logs = case((), seed=204, how=Case(plan="short", logs=2))
    stacks = stacks_from_logs(
        [to_recording(simulate(log), f"log_{i}") for i, log in enumerate(logs)]
    )
    base = prepare(cells_of(pieces_of_all(stacks)), Model.new("beam", radius_m=0.305))
    more = np.cos(base.cells.phi[..., None] * np.arange(1, 12))
    assert base.cells.manoeuvres > 10
    found = []
    for size in (10_000, 10, 1):
        monkeypatch.setattr(floor, "_SOME_CELLS", size)
        added = more[..., :9], more[..., 9:]
        found.append(held_out_losses(base.cells, base.white, base.plain, base.fit, *added))
    for some in found[1:]:
        np.testing.assert_allclose(some, found[0], rtol=1e-8)
