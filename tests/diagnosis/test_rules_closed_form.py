"""The table of verdicts: each rule by hand."""

from dataclasses import replace

import pytest

from tirelog.diagnosis.nuisance_sizes import alike_sentences
from tirelog.diagnosis.rules import RULES, THRESHOLDS, Evidence, verdict_of
from tirelog.diagnosis.wording import sentence_of

NAMED = Evidence(few=False, named=1, share=1.0, rest=False, alike=False, repeats=False, quiet=False)


@pytest.mark.parametrize(
    ("changes", "verdict"),
    [
        ({}, "missing"),
        ({"alike": True}, "ambiguous"),
        ({"rest": True, "alike": True}, "partial"),
        ({"share": 0.89}, "partial"),
        ({"share": 0.69}, "unknown"),
        ({"named": 0, "share": 0.0, "repeats": True, "quiet": True}, "unknown"),
        ({"named": 0, "share": 0.0, "quiet": True}, "nothing_missing"),
        ({"named": 0, "share": 0.0}, "scatter"),
        ({"few": True, "quiet": True}, "too_few"),
    ],
)
def test_verdict(changes, verdict):
    assert verdict_of(replace(NAMED, **changes)) == verdict


def test_every_verdict_has_a_rule_and_every_number_a_reason():
    assert sorted(rule.verdict for rule in RULES) == [
        "ambiguous", "missing", "nothing_missing", "partial", "scatter", "too_few", "unknown",
    ]  # fmt: skip
    assert len({t.name for t in THRESHOLDS}) == len(THRESHOLDS)
    assert all(t.reason and t.unit for t in THRESHOLDS)


def test_a_held_out_error_above_the_floor_is_said():
    facts = {
        "verdict": "nothing_missing", "selected": (), "share": 0.0, "beside": (),
        "before": 1.0, "floor": 1.0, "manoeuvres": 20,
    }  # fmt: skip
    assert "held out" not in sentence_of(facts)
    assert "1.12 floors" in sentence_of({**facts, "before": 1.2544})


def test_a_nuisance_and_an_effect_that_do_the_same_are_told():
    pair = [("wheel", "ring_curvature")]
    assert "ring_curvature would remove as much" in alike_sentences(pair, (), ["wheel"])[0]
    assert "A wheel would remove as much" in alike_sentences(pair, ("ring_curvature",), [])[0]
    assert alike_sentences(pair, (), []) == []
