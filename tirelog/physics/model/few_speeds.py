"""Waveforms of many rows that differ in speed alone, computed at a few speeds.

    Drive of n rows, effects that are on --`few_speeds`--> Drive of k speeds, shares (n, k)
    modes (k, K) --`told_by`--> do they tell what lies between?   rows = shares @ modes

In the speed a waveform is smooth up to the critical one, so a polynomial through the speeds of
Chebyshev's points holds between them: of speeds between 8 and 20 m/s seventeen leave 1e-10 of it.
The polynomial is linear in the waveforms, and so as smooth in the parameters as they are.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import fields

import numpy as np

from tirelog.physics.effects import BY_ID, Drive, Effect
from tirelog.physics.spectral import ComplexArray
from tirelog.vocabulary.arrays import FloatArray

#: numbers of speeds that are tried; the next where one does not tell what lies between, and each
#: for twice as many rows at least; twice as many take twice as long
COUNTS = (17, 33)
#: the last two of a polynomial's terms are below this share of the largest: so far it is off.
#: Twice as much is as far below what a log tells
_OFF = 1e-9


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
    return Drive(**others | {"speed_m_s": there}), _shares(
        (2.0 * speed[:, 0] - low - high) / (high - low), at
    )


def told_by(modes: ComplexArray) -> bool:
    """Do waveforms (k, K) at Chebyshev's points tell those between?  False if one is not known."""
    if modes.shape[0] == 1:
        return True
    k = modes.shape[0]
    weight = np.ones(k)
    weight[[0, -1]] = 0.5
    highest = np.cos(np.pi * np.outer([k - 1, k - 2], np.arange(k)) / (k - 1)) * weight
    last = np.abs(highest @ modes).max() * 2.0 / (k - 1)
    return bool(last <= _OFF * np.abs(modes).max())


def _shares(x: FloatArray, at: FloatArray) -> FloatArray:
    """Weights (n, k) of values at Chebyshev's points `at` (k,) for the polynomial's at x (n,).

    The barycentric formula.
    """
    weight = np.where(np.arange(at.size) % 2 == 0, 1.0, -1.0)
    weight[[0, -1]] *= 0.5
    apart = x[:, None] - at
    exact = np.abs(apart) < 1e-14
    share = weight / np.where(exact, 1.0, apart)
    share /= share.sum(axis=1, keepdims=True)
    hit = exact.any(axis=1)
    share[hit] = exact[hit]
    return np.asarray(share, dtype=np.float64)
