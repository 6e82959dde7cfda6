"""Candidates refitted: from several starts, tried on a few cells, the best one on all.

    Assessed --linear strength, probe--> starts --a few cells, a few steps--> trials
        --the best of them, all cells--> Base with the candidate

Trials know nothing of each other, and neither do the refits: where processes share work they run
side by side, and come to the same numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from tirelog.apart import made_apart
from tirelog.diagnosis.candidates.assessment import Assessed
from tirelog.diagnosis.candidates.signatures import with_candidate
from tirelog.errors import ModelError, or_refusal
from tirelog.inference.base import Base, refit, thinned
from tirelog.inference.fit.cells import Fit, Problem, descend_together, free_names, starts
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray

#: starts of a candidate are tried on so many cells, so many steps, before the best is finished on
#: all cells; the time goes with both
_TRIAL_CELLS = 24
_TRIAL_STEPS = 12
#: starts that end so near the least chi-square, as a share of it, fit alike; of these the one
#: counts that stays nearest to the values given: EJ, k, y and tension share a scale, and along it a
#: fit may drift until something stands at a bound.  Ten times what settles a fit; doubling changes
#: nothing seen
SAME_CHI2 = 1e-3
#: a model with a candidate where its trial ended, and chi-square there
Trial = tuple[Model, float]
#: a refit as it comes from another process: fit and held-out losses
_Again = tuple[Fit, FloatArray, FloatArray]


def _starts(base: Base, candidate: Assessed) -> list[tuple[Model, dict[str, float]]]:
    """Models to begin from, each with the candidate's own values there.

    Its linear strength, and its probe.
    """
    linear = dict(zip(candidate.signature.strengths, candidate.strengths, strict=True))
    probes = {
        p.name: p.probe * (np.sign(linear.get(p.name, 1.0)) or 1.0)
        for p in candidate.signature.effect.parameters
        if p.name in linear
    }
    shape = dict(candidate.signature.shape)
    models = [base.model]
    if (
        base.fit.held and base.given is not None
    ):  # what drove the base to a bound may be the very effect: begin within, too
        within = {
            name: base.given.values[name] for name in base.fit.names if name in base.given.values
        }
        models.append(base.model.with_values(within))
    begun = [(m, {**shape, **s}) for m in models for s in (linear, probes)]
    learnt = {n: p.prior[0] for n, p in base.model.parameters.items() if p.free and p.prior}
    if learnt:  # what a form has learnt may be the very effect
        bare = base.model.with_values(learnt)
        begun += [(m, {**shape, **linear}) for m in starts(bare, base.fit.names)]
    return begun


@or_refusal
def _trial(
    base: Base, few: Base, candidate: Assessed, model: Model, values: dict[str, float]
) -> Trial:
    """Where a start leads on `few` cells."""
    start = with_candidate(model, candidate.signature.effect, values)
    start = start.resolved(base.cells.conditions)
    names, problem = free_names(start, few.cells), Problem(few.cells, few.white)
    return descend_together([problem], start, names, steps=_TRIAL_STEPS)[:2]


def refit_candidate(base: Base, candidate: Assessed, trials: Sequence[Trial]) -> Base:
    """The best refit with the candidate on all cells, from the best of its `trials`.

    ModelError if none leads below the base: a worse refit is a failed refit.
    """
    name = candidate.id
    if not trials:
        raise ModelError(f"the fit with {name} failed")
    least = min(chi2 for _, chi2 in trials)
    reached = [model for model, chi2 in trials if chi2 <= (1.0 + SAME_CHI2) * least]
    best = refit(base, min(reached, key=lambda model: _moved(base, model)))
    if isinstance(best, ModelError):
        raise best
    if best.fit.chi2 > base.fit.chi2:
        raise ModelError(f"the fit with {name} ended above the fit without it")
    return best


@or_refusal
def _again(base: Base, candidate: Assessed, trials: Sequence[Trial]) -> _Again:
    """The same without what the base has already: it goes from process to process."""
    found = refit_candidate(base, candidate, trials)
    return found.fit, found.held_white, found.held_plain


def _moved(base: Base, model: Model) -> float:
    """How far the base's free parameters are from what the model file gave.

    As shares of the larger of the two values, summed.
    """
    given = (base.given or base.model).values
    pairs = [(given[name], model.values[name]) for name in base.fit.names if name in given]
    return float(sum(abs(a - b) / max(abs(a), abs(b), 1e-300) for a, b in pairs))


def refits(base: Base, candidates: Sequence[Assessed]) -> list[Base | ModelError]:
    """Of each candidate the base with it, refitted, or why that failed."""
    few = thinned(base, _TRIAL_CELLS)
    begun = [(one, *start) for one in candidates for start in _starts(base, one)]
    ends = made_apart([partial(_trial, base, few, *start) for start in begun])
    trials = [
        [
            end
            for start, end in zip(begun, ends, strict=True)
            if start[0] is one and not isinstance(end, ModelError)
        ]
        for one in candidates
    ]
    jobs = [partial(_again, base, *pair) for pair in zip(candidates, trials, strict=True)]
    found: list[Base | ModelError] = []
    for again in made_apart(jobs):
        if isinstance(again, ModelError):
            found.append(again)
            continue
        fit, white, plain = again
        found.append(replace(base, cells=fit.cells, fit=fit, held_white=white, held_plain=plain))
    return found
