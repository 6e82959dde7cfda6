"""The whole grammar on a ground: which forms say most, and by what chance.

every form at every value of its grid, under every law -> T, and its flips of manoeuvres
    -> p of the largest over the whole dictionary
the best of each form -> its numbers and exponents polished by variable projection
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from tirelog.diagnosis.candidates.sign_flips import flip_signs
from tirelog.diagnosis.propose.grammar import LAW_BOUNDS, Form, GivenLaw, forms, laws
from tirelog.diagnosis.propose.ground import Ground
from tirelog.errors import ModelError, or_refusal
from tirelog.inference.base import Base
from tirelog.physics.model.own.user_effects import CONDITIONS, effect_by_expression
from tirelog.physics.parameters import Parameter
from tirelog.vocabulary.arrays import FloatArray

#: columns of a form that are worked on at a time: 20 MB for 50 cells
_SOME = 48
#: patterns of signs that are tried: they tell p to 2.4e-4, and a p of 0.01 to 16 % of it; twice as
#: many tell it to 11 %, in twice the time
_FLIPS = 4096
#: a column of which less than this is left beside base and nuisances says nothing of its own, as
#: for candidates; a share of squares: 1 % of a form's size, and with twice as much 1.4 %
_VISIBLE = 1e-4
#: a condition varies if its range is above this share of its largest value; acceleration [m/s^2]
#: and temperature [K] above these.  Half of it would take the scatter of a cruise for a variation
_VARIES = 0.05
_LEAST_RANGE = {"acceleration": 0.3, "temperature": 1.0}
#: steps of a polish, and the relative change of what is left that ends it: a refit of the whole
#: model follows; twice as many take longer before it
_STEPS = 20
_SETTLED = 1e-4


@dataclass(frozen=True)
class Atom:
    """A form with its numbers, under a law: T, and the whitened sum of squares that it explains.

    `fixed`: numbers of the law that were rounded, and are not fitted.
    """

    form: Form
    numbers: Mapping[str, float]
    law: GivenLaw
    statistic: float = 0.0
    explained: float = 0.0
    fixed: tuple[str, ...] = ()

    @property
    def complexity(self) -> int:
        """What a reader has to take in: the form, and the law with its free numbers."""
        numbers = self.law.numbers
        free = [name for name in numbers if name not in self.fixed]
        gone = bool(numbers) and all(n in self.fixed and v == 0.0 for n, v in numbers.items())
        return self.form.complexity + len(free) + (0 if gone else self.law.law.complexity)


@dataclass(frozen=True)
class Scanned:
    """The best atom of each form and law by falling T, how many were tried, p of the best."""

    atoms: tuple[Atom, ...]
    tried: int
    p: float


def typical(base: Base) -> dict[str, float]:
    """A round value of each condition that varies in the cells and is known, by symbol."""
    found = {}
    known = {**CONDITIONS, "load": "load_N"}
    for symbol, column in known.items():
        values = getattr(base.cells.conditions, column)
        if symbol in ("time", "speed") or not np.isfinite(values).all():
            continue
        largest, span = float(np.abs(values).max()), float(np.ptp(values))
        if span > max(_VARIES * largest, _LEAST_RANGE.get(symbol, 0.0)):
            found[symbol] = float(f"{float(np.abs(values).mean()) or largest:.1e}")
    return found


def unit_columns(
    ground: Ground,
    form: Form,
    numbers: Mapping[str, FloatArray | float],
    *,
    in_bins: bool = True,
) -> FloatArray:
    """What the form does to the observable per unit of amplitude and law, (C, m, S).

    In the mean over each bin's samples, or, in half the time, at their mean angle. numbers (S,)
    each; of a wave its two quadratures are neighbours, (C, m, 2 S). ModelError if it cannot be
    computed.
    """
    stage = form.stage
    given = {name: np.atleast_1d(value) for name, value in numbers.items()}
    count = max([value.size for value in given.values()], default=1)
    texts = [form.text.replace("@", wave) for wave in ("cos", "sin")] if form.wave else [form.text]
    shape = ground.residual.shape
    if not stage.acts_on:
        spread = {name: value.reshape(-1, 1, 1) for name, value in given.items()}
        computed = ground.in_bins if in_bins else ground.expression
        each = [np.broadcast_to(computed(text, spread), (count, *shape)) for text in texts]
        stacked = np.stack(each, axis=1).reshape(-1, *shape)
        return np.ascontiguousarray(np.moveaxis(stacked, 0, -1))
    columns = []
    for i in range(count):
        own = {name: float(value[min(i, value.size - 1)]) for name, value in given.items()}
        for text in texts:
            columns.append(_response(ground, form, text, own))
    return np.stack(columns, axis=-1)


def _response(ground: Ground, form: Form, text: str, numbers: Mapping[str, float]) -> FloatArray:
    """The change of the prediction per unit of amplitude at a stage, (C, m)."""
    stage = form.stage
    body = stage.prefix + text
    parameters = [Parameter("A", "", "", stage.probe, -1e9, 1e9, stage.probe)]
    parameters += [
        Parameter(name, "", "", value, -1e9, 1e9, abs(value) + 1e-3, free=False)
        for name, value in numbers.items()
    ]
    probe = effect_by_expression("probe_", stage.acts_on, f"A * ({body})", tuple(parameters))
    return ground.response(probe, stage.probe)


def scan(ground: Ground) -> Scanned:
    """Every atom of the grammar with its T; p of the largest by flips, over all of them."""
    given = laws(typical(ground.base))
    factors = np.stack([ground.law(law.text, law.numbers) for law in given])
    signs = flip_signs(ground.manoeuvres)
    if signs.shape[0] > _FLIPS:
        rows = np.random.default_rng(0).choice(signs.shape[0] - 1, _FLIPS - 1, replace=False)
        signs = signs[np.r_[0, 1 + rows]]
    signs = signs.astype(np.float32)
    largest = np.zeros(signs.shape[0], np.float32)
    best: dict[tuple[str, str, str, int], Atom] = {}
    tried = 0
    for form in forms():
        grid = form.grid()
        for numbers, columns in _batches(ground, form, grid):
            together = 2 if form.wave else 1
            worth = ground.worth(ground.of_cells(columns), factors, together)
            turned, good = _turned(worth.scores, worth.gram, worth.size)
            tried += int(good.sum())
            if not good.any():
                continue
            flipped = _flipped(signs, turned[good])
            np.maximum(largest, flipped.max(axis=1), out=largest)
            statistic = np.zeros(good.size)
            statistic[good] = flipped[0]
            for i, law in enumerate(given):
                own = statistic.reshape(factors.shape[0], -1)[i]
                j = int(np.argmax(own))
                key = (form.stage.name, form.words, law.law.text, 0)
                if own[j] > 0.0 and (key not in best or own[j] > best[key].statistic):
                    at = {name: float(value[j]) for name, value in numbers.items()}
                    best[key] = Atom(form, at, law, float(own[j]))
    atoms = sorted(best.values(), key=lambda atom: -atom.statistic)
    p = float((largest >= atoms[0].statistic * (1.0 - 1e-6)).mean()) if atoms else 1.0
    return Scanned(tuple(atoms), tried, p)


def _batches(
    ground: Ground, form: Form, grid: Mapping[str, FloatArray]
) -> Iterator[tuple[dict[str, FloatArray], FloatArray]]:
    """The grid of a form, some values at a time, with their columns; what fails is left out."""
    count = next((values.size for values in grid.values()), 1)
    for start in range(0, count, _SOME):
        numbers = {name: values[start : start + _SOME] for name, values in grid.items()}
        columns = or_refusal(unit_columns)(ground, form, numbers, in_bins=False)
        if not isinstance(columns, ModelError):
            yield numbers, columns


def _turned(
    scores: FloatArray, gram: FloatArray, size: FloatArray
) -> tuple[FloatArray, np.ndarray]:
    """Scores (K, M, k) in an orthonormal basis, and which say anything: T is their length."""
    length = np.einsum("kii->ki", gram)
    good = np.all(length > _VISIBLE * np.maximum(size, 1e-300), axis=1)
    if scores.shape[-1] == 1:
        return scores / np.sqrt(np.where(good[:, None], length, 1.0))[:, None, :], good
    safe = np.where(good[:, None, None], gram, np.eye(2))
    first = np.sqrt(safe[:, 0, 0])
    slope = safe[:, 0, 1] / first
    rest = safe[:, 1, 1] - slope**2
    good = good & (rest > 1e-6 * safe[:, 1, 1])
    one = scores[:, :, 0] / first[:, None]
    two = (scores[:, :, 1] - slope[:, None] * one) / np.sqrt(np.where(good, rest, 1.0))[:, None]
    return np.stack([one, two], axis=-1), good


def _flipped(signs: FloatArray, turned: FloatArray) -> FloatArray:
    """T (F, K) under each pattern of signs, of scores (K, M, k)."""
    parts = [
        signs @ np.ascontiguousarray(turned[:, :, i].T, dtype=signs.dtype)
        for i in range(turned.shape[-1])
    ]
    return np.abs(parts[0]) if len(parts) == 1 else np.hypot(*parts)


# ---- polishing -----------------------------------------------------------------------------------


def columns_of(ground: Ground, atom: Atom) -> FloatArray:
    """The atom's columns, law and all, (C, m, k), in the observable's unit per amplitude."""
    factor = ground.law(atom.law.text, atom.law.numbers)
    return unit_columns(ground, atom.form, atom.numbers) * factor[:, None, None]


def strengths(ground: Ground, atom: Atom) -> tuple[FloatArray, float]:
    """The amplitudes (k,) of the linear fit, and the whitened sum of squares explained."""
    left = ground.without(ground.of_cells(columns_of(ground, atom)))
    residual = ground.residual.ravel()
    found = np.linalg.lstsq(left, residual, rcond=1e-9)[0]
    explained = ground.square - float(((residual - left @ found) ** 2).sum())
    return np.asarray(found, dtype=np.float64), explained


def polish(ground: Ground, atom: Atom) -> Atom:
    """The atom with its numbers and exponents where it explains most; what is `fixed` stays.

    By variable projection: amplitudes are solved for at every step.
    """
    own = list(atom.numbers)
    of_law = [name for name in atom.law.numbers if name not in atom.fixed]
    start = np.array(
        [atom.numbers[n] for n in own] + [atom.law.numbers[n] for n in of_law], dtype=np.float64
    )
    if not start.size:
        return replace(atom, explained=strengths(ground, atom)[1])
    bounds = np.array([atom.form.bounds(n) for n in own] + [LAW_BOUNDS[n] for n in of_law])
    # widths and rates by their logarithm, so that a step is a share of them
    logged = np.array(
        [atom.form.profile.numbers[n] != "place" for n in own] + [False] * len(of_law)
    )
    scale = np.where(logged, 1.0, np.maximum(0.05 * np.ptp(bounds, axis=1), 1e-12))

    def at(x: FloatArray) -> Atom:
        values = np.where(logged, np.exp(np.where(logged, x, 0.0)), x * scale)
        values = np.clip(values, bounds[:, 0], bounds[:, 1])
        named = dict(zip([*own, *of_law], values.tolist(), strict=True))
        law = replace(
            atom.law,
            numbers={n: named[n] if n in of_law else v for n, v in atom.law.numbers.items()},
        )
        return replace(
            atom,
            numbers={n: named[n] if n in own else v for n, v in atom.numbers.items()},
            law=law,
        )

    residual = ground.residual.ravel()
    kept: dict[tuple[float, ...], FloatArray] = {}

    @or_refusal
    def left(x: FloatArray) -> FloatArray:
        now = at(x)
        key = tuple(now.numbers.values())
        if key not in kept:  # a step in the law alone leaves the form
            kept.clear()
            unit = unit_columns(ground, now.form, now.numbers, in_bins=False)
            kept[key] = ground.of_cells(unit)
        factor = ground.law(now.law.text, now.law.numbers)
        columns = ground.without(kept[key] * factor[:, None, None])
        found = np.linalg.lstsq(columns, residual, rcond=1e-9)[0]
        return np.asarray(residual - columns @ found)

    def all_or_left(x: FloatArray) -> FloatArray:
        found = left(x)
        return residual if isinstance(found, ModelError) else found

    def turned(values: FloatArray) -> FloatArray:
        return np.where(logged, np.log(np.where(logged, values, 1.0)), values / scale)

    inside = np.clip(start, bounds[:, 0] * (1 + 1e-9) + 1e-12, bounds[:, 1] * (1 - 1e-9) - 1e-12)
    reached = least_squares(
        all_or_left,
        turned(inside),
        bounds=(turned(bounds[:, 0]) - 1e-6, turned(bounds[:, 1]) + 1e-6),
        max_nfev=_STEPS,
        diff_step=1e-4,
        xtol=1e-4,
        ftol=_SETTLED,
    )
    polished = at(reached.x)
    explained = ground.square - 2.0 * float(reached.cost)
    return replace(polished, explained=explained)
