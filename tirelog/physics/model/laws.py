"""What is read from a prediction's stages: waveforms, and what has one number per revolution.

    Conditions (n,), angles (m,) or (n, m) --blocks of BLOCK revolutions--> `stages.Task`
        --> values (n, m), slopes (p, n, m)

`Model.predict` and its like go over the blocks. Numbers per revolution are patch length and
dissipation factor (P1, P2), and P4's phase shift and patch width.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, replace
from functools import partial

import numpy as np

from tirelog.errors import ModelError
from tirelog.physics.effects import Drive, Effect, conditions_read
from tirelog.physics.model.stages import (
    Task,
    bending,
    distinct,
    leans,
    loaded_site,
    of_rows,
    waveform,
)
from tirelog.physics.spectral import (
    GRID,
    MODES,
    STEP,
    Angles,
    ComplexArray,
    interpolation_shares,
    powers,
    to_grid,
)
from tirelog.vocabulary.arrays import FloatArray, IntArray


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
        between = between_half_levels(usual) - _between_steepest(usual) + _between_steepest(task)
        return _with_regressors(task, "patch_width", between)
    site = loaded_site(task)[0]
    return _with_regressors(task, "patch_width", 2.0 * site.half_length_m / site.radius_m)


def _under_own_load(task: Task) -> Task:
    """The task under the model's load, whatever is measured and what effects do to it."""
    unknown = replace(task.drive, load_N=np.full((1, 1), np.nan))
    loading = task.having("load", "added_load")
    active = [entry for entry in task.active if entry not in loading]
    near = None if task.near is None else _under_own_load(task.near)
    return replace(task, drive=unknown, active=active, memo={}, near=near)


