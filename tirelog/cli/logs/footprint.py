"""`tirelog footprint LOG...`."""

from __future__ import annotations

from typing import Annotated, Any

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
    plot_kind,
    refuse_kind_alone,
)
from tirelog.cli.logs.log_table import table_option
from tirelog.plots.kinds import FOOTPRINT
from tirelog.runtime import one_thread


def footprint(
    logs: Logs,
    setup: SetupFile = None,
    output: Output = None,
    format: Format = None,
    channel: Channels = None,
    quiet: Quiet = False,
    cutoff: Annotated[str, table_option("footprint", "cutoff")] = "auto",
    plot: Plot = None,
    kind: Annotated[str, plot_kind(FOOTPRINT)] = "page",
) -> None:
    """Tell contact length, edges and slip onset at each passage of the patch."""
    one_thread()
    refuse_kind_alone(kind, plot)
    kept: list[Any] = []
    with (
        Session(setup, quiet, hashed=keeps_hashes(output, format)) as session,
        session.table("footprint", output, format) as table,
    ):
        for recording, part in session.parts(logs, "footprint", channel, cutoff=cutoff):
            table.write(part.columns)
            if plot is not None:
                from tirelog.errors import UsageError
                from tirelog.plots.tables.footprint import FootprintSketch
                from tirelog.plots.tables.turns import TurnsSketch
                from tirelog.strain.footprint.table import FootprintOfChannel

                if not isinstance(part.found, FootprintOfChannel):
                    raise UsageError(
                        "--plot draws the footprint of a grating; this log has accelerometers",
                        allowed="a log of strain is allowed",
                        do="leave --plot out; `tirelog phase-shift --plot` draws fronts",
                        file=recording.log,
                    )
                sketch = FootprintSketch if kind == "page" else TurnsSketch
                kept.append(sketch.of(recording, part.found))
        if plot is not None and kept:
            from tirelog.plots.tables.footprint import footprint_picture
            from tirelog.plots.tables.turns import turns_picture

            if kind == "page":
                footprint_picture(kept, plot)
            else:
                turns_picture(kept, plot, kind)
