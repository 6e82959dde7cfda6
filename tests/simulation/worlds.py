"""What the tests of the truth share: small scenarios and instants."""

from __future__ import annotations

from typing import Any

import numpy as np

from tirelog.simulation import Scenario, scenario_of
from tirelog.simulation.steady.loads import Instants, instants_of
from tirelog.simulation.steady.waveforms import World, drive_of, roughness_of

REFERENCE_LOAD_N = 3434.0


def tables(**more: Any) -> dict[str, Any]:
    """Tables of a scenario: 4 s at 18 m/s, one noiseless grating."""
    out: dict[str, Any] = {
        "manoeuvres": [{"duration_s": 4.0, "speed_m_s": 18.0}],
        "channels": {"s": {"kind": "fbg_strain", "angle_deg": 70.0}},
    }
    return {**out, **more}


def scenario(**more: Any) -> Scenario:
    return scenario_of(tables(**more))


def world(**more: Any) -> World:
    """The world of `scenario(**more)`."""
    made = scenario(**more)
    streams = [np.random.default_rng([made.seed, k]) for k in range(2)]
    drive = drive_of(made, streams[0])
    return World(
        made,
        drive,
        roughness_of(made, float(drive.angle_at(drive.time_s[-1])) * drive.radius_m, streams[1]),
    )


def instants(
    speed: float = 18.0,
    load: float = REFERENCE_LOAD_N,
    half_length: float = 0.058,
    slip: float = 0.0,
) -> Instants:
    """One instant."""
    return instants_of(
        speed=speed,
        load=load,
        half_length=half_length,
        slip=slip,
        reference_load=REFERENCE_LOAD_N,
        stretch=np.ones(1),
    )
