"""Which effect it is.

Refits of the best candidates, sets that these data do not separate, second effects.

    Variant, by falling statistic -> contenders
        -> refitted with the base parameters from two strengths -> least held-out loss names

Likeness of two effects on these data is the nonlinear cosine sqrt(what B explains / what A
explains), each refitted as well as it can. It is defined without noise, and it finds a rival that
can stand for A once all its parameters have moved.

A second effect must survive freedom of shape: the first effect's size per cell, times free shapes
over the angle, is projected out. A real tire does not follow our forms, and what a form that is
somewhat wrong leaves repeats perfectly.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from tirelog.diagnosis.candidates.assessment import (
    Variant,
    all_signatures,
    assess,
    at_noise_floor,
    candidate_effects,
    flip_signs,
    flip_test,
    freedom_of_shape,
    gain_and_error,
    idle_candidates,
    mean_drop,
    scores_of,
    surely_gains,
    with_candidate,
)
from tirelog.diagnosis.rules import (
    ALARM_P,
    BEYOND_DOUBT_P,
    CONTENDER,
    ESTABLISHED_SIGMAS,
    GAIN_SIGMAS,
    LEAST_SHARE_OF_FLOOR,
    LIKE,
    MOST_CONTENDERS,
    NOT_FORM,
    NUISANCE_SHARE,
    SECOND_LEAST,
    THIRD,
    TWINS,
    WORSE_SIGMAS,
)
from tirelog.errors import ModelError, or_refusal
from tirelog.inference.base import (
    Base,
    refit,
    refit_without,
    with_fewer_cells,
    with_fits,
)
from tirelog.inference.fit.cells import NULL, Fit, descended, errors_of, free_names, starts
from tirelog.inference.floor import held_out_losses_with
from tirelog.inference.metric import Offsets, stacked
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model
from tirelog.process_pool import made_apart
from tirelog.vocabulary.arrays import FloatArray

# ---- Candidates refitted: from several starts, tried on a few cells, the best one on all.
#
#     Variant --linear strength, probe--> starts --a few cells, a few steps--> trials
#         --the best of them, all cells--> Base with the candidate
#
# Trials know nothing of each other, and neither do the refits: where processes share work they run
# side by side, and come to the same numbers.


#: a model with a candidate where its trial ended, and chi-square there
Trial = tuple[Model, float]
#: a refit as it comes from another process: the fit of each block, and held-out losses
_Again = tuple[list[Fit], tuple[FloatArray, FloatArray]]


def _starts(base: Base, candidate: Variant) -> list[tuple[Model, dict[str, float]]]:
    """Models to begin from, each with the candidate's own values there.

    Its linear strength, and its probe.
    """
    linear = dict(zip(candidate.strengths, candidate.step, strict=True))
    probes = {
        p.name: p.probe * (np.sign(linear.get(p.name, 1.0)) or 1.0)
        for p in candidate.effect.parameters
        if p.name in linear
    }
    shape = dict(candidate.shape)
    models = [base.model]
    given = base.given.values
    within = {name: given[name] for name in base.fit.names if name in given}
    if base.fit.held:
        # what drove the base to a bound may be the very effect: begin within, too
        models.append(base.model.with_values(within))
    begun = [(m, {**shape, **s}) for m in models for s in (linear, probes)]
    learnt = {n: p.prior[0] for n, p in base.model.parameters.items() if p.free and p.prior}
    if learnt:  # what a form has learnt may be the very effect
        bare = starts(base.model.with_values(learnt), base.fit.names)
        bare.append(bare[0].with_values(within))  # and what it made of the others with it
        begun += [(m, {**shape, **linear}) for m in bare]
    return begun


@or_refusal
def _trial(
    base: Base, few: Base, candidate: Variant, model: Model, values: dict[str, float]
) -> Trial:
    """Where a start leads on `few` cells."""
    start = with_candidate(model, candidate.effect, values)
    start = start.resolved(base.cells.conditions)
    blocks = [(one.cells, one.white) for one in few.blocks]
    names = free_names(start, *(cells for cells, _ in blocks))
    # starts of a candidate are tried on so many cells, so many steps, before the best is finished
    # on all cells; the time goes with both
    return descended(blocks, start, names, steps=12)[1:3]


@or_refusal
def refit_candidate(base: Base, candidate: Variant, trials: Sequence[Trial]) -> _Again:
    """The best refit with the candidate on all cells, from the best of its `trials`.

    Without what the base has already: it goes from process to process. ModelError if none leads
    below the base: a worse refit is a failed refit.
    """
    name = candidate.id
    if not trials:
        raise ModelError(f"the fit with {name} failed")
    least = min(chi2 for _, chi2 in trials)
    # starts that end so near the least chi-square, as a share of it, fit alike; of these the one
    # counts that stays nearest to the values given: EJ, k, y and tension share a scale, and along
    # it a fit may drift until something is at a bound.  Ten times what settles a fit; doubling
    # changes nothing seen
    reached = [model for model, chi2 in trials if chi2 <= (1.0 + 1e-3) * least]
    best = refit(base, min(reached, key=lambda model: _moved(base, model)))
    if isinstance(best, ModelError):
        raise best
    if best.fit.chi2 > base.fit.chi2:
        raise ModelError(f"the fit with {name} ended above the fit without it")
    return [one.fit for one in best.blocks], (best.held_white, best.held_plain)


def _moved(base: Base, model: Model) -> float:
    """How far the base's free parameters are from what the model file gave.

    As shares of the larger of the two values, summed.
    """
    given = base.given.values
    pairs = [(given[name], model.values[name]) for name in base.fit.names if name in given]
    return float(sum(abs(a - b) / max(abs(a), abs(b), 1e-300) for a, b in pairs))


def refits(base: Base, candidates: Sequence[Variant]) -> list[Base | ModelError]:
    """Of each candidate the base with it, refitted, or why that failed."""
    few = with_fewer_cells(base, 24)
    begun = [(one, *start) for one in candidates for start in _starts(base, one)]
    ends = made_apart([partial(_trial, base, few, *start) for start in begun])
    good = [
        (s[0], end) for s, end in zip(begun, ends, strict=True) if not isinstance(end, ModelError)
    ]
    trials = [[end for of, end in good if of is one] for one in candidates]
    jobs = [partial(refit_candidate, base, *pair) for pair in zip(candidates, trials, strict=True)]
    return [
        again if isinstance(again, ModelError) else with_fits(base, *again)
        for again in made_apart(jobs)
    ]


@dataclass(frozen=True, kw_only=True)
class Refitted(Variant):
    """A candidate in the model, refitted.

    The base with it, and its likeness to the best of its step. The likeness is given in whitened
    units and in size; it is 1 for the best itself. `sigmas`: by how many standard errors its
    strengths differ from nothing.
    """

    base: Base
    likeness: float = 1.0
    likeness_of_size: float = 1.0
    sigmas: float = float("inf")

    @property
    def established(self) -> bool:
        """Its strengths are distinguishable from nothing.

        Strengths at their bounds, or replaceable by other parameters, are not.
        """
        return self.sigmas >= ESTABLISHED_SIGMAS


@dataclass(frozen=True)
class Step:
    """One step of the search for names.

    Base before, all candidates assessed, why others are not, the contenders refitted (best first),
    the named one or None. The signatures' columns have served then and are not kept.
    """

    before: Base
    assessed: tuple[Variant, ...]
    reasons: dict[str, str]
    contenders: tuple[Refitted, ...]
    named: Refitted | None
    group: tuple[str, ...]

    @classmethod
    def of(
        cls,
        before: Base,
        assessed: Sequence[Variant],
        reasons: dict[str, str],
        contenders: Sequence[Refitted] = (),
        *,
        named: bool = False,
    ) -> Step:
        """A step in which the best of the contenders is `named`, or nothing.

        What is not established is never named, nor what is clearly worse than one that is not.
        """
        doubtful = [r.base for r in contenders if not r.established]
        named = named and contenders[0].established
        named = named and not any(clearly_worse(contenders[0].base, rest) for rest in doubtful)
        light = tuple(r.without_columns for r in contenders)
        best, group = (light[0], group_of(contenders)) if named else (None, ())
        return cls(before, tuple(a.without_columns for a in assessed), reasons, light, best, group)


def assess_all(base: Base, extra: Iterable[Effect]) -> tuple[list[Variant], dict[str, str]]:
    """Signatures of every candidate at the fitted point, assessed."""
    extra = tuple(extra)
    found, reasons = all_signatures(base, candidate_effects(base.model, extra))
    assessed, invisible = assess(base, found)
    return assessed, {**idle_candidates(base.model, extra), **reasons, **invisible}


def not_among_candidates(base: Base) -> dict[str, str]:
    """What each effect that a search does not try would remove of what is left, as a reason.

    Only of those that repeat, gain and are large enough, as a candidate has to be.
    """
    found, _ = all_signatures(base, candidate_effects(base.model, tried=False))
    return {
        a.id: f"would remove {min(a.removed / base.excess, 1.0):.0%} of what is left (linear "
        "estimate); a diagnosis does not try it, `tirelog model add` adds it"
        for a in (assess(base, found)[0] if found else ())
        if a.alarms(base) and a.removed > NUISANCE_SHARE * base.excess > 0.0
    }


def leading(assessed: Sequence[Variant]) -> list[Variant]:
    """Those of the candidates, which come by falling statistic, that are refitted."""
    least = CONTENDER * max((a.statistic for a in assessed), default=0.0)
    return [a for a in assessed if a.statistic >= least][: int(MOST_CONTENDERS)]


def contend(base: Base, chosen: Sequence[Variant], reasons: dict[str, str]) -> list[Refitted]:
    """The chosen candidates refitted, by rising held-out loss; failed ones go to `reasons`."""
    tried = []
    for one, found in zip(chosen, refits(base, chosen), strict=True):
        if isinstance(found, ModelError):
            reasons[one.id] = found.what
        else:
            sigmas = strength_sigmas(found, one.id)
            tried.append(Refitted(**vars(one), base=found, sigmas=sigmas))
    return ranked(base, tried)


def ranked(base: Base, tried: Iterable[Refitted]) -> list[Refitted]:
    """Contenders by rising held-out loss, established ones first; each with its likeness.

    That is the nonlinear cosine with the best, whitened and in size: the root of what the rival
    explains over what the best does.
    """
    order = sorted(tried, key=lambda r: (not r.established, float(r.base.held_white.sum())))
    left = np.array([(one.fit.chi2, one.square_held) for one in (base, *(r.base for r in order))])
    explains = left[0] - left[1:]
    most = np.maximum(explains[:1], 1e-300)
    alike = np.sqrt(np.clip(explains, 0.0, most) / most).tolist()
    return [
        replace(r, likeness=white, likeness_of_size=size)
        for r, (white, size) in zip(order, alike, strict=True)
    ]


def strength_sigmas(base: Base, effect_id: str) -> float:
    """By how many standard errors an effect's strengths differ from nothing.

    All of them together, per root of their number.

    The errors are marginal: what the base, other effects and the effect's own shape can do as well
    is no evidence. In a waveform a direction that changes nothing at all is the scale that EJ, k,
    mu, y and T share. It is no evidence against an effect. In a number per revolution it is, since
    there almost any effect can replace another.
    """
    fit, own = base.fit, next(e.effect for e in base.model.effects if e.id == effect_id)
    strengths = [f"{effect_id}.{name}" for name in own.strength]
    columns = stacked(Offsets.of(base.cells, base.white).without(base.white(fit.moving)))
    # priors of a form are no evidence: the errors are those of the data alone
    known = errors_of(columns, max(1.0, fit.reduced_chi2))
    error = np.sqrt(np.diag(known.covariance))
    mine = np.flatnonzero(np.isin(fit.names, strengths) & (error > 0.0))
    if not mine.size or (base.cells.phi.shape[1] == 1 and np.isinf(known.se[mine]).any()):
        return 0.0
    sigmas = np.array([base.model.values[fit.names[i]] for i in mine]) / error[mine]
    alike = known.covariance[np.ix_(mine, mine)] / np.outer(error[mine], error[mine])
    evidence = sigmas @ np.linalg.pinv(alike, rcond=NULL, hermitian=True) @ sigmas
    return float(np.sqrt(evidence / mine.size))


def clearly_worse(one: Base, other: Base) -> bool:
    """Is the held-out error of `one` above that of `other`?

    By the scatter of manoeuvres and by more than a twentieth of the floor.
    """
    gain, error = gain_and_error(one.held_plain, other.held_plain)
    return (
        gain > WORSE_SIGMAS * error
        and one.square_held - other.square_held > LEAST_SHARE_OF_FLOOR * other.floor.square
    )


def group_of(contenders: Sequence[Refitted]) -> tuple[str, ...]:
    """The best and those that these data do not separate from it; empty if it is alone.

    Likeness of shape decides, since no tire follows our forms. But if the best leaves the noise
    floor alone, its form is right. A model that leaves clearly more, and more than the floor, is
    then no rival.
    """
    best, floor = contenders[0], contenders[0].base.floor.square
    like = [
        r
        for r in contenders[1:]
        if r.established
        and (
            min(r.likeness, r.likeness_of_size) >= TWINS
            or (
                r.likeness_of_size >= LIKE
                and r.base.square_held - best.base.square_held < THIRD * floor
            )
        )
    ]
    if like and right_to_the_floor(best):
        like = [
            r for r in like if at_noise_floor(r.base, floor) or not clearly_worse(r.base, best.base)
        ]
    return (best.id, *(r.id for r in like)) if like else ()


def right_to_the_floor(best: Refitted) -> bool:
    """Does the model with it leave the noise floor alone?

    Once what it explains is no longer taken for scatter.
    """
    if any(name.startswith(f"{best.id}.") for name in best.base.fit.held):  # it would cross a bound
        return False
    after = best.base.with_scatter_estimated
    return at_noise_floor(after, after.floor.square)


def worth_it(before: Base, after: Base, p: float = 1.0, *, held_out_only: bool = False) -> bool:
    """Held-out gain of a refit above its error, and a size above the rule's.

    `p`: by what chance it looks as it does, if that is known; `held_out_only`: the size is what
    goes of the held-out error, and nothing else, however small p is.
    """
    gain, error = gain_and_error(before.held_white, after.held_white)
    if not surely_gains(gain, error, p, before.share(before.square_held - after.square_held)):
        return False
    least = LEAST_SHARE_OF_FLOOR * before.floor.square
    size, by_size = removed_by(before, after, sure=p <= BEYOND_DOUBT_P and not held_out_only)
    if by_size and size <= least:  # less is scatter once what it does is in
        size, _ = removed_by(before, after.with_scatter_estimated, sure=True)
    return size > least


def removed_by(before: Base, after: Base, *, sure: bool) -> tuple[float, bool]:
    """Mean square [unit^2] that a refit removes, and whether held-out errors do not tell it.

    The held-out errors give it, unless manoeuvres scatter by more. It is then the square of the
    change that the refit makes to the waveforms, as far as the held-out errors allow it. This
    needs a `sure` refit that removes of chi-square's excess what a nuisance must: one that follows
    chance, or loads that scatter, changes the waveforms as well.
    """
    drop, error = (
        x / before.plain.weight for x in gain_and_error(before.held_plain, after.held_plain)
    )
    if drop > GAIN_SIGMAS * error or not (sure and explains_noise(before, after)):
        return drop, False
    one, other = (base.fit.prediction + base.fit.beside for base in (before, after))
    change = float((before.plain(np.nan_to_num(other - one)) ** 2).sum()) / before.plain.weight
    return min(change, drop + GAIN_SIGMAS * error), True


def explains_noise(before: Base, after: Base) -> bool:
    """Does a refit remove of chi-square's excess what a nuisance must?"""
    gone = before.noise_chi2 - after.noise_chi2
    return gone >= NUISANCE_SHARE * (before.noise_chi2 - before.fit.freedom) > 0.0


