"""How often a verdict like this one is right: by simulated cases whose truth is known.

    Diagnosis -> Marks: what a diagnosis knows of itself -> the row of `calibration.toml`
        -> P(right), held between what so many cases can tell

A verdict says more or less, and what is right depends on what it says:

    none     nothing_missing, scatter: nothing is missing that would leave NEGLIGIBLE beside a
             refitted model on a smooth road with nothing else amiss
    name     missing, ambiguous: what is named is what is missing, or stands in the set; no more
    part     partial: the same of its names
    unknown  something is missing that the catalogue does not have

`python -m benchmarks.calibration` draws the cases from priors that stand there in words, runs
them, and writes the table; a logistic in very few terms, each of a sign that was given beforehand,
shrunk towards even odds by two cases. What no such case was like gets no number, and why is said.
"""

from __future__ import annotations

import math
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np

from tirelog.diagnosis.answer import plain_fields
from tirelog.diagnosis.candidates.assessment import (
    all_signatures,
    best_variants,
    candidate_effects,
    flip_signs,
    gain_sigmas,
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
from tirelog.physics.carcass.numbers import steady_carcass
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


@dataclass(frozen=True)
class Marks:
    """What a diagnosis knows of itself, by which like cases are found; NaN if it is not known.

    heldout_before, heldout_after  held-out errors [floors];  chi2_before, chi2_after per freedom
    least_p        least family-wise p of the first step
    gain_sigmas    held-out gain of the names, the least of them [standard errors]
    rival_sigmas   by how much the next rival is worse held out [standard errors]
    """

    verdict: str
    carcass: str
    manoeuvres: int
    heldout_before: float
    heldout_after: float
    chi2_before: float
    chi2_after: float
    least_p: float = math.nan
    gain_sigmas: float = math.nan
    rival_sigmas: float = math.nan


def marks_of(
    found: SearchResult,
    verdict: str,
    floor: float,
    held: tuple[float | None, float | None],
    chi2: tuple[float, float],
) -> Marks:
    """What a diagnosis knows of itself.

    held, floor  held-out errors before and after, and the noise floor, in one unit
    chi2         reduced chi-square before and after
    """
    # a rival, or a gain, is as far away as matters [standard errors]; doubling changes nothing that
    # simulated cases showed
    far = 10.0
    gains, rivals = [], []
    for step in found.steps:
        if step.named is None:
            continue
        best = step.named.base
        gains.append(gain_sigmas(step.before.held_white, best.held_white))
        apart = [r for r in step.contenders if r.id != step.named.id and r.id not in step.group]
        rivals += [gain_sigmas(r.base.held_white, best.held_white) for r in apart] or [far]
    in_floors = [math.nan if e is None or not floor > 0.0 else e / floor for e in held]
    return Marks(
        verdict,
        steady_carcass(found.before.model.carcass),
        found.before.cells.manoeuvres,
        in_floors[0],
        in_floors[1],
        chi2[0],
        chi2[1],
        least_p=min((a.p for a in found.steps[0].assessed), default=1.0),
        gain_sigmas=float(np.clip(min(gains), 0.0, far)) if gains else 0.0,
        rival_sigmas=float(np.clip(min(rivals), 0.0, far)) if rivals else 0.0,
    )


@dataclass(frozen=True)
class CertaintyTerm:
    """A number of a diagnosis that goes with being right: `sign` says which way it may go."""

    words: str
    sign: int
    of: Callable[[Marks], float]


#: by name; what a class of verdicts may use stands in `OF_CLASS`, best first
TERMS: Mapping[str, CertaintyTerm] = {
    "rest": CertaintyTerm(
        "held-out error above the floor, in steps of 0.05 floors",
        -1,
        lambda marks: max(marks.heldout_after - 1.0, 0.0) / 0.05,  # QUIET_FLOORS allows one
    ),
    "evidence": CertaintyTerm(
        "decades of the least p of any effect, named or not",
        -1,
        lambda marks: -math.log10(marks.least_p) if marks.least_p > 0.0 else math.nan,
    ),
    "size": CertaintyTerm(
        "decades by which chi-square falls",
        1,
        lambda marks: (
            math.log10(marks.chi2_before / marks.chi2_after)
            if marks.chi2_before > 0.0 and marks.chi2_after > 0.0
            else math.nan
        ),
    ),
    "rival": CertaintyTerm(
        "standard errors to the next rival, held out", 1, lambda marks: marks.rival_sigmas
    ),
}
OF_CLASS: Mapping[str, tuple[str, ...]] = {
    "none": ("rest", "evidence"),
    "name": ("rest", "size", "rival"),
    "part": ("rest",),
    "unknown": ("size",),
}


@dataclass(frozen=True)
class Certainty:
    """How often a verdict like this one is right, or why that is not known.

    `probability` None: no calibration; `reason` says why. Otherwise it rests on `cases` of the
    same class of verdict, `tires` different ones among them, simulated until `date`.
    """

    probability: float | None
    cases: int = 0
    tires: int = 0
    date: str = ""
    lacking: tuple[str, ...] = ()
    reason: str = ""

    @property
    def sentence(self) -> str:
        """The same in words."""
        if self.probability is None:
            return f"No calibration for this kind: {self.reason}."
        but = f"; none had an {' or an '.join(self.lacking)}" if self.lacking else ""
        of_100 = math.floor(100.0 * self.probability + 1e-9)  # no more than is known
        return (
            f"Right in {of_100} of 100 like cases ({self.cases} simulated, {self.tires} tires, "
            f"{self.date}{but})."
        )

    def to_json(self) -> dict[str, Any]:
        return asdict(self) | {"sentence": self.sentence}


def class_of(verdict: str) -> str | None:
    """The class of verdicts that say alike; None: it claims nothing."""
    return next((name for name, verdicts in CLASSES.items() if verdict in verdicts), None)


def certainty_of(marks: Marks, table: Mapping[str, Any] | None = None) -> Certainty:
    """P(right) of a diagnosis with these marks, by the package's table or another."""
    table, kind = calibration() if table is None else table, class_of(marks.verdict)
    if kind is None:
        return Certainty(None, reason="it claims nothing")
    known, words = table.get(kind), " or ".join(CLASSES[kind])
    if known is None:
        return Certainty(None, reason=f"no simulated case was {words}")
    if marks.carcass not in known["carcasses"]:
        had = " or ".join(known["carcasses"])
        return Certainty(None, reason=f"simulated cases that were {words} had a {had}")
    low, high = known["manoeuvres"]
    # so many times the manoeuvres that the cases had, or so few, are still like them
    if not low / 1.5 <= marks.manoeuvres <= high * 1.5:
        return Certainty(
            None, reason=f"simulated cases had {low} to {high} manoeuvres, these logs "
            f"{marks.manoeuvres}",
        )  # fmt: skip
    logit = float(known["intercept"])
    for name, term in known.get("terms", {}).items():
        value = TERMS[name].of(marks)
        if math.isfinite(value):  # what is not known is as in the middle of the cases
            inside = min(max(value, term["low"]), term["high"])
            logit += term["slope"] * (inside - term["centre"])
    most = float(known["most"])  # that so many cases can tell
    p = min(max(1.0 / (1.0 + math.exp(-logit)), 1.0 - most), most)
    return Certainty(
        math.floor(1000.0 * p + 1e-6) / 1000.0,
        known["cases"],
        known["tires"],
        str(table["date"]),
        tuple(known["lacking"]),
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
    text = (resources.files("tirelog.diagnosis") / TABLE).read_text("utf-8")
    return tomllib.loads(text)


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


#: share of the draws below which a name is said to hang on some manoeuvres; at half of it, it would
#: be said only of what loses
STEADY = 0.8
#: draws that are asked for at most: shares are known to 0.5 % then
MOST_DRAWS = 10000
_BLOCK = 256


@dataclass(frozen=True)
class StepInclusion:
    """One step of the search: the share of draws that named each effect; the rest named none."""

    step: int
    named: str | None
    shares: dict[str, float]

    @property
    def none(self) -> float:
        return max(1.0 - sum(self.shares.values()), 0.0)


@dataclass(frozen=True)
class Inclusion:
    """The steps of a search under so many draws of its manoeuvres."""

    draws: int
    manoeuvres: int
    steps: tuple[StepInclusion, ...]

    @property
    def sentences(self) -> list[str]:
        """A sentence for each step; that a name hangs on some manoeuvres is said."""
        said = []
        for step in self.steps:
            shares, none, named = step.shares, step.none, step.named
            order = sorted(shares.items(), key=lambda item: -item[1])
            parts = [f"{name} in {100.0 * share:.0f} %" for name, share in order if share > 0.0]
            parts += [f"nothing in {100.0 * none:.0f} %"] if none > 0.0 else []
            which = f"step {step.step} of the search" if len(self.steps) > 1 else "the search"
            text = (
                f"of {self.draws} draws of the {self.manoeuvres} manoeuvres {which} names "
                f"{', '.join(parts)}"
            )
            if (shares.get(named, 0.0) if named else none) < STEADY:
                text += f": {named or 'that nothing is named'} hangs on some manoeuvres"
            said.append(f"{text[0].upper()}{text[1:]}.")
        return said

    def to_json(self) -> dict[str, Any]:
        return vars(self) | {"steps": [vars(step) | {"none": step.none} for step in self.steps]}


def inclusion(
    found: SearchResult, draws: int, extra: Iterable[Effect] = (), seed: int = 0
) -> Inclusion:
    """How often each step of a search names each effect, over draws of its manoeuvres."""
    extra, count = tuple(extra), found.before.cells.manoeuvres
    random = np.random.default_rng(seed)
    times = random.multinomial(count, np.full(count, 1.0 / count), size=draws).astype(float)
    steps = tuple(
        StepInclusion(i, step.named.id if step.named else None, _shares(step, i, times, extra))
        for i, step in enumerate(found.steps, start=1)
    )
    return Inclusion(draws, count, steps)


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
        surely = times @ gain > GAIN_SIGMAS * count / max(count - 1.0, 1.0) ** 0.5 * spread
        strong = first & (statistic >= sure)
        result[name] = ((statistic >= least) & surely & (large | strong), statistic)
    return result


# ---- Does the verdict stand if one log, or one tire, is left out?  And what does each say alone?
#
#     answers without each log, or tire -> Stability: where the verdict is another one
#     answers of each alone             -> Each: verdicts and names counted, p adjusted over them
#
# `by_group` asks for them.
#
# What is pooled says one thing of tires that may differ; each alone says whether they do. Over many
# tires some alarm by chance: the adjusted p (Benjamini and Hochberg 1995) holds the share of false
# ones among those that are said to lack something at `FALSE_DISCOVERIES`.


#: share of false ones among tires that are said to lack something; doubled, twice as many
FALSE_DISCOVERIES = 0.05
#: verdicts that say that something is missing
_LACKS = ("missing", "ambiguous", "partial", "unknown")
#: groups that a sentence names; of more their number
_TOLD = 4


@dataclass(frozen=True)
class GroupVerdict:
    """What was said of some of the logs.

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
    def said(self) -> str:
        """The verdict and its names."""
        names = " or ".join(self.selected) if self.verdict == "ambiguous" else ""
        names = names or " and ".join(self.selected)
        return self.verdict.replace("_", " ") + (f" ({names})" if names else "")


@dataclass(frozen=True)
class Stability:
    """The verdicts without each log, or tire, in turn.

    `by`: log or tire; `whole`: what is said of all of them.
    """

    by: str
    whole: GroupVerdict
    without: tuple[GroupVerdict, ...]

    @property
    def changed(self) -> tuple[GroupVerdict, ...]:
        """Where another thing is said."""
        return tuple(a for a in self.without if a.tested and not like_cases(a, self.whole))

    @property
    def sentence(self) -> str:
        """Whether the verdict stands, where it does not, and where it cannot be told."""
        changed, untold = self.changed, [a for a in self.without if not a.tested]
        told = len(self.without) - len(untold)
        said = f"Whether the verdict hangs on single {self.by}s cannot be told."
        if changed:
            each = _some([f"without {a.group} it is {a.said}" for a in changed])
            said = f"The verdict hangs on single {self.by}s, {len(changed)} of {told}: {each}."
        elif told:
            said = f"The verdict stands: it is the same without any one of {told} {self.by}s."
        if untold:
            why = [f"{a.group}: {a.problem or 'too few manoeuvres are left'}" for a in untold]
            said += f" Not to be told: {_some([f'without {one}' for one in why])}."
        return said

    def to_json(self) -> dict[str, Any]:
        rows = [
            asdict(a) | {"same": like_cases(a, self.whole) if a.tested else None}
            for a in self.without
        ]
        return plain_fields({"by": self.by, "sentence": self.sentence, "without": rows})


def _some(parts: Sequence[str]) -> str:
    """The first of them, and how many more there are."""
    more = f"; and {len(parts) - _TOLD} more" if len(parts) > _TOLD else ""
    return "; ".join(parts[:_TOLD]) + more


def like_cases(one: GroupVerdict, other: GroupVerdict) -> bool:
    """Do two answers say the same?  Verdict and names; "missing" beside "ambiguous" is another."""
    return one.verdict == other.verdict and set(one.selected) == set(other.selected)


@dataclass(frozen=True)
class PerGroup:
    """What each log, or tire, says alone, before anything is pooled."""

    by: str
    answers: tuple[GroupVerdict, ...]

    @property
    def adjusted(self) -> tuple[float | None, ...]:
        """p of each, adjusted over those of which there is one."""
        left = iter(benjamini_hochberg([a.p for a in self.answers if a.p is not None]).tolist())
        return tuple(None if a.p is None else next(left) for a in self.answers)

    @property
    def lacking(self) -> tuple[GroupVerdict, ...]:
        """Those of which something is missing, with p adjusted over all of them."""
        return tuple(
            a
            for a, q in zip(self.answers, self.adjusted, strict=True)
            if a.verdict in _LACKS and q is not None and q <= FALSE_DISCOVERIES
        )

    @property
    def asked(self) -> tuple[GroupVerdict, ...]:
        """Those in which anything was tested."""
        return tuple(a for a in self.answers if a.tested)

    @property
    def named(self) -> list[tuple[str, int]]:
        """How many of those that lack something name each effect, the most first."""
        return Counter(name for a in self.lacking for name in a.selected).most_common()

    @property
    def inclusion(self) -> dict[str, float]:
        """Of each effect that is named somewhere the share of those asked that name it."""
        return {name: n / len(self.asked) for name, n in self.named}

    @property
    def sentence(self) -> str:
        """How many lack something, which effect how often, and whether they say the same."""
        asked, lacking = self.asked, self.lacking
        if not asked:
            return f"No {self.by} alone has manoeuvres enough for a test."
        chance = [a for a in asked if a.verdict in _LACKS and a not in lacking]
        names = "".join(f", {name} in {n}" for name, n in self.named)
        said = (
            f"Each {self.by} alone: something is missing in {len(lacking)} of {len(asked)}{names} "
            f"(at most {100.0 * FALSE_DISCOVERIES:.0f} % of them by chance)"
        )
        if chance:
            said += (
                f"; {len(chance)} more {'alarms' if len(chance) == 1 else 'alarm'}, no more than "
                f"chance does among {len(asked)}"
            )
        if len({(a.verdict in _LACKS, frozenset(a.selected)) for a in asked}) > 1:
            said += f"; the {self.by}s do not say the same: what is pooled is their mean"
        return f"{said}."

    def to_json(self) -> dict[str, Any]:
        rows = [
            asdict(a) | {"p_adjusted": q, "lacking": a in self.lacking}
            for a, q in zip(self.answers, self.adjusted, strict=True)
        ]
        fields = {"by": self.by, "sentence": self.sentence, "inclusion": self.inclusion}
        return plain_fields(fields | {"each": rows})


def benjamini_hochberg(p: Sequence[float]) -> FloatArray:
    """p adjusted so that those below q are false in a share of q at most, (n,)."""
    given = np.asarray(p, dtype=np.float64)
    order = np.argsort(given)[::-1]
    by_rank = given[order] * given.size / np.arange(given.size, 0, -1)
    return np.minimum(np.minimum.accumulate(by_rank), 1.0)[np.argsort(order)]
