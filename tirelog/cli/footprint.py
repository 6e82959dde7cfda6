"""`tirelog footprint LOG...`."""

from __future__ import annotations

from typing import Annotated

import typer

from tirelog.cli.common import Format, Logs, Output, Plot, Quiet, Session, SetupFile, keeps_hashes
from tirelog.runtime import one_thread


def footprint(
    logs: Logs,
    setup: SetupFile = None,
    output: Output = None,
    format: Format = None,
    quiet: Quiet = False,
    cutoff: Annotated[
        str,
        typer.Option(
            "--cutoff",
            help="Low-pass of the plain lengths: auto, hertz (400Hz), or multiples of the wheel "
            "frequency (40x).",
        ),
    ] = "auto",
    plot: Plot = None,
) -> None:
    """Tell contact length, edges and slip onset at each passage of the patch."""
    one_thread()
    from tirelog.dsp.lowpass import Cutoff
    from tirelog.strain.footprint.table import footprint_of
    from tirelog.strain.speed import radius_remarks

    setting = Cutoff.parse(cutoff)
    kept = []
    with (
        Session(setup, quiet, hashed=keeps_hashes(output, format)) as session,
        session.table("footprint", output, format) as table,
    ):
        for recording in session.recordings(logs):
            for remark in radius_remarks(recording):
                session.note(f"{recording.log}: {remark}")
            for found in footprint_of(recording, setting):
                table.write(found.columns)
                for remark in found.remarks:
                    session.note(f"{recording.log}: {remark}")
                if plot is not None:
                    from tirelog.plots.footprint import Sketch

                    kept.append(Sketch.of(recording, found))
        if plot is not None and kept:
            from tirelog.plots.footprint import footprint_picture

            footprint_picture(kept, plot)
