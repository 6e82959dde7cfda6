"""`tirelog model ...`, and `tirelog effects`."""

from __future__ import annotations

import shlex
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

import tirelog.api as api
from tirelog.cli import options, pages
from tirelog.cli.session import Session, write_text
from tirelog.errors import UsageError, refuse_unknown


def _assignments(sets: list[str], prefix: str = "") -> dict[str, float | str]:
    """Numbers, and words of an effect's choices, by name."""
    values: dict[str, float | str] = {}
    for text in sets:
        name, word = options.assigned(
            text,
            "--set ",
            "NAME=VALUE with a finite number or a word is allowed, such as --set "
            "line_mass_kg_m=4.5 or --set law=softens",
        )
        values[prefix + name.removeprefix(prefix)] = word
        with suppress(ValueError):
            values[prefix + name.removeprefix(prefix)] = float(word)
    return values


def new(
    output: options.NewModel,
    carcass: Annotated[
        str | None, typer.Option(help="beam (the default), ring or coupled_ring.")
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            help="Numbers of a paper's table: P1, P2 (beams) or P3 (a ring).",
            autocompletion=options.completing(lambda: api.models.PRESETS),
        ),
    ] = None,
    setup: options.SetupFile = None,
    observable: Annotated[
        str | None,
        typer.Option(
            help="What the model predicts, as in the model file; with commas for several that are "
            "fitted together. Default: what the setup's channels measure, else strain."
        ),
    ] = None,
    contact: Annotated[
        str | None,
        typer.Option(help="prescribed or flat_road; default for rings flat_road."),
    ] = None,
    sets: options.Sets = [],  # noqa: B006
    quiet: options.Quiet = False,
) -> None:
    """A new model without effects; tire and conditions are those of the setup."""
    session = Session(setup, quiet)
    model, remarks = api.models.new_model(
        carcass,
        session.setup,
        observable=None if observable is None else [word.strip() for word in observable.split(",")],
        contact=contact,
        values=_assignments(sets),
        preset=preset,
    )
    api.models.save_model(model, output)
    session.note(*remarks)
    named, fitted = (
        shlex.quote(str(path)) for path in (output, output.with_stem(f"{output.stem}_fitted"))
    )
    session.say(
        f"wrote {output}; next: tirelog model fit LOG --model {named} -o {fitted}, or "
        f"tirelog compare LOG --model {named}"
    )


def show(
    model: options.Model,
    against: Annotated[
        Path | None, typer.Option(help="Another model: differences in standard errors.")
    ] = None,
    effects: options.EffectsFile = None,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
) -> None:
    """Parameters and effects of a model; with --against the difference of two models."""
    read = api.models.load_model(model, effects=effects)
    if against is not None:
        rows: dict[str, Any] = api.models.difference_rows(
            read, api.models.load_model(against, effects=effects)
        )
        shown = pages.rows_page(rows)
    else:
        rows, shown = api.models.parameter_rows(read), pages.model_page(read)
    Session(None, quiet, output, format).show("model", shown, rows)


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
    """Add an effect, at its start values or those of --set.

    A setup that gives a grating's length fixes that of `gauge_length`.
    """
    read, given = api.models.load_model(model, effects=effects), Session(setup, quiet).setup
    values = _assignments(sets, f"{effect}.")
    api.models.save_model(
        api.models.added(read, effect, values, setup=given, effects=effects), new_model
    )


def remove(
    model: options.Model,
    effect: Annotated[str, typer.Argument(help="Effect of the model.")],
    new_model: options.EditedModel,
    effects: options.EffectsFile = None,
    quiet: options.Quiet = False,
) -> None:
    """Remove an effect."""
    api.models.save_model(
        api.models.load_model(model, effects=effects).without_effect(effect), new_model
    )


