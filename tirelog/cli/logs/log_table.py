"""`tirelog NAME LOG...` for a table of `vocabulary.tables`, as its entry says."""

from __future__ import annotations

from collections.abc import Callable
from inspect import Parameter, Signature
from typing import Annotated, Any

import typer

from tirelog.cli import options
from tirelog.cli.session import Session
from tirelog.vocabulary.tables import LogTable, TableOption


def table_option(option: TableOption) -> Any:
    """A table's option as typer takes it, with the register's flag and help."""
    return typer.Option(option.flag, help=option.help)


def table_command(table: LogTable) -> Callable[..., None]:
    """The command of a table: its options, one call, rows in the format that is asked for."""

    def command(**given: Any) -> None:
        asked = {option.name: given[option.name] for option in (*table.options, *table.views)}
        plot, kind = given.get("plot"), given.get("kind", "page")
        options.refuse_kind_alone(kind, plot)
        picture = None
        with (
            Session(given["setup"], given["quiet"], given["output"], given["format"]) as session,
            session.table(table.given(asked)) as writer,
        ):
            for recording, part in session.parts(
                given["logs"], table.name, given["channel"], **asked
            ):
                if part.columns:
                    writer.write(part.columns)
                if plot is not None:
                    from tirelog.api.parts import TablePicture

                    picture = picture or TablePicture(table, kind)
                    picture.keep(recording, part)
            if plot is not None and picture is not None:
                picture.draw(plot)

    _give_parameters(command, table)
    command.__doc__ = table.says
    return command


def _give_parameters(command: Callable[..., None], table: LogTable) -> None:
    """Give the command the parameters that typer reads: those of every table, then its own."""
    parameters: list[tuple[str, Any, Any]] = [
        ("logs", options.Logs, Parameter.empty),
        ("setup", options.SetupFile, None),
        ("output", options.Output, None),
        ("format", options.Format, None),
        ("channel", options.Channels, None),
        ("quiet", options.Quiet, False),
    ]
    for option in (*table.options, *table.views):
        switch = option.kind is bool
        of = bool if switch else option.kind | None
        first = False if switch else None
        parameters.append((option.name, Annotated[of, table_option(option)], first))
    if table.picture:
        parameters.append(("plot", options.Plot, None))
    if table.pictures:
        kinds = Annotated[str, options.plot_kind(table.pictures)]
        parameters.append(("kind", kinds, next(iter(table.pictures))))
    command.__annotations__ = {name: kind for name, kind, _ in parameters} | {"return": None}
    typed = [
        Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=kind)
        for name, kind, default in parameters
    ]
    vars(command).update(__signature__=Signature(typed))
