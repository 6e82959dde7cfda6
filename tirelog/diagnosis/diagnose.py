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

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np

from tirelog.diagnosis.answer import (
    NUISANCES_SAID,
    PICTURES,
    AnswerRecord,
    AnswerTable,
    in_unit,
    next_command,
    not_varied,
    percent,
    plain_fields,
    probability,
    record_fields,
    sentence_of,
    separation_sentence,
    strengths,
    unexplained_sentence,
)
from tirelog.diagnosis.candidates.assessment import at_noise_floor, candidate_effects, out_of_range
from tirelog.diagnosis.candidates.naming import not_among_candidates, removed_by
from tirelog.diagnosis.candidates.nuisances import (
    NuisanceFound,
    alike_sentences,
    explained_by_nuisances,
    groups_of,
    held_by_form,
    held_sentences,
    nuisance_sentences,
    nuisances_found,
    observed,
    scatter_sentences,
    with_form_errors,
    with_nuisances_on,
)
from tirelog.diagnosis.candidates.search import (
    Progress,
    SearchResult,
    ranking_of,
    removed_errors,
    search_effects,
)
from tirelog.diagnosis.candidates.separation import advise, drive_next, drive_sentences
from tirelog.diagnosis.certainty import (
    NO_VERDICT,
    SURENESS,
    Certainty,
    certainty_of,
    stability,
    unlike_cases,
)
from tirelog.diagnosis.compare import (
    Measured,
    Revolutions,
    comparison_of,
    measured_pieces,
    of_rounding,
    remarks_of,
    single_revolutions,
)
from tirelog.diagnosis.gratings import Gathered, GratingsFound, gathered
from tirelog.diagnosis.residual_structure import (
    Leftover,
    describe,
    scattered,
    suspect_sentence,
    suspects,
)
from tirelog.diagnosis.results import Candidate, Comparison
from tirelog.diagnosis.rules import (
    BEYOND_DOUBT_P,
    CLAIMING,
    EXPLAINED,
    FEWEST_MANOEUVRES,
    LEAST_SHARE_OF_FLOOR,
    MOST,
    REST_SHARE,
    SECOND_LEAST,
    TOGETHER,
    verdict_of,
)
from tirelog.errors import TirelogError, UsageError
from tirelog.inference.cells.cells import one_drive
from tirelog.inference.cells.pieces import Pieces
from tirelog.inference.stacks.cut import outlines
from tirelog.physics.carcass.numbers import steady_carcass
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model
from tirelog.vocabulary.observables import shown


