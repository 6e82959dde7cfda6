"""`tirelog dissipation LOG...`."""

from __future__ import annotations

from typing import Annotated

import typer

from tirelog.cli.common import (
    Channels,
    Format,
    Logs,
    Output,
    Plot,
    Quiet,
    Session,
    SetupFile,
    keeps_hashes,
)
from tirelog.cli.logs.log_table import table_option
from tirelog.runtime import one_thread


def dissipation(
    logs: Logs,
    setup: SetupFile = None,
    output: Output = None,
    format: Format = None,
    channel: Channels = None,
    quiet: Quiet = False,
    steady_step: Annotated[float, table_option("dissipation", "steady_step")] = 0.08,
    average: Annotated[int, table_option("dissipation", "average")] = 9,
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
    from tirelog.strain.dissipation_table import by_speed as sorted_by_speed
    from tirelog.strain.dissipation_table import regressions

    if fit and by_speed:
        raise UsageError(
            "--fit and --by-speed are two tables",
            allowed="allowed is one of them",
            do="run the command twice",
        )
    kept = []
    name = "dissipation-fit" if fit else "dissipation"
    with (
        Session(setup, quiet, hashed=keeps_hashes(output, format)) as session,
        session.table(name, output, format) as table,
    ):
        for recording, part in session.parts(
            logs, "dissipation", channel, steady_step=steady_step, average=average
        ):
            if fit:
                lines, remarks = regressions(recording.log, part.found)
                for remark in remarks:
                    session.note(f"{recording.log}: {remark}")
                if lines is None:
                    continue
                table.write(lines)
            else:
                table.write(sorted_by_speed(part.found) if by_speed else part.columns)
            if plot is not None:
                from tirelog.plots.tables.dissipation import DissipationSketch

                kept.append(DissipationSketch.of(recording, part.found))
        if plot is not None and kept:
            from tirelog.plots.tables.dissipation import dissipation_picture

            dissipation_picture(kept, plot)
