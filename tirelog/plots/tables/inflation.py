"""Static tests as one page (P2 Figs. 15, 16).

Strain over time with its ramps and stops, and over the inflation pressure.

Recording and InflationOfChannel of each channel --> PNG, SVG or PDF
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from tirelog.by_channel import Part
from tirelog.data.recording import Recording
from tirelog.plots.style import COLOURS, EDGE, MARK, MICRO, figure_page, label, write
from tirelog.strain.inflation_table import InflationOfChannel


def inflation_picture(kept: Sequence[tuple[Recording, Part]], path: Path) -> None:
    """Write the page to `path`, a row per channel."""
    figure = figure_page(12.0, 3.6 * len(kept) + 0.4)
    panels = figure.subplots(len(kept), 2, squeeze=False)
    for (over_time, over_pressure), (recording, part) in zip(panels, kept, strict=True):
        found: InflationOfChannel = part.found
        s, test = found.series, found.inflation
        over_time.plot(s.time_s, MICRO * (s.strain - s.strain[0]), color=COLOURS[0], lw=1.4)
        for stretch, start, duration, leak in zip(
            test.stretch, test.time_s, test.duration_s, test.leak, strict=True
        ):
            if stretch == "stop":
                lost = np.nan_to_num(leak) != 0
                over_time.axvspan(
                    start, start + duration, color=EDGE if lost else "#999999", alpha=0.2, lw=0
                )
                if lost:
                    over_time.annotate(
                        f"−{MICRO * abs(leak):.1f}",
                        (start, 0.04),
                        xycoords=("data", "axes fraction"),
                        fontsize=8,
                    )
        label(
            over_time,
            "time [s]",
            "strain since the start [microstrain]",
            f"{Path(recording.log).name}: {found.channel.name}; shaded: stops, and what is lost",
        )
        if np.isfinite(s.pressure_Pa).any():
            bar = 1e-5 * s.pressure_Pa
            over_pressure.plot(bar, MICRO * (s.strain - s.strain[0]), ".", color=COLOURS[0], ms=3)
            ends = np.array([np.nanmin(s.pressure_Pa), np.nanmax(s.pressure_Pa)])
            line = (
                s.strain.mean()
                - s.strain[0]
                + test.slope_1_Pa[0] * (ends - np.nanmean(s.pressure_Pa))
            )
            se = 1e11 * test.slope_se_1_Pa[0]
            error = f" ± {se:.1g}" if np.isfinite(se) else ""
            text = (
                f"{1e11 * test.slope_1_Pa[0]:.1f}{error} microstrain/bar, straight to "
                f"{100 * test.nonlinearity[0]:.1f} %"
            )
            over_pressure.plot(1e-5 * ends, MICRO * line, color=MARK, lw=1.5, label=text)
            over_pressure.legend(fontsize=8)
        static = recording.setup.tire.static_footprint_length_m
        title = "" if static is None else f"static footprint {1e3 * static:.0f} mm"
        label(
            over_pressure, "inflation pressure [bar]", "strain since the start [microstrain]", title
        )
    write(figure, path)
