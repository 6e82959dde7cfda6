"""The picture of `diagnose`: what the model leaves before and after, at one scale, and the ranking.

residual before | residual after | its size by angle, before and after, beside the floor
the candidates by what they remove, with their p and strength
"""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.diagnosis.answer import in_unit
from tirelog.plots.models.compare import coloured, edges
from tirelog.plots.models.compare import draw as draw_comparison
from tirelog.plots.style import COLOURS, figure_page
from tirelog.vocabulary.observables import drawn

if TYPE_CHECKING:
    from tirelog.diagnosis.diagnose import Diagnosis
    from tirelog.diagnosis.results import Comparison, Map

#: candidates that the ranking shows
_MOST = 10
#: letters in a line of the verdict above the picture
_LETTERS = 130
_BEFORE, _AFTER, _FLOOR = COLOURS[1], COLOURS[0], COLOURS[6]


def figure(result: Diagnosis) -> Any:
    """A matplotlib figure of a diagnosis."""
    canvas = figure_page(13.0, 8.5)
    grid = canvas.add_gridspec(2, 3, height_ratios=(1.0, 0.9))
    before, after = _first(result.before), _first(result.after)
    if before.by_speed.phi_rad.size > 1:
        _maps(canvas, grid, before, after)
    else:
        _values(canvas.add_subplot(grid[0, :]), before, after)
    ranking(canvas.add_subplot(grid[1, :]), result)
    canvas.suptitle("\n".join(textwrap.wrap(result.sentence, _LETTERS)), fontsize=11)
    return canvas


def draw(result: Diagnosis, path: Path) -> list[Path]:
    """Write the figure; the suffix decides the format.

    Of several observables it shows the first; the comparison of each other one has a path of its
    own beside it, and these come back.
    """
    from tirelog.storage.whole import whole_file

    with whole_file(path) as part:
        figure(result).savefig(part, format=path.suffix.lstrip(".") or "png", dpi=110)
    others = []
    for other in result.after.parts[1:]:
        target = path.with_stem(f"{path.stem}_{other.observable}")
        draw_comparison(other, target)
        others.append(target)
    return others


def _first(result: Comparison) -> Comparison:
    return result.parts[0] if result.parts else result


def _maps(canvas: Any, grid: Any, before: Comparison, after: Comparison) -> None:
    """The residual over angle and speed before and after, and its size by angle."""
    factor, unit = drawn(before.observable, before.unit)
    floor = before.noise_floor * factor
    shown = [one.by_speed.residual * factor for one in (before, after)]
    limit = np.nanmax(np.abs(shown[0])) if np.isfinite(shown[0]).any() else 1.0
    all_axes = []
    for column, (word, one, values) in enumerate(
        zip(("before", "after"), (before, after), shown, strict=True)
    ):
        axes = canvas.add_subplot(grid[0, column])
        mesh = coloured(axes, one.by_speed, values, floor, float(limit))
        edges(axes, one.half_angle_rad)
        axes.set(xlabel="angle [deg]", ylabel="speed [m/s]" if column == 0 else "")
        axes.set_title(f"{word}: {_error(one, factor)} {unit}", fontsize=10)
        all_axes.append(axes)
    if mesh is not None:
        canvas.colorbar(
            mesh,
            ax=all_axes,
            label=f"residual [{unit}]",
            location="bottom",
            format="%g",
            shrink=0.6,
        )
    axes = canvas.add_subplot(grid[0, 2])
    for word, one, colour in (("before", before, _BEFORE), ("after", after, _AFTER)):
        phi, size = _by_angle(one.by_speed)
        axes.plot(phi, size * factor, color=colour, label=word, lw=1.4)
    axes.axhline(floor, color=_FLOOR, ls="--", lw=1.0, label="noise floor of a revolution")
    edges(axes, before.half_angle_rad)
    axes.set(xlabel="angle [deg]", ylabel=f"rms of what is left [{unit}]", yscale="log")
    axes.legend(fontsize=8, loc="upper left")
    axes.set_title("means of like revolutions", fontsize=10)


def _values(axes: Any, before: Comparison, after: Comparison) -> None:
    """The residual of a number per revolution over the speed, before and after."""
    factor, unit = drawn(before.observable, before.unit)
    for word, one, colour in (("before", before, _BEFORE), ("after", after, _AFTER)):
        axes.plot(
            one.by_speed.axis,
            np.ravel(one.by_speed.residual) * factor,
            ".",
            color=colour,
            label=f"{word}: {_error(one, factor)} {unit}",
        )
    for side in (-1.0, 1.0):
        axes.axhline(side * before.noise_floor * factor, color=_FLOOR, ls="--", lw=1.0)
    axes.set(xlabel="speed [m/s]", ylabel=f"residual [{unit}]")
    axes.legend(fontsize=8)


def _by_angle(map_: Map) -> tuple[Any, Any]:
    """Angle [deg] and root mean square over the speeds, where anything is known."""
    known = np.isfinite(map_.residual)
    number = known.sum(axis=0)
    square = np.where(known, map_.residual, 0.0) ** 2
    some = number > 0
    return np.rad2deg(map_.phi_rad[some]), np.sqrt(square.sum(axis=0)[some] / number[some])


def _error(one: Comparison, factor: float) -> str:
    if one.rmse_heldout is None:
        return f"error of the fit {in_unit(one.rmse, factor)}"
    return f"held-out error {in_unit(one.rmse_heldout, factor)}"


def ranking(axes: Any, result: Diagnosis) -> None:
    """The candidates by what they remove of the excess, on `axes`; the selected ones full."""
    shown = result.effects[:_MOST]
    place = np.arange(len(shown))[::-1]
    colours = [_AFTER if c.selected else COLOURS[7] for c in shown]
    axes.barh(place, [100.0 * c.excess_removed for c in shown], color=colours, height=0.65)
    for y, c in zip(place, shown, strict=True):
        p = "p < 0.001" if c.p_adjusted < 0.001 else f"p = {c.p_adjusted:.2g}"
        axes.annotate(
            f"{p}{', or ' + ', '.join(c.group) if c.group else ''}",
            (100.0 * c.excess_removed, y),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
        )
    axes.set_yticks(place, [c.effect for c in shown])
    axes.set(xlabel="of the excess removed [%]", xlim=(0.0, 118.0))
    axes.set_title("candidates; full colour: selected", fontsize=10)
