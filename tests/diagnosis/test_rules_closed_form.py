"""The table of verdicts: each rule by hand."""

from dataclasses import replace

import pytest

from tirelog.diagnosis.rules import RULES, THRESHOLDS, Evidence, verdict_of

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
