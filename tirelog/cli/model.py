"""`tirelog model new | show | add | remove | fit | predict | modes`."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from tirelog.cli.common import Format, Logs, ModelFile, Output, Quiet, Session, SetupFile, say
from tirelog.vocabulary.kinds import STRAIN_KINDS
from tirelog.vocabulary.observables import WAVEFORMS, waveform_of

if TYPE_CHECKING:
    from tirelog.data.setup import Setup
    from tirelog.inference.measured import MeasuredLogs
    from tirelog.physics.model.model import Model

app = typer.Typer(help="Make, change, fit and evaluate model files.", no_args_is_help=True)

Model_ = Annotated[Path, typer.Argument(metavar="MODEL", help="Model file.", show_default=False)]
Target = Annotated[
    Path, typer.Option("-o", "--output", help="Model file to write.", show_default=False)
]
EffectsFile = Annotated[
    Path | None,
    typer.Option(
        "--effects", help="Python file with effects of your own; it is run.", show_default=False
    ),
]
Sets = Annotated[
    list[str],
    typer.Option("--set", metavar="NAME=VALUE", help="A parameter's value; several times."),
]


def _load(path: Path, effects: Path | None) -> Model:
    from tirelog.physics.model.file import load_model
    from tirelog.physics.model.user_effects import catalogue_with

    return load_model(path, catalogue=catalogue_with(effects))


def _setup(path: Path | None) -> Setup | None:
    from tirelog.data.setup import load_setup

    return None if path is None else load_setup(path)


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
                f"--set {text}; NAME=VALUE with a finite number is allowed, such as --set "
                "line_mass_kg_m=4.5; correct it"
            )
        values[prefix + name.strip().removeprefix(prefix)] = value
    return values


@app.command()
def new(
    output: Target,
    carcass: Annotated[str, typer.Option(help="beam, ring or coupled_ring.")] = "beam",
    setup: SetupFile = None,
    observable: Annotated[
        str | None,
        typer.Option(
            help="What the model predicts, as in the model file; default what the setup's "
            "channels measure, else strain."
        ),
    ] = None,
    contact: Annotated[
        str | None,
        typer.Option(help="prescribed or flat_road; rings stand on a flat road by default."),
    ] = None,
    sets: Sets = [],  # noqa: B006
    quiet: Quiet = False,
) -> None:
    """Make a model without effects; tire and conditions come from the setup where it has them."""
    from tirelog.physics.model.model import Model

    known = _setup(setup)
    model = Model.new(carcass, observable or _measured(known), contact)
    given = {**_from_setup(model, known), **_assignments(sets)}
    check_pressure(given.get("inflation_pressure_Pa"))
    model = model.with_values(given)
    from tirelog.physics.model.file import save_model

    save_model(model, output)
    if not quiet:
        for remark in _invented(model, given):
            say(f"note: {remark}")
        fitted = output.with_stem(f"{output.stem}_fitted")
        say(
            f"wrote {output}; next: tirelog model fit LOG --model {output} -o {fitted}, or "
            f"tirelog compare LOG --model {output}"
        )


#: A tire at less than this [Pa] stands on its rim, and bar, psi and kPa taken for Pa all lie below
#: it: a fifth of it would let 1000 (kPa) pass, twice as much is 0.1 bar, which sand and snow are
#: driven at.
LEAST_PRESSURE_PA = 5e3
#: Speeds [m/s] and accelerations [m/s^2] that a tire is driven at; beyond them a number is in
#: another unit.
FASTEST_M_S, HARDEST_M_S2 = 200.0, 100.0


def check_pressure(pressure_Pa: float | None) -> None:
    """ModelError for an inflation pressure that is none in Pa; nothing at all (0) is allowed."""
    from tirelog.errors import ModelError

    if pressure_Pa is not None and not (pressure_Pa == 0.0 or pressure_Pa >= LEAST_PRESSURE_PA):
        raise ModelError(
            f"inflation_pressure_Pa = {pressure_Pa:g} is no tire's pressure in Pa; "
            f"0, or {LEAST_PRESSURE_PA:g} and more, is allowed; write it in Pa (2.2 bar is 2.2e5)"
        )


def _measured(setup: Setup | None) -> str:
    """The waveform that a setup's channels measure: radial acceleration if no channel is strain."""
    kinds = {channel.kind for channel in setup.channels.values()} if setup is not None else set()
    return waveform_of(kinds)


