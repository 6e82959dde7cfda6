"""What a model says of the logs: one search for missing effects, told in sections.

recordings, Model --stacks, `diagnose`--> comparison, diagnosis
                                          (a campaign: pieces of its logs, and what it was asked)
+ a ladder, or what the diagnosis selected --> top model --`switches`--> effects on and off
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from tirelog.data.recording import Recording
from tirelog.report import model_sections
from tirelog.report.page import Section
from tirelog.report.switches import MOST_EFFECTS, comparisons, switches, top_of_ladder
from tirelog.vocabulary.observables import STRAIN

if TYPE_CHECKING:
    from tirelog.diagnosis.compare import Measured
    from tirelog.diagnosis.diagnose import Diagnosis
    from tirelog.diagnosis.results import Comparison
    from tirelog.physics.effects import Effect
    from tirelog.physics.model.model import Model
    from tirelog.report.asked import Asked


@dataclass
class Story:
    """Sections before and after the ladder's own, and what cannot be shown."""

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
) -> Story:
    """The sections of a model.  TirelogError if model and logs do not fit together."""
    from tirelog.diagnosis.diagnose import diagnose
    from tirelog.inference.measured import (
        measured,
        measured_gratings,
        measured_together,
        several_channels,
    )
    from tirelog.physics.model.user_effects import own_effects

    level = not model.ac_coupled
    stacks: Measured
    if model.beside:
        stacks = measured_together(
            recordings, model.observables, asked.channel, level=level
        ).revolutions
    elif (names := several_channels(asked.channel)) and model.observable == STRAIN:
        stacks = measured_gratings(recordings, names).revolutions
    else:
        stacks = measured(recordings, model.observable, asked.channel, level=level).stacks
    found = diagnose(stacks, model, effects=own_effects(asked.effects), progress=progress)

    def command(name: str) -> str:
        return asked.report_command() if name == "report" else asked.command(name, model=True)

    return story_of(stacks, found.before, found, climbed, command, catalogue, progress)


def story_of(
    measured: Measured,
    compared: Comparison,
    found: Diagnosis | None,
    climbed: Mapping[str, Any] | None,
    command: Callable[[str], str],
    catalogue: Mapping[str, Effect],
    progress: Callable[[str], None],
) -> Story:
    """The sections of what was found on `measured`: the comparison, the diagnosis and the switches.

    `command(name)`: the line that repeats it.
    """
    story = Story()
    story.before_ladder += model_sections.comparisons(compared, command("compare"))
    if found is not None:
        story.before_ladder.append(model_sections.diagnosis(found, command("diagnose")))
    best = found.model if found is not None else compared.model
    top = top_of_ladder(compared.model, climbed, catalogue) if climbed is not None else best
    effects = [effect.id for effect in top.effects]
    switched, left_out = effects[-MOST_EFFECTS:], effects[:-MOST_EFFECTS]
    section = None
    if switched:
        results = comparisons(measured, top, switched, compared.model, progress)
        section = switches(results, switched, command("report"), left_out)
    if section is not None:
        story.after_ladder.append(section)
    else:
        why = (
            "its full model cannot be computed on these logs"
            if switched
            else "no effect is in the model, and none was found missing"
        )
        story.missing.append((f"switches for effects: {why}", command("ladder")))
    return story
