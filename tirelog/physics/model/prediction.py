"""What a model computes: predictions block by block, and their derivatives.

    Conditions (n,), angles (m,) or (n, m) --blocks of BLOCK revolutions--> `stages.Task`
        --> values (n, m), slopes (p, n, m)

`Model.predict` and its like go over the blocks.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields
from functools import partial

import numpy as np

from tirelog.errors import ModelError
from tirelog.physics.effects import BY_ID, Drive, Effect
from tirelog.physics.model.laws import scalar
from tirelog.physics.model.stages import (
    Task,
    loaded_site,
    waveform,
)
from tirelog.physics.spectral import (
    Angles,
    ComplexArray,
    interpolation_shares,
)
from tirelog.vocabulary.arrays import FloatArray

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
    drive: Drive, effects: Iterable[Effect], count: int
) -> tuple[Drive, FloatArray] | None:
    """(`count` speeds instead of the rows (n,), what each row takes of them (n, count)).

    None if something else differs that the effects may read, or if there are too few rows. What
    none of them reads is not known at these speeds.
    """
    columns = {f.name: getattr(drive, f.name) for f in fields(drive)}
    speed = columns["speed_m_s"]
    if speed.shape[0] < 2 * count or drive.load_N.shape[0] > 1:
        return None
    read = {"inflation_pressure_Pa"}
    for effect in effects:
        # what one of the user's own reads nobody knows, and a strain is added angle by angle
        if BY_ID.get(effect.id) is not effect or effect.strain is not None:
            return None
        read |= {*dict(effect.followed), *effect.needs, *effect.instead.values()}
    if any(columns[name].shape[0] > 1 for name in read - {"speed_m_s"}):
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


def lever_arm(task: Task, surface: str) -> float:
    if surface not in ("outer", "inner"):
        raise ModelError(
            f"unknown surface {surface!r}",
            allowed="allowed are outer, inner",
            do="choose one of them",
        )
    return task.base["lever_arm_m"] if surface == "inner" else -task.base["lever_arm_m"]


#: modes (n or 1, K) and what is added to them at the angles (n or 1, m or 1) of one block; of a
#: number per revolution no modes, and that number
Computed = tuple[ComplexArray | float, FloatArray | float]


def computed(task: Task, observable: str, surface: str, angles: Angles | None) -> Computed:
    """What the sensor reads in one block, as modes and what is added to them."""
    lever = lever_arm(task, surface)
    if angles is None:
        return 0.0, scalar(task, observable, lever)
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
    for a in task.having(hook) if hook else ():
        site, at = loaded_site(task)[0], getattr(a.effect, hook)
        total = total + angles.mean(partial(at, a.values, task.drive, site))
    return total