def between_half_levels(task: Task) -> FloatArray:
    """Angle (n or 1, 1) between the places where the reading is half of its level beside the patch.

    The reading is 1 - R times what the belt is less curved by than a circle, over its size on a
    circle; the level is the mean of 25 to 130 degrees behind the steepest places.
    """
    reading = 1.0 - task.base["radius_m"] * to_grid(bending(task))
    ahead, behind = (side[:, : GRID // 2] for side in _ways(reading))
    angle = STEP * np.arange(GRID // 2)
    # as of a measured passage (`wheel.fronts`); twice the first or half the second angle moves the
    # front by half a degree
    near, far = (0.5 * _between_steepest(task) + np.radians(edge) for edge in (25.0, 130.0))
    beside = (angle > near) & (angle < far)
    count = beside.sum(axis=1, keepdims=True)
    half = 0.5 * ((ahead + behind) * beside).sum(axis=1, keepdims=True) / (2.0 * count)
    return (_crossing(half - ahead) + _crossing(half - behind)) * STEP


def _ways(wave: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A wave on the grid (n, GRID) from the patch's middle on, one way round and the other."""
    return wave, np.concatenate([wave[:, :1], wave[:, :0:-1]], axis=1)


def _crossing(above: FloatArray) -> FloatArray:
    """Place (n, 1), in points, at which rows (n, m) first fall below zero, by a straight line."""
    rows = np.arange(above.shape[0])
    at = np.maximum(np.argmax(above < 0.0, axis=1), 1)
    before, after = above[rows, at - 1], above[rows, at]
    fall = np.where(after < before, before - after, np.inf)
    return np.asarray((at - 1 + before / fall)[:, None])


def _between_steepest(task: Task) -> FloatArray:
    """Angle (n or 1, 1) between the places where the belt's curvature changes most on either side.

    By the parabola through three of the grid's slopes.
    """
    slope = to_grid(1j * np.arange(MODES) * bending(task))
    rows, between = np.arange(slope.shape[0]), np.zeros(slope.shape[0])
    ahead, behind = _ways(slope)
    for fall in (-ahead, behind):  # the belt's curvature falls
        at = np.clip(np.argmax(fall[:, : GRID // 2], axis=1), 1, GRID // 2)
        before, here, after = (fall[rows, at + k] for k in (-1, 0, 1))
        bend = before - 2.0 * here + after
        between += at + 0.5 * (before - after) / np.where(bend < 0.0, bend, -np.inf)
    return np.asarray(between[:, None] * STEP, dtype=np.float64)


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
        return still.distinct([f.name for f in fields(still)])

    drive, rows = task.once("zero stretch", (), found)
    return task.under("zero stretch", (), drive), rows


def _middle_of_fronts(task: Task) -> FloatArray:
    """Angle (n, 1) midway between the places where an accelerometer reads half of its level.

    Of a beam there is none: it does not lie flat in its patch.
    """
    few, of_few = distinct(task)
    modes, half = bending(few), 0.5 / task.base["radius_m"]
    wave = to_grid(modes)
    middle = np.zeros((wave.shape[0], 1))
    for way, along in zip((1, -1), _ways(wave)):
        # the belt's curvature comes back
        angle = way * STEP * _crossing(along[:, : GRID // 2] - half)
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


# ---- Waveforms of many rows that differ in speed alone, computed at a few speeds.
#
#     Drive of n rows, effects that are on --`few_speeds`--> Drive of k speeds, shares (n, k)
#     modes (k, K) --`told_by`--> do they tell what lies between?   rows = shares @ modes
#
# In the speed a waveform is smooth up to the critical one, so a polynomial through the speeds of
# Chebyshev's points holds between them: of speeds between 8 and 20 m/s seventeen leave 1e-10 of it.
# The polynomial is linear in the waveforms, and so as smooth in the parameters as they are.


#: numbers of speeds that are tried; the next where one does not tell what lies between, and each
#: for twice as many rows at least; twice as many take twice as long
COUNTS = (17, 33)


def few_speeds(
    drive: Drive, effects: Sequence[Effect], count: int
) -> tuple[Drive, FloatArray] | None:
    """(`count` speeds instead of the rows (n,), what each row takes of them (n, count)).

    None if something else differs that the effects may read, or if there are too few rows. What
    none of them reads is not known at these speeds.
    """
    columns = {f.name: getattr(drive, f.name) for f in fields(drive)}
    speed, read = columns["speed_m_s"], conditions_read(effects)
    if speed.shape[0] < 2 * count or drive.load_N.shape[0] > 1:
        return None
    # a strain is added angle by angle
    if read is None or any(effect.strain is not None for effect in effects):
        return None
    read = (read | {"inflation_pressure_Pa"}) - {"speed_m_s"}
    if any(columns[name].shape[0] > 1 for name in read):
        return None
    low, high = float(speed.min()), float(speed.max())
    at = np.cos(np.pi * np.arange(count) / (count - 1))
    others = {
        name: x if x.shape[0] == 1 else np.full((1, 1), np.nan) for name, x in columns.items()
    }
    there = np.asarray(0.5 * (low + high) + 0.5 * (high - low) * at[:, None], dtype=np.float64)
    there[0], there[-1] = high, low  # to the last bit: the highest speed may be refused
    weights = np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
    weights[[0, -1]] *= 0.5
    shares = interpolation_shares(there[:, 0], weights, speed[:, 0])
    return Drive(**others | {"speed_m_s": there}), shares


def told_by(modes: ComplexArray) -> bool:
    """Do waveforms (k, K) at Chebyshev's points tell those between?  False if one is not known."""
    if modes.shape[0] == 1:
        return True
    k = modes.shape[0]
    weight = np.ones(k)
    weight[[0, -1]] = 0.5
    highest = np.cos(np.pi * np.outer([k - 1, k - 2], np.arange(k)) / (k - 1)) * weight
    last = np.abs(highest @ modes).max() * 2.0 / (k - 1)
    # the last two of a polynomial's terms are below this share of the largest: so far it is off.
    # Twice as much is as far below what a log tells
    return bool(last <= 1e-9 * np.abs(modes).max())


#: Observable -> the hook that adds to it at the angles themselves.
_AT_ANGLES = {"strain": "strain", "radial_acceleration": "acceleration"}


#: a grating's lever arm over the model's, of a model as one of several gratings sees it
LEVER_RATIO = "lever_ratio"


def lever_arm(task: Task, surface: str) -> float:
    """The signed lever arm [m] of a grating on a surface."""
    if surface not in ("outer", "inner"):
        raise ModelError(
            f"unknown surface {surface!r}",
            allowed="allowed are outer, inner",
            do="choose one of them",
        )
    lever = task.base["lever_arm_m"] * task.base.get(LEVER_RATIO, 1.0)
    return lever if surface == "inner" else -lever


#: modes (n or 1, K) and what is added to them at the angles (n or 1, m or 1) of one block; of a
#: number per revolution no modes, and that number
Computed = tuple[ComplexArray | float, FloatArray | float]


def computed(task: Task, observable: str, surface: str, angles: Angles | None) -> Computed:
    """What the sensor reads in one block, as modes and what is added to them."""
    lever = lever_arm(task, surface)
    if angles is None:
        return 0.0, LAWS[observable](task, lever)
    modes, level = waveform(task, observable, lever)
    return modes, level + _added(task, observable, angles)


def evaluated(
    computed: Computed, angles: Angles | None, shares: FloatArray | None = None
) -> FloatArray | float:
    """What is computed, at the angles; `shares` (n, k): rows are so much of what the task has."""
    modes, level = computed
    if angles is None:
        return level
    if shares is not None and np.ndim(level) and np.shape(level)[0] > 1:
        level = shares @ level
    return angles.evaluate(np.asarray(modes), shares) + level


def _added(task: Task, observable: str, angles: Angles) -> FloatArray | float:
    """What effects add at the angles themselves, in the mean over the samples of each bin.

    These are a user's own, `acts_on = "strain"` or "radial_acceleration".
    """
    total: FloatArray | float = 0.0
    hook = _AT_ANGLES.get(observable, "")
    for effect, values in task.having(hook) if hook else ():
        site, at = loaded_site(task)[0], getattr(effect, hook)
        total = total + angles.mean(partial(at, values, task.drive, site))
    return total
