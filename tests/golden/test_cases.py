"""Golden: what `diagnose` concludes of 80 simulated tires, with and without a planted effect."""

import pytest

from benchmarks import golden_cases

pytestmark = pytest.mark.slow  # some ten seconds each


def test_all_cases_are_kept():
    assert [(row["suite"], row["case"]) for row in golden_cases.read()] == list(
        golden_cases.listed()
    )


def test_every_verdict_is_among_them():
    verdicts = {row["verdict"] for row in golden_cases.read()}
    assert verdicts >= {"missing", "partial", "ambiguous", "unknown", "nothing_missing", "scatter"}


@pytest.mark.parametrize(
    "golden", golden_cases.read(), ids=lambda row: f"{row['suite']}-{row['case']}"
)
def test_a_conclusion_has_not_moved(golden):
    assert golden_cases.moved(golden, golden_cases.outcome(golden["suite"], golden["case"])) == []
