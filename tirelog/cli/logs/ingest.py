"""`tirelog ingest LOG -o run.h5`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli.common import Quiet, Session, SetupFile
from tirelog.cli.targets import in_a_folder


def ingest(
    log: Annotated[
        str, typer.Argument(help="The log, or '-' for standard input.", show_default=False)
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            help="The run to write (HDF5).",
            show_default=False,
            callback=in_a_folder,
        ),
    ],
    setup: SetupFile = None,
    quiet: Quiet = False,
) -> None:
    """Write a log as a run: channels in SI on exact time axes, with its setup, provenance and
    quality flags.
    """
    from tirelog.cli.logs.summary import print_summary
    from tirelog.runs.ingest import write_run
    from tirelog.runs.store import open_run

    with Session(setup, quiet) as session:
        with session.working() as line:
            line.say(f"reading {log}")
            summary = write_run(log, session.setup(), output)
        for remark in summary.remarks:
            session.note(f"{log}: {remark}")
        for loss in summary.losses:
            session.lost(f"{log}: {loss}")
        if not quiet:
            with open_run(output, log) as recording:
                print_summary(recording)