@dataclass(frozen=True, repr=False)
class Diagnosis(AnswerRecord):
    """The answer to "which effect is missing" (contract, Diagnosis).

    `before` and `after`: the model as it was given and with what was selected.
    """

    picture = "diagnose_figure"
    panel = "ranking"
    apart = ("notes", "found", "stacks", "nuisances")
    also = ("certainty", "drive_next", "form_may_hold")

    verdict: str
    sentence: str
    selected: tuple[str, ...]
    effects: tuple[Candidate, ...]
    ambiguous_groups: tuple[tuple[str, ...], ...]
    separating_manoeuvres: tuple[Mapping[str, Any], ...]
    unexplained: Mapping[str, Any]
    nuisances: tuple[NuisanceFound, ...]
    suspects: tuple[Mapping[str, Any], ...]
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
    found: SearchResult
    stacks: Revolutions
    gratings: GratingsFound | None = None
    stability: Mapping[str, Any] | None = None

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
        """How many simulated cases with such a verdict were right."""
        model = self.found.before.model
        why = unlike_cases(model, self.selected, self.gratings is not None)
        if why:
            return Certainty(None, reason=why)
        return certainty_of(self.verdict, steady_carcass(model.carcass), self.manoeuvres)

    @cached_property
    def drive_next(self) -> tuple[Mapping[str, Any], ...]:
        """Manoeuvres by how fast they would make the verdict surer, best first."""
        return tuple(drive_next(self.found, self.verdict, self.certainty.probability))

    def to_json(self) -> dict[str, Any]:
        later, found = ("gratings", "stability"), self.found
        more = {
            "note": " ".join(self.notes),
            "rmse_heldout_without_nuisances": (found.given or found.before).rmse_held,
            "nuisance_or_effect": found.alike,
            "nuisances": {n.nuisance: n for n in self.nuisances},
            "remarks": remarks_of(found.before),
        }
        fields = record_fields(self) | plain_fields(more)
        return {n: value for n, value in fields.items() if value is not None or n not in later}

    def rows(self) -> list[dict[str, Any]]:
        """The ranking, a row per effect."""
        names = ("effect", "rank", "excess_removed", "p_adjusted", "selected")
        return [
            {name: getattr(c, name) for name in names} | {"group": ";".join(c.group)}
            for c in self.effects
        ]

    def draw(self, path: Path) -> list[Path]:
        """The pictures as files: the verdict's at `path`, those of further observables beside it.

        The latter come back.
        """
        beside: list[Path] = resolve_name(f"{PICTURES}:draw_diagnose")(self, path)
        return beside

    @property
    def headline(self) -> str:
        """The verdict in one sentence."""
        return self.sentence

    def below(self) -> tuple[list[AnswerTable], list[str]]:
        """The ranking; how sure, the errors, notes, and what to do next."""
        said = [self.certainty.sentence, self.errors_sentence(), *self.further_sentences()]
        return [self.ranking_table()], [*said, *remarks_of(self.found.before)]

    def ranking_table(self, most: int | None = None) -> AnswerTable:
        """The candidates by what they remove, the selected with a star; `most` strengths each."""
        errors = removed_errors(self.found)
        rows = [
            [
                ("* " if c.selected else "  ") + c.effect,
                percent(c.excess_removed),
                100.0 * errors[c.effect] if c.effect in errors else None,
                probability(c.p_adjusted, self.manoeuvres),
                strengths(c.strengths, most),
            ]
            for c in self.effects
        ]
        names = ["  effect", "excess removed", "standard error [%]", "p", "strength"]
        return AnswerTable("Ranking of the candidates", names, rows)

    def errors_sentence(self) -> str:
        """Errors before and after, the floor, and how much was measured."""
        base, given = self.found.before, self.found.given
        factor, unit = shown(*observed(base))
        errors = [in_unit(e, factor) for e in (self.rmse_heldout_before, self.rmse_heldout_after)]
        error = f"held-out error {' -> '.join(errors)} {unit}"
        if self.rmse_heldout_before is None:
            fitted = float(np.sqrt(max(base.square_fit, 0.0)))
            error = f"error of the fit {in_unit(fitted, factor)} {unit}, none held out"
        elif given is not None and self.found.came_in:
            named = " and ".join(NUISANCES_SAID[name] for name in self.found.came_in)
            error += f" (both with {named}; {in_unit(given.rmse_held, factor)} without)"
        return (
            f"{error}, noise floor {self.noise_floor * factor:.3g}; {self.revolutions} "
            f"revolutions, {self.manoeuvres} manoeuvres"
        )

    def further_sentences(self) -> list[str]:
        """What a diagnosis says beside its verdict and ranking, and what to do next."""
        return [
            *([SURENESS] if self.stability is not None else []),
            *(
                f"not separated by these logs: {', '.join(group)}"
                for group in self.ambiguous_groups
            ),
            *map(separation_sentence, self.separating_manoeuvres),
            *drive_sentences(self.drive_next),
            *self.notes,
            *held_sentences(self.form_may_hold),
            str(self.unexplained["sentence"]),
            *([self.after.agreement] if self.after.agreement else []),
            *(f"not tested: {effect}: {reason}" for effect, reason in self.not_tested.items()),
            f"next: {self.next_command}",
        ]


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
    asked = gathered(measured_pieces(measured), model)
    base, members = asked.base, [part.member for part in asked.pieces]
    whole = asked.searched is asked.pieces
    stacks = [
        own for own in single_revolutions(measured) if whole and outlines(own)[0].member in members
    ]
    progress(f"{len(base.cells)} cells of {base.cells.manoeuvres} manoeuvres; testing candidates")
    found = replace(search_effects(base, extra, progress), given=base)
    progress("describing what is left")
    return conclude(found, stacks, asked)


