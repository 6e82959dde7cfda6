"""`tirelog effects [NAME]`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tirelog.cli.common import Format, Output, Plot, Session

if TYPE_CHECKING:
    from tirelog.physics.effects import Effect


def effects(
    name: Annotated[
        str | None, typer.Argument(help="One effect; without it the catalogue.", show_default=False)
    ] = None,
    own: Annotated[
        Path | None,
        typer.Option(
            "--effects", help="Python file with effects of your own; it is run.", show_default=False
        ),
    ] = None,
    plot: Plot = None,
    output: Output = None,
    format: Format = None,
) -> None:
    """The catalogue of effects: id, physics, acts on, parameters, source; with --plot what each
    does to the strain.
    """
    from tirelog.cli.model_page import catalogue_page, catalogue_rows, effect_page
    from tirelog.errors import UsageError, nearest
    from tirelog.physics.model.user_effects import catalogue_with

    catalogue = catalogue_with(own)
    if name is not None and name not in catalogue:
        raise UsageError(
            f"unknown effect {name!r}{nearest(name, catalogue)}; "
            f"allowed are {', '.join(catalogue)}; name one, or none for the list"
        )
    chosen = list(catalogue.values()) if name is None else [catalogue[name]]
    if plot is not None:
        _plot(chosen, plot)
    if format is None and output is None:
        typer.echo(catalogue_page(chosen) if name is None else effect_page(chosen[0]))
        return
    with Session(None).table("effects", output, format) as table:
        table.write(catalogue_rows(chosen))


def _plot(chosen: list[Effect], path: Path) -> None:
    """Each effect's signature: strain with it (at its probe) less strain without, at two speeds,
    coasting and braking.
    """
    from tirelog.errors import UsageError
    from tirelog.storage.whole import whole_file

    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise UsageError(
            "--plot needs matplotlib; it comes with the extra: pip install 'tirelog[plot]'"
        ) from None
    if path.suffix.lower() not in (".png", ".svg"):
        raise UsageError(f"--plot {path}; .png and .svg are allowed; rename it")
    drawn = [effect for effect in chosen if "strain" in effect.reaches]
    if not drawn:
        raise UsageError(
            f"{chosen[0].id} acts on {', '.join(chosen[0].reaches)}, not on strain; "
            "a strain effect can be drawn; choose another"
        )
    columns = min(len(drawn), 4)
    rows = -(-len(drawn) // columns)
    figure = Figure(figsize=(3.6 * columns, 2.6 * rows), layout="constrained")
    for place, effect in enumerate(drawn):
        _draw(figure.add_subplot(rows, columns, place + 1), effect)
    with whole_file(path) as part:
        figure.savefig(part, format=path.suffix.lower()[1:], dpi=110)


def _draw(axes: Any, effect: Effect) -> None:
    import numpy as np

    from tirelog.data.recording import Conditions
    from tirelog.physics.model.model import Model
    from tirelog.vocabulary.conditions import CONDITIONS

    told = {name: c.example for name, c in CONDITIONS.items() if c.example is not None}
    drives = ((10.0, 0.0, "10 m/s"), (20.0, 0.0, "20 m/s"), (20.0, -3.0, "20 m/s, braking 3 m/s^2"))
    phi = np.linspace(-0.8, 0.8, 801)
    base = Model.new("beam")
    full = base.with_effect(effect)
    full = full.with_values({f"{effect.id}.{p.name}": p.probe for p in effect.parameters})
    for speed, acceleration, label in drives:
        conditions = Conditions.of(1, speed_m_s=speed, acceleration_m_s2=acceleration, **told)
        change = (full.predict(conditions, phi) - base.predict(conditions, phi))[0]
        axes.plot(
            1e3 * phi * base.parameters["radius_m"].value, 1e6 * change, label=label, linewidth=1.0
        )
    axes.axvspan(-55.0, 55.0, color="0.92", zorder=0)
    axes.set_title(effect.id, fontsize=9)
    axes.set_xlabel("xi [mm]", fontsize=8)
    axes.set_ylabel("change of strain [1e-6]", fontsize=8)
    axes.tick_params(labelsize=7)
    axes.legend(fontsize=6)
