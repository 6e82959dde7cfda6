"""`tirelog info LOG`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli.common import Format, Logs, Output, Quiet, Session, SetupFile

#: a log is looked into as far as its first blocks; a run says everything in its metadata
_BLOCKS = 4


def info(
    logs: Logs,
    setup: SetupFile = None,
    output: Output = None,
    format: Format = None,
    quiet: Quiet = False,
    verify: Annotated[
        bool, typer.Option("--verify", help="Read runs whole and compare their samples' sha256.")
    ] = False,
) -> None:
    """Show what logs or runs hold: channels, rates, durations, gaps, losses, repairs, setup.

    Of a log without a setup: its columns, topics or datasets, with ranges and likely kinds.
    """
    from tirelog.cli.logs.summary import print_summary
    from tirelog.runs.overview import channel_rows

    with Session(setup, quiet, hashed=True) as session:
        if setup is None and all(undescribed(log) for log in logs):
            _contents(session, logs, output, format)
            return
        if format is None and output is None:
            for recording in session.recordings(logs, blocks=_BLOCKS):
                print_summary(recording)
            _verify(session, logs if verify else [])
            return
        with session.table("info", output, format) as table:
            for recording in session.recordings(logs, blocks=_BLOCKS):
                table.write(channel_rows(recording))
        _verify(session, logs if verify else [])


def undescribed(log: str) -> bool:
    """True for a log without a setup beside it; a run has its own."""
    from tirelog.data.setup import setup_beside
    from tirelog.runs.ingest import is_file
    from tirelog.runs.store import is_run
    from tirelog.storage.remote import address

    if log == "-" or address(log):
        return True
    return setup_beside(log) is None and not (is_file(log) and is_run(log))


def _contents(session: Session, logs: list[str], output: Path | None, format: str | None) -> None:
    """What is in logs that have no setup."""
    from tirelog.cli.logs.contents_page import print_contents
    from tirelog.drafts.contents import rows

    if format is None and output is None:
        for inside in session.contents(logs):
            print_contents(inside)
        return
    with session.table("contents", output, format) as table:
        for inside in session.contents(logs):
            table.write(rows(inside))


def _verify(session: Session, logs: list[str]) -> None:
    """Say which columns of the runs among `logs` are not what was written."""
    from tirelog.runs.ingest import is_file
    from tirelog.runs.store import changed_columns, is_run

    for log in logs:
        for name in changed_columns(log) if is_file(log) and is_run(log) else ():
            session.lost(
                f"{log}: {name} is not what was written (sha256); copy the run again, or ingest "
                "the log again"
            )
