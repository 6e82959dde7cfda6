"""P4's figures for whatever logs a command has worked on: one page of panels.

    Passages of each accelerometer, Calibration --> PNG or SVG

Top: fronts in the acceleration over wheel angle (Fig. 7), maps of shift and width over speed (Fig.
9). Below, a column for each of the first accelerometers: speed, shift and width over time, raw
(Fig. 8), detrended (Fig. 10), corrected (Figs. 11 to 13). Error bars are two standard errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.by_channel import Part
from tirelog.data.recording import Recording
from tirelog.plots.style import (
    COLOURS,
    EDGE,
    MARK,
    MICRO,
    RAW,
    figure_page,
    label,
    robust_range,
    write,
)
from tirelog.strain.inflation import InflationOfChannel
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import OK
from tirelog.wheel.calibration import Calibration, Cleaned, clean_passages
from tirelog.wheel.phase_shift import EdgeTimes

if TYPE_CHECKING:
    from matplotlib.axes import Axes


# ---- The speed over a log as one page, a row per log: speed with its error, and acceleration.
#
# Rows of each channel --> PNG, SVG or PDF


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


# ---- Static tests as one page (P2 Figs. 15, 16).
#
# Strain over time with its ramps and stops, and over the inflation pressure.
#
# Recording and InflationOfChannel of each channel --> PNG, SVG or PDF


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


# ---- A stretch of the wheel's encoder as one page (P4 Figs. 4 to 6).
#
# The signal, the speed at the contact point and the wheel's angle, over time.
#
# Recording and columns of each log --> PNG, SVG or PDF


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


#: accelerometers that have a column of their own
MOST = 4
RAW_SHIFTS, DETRENDED, CORRECTED = "0.65", COLOURS[0], COLOURS[1]


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
        _passages(axes, time, raw[p.good], error, RAW_SHIFTS, label="measured (Fig. 8)")
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
