"""`tirelog inflation LOG...`."""

from __future__ import annotations

from typing import Annotated

import typer

from tirelog.cli.common import Format, Logs, Output, Plot, Quiet, Session, SetupFile, keeps_hashes


def inflation(
    logs: Logs,
    setup: SetupFile = None,
    output: Output = None,
    format: Format = None,
    quiet: Quiet = False,
    begin: Annotated[
        float | None,
        typer.Option("--from", help="Pressure at the beginning, Pa, where no channel records it."),
    ] = None,
    end: Annotated[float | None, typer.Option("--to", help="Pressure at the end, Pa.")] = None,
    plot: Plot = None,
) -> None:
    """Tell strain against inflation pressure in a static test: slope, linearity, leaks at stops."""
    from tirelog.errors import UsageError
    from tirelog.strain.inflation_table import inflation_of

    if (begin is None) != (end is None) or (begin is not None and begin == end):
        raise UsageError(
            "--from and --to go together and differ; allowed are two pressures in Pa; e.g. "
            "--from 1.7e5 --to 2.3e5"
        )
    ends = None if begin is None or end is None else (begin, end)
    kept = []
    with (
        Session(setup, quiet, hashed=keeps_hashes(output, format)) as session,
        session.table("inflation", output, format) as table,
    ):
        for recording in session.recordings(logs):
            for found in inflation_of(recording, ends):
                table.write(found.columns)
                for remark in found.remarks:
                    session.note(f"{recording.log}: {remark}")
                if plot is not None:
                    kept.append((recording, found))
        if plot is not None and kept:
            from tirelog.plots.inflation import inflation_picture

            inflation_picture(kept, plot)
