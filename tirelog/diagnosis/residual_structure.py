"""What is left after the last step, in physical words.

Where, even or odd, what it follows, at which exponent of speed or fixed frequency.

    projected whitened residual against families of columns:
        (what a cell is driven under: 1, (v/20)^e for a few e, acceleration, time, load, distance,
        water) x (free shapes over the angle)    -> the family with the largest T describes it
        (v/20)^e x (free shapes over the time since the exit edge): what keeps its place there moves
        over the angle as the speed changes, and no shape over the angle repeats it
        rings after the exit edge at a fixed frequency in time, or at a fixed wavelength along the
        tread                                    -> which of the two

Significance by the same sign flips of manoeuvres, the largest over families; size by the held-out
removal of the best family.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import stdtrit

from tirelog.diagnosis.candidates.assessment import (
    Scores,
    beside_base,
    even_share,
    flip_test,
    gain_and_error,
    gain_sigmas,
    hats,
    hats_on,
    mean_drop,
    surely_gains,
)
from tirelog.diagnosis.results import contributions
from tirelog.diagnosis.rules import ALARM_P, ERROR_SIGMAS, GAIN_SIGMAS, LEAST_SHARE_OF_FLOOR
from tirelog.errors import ModelError
from tirelog.inference.base import Base, bases_by_observable, change_to, with_fewer_cells
from tirelog.inference.cells.cells import model_of
from tirelog.inference.floor import held_out_losses, held_out_losses_with, load_derivative
from tirelog.inference.metric import RANK, Offsets, side_by_side
from tirelog.inference.nuisances import condition_slopes
from tirelog.physics.model.model import ModelEffect
from tirelog.physics.model.user_effects import effect_by_shape
from tirelog.process_pool import made_apart
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.conditions import CONDITIONS
from tirelog.vocabulary.observables import OBSERVABLES

# ---- What a rest may go with: everything that a cell is driven under, and which of it moves
# together.
#
# Base -> factors by name, (C,) each: powers of the speed, conditions that vary, single logs


#: exponents of speed that are tested: each is one more candidate for chance
EXPONENTS = (0.0, 1.0, 2.0)
#: a rest is looked at over powers of the speed, and over the size of what has a sign
SPEED = CONDITIONS["speed_m_s"].symbol
SIGNED = tuple(c.symbol for c in CONDITIONS.values() if c.signed)


def factors_of(base: Base) -> dict[str, FloatArray]:
    """What a cell is driven under, (C,) each, by name; what does not vary is left out."""
    c = base.cells.conditions
    result = {f"{SPEED}^{e:g}": (c.speed_m_s / 20.0) ** e for e in EXPONENTS}
    if base.fit.stuck:  # no parameter takes a level beside what follows speed
        result |= {name: x - x.mean() for name, x in result.items() if np.ptp(x) > 0.0}
    for name, condition in CONDITIONS.items():
        values = getattr(c, name)
        varies = np.isfinite(values).all() and np.ptp(values) > 1e-3 * np.abs(values).max()
        if varies and condition.symbol != SPEED:  # that by its powers, above
            level = 0.0 if condition.signed else values.mean()
            result[condition.symbol] = (values - level) / np.abs(values).max()
    logs = np.unique(base.cells.log)
    # single logs that a remainder may follow: each is one more factor that may fit by chance; the
    # family-wise p counts them all, so that twice as many ask more of each
    for number in logs[: 4 if logs.size > 2 else logs.size - 1]:
        own = base.cells.log == number
        result[f"log {number}"] = own - float(np.mean(own))
    return result


def best_factor(factors: dict[str, FloatArray], statistic: FloatArray) -> int:
    """The factor that explains most.

    A quantity is preferred to the log itself if it explains nearly as much.
    """
    # a quantity is named in place of a log from this share of its statistic on; half as much would
    # name a quantity that explains half of what the log does
    least = 0.95 * statistic.max()
    near = [
        i for i, name in enumerate(factors) if not name.startswith("log ") and statistic[i] >= least
    ]
    return max(near, key=lambda i: statistic[i], default=int(np.argmax(statistic)))


def gone_along(factors: dict[str, FloatArray], name: str) -> tuple[str, ...]:
    """Other quantities that went along with the factor `name` in these cells.

    It could be any of them.
    """
    mine = factors[name]
    if name.startswith(SPEED) or np.ptp(mine) == 0.0:
        return ()
    others = [
        n
        for n, x in factors.items()
        if n != name and not n.startswith((SPEED, "log ")) and np.ptp(x) > 0.0
    ]
    # two quantities that move together beyond this correlation are not separated: a fifth of the
    # one in size is its own then; at 0.96 it would be 28 %
    return tuple(n for n in others if abs(float(np.corrcoef(mine, factors[n])[0, 1])) > 0.98)


# ---- Free shapes of the contact pressure as columns of the observable.
#
# What a cause in the patch looks like through the carcass.
#
#     hats on the patch, one after the other -> the model's own response to each -> columns (C,
#     m, k)
#
# A carcass answers a pressure the more the faster it rolls (the beam near its critical speed
# doubles
# it), so an exponent of speed that is read off the strain is not that of a cause in the patch. If
# these few columns explain as much as free shapes of the strain do, they tell the exponent.


def pressure_columns(base: Base) -> FloatArray | None:
    """Changes of the prediction by a hat of pressure at each place of the patch, (C, m, 19).

    None if the model cannot be computed with one of them.
    """
    # over the mean pressure; twice as much doubles the share of the response that is not linear
    height, nodes = 0.02, np.linspace(-2.0, 2.0, 21)  # over L
    pressed = [
        base.model.with_effect(
            ModelEffect.of(
                effect_by_shape("probe", "contact_pressure", "patch", "1", nodes, height * own)
            )
        )
        for own in np.eye(nodes.size)[1:-1]
    ]
    changes = [change_to(base, model) for model in pressed]
    known = [change / height for change in changes if not isinstance(change, ModelError)]
    return np.stack(known, axis=-1) if len(known) == len(changes) else None


#: exponents of speed that describe what was found, to half a power
FINE_EXPONENTS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0)
#: half lengths of the patch within which a shape that is no wake belongs to the patch, and a wake
_NEAR, _WAKE = 3.5, 6.0


#: nodes of free shapes over the time since the exit edge [s]: as many as over the angle; half as
#: close, a ringing of 150 Hz would have three to a period and not six
_TIMES_S = np.r_[0:0.03:0.001, 0.03:0.06:0.003, 0.06:0.42:0.02]


@dataclass(frozen=True)
class Leftover:
    """What a free shape still explains in the residual.

    `size` held-out mean square that the best free shape removes [unit^2]; `in_pressure` if a
    change of the contact pressure explains it best, `in_time` if a shape over the time since the
    exit edge does. `observable`: of several fitted together the one that it describes;
    `contradicts`: nothing repeats within that one, but it contradicts the others.
    """

    significant: bool
    p: float
    size: float
    where: str | None = None
    parity: str | None = None
    follows: str | None = None
    speed_exponent: float | None = None
    frequency_Hz: float | None = None
    in_pressure: bool = False
    together: tuple[str, ...] = ()
    observable: str | None = None
    contradicts: bool = False
    in_time: bool = False


def _describe_several(base: Base) -> Leftover:
    """The rest of the observable in which it is largest."""
    parts = bases_by_observable(base)
    labels = [part.cells.label for part in parts]
    share = [part.plain.weight / base.plain.weight for part in parts]
    # one test for each observable
    found = [replace(left, p=min(left.p * len(parts), 1.0)) for left in map(describe, parts)]
    floors = [part.floor.square for part in parts]
    sizes = np.array([left.size for left in found]) * share / floors
    repeating = sizes * [left.significant for left in found]
    most = int(np.argmax(repeating if repeating.any() else sizes))
    if found[most].significant:
        return replace(found[most], size=float(repeating.sum()), observable=labels[most])
    against = max(contributions(base), key=lambda one: one.size * one.contradicts)
    if not against.contradicts:
        return replace(found[most], size=float(sizes[most]))
    own = labels.index(against.observable)
    rest = replace(found[own], p=against.p, size=against.size * share[own])
    return replace(rest, significant=True, observable=against.observable, contradicts=True)


def _shapes(base: Base) -> FloatArray:
    """Free shapes over the angle, (C, m, k)."""
    phi = base.cells.phi
    return hats(phi) if phi.shape[1] > 1 else np.ones((*phi.shape, 1))


def _late_shapes(base: Base) -> FloatArray:
    """Free shapes over the time since the exit edge, (C, m, k)."""
    since = _behind_m(base) / base.cells.conditions.speed_m_s[:, None]
    return hats_on(since, _TIMES_S[: int(np.searchsorted(_TIMES_S, since.max())) + 1])


def _behind_m(base: Base) -> FloatArray:
    """How far the tread has come since the exit edge, (C, m) [m]."""
    radius = base.model.values["radius_m"]
    after = (np.nan_to_num(base.cells.phi, nan=-1.0) - half_angle(base)) * radius
    return np.asarray(np.where(after > 0, after, after + 2.0 * np.pi * radius))


def _score(
    base: Base,
    taken: Offsets,
    residual: FloatArray,
    columns: FloatArray,
    factor: FloatArray | float = 1.0,
) -> Scores:
    """Evidence for factor x columns, (C, m, k).

    Free shapes are many, so some columns are projected at a time.
    """

    def left_of(some: FloatArray) -> FloatArray:
        white = base.white(factor * some)
        left = taken.without(white)
        # of a column that the base explains whole, rounding is left: no evidence
        left *= np.linalg.norm(left, axis=(0, 1)) > RANK * np.linalg.norm(white, axis=(0, 1))
        return left

    return Scores.of(base, side_by_side(left_of, [columns]), residual)


def _scores(
    base: Base,
    taken: Offsets,
    residual: FloatArray,
    columns: FloatArray,
    factors: Sequence[FloatArray],
) -> list[Scores]:
    """Evidence for each factor x columns, as far as there are processes side by side."""
    return made_apart([partial(_score, base, taken, residual, columns, f) for f in factors])


def describe(base: Base) -> Leftover:
    """The rest that this fit leaves.

    Of several observables it describes the one in which it is largest, its size in floors of all.
    """
    if base.channels:
        return _describe_several(base)
    cells = base.cells
    taken, residual = beside_base(base)
    factors, free = factors_of(base), _shapes(base)
    scores = _scores(base, taken, residual, free, [f[:, None, None] for f in factors.values()])
    by_speed = [name for name in factors if name.startswith(SPEED) and cells.phi.shape[1] > 1]
    if by_speed:
        by = [factors[name][:, None, None] for name in by_speed]
        scores += _scores(base, taken, residual, _late_shapes(base), by)
    statistic, p = flip_test(scores, cells.manoeuvres)
    best = best_factor(factors, statistic[: len(factors)])
    late = len(factors) + int(np.argmax(statistic[len(factors) :])) if by_speed else best
    in_time = bool(statistic[late] > statistic[best])
    if in_time:
        best, free = late, _late_shapes(base)
    name = [*factors, *by_speed][best]
    free *= factors[name][:, None, None]  # in place: this is what takes most memory of a diagnosis
    held_white, held_plain = held_out_losses(cells, base.white, base.plain, base.fit, free)
    size = mean_drop(base, held_plain)
    left = Leftover(True, float(p[best]), size)
    surely = surely_gains(*gain_and_error(base.held_white, held_white), left.p, base.share(size))
    if p[best] > ALARM_P or not surely or size < LEAST_SHARE_OF_FLOOR * base.floor.square:
        return replace(left, significant=False)
    free = _late_shapes(base) if in_time else _shapes(base)
    exponent, in_pressure = None, False
    # a number per revolution that is now above, now below zero follows the speed but for a level
    # that a parameter takes, and grows with no power of it; a remainder is of one sign if its sum
    # is this share of its sizes'; twice as much would leave none
    rest = base.plain(np.nan_to_num(cells.values - base.fit.prediction))
    one_sign = cells.phi.shape[1] > 1 or abs(rest.sum()) >= 0.8 * np.abs(rest).sum()
    if name.startswith(SPEED) and one_sign:
        exponent, in_pressure = _exponent(base, taken, residual, free, pressed=not in_time)
    follows = "nothing" if exponent == 0.0 else name.split("^")[0]
    together = gone_along(factors, name)
    left = replace(left, follows=follows, speed_exponent=exponent, together=together)
    if cells.phi.shape[1] == 1:
        return left
    where, parity = ("exit", "mixed") if in_time else place_and_parity(base)
    side = _one_side(base, taken, residual, free, exponent or 0.0) if where == "patch" else None
    return replace(
        left,
        where=side or where,
        parity="mixed" if side else parity,
        frequency_Hz=_frequency(base),
        in_pressure=in_pressure,
        in_time=in_time,
    )


def _exponent(
    base: Base, taken: Offsets, residual: FloatArray, free: FloatArray, *, pressed: bool
) -> tuple[float, bool]:
    """The exponent of speed with which free shapes explain most.

    Also, if `pressed` is asked, whether these are shapes of the pressure rather than of the
    observable.
    """
    speed = (base.cells.conditions.speed_m_s / 20.0)[:, None, None]

    def explained(columns: FloatArray) -> list[float]:
        return [
            _explained(one)
            for one in _scores(base, taken, residual, columns, [speed**e for e in FINE_EXPONENTS])
        ]

    # one after the other in memory
    bells = pressure_columns(base) if pressed and free.shape[-1] > 1 else None
    by_pressure = [] if bells is None else explained(bells)
    del bells
    by_shape = explained(free)
    in_pressure = max(by_pressure, default=-1.0) >= max(by_shape)
    return FINE_EXPONENTS[int(np.argmax(by_pressure if in_pressure else by_shape))], in_pressure


def _one_side(
    base: Base, taken: Offsets, residual: FloatArray, free: FloatArray, exponent: float
) -> str | None:
    """'entry' or 'exit' if shapes on that side alone explain what both sides do.

    The base parameters are free. Patch length, shift and stiffness make a one-sided cause look
    two-sided once they are fitted; the question takes that back.
    """
    reach, phi = _WAKE * half_angle(base), np.nan_to_num(base.cells.phi)
    factor = (base.cells.conditions.speed_m_s / 20.0)[:, None, None] ** exponent
    within = {"entry": (-reach, 0.0), "exit": (0.0, reach), "both": (-reach, reach)}
    masks = {name: factor * ((phi >= a) & (phi <= b))[..., None] for name, (a, b) in within.items()}
    sides = {n: _explained(_score(base, taken, residual, free, m)) for n, m in masks.items()}
    both = sides.pop("both")
    best, other = sorted(sides, key=lambda name: -sides[name])
    # share of what both sides explain that one side alone must, and its ratio to the other side's;
    # half as much would call a shape of both sides one-sided if one of them is the larger
    return best if sides[best] > 0.93 * both and sides[best] > 1.03 * sides[other] else None


def _explained(score: Scores) -> float:
    """T squared: whitened sum of squares that the columns explain."""
    return float(((score.scores.sum(axis=0) @ score.root()) ** 2).sum())


def leading_shape(base: Base) -> FloatArray:
    """The residual's leading shape over the angle, (m,).

    In the observable's unit at the cell where it is largest.
    """
    residual = base.plain(np.nan_to_num(base.cells.values - base.fit.prediction - base.fit.beside))
    size, strength, shape = np.linalg.svd(residual, full_matrices=False)
    weight = np.maximum(base.plain.weights.max(axis=1), 1e-300)
    scale = strength[0] * np.abs(size[:, 0] / weight).max()
    sign = np.sign(size[np.argmax(np.abs(size[:, 0])), 0])
    return np.asarray(sign * scale * shape[0], dtype=np.float64)


def half_angle(base: Base) -> float:
    """L / R [rad] of the model's patch, mean over cells."""
    model, conditions = base.model, base.cells.conditions
    if model.beside:
        model = model_of(model, base.cells.observable, base.cells.member)
    return float(np.mean(model.half_length_m(conditions))) / model.values["radius_m"]


