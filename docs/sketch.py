"""docs/pictures/tire.png: the tire, its patch and its sensors, with the strain that one turn gives.

python docs/sketch.py               draws it (also: make outputs)
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

import tirelog
from tirelog.api.models import angles
from tirelog.plots.record import figure_page

#: the tire of the sketch: half of the patch's angle is large, so that it can be seen [rad]
HALF_PATCH = np.radians(28)
DARK, BLUE, RED = "#22303c", "#0b5c95", "#b3371f"


def main() -> None:
    """Draw the picture."""
    figure = figure_page(10, 3.8)
    wheel, strain = figure.subplots(1, 2, width_ratios=(1.2, 1))
    draw_wheel(wheel)
    draw_strain(strain)
    figure.savefig(sys.argv[1], dpi=100, metadata={"Software": None})


def draw_wheel(axes: Any) -> None:
    """The tire from its side: tread, liner, rim, patch, grating, accelerometer, encoder."""
    angle = np.linspace(-np.pi, np.pi, 721)  # from straight down
    road = -np.cos(HALF_PATCH)
    for radius, width in ((1.0, 3.0), (0.93, 1.5)):
        height = np.maximum(-radius * np.cos(angle), road + (1.0 - radius))
        axes.plot(radius * np.sin(angle), height, color=DARK, linewidth=width)
    axes.plot(0.55 * np.sin(angle), -0.55 * np.cos(angle), color=DARK, linewidth=1.5)
    axes.plot([-1.35, 1.35], [road - 0.02] * 2, color="0.5", linewidth=2)
    edge = np.sin(HALF_PATCH)
    axes.plot([-edge, edge], [road] * 2, color=RED, linewidth=5, solid_capstyle="butt")
    for x, name, side in ((-edge, "exit edge ", "right"), (edge, " entry edge", "left")):
        axes.text(x, road - 0.08, name, color=RED, ha=side, va="top")
    axes.text(0, road - 0.08, "patch", color=RED, ha="center", va="top")
    mark(axes, (0.93, 118), (1.35, 0.95), "fiber Bragg grating\n(strain)", BLUE)
    mark(axes, (0.93, 205), (-1.25, 1.0), "accelerometer\n(radial)", BLUE)
    mark(axes, (0.0, 0), (-1.42, -0.35), "wheel encoder\n(angle)", BLUE)
    arrow = {"arrowstyle": "-|>", "color": DARK, "connectionstyle": "arc3,rad=-0.3"}
    axes.annotate("", (0.32, 0.22), (-0.32, 0.22), arrowprops=arrow)
    axes.annotate("", (1.7, -0.45), (1.2, -0.45), arrowprops={"arrowstyle": "-|>", "color": DARK})
    axes.text(1.45, -0.42, "travel", color=DARK, ha="center", va="bottom")
    axes.set(xlim=(-1.75, 1.75), ylim=(-1.15, 1.2), aspect="equal")
    axes.axis("off")


def mark(
    axes: Any, place: tuple[float, float], label: tuple[float, float], text: str, colour: str
) -> None:
    """A sensor at (radius, degrees from straight down), and its name elsewhere."""
    radius, degrees = place
    x, y = radius * np.sin(np.radians(degrees)), -radius * np.cos(np.radians(degrees))
    axes.plot([x], [y], "o", color=colour, markersize=8, zorder=3)
    axes.annotate(
        text, (x, y), label, color=colour, ha="center", va="center",
        arrowprops={"arrowstyle": "-", "color": colour, "shrinkB": 5},
    )  # fmt: skip


def draw_strain(axes: Any) -> None:
    """Strain of a beam on a foundation while the grating passes the patch."""
    radius, half = 0.305, 0.055  # [m]
    model = tirelog.Model.new("beam", load_N=3434.0, radius_m=radius, patch_half_length_m=half)
    wave = 1e6 * tirelog.predict(model, {"speed_m_s": 20.0})[0]  # [microstrain]
    xi = 1e3 * radius * angles(len(wave))  # [mm]
    axes.axvspan(-1e3 * half, 1e3 * half, color=RED, alpha=0.12, linewidth=0)
    axes.axhline(0, color="0.7", linewidth=1)
    axes.plot(xi, wave, color=BLUE, linewidth=2)
    top = axes.get_ylim()[1]
    for side, name in ((-half, "entry edge "), (half, " exit edge")):
        axes.text(1e3 * side, top, name, color=RED, va="bottom", ha="right" if side < 0 else "left")
    axes.set(
        xlim=(-400, 400),
        xlabel="place of the grating about the patch, xi [mm]",
        ylabel="strain [microstrain]",
    )
    axes.spines[["top", "right"]].set_visible(False)


if __name__ == "__main__":
    main()
