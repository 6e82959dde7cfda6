"""A scenario becomes a log with known truth, in memory.

Scenario --seed--> Drive, Roughness --> World
    --sampling--> Simulated (raw channels in the file's units, truth) --> Recording or a file
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from tirelog.simulation.scenario.drive import drive_of, roughness_of, wander_of
from tirelog.simulation.scenario.schema import PLANTABLE, Nuisances, Scenario, Sensor
from tirelog.simulation.sensors.sampling import (
    RIDING,
    coupled,
    flanks,
    in_source_units,
    moments_of,
    passages,
    phase_shift,
    pitch_tables,
    riding_values,
    spoiled,
    vehicle_values,
)
from tirelog.simulation.steady.waveforms import CHUNK, World
from tirelog.version import __version__
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
    # the tire's own rolling radius at rest, not the setup's
    radius = scenario.tire.rolling_radius_m * (1.0 + scenario.nuisances.rolling_radius.error)
    true = replace(scenario, tire=replace(scenario.tire, rolling_radius_m=radius))
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


# ---- The truth of a simulated log, ready for JSON.
#
# Times are the log's own stamps. Arrays have one value per passage of the patch; angles grow in the
# direction of rolling.

#: a channel's name and its delay [s] -> what is true at each of its passages, columns (n,)
#: beginning with `time_s` in its own stamps
Passages = Callable[[str, float], dict[str, FloatArray]]


def steady_truth(
    world: World, pitch_rad: Mapping[str, FloatArray], passed: Passages | None = None
) -> dict[str, Any]:
    """The whole truth of a log.

    `passed` gives a channel's passages if they are not the steady world's.
    """
    scenario = world.scenario
    passed = passed or partial(_steady_passages, world)
    # step of the wheel's motion in the truth [s]; twice as long shows quick manoeuvres half as
    # finely in the truth file alone
    time = np.arange(0.0, scenario.duration_s, 0.05)
    return {
        "tirelog_version": __version__,
        "seed": scenario.seed,
        "truth": scenario.truth,
        "contact": "parabola" if scenario.truth == "beam" else scenario.tire.contact,
        "tire": asdict(scenario.tire),
        "conditions": asdict(scenario.conditions),
        "road": asdict(scenario.road),
        **({} if scenario.nuisances == Nuisances() else {"nuisances": asdict(scenario.nuisances)}),
        "ramp": None if scenario.ramp is None else asdict(scenario.ramp),
        "effects": planted_truth(scenario),
        "manoeuvres": [asdict(part) for part in world.drive.parts],
        "motion": {
            "time_s": _list(time),
            "wheel_angle_rad": _list(world.drive.angle_at(time)),
            "speed_m_s": _list(world.drive.speed_at(time)),
            "acceleration_m_s2": _list(world.drive.acceleration_at(time)),
        },
        "channels": {
            name: _channel(scenario, name, passed)
            for name, s in scenario.channels.items()
            if s.kind in RIDING
        },
        "pitch_error_deg": {name: _list(np.degrees(table)) for name, table in pitch_rad.items()},
    }


def planted_truth(scenario: Scenario) -> list[dict[str, Any]]:
    """Every planted effect: name, form, strength, parameters.

    For one outside the catalogue also where it shows, parity, speed exponent, frequency.
    """
    out = []
    for effect in scenario.effects:
        known = PLANTABLE[effect.name]
        entry: dict[str, Any] = {
            "name": effect.name,
            "form": effect.form,
            "in_catalogue": known.in_catalogue,
            "strength": effect[next(iter(known.parameters))],
            "parameters": dict(effect.parameters),
        }
        if not known.in_catalogue:
            entry.update(
                where=known.where, parity=known.parity, speed_exponent=effect["speed_exponent"]
            )
            entry["frequency_Hz"] = effect[known.fixed] if known.fixed else None
        out.append(entry)
    if scenario.truth == "ring" and scenario.tire.contact == "parabola":
        out.append(
            {
                "name": "ring_curvature",
                "form": "exact",
                "in_catalogue": True,
                "strength": 1.0,
                "parameters": {},
            }
        )
    return out


def _channel(scenario: Scenario, name: str, passed: Passages) -> dict[str, Any]:
    """The passages of one sensor, in its own stamps (a delay makes them later)."""
    sensor = scenario.channels[name]
    late = scenario.late_s(sensor)
    return {
        "kind": sensor.kind,
        "angle_deg": sensor.angle_deg,
        "surface": sensor.surface,
        "delay_s": late,
        "passages": {key: _list(value) for key, value in passed(name, late).items()},
    }


def _steady_passages(world: World, name: str, late_s: float) -> dict[str, FloatArray]:
    """The passages of one sensor of a steady world."""
    sensor = world.scenario.channels[name]
    time = passages(world, sensor, world.scenario.duration_s - late_s)
    columns: dict[str, list[FloatArray]] = {}
    for first in range(0, time.size, CHUNK):
        for key, value in _passages(world, sensor, time[first : first + CHUNK]).items():
            columns.setdefault(key, []).append(value)
    return {
        "time_s": time + late_s,
        **{key: np.concatenate(values) for key, values in columns.items()},
    }


def _passages(world: World, sensor: Sensor, time: FloatArray) -> dict[str, FloatArray]:
    """What is true at each of the passages `time` (n,), each (n,)."""
    at = world.instants(time, 1.0 + world.fluctuation(time))
    solution = world.solve(at)
    slope = world.ring.inverse(world.ring.derivatives[1] * world.strain(solution, sensor))
    radius = world.drive.radius_at(at.speed)
    return {
        "speed_m_s": at.speed,
        "acceleration_m_s2": at.acceleration,
        "load_N": at.load,
        "longitudinal_force_N": world.longitudinal_force(time),
        "slip": at.slip,
        "contact_length_m": solution.exit_m - solution.entry_m,
        "entry_m": solution.entry_m,
        "exit_m": solution.exit_m,
        "slip_onset_m": solution.onset_m,
        "dissipation_factor_1_m": (slope**2).sum(axis=1) * world.ring.step_m / at.stretch,
        "wheel_angle_rad": world.drive.angle_at(time),
        "phase_shift_deg": np.degrees(phase_shift(world, time)),
        "patch_width_deg": np.degrees((solution.exit_m - solution.entry_m) / radius),
    }


def _list(values: FloatArray) -> list[float | None]:
    """Numbers for JSON to ten digits, None if there is none."""
    return [float(f"{v:.10g}") if np.isfinite(v) else None for v in values]