def place_and_parity(base: Base) -> tuple[str, str]:
    """(entry, patch, exit or away; even, odd or mixed) of the residual's leading shape.

    What is far from the patch is away; what is as strong on one side as on the other belongs to the
    patch, else to the edge of its side.
    """
    edge, phi, shape = half_angle(base), np.nanmean(base.cells.phi, axis=0), leading_shape(base)
    energy, total = shape**2, (shape**2).sum() + 1e-300
    even = even_share(shape, phi)
    # share of the energy that makes a parity: the other one is then a third as large. With twice
    # the rest it may be half as large; of a shape on one side alone both are equal
    least = 0.9
    parity = "even" if even > least else "odd" if even < 1.0 - least else "mixed"
    if energy[np.abs(phi) > (_WAKE if parity == "mixed" else _NEAR) * edge].sum() > 0.5 * total:
        return "away", parity
    if parity != "mixed" or energy[np.abs(phi) < 0.6 * edge].sum() > 0.5 * total:
        return "patch", parity
    behind, ahead = energy[phi > 0.6 * edge].sum(), energy[phi < -0.6 * edge].sum()
    return "exit" if behind > ahead else "entry", parity


def _frequency(base: Base) -> float | None:
    """The frequency [Hz] of a ring-down after the exit edge.

    Only if a fixed frequency in time explains more than a fixed wavelength.
    """
    # cells that a ring-down is looked for in: the time goes with their number
    base = with_fewer_cells(base, 24)
    taken, residual = beside_base(base)
    behind, speed = _behind_m(base), base.cells.conditions.speed_m_s[:, None]
    since, factor = behind / speed, speed[..., None] / 20.0

    def best(
        numbers: FloatArray, phase: FloatArray, decays: Sequence[float], turns: float = 0.0
    ) -> tuple[float, float]:
        """What the best ring-down of at least so many turns explains, and its number."""
        found = []
        pairs = [(n, decay) for n in numbers.tolist() for decay in decays if n * decay >= turns]
        for number, decay in pairs:
            turn, fall = phase * (2.0 * np.pi * number), np.exp(-phase / decay)[..., None]
            wave = np.stack([np.cos(turn), np.sin(turn)], axis=-1) * fall
            columns = np.concatenate([wave, factor * wave], axis=-1)
            found.append((_explained(_score(base, taken, residual, columns)), number))
        return max(found)

    # fixed frequencies [Hz] or wavelengths [m], and how soon they decay, in time [s] or along the
    # tread [m]. A ringing turns once before it has fallen to 1/e: with half of it a single bump
    # would be one
    in_time, frequency = best(np.geomspace(30.0, 400.0, 30), since, (0.008, 0.02), 1.0)
    in_space, _ = best(1.0 / np.geomspace(0.05, 0.5, 20), behind, (0.1, 0.3))
    # a fixed frequency must explain so much more than a fixed wavelength, and so much of what is
    # left: 0.59 of it in size.  Twice the share leaves little room for anything beside the ringing
    if in_time < 1.15 * in_space or in_time < 0.35 * float((residual**2).sum()):
        return None
    return best(np.linspace(0.92, 1.08, 17) * frequency, since, (0.008, 0.02), 1.0)[1]


