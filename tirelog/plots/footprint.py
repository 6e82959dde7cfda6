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
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.by_channel import Part
from tirelog.data.recording import Recording
from tirelog.dsp.filters import lowpassed, window_spectra
from tirelog.errors import UsageError
from tirelog.plots.style import (
    COLOURS,
    EDGE,
    MARK,
    MICRO,
    RAW,
    draw_signal,
    figure_page,
    label,
    least_and_most,
    robust_range,
    write,
)
from tirelog.plots.turns import TurnsSketch, turns_picture
from tirelog.strain.dissipation import AVERAGED, Regression, regression
from tirelog.strain.dissipation_table import DissipationOfChannel, clean_rows
from tirelog.strain.footprint.footprint import FootprintOfChannel
from tirelog.strain.footprint.plain_edges import along_tread
from tirelog.strain.footprint.refine import PatchWindows, gather_windows
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import good

if TYPE_CHECKING:
    from matplotlib.axes import Axes


#: channels with a colour of their own, and the window of a passage in half lengths
MOST_PASSAGES, WINDOW = 8, 2.2


@dataclass(frozen=True)
class FootprintSketch:
    """What the page needs of one channel, read while its log is open.

    `signal` decimated; `shown`: (row, title, window) of the passages.
    """

    recording: Recording
    found: FootprintOfChannel
    signal: tuple[FloatArray, FloatArray, FloatArray]
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
        return cls(recording, found, least_and_most(found.channel), shown)


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
    shown = first.shown
    figure = figure_page(13.5 if len(shown) < 2 else 17.0, 10.5)
    left, right = np.asarray(
        figure.subfigures(1, 2, width_ratios=[1.0, 0.8 * max(len(shown), 1)])
    ).ravel()
    strain, speed, lengths, by_speed = left.subplots(4, 1, height_ratios=[1.0, 0.7, 1.0, 1.0])
    _drive(strain, speed, first, len(kept))
    _lengths(lengths, by_speed, kept)
    strain.sharex(speed)
    lengths.sharex(speed)
    panels = right.subplots(3, max(len(shown), 1), sharex="col", squeeze=False)
    for column, (row, title, window) in enumerate(shown):
        _passage(panels[:, column], first.found, row, title, window)
    write(figure, path)


def _drive(strain: Axes, speed: Axes, sketch: FootprintSketch, channels: int) -> None:
    """Strain and speed over time (P2 Figs. 17, 20) of one of so many channels."""
    recording, found = sketch.recording, sketch.found
    draw_signal(strain, sketch.signal)
    label(
        strain,
        "",
        "strain [microstrain]",
        f"{Path(recording.log).name}: {found.channel.name} ({found.channel.surface} surface)"
        f"{f', 1 of {channels}' if channels > 1 else ''}",
    )
    speed.plot(
        found.passages.time_s, found.passages.speed_m_s, ".-", color=COLOURS[0], ms=2, lw=0.8
    )
    label(speed, "", "speed [m/s]")


