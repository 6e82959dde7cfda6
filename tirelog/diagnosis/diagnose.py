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
    ambiguous        they would be 'missing', and another effect, or a nuisance, does the same to
                     these data
    unknown          there is repeatable structure that no effect explains (under 50 %)
    too_few          fewer manoeuvres than a test needs: a ranking, no alarm
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tirelog.data.recording import Stack
from tirelog.diagnosis.candidates.beside import (
    groups_of,
    with_form_errors,
    with_nuisances_on,
)
from tirelog.diagnosis.candidates.drive_next import drive_next
from tirelog.diagnosis.candidates.naming import not_among_candidates, removed_by
from tirelog.diagnosis.candidates.nuisance_sizes import (
    NuisanceFound,
    alike_sentences,
    held_by_form,
    nuisance_sentences,
    nuisances_found,
    observed,
    scatter_sentences,
)
from tirelog.diagnosis.candidates.quiet import quiet
from tirelog.diagnosis.candidates.ranking import ranking_of
from tirelog.diagnosis.candidates.search import Found, Progress, search_effects
from tirelog.diagnosis.candidates.separation import advise
from tirelog.diagnosis.candidates.signatures import candidate_effects
from tirelog.diagnosis.compare import (
    Measured,
    comparison_of,
    measured_pieces,
    of_rounding,
    single_revolutions,
    start_from,
)
from tirelog.diagnosis.gratings.found import GratingsFound
from tirelog.diagnosis.gratings.gather import Gathered, gathered
from tirelog.diagnosis.rest.leftover import Leftover, describe
from tirelog.diagnosis.rest.scattered import scattered
from tirelog.diagnosis.results import Candidate, Comparison, plain_values
from tirelog.diagnosis.rules import (
    BEYOND_DOUBT_P,
    EXPLAINED,
    FEWEST_MANOEUVRES,
    LEAST_SHARE_OF_FLOOR,
    MOST,
    REST_SHARE,
    SECOND_LEAST,
    TOGETHER,
    Evidence,
    verdict_of,
)
from tirelog.diagnosis.trust.certainty import Certainty, Marks, certainty_of, marks_of, unlike
from tirelog.diagnosis.trust.checks import (
    Check,
    Suspect,
    check_sentences,
    posterior_checks,
    suspects,
)
from tirelog.diagnosis.trust.inclusion import Inclusion
from tirelog.diagnosis.trust.stability import Each, Stability
from tirelog.diagnosis.validity import out_of_range
from tirelog.diagnosis.wording import next_command, not_varied, sentence_of, unexplained_sentence
from tirelog.inference.base import Base, TogetherBase, apart
from tirelog.inference.cells.together import PiecesTogether, StacksTogether, model_of
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model


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
    stacks: Sequence[Stack] | StacksTogether
    gratings: GratingsFound | None = None
    inclusion: Inclusion | None = None
    stability: Stability | None = None
    each: Each | None = None

    @property
    def model(self) -> Model:
        """The model with what was selected, refitted."""
        return with_nuisances_on(self.found.after if self.selected else self.found.before)

    @cached_property
    def form_may_hold(self) -> dict[str, list[str]]:
        """Effects that a form may hold though nothing is missing, and in what logs part them."""
        return held_by_form(self.found.before) if self.verdict == "nothing_missing" else {}

    @cached_property
    def before(self) -> Comparison:
        return comparison_of(self.found.before, self.stacks)

    @cached_property
    def after(self) -> Comparison:
        return comparison_of(self.found.after, self.stacks) if self.selected else self.before

    @cached_property
    def certainty(self) -> Certainty:
        """How often a verdict like this one is right, by simulated cases."""
        why = unlike(self.found.before.model, self.selected, self.gratings is not None)
        return Certainty(None, reason=why) if why else certainty_of(self.marks)

    @cached_property
    def drive_next(self) -> tuple[Mapping[str, Any], ...]:
        """Manoeuvres by how fast they would make the verdict surer, best first."""
        return tuple(drive_next(self.found, self.verdict, self.certainty.probability))

    @cached_property
    def marks(self) -> Marks:
        """What this diagnosis knows of itself, by which like cases are found."""
        after = self.rmse_heldout_after if self.selected else self.rmse_heldout_before
        return marks_of(
            self.found,
            self.verdict,
            self.noise_floor,
            (self.rmse_heldout_before, after),
            (self.reduced_chi2_before, self.reduced_chi2_after),
        )

    def to_json(self) -> dict[str, Any]:
        apart = (
            *("effects", "notes", "found", "stacks", "nuisances", "checks", "suspects"),
            *("gratings", "inclusion", "stability", "each"),
        )
        names = [name for name in self.__dataclass_fields__ if name not in apart]
        rows = [
            {name: getattr(c, name) for name in Candidate.__dataclass_fields__}
            for c in self.effects
        ]
        told: dict[str, Any] = plain_values(
            {name: getattr(self, name) for name in names}
            | {"effects": rows, "note": " ".join(self.notes)}
            | {"certainty": self.certainty.to_json(), "drive_next": list(self.drive_next)}
            | {"nuisance_or_effect": [list(pair) for pair in self.found.alike]}
            | {"rmse_heldout_without_nuisances": (self.found.given or self.found.before).rmse_held}
            | {"nuisances": {n.nuisance: n.to_json() for n in self.nuisances}}
            | {"form_may_hold": self.form_may_hold}
            | {"checks": [asdict(c) | {"never": c.never} for c in self.checks]}
            | {"suspects": [asdict(s) for s in self.suspects]}
            | ({} if self.gratings is None else {"gratings": self.gratings.to_json()})
            | ({} if self.inclusion is None else {"inclusion": self.inclusion.to_json()})
            | ({} if self.stability is None else {"stability": self.stability.to_json()})
            | ({} if self.each is None else {"each": self.each.to_json()})
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
    pieces = measured_pieces(measured)
    stacks, gratings = single_revolutions(measured), None
    if isinstance(pieces, PiecesTogether) and pieces.places:
        gratings = gathered(pieces, model)
        base: Base = gratings.base
        whole = gratings.searched is gratings.pieces
        if isinstance(stacks, StacksTogether):
            stacks = stacks.of_channels(gratings.pieces.members) if whole else ()
    else:
        base = start_from(pieces, model)
    progress(f"{len(base.cells)} cells of {base.cells.manoeuvres} manoeuvres; testing candidates")
    found = replace(search_effects(base, extra, progress), given=base)
    progress("describing what is left")
    return conclude(found, stacks, gratings)


def conclude(
    found: Found, stacks: Sequence[Stack] | StacksTogether, asked: Gathered | None = None
) -> Diagnosis:
    """The verdict and everything that is said with it.

    `asked`: of several gratings what they had said before.
    """
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
    sure, removed, by_size = beyond_doubt(found), excess_before - excess_after, False
    if sure:
        size, by_size = removed_by(before, after, sure=True)
        removed = max(removed, size) if by_size else removed
    repeats = max(removed, 0.0) + (max(left.size, 0.0) if left.significant else 0.0)
    counted, total = excess_before, share
    if sure and repeats > 0.0 and (repeats < excess_before or by_size):
        counted, share = repeats, min(removed / repeats, 1.0)
        alone *= excess_before / repeats
        first = found.steps[0]
        if by_size and first.named is not None:
            alone = removed_by(first.before, first.named.base, sure=True)[0] / repeats
    enough = share >= MOST and (len(found.named) == 1 or alone >= MOST or share >= TOGETHER)
    or_nuisance = [
        (nuisance, effect)
        for nuisance, effect in found.alike
        if effect in found.named and nuisance not in groups_of(after)
    ]
    evidence = Evidence(
        few=few,
        named=len(found.named),
        share=share if enough else 0.0,
        rest=rest,
        alike=bool(groups or or_nuisance),
        repeats=left.significant and excess_after > LEAST_SHARE_OF_FLOOR * floor.square,
        quiet=quiet(before, floor.square),
    )
    verdict = verdict_of(evidence)
    selected = found.named if verdict in ("missing", "partial", "ambiguous") else ()
    if (
        found.named and not selected
    ):  # what was named is not claimed: all that is told is of the model as it came
        left, floor = describe(before), before.floor
        excess_after = excess_before = max(before.square_held - floor.square, 0.0)
        if max(excess_before, removed if sure else 0.0) <= LEAST_SHARE_OF_FLOOR * floor.square:
            # what alarmed is gone, once less is taken for scatter, or too small to be missing
            verdict = verdict_of(replace(evidence, named=0, repeats=False))
    if selected:
        with_errors = replace(after.fit, model=with_form_errors(after))
        found = replace(found, after=replace(after, fit=with_errors))
    ranking = ranking_of(found, selected, counted, floor.square, share)
    unexplained = _unexplained(
        left, found, ranking, excess_after, excess_before, floor.square, bool(selected)
    )
    result = after if selected else before
    beside, checks = nuisances_found(result), posterior_checks(result)
    suspected = suspects(result) if verdict in ("unknown", "scatter", "partial") else ()
    advice, notes = _advice(found, verdict)
    gratings = None
    if asked is not None and isinstance(result, TogetherBase):
        gratings = asked.with_strengths(result, selected)
        notes += gratings.sentences()
    notes += found.untested
    notes += nuisance_sentences(beside, result, fails=verdict in ("unknown", "partial"))
    notes += scatter_sentences(result)
    stayed = [n.nuisance for n in beside if n.stayed]
    notes += alike_sentences(found.alike, selected, stayed, result)
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
    if verdict in ("unknown", "partial"):
        reasons |= not_among_candidates(result)
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
        "observable": observed(before)[0],
        "unit": observed(before)[1],
        "chi2": before.reduced_chi2,
        "beside": tuple(stayed),
        "groups": groups,
        "or_nuisance": or_nuisance,
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
            logs=before.cells.log_names,
            large_rest=verdict == "partial"
            and left.significant
            and excess_after > SECOND_LEAST * floor.square,
            beside=[
                n.name
                for n in before.model.nuisances
                if n.name in groups_of(result) and n.use != "on"
            ],
            grating=gratings.asked[0] if gratings is not None else "",
        ),
        found=found,
        stacks=stacks,
        gratings=gratings,
    )


def beyond_doubt(found: Found) -> bool:
    """Is every name so significant that a rest that does not repeat cannot make it doubtful?"""
    named = [step.named for step in found.steps if step.named is not None]
    return bool(named) and all(r.assessed.p <= BEYOND_DOUBT_P for r in named)


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
        "in_time": left.in_time,
        "nearest_effect": nearest.effect if nearest and not selected else None,
        "nearest_share": nearest.excess_removed if nearest and not selected else None,
    }
    if left.observable is not None:  # of several that are fitted together
        facts |= {"observable": left.observable, "contradicts": left.contradicts}
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
        step = next((s for s in found.steps if s.named is not None and s.group), step)
        rivals = [(r.id, r.base.model) for r in step.contenders if r.id in step.group]
    else:
        return [], notes
    if len(rivals) < 2:
        return [], notes
    before = step.before
    if isinstance(before, TogetherBase):  # the list is searched in the first waveform
        before = max(apart(before), key=lambda part: part.cells.phi.shape[1])
        seen, member = before.cells.observable, before.cells.member
        rivals = [(name, model_of(model, seen, member)) for name, model in rivals]
    rows, more = advise(before, rivals)
    return rows, notes + more
