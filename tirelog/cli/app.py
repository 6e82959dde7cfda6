"""The command line's table of contents.  Science is imported inside the commands, so that help answers at once."""

from __future__ import annotations

import importlib
import importlib.util
from typing import Annotated, Any

import typer

#: commands in the order of help: module in `tirelog.cli`, and the function or sub-application in it
COMMANDS = (
    ("ingest", "ingest"),
    ("info", "info"),
    ("speed", "speed"),
    ("footprint", "footprint"),
    ("dissipation", "dissipation"),
    ("phase-shift", "phase_shift"),
    ("tables", "tables"),
    ("inflation", "inflation"),
    ("simulate", "simulate"),
    ("effects", "effects"),
    ("model", "app"),
    ("compare", "compare"),
    ("diagnose", "diagnose"),
    ("ladder", "ladder"),
    ("report", "report"),
    ("campaign", "app"),
    ("check", "check"),
)


def _version(asked: bool) -> None:
    if asked:
        from tirelog import __version__

        typer.echo(f"tirelog {__version__}")
        raise typer.Exit()


def _callback(
    version: Annotated[bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")] = False,
) -> None:
    """From the recorded logs of a sensorised tire to tidy tables, and from tables to the physics that a model lacks."""


def command() -> Any:
    """The whole command line as typer's command object."""
    app = typer.Typer(name="tirelog", rich_markup_mode=None, pretty_exceptions_enable=False, no_args_is_help=True)
    app.callback()(_callback)
    for name, attribute in COMMANDS:
        module = f"tirelog.cli.{name.replace('-', '_')}"
        if importlib.util.find_spec(module) is None:
            continue
        target = getattr(importlib.import_module(module), attribute)
        if isinstance(target, typer.Typer):
            app.add_typer(target, name=name)
        else:
            app.command(name)(target)
    return typer.main.get_command(app)
