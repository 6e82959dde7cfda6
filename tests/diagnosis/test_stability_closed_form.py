"""Closed form: what is said without each log, or tire."""

from dataclasses import dataclass, replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.planted import stack
from tirelog.diagnosis import diagnose as diagnosing
from tirelog.diagnosis.certainty import GroupVerdict, stability
from tirelog.errors import ModelError, UsageError
from tirelog.inference.cells.pieces import pieces_of_logs

WHOLE = GroupVerdict("", ("a", "b", "c"), "missing", ("wear",))


def without(group, verdict="missing", selected=("wear",), **more):
    return GroupVerdict(group, (), verdict, selected, **more)


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
