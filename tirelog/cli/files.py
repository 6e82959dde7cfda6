"""Commands of logs and tables: `ingest`, `info`, `setup`, `simulate`, a table of a log, `check`."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from inspect import Parameter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

import tirelog.api as api
from tirelog.cli import options, pages
from tirelog.cli.session import Session, say
from tirelog.errors import ExitStatus, UsageError, printable
from tirelog.vocabulary.tables import LOG_PICTURES, LOG_TABLES, STRETCH, LogTable, TableOption

if TYPE_CHECKING:
    from tirelog.data.recording import Recording
    from tirelog.tables.writer import TableWriter


# ---- `tirelog check TABLE --against TABLE`.


def check(
    table: Annotated[
        Path, typer.Argument(help="The table to check; '-' is csv on standard input.")
    ],
    against: Annotated[Path, typer.Option("--against", help="The earlier table.")],
    tolerance: Annotated[
        list[str] | None,
        typer.Option("--tolerance", help="Absolute tolerance of a column; repeat for several."),
    ] = None,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
) -> None:
    """Compare a table with an earlier one: status 1 and the rows that moved, largest first.

    Rows are matched by the log's path. If the tables share no path they are matched by the log's
    file name, with a note.
    """
    session = Session(None, quiet, output, format)
    found = api.tables.check(table, against, _tolerances(tolerance or []))
    session.note(*found.remarks)
    if found.differences or output is not None:
        session.write("check", [found.columns])
    if found.differences:
        raise typer.Exit(int(ExitStatus.ANSWER_IS_NO))


def _tolerances(texts: list[str]) -> dict[str, float]:
    """`column=value` options as numbers."""
    found = {}
    allowed = "allowed is COLUMN=NUMBER from 0, such as --tolerance speed_m_s=0.001"
    for text in texts:
        name, word = options.assigned(text, "--tolerance ", allowed)
        found[name] = -1.0
        with suppress(ValueError):
            found[name] = float(word)
        if not found[name] >= 0.0:
            raise UsageError(f"--tolerance {text}", allowed=allowed, do="correct it")
    return found


# ---- `tirelog ingest LOG -o run.h5`.


def ingest(
    log: Annotated[str, typer.Argument(help="The log, or '-' for standard input.")],
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", help="The run to write (HDF5).", callback=options.in_a_folder
        ),
    ],
    setup: options.SetupFile = None,
    quiet: options.Quiet = False,
) -> None:
    """Write a log as a run: channels in SI on exact time axes, with its setup, provenance and
    quality flags.
    """
    with Session(setup, quiet) as session:
        with session.working_on(f"reading {log}"):
            summary = api.logs.ingest(log, output, session.setup)
        session.hear(log, summary.remarks, summary.losses)
        if not quiet:
            with api.logs.opened_run(output, log) as recording:
                pages.print_summary(recording)


# ---- `tirelog setup new LOG` and `tirelog setup check LOG`.


NOTHING = "nothing is implausible, missing, unused or guessed"
Log = Annotated[str, typer.Argument(help="A log; '-' is standard input.")]
NewSetup = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        help="Setup file to write; standard output without it.",
        callback=options.in_a_folder,
    ),
]


def new(log: Log, output: NewSetup = None, quiet: options.Quiet = False) -> None:
    """Draft a setup from the content of a log; guesses are marked."""
    made = api.logs.draft_setup(log, output)
    if output is None:
        typer.echo(made.text, nl=False)
    else:
        Session(quiet=quiet).say(
            f"wrote {output}: {made.channels} channels, {made.guesses} guesses to check; next: "
            f"{shlex.join(['tirelog', 'setup', 'check', log, '--setup', str(output)])}"
        )


def check_setup(log: Log, setup: options.SetupFile = None, quiet: options.Quiet = False) -> None:
    """What is implausible, missing, unused or still guessed in the setup of a log."""
    found = api.logs.check_setup(log, setup)
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


# ---- `tirelog simulate SCENARIO -o LOG`.


def simulate(
    scenario: Annotated[
        Path, typer.Argument(help="TOML file: manoeuvres, tire, road, sensors, effects, seed.")
    ],
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            help="The log: .csv, .txt, .mcap or .h5.",
            callback=options.in_a_folder,
        ),
    ],
    seed: Annotated[
        int | None, typer.Option("--seed", help="Seed of the noise; default the scenario's.")
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Write a log with known truth: LOG, LOG.truth.json and its setup.

    A scenario's truth is "beam" or "ring", steady at every instant, or "coupled_ring", a tire that
    moves: over the [road], through all [[manoeuvres]] (segments).
    sample_data/README.md explains the keys.
    """
    session = Session(quiet=quiet)
    with session.working_on(f"driving {scenario}"):
        described, files = api.logs.simulated_log(scenario, output, seed=seed)
    planted = ", ".join(effect.name for effect in described.effects) or "no effect"
    session.note(
        f"{described.duration_s:g} s of log with {planted} planted; "
        f"wrote {', '.join(str(f) for f in files)}"
    )


