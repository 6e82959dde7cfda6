"""Closed form: how often a verdict is right, from tables and rows whose answer is known."""

import math
import tomllib
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest
import tomlkit

from benchmarks.calibration import is_right, rows_of, table, weights
from benchmarks.nuisances import Row
from tirelog.diagnosis.certainty import Marks, certainty_of, unlike_cases
from tirelog.diagnosis.certainty import calibration as shipped
from tirelog.physics.model.model import Model

MARKS = Marks("missing", "beam", 22, 2.0, 1.0, 10.0, 1.0)
NAME = {
    "cases": 40, "tires": 20, "effective": 18.0, "most": 0.95, "carcasses": ["beam"],
    "manoeuvres": [20, 24], "lacking": [], "intercept": math.log(4.0),
    "terms": {"rest": {"centre": 1.0, "slope": -1.0, "low": 0.0, "high": 3.0}},
}  # fmt: skip
TABLE = {"date": "2026-11-22", "name": NAME}


def row(seed, status="missing", planted="wear", named="wear", sets="[]", rest=1.0, **more):
    known = {
        "world": "control", "seed": seed, "carcass": "beam", "planted": planted, "size": "drawn",
        "strength": 1.0, "planted_excess": math.nan, "status": status, "named": named,
        "sets": sets, "share": 1.0, "heldout_before": 2.0, "heldout_after": rest,
        "chi2_before": 9.0, "chi2_after": 1.0, "excess": 3.0, "excess_left": 0.0,
        "manoeuvres": 22, "cpu_s": 1.0, "sentence": "",
    }  # fmt: skip
    return Row(**{**known, **more})


def test_a_probability_is_the_logistic_of_its_terms():
    # held out 1.05 floors is one step above the floor: the term stands at its centre
    assert certainty_of(replace(MARKS, heldout_after=1.05), TABLE).probability == 0.8
    two = certainty_of(replace(MARKS, heldout_after=1.10), TABLE).probability
    assert two == pytest.approx(1.0 / (1.0 + math.exp(1.0 - math.log(4.0))), abs=1e-3)
    # beyond what the cases had it is as at their end
    far = [certainty_of(replace(MARKS, heldout_after=x), TABLE).probability for x in (1.15, 9.0)]
    assert far[0] == far[1]
    # not known: as in the middle
    assert certainty_of(replace(MARKS, heldout_after=math.nan), TABLE).probability == 0.8


def test_it_never_says_more_than_so_many_cases_can_tell():
    def said(intercept, most=0.95):
        name = {**NAME, "most": most, "intercept": intercept, "terms": {}}
        return certainty_of(MARKS, {"date": "", "name": name})

    assert said(50.0).probability == pytest.approx(19.0 / 20.0)
    assert said(-50.0).probability == pytest.approx(1.0 / 20.0)
    assert said(50.0, 11.0 / 12.0).probability <= 11.0 / 12.0
    assert said(50.0, 11.0 / 12.0).sentence.startswith("Right in 91 of 100 like cases")


def test_what_no_case_had_is_left_open():
    def made(rows):
        return table(rows, date(2026, 11, 22)).unwrap()["name"]

    rows = [row(i, rest=1.0 + 0.01 * (i % 5)) for i in range(10)]
    # ten of ten tell no more than eleven of twelve, and nothing of what no case had: 15 % of cases
    assert made(rows)["most"] == pytest.approx(min(11.0 / 12.0, 1.0 - 0.5 * 0.15), abs=1e-3)
    assert made(rows)["lacking"] == ["effect that no catalogue has"]
    many = [replace(r, seed=100 * k + r.seed) for k in range(20) for r in rows]
    assert made(many)["most"] == 0.925
    many += [row(9000 + i, status="unknown", planted="splice", named="") for i in range(9)]
    assert made(many)["most"] > 0.95


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"verdict": "too_few"}, "it claims nothing"),
        ({"verdict": "partial"}, "no simulated case was partial"),
        ({"carcass": "ring"}, "simulated cases that were missing or ambiguous had a beam"),
        ({"manoeuvres": 90}, "simulated cases had 20 to 24 manoeuvres, these logs 90"),
    ],
)
def test_what_no_case_was_like_has_no_number_and_says_why(change, said):
    found = certainty_of(replace(MARKS, **change), TABLE)
    assert found.probability is None
    assert found.sentence == f"No calibration for this kind: {said}."


BEAM = Model.new("beam", radius_m=0.3)


