"""`ladder`: effects added one by one until nothing more is worth it.

The error falls to the floor on the way.

    Stacks, Model --> some manoeuvres are locked away (with twelve or more)
        --> search on the rest --> a row per step
        --> the model at the top against the locked manoeuvres: the number that nothing has touched
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from tirelog.diagnosis.answer import excess_of, probability
from tirelog.diagnosis.candidates.assessment import at_noise_floor, out_of_range
from tirelog.diagnosis.candidates.naming import without_needless
from tirelog.diagnosis.candidates.nuisances import (
    nuisance_sentences,
    nuisances_found,
    observed,
    with_nuisances_on,
)
from tirelog.diagnosis.candidates.search import Progress, SearchResult, search_effects
from tirelog.diagnosis.compare import (
    Measured,
    locked_away,
    manoeuvres_of,
    measured_pieces,
    remarks_of,
    start,
    untouched,
)
from tirelog.diagnosis.gratings import gathered
from tirelog.diagnosis.propose.propose import propose
from tirelog.diagnosis.results import Ladder, LadderStep
from tirelog.diagnosis.rules import EXPLAINED, FEWEST_MANOEUVRES
from tirelog.errors import ModelError
from tirelog.inference.base import Base
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model


def ladder(
    measured: Measured,
    model: Model,
    *,
    effects: Iterable[Effect] = (),
    proposing: bool = False,
    progress: Progress = lambda text: None,
) -> Ladder:
    """The ladder from `model` upwards.

    `effects`: the user's own candidates beside the catalogue. `proposing`: if they end above the
    floor, what is unknown is written down (`propose`) and is the last step.
    """
    # every so many manoeuvres one is locked away, if at least so many remain: these leave sign
    # flips a least p of 2^-11.  Twice as rarely, logs of up to 17 manoeuvres are judged by a single
    # one
    # the fourth is the first: those before it are as a rule the slowest
    # with twice as many, logs of fewer than 27 manoeuvres have none locked
    seen, locked = locked_away(measured_pieces(measured), first=3, every=7, least=12)
    progress("fitting the model")
    asked = gathered(seen, model)
    seen, base = asked.searched, asked.base
    members = [part.member for part in seen]
    locked = [part for part in locked if part.member in members]
    effects = tuple(effects)
    found = search_effects(base, effects, progress)
    after, steps = found.after, list(_steps(found))
    verdict = _reached(found.before, after) if found.named else "nothing_added"
    if found.before.cells.manoeuvres < FEWEST_MANOEUVRES:
        verdict = "too_few"
    more: tuple[str, ...] = ()
    if proposing and verdict in ("nothing_added", "above_the_floor"):
        progress("writing down what is unknown")
        proposal = propose(seen, with_nuisances_on(after), effects=effects, progress=progress)
        if proposal.model is None:
            more = (proposal.sentence,)
        else:
            top = start(seen, proposal.model)
            name = " and ".join(proposal.written)
            sentence = f"{name} added, written down from what was left: {proposal.sentence}"
            p = max((term.p for term in proposal.terms), default=None)
            steps = [step for step in steps if step.outcome != "not_added"]
            steps.append(_row(top, name, "added: proposed", sentence, p))
            after, dropped = without_needless(top, [*found.named, *proposal.written])
            if dropped:
                after = after.with_scatter_estimated
                steps.append(_removed(after, dropped))
            verdict = _reached(found.before, after)
    on_locked = untouched(after, locked) if locked else (None, None)
    fails = verdict != "at_the_floor" and not at_noise_floor(after, after.floor.square)
    untested = list(found.untested)
    if isinstance(on_locked, ModelError):
        untested.append(f"No error on the manoeuvres reserved for the end: {on_locked.what}.")
        on_locked = None, None
    kept_back = int(manoeuvres_of(locked).size) if locked else 0
    if kept_back:
        untested.append(
            f"{kept_back} of {base.cells.manoeuvres + kept_back} manoeuvres are locked away until "
            f"the last step. The errors of the steps are those on the other "
            f"{base.cells.manoeuvres}: `compare`, which uses all, differs somewhat"
        )
    left_before = out_of_range(found.before)
    observable, unit = observed(after)
    return Ladder(
        observable=observable,
        unit=unit,
        steps=tuple(replace(step, step=number) for number, step in enumerate(steps)),
        model=with_nuisances_on(after),
        verdict=verdict,
        rmse_untouched=on_locked[0],
        floor_untouched=on_locked[1],
        revolutions=int(after.cells.revolutions.sum()),
        manoeuvres=after.cells.manoeuvres,
        logs=after.cells.log_names,
        manoeuvres_locked=kept_back,
        remarks=(
            *remarks_of(found.before),
            *(() if asked.found is None else asked.found.sentences()),
            *(said for said in out_of_range(after) if said not in left_before),
            *nuisance_sentences(nuisances_found(after), after, fails=fails),
            *more,
            *untested,
        ),
    )


def _reached(first: Base, last: Base) -> str:
    """The floor, if as much of the excess is gone as a name must explain."""
    before, after = (max(b.square_held - last.floor.square, 0.0) for b in (first, last))
    return "at_the_floor" if after <= (1.0 - EXPLAINED) * before else "above_the_floor"


def _steps(found: SearchResult) -> Iterable[LadderStep]:
    """The base's row, a row for each effect that came in, and one for the first that did not."""
    last, later = found.before, [*(step.before for step in found.steps[1:]), found.after]
    yield _row(last, "base", "start", "The model as given.")
    for step, base in zip(found.steps, later, strict=True):
        if (named := step.named) is None:
            break
        others = [name for name in step.group if name != named.id]
        decision = f"added (or {', '.join(others)})" if others else "added"
        noise = probability(named.p, base.cells.manoeuvres)
        sentence = f"{named.id} added: the improvement has probability {noise} of being noise."
        yield _row(base, named.id, decision, sentence, named.p)
        last = base
    if found.dropped:
        yield _removed(found.after, found.dropped)
        last = found.after
    final = found.steps[-1]
    if final.named is None and final.assessed:
        best = final.contenders[0] if final.contenders else final.assessed[0]
        reason = "within what a different form of the others would leave"
        if found.before.cells.manoeuvres < FEWEST_MANOEUVRES:
            reason = "too few manoeuvres"
        elif not final.contenders:
            reason = "no gain"
        noise = probability(best.p, last.cells.manoeuvres)
        sentence = (
            f"An improvement by {best.id} has probability {noise} of being noise; it is not added "
            f"({reason})."
        )
        yield _row(last, best.id, f"not added: {reason}", sentence, best.p)


def _removed(base: Base, names: Sequence[str]) -> LadderStep:
    """The step on which effects went that later ones had made needless."""
    every = ", ".join(names)
    said = f"{every} removed: what came later has made it needless."
    return _row(base, every, "removed", said)


def _row(
    base: Base, effect: str, decision: str, sentence: str, p_adjusted: float | None = None
) -> LadderStep:
    """A step that ends at the base; steps are numbered once all are known."""
    held, floor = base.rmse_held, float(np.sqrt(base.floor.square))
    return LadderStep(
        step=0,
        effect=effect,
        rmse_fit=float(np.sqrt(max(base.square_fit, 0.0))),
        rmse_heldout=held,
        noise_floor=floor,
        excess_heldout=None if held is None else excess_of(held, floor),
        p_adjusted=p_adjusted,
        outcome=re.split(r" \(|:", decision)[0].replace(" ", "_"),
        decision=decision,
        sentence=sentence,
        parameters={
            name: {"value": p.value, "se": p.se, "unit": p.unit}
            for name, p in base.model.parameters.items()
            if p.free
        },
    )
