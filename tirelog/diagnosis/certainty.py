"""How often a verdict of one kind is right: counts of simulated cases whose truth is known.

    verdict, carcass, number of manoeuvres -> the row of `calibration.toml`
        -> right of so many cases, and the least share that such counts allow

A verdict claims more or less, and what is right depends on the claim:

    none     nothing_missing, scatter: nothing is missing that would leave NEGLIGIBLE beside a
             refitted model on a smooth road without nuisances
    name     missing, ambiguous: what is named is what is missing, or the set holds it; no more
    part     partial: the same of its names
    unknown  something is missing that the catalogue does not have

`python -m benchmarks.calibration` draws the cases from written priors, runs them, and writes the
table. A diagnosis of another kind than all cases gets no number, and a reason.
"""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, ClassVar

import numpy as np
from scipy.special import betaincinv

from tirelog.diagnosis.candidates.assessment import (
    all_signatures,
    best_variants,
    candidate_effects,
    flip_signs,
    scores_of,
    statistics,
)
from tirelog.diagnosis.candidates.naming import Step
from tirelog.diagnosis.candidates.search import SearchResult
from tirelog.diagnosis.rules import (
    ALARM_P,
    BEYOND_DOUBT_P,
    GAIN_SIGMAS,
    LEAST_SHARE_OF_FLOOR,
    SECOND_LEAST,
)
from tirelog.inference.base import Base
from tirelog.physics.effects import BY_ID, Effect
from tirelog.physics.model.model import BY_NAME, FORM, Model
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import STRAIN

TABLE = "calibration.toml"
#: what a case may lack and "nothing is missing" is still called right [squared floors]: as much as
#: a second effect must remove to be named; half of it would call right only what no log shows
NEGLIGIBLE = 0.5
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


