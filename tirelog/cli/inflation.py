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
        typer.Option("--from", help="Pressure at the beginning, Pa, if no channel records it."),
    ] = None,
    end: Annotated[float | None, typer.Option("--to", help="Pressure at the end, Pa.")] = None,
    plot: Plot = None,
) -> None:
    """Tell strain against inflation pressure in a static test: slope, linearity, leaks at stops."""
    kept = []
    with (
        Session(setup, quiet, hashed=keeps_hashes(output, format)) as session,
        session.table("inflation", output, format) as table,
    ):
        for recording, part in session.parts(logs, "inflation", from_Pa=begin, to_Pa=end):
            table.write(part.columns)
            if plot is not None:
                kept.append((recording, part.found))
        if plot is not None and kept:
            from tirelog.plots.inflation import inflation_picture

            inflation_picture(kept, plot)
