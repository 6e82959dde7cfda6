"""`tirelog check TABLE --against TABLE`."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli import options
from tirelog.cli.options import in_a_folder
from tirelog.cli.session import Session
from tirelog.errors import ExitStatus, UsageError, printable


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


# ---- `tirelog ingest LOG -o run.h5`.


def ingest(
    log: Annotated[str, typer.Argument(help="The log, or '-' for standard input.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="The run to write (HDF5).", callback=in_a_folder)
    ],
    setup: options.SetupFile = None,
    quiet: options.Quiet = False,
) -> None:
    """Write a log as a run: channels in SI on exact time axes, with its setup, provenance and
    quality flags.
    """
    from tirelog.api import logs
    from tirelog.cli.pages import print_summary

    with Session(setup, quiet) as session:
        with session.working() as line:
            line.say(f"reading {log}")
            summary = logs.ingest(log, output, session.setup())
        session.notes(f"{log}: {remark}" for remark in summary.remarks)
        for loss in summary.losses:
            session.lost(f"{log}: {loss}")
        if not quiet:
            with logs.opened_run(output, log) as recording:
                print_summary(recording)


# ---- `tirelog setup new LOG` and `tirelog setup check LOG`.


app = typer.Typer(help="Draft the setup of a log, and check one.", no_args_is_help=True)

NOTHING = "nothing is implausible, missing, unused or guessed"
Log = Annotated[str, typer.Argument(help="A log; '-' is standard input.")]
NewSetup = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        help="Setup file to write; standard output without it.",
        callback=in_a_folder,
    ),
]


@app.command("new")
def new(log: Log, output: NewSetup = None, quiet: options.Quiet = False) -> None:
    """Draft a setup from what a log holds; what is guessed is marked."""
    from tirelog.api.setups import draft_setup

    made = draft_setup(log, output)
    if output is None:
        typer.echo(made.text, nl=False)
    else:
        Session(quiet=quiet).say(
            f"wrote {output}: {made.channels} channels, {made.guesses} guesses to look at; next: "
            f"{shlex.join(['tirelog', 'setup', 'check', log, '--setup', str(output)])}"
        )


@app.command("check")
def check_setup(log: Log, setup: options.SetupFile = None, quiet: options.Quiet = False) -> None:
    """Say what is implausible, missing, unused or still guessed in the setup of a log."""
    from tirelog.api.setups import check_setup

    found = check_setup(log, setup)
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
            "-o", "--output", help="The log: .csv, .txt, .mcap or .h5.", callback=in_a_folder
        ),
    ],
    seed: Annotated[
        int | None, typer.Option("--seed", help="Another seed than the scenario's.")
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Write a log with known truth: LOG, LOG.truth.json and its setup.

    A scenario's truth is "beam" or "ring", steady at every instant, or "coupled_ring", a tire that
    moves: over the [road] (flat, step, cleat, sine, profile), under [[load_steps]], through every
    [[manoeuvres]]. The keys are explained in sample_data/README.md.
    """
    from tirelog.api.simulated import simulated_log

    session = Session(quiet=quiet)
    with session.working() as line:
        line.say(f"driving {scenario}")
        described, files = simulated_log(scenario, output, seed=seed)
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
    verify: Annotated[
        bool, typer.Option("--verify", help="Read runs whole and compare their samples' sha256.")
    ] = False,
) -> None:
    """Show what logs or runs hold: channels, rates, durations, gaps, losses, repairs, setup.

    Of a log without a setup: its columns, topics or datasets, with ranges and likely kinds.
    """
    from tirelog.api.logs import changed, channels, described

    with Session(setup, quiet, output, format, hashed=True) as session:
        if setup is None and not any(described(log) for log in logs):
            _contents(session, logs)
            return
        if session.paged:
            from tirelog.cli import pages

            for recording in session.recordings(logs, blocks=_BLOCKS):
                pages.print_summary(recording)
        else:
            with session.table("info") as table:
                for recording in session.recordings(logs, blocks=_BLOCKS):
                    table.write(channels(recording))
        for log in logs if verify else ():
            for name in changed(log):
                session.lost(
                    f"{log}: {name} is not what was written (sha256); copy the run again, or "
                    "ingest the log again"
                )


def _contents(session: Session, logs: list[str]) -> None:
    """What is in logs that have no setup."""
    from tirelog.api.setups import contents_rows
    from tirelog.cli.pages import print_contents

    if session.paged:
        for inside in session.contents(logs):
            print_contents(inside)
        return
    with session.table("contents") as table:
        for inside in session.contents(logs):
            table.write(contents_rows(inside))
