"""`tirelog model new | show | add | remove | worn | nuisance | fit`, and `tirelog effects`."""

from __future__ import annotations

import math
import shlex
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tirelog.cli import options
from tirelog.cli.predict import forces, modes, predict
from tirelog.cli.session import Session
from tirelog.errors import UsageError, refuse_unknown

if TYPE_CHECKING:
    from tirelog.api.answers import MeasuredLogs
    from tirelog.api.models import Model


app = typer.Typer(help="Make, change, fit and evaluate model files.", no_args_is_help=True)


def _words(text: str) -> list[str]:
    """The words of a list with commas."""
    return [word.strip() for word in text.split(",")]


def _assignments(sets: list[str], prefix: str = "") -> dict[str, float | str]:
    """NAME=VALUE pairs: numbers, and words for an effect's choices."""
    values: dict[str, float | str] = {}
    for text in sets:
        name, equals, word = text.partition("=")
        value: float | str = word.strip()
        with suppress(ValueError):
            value = float(word)
        if not equals or value == "" or (isinstance(value, float) and not math.isfinite(value)):
            raise UsageError(
                f"--set {text}",
                allowed="NAME=VALUE with a finite number or a word is allowed, such as --set "
                "line_mass_kg_m=4.5 or --set law=softens",
                do="correct it",
            )
        values[prefix + name.strip().removeprefix(prefix)] = value
    return values


@app.command()
def new(
    output: options.NewModel,
    carcass: Annotated[
        str | None, typer.Option(help="beam (the default), ring or coupled_ring.")
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help="Start from the numbers of a paper's table: P1, P2 (beams) or P3 (a ring).",
            autocompletion=options.presets,
        ),
    ] = None,
    setup: options.SetupFile = None,
    observable: Annotated[
        str | None,
        typer.Option(
            help="What the model predicts, as in the model file, several with commas between them "
            "to be fitted together; default what the setup's channels measure, else strain."
        ),
    ] = None,
    contact: Annotated[
        str | None,
        typer.Option(help="prescribed or flat_road; rings stand on a flat road by default."),
    ] = None,
    sets: options.Sets = [],  # noqa: B006
    quiet: options.Quiet = False,
) -> None:
    """Make a model without effects; tire and conditions come from the setup if it has them."""
    from tirelog.api.models import new_model, save_model

    session = Session(setup, quiet)
    model, remarks = new_model(
        carcass,
        session.setup(),
        observable=None if observable is None else _words(observable),
        contact=contact,
        values=_assignments(sets),
        preset=preset,
    )
    save_model(model, output)
    session.notes(remarks)
    named, fitted = (
        shlex.quote(str(path)) for path in (output, output.with_stem(f"{output.stem}_fitted"))
    )
    session.say(
        f"wrote {output}; next: tirelog model fit LOG --model {named} -o {fitted}, or "
        f"tirelog compare LOG --model {named}"
    )


@app.command()
def show(
    model: options.Model,
    against: Annotated[
        Path | None, typer.Option(help="Another model: differences in sigma.")
    ] = None,
    history: Annotated[
        bool, typer.Option("--history", help="The ladders climbed from this model.")
    ] = False,
    effects: options.EffectsFile = None,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
) -> None:
    """Show a model to read, or its parameters as a table; with --against the difference of two
    models in sigma.
    """
    from tirelog.api.models import difference_rows, ladder_rows, load_model, parameter_rows
    from tirelog.cli.pages import difference_page, history_page, model_page

    session = Session(None, quiet, output, format)
    read = load_model(model, effects=effects)
    if history:
        rows: dict[str, Any] = ladder_rows(model)
        shown = history_page(rows)
    elif against is not None:
        rows = difference_rows(read, load_model(against, effects=effects))
        shown = difference_page(rows)
    else:
        rows, shown = parameter_rows(read), model_page(read)
    if session.paged:
        typer.echo(shown)
        return
    with session.table("model") as table:
        table.write(rows)


@app.command()
def add(
    model: options.Model,
    effect: Annotated[
        str,
        typer.Argument(
            help="Effect of the catalogue, or of --effects.", autocompletion=options.effects
        ),
    ],
    new_model: options.EditedModel,
    sets: options.Sets = [],  # noqa: B006
    setup: options.SetupFile = None,
    effects: options.EffectsFile = None,
    quiet: options.Quiet = False,
) -> None:
    """Add an effect at its start values (or --set ones); a grating's length is fixed if the
    setup gives it.
    """
    from tirelog.api.models import added, load_model, save_model

    read, given = load_model(model, effects=effects), Session(setup, quiet).setup()
    values = _assignments(sets, f"{effect}.")
    save_model(added(read, effect, values, setup=given, effects=effects), new_model)


