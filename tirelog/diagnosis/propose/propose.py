"""`propose`: the unknown effect written down, with its error on manoeuvres that nothing touched."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from tirelog.diagnosis.candidates.assessment import surely_gains
from tirelog.diagnosis.candidates.at_noise_floor import at_noise_floor
from tirelog.diagnosis.candidates.naming import worth_it
from tirelog.diagnosis.candidates.nuisance_selection import (
    allowed_nuisances,
    best_nuisance,
    groups_of,
    needed_nuisances,
    with_nuisances,
    with_nuisances_on,
)
from tirelog.diagnosis.candidates.search import Progress, SearchResult, search_effects
from tirelog.diagnosis.candidates.separation import advise, by_the_minute
from tirelog.diagnosis.compare import Measured, measured_pieces, start
from tirelog.diagnosis.diagnose import Diagnosis, conclude
from tirelog.diagnosis.holdout import locked_away, untouched
from tirelog.diagnosis.propose.formulas import (
    Choice,
    Draft,
    Scanned,
    choose,
    numbers_of,
    polished,
    scan,
    simplified,
    with_covering_errors,
)
from tirelog.diagnosis.propose.ground import FEW_CELLS, Ground
from tirelog.diagnosis.propose.measured_shapes import (
    MeasuredShape,
    measured_shapes,
    without_twins,
)
from tirelog.diagnosis.propose.results import FoundFormula, HoldoutErrors, Proposal, Term
from tirelog.diagnosis.residual_structure import leading_shape
from tirelog.diagnosis.rules import (
    ALARM_P,
    BEYOND_DOUBT_P,
    FEWEST_MANOEUVRES,
    LEAST_SHARE_OF_FLOOR,
    REST_SHARE,
    SECOND_LEAST,
)
from tirelog.diagnosis.wording import NUISANCES_SAID, percent
from tirelog.errors import ModelError, UsageError, or_refusal
from tirelog.inference.base import (
    Base,
    change_to,
    refit,
    refit_without,
    with_fewer_cells,
    with_scatter_estimated,
)
from tirelog.inference.cells.joint import JointPieces
from tirelog.inference.cells.pieces import Pieces
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model
from tirelog.vocabulary.observables import OBSERVABLES, WAVEFORMS

#: every so many manoeuvres one is locked away before anything is looked at; twice as rarely leaves
#: the number that is said to two or three manoeuvres
LOCK_EVERY = 3
#: terms of a proposal at most: what needs more is better told by its measured shape; each further
#: one has to pass the same test, so that twice as many are reached only by what repeats
MOST_TERMS = 3
#: share of the excess that a measured shape must remove beyond the formulas to stand in their
#: place: a reader would rather have a formula; doubled, forms outside of the grammar leave twice as
#: much
_SHAPE_MORE = 0.05
#: squared floors from which on what a term adds is plainly needed, and no refit without it asked
#: for; half of it would ask of each, at a second each
_PLAINLY = 1.0
#: share of the excess on the locked manoeuvres that a proposal must remove, or it is not made:
#: what is chance removes nothing; doubled, only what is right to the floor would be said
_CONFIRMED = 0.5


def propose(
    measured: Measured,
    model: Model,
    *,
    effects: Iterable[Effect] = (),
    despite: bool = False,
    shape: bool = False,
    progress: Progress = lambda text: None,
) -> Proposal:
    """The unknown effect written down, or why there is nothing to propose.

    effects   the user's own candidates, as for `diagnose`
    despite   also if an effect of the catalogue explains it: the proposal stands in its place
    shape     a measured shape in any case, in place of formulas
    UsageError: the model predicts a number per revolution, in which no shape is seen, or several
    observables at once.
    """
    if model.observable not in WAVEFORMS:
        raise UsageError(
            f"a model of {model.observable} gives one number per revolution, which has no shape",
            allowed=f"a model of {' or '.join(WAVEFORMS)} is allowed",
            do="take one; for numbers `tirelog diagnose` tells what they follow",
        )
    pieces = measured_pieces(measured)
    if isinstance(pieces, JointPieces):
        raise UsageError(
            f"a model of {' and '.join(model.observables)}",
            allowed="allowed is a model of one waveform",
            do="propose with a model of one of them, and compare the result on all",
        )
    seen, locked = locked_away(pieces, 1, LOCK_EVERY, FEWEST_MANOEUVRES)
    if locked is None:
        return _nothing(model, _too_few(pieces), int(np.unique(pieces.manoeuvre).size))
    progress("fitting the model")
    base = start(seen, model)
    progress(
        f"{len(base.cells)} cells of {base.cells.manoeuvres} manoeuvres seen, "
        f"{np.unique(locked.manoeuvre).size} locked away; testing candidates"
    )
    found = search_effects(base, tuple(effects), progress)
    diagnosis = conclude(found, ())
    ground, reason = _ground(found, diagnosis, despite)
    if ground is None:
        return _nothing(model, reason, base.cells.manoeuvres, diagnosis)
    # what no free shape alone shows to repeat must be beyond doubt over the whole grammar
    alarm = BEYOND_DOUBT_P if diagnosis.verdict == "scatter" else ALARM_P
    climb = _climb(ground, alarm, progress)
    return _proposal(climb, diagnosis, locked, shape, progress)


def _too_few(pieces: Pieces) -> str:
    number = int(np.unique(pieces.manoeuvre).size)
    needed = next(n for n in range(1, 100) if n - len(range(1, n, LOCK_EVERY)) >= FEWEST_MANOEUVRES)
    return (
        f"{number} manoeuvres are too few: a third is locked away before anything is looked at, "
        f"and a test needs {FEWEST_MANOEUVRES} of the others; drive {needed} at least."
    )


def _ground(found: SearchResult, diagnosis: Diagnosis, despite: bool) -> tuple[Base | None, str]:
    """The base to propose on, or why there is nothing to propose."""
    verdict = diagnosis.verdict
    if verdict in ("unknown", "scatter") or (despite and diagnosis.selected):
        return found.before, ""
    if verdict == "partial":
        after, before = found.after, found.before
        if (
            diagnosis.unexplained["significant"]
            and after.excess > SECOND_LEAST * after.floor.square
            and after.excess > REST_SHARE * before.excess
        ):
            return after, ""
        return None, (
            f"{diagnosis.sentence} The rest is too small, or does not repeat well enough, to "
            "write down."
        )
    if diagnosis.selected:
        return None, (
            f"{diagnosis.sentence} Add it to the model, or give --despite to have what these data "
            "would say without it."
        )
    return None, diagnosis.sentence


@dataclass
class _Climb:
    """Terms one by one: the bases from the start upwards, what was chosen, and the shapes."""

    bases: list[Base]
    choices: list[Choice] = field(default_factory=list)
    scans: list[Scanned] = field(default_factory=list)
    shapes: list[MeasuredShape] = field(default_factory=list)
    last: Scanned | None = None
    beside: list[str] = field(default_factory=list)

    @property
    def after(self) -> Base:
        return self.bases[-1]


def _climb(base: Base, alarm: float, progress: Progress) -> _Climb:
    """Terms until nothing of size is left, or none is worth it.

    As in the search for names, a nuisance that leaves less than the best form comes in before it.
    """
    climb = _Climb([base])
    first_excess = max(base.excess, 1e-300)
    while len(climb.choices) < MOST_TERMS:
        at, number = climb.after, len(climb.choices) + 1
        if number > 1 and at.excess < LEAST_SHARE_OF_FLOOR * at.floor.square:
            break
        full = Ground(at)
        few = full if len(at.cells) <= FEW_CELLS else Ground(with_fewer_cells(at, FEW_CELLS))
        if number == 1:
            progress("measuring free shapes")
            climb.shapes = _shapes(full, few)
        progress(f"term {number}: trying every form of the grammar")
        scanned = scan(few)
        choice = None
        if scanned.p <= alarm:
            choice = choose(full, polished(few, scanned.atoms), _free_name(base, number))
            if choice and not worth_it(at, choice.chosen.base, scanned.p, held_out_only=True):
                choice = None
        rival = (
            None
            if at_noise_floor(at, at.floor.square)
            else best_nuisance(at, allowed_nuisances(at))
        )
        if rival is not None and (choice is None or _leaves_less(rival, choice)):
            progress(f"beside the model: {groups_of(rival)[-1]}")
            climb.bases[-1] = with_scatter_estimated(rival)
            climb.beside.append(groups_of(rival)[-1])
            continue
        if choice is None:
            climb.last = scanned
            break
        chosen = simplified(replace(choice.chosen, base=with_scatter_estimated(choice.chosen.base)))
        new = chosen.base
        if number > 1 and at.square_held - new.square_held < REST_SHARE * first_excess:
            break
        progress(f"term {number}: {choice.chosen.atom.form.words}")
        climb.scans.append(scanned)
        climb.choices.append(replace(choice, chosen=chosen))
        climb.bases.append(new)
    return _without_needless(_with_needed_nuisances(climb))


def _shapes(full: Ground, few: Ground) -> list[MeasuredShape]:
    return without_twins(measured_shapes(few, full))


def _with_needed_nuisances(climb: _Climb) -> _Climb:
    """The climb without the nuisances that its terms have made needless."""
    after = climb.after
    needed = needed_nuisances(after) if climb.choices else groups_of(after)
    if needed == groups_of(after):
        return climb
    first, top = (with_nuisances(base, needed) for base in (climb.bases[0], after))
    if isinstance(first, ModelError) or isinstance(top, ModelError):
        return climb
    first, top = with_scatter_estimated(first), with_scatter_estimated(top)
    full = Ground(first)
    few = full if len(first.cells) <= FEW_CELLS else Ground(with_fewer_cells(first, FEW_CELLS))
    climb.bases, climb.shapes = [first, *climb.bases[1:-1], top], _shapes(full, few)
    last = climb.choices[-1]
    climb.choices[-1] = replace(last, chosen=replace(last.chosen, base=top))
    return climb


def _leaves_less(rival: Base, choice: Choice) -> bool:
    """Does a nuisance leave less held out than the best form?"""
    best = min(float(draft.base.held_white.sum()) for draft in choice.refitted)
    return float(rival.held_white.sum()) < best


def _free_name(base: Base, number: int) -> str:
    """The name of a term that no effect of the model has."""
    held = {effect.id for effect in base.model.effects}
    free = (name for i in range(1, 100) if (name := f"proposed_{i}") not in held)
    return next(name for i, name in enumerate(free, start=1) if i == number)


def _without_needless(climb: _Climb) -> _Climb:
    """The climb without terms that those after them have made needless, numbered anew.

    What was as good as a term was so beside those that go: it is not said then.
    """
    after = climb.after
    names = [choice.chosen.entry.id for choice in climb.choices]
    needed = list(names)
    for name in names[:-1]:
        if _share(after, name) > _PLAINLY:
            continue
        less = refit_without(after, name)
        least = LEAST_SHARE_OF_FLOOR * after.floor.square
        if not isinstance(less, ModelError) and less.square_held - after.square_held < least:
            after = less
            needed.remove(name)
    if needed == names:
        return climb
    model = after.model
    entries = {entry.id: entry for entry in model.effects}
    model = model.without_effect(*needed)
    kept = [i for i, name in enumerate(names) if name in needed]
    renamed = []
    for new, i in zip(names, kept, strict=False):
        old = entries[names[i]]
        renamed.append(replace(old, effect=replace(old.effect, id=new)))
        model = model.with_entry(renamed[-1])
    again = refit(after, model)
    if isinstance(again, ModelError):
        return climb
    top = with_scatter_estimated(again)
    climb.scans = [climb.scans[i] for i in kept]
    choices = []
    for entry, i in zip(renamed, kept, strict=True):
        chosen = replace(climb.choices[i].chosen, entry=entry, base=top)
        choices.append(replace(climb.choices[i], chosen=chosen, as_good=(chosen,)))
    climb.choices, climb.bases = choices, [climb.bases[0], top]
    return climb


def _share(base: Base, name: str) -> float:
    """What an effect adds to the waveforms, in squared floors; infinite if it has to stay."""
    lost = change_to(base, base.model.without_effect(name))
    if isinstance(lost, ModelError):
        return float("inf")
    added = base.plain(np.nan_to_num(lost))
    return float((added**2).sum()) / base.plain.weight / base.floor.square


def _proposal(
    climb: _Climb,
    diagnosis: Diagnosis,
    locked: Pieces,
    shape_wanted: bool,
    progress: Progress,
) -> Proposal:
    """What is written down in the end, and its error on the locked manoeuvres."""
    base, after = climb.bases[0], climb.after
    status = "formula" if climb.choices else "nothing"
    repeats = diagnosis.verdict != "scatter" or climb.choices
    p = diagnosis.unexplained["p"]
    by_shape = _with_shape(base, climb.shapes, p) if repeats else None
    if by_shape is not None:
        more = after.square_held - by_shape.square_held
        if shape_wanted or more > max(
            LEAST_SHARE_OF_FLOOR * base.floor.square, _SHAPE_MORE * base.excess
        ):
            after, status = by_shape, "shape"
    if status == "nothing" and diagnosis.verdict == "scatter":
        return _nothing(
            base.model, diagnosis.sentence, base.cells.manoeuvres, diagnosis, climb.shapes
        )
    if status == "nothing":
        return _nothing(base.model, _doubt(climb), base.cells.manoeuvres, diagnosis, climb.shapes)
    progress("asking the manoeuvres that were locked away")
    number = int(np.unique(locked.manoeuvre).size)
    before_there, after_there = untouched(base, locked), untouched(after, locked)
    result, doubt = None, ""
    for there in (before_there, after_there):
        if isinstance(there, ModelError):
            doubt = f"of the manoeuvres that were locked away nothing is known: {there.what}."
    if not isinstance(before_there, ModelError) and not isinstance(after_there, ModelError):
        result = HoldoutErrors(number, before_there[0], *after_there)
        if result.share is None or result.share < _CONFIRMED:
            held = percent(max(result.share or 0.0, 0.0))
            doubt = (
                f"what was found removes {held} of the excess on the {number} manoeuvres that were "
                "locked away, too little to be claimed."
            )
    if doubt:
        return _nothing(base.model, doubt, base.cells.manoeuvres, diagnosis, climb.shapes)
    own = {effect.id for effect in base.model.effects}
    written = tuple(e.id for e in after.model.effects if e.id not in own)
    covering = with_covering_errors(after, written)
    terms = tuple(_terms(climb, covering)) if status == "formula" else ()
    rows, notes = _advice(climb) if status == "formula" else ([], [])
    near = sorted(diagnosis.effects, key=lambda c: -c.excess_removed)[:2]
    return Proposal(
        status=status,
        reason="",
        diagnosis=diagnosis,
        terms=terms,
        shapes=tuple(climb.shapes),
        written=written,
        model=with_nuisances_on(replace(after, fit=replace(after.fit, model=covering))),
        locked=result,
        observable=base.model.observable,
        unit=OBSERVABLES[base.model.observable].unit,
        rmse_heldout_before=base.rmse_held,
        rmse_heldout_after=after.rmse_held,
        noise_floor=float(np.sqrt(after.floor.square)),
        manoeuvres=base.cells.manoeuvres,
        nearest=tuple((c.effect, c.excess_removed) for c in near if c.excess_removed > REST_SHARE),
        separating_manoeuvres=tuple(rows),
        notes=tuple(notes),
        phi_rad=np.nanmean(base.cells.phi, axis=0),
        leading_before=leading_shape(base),
        leading_after=leading_shape(after),
        asked=shape_wanted,
    )


def _doubt(climb: _Climb) -> str:
    """Why nothing is proposed although something repeats."""
    if climb.beside or climb.last is None:
        names = " and ".join(NUISANCES_SAID[name] for name in climb.beside)
        return f"what repeats goes with {names or 'what is named'} beside the model."
    return (
        "something repeats, but no form of the grammar and no free shape is beyond doubt "
        f"(p = {climb.last.p:.2g} over {climb.last.tried} forms)."
    )


def _with_shape(base: Base, shapes: list[MeasuredShape], p: float) -> Base | None:
    """The base with the best measured shape; None if it is not beyond doubt.

    `p`: by what chance a free shape takes as much.
    """
    if not shapes:
        return None
    best = shapes[0]
    surely = surely_gains(best.gain, 1.0, p, base.share(best.removed))
    if not surely or best.removed < LEAST_SHARE_OF_FLOOR * base.floor.square:
        return None
    entered = or_refusal(base.model.with_entry)(best.entry(_shape_name(base)))
    refitted = entered if isinstance(entered, ModelError) else refit(base, entered)
    return None if isinstance(refitted, ModelError) else with_scatter_estimated(refitted)


def _shape_name(base: Base) -> str:
    held = {effect.id for effect in base.model.effects}
    return next(n for i in range(1, 100) if (n := f"proposed_shape_{i}") not in held)


def _terms(climb: _Climb, model: Model) -> Iterable[Term]:
    """The chosen formulas with their numbers in the model at the top."""
    for choice, scanned in zip(climb.choices, climb.scans, strict=False):
        yield Term(
            name=choice.chosen.entry.id,
            formula=_formula_of(choice.chosen, choice.chosen.text),
            as_good=tuple(_formula_of(draft, draft.read) for draft in choice.as_good[1:]),
            numbers=numbers_of(choice.chosen.entry, model),
            p=scanned.p,
            tried=scanned.tried,
        )


def _formula_of(draft: Draft, text: str) -> FoundFormula:
    free = [name for name in draft.atom.law.numbers if name not in draft.atom.fixed]
    return FoundFormula(
        text,
        draft.acts_on,
        draft.atom.form.words,
        draft.atom.law.written(free) or "1",
        draft.base.square_held,
    )


def _advice(climb: _Climb) -> tuple[list[dict[str, object]], list[str]]:
    """What to drive so that formulas that are as good part: of the first term that has such."""
    for choice, base in zip(climb.choices, climb.bases, strict=False):
        if len(choice.as_good) > 1:
            rivals = [(draft.read, draft.base.model) for draft in choice.as_good[:2]]
            rows, notes = advise(base, rivals)
            return [by_the_minute(rows)[0]] if rows else [], notes
    return [], []


def _nothing(
    model: Model,
    reason: str,
    manoeuvres: int,
    diagnosis: Diagnosis | None = None,
    shapes: Iterable[MeasuredShape] = (),
) -> Proposal:
    """No proposal, and why."""
    empty = np.zeros(0)
    return Proposal(
        "nothing", reason, diagnosis, (), tuple(shapes), (), None, None, model.observable,
        OBSERVABLES[model.observable].unit,
        None if diagnosis is None else diagnosis.rmse_heldout_before,
        None if diagnosis is None else diagnosis.rmse_heldout_after,
        None if diagnosis is None else diagnosis.noise_floor,
        manoeuvres, (), (), (), empty, empty, empty,
    )  # fmt: skip
