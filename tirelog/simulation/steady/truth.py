"""The truth of a simulated log, ready for JSON.

What every estimator and diagnosis is measured against.

Times are the log's own stamps. Arrays have one value per passage of the patch; angles grow in the
direction of rolling.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from tirelog.simulation.scenario.schema import PLANTABLE, Nuisances, Scenario, Sensor
from tirelog.simulation.sensors.sampling import RIDING, passages, phase_shift
from tirelog.simulation.steady.waveforms import CHUNK, World
from tirelog.version import __version__
from tirelog.vocabulary.arrays import FloatArray

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