def conclude(found: SearchResult, stacks: Revolutions, asked: Gathered | None = None) -> Diagnosis:
    """The verdict and all that goes with it; `asked`: what the search was asked of."""
    decision, before = decide(found), found.before
    verdict, selected, floor = (decision[name] for name in ("verdict", "selected", "floor"))
    if selected:
        fit = replace(found.after.fit, model=with_form_errors(found.after))
        found = replace(found, after=replace(found.after, fit=fit))
    result = found.after if selected else before
    unnamed, manoeuvres = verdict in ("unknown", "partial"), before.cells.manoeuvres
    ranking = ranking_of(found, selected, decision["repeats"], floor, decision["share"])
    scatter = scattered(before, floor) if verdict == "scatter" else None
    unexplained = _unexplained(decision, ranking, manoeuvres) | {"scatter": scatter}
    beside = nuisances_found(result)
    suspected = suspects(result) if unnamed or scatter else ()
    advice, notes = _advice(found, verdict)
    gratings = None if asked is None else asked.beside(result, selected)
    notes += [] if gratings is None else gratings.sentences()
    stayed = tuple(n.nuisance for n in beside if n.stayed)
    left_before = out_of_range(before)
    notes += [
        *found.untested,
        *nuisance_sentences(beside, result, fails=unnamed),
        *scatter_sentences(result),
        *alike_sentences(found.alike, selected, stayed, result),
        *of_rounding(before),
        not_varied(before.cells.conditions, candidate_effects(before.model)),
        *(f"{said}." for said in out_of_range(result) if said not in left_before),
    ]
    taken = explained_by_nuisances(beside, found.given or before, before, found.came_in)
    few, ranked = manoeuvres < FEWEST_MANOEUVRES, {c.effect for c in ranking}
    large = decision["left"].significant and decision["excess_after"] > SECOND_LEAST * floor
    uses = {nuisance.name: nuisance.use for nuisance in before.model.nuisances}
    groups = tuple(s.group for s in found.steps if few and s.group)
    observable, unit = observed(before)
    facts = decision | {
        "observable": observable,
        "unit": unit,
        "shares": {c.effect: c.excess_removed for c in ranking},
        "enough": MOST,
        "explained": EXPLAINED,
        "unestablished": [r.id for r in found.steps[0].contenders if not r.established],
        "chi2": before.reduced_chi2,
        "manoeuvres": manoeuvres,
        "before": before.square_held,
        "after": found.after.square_held,
        "suspects": tuple(map(suspect_sentence, suspected[:3])),
        "beside": stayed,
        "taken": taken,
        "scatter": scatter,
        "unexplained": unexplained,
    }
    return Diagnosis(
        verdict=verdict,
        sentence=sentence_of(facts),
        selected=selected,
        effects=ranking,
        ambiguous_groups=decision["groups"] if selected else groups,
        separating_manoeuvres=tuple(advice),
        unexplained=unexplained,
        nuisances=beside,
        suspects=suspected,
        not_tested={k: v for k, v in found.steps[0].reasons.items() if k not in ranked}
        | (not_among_candidates(result) if unnamed else {}),
        rmse_heldout_before=before.rmse_held,
        rmse_heldout_after=result.rmse_held,
        noise_floor=float(np.sqrt(floor)),
        noise_floor_within=float(np.sqrt(decision["floor_within"])),
        reduced_chi2_before=before.reduced_chi2,
        reduced_chi2_after=result.reduced_chi2,
        revolutions=int(before.cells.revolutions.sum()),
        manoeuvres=manoeuvres,
        notes=tuple(filter(None, notes)),
        next_command=next_command(
            verdict,
            selected,
            model=before.model,
            logs=before.cells.log_names,
            large_rest=verdict == "partial" and large,
            beside=[
                name for name, use in uses.items() if name in groups_of(result) and use != "on"
            ],
            grating=gratings.asked[0] if gratings is not None else "",
        ),
        found=found,
        stacks=stacks,
        gratings=gratings,
    )


