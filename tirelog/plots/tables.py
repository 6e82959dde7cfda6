"""Pictures of tables: footprint and dissipation, speed, static tests, encoder, and phase shift.

    Recording and what a command found of each channel --while the log is open--> Sketch
        --all of them--> PNG, SVG or PDF

Longer than others: a picture per table, which share their parts.
"""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.data.recording import Channel, Recording
from tirelog.dsp.filters import lowpassed, window_spectra
from tirelog.errors import UsageError
from tirelog.plots.record import (
    Mark,
    Page,
    Panel,
    band,
    dots,
    level,
    line,
    span,
    upright,
    words,
)
from tirelog.plots.style import (
    COLOURS,
    EDGE,
    MARK,
    MICRO,
    RAW,
    decimated,
    picture,
    robust_range,
)
from tirelog.plots.turns import TurnsSketch, turns_picture
from tirelog.products import Part
from tirelog.strain.dissipation import (
    AVERAGED,
    DissipationOfChannel,
    Regression,
    clean_rows,
    regression,
)
from tirelog.strain.footprint.footprint import FootprintOfChannel
from tirelog.strain.footprint.learn import PatchWindows, gather_windows
from tirelog.strain.footprint.measure import along_tread
from tirelog.strain.inflation import InflationOfChannel
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import OK, good
from tirelog.wheel.calibration import Calibration, clean_passages
from tirelog.wheel.phase_shift import EdgeTimes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# ---- The footprint as one page (P2 Figs. 17 to 22).
#
# Left: strain and speed over time of the first channel (Figs. 17, 20), contact lengths over time
# and speed of all. Right: one passage, free rolling if there is one, and the one with the clearest
# slip onset: strain, first and second derivative along the tread, raw and low-passed, edges by each
# method (Figs. 18, 19, 21).


#: how an onset of slip is marked: an open ring, 6 points wide
_ONSET: dict[str, Any] = {"symbol": "o", "mfc": "none", "mec": MARK, "size": 6}
#: a legend above the lengths, small enough for three of them side by side
_ABOVE = {"fontsize": 6.5, "ncols": 3, "loc": "upper center"}
#: channels with a colour of their own, or logs with a row, and the window of a passage in half
#: lengths
MOST, WINDOW = 8, 2.2
#: what is read beside a window for the low-pass, in its periods
_BESIDE = 3.0


@dataclass(frozen=True)
class Sketch:
    """The numbers of one channel for a page, read while its log is open.

    found    what the command found of it; `signal` its samples, decimated
    closer   of a footprint (row, title, window) of the passages that are shown, of a dissipation
             times, strain and speed of a few revolutions
    """

    recording: Recording
    found: Any
    signal: tuple[FloatArray, FloatArray]
    closer: Any


def footprint_sketch(recording: Recording, part: Part, kind: str) -> Sketch | TurnsSketch:
    """The numbers of a channel for a picture of this kind.  UsageError: no grating."""
    found = part.found
    if not isinstance(found, FootprintOfChannel):
        raise UsageError(
            "--plot draws the footprint of a grating; this log has accelerometers",
            allowed="a log of strain is allowed",
            do="leave --plot out; `tirelog phase-shift --plot` draws fronts",
            file=recording.log,
        )
    if kind != "page":
        return TurnsSketch.of(recording, found)
    p, windows = found.passages, []
    for row, title in _passages(found):
        window = passage_window(found.channel, p.sign, p.index[row], *_seen_with(found, row))
        windows += [] if window is None else [(row, title, window)]
    return Sketch(recording, found, decimated(found.channel), windows)


def footprint_picture(sketches: Sequence[Any], kind: str) -> Figure:
    """The picture of this kind."""
    return picture(_footprint_page(sketches)) if kind == "page" else turns_picture(sketches, kind)


