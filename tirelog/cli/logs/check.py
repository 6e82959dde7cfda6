"""`tirelog check TABLE --against TABLE`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli.common import Format, Output, say
from tirelog.errors import ExitStatus, UsageError


def check(
    table: Annotated[
        Path,
        typer.Argument(
            help="The table to check; '-' is csv on standard input.", show_default=False
        ),
    ],
    against: Annotated[
        Path, typer.Option("--against", help="The table it should agree with.", show_default=False)
    ],
    tolerance: Annotated[
        list[str] | None,
        typer.Option("--tolerance", help="COLUMN=VALUE, absolute; may be repeated."),
    ] = None,
    bless: Annotated[
        bool,
        typer.Option("--bless", help="Write TABLE over the one it is checked against, on purpose."),
    ] = False,
    output: Output = None,
    format: Format = None,
) -> None:
    """Compare a table with an earlier one: status 1 and the rows that moved, largest first.

    Rows are matched by the log's path as it was typed; if not one path is in both tables, by the
    log's file name, which is said.
    """
    from tirelog.storage.whole import whole_file
    from tirelog.tables.check import as_table, differences, of_like_logs, summary
    from tirelog.tables.writer import TableWriter, read_table

    if bless:
        if str(table) == "-":
            raise UsageError(
                "--bless wants a file",
                allowed="standard input cannot be copied",
                do="write the table with -o first",
            )
        read_table(table)  # nothing that is no table takes the other's place
        with whole_file(against) as part:
            part.write_bytes(table.read_bytes())
        say(f"note: {against} is now {table}")
        return
    new, old, remark = of_like_logs(read_table(table), read_table(against))
    found = differences(new, old, _tolerances(tolerance or []))
    for line in (remark, summary(found)):
        if line:
            say(f"note: {line}")
    if found or output is not None:
        with TableWriter("check", output, format) as writer:
            writer.write(as_table(found))
    if found:
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
