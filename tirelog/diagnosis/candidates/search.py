"""The search for what a model lacks: effects step by step, beside the nuisances that earn a place.

Base -> the best nuisance or the best effect, whichever leaves less held out -> the base with it
     -> ... until nothing more is worth naming -> once more beside the nuisances that are needed
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tirelog.diagnosis.candidates.assessment import (
    Variant,
    gain_and_error,
    least_left,
    quiet_waveforms,
)
from tirelog.diagnosis.candidates.naming import (
    Refitted,
    Step,
    assess_all,
    clearly_worse,
    contend,
    group_of,
    leading,
    next_step,
    regrouped,
    step_beside_form,
    without_needless,
)
from tirelog.diagnosis.candidates.nuisances import (
    Rival,
    alarming_nuisances,
    allowed_nuisances,
    best_of,
    form_explains,
    groups_of,
    needed_nuisances,
    newest,
    rival_nuisances,
    with_nuisance,
    with_nuisances,
)
from tirelog.diagnosis.results import Candidate
from tirelog.diagnosis.rules import (
    FEWEST_MANOEUVRES,
    LEAST_SHARE_OF_FLOOR,
    MOST,
    MOST_EFFECTS,
    NUISANCE_SHARE,
    TWINS,
)
from tirelog.errors import ModelError
from tirelog.inference.base import Base, refit
from tirelog.inference.fit.cells import LEAST_CHANGE
from tirelog.inference.metric import Offsets, stacked
from tirelog.inference.nuisances import FORM, frees
from tirelog.physics.effects import Effect

Progress = Callable[[str], None]


@dataclass(frozen=True)
class SearchResult:
    """What the search came to.

    The base before, the steps, the base with all that was named, and what later names made
    needless. `alike`: pairs of a nuisance and an effect that removed as much, of which one was
    taken. `given`: the base that the search began with, if it was kept. `untested`: sentences on
    what the search could not ask, and why.

    While it is under way: `ground`, the base that the steps stand on, None if a nuisance came in
    after them; `passed_over`, the base with the nuisance that the first effect came before; and
    `rivals`, the first base with each of the nuisances, if they were asked for.
    """

    before: Base
    steps: tuple[Step, ...]
    after: Base
    dropped: tuple[str, ...] = ()
    alike: tuple[tuple[str, str], ...] = ()
    untested: tuple[str, ...] = ()
    given: Base | None = None
    ground: Base | None = None
    passed_over: Base | None = None
    rivals: tuple[Rival, ...] | None = None

    @property
    def came_in(self) -> tuple[str, ...]:
        """The nuisances that stand beside the model before any effect, and did not when it came."""
        own = groups_of(self.before if self.given is None else self.given)
        return tuple(name for name in groups_of(self.before) if name not in own)

    @property
    def named(self) -> tuple[str, ...]:
        return tuple(
            step.named.id
            for step in self.steps
            if step.named is not None and step.named.id not in self.dropped
        )


def search_effects(
    base: Base, extra: tuple[Effect, ...] = (), progress: Progress = lambda text: None
) -> SearchResult:
    """Steps until nothing more is worth naming, beside the nuisances that earn their place.

    With too few manoeuvres: one step, contenders refitted, nothing named. The tire's form comes in
    where the search without it ends above the floor, or names more effects to come there.
    """
    if base.cells.manoeuvres < FEWEST_MANOEUVRES:
        step = next_step(base, extra)
        contenders = step.contenders or tuple(contend(base, leading(step.assessed), step.reasons))
        group = group_of(contenders) if contenders else ()
        return SearchResult(
            base, (Step(base, step.assessed, step.reasons, contenders, None, group),), base
        )
    allowed = allowed_nuisances(base)
    bare = tuple(name for name in allowed if name != FORM)
    climb = _climb(base, extra, progress, bare)
    tried = bare != allowed and not quiet_waveforms(climb.after)
    formed = _formed(base, extra, progress, allowed, climb.after) if tried else None
    if (
        formed is not None
        and quiet_waveforms(formed.after)
        and not _one_may_do(formed.after, extra)
    ):
        return formed
    plain = _search(base, extra, progress, bare, climb)
    at_floor = quiet_waveforms(plain.after)
    if bare == allowed or (at_floor and not plain.named):
        return plain
    if at_floor and len(plain.named) == 1:
        return _or_form(plain)
    if not tried:
        formed = _formed(base, extra, progress, allowed, plain.after, len(plain.named) - 1)
    if formed is None:
        return plain
    beyond = [s.named.effect for s in plain.steps if s.named is not None]
    beyond = [e for e in beyond if e.id in plain.named and e.id not in formed.named]
    one_does = len(beyond) == 1 and not beyond[0].followed
    fewer = len(formed.named) < len(plain.named) and not one_does
    return formed if fewer or not at_floor else plain


def _one_may_do(formed: Base, extra: tuple[Effect, ...]) -> bool:
    """Could one effect that is the same throughout do most of what the form does?"""
    without = with_nuisances(formed, [name for name in groups_of(formed) if name != FORM])
    if isinstance(without, ModelError):
        return False
    same = [a for a in assess_all(without, extra)[0] if not a.effect.followed]
    return max((a.removed for a in same), default=0.0) > MOST * without.excess


def _formed(
    base: Base,
    extra: tuple[Effect, ...],
    progress: Progress,
    allowed: tuple[str, ...],
    without: Base,
    most_effects: float = MOST_EFFECTS,
) -> SearchResult | None:
    """The search with the tire's form; None if it does not explain what is left `without` it.

    Where nothing is left without it, only steps to the floor by at most `most_effects` are of use.
    """
    progress("once more with a form of the tire's own")
    at_floor = quiet_waveforms(without)
    left = np.inf if at_floor else without.excess
    climb = _climb(base, extra, progress, allowed, left, most_effects)
    if not climb.steps or (at_floor and not quiet_waveforms(climb.after)):
        return None
    found = _search(base, extra, progress, allowed, climb)
    return found if form_explains(found.after, without) else None


def _or_form(plain: SearchResult) -> SearchResult:
    """A search that one effect ended at the floor, with the form if that does as much."""
    named = plain.steps[0].named
    before = plain.steps[0].before
    if named is None or not named.effect.followed:
        return plain  # one number that does the same throughout is the cause
    gained = float((before.held_white - named.base.held_white).sum())
    forms = [x for x, gain in alarming_nuisances(before, [FORM]) if gain > TWINS**2 * gained]
    rivals = [with_nuisance(before, *effects.groups) for effects in forms]
    alike = [r for r in rivals if not isinstance(r, ModelError) and _as_much(before, r, named)]
    return replace(plain, alike=(*plain.alike, *[(FORM, named.id)] * len(alike)))


def _search(
    base: Base,
    extra: tuple[Effect, ...],
    progress: Progress,
    allowed: tuple[str, ...],
    climb: SearchResult,
) -> SearchResult:
    """Steps from a base, beside those of the nuisances that are allowed.

    `climb`: the first steps.
    """
    rivals = climb.rivals
    if climb.passed_over is not None and not quiet_waveforms(climb.after):
        # an effect that came before a nuisance may have taken its place
        progress(f"once more with {newest(climb.passed_over, base)} first")
        other = _climb(climb.passed_over.with_scatter_estimated, extra, progress, allowed)
        if _leaves_less_at_end(base, climb.passed_over, other, climb):
            climb = other
    if not quiet_waveforms(climb.after):
        climb = _with_one_to_begin(base, rivals, extra, progress, climb, allowed)
    alike = climb.alike
    untested: tuple[str, ...] = ()
    while True:
        beside = groups_of(climb.after)
        needed = needed_nuisances(climb.after) if beside != groups_of(base) else beside
        if climb.ground is not None and needed == beside:
            base = climb.ground  # nuisances came in before any effect: the steps stand as they are
            break
        # one that came in after an effect may show that the effect stood in for another one
        words = f"once more beside {' and '.join(needed) or 'no nuisance'}"
        again = with_nuisances(base, needed)
        if isinstance(again, ModelError):
            untested = (f"Not searched {words}: {again.what}.",)
            break
        progress(words)
        base = again.with_scatter_estimated
        allowed = tuple(name for name in allowed if name not in beside)
        climb = _climb(base, extra, progress, allowed)
        alike += tuple(pair for pair in climb.alike if pair not in alike)
    found = replace(
        climb, before=base, alike=alike, untested=untested, passed_over=None, rivals=None
    )
    if len(found.named) < 2:
        return found
    progress("looking for what could stand in place of each")
    after, dropped = without_needless(found.after, found.named)
    after = after.with_scatter_estimated if dropped else after
    found = replace(found, after=after, dropped=dropped)
    groups, why_not = regrouped(after, found.named, extra)
    steps = tuple(
        replace(s, group=groups.get(s.named.id, ())) if s.named is not None else s
        for s in found.steps
    )
    return replace(found, steps=steps, untested=(*untested, *why_not))


def _with_one_to_begin(
    base: Base,
    rivals: tuple[Rival, ...] | None,
    extra: tuple[Effect, ...],
    progress: Progress,
    climb: SearchResult,
    allowed: Sequence[str],
) -> SearchResult:
    """The search from a nuisance that alone removes too little, if what follows makes up for it.

    `rivals`: the base with each of the nuisances, if they are known.

    Of two nuisances of a size neither removes most: together they must leave of chi-square's
    excess what so many leave that earn their places one by one.
    """
    known = rival_nuisances(base, allowed) if rivals is None else rivals
    first = best_of(base, known, least=0.0)
    if first is None or newest(first, base) in groups_of(climb.after):
        return climb
    progress(f"once more with {newest(first, base)} to begin with")
    other = _climb(first.with_scatter_estimated, extra, progress, allowed)
    came_in = len(groups_of(other.after)) - len(groups_of(base)) + len(other.named)
    left = (other.after.reduced_chi2 - 1.0) / (base.reduced_chi2 - 1.0)
    enough = left <= (1.0 - NUISANCE_SHARE) ** came_in
    return other if enough and _leaves_less_at_end(base, first, other, climb) else climb


def _climb(
    base: Base,
    extra: tuple[Effect, ...],
    progress: Progress,
    nuisances: Sequence[str],
    left: float = np.inf,
    most_effects: float = MOST_EFFECTS,
) -> SearchResult:
    """The search from a base upwards, to `most_effects` names.

    It ends without a step where the tire's form came in and all candidates at once leave too much
    by a linear fit: more than half of what it leaves, and of what is `left` [unit^2] without it.

    Before each step the best of the `nuisances` that earns its place comes in if it leaves less
    than the best effect: what both explain is then the nuisance's. The steps stand on the base with
    all nuisances; on none if one came in after an effect.
    """
    climb = SearchResult(base, (), base, ground=base)
    excess, without = base.excess, list[Variant]()
    while True:
        after, named = climb.after, climb.named
        rivals = None if quiet_waveforms(after) else rival_nuisances(after, nuisances)
        rival = None if rivals is None else best_of(after, rivals)
        if after is base:
            climb = replace(climb, rivals=rivals)
        step, known = None, assess_all(after, extra)
        if after is base and FORM not in groups_of(base):
            without = known[0] if any(a.alarms(base) for a in known[0]) else []
        # of an unknown wave candidates leave more than half, of effects that a form had partly
        # learnt up to 0.45
        half = 0.5 * max(left, after.excess)
        if FORM in groups_of(after) and least_left(after, known[0]) > half:
            return SearchResult(base, (), after)
        if rival is None or named or _may_do_as_well(after, rival, known[0]):
            step = next_step(after, extra, known, named=named, excess=excess)
        if step is not None and not named and FORM in groups_of(after):
            step = step_beside_form(after, without, step)
        named_now = None if step is None else step.named
        if rival is not None and named_now and _as_much(after, rival, named_now):
            pair = newest(rival, after), named_now.id
            climb = replace(climb, alike=(*climb.alike, pair))
        if rival is not None and (step is None or _leaves_less(rival, step)):
            progress(f"beside the model: {newest(rival, after)}")
            alarming = [a for a in known[0] if a.alarms(after) and not named]
            one = _left_to_one(after, rival, alarming, extra)
            after = rival.with_scatter_estimated if one is None else one.before
            climb = replace(climb, after=after, ground=None if climb.steps else after)
            excess = excess if climb.steps else after.excess
            if one is None or one.named is None:
                continue
            step = one
        assert step is not None
        passed_over = climb.passed_over if climb.steps or step.named is None else rival
        climb = replace(climb, steps=(*climb.steps, step), passed_over=passed_over)
        if step.named is None:
            return climb
        progress(f"named {step.named.id}; looking for another")
        climb = replace(climb, after=step.named.base.with_scatter_estimated)
        if len(climb.steps) == most_effects:
            return climb


def _left_to_one(
    base: Base, rival: Base, alarming: Sequence[Variant], extra: tuple[Effect, ...]
) -> Step | None:
    """The step that names what does by one number, and a measured condition, what a nuisance did.

    alarming  candidates that alarm at the `base`, by falling statistic; `rival` has the nuisance

    The nuisance stays without the numbers that the candidate's main strength replaces, if the two
    leave as little as the whole nuisance. None if no candidate does so.
    """
    name, held = newest(rival, base), rival.cells.shared
    own = [i for i, group in enumerate(held.group) if group == name] if held is not None else []
    if held is None or not own:
        return None
    white, least = rival.white, LEAST_SHARE_OF_FLOOR * rival.floor.square
    alone = Offsets.of(replace(rival.cells, shared=None), white)
    taken = alone.beside(white(rival.fit.moving))
    columns = stacked(taken.without(white(held.columns[..., own] * held.sd[own])))
    length = np.linalg.norm(columns, axis=0)
    for candidate in (a for a in alarming if _varies_as_measured(base, a.effect)):
        main = stacked(taken.without(white(candidate.columns[..., :1])))[:, 0]
        share = np.linalg.lstsq(columns, main, rcond=None)[0]
        if np.linalg.norm(columns @ share) < TWINS * np.linalg.norm(main):
            continue
        # numbers that make up a tenth of what the candidate does are replaced; twice as much would
        # leave those of a short log in place
        made = np.abs(share) * length > 0.1 * np.linalg.norm(main)
        replaced = [own[i] for i in np.flatnonzero(made)]
        change = held.columns[..., replaced] @ rival.fit.amplitudes[replaced]
        if float((rival.plain(change) ** 2).sum()) / rival.plain.weight < least:
            continue
        gone = {held.names[i] for i in replaced}
        less = [
            mine and mine.of([i for i, own_name in enumerate(mine.names) if own_name not in gone])
            for mine in (one.cells.shared for one in rival.blocks)
        ]
        without = refit(rival, rival.model, shared=less)
        if isinstance(without, ModelError):
            continue
        step = next_step(without.with_scatter_estimated, extra)
        if step.named is None or step.named.id != candidate.id:
            continue
        if step.named.base.square_held < rival.square_held + least:
            return step
    return None


def _may_do_as_well(base: Base, rival: Base, assessed: Sequence[Variant]) -> bool:
    """Could an effect, once refitted, leave as little as a nuisance does?

    Not if the nuisance leaves the floor, and none comes near to it by its linear strength: refits
    of effects take most of a search.
    """
    if rival.excess > LEAST_SHARE_OF_FLOOR * rival.floor.square:
        return True
    most = max((a.removed for a in assessed if a.alarms(base)), default=0.0)
    return most > 0.5 * MOST * (base.excess - rival.excess)


def _leaves_less(rival: Base, step: Step) -> bool:
    """Is the held-out loss beside a nuisance below that with the effect of a step?

    By more than its numbers, if it is a form or the effect follows what was measured: an effect
    that does with one number what it does is the cause.
    """
    if step.named is None:
        return True
    name = newest(rival, step.before)
    many = name == FORM or _one_for_many(step.before, rival, step.named)
    numbers = _numbers(rival, name) if many else 0
    return float(rival.held_white.sum()) + numbers < float(step.named.base.held_white.sum())


def _leaves_less_at_end(base: Base, rival: Base, other: SearchResult, climb: SearchResult) -> bool:
    """Does the search `other`, which a nuisance (`rival`) began, leave less than the first one?

    If that began with an effect that does with one number what the nuisance does by many, then by
    what a nuisance must remove.
    """
    first = climb.steps[0].named if climb.steps else None
    one = first is not None and _one_for_many(base, rival, first)
    least = 1.0 - NUISANCE_SHARE if one else 1.0
    left, before = other.after.reduced_chi2 - 1.0, climb.after.reduced_chi2 - 1.0
    return left < min(before, least * before)


def _numbers(base: Base, nuisance: str) -> int:
    """How many numbers a nuisance of the base has."""
    held = base.cells.shared
    linear = 0 if held is None else sum(group == nuisance for group in held.group)
    return linear + len(frees(base.model, nuisance))


def _one_for_many(base: Base, rival: Base, named: Refitted) -> bool:
    """Does an effect do by a measured condition what a nuisance does by more numbers?

    Speed and time are no such condition: a rolling radius follows the one, a drift the other.
    """
    effect = named.effect
    fewer = len(effect.strength) < _numbers(rival, newest(rival, base))
    return fewer and _varies_as_measured(base, effect)


def _varies_as_measured(base: Base, effect: Effect) -> bool:
    """Does a condition vary here that the effect follows, other than speed and time?"""
    measured = [
        values
        for name, _ in effect.followed
        if name not in ("speed_m_s", "time_s")
        and np.isfinite(values := getattr(base.cells.conditions, name)).all()
    ]
    return any(np.ptp(x) > LEAST_CHANGE * np.abs(x).max() for x in measured)


def _as_much(base: Base, rival: Base, named: Refitted) -> bool:
    """Do a nuisance and an effect remove as much of chi-square, to what forms differ by?

    The waveforms decide, which a nuisance acts on. The answer is no if the better one leaves the
    noise floor alone and the other is clearly worse: then its form is right. The tire's form has
    many numbers: it is clearly worse as soon as it leaves more than the floor. It is never alike
    to an effect that does the same under all conditions: one number that does it is the cause. So
    is one that does by a measured condition what a nuisance does by many (`_one_for_many`).
    """
    form = newest(rival, base) == FORM
    if form and not named.effect.followed:
        return False
    if not form and _one_for_many(base, rival, named):
        return False
    better, worse = sorted((rival, named.base), key=lambda refitted: refitted.noise_chi2)
    removed = [base.noise_chi2 - refitted.noise_chi2 for refitted in (worse, better)]
    if removed[0] < TWINS**2 * removed[1]:
        return False
    right = better.with_scatter_estimated
    return not (
        quiet_waveforms(right)
        and not quiet_waveforms(worse)
        and (form or clearly_worse(worse, better))
    )


# ---- The ranking of all effects that were tried: shares of the excess, strengths, and their
# errors.


def ranking_of(
    found: SearchResult, selected: Sequence[str], excess: float, floor: float, share_of_all: float
) -> tuple[Candidate, ...]:
    """All candidates of the first step.

    Those named later follow with what they did when they were named. If one effect was selected its
    share is `share_of_all`, so that the table and the sentence say one number.
    """
    first = found.steps[0]
    refitted = {r.id: r for r in first.contenders}
    own: dict[str, tuple[Variant, float]] = {}
    for a in first.assessed:
        if a.id in first.reasons and a.id not in selected:
            continue  # a failed refit is no number
        again = refitted.get(a.id)
        removed = first.before.square_held - again.base.square_held if again else a.removed
        unphysical = a.one_sided and a.step[0] < 0.0 and not again
        shared = excess > LEAST_SHARE_OF_FLOOR * floor and not unphysical
        share = share_of_all if tuple(selected) == (a.id,) else removed / excess if shared else 0.0
        own[a.id] = a, float(np.clip(share, 0.0, 1.0))
    p = {s.named.id: s.named.p for s in found.steps if s.named is not None}
    order = dict.fromkeys([*selected, *(r.id for r in first.contenders), *own])
    groups = {s.named.id: s.group for s in found.steps if s.named is not None}
    return tuple(
        Candidate(
            effect=name,
            rank=i + 1,
            excess_removed=own[name][1],
            p_adjusted=p.get(name, own[name][0].p),
            selected=name in selected,
            group=tuple(g for g in groups.get(name, ()) if g != name),
            statistic=own[name][0].statistic,
            strengths=_strengths(found, own[name][0], refitted),
        )
        for i, name in enumerate(n for n in order if n in own)
    )


def _strengths(
    found: SearchResult, a: Variant, refitted: Mapping[str, Any]
) -> dict[str, dict[str, Any]]:
    """The effect's parameters with errors and units.

    From the final model, its own refit, or the linear fit.
    """
    for model in (found.after.model, *([refitted[a.id].base.model] if a.id in refitted else [])):
        own = {n.split(".")[1]: q for n, q in model.parameters.items() if n.startswith(f"{a.id}.")}
        if own:
            return {
                name: {"value": q.value, "se": q.se, "se_with_form": q.se_with_form, "unit": q.unit}
                for name, q in own.items()
                if q.free
            }
    units = {q.name: q.unit for q in a.effect.parameters}
    return {
        n: {"value": float(v), "se": None, "unit": units[n]}
        for n, v in zip(a.strengths, a.step, strict=True)
    }


def removed_errors(found: SearchResult) -> dict[str, float]:
    """Effect -> standard error of the share of the excess that it removes alone.

    The excess is the held-out mean-square error above the floor. The share is a ratio of sums over
    manoeuvres, gain over excess; its error is that of the sum of (gain - share x excess). Known for
    the candidates that were refitted in the first step; empty if there is no excess to share.
    """
    base, errors = found.steps[0].before, dict[str, float]()
    between = (found.after if found.named else found.before).floor.square - base.floor.within
    noise = base.plain.bias + between * base.plain.weight
    excess = base.held_plain - noise / base.held_plain.size
    total = float(excess.sum())
    for rival in found.steps[0].contenders if total > 0.0 else ():
        share = float((base.held_plain - rival.base.held_plain).sum()) / total
        _, error = gain_and_error(base.held_plain, rival.base.held_plain + share * excess)
        errors[rival.id] = error / total
    return errors
