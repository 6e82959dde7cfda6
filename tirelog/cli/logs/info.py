"""`tirelog info LOG`."""

from __future__ import annotations

from typing import Annotated

import typer

from tirelog.cli import options
from tirelog.cli.session import Session

#: a log is looked into as far as its first blocks; a run says everything in its metadata
_BLOCKS = 4


def info(
    logs: options.Logs,
    setup: options.SetupFile = None,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
    verify: Annotated[
        bool, typer.Option("--verify", help="Read runs whole and compare their samples' sha256.")
    ] = False,
) -> None:
    """Show what logs or runs hold: channels, rates, durations, gaps, losses, repairs, setup.

    Of a log without a setup: its columns, topics or datasets, with ranges and likely kinds.
    """
    from tirelog.api.logs import changed, channels, described

    with Session(setup, quiet, output, format, hashed=True) as session:
        if setup is None and not any(described(log) for log in logs):
            _contents(session, logs)
            return
        if session.paged:
            from tirelog.cli.logs import pages

            for recording in session.recordings(logs, blocks=_BLOCKS):
                pages.print_summary(recording)
        else:
            with session.table("info") as table:
                for recording in session.recordings(logs, blocks=_BLOCKS):
                    table.write(channels(recording))
        for log in logs if verify else ():
            for name in changed(log):
                session.lost(
                    f"{log}: {name} is not what was written (sha256); copy the run again, or "
                    "ingest the log again"
                )


def _contents(session: Session, logs: list[str]) -> None:
    """What is in logs that have no setup."""
    from tirelog.api.setups import contents_rows
    from tirelog.cli.logs.pages import print_contents

    if session.paged:
        for inside in session.contents(logs):
            print_contents(inside)
        return
    with session.table("contents") as table:
        for inside in session.contents(logs):
            table.write(contents_rows(inside))
