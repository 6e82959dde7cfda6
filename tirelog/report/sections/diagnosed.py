"""What a model says of the logs: one search for missing effects, told in sections.

recordings, Model --stacks, `diagnose`--> comparison, diagnosis
                                          (a campaign: pieces of its logs, and what it was asked)
+ a ladder, or what the diagnosis selected --> the best model's comparison
all of it --`answer`--> the page's first section
logs that met an obstacle --> how well the model answers it; something unknown, and --propose -->
                              what `propose` writes down
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from tirelog.data.recording import Recording
from tirelog.diagnosis.compare import (
    Measured,
    compare,
    comparison_of,
    measured_pieces,
    start_from,
)
from tirelog.diagnosis.diagnose import Diagnosis, diagnose
from tirelog.diagnosis.obstacles import HitResult, TransientComparison, compare_transients
from tirelog.diagnosis.propose.propose import Proposal, propose
from tirelog.diagnosis.results import Comparison, effect_curves
from tirelog.errors import ModelError, TirelogError, UsageError, nearest, or_refusal
from tirelog.inference.measured import measured_for
from tirelog.inference.obstacle_log import TransientLog
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model
from tirelog.physics.model.user_effects import own_effects
from tirelog.plots.answers import hit_panels, rest, shape
from tirelog.report.page import GREY, INK, Figure, LogColours, PageTable, Section, figure
from tirelog.report.request import ReportRequest
from tirelog.report.sections import models as model_sections
from tirelog.report.sections.models import AnswerSection, answer, page_table, shown_value

# ---- The section of logs that met an obstacle: how well the model answers it, hit by hit.
#
# MeasuredLogs --`compare_transients` behind `compare`, of a model that moves--> Section


#: hits that are drawn
_MOST = 3


def not_answered(logs: Sequence[TransientLog], carcass: str, command: str) -> Section:
    """The hits that were found, if the model does not move."""
    hits = sum(log.hits_s.size for log in logs)
    text = (
        f"{hits} hits on an obstacle; answer, comparison and diagnosis leave their revolutions "
        f"out. A {carcass} says nothing of an obstacle; a model with carcass = "
        '"coupled_ring" does.'
    )
    rows = [
        [
            Path(log.log).name,
            log.road.kind,
            str(log.hits_s.size),
            ", ".join(f"{time:.3f}" for time in log.hits_s),
        ]
        for log in logs
    ]
    table = PageTable("Obstacles", ["log", "kind", "hits", "at [s]"], rows)
    return Section("obstacles", "Obstacles", command, [text], (), [table])


def obstacles(result: TransientComparison, command: str, colours: LogColours) -> Section:
    """Each hit as measured and predicted, what of the added the model misses, and by frequency."""
    factor, unit = shown_value(result.observable, result.unit)
    total = result.to_json()
    words = [
        f"{len(result.hits)} hits on an obstacle, kept apart from the steady revolutions; the "
        f"model covers {100.0 * total['covered']:.0f} % of what they added: "
        f"{total['added'] * factor:.3g} {unit} added, {total['missed'] * factor:.3g} missed, at a "
        f"floor of {total['noise_floor'] * factor:.3g}.",
        f"The prediction has {total['nuisance_parameters']} nuisance numbers (when, phase, level "
        "and alignment of each hit), which the errors are charged for.",
        *(f"{remark}." for remark in result.remarks),
    ]
    if len(result.hits) > _MOST:
        words.append(f"The first {_MOST} hits are drawn; the table has all of them.")
    figures = [
        figure
        for number, hit in enumerate(result.hits[:_MOST])
        for figure in _hit(hit, number, result.observable, (factor, unit), colours)
    ]
    table = page_table(result.hits_table(lambda log: Path(log).name))
    return Section("obstacles", "Obstacles", command, words, figures, [table])


def _hit(
    found: HitResult, number: int, observable: str, as_shown: tuple[float, str], colours: LogColours
) -> list[Figure]:
    hit, log = found.hit, Path(found.log.log).name
    own = colours(log)
    panels = hit_panels(found, observable, as_shown, (own, own, INK, INK, GREY))
    covered = f"{100.0 * found.row()['covered']:.0f} % of the added is covered"
    which = f"Hit {number + 1}"
    told = (
        (
            f"hit-{number}",
            f"{which}: {log}, {hit.time_s:.3f} s, {hit.speed_m_s:.1f} m/s",
            f"Measured (points) and predicted (line) {observable} after the hit; {covered}.",
        ),
        (
            f"hit-added-{number}",
            f"{which}: what the obstacle added, and what the model misses",
            f"Change by the obstacle, and the part that the model does not cover; {covered}.",
        ),
        (
            f"hit-bands-{number}",
            f"{which} by frequency",
            "Root mean squares per band: what the obstacle added, what of it is missed, the "
            "residual with and off the obstacle, the floor.",
        ),
    )
    return [
        figure(id, title, alt, panel, half=panel is not panels[-1])
        for (id, title, alt), panel in zip(told, panels, strict=True)
    ]


# ---- The section of what `propose` wrote down: formulas or a measured shape, and how well they do.
#
# Proposal --> sentence, formulas with their numbers, errors on locked manoeuvres, two figures, the
# command that writes the model file


def proposed(result: Proposal, command: str) -> Section:
    """The section; of no proposal the reason."""
    title = "What is unknown, written down"
    if result.status == "nothing":
        return Section("propose", title, command, [result.sentence])
    as_shown = shown_value(result.observable, result.unit)
    terms = result.terms if result.status == "formula" else ()
    panel = rest(result, as_shown, (GREY, INK))
    alt = "The leading shape of what is left over the angle, before and with the proposal."
    left = figure("propose-rest", "What is left, before and after", alt, panel, half=True)
    return Section(
        "propose",
        title,
        command,
        [result.sentence, *result.sentences()],
        [*_shape(result, as_shown), left],
        [*_errors(result, *as_shown), *([page_table(result.terms_table())] if terms else [])],
        folded=False,
        formulas=[(term.name, term.formula.expression) for term in terms],
    )


def _errors(result: Proposal, factor: float, unit: str) -> list[PageTable]:
    """Errors before and after, on manoeuvres that the search saw and on those it did not."""
    before, after, floor = result.rmse_heldout_before, result.rmse_heldout_after, result.noise_floor
    known = []
    if before is not None and floor is not None:
        known.append(("seen, held out in turn", result.manoeuvres, (before, after, floor)))
    if (locked := result.locked) is not None:
        errors = (locked.before, locked.after, locked.floor)
        known.append(("locked away from the search", locked.manoeuvres, errors))
    rows = [
        [which, str(count), *("" if error is None else f"{error * factor:.3g}" for error in errors)]
        for which, count, errors in known
    ]
    header = ["manoeuvres", "how many", *(f"{w} [{unit}]" for w in ("before", "after", "floor"))]
    return [PageTable("Errors without and with the proposal", header, rows)] if rows else []


def _shape(result: Proposal, as_shown: tuple[float, str]) -> list[Figure]:
    """The best measured shape with two standard errors."""
    panel = shape(result, as_shown, (GREY, INK))
    if panel is None:
        return []
    best = result.shapes[0]
    named = f"{best.words}{'' if best.law == '1' else f', times {best.law}'}"
    alt = (
        f"A free shape {named}, with two standard errors as a band: what any formula in this frame "
        "can remove at most."
    )
    return [figure("propose-shape", f"Measured shape {named}", alt, panel, half=True)]


@dataclass
class DiagnosisFigures:
    """The answer, sections before and after the ladder's own, and what cannot be shown."""

    answer: Section
    before_ladder: list[Section] = field(default_factory=list)
    after_ladder: list[Section] = field(default_factory=list)
    missing: list[tuple[str, str]] = field(default_factory=list)


