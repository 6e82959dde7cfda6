"""How often a verdict of one kind is right: counts of simulated cases whose truth is known.

    verdict, carcass, number of manoeuvres -> the row of `calibration.toml`
        -> right of so many cases, and the least share that such counts allow

A verdict claims more or less, and what is right depends on the claim:

    none     nothing_missing, scatter: nothing is missing that would leave SECOND_LEAST beside a
             refitted model on a smooth road without nuisances
    name     missing, ambiguous: what is named is what is missing, or the set holds it; no more
    part     partial: the same of its names
    unknown  something is missing that the catalogue does not have

`python -m benchmarks.calibration` draws the cases from written priors, runs them, and writes the
table. A diagnosis of another kind than all cases gets no number, and a reason.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, ClassVar

from scipy.special import betaincinv

from tirelog.physics.effects import BY_ID
from tirelog.physics.model.model import BY_NAME, FORM, Model
from tirelog.vocabulary.observables import STRAIN

TABLE = "calibration.toml"
#: the verdicts that say alike
CLASSES: Mapping[str, tuple[str, ...]] = {
    "none": ("nothing_missing", "scatter"),
    "name": ("missing", "ambiguous"),
    "part": ("partial",),
    "unknown": ("unknown",),
}


#: confidence of the interval whose lower limit is the least share: at 99 % it would be 90 % of 49
#: right cases in 49, not 92 %
_CONFIDENCE = 0.95


def least_share(right: int, cases: int) -> float:
    """The lower limit of the Clopper-Pearson interval of a share, by `right` of so many cases."""
    below = 0.5 * (1.0 - _CONFIDENCE)
    return float(betaincinv(right, cases - right + 1.0, below)) if right else 0.0


@dataclass(frozen=True)
class Certainty:
    """How many simulated cases of this kind of verdict were right, or why none is counted.

    probability  the least share that is right (`least_share`); None without such cases
    cases, right, tires  what was simulated until `date`: verdicts, right ones, different tires
    lacking      what no case had;  reason  why nothing is counted
    """

    probability: float | None
    cases: int = 0
    tires: int = 0
    date: str = ""
    lacking: tuple[str, ...] = ()
    reason: str = ""
    right: int = 0
    also: ClassVar = ("bound", "sentence")

    @property
    def bound(self) -> str:
        """What kind of number `probability` is."""
        limit = f"lower limit of the {100.0 * _CONFIDENCE:.0f} % Clopper-Pearson interval"
        return limit if self.cases else ""

    @property
    def sentence(self) -> str:
        """The same in words."""
        if self.probability is None:
            return f"{self.count}: {self.reason}."
        but = f" None had an {' or an '.join(self.lacking)}." if self.lacking else ""
        return f"{self.count} ({self.bound}; {self.tires} tires, {self.date}).{but}"

    @property
    def count(self) -> str:
        """The cases that were right, in words; that none is known otherwise."""
        if self.probability is None:
            return "How often such a verdict is right is not known"
        return (
            f"{self.right} of {self.cases} simulated cases of this kind were right: at least "
            f"{int(100.0 * self.probability)} %"
        )


#: what the numbers on the sureness of a verdict measure, and which to go by
SURENESS = (
    "The simulated cases count how often such verdicts are right on other tires: go by them. Logs "
    "left out show whether one of them decides here: if so, drive more."
)


def class_of(verdict: str) -> str | None:
    """The class of verdicts that say alike; None: it claims nothing."""
    return next((name for name, verdicts in CLASSES.items() if verdict in verdicts), None)


def certainty_of(
    verdict: str, carcass: str, manoeuvres: int, table: Mapping[str, Any] | None = None
) -> Certainty:
    """The counts for a verdict on so many manoeuvres, by the package's table or another."""
    table, kind = calibration() if table is None else table, class_of(verdict) or ""
    known, words = table.get(kind, {}), " or ".join(CLASSES.get(kind, ()))
    (low, high), had = known.get("manoeuvres", (0, 0)), known.get("carcasses", ())
    reasons = {
        "it claims nothing": not kind,
        f"no simulated case was {words}": not known,
        f"simulated cases that were {words} had a {' or '.join(had)}": carcass not in had,
        # so many times the manoeuvres that the cases had, or so few, are still of their kind
        f"simulated cases had {low} to {high} manoeuvres, these logs {manoeuvres}": not (
            low / 1.5 <= manoeuvres <= high * 1.5
        ),
    }
    if why := next((why for why, holds in reasons.items() if holds), ""):
        return Certainty(None, reason=why)
    right, cases = int(known["right"]), int(known["cases"])
    return Certainty(
        least_share(right, cases),
        cases,
        known["tires"],
        str(table["date"]),
        tuple(known["lacking"]),
        right=right,
    )