def _invented(model: Model, given: dict[str, float]) -> list[str]:
    """What neither the setup nor --set gives, though it is this tire's or this drive's own."""
    own = ("load_N", "radius_m", "inflation_pressure_Pa", "width_m")
    guessed = [
        f"{name} = {model.values[name]:g}"
        for name in own
        if name in model.parameters and name not in given
    ]
    if not guessed:
        return []
    return [
        f"neither the setup nor --set gives {', '.join(guessed)}: a guess, not this tire's; "
        "give it in the setup's [tire] or [conditions], or with --set NAME=VALUE"
    ]


def _from_setup(model: Model, setup: Setup | None) -> dict[str, float]:
    """What a setup knows of a model's numbers."""
    if setup is None:
        return {}
    tire, conditions = setup.tire, setup.conditions
    radius = tire.rolling_radius_m or tire.unloaded_radius_m
    known = {
        "radius_m": radius,
        "width_m": tire.width_m,
        "load_N": conditions.load_N,
        "reference_load_N": conditions.load_N,
        "inflation_pressure_Pa": conditions.inflation_pressure_Pa,
        "patch_half_length_m": None
        if tire.static_footprint_length_m is None
        else tire.static_footprint_length_m / 2.0,
    }
    return {
        name: value
        for name, value in known.items()
        if value is not None and name in model.parameters
    }


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
    from tirelog.cli.history import history_page, history_rows
    from tirelog.cli.model_page import difference_page, difference_rows, model_page, parameter_rows

    read = _load(model, effects)
    if history:
        rows: dict[str, Any] = history_rows(model)
    else:
        rows = (
            parameter_rows(read)
            if against is None
            else difference_rows(read, _load(against, effects))
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
    effect: Annotated[str, typer.Argument(help="Effect of the catalogue, or of --effects.")],
    output: Target,
    sets: Sets = [],  # noqa: B006
    setup: SetupFile = None,
    effects: EffectsFile = None,
) -> None:
    """Add an effect at its start values (or --set ones); a grating's length is fixed where the
    setup gives it.
    """
    from tirelog.errors import ModelError, nearest
    from tirelog.physics.model.entry import ModelEffect
    from tirelog.physics.model.user_effects import catalogue_with

    catalogue = catalogue_with(effects)
    if effect not in catalogue:
        raise ModelError(
            f"unknown effect {effect!r}{nearest(effect, catalogue)}; "
            f"allowed are {', '.join(catalogue)}; see `tirelog effects`"
        )
    changed = (
        _load(model, effects)
        .with_effect(ModelEffect.of(catalogue[effect]))
        .with_values(_assignments(sets, f"{effect}."))
    )
    given = _setup(setup)
    if effect == "gauge_length" and given is not None:
        changed = _gauge_from_setup(changed, given)
    from tirelog.physics.model.file import save_model

    save_model(changed, output)


def _gauge_from_setup(model: Model, setup: Setup) -> Model:
    """The grating's length held at what the setup says, where its strain channels agree on one."""
    lengths = {c.gauge_length_m for c in setup.channels.values() if c.kind in STRAIN_KINDS}
    length = lengths.pop() if len(lengths) == 1 else None
    if length is None:
        return model
    name = "gauge_length.length_m"
    return model.with_parameters({name: model.parameters[name].at(length).fixed()})


