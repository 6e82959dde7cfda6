"""Property: several stretches, stacks put aside, some manoeuvres of many: the same measurement."""

import os
from dataclasses import fields, replace
from itertools import chain

import numpy as np
import pytest

from benchmarks.cases import Case, case
from tests.diagnosis.test_transient_truth import scenario
from tests.diagnosis.toy import stack
from tirelog import runtime
from tirelog.data.recording import Channel, Conditions
from tirelog.diagnosis.compare import compare
from tirelog.diagnosis.diagnose import diagnose
from tirelog.inference.cells.pieces import pieces_of, pieces_of_all
from tirelog.inference.measured import measured
from tirelog.inference.stacks import align
from tirelog.inference.stacks.cut import Stacks, joined, stacks_from_logs
from tirelog.physics.model.model import Model
from tirelog.process_pool import POSSIBLE
from tirelog.simulation import simulate, to_recording

pytestmark = pytest.mark.xdist_group("long logs")  # one worker makes what these tests share


def same(one, other):
    """Equal to the bit, types too."""
    for f in fields(one):
        a, b = getattr(one, f.name), getattr(other, f.name)
        if isinstance(a, Conditions):
            same(a, b)
        elif isinstance(a, np.ndarray):
            assert a.dtype == b.dtype, f.name
            np.testing.assert_array_equal(a, b, f.name)
        else:
            np.testing.assert_equal(a, b, f.name)


def with_added(recording, values):
    """The recording with something added to its grating."""
    source = recording.channels["strain_1"]
    added = Channel.of_array(
        source.name, source.kind, source.read() + values, source.axis, surface=source.surface
    )
    return replace(recording, channels={source.name: added})


def test_pieces_of_stacks_are_those_of_one_stack_where_none_is_cut():
    stacks = Stacks()
    for seed in (1, 2, 3):
        whole = stack(seed, manoeuvres=4)
        stacks.add("a", [whole.take(slice(0, 24)), whole.take(slice(24, 48))])
    same(pieces_of_all(stacks), pieces_of(joined(stacks)))


@pytest.fixture(scope="module")
def recordings():
    logs = case(("edge_impact",), seed=203, how=Case(plan="short", logs=2))
    return [to_recording(simulate(log), f"log_{i}") for i, log in enumerate(logs)]


@pytest.fixture(scope="module")
def model():
    """A beam beside which no form is tried: that takes long, and a cut log does not touch it."""
    return Model.new("beam", radius_m=0.305).with_nuisance("form", "off")


@pytest.fixture(scope="module")
def whole(recordings, model):
    return compare(stacks_from_logs(recordings), model)


def test_a_comparison_does_not_know_of_stretches_between_manoeuvres(recordings, model, whole):
    stacks = stacks_from_logs(recordings)
    manoeuvres = Stacks(in_memory=0)
    for number, log in enumerate(stacks.logs):
        one = joined(stack for stack in stacks if stack.log[0] == number)
        first = int(one.manoeuvre.min())
        parts = (one.take(one.manoeuvre == m) for m in np.unique(one.manoeuvre))
        manoeuvres.add(log, (replace(part, manoeuvre=part.manoeuvre - first) for part in parts))
    assert len(manoeuvres) > 6
    parted = compare(manoeuvres, model)
    assert parted.to_json() == whole.to_json()
    assert list(chain(*parted.by("revolution"))) == list(chain(*whole.by("revolution")))


def test_a_comparison_hardly_knows_of_manoeuvres_that_were_cut(recordings, model, whole):
    parted = compare(stacks_from_logs(recordings, most=40), model)
    assert parted.manoeuvres == whole.manoeuvres
    for name in ("rmse", "rmse_heldout", "noise_floor"):
        assert getattr(parted, name) == pytest.approx(getattr(whole, name), rel=0.02)
    rows, expected = (list(chain(*found.by("revolution"))) for found in (parted, whole))
    for name in ("log", "revolution", "time_s", "speed_m_s", "regime", "manoeuvre"):
        assert [row[name] for row in rows] == [row[name] for row in expected]
    np.testing.assert_allclose(
        [row["rmse"] for row in rows], [row["rmse"] for row in expected], rtol=0.05
    )


@pytest.mark.slow
@pytest.mark.skipif(not POSSIBLE, reason="no process is forked here")
def test_a_diagnosis_does_not_know_of_the_processes_that_share_it(recordings, model, monkeypatch):
    stacks = stacks_from_logs(recordings, most=40)
    alone = diagnose(stacks, model)
    assert any(step.contenders for step in alone.found.steps)  # of which each is refitted
    monkeypatch.setattr(runtime, "_PROCESSES", [2])
    shared = diagnose(stacks, model)
    assert shared.to_json() == alone.to_json()


