"""A stretch of the wheel's encoder as one page (P4 Figs. 4 to 6).

The signal, the speed at the contact point and the wheel's angle, over time.

Recording and columns of each log --> PNG, SVG or PDF
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tirelog.by_channel import Part
from tirelog.data.recording import Recording
from tirelog.plots.style import COLOURS, figure_page, label, write

#: samples of a log that are drawn: evenly over the stretch if there are more
_MOST_SAMPLES = 20_000


def wheel_angle_picture(kept: Sequence[tuple[Recording, Part]], path: Path) -> None:
    """Write the page to `path`, a row per log."""
    figure = figure_page(12.0, 2.8 * len(kept) + 0.4)
    panels = figure.subplots(len(kept), 3, squeeze=False)
    for row, (recording, part) in zip(panels, kept, strict=True):
        columns = part.columns
        size = np.size(columns["time_s"])
        picked = np.unique(np.linspace(0, size - 1, min(size, _MOST_SAMPLES)).round().astype(int))
        time = np.asarray(columns["time_s"])[picked]
        for axes, name, what in (
            (row[0], "encoder_signal", "encoder, as recorded"),
            (row[1], "speed_m_s", "speed [m/s]"),
            (row[2], "turned_deg", "wheel angle [deg]"),
        ):
            axes.plot(time, np.asarray(columns[name])[picked], color=COLOURS[0], lw=1.0)
            label(axes, "time [s]", what, Path(recording.log).name if axes is row[0] else "")
    write(figure, path)