def unlike_cases(model: Model, selected: Iterable[str], gratings: bool) -> str:
    """Why no simulated case was like a diagnosis of this model, "" if some were.

    `gratings`: it was asked of several.
    """
    own = [effect.id for effect in model.effects]
    new = [name for name in selected if name not in BY_ID]
    logs = " and ".join(model.observables)
    uses = [(nuisance.use, BY_NAME[nuisance.name].use) for nuisance in model.nuisances]
    reasons = {
        "the cases had one grating": gratings,
        f"the cases had {STRAIN}, these logs have {logs}": model.observables != (STRAIN,),
        "in the cases no form of the tire's own came in": FORM in own,
        "the cases began with a bare model, this one holds effects already": own,
        "in the cases every nuisance might come in, this model says which": any(
            use != usual for use, usual in uses
        ),
        f"the cases had the catalogue alone, and {' '.join(new[:1])} is not of it": new,
    }
    return next((why for why, holds in reasons.items() if holds), "")


@cache
def calibration() -> dict[str, Any]:
    """The table that the package comes with (see `benchmarks.calibration`)."""
    return tomllib.loads((resources.files("tirelog.diagnosis") / TABLE).read_text("utf-8"))


# ---- Does the verdict stand if one log, or one tire, is left out?
#
#     verdicts without each log, or tire -> where the verdict is another one
#
# `diagnose.with_groups` asks for them.


#: the verdict on some of the logs that could not be asked. `group`: the log or tire that was left
#: out; `problem`: why it could not be asked
NO_VERDICT: dict[str, Any] = {
    "group": "", "logs": (), "verdict": "", "selected": (), "ambiguous_groups": (),
    "probability": None, "problem": "",
}  # fmt: skip


def stability(
    by: str, whole: Mapping[str, Any], without: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """The verdicts without each log, or tire (`by`), beside that of the `whole`, and a sentence.

    Each has what `NO_VERDICT` has. The sentence says whether the verdict holds, where it changes,
    and where that is not known: not asked, or of too few manoeuvres.
    """
    claim = (whole["verdict"], {*whole["selected"]})
    same = [
        None if a["verdict"] in ("", "too_few") else (a["verdict"], {*a["selected"]}) == claim
        for a in without
    ]
    pairs = list(zip(without, same, strict=True))
    changed = [f"without {a['group']} it is {_with_names(a)}" for a, like in pairs if like is False]
    untold = [
        f"without {a['group']}: {a['problem'] or 'too few manoeuvres are left'}"
        for a, like in pairs
        if like is None
    ]
    told = len(without) - len(untold)
    said = f"Whether the verdict hangs on single {by}s is not known."
    if changed:
        said = f"The verdict hangs on single {by}s, {len(changed)} of {told}: {_some(changed)}."
    elif told:
        said = f"The verdict holds: it is the same without any one of {told} {by}s."
    said += f" Not known: {_some(untold)}." if untold else ""
    rows = [{**a, "same": like} for a, like in pairs]
    return {"by": by, "sentence": said, "without": rows}


def _with_names(row: Mapping[str, Any]) -> str:
    """The verdict and its names."""
    names = (" or " if row["verdict"] == "ambiguous" else " and ").join(row["selected"])
    return str(row["verdict"]).replace("_", " ") + (f" ({names})" if names else "")


def _some(parts: Sequence[str], most: int = 4) -> str:
    """The first of them, and how many more there are."""
    more = f"; and {len(parts) - most} more" if len(parts) > most else ""
    return "; ".join(parts[:most]) + more
