"""Every condition that a tire is driven under, once: speed, load, water depth, ...

`ConditionValues` is the register: a field is a condition, and its name has the unit. The entry of a
field has the condition's names, the channels that measure it, and the numbers that a setup may
give. It also has the stretch to propose to a driver. The conditions of revolutions and predictions,
the setup's keys, the names in expressions and the sentences of a diagnosis come from it. A new
condition is one field here (docs/howto/condition.md); docs/setup.md and docs/conditions.md are made
from this register.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeAlias

from tirelog.vocabulary.arrays import FloatArray

#: numbers that [conditions] takes: from which, to which, and whether the first is one of them
SetupRange: TypeAlias = tuple[float, float, bool]


@dataclass(frozen=True)
class Proposed:
    """A stretch to ask a driver for: its name, its speed [m/s], the condition's value."""

    name: str
    speed_m_s: float
    value: float


@dataclass(frozen=True)
class Condition:
    """A condition.

    field           its name with its unit: in code, tables, model files and setups
    symbol          its name in an expression, and of a remainder that follows it
    word            its name in a list of what an effect follows (default: the symbol)
    name            its name in a sentence (default: the word)
    unit            unit of its values, SI or as the field says
    meaning         a sentence
    kinds           kinds of channel whose mean over a revolution gives it, the last one first
    from_start      those of them that are absolute: the first revolution's value is subtracted
    setup           the numbers that a setup may give for the whole log; None: none
    signed          True if a remainder grows from zero both ways, as from drive to brake
    in_expressions  True if a user's expression may read it as a condition
    example         value at which an effect's signature is drawn; None: not known there
    proposed        stretch by which rivals may be parted; None: none on the list
    """

    field: str
    symbol: str
    word: str
    name: str
    unit: str
    meaning: str
    kinds: tuple[str, ...] = ()
    from_start: tuple[str, ...] = ()
    setup: SetupRange | None = None
    signed: bool = False
    in_expressions: bool = True
    example: float | None = None
    proposed: Proposed | None = None


def _entry(
    symbol: str, unit: str, meaning: str, *, word: str = "", name: str = "", **more: Any
) -> dict[str, Condition]:
    """The entry of a field of `ConditionValues` in the register."""
    entry = Condition("", symbol, word or symbol, name or word or symbol, unit, meaning, **more)
    return {"condition": entry}


@dataclass(frozen=True)
class ConditionValues:
    """One array per condition, SI, NaN if it is not known; the shape is its owner's."""

    speed_m_s: FloatArray = field(metadata=_entry("speed", "m/s", "speed at the patch centre"))
    acceleration_m_s2: FloatArray = field(
        metadata=_entry(
            "acceleration",
            "m/s^2",
            "longitudinal acceleration, the same over a revolution",
            signed=True,
        )
    )
    time_s: FloatArray = field(
        metadata=_entry("time", "s", "time from the start of the log", example=60.0)
    )
    load_N: FloatArray = field(
        metadata=_entry(
            "load",
            "N",
            "load of the wheel on the road",
            kinds=("vertical_load",),
            setup=(0.0, 1e6, False),
            # there `load` is the patch's, after the effects on it
            in_expressions=False,
        )
    )
    inflation_pressure_Pa: FloatArray = field(
        metadata=_entry(
            "pressure",
            "Pa",
            "inflation pressure above the air's",
            name="inflation pressure",
            kinds=("inflation_pressure",),
            setup=(0.0, 1e8, False),
            example=2.2e5,
        )
    )
    temperature_K: FloatArray = field(
        metadata=_entry(
            "temperature",
            "K",
            "change of the tire's temperature against its reference, or since the start of the log",
            kinds=("temperature", "fbg_temperature"),
            from_start=("temperature",),
            example=10.0,
        )
    )
    distance_km: FloatArray = field(
        metadata=_entry(
            "distance",
            "km",
            "distance that the tread has been driven",
            name="tread distance",
            setup=(0.0, 1e7, True),
            example=20000.0,
            proposed=Proposed("cruise at 15 m/s on a tread of 40000 km", 15.0, 40000.0),
        )
    )
    water_depth_mm: FloatArray = field(
        metadata=_entry(
            "water",
            "mm",
            "depth of the water on the road",
            word="water depth",
            setup=(0.0, 1e3, True),
            example=1.0,
            proposed=Proposed("cruise at 20 m/s in 2 mm of water", 20.0, 2.0),
        )
    )
    longitudinal_force_N: FloatArray = field(
        metadata=_entry(
            "longitudinal_force",
            "N",
            "force of the road on the wheel along the vehicle, positive in drive",
            word="longitudinal force",
            kinds=("longitudinal_force",),
            signed=True,
            example=1000.0,
        )
    )
    lateral_acceleration_m_s2: FloatArray = field(
        metadata=_entry(
            "lateral_acceleration",
            "m/s^2",
            "acceleration of the vehicle to the left, in a curve",
            word="lateral acceleration",
            kinds=("lateral_acceleration",),
            signed=True,
            example=3.0,
        )
    )
    slip: FloatArray = field(
        metadata=_entry(
            "slip", "1", "longitudinal slip, positive in braking", signed=True, in_expressions=False
        )
    )


CONDITIONS: Mapping[str, Condition] = {
    f.name: replace(f.metadata["condition"], field=f.name) for f in fields(ConditionValues)
}
#: conditions that a setup gives for a whole log, by key
SETUP_KEYS: Mapping[str, SetupRange] = {
    name: condition.setup for name, condition in CONDITIONS.items() if condition.setup is not None
}
