"""What each observable of one fit knows, and whether they contradict each other.

    whitened slopes J_i and residual r_i of each observable at the fit to all
        -> information I_i = J_i' J_i, pull g_i = J_i' r_i, all together I and 0
        -> directions in which I is 1: there the observable knows the share s of it, and pulls with
           the variance s (1 - s) if all are right
        -> chi-square of what it wants against what the others want, g^2 / (s (1 - s)) summed over
           the directions that both know (the "parameter goodness of fit" of Maltoni and Schwetz,
           Phys. Rev. D 68 (2003) 033020, in its linear form)
        -> the error of each parameter if the observable were left out

A parameter that one observable alone can see is no matter of agreement. What chance does not
explain may still be too small to matter: a contradiction is said if the observable would be nearer
to its floor by as much as an effect must remove.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.special import chdtrc  # tail of chi-square, without the second of scipy.stats

from tirelog.diagnosis.rules import ALARM_P, LEAST_SHARE_OF_FLOOR
from tirelog.inference.base import Base, JointBase, bases_by_observable
from tirelog.inference.fit.cells import NULL, errors_of
from tirelog.inference.metric import Offsets
from tirelog.vocabulary.arrays import FloatArray

#: a direction of which an observable knows less than this share, or the others do, is no matter of
#: agreement: one of the two is thirty times as far off there.  Doubling it changes nothing seen
_BOTH_KNOW = 1e-3
#: standard errors by which a parameter differs that is named, and how many are at most; with twice
#: as many, contradictions are told without the parameter that makes them
_NAMED_SIGMAS = 3.0
_NAMED = 3


@dataclass(frozen=True)
class Tension:
    """A parameter as an observable wants it alone, and as the others want it without it."""

    parameter: str
    alone: float
    alone_se: float
    others: float
    others_se: float

    @property
    def sigmas(self) -> float:
        return abs(self.alone - self.others) / float(np.hypot(self.alone_se, self.others_se))


@dataclass(frozen=True)
class Contribution:
    """What one observable brings to a fit of several.

    error_without  standard error of each free parameter if it were left out; inf: not determined
    chi2, freedom, p  of what it wants of the parameters against what the others want
    size           squared floors by which it would be nearer to its floor alone
    pulls          the parameters that differ most, if it contradicts the others
    """

    observable: str
    error_without: Mapping[str, float]
    chi2: float
    freedom: int
    p: float
    size: float
    pulls: tuple[Tension, ...] = ()

    @property
    def contradicts(self) -> bool:
        """More than chance does, and enough to matter."""
        return self.p <= ALARM_P and self.size > LEAST_SHARE_OF_FLOOR

    def to_json(self) -> dict[str, Any]:
        pulls = [
            {name: getattr(pull, name) for name in (*Tension.__dataclass_fields__, "sigmas")}
            for pull in self.pulls
        ]
        names = ("error_without", "chi2", "freedom", "p", "size", "contradicts")
        return {name: getattr(self, name) for name in names} | {"pulls": pulls}


def contributions(base: JointBase) -> tuple[Contribution, ...]:
    """What each observable of the base brings."""
    cells, fit = base.cells, base.fit
    offsets = Offsets.of(cells, base.white)
    slopes = offsets.without(base.white(fit.moving))
    residual = offsets.without(
        base.white(np.where(np.isfinite(cells.values), cells.values - fit.prediction, 0.0))
    )
    scale = max(1.0, fit.reduced_chi2)
    p = slopes.shape[-1]
    norm = np.linalg.norm(slopes.reshape(-1, p), axis=0)
    size = np.where(norm > 0.0, norm, np.inf)
    parts, found = bases_by_observable(base), []
    known = [np.flatnonzero(cells.part == i) for i in range(len(parts))]
    flat = [slopes[rows].reshape(-1, p) / size for rows in known]
    pull = [x.T @ residual[rows].ravel() for x, rows in zip(flat, known, strict=True)]
    information = [x.T @ x for x in flat]
    root = _root(np.sum(information, axis=0))
    for i, part in enumerate(parts):
        share, turn = np.linalg.eigh(root.T @ information[i] @ root)
        both = (share > _BOTH_KNOW) & (share < 1.0 - _BOTH_KNOW)
        along = turn[:, both].T @ (root.T @ pull[i])
        s = share[both]
        chi2 = float((along**2 / (s * (1.0 - s))).sum()) / scale
        freedom = int(both.sum())
        step = root @ (turn[:, both] @ (along / s)) / size
        others = np.concatenate([x for k, x in enumerate(flat) if k != i]) * np.where(
            norm > 0.0, norm, 0.0
        )
        without = errors_of(others, scale).se
        tail = float(chdtrc(freedom, chi2)) if freedom else 1.0
        one = Contribution(
            part.cells.label,
            dict(zip(fit.names, without.tolist(), strict=True)),
            chi2,
            freedom,
            tail,
            _size(part, step),
        )
        if one.contradicts:
            back = root @ (turn[:, both] @ (-along / (1.0 - s))) / size
            alone = errors_of(flat[i] * np.where(norm > 0.0, norm, 0.0), scale).se
            one = replace(one, pulls=_pulls(base, step, alone, back, without))
        found.append(one)
    return tuple(found)


def _root(information: FloatArray) -> FloatArray:
    """Columns (p, r) in which the information of all is one; what nothing shows is left out."""
    values, vectors = np.linalg.eigh(information)
    good = values > NULL * max(float(values[-1]), 1e-300)
    return np.asarray(vectors[:, good] / np.sqrt(values[good]), dtype=np.float64)


def _size(part: Base, step: FloatArray) -> float:
    """Squared floors by which the observable's error falls if the parameters move by a step."""
    left = part.cells.values - part.fit.prediction - part.fit.beside
    moved = left - np.nan_to_num(part.fit.moving) @ step
    before, after = (float((part.plain(np.nan_to_num(x)) ** 2).sum()) for x in (left, moved))
    return (before - after) / part.plain.weight / part.floor.square