def change(
    model: options.Model,
    changes: Annotated[
        list[str],
        typer.Argument(
            help="NAME=NUMBER (a value), NAME=fixed, NAME=free, NAME=MIN:MAX (free within bounds), "
            "or NAME=WORD: a choice of an effect, or on, off or auto of a disturbance (wheel, "
            "drift, rolling, patch_law, pressure_law, form).",
        ),
    ],
    new_model: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="Model file to write; default MODEL itself.",
            callback=options.in_a_folder,
        ),
    ] = None,
    effects: options.EffectsFile = None,
    quiet: options.Quiet = False,
) -> None:
    """Change values, bounds and choices of a model file, in its place or with -o."""
    read = api.models.load_model(model, effects=effects)
    allowed = "allowed are NAME=NUMBER, NAME=fixed, NAME=free, NAME=MIN:MAX, NAME=WORD"
    names = f"names: `{shlex.join(['tirelog', 'model', 'show', str(model)])}`"
    pairs = [options.assigned(text, "", allowed, names) for text in changes]
    api.models.save_model(api.models.changed(read, pairs), new_model or model)


def worn(
    model: options.Model,
    output: options.NewModel,
    new_depth: Annotated[float, typer.Option(help="Tread depth of this model [m].")],
    depth: Annotated[float, typer.Option(help="Tread depth of the worn tire [m].")],
    neutral_axis: Annotated[
        float,
        typer.Option(
            help="Shift of the neutral axis per metre of lost depth: 0.5 for one material, 0 for "
            "a stiff belt."
        ),
    ] = 0.5,
    effects: options.EffectsFile = None,
    quiet: options.Quiet = False,
) -> None:
    """The model of a worn tire: a stiffer tread and a shorter lever arm.

    Stiffness of a rubber block, one over depth: an assumption; P3 gives no equation.
    """
    read = api.models.load_model(model, effects=effects)
    made, changed = api.models.worn_model(read, new_depth, depth, neutral_axis)
    api.models.save_model(made, output)
    Session(quiet=quiet).note(
        *(f"{name} {before:g} -> {after:g}" for name, (before, after) in changed.items())
    )


def pressure(
    model: options.Model,
    picture: Annotated[Path, typer.Argument(metavar="PICTURE")],
    output: options.NewModel,
    pitch: Annotated[float, typer.Option(help="Way between two lines of the picture [m].")],
    load: Annotated[float, typer.Option(help="Load on the tire under which it was taken [N].")],
    effects: options.EffectsFile = None,
    quiet: options.Quiet = False,
) -> None:
    """The model with a footprint's measured pressure in place of the parabola.

    PICTURE is text: a line for each place along the tread, entry first, its numbers across the
    tread with commas between them, in any unit of pressure.
    """
    read = api.models.load_model(model, effects=effects)
    made = api.models.with_picture(read, picture, pitch, load)
    api.models.save_model(made, output)
    half = made.values["patch_half_length_m"]
    Session(quiet=quiet).note(f"patch_half_length_m = {half:g} at {load:g} N")


def fit(
    logs: options.Logs,
    model: options.ModelFile,
    new_model: options.EditedModel,
    setup: options.SetupFile = None,
    channel: options.ChannelName = None,
    effects: options.EffectsFile = None,
    quiet: options.Quiet = False,
) -> None:
    """Fit a model's free parameters to the logs, as `compare` does; values with standard errors.

    Masses, damping and bristles of a coupled ring are fitted to the obstacles of logs whose setup
    has a [road].
    """
    api.models.refuse_another(new_model)
    start = api.models.load_model(model, effects=effects)
    with Session(setup, quiet) as session:
        measured = api.answers.measure(session.recordings(logs), start, channel)
        with session.working_on("fitting the model"):
            result = api.answers.fit(measured, start)
        session.note(*result.remarks)
        session.refuse_edit(model, new_model)
        api.models.save_model(result.model, new_model)
        if not quiet:
            pages.print_answer(pages.fit_page(result))


# ---- Predictions of a model alone.


