"""A scenario becomes a log with known truth, in memory.

Scenario --seed--> Drive, Roughness --> World
    --sampling--> Simulated (raw channels in the file's units, truth) --> Recording or a file
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from tirelog.simulation.scenario.drive import drive_of, roughness_of, wander_of
from tirelog.simulation.scenario.schema import Scenario
from tirelog.simulation.sensors.sampling import (
    coupled,
    flanks,
    in_source_units,
    moments_of,
    pitch_tables,
    riding_values,
    spoiled,
    vehicle_values,
)
from tirelog.simulation.steady.truth import steady_truth
from tirelog.simulation.steady.waveforms import World
from tirelog.vocabulary.arrays import FloatArray


@dataclass(frozen=True)
class Simulated:
    """A simulated log.

    `channels` raw values (n,) in the file's unit, NaN if lost; `stamp_s` (n,) their stamps [s];
    `world` the truth itself, to be asked for any instant.
    """

    scenario: Scenario
    channels: Mapping[str, FloatArray]
    stamp_s: Mapping[str, FloatArray]
    world: World
    pitch_rad: Mapping[str, FloatArray]

    @cached_property
    def truth(self) -> dict[str, Any]:
        """What is known of the log, ready for JSON."""
        if self.scenario.truth == "coupled_ring":
            from tirelog.simulation.rolling.world import (
                RolledWorld,  # brings the compiler
                truth_of_rolled,
            )

            if isinstance(self.world, RolledWorld):
                return truth_of_rolled(self.world, self.pitch_rad)
        return steady_truth(self.world, self.pitch_rad)


def simulate(scenario: Scenario) -> Simulated:
    """The log of a scenario.

    The same scenario (with its seed) gives the same numbers. UsageError if the physics refuses
    it.
    """
    streams = [
        np.random.default_rng(s)
        for s in np.random.SeedSequence(scenario.seed).spawn(4 + len(scenario.channels))
    ]
    true = with_true_radius(scenario)
    drive = drive_of(true, streams[0])
    length = float(drive.distance_at(drive.time_s[-1]))
    roughness = roughness_of(true, length, streams[1])
    stamps, moments = moments_of(true, streams[2])
    if scenario.truth == "coupled_ring":
        from tirelog.simulation.rolling.world import RolledWorld  # brings the compiler

        world: World = (rolled := RolledWorld(true, drive, roughness))
        clean = rolled.values(moments)
    else:
        world = World(true, drive, roughness, wander_of(true, streams[-1]))
        clean = riding_values(world, moments)
    tables = pitch_tables(world)
    channels = {}
    for (name, sensor), random in zip(true.channels.items(), streams[3:-1], strict=True):
        time, values = moments[name], clean.get(name)
        if values is None:
            values = vehicle_values(world, sensor, time, tables.get(name))
        told = in_source_units(world, sensor, time, coupled(sensor, values))
        channels[name] = spoiled(sensor, told, flanks(world, sensor, time, told), random)
    return Simulated(scenario, channels, stamps, world, tables)


def with_true_radius(scenario: Scenario) -> Scenario:
    """The scenario with the tire's own rolling radius at rest instead of the setup's."""
    error = scenario.nuisances.rolling_radius.error
    tire = scenario.tire
    return replace(
        scenario, tire=replace(tire, rolling_radius_m=tire.rolling_radius_m * (1.0 + error))
    )
