"""`tirelog setup new LOG` and `tirelog setup check LOG`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli import options
from tirelog.cli.session import Session
from tirelog.cli.targets import in_a_folder
from tirelog.errors import ExitStatus, printable

app = typer.Typer(help="Draft the setup of a log, and check one.", no_args_is_help=True)

NOTHING = "nothing is implausible, missing, unused or guessed"
Log = Annotated[str, typer.Argument(help="A log; '-' is standard input.")]
NewSetup = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        help="Setup file to write; standard output without it.",
        callback=in_a_folder,
    ),
]


@app.command("new")
def new(log: Log, output: NewSetup = None, quiet: options.Quiet = False) -> None:
    """Draft a setup from what a log holds; what is guessed is marked."""
    from tirelog.api.setups import draft_setup

    made = draft_setup(log, output)
    if output is None:
        typer.echo(made.text, nl=False)
    else:
        Session(quiet=quiet).say(
            f"wrote {output}: {made.channels} channels, {made.guesses} guesses to look at; next: "
            f"{shlex.join(['tirelog', 'setup', 'check', log, '--setup', str(output)])}"
        )


@app.command("check")
def check(log: Log, setup: options.SetupFile = None, quiet: options.Quiet = False) -> None:
    """Say what is implausible, missing, unused or still guessed in the setup of a log."""
    from tirelog.api.setups import check_setup

    found = check_setup(log, setup)
    lines = [
        f"{name}: {kind}, {rate_Hz:,.6g} Hz, {duration_s:,.6g} s"
        for name, kind, rate_Hz, duration_s in found.channels
    ]
    lines += [f"{one.about}: {one.sentence}" for one in found.findings]
    for line in lines if found.findings else [*lines, NOTHING]:
        typer.echo(printable(line))
    if found.implausible:
        raise typer.Exit(int(ExitStatus.UNUSABLE_REQUEST))
    if found.lost:
        raise typer.Exit(int(ExitStatus.INPUT_LOST))
