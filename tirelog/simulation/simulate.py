"""A scenario becomes a log with known truth, in memory.

Scenario --seed--> Drive, Roughness --> World
    --sampling--> Simulated (raw channels in the file's units, truth) --> Recording or a file
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tirelog.simulation.scenario.drive import Drive, Roughness, drive_of, roughness_of
from tirelog.simulation.scenario.schema import Scenario
from tirelog.simulation.sensors.sampling import (
    Trace,
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
            from tirelog.simulation.rolling.truth import truth_of_rolled
            from tirelog.simulation.rolling.world import RolledWorld  # brings the compiler

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
        for s in np.random.SeedSequence(scenario.seed).spawn(3 + len(scenario.channels))
    ]
    drive = drive_of(scenario, streams[0])
    length = float(drive.angle_at(drive.time_s[-1])) * drive.radius_m
    roughness = roughness_of(scenario, length, streams[1])
    moments = traces(scenario, streams[2])
    world, clean = _solved(scenario, drive, roughness, moments)
    tables = pitch_tables(world)
    channels = {}
    for (name, trace), random in zip(moments.items(), streams[3:], strict=True):
        values = clean[name] if name in clean else vehicle_values(world, name, trace, tables)
        channels[name] = spoiled(trace.sensor, in_source_units(world, trace, values), random)
    return Simulated(scenario, channels, _stamps(moments), world, tables)


def _solved(
    scenario: Scenario, drive: Drive, roughness: Roughness, moments: dict[str, Trace]
) -> tuple[World, dict[str, FloatArray]]:
    """The world of the scenario's truth, and the clean values of what it moves.

    Steady at every instant, or rolled from begin to end.
    """
    if scenario.truth == "coupled_ring":
        from tirelog.simulation.rolling.world import RolledWorld  # brings the compiler

        rolled = RolledWorld(scenario, drive, roughness)
        return rolled, rolled.values(moments)
    world = World(scenario, drive, roughness)
    return world, riding_values(world, moments)


def _stamps(moments: dict[str, Trace]) -> dict[str, FloatArray]:
    return {name: trace.stamp_s for name, trace in moments.items()}
