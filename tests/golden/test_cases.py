"""Golden: what `diagnose` concludes of 80 simulated tires, with and without a planted effect."""

import pytest

from benchmarks import golden_cases

pytestmark = pytest.mark.slow  # some ten seconds each

#: the constant part of a tire's form goes by these names
OF_FORM = {"shear_layer": "belt_tension", "shifted": "pressure_offset"}


def test_all_cases_are_kept():
    kept = [(row["suite"], row["case"]) for row in golden_cases.read()]
    assert kept == list(golden_cases.listed())


def test_nothing_is_named_where_nothing_is_planted():
    for row in golden_cases.read():
        words = row["case"].split()
        if words[0] in ("null", "null2", "scatter") or words[-2] == "none":
            assert row["named"] == OF_FORM.get(words[1], ""), row["case"]


@pytest.mark.parametrize(
    "golden", golden_cases.read(), ids=lambda row: f"{row['suite']}-{row['case']}"
)
def test_a_conclusion_has_not_moved(golden):
    assert golden_cases.moved(golden, golden_cases.outcome(golden["suite"], golden["case"])) == []