def shares_explained(
    found: SearchResult, left: Leftover, before: float, after: float
) -> tuple[float, float, float, float]:
    """(repeats, share, alone, certain): what the named effects remove of the excess [unit^2].

    before, after  held-out error above the floor without them and with them
    left           what repeats beside them

    repeats   what the shares are of: the excess before, or what repeats beside names that are
              beyond doubt
    share     of that, which they remove;  alone  which the first removes
    certain   what they remove if they are beyond doubt, else 0
    """
    names = [step.named for step in found.steps if step.named is not None]
    if not names:
        return before, 0.0, 0.0, 0.0
    first = names[0]
    left_alone = max(first.base.square_held - found.after.floor.square, 0.0)
    share, alone = (1.0 - x / before if before > 0.0 else 0.0 for x in (after, left_alone))
    if any(r.p > BEYOND_DOUBT_P for r in names):
        return before, share, alone, 0.0
    # what does not repeat is no effect's to explain: it is a size of its own, and vetoes no name
    size, by_size = removed_by(found.before, found.after, sure=True)
    removed = max(before - after, size) if by_size else before - after
    repeats = max(removed, 0.0) + (max(left.size, 0.0) if left.significant else 0.0)
    if repeats <= 0.0 or not (repeats < before or by_size):
        return before, share, alone, removed
    alone *= before / repeats
    if by_size:
        alone = removed_by(found.steps[0].before, first.base, sure=True)[0] / repeats
    return repeats, min(removed / repeats, 1.0), alone, removed


def decide(found: SearchResult) -> dict[str, Any]:
    """The verdict of a search by the table of rules, what it claims, and what it was decided by.

    excess_before, excess_after  held-out error above the floor [unit^2] without the effects that
                                 are claimed and with them
    repeats, share  what the share is of, which they remove (`shares_explained`)
    left, floor     what repeats of what the claimed model leaves, and its noise floor [unit^2]
    groups          effects that are not separated;  or_nuisance  (nuisance, effect) likewise
    """
    last, left = found.after if found.named else found.before, describe(found.after)
    floor = last.floor
    before, after = (max(b.square_held - floor.square, 0.0) for b in (found.before, last))
    repeats, share, alone, certain = shares_explained(found, left, before, after)
    groups = tuple(s.group for s in found.steps if s.named is not None and s.group)
    or_nuisance = [
        (nuisance, effect)
        for nuisance, effect in found.alike
        if effect in found.named and nuisance not in groups_of(found.after)
    ]
    enough = share >= MOST and (len(found.named) == 1 or alone >= MOST or share >= TOGETHER)
    matters = left.significant and after > LEAST_SHARE_OF_FLOOR * floor.square
    evidence = {
        "few": found.before.cells.manoeuvres < FEWEST_MANOEUVRES,
        "named": len(found.named),
        "share": share if enough else 0.0,
        "rest": matters and after > REST_SHARE * before,
        "alike": bool(groups or or_nuisance),
        "repeats": matters,
        "quiet": at_noise_floor(found.before, floor.square),
    }
    verdict, selected = verdict_of(evidence), found.named
    if selected and verdict not in CLAIMING:
        # what was named is not claimed: all sentences are on the model as given
        selected, floor, left = (), found.before.floor, describe(found.before)
        before = after = max(found.before.square_held - floor.square, 0.0)
        if max(before, certain) <= LEAST_SHARE_OF_FLOOR * floor.square:
            # what alarmed is gone, once less is taken for scatter, or too small to be missing
            verdict = verdict_of(evidence | {"named": 0, "repeats": False})
    return {
        "verdict": verdict,
        "selected": selected,
        "excess_before": before,
        "excess_after": after,
        "total": 1.0 - after / before if before > 0 else 0.0,
        "repeats": repeats,
        "share": share,
        "left": left,
        "groups": groups,
        "or_nuisance": or_nuisance,
        "floor": floor.square,
        "floor_within": floor.within,
    }


def _unexplained(
    decision: Mapping[str, Any], ranking: Sequence[Candidate], manoeuvres: int
) -> dict[str, Any]:
    """What remains, in the contract's keys and a sentence."""
    left, excess = decision["left"], decision["excess_before"]
    counts = excess > LEAST_SHARE_OF_FLOOR * decision["floor"]
    near = [c for c in ranking if c.excess_removed >= REST_SHARE]
    tells = left.significant and not decision["selected"]
    nearest = max(near, key=lambda c: c.excess_removed, default=None) if tells else None
    # of one, or of several together
    apart = () if left.observable is not None else ("observable", "contradicts")
    facts = {name: value for name, value in vars(left).items() if name not in apart} | {
        "size": float(np.sqrt(max(left.size, 0.0))),
        "share_of_excess": min(decision["excess_after"] / excess, 1.0) if counts else 0.0,
        "nearest_effect": nearest.effect if nearest else None,
        "nearest_share": nearest.excess_removed if nearest else None,
    }
    return facts | {"sentence": unexplained_sentence(facts, manoeuvres < FEWEST_MANOEUVRES)}


