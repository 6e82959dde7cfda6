"""The catalogue: one mechanism per file, here only listed."""

from __future__ import annotations

from tirelog.physics.effects import (
    aero_load,
    belt_tension,
    edge_impact,
    gauge_length,
    hysteresis,
    load_transfer,
    pressure_offset,
    ring_curvature,
    rough_contact,
    sensor_lag,
    stiffening,
    thermal_drift,
    traction,
    viscous_damping,
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
)

#: Every effect of the catalogue, in the contract's order.
CATALOGUE: tuple[Effect, ...] = (
    viscous_damping.EFFECT,
    hysteresis.EFFECT,
    belt_tension.EFFECT,
    stiffening.EFFECT,
    ring_curvature.EFFECT,
    pressure_offset.EFFECT,
    traction.EFFECT,
    edge_impact.EFFECT,
    rough_contact.EFFECT,
    water_film.EFFECT,
    wear.EFFECT,
    load_transfer.EFFECT,
    aero_load.EFFECT,
    thermal_drift.EFFECT,
    gauge_length.EFFECT,
    sensor_lag.EFFECT,
    SPEED_TREND,
    LOAD_CROSSTALK,
    TELEMETRY_DELAY,
    TOOTH_PITCH,
    INFLATION,
)
BY_ID = {effect.id: effect for effect in CATALOGUE}

__all__ = ["BY_ID", "CATALOGUE", "Drive", "Effect", "Site", "Structure"]
