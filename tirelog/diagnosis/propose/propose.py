"""`propose`: the unknown effect written down, and its error on manoeuvres that nothing touched.

Proposal, Term, FoundFormula: what it gives, with its sentences and JSON
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from tirelog.diagnosis.answer import (
    NUISANCES_SAID,
    AnswerRecord,
    AnswerTable,
    percent,
    plain_fields,
    probability,
)
from tirelog.diagnosis.candidates.assessment import at_noise_floor, surely_gains
from tirelog.diagnosis.candidates.naming import without_needless, worth_it
from tirelog.diagnosis.candidates.nuisances import (
    allowed_nuisances,
    best_nuisance,
    groups_of,
    needed_nuisances,
    newest,
    with_nuisances,
    with_nuisances_on,
)
from tirelog.diagnosis.candidates.search import Progress, SearchResult, search_effects
from tirelog.diagnosis.compare import (
    Measured,
    locked_away,
    manoeuvres_of,
    measured_pieces,
    start,
    untouched,
)
from tirelog.diagnosis.diagnose import Diagnosis, conclude
from tirelog.diagnosis.propose.formulas import (
    Choice,
    Draft,
    choose,
    polished,
    scan,
    simplified,
    with_covering_errors,
)
from tirelog.diagnosis.propose.ground import (
    Ground,
    MeasuredShape,
    measured_shapes,
)
from tirelog.diagnosis.residual_structure import leading_shape
from tirelog.diagnosis.rules import (
    ALARM_P,
    BEYOND_DOUBT_P,
    FEWEST_MANOEUVRES,
    GAIN_SIGMAS,
    LEAST_SHARE_OF_FLOOR,
    REST_SHARE,
    SECOND_LEAST,
)
from tirelog.errors import ModelError, UsageError, or_refusal
from tirelog.inference.base import Base, refit
from tirelog.inference.cells.pieces import Pieces
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import OBSERVABLES, WAVEFORMS, shown


@dataclass(frozen=True)
class FoundFormula:
    """One way to write a term.

    `expression` and `acts_on` as in a model file, `words` and `law` to read ("1": always the same),
    `left` the mean square error [unit^2] held out with it.
    """

    expression: str
    acts_on: str
    words: str
    law: str
    left: float

    @property
    def said(self) -> str:
        law = "always the same" if self.law == "1" else f"growing as {self.law}"
        return f"{self.words}, {law}, acting on {self.acts_on}"


@dataclass(frozen=True)
class Term:
    """One proposed effect.

    `name` in the model, its `formula`, and those `as_good`, simplest first;
    `numbers`: value, se, unit by name; `p` over the `tried` forms of the whole grammar.
    """

    name: str
    formula: FoundFormula
    as_good: tuple[FoundFormula, ...]
    numbers: Mapping[str, Mapping[str, Any]]
    p: float
    tried: int

    @property
    def stages(self) -> tuple[str, ...]:
        """Where it acts; several if these data cannot tell."""
        return tuple(dict.fromkeys(one.acts_on for one in (self.formula, *self.as_good)))

    def sentences(self, manoeuvres: int) -> list[str]:
        """How surely it is one, where it may act, and what else does as well."""
        p = probability(self.p, manoeuvres)
        said = [f"probability {p} of being chance over {self.tried} forms"]
        if len(self.stages) > 1:
            said.append(f"it acts on {' or '.join(self.stages)}; these data cannot tell which")
        if self.as_good:
            said.append(f"as good held out: {'; '.join(one.expression for one in self.as_good)}")
        return [f"{self.name}: {sentence}." for sentence in said]

    def to_json(self) -> dict[str, Any]:
        own = {"name": self.name, "stages": self.stages, "parameters": self.numbers}
        good = {"p": self.p, "tried": self.tried, "as_good": self.as_good}
        return plain_fields(own | vars(self.formula) | good)


@dataclass(frozen=True, repr=False)
class Proposal(AnswerRecord):
    """What is unknown, written down; or why there is nothing to propose.

    status      "formula", "shape" (a measured shape in its place) or "nothing"
    reason      why there is nothing to propose; empty otherwise
    terms       the formulas, each beside those before it
    shapes      measured shapes, the best first: what one form in that frame can remove at most
    written     names of the effects that `model` has more than the model that was asked about
    model       with them, fitted on the manoeuvres that were seen; None without a proposal
    locked      errors without and with it on the manoeuvres reserved for the end, the floor
                there, and the share of the excess that is removed
    rmse_heldout_before, rmse_heldout_after, noise_floor  on the manoeuvres that were seen
    nearest     effects of the catalogue and the share of the excess that each removes
    asked       the measured shape was asked for: formulas may do as well
    leading_before, leading_after  (m,) the leading shape of what is left, at `phi_rad` (m,)
    """

    picture = "propose_figure"
    panel = "shape"
    apart = ("model", "diagnosis", "phi_rad", "leading_before", "leading_after", "asked")
    also = ("sentence", "unit", "verdict")

    status: str
    reason: str
    observable: str
    manoeuvres: int
    diagnosis: Diagnosis | None = None
    terms: tuple[Term, ...] = ()
    shapes: tuple[MeasuredShape, ...] = ()
    written: tuple[str, ...] = ()
    model: Model | None = None
    locked: Mapping[str, Any] | None = None
    rmse_heldout_before: float | None = None
    rmse_heldout_after: float | None = None
    noise_floor: float | None = None
    nearest: tuple[Mapping[str, Any], ...] = ()
    phi_rad: FloatArray = field(default_factory=partial(np.zeros, 0))
    leading_before: FloatArray = field(default_factory=partial(np.zeros, 0))
    leading_after: FloatArray = field(default_factory=partial(np.zeros, 0))
    asked: bool = False

    @property
    def unit(self) -> str:
        return OBSERVABLES[self.observable].unit

    @property
    def verdict(self) -> str:
        return self.diagnosis.verdict if self.diagnosis else "too_few"

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        if self.status == "nothing":
            return f"Nothing to propose: {self.reason}"
        locked, (factor, unit) = self.locked, shown(self.observable, self.unit)
        what = "; and ".join(term.formula.said for term in self.terms)
        if self.status == "shape":
            law = "" if self.shapes[0].law == "1" else f", times {self.shapes[0].law}"
            why = "" if self.asked else ", since no formula does as well"
            what = f"a measured shape {self.shapes[0].words}{law}{why}"
        if locked is None:
            return f"Proposed: {what}."
        return (
            f"Proposed: {what}. On {locked['manoeuvres']} manoeuvres reserved for the end it "
            f"removes {percent(locked['share_removed'])} of the excess: "
            f"{locked['rmse_before'] * factor:.3g} -> {locked['rmse_after'] * factor:.3g} {unit} "
            f"at a floor of {locked['noise_floor'] * factor:.3g}."
        )

    def sentences(self) -> list[str]:
        """What else a reader should know, in words."""
        if self.status == "nothing":
            return []
        said = [sentence for term in self.terms for sentence in term.sentences(self.manoeuvres)]
        before, floor = self.rmse_heldout_before, self.noise_floor
        excess = 0.0 if before is None or floor is None else before**2 - floor**2
        best = self.shapes[0] if self.shapes else None
        if best is not None and excess > 0.0 and best.gain > GAIN_SIGMAS:
            said.append(
                f"A free shape {best.words}, times {best.law}, removes "
                f"{percent(min(best.removed / excess, 1.0))} of the excess held out: no single "
                "form in that frame removes more."
            )
        if self.nearest:
            near = ", ".join(f"{n['effect']} {percent(n['excess_removed'])}" for n in self.nearest)
            said.append(f"Nearest effects of the catalogue: {near} of the excess.")
        return said

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        return self.sentence

    def below(self) -> tuple[list[AnswerTable], list[str]]:
        """The numbers of the formulas, if there are any; what else a reader should know."""
        return [self.terms_table()] if self.terms else [], self.sentences()

    def terms_table(self) -> AnswerTable:
        """The numbers of the formulas that are proposed."""
        rows = []
        for term in self.terms:
            words = [term.name, term.formula.acts_on, term.formula.expression]
            for name, n in term.numbers.items():
                error = "not determined" if n["se"] is None else n["se"]
                rows.append([*words, name, n["value"], error, n["unit"]])
                words = ["", "", ""]
        names = ["effect", "acts on", "expression", "number", "value", "error", "unit"]
        return AnswerTable("Numbers of the formulas", names, rows)


# ---- `propose`: the unknown effect written down, with its error on manoeuvres that nothing
# touched.


#: every so many manoeuvres one is locked away before anything is looked at; twice as rarely leaves
#: the number that is reported to two or three manoeuvres
LOCK_EVERY = 3


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
    despite   also if an effect of the catalogue explains it: the proposal takes its place
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
    if len(pieces) > 1:
        raise UsageError(
            f"a model of {' and '.join(model.observables)}",
            allowed="allowed is a model of one waveform",
            do="propose with a model of one of them, and compare the result on all",
        )
    seen, locked = locked_away(pieces, 1, LOCK_EVERY, FEWEST_MANOEUVRES)
    if not locked:
        number = int(manoeuvres_of(pieces).size)
        left = (n for n in range(1, 100) if n - len(range(1, n, LOCK_EVERY)) >= FEWEST_MANOEUVRES)
        reason = (
            f"{number} manoeuvres are too few: a third is locked away first, and a test needs "
            f"{FEWEST_MANOEUVRES} of the others. Drive {next(left)} at least."
        )
        return Proposal("nothing", reason, model.observable, number)
    progress("fitting the model")
    base = start(seen, model)
    progress(
        f"{len(base.cells)} cells of {base.cells.manoeuvres} manoeuvres seen, "
        f"{manoeuvres_of(locked).size} locked away; testing candidates"
    )
    found = search_effects(base, tuple(effects), progress)
    diagnosis = conclude(found, ())
    ground, reason = _ground(found, diagnosis, despite)
    if ground is None:
        return _nothing(reason, base, diagnosis)
    # what no free shape alone shows to repeat must be beyond doubt over the whole grammar
    alarm = BEYOND_DOUBT_P if diagnosis.verdict == "scatter" else ALARM_P
    return _proposal(_climb(ground, alarm, progress), diagnosis, locked, shape, progress)


def _nothing(
    reason: str, base: Base, diagnosis: Diagnosis, shapes: Iterable[MeasuredShape] = ()
) -> Proposal:
    """No proposal, and why."""
    return Proposal(
        "nothing",
        reason,
        base.model.observable,
        base.cells.manoeuvres,
        diagnosis,
        shapes=tuple(shapes),
        rmse_heldout_before=diagnosis.rmse_heldout_before,
        rmse_heldout_after=diagnosis.rmse_heldout_after,
        noise_floor=diagnosis.noise_floor,
    )


def _ground(found: SearchResult, diagnosis: Diagnosis, despite: bool) -> tuple[Base | None, str]:
    """The base to propose on, or why there is nothing to propose."""
    after, partial = found.after, diagnosis.verdict == "partial"
    if diagnosis.verdict in ("unknown", "scatter") or (despite and diagnosis.selected):
        return found.before, ""
    least = max(SECOND_LEAST * after.floor.square, REST_SHARE * found.before.excess)
    if partial and diagnosis.unexplained["significant"] and after.excess > least:
        return after, ""
    why = " Add it to the model, or search with --always for what these data say without it."
    if partial:
        why = " The rest is too small, or does not repeat well enough, to write down."
    return None, diagnosis.sentence + why * bool(diagnosis.selected)


@dataclass
class _Climb:
    """Terms one by one: the bases from the start upwards, what was chosen, and the shapes."""

    bases: list[Base]
    choices: list[Choice] = field(default_factory=list)
    shapes: list[MeasuredShape] = field(default_factory=list)
    p: float | None = None
    tried: int = 0
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
    # terms of a proposal at most: what needs more is better shown by its measured shape; each
    # further one has to pass the same test, so that twice as many are reached only by what repeats
    while len(climb.choices) < 3:
        at, number = climb.after, len(climb.choices) + 1
        if number > 1 and at.excess < LEAST_SHARE_OF_FLOOR * at.floor.square:
            break
        full = Ground(at)
        if number == 1:
            progress("measuring free shapes")
            climb.shapes = measured_shapes(full.few, full)
        progress(f"term {number}: trying every form of the grammar")
        atoms, p, climb.tried = scan(full.few)
        climb.p = p
        choice = None
        if p <= alarm:
            name = _free_name(base, "proposed", number)
            choice = choose(full, polished(full.few, atoms), name)
        if choice and not worth_it(at, choice.chosen.base, p, held_out_only=True):
            choice = None
        quiet = at_noise_floor(at, at.floor.square)
        rival = None if quiet else best_nuisance(at, allowed_nuisances(at))
        losses = [draft.base.held_white.sum() for draft in choice.refitted] if choice else [np.inf]
        if rival is not None and rival.held_white.sum() < min(losses):
            climb.beside.append(newest(rival, at))
            progress(f"beside the model: {climb.beside[-1]}")
            climb.bases[-1] = rival.with_scatter_estimated
            continue
        if choice is None:
            break
        chosen = simplified(replace(choice.chosen, base=choice.chosen.base.with_scatter_estimated))
        if number > 1 and at.square_held - chosen.base.square_held < REST_SHARE * first_excess:
            break
        progress(f"term {number}: {choice.chosen.atom.form.words}")
        climb.choices.append(replace(choice, chosen=chosen, p=p, tried=climb.tried))
        climb.bases.append(chosen.base)
    return _without_needless(_with_needed_nuisances(climb))


def _with_needed_nuisances(climb: _Climb) -> _Climb:
    """The climb without the nuisances that its terms have made needless."""
    after = climb.after
    needed = needed_nuisances(after) if climb.choices else groups_of(after)
    if needed == groups_of(after):
        return climb
    first, top = (with_nuisances(base, needed) for base in (climb.bases[0], after))
    if isinstance(first, ModelError) or isinstance(top, ModelError):
        return climb
    first, top = first.with_scatter_estimated, top.with_scatter_estimated
    full, last = Ground(first), climb.choices[-1]
    climb.bases, climb.shapes = [first, *climb.bases[1:-1], top], measured_shapes(full.few, full)
    climb.choices[-1] = replace(last, chosen=replace(last.chosen, base=top))
    return climb


def _free_name(base: Base, stem: str, number: int = 1) -> str:
    """The first name of that stem, or a later one, that no effect of the model has."""
    names = [f"{stem}_{i}" for i in range(1, 100)]
    held = {effect.id for effect in base.model.effects}
    return [name for name in names if name not in held][number - 1]


def _without_needless(climb: _Climb) -> _Climb:
    """The climb without terms that those after them have made needless.

    What was as good as a term was so beside those that go: it is left out then.
    """
    names = [choice.chosen.entry.id for choice in climb.choices]
    after, dropped = without_needless(climb.after, names, _matters)
    if dropped:
        climb.bases = [climb.bases[0], after.with_scatter_estimated]
        kept = [choice for choice in climb.choices if choice.chosen.entry.id not in dropped]
        chosen = [replace(choice.chosen, base=climb.after) for choice in kept]
        climb.choices = [
            replace(k, chosen=c, as_good=(c,)) for k, c in zip(kept, chosen, strict=True)
        ]
    return climb


def _matters(without: Base, base: Base) -> bool:
    """Is what a base removes of the held-out error large enough to matter?"""
    return without.square_held - base.square_held >= LEAST_SHARE_OF_FLOOR * base.floor.square


def _proposal(
    climb: _Climb,
    diagnosis: Diagnosis,
    locked: Sequence[Pieces],
    shape_wanted: bool,
    progress: Progress,
) -> Proposal:
    """What is written down in the end, and its error on the locked manoeuvres."""
    base, after = climb.bases[0], climb.after
    scattered, formula = diagnosis.verdict == "scatter", bool(climb.choices)
    by_shape = None
    if formula or not scattered:
        by_shape = _with_shape(base, climb.shapes, diagnosis.unexplained["p"])
    # share of the excess that a measured shape must remove beyond the formulas to stand in their
    # place: a reader would rather have a formula; doubled, forms outside of the grammar leave twice
    # as much
    least = max(LEAST_SHARE_OF_FLOOR * base.floor.square, 0.05 * base.excess)
    if by_shape is not None and (shape_wanted or after.square_held - by_shape.square_held > least):
        after, formula = by_shape, False
    if not formula and after is not by_shape:
        reason = diagnosis.sentence if scattered else _doubt(climb)
        return _nothing(reason, base, diagnosis, climb.shapes)
    progress("asking the manoeuvres that were locked away")
    result = _on_locked(base, after, locked)
    if isinstance(result, str):
        return _nothing(result, base, diagnosis, climb.shapes)
    own = {effect.id for effect in base.model.effects}
    written = tuple(e.id for e in after.model.effects if e.id not in own)
    covering = with_covering_errors(after, written)
    near = sorted(diagnosis.effects, key=lambda c: -c.excess_removed)[:2]
    return Proposal(
        status="formula" if formula else "shape",
        reason="",
        diagnosis=diagnosis,
        terms=tuple(_term(choice, covering) for choice in climb.choices) if formula else (),
        shapes=tuple(climb.shapes),
        written=written,
        model=with_nuisances_on(replace(after, fit=replace(after.fit, model=covering))),
        locked=result,
        observable=base.model.observable,
        rmse_heldout_before=base.rmse_held,
        rmse_heldout_after=after.rmse_held,
        noise_floor=float(np.sqrt(after.floor.square)),
        manoeuvres=base.cells.manoeuvres,
        nearest=tuple(
            {"effect": c.effect, "excess_removed": c.excess_removed}
            for c in near
            if c.excess_removed > REST_SHARE
        ),
        phi_rad=np.nanmean(base.cells.phi, axis=0),
        leading_before=leading_shape(base),
        leading_after=leading_shape(after),
        asked=shape_wanted,
    )


def _on_locked(base: Base, after: Base, locked: Sequence[Pieces]) -> dict[str, Any] | str:
    """The errors on the locked manoeuvres, or why what was found is not claimed."""
    there, before = untouched(after, locked), untouched(base, locked)
    unknown = "of the manoeuvres that were locked away nothing is known"
    if isinstance(there, ModelError):
        return f"{unknown}: {there.what}."
    if isinstance(before, ModelError):
        return f"{unknown}: {before.what}."
    square = there[1] ** 2
    excess, left = before[0] ** 2 - square, max(there[0] ** 2 - square, 0.0)
    share, number = 1.0 - left / excess if excess > 0.0 else None, manoeuvres_of(locked).size
    # what is chance removes nothing; with twice the share only what is right to the floor is named
    if share is not None and share >= 0.5:
        return {
            "manoeuvres": number, "rmse_before": before[0], "rmse_after": there[0],
            "noise_floor": there[1], "share_removed": share,
        }  # fmt: skip
    return (
        f"what was found removes {percent(max(share or 0.0, 0.0))} of the excess on the "
        f"{number} manoeuvres that were locked away, too little to be claimed."
    )


def _doubt(climb: _Climb) -> str:
    """Why nothing is proposed although something repeats."""
    if climb.beside or climb.p is None:
        names = " and ".join(NUISANCES_SAID[name] for name in climb.beside)
        return f"what repeats goes with {names or 'what is named'} beside the model."
    return (
        "something repeats, but no form of the grammar and no free shape is beyond doubt "
        f"(p = {climb.p:.2g} over {climb.tried} forms)."
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
    entered = or_refusal(base.model.with_entry)(best.entry(_free_name(base, "proposed_shape")))
    refitted = entered if isinstance(entered, ModelError) else refit(base, entered)
    return None if isinstance(refitted, ModelError) else refitted.with_scatter_estimated


def _term(choice: Choice, model: Model) -> Term:
    """A chosen formula with its numbers in the model at the top."""
    chosen = choice.chosen
    own = {p.name: model.parameters[f"{chosen.entry.id}.{p.name}"] for p in chosen.entry.parameters}
    return Term(
        name=chosen.entry.id,
        formula=_formula_of(chosen, chosen.text),
        as_good=tuple(_formula_of(draft, draft.read) for draft in choice.as_good[1:]),
        numbers={n: {"value": p.value, "se": p.se, "unit": p.unit} for n, p in own.items()},
        p=choice.p,
        tried=choice.tried,
    )


def _formula_of(draft: Draft, text: str) -> FoundFormula:
    atom, acts_on = draft.atom, str(draft.entry.source["acts_on"])
    law = atom.law.written(atom.free) or "1"
    return FoundFormula(text, acts_on, atom.form.words, law, draft.base.square_held)
