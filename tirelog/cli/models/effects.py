"""`tirelog effects [NAME]`."""

from __future__ import annotations

from typing import Annotated

import typer

from tirelog.cli import completion
from tirelog.cli.common import EffectsFile, Format, Output, Plot, Session


def effects(
    name: Annotated[
        str | None,
        typer.Argument(
            help="One effect; without it the catalogue.",
            show_default=False,
            autocompletion=completion.effects,
        ),
    ] = None,
    own: EffectsFile = None,
    plot: Plot = None,
    output: Output = None,
    format: Format = None,
) -> None:
    """The catalogue of effects: id, physics, acts on, parameters, source; with --plot what each
    does to the strain.
    """
    from tirelog.cli.models.model_page import catalogue_page, catalogue_rows, effect_page
    from tirelog.errors import refuse_unknown
    from tirelog.physics.model.user_effects import catalogue_with

    catalogue = catalogue_with(own)
    if name is not None:
        refuse_unknown(
            name, catalogue, f"unknown effect {name!r}", do="name one, or none for the list"
        )
    chosen = list(catalogue.values()) if name is None else [catalogue[name]]
    if plot is not None:
        from tirelog.plots.models.effects import signatures

        signatures(chosen, plot)
    if format is None and output is None:
        typer.echo(catalogue_page(chosen) if name is None else effect_page(chosen[0]))
        return
    with Session(None).table("effects", output, format) as table:
        table.write(catalogue_rows(chosen))
