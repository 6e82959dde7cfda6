"""Warming, first order in time or by a temperature channel: baseline strain, stiffness (P1 4)."""

from __future__ import annotations

import numpy as np

from tirelog.physics.effects.base import Drive, Effect, Structure, Values
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray


def warmth(v: Values, drive: Drive) -> FloatArray:
    """T - T_0 [K] if the option `driver` is temperature, else 1 - exp(-t / tau)."""
    if v["driver:temperature"]:
        return drive.temperature_K
    return -np.expm1(-drive.time_s / v["time_constant_s"])


def _structure(v: Values, drive: Drive) -> Structure:
    return Structure(stiffening=v["stiffness"] * warmth(v, drive))


def _baseline(v: Values, drive: Drive) -> FloatArray:
    return v["drift"] * warmth(v, drive)


EFFECT = Effect(
    id="thermal_drift",
    mechanism="warming, first order in time or by a temperature "
    "channel: baseline strain and stiffness",
    follows=(("time_s", 1), ("temperature_K", 1)),
    acts_on=("baseline", "structure"),
    parameters=(
        Parameter(
            "drift",
            "1 or 1/K",
            "a in baseline a (1 - exp(-t/tau)), or a (T - T_0)",
            0.0,
            -1e-2,
            1e-2,
            probe=2e-5,
        ),
        Parameter(
            "stiffness",
            "1 or 1/K",
            "b in k (1 + b (1 - exp(-t/tau))), or k (1 + b (T - T_0))",
            0.0,
            -0.9,
            0.9,
            probe=-0.03,
        ),
        Parameter("time_constant_s", "s", "tau", 30.0, 1.0, 1e5, probe=30.0),
    ),
    strength=("drift", "stiffness"),
    source="P1 4",
    valid='one warming from the start of the log; driver = "time" or "temperature" (auto: '
    "temperature where it varies)",
    signature="the baseline moves once in time or with temperature, whatever the speed",
    needs=("time_s",),
    instead={"time_s": "temperature_K"},
    options={"driver": ("auto", "time", "temperature")},
    structure=_structure,
    baseline=_baseline,
)
