"""The footprint of whatever logs a command has worked on, as one page (P2 Figs. 17 to 22).

    Recording and FootprintOfChannel of each channel --while the log is open--> Sketch
        --all of them--> PNG, SVG or PDF

Left: strain and speed over time of the first channel (Figs. 17, 20), contact lengths over time and
speed of all. Right: one passage, free rolling if there is one, and the one with the clearest slip
onset: strain, first and second derivative along the tread, raw and low-passed, edges by each method
(Figs. 18, 19, 21).
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.by_channel import Part
from tirelog.data.recording import Channel, Recording
from tirelog.dsp.filters import lowpassed, window_spectra
from tirelog.errors import UsageError
from tirelog.plots.record import Mark, Page, Panel, dots, level, line, upright
from tirelog.plots.style import (
    COLOURS,
    EDGE,
    MARK,
    MICRO,
    RAW,
    decimated,
    picture,
    robust_range,
    write,
)
from tirelog.plots.turns import TurnsSketch, turns_picture
from tirelog.strain.dissipation import AVERAGED, Regression, regression
from tirelog.strain.dissipation_table import DissipationOfChannel, clean_rows
from tirelog.strain.footprint.footprint import FootprintOfChannel
from tirelog.strain.footprint.measure import along_tread
from tirelog.strain.footprint.refine import PatchWindows, gather_windows
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import good

#: how an onset of slip is marked: an open ring, 6 points wide
_ONSET: dict[str, Any] = {"symbol": "o", "mfc": "none", "mec": MARK, "size": 6}
#: a legend above the lengths, small enough for three of them side by side
_ABOVE = {"fontsize": 6.5, "ncols": 3, "loc": "upper center"}
#: channels with a colour of their own, and the window of a passage in half lengths
MOST_PASSAGES, WINDOW = 8, 2.2


@dataclass(frozen=True)
class FootprintSketch:
    """What the page needs of one channel, read while its log is open.

    `signal` decimated; `shown`: (row, title, window) of the passages.
    """

    recording: Recording
    found: FootprintOfChannel
    signal: tuple[FloatArray, FloatArray]
    shown: list[tuple[int, str, PatchWindows]]

    @classmethod
    def of(cls, recording: Recording, found: FootprintOfChannel) -> FootprintSketch:
        """The sketch of a channel whose log is open."""
        shown = []
        for row, title in _passages(found):
            window = next(
                iter(
                    gather_windows(
                        found.channel,
                        found.passages.sign,
                        found.passages.index,
                        _reach(found, row),
                        np.array([row]),
                    )
                ),
                None,
            )
            if window is not None:
                shown.append((row, title, window))
        return cls(recording, found, decimated(found.channel), shown)


def footprint_sketch(recording: Recording, part: Part, kind: str) -> FootprintSketch | TurnsSketch:
    """What a picture of this kind keeps of a channel.  UsageError: it is no grating."""
    if not isinstance(part.found, FootprintOfChannel):
        raise UsageError(
            "--plot draws the footprint of a grating; this log has accelerometers",
            allowed="a log of strain is allowed",
            do="leave --plot out; `tirelog phase-shift --plot` draws fronts",
            file=recording.log,
        )
    return (FootprintSketch if kind == "page" else TurnsSketch).of(recording, part.found)


def draw_footprint(sketches: Sequence[Any], path: Path, kind: str) -> None:
    """Write the picture of this kind to `path`."""
    if kind == "page":
        footprint_picture(sketches, path)
    else:
        turns_picture(sketches, path, kind)


def footprint_picture(sketches: Sequence[FootprintSketch], path: Path) -> None:
    """Write the page to `path`."""
    kept = [(sketch.recording, sketch.found) for sketch in sketches]
    first = next((sketch for sketch in sketches if len(sketch.found.passages)), sketches[0])
    p = first.found.passages
    speed = line(p.time_s, p.speed_m_s, symbol=".", size=2, width=0.8)
    speeds = Panel("time [s]", "speed [m/s]", [speed])
    by_time, by_speed = _lengths(kept)
    over_time = [[signal_panel(first, len(kept))], [speeds], [by_time]]
    columns = [_passage(first.found, *shown) for shown in first.shown]
    right = [list(row) for row in zip(*columns, strict=True)] or [[None]]
    left = [Page(over_time, heights=(1.0, 0.7, 1.0), share="x"), Page([[by_speed]])]
    parts = [Page(parts=left, stacked=True, heights=(2.7, 1.1)), Page(right, share="x")]
    size = (13.5 if len(columns) < 2 else 17.0, 10.5)
    write(picture(Page(size=size, parts=parts, widths=(1.0, 0.8 * max(len(columns), 1)))), path)


def signal_panel(sketch: FootprintSketch | DissipationSketch, channels: int) -> Panel:
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
    for number, (recording, found) in enumerate(kept[:MOST_PASSAGES]):
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
    """Rows worth a look.

    A clean one of free rolling, well sampled; and the one with the surest slip onset.
    """
    f, p = found.footprint, found.passages
    if not len(p):
        return []
    clean = good(f.quality) & np.isfinite(f.length_m)
    some = np.flatnonzero(clean) if clean.any() else np.arange(len(p))
    free = some[
        np.argsort(np.abs(np.nan_to_num(p.acceleration_m_s2[some])), kind="stable")[
            : max(some.size // 3, 1)
        ]
    ]
    row = int(free[np.argsort(p.speed_m_s[free], kind="stable")[free.size // 4]])
    chosen = [(row, "passage")]
    onset = np.flatnonzero(np.isfinite(f.slip["onset_m"]) & clean)
    if onset.size:
        best = int(onset[np.argmin(f.slip["onset_m"][onset] / f.length_m[onset])])
        if best != row:
            chosen.append((best, "passage with slip"))
    return chosen


def _reach(found: FootprintOfChannel, row: int) -> FloatArray:
    """Half window [samples] that shows passage `row`, for every passage."""
    length, rate = _length(found, row), found.channel.axis.rate_Hz
    samples = 0.7 * WINDOW * length / found.passages.speed_m_s[row] * rate + 3.0 * rate / _cutoff(
        found, row
    )
    return np.full(len(found.passages), samples)


def _length(found: FootprintOfChannel, row: int) -> float:
    return (
        float(found.footprint.length_m[row]) if np.isfinite(found.footprint.length_m[row]) else 0.1
    )


def _cutoff(found: FootprintOfChannel, row: int) -> float:
    asked = found.footprint.cutoff_Hz[row]
    return float(min(asked if np.isfinite(asked) else 400.0, 0.49 * found.channel.axis.rate_Hz))


def _passage(found: FootprintOfChannel, row: int, title: str, windows: PatchWindows) -> list[Panel]:
    """Strain and its derivatives along the tread (P2 Figs. 18, 19, 21), with the edges."""
    p, f = found.passages, found.footprint
    speed, acceleration = float(p.speed_m_s[row]), float(np.nan_to_num(p.acceleration_m_s2[row]))
    cutoff, middle = _cutoff(found, row), f.fits["shift_m"][row]
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
    said = (
        f"{title}: {p.time_s[row]:.2f} s, {speed:.1f} m/s, {round(acceleration, 1) + 0.0:+.1f} m/s²"
        f", low-pass {cutoff:.0f} Hz"
    )
    inner = found.channel.surface == "inner"
    at = (speed, acceleration, _length(found, row), cutoff)
    panels = passage_panels(windows, at, inner, lines, (RAW, COLOURS[0]))
    return [replace(panels[0], title=said), *panels[1:]]


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
        of = (windows.rate_Hz, windows.centre, speed, acceleration, np.array([cut]), upsample)
        tread = along_tread(windows.values, *of)
        spectra, m = window_spectra(windows.values), windows.values.shape[1]
        strain = lowpassed(spectra, windows.rate_Hz, np.array([cut]), m, upsample)[0]
        xi = 1e3 * tread.xi_m[0]
        shown = [
            (-1.0 if inner else 1.0) * scale * curve
            for curve, scale in (
                (strain + np.linspace(ends[0], ends[1], strain.size), MICRO),
                (tread.first[0], 1e3),
                (tread.second[0], 1.0),
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


#: channels that are drawn
MOST_TURNS = 8
#: revolutions in the magnification of the strain
MAGNIFIED = 4


@dataclass(frozen=True)
class DissipationSketch:
    """What the page needs of one channel, read while its log is open.

    `signal` decimated, `magnified` a few revolutions.
    """

    recording: Recording
    found: DissipationOfChannel
    signal: tuple[FloatArray, FloatArray]
    magnified: tuple[FloatArray, FloatArray, float]

    @classmethod
    def of(cls, recording: Recording, found: DissipationOfChannel) -> DissipationSketch:
        """The sketch of a channel whose log is open."""
        p = found.passages
        steady = np.flatnonzero(found.dissipation.steady)
        row = int(steady[steady.size // 2]) if steady.size else len(p) // 2
        row = max(min(row, len(p) - MAGNIFIED - 1), 0)
        magnified = (np.zeros(0), np.zeros(0), float("nan"))
        if len(p) > MAGNIFIED:
            low, high = max(int(p.index[row]) - 10, 0), int(p.index[row + MAGNIFIED])
            magnified = (
                found.channel.axis.time(low, high),
                found.channel.read(low, high),
                float(p.speed_m_s[row]),
            )
        return cls(recording, found, decimated(found.channel), magnified)


def dissipation_sketch(recording: Recording, part: Part, kind: str) -> DissipationSketch:
    """What the page keeps of a channel."""
    return DissipationSketch.of(recording, part.found)


def dissipation_picture(sketches: Sequence[DissipationSketch], path: Path) -> None:
    """Write the page to `path`."""
    kept = [(sketch.recording, sketch.found) for sketch in sketches]
    first = next((sketch for sketch in sketches if len(sketch.found.passages)), sketches[0])
    d, p = first.found.dissipation, first.found.passages
    power, factor = "specific power [m³/s²]", "dissipation factor [1/m]"
    error = 2.0 * first.found.columns["dissipation_factor_se_1_m"]
    errors = dots(p.time_s, d.factor_1_m, "two standard errors", error=error, symbol="",
                  elinewidth=0.6, opacity=0.5)  # fmt: skip
    still = np.where(d.steady, p.speed_m_s, np.nan)
    speeds = [
        dots(p.time_s, p.speed_m_s, "", RAW, size=3),
        line(
            _smoothed(p.time_s), _smoothed(p.speed_m_s), f"mean of {AVERAGED}", "#CC0000", width=0.9
        ),
        dots(p.time_s, still, "constant speed", EDGE, size=3),
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
    write(picture(Page(size=(15.0, 10.0), parts=parts, widths=(1.35, 1.0))), path)


def _smoothed(values: FloatArray) -> FloatArray:
    """Moving averages over AVERAGED revolutions (P1 Fig. 7, red); of fewer all as they are."""
    if values.size < AVERAGED:
        return values
    return np.convolve(values, np.full(AVERAGED, 1.0 / AVERAGED), "valid")


def _over_time(
    time_s: FloatArray, values: FloatArray, averages: FloatArray, text: str, *more: Mark
) -> Panel:
    """Every revolution, and the moving averages in stretches of constant speed (P1 Figs. 9, 10)."""
    marks = [
        dots(time_s, values, "each revolution", size=2.5, opacity=0.6),
        line(time_s, averages, "moving average, constant speed", EDGE, width=1.6),
        *more,
    ]
    return Panel("time [s]", text, marks, limits=(None, robust_range(values, share=0.005)))


def _magnified(sketch: DissipationSketch) -> Panel:
    """The strain of a few revolutions (P1 Fig. 8)."""
    time, strain, speed = sketch.magnified
    title = f"{MAGNIFIED} revolutions at {speed:.1f} m/s" if time.size else ""
    marks = [line(time, MICRO * strain, width=0.9)]
    return Panel("time [s]", "strain [microstrain]", marks, title)


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
    for number, (recording, found) in enumerate(kept[:MOST_TURNS]):
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
