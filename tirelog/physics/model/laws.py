"""The laws of what has one number per revolution, from the stages of a prediction.

Patch length and dissipation factor (P1, P2), and P4's phase shift and patch width.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from tirelog.errors import ModelError
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

    A front is where an accelerometer reads half of its level outside (errata). Of a ring it is
    where its belt is bent half as much as a round one, and that is inside the contact's edge, by
    less where the load is low. A beam does not lie flat: of it the angle is the contact's length.
    """
    site = loaded_site(task)[0]
    if task.carcass == "ring":
        return _with_regressors(task, "patch_width", _between_half_levels(task))
    return _with_regressors(task, "patch_width", 2.0 * site.half_length_m / site.radius_m)


def _between_half_levels(task: Task) -> FloatArray:
    """Angle (n or 1, 1) between the two places where the belt's curvature is 1 / (2 R).

    On the grid's values and slopes by Hermite's cubic, so that it follows the parameters smoothly.
    """
    modes = bending(task) * task.base["radius_m"]
    rise = to_grid(modes) - 0.5
    slope = to_grid(1j * np.arange(MODES) * modes) * STEP
    fronts = []
    for way in (1, -1):
        # grid points from the patch's middle on, one way round
        first, last = (
            np.concatenate([x[:, :1], x[:, 1:][:, ::way]], axis=1) for x in (rise, slope)
        )
        inside = np.cumprod(first[:, : GRID // 2] > 0.0, axis=1, dtype=np.int64).sum(axis=1)
        if np.any(inside == 0) or np.any(inside == GRID // 2):
            raise ModelError(
                "the belt is nowhere, or everywhere, bent to half of the road's flatness",
                allowed="a patch that is flat in its middle is allowed",
                do="give another load or stiffness",
            )
        at = np.arange(inside.size), inside - 1
        beyond = at[0], inside
        fronts.append(
            (inside - 1) + _root(first[at], first[beyond], way * last[at], way * last[beyond])
        )
    return np.asarray((fronts[0] + fronts[1])[:, None] * STEP, dtype=np.float64)


def _root(left: FloatArray, right: FloatArray, rise: FloatArray, run: FloatArray) -> FloatArray:
    """Where Hermite's cubic through values of two signs and slopes there is zero, in [0, 1]."""
    bend, twist = 3.0 * (right - left) - 2.0 * rise - run, 2.0 * (left - right) + rise + run
    place = left / (left - right)
    for _ in range(4):
        value = left + place * (rise + place * (bend + place * twist))
        steep = rise + place * (2.0 * bend + 3.0 * place * twist)
        place = np.clip(place - value / np.where(steep == 0.0, np.inf, steep), 0.0, 1.0)
    return np.asarray(place, dtype=np.float64)


def _with_regressors(task: Task, observable: str, width_rad: FloatArray | float) -> FloatArray:
    site = loaded_site(task)[0]
    value = task.base["offset_rad"] + task.base["per_acceleration_rad_s2_m"] * np.nan_to_num(
        task.drive.acceleration_m_s2
    )
    value = value + width_rad
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


#: observable of one number per revolution -> its law: (task, signed lever arm [m]) -> column
LAWS: Mapping[str, Callable[[Task, float], FloatArray]] = {
    "patch_length": patch_length,
    "dissipation_factor": dissipation_factor,
    "phase_shift": phase_shift,
    "patch_width": patch_width,
}