def _footprint_page(sketches: Sequence[Sketch]) -> Page:
    """Time series and lengths at the left, passages at the right."""
    kept = [(sketch.recording, sketch.found) for sketch in sketches]
    first = next((sketch for sketch in sketches if len(sketch.found.passages)), sketches[0])
    p = first.found.passages
    speeds = Panel(
        "time [s]", "speed [m/s]", [line(p.time_s, p.speed_m_s, symbol=".", size=2, width=0.8)]
    )
    by_time, by_speed = _lengths(kept)
    over_time = [[signal_panel(first, len(kept))], [speeds], [by_time]]
    columns = [_passage(first.found, *shown) for shown in first.closer]
    right = [list(row) for row in zip(*columns, strict=True)] or [[None]]
    left = [Page(over_time, heights=(1.0, 0.7, 1.0), share="x"), Page([[by_speed]])]
    return Page(
        size=(13.5 if len(columns) < 2 else 17.0, 10.5),
        parts=[Page(parts=left, stacked=True, heights=(2.7, 1.1)), Page(right, share="x")],
        widths=(1.0, 0.8 * max(len(columns), 1)),
    )


def signal_panel(sketch: Sketch, channels: int) -> Panel:
    """The whole strain of one of so many channels over time (P2 Fig. 17)."""
    channel, (time, strain) = sketch.found.channel, sketch.signal
    which = f", 1 of {channels}" if channels > 1 else ""
    return Panel(
        "time [s]",
        "strain [microstrain]",
        [line(time, MICRO * strain, width=0.5, opacity=0.9)],
        f"{Path(sketch.recording.log).name}: {channel.name} ({channel.surface} surface){which}",
    )


def channel_name(recording: Recording, channel: Channel, channels: int) -> str:
    """A channel's name; of several with its log's."""
    return channel.name if channels == 1 else f"{Path(recording.log).name}: {channel.name}"


def _lengths(kept: Sequence[tuple[Recording, FootprintOfChannel]]) -> list[Panel]:
    """Contact lengths by the three methods over time and speed.

    Each channel in its colour, and the static footprint.
    """
    marks: dict[str, list[Mark]] = {"time_s": [], "speed_m_s": []}
    values = []
    for number, (recording, found) in enumerate(kept[:MOST]):
        f, p, colour = found.footprint, found.passages, COLOURS[number % len(COLOURS)]
        for x, drawn in marks.items():
            for length, symbol, look in (
                (f.length_d2_m, "^", {"opacity": 0.25, "size": 2.5}),
                (f.length_d1_m, "v", {"opacity": 0.25, "size": 2.5}),
                (f.length_m, ".", {"opacity": 0.9, "size": 4}),
            ):
                drawn.append(dots(getattr(p, x), 1e3 * length, "", colour, symbol=symbol, **look))
        values += [1e3 * f.length_m, 1e3 * f.length_d2_m, 1e3 * f.length_d1_m]
        seen = np.isfinite(f.slip["onset_m"])
        marks["time_s"].append(dots(p.time_s[seen], 1e3 * f.length_m[seen], **_ONSET))
        name = channel_name(recording, found.channel, len(kept))
        marks["speed_m_s"].append(dots([], [], name, colour, symbol="s"))
    low, high = robust_range(*values)
    statics = {recording.setup.tire.static_footprint_length_m for recording, _ in kept} - {None}
    for static in (1e3 * length for length in statics if length is not None):
        for drawn in marks.values():
            drawn.append(level(static, f"static {static:.0f} mm", dash="dot", width=1.2))
        low, high = min(low, 0.97 * static), max(high, 1.03 * static)
    named = {".": "best estimate", "^": "2nd derivative (P2)", "v": "1st derivative"}
    for symbol, text in named.items():
        marks["time_s"].append(dots([], [], text, "black", symbol=symbol))
    if any(np.isfinite(found.footprint.slip["onset_m"]).any() for _, found in kept):
        marks["time_s"].append(dots([], [], "slip onset seen", **_ONSET))
    limits = (None, (low, high + 0.35 * (high - low)))
    return [
        Panel(label, "contact length [mm]", drawn, limits=limits, legend=_ABOVE)
        for label, drawn in zip(("time [s]", "speed [m/s]"), marks.values(), strict=True)
    ]


