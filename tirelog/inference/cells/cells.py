"""Cells: the pieces of all logs with their noise and scatter.

Every later step works on them.

    Pieces (P, m) of all logs -> noise by angle, covariance of the coefficients, both pooled
        -> Cells (C, m), C = P

The coefficients removed from single revolutions come back as random effects of the cell's mean.
Their covariance is that over revolutions, with the correlation of neighbours, divided by the number
of revolutions. The shift comes back as a free nuisance. Amplitude and width are relative: a load
that scatters moves both.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.special import digamma, polygamma

from tirelog.data.recording import Conditions
from tirelog.inference.cells.pieces import (
    ROW,
    Means,
    Pieces,
    binned,
    without_line,
)
from tirelog.physics.effects import Effect
from tirelog.physics.model.laws import LEVER_RATIO
from tirelog.physics.model.model import Model
from tirelog.physics.spectral import Angles, Parameter
from tirelog.vocabulary.arrays import FloatArray, IntArray
from tirelog.vocabulary.observables import STRAIN, together

# ---- Random effects that all manoeuvres share: what wheel, road and weather do beside the tire.
#
# Their columns say what one unit of each amplitude does to every cell, their standard deviations
# how
# large an amplitude is before anything is measured. An amplitude is never subtracted first: it is
# found with the model's parameters, whenever those are.


@dataclass(frozen=True)
class SharedEffects:
    """K random effects on C cells x m angles.

    columns  (C, m, K) in the observable's unit per unit of each amplitude
    sd       (K,) standard deviation of each amplitude, in that unit
    names    (K,) of the amplitudes; group (K,) of which nuisance each is a part
    """

    columns: FloatArray
    sd: FloatArray
    names: tuple[str, ...]
    group: tuple[str, ...]

    @classmethod
    def joined(cls, parts: Iterable[SharedEffects | None]) -> SharedEffects | None:
        """All effects of the parts, which are on the same cells; None if no part has any."""
        known = [part for part in parts if part is not None]
        if not known:
            return None
        return cls(
            np.concatenate([part.columns for part in known], axis=-1),
            np.concatenate([part.sd for part in known]),
            tuple(name for part in known for name in part.names),
            tuple(name for part in known for name in part.group),
        )

    @property
    def groups(self) -> tuple[str, ...]:
        """The nuisances that these effects make up, each once."""
        return tuple(dict.fromkeys(self.group))

    @property
    def plain_names(self) -> tuple[str, ...]:
        """The names without whose they are: of several observables each has its own."""
        return tuple(name.rpartition(": ")[2] for name in self.names)

    def of_groups(self, groups: Sequence[str]) -> SharedEffects:
        """The effects of some nuisances alone."""
        return self.of([i for i, group in enumerate(self.group) if group in groups])

    def of(self, kept: Sequence[int]) -> SharedEffects:
        """Some of the effects, by their numbers."""
        return SharedEffects(
            self.columns[..., kept],
            self.sd[kept],
            tuple(self.names[i] for i in kept),
            tuple(self.group[i] for i in kept),
        )

    def take(self, rows: NDArray[Any]) -> SharedEffects:
        """The effects on some of the cells."""
        return replace(self, columns=self.columns[rows])

    def __len__(self) -> int:
        return len(self.names)


# ---- How well means of numbers per revolution are known: their scatter, how alike neighbours are.


#: degrees of freedom that all pieces together stand for beside one, at most: then they are alike to
#: a tenth; twice as many, to 7 %
_MOST_PRIOR = 200.0
#: neighbours that numbers are alike with, seen in pieces of so many revolutions; twice as many of
#: the first tell a road that wanders over more turns, and of others noise
NEIGHBOURS, LONG = 2, 20


def scatter_of_numbers(pieces: Pieces, alike: float = 1.0) -> FloatArray:
    """With one angle only: standard deviation of single revolutions (P, 1).

    A piece's own, drawn towards that of all pieces as far as its few revolutions leave it unknown:
    the mean of a scaled inverse chi-square whose spread over the pieces tells how much they differ
    (Smyth, Stat. Appl. Genet. Mol. Biol. 3 (2004) 3). By itself a scatter of four revolutions makes
    a chi-square of three out of nothing. About their own line neighbours that are `alike` scatter
    by less than about the one of all.
    """
    number = pieces.count[:, 0].astype(np.float64)
    own = pieces.scatter[:, 0] / np.sqrt([_about_a_line(int(n), alike) for n in number])
    # squares are alike over fewer neighbours than values: of a Markov chain, so many times fewer
    freedom = np.maximum(2.0 * alike / (alike**2 + 1.0) * number - 2.0, 1.0)
    known = np.isfinite(own)
    usual = float(np.median(own[known])) if known.any() else np.nan
    if not usual > 0.0:
        return np.full(pieces.scatter.shape, usual)
    # a piece's scatter below this share of the usual one is taken as that for what all pieces say:
    # values may be alike by rounding; half as much lets one such piece count for the more
    size = np.maximum(own[known], 0.1 * usual)
    half = 0.5 * freedom[known]
    log = 2.0 * np.log(size) - digamma(half) + np.log(half)
    differ = float(np.sum((log - log.mean()) ** 2) / max(log.size - 1, 1))
    differ -= float(polygamma(1, half).mean())
    prior = _MOST_PRIOR
    if differ > 0.0:  # trigamma falls: the least number of degrees of freedom that differs so much
        tried = np.geomspace(0.1, _MOST_PRIOR, 400)
        prior = float(tried[np.argmin(np.abs(polygamma(1, 0.5 * tried) - differ))])
    # the mean of logarithms, which the few pieces in which the number moves do not decide
    weight = 1.0 / (polygamma(1, half) + max(differ, 0.0))
    of_all = np.exp(np.average(log, weights=weight) + digamma(0.5 * prior) - np.log(0.5 * prior))
    told = np.where(known, freedom, 0.0)
    square = (prior * of_all + told * np.where(known, own, 0.0) ** 2) / (prior + told)
    return np.asarray(np.sqrt(square), dtype=np.float64)[:, None]


@lru_cache(maxsize=4096)
def _about_a_line(number: int, alike: float) -> float:
    """Mean square of so many numbers about their own line over that about the line of all.

    The trace of what the line leaves of their correlation: of the next neighbour, and if that were
    more than a half of the one after it too.
    """
    if number < 4:
        return 1.0
    beyond = 0.5 * (alike - 1.0)
    near = [beyond] if beyond <= 0.5 else [0.5 * beyond] * NEIGHBOURS
    place = np.arange(number) - 0.5 * (number - 1)
    place /= np.sqrt(place @ place)
    left = number - 2.0
    for lag, correlation in enumerate(near, start=1):
        hat = (number - lag) / number + float(place[lag:] @ place[:-lag])
        left -= 2.0 * correlation * hat
    return max(left / (number - 2.0), 0.2)


def alikeness(pieces: Pieces) -> float:
    """Variance of a mean of numbers over what it would be if neighbours were not alike, at least 1.

    By pieces of LONG revolutions and more: loads of a road wander over more than a turn. It is
    asked about a straight line, as their scatter is; about that through n each product is less by
    twice that variance over n, at small lags.
    """
    lags = np.arange(1, 1 + NEIGHBOURS)
    long = [
        without_line(about)
        for about in np.split(pieces.coefficients[:, 2], np.cumsum(pieces.number)[:-1])
        if about.size >= LONG
    ]
    square = float(sum(about @ about for about in long))
    if not square > 0.0:
        return 1.0
    values = sum(about.size for about in long)
    mean_size = values / len(long)
    seen: float = sum(
        sum(float(about[lag:] @ about[:-lag]) for about in long) * mean_size / (mean_size - lag)
        for lag in lags
    )
    seen /= square
    found = max((1.0 + 2.0 * seen) / (1.0 - 4.0 * (NEIGHBOURS - seen) / mean_size), 1.0)
    # squared errors are divided by it: as far as it scatters (Bartlett), their mean is larger
    return found * (1.0 + 4.0 * NEIGHBOURS / values)


#: harmonics of the staircase: the others are 2 % of a step's variance without noise, and nothing
#: with 0.1 steps of it
_HARMONICS = np.arange(1.0, 9.0)


@dataclass(frozen=True, kw_only=True)
class Cells(Means):
    """C cells x m angles, of which the random effects and the shift are relative.

    sd             (C, m)  standard error of the mean from independent noise and from rounding; inf
                   if empty
    rounding       (C, m)  mean square that rounding to steps leaves in one revolution's value at
                   least; 0 if no step is seen
    random_cov     (C, 3, 3)  covariance of the means of `random`: amplitude, width, baseline
    revolutions    (C,)  in the cell
    within         (C, m) mean square of single revolutions about their cell, shift taken out, noise
                   and random effects in it
    moved          (C,)  by how much `phi` was moved to the model's patch centre [rad] (a fit does
                   that)
    part           (C,) the member of each row if they are of several (an observable, or one grating
                   of several);  parts: what each member is, as cells without rows;  scales: what
                   its values are divided by [its unit]
    shared         random effects that all manoeuvres share; none unless asked for
    """

    sd: FloatArray = field(metadata=binned(1, np.inf))
    rounding: FloatArray = field(metadata=binned(2, 0.0))
    random_cov: FloatArray = field(metadata=ROW)
    revolutions: IntArray = field(metadata=ROW)
    within: FloatArray = field(metadata=binned(2, 0.0))
    moved: FloatArray = field(metadata=ROW)
    part: IntArray = field(metadata=ROW)
    shared: SharedEffects | None = None
    parts: tuple[Cells, ...] = ()
    scales: tuple[float, ...] = (1.0,)

    def take(self, which: NDArray[Any]) -> Self:
        """Some of the cells (mask or indices)."""
        shared = None if self.shared is None else self.shared.take(which)
        return replace(super().take(which), shared=shared)

    @property
    def label(self) -> str:
        """What they are called: the grating, if it is one of several, else the observable."""
        return self.member or self.observable

    @property
    def members(self) -> tuple[Cells, ...]:
        """What each member is; themselves if they are of one."""
        return self.parts or (self,)

    @property
    def level(self) -> FloatArray:
        """Where an offset of its log is in a cell, (C, m): 1, of a number per revolution 0."""
        waves = np.array([one.phi.shape[1] > 1 for one in self.members])[self.part]
        return np.repeat(waves[:, None].astype(np.float64), self.phi.shape[1], axis=1)

    @property
    def log_names(self) -> tuple[str, ...]:
        """The drives, each once; `log` modulo their number is that of all their observables."""
        return self.logs[: len(self.logs) // len(self.members)]

    @cached_property
    def angles(self) -> Angles | None:
        """Where a model is asked to predict; None for a number per revolution."""
        return Angles(self.phi, self.phi_variance) if self.phi.shape[1] > 1 else None

    @property
    def manoeuvres(self) -> int:
        return int(self.manoeuvre.max()) + 1 if self.manoeuvre.size else 0


def cells_of(pieces: Pieces) -> Cells:
    """The cells of all pieces: noise and scatter pooled over them."""
    m = pieces.values.shape[1]
    alike = alikeness(pieces) if m == 1 else 1.0
    scatter = scatter_of_numbers(pieces, alike) if m == 1 else pieces.scatter
    noise = _noise_profile(pieces) if m > 1 else np.full(1, np.nan)
    covariance = _coefficient_covariance(pieces)
    number, random, sample = pieces.number, pieces.random, pieces.count
    spread = np.einsum("cmi,ij,cmj->cm", random, covariance[0], random) if m > 1 else 0.0
    per_revolution = np.maximum(sample / number[:, None], 1e-9)
    standing = _standing_error(pieces, noise)
    rounding = np.where(
        sample > 0,
        standing + (pieces.step[:, None] ** 2 / 12.0 - standing) / np.maximum(per_revolution, 1.0),
        0.0,
    )
    with np.errstate(divide="ignore"):
        sd = (
            np.sqrt(noise[None, :] / sample + standing)
            if m > 1
            else scatter * np.sqrt(alike / number)[:, None]
        )
    rows: dict[str, Any] = {f.name: getattr(pieces, f.name) for f in fields(Means)}
    rows["manoeuvre"] = np.unique(pieces.manoeuvre, return_inverse=True)[1]
    return Cells(
        **rows,
        sd=np.where(sample > 0, sd, np.inf),
        rounding=rounding,
        random_cov=covariance[1][None] / number[:, None, None],
        revolutions=number,
        within=(noise[None, :] / per_revolution + standing + spread)
        if m > 1
        else np.where(sample > 0, scatter, np.inf) ** 2,
        moved=np.zeros(len(pieces)),
        part=np.zeros(len(pieces), np.int64),
    )


def _standing_error(pieces: Pieces, noise: FloatArray) -> FloatArray:
    """Mean square of each mean's rounding error that stays however many revolutions it has, (P, m).

    With y and sigma in steps, rounding y + noise of standard deviation sigma has the mean error

        b(y) = sum over k of (-1)^k / (pi k) sin(2 pi k y) exp(-2 (pi k sigma)^2)

    Noise makes it small, and so does a y that differs between the samples of a mean: |still|^(k^2)
    of it is left.
    `noise` (m,) is the variance of one sample about the mean, that is after rounding.
    """
    standing = np.zeros(pieces.values.shape)
    for step in np.unique(pieces.step[pieces.step > 0.0]):
        rows = (pieces.step == step) & (pieces.still != 0.0).any(axis=1)
        if rows.any():
            count = np.maximum(pieces.count[rows], 1.0)
            standing[rows] = step**2 * _standing_steps(pieces.still[rows], count, noise / step**2)
    return standing


def _standing_steps(still: FloatArray, count: FloatArray, noise: FloatArray) -> FloatArray:
    """The same in steps, of means (P, m) of so many samples, `still` the size of their mean
    exp(2 pi i y).

    Where between two steps a value lies is not asked: the square is the mean over all places.
    """
    # of places at random, one over their number is left
    share = np.clip((count * still**2 - 1.0) / np.maximum(count - 1.0, 1.0), 0.0, 1.0)
    k = _HARMONICS[:, None, None]
    # what the spread of the places leaves of each harmonic
    left = (share * (count > 1.0)) ** (0.5 * k**2) / (np.pi * k)

    def error(variance: FloatArray | float) -> FloatArray:
        """Mean square error of rounding under noise of a `variance`."""
        damped = np.exp(-2.0 * np.pi**2 * k**2 * np.asarray(variance))
        return np.asarray(0.5 * ((damped * left) ** 2).sum(axis=0), dtype=np.float64)

    # variances that are tried, between them by a line; twice as many take twice as long
    tried = np.geomspace(1e-3, 1.0, 24)
    # variance of rounded samples about their mean, pooled over pieces and neighbours
    after = np.stack([_smoothed(count * (v + 1.0 / 12.0 - error(v))) for v in tried.tolist()])
    after = np.minimum.accumulate(after[::-1], axis=0)[::-1] / _smoothed(count)
    return error(np.array([np.interp(noise[j], after[:, j], tried) for j in range(noise.size)]))


def _noise_profile(pieces: Pieces) -> FloatArray:
    """Variance of one sample by angle (m,).

    Pooled over the pieces and smoothed over neighbouring bins.
    """
    profile = _smoothed(pieces.residual_ss) / np.maximum(_smoothed(pieces.freedom), 1e-9)
    return np.asarray(np.maximum(profile, 1e-3 * np.median(profile) + 1e-30), dtype=np.float64)


def _smoothed(x: FloatArray) -> FloatArray:
    """Sums of x (P, m) over the pieces and neighbouring bins, (m,)."""
    x = x.sum(axis=0)
    half = max(1, x.size // 64)
    return np.convolve(np.r_[x[-half:], x, x[:half]], np.ones(2 * half + 1), mode="valid")


def _coefficient_covariance(pieces: Pieces) -> tuple[FloatArray, FloatArray]:
    """Covariance (3, 3) of single revolutions' coefficients, and that of a long mean.

    The second counts neighbours' correlation; both are over revolutions.

    Each cell's coefficients are taken about their trend in the order of driving: what follows speed
    is not scatter.
    """
    zero, one, freedom, pairs = np.zeros((3, 3)), np.zeros((3, 3)), 0.0, 0
    for coefficients in np.split(pieces.coefficients, np.cumsum(pieces.number)[:-1]):
        k = coefficients.shape[0]
        x = np.linspace(-1.0, 1.0, k)[:, None] if k > 1 else np.zeros((1, 1))
        design = np.hstack([np.ones((k, 1)), x]) if k >= 4 else np.ones((k, 1))
        c = coefficients - design @ np.linalg.lstsq(design, coefficients, rcond=None)[0]
        zero += c.T @ c
        one += 0.5 * (c[1:].T @ c[:-1] + c[:-1].T @ c[1:])
        freedom += k - design.shape[1]
        pairs += k - 1
    single = zero / max(freedom, 1.0)
    together = single + 2.0 * one / max(pairs, 1)
    values, vectors = np.linalg.eigh(0.5 * (together + together.T))
    scale = np.trace(single) + 1e-300
    return single, (vectors * np.maximum(values, 1e-6 * scale)) @ vectors.T


# ---- Cells of several observables of one tire under each other, so that one fit sees them all.
#
# Several gratings are members of one fit like several observables, each with a lever arm of its own
# (`with_ratios`).
#
#     Cells of each observable, its scale (its noise floor) --joined_cells--> Cells (C, m)
#         rows     those of one observable after the other; `part` says whose a row is
#         angles   as many as the observable with most; the others' last bins are empty
#         values   over the observable's scale: "noise floors", so that sizes may be added up
#
# A question asked of all of them is asked of these; what is fitted, and what is each one's own, is
# asked of the cells of each (`base.Base.channels`), which stay as they are.
#
# What is one in physics is one here: the parameters, and the manoeuvre. A stretch of driving is one
# replicate however many sensors saw it: leaving it out, or flipping its sign, is done to all of
# them at once (`one_drive`). What is each observable's own stays so: noise, floor, metric, scatter,
# the offset of each log (`log` numbers the logs of each observable apart), and the nuisances: but
# what a nuisance does to the tire or the wheel is one to all gratings of it, and only their
# baselines are their own.


# ---- The lever arm of each grating of one tire, as parameters of the model that all share.
#
# A grating that sits deeper in the tread reads less strain: its lever arm is the model's times a
# ratio of its own, and the first grating's ratio is one. The ratios are parameters of a fit,
# never of
# a model file.


LEVER = "lever_arm_m"
_OWN = "lever_arm_of_"
#: ratios that a fit may come to: gratings on one surface differ by a factor of two at most, and a
#: wrong strain gain by as much again
_LEAST, _MOST = 0.1, 10.0


def ratio_name(member: str) -> str:
    """The parameter that is a grating's lever arm over the first one's."""
    return _OWN + member.replace(".", ":")  # a dot would make it an effect's


def with_ratios(model: Model, cells: Sequence[Cells]) -> Model:
    """The model with a free ratio for every grating beside the first, near what is measured."""
    gratings = [own for own in cells if own.member and own.observable == STRAIN]
    sizes = [float(np.nanstd(own.values)) for own in gratings]
    new = [
        Parameter(
            ratio_name(own.member),
            "1",
            f"lever arm of {own.member} over that of {gratings[0].member}",
            float(np.clip(size / max(sizes[0], 1e-300), 2.0 * _LEAST, 0.5 * _MOST)),
            _LEAST,
            _MOST,
            1.0,
        )
        for own, size in zip(gratings[1:], sizes[1:], strict=True)
    ]
    kept = tuple(p for p in model.base if not p.name.startswith(_OWN))
    return replace(model, base=(*kept, *new)) if LEVER in model.parameters else model


def without_ratios(model: Model) -> Model:
    """The model as a file has it: without the gratings' own lever arms."""
    if not any(p.name.startswith(_OWN) for p in model.base):
        return model
    return replace(model, base=tuple(p for p in model.base if not p.name.startswith(_OWN)))