#: one value, several with commas, or FROM:TO:STEP
_SEVERAL = "; several with commas, or FROM:TO:STEP"
Speeds = Annotated[str, typer.Option(help=f"Speed [m/s]{_SEVERAL}.")]
Loads = Annotated[
    str | None, typer.Option(help=f"Load [N]{_SEVERAL}; default the setup's, else the model's.")
]
Pressures = Annotated[str | None, typer.Option(help=f"Inflation pressure [Pa]{_SEVERAL}.")]
Accelerations = Annotated[str, typer.Option(help=f"Longitudinal acceleration [m/s^2]{_SEVERAL}.")]
Slips = Annotated[
    str | None, typer.Option(help=f"Longitudinal slip, positive in braking{_SEVERAL}.")
]


def predict(
    model: options.Model,
    speed: Speeds,
    setup: options.SetupFile = None,
    load: Loads = None,
    pressure: Pressures = None,
    acceleration: Accelerations = "0",
    time: Annotated[float, typer.Option(help="Time since the start [s].")] = 0.0,
    temperature: Annotated[float | None, typer.Option(help="Temperature change [K].")] = None,
    slip: Slips = None,
    surface: Annotated[
        str | None,
        typer.Option(help="outer or inner; default the setup's strain channel, else outer."),
    ] = None,
    points: Annotated[
        int | None,
        typer.Option(min=8, max=100_000, help="Angles; default 1024, 4096 of one with --all."),
    ] = None,
    modes: Annotated[
        int | None,
        typer.Option(min=1, max=1023, help="Last wave round the circumference; default all."),
    ] = None,
    everything: Annotated[
        bool,
        typer.Option(
            "--all",
            help="Also slope and curvature of the strain, tangential displacement, conditions; a "
            "model of one number also gives waveforms. Always for several conditions.",
        ),
    ] = False,
    road: Annotated[
        str | None,
        typer.Option(
            help="Road under a coupled_ring: KIND,KEY=VALUE,... (step, cleat, sine, profile; keys "
            "as in a setup's [road]), or setup for the setup's own."
        ),
    ] = None,
    load_step: Annotated[
        list[str],
        typer.Option(
            metavar="TIME:LOAD", help="The load [N] from that time [s] on; repeat for several."
        ),
    ] = [],  # noqa: B006
    duration: Annotated[
        float | None,
        typer.Option(help="Duration [s]; default half a second past the last event."),
    ] = None,
    sensor: Annotated[
        list[float],
        typer.Option(help="Sensor's angle on the belt [deg] at the start, 0 under the wheel."),
    ] = [],  # noqa: B006
    effects: options.EffectsFile = None,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
) -> None:
    """Prediction of a model over one revolution, or its number per revolution.

    A revolution goes from half a turn before the patch centre to half a turn after. Several speeds,
    loads, pressures, accelerations or slips are combined, each with each. With --road or
    --load-step a coupled ring is driven in time: forces and sensor signals.
    """
    session = Session(setup, quiet, output, format)
    read, given = api.models.load_model(model, effects=effects), session.setup
    conditions = options.conditions_given(
        given, {"time_s": time, "temperature_K": temperature},
        speed=speed, load=load, pressure=pressure, acceleration=acceleration, slip=slip,
    )  # fmt: skip
    # what jumps at the slip onset is a millimetre off on 1024
    points = points or (4096 if everything and len(conditions) == 1 else 1024)
    options.refuse_many(len(conditions), points)
    session.note(*options.doubts(conditions, speed, acceleration))
    side = surface or api.models.known_surface(given) or "outer"
    number = read.observable in api.models.SCALARS
    whole = everything or modes is not None or len(conditions) > 1
    if road is not None or load_step:
        if number or whole:
            raise UsageError(
                "--road or --load-step with several conditions, --all or --modes, or a model of "
                f"{read.observable}",
                allowed="one drive from one speed and load is allowed, of a model of a waveform",
                do="leave them out",
            )
        with session.working_on("driving"):
            rows, remarks = api.models.passage(
                read,
                conditions,
                options.road_words(road or "flat", given),
                folder=setup.parent if setup is not None and road == "setup" else None,
                loads=options.load_steps(load_step),
                duration_s=duration,
                sensors_deg=sensor,
                surface=side,
            )
        session.note(*remarks)
        name = "passage"
    elif number and not (everything or modes is not None):
        name, rows = "predict-numbers", api.models.numbers(read, conditions, surface=side)
    else:
        name = "predict-all" if whole else "predict"
        rows = api.models.revolutions(read, conditions, points=points, surface=side, modes=modes)
    session.write(name, [api.models.table_columns(name, rows)])


