"""Faults: what cannot be diagnosed is said to be so; what cannot be written or drawn in the end is
refused before the work.
"""

from dataclasses import replace
from importlib import util
from pathlib import Path

import numpy as np
import pytest

from benchmarks.cases import Case, case
from tests.cli.conftest import Command, folder, tirelog
from tests.diagnosis.toy import phase_shifts
from tirelog.diagnosis.diagnose import diagnose
from tirelog.errors import ModelError
from tirelog.inference.stacks.cut import stacks_from_logs
from tirelog.physics.model.model import Model
from tirelog.physics.model.user_effects import effect_by_expression
from tirelog.physics.spectral import Parameter
from tirelog.simulation import simulate, to_recording
from tirelog.simulation.scenario.schema import Manoeuvre

pytestmark = pytest.mark.xdist_group("faults of diagnosis")  # one worker makes what is shared


def recordings(manoeuvres, **more):
    (log,) = case((), seed=201, how=Case(plan="short", logs=1))
    return [to_recording(simulate(replace(log, manoeuvres=manoeuvres, **more)), "log")]


@pytest.fixture(scope="module")
def one_cruise():
    return recordings((Manoeuvre(5.0, 14.0),))


@pytest.fixture(scope="module")
def model():
    return Model.new("beam", radius_m=0.305).with_nuisance("form", "off")


def test_one_manoeuvre_is_too_few_and_ranks(one_cruise, model):
    result = diagnose(stacks_from_logs(one_cruise), model)
    assert result.verdict == "too_few"
    assert result.selected == ()
    assert "manoeuvres" in " ".join(result.notes)
    assert result.effects


def test_a_condition_that_is_not_known_leaves_its_effects_untested(one_cruise, model):
    (one,) = stacks_from_logs(one_cruise)
    unknown = replace(one.conditions, distance_km=np.full(len(one), np.nan))
    result = diagnose([replace(one, conditions=unknown)], model)
    assert result.not_tested["wear"] == "needs distance_km"
    assert "viscous_damping" in [c.effect for c in result.effects]


def test_a_candidate_whose_fit_fails_is_reported_and_the_others_go_on(
    one_cruise, model, monkeypatch
):
    from tirelog.diagnosis.candidates import naming

    def refuse(base, candidate, tried):
        if candidate.id == asked[0]:
            return ModelError("the fit with it failed")
        return refit(base, candidate, tried)

    refit = naming.refit_candidate
    monkeypatch.setattr(naming, "refit_candidate", refuse)
    stacks = stacks_from_logs(one_cruise)
    asked = ["nothing"]
    first = diagnose(stacks, model).effects[0].effect
    asked[0] = first
    result = diagnose(stacks, model)
    assert "failed" in result.not_tested[first]
    assert len(result.effects) > 3


def by_load():
    """Phase shifts [rad] that follow the load, which is measured, and nothing else."""
    drive = {"load_N": (3000.0, 4000.0), "acceleration_m_s2": (-3.0, 3.0)}
    return phase_shifts(5, 12, 6, lambda one: 0.03 * (one.load_N / 3500.0 - 1.0), 1e-3, **drive)


def test_candidates_that_act_on_nothing_are_said_not_to_be_tested():
    mine, wave = (
        effect_by_expression(name, on, "q", (Parameter("q", "", "own", 0.0, -1e3, 1e3, probe=1.0),))
        for name, on in (("mine", "load"), ("wave", "baseline"))
    )
    result = diagnose([by_load()], Model.new("beam", "phase_shift"), effects=[mine, wave])
    reads_none = "acts on load, which nothing in this model of phase_shift reads"
    idle = ("load_transfer", "aero_load", "mine")
    assert {result.not_tested[name] for name in idle} == {reads_none}
    assert result.not_tested["wave"].startswith("acts on baseline and does nothing to phase_shift")
    assert "viscous_damping" not in result.not_tested
    assert result.selected == ("load_crosstalk",)
    again = diagnose([by_load()], result.model, effects=[mine])
    assert reads_none not in [again.not_tested.get(name) for name in idle]


__all__ = ["folder", "tirelog"]


@pytest.fixture
def no_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Logs that must not be opened, by names that no module imported meanwhile can keep."""

    def opened(*given: object, **more: object) -> None:
        raise AssertionError("the work was begun")

    for name in ("temporary_folder", "open_run"):
        monkeypatch.setattr(f"tirelog.runs.ingest.{name}", opened)


@pytest.mark.parametrize("command", ["compare", "diagnose", "ladder", "footprint"])
@pytest.mark.usefixtures("no_work")
def test_a_picture_without_matplotlib_is_refused_first(
    folder: Path, tirelog: Command, command: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = util.find_spec
    monkeypatch.setattr(
        util, "find_spec", lambda name, *more: None if name == "matplotlib" else found(name, *more)
    )
    log, model, plot = (str(folder / name) for name in ("log.csv", "m.toml", "x.png"))
    models = [] if command == "footprint" else ["--model", model]
    result = tirelog(command, log, *models, "--plot", plot)
    assert result.status == 2
    assert "a picture needs matplotlib" in result.err