def at_lever(model: Model, member: str) -> Model:
    """The model with a grating's own lever arm; its ratio is one then, so that twice is once."""
    ratio = model.parameters.get(ratio_name(member))
    if ratio is None:
        return model
    lever = model.parameters[LEVER]
    value = lever.value * ratio.value
    own = replace(lever, value=value, min=min(lever.min, value), max=max(lever.max, value))
    return model.with_parameters({LEVER: own, ratio.name: replace(ratio, value=1.0, se=None)})


def one_drive(parts: Sequence[Pieces]) -> list[Pieces]:
    """The pieces of each observable, with the manoeuvres of the first in all of them.

    Each sensor finds manoeuvres for itself, and some revolutions later. One of another observable
    becomes the one that most of its revolutions are nearest to in time, of the first observable
    that the log has.
    """
    found: list[Pieces] = []
    #: times [s] and manoeuvres of each log's pieces, of the first observable that it has
    of_log: dict[str, tuple[FloatArray, IntArray]] = {}
    free = 0
    for part in parts:
        own, time = np.empty(len(part), np.int64), part.conditions.time_s
        for manoeuvre in np.unique(part.manoeuvre):
            rows = np.flatnonzero(part.manoeuvre == manoeuvre)
            log = part.logs[part.log[rows[0]]]
            if log not in of_log:
                own[rows], free = free, free + 1
                continue
            nearest = np.abs(time[rows][:, None] - of_log[log][0]).argmin(axis=1)
            number = of_log[log][1][nearest]
            own[rows] = int(np.bincount(number, part.number[rows]).argmax())
        for number in np.unique(part.log).tolist():
            rows = np.flatnonzero(part.log == number)
            of_log.setdefault(part.logs[number], (time[rows], own[rows]))
        found.append(replace(part, manoeuvre=own))
    return found


