"""`tirelog report LOG... -o report.html`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli import options
from tirelog.cli.options import in_a_folder
from tirelog.cli.session import Session


def report(
    logs: Annotated[
        list[str] | None, typer.Argument(help="Logs or runs; '-' is standard input.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="The page to write, .html.", callback=in_a_folder),
    ] = None,
    setup: options.SetupFile = None,
    table: Annotated[
        list[Path] | None, typer.Option("--table", help="A table already made; may be repeated.")
    ] = None,
    campaign: Annotated[
        Path | None, typer.Option("--campaign", help="A campaign's output folder.")
    ] = None,
    model: Annotated[
        Path | None, typer.Option("--model", help="Model file to hold against the logs.")
    ] = None,
    ladder: Annotated[
        Path | None, typer.Option("--ladder", help="The ladder kept beside the model.")
    ] = None,
    channel: options.ChannelName = None,
    effects: options.EffectsFile = None,
    propose: Annotated[
        bool,
        typer.Option(
            "--propose",
            help="If something is unknown: write it down, as `propose` (half a minute and more).",
        ),
    ] = False,
    quiet: options.Quiet = False,
) -> None:
    """Write one offline page: what was recorded, what came of it, where the model fails."""
    os.environ.setdefault(
        "ARROW_DEFAULT_MEMORY_POOL", "system"
    )  # the default one keeps what is freed: 50 MB for an hour's tables
    from tirelog.api.reports import ReportOrder, ReportRequest

    paths, tables = tuple(logs or ()), tuple(table or ())
    order = ReportOrder(
        ReportRequest(paths, setup, model, ladder, campaign, tables, channel, effects, propose),
        output,
    )
    with Session(setup, quiet, hashed=True) as session:
        with session.working() as line:
            line.say("making the page")
            recordings = session.all_recordings(list(paths)) if paths else []
            written = order.make(recordings, session.say)
        session.notes(written)
