"""`tirelog setup new LOG` and `tirelog setup check LOG`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli.common import Quiet, Session, SetupFile, say
from tirelog.cli.targets import in_a_folder
from tirelog.errors import ExitStatus, printable

app = typer.Typer(help="Draft the setup of a log, and check one.", no_args_is_help=True)
#: a log is looked into as far as its first blocks
_BLOCKS = 48

Log = Annotated[str, typer.Argument(help="A log; '-' is standard input.", show_default=False)]
NewSetup = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        help="Setup file to write; standard output without it.",
        show_default=False,
        callback=in_a_folder,
    ),
]


@app.command("new")
def new(log: Log, output: NewSetup = None, quiet: Quiet = False) -> None:
    """Draft a setup from what a log holds; what is guessed is marked."""
    from tirelog.drafts.setup import draft
    from tirelog.storage.whole import whole_file

    made = draft(log)
    if output is None:
        typer.echo(made.text, nl=False)
        return
    with whole_file(output) as part:
        part.write_text(made.text, encoding="utf-8")
    if not quiet:
        say(
            f"wrote {output}: {made.channels} channels, {made.guesses} guesses to look at; next: "
            f"tirelog setup check {log} --setup {output}"
        )


@app.command("check")
def check(log: Log, setup: SetupFile = None, quiet: Quiet = False) -> None:
    """Say what is implausible, missing, unused or still guessed in the setup of a log."""
    from tirelog.drafts.check import findings
    from tirelog.runs.ingest import open_recording

    with Session(setup, quiet) as session:
        given = session.setup()
        with open_recording(log, given, blocks=_BLOCKS, check=False) as recording:
            found = findings(recording, log)
            for name, channel in recording.channels.items():
                rate = f"{channel.axis.rate_Hz:,.6g} Hz"
                typer.echo(
                    printable(f"{name}: {channel.kind}, {rate}, {channel.axis.duration_s:,.6g} s")
                )
            for one in found:
                typer.echo(printable(f"{one.about}: {one.sentence}"))
            if not found:
                typer.echo("nothing is implausible, missing, unused or guessed")
            lost = bool(recording.losses)
    if any(one.about == "implausible" for one in found):
        raise typer.Exit(int(ExitStatus.UNUSABLE_REQUEST))
    if lost:
        raise typer.Exit(int(ExitStatus.INPUT_LOST))