def joined_cells(
    parts: Sequence[Cells], scales: Sequence[float], drive: Sequence[IntArray]
) -> Cells:
    """The cells of several observables as one.

    scales  (n,) of each observable [its unit];  drive  of each the manoeuvre of its rows, numbered
            through all observables
    """
    width = max(part.phi.shape[1] for part in parts)
    names = tuple(dict.fromkeys(name for part in parts for name in part.logs))

    def joined(name: str, empty: float | None, power: int = 0) -> NDArray[Any]:
        rows = [getattr(part, name) for part in parts]
        if empty is not None:
            each = zip(rows, scales, strict=True)
            rows = [in_bins(own / scale**power, width, empty) for own, scale in each]
        return np.concatenate(rows)

    rows: dict[str, Any] = {
        f.name: joined(f.name, **f.metadata) for f in fields(Cells) if f.metadata
    }
    logs = [np.array([names.index(log) for log in part.logs]) for part in parts]
    rows |= {
        "log": np.concatenate(
            [i * len(names) + own[part.log] for i, (part, own) in enumerate(zip(parts, logs))]
        ),
        "manoeuvre": np.unique(np.concatenate(list(drive)), return_inverse=True)[1],
        "part": np.repeat(np.arange(len(parts)), [len(part) for part in parts]),
    }
    cells = replace(
        parts[0],
        observable=together(
            f"{name} of {n} gratings" if n > 1 else name
            for name, n in Counter(part.observable for part in parts).items()
        ),
        conditions=Conditions.concatenate([part.conditions for part in parts]),
        cell=np.zeros(0, np.int64),
        logs=names * len(parts),
        notes=tuple(dict.fromkeys(note for part in parts for note in part.notes)),
        shared=None,
        parts=tuple(replace(part.take(np.zeros(0, np.int64)), shared=None) for part in parts),
        scales=tuple(float(scale) for scale in scales),
        member="",
        place_rad=np.nan,
        **rows,
    )
    return replace(cells, shared=joined_effects(cells, [part.shared for part in parts]))


