"""What to drive next: the manoeuvre that makes the verdict's probability grow fastest.

    the verdict's probability -> how likely each rival is instead
    rivals: other effects that were refitted, nuisances that do as well, effects that these logs
            cannot show since what they follow is the same throughout
        -> `separation`: how far each manoeuvre on the list parts the two, refitted
        -> by how much the probability of naming the right one grows, per minute of driving

With the verdict at the odds exp(l) against a rival, and s standard errors between the two on a
planned stretch, the log of the odds will have moved by +-s^2/2 on the average, with the standard
deviation s. The right one is then the likelier one with

    P = p Phi((s^2/2 + l) / s) + (1 - p) Phi((s^2/2 - l) / s),   p = 1 / (1 + exp(-l))

in place of max(p, 1 - p). What the logs hold already is not on the list.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from tirelog.diagnosis.candidates.beside import groups_of
from tirelog.diagnosis.candidates.naming import Step
from tirelog.diagnosis.candidates.search import Found
from tirelog.diagnosis.candidates.separation import ALLOWED, WANTED_SIGMA, driven, separations
from tirelog.diagnosis.candidates.sign_flips import gain_and_error
from tirelog.diagnosis.candidates.signatures import candidate_effects, with_candidate
from tirelog.errors import ModelError, or_refusal
from tirelog.inference.base import Base, TogetherBase, apart
from tirelog.inference.cells.together import model_of
from tirelog.inference.nuisances import freed, frees
from tirelog.physics.model.model import Model

#: a growth of the probability below this is not worth a drive; at half of it a tenth of what is
#: advised would be for rivals that are as good as excluded
LEAST_GAIN = 0.005
#: manoeuvres that are named, rivals that are asked about, runs of one manoeuvre at most
_MOST = 3
_MOST_RIVALS = 4
_MOST_REPEATS = 20
#: probability that any effect of the catalogue is missing, before anything is measured: as in the
#: priors of the calibration
_MISSING_AT_ALL = 0.45
#: a verdict without a calibration is taken to be as likely as not
_EVEN = 0.5


@dataclass(frozen=True)
class Rival:
    """What else may be: its name, the model that has the verdict's, and that of the rival.

    `first` is taken as true and parted from any refit of `second` with the nuisances `beside`;
    `mass` is the probability of the rival, `base` what it is measured from.
    """

    name: str
    of: str
    first: Model
    second: Model
    mass: float
    beside: tuple[str, ...] = ()
    verdict_mass: float | None = None


def probability_after(odds_log: float, sigma: float) -> float:
    """P that the likelier of two is the right one, once a stretch parts them by `sigma`."""
    p = 1.0 / (1.0 + math.exp(-odds_log))
    if sigma <= 0.0:
        return max(p, 1.0 - p)
    return p * _normal((0.5 * sigma**2 + odds_log) / sigma) + (1.0 - p) * _normal(
        (0.5 * sigma**2 - odds_log) / sigma
    )


def _normal(x: float) -> float:
    return 0.5 * math.erfc(-x / math.sqrt(2.0))


def expected_gain(verdict: float, rival: float, sigma: float) -> float:
    """By how much P(right) grows if two of these probabilities are parted by `sigma`."""
    both = verdict + rival
    if verdict <= 0.0 or rival <= 0.0:
        return 0.0
    return both * probability_after(math.log(verdict / rival), sigma) - max(verdict, rival)


def drive_next(found: Found, verdict: str, probability: float | None) -> list[dict[str, Any]]:
    """Manoeuvres by the expected growth of the verdict's probability per minute, best first.

    Rows: manoeuvre, repeats, minutes of all of them, gain, gain_per_minute, separates (pairs), the
    separation_sigma of the first pair and run, and whether the probability that it starts from is
    calibrated or even odds. None if nothing on the list is worth it.
    """
    p = _EVEN if probability is None else probability
    base, rivals = _rivals(found, verdict, p)
    if base is None or not rivals:
        return []
    radius = base.cells.radius_m
    held = {manoeuvre.name for manoeuvre in ALLOWED if driven(base, manoeuvre)}
    floor = math.sqrt(base.floor.square)
    parted: dict[str, list[tuple[Rival, float]]] = {}
    for rival in rivals[:_MOST_RIVALS]:
        rows = separations(base, rival.first, rival.second, rival.beside)
        for row in [] if isinstance(rows, ModelError) else rows:
            if row["manoeuvre"] not in held and row["rest"] > floor / 9.0:
                parted.setdefault(row["manoeuvre"], []).append((rival, row["separation_sigma"]))
    by_name = {manoeuvre.name: manoeuvre for manoeuvre in ALLOWED}
    result: list[dict[str, Any]] = []
    for name, pairs in parted.items():
        # so often that the likeliest rival is parted: what is driven in part settles nothing
        likeliest = max(pairs, key=lambda pair: _gain(p, pair[0], pair[1], _MOST_REPEATS))
        wanted = (WANTED_SIGMA / max(likeliest[1], 1e-9)) ** 2
        repeats = int(min(max(1.0, math.ceil(wanted)), _MOST_REPEATS))
        gain = sum(_gain(p, r, s, repeats) for r, s in pairs)
        minutes = by_name[name].minutes(radius, repeats)
        if gain < LEAST_GAIN:
            continue
        pairs.sort(key=lambda pair: -_gain(p, pair[0], pair[1], repeats))
        worth = [r for r, s in pairs if _gain(p, r, s, repeats) >= 0.5 * LEAST_GAIN]
        result.append(
            {
                "manoeuvre": name,
                "repeats": repeats,
                "minutes": minutes,
                "gain": gain,
                "gain_per_minute": gain / minutes,
                "separates": [[r.of, r.name] for r in worth],
                "separation_sigma": pairs[0][1],
                "calibrated": probability is not None,
            }
        )
    return sorted(result, key=lambda row: -row["gain_per_minute"])[:_MOST]


def _gain(p: float, rival: Rival, sigma: float, repeats: int) -> float:
    """What so many runs that part by `sigma` each add to the probability of being right."""
    verdict = p if rival.verdict_mass is None else rival.verdict_mass
    return expected_gain(verdict, rival.mass, sigma * repeats**0.5)


def _rivals(found: Found, verdict: str, p: float) -> tuple[Base | None, list[Rival]]:
    """What the verdict may be taken for, and the base that it is measured from."""
    silent = verdict == "nothing_missing"
    named = [s for s in found.steps if s.named is not None and not silent]
    step = named[0] if named else found.steps[0]
    base = step.before
    if isinstance(base, TogetherBase):  # the list is searched in the first waveform
        base = max(apart(base), key=lambda part: part.cells.phi.shape[1])
    # where loads or other conditions are in doubt, these come before any effect
    if base.cells.phi.shape[1] == 1 or verdict in ("unknown", "scatter"):
        return None, []
    if silent:
        return base, [_of_base(rival, base, found) for rival in _hidden(found, p)]
    if verdict == "too_few":
        some = step.contenders[:3]
        return base, [
            Rival(r.id, some[0].id, some[0].base.model, r.base.model, 1.0 / len(some), (),
                  1.0 / len(some))
            for r in some[1:]
        ]  # fmt: skip
    rivals = [*_instead(step, p), *_beside(found, p)]
    return base, [_of_base(rival, base, found) for rival in rivals]


def _of_base(rival: Rival, base: Base, found: Found) -> Rival:
    """The rival's models for one observable, if several were fitted together."""
    if not isinstance(found.before, TogetherBase):
        return rival
    seen, member = base.cells.observable, base.cells.member
    first, second = (model_of(m, seen, member) for m in (rival.first, rival.second))
    return Rival(rival.name, rival.of, first, second, rival.mass, rival.beside, rival.verdict_mass)


