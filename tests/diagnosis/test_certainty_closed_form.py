"""Closed form: how often a verdict is right, and how much surer another stretch makes it."""

import math
import tomllib
from datetime import date
from pathlib import Path

import pytest
import tomlkit
from scipy.stats import binom

from benchmarks.calibration import is_right, rows_of, table
from benchmarks.nuisances import Row
from tirelog.diagnosis.candidates.separation import (
    expected_gain,
    probability_after,
)
from tirelog.diagnosis.certainty import calibration as shipped
from tirelog.diagnosis.certainty import certainty_of, least_share, unlike_cases
from tirelog.physics.model.model import Model

KIND = {"verdict": "missing", "carcass": "beam", "manoeuvres": 22}
NAME = {
    "cases": 40, "tires": 20, "right": 32, "carcasses": ["beam"],
    "manoeuvres": [20, 24], "lacking": [],
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


@pytest.mark.parametrize(("right", "cases"), [(49, 49), (32, 40), (1, 9), (0, 5)])
def test_the_bound_is_the_share_with_which_so_many_right_ones_are_one_in_forty(right, cases):
    # Clopper and Pearson (1934): at the lower limit P(right or more) is half of 5 %
    least = least_share(right, cases)
    beyond = float(binom.sf(right - 1, cases, least)) if right else 0.025
    assert beyond == pytest.approx(0.025, rel=1e-9)
    assert least <= right / cases
    assert least_share(cases, cases) == pytest.approx(0.025 ** (1.0 / cases), rel=1e-12)


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
    found = certainty_of(**{**KIND, **change}, table=TABLE)
    assert found.probability is None
    assert found.sentence == f"How often such a verdict is right is not known: {said}."


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


def test_the_table_of_the_package_is_that_of_the_rows_that_are_kept():
    rows = rows_of(Path(__file__).parents[2] / "benchmarks" / "rows" / "calibration.csv")
    known = shipped()
    made = tomllib.loads(tomlkit.dumps(table(rows, date.fromisoformat(known["date"]))))
    assert {"seeds", "none", "name", "unknown"} <= made.keys() == known.keys()
    assert all(made[key] == known[key] for key in made if key not in ("date", "tires"))
    assert known["tires"] >= 100
    for verdict in ("missing", "nothing_missing"):
        found = certainty_of(**{**KIND, "verdict": verdict}, table=known)
        assert 0.5 < found.probability < found.right / found.cases <= 1.0


def test_of_two_as_likely_the_right_one_is_told_as_two_normals_part():
    for sigma, p in ((0.0, 0.5), (2.0, 0.841345), (6.0, 0.998650)):
        assert probability_after(0.0, sigma) == pytest.approx(p, abs=1e-6)
    # nothing is lost by driving, and in the end all is known
    assert probability_after(math.log(9.0), 0.0) == pytest.approx(0.9)
    assert probability_after(math.log(9.0), 1e-3) == pytest.approx(0.9)
    assert probability_after(-math.log(9.0), 30.0) == pytest.approx(1.0)


def test_a_gain_is_the_share_of_the_two():
    # a set of two that is right in 90 of 100: 45 points are to be won at most
    assert expected_gain(0.45, 0.45, 40.0) == pytest.approx(0.45)
    assert expected_gain(0.45, 0.45, 2.0) == pytest.approx(0.9 * 0.841345 - 0.45, abs=1e-5)
    assert expected_gain(0.9, 0.05, 0.0) == pytest.approx(0.0, abs=1e-12)
    assert expected_gain(0.9, 0.0, 5.0) == 0.0
