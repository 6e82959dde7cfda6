"""`tirelog phase-shift LOG...`, which also learns a calibration."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from inspect import Parameter, Signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tirelog.cli import options
from tirelog.cli.options import folder, in_a_folder
from tirelog.cli.session import Session
from tirelog.vocabulary.tables import LOG_TABLES, LogTable, TableOption

if TYPE_CHECKING:
    from tirelog.api.parts import Part
    from tirelog.data.recording import Recording
    from tirelog.tables.writer import TableWriter


# ---- `tirelog NAME LOG...` for a table of `vocabulary.tables`, as its entry says.


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


# ---- `tirelog tables LOG... -o FOLDER`.
#
# What the commands of single tables write, in one go: the log is read once and each channel's
# passages are found once, two channels at a time; the rows are those of the single commands.


def tables(
    logs: options.Logs,
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", help="Folder to write FOLDER/NAME.csv into.", callback=folder
        ),
    ],
    setup: options.SetupFile = None,
    table: Annotated[
        list[str] | None,
        typer.Option(
            "--table",
            help="One of the tables; without it all that the logs have channels for.",
            autocompletion=options.tables,
        ),
    ] = None,
    format: Annotated[str, typer.Option("--format", help="csv, ndjson, parquet or json.")] = "csv",
    channel: options.Channels = None,
    workers: Annotated[
        int,
        typer.Option(
            "--workers",
            min=1,
            help="Channels worked on at a time; each takes some 45 MB for an hour.",
        ),
    ] = 2,
    quiet: options.Quiet = False,
) -> None:
    """Make several tables in one go, each log read once."""
    from tirelog.api.parts import parts_of_drive, refuse_other_tables
    from tirelog.storage.whole import all_or_none, make_folder

    refuse_other_tables(table or ())
    with Session(setup, quiet, format=format) as session, all_or_none(), ExitStack() as open_tables:

        def made(recording: Recording) -> Iterator[Part]:
            parts, unsuited = parts_of_drive(
                recording,
                table or (),
                channel or (),
                workers=workers,
                refused_first=len(logs) > 1,
                processes=True,
            )
            session.notes(f"{recording.log}: no channel for {name}" for name in unsuited)
            return parts

        writers: dict[str, TableWriter] = {}
        for _, part in session.parts_of(logs, made):
            if part.table not in writers:
                make_folder(output)
                writers[part.table] = open_tables.enter_context(
                    session.table(part.table, output.joinpath(f"{part.table}.{format}"))
                )
            writers[part.table].write(part.columns)


TABLE = LOG_TABLES["phase-shift"]
_OWN = {option.name: table_option(option) for option in (*TABLE.options, *TABLE.views)}


def phase_shift(
    logs: options.Logs,
    setup: options.SetupFile = None,
    output: options.Output = None,
    format: options.Format = None,
    channel: options.Channels = None,
    calibration: Annotated[Path | None, _OWN["calibration"]] = None,
    calibrate: Annotated[
        Path | None,
        typer.Option(
            help="Calibration file to write, learnt from these logs, and applied.",
            callback=in_a_folder,
        ),
    ] = None,
    zero: Annotated[str, _OWN["zero"]] = "auto",
    fit_forces: Annotated[
        bool,
        typer.Option("--fit-forces", help="With --calibrate: force maps from the force channels."),
    ] = False,
    by_time: Annotated[bool, _OWN["by_time"]] = False,
    plot: options.Plot = None,
    quiet: options.Quiet = False,
) -> None:
    """Patch width and phase shift from a wheel encoder and an in-tire accelerometer (P4)."""
    from tirelog.api.parts import TablePicture, calibrated, calibration_notes, save_calibration
    from tirelog.errors import UsageError

    if calibration is not None and calibrate is not None:
        raise UsageError(
            "--calibration and --calibrate",
            allowed="one reads a calibration, the other learns one",
            do="give one of them",
        )
    if fit_forces and calibrate is None:
        raise UsageError(
            "--fit-forces without --calibrate",
            allowed="the force maps are part of a calibration",
            do="give --calibrate FILE",
        )
    applied = calibration_notes(calibration)
    picture = TablePicture(TABLE)
    asked = {"zero": zero, "calibration": calibration}
    with (
        Session(setup, quiet, output, format) as session,
        session.table(TABLE.name, calibration=str(calibration or "")) as writer,
    ):
        if calibrate is None:
            made = session.parts(logs, TABLE.name, channel, by_time=by_time, **asked)
        else:
            read = list(session.parts(logs, TABLE.name, channel, forces=True, **asked))
            learnt, rows = calibrated(
                [part for _, part in read], forces=fit_forces, by_time=by_time
            )
            save_calibration(learnt, calibrate)
            applied = learnt.remarks
            made = ((read[0][0], part) for part in rows)
        for recording, part in made:
            writer.write(part.columns)
            if plot is not None:
                picture.keep(recording, part)
        session.notes(applied)
        if plot is not None:
            picture.draw(plot)