@pytest.mark.skipif(not POSSIBLE, reason="no process is forked here")
def test_stretches_do_not_know_of_the_processes_that_share_them(recordings, monkeypatch):
    hum = 2e-5 * np.sin(2.0 * np.pi * 50.0 * recordings[0].channels["strain_1"].axis.time())
    monkeypatch.setattr("tirelog.inference.stacks.hum._SHORTEST_S", 1.0)
    humming = [with_added(recordings[0], hum), recordings[1]]
    alone = stacks_from_logs(humming, most=40)
    monkeypatch.setattr(runtime, "_PROCESSES", [2])
    monkeypatch.setattr(align, "_SHARED", 2)
    forked = []
    monkeypatch.setattr(os, "fork", lambda fork=os.fork: forked.append(1) or fork())
    shared = stacks_from_logs(humming, most=40)
    assert len(forked) > 2 * (2 * len(alone.logs))  # for passages, and for stretches
    assert len(shared) == len(alone) > 4
    assert "as hum does" in " ".join(alone.notes)
    assert shared.notes == alone.notes
    for one, other in zip(shared, alone, strict=True):
        same(one, other)


def driven(seed, **more):
    """Forty cruises at two speeds in turn."""
    made = stack(seed, manoeuvres=40, revolutions=10, **more)
    speed = np.where(made.manoeuvre % 2, 12.0, 17.0)
    return replace(
        made,
        conditions=replace(made.conditions, speed_m_s=speed + 0.01 * np.arange(len(made)) % 0.3),
    )


def two_driven_logs():
    stacks = Stacks()
    for seed in (1, 2):
        made = driven(seed)
        regime = np.where(made.manoeuvre % 8 == 3, "brake", "cruise")
        made = replace(made, regime=regime, logs=(f"log_{seed}",))
        stacks.add(f"log_{seed}", (made.take(rows) for rows in np.split(np.arange(len(made)), 5)))
    return stacks


@pytest.mark.parametrize("most", [200, 80, 24, 12, 1])
def test_manoeuvres_of_a_long_log_are_used_whole_and_of_every_regime_and_speed(most):
    stacks = two_driven_logs()
    one, pieces = joined(stacks), pieces_of_all(stacks, most)
    used = np.unique(one.manoeuvre) if most >= 40 else np.unique(pieces.manoeuvre)
    inside = np.isin(one.manoeuvre, used)
    same(replace(pieces, cell=pieces.cell[inside], notes=()), pieces_of(one.take(inside)))
    for log in (0, 1):
        of_log = pieces.log == log
        assert of_log.sum() <= max(most, 4)  # two of each regime
        assert set(pieces.regime[of_log]) == {"brake", "cruise"}
    if most > 2:  # both speeds of the cruises
        assert set(np.round(pieces.conditions.speed_m_s)) == {12.0, 17.0}
    assert bool(pieces.notes) == (most < 40)


@pytest.mark.parametrize("wet", [(6, 7), (0, 20, 39)])
def test_the_few_wet_manoeuvres_of_a_dry_log_are_used(wet):
    """Evenly over the speeds alone, a quarter of the manoeuvres would be."""
    made = driven(3, m=64)
    depth = np.where(np.isin(made.manoeuvre, wet), 2.0, 0.0)
    made = replace(made, conditions=replace(made.conditions, water_depth_mm=depth))
    pieces = pieces_of_all([made], 10)
    used = np.unique(pieces.manoeuvre[pieces.conditions.water_depth_mm > 1.0])
    assert used.size == len(wet)
    assert 6 <= len(pieces) <= 14


def test_a_revolution_of_an_unused_manoeuvre_has_the_piece_nearest_in_speed_of_its_log():
    stacks = two_driven_logs()
    one, pieces = joined(stacks), pieces_of_all(stacks, 24)
    assert pieces.number.sum() < len(pieces.cell) == len(one)
    np.testing.assert_array_equal(pieces.log[pieces.cell], one.log)
    speed, there = one.conditions.speed_m_s, pieces.conditions.speed_m_s
    for i in np.flatnonzero(~np.isin(one.manoeuvre, pieces.manoeuvre)):
        own = pieces.log == one.log[i]
        off = np.abs(there[own] - speed[i]).min()
        assert abs(there[pieces.cell[i]] - speed[i]) == pytest.approx(off)


@pytest.mark.slow
def test_an_obstacle_is_found_in_a_log_of_several_stretches():
    met = to_recording(simulate(scenario()), "cleat.csv")
    answers = []
    for most in (1000, 12):
        stacks = stacks_from_logs([met], most=most)
        assert (len(stacks) > 2) == (most == 12)
        answers.append(measured([met], most=most))
    (steady, (hits,)), (steady_parts, (hits_parts,)) = (
        (found.stacks, found.obstacles) for found in answers
    )
    same(joined(steady), joined(steady_parts))
    np.testing.assert_array_equal(hits.hits_s, hits_parts.hits_s)
    assert len(joined(steady)) < len(joined(stacks))
