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
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tirelog.data.recording import Recording
from tirelog.errors import ModelError, TirelogError, UsageError, nearest, or_refusal
from tirelog.report.figures import LogColours
from tirelog.report.page import Section
from tirelog.report.sections import models as model_sections
from tirelog.report.sections import obstacles
from tirelog.report.sections.answer import Answered, answer
from tirelog.report.sections.proposed import proposed

if TYPE_CHECKING:
    from tirelog.diagnosis.compare import Measured
    from tirelog.diagnosis.diagnose import Diagnosis
    from tirelog.diagnosis.results import Comparison
    from tirelog.inference.measured import MeasuredLogs
    from tirelog.physics.effects import Effect
    from tirelog.physics.model.model import Model
    from tirelog.report.asked import Asked


@dataclass
class Story:
    """The answer, sections before and after the ladder's own, and what cannot be shown."""

    answer: Section
    before_ladder: list[Section] = field(default_factory=list)
    after_ladder: list[Section] = field(default_factory=list)
    missing: list[tuple[str, str]] = field(default_factory=list)


def model_story(
    recordings: Sequence[Recording],
    model: Model,
    climbed: Mapping[str, Any] | None,
    asked: Asked,
    catalogue: Mapping[str, Effect],
    progress: Callable[[str], None],
    colours: LogColours | None = None,
) -> Story:
    """The sections of a model.  TirelogError if model and logs do not fit together."""
    from tirelog.diagnosis.compare import compare
    from tirelog.diagnosis.diagnose import diagnose
    from tirelog.inference.measured import measured_for
    from tirelog.physics.model.own.user_effects import own_effects

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

    def write_down() -> Section:
        from tirelog.diagnosis.propose.propose import propose

        return proposed(propose(logs.stacks, model, effects=own, progress=progress), wanted)

    if logs.obstacles:
        by = command("compare")
        add("obstacles", by, lambda: _obstacles(logs, compared, by, progress, colours))
    unknown = "what is unknown, written down as a formula"
    if found is not None and found.next_command.startswith("tirelog propose"):
        wanted = asked.with_options(found.next_command)
        if asked.propose:
            add(unknown, wanted, write_down)
        else:
            again = replace(asked, propose=True).report_command()
            story.missing.append((f"{unknown} (--propose)", again))
    elif asked.propose and found is not None:
        word = found.verdict.replace("_", " ")
        story.missing.append((f"{unknown}: the verdict is {word}", wanted))
    return story


def _obstacles(
    logs: MeasuredLogs,
    compared: Comparison,
    command: str,
    progress: Callable[[str], None],
    colours: LogColours,
) -> Section:
    """The answer to the obstacles of the model that came, as `compare` gives it."""
    from tirelog.diagnosis.obstacles.compare import compare_transients

    if compared.model.carcass != "coupled_ring":
        return obstacles.not_answered(logs.obstacles, compared.model.carcass, command)
    progress("driving the model over the obstacles")
    answers = compare_transients(logs.obstacles, compared.model, unit=compared.unit)
    return obstacles.obstacles(answers, command, colours)


def story_of(
    measured: Measured,
    compared: Comparison,
    found: Diagnosis | None,
    climbed: Mapping[str, Any] | None,
    command: Callable[[str], str],
    catalogue: Mapping[str, Effect],
    colours: LogColours | None = None,
    next_command: str = "",
) -> Story:
    """The sections of what was found on `measured`: answer, comparison and diagnosis.

    `command(name)`: the line that repeats it; `next_command`: what to type next.
    """
    from tirelog.diagnosis.compare import comparison_of, measured_pieces, start_from
    from tirelog.diagnosis.effect_curves import effect_curves

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
    given = Answered(compared, found, best, added, climbed, curves, catalogue)
    asked = "compare" if found is None else "diagnose"
    follows = next_command or (command("diagnose") if found is None else found.next_command)
    story = Story(answer(given, follows, command(asked), colours), missing=missing)
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