def _lengths(
    over_time: Axes, over_speed: Axes, kept: Sequence[tuple[Recording, FootprintOfChannel]]
) -> None:
    """Contact lengths by the three methods over time and speed.

    Each channel in its colour, and the static footprint.
    """
    values = []
    for number, (_, found) in enumerate(kept[:MOST_PASSAGES]):
        f, p = found.footprint, found.passages
        for axes, x in ((over_time, p.time_s), (over_speed, p.speed_m_s)):
            for length, marker, alpha in (
                (f.length_d2_m, "^", 0.25),
                (f.length_d1_m, "v", 0.25),
                (f.length_m, ".", 0.9),
            ):
                axes.plot(
                    x,
                    1e3 * length,
                    marker,
                    color=COLOURS[number % len(COLOURS)],
                    ms=4 if marker == "." else 2.5,
                    alpha=alpha,
                )
        values += [1e3 * f.length_m, 1e3 * f.length_d2_m, 1e3 * f.length_d1_m]
        onset = np.isfinite(f.slip.onset_m)
        over_time.plot(p.time_s[onset], 1e3 * f.length_m[onset], "o", mfc="none", mec=MARK, ms=6)
    limits = robust_range(*values)
    statics = (recording.setup.tire.static_footprint_length_m for recording, _ in kept)
    for static in {length for length in statics if length is not None}:
        for axes in (over_time, over_speed):
            axes.axhline(
                1e3 * static, color="black", ls=":", lw=1.2, label=f"static {1e3 * static:.0f} mm"
            )
        limits = min(limits[0], 0.97e3 * static), max(limits[1], 1.03e3 * static)
    for axes, marker, text in (
        (over_time, ".", "best estimate"),
        (over_time, "^", "2nd derivative (P2)"),
        (over_time, "v", "1st derivative"),
    ):
        axes.plot([], [], marker, color="black", label=text)
    if any(np.isfinite(found.footprint.slip.onset_m).any() for _, found in kept):
        over_time.plot([], [], "o", mfc="none", mec=MARK, label="slip onset seen")
    for number, (recording, found) in enumerate(kept[:MOST_PASSAGES]):
        name = (
            found.channel.name
            if len(kept) == 1
            else f"{Path(recording.log).name}: {found.channel.name}"
        )
        over_speed.plot([], [], "s", color=COLOURS[number % len(COLOURS)], label=name)
    over_time.legend(fontsize=6.5, ncols=3, loc="upper center")
    over_speed.legend(fontsize=7, ncols=3, loc="upper center")
    top = limits[1] + 0.35 * (limits[1] - limits[0])
    label(over_time, "time [s]", "contact length [mm]", ylim=(limits[0], top))
    label(over_speed, "speed [m/s]", "contact length [mm]", ylim=(limits[0], top))


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
    onset = np.flatnonzero(np.isfinite(f.slip.onset_m) & clean)
    if onset.size:
        best = int(onset[np.argmin(f.slip.onset_m[onset] / f.length_m[onset])])
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