def _instead(step: Step, p: float) -> list[Rival]:
    """Other effects that were refitted: those of a set as likely each, others by their loss."""
    if step.named is None:
        return []
    best = step.named.base
    others = [r for r in step.contenders if r.id != step.named.id and r.established]
    group = [r for r in others if r.id in step.group]
    # of what is not in the set, and of what was not refitted at all
    weight = {}
    for r in others:
        gain, error = gain_and_error(r.base.held_white, best.held_white)
        sigma = max(gain / error, 0.0) if error > 0.0 else 0.0
        weight[r.id] = math.exp(-0.5 * sigma**2)
    share = p / (1 + len(group))
    rest = (1.0 - p) / (1.0 + sum(weight[r.id] for r in others if r not in group))
    return [
        Rival(
            r.id,
            step.named.id,
            best.model,
            r.base.model,
            share if r in group else rest * weight[r.id],
            (),
            share,
        )
        for r in others
    ]


def _beside(found: Found, p: float) -> list[Rival]:
    """Nuisances that do as well as an effect that is named: as likely as it."""
    rivals = []
    for nuisance, effect in found.alike:
        if effect not in found.named or nuisance in groups_of(found.after):
            continue
        without = or_refusal(found.after.model.without_effect)(effect)
        if isinstance(without, ModelError):
            continue
        linear = not frees(without, nuisance)
        second = without if linear else freed(without, [nuisance])
        beside = (nuisance,) if linear else ()
        rivals.append(Rival(nuisance, effect, found.after.model, second, 0.5 * p, beside, 0.5 * p))
    return rivals


def _hidden(found: Found, p: float) -> list[Rival]:
    """Effects that these logs cannot show: as likely as before anything was measured."""
    model, reasons = found.before.model, found.steps[0].reasons
    effects = [e for e in candidate_effects(model) if e.id in reasons]
    count = len(candidate_effects(model))
    rivals = []
    for effect in effects:
        probes = {q.name: q.probe for q in effect.parameters if q.name in effect.strength}
        shown = with_candidate(model, effect, probes)
        mass = _MISSING_AT_ALL / max(count, 1)
        rivals.append(Rival("nothing", effect.id, shown, model, mass, (), p))
    return rivals


def by_the_minute(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Rows of `separation.advise` for two that are as likely each, best per minute first."""
    told = []
    for row in rows:
        gain = expected_gain(0.5, 0.5, row["separation_sigma"] * row["repeats"] ** 0.5)
        told.append({**row, "gain": gain, "gain_per_minute": gain / row["minutes"]})
    return sorted(told, key=lambda row: -row["gain_per_minute"])


def drive_sentences(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Each row as a sentence."""
    said = []
    for row in rows:
        times = "once" if row["repeats"] == 1 else f"{row['repeats']} times"
        pairs = "; ".join(f"{one} from {other}" for one, other in row["separates"])
        points, rate = 100.0 * row["gain"], 100.0 * row["gain_per_minute"]
        odds = "" if row["calibrated"] else ", counted from even odds"
        said.append(
            f"To be surer, drive: {row['manoeuvre']}, {times} ({row['minutes']:.1f} min). It tells "
            f"{pairs}; of 100 such verdicts {points:.1f} more would be right ({rate:.2g} per "
            f"minute{odds})."
        )
    return said
