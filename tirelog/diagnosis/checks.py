"""What a fitted model never does, and which conditions are suspects before physics.

Base -> whitened residual -> five numbers, beside those of noise as the floor has it, fitted
        alike -> what the model never does
     -> a load, a radius or a pressure wrong in one log -> how much of the excess that would
        remove
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from tirelog.diagnosis.candidates.assessment import gain_and_error
from tirelog.diagnosis.rules import GAIN_SIGMAS, LEAST_SHARE_OF_FLOOR
from tirelog.inference.base import Base, JointBase, bases_by_observable
from tirelog.inference.floor import held_out_losses_with
from tirelog.inference.metric import Offsets, ProjectedOut, solve_scaled
from tirelog.inference.nuisances import condition_slopes
from tirelog.vocabulary.arrays import FloatArray

#: residuals that are drawn, and the standard deviations about their mean that make the range: one
#: of the five leaves it by chance in a log in two hundred; twice as many tell the ranges to 3.5
#: instead of 5 %, in twice the time; with a range twice as wide only what is twice as far off
#: fails
_DRAWN = 200
_WITHIN = 3.3
#: a direction shrunk by so much is free, and no residual has a part in it
_FREE = 0.99
#: a suspect is said from this share of the excess on, that it would remove; twice as much names
#: only what removes more than half of it
_SUSPECT = 0.3


@dataclass(frozen=True)
class Check:
    """A number of the residual beside the range in which noise alone leaves it."""

    name: str
    measured: float
    low: float
    high: float

    @property
    def never(self) -> bool:
        """The model and its floor never leave this."""
        return not self.low <= self.measured <= self.high


def posterior_checks(base: Base, seed: int = 0) -> tuple[Check, ...]:
    """Largest cell, lag one over angles and cells, kurtosis and drift of the whitened residual.

    The ranges are those of residuals drawn from noise and scatter as the floor has them, with base
    parameters, offsets and nuisances taken out as they are of what was measured.
    """
    if isinstance(base, JointBase):
        return tuple(
            replace(check, name=f"{check.name} of {part.cells.label}")
            for part in bases_by_observable(base)
            for check in posterior_checks(part, seed)
        )
    if base.cells.phi.shape[1] == 1:
        return ()  # one number per revolution has no shape
    cells, white = base.cells, base.noise
    other = ProjectedOut.of(Offsets.of(cells, white), white(base.fit.moving))
    measured = other.without(white(np.nan_to_num(cells.values - base.fit.prediction)))
    random, used = np.random.default_rng(seed), white.inverse_sd > 0.0
    statistics = _statistics(base, used)
    drawn = np.empty((_DRAWN, len(statistics)))
    for row in drawn:
        noise = random.standard_normal(measured.shape) * used
        along = np.swapaxes(white.basis, 1, 2) @ noise[..., None]
        free = (white.shrink > _FREE)[..., None]
        noise = other.without(noise - (white.basis @ (free * along))[..., 0])
        row[:] = [statistic(noise) for statistic in statistics.values()]
    mean, spread = drawn.mean(axis=0), drawn.std(axis=0, ddof=1)
    low, high = mean - _WITHIN * spread, mean + _WITHIN * spread
    return tuple(
        Check(name, statistic(measured), float(a), float(b))
        for (name, statistic), a, b in zip(statistics.items(), low, high, strict=True)
    )


def _statistics(base: Base, used: NDArray[np.bool_]) -> dict[str, Callable[[FloatArray], float]]:
    """The five numbers, of a whitened residual (C, m)."""
    cells = base.cells
    count = np.maximum(used.sum(axis=1), 1)
    order = np.lexsort((cells.conditions.time_s, cells.manoeuvre))
    beside = np.flatnonzero(np.diff(cells.manoeuvre[order]) == 0)
    before, after = order[beside], order[beside + 1]
    time = np.zeros(len(cells))
    for log in np.unique(cells.log):
        rows = cells.log == log
        own = cells.conditions.time_s[rows]
        time[rows] = own - own.mean() if np.isfinite(own).all() else 0.0
    time /= max(float(np.sqrt((time**2).sum())), 1e-300)

    def square(r: FloatArray) -> float:
        return max(float((r**2).sum()), 1e-300)

    return {
        "largest cell": lambda r: float(((r**2).sum(axis=1) / count).max()),
        "lag one over angles": lambda r: float((r[:, 1:] * r[:, :-1]).sum()) / square(r),
        "lag one over cells": lambda r: float((r[before] * r[after]).sum()) / square(r),
        "kurtosis": lambda r: float(np.square(r**2).sum()) * float(used.sum()) / square(r) ** 2,
        "drift": lambda r: float(time @ (r.sum(axis=1) / np.sqrt(count))),
    }


def check_sentences(checks: tuple[Check, ...]) -> list[str]:
    """What the model and its floor never do, in one sentence; none if there is nothing."""
    said = [
        f"{c.name} {c.measured:.3g} (model: {c.low:.3g} to {c.high:.3g})" for c in checks if c.never
    ]
    return [f"What this model never does: {'; '.join(said)}."] if said else []


@dataclass(frozen=True)
class Suspect:
    """A condition that would remove a `share` of the excess if it were `change` higher in a log."""

    condition: str
    log: int
    change: float
    share: float

    @property
    def said(self) -> str:
        return (
            f"a {self.condition} {100.0 * abs(self.change):.2g} % "
            f"{'higher' if self.change > 0.0 else 'lower'} in log {self.log + 1} than its setup "
            f"says would remove {100.0 * self.share:.0f} % of the excess"
        )


def suspects(base: Base) -> tuple[Suspect, ...]:
    """Load, rolling radius and pressure of one log each that would explain much, the best first.

    Of one log alone none: what a level does there is what the model's parameters do.
    """
    if isinstance(base, JointBase):
        each = [suspect for part in bases_by_observable(base) for suspect in suspects(part)]
        return tuple(sorted(each, key=lambda s: -s.share))
    cells, logs = base.cells, np.unique(base.cells.log)
    if base.excess <= LEAST_SHARE_OF_FLOOR * base.floor.square or logs.size < 2:
        return ()
    other = ProjectedOut.of(Offsets.of(cells, base.white), base.white(base.fit.moving))
    residual = other.without(base.white(np.nan_to_num(cells.values - base.fit.prediction)))
    found = []
    columns = {
        (condition, int(log)): (slope * (cells.log == log)[:, None])[..., None]
        for condition, slope in condition_slopes(cells, base.fit).items()
        for log in logs
    }
    losses = held_out_losses_with(
        cells, base.white, base.plain, base.fit, [[column] for column in columns.values()]
    )
    for ((condition, log), column), (white, plain) in zip(columns.items(), losses, strict=True):
        gain, error = gain_and_error(base.held_white, white)
        share = float((base.held_plain - plain).sum()) / base.plain.weight / base.excess
        if gain <= GAIN_SIGMAS * error or share < _SUSPECT:
            continue
        left = other.without(base.white(column)).reshape(-1, 1)
        change = solve_scaled(left.T @ left, left.T @ residual.ravel())[0]
        found.append(Suspect(condition, log, float(change), min(share, 1.0)))
    return tuple(sorted(found, key=lambda s: -s.share))
