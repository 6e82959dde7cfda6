"""Shapes of a tire's modes as one page: the belt's outline, and how it is pushed out and in.

Rows of `model modes` --> PNG, SVG or PDF
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from tirelog.plots.style import COLOURS, RAW, figure_page, write

#: modes that are drawn, the lowest ones, and their amplitude over the radius
_MOST, _DRAWN = 12, 0.15


def modes_picture(columns: Mapping[str, Sequence[Any]], path: Path) -> None:
    """Write the page to `path`: cos(n phi) outward for n lobes, the belt turned for n = 0.

    A mode is drawn as the one wave that has most of its energy; on the road it has others too.
    """
    order = np.argsort(np.asarray(columns["frequency_Hz"], float))[:_MOST]
    across = 4
    figure = figure_page(10.0, 2.7 * max(-(-order.size // across), 1))
    panels = figure.subplots(max(-(-order.size // across), 1), across, squeeze=False).ravel()
    phi = np.linspace(0.0, 2.0 * np.pi, 361)
    for axes in panels:
        axes.set_axis_off()
    for axes, row in zip(panels, order, strict=False):
        lobes = int(columns["lobes"][row])
        upright = 0.5 * np.pi * ("vertical" in str(columns["shape"][row]))
        out = _DRAWN * np.cos(lobes * (phi - upright)) * (lobes > 0)
        # an inextensible belt moves along itself too: v = -sin(n phi) / n
        turned = np.sin(lobes * (phi - upright))
        along = -_DRAWN * turned / lobes if lobes else np.full(phi.size, _DRAWN)
        angle = phi + along
        axes.plot(np.cos(phi), np.sin(phi), color=RAW, lw=0.8)
        axes.plot((1 + out) * np.cos(angle), (1 + out) * np.sin(angle), color=COLOURS[0], lw=1.4)
        spoke = slice(0, None, 45)
        axes.plot(
            ((1 + out) * np.cos(angle))[spoke], ((1 + out) * np.sin(angle))[spoke], ".", color="k"
        )
        axes.set_aspect("equal")
        axes.set_title(
            f"{float(columns['frequency_Hz'][row]):.1f} Hz, {columns['support'][row]}\n"
            f"{columns['shape'][row]}, {columns['direction'][row]}\n"
            f"{float(columns['share'][row]):.0%} of its energy as drawn",
            fontsize=8,
        )
    write(figure, path)
