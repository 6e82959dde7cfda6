"""One more term: polished atoms as effects of the model, refitted, and the simplest of the best.

atoms -> what each removes held out, linearly -> the leading ones refitted in the model
    -> least held-out loss; those that leave as little are as good, the simplest represents them
    -> exponents and phases rounded if that costs nothing
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtri, stdtrit  # quantiles, without the second of scipy.stats

from tirelog.diagnosis.candidates.assessment import flip_signs, gain_and_error, mean_drop
from tirelog.diagnosis.propose.grammar import (
    EXPONENTS,
    LAW_BOUNDS,
    LAW_UNITS,
    Form,
    Law,
    forms,
    laws,
)
from tirelog.diagnosis.propose.ground import Ground, typical
from tirelog.diagnosis.rules import CONTENDER, LEAST_SHARE_OF_FLOOR, QUIET_CHI2, REST_SHARE
from tirelog.errors import ModelError, or_refusal
from tirelog.inference.base import Base, refit
from tirelog.inference.floor import held_out_losses, steps_left_out
from tirelog.physics.model.model import Model, ModelEffect
from tirelog.physics.model.user_effects import (
    CONDITIONS,
    PLACES,
    effect_by_expression,
    parse_expression,
)
from tirelog.physics.spectral import Parameter
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import OBSERVABLES

# ---- The whole grammar on a ground: which forms say most, and by what chance.
#
# every form at every value of its grid, under every law -> T, and its flips of manoeuvres
#     -> p of the largest over the whole dictionary
# the best of each form -> its numbers and exponents polished by variable projection


@dataclass(frozen=True)
class Atom:
    """A form with its numbers, under a law: T, and the whitened sum of squares that it explains.

    `fixed`: numbers of the law that were rounded, and are not fitted. `left`: the loss held out
    with its columns free, `removed` the mean square [unit^2] that they remove there.
    """

    form: Form
    numbers: Mapping[str, float]
    law: Law
    statistic: float = 0.0
    explained: float = 0.0
    fixed: tuple[str, ...] = ()
    left: float = np.inf
    removed: float = 0.0

    @property
    def complexity(self) -> int:
        """What a reader has to take in: the form, and the law with its free numbers."""
        free, numbers = self.free, self.law.numbers
        gone = bool(numbers) and not free and not any(numbers.values())
        return self.form.profile.complexity + len(free) + (0 if gone else self.law.complexity)

    @property
    def free(self) -> list[str]:
        """The numbers of its law that are fitted."""
        return [name for name in self.law.numbers if name not in self.fixed]

    @property
    def form_key(self) -> tuple[str, str]:
        """What atoms of one form under several laws share."""
        return self.form.stage.name, self.form.words

    def at(self, values: Mapping[str, float]) -> Atom:
        """The atom with other values of some of its numbers, by name."""
        law, own = (
            {name: values.get(name, value) for name, value in known.items()}
            for known in (self.law.numbers, self.numbers)
        )
        return replace(self, numbers=own, law=replace(self.law, numbers=law))


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
    stage, shape = form.stage, ground.residual.shape
    given = {name: np.atleast_1d(value) for name, value in numbers.items()}
    count = max([value.size for value in given.values()], default=1)
    if not stage.acts_on:
        waves = ("cos", "sin") if form.wave else ("",)
        texts = [form.text.replace("@", wave) for wave in waves]
        spread = {name: value.reshape(-1, 1, 1) for name, value in given.items()}
        computed = ground.in_bins if in_bins else ground.expression
        each = [np.broadcast_to(computed(text, spread), (count, *shape)) for text in texts]
        return np.ascontiguousarray(np.moveaxis(np.stack(each, axis=1).reshape(-1, *shape), 0, -1))
    columns = []
    for i in range(count):
        own = {name: float(value[min(i, value.size - 1)]) for name, value in given.items()}
        parameters = [Parameter("A", "", "", stage.probe, -1e9, 1e9, stage.probe)]
        parameters += [
            Parameter(name, "", "", value, -1e9, 1e9, abs(value) + 1e-3, free=False)
            for name, value in own.items()
        ]
        body = f"A * ({stage.prefix}{form.text})"  # a wave is of the observable alone
        probe = effect_by_expression("probe_", stage.acts_on, body, tuple(parameters))
        columns.append(ground.response(probe, stage.probe))
    return np.stack(columns, axis=-1)


def scan(ground: Ground) -> tuple[list[Atom], float, int]:
    """The best atom of each form and law by falling T, p of the best by flips, how many were tried.

    That p is over every atom of the grammar.
    """
    given = laws(typical(ground.base))
    factors = np.stack([ground.law(law.text, law.numbers) for law in given])
    # patterns of signs that are tried: they tell p to 2.4e-4, and a p of 0.01 to 16 % of it; twice
    # as many tell it to 11 %, in twice the time. Of 13 manoeuvres the others are their mirror
    # images, which say the same
    signs = flip_signs(ground.manoeuvres)[:4096]
    signs = signs.astype(np.float32)
    largest, tried = np.zeros(signs.shape[0], np.float32), 0
    best: dict[tuple[str, str, str], Atom] = {}
    for form in forms():
        # columns of a form that are worked on at a time: 20 MB for 50 cells
        for numbers in form.grids(48):
            columns = or_refusal(unit_columns)(ground, form, numbers, in_bins=False)
            if isinstance(columns, ModelError):
                continue
            worth = ground.worth(ground.of_cells(columns), factors, 2 if form.wave else 1)
            turned, good = _turned(*worth)
            tried += int(good.sum())
            flipped = _flipped(signs, turned[good])
            np.maximum(largest, flipped.max(axis=1, initial=0.0), out=largest)
            statistic = np.zeros(good.size)
            statistic[good] = flipped[0]
            for law, own in zip(given, statistic.reshape(len(given), -1), strict=True):
                j = int(np.argmax(own))
                key = (form.stage.name, form.words, law.text)
                if own[j] > 0.0 and (key not in best or own[j] > best[key].statistic):
                    at = {name: float(value[j]) for name, value in numbers.items()}
                    best[key] = Atom(form, at, law, float(own[j]))
    atoms = sorted(best.values(), key=lambda atom: -atom.statistic)
    p = float((largest >= atoms[0].statistic * (1.0 - 1e-6)).mean()) if atoms else 1.0
    return atoms, p, tried


def _turned(
    scores: FloatArray, gram: FloatArray, size: FloatArray
) -> tuple[FloatArray, np.ndarray]:
    """Scores (K, M, k) in an orthonormal basis, and which say anything: T is their length."""
    length, identity = np.einsum("kii->ki", gram), np.eye(gram.shape[-1])
    # a column of which less than this is left beside base and nuisances says nothing of its own, as
    # for candidates; a share of squares: 1 % of a form's size, and with twice as much 1.4 %
    good = np.all(length > 1e-4 * np.maximum(size, 1e-300), axis=1)
    # two columns that are one, to a share of squares of 1e-6, get no sentence
    good &= np.linalg.det(gram) > 1e-6 * np.prod(length, axis=1)
    root = np.linalg.cholesky(np.where(good[:, None, None], gram, identity))
    return np.swapaxes(np.linalg.solve(root, np.swapaxes(scores, 1, 2)), 1, 2), good


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
    left, residual = (
        ground.without(ground.of_cells(columns_of(ground, atom))),
        ground.residual.ravel(),
    )
    found = np.asarray(np.linalg.lstsq(left, residual, rcond=1e-9)[0], dtype=np.float64)
    return found, ground.square - float(((residual - left @ found) ** 2).sum())


def polish(ground: Ground, atom: Atom) -> Atom:
    """The atom with its numbers and exponents where it explains most; what is `fixed` stays.

    By variable projection: amplitudes are solved for at every step.
    """
    names = [*atom.numbers, *atom.free]
    if not names:
        return replace(atom, explained=strengths(ground, atom)[1])
    known, residual = {**atom.law.numbers, **atom.numbers}, ground.residual.ravel()
    low, high = np.array([LAW_BOUNDS.get(n) or atom.form.bounds(n) for n in names]).T

    @lru_cache(maxsize=1)  # a step in the law alone leaves the form
    @or_refusal
    def of_form(numbers: tuple[float, ...]) -> FloatArray:
        own = dict(zip(atom.numbers, numbers, strict=True))
        return ground.of_cells(unit_columns(ground, atom.form, own, in_bins=False))

    def left(x: FloatArray) -> FloatArray:
        """What is left at these numbers; all of it where the model cannot be computed."""
        now = atom.at(dict(zip(names, x.tolist(), strict=True)))
        unit = of_form(tuple(now.numbers.values()))
        if isinstance(unit, ModelError):
            return residual
        columns = ground.without(unit * ground.law(now.law.text, now.law.numbers)[:, None, None])
        return np.asarray(residual - columns @ np.linalg.lstsq(columns, residual, rcond=1e-9)[0])

    reached = least_squares(
        left,
        np.clip([known[n] for n in names], low, high),
        bounds=(low, high),
        x_scale="jac",
        # a refit of the whole model follows; twice as many steps take longer before it
        max_nfev=20,
        diff_step=1e-4,
        xtol=1e-4,
        ftol=1e-4,
    )
    best = atom.at(dict(zip(names, reached.x.tolist(), strict=True)))
    return replace(best, explained=ground.square - 2.0 * float(reached.cost))


@dataclass(frozen=True)
class Draft:
    """An atom in a model: its entry, and the base refitted with it.

    `quarter`: the phase in quarter turns, None if it is free.
    """

    atom: Atom
    entry: ModelEffect
    base: Base
    quarter: int | None = None

    @property
    def text(self) -> str:
        return str(self.entry.source["expression"])

    @property
    def read(self) -> str:
        """The formula with its fitted exponents as numbers, to read."""
        numbers = self.atom.law.numbers
        found = rf"\*\* ({'|'.join(EXPONENTS)})\b"
        return re.sub(found, lambda one: f"** {numbers.get(one[1], 0.0):.2g}", self.text)


@dataclass(frozen=True)
class Choice:
    """The drafts of a term: the chosen one, those as good, and all that were refitted.

    `p`: of the best form by flips, over all that were `tried`.
    """

    chosen: Draft
    as_good: tuple[Draft, ...]
    refitted: tuple[Draft, ...]
    p: float = 1.0
    tried: int = 0


def entry_of(
    atom: Atom,
    amplitudes: FloatArray,
    name: str,
    observable: str,
    quarter: int | None = None,
) -> ModelEffect:
    """The atom as an effect of a model.

    `amplitudes` (1,) of its column, or (2,) of cosine and sine; a phase is at a quarter turn if
    one is given. ModelError if a number is outside of its bounds.
    """
    form, parameters, text = atom.form, [], atom.form.text
    size = float(np.hypot(*amplitudes)) if form.wave else float(amplitudes[0])
    if form.wave and quarter is None:
        text = f"{text[:-1].replace('@(', 'sin(')} + psi)"  # a wave is the end of its formula
        phase = float(np.arctan2(amplitudes[0], amplitudes[1]))
        parameters.append(Parameter("psi", "rad", "phase", phase, -7.0, 7.0, 0.5))
    elif form.wave and quarter is not None:
        text = text.replace("@", "sin" if quarter % 2 == 0 else "cos")
        size *= 1.0 if quarter % 4 < 2 else -1.0
    free = atom.free
    factors = (atom.law.written(free), form.stage.prefix.removesuffix(" * "), text * (text != "1"))
    body = " * ".join(factor for factor in factors if factor)
    expression = ast.unparse(ast.parse(f"A * {body}" if body else "A", mode="eval"))
    large = max(abs(size), 1e-12)
    unit = form.stage.unit or OBSERVABLES[observable].unit
    # the bound keeps a descent from running away; an amplitude that settles is the same with twice
    # as much
    most = 100.0 * large
    parameters.append(Parameter("A", unit, "strength", size, -most, most, 0.1 * large))
    numbers = [(n, v, form.bounds(n), form.unit(n)) for n, v in atom.numbers.items()]
    numbers += [(n, atom.law.numbers[n], LAW_BOUNDS[n], LAW_UNITS[n]) for n in free]
    for number, value, (low, high), its_unit in numbers:
        inside = float(np.clip(value, low, high))
        probe = max(0.1 * abs(inside), 1e-3 * (high - low))
        parameters.append(Parameter(number, its_unit, "", inside, low, high, probe))
    known = {*PLACES, *CONDITIONS, *(p.name for p in parameters)}
    names = parse_expression(expression, known).names
    used = tuple(p for p in parameters if p.name in names)
    acts_on = form.stage.acts_on or observable
    effect = effect_by_expression(name, acts_on, expression, used)
    return ModelEffect(effect, used, {}, {"acts_on": acts_on, "expression": expression})


def polished(ground: Ground, atoms: Sequence[Atom]) -> list[Atom]:
    """The best atom of each form, and other laws of the first of them, polished."""
    best: dict[tuple[str, str], Atom] = {}
    for atom in atoms:
        best.setdefault(atom.form_key, atom)
    # twice as many of either take twice as long
    leading = list(best.values())[:8]
    first, taken = [atom.form_key for atom in leading[:2]], {id(atom) for atom in leading}
    others = [a for a in atoms if a.form_key in first and id(a) not in taken][:3]
    tried = [or_refusal(polish)(ground, atom) for atom in [*leading, *others]]
    found = [atom for atom in tried if not isinstance(atom, ModelError)]
    return sorted(found, key=lambda atom: -atom.explained)


@or_refusal
def _held_out(full: Ground, atom: Atom) -> Atom:
    """The atom with what it leaves held out, its columns free."""
    base = full.base
    columns = columns_of(full, atom)
    white, plain = held_out_losses(base.cells, base.white, base.plain, base.fit, columns)
    return replace(atom, left=float(white.sum()), removed=mean_drop(base, plain))


def _without_needless_laws(atoms: Sequence[Atom], base: Base) -> list[Atom]:
    """The atoms without those whose law does no more than a simpler one of the same form."""
    least = max(LEAST_SHARE_OF_FLOOR * base.floor.square, REST_SHARE * base.excess)
    kept: list[Atom] = []
    for atom in sorted(atoms, key=lambda atom: atom.complexity):
        same = [other for other in kept if other.form_key == atom.form_key]
        if all(atom.removed - other.removed >= least for other in same):
            kept.append(atom)
    return [atom for atom in atoms if any(atom is one for one in kept)]


def choose(full: Ground, atoms: Sequence[Atom], name: str) -> Choice | None:
    """The leading atoms refitted in the model, and the simplest of the best; None if all fail."""
    tried = [_held_out(full, atom) for atom in atoms]
    scored = sorted((a for a in tried if not isinstance(a, ModelError)), key=lambda a: a.left)
    near = [atom for atom in scored if atom.removed >= CONTENDER * scored[0].removed]
    near = _without_needless_laws(near, full.base)
    leading = near[:4]  # each takes a fit of the whole model
    stages = {atom.form.stage.name for atom in leading}
    leading += [atom for atom in near if atom.form.stage.name not in stages][:1]
    refitted = [_drafted(full, atom, name) for atom in leading]
    drafts = [draft for draft in refitted if isinstance(draft, Draft)]
    if not drafts:
        return None
    drafts.sort(key=lambda draft: float(draft.base.held_white.sum()))
    best = drafts[0].base
    good = [draft for draft in drafts if _as_good(best, draft.base, full.base.excess)]
    good.sort(key=lambda d: (d.atom.complexity, float(d.base.held_white.sum())))
    # the same form under a law that holds the simpler one is no other answer; more than three make
    # a longer answer
    other = [d for d in good[1:] if d.atom.form_key != good[0].atom.form_key][:2]
    return Choice(good[0], (good[0], *other), tuple(drafts))


@or_refusal
def _drafted(full: Ground, atom: Atom, name: str) -> Draft | None:
    """The atom refitted in the model; None if that fails or ends above the base."""
    base = full.base
    entry = entry_of(atom, strengths(full, atom)[0], name, base.model.observable)
    new = refit(base, base.model.with_entry(entry))
    if isinstance(new, ModelError) or new.fit.chi2 > base.fit.chi2:
        return None
    return _read(atom, entry, new)


def _read(atom: Atom, entry: ModelEffect, new: Base, quarter: int | None = None) -> Draft:
    """The draft with the numbers of its atom as they were fitted."""
    own = {p.name: new.model.values[f"{entry.id}.{p.name}"] for p in entry.parameters}
    return Draft(atom.at(own), entry, new, quarter)


def _as_good(best: Base, other: Base, excess: float) -> bool:
    """Does another refit leave as little held out?

    By what is too small to matter; or by its error, if it leaves little more of the excess: where
    manoeuvres differ in size their scatter alone excuses too much.
    """
    worse, error = gain_and_error(other.held_white, best.held_white)
    more = other.square_held - best.square_held
    # with twice the error more forms are as good as the first
    near = worse < error and more < REST_SHARE * excess
    return near or more < LEAST_SHARE_OF_FLOOR * best.floor.square


def simplified(draft: Draft) -> Draft:
    """The draft with exponents at whole numbers, or halves, and the phase at a quarter turn.

    Each if that costs nothing. Its base is settled: rounding is judged by the noise.
    """
    best = draft
    for number in (name for name in EXPONENTS if name in draft.atom.free):
        value = best.atom.law.numbers[number]
        for wanted in dict.fromkeys((float(round(value)), round(2.0 * value) / 2.0)):
            atom = replace(best.atom.at({number: wanted}), fixed=(*best.atom.fixed, number))
            trial = _with_fixed(best, atom, best.quarter)
            # a step of an exponent that is small: over a decade of speed an effect changes by 12 %
            # at most, and no law that is known lies so near to a half; twice as much would round
            # 0.4
            near = abs(wanted - value) <= 0.05
            if isinstance(trial, Draft) and _costs_nothing(best.base, trial.base, small=near):
                best = trial
                break
    if best.atom.form.wave:
        phase = best.base.model.values[f"{best.entry.id}.psi"]
        trial = _with_fixed(best, best.atom, round(phase / (0.5 * np.pi)) % 4)
        if isinstance(trial, Draft) and _costs_nothing(best.base, trial.base):
            best = trial
    return best


@or_refusal
def _with_fixed(draft: Draft, atom: Atom, quarter: int | None) -> Draft | ModelError:
    """The draft with some of its numbers given, fitted again from where it is."""
    base, name = draft.base, draft.entry.id
    phase = base.model.values.get(f"{name}.psi", 0.0)
    turned = np.array([np.sin(phase), np.cos(phase)]) if atom.form.wave else np.ones(1)
    amplitudes = base.model.values[f"{name}.A"] * turned
    entry = entry_of(atom, amplitudes, name, base.model.observable, quarter)
    new = refit(base, base.model.without_effect(name).with_entry(entry))
    return new if isinstance(new, ModelError) else _read(atom, entry, new, quarter)


def _costs_nothing(before: Base, rounded: Base, *, small: bool = False) -> bool:
    """Is a rounded number as good: by chi-square, or, of a form that is not right, held out?

    Held out too if the step is `small`: of a large effect chi-square sees more than matters.
    """
    worse = rounded.noise_chi2 - before.noise_chi2
    # standard errors that a number may lie from a round one: beyond them rounding would push the
    # others out of their errors; twice as much makes rounder formulas that fit worse
    near = worse <= 2.0**2 * max(1.0, before.reduced_chi2)
    held_out = small or before.reduced_chi2 > QUIET_CHI2
    return near or (held_out and _as_good(before, rounded, before.excess))


def with_covering_errors(base: Base, effects: Sequence[str]) -> Model:
    """The base's model, whose standard errors of these effects' numbers cover.

    The error of a fit knows noise and the random effects that it models. Where manoeuvres scatter
    in another way, or a form is not quite right, what leaving each of them out does to a number
    tells more: the larger of the two is its error.
    """
    moved = steps_left_out(base.cells, base.white, base.fit)
    M = moved.shape[0]
    # as wide as a normal distribution's error would have to be for the same 95 %
    spread = np.sqrt(M - 1) * moved.std(axis=0) * float(stdtrit(M - 1, 0.975) / ndtri(0.975))
    error = dict(zip(base.fit.names, spread.tolist(), strict=True))
    known = {name: p for name, p in base.model.parameters.items() if name in error}
    changed = {
        name: replace(p, se=max(p.se, error[name]))
        for name, p in known.items()
        if name.partition(".")[0] in effects and p.se is not None
    }
    return base.model.with_parameters(changed)