#: the candidates by falling statistic, and why others are not among them
Known = tuple[list[Variant], dict[str, str]]


def step_beside_form(base: Base, without: Sequence[Variant], step: Step) -> Step:
    """A first effect beside a form that has learnt some of it, so that slopes show it badly now.

    The contenders are those `without` the form that the `step` by slopes has not refitted. One is
    named if nothing is left with it, where the form and what the step names leave something. Its p
    is by flips of what it gains in each manoeuvre, times the number of candidates. Else the step.
    """
    if step.named is not None and right_to_the_floor(step.named):
        return step
    refitted = {r.id for r in step.contenders}
    more = contend(base, [a for a in leading(without) if a.id not in refitted], step.reasons)
    if not more:
        return step
    best, *others = ranked(base, [*more, *step.contenders])
    if best.id in refitted or not right_to_the_floor(best):
        return step
    p = _p_of_gains(base, best, len(without))
    if p > ALARM_P or not worth_it(base, best.base, p):
        return step
    best = replace(best, p=p)
    assessed = [best if a.id == best.id else a for a in step.assessed]
    return Step.of(base, assessed, step.reasons, [best, *others], named=True)


def _p_of_gains(base: Base, refitted: Refitted, candidates: int) -> float:
    """p of a refit by flips of what it gains in each manoeuvre, times the number of candidates."""
    gains = base.held_white - refitted.base.held_white
    as_much = flip_signs(gains.size) @ gains >= gains.sum() * (1.0 - 1e-9)
    return float(min(1.0, candidates * as_much.mean()))