def of_all(cells: Cells, each: Sequence[FloatArray], empty: float = 0.0) -> FloatArray:
    """What is of each observable's cells, in its unit, (c, m) or (c, m, k), of all cells as one."""
    width = cells.phi.shape[1]
    rows = [in_bins(x / s, width, empty) for x, s in zip(each, cells.scales, strict=True)]
    return rows[0] if len(rows) == 1 else np.concatenate(rows)


def in_bins(x: FloatArray, width: int, empty: float) -> FloatArray:
    """x (C, m) or (C, m, k) with so many angles, those that it lacks empty."""
    if x.shape[1] == width:
        return x
    more = [(0, 0), (0, width - x.shape[1]), (0, 0)][: x.ndim]
    return np.pad(x, more, constant_values=empty)


def embedded(cells: Cells, part: int, x: FloatArray) -> FloatArray:
    """What is of one observable's cells, in its unit, (c, m) or (c, m, k), among all cells."""
    result = np.zeros((*cells.phi.shape, *x.shape[2:]))
    result[cells.part == part, : x.shape[1]] = x / cells.scales[part]
    return result


def joined_effects(cells: Cells, effects: Sequence[SharedEffects | None]) -> SharedEffects | None:
    """The shared effects of each member's cells as those of all, those of one name as one."""
    if not cells.parts:
        return effects[0]
    joined = SharedEffects.joined(
        None if own is None else replace(own, columns=embedded(cells, i, own.columns))
        for i, own in enumerate(effects)
    )
    if joined is None:
        return None
    kept = [joined.names.index(name) for name in dict.fromkeys(joined.names)]
    of_name = np.equal.outer(joined.names, [joined.names[k] for k in kept]).astype(np.float64)
    return replace(joined.of(kept), columns=joined.columns @ of_name)


