"""Cases with known truth for `hidden.py`: what is driven, by which tire, with what planted.  A case is two to four logs of 60 s at 2.5 kHz."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.recording import Channel, Recording, TimeAxis
from tirelog.setup import parse_setup
from tirelog.simulation.simulate import simulate
from tirelog.simulation.scenario import scenario_of

RATE_HZ = 2500.0
#: noise [microstrain] of one sample, and the load's scatter along the road
NOISE = 3.0
ROUGHNESS = 0.005


@dataclass(frozen=True)
class Case:
    """`effects`: tables as in a scenario; `load_scatter` from manoeuvre to manoeuvre; `speed`: 'mixed' or 'one' (twins that need speed)."""

    name: str
    seed: int
    effects: tuple[Mapping[str, Any], ...] = ()
    logs: int = 3
    load_scatter: float = 0.0
    truth: str = "beam"
    speed: str = "mixed"
    duration_s: float = 60.0


def drive(random: np.random.Generator, duration_s: float) -> list[dict[str, Any]]:
    """A mixed drive: cruises, drives, coasts and brakes between 8 and 25 m/s."""
    speed = float(random.uniform(8.0, 13.0))
    parts: list[dict[str, Any]] = [{"duration_s": float(random.uniform(4.0, 6.0)), "speed_m_s": speed}]
    total = parts[0]["duration_s"]
    while total < duration_s:
        if speed < 15.0:
            target, rate = random.uniform(max(speed + 4.0, 16.0), 25.0), random.uniform(1.0, 2.5)
        elif random.random() < 0.5:
            target, rate = random.uniform(8.0, speed - 5.0), random.uniform(2.0, 3.5)
        else:
            target, rate = speed - random.uniform(3.0, 6.0), random.uniform(0.5, 1.0)
        parts.append({"duration_s": float(abs(target - speed) / rate), "speed_m_s": float(target)})
        speed = float(target)
        parts.append({"duration_s": float(random.uniform(3.0, 6.0)), "speed_m_s": speed})
        total = sum(part["duration_s"] for part in parts)
    return parts


def cruise(random: np.random.Generator, duration_s: float, speed: float) -> list[dict[str, Any]]:
    """One speed, with short lifts of the foot that keep the stretches apart."""
    parts: list[dict[str, Any]] = []
    while sum(part["duration_s"] for part in parts) < duration_s:
        parts.append({"duration_s": float(random.uniform(4.0, 6.0)), "speed_m_s": speed})
        parts.append({"duration_s": 1.2, "speed_m_s": speed - 0.6})
        parts.append({"duration_s": 1.2, "speed_m_s": speed})
    return parts


def scenarios(case: Case) -> list[dict[str, Any]]:
    """The scenario tables of a case's logs: each with its own load, pressure, distance, water, drive."""
    random = np.random.default_rng([case.seed, 17])
    speed = float(random.uniform(12.0, 18.0))
    stiff = {"lever_arm_m": 3.0e-4 * random.uniform(0.9, 1.1), "foundation_stiffness_N_m2": 2.0e6 * random.uniform(0.8, 1.2)}
    result = []
    for log in range(case.logs):
        manoeuvres = drive(random, case.duration_s) if case.speed == "mixed" else cruise(random, case.duration_s, speed)
        conditions = {
            "load_N": 3434.0 * (0.85, 1.1, 1.0, 0.95)[log],
            "inflation_pressure_Pa": 2.2e5,
            "distance_km": (500.0, 30000.0, 15000.0, 40000.0)[log],
            "water_depth_mm": (1.0, 0.5, 1.5, 0.0)[log],
        }
        tire = {"contact": "parabola", **stiff} if case.truth == "beam" else {"contact": "parabola"}
        result.append(
            {
                "truth": case.truth,
                "seed": case.seed * 10 + log,
                "tire": tire,
                "conditions": conditions,
                "road": {"roughness": ROUGHNESS, "load_scatter": case.load_scatter},
                "manoeuvres": manoeuvres,
                "channels": {"strain_1": {"kind": "strain", "sampling_rate_Hz": RATE_HZ, "noise": NOISE}},
                "effects": [dict(effect) for effect in case.effects],
            }
        )
    return result


def recording_of(table: Mapping[str, Any], name: str) -> Recording:
    """The log of a scenario as a recording in memory, strain in SI, with the setup that a user would write."""
    simulated = simulate(scenario_of(table))
    conditions = "\n".join(f"{key} = {value}" for key, value in table["conditions"].items())
    setup = parse_setup(
        f"[tire]\nunloaded_radius_m = 0.3126\nrolling_radius_m = 0.305\nsection_height_m = 0.018\nwidth_m = 0.215\n"
        f'[conditions]\n{conditions}\n[channels.strain_1]\nkind = "strain"\nsource = "strain_1"\nunit = "microstrain"\nsurface = "outer"\n'
    )
    values = simulated.channels["strain_1"] * 1e-6
    axis = TimeAxis.uniform(values.size, RATE_HZ)
    return Recording(name, {"strain_1": Channel.of_array("strain_1", "strain", values, axis, surface="outer")}, setup)


def recordings(case: Case) -> list[Recording]:
    """All logs of a case."""
    return [recording_of(table, f"log_{i + 1}") for i, table in enumerate(scenarios(case))]
