"""P4's figures for whatever logs a command has worked on: one page of panels.

    Passages of each accelerometer, Calibration --> PNG or SVG

Top: fronts in the acceleration over wheel angle (Fig. 7), maps of shift and width over speed (Fig.
9). Below, a column for each of the first accelerometers: speed, shift and width over time, raw
(Fig. 8), detrended (Fig. 10), corrected (Figs. 11 to 13). Error bars are two standard errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.by_channel import Part
from tirelog.data.recording import Recording
from tirelog.plots.style import COLOURS, figure_page, write
from tirelog.vocabulary.arrays import FloatArray
from tirelog.wheel.calibration import Calibration, Cleaned, clean_passages
from tirelog.wheel.phase_shift import EdgeTimes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: accelerometers that have a column of their own
MOST = 4
RAW, DETRENDED, CORRECTED = "0.65", COLOURS[0], COLOURS[1]


def phase_shift_picture(kept: Sequence[tuple[Recording, Part]], path: Path) -> None:
    """Write the page to `path`; its suffix decides the format."""
    shown = [passages for _, part in kept for passages in part.found.passages][:MOST]
    calibration = kept[0][1].found.calibration
    columns = max(len(shown), 1)
    figure = figure_page(max(4.2 * columns, 12.0), 13.0)
    top, bottom = np.asarray(figure.subfigures(2, 1, height_ratios=[1.0, 2.2]))
    fronts, shifts, widths = top.subplots(1, 3)
    _fronts(fronts, shown)
    _map(shifts, shown, calibration, "shift")
    _map(widths, shown, calibration, "width")
    if shown:
        panels = bottom.subplots(3, columns, sharex="col", squeeze=False)
        for column, passages in enumerate(shown):
            _times(
                panels[:, column],
                passages,
                clean_passages(passages, calibration) if calibration else None,
            )
    write(figure, path)


def _fronts(axes: Axes, logs: Sequence[EdgeTimes]) -> None:
    """P4 Fig. 7: one passage of each accelerometer, in levels outside the patch, and its fronts."""
    for number, p in enumerate(logs):
        if not p.example.size:
            continue
        angle, level, entry, leave = p.example[0], p.example[1], p.example[2, 0], p.example[2, 1]
        axes.plot(
            angle,
            level,
            ".-",
            lw=0.7,
            ms=2,
            color=f"C{number}",
            label=f"{p.channel}, {Path(p.log).name}",
        )
        axes.vlines([entry, leave], -0.5, 1.5, colors=f"C{number}", linestyles="dashed", lw=1)
    axes.axhline(0.5, color="0.8", lw=0.8)
    axes.set(
        xlabel="wheel angle from the patch's middle [deg]",
        ylabel="acceleration / level outside [-]",
        title="Fronts (P4 Fig. 7)",
    )
    if logs:
        axes.legend(fontsize=7, loc="lower left")  # where no front passes


def _map(axes: Axes, logs: Sequence[EdgeTimes], calibration: Calibration | None, what: str) -> None:
    """P4 Fig. 9: all passages over speed, and the calibration's map with its range."""
    for number, p in enumerate(logs):
        values, se = (
            (p.shift_deg, p.shift_se_deg) if what == "shift" else (p.width_deg, p.width_se_deg)
        )
        _passages(axes, p.speed_m_s[p.good], values[p.good], se[p.good], f"C{number}", alpha=0.5)
    if calibration is not None:
        one = calibration.shift if what == "shift" else calibration.width
        speed = np.linspace(one.low_m_s, one.high_m_s, 200)
        change = one(speed, calibration.reference_speed_m_s)
        axes.plot(
            speed,
            change + (calibration.patch_width_deg if what == "width" else 0.0),
            "k",
            lw=1.5,
            label="map",
        )
        axes.legend(fontsize=7)
    name = "phase shift" if what == "shift" else "patch width"
    axes.set(
        xlabel="speed [m/s]",
        ylabel=f"{name} [deg]",
        title=f"{name.capitalize()} and speed (P4 Fig. 9)",
    )


def _passages(
    axes: Axes, x: FloatArray, y: FloatArray, se: FloatArray, colour: str, **more: Any
) -> None:
    """A point per passage with two standard errors, if it has one."""
    error = 2.0 * np.where(np.isfinite(se), se, 0.0)
    axes.errorbar(x, y, error, fmt=".", ms=3, elinewidth=0.6, color=colour, **more)


def _times(panels: Sequence[Axes], p: EdgeTimes, cleaned: Cleaned | None) -> None:
    """P4 Figs. 8, 10 to 13: speed, shift and width over time."""
    speed, shift, width = panels
    speed.plot(p.time_s, p.speed_m_s, color="k", lw=1)
    driven = {True: ", driven", False: ", undriven", None: ""}[p.driven]
    speed.set(ylabel="speed [m/s]", title=f"{Path(p.log).name}: {p.channel}{driven}")
    detrended_shift, detrended_width = (
        (cleaned.shift_deg, cleaned.width_deg) if cleaned is not None else (None, None)
    )
    for axes, raw, se, detrended in (
        (shift, p.shift_deg, p.shift_se_deg, detrended_shift),
        (width, p.width_deg, p.width_se_deg, detrended_width),
    ):
        time, error = p.time_s[p.good], se[p.good]
        _passages(axes, time, raw[p.good], error, RAW, label="measured (Fig. 8)")
        if detrended is not None:
            _passages(axes, time, detrended[p.good], error, DETRENDED, label="detrended (Fig. 10)")
    if cleaned is not None and np.isfinite(cleaned.corrected_deg).any():
        corrected = cleaned.corrected_deg[p.good]
        error = p.shift_se_deg[p.good]
        _passages(
            shift, p.time_s[p.good], corrected, error, CORRECTED, label="corrected (Figs. 11-13)"
        )
    shift.axhline(0.0, color="0.8", lw=0.8, zorder=0)
    shift.set(ylabel="phase shift [deg]")
    width.set(ylabel="patch width [deg]", xlabel="time [s]")
    shift.legend(fontsize=7)
    width.legend(fontsize=7)
