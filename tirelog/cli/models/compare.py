"""`tirelog compare LOG... --model M`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

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
    plot_kind,
    refuse_kind_alone,
)
from tirelog.plots.kinds import COMPARE

if TYPE_CHECKING:
    from tirelog.api.answers import MeasuredLogs
    from tirelog.api.results import ComparisonOfLogs
    from tirelog.physics.model.model import Model

By = Annotated[
    str | None,
    typer.Option(
        "--by",
        help="A table by revolution, angle, speed, regime or conditions; with a [road] in the "
        "setup by hit, time or frequency.",
        show_default=False,
    ),
]


def measured_and_model(
    session: Session, logs: list[str], model: Path, effects: Path | None, channel: str | None
) -> tuple[MeasuredLogs, Model]:
    """What compare, diagnose and ladder start from.

    A log that cannot be read is said and left out.
    """
    from tirelog.api.answers import measure
    from tirelog.api.models import load_model

    read = load_model(model, effects=effects)
    return measure(session.recordings(logs), read, channel), read


def write_json(value: dict[str, Any], output: Path | None) -> None:
    """A JSON document on standard output or as a whole file."""
    from tirelog.storage.whole import whole_file

    text = json.dumps(value, indent=1) + "\n"
    if output is None:
        typer.echo(text, nl=False)
        return
    with whole_file(output) as part:
        part.write_text(text, encoding="utf-8")


def columns_of_rows(rows: list[dict[str, Any]]) -> dict[str, list[Any]]:
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
    effects: EffectsFile = None,
    plot: Plot = None,
    kind: Annotated[str, plot_kind(COMPARE)] = "page",
) -> None:
    """Fit a model on some manoeuvres and show its error on the others, beside the noise floor."""
    from tirelog.cli.models.transients import TABLES
    from tirelog.errors import UsageError, refuse_unknown

    refuse_kind_alone(kind, plot)
    tables = ("revolution", "angle", "speed", "regime", "conditions", *TABLES)
    if by is not None:
        refuse_unknown(by, tables, f"--by {by}", do="choose one")
    with Session(setup, quiet, hashed=keeps_hashes(output, format)) as session:
        found, read = measured_and_model(session, logs, model, effects, channel)
        from tirelog.api.answers import compare as compare_measured

        with session.working() as line:
            line.say("fitting the model")
            result = compare_measured(found, read)
        if by in TABLES and result.obstacles is None:
            raise UsageError(
                f"--by {by} is for a coupled_ring model and logs whose setup has a [road]",
                allowed=f"allowed here are {', '.join(t for t in tables if t not in TABLES)}",
                do="choose one, or add the [road]",
            )
        for remark in result.notes:
            session.note(remark)
        if plot is not None:
            _draw(session, result, plot, kind)
        if by is not None:
            parts = (
                iter([result.obstacles.tables[by]])
                if result.obstacles is not None and by in TABLES
                else result.tables.parts(by)
            )
            with session.table("compare", output, format) as table:
                for rows in parts:
                    table.write(columns_of_rows(rows))
        elif format == "json" or (output is not None and output.suffix == ".json"):
            write_json(result.to_json(), output)
        elif format is not None or output is not None:
            with session.table("compare", output, format) as table:
                table.write({name: [value] for name, value in _flat(result).items()})
        else:
            from tirelog.cli.models.answers_page import comparison_page

            comparison_page(result)
            if result.obstacles is not None:
                from tirelog.cli.models.transients import transients_page

                transients_page(result.obstacles)


def _draw(session: Session, result: ComparisonOfLogs, plot: Path, kind: str) -> None:
    """The picture of the steady comparison, and beside it that of the obstacles."""
    from tirelog.plots.models.compare import draw

    for beside in draw(result, plot, kind):
        session.note(f"another observable drawn in {beside}")
    if result.obstacles is not None:
        from tirelog.cli.models.transients import draw_transients

        session.note(f"obstacles drawn in {draw_transients(result.obstacles, plot)}")


def _flat(result: ComparisonOfLogs) -> dict[str, Any]:
    """The numbers of the JSON as one row."""
    return {
        name: value
        for name, value in result.to_json().items()
        if not isinstance(value, dict | list)
    }
