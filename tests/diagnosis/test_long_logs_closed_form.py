"""Closed form: sums over chunks, blocks and stretches are the sums over the whole."""

import numpy as np
import pytest

from benchmarks.cases import Case, case
from tests.diagnosis.test_long_logs_property import same
from tests.diagnosis.toy import channel
from tirelog.data.recording import Recording
from tirelog.data.setup import Setup, Tire
from tirelog.inference import floor
from tirelog.inference.base import prepare
from tirelog.inference.cells.cells import cells_of
from tirelog.inference.cells.pieces import pieces_of_all
from tirelog.inference.floor import held_out_losses
from tirelog.inference.stacks.align import PassageAngle, split_turns
from tirelog.inference.stacks.cut import joined, stacks_from_logs
from tirelog.physics.model.model import Model
from tirelog.simulation import simulate, to_recording


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
