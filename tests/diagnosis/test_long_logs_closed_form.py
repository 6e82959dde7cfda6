"""Closed form: sums over chunks, blocks and stretches are the sums over the whole."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.cases import Case, case
from tests.diagnosis.toy import channel
from tirelog.data.recording import Channel, Recording, TimeAxis
from tirelog.data.setup import Setup, Tire
from tirelog.inference import floor
from tirelog.inference.base import prepare
from tirelog.inference.cells.cells import cells_of
from tirelog.inference.cells.pieces import pieces_of_all
from tirelog.inference.floor import held_out_losses
from tirelog.inference.metric import LeaveOneOut, Normal
from tirelog.inference.stacks import align as samples_of
from tirelog.inference.stacks.align import (
    PassageAngle,
    Samples,
    front_fit,
    knots_for,
    refine_passages,
    split_turns,
    template,
)
from tirelog.inference.stacks.cut import joined, stacks_from_logs
from tirelog.inference.stacks.manoeuvres import _channel_mean
from tirelog.physics.model.model import Model
from tirelog.simulation import simulate, to_recording


def refined_at_once(time, values, centre, rounds=3):
    """The matched filter on all samples together."""
    good = np.isfinite(values)
    time, values = time[good], values[good]
    knots = knots_for(centre, 2500.0)
    for _ in range(rounds):
        angle = PassageAngle.through(centre)
        turn, phi = split_turns(angle.theta(time))
        whole = (turn >= 0) & (turn < centre.size)
        turn, phi, y = turn[whole], phi[whole], values[whole]
        shift = front_fit(turn, phi, y, template(phi, y, knots), centre.size)[0]
        centre = centre + (shift - np.median(shift)) / angle.speed_rad_s(centre)
    return centre


@pytest.mark.parametrize("size", [700, 5000, 1 << 20])
def test_passages_refined_in_chunks_are_those_refined_at_once(size, monkeypatch):
    monkeypatch.setattr(samples_of, "CHUNK_SAMPLES", size)
    toy, truth = channel(5)
    values = toy.read()
    values[4000:4100] = np.nan
    toy = replace(toy, samples=lambda start, stop: values[start:stop])
    rough = truth + 1e-3 * np.random.default_rng(5).standard_normal(truth.size)
    np.testing.assert_allclose(
        refine_passages(Samples(toy), rough),
        refined_at_once(toy.axis.time(), values, rough),
        rtol=0,
        atol=1e-12,
    )


@pytest.mark.parametrize("explicit", [False, True])
def test_samples_are_found_by_their_times(explicit):
    first, start = np.array([0, 9000, 20_000]), np.array([0.5, 5.0, 30.0])
    axis = TimeAxis(30_000, 2500.0, first, start, np.full(3, 4e-4))
    time = axis.time()
    if explicit:
        axis = TimeAxis.of_times(time)
    asked = np.concatenate(
        [[-1.0, 100.0, 4.2, 4.5], time[[0, 8191, 8192, 8999, 9000, 29_999]], time[::997] + 1e-4]
    )
    found = Samples(Channel.of_array("a", "strain", np.zeros(30_000), axis)).before(asked)
    np.testing.assert_array_equal(found, np.searchsorted(time, asked))


@pytest.fixture(scope="module")
def recording():
    toy, _ = channel(6, seconds=30.0)
    return Recording("toy.csv", {"toy": toy}, Setup(tire=Tire(rolling_radius_m=0.3)))


def test_bins_hold_the_samples_of_their_revolution_and_angle(recording, monkeypatch):
    monkeypatch.setattr(samples_of, "CHUNK_SAMPLES", 3000)
    stacks = stacks_from_logs([recording], angles=32, most=40)
    assert len(stacks) > 3
    stack, toy = joined(stacks), recording.channels["toy"]
    time, values = toy.axis.time(), toy.read()
    theta = PassageAngle.through(stack.conditions.time_s).theta(
        time
    )  # of the revolutions' own passages
    turn, phi = split_turns(theta)
    for i in range(3, len(stack) - 3):
        for b in range(0, 32, 5):
            mine = (turn == i) & (np.abs(phi - stack.phi_rad[b]) < np.pi / 32 - 1e-6)
            assert abs(stack.count[i, b] - mine.sum()) <= 1
            if stack.count[i, b] == mine.sum() > 0:
                assert stack.values[i, b] == pytest.approx(values[mine].mean(), abs=1e-9)
                assert stack.phi_variance[i, b] == pytest.approx(phi[mine].var(), abs=1e-6)


def test_stretches_of_a_log_are_its_stack_to_the_bit(recording):
    whole, parts = stacks_from_logs([recording]), stacks_from_logs([recording], most=30)
    assert len(whole) == 1
    assert max(len(part) for part in parts) <= 30
    for name in (
        "values",
        "phi_mean",
        "phi_variance",
        "count",
        "noise",
        "log",
        "manoeuvre",
        "revolution",
        "regime",
    ):
        np.testing.assert_array_equal(getattr(joined(parts), name), getattr(whole[0], name))
    for name in ("speed_m_s", "acceleration_m_s2", "time_s"):
        np.testing.assert_array_equal(
            getattr(joined(parts).conditions, name), getattr(whole[0].conditions, name)
        )


def test_mean_of_a_channel_in_blocks_is_the_mean_of_its_samples():
    random = np.random.default_rng(8)
    time = np.cumsum(random.uniform(0.5e-3, 1.5e-3, 600_000)) + 3.0
    values = np.cumsum(random.standard_normal(time.size))
    values[random.random(time.size) < 0.1] = np.nan
    values[260_000:264_000] = np.nan  # across the end of a block, some revolutions long
    centre = np.cumsum(random.uniform(0.2, 0.6, 1400))
    half = 0.5 * np.gradient(centre)
    good = np.isfinite(values)
    expected = np.empty(centre.size)
    for i, (c, h) in enumerate(zip(centre, half, strict=True)):
        mine = (time >= c - h) & (time < c + h) & good
        expected[i] = values[mine].mean() if mine.any() else np.interp(c, time[good], values[good])
    found = _channel_mean(
        Channel.of_array("load", "vertical_load", values, TimeAxis.of_times(time)), centre
    )
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-6)


def test_mean_of_an_empty_channel_is_not_known():
    axis = TimeAxis.uniform(100, 10.0)
    assert np.isnan(
        _channel_mean(
            Channel.of_array("load", "vertical_load", np.full(100, np.nan), axis),
            np.arange(1.0, 4.0),
        )
    ).all()


def test_losses_of_some_manoeuvres_at_a_time_are_those_of_all(monkeypatch):
    logs = case((), seed=204, how=Case(plan="short", logs=2))
    stacks = stacks_from_logs(
        [to_recording(simulate(log), f"log_{i}") for i, log in enumerate(logs)]
    )
    base = prepare(cells_of(pieces_of_all(stacks)), Model.new("beam", radius_m=0.305))
    more = np.cos(base.cells.phi[..., None] * np.arange(1, 12))
    cells, left = base.cells, np.nan_to_num(base.cells.values - base.fit.prediction)
    log, p = np.zeros(cells.manoeuvres, int), base.fit.jacobian.shape[-1]
    log[cells.manoeuvre] = cells.log
    none = np.zeros(1 + p + more.shape[-1])
    columns = np.concatenate([np.ones((*left.shape, 1)), base.fit.jacobian, more], axis=-1)
    whole = [
        LeaveOneOut(Normal.of(metric(columns), metric(left), cells.manoeuvre), log, (none, none))
        for metric in (base.white, base.plain)
    ]
    solution = whole[0].left_out() - whole[0].step_of_all(p)
    assert len(cells) > 20
    assert cells.manoeuvres > 10
    for size in (1, 10, 10_000):
        monkeypatch.setattr(floor, "_SOME_CELLS", size)
        found = held_out_losses(
            cells, base.white, base.plain, base.fit, more[..., :9], more[..., 9:]
        )
        for part, expected in zip(found, whole, strict=True):
            np.testing.assert_allclose(part, expected.loss(solution), rtol=1e-8)
