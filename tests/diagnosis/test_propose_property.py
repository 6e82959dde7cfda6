"""Property: what `propose` writes can be read again and lowers the error."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import folder, tirelog
from tests.diagnosis.planted import MODEL, ringing, since_exit, stack
from tirelog.diagnosis import ladder as climbing
from tirelog.diagnosis.answer import next_command
from tirelog.diagnosis.candidates.search import SearchResult, search_effects
from tirelog.diagnosis.compare import compare, start
from tirelog.diagnosis.diagnose import diagnose
from tirelog.diagnosis.propose.formulas import Atom, Choice, Draft, entry_of
from tirelog.diagnosis.propose.grammar import LAWS, forms
from tirelog.diagnosis.propose.propose import LOCK_EVERY, _Climb, _without_needless, propose
from tirelog.diagnosis.residual_structure import describe
from tirelog.inference.base import refit
from tirelog.physics import Model
from tirelog.physics.model.file import load_model, save_model

pytestmark = pytest.mark.xdist_group("proposals")  # one worker makes what these tests share


LOGS = [stack(ringing, manoeuvres=13, m=96)]
#: the same for those who know their tire: ladders are climbed in a third of the time
KNOWN = MODEL.with_nuisance("form", "off")
__all__ = ["folder", "tirelog"]


@pytest.fixture(scope="module")
def proposal():
    return propose(LOGS, MODEL)


def test_a_ringing_is_written_down(proposal):
    assert proposal.status == "formula"
    (term,) = proposal.terms
    assert term.formula.words == "ringing in the time since the exit edge"
    assert term.formula.law == "(speed / 20)"
    assert term.numbers["f"]["value"] == pytest.approx(120.0, abs=4 * term.numbers["f"]["se"])
    assert term.numbers["decay"]["unit"] == "s"
    assert proposal.locked is not None
    assert proposal.locked["manoeuvres"] == len(range(1, 13, LOCK_EVERY))
    assert proposal.locked["share_removed"] > 0.95
    told = json.loads(json.dumps(proposal.to_json()))
    assert told["terms"][0]["expression"] == term.formula.expression
    assert told["locked"] == proposal.locked


def test_formula_and_measured_shape_are_read_again_and_their_error_has_fallen(proposal, tmp_path):
    assert proposal.rmse_heldout_before is not None
    assert proposal.model is not None
    shaped = MODEL.with_entry(proposal.shapes[0].entry("as_measured"))
    for model, most in ((proposal.model, 1.05), (shaped, 1.1)):
        save_model(model, tmp_path / "better.toml")
        after = compare(LOGS, load_model(tmp_path / "better.toml"))
        assert after.rmse_heldout is not None
        assert after.rmse_heldout < most * after.noise_floor
        assert proposal.rmse_heldout_before > 1.7 * after.noise_floor


def test_a_ladder_ends_with_what_is_proposed(proposal, monkeypatch):
    asked: list[object] = []

    def given(seen, model, **_):
        asked.append(model)
        return proposal

    monkeypatch.setattr(climbing, "propose", given)
    climbed = climbing.ladder(LOGS, KNOWN, proposing=True)
    assert len(asked) == 1
    last = next(step for step in climbed.steps if step.decision == "added: proposed")
    assert last.effect == "proposed_1"
    assert last.rmse_heldout is not None
    assert last.rmse_heldout < 1.05 * last.noise_floor < 0.7 * (climbed.steps[0].rmse_heldout or 0)
    assert [step.step for step in climbed.steps] == list(range(len(climbed.steps)))
    assert climbed.verdict == "at_the_floor"
    assert [entry.id for entry in climbed.model.effects] == ["proposed_1"]
    nothing = replace(proposal, status="nothing", reason="it scatters.", model=None, written=())
    monkeypatch.setattr(climbing, "propose", lambda seen, model, **_: nothing)
    kept = climbing.ladder(LOGS, KNOWN, proposing=True)
    assert not any("proposed" in step.decision for step in kept.steps)
    assert any("it scatters." in remark for remark in kept.remarks)


def test_a_ladder_takes_away_the_name_that_a_proposal_makes_needless(proposal, monkeypatch):
    """The search is made to name viscous damping first, which is not there."""
    assert proposal.model is not None
    (ringing_entry,) = proposal.model.effects

    def misled(base, *asked):
        found = search_effects(base, *asked)
        wrong = refit(base, base.model.with_effect("viscous_damping"))
        monkeypatch.setattr(SearchResult, "named", ("viscous_damping",))
        return SearchResult(found.before, found.steps, wrong)

    def beside_it(seen, model, **_):
        assert [entry.id for entry in model.effects] == ["viscous_damping"]
        return replace(proposal, model=model.with_entry(ringing_entry))

    monkeypatch.setattr(climbing, "search_effects", misled)
    monkeypatch.setattr(climbing, "propose", beside_it)
    climbed = climbing.ladder(LOGS, KNOWN, proposing=True)
    last = climbed.steps[-1]
    assert (last.decision, last.effect) == ("removed", "viscous_damping")
    assert (last.rmse_heldout or 1.0) < 1.05 * last.noise_floor
    assert [entry.id for entry in climbed.model.effects] == ["proposed_1"]
    assert climbed.verdict == "at_the_floor"


def test_a_shape_is_said_to_do_better_only_if_it_was_not_asked_for(proposal):
    as_shape = replace(proposal, status="shape", terms=())
    said = "a measured shape in the time since the exit edge, times (speed / 20)"
    assert f"{said}, since no formula does as well." in as_shape.sentence
    assert f"{said}. On 4 manoeuvres" in replace(as_shape, asked=True).sentence
    assert any(text.startswith("A free shape") for text in proposal.sentences())
    nothing = replace(proposal, status="nothing", reason="it scatters.")
    assert not any(text.startswith("A free shape") for text in nothing.sentences())


def test_a_term_that_a_later_one_made_needless_goes():
    """An odd wave of no size before the ringing that is there: one term is left."""
    alone = start(LOGS, MODEL)
    by_words = {form.words: form for form in forms()}
    law = replace(LAWS[0], numbers={"n": 1.0})
    planned = (
        ("odd wave along the patch (xi / L)", {"width": 1.0}, [1e-8]),
        ("ringing in the time since the exit edge", {"decay": 0.008, "f": 120.0}, [0.0, 4e-5]),
    )
    climb = _Climb([alone])
    for i, (words, numbers, size) in enumerate(planned, start=1):
        atom = Atom(by_words[words], numbers, law, fixed=("n",))
        entry = entry_of(atom, np.array(size), f"proposed_{i}", "strain")
        draft = Draft(atom, entry, refit(climb.after, climb.after.model.with_entry(entry)))
        climb.choices.append(Choice(draft, (draft, draft), (draft,), 0.001, i))
        climb.bases.append(draft.base)
    left = _without_needless(climb)
    (choice,) = left.choices
    name = choice.chosen.entry.id
    assert (name, choice.chosen.atom.form.profile.name) == ("proposed_2", "ringing")
    assert choice.tried == 2
    assert choice.as_good == (choice.chosen,)
    assert [entry.id for entry in left.after.model.effects] == [name]
    assert left.after.model.values[f"{name}.f"] == pytest.approx(120.0, rel=0.01)


@pytest.mark.parametrize(
    ("verdict", "large_rest", "begins"),
    [
        ("unknown", False, "tirelog propose a.csv --model m.toml -o m+proposed.toml"),
        ("partial", True, "tirelog propose a.csv --model m.toml -o m+proposed.toml"),
        ("partial", False, "tirelog model add m.toml wear"),
        ("missing", False, "tirelog model add m.toml wear"),
        ("scatter", False, "tirelog compare a.csv --model m.toml --plot"),
    ],
)
def test_a_diagnosis_ends_with_the_command_that_goes_on(verdict, large_rest, begins):
    model = replace(MODEL, path=Path("m.toml"))
    selected = ("wear",) if verdict in ("partial", "missing") else ()
    said = next_command(verdict, selected, model=model, logs=["a.csv"], large_rest=large_rest)
    assert said.startswith(begins)
    number = Model.new("beam", "patch_length")
    assert "propose" not in next_command(verdict, selected, model=number, logs=["a.csv"])
    several = Model.new("beam", observable=("strain", "phase_shift"), radius_m=0.3)
    said = next_command(verdict, selected, model=several, logs=["a.csv"], large_rest=large_rest)
    assert "propose" not in said


def test_nothing_is_proposed_if_nothing_is_missing():
    result = propose([stack(seed=5, m=64)], MODEL)
    assert (result.status, result.model, result.written) == ("nothing", None, ())
    assert result.sentence.startswith("Nothing to propose: Nothing is missing")


COMMAND = ("propose", "log.csv", "--model", "m.toml")


@pytest.fixture
def proposed(folder, monkeypatch):
    """A folder in which whatever is measured, what this is called with is proposed."""
    monkeypatch.chdir(folder)
    save_model(MODEL, folder / "m.toml")
    place = "tirelog.diagnosis.propose.propose.propose"
    return lambda result: monkeypatch.setattr(place, lambda *given, **more: result)


def test_the_command_prints_and_writes_what_python_gives(proposal, tirelog, proposed):
    proposed(proposal)
    result = tirelog(*COMMAND, "-o", "better.toml", "--plot", "p.png")
    assert result.status == 0
    assert result.out.startswith("FORMULA.  Proposed: ringing in the time since the exit edge")
    assert proposal.terms[0].formula.expression in result.out
    assert "next: tirelog compare log.csv --model better.toml" in result.out
    assert proposal.model is not None
    assert load_model("better.toml").values == proposal.model.values
    assert Path("p.png").stat().st_size > 10_000
    told = json.loads(tirelog(*COMMAND, "--format", "json").out)
    assert told.pop("next_command") == "tirelog compare log.csv --model BETTER.toml"
    assert told == json.loads(json.dumps(proposal.to_json()))
    refused = tirelog(*COMMAND, "--format", "csv")
    assert (refused.status, "json is allowed" in refused.err) == (2, True)


def test_without_a_proposal_no_file_is_written_and_the_old_one_stays(tirelog, proposed):
    proposed(propose([stack(manoeuvres=3, m=64)], MODEL))
    mine = Path("better.toml")
    save_model(MODEL, mine)
    before = mine.read_text()
    result = tirelog(*COMMAND, "-o", "better.toml", "--plot", "p.png")
    assert result.status == 0
    assert result.out.startswith("NOTHING.  Nothing to propose: 3 manoeuvres are too few")
    assert "better.toml and p.png not written" in result.err
    assert mine.read_text() == before
    assert not Path("p.png").exists()


def test_an_echo_of_fixed_delay_repeats_though_no_shape_over_the_angle_does():
    def echo(xi, speed):
        late = since_exit(xi) / speed
        return 1e-5 * np.exp(-0.5 * ((late - 0.012) / 0.0016) ** 2)

    base = start([stack(echo)], MODEL)
    left = describe(base)
    assert left.significant
    assert left.in_time
    assert (left.where, left.follows, left.frequency_Hz) == ("exit", "nothing", None)
    assert left.size > 0.9 * base.excess
    facts = diagnose([stack(echo)], MODEL)
    assert facts.verdict == "unknown"
    assert "fixed in the time since that edge" in facts.unexplained["sentence"]
