"""`tirelog phase-shift LOG...`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

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
from tirelog.cli.logs.log_table import table_option
from tirelog.cli.targets import in_a_folder

if TYPE_CHECKING:
    from tirelog.wheel.calibration import Calibration
    from tirelog.wheel.phase_shift import EdgeTimes


def phase_shift(
    logs: Logs,
    setup: SetupFile = None,
    output: Output = None,
    format: Format = None,
    channel: Channels = None,
    calibration: Annotated[Path | None, table_option("phase-shift", "calibration")] = None,
    calibrate: Annotated[
        Path | None,
        typer.Option(
            help="Calibration file to write, learnt from these logs, and applied.",
            show_default=False,
            callback=in_a_folder,
        ),
    ] = None,
    zero: Annotated[str, table_option("phase-shift", "zero")] = "auto",
    fit_forces: Annotated[
        bool,
        typer.Option("--fit-forces", help="With --calibrate: force maps from the force channels."),
    ] = False,
    in_time: Annotated[
        bool,
        typer.Option(
            "--by-time",
            help="Rows of all accelerometers of a log in the order of time.",
        ),
    ] = False,
    plot: Plot = None,
    quiet: Quiet = False,
) -> None:
    """Patch width and phase shift from a wheel encoder and an in-tire accelerometer (P4)."""
    from tirelog.errors import UsageError
    from tirelog.wheel.calibration_file import read_calibration
    from tirelog.wheel.table import by_time, table

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
    applied = read_calibration(calibration) if calibration is not None else None
    with (
        Session(setup, quiet, hashed=keeps_hashes(output, format)) as session,
        session.table("phase-shift", output, format, calibration=str(calibration or "")) as writer,
    ):
        if applied is not None and applied.has_delay:
            session.note(applied.delay_remark)
        kept: list[EdgeTimes] = []
        waiting: list[Mapping[str, object]] = []  # what is known of the log that is being read
        learning = calibrate is not None
        for _, part in session.parts(
            logs, "phase-shift", channel, calibration=applied, zero=zero, forces=learning
        ):
            if not learning and not in_time:
                writer.write(part.columns)
            if in_time and not learning:
                if waiting and waiting[0]["log"] != part.columns["log"]:
                    writer.write(by_time(waiting))
                    waiting = []
                waiting.append(part.columns)
            if learning or plot is not None:
                kept.append(part.found)
        if calibrate is not None:
            applied = _learn(session, kept, calibrate, fit_forces)
            tables = [table(passages, applied) for passages in kept]
            if in_time:
                logs_of = dict.fromkeys(str(one["log"]) for one in tables)
                tables = [by_time([t for t in tables if t["log"] == log]) for log in logs_of]
            for one in tables:
                writer.write(one)
        if waiting:
            writer.write(by_time(waiting))
        if applied is None:
            session.note(
                "no calibration: the detrended and corrected columns are empty; learn one with "
                "--calibrate FILE"
            )
        if plot is not None:
            from tirelog.plots.tables.phase_shift import plot_phase_shift

            plot_phase_shift(kept, applied, plot)


def _learn(session: Session, kept: list[EdgeTimes], path: Path, forces: bool) -> Calibration:
    """Learn, write and describe a calibration."""
    from tirelog.wheel.calibration import calibrate
    from tirelog.wheel.calibration_file import write_calibration

    learnt = calibrate(kept, forces)
    write_calibration(path, learnt)
    for remark in learnt.remarks:
        session.note(remark)
    return learnt
