"""How often each effect is named when manoeuvres are drawn anew: does a few of them decide?

    Found -> each step's scores, linear gains and refits, manoeuvre by manoeuvre
        -> manoeuvres drawn with replacement, so many times
        -> each time: which candidates alarm, and which of those refitted loses least held out

Held fixed: the fit before each step and its metric, the nuisances, each candidate's form, which
candidates were refitted and their refits, and the steps before. So it tells what chance in the
choice of manoeuvres does, not what a new search would; and since what was measured once is drawn
again, what is near an alarm alarms more often than it would on new logs. Frequencies are no
probabilities of being right: `certainty` is.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from tirelog.diagnosis.candidates.assessment import best_variants, scores_of
from tirelog.diagnosis.candidates.naming import Step
from tirelog.diagnosis.candidates.search import Found
from tirelog.diagnosis.candidates.sign_flips import flip_signs, statistics
from tirelog.diagnosis.candidates.signatures import all_signatures, candidate_effects
from tirelog.diagnosis.rules import (
    ALARM_P,
    BEYOND_DOUBT_P,
    GAIN_SIGMAS,
    LEAST_SHARE_OF_FLOOR,
    SECOND_LEAST,
)
from tirelog.inference.base import Base
from tirelog.inference.floor import held_out_losses_with
from tirelog.physics.effects import Effect
from tirelog.vocabulary.arrays import FloatArray

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
            shares = sorted(step.shares.items(), key=lambda item: -item[1])
            parts = [f"{name} in {100.0 * share:.0f} %" for name, share in shares if share > 0.0]
            parts += [f"nothing in {100.0 * step.none:.0f} %"] if step.none > 0.0 else []
            which = f"step {step.step} of the search" if len(self.steps) > 1 else "the search"
            text = (
                f"of {self.draws} draws of the {self.manoeuvres} manoeuvres {which} names "
                f"{', '.join(parts)}"
            )
            share = step.shares.get(step.named, 0.0) if step.named else step.none
            if share < STEADY:
                text += f": {step.named or 'that nothing is named'} hangs on some manoeuvres"
            said.append(f"{text[0].upper()}{text[1:]}.")
        return said

    def to_json(self) -> dict[str, Any]:
        steps = [asdict(step) | {"none": step.none} for step in self.steps]
        return {"draws": self.draws, "manoeuvres": self.manoeuvres, "steps": steps}


def inclusion(found: Found, draws: int, extra: Iterable[Effect] = (), seed: int = 0) -> Inclusion:
    """How often each step of a search names each effect, over draws of its manoeuvres."""
    extra = tuple(extra)
    count = found.before.cells.manoeuvres
    random = np.random.default_rng(seed)
    times = random.multinomial(count, np.full(count, 1.0 / count), size=draws).astype(float)
    steps = [
        StepInclusion(i, step.named.id if step.named else None, _shares(step, i, times, extra))
        for i, step in enumerate(found.steps, start=1)
    ]
    return Inclusion(draws, count, tuple(steps))


def _shares(
    step: Step, number: int, times: FloatArray, extra: tuple[Effect, ...]
) -> dict[str, float]:
    """The share of the draws (D, M) that named each effect at this step, if any did."""
    base = step.before
    held = {effect.effect.id for effect in base.model.effects}
    tried = [a.id for a in step.assessed if a.id not in held]
    alarms = _alarms(base, tried, times, extra, first=number == 1)
    refitted = [r for r in step.contenders if r.established and r.id in alarms]
    if refitted:
        loss = np.stack([times @ r.base.held_white for r in refitted], axis=1)
        order = [r.id for r in refitted]
        alarming = np.stack([alarms[name][0] for name in order], axis=1)
        chosen = np.where(alarming, loss, np.inf)
    else:  # none was refitted: the largest statistic would be
        order = list(alarms)
        if not order:
            return {}
        alarming = np.stack([alarms[name][0] for name in order], axis=1)
        chosen = np.where(alarming, -np.stack([alarms[name][1] for name in order], axis=1), np.inf)
    best = chosen.argmin(axis=1)
    some = alarming.any(axis=1)
    shares = {name: float(np.mean(some & (best == i))) for i, name in enumerate(order)}
    return {name: share for name, share in shares.items() if share > 0.0}


def _alarms(
    base: Base, names: list[str], times: FloatArray, extra: tuple[Effect, ...], *, first: bool
) -> dict[str, tuple[Any, FloatArray]]:
    """By effect: which draws it alarms in, and its statistic in each, (D,).

    A further effect must remove more than the first.
    """
    effects = [e for e in candidate_effects(base.model, extra) if e.id in names]
    found, _ = all_signatures(base, effects)
    kept, scores, _ = scores_of(base, found)
    if not kept:
        return {}
    under_flips = statistics(scores, flip_signs(base.cells.manoeuvres))
    largest = under_flips.max(axis=1)
    least, sure = (float(np.quantile(largest, 1.0 - p)) for p in (ALARM_P, BEYOND_DOUBT_P))
    result: dict[str, tuple[Any, FloatArray]] = {}
    share = LEAST_SHARE_OF_FLOOR if first else SECOND_LEAST
    size = share * base.floor.square * base.plain.weight
    best = best_variants(kept, under_flips[0])
    losses = held_out_losses_with(
        base.cells, base.white, base.plain, base.fit, [[kept[i].columns] for i in best.values()]
    )
    for (name, i), (white, plain) in zip(best.items(), losses, strict=True):
        gain, drop = base.held_white - white, base.held_plain - plain
        statistic = statistics([scores[i]], times)[:, 0]
        mean = times @ gain / gain.size
        spread = np.sqrt(np.maximum(times @ gain**2 / gain.size - mean**2, 0.0))
        error = np.sqrt(gain.size / max(gain.size - 1.0, 1.0) * gain.size) * spread
        alarming = (
            (statistic >= least)
            & (times @ gain > GAIN_SIGMAS * error)
            & ((times @ drop > size) | (first & (statistic >= sure)))
        )
        result[name] = (alarming, statistic)
    return result
