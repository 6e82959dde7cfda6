"""The catalogue: one mechanism per file, here only listed."""

from __future__ import annotations

import copyreg
import pickle
from typing import Any

from tirelog.physics.effects import (
    aero_load,
    belt_extension,
    belt_shear,
    belt_tension,
    belt_viscosity,
    cavity_resonance,
    edge_impact,
    form,
    gauge_length,
    hysteresis,
    imbalance,
    inflated_sidewalls,
    load_transfer,
    pressure_offset,
    pressure_saddle,
    ring_curvature,
    rough_contact,
    sensor_lag,
    sensor_tilt,
    standing_wave,
    stiffening,
    thermal_drift,
    traction,
    tread_pitch,
    viscous_damping,
    warm_gain,
    warm_hysteresis,
    water_film,
    wear,
)
from tirelog.physics.effects.base import Drive, Effect, Site, Structure
from tirelog.physics.effects.regressors import (
    INFLATION,
    LOAD_CROSSTALK,
    SPEED_TREND,
    TELEMETRY_DELAY,
    TOOTH_PITCH,
    WIND_UP,
)

#: Every effect of the catalogue, in the contract's order.
CATALOGUE: tuple[Effect, ...] = (
    viscous_damping.EFFECT,
    hysteresis.EFFECT,
    warm_hysteresis.EFFECT,
    belt_viscosity.EFFECT,
    belt_shear.EFFECT,
    belt_extension.EFFECT,
    belt_tension.EFFECT,
    inflated_sidewalls.EFFECT,
    stiffening.EFFECT,
    ring_curvature.EFFECT,
    pressure_offset.EFFECT,
    pressure_saddle.EFFECT,
    traction.EFFECT,
    edge_impact.EFFECT,
    rough_contact.EFFECT,
    water_film.EFFECT,
    wear.EFFECT,
    tread_pitch.EFFECT,
    load_transfer.EFFECT,
    aero_load.EFFECT,
    imbalance.EFFECT,
    thermal_drift.EFFECT,
    gauge_length.EFFECT,
    sensor_lag.EFFECT,
    sensor_tilt.EFFECT,
    warm_gain.EFFECT,
    standing_wave.EFFECT,
    cavity_resonance.EFFECT,
    SPEED_TREND,
    LOAD_CROSSTALK,
    TELEMETRY_DELAY,
    TOOTH_PITCH,
    INFLATION,
    WIND_UP,
    form.EFFECT,
)
BY_ID = {effect.id: effect for effect in CATALOGUE}


def _of_catalogue(name: str) -> Effect:
    return BY_ID[name]


def _pickled(effect: Effect) -> str | tuple[Any, ...]:
    """How an effect goes to another process: one of the catalogue is the catalogue's again there.

    Of any other nobody knows which conditions it reads, and predictions take five times as long.
    """
    if BY_ID.get(effect.id) is effect:
        return _of_catalogue, (effect.id,)
    return effect.__reduce_ex__(pickle.HIGHEST_PROTOCOL)


copyreg.pickle(Effect, _pickled)


def readers(effect: Effect, observable: str) -> list[Effect]:
    """The effects of the catalogue beside which `effect` acts on an observable.

    None for an observable on which it acts by itself, or not at all.
    """
    if effect.acts_in(observable, ()):
        return []
    return [
        other
        for other in CATALOGUE
        if observable in other.observables and effect.acts_in(observable, [other])
    ]


def serves(effect: Effect) -> dict[str, str]:
    """The observables that an effect acts on, and how they are said.

    With the effects that it needs beside it there, if it does not act by itself.
    """
    said = {name: name for name in effect.reaches}
    for name in effect.observables:
        if beside := [other.id for other in readers(effect, name)]:
            said[name] = f"{name} (beside {' or '.join(beside)})"
    return said


__all__ = ["BY_ID", "CATALOGUE", "Drive", "Effect", "Site", "Structure", "readers", "serves"]