def model_story(
    recordings: Sequence[Recording],
    model: Model,
    climbed: Mapping[str, Any] | None,
    asked: ReportRequest,
    catalogue: Mapping[str, Effect],
    progress: Callable[[str], None],
    colours: LogColours | None = None,
) -> DiagnosisFigures:
    """The sections of a model.  TirelogError if model and logs do not fit together."""
    level = not model.ac_coupled
    logs = measured_for(recordings, model.observables, asked.channel, level=level)
    own = own_effects(model.effects_file, asked=False)
    colours = LogColours(r.log for r in recordings) if colours is None else colours
    compared = compare(logs.revolutions, model)
    asked_of = or_refusal(diagnose)(logs.revolutions, model, effects=own, progress=progress)
    found = None if isinstance(asked_of, ModelError) else asked_of

    def command(name: str) -> str:
        return asked.report_command() if name == "report" else asked.command(name, model=True)

    story = story_of(
        logs.revolutions,
        compared,
        found,
        climbed,
        command,
        catalogue,
        colours,
        "" if found is None else asked.with_options(found.next_command),
    )
    if isinstance(asked_of, ModelError):
        story.missing.append((f"the diagnosis: {asked_of}", command("diagnose")))
    better = f"{(asked.model or Path('M.toml')).with_suffix('')}+proposed.toml"
    wanted = asked.command("propose", "-o", better, model=True)

    def add(what: str, made_by: str, make: Callable[[], Section]) -> None:
        """A section before all others; if it cannot be made the rest of the story stays."""
        try:
            story.before_ladder.insert(0, make())
        except TirelogError as problem:
            story.missing.append((f"{what}: {problem}", made_by))

    def answered() -> Section:
        """The answer to the obstacles of the model that came, as `compare` gives it."""
        if compared.model.carcass != "coupled_ring":
            return not_answered(logs.obstacles, compared.model.carcass, command("compare"))
        progress("driving the model over the obstacles")
        answers = compare_transients(logs.obstacles, compared.model, unit=compared.unit)
        return obstacles(answers, command("compare"), colours)

    if logs.obstacles:
        add("obstacles", command("compare"), answered)
    unknown = "what is unknown, written down as a formula"
    if found is not None and found.next_command.startswith("tirelog propose"):
        wanted = asked.with_options(found.next_command)
        if asked.propose:
            write = partial(propose, logs.stacks, model, effects=own, progress=progress)
            add(unknown, wanted, lambda: proposed(write(), wanted))
        else:
            again = replace(asked, propose=True).report_command()
            story.missing.append((f"{unknown} (--propose)", again))
    elif asked.propose and found is not None:
        word = found.verdict.replace("_", " ")
        story.missing.append((f"{unknown}: the verdict is {word}", wanted))
    return story


