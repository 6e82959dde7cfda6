"""`tirelog ladder LOG... --model M`."""

from __future__ import annotations

import json
import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tirelog.cli.common import (
    ChannelName,
    EffectsFile,
    Format,
    Logs,
    ModelFile,
    Output,
    Plot,
    Quiet,
    Session,
    SetupFile,
    keeps_hashes,
    say,
)
from tirelog.cli.models.compare import columns_of_rows, measured_and_model, write_json
from tirelog.cli.targets import in_a_folder
from tirelog.errors import printable

if TYPE_CHECKING:
    from tirelog.diagnosis.results import Ladder

#: letters in the longest bar
_BAR = 40


def ladder(
    logs: Logs,
    model: ModelFile,
    setup: SetupFile = None,
    output: Output = None,
    format: Format = None,
    quiet: Quiet = False,
    channel: ChannelName = None,
    effects: EffectsFile = None,
    plot: Plot = None,
    save: Annotated[
        Path | None,
        typer.Option(
            "--save",
            help="Write the model at the top of the ladder.",
            show_default=False,
            callback=in_a_folder,
        ),
    ] = None,
    propose: Annotated[
        bool,
        typer.Option(
            "--propose",
            help="Where the effects end above the floor: write down what is unknown, as `propose`.",
        ),
    ] = False,
    by_log: Annotated[
        bool, typer.Option("--by-log", help="The fitted strengths log by log instead of the steps.")
    ] = False,
) -> None:
    """Add effects one by one until nothing more is worth adding; one row per step."""

    from tirelog.physics.model.save import refuse_another, save_model

    if save is not None:
        refuse_another(save)
    with Session(setup, quiet, hashed=keeps_hashes(output, format)) as session:
        found, read = measured_and_model(session, logs, model, effects, channel)
        from tirelog.api.answers import ladder as climb

        with session.working() as line:
            line.say("climbing")
            result = climb(
                found,
                read,
                propose=propose,
                progress=None if quiet else say,
            )
        if not quiet:
            _bars(result)
        _remember(result, model)
        if plot is not None:
            from tirelog.plots.models.ladder import draw

            draw(result, plot)
        if save is not None:
            save_model(result.model, save)
        if format == "json" or (output is not None and output.suffix == ".json"):
            write_json(result.to_json(), output)
            return
        rows = [dict(row) for row in result.strengths_by_log] if by_log else result.rows()
        with session.table("ladder", output, format) as table:  # nothing added: names, no rows
            table.write(columns_of_rows(rows) or {name: [] for name in _BY_LOG})


#: columns of --by-log
_BY_LOG = ("log", "parameter", "unit", "value", "se", "distance_km", "load_N")


def _bars(result: Ladder) -> None:
    """The held-out error as bars that shrink, the floor marked, on standard error."""
    from tirelog.vocabulary.observables import shown

    factor, unit = shown(result.observable, result.unit)
    errors = [
        step.rmse_fit if step.rmse_heldout is None else step.rmse_heldout for step in result.steps
    ]
    largest = max(errors)
    for step, error in zip(result.steps, errors, strict=True):
        length = max(1, round(_BAR * error / largest))
        floor = min(_BAR - 1, round(_BAR * step.noise_floor / largest))
        bar = "".join("|" if i == floor else "#" if i < length else " " for i in range(_BAR))
        _line(f"{step.step:2d} {step.effect:18s} {bar} {error * factor:.3g} {unit}")
        _line(f"   {step.sentence}")
    for remark in result.remarks:
        _line(f"   {remark}")
    if result.rmse_untouched is not None:
        error, floor_there = (
            result.rmse_untouched * factor,
            (result.floor_untouched or 0.0) * factor,
        )
        _line(
            f"   on manoeuvres that nothing had touched: {error:.3g} {unit}, floor "
            f"{floor_there:.3g}"
        )


def _line(text: str) -> None:
    """A line of the bars, as any terminal may show it."""
    sys.stderr.write(f"{printable(text)}\n")


def _remember(result: Ladder, model: Path) -> None:
    """The ladder, appended to the history beside the model file (MODEL.ladder.json)."""
    from tirelog.cli.models.history import history_file, read_history
    from tirelog.storage.whole import whole_file

    past = read_history(model)
    entry = {"climbed": datetime.now(UTC).isoformat(timespec="seconds")} | result.to_json()
    with whole_file(history_file(model)) as part:
        part.write_text(json.dumps({"ladders": [*past, entry]}, indent=1) + "\n", encoding="utf-8")
