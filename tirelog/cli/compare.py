"""`tirelog compare LOG... --model M`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tirelog.cli.common import (
    Format,
    Logs,
    ModelFile,
    Output,
    Plot,
    Quiet,
    Session,
    SetupFile,
    keeps_hashes,
)

if TYPE_CHECKING:
    from tirelog.diagnosis.obstacles.compare import TransientComparison
    from tirelog.diagnosis.results import Comparison
    from tirelog.inference.measured import MeasuredLogs
    from tirelog.inference.obstacle_log import TransientLog
    from tirelog.inference.stacks.spooled import Stacks
    from tirelog.physics.model.model import Model

Effects = Annotated[
    Path | None,
    typer.Option(
        "--effects", help="Python file with effects of your own; it is run.", show_default=False
    ),
]
ChannelName = Annotated[
    str | None,
    typer.Option(
        "--channel", help="Channel to compare; the first that fits by default.", show_default=False
    ),
]
By = Annotated[
    str | None,
    typer.Option(
        "--by",
        help="A table by revolution, angle, speed, regime or conditions; with a [road] in the "
        "setup by hit, time or frequency.",
        show_default=False,
    ),
]


def stacks_and_model(
    session: Session, logs: list[str], model: Path, effects: Path | None, channel: str | None
) -> tuple[Stacks, Model]:
    """What diagnose and ladder start from: steady revolutions, and the model; a log that cannot be
    read is said and left out.
    """
    found, read = measured_and_model(session, logs, model, effects, channel)
    return found.stacks, read


def measured_and_model(
    session: Session, logs: list[str], model: Path, effects: Path | None, channel: str | None
) -> tuple[MeasuredLogs, Model]:
    """What compare starts from: steady revolutions and obstacles of the logs, and the model."""
    from tirelog.inference.measured import measured
    from tirelog.physics.model.file import load_model
    from tirelog.physics.model.user_effects import catalogue_with

    read = load_model(model, catalogue=catalogue_with(effects))
    return measured(session.recordings(logs), read.observable, channel), read


def own_effects(effects: Path | None) -> list[Any]:
    """Candidates beside the catalogue: installed packages' and those of --effects."""
    from tirelog.physics.effects import BY_ID
    from tirelog.physics.model.user_effects import catalogue_with

    return [effect for name, effect in catalogue_with(effects).items() if name not in BY_ID]


def write_json(value: dict[str, Any], output: Path | None) -> None:
    """A JSON document on standard output or as a whole file."""
    from tirelog.storage.whole import whole_file

    text = json.dumps(value, indent=1) + "\n"
    if output is None:
        typer.echo(text, nl=False)
        return
    with whole_file(output) as part:
        part.write_text(text, encoding="utf-8")


def columns_of(rows: list[dict[str, Any]]) -> dict[str, list[Any]]:
    """Rows as columns; what a row lacks is NaN or empty text."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    texts = {name for name in names if any(isinstance(row.get(name), str) for row in rows)}
    empty = {name: "" if name in texts else float("nan") for name in names}
    return {
        name: [empty[name] if row.get(name) is None else row[name] for row in rows]
        for name in names
    }


def compare(
    logs: Logs,
    model: ModelFile,
    setup: SetupFile = None,
    output: Output = None,
    format: Format = None,
    quiet: Quiet = False,
    by: By = None,
    channel: ChannelName = None,
    effects: Effects = None,
    plot: Plot = None,
) -> None:
    """Fit a model on some manoeuvres and show its error on the others, beside the noise floor."""
    from tirelog.cli.targets import refuse_picture, refuse_unwritable
    from tirelog.cli.transients import TABLES
    from tirelog.errors import UsageError, nearest

    tables = ("revolution", "angle", "speed", "regime", "conditions", *TABLES)
    if by is not None and by not in tables:
        raise UsageError(
            f"--by {by}{nearest(by, tables)}; allowed are {', '.join(tables)}; choose one"
        )
    refuse_unwritable(output)
    refuse_picture(plot)
    with Session(setup, quiet, hashed=keeps_hashes(output, format)) as session:
        found, read = measured_and_model(session, logs, model, effects, channel)
        from tirelog.diagnosis.compare import compare as compare_stacks

        result = compare_stacks(found.stacks, read)
        answers = _obstacles(session, found.obstacles, result)
        if by in TABLES and answers is None:
            raise UsageError(
                f"--by {by} is for a coupled_ring model and logs whose setup has a [road]; "
                "allowed here are "
                f"{', '.join(t for t in tables if t not in TABLES)}; choose one, or add the [road]"
            )
        for remark in (*result.remarks, *(answers.remarks if answers is not None else ())):
            session.note(remark)
        if plot is not None:
            _draw(session, result, answers, plot)
        if by is not None:
            parts = (
                iter([answers.tables[by]])
                if answers is not None and by in TABLES
                else result.tables.parts(by)
            )
            with session.table("compare", output, format) as table:
                for rows in parts:
                    table.write(columns_of(rows))
        elif format == "json" or (output is not None and output.suffix == ".json"):
            write_json(_json(result, answers), output)
        elif format is not None or output is not None:
            with session.table("compare", output, format) as table:
                table.write({name: [value] for name, value in _flat(result).items()})
        else:
            from tirelog.cli.discrepancy_page import comparison_page

            comparison_page(result)
            if answers is not None:
                from tirelog.cli.transients import transients_page

                transients_page(answers)


def _obstacles(
    session: Session, obstacles: Sequence[TransientLog], result: Comparison
) -> TransientComparison | None:
    """The fitted model's answer to the obstacles; None where there are none, or the model does not
    move in time.
    """
    if not obstacles:
        return None
    if result.model.carcass != "coupled_ring":
        session.note(
            f'a {result.model.carcass} says nothing of the obstacles; carcass = "coupled_ring" does'
        )
        return None
    from tirelog.diagnosis.obstacles.compare import compare_transients

    return compare_transients(obstacles, result.model, unit=result.unit)


def _draw(
    session: Session, result: Comparison, answers: TransientComparison | None, plot: Path
) -> None:
    """The picture of the steady comparison, and beside it that of the obstacles."""
    from tirelog.plots.compare import draw

    draw(result, plot)
    if answers is not None:
        from tirelog.cli.transients import draw_transients

        session.note(f"obstacles drawn in {draw_transients(answers, plot)}")


def _json(result: Comparison, answers: TransientComparison | None) -> dict[str, Any]:
    """The document: with obstacles their part under `transients`."""
    return result.to_json() | ({"transients": answers.to_json()} if answers is not None else {})


def _flat(result: Comparison) -> dict[str, Any]:
    """The numbers of the JSON as one row."""
    return {
        name: value
        for name, value in result.to_json().items()
        if not isinstance(value, dict | list)
    }
