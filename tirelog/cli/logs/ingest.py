"""`tirelog ingest LOG -o run.h5`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli import options
from tirelog.cli.session import Session
from tirelog.cli.targets import in_a_folder


def ingest(
    log: Annotated[str, typer.Argument(help="The log, or '-' for standard input.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="The run to write (HDF5).", callback=in_a_folder)
    ],
    setup: options.SetupFile = None,
    quiet: options.Quiet = False,
) -> None:
    """Write a log as a run: channels in SI on exact time axes, with its setup, provenance and
    quality flags.
    """
    from tirelog.api import logs
    from tirelog.cli.logs.pages import print_summary

    with Session(setup, quiet) as session:
        with session.working() as line:
            line.say(f"reading {log}")
            summary = logs.ingest(log, output, session.setup())
        session.notes(f"{log}: {remark}" for remark in summary.remarks)
        for loss in summary.losses:
            session.lost(f"{log}: {loss}")
        if not quiet:
            with logs.opened_run(output, log) as recording:
                print_summary(recording)