def _pulls(
    base: JointBase, step: FloatArray, alone: FloatArray, back: FloatArray, others: FloatArray
) -> tuple[Tension, ...]:
    """The parameters that differ most, of those that both sides know."""
    pulls = [
        Tension(
            name, value + float(step[k]), float(alone[k]), value + float(back[k]), float(others[k])
        )
        for k, name in enumerate(base.fit.names)
        if np.isfinite([alone[k], others[k]]).all()
        for value in (base.model.values[name],)
    ]
    named = [pull for pull in pulls if pull.sigmas >= _NAMED_SIGMAS]
    return tuple(sorted(named, key=lambda pull: -pull.sigmas)[:_NAMED])


def agreement_sentence(
    found: tuple[Contribution, ...], units: Mapping[str, str], word: str = "observable"
) -> str:
    """Whether the observables agree, in words; `units` of the parameters, `word` for one."""
    wrong = [one for one in found if one.contradicts]
    if not wrong:
        sharing = [one for one in found if one.freedom]
        if not sharing:
            return f"No parameter is known by more than one {word}: nothing can contradict."
        told = ", ".join(
            f"{one.observable} against the others {one.chi2:.3g} of {one.freedom}"
            for one in sharing
        )
        small = (
            "; what chance does not explain of it is too small to matter"
            if any(one.p <= ALARM_P for one in found)
            else ""
        )
        alone = [one.observable for one in found if not one.freedom]
        own = f" {' and '.join(alone)} shares no parameter that it can tell." if alone else ""
        return f"The {word}s agree on what they share (chi-square of {told}{small}).{own}"
    said, many = [], len(wrong)
    if word == "grating" and many > 1:  # a wheel's force variation makes all differ
        wrong = [max(wrong, key=lambda one: one.size)]
        said = [f"{many} of {len(found)} gratings differ from the others"]
    for one in wrong:
        pulls = "; ".join(
            f"{pull.parameter} {pull.alone:.4g} ± {pull.alone_se:.2g} alone, {pull.others:.4g} ± "
            f"{pull.others_se:.2g} by the others"
            + (f" [{unit}]" if (unit := units.get(pull.parameter, "1")) != "1" else "")
            for pull in one.pulls
        )
        said.append(
            f"{one.observable} contradicts the others (chi-square {one.chi2:.3g} of "
            f"{one.freedom}){': ' if pulls else ''}{pulls}"
        )
    if word == "grating":
        return (
            f"{'. '.join(said)}. It may be the wheel's force variation, something missing, or the "
            "grating: diagnose tells them apart."
        )
    return (
        f"{'. '.join(said)}. Each alone would fit better: something is missing that is not the "
        "same in all, or a channel's scale or place is wrong."
    )