def _passages(found: FootprintOfChannel) -> list[tuple[int, str]]:
    """Rows of typical and of unusual passages.

    A clean one of free rolling, well sampled; and the one with the surest slip onset.
    """
    f, p = found.footprint, found.passages
    if not len(p):
        return []
    clean = good(f.quality) & np.isfinite(f.length_m)
    some = np.flatnonzero(clean) if clean.any() else np.arange(len(p))
    row = int(some[free_rolling(p.acceleration_m_s2[some], p.speed_m_s[some])])
    chosen = [(row, "passage")]
    onset = np.flatnonzero(np.isfinite(f.slip["onset_m"]) & clean)
    if onset.size:
        best = int(onset[np.argmin(f.slip["onset_m"][onset] / f.length_m[onset])])
        if best != row:
            chosen.append((best, "passage with slip"))
    return chosen


def _seen_with(found: FootprintOfChannel, row: int) -> tuple[float, float, float]:
    """Speed [m/s], contact length [m] and low-pass [Hz] of a passage; usual ones if unknown."""
    f = found.footprint
    length = float(f.length_m[row]) if np.isfinite(f.length_m[row]) else 0.1
    cutoff = float(f.cutoff_Hz[row]) if np.isfinite(f.cutoff_Hz[row]) else 400.0
    return (
        float(found.passages.speed_m_s[row]),
        length,
        min(cutoff, 0.49 * found.channel.axis.rate_Hz),
    )


def _passage(found: FootprintOfChannel, row: int, title: str, windows: PatchWindows) -> list[Panel]:
    """Strain and its derivatives along the tread (P2 Figs. 18, 19, 21), with the edges."""
    p, f = found.passages, found.footprint
    speed, length, cutoff = _seen_with(found, row)
    acceleration, middle = float(np.nan_to_num(p.acceleration_m_s2[row])), f.fits["shift_m"][row]
    best, plain = (np.array([-0.5, 0.5]) * length[row] for length in (f.length_m, f.length_d1_m))
    derived = np.array([f.d2_entry_m[row], f.d2_exit_m[row]])
    lines = [
        *upright(1e3 * (middle + best), "edges, best estimate", EDGE, width=1.3),
        *upright(1e3 * derived, "by the 2nd derivative", "black", width=0.9, dash="dash"),
        *upright(1e3 * (middle + plain), "by the 1st derivative", "black", width=0.9, dash="dot"),
    ]
    if np.isfinite(onset := f.slip["onset_m"][row]):
        name = f"slip onset {1e3 * onset:.1f} mm"
        lines += upright([1e3 * (middle + onset)], name, MARK, width=1.5)
    at = (speed, acceleration, length, cutoff)
    inner = found.channel.surface == "inner"
    first, *others = passage_panels(windows, at, inner, lines, (RAW, COLOURS[0]))
    said = (
        f"{title}: {p.time_s[row]:.2f} s, {speed:.1f} m/s, {round(acceleration, 1) + 0.0:+.1f} m/s²"
        f", low-pass {cutoff:.0f} Hz"
    )
    return [replace(first, title=said), *others]


