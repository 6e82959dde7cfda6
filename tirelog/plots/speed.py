"""Pictures of tables over time: speed, static tests, the wheel's encoder, and P4's phase shift.

    Rows of each channel, what a command found --> PNG, SVG or PDF

P4's page, top: fronts in the acceleration over wheel angle (Fig. 7), maps of shift and width over
speed (Fig. 9). Below, a column for each of the first accelerometers: speed, shift and width over
time, raw (Fig. 8), detrended (Fig. 10), corrected (Figs. 11 to 13). Error bars are two standard
errors.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.by_channel import Part
from tirelog.data.recording import Recording
from tirelog.plots.record import Mark, Page, Panel, band, dots, level, line, span, upright, words
from tirelog.plots.style import COLOURS, EDGE, MARK, MICRO, RAW, picture, robust_range, write
from tirelog.strain.inflation import InflationOfChannel
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import OK
from tirelog.wheel.calibration import Calibration, Cleaned, clean_passages
from tirelog.wheel.phase_shift import EdgeTimes

# ---- The speed over a log as one page, a row per log: speed with its error, and acceleration.
#
# Rows of each channel --> PNG, SVG or PDF


#: logs that have a row of their own
_MOST = 8
#: rows of a channel that are drawn: evenly over the log if there are more
_MOST_ROWS = 20_000


def speed_picture(kept: Sequence[tuple[Recording, Part]], path: Path) -> None:
    """Write the page to `path`: logs by rows, channels by colour, flagged rows in grey."""
    logs: dict[str, list[Mapping[str, Any]]] = {}
    for recording, part in kept:
        logs.setdefault(recording.log, []).append(part.columns)
    shown = list(logs)[:_MOST]
    rows = [_speeds(log, logs[log]) for log in shown]
    if more := len(logs) - len(shown):
        said = f"{rows[-1][0].title}; {more} logs more are not drawn"
        rows[-1][0] = replace(rows[-1][0], title=said)
    write(picture(Page(rows, (12.0, 3.2 * len(rows) + 0.4))), path)


def _speeds(log: str, channels: Sequence[Mapping[str, Any]]) -> list[Panel]:
    """Speed and acceleration of a log."""
    speeds: list[Mark] = []
    accelerations: list[Mark] = []
    reached = []
    for number, columns in enumerate(channels):
        colour = COLOURS[number % len(COLOURS)]
        names = ("time_s", "speed_m_s", "speed_se_m_s", "acceleration_m_s2", "quality")
        time, speed, error, pushed, quality = _thinned(columns, names)
        good = quality == OK
        name = str(np.atleast_1d(columns["channel"])[0]) if time.size else ""
        low, high = speed - 2.0 * error, speed + 2.0 * error
        speeds += [
            band(time[good], low[good], high[good], "", colour, opacity=0.25),
            dots(time[good], speed[good], name, colour, size=2.5),
            dots(time[~good], speed[~good], "", RAW, symbol="x", size=3.5),
        ]
        accelerations.append(dots(time[good], pushed[good], "", colour, size=2.5))
        reached.append(speed[good])
    legend = {"fontsize": 8} if len(channels) > 1 else None
    title = f"{Path(log).name}: band two standard errors, grey: flagged"
    limits = (None, robust_range(*reached, share=0.0))
    return [
        Panel("time [s]", "speed [m/s]", speeds, title, limits, legend=legend),
        Panel("time [s]", "acceleration [m/s²]", accelerations),
    ]


def _thinned(columns: Mapping[str, Any], names: Sequence[str]) -> list[Any]:
    """These columns as arrays, of at most so many rows."""
    arrays = np.broadcast_arrays(*(np.atleast_1d(np.asarray(columns[name])) for name in names))
    n = arrays[0].size
    kept = np.unique(np.linspace(0, n - 1, min(n, _MOST_ROWS)).round().astype(int))
    return [array[kept if n else []] for array in arrays]


# ---- Static tests as one page (P2 Figs. 15, 16).
#
# Strain over time with its ramps and stops, and over the inflation pressure.
#
# Recording and InflationOfChannel of each channel --> PNG, SVG or PDF


def inflation_picture(kept: Sequence[tuple[Recording, Part]], path: Path) -> None:
    """Write the page to `path`, a row per channel."""
    rows = [
        [_stops(recording, part.found), _ramps(recording, part.found)] for recording, part in kept
    ]
    write(picture(Page(rows, (12.0, 3.6 * len(rows) + 0.4))), path)


_SINCE = "strain since the start [microstrain]"


def _stops(recording: Recording, found: InflationOfChannel) -> Panel:
    """Strain over time; its stops are shaded, with what is lost in each."""
    s, test = found.series, found.inflation
    marks = [line(s.time_s, MICRO * (s.strain - s.strain[0]), width=1.4)]
    for stretch, start, duration, leak in zip(
        test["stretch"], test["time_s"], test["duration_s"], test["leak"], strict=True
    ):
        if stretch != "stop":
            continue
        lost = np.nan_to_num(leak) != 0
        marks.append(span(start, start + duration, EDGE if lost else RAW, opacity=0.2))
        if lost:
            text = f"−{MICRO * abs(leak):.1f}"
            marks.append(words(text, start, 0.04, xycoords=("data", "axes fraction")))
    name = f"{Path(recording.log).name}: {found.channel.name}; shaded: stops, and what is lost"
    return Panel("time [s]", _SINCE, marks, name)


def _ramps(recording: Recording, found: InflationOfChannel) -> Panel:
    """Strain over the inflation pressure, with its straight line."""
    s, test = found.series, found.inflation
    marks = []
    if np.isfinite(s.pressure_Pa).any():
        ends = np.array([np.nanmin(s.pressure_Pa), np.nanmax(s.pressure_Pa)])
        rise = test["slope_1_Pa"][0] * (ends - np.nanmean(s.pressure_Pa))
        se = 1e11 * test["slope_se_1_Pa"][0]
        text = (
            f"{1e11 * test['slope_1_Pa'][0]:.1f}{f' ± {se:.1g}' if np.isfinite(se) else ''} "
            f"microstrain/bar, straight to {100 * test['nonlinearity'][0]:.1f} %"
        )
        strain = MICRO * (s.strain.mean() - s.strain[0] + rise)
        marks = [
            dots(1e-5 * s.pressure_Pa, MICRO * (s.strain - s.strain[0]), size=3),
            line(1e-5 * ends, strain, text, MARK, width=1.5),
        ]
    static = recording.setup.tire.static_footprint_length_m
    title = "" if static is None else f"static footprint {1e3 * static:.0f} mm"
    return Panel("inflation pressure [bar]", _SINCE, marks, title, legend={"fontsize": 8})


# ---- A stretch of the wheel's encoder as one page (P4 Figs. 4 to 6).
#
# The signal, the speed at the contact point and the wheel's angle, over time.
#
# Recording and columns of each log --> PNG, SVG or PDF


_ENCODER = {
    "encoder_signal": "encoder, as recorded",
    "speed_m_s": "speed [m/s]",
    "turned_deg": "wheel angle [deg]",
}


def wheel_angle_picture(kept: Sequence[tuple[Recording, Part]], path: Path) -> None:
    """Write the page to `path`, a row per log."""
    rows = []
    for recording, part in kept:
        time, *drawn = _thinned(part.columns, ("time_s", *_ENCODER))
        titles = (Path(recording.log).name, "", "")
        rows.append(
            [
                Panel("time [s]", text, [line(time, values, width=1.0)], title)
                for values, text, title in zip(drawn, _ENCODER.values(), titles, strict=True)
            ]
        )
    write(picture(Page(rows, (12.0, 2.8 * len(rows) + 0.4))), path)


# ---- Phase shift (P4).


#: accelerometers that have a column of their own
MOST = 4
RAW_SHIFTS, DETRENDED, CORRECTED = "0.65", COLOURS[0], COLOURS[1]


def phase_shift_picture(kept: Sequence[tuple[Recording, Part]], path: Path) -> None:
    """Write the page to `path`; its suffix decides the format."""
    shown = [passages for _, part in kept for passages in part.found.passages][:MOST]
    calibration = kept[0][1].found.calibration
    top = Page([[_fronts(shown), *(_map(shown, calibration, name) for name in ("shift", "width"))]])
    columns = [_times(p, clean_passages(p, calibration) if calibration else None) for p in shown]
    below = Page([list(row) for row in zip(*columns, strict=True)], share="x")
    parts = [top, below] if shown else [top, Page([[None]])]
    size = (max(4.2 * len(shown), 12.0), 13.0)
    write(picture(Page(size=size, parts=parts, stacked=True, heights=(1.0, 2.2))), path)


def _fronts(logs: Sequence[EdgeTimes]) -> Panel:
    """P4 Fig. 7: one passage of each accelerometer, in levels outside the patch, and its fronts."""
    marks = [level(0.5, "", "0.8", width=0.8)]
    for number, p in enumerate(logs):
        if p.example.size:
            name, colour = f"{p.channel}, {Path(p.log).name}", f"C{number}"
            marks.append(
                line(p.example[0], p.example[1], name, colour, symbol=".", width=0.7, size=2)
            )
            marks += upright(p.example[2, :2], "", colour, dash="dash", width=1)
    return Panel(
        "wheel angle from the patch's middle [deg]",
        "acceleration / level outside [-]",
        marks,
        "Fronts (P4 Fig. 7)",
        (None, (-0.6, 1.6)),
        legend={"fontsize": 7, "loc": "lower left"},  # where no front passes
    )


def _map(logs: Sequence[EdgeTimes], calibration: Calibration | None, what: str) -> Panel:
    """P4 Fig. 9: all passages over speed, and the calibration's map with its range."""
    marks = []
    for number, p in enumerate(logs):
        values, se = (getattr(p, name)[p.good] for name in (f"{what}_deg", f"{what}_se_deg"))
        marks.append(_passages(p.speed_m_s[p.good], values, se, f"C{number}", opacity=0.5))
    if calibration is not None:
        one = calibration.shift if what == "shift" else calibration.width
        speed = np.linspace(one.low_m_s, one.high_m_s, 200)
        least = calibration.patch_width_deg if what == "width" else 0.0
        change = one(speed, calibration.reference_speed_m_s) + least
        marks.append(line(speed, change, "map", "k", width=1.5))
    name = "phase shift" if what == "shift" else "patch width"
    title = f"{name.capitalize()} and speed (P4 Fig. 9)"
    return Panel("speed [m/s]", f"{name} [deg]", marks, title)


