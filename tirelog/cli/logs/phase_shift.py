"""`tirelog phase-shift LOG...`, which also learns a calibration."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from tirelog.cli import options
from tirelog.cli.logs.log_table import table_option
from tirelog.cli.session import Session
from tirelog.cli.targets import in_a_folder
from tirelog.vocabulary.tables import LOG_TABLES

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
