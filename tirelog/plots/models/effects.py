"""The picture of `effects`: what each does to the strain."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.errors import UsageError
from tirelog.physics.effects import Effect
from tirelog.physics.model.model import Model
from tirelog.plots.style import COLOURS, MICRO, figure_page, write
from tirelog.vocabulary.conditions import CONDITIONS

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def signatures(chosen: Sequence[Effect], path: Path) -> None:
    """Each effect's signature.

    Strain with it (at its probe) less strain without, at two speeds, coasting and braking.
    """
    drawn = [effect for effect in chosen if "strain" in effect.reaches]
    if not drawn:
        raise UsageError(
            f"{chosen[0].id} acts on {', '.join(chosen[0].reaches)}, not on strain",
            allowed="a strain effect can be drawn",
            do="choose another",
        )
    columns = min(len(drawn), 4)
    rows = -(-len(drawn) // columns)
    figure = figure_page(3.6 * columns, 2.6 * rows)
    panels = [figure.add_subplot(rows, columns, place + 1) for place in range(len(drawn))]
    for axes, effect in zip(panels, drawn, strict=True):
        _draw(axes, effect)
    lines, names = panels[0].get_legend_handles_labels()
    figure.legend(lines, names, loc="outside upper center", ncols=len(names), fontsize=8)
    write(figure, path)


def _draw(axes: Axes, effect: Effect) -> None:
    """The change of strain along the tread by one effect."""
    drives: tuple[tuple[float, float, str, dict[str, Any]], ...] = (
        (10.0, 0.0, "10 m/s", {"color": COLOURS[5], "lw": 1.2}),
        (20.0, 0.0, "20 m/s", {"color": COLOURS[0], "lw": 1.6}),
        (20.0, -3.0, "20 m/s, braking 3 m/s²", {"color": COLOURS[1], "lw": 1.2, "ls": "--"}),
    )
    told = {name: c.example for name, c in CONDITIONS.items() if c.example is not None}
    phi = np.linspace(-0.8, 0.8, 801)
    base = Model.new("beam")
    full = base.with_effect(effect)
    full = full.with_values({f"{effect.id}.{p.name}": p.probe for p in effect.parameters})
    for speed, acceleration, label, style in drives:
        conditions = Conditions.of(1, speed_m_s=speed, acceleration_m_s2=acceleration, **told)
        change = (full.predict(conditions, phi) - base.predict(conditions, phi))[0]
        axes.plot(
            1e3 * phi * base.parameters["radius_m"].value, MICRO * change, label=label, **style
        )
    axes.axvspan(-55.0, 55.0, color="0.92", zorder=0)
    axes.set_title(effect.id, fontsize=9)
    axes.set_xlabel("xi [mm], entry to exit; grey: the patch", fontsize=8)
    axes.set_ylabel("change of strain [microstrain]", fontsize=8)
    axes.tick_params(labelsize=7)