def _passages(
    x: FloatArray, y: FloatArray, se: FloatArray, colour: str, name: str = "", **more: Any
) -> Mark:
    """A point per passage with two standard errors, if it has one."""
    error = 2.0 * np.where(np.isfinite(se), se, 0.0)
    return dots(x, y, name, colour, error=error, size=3, elinewidth=0.6, **more)


def _times(p: EdgeTimes, cleaned: Cleaned | None) -> list[Panel]:
    """P4 Figs. 8, 10 to 13: speed, shift and width over time."""
    time, good = p.time_s[p.good], p.good
    shifts = [level(0.0, "", "0.8", width=0.8, zorder=0)]
    widths: list[Mark] = []
    for marks, what in ((shifts, "shift"), (widths, "width")):
        values, se = getattr(p, f"{what}_deg")[good], getattr(p, f"{what}_se_deg")[good]
        marks.append(_passages(time, values, se, RAW_SHIFTS, "measured (Fig. 8)"))
        if cleaned is not None:
            clean = getattr(cleaned, f"{what}_deg")[good]
            marks.append(_passages(time, clean, se, DETRENDED, "detrended (Fig. 10)"))
    if cleaned is not None and np.isfinite(cleaned.corrected_deg).any():
        shift, se = cleaned.corrected_deg[good], p.shift_se_deg[good]
        shifts.append(_passages(time, shift, se, CORRECTED, "corrected (Figs. 11-13)"))
    driven = {True: ", driven", False: ", undriven", None: ""}[p.driven]
    speed = line(p.time_s, p.speed_m_s, colour="k", width=1)
    return [
        Panel("", "speed [m/s]", [speed], f"{Path(p.log).name}: {p.channel}{driven}"),
        Panel("", "phase shift [deg]", shifts),
        Panel("time [s]", "patch width [deg]", widths),
    ]