# ---- What is left that does not repeat: its size, whether a load looks like it, what it goes with.


def scattered(base: Base, floor_square: float) -> dict[str, Any]:
    """Size and course of what does not repeat beside the floor.

    `size` is its root mean square in the observable's unit. The other keys: whether it looks like a
    load that changes, the quantity that it `follows` ("" if none), what went `together` with it.
    `grows`: with that quantity, else it falls. If only chi-square shows it, `size` is that of cell
    means.
    """
    unit = 1.0
    if base.channels:  # of the observable farthest above its floor, in floors
        parts = bases_by_observable(base, held_by_all=True)
        base = max(parts, key=lambda part: part.square_held / part.floor.square)
        floor_square, unit = base.floor.square, float(np.sqrt(base.floor.square))
    plain, cells = base.plain, base.cells
    beyond = max(
        base.square_held - floor_square, (base.reduced_chi2 - 1.0) * plain.bias / plain.weight, 0.0
    )
    left = plain(np.nan_to_num(cells.values - base.fit.prediction - base.fit.beside))
    square = (left**2).sum(axis=1)
    load = plain(np.nan_to_num(load_derivative(cells, base.fit)))
    along = (left * load).sum(axis=1) ** 2 / np.maximum((load**2).sum(axis=1), 1e-300)
    # share of what is left that one shape must make up to be reported, and rank correlation over
    # manoeuvres of its size with what it is reported to follow: so much, and more than chance gives
    # with this probability on either side (a dozen factors are looked at); doubling either says
    # nothing
    like_load = cells.phi.shape[1] > 1 and bool(along.sum() > 0.5 * square.sum())
    factors = factors_of(base)

    def of_manoeuvres(x: FloatArray) -> FloatArray:
        """Means over the cells of each manoeuvre, which go together: it is what counts."""
        return np.asarray(np.bincount(cells.manoeuvre, x) / np.bincount(cells.manoeuvre))

    sizes = [np.log(np.maximum(square / cells.revolutions, 1e-300))]
    if cells.phi.shape[1] == 1:  # what crosses zero is largest at both ends
        sizes.append(left[:, 0])
    ranked = [_ranks(of_manoeuvres(size)) for size in sizes]
    least, freedom = 1.0, cells.manoeuvres - 2
    if freedom > 0:  # what manoeuvres that follow nothing reach
        t = float(stdtrit(freedom, 1.0 - 0.00135))
        least = max(0.5, t / float(np.sqrt(freedom + t**2)))
    means = {
        factor: of_manoeuvres(np.abs(x) if factor in SIGNED else x) for factor, x in factors.items()
    }
    ranks = [
        (float(np.corrcoef(of_size, _ranks(mean))[0, 1]), factor)
        for factor, mean in means.items()
        for of_size in ranked
        if np.ptp(mean) > 0.0
    ]
    sure = [pair for pair in ranks if abs(pair[0]) > least]
    best, name = max(sure, key=lambda pair: abs(pair[0]), default=(0.0, ""))
    return {
        "size": float(np.sqrt(beyond)) / unit,
        "like_load": like_load,
        "follows": name.split("^")[0],
        "grows": best > 0.0,
        "together": gone_along(factors, name) if name else (),
    }