def _passage(
    panels: Sequence[Axes], found: FootprintOfChannel, row: int, title: str, windows: PatchWindows
) -> None:
    """Strain and its derivatives along the tread (P2 Figs. 18, 19, 21).

    Raw and low-passed, with the edges.
    """
    p = found.passages
    speed, acceleration = p.speed_m_s[[row]], np.nan_to_num(p.acceleration_m_s2[[row]])
    length, cutoff = _length(found, row), np.array([_cutoff(found, row)])
    upward = -1.0 if found.channel.surface == "inner" else 1.0
    known = windows.values[0][np.isfinite(windows.values[0])]
    edge = max(windows.values.shape[1] // 32, 1)
    ends = [float(part.mean()) if part.size else 0.0 for part in (known[:edge], known[-edge:])]
    panes = []
    for cut, upsample in ((np.array([1e9]), 1), (cutoff, 4)):
        tread = along_tread(
            windows.values, windows.rate_Hz, windows.centre, speed, acceleration, cut, upsample
        )
        strain = lowpassed(
            window_spectra(windows.values), windows.rate_Hz, cut, windows.values.shape[1], upsample
        )[0]
        panes.append(
            (
                1e3 * tread.xi_m[0],
                (
                    strain + np.linspace(ends[0], ends[1], strain.size),
                    tread.first[0],
                    tread.second[0],
                ),
            )
        )
    units = (
        ("strain [microstrain]", MICRO),
        ("d/dξ [microstrain/mm]", 1e3),
        ("d²/dξ² [microstrain/mm²]", 1.0),
    )
    for number, (axes, (text, scale)) in enumerate(zip(panels, units, strict=True)):
        for (xi, curves), colour, width, style in (
            (panes[0], RAW, 0.8, ".-"),
            (panes[1], COLOURS[0], 1.4, "-"),
        ):
            axes.plot(xi, upward * scale * curves[number], style, color=colour, lw=width, ms=3)
        _edges(axes, found, row)
        xi, curves = panes[1]
        shown = upward * scale * curves[number][np.abs(xi) < 1e3 * WINDOW * 0.5 * length]
        label(
            axes,
            "",
            text,
            xlim=(-1e3 * WINDOW * 0.5 * length, 1e3 * WINDOW * 0.5 * length),
            ylim=robust_range(shown, share=0.0),
        )
    speed_text = (
        f"{p.time_s[row]:.2f} s, {speed[0]:.1f} m/s, {round(acceleration[0], 1) + 0.0:+.1f} m/s², "
        f"low-pass {cutoff[0]:.0f} Hz"
    )
    panels[0].set_title(f"{title}: {speed_text}", loc="left", fontsize=9)
    panels[2].set_xlabel("ξ from the patch centre [mm]   (entry − … exit +)")
    panels[0].legend(fontsize=7, loc="lower right")


def _edges(axes: Axes, found: FootprintOfChannel, row: int) -> None:
    """Vertical lines at the edges by each method, and at the slip onset."""
    f = found.footprint
    middle = f.fits.shift_m[row]
    best, plain = (np.array([-0.5, 0.5]) * length[row] for length in (f.length_m, f.length_d1_m))
    for ends, words, style in (
        (middle + best, "edges, best estimate", {"color": EDGE, "lw": 1.3}),
        ((f.d2_entry_m[row], f.d2_exit_m[row]), "by the 2nd derivative", {"ls": "--"}),
        (middle + plain, "by the 1st derivative", {"ls": ":"}),
    ):
        drawn: dict[str, Any] = {"color": "black", "lw": 0.9, **style}
        for place, name in zip(ends, (words, None), strict=True):
            axes.axvline(1e3 * place, label=name, **drawn)
    if np.isfinite(f.slip.onset_m[row]):
        onset = 1e3 * (middle + f.slip.onset_m[row])
        axes.axvline(
            onset, color=MARK, lw=1.5, label=f"slip onset {1e3 * f.slip.onset_m[row]:.1f} mm"
        )


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
    signal: tuple[FloatArray, FloatArray, FloatArray]
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
        return cls(recording, found, least_and_most(found.channel), magnified)


def dissipation_sketch(recording: Recording, part: Part, kind: str) -> DissipationSketch:
    """What the page keeps of a channel."""
    return DissipationSketch.of(recording, part.found)


def dissipation_picture(sketches: Sequence[DissipationSketch], path: Path) -> None:
    """Write the page to `path`."""
    kept = [(sketch.recording, sketch.found) for sketch in sketches]
    first = next((sketch for sketch in sketches if len(sketch.found.passages)), sketches[0])
    figure = figure_page(15.0, 10.0)
    left, right = np.asarray(figure.subfigures(1, 2, width_ratios=[1.35, 1.0])).ravel()
    strain, power, factor, speed = left.subplots(4, 1, sharex=True)
    recording, found = first.recording, first.found
    draw_signal(strain, first.signal)
    label(
        strain,
        "",
        "strain [microstrain]",
        f"{Path(recording.log).name}: {found.channel.name} ({found.channel.surface} surface)"
        f"{f', 1 of {len(kept)}' if len(kept) > 1 else ''}",
    )
    d = found.dissipation
    _over_time(
        power, found, d.specific_power_m3_s2, d.specific_power_mean_m3_s2, "specific power [m³/s²]"
    )
    _over_time(factor, found, d.factor_1_m, d.factor_mean_1_m, "dissipation factor [1/m]")
    time_s, error = found.passages.time_s, found.columns["dissipation_factor_se_1_m"]
    ends = d.factor_1_m + 2.0 * np.array([[-1.0], [1.0]]) * error
    factor.vlines(time_s, *ends, color=COLOURS[0], lw=0.6, alpha=0.5, label="two standard errors")
    factor.legend(fontsize=7)
    speed.plot(found.passages.time_s, found.passages.speed_m_s, ".", color=RAW, ms=3)
    smooth = [_smoothed(x) for x in (found.passages.time_s, found.passages.speed_m_s)]
    speed.plot(*smooth, color="#CC0000", lw=0.9, label=f"mean of {AVERAGED}")
    still = np.where(d.steady, found.passages.speed_m_s, np.nan)
    speed.plot(found.passages.time_s, still, ".", color=EDGE, ms=3, label="constant speed")
    speed.legend(fontsize=7)
    label(speed, "time [s]", "speed [m/s]")
    magnified, power_by, factor_by = right.subplots(3, 1)
    _magnified(magnified, first)
    _over_speed(
        power_by,
        kept,
        "specific_power_m3_s2",
        "specific_power_mean_m3_s2",
        "specific power [m³/s²]",
    )
    _over_speed(
        factor_by,
        kept,
        "dissipation_factor_1_m",
        "dissipation_factor_mean_1_m",
        "dissipation factor [1/m]",
    )
    write(figure, path)


def _smoothed(values: FloatArray) -> FloatArray:
    """Moving averages over AVERAGED revolutions (P1 Fig. 7, red); of fewer all as they are."""
    if values.size < AVERAGED:
        return values
    return np.convolve(values, np.full(AVERAGED, 1.0 / AVERAGED), "valid")


def _over_time(
    axes: Axes, found: DissipationOfChannel, values: FloatArray, averages: FloatArray, text: str
) -> None:
    """Every revolution, and the moving averages in stretches of constant speed (P1 Figs. 9, 10)."""
    axes.plot(
        found.passages.time_s,
        values,
        ".",
        color=COLOURS[0],
        ms=2.5,
        alpha=0.6,
        label="each revolution",
    )
    axes.plot(
        found.passages.time_s,
        averages,
        "-",
        color=EDGE,
        lw=1.6,
        label="moving average, constant speed",
    )
    axes.legend(fontsize=7)
    label(axes, "", text, ylim=robust_range(values, share=0.005))


def _magnified(axes: Axes, sketch: DissipationSketch) -> None:
    """The strain of a few revolutions (P1 Fig. 8)."""
    time, strain, speed = sketch.magnified
    axes.plot(time, MICRO * strain, color=COLOURS[0], lw=0.9)
    label(
        axes,
        "time [s]",
        "strain [microstrain]",
        f"{MAGNIFIED} revolutions at {speed:.1f} m/s" if time.size else "",
    )


def said(line: Regression) -> str:
    """The legend of a line.

    Its slope with the error, and what speaks against it, in lines that a legend holds.
    """
    error = f" ± {line.slope_se:.1g}" if np.isfinite(line.slope_se) else ""
    return "\n".join([f"{line.slope:.3g}{error} per m/s", *textwrap.wrap(line.judgement, 44)])


def _over_speed(
    axes: Axes,
    kept: Sequence[tuple[Recording, DissipationOfChannel]],
    name: str,
    average: str,
    text: str,
) -> None:
    """Moving averages sorted by speed, means of the stretches, and their line (P1 Fig. 11).

    The line through them is dashed if it is doubtful.
    """
    values = []
    for number, (recording, found) in enumerate(kept[:MOST_TURNS]):
        colour = COLOURS[number % len(COLOURS)]
        speed = found.passages.speed_m_s
        order = np.argsort(speed)
        who = (
            found.channel.name
            if len(kept) == 1
            else f"{Path(recording.log).name}: {found.channel.name}"
        )
        axes.plot(speed[order], found.columns[average][order], ".", color=colour, ms=3, label=who)
        values.append(found.columns[average])
        line = regression(name, speed, found.columns[name], clean_rows(found))
        if line is not None:
            axes.errorbar(
                line.speed_m_s,
                line.means,
                line.mean_se,
                fmt="o",
                color=colour,
                mec="black",
                ms=5,
                capsize=2,
            )
            ends = np.linspace(line.slowest_m_s, line.fastest_m_s, 50)
            style = "--" if line.doubtful else "-"
            axes.plot(
                ends,
                line.intercept + line.slope * ends,
                style,
                color=colour if len(kept) > 1 else "black",
                lw=1.4,
                label=said(line),
            )
            if line.doubtful and np.isfinite(line.curvature):
                axes.plot(
                    ends,
                    np.polynomial.polynomial.polyval(ends, line.parabola),
                    ":",
                    color=colour,
                    lw=1.2,
                    label="parabola",
                )
    axes.legend(fontsize=7)
    label(axes, "speed [m/s]", text, ylim=robust_range(*values, share=0.0))
