"""Models from what a setup knows of the tire and the drive, and from the papers' tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.data.setup import Setup
from tirelog.errors import ModelError, UsageError, refuse_unknown
from tirelog.physics.model.file import load_model
from tirelog.physics.model.model import Model
from tirelog.vocabulary.conditions import SETUP_KEYS
from tirelog.vocabulary.kinds import STRAIN_KINDS
from tirelog.vocabulary.observables import ACCELERATION, waveform_of

#: Models with the numbers of the papers' tables, in files below `presets`; each names its table and
#: what was corrected.
PRESETS = ("P1", "P2", "P3")
#: numbers that are this tire's or this drive's own, so that a start value is a guess
_OWN = ("load_N", "radius_m", "inflation_pressure_Pa", "width_m")


def new_model(
    carcass: str | None,
    setup: Setup | None = None,
    *,
    observable: str | Sequence[str] | None = None,
    contact: str | None = None,
    values: Mapping[str, float | str] | None = None,
    preset: str | None = None,
) -> tuple[Model, list[str]]:
    """(A model without effects, remarks on guessed values).

    `values` go before what the setup knows, this before a preset's numbers, these before start
    values.

    carcass     None: the preset's, else a beam
    observable  what the model predicts, one or several; None: the preset's, else what the setup's
                channels measure, else strain
    ModelError  no such carcass, observable, contact or parameter, or a pressure that is none in Pa
    UsageError  no such preset, or one of another carcass
    """
    if preset is None:
        model = Model.new(carcass or "beam", observable or measured_waveform(setup), contact)
        printed: dict[str, float] = {}
    else:
        model = preset_model(preset, observable=observable, contact=contact)
        printed = model.values
        if carcass not in (None, model.carcass):
            raise UsageError(
                f"the preset {preset} is a {model.carcass}, and --carcass says {carcass}",
                allowed="one of the two is allowed",
                do="leave --carcass out, or --preset",
            )
    given = {**known_numbers(model, setup), **(values or {})}
    model = model.with_values(given)
    check_pressure(model.values.get("inflation_pressure_Pa"))
    guessed = [
        f"{name} = {model.values[name]:g}"
        for name in _OWN
        if name in model.parameters and name not in {**printed, **given}
    ]
    notes = []
    if guessed:
        notes.append(
            f"neither the setup nor --set gives {', '.join(guessed)}: a guess, not this tire's; "
            f"give it in the setup's [tire] or [conditions], or with --set NAME=VALUE"
        )
    if model.carcass == "beam" and ACCELERATION in model.observables:
        notes.append(
            "a beam does not lie flat in the patch, where an accelerometer reads nothing; "
            "a ring does: --carcass ring"
        )
    return model, notes


def preset_model(
    name: str, *, observable: str | Sequence[str] | None = None, contact: str | None = None
) -> Model:
    """The model that a paper's table describes, without effects.

    With another observable or contact than the paper's, the numbers that such a model has.

    UsageError: no such preset.
    """
    refuse_unknown(name, PRESETS, f"unknown preset {name!r}", do="choose one of them")
    printed = load_model(Path(__file__).parent / "presets" / f"{name}.toml")
    if observable in (None, printed.observable) and contact in (None, printed.contact):
        return printed
    other = Model.new(printed.carcass, observable or printed.observable, contact or printed.contact)
    return other.with_values({k: v for k, v in printed.values.items() if k in other.parameters})


def measured_waveform(setup: Setup | None) -> str:
    """The waveform that a setup's channels measure: radial acceleration if no channel is strain."""
    kinds = {channel.kind for channel in setup.channels.values()} if setup is not None else set()
    return waveform_of(kinds)


def known_numbers(model: Model, setup: Setup | None) -> dict[str, float]:
    """What a setup knows of a model's numbers."""
    if setup is None:
        return {}
    tire, conditions = setup.tire, setup.conditions
    static = tire.static_footprint_length_m
    known = {
        "radius_m": tire.rolling_radius_m or tire.unloaded_radius_m,
        "width_m": tire.width_m,
        "load_N": conditions.load_N,
        "reference_load_N": conditions.load_N,
        "inflation_pressure_Pa": conditions.inflation_pressure_Pa,
        "reference_pressure_Pa": conditions.inflation_pressure_Pa,
        "patch_half_length_m": None if static is None else static / 2.0,
    }
    return {
        name: value
        for name, value in known.items()
        if value is not None and name in model.parameters
    }


