"""`tirelog effects [NAME]`."""

from __future__ import annotations

from typing import Annotated

import typer

from tirelog.cli import completion, options
from tirelog.cli.session import Session


def effects(
    name: Annotated[
        str | None,
        typer.Argument(
            help="One effect; without it the catalogue.", autocompletion=completion.effects
        ),
    ] = None,
    own: options.EffectsFile = None,
    plot: options.Plot = None,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
) -> None:
    """The catalogue of effects: id, physics, acts on, parameters, source; with --plot what each
    does to the strain.
    """
    from tirelog.api.models import catalogue_with, draw_effects
    from tirelog.cli.models.model_page import catalogue_page, catalogue_rows, effect_page
    from tirelog.errors import refuse_unknown

    session = Session(None, quiet, output, format)
    catalogue = catalogue_with(own)
    if name is not None:
        refuse_unknown(
            name, catalogue, f"unknown effect {name!r}", do="name one, or none for the list"
        )
    chosen = list(catalogue.values()) if name is None else [catalogue[name]]
    if plot is not None:
        draw_effects(chosen, plot)
    if session.paged:
        typer.echo(catalogue_page(chosen) if name is None else effect_page(chosen[0]))
        return
    with session.table("effects") as table:
        table.write(catalogue_rows(chosen))