def named(effects: SharedEffects, model: Model, cells: Cells) -> SharedEffects:
    """The shared effects of one observable's cells, by names that tell whose they are.

    What a grating alone has is its own; all else is the tire's or the wheel's, and one to all
    gratings. Those of an observable that is alone have no name before theirs.
    """

    def own(name: str) -> str:
        # amplitudes whose names begin so are a grating's own
        of_one = not cells.member or name.startswith("baseline")
        before = cells.label if of_one else cells.observable
        alone = not model.beside and not (cells.member and of_one)
        return name if alone or ": " in name else f"{before}: {name}"

    return replace(effects, names=tuple(map(own, effects.names)))


# ---- what a model says of them -------------------------------------------------------------------


def predicted(
    model: Model,
    cells: Cells,
    *,
    conditions: Conditions | None = None,
    values: Mapping[str, float] | None = None,
) -> FloatArray:
    """What a model predicts of one observable's cells, (C, m), under their conditions or others."""
    one = _seen_by(model, cells)
    own = {_called(name, cells): value for name, value in (values or {}).items()}
    return one.predict(
        cells.conditions if conditions is None else conditions,
        cells.angles,
        values=_known(one, own),
        surface=cells.surface,
        observable=cells.observable,
    )


def linearised(
    model: Model,
    cells: Cells,
    names: Sequence[str],
    values: Mapping[str, float],
    *,
    rough: bool = False,
) -> tuple[FloatArray, FloatArray]:
    """Prediction (C, m) and Jacobian (C, m, p), `rough` as of `Model.linearised`."""
    one = _seen_by(model, cells)
    own = {_called(name, cells): value for name, value in values.items()}
    asked = _known(one, {_called(name, cells): k for k, name in enumerate(names)})
    prediction, slopes = one.linearised(
        cells.conditions,
        cells.angles,
        list(asked),
        values=_known(one, own),
        rough=rough,
        surface=cells.surface,
        observable=cells.observable,
    )
    jacobian = np.zeros((*cells.phi.shape, len(names)))
    jacobian[..., list(asked.values())] = np.moveaxis(slopes, 0, -1)
    return prediction, jacobian


