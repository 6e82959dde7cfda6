"""`tirelog report LOG... -o report.html`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from tirelog.cli.common import (
    ChannelName,
    EffectsFile,
    Quiet,
    Session,
    SetupFile,
    say,
)
from tirelog.cli.targets import folder, in_a_folder
from tirelog.runtime import one_thread

if TYPE_CHECKING:
    from tirelog.report.build import Report

_FORMATS = ("html", "png")
_SUFFIXES = (".html", ".htm")


def report(
    logs: Annotated[
        list[str] | None,
        typer.Argument(help="Logs or runs; '-' is standard input.", show_default=False),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="The page to write, .html.",
            show_default=False,
            callback=in_a_folder,
        ),
    ] = None,
    setup: SetupFile = None,
    table: Annotated[
        list[Path] | None,
        typer.Option("--table", help="A table already made; may be repeated.", show_default=False),
    ] = None,
    campaign: Annotated[
        Path | None,
        typer.Option("--campaign", help="A campaign's output folder.", show_default=False),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option("--model", help="Model file to hold against the logs.", show_default=False),
    ] = None,
    ladder: Annotated[
        Path | None,
        typer.Option("--ladder", help="The ladder kept beside the model.", show_default=False),
    ] = None,
    channel: ChannelName = None,
    effects: EffectsFile = None,
    propose: Annotated[
        bool,
        typer.Option(
            "--propose",
            help="If something is unknown: write it down, as `propose` (half a minute and more).",
        ),
    ] = False,
    format: Annotated[str, typer.Option("--format", help="html, or png for slides.")] = "html",
    figures: Annotated[
        Path | None,
        typer.Option(
            "--figures", help="Folder for the pictures.", show_default=False, callback=folder
        ),
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Write one offline page: what was recorded, what came of it, where the model fails."""
    one_thread()
    os.environ.setdefault(
        "ARROW_DEFAULT_MEMORY_POOL", "system"
    )  # the default one keeps what is freed: 50 MB for an hour's tables
    from tirelog.report.asked import Asked
    from tirelog.report.build import build

    _possible(logs, output, campaign, format, figures)
    if propose and model is None:
        from tirelog.errors import UsageError

        raise UsageError("--propose asks what a model lacks", do="give the model with --model")
    paths = tuple(logs or ())
    asked = Asked(
        paths, setup, model, ladder, campaign, tuple(table or ()), channel, effects, propose
    )
    with Session(setup, quiet, hashed=True) as session:
        with session.working() as line:
            line.say("making the page")
            made = build(
                session.all_recordings(list(paths)) if paths else [],
                asked,
                (lambda text: None) if quiet else say,
            )
        if output is not None:
            _write_page(made, output, session)
        if format == "png" and figures is not None:
            from tirelog.report.pictures import write_pictures

            written = write_pictures(
                [f for section in made.sections for f in section.figures], figures
            )
            session.note(f"{figures}: {len(written)} pictures")


def _possible(
    logs: list[str] | None,
    output: Path | None,
    campaign: Path | None,
    format: str,
    figures: Path | None,
) -> None:
    """UsageError, before any work, if nothing could come of it."""
    from tirelog.errors import UsageError, refuse_unknown
    from tirelog.report.page import plotting_library

    refuse_unknown(format, _FORMATS, f"--format {format}", do="choose one")
    if not logs and campaign is None:
        raise UsageError(
            "nothing to report on",
            allowed="allowed are logs, runs and --campaign DIR",
            do="give one",
        )
    if (format == "png") != (figures is not None):
        raise UsageError(
            "--format png and --figures DIR belong together", do="give both or neither"
        )
    if output is None and figures is None:
        raise UsageError(
            "nothing to write",
            allowed="allowed are -o PAGE.html and --format png --figures DIR",
            do="add one",
        )
    if output is not None:
        if output.suffix.lower() not in _SUFFIXES and (output.is_file() or not output.exists()):
            raise UsageError(
                f"-o {output}: the page is HTML",
                allowed=f"allowed are the suffixes {', '.join(_SUFFIXES)}",
                do="rename it",
            )
        plotting_library()
    if figures is not None:
        from tirelog.report.pictures import need_matplotlib

        need_matplotlib()


def _write_page(made: Report, output: Path, session: Session) -> None:
    from tirelog.report.page import render
    from tirelog.storage.whole import whole_file

    parts = render(
        made.title,
        made.sections,
        made.missing,
        made.provenance,
        made.commands,
        made.papers,
        made.made,
    )
    with whole_file(output) as part, part.open("w", encoding="utf-8") as stream:
        stream.writelines(parts)
        size = stream.tell()
    session.note(f"{output}: {len(made.sections)} sections, {size / 1e6:.1f} MB")
