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

from tirelog.simulation.scenario.drive import (
    Roughness,
    TrueDrive,
    Wander,
    drive_of,
    roughness_of,
    wander_of,
)
from tirelog.simulation.scenario.schema import Scenario
from tirelog.simulation.sensors.sampling import (
    Trace,
    coupled,
    flanks,
    in_source_units,
    pitch_tables,
    riding_values,
    spoiled,
    traces,
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
    moments = traces(true, streams[2])
    world, clean = _solved(true, drive, roughness, wander_of(true, streams[-1]), moments)
    tables = pitch_tables(world)
    channels = {}
    for (name, trace), random in zip(moments.items(), streams[3:-1], strict=True):
        values = clean[name] if name in clean else vehicle_values(world, name, trace, tables)
        told = in_source_units(world, trace, coupled(trace, values))
        channels[name] = spoiled(trace.sensor, told, flanks(world, trace, told), random)
    return Simulated(scenario, channels, _stamps(moments), world, tables)


def with_true_radius(scenario: Scenario) -> Scenario:
    """The scenario with the tire's own rolling radius at rest instead of the setup's."""
    error = scenario.nuisances.rolling_radius.error
    tire = scenario.tire
    return replace(
        scenario, tire=replace(tire, rolling_radius_m=tire.rolling_radius_m * (1.0 + error))
    )


def _solved(
    scenario: Scenario,
    drive: TrueDrive,
    roughness: Roughness,
    wander: Wander,
    moments: dict[str, Trace],
) -> tuple[World, dict[str, FloatArray]]:
    """The world of the scenario's truth, and the clean values of what it moves.

    Steady at every instant, or rolled from begin to end.
    """
    if scenario.truth == "coupled_ring":
        from tirelog.simulation.rolling.world import RolledWorld  # brings the compiler

        rolled = RolledWorld(scenario, drive, roughness)
        return rolled, rolled.values(moments)
    world = World(scenario, drive, roughness, wander)
    return world, riding_values(world, moments)


def _stamps(moments: dict[str, Trace]) -> dict[str, FloatArray]:
    return {name: trace.stamp_s for name, trace in moments.items()}
