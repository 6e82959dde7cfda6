"""The picture of `ladder`: the error falling to the floor, step by step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from tirelog.plots.style import COLOURS, figure_page
from tirelog.vocabulary.observables import drawn

if TYPE_CHECKING:
    from tirelog.diagnosis.results import Ladder


def figure(result: Ladder) -> Any:
    """A matplotlib figure of a ladder."""
    canvas = figure_page(8.0, 4.5)
    steps(canvas.add_subplot(), result)
    return canvas


def steps(axes: Any, result: Ladder) -> None:
    """Error and floor of each step that was taken, on `axes`."""
    factor, unit = drawn(result.observable, result.unit)
    taken = [s for s in result.steps if s.outcome != "not_added"]
    place = list(range(len(taken)))
    held_out = [float("nan") if s.rmse_heldout is None else s.rmse_heldout * factor for s in taken]
    axes.bar(place, held_out, width=0.6, color=COLOURS[5], label="held-out error")
    axes.plot(place, [s.rmse_fit * factor for s in taken], "k_", ms=22, label="error of the fit")
    axes.step(
        place,
        [s.noise_floor * factor for s in taken],
        where="mid",
        color=COLOURS[1],
        label="noise floor",
    )
    for x, s in zip(place, taken, strict=True):
        text = s.decision if s.p_adjusted is None else f"{s.decision}\np = {s.p_adjusted:.2g}"
        height = max(s.rmse_heldout or s.rmse_fit, s.rmse_fit, s.noise_floor)
        if x == place[-1] and result.rmse_untouched is not None:
            height = max(height, result.rmse_untouched)
        axes.annotate(
            text,
            (x, height * factor),
            xytext=(0, 7),
            textcoords="offset points",
            ha="center",
            va="bottom",
            fontsize=8,
        )
    if result.rmse_untouched is not None:
        axes.plot(
            [place[-1]],
            [result.rmse_untouched * factor],
            "D",
            color=COLOURS[4],
            mec="black",
            ls="none",
            label="error on manoeuvres that nothing had touched",
        )
    axes.set_xticks(place, [s.effect for s in taken])
    axes.set(ylabel=f"{result.observable} error [{unit}]")
    axes.margins(y=0.2)
    axes.legend(fontsize=8)