def _ranks(x: FloatArray) -> FloatArray:
    return np.unique(x, return_inverse=True)[1].astype(float)


# ---- Is what a model leaves noise, how wrong is it, and which conditions come before physics?
#
# Base -> whitened residual -> six numbers, beside those of noise as the floor has it, fitted alike
#      -> the least extra error per zone, condition and parameter at which model and data agree
#      -> a load, a radius or a pressure wrong in one log -> how much of the excess that would
#         remove


Row = dict[str, Any]


def of_each(
    question: Callable[[Base], Sequence[Row]], base: Base, name: str = ""
) -> tuple[Row, ...]:
    """The rows that answer a question, of each observable; of several, `name` says of which."""
    if not base.channels:
        return tuple(question(base))
    each = [(part.cells.label, row) for part in bases_by_observable(base) for row in question(part)]
    return tuple(row | ({name: f"{row[name]} of {label}"} if name else {}) for label, row in each)


def posterior_checks(base: Base) -> Sequence[Row]:
    """Largest cell, autocorrelations, Ljung-Box, kurtosis and drift of the whitened residual.

    The ranges are those of residuals drawn from noise and scatter as the floor has them. Base
    parameters, offsets and nuisances are projected out of them, as of the measured residual.
    `low`, `high`: the range; `never`: noise never leaves what is measured.
    """
    cells, white = base.cells, base.noise
    if cells.phi.shape[1] == 1:
        return ()  # one number per revolution has no shape
    other = Offsets.of(cells, white).beside(white(base.fit.moving))
    measured = other.without(white(np.nan_to_num(cells.values - base.fit.prediction)))
    random, used = np.random.default_rng(0), white.inverse_sd > 0.0
    names, statistics = _statistics(base, used)
    # residuals that are drawn, and the standard deviations about their mean that make the range:
    # one of them leaves it by chance in a log in two hundred; twice as many tell the ranges to
    # 3.5 instead of 5 %, in twice the time; with a range twice as wide only what is twice as far
    # off fails
    count, width = 200, 3.3
    drawn = np.empty((count, len(names)))
    for row in drawn:
        noise = random.standard_normal(measured.shape) * used
        along = np.swapaxes(white.basis, 1, 2) @ noise[..., None]
        # a direction shrunk by so much is free, and no residual has a part in it
        free = (white.shrink > 0.99)[..., None]
        row[:] = statistics(other.without(noise - (white.basis @ (free * along))[..., 0]))
    middle, reach = drawn.mean(axis=0), width * drawn.std(axis=0, ddof=1)
    rows = np.stack([statistics(measured), middle - reach, middle + reach], axis=1).tolist()
    return [
        {"name": name, "measured": own, "low": low, "high": high, "never": not low <= own <= high}
        for name, (own, low, high) in zip(names, rows, strict=True)
    ]


