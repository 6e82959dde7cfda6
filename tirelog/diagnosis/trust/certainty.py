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
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cache
from importlib import resources
from typing import Any

from tirelog.diagnosis.candidates.search import Found
from tirelog.diagnosis.candidates.sign_flips import gain_and_error
from tirelog.physics.carcass.numbers import steady_carcass
from tirelog.physics.effects import BY_ID
from tirelog.physics.model.model import Model
from tirelog.physics.model.nuisances import BY_NAME, FORM
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
#: a rival, or a gain, is as far away as matters [standard errors]; doubling changes nothing that
#: simulated cases showed
_FAR = 10.0
#: logs of at most so many times the manoeuvres that the cases had, or so few, are still like them
_REACH = 1.5
#: held-out error above the floor that counts as one step [floors]: QUIET_FLOORS allows one
_STEP = 0.05


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
    found: Found,
    verdict: str,
    floor: float,
    held: tuple[float | None, float | None],
    chi2: tuple[float, float],
) -> Marks:
    """What a diagnosis knows of itself.

    held, floor  held-out errors before and after, and the noise floor, in one unit
    chi2         reduced chi-square before and after
    """
    gains, rivals = [], []
    for step in found.steps:
        if step.named is None:
            continue
        best = step.named.base
        gains.append(_sigmas(step.before.held_white, best.held_white))
        apart = [r for r in step.contenders if r.id != step.named.id and r.id not in step.group]
        rivals += [_sigmas(r.base.held_white, best.held_white) for r in apart] or [_FAR]
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
        gain_sigmas=min(gains, default=0.0),
        rival_sigmas=min(rivals, default=0.0),
    )


def _sigmas(before: Any, after: Any) -> float:
    """A held-out gain in its standard errors, between 0 and as far as matters."""
    gain, error = gain_and_error(before, after)
    return min(max(gain / error, 0.0), _FAR) if error > 0.0 else 0.0


@dataclass(frozen=True)
class CertaintyTerm:
    """A number of a diagnosis that goes with being right: `sign` says which way it may go."""

    words: str
    sign: int
    of: Callable[[Marks], float]


def _above(error: float) -> float:
    return max(error - 1.0, 0.0) / _STEP


def _decades(x: float, y: float) -> float:
    return math.log10(x / y) if x > 0.0 and y > 0.0 else math.nan


#: by name; what a class of verdicts may use stands in `OF_CLASS`, best first
TERMS: Mapping[str, CertaintyTerm] = {
    "rest": CertaintyTerm(
        "held-out error above the floor, in steps of 0.05 floors",
        -1,
        lambda marks: _above(marks.heldout_after),
    ),
    "evidence": CertaintyTerm(
        "decades of the least p of any effect, named or not",
        -1,
        lambda marks: _decades(1.0, marks.least_p),
    ),
    "size": CertaintyTerm(
        "decades by which chi-square falls",
        1,
        lambda marks: _decades(marks.chi2_before, marks.chi2_after),
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
    table = calibration() if table is None else table
    kind = class_of(marks.verdict)
    if kind is None:
        return Certainty(None, reason="it claims nothing")
    known = table.get(kind)
    words = " or ".join(CLASSES[kind])
    if known is None:
        return Certainty(None, reason=f"no simulated case was {words}")
    if marks.carcass not in known["carcasses"]:
        had = " or ".join(known["carcasses"])
        return Certainty(None, reason=f"simulated cases that were {words} had a {had}")
    low, high = known["manoeuvres"]
    if not low / _REACH <= marks.manoeuvres <= high * _REACH:
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


def unlike(model: Model, selected: Iterable[str], gratings: bool) -> str:
    """Why no simulated case was like a diagnosis of this model, "" if some were.

    `gratings`: it was asked of several.
    """
    if gratings:
        return "the cases had one grating"
    if model.observables != (STRAIN,):
        return f"the cases had {STRAIN}, these logs have {' and '.join(model.observables)}"
    own = [effect.id for effect in model.effects]
    if FORM in own:
        return "in the cases no form of the tire's own came in"
    if own:
        return "the cases began with a bare model, this one holds effects already"
    if any(nuisance.use != BY_NAME[nuisance.name].use for nuisance in model.nuisances):
        return "in the cases every nuisance might come in, this model says which"
    own = [name for name in selected if name not in BY_ID]
    if own:
        return f"the cases had the catalogue alone, and {own[0]} is not of it"
    return ""


@cache
def calibration() -> dict[str, Any]:
    """The table that the package comes with (see `benchmarks.calibration`)."""
    text = (resources.files("tirelog.diagnosis.trust") / TABLE).read_text("utf-8")
    return tomllib.loads(text)
