"""The rules of a diagnosis in one table: what a name needs, which verdict follows, and why.

`THRESHOLDS` lists every number that decides, with unit and reason; `RULES` the verdicts in the
order in which they are tried. docs/verdicts.md is made of both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Threshold:
    """A number that decides: its name in the code, value, unit, and what it is for."""

    name: str
    value: float
    unit: str
    reason: str


THRESHOLDS: tuple[Threshold, ...] = (
    # ---- is anything there?
    Threshold(
        "ALARM_P", 0.01, "probability",
        "family-wise p at most; bounds the rate of false alarms over all candidates, doubled it "
        "allows twice as many",
    ),
    Threshold(
        "GAIN_SIGMAS", 1.4, "standard errors",
        "held-out gain at least, by the scatter of manoeuvres, which share their training: an "
        "effect of two squared floors gains by two to six; loads that wander, alike in "
        "neighbours, gave an effect that acts through the load 0.7 and more; twice as much "
        "loses effects of a few manoeuvres",
    ),
    Threshold(
        "LEAST_SHARE_OF_FLOOR", 0.05, "squared floors",
        "what goes must be this large at least: what is too small to matter may repeat "
        "perfectly, and no p-value removes that",
    ),
    Threshold(
        "FEWEST_MANOEUVRES", 8, "manoeuvres",
        "a two-sided p of ALARM_P needs so many",
    ),
    Threshold(
        "NUISANCE_SHARE", 0.4, "share of what chi-square is above its degrees of freedom",
        "that a nuisance must remove to come in, and an effect whose size held-out errors do "
        "not tell: of two nuisances at once the larger removes half; those beside an effect "
        "that nothing explains remove a third",
    ),
    # ---- which one is it?
    Threshold(
        "CONTENDER", 0.65, "share of the largest statistic",
        "candidates from here on are refitted with the base free",
    ),
    Threshold(
        "MOST_CONTENDERS", 4, "candidates",
        "and at most so many, for the time it takes",
    ),
    Threshold(
        "TWINS", 0.95, "cosine",
        "likeness from which on two effects are one to these data: noise separates shapes that "
        "differ by 5 %, knowledge of tires does not",
    ),
    Threshold(
        "LIKE", 0.90, "cosine",
        "and from which on they are if the worse one leaves less than THIRD more",
    ),
    Threshold(
        "THIRD", 1.0 / 9.0, "squared floors",
        "a third of the floor, in mean squares",
    ),
    Threshold(
        "ESTABLISHED_SIGMAS", 2.0, "standard errors",
        "by which an effect's strengths differ from nothing, per root of their number; doubled "
        "it would ask of a name more than the test asks of an alarm",
    ),
    Threshold(
        "WORSE_SIGMAS", 2.1, "standard errors",
        "by which a rival is clearly worse than one that is right to the floor; twice as much "
        "leaves more sets of effects that are not told apart",
    ),
    # ---- is there another?
    Threshold(
        "SECOND_LEAST", 0.5, "squared floors",
        "what a further effect must remove beside free shapes of those before: what a form that "
        "is somewhat wrong leaves repeats perfectly; true seconds keep 2 and more, false ones "
        "0.3 at most",
    ),
    Threshold(
        "NOT_FORM", 0.12, "share of the excess",
        "a rest that no form of the first effect would leave; forms 20 to 40 % wrong leave 1 to "
        "6 %",
    ),
    Threshold(
        "MOST_EFFECTS", 4, "effects",
        "that one diagnosis names at most",
    ),
    # ---- what is said of it?
    Threshold(
        "EXPLAINED", 0.9, "share of the excess that repeats",
        "that the named effects remove; below it something is missing besides",
    ),
    Threshold(
        "MOST", 0.7, "share of the excess that repeats",
        "below it a name is not claimed: false names explain less",
    ),
    Threshold(
        "TOGETHER", 0.85, "share of the excess that repeats",
        "that several must remove if the first alone does not remove MOST: two wrong names "
        "imitate more than one",
    ),
    Threshold(
        "REST_SHARE", 0.02, "share of the excess",
        "from which on a rest is worth a word",
    ),
    Threshold(
        "BEYOND_DOUBT_P", 0.001, "probability",
        "family-wise p at most with which an effect is named beside a rest that does not "
        "repeat, by the size of what it changes where held-out errors do not tell it; with "
        "ALARM_P one null in a hundred that scatters would get a name",
    ),
    Threshold(
        "QUIET_FLOORS", 1.05, "floors",
        "held-out error at most of what is the noise floor; twice the margin would let a "
        "quarter of the floor's square pass unsaid",
    ),
    Threshold(
        "ERROR_SIGMAS", 2.0, "standard deviations",
        "of what the errors of parameters add to a held-out error, by which it may be above "
        "that: it counts where manoeuvres scatter and are few; doubled, a scatter would hide as "
        "much again as it is itself",
    ),
    Threshold(
        "QUIET_CHI2", 1.2, "reduced chi-square",
        "and its chi-square at most, beside ERROR_SIGMAS of what chance adds to one of so few "
        "degrees of freedom",
    ),
)  # fmt: skip
_VALUES = {threshold.name: threshold.value for threshold in THRESHOLDS}


def __getattr__(name: str) -> float:
    """The number of a threshold by its name, as other modules import it."""
    if name not in _VALUES:
        raise AttributeError(f"no threshold {name}")
    return _VALUES[name]


#: what a verdict is made of, by name:
#:
#: few       fewer manoeuvres than FEWEST_MANOEUVRES
#: named     how many effects alarmed, gained, were large enough and established
#: share     of the excess that repeats, which they remove
#: rest      something of size repeats beside them
#: alike     another effect, or a nuisance, does the same
#: repeats   something repeats that no effect is named for;  quiet  what is left is the floor
Evidence = Mapping[str, float]


@dataclass(frozen=True)
class Rule:
    """A verdict, when it is given, and that in words."""

    verdict: str
    given: Callable[[Evidence], object]
    words: str


_FEWEST, _MOST, _EXPLAINED, _FLOORS, _CHI2 = (
    _VALUES[name]
    for name in ("FEWEST_MANOEUVRES", "MOST", "EXPLAINED", "QUIET_FLOORS", "QUIET_CHI2")
)
#: tried from the top; the first that holds is the verdict
RULES = (
    Rule("too_few", lambda e: e["few"], f"fewer than {_FEWEST} manoeuvres: a ranking"),
    Rule(
        "scatter",
        lambda e: not e["named"] and not e["repeats"] and not e["quiet"],
        "nothing is named, nothing repeats, and what is left is more than the floor",
    ),
    Rule(
        "nothing_missing",
        lambda e: not e["named"] and not e["repeats"],
        f"nothing is named, nothing repeats, and what is left is the floor: held out at most "
        f"{_FLOORS:g} floors and what chance adds to it, reduced chi-square at most "
        f"{_CHI2:g}",
    ),
    Rule(
        "unknown",
        lambda e: not e["named"] or e["share"] < _MOST,
        f"something repeats, and no effect removes {100 * _MOST:.0f} % of it",
    ),
    Rule(
        "partial",
        lambda e: e["share"] < _EXPLAINED or e["rest"],
        f"the named effects remove {100 * _MOST:.0f} to {100 * _EXPLAINED:.0f} % of what repeats, "
        "or something of size repeats beside them",
    ),
    Rule(
        "ambiguous",
        lambda e: e["alike"],
        "they remove it, and another effect or a nuisance would, too",
    ),
    Rule("missing", lambda e: True, "the named effects remove what repeats"),
)

#: the verdicts that claim the named effects
CLAIMING = ("missing", "partial", "ambiguous")


def verdict_of(evidence: Evidence) -> str:
    """The first verdict whose rule holds."""
    return next(rule.verdict for rule in RULES if rule.given(evidence))