def _statistics(
    base: Base, used: NDArray[np.bool_]
) -> tuple[tuple[str, ...], Callable[[FloatArray], FloatArray]]:
    """The names of the six numbers, and what gives them (6,) of a whitened residual (C, m)."""
    cells = base.cells
    count = np.maximum(used.sum(axis=1), 1)
    order = np.lexsort((cells.conditions.time_s, cells.manoeuvre))
    beside = np.flatnonzero(np.diff(cells.manoeuvre[order]) == 0)
    before, after = order[beside], order[beside + 1]
    time, in_log = cells.conditions.time_s, np.maximum(np.bincount(cells.log), 1)
    # a log that does not know its times has none
    time = np.nan_to_num(time - (np.bincount(cells.log, time) / in_log)[cells.log])
    time = time / max(float(np.sqrt((time**2).sum())), 1e-300)
    names = (
        "largest mean square of a cell",
        "autocorrelation over the angle",
        "Ljung-Box over ten angles",
        "autocorrelation from cell to cell",
        "kurtosis",
        "drift along the logs",
    )

    def statistics(r: FloatArray) -> FloatArray:
        square, number = max(float((r**2).sum()), 1e-300), float(used.sum())
        # lags of the angle; of a ringing of 400 Hz at 20 m/s ten are a period at 256 angles
        lags = np.array([(r[:, k:] * r[:, :-k]).sum() for k in range(1, 11)]) / square
        return np.array(
            [
                ((r**2).sum(axis=1) / count).max(),
                lags[0],
                number * np.mean(lags**2),
                (r[before] * r[after]).sum() / square,
                np.square(r**2).sum() * number / square**2,
                time @ (r.sum(axis=1) / np.sqrt(count)),
            ]
        )

    return names, statistics


