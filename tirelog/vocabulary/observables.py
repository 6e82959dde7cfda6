"""Every observable that a model predicts and a log measures, once.

What it is, in which unit, how a person reads it, which channels measure it, and which stages of the
model it is computed from. A new observable is one entry here, its law in `physics.model.stages`
and its measurement in `inference.stacks.manoeuvres` (docs/howto/observable.md); docs/model.md and
docs/observables.md are made from this register.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from tirelog.vocabulary.kinds import ACCELERATION_KINDS, STRAIN_KINDS


@dataclass(frozen=True)
class Observable:
    """What is compared with a model.

    unit         SI unit of its values in models, stacks and JSON
    shown_unit   unit in which a person reads it, `shown_factor` of them in one SI unit
    kinds        kinds of channel that measure it
    waveform     True if it is a waveform over the angle, False if one number per revolution
    reads        stages of the model that it is computed from; an effect that enters none of them
                 does not act on it, unless by another effect that reads its stage (`Effect.reads`)
    meaning      a sentence
    data         what of a log it is made of, "" for something of its own: two observables of the
                 same data are no two measurements, and are not fitted together
    beside       kinds of channel that it needs besides
    column       its column in tables, of one number per revolution; angles stand there in degrees
    own_zero     True if each log counts it from a zero of its own, so that logs cannot be compared
                 in its level
    """

    name: str
    unit: str
    shown_unit: str
    shown_factor: float
    kinds: tuple[str, ...]
    waveform: bool
    reads: tuple[str, ...]
    meaning: str
    data: str = ""
    beside: tuple[str, ...] = ()
    own_zero: bool = False
    column: str = ""


STRAIN, ACCELERATION, WIDTH = "strain", "radial_acceleration", "patch_width"
_DEGREES = math.degrees(1.0)
_WAVE = ("load", "contact_pressure", "structure", "sensor")
_ALL = (
    Observable(
        STRAIN,
        "1",
        "microstrain",
        1e6,
        STRAIN_KINDS,
        True,
        (*_WAVE, "lever_arm", "baseline", "strain"),
        "strain along the tread at the sensor, over one revolution",
        "strain",
    ),
    Observable(
        ACCELERATION,
        "m/s^2",
        "m/s^2",
        1.0,
        ACCELERATION_KINDS,
        True,
        (*_WAVE, "radial_acceleration"),
        "specific force that an accelerometer in the tread reads, outwards, over one revolution",
        "acceleration",
    ),
    Observable(
        "patch_length",
        "m",
        "mm",
        1e3,
        STRAIN_KINDS,
        False,
        ("load",),
        "length of the contact patch, from its entry edge to its exit edge",
        "strain",
        column="patch_length_m",
    ),
    Observable(
        "dissipation_factor",
        "1/m",
        "1/m",
        1.0,
        STRAIN_KINDS,
        False,
        (*_WAVE, "lever_arm"),
        "integral of the squared strain slope along the tread over one revolution (P1)",
        "strain",
        column="dissipation_factor_1_m",
    ),
    Observable(
        "phase_shift",
        "rad",
        "deg",
        _DEGREES,
        ACCELERATION_KINDS,
        False,
        ("regressors",),
        "wheel angle at the middle of the patch against its zero, growing in the rolling direction",
        "wheel angle",
        ("wheel_encoder",),
        own_zero=True,
        column="phase_shift_deg",
    ),
    Observable(
        WIDTH,
        "rad",
        "deg",
        _DEGREES,
        ACCELERATION_KINDS,
        False,
        ("load", "regressors"),
        "wheel angle from the patch's entry edge to its exit edge (P4)",
        "acceleration",
        ("wheel_encoder",),
        column="patch_width_deg",
    ),
)
OBSERVABLES: Mapping[str, Observable] = {observable.name: observable for observable in _ALL}
WAVEFORMS = tuple(o.name for o in _ALL if o.waveform)
OWN_ZERO = tuple(o.name for o in _ALL if o.own_zero)
SCALARS = tuple(o.name for o in _ALL if not o.waveform)


#: unit of what several observables have together: the noise floor of each
FLOORS = "noise floors"


def together(names: Iterable[str]) -> str:
    """The name of several observables of one fit."""
    return " + ".join(names)


def at_odds(names: Iterable[str]) -> str:
    """Why these cannot be fitted together; "" if they can."""
    seen: dict[str, str] = {}
    for name in names:
        own = OBSERVABLES[name]
        for what in (
            own.data or name,
            *(("a level of its own",) if "regressors" in own.reads else ()),
        ):
            if what in seen and seen[what] == name:
                return f"{name} is named twice"
            if what in seen:
                share = "have" if what == "a level of its own" else "are made of"
                same = "one level" if share == "have" else f"the same {what}"
                return f"{seen[what]} and {name} {share} {same}"
            seen[what] = name
    return ""


def computed_from(stage: str) -> tuple[str, ...]:
    """The observables that are computed from a stage of the model."""
    return tuple(o.name for o in _ALL if stage in o.reads)


def waveform_of(kinds: Iterable[str]) -> str:
    """The waveform that channels of these kinds measure; strain if they measure several or none."""
    given = set(kinds)
    return next((o.name for o in _ALL if o.waveform and given & set(o.kinds)), STRAIN)


def shown(name: str, unit: str) -> tuple[float, str]:
    """Factor and unit in which a page shows an observable; `unit` itself for an unknown one."""
    known = OBSERVABLES.get(name)
    return (known.shown_factor, known.shown_unit) if known is not None else (1.0, unit)
