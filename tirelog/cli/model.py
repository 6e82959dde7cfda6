"""`tirelog model new | show | add | remove | fit | predict | forces | modes`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tirelog.cli import completion
from tirelog.cli.common import (
    ChannelName,
    EffectsFile,
    Format,
    Logs,
    ModelFile,
    Output,
    Plot,
    Quiet,
    Session,
    SetupFile,
    say,
)
from tirelog.cli.targets import in_a_folder

if TYPE_CHECKING:
    from tirelog.api.answers import MeasuredLogs
    from tirelog.data.recording import Conditions
    from tirelog.data.setup import Setup
    from tirelog.physics.model.model import Model

app = typer.Typer(help="Make, change, fit and evaluate model files.", no_args_is_help=True)

Model_ = Annotated[Path, typer.Argument(metavar="MODEL", help="Model file.", show_default=False)]
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


def _setup(path: Path | None) -> Setup | None:
    from tirelog.data.setup import load_setup

    return None if path is None else load_setup(path)


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
        _setup(setup),
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
    from tirelog.cli.history import history_page, history_rows
    from tirelog.cli.model_page import difference_page, model_page
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
    """Add an effect at its start values (or --set ones); a grating's length is fixed where the
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
    given = _setup(setup)
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
    from tirelog.cli.model_page import fit_page, learned_page
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


#: one value, several with commas, or FROM:TO:STEP
_SEVERAL = "; several with commas, or FROM:TO:STEP"
Speeds = Annotated[str, typer.Option(help=f"Speed [m/s]{_SEVERAL}.")]
Loads = Annotated[
    str | None,
    typer.Option(
        help=f"Load [N]{_SEVERAL}; default the setup's, else the model's.", show_default=False
    ),
]
Pressures = Annotated[
    str | None,
    typer.Option(help=f"Inflation pressure [Pa]{_SEVERAL}.", show_default=False),
]
Accelerations = Annotated[str, typer.Option(help=f"Longitudinal acceleration [m/s^2]{_SEVERAL}.")]
Slips = Annotated[
    str | None,
    typer.Option(help=f"Longitudinal slip, positive in braking{_SEVERAL}.", show_default=False),
]