def extra_errors(base: Base) -> Sequence[Row]:
    """The least extra error by zone, speed, regime, log and parameter, each by itself.

    Rows: `of` ("zone", "speed", "regime", "log" or "parameter"), its `name`, `size`, `unit`,
    `observable`. Model and data agree where chi-square is what noise gives, to two standard
    deviations. In a zone or condition the size is the standard deviation of an independent error of
    cell means; of a parameter that of a relative change from cell to cell. 0 if they agree without;
    None if no size makes them agree.
    """
    cells, white = base.cells, base.noise
    residual = white(cells.values - base.fit.prediction - base.fit.beside)
    square, inverse, used = residual**2, white.inverse_sd**2, white.inverse_sd > 0.0
    share = base.fit.freedom / max(float(used.sum()), 1.0)
    unit, found = OBSERVABLES[cells.observable].unit, list[dict[str, Any]]()
    band = np.floor(cells.conditions.speed_m_s / 2.0) * 2.0 + 1.0
    conditions = (
        ("speed", band),
        ("regime", cells.regime),
        ("log", np.array(cells.logs)[cells.log]),
    )
    wheres = [("zone", name, zone[None, :]) for name, zone in zones(base)] + [
        (of, f"{name:g} m/s" if of == "speed" else str(name), (names == name)[:, None])
        for of, names in conditions
        for name in np.unique(names).tolist()
    ]
    for of, name, where in wheres:
        own, precision = square[used & where], inverse[used & where]
        size = _least_root(partial(_widened, own, precision), share * own.size)
        found.append({"of": of, "name": name, "size": size, "unit": unit})
    values, total = base.model.values, float(square.sum())
    for name, column in zip(base.fit.names, np.moveaxis(base.fit.moving, -1, 0), strict=True):
        moved = white(column * values[name])
        length, along = (moved**2).sum(axis=1), (moved * residual).sum(axis=1) ** 2
        if length.any():
            size = _least_root(partial(_moved, total, length, along), base.fit.freedom)
            found.append({"of": "parameter", "name": name, "size": size, "unit": "1"})
    return [{**row, "observable": cells.observable} for row in found]


