"""The laws of what has one number per revolution, from the stages of a prediction.

Patch length and dissipation factor (P1, P2), and P4's phase shift and patch width.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from tirelog.physics.model.stages import Task, bending, loaded_site, waveform
from tirelog.physics.spectral import GRID, MODES, STEP, to_grid
from tirelog.vocabulary.arrays import FloatArray


def scalar(task: Task, observable: str, lever_m: float) -> FloatArray:
    """The observable as a column (n or 1, 1) in its SI unit."""
    return LAWS[observable](task, lever_m)


def patch_length(task: Task, lever_m: float) -> FloatArray:
    """2 L [m], after the effects on the load."""
    return 2.0 * loaded_site(task)[0].half_length_m


def phase_shift(task: Task, lever_m: float) -> FloatArray:
    """The level, what follows the force, and the regressors [rad] (P4 III, IV)."""
    return _with_regressors(task, "phase_shift", 0.0)


def patch_width(task: Task, lever_m: float) -> FloatArray:
    """The angle [rad] between the fronts beside what the phase shift has (P4).

    Of a ring it is between the two steepest places of what an accelerometer reads: the fronts keep
    their distance from these while load and pressure move them, and `offset_rad` is that distance.
    A beam does not lie flat: of it the angle is the contact's length.
    """
    if task.carcass == "ring":
        return _with_regressors(task, "patch_width", _between_steepest(task))
    site = loaded_site(task)[0]
    return _with_regressors(task, "patch_width", 2.0 * site.half_length_m / site.radius_m)


def _between_steepest(task: Task) -> FloatArray:
    """Angle (n or 1, 1) between the places where the belt's curvature changes most on either side.

    By the parabola through three of the grid's slopes.
    """
    slope = to_grid(1j * np.arange(MODES) * bending(task))
    rows = np.arange(slope.shape[0])
    places = []
    for way in (1, -1):
        # grid points from the patch's middle on, one way round; the belt's curvature falls
        fall = -way * np.concatenate([slope[:, :1], slope[:, 1:][:, ::way]], axis=1)
        at = np.clip(np.argmax(fall[:, : GRID // 2], axis=1), 1, GRID // 2)
        before, here, after = (fall[rows, at + k] for k in (-1, 0, 1))
        bend = before - 2.0 * here + after
        places.append(at + 0.5 * (before - after) / np.where(bend < 0.0, bend, -np.inf))
    return np.asarray((places[0] + places[1])[:, None] * STEP, dtype=np.float64)


def _with_regressors(task: Task, observable: str, width_rad: FloatArray | float) -> FloatArray:
    value = task.base["offset_rad"] + task.base["per_acceleration_rad_s2_m"] * np.nan_to_num(
        task.drive.acceleration_m_s2
    )
    value = value + width_rad
    for added in task.hooks(lambda effect: effect.regressor).values():
        value = value + added(loaded_site(task)[0], observable)
    return value


def dissipation_factor(task: Task, lever_m: float) -> FloatArray:
    """int eps'^2 ds over one revolution [1/m] (P1 (27)), from the modes by Parseval."""
    modes, _ = waveform(task, "strain", lever_m)
    R = task.base["radius_m"]
    slopes = (np.arange(MODES) / R) ** 2 * (modes.real**2 + modes.imag**2)
    integral: FloatArray = 4.0 * np.pi * R * slopes.sum(axis=1, keepdims=True)
    return integral


#: observable of one number per revolution -> its law: (task, signed lever arm [m]) -> column
LAWS: Mapping[str, Callable[[Task, float], FloatArray]] = {
    "patch_length": patch_length,
    "dissipation_factor": dissipation_factor,
    "phase_shift": phase_shift,
    "patch_width": patch_width,
}