def forces(
    model: options.Model,
    speed: Annotated[
        str | None,
        typer.Option(help=f"Speed [m/s]{_SEVERAL}; a TYDEX file of --against may have its own."),
    ] = None,
    setup: options.SetupFile = None,
    load: Loads = None,
    pressure: Pressures = None,
    acceleration: Accelerations = "0",
    slip: Slips = None,
    slip_angle: Annotated[
        float, typer.Option(help="Slip angle [deg] of the brush, for the lateral force.")
    ] = 0.0,
    camber: Annotated[
        float, typer.Option(help="Camber [deg] of the wheel, for the lateral force.")
    ] = 0.0,
    effects: options.EffectsFile = None,
    against: Annotated[
        Path | None,
        typer.Option(
            help="TYDEX file of a test rig, or Magic Formula (.tir): its forces beside the model's."
        ),
    ] = None,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
) -> None:
    """Forces at hub and road, rolling resistance and losses of a model; a row per condition.

    Several speeds, loads, pressures, accelerations or slips are combined, each with each. A column
    that the model does not have is empty: a beam has no hub, a ring no critical speed. -o FILE.tdx
    writes a TYDEX file, -o FILE.tir a Magic Formula of the model's brush.
    """
    suffix = "" if output is None or format else output.suffix.lower()
    exported = suffix in api.models.SUFFIXES
    session = Session(setup, quiet, None if exported else output, format)
    read, given = api.models.load_model(model, effects=effects), session.setup
    conditions = None
    if speed is not None:
        conditions = options.conditions_given(
            given, {"time_s": 0.0},
            speed=speed, load=load, pressure=pressure, acceleration=acceleration, slip=slip,
        )  # fmt: skip
        session.note(*options.doubts(conditions, speed, acceleration))
    rows, remarks = api.models.forces_against(
        read,
        None if against is None else api.models.read_forces(against),
        conditions,
        slip_angle_deg=slip_angle,
        camber_deg=camber,
        setup=given,
    )
    session.note(*remarks)
    if exported:
        text, remarks = api.models.force_file(read, rows, suffix)
        session.note(*remarks)
        write_text(text, output)
    else:
        session.write("forces", [rows])


def plan(
    model: options.Model,
    speed: Speeds = "5,10,20",
    load: Loads = None,
    acceleration: Accelerations = "0",
    setup: options.SetupFile = None,
    effects: options.EffectsFile = None,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
) -> None:
    """Which test determines which free parameter: static, modal, cleat, and driving with a sensor.

    Standard errors after each stage, from the model's own slopes. The options are those of driving.
    """
    session = Session(setup, quiet, output, format)
    conditions = options.conditions_given(
        session.setup, {"time_s": 0.0}, speed=speed, load=load, acceleration=acceleration
    )
    session.note(*options.doubts(conditions, speed, acceleration))
    with session.working_on("planning tests"):
        read = api.models.load_model(model, effects=effects)
        rows, remarks = api.models.plan(read, conditions)
    session.show("plan", "\n".join((pages.rows_page(rows), *remarks)), rows)
    if not session.paged:
        session.note(*remarks)


