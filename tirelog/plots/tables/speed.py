"""The speed over a log as one page, a row per log: speed with its error, and acceleration.

Rows of each channel --> PNG, SVG or PDF
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.by_channel import Part
from tirelog.data.recording import Recording
from tirelog.plots.style import COLOURS, RAW, figure_page, label, robust_range, write
from tirelog.vocabulary.quality import OK

#: logs that have a row of their own
_MOST = 8
#: passages of a channel that are drawn: evenly over the log if there are more
_MOST_PASSAGES = 20_000


def speed_picture(kept: Sequence[tuple[Recording, Part]], path: Path) -> None:
    """Write the page to `path`: logs by rows, channels by colour, flagged rows in grey."""
    logs: dict[str, list[Mapping[str, Any]]] = {}
    for recording, part in kept:
        logs.setdefault(recording.log, []).append(part.columns)
    shown = list(logs.items())[:_MOST]
    figure = figure_page(12.0, 3.2 * len(shown) + 0.4)
    panels = figure.subplots(len(shown), 2, squeeze=False)
    for (speeds, accelerations), (log, channels) in zip(panels, shown, strict=True):
        drawn = []
        for number, columns in enumerate(channels):
            rows = _rows(columns)
            good = np.asarray(rows["quality"]) == OK
            colour = COLOURS[number % len(COLOURS)]
            time, speed, error = (rows[n] for n in ("time_s", "speed_m_s", "speed_se_m_s"))
            drawn.append(speed[good])
            name = str(np.atleast_1d(columns["channel"])[0]) if time.size else ""
            speeds.fill_between(
                time[good],
                (speed - 2.0 * error)[good],
                (speed + 2.0 * error)[good],
                color=colour,
                alpha=0.25,
                lw=0,
            )
            speeds.plot(time[good], speed[good], ".", ms=2.5, color=colour, label=name)
            speeds.plot(time[~good], speed[~good], "x", ms=3.5, color=RAW)
            accelerations.plot(
                time[good], rows["acceleration_m_s2"][good], ".", ms=2.5, color=colour, label=name
            )
        left = len(logs) - len(shown)
        more = f"; {left} logs more are not drawn" if left and log == shown[-1][0] else ""
        label(
            speeds,
            "time [s]",
            "speed [m/s]",
            f"{Path(log).name}: band two standard errors, grey: flagged{more}",
            ylim=robust_range(*drawn, share=0.0),
        )
        label(accelerations, "time [s]", "acceleration [m/s²]")
        if len(channels) > 1:
            speeds.legend(fontsize=8)
    write(figure, path)


def _rows(columns: Mapping[str, Any]) -> dict[str, Any]:
    """The columns that are drawn, as arrays, at most so many rows."""
    names = ("time_s", "speed_m_s", "speed_se_m_s", "acceleration_m_s2", "quality")
    arrays = {name: np.atleast_1d(np.asarray(columns[name])) for name in names}
    n = max(array.size for array in arrays.values())
    kept = np.unique(np.linspace(0, n - 1, min(n, _MOST_PASSAGES)).round().astype(int))
    return {
        name: (np.broadcast_to(array, (n,)) if array.size == 1 else array)[kept if n else []]
        for name, array in arrays.items()
    }