@pytest.mark.parametrize(
    ("model", "selected", "gratings", "said"),
    [
        (BEAM, ("wear",), False, ""),
        (BEAM, (), True, "the cases had one grating"),
        (BEAM.with_effect("wear"), (), False, "this one holds effects already"),
        (BEAM.with_effect("form"), (), False, "no form of the tire's own came in"),
        (Model.new("beam", "patch_length"), (), False, "these logs have patch_length"),
        (BEAM, ("my_own",), False, "my_own is not of it"),
        (BEAM.with_nuisance("wheel", "off"), (), False, "this model says which"),
    ],
)
def test_what_was_asked_otherwise_than_any_case_is_said(model, selected, gratings, said):
    why = unlike_cases(model, selected, gratings)
    assert said in why
    assert bool(why) == bool(said)


def test_the_sentence_says_what_it_rests_on():
    known = {**TABLE, "name": {**NAME, "lacking": ["effect that no catalogue has"], "terms": {}}}
    assert certainty_of(MARKS, known).sentence == (
        "Right in 80 of 100 like cases (40 simulated, 20 tires, 2026-11-22; none had an effect "
        "that no catalogue has)."
    )


@pytest.mark.parametrize(
    ("given", "right"),
    [
        (row(1), True),
        (row(1, named="hysteresis"), False),
        (row(1, named="wear+hysteresis"), False),
        (row(1, status="ambiguous", named="hysteresis", sets='[["hysteresis", "wear"]]'), True),
        (row(1, planted="", named="wear"), False),
        (row(1, status="nothing_missing", planted="", named=""), True),
        (row(1, status="nothing_missing", named="", planted_excess=2.0), False),
        (row(1, status="scatter", named="", planted_excess=0.1), True),
        (row(1, status="unknown", planted="splice", named=""), True),
        (row(1, status="unknown", named=""), False),
        (row(1, status="partial", planted="splice", named="wear"), False),
        (row(1, planted="wear+traction", named="traction+wear"), True),
        (row(1, planted="wear+traction", named="wear"), False),
        (row(1, status="partial", planted="wear+traction", named="wear"), True),
    ],
)
def test_what_is_right(given, right):
    assert is_right(given) is right


def test_rows_count_by_the_priors_and_like_ones_as_what_they_tell_together():
    rows = [row(s, planted="", named="", status="nothing_missing") for s in range(30)]
    rows += [row(s) for s in range(40, 50)]
    rows += [row(99, world=f"{i}") for i in range(9)]  # one tire: nine logs tell as 1.8 cases
    own = weights(rows)
    assert own[:30].sum() / own.sum() == pytest.approx(0.4 / 0.85)
    assert own[30] / own[40] == pytest.approx(5.0)
    assert own.sum() < 41.8
    assert weights(rows[:30]).sum() == pytest.approx(30.0)


def test_a_fit_finds_the_probabilities_that_rows_were_drawn_with():
    random = np.random.default_rng(5)
    rest = random.uniform(0.0, 3.0, 3000)
    truth = 1.0 / (1.0 + np.exp(1.2 * rest - 3.0))
    hit = random.uniform(size=rest.size) < truth
    rows = [
        row(i, rest=1.0 + 0.05 * r, named="wear" if h else "hysteresis")
        for i, (r, h) in enumerate(zip(rest, hit, strict=True))
    ]
    made = table(rows, date(2026, 11, 22)).unwrap()
    said = np.array([certainty_of(r.marks, made).probability for r in rows])
    assert np.abs(said - truth).mean() < 0.03
    assert made["name"]["terms"]["rest"]["slope"] == pytest.approx(-1.2, abs=0.2)


def test_the_table_of_the_package_is_whole():
    known = shipped()
    assert known["tires"] >= 100
    for kind in ("none", "name"):
        verdict = "missing" if kind == "name" else "nothing_missing"
        found = certainty_of(replace(MARKS, verdict=verdict), known)
        own = known[kind]
        assert own["most"] <= (own["effective"] + 1.0) / (own["effective"] + 2.0)
        assert 0.5 < found.probability <= own["most"]
        assert known[kind]["right"] <= known[kind]["cases"]


def test_the_table_of_the_package_is_that_of_the_rows_that_are_kept():
    rows = rows_of(Path(__file__).parents[2] / "benchmarks" / "rows" / "calibration.csv")
    known = shipped()
    made = tomllib.loads(tomlkit.dumps(table(rows, date.fromisoformat(known["date"]))))
    assert made.keys() == known.keys()
    assert made["seeds"] == known["seeds"]
    for kind in ("none", "name", "unknown"):
        assert made[kind]["right"] == known[kind]["right"]
        assert made[kind]["intercept"] == pytest.approx(known[kind]["intercept"], abs=2e-3)
        for name, term in known[kind]["terms"].items():
            assert made[kind]["terms"][name]["slope"] == pytest.approx(term["slope"], abs=2e-3)
