"""Revolutions of a beam with something more planted, and scatter and noise on top."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from tests.diagnosis.toy import stack_of
from tirelog.data.recording import Conditions, Stack
from tirelog.diagnosis.candidates.search import search_effects
from tirelog.diagnosis.diagnose import Diagnosis, conclude
from tirelog.inference.base import Base
from tirelog.inference.stacks.cut import stacks_from_logs
from tirelog.physics import Model
from tirelog.simulation import Scenario, simulate, to_recording
from tirelog.vocabulary.arrays import FloatArray


def simulated(scenarios: Iterable[Scenario], **how: Any) -> list[Stack]:
    """Stacks of the logs that scenarios give, solved apart from the models."""
    logs = [to_recording(simulate(one), f"log_{i}") for i, one in enumerate(scenarios)]
    return list(stacks_from_logs(logs, **how))


def diagnosed(base: Base) -> Diagnosis:
    """What `diagnose` says once the model is fitted."""
    return conclude(search_effects(base), ())


_BEAM = Model.new("beam", radius_m=0.3, load_N=3434.0)
#: patch length and lever arm are free: what is asked here does not need more
MODEL = _BEAM.with_parameters(
    {
        name: _BEAM.parameters[name].fixed()
        for name in ("flexural_stiffness_N_m2", "foundation_stiffness_N_m2")
    }
)
HALF_M = float(
    MODEL.half_length_m(
        Conditions.of(1, speed_m_s=9.0, acceleration_m_s2=0.0, time_s=0.0, load_N=3434.0)
    )[0]
)


def stack(
    planted: Callable[[FloatArray, FloatArray], FloatArray] = lambda xi, speed: 0.0 * xi,
    *,
    manoeuvres: int = 15,
    revolutions: int = 8,
    noise: float = 2e-6,
    seed: int = 1,
    m: int = 128,
) -> Stack:
    """Revolutions at a speed for each manoeuvre; `planted` of xi [m] and speed [m/s], (n, m)."""
    random = np.random.default_rng(seed)
    n = manoeuvres * revolutions
    number = np.repeat(np.arange(manoeuvres), revolutions)
    grid = (np.arange(m) + 0.5) * 2 * np.pi / m - np.pi
    speed = 8.0 + 16.0 * random.permutation(manoeuvres)[number] / (manoeuvres - 1)
    speed = speed + 0.05 * random.standard_normal(n)
    conditions = Conditions.of(
        n, speed_m_s=speed, acceleration_m_s2=0.0, time_s=0.2 * np.arange(n), load_N=3434.0
    )
    values = MODEL.predict(conditions, grid) + planted(
        0.3 * grid + 0.0 * speed[:, None], speed[:, None]
    )
    values *= 1.0 + 0.002 * random.standard_normal((n, 1))
    values += noise * random.standard_normal((n, m))
    return stack_of(values=values, noise=noise, conditions=conditions, manoeuvre=number)


def since_exit(xi: FloatArray) -> FloatArray:
    """Distance behind the exit edge [m]."""
    return np.mod(xi - HALF_M, 2 * np.pi * 0.3)


def ringing(xi: FloatArray, speed: FloatArray) -> FloatArray:
    """Strain that rings behind the exit edge at 120 Hz, fixed in time, larger at speed."""
    late = since_exit(xi) / speed
    return 4e-5 * speed / 20.0 * np.exp(-late / 0.008) * np.sin(2 * np.pi * 120.0 * late)