#: what each number on the sureness of a verdict measures, and which to go by
SURENESS = (
    "These numbers measure different things. The simulated cases count how often such verdicts are "
    "right on other tires: go by them. Draws of manoeuvres, and logs left out, show whether a few "
    "of them decide here: if so, drive more."
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


# ---- How often each effect is named when manoeuvres are drawn anew: does a few of them decide?
#
#     Found -> each step's scores, linear gains and refits, manoeuvre by manoeuvre
#         -> manoeuvres drawn with replacement, so many times
#         -> each time: which candidates alarm, and which of those refitted loses least held out
#
# Held fixed: the fit before each step and its metric, the nuisances, each candidate's form, which
# candidates were refitted and their refits, and the steps before. So it tells what chance in the
# choice of manoeuvres does, not what a new search would; and since what was measured once is drawn
# again, what is near an alarm alarms more often than it would on new logs. Frequencies are no
# probabilities of being right: `certainty` is.


#: share of the draws below which a name hangs on some manoeuvres; at half of it only what
#: loses would
STEADY = 0.8
#: draws that are asked for at most: shares are known to 0.5 % then
MOST_DRAWS = 10000
_BLOCK = 256


def inclusion(
    found: SearchResult, draws: int, extra: Iterable[Effect] = (), seed: int = 0
) -> dict[str, Any]:
    """How often each step of a search names each effect, over draws of its manoeuvres.

    The keys are `draws`, `manoeuvres` and `steps`. Each step has what it `named`, the `shares` of
    the draws that named each effect, and the share that named `none`.
    """
    extra, count, steps = tuple(extra), found.before.cells.manoeuvres, []
    even = np.full(count, 1.0 / count)
    times = np.random.default_rng(seed).multinomial(count, even, size=draws).astype(float)
    for i, step in enumerate(found.steps, start=1):
        shares, named = _shares(step, i, times, extra), step.named.id if step.named else None
        none = max(1.0 - sum(shares.values()), 0.0)
        steps.append({"step": i, "named": named, "shares": shares, "none": none})
    return {"draws": draws, "manoeuvres": count, "steps": steps}


def inclusion_sentences(drawn: Mapping[str, Any]) -> list[str]:
    """A sentence for each step; it warns if a name hangs on some manoeuvres."""
    said = []
    for step in drawn["steps"]:
        shares, none, named = step["shares"], step["none"], step["named"]
        often = [*sorted(shares.items(), key=lambda item: -item[1]), ("nothing", none)]
        parts = [f"{name} in {100.0 * share:.0f} %" for name, share in often if share > 0.0]
        which = f"step {step['step']} of the search" if len(drawn["steps"]) > 1 else "the search"
        hangs = ""
        if (shares.get(named, 0.0) if named else none) < STEADY:
            hangs = f": {named or 'that nothing is named'} hangs on some manoeuvres"
        said.append(
            f"Of {drawn['draws']} draws of the {drawn['manoeuvres']} manoeuvres {which} names "
            f"{', '.join(parts)}{hangs}."
        )
    return said


def _shares(
    step: Step, number: int, times: FloatArray, extra: tuple[Effect, ...]
) -> dict[str, float]:
    """The share of the draws (D, M) that named each effect at this step, if any did."""
    tried = {a.id for a in step.assessed} - {effect.id for effect in step.before.model.effects}
    effects = [e for e in candidate_effects(step.before.model, extra) if e.id in tried]
    alarms = _alarms(step.before, effects, times, first=number == 1)
    refitted = [r for r in step.contenders if r.established and r.id in alarms]
    loss = {r.id: times @ r.base.held_white for r in refitted}
    if not loss:  # none was refitted: the largest statistic would be
        loss = {name: -statistic for name, (_, statistic) in alarms.items()}
    if not loss:
        return {}
    alarming = np.stack([alarms[name][0] for name in loss], axis=1)
    best = np.where(alarming, np.stack(list(loss.values()), axis=1), np.inf).argmin(axis=1)
    some = alarming.any(axis=1)
    shares = {name: float(np.mean(some & (best == i))) for i, name in enumerate(loss)}
    return {name: share for name, share in shares.items() if share > 0.0}


def _alarms(
    base: Base, effects: Sequence[Effect], times: FloatArray, *, first: bool
) -> dict[str, tuple[Any, FloatArray]]:
    """By effect: which draws it alarms in, and its statistic in each, (D,).

    A further effect must remove more than the first.
    """
    kept, scores, _ = scores_of(base, all_signatures(base, effects)[0])
    if not kept:
        return {}
    under_flips = statistics(scores, flip_signs(base.cells.manoeuvres))
    largest = under_flips.max(axis=1)
    least, sure = (float(np.quantile(largest, 1.0 - p)) for p in (ALARM_P, BEYOND_DOUBT_P))
    share = LEAST_SHARE_OF_FLOOR if first else SECOND_LEAST
    size = share * base.floor.square * base.plain.weight
    result: dict[str, tuple[Any, FloatArray]] = {}
    for name, (i, white, plain) in best_variants(base, kept, under_flips[0]).items():
        gain, large = base.held_white - white, times @ (base.held_plain - plain) > size
        statistic, count = statistics([scores[i]], times)[:, 0], gain.size
        mean = times @ gain / count
        spread = np.sqrt(np.maximum(times @ gain**2 / count - mean**2, 0.0))
        shared = 1.0 / count + 1.0 / max(count - 1.0, 1.0)  # as in `gain_and_error`
        error = spread * count * (shared * count / max(count - 1.0, 1.0)) ** 0.5
        surely = times @ gain > GAIN_SIGMAS * error
        strong = first & (statistic >= sure)
        result[name] = ((statistic >= least) & surely & (large | strong), statistic)
    return result


# ---- Does the verdict stand if one log, or one tire, is left out?  And what does each say alone?
#
#     verdicts without each log, or tire -> where the verdict is another one
#     verdicts of each alone             -> verdicts and names counted, p adjusted over them
#
# `diagnose.with_groups` asks for them.
#
# What is pooled says one thing of tires that may differ; each alone says whether they do. Over many
# tires some alarm by chance: the adjusted p (Benjamini and Hochberg 1995) holds the share of false
# ones among those that are reported to lack something at `FALSE_DISCOVERIES`.


#: share of false ones among tires that are reported to lack something; doubled, twice as many
FALSE_DISCOVERIES = 0.05
#: verdicts that say that something is missing
_LACKS = ("missing", "ambiguous", "partial", "unknown")
#: groups that a sentence names; of more their number
_TOLD = 4


@dataclass(frozen=True)
class GroupVerdict:
    """The verdict on some of the logs.

    `group`: the log or tire that was left out, or alone; `verdict` "" if it could not be asked,
    `problem` why. `p`: how likely chance alone is to look so; None if nothing was tested.
    """

    group: str
    logs: tuple[str, ...]
    verdict: str
    selected: tuple[str, ...] = ()
    ambiguous_groups: tuple[tuple[str, ...], ...] = ()
    p: float | None = None
    probability: float | None = None
    problem: str = ""

    @property
    def tested(self) -> bool:
        """Was anything tested: it could be asked, and there were manoeuvres enough?"""
        return self.verdict not in ("", "too_few")

    @property
    def alarms(self) -> bool:
        """Does the verdict claim that something is missing?"""
        return self.verdict in _LACKS

    @property
    def said(self) -> str:
        """The verdict and its names."""
        names = " or ".join(self.selected) if self.verdict == "ambiguous" else ""
        names = names or " and ".join(self.selected)
        return self.verdict.replace("_", " ") + (f" ({names})" if names else "")


def stability(by: str, whole: GroupVerdict, without: Sequence[GroupVerdict]) -> dict[str, Any]:
    """The verdicts without each log, or tire (`by`), beside that of the `whole`, and a sentence.

    The sentence says whether the verdict holds, where it changes, and where that is not known.
    """
    claim = (whole.verdict, {*whole.selected})
    same = [(a.verdict, {*a.selected}) == claim if a.tested else None for a in without]
    pairs = list(zip(without, same, strict=True))
    changed = [f"without {a.group} it is {a.said}" for a, like in pairs if like is False]
    untold = [
        f"without {a.group}: {a.problem or 'too few manoeuvres are left'}"
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
    rows = [vars(a) | {"same": like} for a, like in pairs]
    return {"by": by, "sentence": said, "without": rows}


def _some(parts: Sequence[str]) -> str:
    """The first of them, and how many more there are."""
    more = f"; and {len(parts) - _TOLD} more" if len(parts) > _TOLD else ""
    return "; ".join(parts[:_TOLD]) + more


def each_alone(by: str, verdicts: Sequence[GroupVerdict]) -> dict[str, Any]:
    """What each log, or tire (`by`), says alone, before anything is pooled, and a sentence.

    `p_adjusted` over all of them; `lacking` says of which something is missing by it; `inclusion`
    has of each effect that one of these names the share of those tested that do.
    """
    left = iter(benjamini_hochberg([a.p for a in verdicts if a.p is not None]).tolist())
    adjusted = [None if a.p is None else next(left) for a in verdicts]
    rows = [
        vars(a)
        | {"p_adjusted": q, "lacking": a.alarms and q is not None and q <= FALSE_DISCOVERIES}
        for a, q in zip(verdicts, adjusted, strict=True)
    ]
    lacking, tested = [row for row in rows if row["lacking"]], [a for a in verdicts if a.tested]
    named = Counter(name for row in lacking for name in row["selected"]).most_common()
    said = f"No {by} alone has manoeuvres enough for a test"
    if tested:
        names = "".join(f", {name} in {n}" for name, n in named)
        said = (
            f"Each {by} alone: something is missing in {len(lacking)} of {len(tested)}{names} "
            f"(at most {100.0 * FALSE_DISCOVERIES:.0f} % of them by chance)"
        )
    if (chance := sum(a.alarms for a in verdicts) - len(lacking)) > 0:
        said += (
            f"; {chance} more {'alarms' if chance == 1 else 'alarm'}, no more than chance does "
            f"among {len(tested)}"
        )
    if len({(a.alarms, frozenset(a.selected)) for a in tested}) > 1:
        said += f"; the {by}s do not say the same: what is pooled is their mean"
    shares = {name: n / len(tested) for name, n in named}
    return {"by": by, "sentence": f"{said}.", "inclusion": shares, "each": rows}


def benjamini_hochberg(p: Sequence[float]) -> FloatArray:
    """p adjusted so that those below q are false in a share of q at most, (n,)."""
    given = np.asarray(p, dtype=np.float64)
    order = np.argsort(given)[::-1]
    by_rank = given[order] * given.size / np.arange(given.size, 0, -1)
    return np.minimum(np.minimum.accumulate(by_rank), 1.0)[np.argsort(order)]
