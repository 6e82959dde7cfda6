"""`tirelog NAME LOG...` for a table of `vocabulary.tables`, as its entry says.

A table whose command does more than write it has a module of its own in this folder.
"""

from __future__ import annotations

from collections.abc import Callable
from inspect import Parameter, Signature
from pkgutil import resolve_name
from typing import Annotated, Any

import typer

from tirelog.cli.common import (
    Channels,
    Format,
    Logs,
    Output,
    Plot,
    Quiet,
    Session,
    SetupFile,
    keeps_hashes,
)
from tirelog.vocabulary.tables import LOG_TABLES, LogTable, TableOption


def table_option(table: str, name: str) -> Any:
    """The option `name` of a table as typer takes it, with the register's flag and help."""
    (option,) = [option for option in LOG_TABLES[table].options if option.name == name]
    return _shown(option)


def _shown(option: TableOption) -> Any:
    return typer.Option(option.flag, help=option.help)


def table_command(table: LogTable) -> Callable[..., None]:
    """The command of a table: its options, one call, rows in the format that is asked for."""

    def command(**given: Any) -> None:
        options = {option.name: given[option.name] for option in table.options}
        output, format, plot = given["output"], given["format"], given.get("plot")
        kept = []
        with (
            Session(given["setup"], given["quiet"], hashed=keeps_hashes(output, format)) as session,
            session.table(table.name, output, format) as writer,
        ):
            for recording, part in session.parts(
                given["logs"], table.name, given["channel"], **options
            ):
                writer.write(part.columns)
                if plot is not None:
                    kept.append((recording, part.columns if table.draws_rows else part.found))
            if plot is not None and kept:
                resolve_name(table.picture)(kept, plot)

    _give_parameters(command, table)
    command.__doc__ = table.says
    return command


def _give_parameters(command: Callable[..., None], table: LogTable) -> None:
    """Give the command the parameters that typer reads: those of every table, then its own."""
    parameters: list[tuple[str, Any, Any]] = [
        ("logs", Logs, Parameter.empty),
        ("setup", SetupFile, None),
        ("output", Output, None),
        ("format", Format, None),
        ("channel", Channels, None),
        ("quiet", Quiet, False),
    ]
    for option in table.options:
        switch = option.kind is bool
        kind = bool if switch else option.kind | None
        parameters.append((option.name, Annotated[kind, _shown(option)], False if switch else None))
    if table.picture:
        parameters.append(("plot", Plot, None))
    command.__annotations__ = {name: kind for name, kind, _ in parameters} | {"return": None}
    taken = [
        Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=kind)
        for name, kind, default in parameters
    ]
    vars(command).update(__signature__=Signature(taken))
