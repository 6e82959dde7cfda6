"""`tirelog dissipation LOG...`."""

from __future__ import annotations

from typing import Annotated

import typer

from tirelog.cli.common import Format, Logs, Output, Plot, Quiet, Session, SetupFile, keeps_hashes
from tirelog.runtime import one_thread


def dissipation(
    logs: Logs,
    setup: SetupFile = None,
    output: Output = None,
    format: Format = None,
    quiet: Quiet = False,
    steady_step: Annotated[
        float,
        typer.Option(
            "--steady-step", help="Largest step of a constant speed between revolutions, m/s."
        ),
    ] = 0.08,
    average: Annotated[int, typer.Option("--average", help="Revolutions of a moving average.")] = 9,
    fit: Annotated[
        bool,
        typer.Option(
            "--fit", help="Write the regressions of factor and specific power on speed instead."
        ),
    ] = False,
    by_speed: Annotated[
        bool,
        typer.Option(
            "--by-speed", help="Write the rows of constant speed, sorted by speed (P1 Fig. 11)."
        ),
    ] = False,
    plot: Plot = None,
) -> None:
    """Tell the strain's dissipation factor and power in each revolution."""
    one_thread()
    from tirelog.errors import UsageError
    from tirelog.strain import dissipation_table as tables
    from tirelog.strain.speed import radius_remarks

    if not steady_step > 0 or average < 1:
        raise UsageError(
            "--steady-step is above 0 m/s and --average at least 1 revolution; mend the number"
        )
    if fit and by_speed:
        raise UsageError(
            "--fit and --by-speed are two tables; allowed is one of them; run the command twice"
        )
    kept = []
    name = "dissipation-fit" if fit else "dissipation"
    with (
        Session(setup, quiet, hashed=keeps_hashes(output, format)) as session,
        session.table(name, output, format) as table,
    ):
        for recording in session.recordings(logs):
            for remark in radius_remarks(recording):
                session.note(f"{recording.log}: {remark}")
            for found in tables.dissipation_of(recording, steady_step, average):
                columns = found.columns
                if fit:
                    lines = tables.regression_columns(recording.log, found)
                    if lines is None:
                        session.note(
                            f"{recording.log}: {found.channel.name}: no regression: "
                            "too few revolutions of constant speed, or one speed"
                        )
                        continue
                    columns = lines
                table.write(tables.by_speed(found) if by_speed else columns)
                for remark in found.remarks:
                    session.note(f"{recording.log}: {remark}")
                if plot is not None:
                    from tirelog.plots.dissipation import Sketch

                    kept.append(Sketch.of(recording, found))
        if plot is not None and kept:
            from tirelog.plots.dissipation import dissipation_picture

            dissipation_picture(kept, plot)