# ---- `tirelog info LOG`.


#: a log is looked into as far as its first blocks; a run says everything in its metadata
_BLOCKS = 4


def info(
    logs: options.Logs,
    setup: options.SetupFile = None,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
) -> None:
    """Channels of logs or runs: rates, durations, gaps, losses, repairs, setup.

    For a log without a setup: its columns, topics or datasets, with ranges and likely kinds.
    """
    with Session(setup, quiet, output, format, hashed=True) as session:
        if setup is None and not any(api.logs.described(log) for log in logs):
            found = session.contents(logs)
            if session.paged:
                for inside in found:
                    pages.print_contents(inside)
            else:
                session.write("contents", map(api.logs.contents_rows, found))
            return
        recordings = session.recordings(logs, blocks=_BLOCKS)
        if session.paged:
            for recording in recordings:
                pages.print_summary(recording)
        else:
            session.write("info", map(api.logs.channels, recordings))


# ---- `tirelog NAME LOG...` for a table of `vocabulary.tables`, as its entry says.


def table_option(option: TableOption) -> Any:
    """A table's option for typer, with the register's flag and help."""
    return typer.Option(option.flag, help=option.help)


def _write(
    parts: Iterable[tuple[Recording, api.parts.Part]],
    writer: TableWriter,
    picture: api.pictures.TablePicture | None,
    plot: Path | None,
) -> None:
    """Write the rows of parts, and the picture of what it keeps of them."""
    for recording, part in parts:
        if part.columns:
            writer.write(part.columns)
        if picture is not None:
            picture.keep(recording, part)
    if picture is not None and picture.draw(plot) is None:
        say(f"note: {plot} is not written: there are no rows to draw")


def table_command(table: LogTable) -> Callable[..., None]:
    """The command of a table: its options, one call, rows in the given format."""

    def command(**given: Any) -> None:
        asked = {option.name: given[option.name] for option in table.asked}
        plot = given.get("plot")
        picture = None if plot is None else api.pictures.TablePicture(table, asked)
        with (
            Session(given["setup"], given["quiet"], given["output"], given["format"]) as session,
            session.table(table.given(asked)) as writer,
        ):
            parts = session.parts(given["logs"], table.name, given["channel"], **asked)
            _write(parts, writer, picture, plot)

    own: list[tuple[str, Any, Any]] = [
        (option.name, Annotated[option.kind | None, table_option(option)], None)
        if option.kind is not bool
        else (option.name, Annotated[bool, table_option(option)], False)
        for option in table.asked
    ]
    if table.picture:
        own.append(("plot", options.Plot, None))
    shared = (
        ("logs", options.Logs, Parameter.empty),
        ("setup", options.SetupFile, None),
        ("output", options.Output, None),
        ("format", options.Format, None),
        ("channel", options.Channels, None),
        ("quiet", options.Quiet, False),
    )
    options.with_options(
        command,
        (
            Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=kind)
            for name, kind, default in (*shared, *own)
        ),
    )
    command.__doc__ = table.says
    return command


# ---- `tirelog plot WHAT...`.


def plot(
    logs: Annotated[
        list[str],
        typer.Argument(metavar="WHAT", help="Logs or runs; or tables, a model, an answer's JSON."),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Picture to write: .png, .svg or .pdf. Without it a window shows it.",
            callback=options.drawable,
        ),
    ] = None,
    kind: Annotated[
        str,
        typer.Option(
            help=f"What of logs is drawn: {', '.join(LOG_PICTURES)}.",
            autocompletion=options.completing(LOG_PICTURES),
        ),
    ] = "signal",
    setup: options.SetupFile = None,
    channel: options.Channels = None,
    start: Annotated[str | None, table_option(STRETCH[0])] = None,
    stop: Annotated[str | None, table_option(STRETCH[1])] = None,
    quiet: options.Quiet = False,
) -> None:
    """Picture of a log's signals, a table, a model or an answer, on the screen or as a file.

    The content of the files decides. A log needs no setup to be looked at.
    """
    ends = {"start": start, "stop": stop}
    with Session(setup, quiet, drafts=True) as session:
        opened = session.recordings(logs)
        figure = api.pictures.figure_of(logs, opened, kind, channel or (), ends, session.note)
        api.pictures.show(figure, output)


