"""The picture of `compare` on transients.

A row per hit, in time (measured, predicted, missed) and in frequency (added, missed, floor).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.plots.style import COLOURS, figure_page, label, write
from tirelog.vocabulary.observables import drawn

if TYPE_CHECKING:
    from tirelog.diagnosis.obstacles.compare import HitResult, TransientComparison

#: hits that are drawn, and how long [s] of each
_MOST = 4
SHOWN_S = 0.25


def figure(result: TransientComparison) -> Any:
    """A matplotlib figure of the first hits."""
    factor, unit = drawn(result.observable, result.unit)
    shown = result.hits[:_MOST]
    canvas = figure_page(13.0, 3.2 * len(shown) + 0.6)
    grid = canvas.add_gridspec(len(shown), 2, width_ratios=(1.7, 1.0))
    for row, hit in enumerate(shown):
        _in_time(canvas.add_subplot(grid[row, 0]), hit, factor, unit, first=row == 0)
        _in_frequency(canvas.add_subplot(grid[row, 1]), hit, factor, unit, first=row == 0)
    return canvas


def draw(result: TransientComparison, path: Path) -> None:
    """Write the figure; the suffix decides the format."""
    write(figure(result), path)


def _in_time(axes: Any, result: HitResult, factor: float, unit: str, *, first: bool) -> None:
    hit = result.hit
    at = hit.since_s <= SHOWN_S
    time = 1e3 * hit.since_s[at]
    axes.plot(time, factor * hit.measured[at], color=COLOURS[6], lw=0.9, label="measured")
    axes.plot(time, factor * hit.predicted[at], color=COLOURS[0], lw=0.9, label="model")
    below = factor * (hit.measured[at].min() - 1.2 * np.abs(hit.added[at]).max())
    for values, colour, words in (
        (hit.added, 7, "added by the obstacle"),
        (hit.missed, 1, "of that missed by the model"),
    ):
        axes.plot(time, below + factor * values[at], color=COLOURS[colour], lw=0.8, label=words)
    title = (
        f"{Path(result.log.log).name}, {hit.time_s:.3f} s, {hit.speed_m_s:.1f} m/s: "
        f"{100 * result.row()['covered']:.0f} % covered"
    )
    label(axes, "time since the hit [ms]", unit, title)
    if first:
        axes.legend(fontsize=7, ncols=2)


def _in_frequency(axes: Any, result: HitResult, factor: float, unit: str, *, first: bool) -> None:
    s = result.spectrum
    lines = (
        ("added", s.added, 7),
        ("missed", s.missed, 1),
        ("residual", s.residual, 0),
        ("off the obstacle", s.steady, 4),
        ("floor", s.floor, 2),
    )
    for name, squares, colour in lines:
        axes.stairs(
            factor * np.sqrt(np.maximum(squares, 0.0)),
            s.edges_Hz,
            color=COLOURS[colour],
            label=name,
        )
    axes.set_yscale("log")
    label(axes, "frequency [Hz]", f"rms in the band [{unit}]")
    if first:
        axes.legend(fontsize=7)