@app.command()
def predict(
    model: Model_,
    speed: Speeds,
    setup: SetupFile = None,
    load: Loads = None,
    pressure: Pressures = None,
    acceleration: Accelerations = "0",
    time: Annotated[float, typer.Option(help="Time since the start [s].")] = 0.0,
    temperature: Annotated[
        float | None, typer.Option(help="Temperature change [K].", show_default=False)
    ] = None,
    slip: Slips = None,
    surface: Annotated[
        str | None,
        typer.Option(
            help="outer or inner; default the setup's strain channel, else outer.",
            show_default=False,
        ),
    ] = None,
    points: Annotated[
        int, typer.Option(min=8, max=100_000, help="Angles over the revolution.")
    ] = 1024,
    modes: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=1023,
            help="Waves round the circumference, the last of them; default all (P3's n_mode).",
            show_default=False,
        ),
    ] = None,
    everything: Annotated[
        bool,
        typer.Option(
            "--all",
            help="Also strain's slope and curvature, a ring's v, and the conditions; always if "
            "several are given.",
        ),
    ] = False,
    road: Annotated[
        str | None,
        typer.Option(
            help="Drive a coupled_ring over it: KIND,KEY=VALUE,... (step, cleat, sine, profile; "
            "keys as in a setup's [road]) or setup.",
            show_default=False,
        ),
    ] = None,
    load_step: Annotated[
        list[str],
        typer.Option(
            metavar="TIME:LOAD", help="The load [N] steps at that time [s]; several times."
        ),
    ] = [],  # noqa: B006
    speed_ramp: Annotated[
        list[str],
        typer.Option(
            metavar="FROM:TO:SPEED",
            help="The speed [m/s] goes to that between two times; several times.",
        ),
    ] = [],  # noqa: B006
    duration: Annotated[
        float | None,
        typer.Option(
            help="Time driven [s]; default half a second past the last event.", show_default=False
        ),
    ] = None,
    step: Annotated[
        float | None,
        typer.Option(
            help="Step of the motion [s]; default the longest good one.", show_default=False
        ),
    ] = None,
    sensor: Annotated[
        list[float],
        typer.Option(help="Sensor's angle on the belt [deg] at the start, 0 under the wheel."),
    ] = [],  # noqa: B006
    effects: EffectsFile = None,
    output: Output = None,
    format: Format = None,
) -> None:
    """One revolution as the model sees it, from half a turn before the patch centre to half a turn
    after.

    Of several speeds, loads, pressures, accelerations or slips each with each. With --road,
    --load-step or --speed-ramp: a coupled ring driven in time, forces at road and spindle and what
    sensors read.
    """
    from tirelog.api.models import load_model, revolution, revolutions
    from tirelog.cli.ranges import conditions_given, refuse_many
    from tirelog.errors import UsageError
    from tirelog.physics.model.from_setup import known_surface
    from tirelog.physics.model.limits import check_model

    read, given = load_model(model, effects=effects), _setup(setup)
    conditions = conditions_given(
        given,
        {"time_s": time, "temperature_K": temperature},
        speed=speed,
        load=load,
        pressure=pressure,
        acceleration=acceleration,
        slip=slip,
    )
    check_model(read)
    refuse_many(len(conditions) * points)
    side = surface or known_surface(given) or "outer"
    if road is None and not load_step and not speed_ramp:
        if everything or modes is not None or len(conditions) > 1:
            rows = revolutions(read, conditions, points=points, surface=side, modes=modes)
            with Session(None).table("predict-all", output, format) as table:
                table.write(rows)
            return
        columns: dict[str, Any] = dict(revolution(read, conditions, points=points, surface=side))
        with Session(None).table("predict", output, format) as table:
            table.write(columns)
        return
    if len(conditions) > 1 or everything or modes is not None:
        raise UsageError(
            "--road, --load-step or --speed-ramp with several conditions, --all or --modes",
            allowed="one drive from one speed and load is allowed",
            do="leave them out",
        )
    folder = setup.parent if setup is not None and road == "setup" else None
    session = Session(None)
    with session.working() as line:
        line.say("driving")
        driven_rows = _passage(
            read, conditions, given, folder, road, load_step, speed_ramp, duration, step, sensor,
            side,
        )  # fmt: skip
    with session.table("passage", output, format) as table:
        table.write(driven_rows)


@app.command()
def forces(
    model: Model_,
    speed: Speeds,
    setup: SetupFile = None,
    load: Loads = None,
    pressure: Pressures = None,
    acceleration: Accelerations = "0",
    slip: Slips = None,
    slip_angle: Annotated[
        float, typer.Option(help="Slip angle [deg] of the brush, for the lateral force.")
    ] = 0.0,
    camber: Annotated[float, typer.Option(help="Camber [deg] of the wheel, likewise.")] = 0.0,
    effects: EffectsFile = None,
    output: Output = None,
    format: Format = None,
) -> None:
    """Forces at hub and road, patch, rolling resistance and losses as the model has them, a row
    per condition.

    Of several speeds, loads, pressures, accelerations or slips each with each. Empty is what this
    model does not have: a beam has no hub, a ring no critical speed.
    """
    from tirelog.api import models
    from tirelog.cli.ranges import conditions_given

    read, given = models.load_model(model, effects=effects), _setup(setup)
    conditions = conditions_given(
        given,
        {"time_s": 0.0},
        speed=speed,
        load=load,
        pressure=pressure,
        acceleration=acceleration,
        slip=slip,
    )
    rows = models.forces(
        read, conditions, slip_angle_deg=slip_angle, camber_deg=camber, setup=given
    )
    with Session(None).table("forces", output, format) as table:
        table.write(rows)