@app.command()
def remove(
    model: Model_,
    effect: Annotated[str, typer.Argument(help="Effect of the model.")],
    output: Target,
    effects: EffectsFile = None,
) -> None:
    """Remove an effect."""
    from tirelog.physics.model.file import save_model

    save_model(_load(model, effects).without_effect(effect), output)


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
    from tirelog.cli.model_page import fit_page, learned_page
    from tirelog.cli.targets import refuse_unwritable
    from tirelog.diagnosis.fitted import fit_channels_measured
    from tirelog.diagnosis.obstacles.learn import learn
    from tirelog.inference.motion import motion_names

    refuse_unwritable(output)
    start = _load(model, effects)
    words = (
        [w for w in nuisances.replace(",", " ").split() if w != "none"]
        if start.observable in WAVEFORMS
        else ["shift"]
    )
    with Session(setup, quiet) as session:
        channels = _channels(session, logs, start, channel)
        result, remarks = fit_channels_measured([found.stacks for found in channels], start, words)
        obstacles = [obstacle for found in channels for obstacle in found.obstacles]
        for remark in remarks:
            session.note(remark)
        fitted = result.model.with_parameters(
            {name: start.parameters[name] for name in motion_names(start)}
        )
        learned = learn(obstacles, fitted) if obstacles and motion_names(start) else None
        from tirelog.physics.model.file import save_model

        save_model(fitted if learned is None else learned.model, output)
        if not quiet:
            typer.echo(fit_page(result))
            if learned is not None:
                typer.echo(learned_page(learned))
            elif motion_names(start):
                say(
                    f"note: {', '.join(motion_names(start))}: told by obstacles alone; "
                    "no log has a [road] in its setup: kept"
                )


def _channels(
    session: Session, logs: list[str], start: Model, channel: list[str]
) -> list[MeasuredLogs]:
    """The measured revolutions of each channel; one channel's logs are read one after the other."""
    from tirelog.inference.measured import measured

    names = list(dict.fromkeys(channel))
    if len(names) < 2:
        name = names[0] if names else None
        return [measured(session.recordings(logs), start.observable, name)]
    recordings = session.all_recordings(logs)
    return [measured(recordings, _observable(recordings, name, start), name) for name in names]


def _observable(recordings: list[Any], name: str, model: Model) -> str:
    """What a named channel measures (strain and radial acceleration fit one tire together), else
    what the model predicts.
    """
    kinds = {
        recording.channels[name].kind for recording in recordings if name in recording.channels
    }
    return waveform_of(kinds) if model.observable in WAVEFORMS and kinds else model.observable


def _drivable(
    speed: float, acceleration: float, time: float, temperature: float | None, slip: float | None
) -> None:
    """UsageError for conditions that no tire is driven under."""
    from tirelog.errors import UsageError

    for option, value, low, high, unit in (
        ("speed", speed, 0.0, FASTEST_M_S, "m/s"),
        ("acceleration", acceleration, -HARDEST_M_S2, HARDEST_M_S2, "m/s^2"),
        ("time", time, 0.0, 1e7, "s"),
        ("temperature", temperature, -300.0, 300.0, "K of change"),
        ("slip", slip, -1.0, 1.0, "(positive in braking)"),
    ):
        if value is not None and not low <= value <= high:
            raise UsageError(
                f"--{option} {value:g}; {low:g} to {high:g} {unit} is allowed; correct it"
            )


