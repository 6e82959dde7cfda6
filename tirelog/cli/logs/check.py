"""`tirelog check TABLE --against TABLE`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli import options
from tirelog.cli.session import Session
from tirelog.errors import ExitStatus, UsageError


def check(
    table: Annotated[
        Path, typer.Argument(help="The table to check; '-' is csv on standard input.")
    ],
    against: Annotated[Path, typer.Option("--against", help="The table it should agree with.")],
    tolerance: Annotated[
        list[str] | None,
        typer.Option("--tolerance", help="COLUMN=VALUE, absolute; may be repeated."),
    ] = None,
    bless: Annotated[
        bool,
        typer.Option("--bless", help="Write TABLE over the one it is checked against, on purpose."),
    ] = False,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
) -> None:
    """Compare a table with an earlier one: status 1 and the rows that moved, largest first.

    Rows are matched by the log's path as it was typed; if not one path is in both tables, by the
    log's file name, which is said.
    """
    from tirelog.api import checks

    session = Session(None, quiet, output, format)
    if bless:
        checks.bless(table, against)
        session.note(f"{against} is now {table}")
        return
    found = checks.check(table, against, _tolerances(tolerance or []))
    session.notes(found.remarks)
    if found.differences or output is not None:
        with session.table("check") as writer:
            writer.write(found.columns)
    if found.differences:
        raise typer.Exit(int(ExitStatus.ANSWER_IS_NO))


def _tolerances(texts: list[str]) -> dict[str, float]:
    """`column=value` options as numbers."""
    out = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            out[name] = float(value)
        except ValueError:
            raise UsageError(
                f"--tolerance {text}: not COLUMN=NUMBER",
                allowed="e.g. --tolerance speed_m_s=0.001",
                do="mend it",
            ) from None
        if not out[name] >= 0:
            raise UsageError(
                f"--tolerance {text}: below zero",
                allowed="allowed is a number from 0",
                do="mend it",
            )
    return out
