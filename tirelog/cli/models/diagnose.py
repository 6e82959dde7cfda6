"""`tirelog diagnose LOG... --model M`."""

from __future__ import annotations

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
    say,
)
from tirelog.cli.models.compare import columns_of_rows, measured_and_model, write_json
from tirelog.errors import UsageError

if TYPE_CHECKING:
    from tirelog.diagnosis.diagnose import Diagnosis


def diagnose(
    logs: Logs,
    model: ModelFile,
    setup: SetupFile = None,
    output: Output = None,
    format: Format = None,
    quiet: Quiet = False,
    channel: ChannelName = None,
    effects: EffectsFile = None,
    plot: Plot = None,
    bootstrap: Annotated[
        int,
        typer.Option(
            metavar="DRAWS",
            help="Draw the manoeuvres anew so many times, and say how often each effect is named.",
            min=0,
            max=10000,
            show_default=False,
        ),
    ] = 0,
    leave_one_out: Annotated[
        str | None,
        typer.Option(
            metavar="log|tire",
            help="Diagnose without each log, or tire, in turn; say where the verdict changes.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Tell which effect the model lacks, which cannot be told apart, and what to drive next."""

    if leave_one_out not in (None, "log", "tire"):
        raise UsageError(
            f"--leave-one-out {leave_one_out}", allowed="allowed are log, tire", do="choose one"
        )
    with Session(setup, quiet, hashed=keeps_hashes(output, format)) as session:
        found, read = measured_and_model(session, logs, model, effects, channel)
        from tirelog.api.answers import diagnose as diagnose_measured

        with session.working() as line:
            line.say("diagnosing")
            result = diagnose_measured(
                found,
                read,
                bootstrap=bootstrap,
                leave_one_out=session.tires if leave_one_out == "tire" else bool(leave_one_out),
                progress=None if quiet else say,
            )
        for remark in result.before.remarks:
            session.note(remark)
        if plot is not None:
            from tirelog.plots.models.diagnose import draw

            for beside in draw(result, plot):
                session.note(f"another observable drawn in {beside}")
        if format == "json" or (output is not None and output.suffix == ".json"):
            write_json(result.to_json(), output)
        elif format is not None or output is not None:
            with session.table("diagnose", output, format) as table:
                table.write(columns_of_rows(_rows(result)))
        else:
            from tirelog.cli.models.answers_page import diagnosis_page

            diagnosis_page(result)


def _rows(result: Diagnosis) -> list[dict[str, Any]]:
    """The ranking as a table."""
    return [
        {
            "effect": c.effect, "rank": c.rank, "excess_removed": c.excess_removed,
            "p_adjusted": c.p_adjusted, "selected": c.selected, "group": ";".join(c.group),
        }
        for c in result.effects
    ]  # fmt: skip