def _seen_by(model: Model, cells: Cells) -> Model:
    """The model as the observable or grating of these cells sees it."""
    several = model.beside or cells.member
    return model_of(model, cells.observable, cells.member) if several else model


def _called(name: str, cells: Cells) -> str:
    """A parameter of the model that all members share, as it is called in that of one of them."""
    return LEVER_RATIO if name == ratio_name(cells.member) else name


def _known(one: Model, numbers: dict[str, Any]) -> dict[str, Any]:
    """What is given by name, of the parameters that the model of one member has."""
    return {name: number for name, number in numbers.items() if name in one.parameters}


def lacking(effect: Effect, model: Model, cells: Cells) -> list[str]:
    """What an effect needs to be known, and some revolution that it acts on does not know."""
    acts = not model.beside or model.acts_on(effect, cells.observable)
    return effect.missing(cells.conditions) if acts else []


def model_of(model: Model, observable: str, member: str = "") -> Model:
    """The model as one observable sees it: without the effects that do nothing to it.

    What such an effect needs to be known of a log, this observable's logs need not know. Of several
    gratings `member` is the one whose lever arm it has.
    """
    kept = tuple(e for e in model.effects if model.acts_on(e.effect, observable))
    own = (replace(p, name=LEVER_RATIO) for p in model.base if p.name == ratio_name(member))
    base = (*without_ratios(model).base, *own)
    return replace(model, observable=observable, beside=(), effects=kept, base=base)
