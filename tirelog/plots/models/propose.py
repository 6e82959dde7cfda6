"""The picture of `propose`: the measured shape with its band, and what is left before and after."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.physics.model.own.empirical import FRAMES
from tirelog.plots.style import COLOURS, figure_page
from tirelog.vocabulary.observables import drawn

if TYPE_CHECKING:
    from tirelog.diagnosis.propose.results import Proposal


def figure(result: Proposal) -> Any:
    """A matplotlib figure of a proposal."""
    canvas = figure_page(11.0, 4.5)
    left, right = canvas.subplots(1, 2)
    shape(left, result)
    rest(right, result)
    return canvas


def shape(axes: Any, result: Proposal) -> None:
    """The best measured shape with two standard errors, on `axes`."""
    if not result.shapes:
        return
    best = result.shapes[0]
    frame = FRAMES[best.frame]
    factor, unit = (
        drawn(result.observable, result.unit) if best.acts_on == result.observable else (1.0, "")
    )
    words = {"contact_pressure": "mean pressures", "load": "N"}.get(best.acts_on, unit)
    low, high = best.values - 2.0 * best.band, best.values + 2.0 * best.band
    axes.fill_between(best.nodes, low * factor, high * factor, color=COLOURS[5], alpha=0.5, lw=0)
    axes.plot(best.nodes, best.values * factor, color=COLOURS[0])
    seen = np.abs(best.values) > 3.0 * best.band
    if seen.any():
        axes.set_xlim(best.nodes[seen][0], best.nodes[seen][-1])
        largest = 1.3 * float(np.abs(best.values[seen]).max()) * factor
        axes.set_ylim(-largest, largest)
    of = "" if frame.unit == "1" else f" [{frame.unit}]"
    axes.set(
        xlabel=f"{frame.words.removeprefix('in the ').removeprefix('along the ')}{of}",
        ylabel=f"{best.acts_on} [{words}]",
        title=f"measured shape, times {best.law}",
    )


def rest(axes: Any, result: Proposal) -> None:
    """The leading shape of what is left before and after, on `axes`."""
    factor, unit = drawn(result.observable, result.unit)
    angle = np.degrees(result.phi_rad)
    axes.plot(angle, result.leading_before * factor, color=COLOURS[1], label="before")
    axes.plot(angle, result.leading_after * factor, color=COLOURS[2], label="with the proposal")
    axes.set(xlabel="angle [deg]", ylabel=f"{result.observable} [{unit}]", title="what is left")
    axes.legend(fontsize=8)