@app.command()
def remove(
    model: options.Model,
    effect: Annotated[str, typer.Argument(help="Effect of the model.")],
    new_model: options.EditedModel,
    effects: options.EffectsFile = None,
    quiet: options.Quiet = False,
) -> None:
    """Remove an effect."""
    from tirelog.api.models import load_model, save_model

    save_model(load_model(model, effects=effects).without_effect(effect), new_model)


@app.command()
def worn(
    model: options.Model,
    output: options.NewModel,
    new_depth: Annotated[float, typer.Option(help="Tread depth of the model as it is [m].")],
    depth: Annotated[float, typer.Option(help="Tread depth that is left [m].")],
    neutral_axis: Annotated[
        float,
        typer.Option(
            help="Metres that the neutral axis moves per metre worn off: 0.5 of one material, 0 of "
            "a stiff belt."
        ),
    ] = 0.5,
    effects: options.EffectsFile = None,
    quiet: options.Quiet = False,
) -> None:
    """Write the model of a worn tire: tread and bristles stiffer as 1/depth, the lever arm shorter.

    P3 shows wear (Figs. 5, 6) and gives no equation; this is that of a block of rubber.
    """
    from tirelog.api.models import load_model, save_model, worn_model

    made, changed = worn_model(load_model(model, effects=effects), new_depth, depth, neutral_axis)
    save_model(made, output)
    Session(quiet=quiet).notes(
        f"{name} {before:g} -> {after:g}" for name, (before, after) in changed.items()
    )


@app.command()
def nuisance(
    model: options.Model,
    name: Annotated[
        str,
        typer.Argument(
            help="wheel, drift, rolling, patch_law, pressure_law or form.",
            autocompletion=options.nuisances,
        ),
    ],
    use: Annotated[str, typer.Argument(help="on, off, or auto: if it earns its place.")],
    new_model: options.EditedModel,
    quiet: options.Quiet = False,
) -> None:
    """Say whether a nuisance of wheel, road or day, or the tire's form, stands beside the model."""
    from tirelog.api.models import load_model, save_model

    save_model(load_model(model).with_nuisance(name, use), new_model)


@app.command()
def fit(
    logs: options.Logs,
    model: options.ModelFile,
    new_model: options.EditedModel,
    setup: options.SetupFile = None,
    channel: Annotated[
        list[str],
        typer.Option(
            help="Channel to fit; several times for several (default: the first that fits). Of "
            "strain several gratings: their names with commas between, or all."
        ),
    ] = [],  # noqa: B006
    nuisances: Annotated[
        str,
        typer.Option(
            help="Taken out of each mean of like revolutions: offset, amplitude (by some 10 %), "
            "shift (words, or none)."
        ),
    ] = "shift",
    effects: options.EffectsFile = None,
    quiet: options.Quiet = False,
) -> None:
    """Fit a model's free parameters to the logs as `compare` does, and write the model with values
    and standard errors.

    Several channels are fitted at once, each with its own noise, scatter and offset of each log.
    Masses, damping and bristles of a coupled ring are fitted to the
    obstacles of logs whose setup has a [road].
    """
    from tirelog.api.answers import fit as fit_model
    from tirelog.api.models import load_model, refuse_another, save_model
    from tirelog.cli.pages import fit_page, learned_page

    refuse_another(new_model)
    start = load_model(model, effects=effects)
    words = [w for w in nuisances.replace(",", " ").split() if w != "none"]
    with Session(setup, quiet) as session:
        measured = _measured(session, logs, start, list(dict.fromkeys(channel)))
        with session.working() as line:
            line.say("fitting the model")
            result = fit_model(measured, start, nuisances=words)
        session.notes(result.remarks)
        session.refuse_edit(model, new_model)
        save_model(result.model, new_model)
        if not quiet:
            typer.echo(fit_page(result))
            if result.learned is not None:
                typer.echo(learned_page(result.learned))


def _measured(
    session: Session, logs: list[str], model: Model, channels: list[str]
) -> list[MeasuredLogs]:
    """What was measured by each of the channels; by the first that fits if none is named.

    One channel's logs are read one after the other.
    """
    from tirelog.api.answers import measure, observable_of

    if len(channels) < 2:
        return [measure(session.recordings(logs), model, channels[0] if channels else None)]
    recordings = session.all_recordings(logs)
    return [measure(recordings, observable_of(name, recordings, model), name) for name in channels]


for command in (predict, forces, modes):
    app.command()(command)


def effects(
    name: Annotated[
        str | None,
        typer.Argument(
            help="One effect; without it the catalogue.", autocompletion=options.effects
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
    from tirelog.cli.pages import catalogue_page, catalogue_rows, effect_page

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