# ---- `tirelog tables LOG... -o FOLDER`.
#
# What the commands of single tables write, in one go: the log is read once and each channel's
# passages are found once, two channels at a time; the rows are those of the single commands.


def tables(
    logs: options.Logs,
    output: Annotated[
        Path,
        typer.Option(
            "-o", "--output", help="Folder to write FOLDER/NAME.csv into.", callback=options.folder
        ),
    ],
    setup: options.SetupFile = None,
    table: Annotated[
        list[str] | None,
        typer.Option(
            "--table",
            help=f"Repeat for several: {', '.join(LOG_TABLES)}. Default: all of a drive that the "
            "logs have channels for.",
            autocompletion=options.completing(LOG_TABLES),
        ),
    ] = None,
    format: Annotated[str, typer.Option("--format", help="csv, ndjson, parquet or json.")] = "csv",
    channel: options.Channels = None,
    start: Annotated[str | None, table_option(STRETCH[0])] = None,
    stop: Annotated[str | None, table_option(STRETCH[1])] = None,
    workers: Annotated[
        int,
        typer.Option(
            "--workers", min=1, help="Channels at a time; each takes some 45 MB for an hour."
        ),
    ] = 2,
    quiet: options.Quiet = False,
) -> None:
    """Several tables in one go, each log read once."""
    from tirelog.storage.whole import all_or_none, make_folder

    api.parts.refuse_other_tables(table or ())
    with Session(setup, quiet, format=format) as session, all_or_none(), ExitStack() as open_tables:

        def made(recording: Recording) -> Iterator[api.parts.Part]:
            parts, unsuited = api.parts.parts_of_drive(
                recording,
                table or (),
                channel or (),
                {"start": start, "stop": stop},
                workers=workers,
                refused_first=len(logs) > 1,
                processes=True,
            )
            session.note(*(f"{recording.log}: no channel for {name}" for name in unsuited))
            return parts

        writers: dict[str, TableWriter] = {}
        for _, part in session.parts_of(logs, made):
            if part.table not in writers:
                make_folder(output)
                writers[part.table] = open_tables.enter_context(
                    session.table(part.table, output.joinpath(f"{part.table}.{format}"))
                )
            writers[part.table].write(part.columns)
        given = [*logs, *(["--setup", str(setup)] if setup is not None else [])]
        page = output.joinpath("report.html")
        session.say(f"next: {shlex.join(['tirelog', 'report', *given, '-o', str(page)])}")


TABLE = LOG_TABLES["phase-shift"]
_OWN = {option.name: table_option(option) for option in TABLE.asked}


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
            help="Calibration file to write: learnt from these logs, and applied to them.",
            callback=options.in_a_folder,
        ),
    ] = None,
    zero: Annotated[str, _OWN["zero"]] = "auto",
    fit_forces: Annotated[
        bool,
        typer.Option("--fit-forces", help="With --calibrate: force maps from the force channels."),
    ] = False,
    start: Annotated[str | None, _OWN["start"]] = None,
    stop: Annotated[str | None, _OWN["stop"]] = None,
    plot: options.Plot = None,
    quiet: options.Quiet = False,
) -> None:
    """Patch width and phase shift from a wheel encoder and an in-tire accelerometer."""
    learns, ends = calibrate is not None, {"start": start, "stop": stop}
    for refused, what, allowed, do in (
        (
            learns and calibration is not None,
            "--calibration and --calibrate",
            "one reads a calibration, the other learns one",
            "give one of them",
        ),
        (
            fit_forces and not learns,
            "--fit-forces without --calibrate",
            "the force maps are part of a calibration",
            "give --calibrate FILE",
        ),
        (
            learns and (start, stop) != (None, None),
            "--calibrate with --from or --to",
            "a calibration is learnt from whole logs",
            "apply it to a stretch with --calibration",
        ),
    ):
        if refused:
            raise UsageError(what, allowed=allowed, do=do)
    applied = api.parts.calibration_notes(calibration)
    asked = {"zero": zero, "calibration": calibration}
    picture = None if plot is None else api.pictures.TablePicture(TABLE, ends)
    with (
        Session(setup, quiet, output, format) as session,
        session.table(TABLE.name, calibration=str(calibration or "")) as writer,
    ):
        if calibrate is None:
            made = session.parts(logs, TABLE.name, channel, **asked, **ends)
        else:
            read = list(session.parts(logs, TABLE.name, channel, forces=True, **asked))
            learnt, rows = api.parts.calibrated([part for _, part in read], forces=fit_forces)
            api.parts.save_calibration(learnt, calibrate)
            applied = learnt.remarks
            made = ((read[0][0], part) for part in rows)
        _write(made, writer, picture, plot)
        session.note(*applied)
