"""Dissipation of whatever logs a command has worked on, as one page (P1 Figs. 7 to 11).

    Recording and DissipationOfChannel of each channel --while the log is open--> Sketch
        --all of them--> PNG, SVG or PDF

Left: strain and speed over time (Figs. 7, 8's magnification), specific power and factor over time
with their moving averages (Figs. 9, 10). Right: both averages over speed with their regressions
(Fig. 11).
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from tirelog.by_channel import Part
from tirelog.data.recording import Recording
from tirelog.plots.style import (
    COLOURS,
    EDGE,
    MICRO,
    RAW,
    draw_signal,
    figure_page,
    label,
    least_and_most,
    robust_range,
    write,
)
from tirelog.strain.dissipation import AVERAGED
from tirelog.strain.dissipation_fit import Regression, regression
from tirelog.strain.dissipation_table import DissipationOfChannel, clean_rows
from tirelog.vocabulary.arrays import FloatArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: channels that are drawn
MOST = 8
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


def sketch(recording: Recording, part: Part, kind: str) -> DissipationSketch:
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
    for number, (recording, found) in enumerate(kept[:MOST]):
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