def next_step(
    base: Base,
    extra: Iterable[Effect] = (),
    known: Known | None = None,
    *,
    named: Sequence[str] = (),
    excess: float = 0.0,
) -> Step:
    """The first effect, or a further one beside those `named`, if there is one.

    `known`: what `assess_all` gives; `excess`: the mean square that the first base left above
    the floor.
    """
    assessed, reasons = known or assess_all(base, extra)
    small = bool(named) and base.excess < LEAST_SHARE_OF_FLOOR * base.floor.square
    if small or not any(a.alarms(base) for a in assessed):
        return Step.of(base, assessed, reasons)
    contenders = contend(base, leading(assessed), reasons)
    if not contenders:
        return Step.of(base, assessed, reasons)
    best = contenders[0]
    if best.p > ALARM_P:
        # another candidate's alarm is no evidence for this one; slopes show badly what is far from
        # linear, and what its refit gains may show it
        p = min(best.p, _p_of_gains(base, best, len(assessed)))
        best = contenders[0] = replace(best, p=p)
    is_named = best.p <= ALARM_P and worth_it(base, best.base, best.p)
    if named and is_named:
        taken = base.square_held - best.base.square_held
        beyond_form = base.excess > NOT_FORM * excess and taken > 0.5 * base.excess
        is_named = beyond_form or survives(base, named, best, assessed)
    return Step.of(base, assessed, reasons, contenders, named=is_named)


