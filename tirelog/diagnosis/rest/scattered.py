"""What is left that does not repeat: its size, whether a load looks like it, what it goes with."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit  # scipy.stats takes a second to import

from tirelog.diagnosis.rest.followed import SIGNED, factors_of, gone_along
from tirelog.inference.base import Base, TogetherBase, apart
from tirelog.inference.scatter import load_derivative
from tirelog.vocabulary.arrays import FloatArray

#: share of what is left that one shape must make up to be said, and rank correlation over
#: manoeuvres of its size with what it is said to follow: so much, and more than chance gives with
#: this probability on either side (a dozen factors are looked at); doubling either says nothing
_ONE_SHAPE = 0.5
_FOLLOWS = 0.5
_FOLLOWS_P = 0.00135


@dataclass(frozen=True)
class Scattered:
    """What does not repeat.

    Its root mean square `size` in the observable's unit, whether it looks like a load that
    changes, and the quantity with which it is large ("" if none), growing with it or falling, and
    what went along with that.
    """

    size: float
    like_load: bool
    follows: str
    grows: bool
    together: tuple[str, ...] = ()


def _scattered_several(base: TogetherBase) -> Scattered:
    """That of the observable that is farthest above its floor, in floors."""
    parts = apart(base, held_by_all=True)
    worst = max(parts, key=lambda part: part.square_held / part.floor.square)
    found = scattered(worst, worst.floor.square)
    return replace(found, size=found.size / float(np.sqrt(worst.floor.square)))


def scattered(base: Base, floor_square: float) -> Scattered:
    """Size and course of what is left beside the floor.

    If only chi-square tells of it, the size is that of cell means.
    """
    if isinstance(base, TogetherBase):
        return _scattered_several(base)
    plain, cells = base.plain, base.cells
    beyond = max(
        base.square_held - floor_square, (base.reduced_chi2 - 1.0) * plain.bias / plain.weight, 0.0
    )
    left = plain(np.nan_to_num(cells.values - base.fit.prediction - base.fit.beside))
    square = (left**2).sum(axis=1)
    load = plain(np.nan_to_num(load_derivative(cells, base.fit)))
    along = (left * load).sum(axis=1) ** 2 / np.maximum((load**2).sum(axis=1), 1e-300)
    like_load = cells.phi.shape[1] > 1 and bool(along.sum() > _ONE_SHAPE * square.sum())
    factors, best, name = factors_of(base), 0.0, ""
    number = np.bincount(cells.manoeuvre)  # cells of a manoeuvre go together: it is what counts
    sizes = [np.log(np.maximum(square / cells.revolutions, 1e-300))]
    if cells.phi.shape[1] == 1:  # what crosses zero is largest at both ends
        sizes.append(left[:, 0])
    ranked = [_ranks(np.bincount(cells.manoeuvre, size) / number) for size in sizes]
    least = max(_FOLLOWS, _least_rank(cells.manoeuvres))
    for factor, values in factors.items():
        mean = np.bincount(cells.manoeuvre, np.abs(values) if factor in SIGNED else values) / number
        if np.ptp(mean) > 0.0:
            for of_size in ranked:
                rank = float(np.corrcoef(of_size, _ranks(mean))[0, 1])
                if abs(rank) > max(abs(best), least):
                    best, name = rank, factor
    together = gone_along(factors, name) if name else ()
    return Scattered(float(np.sqrt(beyond)), like_load, name.split("^")[0], best > 0.0, together)


def _least_rank(manoeuvres: int) -> float:
    """Rank correlation that manoeuvres which follow nothing reach with `_FOLLOWS_P`."""
    if manoeuvres < 3:
        return 1.0
    t = float(stdtrit(manoeuvres - 2, 1.0 - _FOLLOWS_P))
    return float(t / np.sqrt(manoeuvres - 2 + t**2))


def _ranks(x: FloatArray) -> FloatArray:
    return np.unique(x, return_inverse=True)[1].astype(float)
