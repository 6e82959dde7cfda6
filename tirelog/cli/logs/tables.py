"""`tirelog tables LOG... -o FOLDER`.

What `speed`, `footprint`, `dissipation` and `phase-shift` write, in one go.

The log is read once and each channel's passages are found once, two channels at a time; the rows
are those of the single commands.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tirelog.cli import completion
from tirelog.cli.common import Channels, Logs, Quiet, Session, SetupFile, keeps_hashes
from tirelog.cli.targets import folder
from tirelog.runtime import one_thread

if TYPE_CHECKING:
    from tirelog.data.recording import Recording


def tables(
    logs: Logs,
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            help="Folder to write FOLDER/NAME.csv into.",
            show_default=False,
            callback=folder,
        ),
    ],
    setup: SetupFile = None,
    table: Annotated[
        list[str] | None,
        typer.Option(
            "--table",
            help="One of the tables; without it all that the logs have channels for.",
            autocompletion=completion.tables,
        ),
    ] = None,
    format: Annotated[str, typer.Option("--format", help="csv, ndjson, parquet or json.")] = "csv",
    channel: Channels = None,
    workers: Annotated[
        int,
        typer.Option(
            "--workers",
            min=1,
            help="Channels worked on at a time; each takes some 45 MB for an hour.",
        ),
    ] = 2,
    quiet: Quiet = False,
) -> None:
    """Make several tables in one go, each log read once."""
    one_thread()
    from tirelog.errors import UsageError, refuse_unknown
    from tirelog.products import OF_A_DRIVE, Part, tables_of, with_channels
    from tirelog.storage.whole import all_or_none, make_folder
    from tirelog.tables.writer import TableWriter, table_format

    for name in table or ():
        refuse_unknown(name, OF_A_DRIVE, f"--table {name}", do="choose among them")
    suffix = table_format(None, format)
    with (
        Session(setup, quiet, hashed=keeps_hashes(None, format)) as session,
        all_or_none(),
        ExitStack() as open_tables,
    ):

        def made(recording: Recording) -> Iterator[Part]:
            if channel:
                recording = with_channels(recording, channel, table or OF_A_DRIVE)
            suited = [name for name in table or OF_A_DRIVE if OF_A_DRIVE[name].suits(recording)]
            for name in set(table or ()) - set(suited):
                session.note(f"{recording.log}: no channel for {name}")
            if not suited:
                raise UsageError(
                    f"no channel for {' or '.join(table or OF_A_DRIVE)}",
                    allowed="see `tirelog info`",
                    do="name one in the setup",
                    file=recording.log,
                )
            wanted: dict[str, dict[str, Any]] = {name: {} for name in suited}
            return tables_of(recording, wanted, workers, refused_first=len(logs) > 1)

        writers: dict[str, TableWriter] = {}
        for _, part in session.parts_of(logs, made):
            if part.table not in writers:
                make_folder(output)
                writers[part.table] = open_tables.enter_context(
                    session.table(part.table, output / f"{part.table}.{suffix}", format)
                )
            writers[part.table].write(part.columns)