def with_gauge_length(model: Model, setup: Setup | None) -> Model:
    """The model with gauge_length held at the length of the setup's gratings.

    Only if it has this effect and the gratings agree on one length.
    """
    name = "gauge_length.length_m"
    if setup is None or name not in model.parameters:
        return model
    lengths = {c.gauge_length_m for c in setup.channels.values() if c.kind in STRAIN_KINDS}
    length = lengths.pop() if len(lengths) == 1 else None
    if length is None:
        return model
    return model.with_parameters({name: model.parameters[name].at(length).fixed()})


def known_conditions(setup: Setup | None) -> dict[str, float]:
    """What a setup says of the conditions of a whole log, by the field of `Conditions`."""
    if setup is None:
        return {}
    known = {name: getattr(setup.conditions, name) for name in SETUP_KEYS}
    return {name: value for name, value in known.items() if value is not None}


def known_surface(setup: Setup | None) -> str | None:
    """The surface that a setup's first strain channel is on; None: it has none."""
    if setup is None:
        return None
    return next(
        (c.surface for c in setup.channels.values() if c.kind in STRAIN_KINDS and c.surface), None
    )


# ---- What a tire is driven under: beyond it a number is in another unit, and is refused.

#: A tire at less than this [Pa] rests on its rim, and bar, psi and kPa taken for Pa all lie below
#: it: a fifth of it would let 1000 (kPa) pass, twice as much is 0.1 bar, which sand and snow are
#: driven at.
LEAST_PRESSURE_PA = 5e3
#: Speeds [m/s] and accelerations [m/s^2] that a tire is driven at; beyond them a number is in
#: another unit. Twice as much lets a speed in km/h pass for m/s up to 400 km/h.
FASTEST_M_S, HARDEST_M_S2 = 200.0, 100.0
#: least, most and unit of each condition; a time of 1e7 s is a third of a year, a change of 300 K
#: would burn the rubber
_DRIVEN = {
    "speed_m_s": (0.0, FASTEST_M_S, "m/s"),
    "acceleration_m_s2": (-HARDEST_M_S2, HARDEST_M_S2, "m/s^2"),
    "time_s": (0.0, 1e7, "s"),
    "temperature_K": (-300.0, 300.0, "K of change"),
    "slip": (-1.0, 1.0, "(positive in braking)"),
}


def check_pressure(pressure_Pa: float | None) -> None:
    """ModelError for an inflation pressure that is none in Pa; nothing at all (0) is allowed."""
    if pressure_Pa is not None and not (pressure_Pa == 0.0 or pressure_Pa >= LEAST_PRESSURE_PA):
        raise ModelError(
            f"inflation_pressure_Pa = {pressure_Pa:g} is not a plausible pressure of a tire in Pa",
            allowed=f"0, or {LEAST_PRESSURE_PA:g} and more, is allowed",
            do="write it in Pa (2.2 bar is 2.2e5)",
        )


def check_model(model: Model) -> None:
    """ModelError for a model whose inflation pressure is none in Pa."""
    check_pressure(model.values.get("inflation_pressure_Pa"))


def check_conditions(conditions: Conditions, called: Mapping[str, str] | None = None) -> None:
    """UsageError for conditions that no tire is driven under, ModelError for such a pressure.

    What is not known (NaN) passes, but for the speed. `called`: how the user gave a condition.
    """
    backwards = ~(np.asarray(conditions.speed_m_s) >= 0.0)
    if backwards.any():
        raise UsageError(
            f"{(called or {}).get('speed_m_s', 'speed_m_s')} "
            f"{float(conditions.speed_m_s[backwards][0]):g}",
            allowed="allowed is a speed of 0 m/s or more, forwards",
            do="give that",
        )
    for name, (low, high, unit) in _DRIVEN.items():
        values = np.asarray(getattr(conditions, name))
        outside = (values < low) | (values > high)
        if outside.any():
            name = (called or {}).get(name, name)
            raise UsageError(
                f"{name} {float(values[outside][0]):g}",
                allowed=f"{low:g} to {high:g} {unit} is allowed",
                do="correct it",
            )
    for pressure in np.unique(conditions.inflation_pressure_Pa):
        check_pressure(None if np.isnan(pressure) else float(pressure))