def learnt_residual(base: Base) -> Sequence[Row]:
    """What a residual that is learnt gains on manoeuvres held out (P3 outlook).

    A Gaussian process over the angle, then over angle and speed, then over all conditions that
    vary. Its weights are learnt with the model's parameters on the other manoeuvres, in the same
    metric as the model's own held-out losses. Before any manoeuvre they are about zero, as large as
    the excess. Rows: `learns` (of what), the `weights`, `rmse_heldout`, `excess_removed` (a share;
    below zero if it harms), `sigmas` of the gain, `observable`. It never enters a name.
    """
    # ten conditions take 300 MB of columns; twice as many cells take twice as much
    few = with_fewer_cells(base, 480)
    if few.cells.manoeuvres < 2 or min(base.excess, few.excess) <= 0.0:
        return ()
    phi, factors = few.cells.phi, factors_of(few)
    shapes = np.ones((*phi.shape, 1))
    if phi.shape[1] > 1:
        # in half lengths of the patch: half as many nodes lose a kink at an edge, twice as many
        # take twice the memory
        nodes = half_angle(base) * np.linspace(-3.0, 3.0, 31)
        shapes = hats_on(np.nan_to_num(phi, nan=np.pi), nodes)
    by_speed = [name for name in factors if name.startswith(SPEED)]
    others = [name for name in factors if not name.startswith((SPEED, "log "))]
    learns = {"angle": by_speed[:1], f"angle, {SPEED}": by_speed}
    if others:
        learns[", ".join(("angle", SPEED, *others))] = [*by_speed, *others]
    columns = {name: shapes * factors[name][:, None, None] for name in (*by_speed, *others)}
    additions = [[columns[name] for name in names] for names in learns.values()]
    parts = few.cells, few.white, few.plain, few.fit
    rows = []
    for (learnt, names), (_, plain) in zip(
        learns.items(),
        held_out_losses_with(*parts, additions, precision=1.0 / few.excess),
        strict=True,
    ):
        share = mean_drop(few, plain) / few.excess
        rows.append(
            {
                "learns": learnt,
                "weights": shapes.shape[-1] * len(names),
                "rmse_heldout": float(np.sqrt(max(base.square_held - share * base.excess, 0.0))),
                "excess_removed": share,
                "sigmas": gain_sigmas(few.held_plain, plain),
                "observable": base.cells.observable,
            }
        )
    return rows


