"""`tirelog model new | show | add | remove | worn | nuisance | fit`, beside `model_predict`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tirelog.cli import completion
from tirelog.cli.common import (
    EffectsFile,
    Format,
    Logs,
    ModelFile,
    Output,
    Quiet,
    Session,
    SetupFile,
    say,
)
from tirelog.cli.models.predict import Model_, forces, modes, predict, setup_in
from tirelog.cli.targets import in_a_folder

if TYPE_CHECKING:
    from tirelog.api.answers import MeasuredLogs
    from tirelog.physics.model.model import Model

app = typer.Typer(help="Make, change, fit and evaluate model files.", no_args_is_help=True)

Target = Annotated[
    Path,
    typer.Option(
        "-o", "--output", help="Model file to write.", show_default=False, callback=in_a_folder
    ),
]
Sets = Annotated[
    list[str],
    typer.Option("--set", metavar="NAME=VALUE", help="A parameter's value; several times."),
]


def _words(text: str) -> list[str]:
    """The words of a list with commas."""
    return [word.strip() for word in text.split(",")]


def _assignments(sets: list[str], prefix: str = "") -> dict[str, float]:
    """NAME=VALUE pairs as numbers."""
    from tirelog.errors import UsageError

    values = {}
    for text in sets:
        name, equals, number = text.partition("=")
        try:
            value = float(number)
        except ValueError:
            value = math.nan
        if not equals or not math.isfinite(value):
            raise UsageError(
                f"--set {text}",
                allowed="NAME=VALUE with a finite number is allowed, such as --set "
                "line_mass_kg_m=4.5",
                do="correct it",
            )
        values[prefix + name.strip().removeprefix(prefix)] = value
    return values


@app.command()
def new(
    output: Target,
    carcass: Annotated[
        str | None,
        typer.Option(help="beam (the default), ring or coupled_ring.", show_default=False),
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help="Start from the numbers of a paper's table: P1, P2 (beams) or P3 (a ring).",
            autocompletion=completion.presets,
            show_default=False,
        ),
    ] = None,
    setup: SetupFile = None,
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
    sets: Sets = [],  # noqa: B006
    quiet: Quiet = False,
) -> None:
    """Make a model without effects; tire and conditions come from the setup if it has them."""
    from tirelog.physics.model.from_setup import new_model
    from tirelog.physics.model.save import save_model

    model, remarks = new_model(
        carcass,
        setup_in(setup),
        observable=None if observable is None else _words(observable),
        contact=contact,
        values=_assignments(sets),
        preset=preset,
    )
    save_model(model, output)
    if not quiet:
        for remark in remarks:
            say(f"note: {remark}")
        fitted = output.with_stem(f"{output.stem}_fitted")
        say(
            f"wrote {output}; next: tirelog model fit LOG --model {output} -o {fitted}, or "
            f"tirelog compare LOG --model {output}"
        )


@app.command()
def show(
    model: Model_,
    against: Annotated[
        Path | None, typer.Option(help="Another model: differences in sigma.", show_default=False)
    ] = None,
    history: Annotated[
        bool, typer.Option("--history", help="The ladders climbed from this model.")
    ] = False,
    effects: EffectsFile = None,
    output: Output = None,
    format: Format = None,
) -> None:
    """Show a model to read, or its parameters as a table; with --against the difference of two
    models in sigma.
    """
    from tirelog.api.models import load_model
    from tirelog.cli.models.history import history_page, history_rows
    from tirelog.cli.models.model_page import difference_page, model_page
    from tirelog.physics.model.difference import difference_rows, parameter_rows

    read = load_model(model, effects=effects)
    if history:
        rows: dict[str, Any] = history_rows(model)
    else:
        rows = (
            parameter_rows(read)
            if against is None
            else difference_rows(read, load_model(against, effects=effects))
        )
    if format is None and output is None:
        typer.echo(
            history_page(rows)
            if history
            else model_page(read)
            if against is None
            else difference_page(rows)
        )
        return
    with Session(None).table("model", output, format) as table:
        table.write(rows)


@app.command()
def add(
    model: Model_,
    effect: Annotated[
        str,
        typer.Argument(
            help="Effect of the catalogue, or of --effects.", autocompletion=completion.effects
        ),
    ],
    output: Target,
    sets: Sets = [],  # noqa: B006
    setup: SetupFile = None,
    effects: EffectsFile = None,
) -> None:
    """Add an effect at its start values (or --set ones); a grating's length is fixed if the
    setup gives it.
    """
    from tirelog.api.models import load_model
    from tirelog.physics.model.from_setup import with_gauge_length
    from tirelog.physics.model.save import save_model
    from tirelog.physics.model.user_effects import effect_called

    read = load_model(model, effects=effects)
    changed = read.with_effect(
        effect_called(effect, effects or read.effects_file, asked=effects is not None)
    ).with_values(_assignments(sets, f"{effect}."))
    given = setup_in(setup)
    save_model(with_gauge_length(changed, given) if effect == "gauge_length" else changed, output)


@app.command()
def remove(
    model: Model_,
    effect: Annotated[str, typer.Argument(help="Effect of the model.")],
    output: Target,
    effects: EffectsFile = None,
) -> None:
    """Remove an effect."""
    from tirelog.api.models import load_model
    from tirelog.physics.model.save import save_model

    save_model(load_model(model, effects=effects).without_effect(effect), output)


@app.command()
def worn(
    model: Model_,
    output: Target,
    new_depth: Annotated[float, typer.Option(help="Tread depth of the model as it is [m].")],
    depth: Annotated[float, typer.Option(help="Tread depth that is left [m].")],
    neutral_axis: Annotated[
        float,
        typer.Option(
            help="Metres that the neutral axis moves per metre worn off: 0.5 of one material, 0 of "
            "a stiff belt."
        ),
    ] = 0.5,
    effects: EffectsFile = None,
    quiet: Quiet = False,
) -> None:
    """Write the model of a worn tire: tread and bristles stiffer as 1/depth, the lever arm shorter.

    P3 shows wear (Figs. 5, 6) and gives no equation; this is that of a block of rubber.
    """
    from tirelog.api.models import load_model
    from tirelog.physics.model.save import save_model
    from tirelog.physics.model.worn import worn_model

    made, changed = worn_model(load_model(model, effects=effects), new_depth, depth, neutral_axis)
    save_model(made, output)
    if not quiet:
        for name, (before, after) in changed.items():
            say(f"note: {name} {before:g} -> {after:g}")


@app.command()
def nuisance(
    model: Model_,
    name: Annotated[
        str,
        typer.Argument(
            help="wheel, drift, rolling, patch_law or pressure_law.",
            autocompletion=completion.nuisances,
        ),
    ],
    use: Annotated[str, typer.Argument(help="on, off, or auto: if it earns its place.")],
    output: Target,
) -> None:
    """Say whether a nuisance of wheel, road or day stands beside the model."""
    from tirelog.api.models import load_model
    from tirelog.physics.model.save import save_model

    save_model(load_model(model).with_nuisance(name, use), output)


@app.command()
def fit(
    logs: Logs,
    model: ModelFile,
    output: Target,
    setup: SetupFile = None,
    channel: Annotated[
        list[str],
        typer.Option(
            help="Channel to fit; several times for several (default: the first that fits)."
        ),
    ] = [],  # noqa: B006
    nuisances: Annotated[
        str,
        typer.Option(
            help="Taken out of each mean of like revolutions: offset, amplitude (by some 10 %), "
            "shift (words, or none)."
        ),
    ] = "shift",
    effects: EffectsFile = None,
    quiet: Quiet = False,
) -> None:
    """Fit a model's free parameters to the logs as `compare` does, and write the model with values
    and standard errors.

    Several channels are fitted at once, each with its own noise, scatter and offset of each log.
    Masses, damping and bristles of a coupled ring are fitted to the
    obstacles of logs whose setup has a [road].
    """
    from tirelog.api.answers import fit as fit_model
    from tirelog.api.models import load_model
    from tirelog.cli.models.model_page import fit_page, learned_page
    from tirelog.physics.model.save import refuse_another, save_model
    from tirelog.vocabulary.observables import WAVEFORMS

    refuse_another(output)
    start = load_model(model, effects=effects)
    words = [w for w in nuisances.replace(",", " ").split() if w != "none"]
    if start.observable not in WAVEFORMS:
        words = ["shift"]
    with Session(setup, quiet) as session:
        measured = _measured(session, logs, start, list(dict.fromkeys(channel)))
        with session.working() as line:
            line.say("fitting the model")
            result = fit_model(measured, start, nuisances=words)
        for remark in result.remarks:
            session.note(remark)
        save_model(result.model, output)
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