@app.command()
def predict(
    model: Model_,
    speed: Annotated[float, typer.Option(help="Speed [m/s].")],
    setup: SetupFile = None,
    acceleration: Annotated[float, typer.Option(help="Longitudinal acceleration [m/s^2].")] = 0.0,
    time: Annotated[float, typer.Option(help="Time since the start [s].")] = 0.0,
    temperature: Annotated[
        float | None, typer.Option(help="Temperature change [K].", show_default=False)
    ] = None,
    slip: Annotated[
        float | None,
        typer.Option(help="Longitudinal slip, positive in braking.", show_default=False),
    ] = None,
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

    With --road, --load-step or --speed-ramp: a coupled ring driven in time, forces at road and
    spindle and what sensors read.
    """
    import numpy as np

    from tirelog.data.recording import Conditions
    from tirelog.errors import UsageError
    from tirelog.vocabulary.conditions import SETUP_KEYS

    if speed < 0 or not np.isfinite(speed):
        raise UsageError(
            f"--speed {speed:g}; allowed is a speed of 0 m/s or more, forwards; give that"
        )
    read, given = _load(model, effects), _setup(setup)
    _drivable(speed, acceleration, time, temperature, slip)
    check_pressure(read.values.get("inflation_pressure_Pa"))
    known: dict[str, Any] = {
        "speed_m_s": speed,
        "acceleration_m_s2": acceleration,
        "time_s": time,
        "temperature_K": temperature,
        "slip": slip,
    }
    if given is not None:
        known |= {name: getattr(given.conditions, name) for name in SETUP_KEYS}
        check_pressure(given.conditions.inflation_pressure_Pa)
        strain = [
            c.surface for c in given.channels.values() if c.kind in STRAIN_KINDS and c.surface
        ]
        surface = surface or (strain[0] if strain else None)
    conditions = Conditions.of(
        1, **{name: value for name, value in known.items() if value is not None}
    )
    if road is not None or load_step or speed_ramp:
        from tirelog.cli.passage import course_of, road_words, rows
        from tirelog.physics.moving.transient import drive

        weight = conditions.load_N[0] if conditions.known("load_N") else read.values["load_N"]
        words = road_words(road or "flat", given)
        folder = setup.parent if setup is not None and road == "setup" else None
        course = course_of(words, folder, speed, float(weight), load_step, speed_ramp, duration)
        passage = drive(read, conditions, course, step_s=step)
        for remark in passage.remarks:
            say(f"note: {remark}")
        with Session(None).table("passage", output, format) as table:
            table.write(rows(passage, sensor or [180.0], surface or "outer"))
        return
    phi = np.linspace(-np.pi, np.pi, points, endpoint=False) + np.pi / points
    columns: dict[str, Any] = {
        "xi_m": phi * read.parameters["radius_m"].value,
        "phi_deg": np.degrees(phi),
    }
    wanted = {
        "displacement_m": "displacement",
        "strain": "strain",
        "radial_acceleration_m_s2": "radial_acceleration",
    }
    wanted |= {"contact_pressure_N_m": "contact_pressure", "shear_traction_N_m": "shear_traction"}
    for column, observable in wanted.items():
        columns[column] = read.predict(
            conditions, phi, surface=surface or "outer", observable=observable
        )[0]
    with Session(None).table("predict", output, format) as table:
        table.write(columns)


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
) -> None:
    """Natural frequencies, damping and shapes of a ring model, in the air and (with contact =
    "flat_road") on the road.

    The ring moves on the sidewall of a hub with the mass given; the model's effects are not in it.
    """
    from dataclasses import asdict

    from tirelog.errors import ModelError
    from tirelog.physics.carcass.numbers import steady_carcass
    from tirelog.physics.moving.modes import natural_modes, of_model
    from tirelog.vocabulary.columns import TABLES

    read = _load(model, effects)
    if steady_carcass(read.carcass) != "ring":
        raise ModelError(
            f'a {read.carcass} has no natural modes here; carcass = "ring" or "coupled_ring" is '
            "allowed; make one with --carcass ring",
            file=model,
        )
    tire = of_model(read.values, hub_mass_kg=hub_mass, hub_inertia_kg_m2=hub_inertia)
    supports: dict[str, float | None] = {"air": None}
    if read.contact == "flat_road":
        supports["road"] = read.values["load_N"] if load is None else load
    elif load is not None:
        raise ModelError(
            '--load needs a tread to stand on; contact = "flat_road" is allowed; '
            "leave it out, or make such a model",
            file=model,
        )
    found = [
        {"support": support, "speed_m_s": speed, **asdict(mode)}
        for support, stands in supports.items()
        for mode in natural_modes(tire, speed_m_s=speed, load_N=stands, to_Hz=to_frequency)
    ]
    with Session(None).table("modes", output, format) as table:
        table.write({name: [row[name] for row in found] for name in TABLES["modes"]})
