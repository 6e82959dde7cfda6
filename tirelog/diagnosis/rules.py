"""The rules of a diagnosis in one table: what a name needs, which verdict follows, and why.

`THRESHOLDS` lists every number that decides, with unit and reason; `RULES` the verdicts in the
order in which they are tried. docs/verdicts.md is made of both.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

#: every number that decides, by its name in the code: value, unit, and what it is for
THRESHOLDS: Mapping[str, tuple[float, str, str]] = {
    # ---- is anything there?
    "ALARM_P": (
        0.01, "probability",
        "family-wise p at most. It bounds the rate of false alarms over all candidates",
    ),
    "GAIN_SIGMAS": (
        1.4, "standard errors",
        "held-out gain at least; manoeuvres share their training, which the error allows for. "
        "Effects of two squared floors gain two to six. Loads that wander gave a false effect "
        "0.7 and more",
    ),
    "LEAST_SHARE_OF_FLOOR": (
        0.05, "squared floors",
        "least size of what an effect removes. Smaller changes may repeat perfectly, and no "
        "p-value removes them",
    ),
    "FEWEST_MANOEUVRES": (
        8, "manoeuvres",
        "a two-sided p of ALARM_P needs so many",
    ),
    "NUISANCE_SHARE": (
        0.4, "share of what chi-square is above its degrees of freedom",
        "least share that a nuisance removes, and an effect whose size held-out errors do not "
        "show. Of two nuisances the larger removes half. Nuisances beside an unknown effect "
        "remove a third",
    ),
    # ---- which one is it?
    "CONTENDER": (
        0.65, "share of the largest statistic",
        "candidates from here on are refitted with the base free",
    ),
    "MOST_CONTENDERS": (
        4, "candidates",
        "and at most so many, for the time it takes",
    ),
    "TWINS": (
        0.95, "cosine",
        "likeness from which on two effects are one to these data. Noise separates shapes "
        "that differ by 5 %; knowledge of tires does not",
    ),
    "LIKE": (
        0.90, "cosine",
        "likeness from which on they are one if the worse leaves less than THIRD more",
    ),
    "THIRD": (
        1.0 / 9.0, "squared floors",
        "a third of the floor, as mean square",
    ),
    "ESTABLISHED_SIGMAS": (
        2.0, "standard errors",
        "least distance of an effect's strengths from zero, per root of their number. Twice "
        "as much asks more than the test asks of an alarm",
    ),
    "WORSE_SIGMAS": (
        2.1, "standard errors",
        "least distance of a clearly worse rival from one that is right to the floor. Twice "
        "as much leaves more sets of effects that are not separated",
    ),
    # ---- is there another?
    "SECOND_LEAST": (
        0.5, "squared floors",
        "least size of a further effect beside free shapes of those before. A somewhat wrong "
        "form leaves 0.3 at most; true second effects keep 2 and more",
    ),
    "NOT_FORM": (
        0.12, "share of the excess",
        "a larger rest is left by no form of the first effect. Forms that are 20 to 40 % "
        "wrong leave 1 to 6 %",
    ),
    "MOST_EFFECTS": (
        4, "effects",
        "most effects that one diagnosis names",
    ),
    # ---- which sentences does it get?
    "EXPLAINED": (
        0.9, "share of the excess that repeats",
        "share that the named effects remove; below it something else is missing too",
    ),
    "MOST": (
        0.7, "share of the excess that repeats",
        "below this share a name is not claimed: false names explain less",
    ),
    "TOGETHER": (
        0.85, "share of the excess that repeats",
        "share of several effects, if the first alone does not remove MOST. Two wrong names "
        "imitate more than one",
    ),
    "REST_SHARE": (
        0.02, "share of the excess",
        "from here on a rest is reported",
    ),
    "BEYOND_DOUBT_P": (
        0.001, "probability",
        "family-wise p at most of a name beside a rest that does not repeat. With ALARM_P one "
        "null in a hundred that scatters would get a name",
    ),
    "QUIET_FLOORS": (
        1.05, "floors",
        "largest held-out error of a model that leaves only noise. Twice the margin would let "
        "a quarter of the floor's square pass",
    ),
    "ERROR_SIGMAS": (
        2.0, "standard deviations",
        "allowance for errors of parameters in a held-out error above that. It matters with "
        "few manoeuvres that scatter. Twice as much hides a scatter as large again",
    ),
    "QUIET_CHI2": (
        1.2, "reduced chi-square",
        "largest chi-square of a model that leaves only noise, beside ERROR_SIGMAS of what "
        "chance adds to it",
    ),
}  # fmt: skip
_VALUES = {name: value for name, (value, _, _) in THRESHOLDS.items()}


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


_FEWEST, _MOST, _EXPLAINED, _FLOORS, _CHI2 = (
    _VALUES[name]
    for name in ("FEWEST_MANOEUVRES", "MOST", "EXPLAINED", "QUIET_FLOORS", "QUIET_CHI2")
)
#: verdicts, when each is given, and that in words; the first that holds is the verdict
RULES: tuple[tuple[str, Callable[[Evidence], object], str], ...] = (
    ("too_few", lambda e: e["few"], f"fewer than {_FEWEST} manoeuvres: a ranking"),
    (
        "scatter",
        lambda e: not e["named"] and not e["repeats"] and not e["quiet"],
        "nothing is named, nothing repeats, and the rest is more than the floor",
    ),
    (
        "nothing_missing",
        lambda e: not e["named"] and not e["repeats"],
        "nothing is named, nothing repeats, and the rest is noise: held-out error at most "
        f"{_FLOORS:g} floors, reduced chi-square at most {_CHI2:g}, and what chance adds",
    ),
    (
        "unknown",
        lambda e: not e["named"] or e["share"] < _MOST,
        f"something repeats, and no effect removes {100 * _MOST:.0f} % of it",
    ),
    (
        "partial",
        lambda e: e["share"] < _EXPLAINED or e["rest"],
        f"the named effects remove {100 * _MOST:.0f} to {100 * _EXPLAINED:.0f} % of what repeats, "
        "or something of size repeats beside them",
    ),
    (
        "ambiguous",
        lambda e: e["alike"],
        "they remove it, and another effect or a nuisance would, too",
    ),
    ("missing", lambda e: True, "the named effects remove what repeats"),
)

#: the verdicts that claim the named effects
CLAIMING = ("missing", "partial", "ambiguous")


def verdict_of(evidence: Evidence) -> str:
    """The first verdict whose rule holds."""
    return next(verdict for verdict, given, _ in RULES if given(evidence))