def _widened(square: FloatArray, precision: FloatArray, variance: float) -> float:
    """Chi-square of bins with an independent error of this variance beside the noise."""
    return float((square / (1.0 + variance * precision)).sum())


def _moved(total: float, length: FloatArray, along: FloatArray, variance: float) -> float:
    """Chi-square of cells that each move along one column by this variance."""
    return total - float((variance * along / (1.0 + variance * length)).sum())


def zones(base: Base) -> list[tuple[str, NDArray[np.bool_]]]:
    """Parts of the turn by name, each a mask over the angles (m,); "all" of a scalar."""
    if base.cells.phi.shape[1] == 1:
        return [("all", np.ones(1, bool))]
    edge, phi = half_angle(base), np.nanmean(base.cells.phi, axis=0)
    return [
        ("entry", (phi >= -1.5 * edge) & (phi < -0.5 * edge)),
        ("patch", np.abs(phi) <= 0.5 * edge),
        ("exit", (phi > 0.5 * edge) & (phi <= 1.5 * edge)),
        ("away", np.abs(phi) > 1.5 * edge),
    ]


def _least_root(left: Callable[[float], float], freedom: float) -> float | None:
    """The least standard deviation at which chi-square, `left` of its square, is that of noise.

    0 if it is without; None if no size makes it so.
    """
    wanted = freedom + ERROR_SIGMAS * float(np.sqrt(2.0 * freedom))
    none, most = -30.0, 30.0  # powers of ten of variances, in any unit
    if left(10.0**none) <= wanted:
        return 0.0
    if left(10.0**most) > wanted:
        return None
    return float(10.0 ** (0.5 * brentq(lambda power: left(10.0**power) - wanted, none, most)))


def suspects(base: Base) -> tuple[Row, ...]:
    """Load, rolling radius and pressure of one log each that would explain much, the best first.

    `share`: of the excess it would remove if it were `change` higher in the log.
    """
    return tuple(sorted(of_each(_suspects, base), key=lambda row: -row["share"]))


def suspect_sentence(row: Mapping[str, Any]) -> str:
    """What a suspect would have to be, and what that would explain."""
    return (
        f"a {row['condition']} {100.0 * abs(row['change']):.2g} % "
        f"{'higher' if row['change'] > 0.0 else 'lower'} in log {row['log'] + 1} than its setup "
        f"says would remove {100.0 * row['share']:.0f} % of the excess"
    )


def _suspects(base: Base) -> Sequence[Row]:
    """The suspects of one observable.

    Of one log alone none: what a level does there is what the model's parameters do.
    """
    cells, logs = base.cells, np.unique(base.cells.log)
    if base.excess <= LEAST_SHARE_OF_FLOOR * base.floor.square or logs.size < 2:
        return ()
    taken, residual = beside_base(base)
    found = []
    columns = {
        (condition, int(log)): (slope * (cells.log == log)[:, None])[..., None]
        for condition, slope in condition_slopes(cells, base.fit).items()
        for log in logs
    }
    single = [[column] for column in columns.values()]
    losses = held_out_losses_with(cells, base.white, base.plain, base.fit, single)
    for ((condition, log), column), (white, plain) in zip(columns.items(), losses, strict=True):
        gain, error = gain_and_error(base.held_white, white)
        share = mean_drop(base, plain) / base.excess
        # a suspect is named from this share of the excess on, that it would remove; twice as much
        # names only what removes more than half of it
        if gain > GAIN_SIGMAS * error and share >= 0.3:
            left = taken.without(base.white(column)).ravel()
            change = float(left @ residual.ravel()) / max(float(left @ left), 1e-300)
            row = {"condition": condition, "log": log, "change": change, "share": min(share, 1.0)}
            found.append(row)
    return found
