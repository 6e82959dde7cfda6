"""The laws of what has one number per revolution, from the stages of a prediction.

Patch length and dissipation factor (P1, P2), and P4's phase shift and patch width.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace

import numpy as np

from tirelog.physics.effects.base import Drive
from tirelog.physics.model.stages import (
    Task,
    bending,
    distinct,
    leans,
    loaded_site,
    of_rows,
    waveform,
)
from tirelog.physics.spectral import GRID, MODES, STEP, powers, to_grid
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: from where to where beyond a front the level beside the patch is taken, as of a measured passage
#: (`wheel.fronts`); twice the first or half the second move the front by half a degree
BESIDE_RAD = (np.radians(25.0), np.radians(130.0))


def scalar(task: Task, observable: str, lever_m: float) -> FloatArray:
    """The observable as a column (n or 1, 1) in its SI unit."""
    return LAWS[observable](task, lever_m)


def patch_length(task: Task, lever_m: float) -> FloatArray:
    """2 L [m], after the effects on the load."""
    return 2.0 * loaded_site(task)[0].half_length_m


def phase_shift(task: Task, lever_m: float) -> FloatArray:
    """The level, what follows the force, and the regressors [rad] (P4 III, IV).

    Of a ring whose contact or answer leans to one side also the middle of the fronts, against the
    one in the log's zero stretch: the angle is read from them, and not from the belt's lowest
    point.
    """
    if task.carcass != "ring" or not leans(task):
        return _with_regressors(task, "phase_shift", 0.0)
    zero, rows = _at_zero(task)
    moved = _middle_of_fronts(task) - _middle_of_fronts(zero)[rows]
    return _with_regressors(task, "phase_shift", moved)


def patch_width(task: Task, lever_m: float) -> FloatArray:
    """The angle [rad] between the fronts beside what the phase shift has (P4).

    Of a ring the fronts are where an accelerometer reads half of its level beside the patch, under
    the model's own load; with other loads they move as the steepest places of the reading do, as
    those that are measured. A beam does not lie flat: of it the angle is the contact's length.
    """
    if task.carcass == "ring":
        usual = _under_own_load(task)
        between = _between_half_levels(usual) - _between_steepest(usual) + _between_steepest(task)
        return _with_regressors(task, "patch_width", between)
    site = loaded_site(task)[0]
    return _with_regressors(task, "patch_width", 2.0 * site.half_length_m / site.radius_m)


def _under_own_load(task: Task) -> Task:
    """The task under the model's load, whatever is measured and what effects do to it."""
    unknown = replace(task.drive, load_N=np.full((1, 1), np.nan))
    loading = task.having("load", "added_load")
    active = [a for a in task.active if a not in loading]
    near = None if task.near is None else _under_own_load(task.near)
    return replace(task, drive=unknown, active=active, memo={}, near=near)