def free_rolling(acceleration_m_s2: Any, speed_m_s: Any) -> int:
    """Which of some passages has little acceleration (0 if unknown) and moderate speed."""
    pushed = np.abs(np.nan_to_num(np.asarray(acceleration_m_s2, float)))
    free = np.argsort(pushed, kind="stable")[: max(pushed.size // 3, 1)]
    speeds = np.asarray(speed_m_s, float)[free]
    return int(free[np.argsort(speeds, kind="stable")[free.size // 4]])


def passage_window(
    channel: Channel, sign: float, index: float, speed_m_s: float, length_m: float, cutoff_Hz: float
) -> PatchWindows | None:
    """The samples of a passage at `index`, with what the low-pass needs beside; None without any.

    sign  -1 on the outer surface, whose strain has its minimum in the patch
    """
    rate = channel.axis.rate_Hz
    reach = 0.7 * WINDOW * length_m / speed_m_s * rate + _BESIDE * rate / cutoff_Hz
    motions = np.array([speed_m_s]), np.zeros(1)
    windows = gather_windows(
        channel, sign, np.array([index]), motions, np.array([reach]), np.zeros(1, np.int64)
    )
    return next(iter(windows), None)


def passage_panels(
    windows: PatchWindows,
    at: tuple[float, float, float, float],
    inner: bool,
    lines: Sequence[Mark],
    colours: tuple[Any, Any],
) -> list[Panel]:
    """Strain, its first and second derivative along the tread, raw and low-passed.

    at      speed [m/s], acceleration [m/s^2], contact length [m], low-pass [Hz]
    inner   the sensor is on the inner surface: strain is turned, so that it is the tread's
    lines   the edges
    """
    speed, acceleration, (length, cutoff) = np.array([at[0]]), np.array([at[1]]), at[2:]
    reach = 1e3 * WINDOW * 0.5 * length
    known = windows.values[0][np.isfinite(windows.values[0])]
    edge = max(windows.values.shape[1] // 32, 1)
    ends = [float(part.mean()) if part.size else 0.0 for part in (known[:edge], known[-edge:])]
    looks = (
        (1e9, 1, "samples", colours[0], {"width": 0.8, "symbol": ".", "size": 3}),
        (cutoff, 4, f"low-pass {cutoff:.0f} Hz", colours[1], {"width": 1.4}),
    )
    marks: list[list[Mark]] = [[], [], []]
    shown: list[FloatArray] = []
    for cut, upsample, name, colour, look in looks:
        of = (
            windows.rate_Hz,
            windows.motion["centre"],
            speed,
            acceleration,
            np.array([cut]),
            upsample,
        )
        along_m, first, second, _ = along_tread(windows.values, *of)
        spectra, m = window_spectra(windows.values), windows.values.shape[1]
        strain = lowpassed(spectra, windows.rate_Hz, np.array([cut]), m, upsample)[0]
        xi = 1e3 * along_m[0]
        shown = [
            (-1.0 if inner else 1.0) * scale * curve
            for curve, scale in (
                (strain + np.linspace(ends[0], ends[1], strain.size), MICRO),
                (first[0], 1e3),
                (second[0], 1.0),
            )
        ]
        for drawn, curve in zip(marks, shown, strict=True):
            drawn.append(line(xi, curve, f"_{name}", colour, **look))
    labels = ("strain [microstrain]", "dε/dξ [microstrain/mm]", "d²ε/dξ² [microstrain/mm²]")
    return [
        Panel(
            "ξ from the patch centre [mm]   (entry − … exit +)" if text is labels[-1] else "",
            text,
            [*drawn, *lines],
            limits=((-reach, reach), robust_range(curve[np.abs(xi) < reach], share=0.0)),
            legend={"fontsize": 7, "loc": "lower right"} if text is labels[0] else None,
        )
        for text, drawn, curve in zip(labels, marks, shown, strict=True)
    ]


# ---- Dissipation of whatever logs a command has worked on, as one page (P1 Figs. 7 to 11).
#
#     Recording and DissipationOfChannel of each channel --while the log is open--> Sketch
#         --all of them--> PNG, SVG or PDF
#
# Left: strain and speed over time (Figs. 7, 8's magnification), specific power and factor over time
# with their moving averages (Figs. 9, 10). Right: both averages over speed with their regressions
# (Fig. 11).


#: revolutions in the magnification of the strain
MAGNIFIED = 4


def dissipation_sketch(recording: Recording, part: Part, kind: str) -> Sketch:
    """The numbers of a channel for the page."""
    found = part.found
    p, steady = found.passages, np.flatnonzero(found.dissipation.steady)
    row = int(steady[steady.size // 2]) if steady.size else len(p) // 2
    row = max(min(row, len(p) - MAGNIFIED - 1), 0)
    magnified = (np.zeros(0), np.zeros(0), float("nan"))
    if len(p) > MAGNIFIED:
        low, high = max(int(p.index[row]) - 10, 0), int(p.index[row + MAGNIFIED])
        channel = found.channel
        magnified = channel.axis.time(low, high), channel.read(low, high), float(p.speed_m_s[row])
    return Sketch(recording, found, decimated(found.channel), magnified)


def dissipation_picture(sketches: Sequence[Sketch]) -> Figure:
    """The page."""
    kept = [(sketch.recording, sketch.found) for sketch in sketches]
    first = next((sketch for sketch in sketches if len(sketch.found.passages)), sketches[0])
    d, p = first.found.dissipation, first.found.passages
    power, factor = "specific power [m³/s²]", "dissipation factor [1/m]"
    error = 2.0 * first.found.columns["dissipation_factor_se_1_m"]
    errors = dots(p.time_s, d.factor_1_m, "two standard errors", error=error, symbol="",
                  elinewidth=0.6, opacity=0.5)  # fmt: skip
    speeds = [
        dots(p.time_s, p.speed_m_s, "", RAW, size=3),
        line(
            _smoothed(p.time_s), _smoothed(p.speed_m_s), f"mean of {AVERAGED}", "#CC0000", width=0.9
        ),
        dots(p.time_s, np.where(d.steady, p.speed_m_s, np.nan), "constant speed", EDGE, size=3),
    ]
    left = [
        signal_panel(first, len(kept)),
        _over_time(p.time_s, d.specific_power_m3_s2, d.specific_power_mean_m3_s2, power),
        _over_time(p.time_s, d.factor_1_m, d.factor_mean_1_m, factor, errors),
        Panel("time [s]", "speed [m/s]", speeds),
    ]
    right = [
        _magnified(first),
        _over_speed(kept, "specific_power_m3_s2", "specific_power_mean_m3_s2", power),
        _over_speed(kept, "dissipation_factor_1_m", "dissipation_factor_mean_1_m", factor),
    ]
    parts = [Page([[panel] for panel in left], share="x"), Page([[panel] for panel in right])]
    return picture(Page(size=(15.0, 10.0), parts=parts, widths=(1.35, 1.0)))


def _smoothed(values: FloatArray) -> FloatArray:
    """Moving averages over AVERAGED revolutions (P1 Fig. 7, red), or all of fewer."""
    if values.size < AVERAGED:
        return values
    return np.convolve(values, np.full(AVERAGED, 1.0 / AVERAGED), "valid")


def _over_time(
    time_s: FloatArray, values: FloatArray, averages: FloatArray, text: str, *more: Mark
) -> Panel:
    """Every revolution, and the moving averages in stretches of constant speed (P1 Figs. 9, 10)."""
    return Panel(
        "time [s]",
        text,
        [
            dots(time_s, values, "each revolution", size=2.5, opacity=0.6),
            line(time_s, averages, "moving average, constant speed", EDGE, width=1.6),
            *more,
        ],
        limits=(None, robust_range(values, share=0.005)),
    )


def _magnified(sketch: Sketch) -> Panel:
    """The strain of a few revolutions (P1 Fig. 8)."""
    time, strain, speed = sketch.closer
    title = f"{MAGNIFIED} revolutions at {speed:.1f} m/s" if time.size else ""
    return Panel("time [s]", "strain [microstrain]", [line(time, MICRO * strain, width=0.9)], title)


def said(line: Regression) -> str:
    """The legend of a line.

    Its slope with the error, and what speaks against it, in lines that a legend holds.
    """
    error = f" ± {line['slope_se']:.1g}" if np.isfinite(line["slope_se"]) else ""
    return "\n".join([f"{line['slope']:.3g}{error} per m/s", *textwrap.wrap(line["judgement"], 44)])


def _over_speed(
    kept: Sequence[tuple[Recording, DissipationOfChannel]], name: str, average: str, text: str
) -> Panel:
    """Moving averages sorted by speed, means of the stretches, and their line (P1 Fig. 11).

    The line through them is dashed if it is doubtful.
    """
    marks, values = [], []
    for number, (recording, found) in enumerate(kept[:MOST]):
        colour, speed = COLOURS[number % len(COLOURS)], found.passages.speed_m_s
        who = channel_name(recording, found.channel, len(kept))
        marks.append(dots(speed, found.columns[average], who, colour, size=3))
        values.append(found.columns[average])
        fit = regression(name, speed, found.columns[name], clean_rows(found))
        if fit is None:
            continue
        ends = np.linspace(fit["slowest_m_s"], fit["fastest_m_s"], 50)
        straight, ink = fit["intercept"] + fit["slope"] * ends, colour if len(kept) > 1 else "black"
        look = {"dash": "dash" if fit["doubtful"] else "solid", "width": 1.4}
        marks += [
            dots(fit["speed_m_s"], fit["means"], "", colour, error=fit["mean_se"], symbol="o",
                 mec="black", size=5, capsize=2),
            line(ends, straight, said(fit), ink, **look),
        ]  # fmt: skip
        if fit["doubtful"] and np.isfinite(fit["curvature"]):
            bent = np.polynomial.polynomial.polyval(ends, fit["parabola"])
            marks.append(line(ends, bent, "parabola", colour, dash="dot", width=1.2))
    return Panel("speed [m/s]", text, marks, limits=(None, robust_range(*values, share=0.0)))


# ---- The speed over a log as one page, a row per log: speed with its error, and acceleration.
#
# Rows of each channel --> PNG, SVG or PDF


#: rows of a channel that are drawn: evenly over the log if there are more
_MOST_ROWS = 20_000


def speed_picture(kept: Sequence[tuple[Recording, Part]]) -> Figure:
    """The page: logs by rows, channels by colour, flagged rows in grey."""
    logs: dict[str, list[Mapping[str, Any]]] = {}
    for recording, part in kept:
        logs.setdefault(recording.log, []).append(part.columns)
    shown = list(logs)[:MOST]
    rows = [_speeds(log, logs[log]) for log in shown]
    if more := len(logs) - len(shown):
        said = f"{rows[-1][0].title}; {more} more logs are not drawn"
        rows[-1][0] = replace(rows[-1][0], title=said)
    return picture(Page(rows, (12.0, 3.2 * len(rows) + 0.4)))


def _speeds(log: str, channels: Sequence[Mapping[str, Any]]) -> list[Panel]:
    """Speed and acceleration of a log."""
    speeds, accelerations, reached = list[Mark](), list[Mark](), list[FloatArray]()
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
    return [
        Panel(
            "time [s]",
            "speed [m/s]",
            speeds,
            f"{Path(log).name}: band: two standard errors; grey: flagged",
            (None, robust_range(*reached, share=0.0)),
            legend={"fontsize": 8} if len(channels) > 1 else None,
        ),
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


def inflation_picture(kept: Sequence[tuple[Recording, Part]]) -> Figure:
    """The page, a row per channel."""
    rows = [
        [_stops(recording, part.found), _ramps(recording, part.found)] for recording, part in kept
    ]
    return picture(Page(rows, (12.0, 3.6 * len(rows) + 0.4)))


_SINCE = "strain since the start [microstrain]"


def _stops(recording: Recording, found: InflationOfChannel) -> Panel:
    """Strain over time; its stops are shaded, with what is lost in each."""
    s, test = found.series, found.inflation
    marks = [line(s["time_s"], MICRO * (s["strain"] - s["strain"][0]), width=1.4)]
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
    title = f"{Path(recording.log).name}: {found.channel.name}; shaded: stops and lost samples"
    return Panel("time [s]", _SINCE, marks, title)


def _ramps(recording: Recording, found: InflationOfChannel) -> Panel:
    """Strain over the inflation pressure, with its straight line."""
    s, test = found.series, found.inflation
    marks = []
    if np.isfinite(s["pressure_Pa"]).any():
        ends = np.array([np.nanmin(s["pressure_Pa"]), np.nanmax(s["pressure_Pa"])])
        rise = test["slope_1_Pa"][0] * (ends - np.nanmean(s["pressure_Pa"]))
        se = 1e11 * test["slope_se_1_Pa"][0]
        text = (
            f"{1e11 * test['slope_1_Pa'][0]:.1f}{f' ± {se:.1g}' if np.isfinite(se) else ''} "
            f"microstrain/bar, straight to {100 * test['nonlinearity'][0]:.1f} %"
        )
        strain = MICRO * (s["strain"].mean() - s["strain"][0] + rise)
        marks = [
            dots(1e-5 * s["pressure_Pa"], MICRO * (s["strain"] - s["strain"][0]), size=3),
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


def wheel_angle_picture(kept: Sequence[tuple[Recording, Part]]) -> Figure:
    """The page, a row per log."""
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
    return picture(Page(rows, (12.0, 2.8 * len(rows) + 0.4)))


# ---- Phase shift (P4).
#
# Top: fronts in the acceleration over wheel angle (Fig. 7), maps of shift and width over speed
# (Fig. 9). Below, a column for each of the first accelerometers: speed, shift and width over time,
# raw (Fig. 8), detrended (Fig. 10), corrected (Figs. 11 to 13). Error bars are two standard errors.


#: accelerometers that have a column of their own
MOST_ACCELEROMETERS = 4
RAW_SHIFTS, DETRENDED, CORRECTED = "0.65", COLOURS[0], COLOURS[1]


def phase_shift_picture(kept: Sequence[tuple[Recording, Part]]) -> Figure:
    """The page."""
    shown = [passages for _, part in kept for passages in part.found.passages][:MOST_ACCELEROMETERS]
    calibration = kept[0][1].found.calibration
    top = Page([[_fronts(shown), *(_map(shown, calibration, name) for name in ("shift", "width"))]])
    columns = [_times(p, clean_passages(p, calibration) if calibration else None) for p in shown]
    below = Page([list(row) for row in zip(*columns, strict=True)], share="x")
    parts, width = [top, below if shown else Page([[None]])], max(4.2 * len(shown), 12.0)
    return picture(Page(size=(width, 13.0), parts=parts, stacked=True, heights=(1.0, 2.2)))


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
        marks.append(_points(p.speed_m_s[p.good], values, se, f"C{number}", opacity=0.5))
    if calibration is not None:
        one = calibration.shift if what == "shift" else calibration.width
        speed = np.linspace(one.low_m_s, one.high_m_s, 200)
        least = calibration.patch_width_deg if what == "width" else 0.0
        change = one(speed, calibration.reference_speed_m_s) + least
        marks.append(line(speed, change, "map", "k", width=1.5))
    name = "phase shift" if what == "shift" else "patch width"
    return Panel(
        "speed [m/s]", f"{name} [deg]", marks, f"{name.capitalize()} and speed (P4 Fig. 9)"
    )


def _points(
    x: FloatArray, y: FloatArray, se: FloatArray, colour: str, name: str = "", **more: Any
) -> Mark:
    """A point per passage with two standard errors, if it has one."""
    error = 2.0 * np.where(np.isfinite(se), se, 0.0)
    return dots(x, y, name, colour, error=error, size=3, elinewidth=0.6, **more)


def _times(p: EdgeTimes, cleaned: Mapping[str, FloatArray] | None) -> list[Panel]:
    """P4 Figs. 8, 10 to 13: speed, shift and width over time."""
    time, good = p.time_s[p.good], p.good
    shifts = [level(0.0, "", "0.8", width=0.8, zorder=0)]
    widths: list[Mark] = []
    for marks, what in ((shifts, "shift"), (widths, "width")):
        values, se = getattr(p, f"{what}_deg")[good], getattr(p, f"{what}_se_deg")[good]
        marks.append(_points(time, values, se, RAW_SHIFTS, "measured (Fig. 8)"))
        if cleaned is not None:
            clean = cleaned[f"{what}_deg"][good]
            marks.append(_points(time, clean, se, DETRENDED, "detrended (Fig. 10)"))
    if cleaned is not None and np.isfinite(cleaned["corrected_deg"]).any():
        shift, se = cleaned["corrected_deg"][good], p.shift_se_deg[good]
        shifts.append(_points(time, shift, se, CORRECTED, "corrected (Figs. 11-13)"))
    driven = {True: ", driven", False: ", undriven", None: ""}[p.driven]
    return [
        Panel(
            "",
            "speed [m/s]",
            [line(p.time_s, p.speed_m_s, colour="k", width=1)],
            f"{Path(p.log).name}: {p.channel}{driven}",
        ),
        Panel("", "phase shift [deg]", shifts),
        Panel("time [s]", "patch width [deg]", widths),
    ]
