"""`tirelog report LOG... -o report.html`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli.common import Logs, Quiet, Session, SetupFile


def report(
    logs: Logs,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="The page to write, .html.", show_default=False)] = None,
    setup: SetupFile = None,
    table: Annotated[list[Path] | None, typer.Option("--table", help="A table already made; may be repeated.", show_default=False)] = None,
    quiet: Quiet = False,
) -> None:
    """Write one offline page: what was recorded, what came of it, where the model fails."""
    from tirelog.errors import UsageError
    from tirelog.files import whole_file
    from tirelog.report.build import build, given_tables
    from tirelog.report.page import plotting_library, render

    if output is None:
        raise UsageError("nothing to write; allowed is -o PAGE.html; add it")
    plotting_library()  # before the work: without it there is no page
    with Session(setup, quiet) as session:
        given = given_tables(table or [])
        made = build(session.all_recordings(logs), given, setup)
        page = render(made.title, made.sections, made.missing, made.provenance, made.commands)
        with whole_file(output) as part:
            part.write_text(page, encoding="utf-8")
        session.note(f"{output}: {len(made.sections)} sections, {len(page.encode()) / 1e6:.1f} MB")
