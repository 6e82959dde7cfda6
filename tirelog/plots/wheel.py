"""Waveforms drawn around the wheel, as they are where they act: the road is below."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from tirelog.plots.style import EDGE, RAW
from tirelog.vocabulary.arrays import FloatArray


def around_the_wheel(
    axes: Any,
    waves: Sequence[tuple[FloatArray, FloatArray, FloatArray, str]],
    colours: Sequence[Any],
    half_angle_rad: float,
    unit: str = "microstrain",
) -> float:
    """Waveforms (angle, value, band, name) on polar `axes`: zero is a circle, the road is below.

    The tire turns so that the entry is at the right. The radius of the zero circle comes back: the
    whole range of the values, so that the lowest of them stays off the centre.
    """
    values = np.concatenate([w for _, w, _, _ in waves])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    zero = 1.6 * max(high - low, 1e-12) - low
    axes.set_theta_zero_location("S")
    axes.set_theta_direction(-1)
    for (phi, wave, band, name), colour in zip(waves, colours, strict=True):
        axes.fill_between(
            phi, zero + wave - band, zero + wave + band, color=colour, alpha=0.3, lw=0
        )
        axes.plot(phi, zero + wave, color=colour, label=name)
    round_it = np.linspace(-np.pi, np.pi, 361)
    axes.plot(round_it, np.full(361, zero), color=RAW, lw=0.9, ls="--")
    outer = zero + high + 0.12 * (high - low)
    arc = np.linspace(-half_angle_rad, half_angle_rad, 61)
    axes.plot(arc, np.full(61, outer), color=EDGE, lw=6.0, solid_capstyle="butt")
    axes.annotate("patch", (0.0, outer), xytext=(0, -14), textcoords="offset points",
                  ha="center", va="top", color=EDGE, annotation_clip=False)  # fmt: skip
    axes.annotate("rolls →", (0.94, 0.04), xycoords="axes fraction", ha="right", color=RAW)
    step = _round_step(high - low)
    ticks = np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step
    names = [f"{t:g} {unit}" if t == ticks[-1] else f"{t:g}" for t in ticks]
    _, labels = axes.set_rgrids(zero + ticks, names, angle=205.0, fontsize=10)
    for text in labels:
        text.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 1.0})
        text.set_ha("center")
    axes.set_rlim(0.0, outer)
    turns = np.arange(-135, 181, 45)
    axes.set_thetagrids(turns % 360, ["" if t == 0 else f"{t}°" for t in turns], fontsize=11)
    axes.grid(alpha=0.35)
    return zero


def _round_step(span: float) -> float:
    """A round number that divides the span into two to four."""
    size = 10.0 ** np.floor(np.log10(span / 2.0))
    return float(size * max(n for n in (1.0, 2.0, 5.0) if n * size <= span / 2.0))