def _passage(
    model: Model,
    conditions: Conditions,
    setup: Setup | None,
    folder: Path | None,
    road: str | None,
    load_step: list[str],
    speed_ramp: list[str],
    duration: float | None,
    step: float | None,
    sensor: list[float],
    surface: str,
) -> dict[str, Any]:
    """The columns of a drive over the road, under the loads and at the speeds of the options."""
    from tirelog.cli.passage import load_steps, road_words, speed_ramps
    from tirelog.physics.moving.course import course_of, passage_columns
    from tirelog.physics.moving.transient import driven

    known_load = conditions.known("load_N")
    course = course_of(
        road_words(road or "flat", setup),
        folder,
        float(conditions.speed_m_s[0]),
        float(conditions.load_N[0]) if known_load else model.values["load_N"],
        load_steps(load_step),
        speed_ramps(speed_ramp),
        duration,
    )
    passage = driven(model, conditions, course, step_s=step)
    for remark in passage.remarks:
        say(f"note: {remark}")
    return passage_columns(passage, sensor or [180.0], surface)


@app.command()
def modes(
    model: Model_,
    speed: Annotated[float, typer.Option(help="Speed [m/s] at which the tire turns.")] = 0.0,
    load: Annotated[
        float | None,
        typer.Option(help="Load [N] on the road; default the model's.", show_default=False),
    ] = None,
    hub_mass: Annotated[
        float | None,
        typer.Option(
            help="Mass m_h [kg] of hub and rim; default the model's, else 20.", show_default=False
        ),
    ] = None,
    hub_inertia: Annotated[
        float | None,
        typer.Option(
            help="Moment of inertia J_h [kg m^2] about the axle; default the model's, else 0.8.",
            show_default=False,
        ),
    ] = None,
    to_frequency: Annotated[float, typer.Option(help="Highest frequency [Hz].")] = 300.0,
    effects: EffectsFile = None,
    output: Output = None,
    format: Format = None,
    plot: Plot = None,
    log: Annotated[
        list[str],
        typer.Option("--log", help="With --plot: a log whose order map is drawn below; twice."),
    ] = [],  # noqa: B006
    setup: SetupFile = None,
    channel: ChannelName = None,
    quiet: Quiet = False,
) -> None:
    """Natural frequencies, damping and shapes of a ring model, in the air and (with contact =
    "flat_road") on the road.

    The ring moves on the sidewall of a hub with the mass given; the model's effects are not in it.
    --plot draws their shapes; with --log the modes over the log's order map, as the turning belt
    feels them.
    """
    from dataclasses import asdict

    from tirelog.api.models import load_model
    from tirelog.errors import UsageError
    from tirelog.physics.moving.modes import modes_of_model
    from tirelog.vocabulary.columns import TABLES

    if log and plot is None:
        raise UsageError("--log without --plot", allowed="its order map is drawn", do="add --plot")
    read = load_model(model, effects=effects)
    hub: dict[str, Any] = {"hub_mass_kg": hub_mass, "hub_inertia_kg_m2": hub_inertia}
    session = Session(setup, quiet)
    with session.working() as line:
        line.say("looking for modes")
        found = modes_of_model(read, speed_m_s=speed, load_N=load, to_Hz=to_frequency, **hub)
    rows = [{"support": support, "speed_m_s": speed, **asdict(mode)} for support, mode in found]
    columns = {name: [row[name] for row in rows] for name in TABLES["modes"]}
    with session, session.table("modes", output, format) as table:
        if plot is not None and log:
            from tirelog.plots.orders import map_of_log, modes_over_orders

            maps = [(each.log, map_of_log(each, channel)) for each in session.recordings(log)]
            modes_over_orders(read, maps, plot, highest_Hz=to_frequency, **hub)
        elif plot is not None:
            from tirelog.plots.modes import modes_picture

            modes_picture(columns, plot)
        table.write(columns)
