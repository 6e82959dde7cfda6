"""`tirelog info LOG`."""

from __future__ import annotations

from tirelog.cli.common import Format, Logs, Output, Quiet, Session, SetupFile

#: a log is looked into as far as its first blocks; a run says everything in its metadata
_BLOCKS = 4


def info(logs: Logs, setup: SetupFile = None, output: Output = None, format: Format = None, quiet: Quiet = False) -> None:
    """Show what is in logs or runs: channels, rates, durations, gaps, lost samples, repairs, setup."""
    from tirelog.cli.summary import print_summary
    from tirelog.overview import channel_rows

    with Session(setup, quiet, hashed=True) as session:
        if format is None and output is None:
            for recording in session.recordings(logs, blocks=_BLOCKS):
                print_summary(recording)
            return
        with session.table("info", output, format) as table:
            for recording in session.recordings(logs, blocks=_BLOCKS):
                table.write(channel_rows(recording))