def _between_half_levels(task: Task) -> FloatArray:
    """Angle (n or 1, 1) between the places where the reading is half of its level beside the patch.

    The reading is 1 - R times what the belt is less curved by than a circle, over its size on a
    circle; the level is the mean from BESIDE_RAD on behind the steepest places, as it is measured.
    """
    reading = 1.0 - task.base["radius_m"] * to_grid(bending(task))
    angle = STEP * np.arange(GRID // 2)
    widths = []
    for row, steepest in zip(reading, _between_steepest(task)[:, 0], strict=True):
        sides = np.stack([row[: GRID // 2], np.roll(row[::-1], 1)[: GRID // 2]])
        near, far = (0.5 * steepest + edge for edge in BESIDE_RAD)
        half = 0.5 * sides[:, (angle > near) & (angle < far)].mean()
        after = np.maximum(np.argmax(sides > half, axis=1), 1)
        outside, inside = (sides[[0, 1], after - k] for k in (0, 1))
        widths.append(float(np.sum(after - (outside - half) / (outside - inside))) * STEP)
    return np.array(widths)[:, None]


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


def _at_zero(task: Task) -> tuple[Task, IntArray]:
    """The task under the conditions of a zero stretch, each once, and whose they are (n,).

    Rolling freely at the start of the log, at a low speed.
    """

    def found() -> tuple[Drive, IntArray]:
        drive, one = task.drive, np.ones((1, 1))
        # speed [m/s] of the stretch in which a phase shift is zero, by convention (P4: about 10).
        # Twice as much moves the level of all by what damping does at 10 m/s, which the free level
        # takes
        still = replace(
            drive,
            speed_m_s=10.0 * one,
            acceleration_m_s2=0.0 * one,
            slip=np.where(np.isfinite(drive.slip[:1]), 0.0, np.nan),
            time_s=drive.time_s[:1],
        )
        names = [f.name for f in fields(still)]
        columns = np.hstack(
            np.broadcast_arrays(*(getattr(still, name) for name in names), drive.speed_m_s)[:-1]
        )
        _, first, rows = np.unique(
            np.nan_to_num(columns, nan=-np.inf), axis=0, return_index=True, return_inverse=True
        )
        few = Drive(**{name: columns[first, i : i + 1] for i, name in enumerate(names)})
        return few, rows.ravel()

    drive, rows = task.once("zero stretch", (), found)
    return task.under("zero stretch", (), drive), rows


def _middle_of_fronts(task: Task) -> FloatArray:
    """Angle (n, 1) midway between the places where an accelerometer reads half of its level.

    Of a beam there is none: it does not lie flat in its patch.
    """
    few, of_few = distinct(task)
    modes, half = bending(few), 0.5 / task.base["radius_m"]
    wave = to_grid(modes)
    rows, middle = np.arange(wave.shape[0]), np.zeros((wave.shape[0], 1))
    for way in (1, -1):
        # grid points from the patch's middle on, one way round; the belt's curvature comes back
        along = np.concatenate([wave[:, :1], wave[:, 1:][:, ::way]], axis=1)[:, : GRID // 2]
        at = np.maximum(np.argmax(along < half, axis=1), 1)
        before, after = along[rows, at - 1], along[rows, at]
        fall = np.where(after < before, before - after, np.inf)
        angle = way * STEP * (at - 1 + (before - half) / fall)[:, None]
        turn = modes * powers(angle)  # one step of Newton's from between the grid's points
        level = 2.0 * turn.sum(axis=1, keepdims=True).real - modes[:, :1].real
        slope = -2.0 * (turn.imag * np.arange(MODES)).sum(axis=1, keepdims=True)
        middle = middle + 0.5 * (angle - (level - half) / np.where(slope == 0.0, np.inf, slope))
    middle = of_rows(middle, of_few)
    size = max(task.drive.speed_m_s.shape[0], middle.shape[0])
    return np.asarray(np.broadcast_to(middle, (size, 1)), dtype=np.float64)


def _with_regressors(task: Task, observable: str, width_rad: FloatArray | float) -> FloatArray:
    value = task.base["offset_rad"] + task.base["per_acceleration_rad_s2_m"] * np.nan_to_num(
        task.drive.acceleration_m_s2
    )
    regressors = task.hooks(lambda effect: effect.regressor).values()
    return sum((own(loaded_site(task)[0], observable) for own in regressors), value + width_rad)


def dissipation_factor(task: Task, lever_m: float) -> FloatArray:
    """int eps'^2 ds over one revolution [1/m] (P1 (27)), from the modes by Parseval."""
    modes, _ = waveform(task, "strain", lever_m)
    R = task.base["radius_m"]
    slopes = (np.arange(MODES) / R) ** 2 * (modes.real**2 + modes.imag**2)
    return np.asarray(4.0 * np.pi * R * slopes.sum(axis=1, keepdims=True))


#: observable of one number per revolution -> its law: (task, signed lever arm [m]) -> column
LAWS: Mapping[str, Callable[[Task, float], FloatArray]] = {
    "patch_length": patch_length,
    "dissipation_factor": dissipation_factor,
    "phase_shift": phase_shift,
    "patch_width": patch_width,
}
