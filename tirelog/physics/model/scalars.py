"""Numbers per revolution from the same stages: patch length, dissipation factor, and P4's phase
shift and patch width.
"""

from __future__ import annotations

import numpy as np

from tirelog.physics.model.stages import loaded_site, waveform
from tirelog.physics.model.task import Task
from tirelog.physics.spectral import MODES
from tirelog.vocabulary.arrays import FloatArray


def scalar(task: Task, observable: str, lever_m: float) -> FloatArray:
    """The observable as a column (n or 1, 1): [m], [1/m], [rad], [rad]."""
    if observable == "patch_length":
        return 2.0 * loaded_site(task)[0].half_length_m
    if observable == "dissipation_factor":
        return dissipation_factor(task, lever_m)
    site = loaded_site(task)[0]
    value = task.base["offset_rad"] + task.base["per_acceleration_rad_s2_m"] * np.nan_to_num(
        task.drive.acceleration_m_s2
    )
    if observable == "patch_width":
        value = value + 2.0 * site.half_length_m / site.radius_m
    for added in task.hooks(lambda effect: effect.regressor).values():
        value = value + added(site, observable)
    return value


def dissipation_factor(task: Task, lever_m: float) -> FloatArray:
    """int eps'^2 ds over one revolution [1/m] (P1 (27)), from the modes by Parseval."""
    modes, _ = waveform(task, "strain", lever_m)
    R = task.base["radius_m"]
    slopes = (np.arange(MODES) / R) ** 2 * (modes.real**2 + modes.imag**2)
    integral: FloatArray = 4.0 * np.pi * R * slopes.sum(axis=1, keepdims=True)
    return integral
