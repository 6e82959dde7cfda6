"""`tirelog tables LOG... -o FOLDER`.

What the commands of single tables write, in one go: the log is read once and each channel's
passages are found once, two channels at a time; the rows are those of the single commands.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tirelog.cli import completion, options
from tirelog.cli.session import Session
from tirelog.cli.targets import folder

if TYPE_CHECKING:
    from tirelog.api.parts import Part
    from tirelog.data.recording import Recording
    from tirelog.tables.writer import TableWriter


def tables(
    logs: options.Logs,
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", help="Folder to write FOLDER/NAME.csv into.", callback=folder
        ),
    ],
    setup: options.SetupFile = None,
    table: Annotated[
        list[str] | None,
        typer.Option(
            "--table",
            help="One of the tables; without it all that the logs have channels for.",
            autocompletion=completion.tables,
        ),
    ] = None,
    format: Annotated[str, typer.Option("--format", help="csv, ndjson, parquet or json.")] = "csv",
    channel: options.Channels = None,
    workers: Annotated[
        int,
        typer.Option(
            "--workers",
            min=1,
            help="Channels worked on at a time; each takes some 45 MB for an hour.",
        ),
    ] = 2,
    quiet: options.Quiet = False,
) -> None:
    """Make several tables in one go, each log read once."""
    from tirelog.api.parts import parts_of_drive, refuse_other_tables
    from tirelog.storage.whole import all_or_none, make_folder

    refuse_other_tables(table or ())
    with Session(setup, quiet, format=format) as session, all_or_none(), ExitStack() as open_tables:

        def made(recording: Recording) -> Iterator[Part]:
            parts, unsuited = parts_of_drive(
                recording,
                table or (),
                channel or (),
                workers=workers,
                refused_first=len(logs) > 1,
                processes=True,
            )
            session.notes(f"{recording.log}: no channel for {name}" for name in unsuited)
            return parts

        writers: dict[str, TableWriter] = {}
        for _, part in session.parts_of(logs, made):
            if part.table not in writers:
                make_folder(output)
                writers[part.table] = open_tables.enter_context(
                    session.table(part.table, output.joinpath(f"{part.table}.{format}"))
                )
            writers[part.table].write(part.columns)