def story_of(
    measured: Measured,
    compared: Comparison,
    found: Diagnosis | None,
    climbed: Mapping[str, Any] | None,
    command: Callable[[str], str],
    catalogue: Mapping[str, Effect],
    colours: LogColours | None = None,
    next_command: str = "",
) -> DiagnosisFigures:
    """The sections of what was found on `measured`: answer, comparison and diagnosis.

    `command(name)`: the line that repeats it; `next_command`: what to type next.
    """
    colours = LogColours(model_sections.logs_of(compared)) if colours is None else colours
    best: Comparison | None = None
    added: Sequence[str] = () if found is None else (*found.found.came_in, *found.selected)
    missing: list[tuple[str, str]] = []
    if climbed is not None:
        top = top_of_ladder(compared.model, climbed, catalogue)
        came = [effect.id for effect in compared.model.effects]
        added = [effect.id for effect in top.effects if effect.id not in came]
        try:
            best = comparison_of(start_from(measured_pieces(measured), top)) if added else None
        except ModelError as problem:
            missing.append((f"the ladder's last model: {problem.message}", command("ladder")))
    elif found is not None and added:
        best = found.after
    curves = []
    if found is not None:
        drawn = found.selected or [effect.id for effect in found.model.effects]
        curves = effect_curves(found.found.after if found.selected else found.found.before, drawn)
    given = AnswerSection(compared, found, best, added, climbed, curves, catalogue)
    asked = "compare" if found is None else "diagnose"
    follows = next_command or (command("diagnose") if found is None else found.next_command)
    story = DiagnosisFigures(answer(given, follows, command(asked), colours), missing=missing)
    if found is not None:
        story.before_ladder.append(model_sections.diagnosis(found, command("diagnose")))
    story.after_ladder += model_sections.comparisons(compared, command("compare"), colours)
    return story


def top_of_ladder(
    model: Model, climbed: Mapping[str, Any], catalogue: Mapping[str, Effect]
) -> Model:
    """The model with the effects that a ladder added and the values it found.

    UsageError: an effect that nobody knows.
    """
    added = [step for step in climbed["steps"] if step["outcome"] == "added"]
    for step in added:
        name = step["effect"]
        if name in [e.id for e in model.effects]:
            continue
        if name not in catalogue:
            raise UsageError(
                f"the ladder has the effect {name!r}{nearest(name, catalogue)}, which is not "
                "known here",
                do="give it with --effects",
            )
        model = model.with_effect(catalogue[name])
    values = {
        name: p["value"]
        for step in added[-1:]
        for name, p in step["parameters"].items()
        if name in model.parameters
    }
    return model.with_values(values)
