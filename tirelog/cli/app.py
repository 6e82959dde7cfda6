"""The command line's table of contents.

Science is imported inside the commands, so that help answers at once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial, wraps
from pathlib import Path
from pkgutil import resolve_name
from typing import Annotated, Any

import typer

from tirelog.vocabulary.tables import LOG_TABLES, LogTable

#: a table whose command does more than write it
OF_THEIR_OWN = {"phase-shift": "log_tables:phase_shift"}
#: commands in the order of help: module in `tirelog.cli`, and the function or sub-application in
#: it; the tables of `vocabulary.tables` stand before `tables` if of a drive, else after it
BEFORE_TABLES = {"ingest": "files:ingest", "info": "files:info"}
AFTER_TABLES = {
    "setup": "files:app",
    "simulate": "files:simulate",
    "effects": "model:effects",
    "model": "model:app",
    "compare": "answers:compare",
    "diagnose": "answers:diagnose",
    "propose": "answers:propose",
    "form": "answers:form",
    "ladder": "answers:ladder",
    "report": "report:report",
    "campaign": "campaign:app",
    "check": "files:check",
}


def _commands() -> Iterator[tuple[str, Callable[[], Any]]]:
    """Every command's name, and what imports the function or sub-application behind it."""

    def own(place: str) -> Any:
        return resolve_name(f"tirelog.cli.{place}")

    def of_table(name: str, table: LogTable) -> Any:
        from tirelog.cli.log_tables import table_command

        return own(OF_THEIR_OWN[name]) if name in OF_THEIR_OWN else table_command(table)

    def of_a_log(driven: bool) -> Iterator[tuple[str, Callable[[], Any]]]:
        for name, table in LOG_TABLES.items():
            if table.driven == driven:
                yield name, partial(of_table, name, table)

    yield from ((name, partial(own, place)) for name, place in BEFORE_TABLES.items())
    yield from of_a_log(driven=True)
    yield "tables", partial(own, "log_tables:tables")
    yield from of_a_log(driven=False)
    yield from ((name, partial(own, place)) for name, place in AFTER_TABLES.items())


def _version(asked: bool) -> None:
    if asked:
        from tirelog.version import __version__

        typer.echo(f"tirelog {__version__}")
        raise typer.Exit()


def _callback(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """From the recorded logs of a sensorised tire to tidy tables, and from tables to the physics
    that a model lacks.
    """


#: marks a command that keeps its inputs: groups are asked for more than once in a process
_KEEPS = "keeps_inputs"
#: options that name what a command writes; every other path, and every log, is an input
OUTPUTS = ("output", "new_model", "plot", "save", "calibrate")


def _keep_inputs(given: dict[str, Any]) -> None:
    """Tell which files a command reads, before it does.

    A command that writes a `new_model` edits its `model`, which the new one may replace.

    UsageError: it would write on another of them, or two outputs on one file.
    """
    from tirelog.storage.whole import refuse_inputs, refuse_one_for_two, taken_as_input

    outputs = (*OUTPUTS, "against") if given.get("bless") else OUTPUTS
    edited = given.get("model") if "new_model" in given else None
    for place in _inputs(given, outputs if edited is None else (*outputs, "model")):
        if str(place) == "-":
            taken_as_input(0, "standard input")
        else:
            taken_as_input(place)
    if edited is not None:
        taken_as_input(edited, edited=True)
    written = [given[name] for name in outputs if given.get(name) is not None]
    refuse_inputs(*written)
    refuse_one_for_two(*written)
    refuse_inputs(1, name="standard output")


def _inputs(given: dict[str, Any], outputs: tuple[str, ...]) -> Iterator[Path | str]:
    """The paths among a command's arguments that it reads, and the setups beside its logs."""
    for name, value in given.items():
        several = value if isinstance(value, list | tuple) else [value]
        logs = name in ("log", "logs")
        for path in several:
            if name not in outputs and (isinstance(path, Path) or (logs and isinstance(path, str))):
                yield path
        if logs and given.get("setup") is None:
            from tirelog.data.setup import setup_beside

            yield from filter(None, map(setup_beside, filter(None, several)))


def _kept(callback: Callable[..., Any]) -> Callable[..., Any]:
    """A command that knows its inputs before it starts.

    typer calls it with what it has made of the command line: paths are paths.
    """

    @wraps(callback)
    def keeping(**given: Any) -> Any:
        _keep_inputs(given)
        return callback(**given)

    setattr(keeping, _KEEPS, True)
    return keeping


def _keep_all(commands: typer.Typer) -> typer.Typer:
    """The commands, and those below them, so that none writes on its inputs."""
    for known in commands.registered_commands:
        if known.callback is not None and not hasattr(known.callback, _KEEPS):
            known.callback = _kept(known.callback)
    for group in commands.registered_groups:
        if group.typer_instance is not None:
            _keep_all(group.typer_instance)
    return commands


def command(asked: str = "") -> Any:
    """The command line as typer's command object: the command `asked` for alone, else the whole.

    The whole also if there is no such command. One alone is made in 10 ms, the whole in 55 (CPU, 23
    November 2026, Python 3.11).
    """
    from tirelog.cli.help import GroupedHelp, PlainHelp, dress

    app = typer.Typer(
        name="tirelog",
        cls=GroupedHelp,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_callback)
    commands = dict(_commands())
    for name in [asked] if asked in commands else commands:
        target = commands[name]()
        if isinstance(target, typer.Typer):
            app.add_typer(target, name=name, cls=PlainHelp)
        else:
            app.command(name)(target)
    parsed = typer.main.get_command(_keep_all(app))
    dress(parsed)
    return parsed
