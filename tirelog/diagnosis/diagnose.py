"""`diagnose`: which effect is missing, in one value with a verdict.

    Stacks, Model -> base -> first step -> further steps
        -> share of the excess that they remove, what is left -> verdict

The verdicts:

    nothing_missing  no candidate alarms, no generic shape is left, and what is left is the floor by
                     held-out error and chi-square
    scatter          the same, but what is left is more than the floor
    missing          the selected effects remove at least 90 % of the excess, and nothing else of
                     size is left
    partial          they remove 70 to 90 %, or something repeatable is left
    ambiguous        they would be 'missing', and another effect does the same to these data
    unknown          there is repeatable structure that no effect explains (under 50 %)
    too_few          fewer manoeuvres than a test needs: a ranking, no alarm
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tirelog.data.recording import Stack
from tirelog.diagnosis.assessment import Assessed
from tirelog.diagnosis.beside import (
    allowed_nuisances,
    best_nuisance,
    groups_of,
    needed_nuisances,
    with_nuisances,
    with_nuisances_on,
)
from tirelog.diagnosis.checks import (
    Check,
    Suspect,
    check_sentences,
    posterior_checks,
    suspects,
)
from tirelog.diagnosis.compare import (
    Measured,
    comparison_of,
    of_rounding,
    single_revolutions,
    start,
)
from tirelog.diagnosis.leftover import Leftover, describe, scattered
from tirelog.diagnosis.naming import (
    Step,
    assess_all,
    contend,
    first_step,
    group_of,
    next_step,
    quiet,
    regrouped,
    without_needless,
)
from tirelog.diagnosis.nuisance_sizes import (
    NuisanceFound,
    alike_sentences,
    nuisance_sentences,
    nuisances_found,
    scatter_sentences,
)
from tirelog.diagnosis.results import Candidate, Comparison, plain_values
from tirelog.diagnosis.rules import (
    BEYOND_DOUBT_P,
    EXPLAINED,
    FEWEST_MANOEUVRES,
    LEAST_SHARE_OF_FLOOR,
    MOST,
    MOST_EFFECTS,
    REST_SHARE,
    TOGETHER,
    TWINS,
    Evidence,
    verdict_of,
)
from tirelog.diagnosis.separation import advise
from tirelog.diagnosis.signatures import candidate_effects
from tirelog.diagnosis.validity import out_of_range
from tirelog.diagnosis.wording import next_command, not_varied, sentence_of, unexplained_sentence
from tirelog.inference.base import Base, settled
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model
from tirelog.vocabulary.observables import OBSERVABLES

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Found:
    """What the search came to.

    The base before, the steps, the base with all that was named, and what later names made
    needless. `alike`: pairs of a nuisance and an effect that removed as much, of which one was
    taken.
    """

    before: Base
    steps: tuple[Step, ...]
    after: Base
    dropped: tuple[str, ...] = ()
    alike: tuple[tuple[str, str], ...] = ()

    @property
    def named(self) -> tuple[str, ...]:
        return tuple(
            step.named.id
            for step in self.steps
            if step.named is not None and step.named.id not in self.dropped
        )


@dataclass(frozen=True)
class Diagnosis:
    """The answer to "which effect is missing" (contract, Diagnosis).

    `before` and `after`: the model as it came and with what was selected.
    """

    verdict: str
    sentence: str
    selected: tuple[str, ...]
    effects: tuple[Candidate, ...]
    ambiguous_groups: tuple[tuple[str, ...], ...]
    separating_manoeuvres: tuple[Mapping[str, Any], ...]
    unexplained: Mapping[str, Any]
    nuisances: tuple[NuisanceFound, ...]
    checks: tuple[Check, ...]
    suspects: tuple[Suspect, ...]
    not_tested: Mapping[str, str]
    rmse_heldout_before: float | None
    rmse_heldout_after: float | None
    noise_floor: float
    noise_floor_within: float
    reduced_chi2_before: float
    reduced_chi2_after: float
    revolutions: int
    manoeuvres: int
    notes: tuple[str, ...]
    next_command: str
    found: Found
    stacks: Sequence[Stack]

    @property
    def model(self) -> Model:
        """The model with what was selected, refitted."""
        return with_nuisances_on(self.found.after if self.selected else self.found.before)

    @cached_property
    def before(self) -> Comparison:
        return comparison_of(self.found.before, self.stacks)

    @cached_property
    def after(self) -> Comparison:
        return comparison_of(self.found.after, self.stacks) if self.selected else self.before

    def to_json(self) -> dict[str, Any]:
        apart = ("effects", "notes", "found", "stacks", "nuisances", "checks", "suspects")
        names = [name for name in self.__dataclass_fields__ if name not in apart]
        rows = [
            {name: getattr(c, name) for name in Candidate.__dataclass_fields__}
            for c in self.effects
        ]
        told: dict[str, Any] = plain_values(
            {name: getattr(self, name) for name in names}
            | {"effects": rows, "note": " ".join(self.notes)}
            | {"nuisance_or_effect": [list(pair) for pair in self.found.alike]}
            | {"nuisances": {n.nuisance: n.to_json() for n in self.nuisances}}
            | {"checks": [asdict(c) | {"never": c.never} for c in self.checks]}
            | {"suspects": [asdict(s) for s in self.suspects]}
        )
        return told


def diagnose(
    measured: Measured,
    model: Model,
    *,
    effects: Iterable[Effect] = (),
    progress: Progress = lambda text: None,
) -> Diagnosis:
    """Which effect is missing.

    `effects`: the user's own candidates beside the catalogue; `progress` hears what is being done.
    """
    extra = tuple(effects)
    progress("fitting the model")
    base = start(measured, model)
    progress(f"{len(base.cells)} cells of {base.cells.manoeuvres} manoeuvres; testing candidates")
    found = search_effects(base, extra, progress)
    progress("describing what is left")
    return conclude(found, single_revolutions(measured))


def search_effects(
    base: Base, extra: tuple[Effect, ...] = (), progress: Progress = lambda text: None
) -> Found:
    """Steps until nothing more is worth naming, beside the nuisances that earn their place.

    With too few manoeuvres: one step, contenders refitted, nothing named.
    """
    if base.cells.manoeuvres < FEWEST_MANOEUVRES:
        step = first_step(base, extra)
        contenders = step.contenders or tuple(contend(base, step.assessed, step.reasons))
        group = group_of(contenders) if contenders else ()
        return Found(
            base, (Step(base, step.assessed, step.reasons, contenders, None, group),), base
        )
    climb = _climb(base, extra, progress, allowed_nuisances(base))
    if climb.passed_over is not None and not quiet(climb.after, climb.after.floor.square):
        # an effect that came before a nuisance may have taken its place
        progress(f"once more with {groups_of(climb.passed_over)[-1]} first")
        other = _climb(settled(climb.passed_over), extra, progress, allowed_nuisances(base))
        if other.after.reduced_chi2 < climb.after.reduced_chi2:
            climb = other
    steps, after, ground, alike = climb.steps, climb.after, climb.ground, tuple(climb.alike)
    beside = groups_of(after)
    needed = needed_nuisances(after) if beside != groups_of(base) else beside
    if ground is not None and needed == beside:
        base = ground  # nuisances came in before any effect: the steps stand as they are
    else:
        progress(f"once more beside {' and '.join(needed) or 'no nuisance'}")
        base = settled(with_nuisances(base, needed))
        again = _climb(base, extra, progress, ())
        steps, after = again.steps, again.after
    named = [s.named.id for s in steps if s.named is not None]
    if len(named) < 2:
        return Found(base, tuple(steps), after, alike=alike)
    progress("looking for what could stand in place of each")
    after, dropped = without_needless(after, named)
    after = settled(after) if dropped else after
    groups = regrouped(after, [name for name in named if name not in dropped], extra)
    steps = [
        replace(s, group=groups.get(s.named.id, ())) if s.named is not None else s for s in steps
    ]
    return Found(base, tuple(steps), after, dropped, alike)


@dataclass
class _Climb:
    """Steps from a base upwards, the base at their top, and the one they stand on.

    `alike`: pairs of a nuisance and an effect that these data cannot tell apart; `passed_over`: the
    base with the nuisance that the first effect came before, if there was one.
    """

    after: Base
    ground: Base | None
    steps: list[Step]
    alike: list[tuple[str, str]]
    passed_over: Base | None = None


def _climb(
    base: Base, extra: tuple[Effect, ...], progress: Progress, nuisances: Sequence[str]
) -> _Climb:
    """The search from a base upwards.

    Before each step the best of the `nuisances` that earns its place comes in if it leaves less
    than the best effect: what both explain is then the nuisance's. The steps stand on the base with
    all nuisances; on none if one came in after an effect.
    """
    climb, excess = _Climb(base, base, [], []), base.excess
    while True:
        after = climb.after
        named = [s.named.id for s in climb.steps if s.named is not None]
        rival = None if quiet(after, after.floor.square) else best_nuisance(after, nuisances)
        step = None
        if rival is None or named or _may_do_as_well(after, rival, extra):
            step = next_step(after, named, excess, extra) if named else first_step(after, extra)
        named_now = None if step is None else step.named
        if rival is not None and named_now and _as_much(after, rival, named_now.base):
            climb.alike.append((groups_of(rival)[-1], named_now.id))
        if rival is not None and (step is None or _leaves_less(rival, step)):
            progress(f"beside the model: {groups_of(rival)[-1]}")
            climb.after = settled(rival)
            if climb.steps:
                climb.ground = None
            else:
                climb.ground, excess = climb.after, climb.after.excess
            continue
        assert step is not None
        if not climb.steps and step.named is not None:
            climb.passed_over = rival
        climb.steps.append(step)
        if step.named is None:
            return climb
        progress(f"named {step.named.id}; looking for another")
        climb.after = settled(step.named.base)
        if len(climb.steps) == MOST_EFFECTS:
            return climb


def _may_do_as_well(base: Base, rival: Base, extra: tuple[Effect, ...]) -> bool:
    """Could an effect, once refitted, leave as little as a nuisance does?

    Not if the nuisance leaves the floor, and none comes near to it by its linear strength: refits
    of effects take most of a search.
    """
    if rival.excess > LEAST_SHARE_OF_FLOOR * rival.floor.square:
        return True
    assessed, _ = assess_all(base, extra)
    most = max((a.removed for a in assessed if a.alarms(base.floor.square)), default=0.0)
    return most > 0.5 * MOST * (base.excess - rival.excess)


def _leaves_less(rival: Base, step: Step) -> bool:
    """Is the held-out loss beside a nuisance below that with the effect of a step?"""
    return step.named is None or float(rival.held_white.sum()) < float(
        step.named.base.held_white.sum()
    )


def _as_much(base: Base, one: Base, other: Base) -> bool:
    """Does each of two refits remove as much of chi-square, to what forms differ by?"""
    removed = sorted(base.noise_chi2 - refitted.noise_chi2 for refitted in (one, other))
    return removed[0] >= TWINS**2 * removed[1]


def conclude(found: Found, stacks: Sequence[Stack]) -> Diagnosis:
    """The verdict and everything that is said with it."""
    before, after = found.before, found.after
    floor = after.floor if found.named else before.floor
    excess_before = max(before.square_held - floor.square, 0.0)
    excess_after = max(after.square_held - floor.square, 0.0) if found.named else excess_before
    share = 1.0 - excess_after / excess_before if excess_before > 0 else 0.0
    left = describe(after)
    few = before.cells.manoeuvres < FEWEST_MANOEUVRES
    groups = tuple(s.group for s in found.steps if s.named is not None and s.group)
    rest = (
        left.significant
        and excess_after > LEAST_SHARE_OF_FLOOR * floor.square
        and excess_after > REST_SHARE * excess_before
    )
    alone = (
        1.0 - max(found.steps[0].named.base.square_held - floor.square, 0.0) / excess_before
        if found.steps[0].named and excess_before
        else 0.0
    )
    # what does not repeat is no effect's to explain: it is a size of its own, and vetoes no name
    removed = excess_before - excess_after
    repeats = max(removed, 0.0) + (max(left.size, 0.0) if left.significant else 0.0)
    counted, total = excess_before, share
    if 0.0 < repeats < excess_before and beyond_doubt(found):
        counted, share = repeats, min(removed / repeats, 1.0)
        alone *= excess_before / repeats
    enough = share >= MOST and (len(found.named) == 1 or alone >= MOST or share >= TOGETHER)
    evidence = Evidence(
        few=few,
        named=len(found.named),
        share=share if enough else 0.0,
        rest=rest,
        alike=bool(groups),
        repeats=left.significant and excess_after > LEAST_SHARE_OF_FLOOR * floor.square,
        quiet=quiet(before, floor.square),
    )
    verdict = verdict_of(evidence)
    selected = found.named if verdict in ("missing", "partial", "ambiguous") else ()
    if (
        found.named and not selected
    ):  # what was named is not claimed: the description is of what the model as it came leaves
        left, excess_after = describe(before), excess_before
        if not left.significant and excess_before <= LEAST_SHARE_OF_FLOOR * floor.square:
            # what alarmed is gone, once less is taken for scatter
            verdict = verdict_of(replace(evidence, named=0, repeats=False))
    ranking = _ranking(found, selected, counted, floor.square, share)
    unexplained = _unexplained(
        left, found, ranking, excess_after, excess_before, floor.square, bool(selected)
    )
    result = after if selected else before
    beside, checks = nuisances_found(result), posterior_checks(result)
    suspected = suspects(result) if verdict in ("unknown", "scatter", "partial") else ()
    advice, notes = _advice(found, verdict)
    notes += nuisance_sentences(beside, result)
    notes += scatter_sentences(result)
    notes += alike_sentences(found.alike, selected, [n.nuisance for n in beside if n.stayed])
    if verdict in ("unknown", "scatter", "partial"):
        notes += check_sentences(checks)
    notes += of_rounding(before)
    notes += (
        [said]
        if (said := not_varied(before.cells.conditions, candidate_effects(before.model)))
        else []
    )
    if selected:
        left_before = out_of_range(before)
        notes += [f"{said}." for said in out_of_range(after) if said not in left_before]
    ranked = {c.effect for c in ranking}
    reasons = {k: v for s in found.steps[:1] for k, v in s.reasons.items() if k not in ranked}
    scatter = asdict(scattered(before, floor.square)) if verdict == "scatter" else None
    shares = {c.effect: c.excess_removed for c in ranking}
    facts = {
        "verdict": verdict,
        "selected": selected,
        "share": share,
        "total": total,
        "suspects": tuple(s.said for s in suspected[:3]),
        "shares": shares,
        "enough": MOST,
        "explained": EXPLAINED,
        "after": after.square_held,
        "unestablished": tuple(r.id for r in found.steps[0].contenders if not r.established),
        "scatter": scatter,
        "observable": before.model.observable,
        "unit": OBSERVABLES[before.model.observable].unit,
        "chi2": before.reduced_chi2,
        "beside": tuple(n.nuisance for n in beside if n.stayed),
        "groups": groups,
        "unexplained": unexplained,
        "manoeuvres": before.cells.manoeuvres,
        "before": before.square_held,
        "floor": floor.square,
    }
    return Diagnosis(
        verdict=verdict,
        sentence=sentence_of(facts),
        selected=selected,
        effects=ranking,
        ambiguous_groups=groups
        if selected
        else tuple(s.group for s in found.steps if few and s.group),
        separating_manoeuvres=tuple(advice),
        unexplained=unexplained | {"scatter": scatter},
        nuisances=beside,
        checks=checks,
        suspects=suspected,
        not_tested=reasons,
        rmse_heldout_before=before.rmse_held,
        rmse_heldout_after=result.rmse_held,
        noise_floor=float(np.sqrt(floor.square)),
        noise_floor_within=float(np.sqrt(floor.within)),
        reduced_chi2_before=before.reduced_chi2,
        reduced_chi2_after=result.reduced_chi2,
        revolutions=int(before.cells.revolutions.sum()),
        manoeuvres=before.cells.manoeuvres,
        notes=tuple(notes),
        next_command=next_command(
            verdict,
            selected,
            model=before.model,
            logs=before.cells.logs,
            beside=[
                n.name
                for n in before.model.nuisances
                if n.name in groups_of(result) and n.use != "on"
            ],
        ),
        found=found,
        stacks=stacks,
    )


def beyond_doubt(found: Found) -> bool:
    """Is every name so significant that a rest that does not repeat cannot make it doubtful?"""
    named = [step.named for step in found.steps if step.named is not None]
    return bool(named) and all(r.assessed.p <= BEYOND_DOUBT_P for r in named)


def _ranking(
    found: Found, selected: Sequence[str], excess: float, floor: float, share_of_all: float
) -> tuple[Candidate, ...]:
    """All candidates of the first step.

    Those named later follow with what they did when they were named. If one effect was selected its
    share is `share_of_all`, so that the table and the sentence say one number.
    """
    first = found.steps[0]
    refitted = {r.id: r for r in first.contenders}
    rows: list[tuple[Assessed, float, Mapping[str, Any]]] = []
    tested = [
        a for a in first.assessed if a.id not in first.reasons or a.id in selected
    ]  # a failed refit is no number
    for a in tested:
        removed = (
            refitted[a.id].base.square_held
            if a.id in refitted
            else first.before.square_held - a.removed
        )
        unphysical = a.signature.one_sided and a.strengths[0] < 0.0 and a.id not in refitted
        shared = excess > LEAST_SHARE_OF_FLOOR * floor and not unphysical
        share = (first.before.square_held - removed) / excess if shared else 0.0
        share = share_of_all if tuple(selected) == (a.id,) else share
        rows.append((a, float(np.clip(share, 0.0, 1.0)), _strengths(found, a, refitted)))
    later = [s.named for s in found.steps[1:] if s.named is not None]
    p = {r.id: r.assessed.p for r in later}
    order = [r.id for r in first.contenders] + [a.id for a in tested if a.id not in refitted]
    order = list(selected) + [name for name in order if name not in selected]
    groups = {s.named.id: s.group for s in found.steps if s.named is not None}
    by_id = {a.id: (a, share, strengths) for a, share, strengths in rows}
    return tuple(
        Candidate(
            effect=name,
            rank=i + 1,
            excess_removed=by_id[name][1],
            p_adjusted=p.get(name, by_id[name][0].p),
            selected=name in selected,
            group=tuple(g for g in groups.get(name, ()) if g != name),
            statistic=by_id[name][0].statistic,
            strengths=by_id[name][2],
        )
        for i, name in enumerate(n for n in order if n in by_id)
    )


def _strengths(found: Found, a: Assessed, refitted: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """The effect's parameters with errors and units.

    From the final model, its own refit, or the linear fit.
    """
    for model in (found.after.model, *([refitted[a.id].base.model] if a.id in refitted else [])):
        own = {n.split(".")[1]: q for n, q in model.parameters.items() if n.startswith(f"{a.id}.")}
        if own:
            return {
                name: {"value": q.value, "se": q.se, "unit": q.unit}
                for name, q in own.items()
                if q.free
            }
    units = {q.name: q.unit for q in a.signature.effect.parameters}
    return {
        n: {"value": float(v), "se": None, "unit": units[n]}
        for n, v in zip(a.signature.strengths, a.strengths, strict=True)
    }


def _unexplained(
    left: Leftover,
    found: Found,
    ranking: Sequence[Candidate],
    after: float,
    before: float,
    floor: float,
    selected: bool,
) -> dict[str, Any]:
    """What remains, in the contract's keys and a sentence."""
    near = [c for c in ranking if not c.selected and c.excess_removed >= REST_SHARE]
    nearest = max(near, key=lambda c: c.excess_removed) if near and left.significant else None
    share = (
        float(np.clip(after / before, 0.0, 1.0)) if before > LEAST_SHARE_OF_FLOOR * floor else 0.0
    )
    facts = {
        "significant": left.significant,
        "share_of_excess": share,
        "p": left.p,
        "size": float(np.sqrt(max(left.size, 0.0))),
        "where": left.where,
        "parity": left.parity,
        "follows": left.follows,
        "together": left.together,
        "speed_exponent": left.speed_exponent,
        "frequency_Hz": left.frequency_Hz,
        "in_pressure": left.in_pressure,
        "nearest_effect": nearest.effect if nearest and not selected else None,
        "nearest_share": nearest.excess_removed if nearest and not selected else None,
    }
    return facts | {
        "sentence": unexplained_sentence(facts, found.before.cells.manoeuvres < FEWEST_MANOEUVRES)
    }


def _advice(found: Found, verdict: str) -> tuple[list[dict[str, Any]], list[str]]:
    """What to drive next, for rivals and for too few manoeuvres."""
    step = found.steps[0]
    notes: list[str] = []
    if verdict == "too_few":
        notes.append(
            f"{found.before.cells.manoeuvres} manoeuvres; a test needs {FEWEST_MANOEUVRES}, two "
            "mixed logs of a minute have a dozen: drive more of them."
        )
        rivals = [(r.id, r.base.model) for r in step.contenders[:3]]
    elif verdict == "ambiguous":
        step = next(s for s in found.steps if s.named is not None and s.group)
        rivals = [(r.id, r.base.model) for r in step.contenders if r.id in step.group]
    else:
        return [], notes
    if len(rivals) < 2:
        return [], notes
    rows, more = advise(step.before, rivals)
    return rows, notes + more
