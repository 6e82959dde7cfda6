"""`tirelog model predict | forces | modes`: what a model says by itself."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from tirelog.cli import options
from tirelog.cli.session import Session
from tirelog.errors import UsageError
from tirelog.vocabulary.columns import TABLES
from tirelog.vocabulary.observables import SCALARS

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
        int, typer.Option(min=8, max=100_000, help="Angles over the revolution.")
    ] = 1024,
    modes: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=1023,
            help="Waves round the circumference, the last of them; default all (P3's n_mode).",
        ),
    ] = None,
    everything: Annotated[
        bool,
        typer.Option(
            "--all",
            help="Also strain's slope and curvature, a ring's v, and the conditions; always if "
            "several are given. Of a model of one number the waveforms beside it.",
        ),
    ] = False,
    road: Annotated[
        str | None,
        typer.Option(
            help="Drive a coupled_ring over it: KIND,KEY=VALUE,... (step, cleat, sine, profile; "
            "keys as in a setup's [road]) or setup."
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
        typer.Option(help="Time driven [s]; default half a second past the last event."),
    ] = None,
    step: Annotated[
        float | None, typer.Option(help="Step of the motion [s]; default the longest good one.")
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
    """One revolution as the model sees it, from half a turn before the patch centre to half a turn
    after; of a model of one number per revolution that number, a row per condition.

    Several speeds, loads, pressures, accelerations or slips are combined, each with each. With
    --road, --load-step or --speed-ramp: a coupled ring driven in time, forces at road and spindle
    and what sensors read.
    """
    from tirelog.api import models
    from tirelog.cli.options import (
        conditions_given,
        load_steps,
        refuse_many,
        road_words,
        speed_ramps,
    )

    session = Session(setup, quiet, output, format)
    read, given = models.load_model(model, effects=effects), session.setup()
    conditions = conditions_given(
        given, {"time_s": time, "temperature_K": temperature},
        speed=speed, load=load, pressure=pressure, acceleration=acceleration, slip=slip,
    )  # fmt: skip
    refuse_many(len(conditions), points)
    side = surface or models.known_surface(given) or "outer"
    driven = road is not None or bool(load_step) or bool(speed_ramp)
    name = _table(read.observable, len(conditions), everything or modes is not None, driven)
    if driven:
        with session.working() as line:
            line.say("driving")
            rows, remarks = models.passage(
                read,
                conditions,
                road_words(road or "flat", given),
                folder=setup.parent if setup is not None and road == "setup" else None,
                loads=load_steps(load_step),
                ramps=speed_ramps(speed_ramp),
                duration_s=duration,
                step_s=step,
                sensors_deg=sensor,
                surface=side,
            )
        session.notes(remarks)
    elif name == "predict-numbers":
        rows = models.numbers(read, conditions, surface=side)
    else:
        rows = models.revolutions(read, conditions, points=points, surface=side, modes=modes)
    with session.table(name) as table:
        table.write({column: rows[column] for column in TABLES[name] if column in rows})


def _table(observable: str, conditions: int, everything: bool, driven: bool) -> str:
    """The table that a prediction is.  UsageError: a drive of what is none."""
    numbers = observable in SCALARS and not everything
    if not driven:
        along = "predict-all" if everything or conditions > 1 else "predict"
        return "predict-numbers" if numbers else along
    if numbers or everything or conditions > 1:
        raise UsageError(
            "--road, --load-step or --speed-ramp with several conditions, --all or --modes, or a "
            f"model of {observable}",
            allowed="one drive from one speed and load is allowed, of a model of a waveform",
            do="leave them out",
        )
    return "passage"


def forces(
    model: options.Model,
    speed: Speeds,
    setup: options.SetupFile = None,
    load: Loads = None,
    pressure: Pressures = None,
    acceleration: Accelerations = "0",
    slip: Slips = None,
    slip_angle: Annotated[
        float, typer.Option(help="Slip angle [deg] of the brush, for the lateral force.")
    ] = 0.0,
    camber: Annotated[float, typer.Option(help="Camber [deg] of the wheel, likewise.")] = 0.0,
    effects: options.EffectsFile = None,
    output: options.Output = None,
    format: options.Format = None,
    quiet: options.Quiet = False,
) -> None:
    """Forces at hub and road, patch, rolling resistance and losses as the model has them, a row
    per condition.

    Several speeds, loads, pressures, accelerations or slips are combined, each with each. Empty is
    what this model does not have: a beam has no hub, a ring no critical speed.
    """
    from tirelog.api import models
    from tirelog.cli.options import conditions_given

    session = Session(setup, quiet, output, format)
    read, given = models.load_model(model, effects=effects), session.setup()
    conditions = conditions_given(
        given, {"time_s": 0.0},
        speed=speed, load=load, pressure=pressure, acceleration=acceleration, slip=slip,
    )  # fmt: skip
    rows = models.forces(
        read, conditions, slip_angle_deg=slip_angle, camber_deg=camber, setup=given
    )
    with session.table("forces") as table:
        table.write(rows)


def modes(
    model: options.Model,
    speed: Annotated[float, typer.Option(help="Speed [m/s] at which the tire turns.")] = 0.0,
    load: Annotated[
        float | None, typer.Option(help="Load [N] on the road; default the model's.")
    ] = None,
    hub_mass: Annotated[
        float | None,
        typer.Option(help="Mass m_h [kg] of hub and rim; default the model's, else 20."),
    ] = None,
    hub_inertia: Annotated[
        float | None,
        typer.Option(
            help="Moment of inertia J_h [kg m^2] about the axle; default the model's, else 0.8."
        ),
    ] = None,
    to_frequency: Annotated[float, typer.Option(help="Highest frequency [Hz].")] = 300.0,
    effects: options.EffectsFile = None,
    output: options.Output = None,
    format: options.Format = None,
    plot: options.Plot = None,
    log: Annotated[
        list[str],
        typer.Option("--log", help="With --plot: a log whose order map is drawn below; twice."),
    ] = [],  # noqa: B006
    setup: options.SetupFile = None,
    channel: options.ChannelName = None,
    quiet: options.Quiet = False,
) -> None:
    """Natural frequencies, damping and shapes of a ring model, in the air and (with contact =
    "flat_road") on the road.

    The ring moves on the sidewall of a hub with the mass given; the model's effects are not in it.
    --plot draws their shapes; with --log the modes over the log's order map, as the turning belt
    feels them.
    """
    from tirelog.api import models

    if log and plot is None:
        raise UsageError("--log without --plot", allowed="its order map is drawn", do="add --plot")
    read = models.load_model(model, effects=effects)
    hub: dict[str, Any] = {"hub_mass_kg": hub_mass, "hub_inertia_kg_m2": hub_inertia}
    session = Session(setup, quiet, output, format)
    with session.working() as line:
        line.say("looking for modes")
        columns = models.modes(read, speed_m_s=speed, load_N=load, to_Hz=to_frequency, **hub)
    with session, session.table("modes") as table:
        if plot is not None:
            models.draw_modes(
                read,
                columns,
                plot,
                session.recordings(log) if log else (),
                channel=channel,
                highest_Hz=to_frequency,
                **hub,
            )
        table.write(columns)
