"""`tirelog speed LOG...`."""

from __future__ import annotations

from typing import Annotated

import typer

from tirelog.cli.common import Format, Logs, Output, Quiet, Session, SetupFile, keeps_hashes


def speed(
    logs: Logs,
    setup: SetupFile = None,
    output: Output = None,
    format: Format = None,
    quiet: Quiet = False,
    calibrate_radius: Annotated[
        bool,
        typer.Option(
            "--calibrate-radius",
            help="Take the rolling radius from the log's vehicle_speed, with its error.",
        ),
    ] = False,
) -> None:
    """Tell the speed at each passage of the patch, with standard error and acceleration."""
    with (
        Session(setup, quiet, hashed=keeps_hashes(output, format)) as session,
        session.table("speed", output, format) as table,
    ):
        for _, part in session.parts(logs, "speed", calibrate_radius=calibrate_radius):
            table.write(part.columns)