def _advice(found: SearchResult, verdict: str) -> tuple[list[dict[str, Any]], list[str]]:
    """What to drive next, for rivals and for too few manoeuvres."""
    step, few = found.steps[0], verdict == "too_few"
    notes = [
        f"{found.before.cells.manoeuvres} manoeuvres; a test needs {FEWEST_MANOEUVRES}, two "
        "mixed logs of a minute have a dozen: drive more of them."
    ] * few
    if verdict == "ambiguous":
        step = next((s for s in found.steps if s.named is not None and s.group), step)
    rivals = [r for r in step.contenders if r.id in step.group] if not few else step.contenders[:3]
    if verdict not in ("too_few", "ambiguous") or len(rivals) < 2:
        return [], notes
    rows, more = advise(step.before, [(r.id, r.base.model) for r in rivals])
    return rows, notes + more


# ---- A diagnosis asked again, without each log or tire.
#
#     pieces of all logs, groups of logs -> the pieces without each group
#         -> a diagnosis each -> `certainty.stability`
#
# It takes as many diagnoses as there are logs, or tires.


#: the pieces of the logs of these names
Some = Callable[[Sequence[str]], Pieces | Sequence[Pieces]]


def with_groups(
    found: Diagnosis,
    groups: Mapping[str, Sequence[str]],
    some: Some,
    model: Model,
    *,
    by: str = "log",
    effects: Iterable[Effect] = (),
    progress: Progress = lambda text: None,
) -> Diagnosis:
    """The diagnosis, with whether it holds without each group of logs in turn.

    groups  name -> its logs: those of one tire, or one log each;  some  gives the pieces of logs
    """
    every = [log for logs in groups.values() for log in logs]
    extra, without = tuple(effects), list[dict[str, Any]]()
    for group, logs in groups.items():
        rest = [log for log in every if log not in logs]
        progress(f"once more without {group}")
        try:
            again = diagnose(some(rest), model, effects=extra)
            without.append(verdict_of_group(group, rest, again))
        except TirelogError as problem:
            asked = {"group": group, "logs": tuple(rest), "problem": problem.message}
            without.append({**NO_VERDICT, **asked})
    answer = stability(by, verdict_of_group("", every, found), without)
    return replace(found, stability=answer, notes=(*found.notes, answer["sentence"]))


def refuse_one(groups: Mapping[str, Sequence[str]], by: str) -> None:
    """UsageError: there is but one group."""
    if len(groups) < 2:
        raise UsageError(
            f"one {by} alone: none can be left out",
            allowed=f"two {by}s at least",
            do="give more logs",
        )


def verdict_of_group(group: str, logs: Sequence[str], found: Diagnosis) -> dict[str, Any]:
    """A diagnosis in few words."""
    said = {name: getattr(found, name) for name in ("verdict", "selected", "ambiguous_groups")}
    about = {"group": group, "logs": tuple(logs), "probability": found.certainty.probability}
    return {**NO_VERDICT, **about, **said}


def logs_of(pieces: Sequence[Pieces]) -> dict[str, tuple[str, ...]]:
    """Every log as a group of its own."""
    return {log: (log,) for part in pieces for log in part.logs}


def of_logs(pieces: Sequence[Pieces], logs: Iterable[str]) -> list[Pieces]:
    """The pieces of some of the logs; UsageError: there is none."""
    names, parts = set(logs), list[Pieces]()
    for part in pieces:
        some = part.take(np.isin(part.log, [i for i, log in enumerate(part.logs) if log in names]))
        if len(some):
            number, log = np.unique(some.log, return_inverse=True)
            parts.append(replace(some, log=log, logs=tuple(part.logs[i] for i in number)))
    if not parts:
        raise UsageError("no log is left", allowed="one at least", do="give more logs")
    if len(parts) < len(pieces):
        raise UsageError(
            "a sensor is in none of the other logs",
            allowed="each observable and grating must be in one log at least",
            do="give more logs",
        )
    return one_drive(parts)