def warm(
    model: options.Model,
    log: Annotated[
        str | None,
        typer.Option(help="Log whose speeds are driven; with a temperature channel a fit."),
    ] = None,
    speed: Annotated[float, typer.Option(help="Speed [m/s] without a log.")] = 20.0,
    duration: Annotated[
        float, typer.Option(min=1.0, max=1e6, help="Duration [s] without a log.")
    ] = 3600.0,
    load: Annotated[float | None, typer.Option(help="Load [N]; default the model's.")] = None,
    heat_capacity: Annotated[
        float | None,
        typer.Option(min=1.0, max=1e9, help="Heat capacity [J/K]; default: fitted to the log."),
    ] = None,
    cooling: Annotated[
        float | None,
        typer.Option(min=1e-3, max=1e6, help="Cooling [W/K]; default: fitted to the log."),
    ] = None,
    ambient: Annotated[
        float, typer.Option(min=150.0, max=400.0, help="Temperature around the tire [K].")
    ] = 293.0,
    setup: options.SetupFile = None,
    effects: options.EffectsFile = None,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
) -> None:
    """Temperature, pressure and losses of a tire that warms up by what its model dissipates.

    One temperature for tire and air. Effects that follow temperature or pressure change the losses.
    """
    session = Session(setup, quiet, output, format)
    read = api.models.load_model(model, effects=effects)
    if log is None:
        drive = api.models.steady_drive(session.setup, duration, speed, load)
    else:
        (drive,) = map(api.models.driven_conditions, session.recordings([log]))
    rows, remarks = api.models.warm(
        read, drive, ambient_K=ambient, heat_capacity=heat_capacity, cooling=cooling
    )
    session.note(*remarks)
    session.write("warm", [rows])


def modes(
    model: options.Model,
    speed: Annotated[float, typer.Option(help="Speed [m/s] at which the tire turns.")] = 0.0,
    load: Annotated[
        float | None, typer.Option(help="Load [N] on the road; default the model's.")
    ] = None,
    hub_mass: Annotated[
        float | None,
        typer.Option(help="Mass [kg] of hub and rim; default the model's, else 20."),
    ] = None,
    hub_inertia: Annotated[
        float | None,
        typer.Option(
            help="Moment of inertia [kg m^2] about the axle; default the model's, else 0.8."
        ),
    ] = None,
    to_frequency: Annotated[float, typer.Option(help="Highest frequency [Hz].")] = 300.0,
    effects: options.EffectsFile = None,
    output: options.Output = None,
    format: options.Format = None,
    plot: options.Plot = None,
    quiet: options.Quiet = False,
) -> None:
    """Natural frequencies, damping and shapes of a ring model, in the air and on a flat road.

    The ring moves on the sidewall of a hub with the given mass, without the model's effects. --plot
    draws the shapes.
    """
    session = Session(None, quiet, output, format)
    with session.working_on("looking for modes"):
        columns = api.models.modes(
            api.models.load_model(model, effects=effects),
            speed_m_s=speed,
            load_N=load,
            to_Hz=to_frequency,
            hub_mass_kg=hub_mass,
            hub_inertia_kg_m2=hub_inertia,
        )
    if plot is not None:
        api.models.draw_modes(columns, plot)
    session.write("modes", [columns])


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
    """Catalogue of effects: mechanism, parameters, source; --plot draws their strain."""
    session = Session(None, quiet, output, format)
    catalogue = api.models.catalogue_with(own)
    if name is not None:
        refuse_unknown(name, catalogue, f"unknown effect {name!r}", do="list: `tirelog effects`")
    chosen = list(catalogue.values()) if name is None else [catalogue[name]]
    if plot is not None:
        api.models.draw_effects(chosen, plot)
    page = pages.catalogue_page(chosen) if name is None else pages.effect_page(chosen[0])
    session.show("effects", page, pages.catalogue_rows(chosen))
