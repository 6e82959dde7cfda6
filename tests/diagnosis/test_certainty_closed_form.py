"""Closed form: how often a verdict is right, where it hangs on one log, and what makes it surer."""

import math
import tomllib
from dataclasses import dataclass, replace
from datetime import date
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import tomlkit
from scipy.stats import binom

from benchmarks.calibration import is_right, rows_of, table
from benchmarks.nuisances import Row
from tests.diagnosis.planted import stack
from tirelog.diagnosis import diagnose as diagnosing
from tirelog.diagnosis.candidates.separation import (
    probability_after,
)
from tirelog.diagnosis.certainty import (
    NO_VERDICT,
    certainty_of,
    least_share,
    stability,
    unlike_cases,
)
from tirelog.diagnosis.certainty import calibration as shipped
from tirelog.errors import ModelError, UsageError
from tirelog.inference.cells.pieces import pieces_of_logs
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


WHOLE = NO_VERDICT | {"logs": ("a", "b", "c"), "verdict": "missing", "selected": ("wear",)}


def without(group, verdict="missing", selected=("wear",), **more):
    return NO_VERDICT | {"group": group, "verdict": verdict, "selected": selected} | more


def test_a_verdict_that_hangs_on_one_log_says_on_which():
    others = (
        without("a", "nothing_missing", ()),
        without("b"),
        without("c", "", (), problem="needs water_depth_mm"),
        without("d", "ambiguous", ("wear",)),
        without("e", "too_few", ()),
    )
    found = stability("tire", WHOLE, others)
    assert found["sentence"] == (
        "The verdict hangs on single tires, 2 of 3: without a it is nothing missing; without d it "
        "is ambiguous (wear). Not known: without c: needs water_depth_mm; without "
        "e: too few manoeuvres are left."
    )
    assert [row["same"] for row in found["without"]] == [False, True, None, False, None]
    held = stability("log", WHOLE, [without("a"), without("b"), without("c")])
    assert held["sentence"] == "The verdict holds: it is the same without any one of 3 logs."
    assert stability("log", WHOLE, others[-1:])["sentence"].startswith(
        "Whether the verdict hangs on single logs is not known. Not known: "
    )


def several():
    """Three logs of eight manoeuvres, as pieces."""
    made = [stack(manoeuvres=8, revolutions=4, seed=s, m=16) for s in (1, 2, 3)]
    names = ("a", "b", "c")
    numbered = [
        replace(one, logs=names, log=np.full(len(one), i), manoeuvre=one.manoeuvre + 8 * i)
        for i, one in enumerate(made)
    ]
    return pieces_of_logs(numbered)


def test_pieces_without_a_log_are_those_of_the_others():
    pieces = several()
    (rest,) = diagnosing.of_logs([pieces], ["c", "a"])
    assert rest.logs == ("a", "c")
    assert np.unique(rest.log).tolist() == [0, 1]
    assert np.unique(rest.manoeuvre).tolist() == list(range(16))
    assert np.array_equal(rest.values, pieces.values[pieces.log != 1], equal_nan=True)
    with pytest.raises(UsageError, match="no log is left"):
        diagnosing.of_logs([pieces], [])


@dataclass(frozen=True)
class Said:
    """As much of a diagnosis as is asked of one of some logs."""

    verdict: str
    selected: tuple[str, ...]
    notes: tuple[str, ...] = ()
    stability: dict | None = None
    ambiguous_groups = ()
    certainty = SimpleNamespace(probability=0.9)


def test_each_log_is_left_out_once_and_of_one_none_can_be(monkeypatch):
    asked = []

    def found(pieces, model, effects=()):
        (one,) = pieces
        asked.append(one.logs)
        if one.logs == ("b", "c"):
            raise ModelError("needs water_depth_mm")
        return Said("missing", ("wear",)) if "b" in one.logs else Said("nothing_missing", ())

    monkeypatch.setattr(diagnosing, "diagnose", found)
    pieces = [several()]
    whole, some = found(pieces, None), partial(diagnosing.of_logs, pieces)
    result = diagnosing.with_groups(whole, diagnosing.logs_of(pieces), some, None)
    assert asked[1:] == [("b", "c"), ("a", "c"), ("a", "b")]
    assert [(row["group"], row["verdict"]) for row in result.stability["without"]] == [
        ("a", ""),
        ("b", "nothing_missing"),
        ("c", "missing"),
    ]
    assert result.notes == (result.stability["sentence"],)
    tires = {"old": ("a", "c"), "new": ("b",)}
    result = diagnosing.with_groups(whole, tires, some, None, by="tire")
    assert [(row["group"], row["verdict"]) for row in result.stability["without"]] == [
        ("old", "missing"),
        ("new", "nothing_missing"),
    ]
    with pytest.raises(UsageError, match="one log alone: none can be left out"):
        diagnosing.refuse_one({"a": ("a",)}, "log")