def without_needless(
    after: Base, named: Sequence[str], worth: Callable[[Base, Base], bool] = worth_it
) -> tuple[Base, tuple[str, ...]]:
    """(the base without needless effects, their names).

    Needless are named effects that the others have made so: a first name may have stood in for two.
    `worth` tells of a base without one and with it whether it is needed.
    """
    dropped: list[str] = []
    for name in named:
        if len(named) - len(dropped) == 1:
            break
        less = refit_without(after, name)
        if not isinstance(less, ModelError) and not worth(less, after):
            after, dropped = less, [*dropped, name]
    return after, tuple(dropped)


def regrouped(
    after: Base, named: Sequence[str], extra: Iterable[Effect] = ()
) -> tuple[dict[str, tuple[str, ...]], list[str]]:
    """For each of several named effects the set of those that could stand in its place.

    Beside the others, which stay; and sentences on those whose place none is tried in, since
    nothing can be computed without them.
    """
    groups: dict[str, tuple[str, ...]] = {}
    untested = []
    for name in named:
        without_it = refit_without(after, name)
        if isinstance(without_it, ModelError):
            untested.append(f"Not tested, what could stand in place of {name}: {without_it.what}.")
            continue
        assessed, reasons = assess_all(without_it, extra)
        contenders = contend(without_it, leading(assessed), reasons)
        if contenders and contenders[0].id == name:
            groups[name] = group_of(contenders)
    return groups, untested


def survives(
    base: Base, named: Sequence[str], candidate: Refitted, assessed: Sequence[Variant]
) -> bool:
    """Does the candidate remove enough beside free shapes of the effects named before?

    Its p there is family-wise over all that were `assessed`, since it was chosen among them.
    """
    free = np.concatenate([freedom_of_shape(base, effect) for effect in named], axis=-1)
    others = [a for a in assessed if a.id != candidate.id]
    kept, scores, _ = scores_of(base, [candidate, *others], free)
    if not kept or kept[0].id != candidate.id:
        return False
    if flip_test(scores, base.cells.manoeuvres)[1][0] > ALARM_P:
        return False
    added = ([free], [free, candidate.columns])
    losses = held_out_losses_with(base.cells, base.white, base.plain, base.fit, added)
    removed = mean_drop(base, losses[1][1]) - mean_drop(base, losses[0][1])
    return removed > SECOND_LEAST * base.floor.square
