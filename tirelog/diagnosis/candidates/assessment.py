"""What each candidate would do to the waveforms of these cells, and the evidence for it.

Columns (C, m, k), which candidates cannot be tested, and why; whether what a model leaves is noise.

A signature is the change of the fitted model's prediction by the effect at its probe strength, per
unit of strength. It has one column per strength parameter. If an effect has shape parameters (the
width of a pulse, a time constant), it is tried at a few values of each. These are its variants: the
one with the largest statistic represents the effect (all take part in the family-wise maximum).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Self

import numpy as np

from tirelog.diagnosis.rules import (
    ALARM_P,
    BEYOND_DOUBT_P,
    ERROR_SIGMAS,
    GAIN_SIGMAS,
    LEAST_SHARE_OF_FLOOR,
    MOST,
    QUIET_CHI2,
    QUIET_FLOORS,
)
from tirelog.errors import ModelError, or_refusal
from tirelog.inference.base import Base, bases_by_observable, change_to
from tirelog.inference.cells.cells import Cells, embedded, lacking
from tirelog.inference.floor import held_out_losses_with
from tirelog.inference.metric import Offsets, per_group, side_by_side, stacked
from tirelog.inference.nuisances import FORM
from tirelog.physics.carcass.numbers import steady_carcass
from tirelog.physics.effects import BY_ID, Effect, readers
from tirelog.physics.model.model import Model, ModelEffect, why_idle
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.conditions import CONDITIONS
from tirelog.vocabulary.observables import OWN_ZERO


@dataclass(frozen=True)
class Variant:
    """A candidate at values of its shape parameters, and the evidence for it once that is known.

    columns    (C, m, k), what each of its `strengths` does to the observable, per unit of it
    shape      the shape parameters it holds at; one_sided  only a positive strength is physical
    statistic, p  by flips of manoeuvres, p family-wise;  step  (k,) the strengths of the linear fit
    gain, gain_error  held out;  removed  mean square [unit^2]
    """

    effect: Effect
    strengths: tuple[str, ...]
    shape: Mapping[str, float]
    columns: FloatArray
    one_sided: bool
    statistic: float = 0.0
    p: float = 1.0
    step: FloatArray = field(default_factory=partial(np.zeros, 0))
    gain: float = 0.0
    gain_error: float = np.inf
    removed: float = 0.0

    @property
    def id(self) -> str:
        return self.effect.id

    @property
    def without_columns(self) -> Self:
        """The same once its columns have served."""
        return replace(self, columns=np.zeros((0, 0, 0)))

    def alarms(self, base: Base) -> bool:
        """All three rules: significance, held-out gain, size beside what the base leaves.

        The size of what is beyond doubt is judged once it is refitted: if manoeuvres scatter,
        held-out errors do not tell it.
        """
        large = self.removed > LEAST_SHARE_OF_FLOOR * base.floor.square
        return (
            self.p <= ALARM_P
            and surely_gains(self.gain, self.gain_error, self.p, base.share(self.removed))
            and (large or self.p <= BEYOND_DOUBT_P)
        )


def candidate_effects(
    model: Model, extra: Iterable[Effect] = (), *, tried: bool = True
) -> list[Effect]:
    """The catalogue and the user's own effects, for this observable and carcass.

    Without what the model holds already, and what acts on nothing in it. Those that a search does
    not try, if `tried` is False.
    """
    beside = [held.effect for held in model.effects]
    held = {FORM, *(effect.id for effect in beside)}
    return [
        effect
        for effect in {**BY_ID, **{effect.id: effect for effect in extra}}.values()
        if effect.id not in held
        and effect.tried == tried
        and model.acted_on_by(effect, beside)
        and not (effect.beam_only and steady_carcass(model.carcass) == "ring")
    ]


def idle_candidates(model: Model, extra: Iterable[Effect] = ()) -> dict[str, str]:
    """Effects that act on nothing in this model, and why: the user's own, and ours that would act
    on its observable beside another effect.
    """
    beside = [held.effect for held in model.effects]
    held = {effect.id for effect in beside}
    own = {effect.id: effect for effect in extra}
    return {
        effect.id: why_idle(effect, model.observable)
        for effect in {**BY_ID, **own}.values()
        if effect.id not in held
        and effect.tried
        and not model.acted_on_by(effect, beside)
        and (effect.id in own or any(readers(effect, one) for one in model.observables))
    }


def variants(effect: Effect) -> list[dict[str, float]]:
    """Values of the free shape parameters to try: their start, then each moved alone."""
    shapes = [p for p in effect.parameters if p.name not in effect.strength and p.free]
    start = {p.name: p.value for p in shapes}
    # shape parameters are tried at these factors of their probe
    tried = [(p.name, float(np.clip(f * p.probe, p.min, p.max))) for p in shapes for f in (0.5, 2)]
    return [start, *({**start, name: value} for name, value in tried if value != start[name])]


def with_candidate(model: Model, effect: Effect, values: Mapping[str, float]) -> Model:
    """The model with the effect at these values, clipped to the bounds.

    Strengths that are not given are zero.
    """
    at = {**dict.fromkeys(effect.strength, 0.0), **values}
    clipped = {
        p.name: float(np.clip(at[p.name], p.min, p.max)) for p in effect.parameters if p.name in at
    }
    return model.with_effect(ModelEffect.of(effect), **clipped)


@or_refusal
def signatures_of(base: Base, effect: Effect) -> list[Variant] | ModelError:
    """All variants of one candidate, or why it cannot be tested on these cells."""
    cells, model = base.cells, base.model
    blocks = [one.cells for one in base.blocks]
    if missing := dict.fromkeys(name for own in blocks for name in lacking(effect, model, own)):
        raise ModelError(f"needs {', '.join(missing)}")
    refuse_stand_in(effect, model, blocks)
    own, result = {p.name: p for p in effect.parameters}, []
    size = float(np.nanmax(np.abs(base.fit.prediction)))
    for shape in variants(effect):
        columns = {}
        for name in effect.strength:
            added = with_candidate(model, effect, {**shape, name: own[name].probe})
            change = change_to(base, added.resolved(cells.conditions))
            if isinstance(change, ModelError):
                return change
            # a change below this share of the waveform is rounding; doubling it decides nothing,
            # since what acts at its probe strength does far more
            if np.nanmax(np.abs(change)) > 1e-9 * size:
                columns[name] = change / own[name].probe
        if not columns:
            continue
        changes, names = list(columns.values()), tuple(columns)
        if np.unique(cells.log).size > 1 and all(_moves_zeros_alone(cells, x) for x in changes):
            raise ModelError(
                "differs from log to log alone, and each log counts the "
                f"{' and '.join(OWN_ZERO)} from a zero of its own"
            )
        single = len(names) == 1 and own[names[0]].min >= 0.0 and own[names[0]].probe > 0
        result.append(Variant(effect, names, shape, np.stack(changes, axis=-1), single))
    if not result:
        raise ModelError(
            "does nothing under these conditions (a quantity it follows is zero or does not vary)"
        )
    return result


def refuse_stand_in(effect: Effect, model: Model, blocks: Sequence[Cells]) -> None:
    """ModelError if the effect replaces what is measured, in all observables that it acts on."""
    acted_on = [cells for cells in blocks if model.acts_on(effect, cells.observable)]
    stands_for = [effect.stands_for.get(cells.observable, ()) for cells in acted_on]
    measured = all(
        np.isfinite(getattr(cells.conditions, name)).all()
        for cells, own in zip(acted_on, stands_for, strict=True)
        for name in own
    )
    if acted_on and all(stands_for) and measured:
        names = dict.fromkeys(name for own in stands_for for name in own)
        raise ModelError(f"replaces {' and '.join(names)}, which is measured")


def _moves_zeros_alone(cells: Cells, change: FloatArray) -> bool:
    """True if a change (C, m) is the same all along each log, of what has a zero of its own."""
    moved = change.copy()
    for log in np.unique(cells.log):  # of several observables each numbers its logs apart
        own = cells.log == log
        if cells.members[cells.part[own][0]].observable in OWN_ZERO:
            moved[own] -= np.nanmean(change[own])
    # what differs by less than this share of a change within a log is its zero; a tenth of it is
    # what a pressure moves while the tire warms in a minute, and twice as much decides nothing
    return bool(np.nanmax(np.abs(moved)) < 0.05 * np.nanmax(np.abs(change)))


def all_signatures(base: Base, effects: Iterable[Effect]) -> tuple[list[Variant], dict[str, str]]:
    """Signatures of all candidates, and the reasons of those that are not tested."""
    tried = {effect.id: signatures_of(base, effect) for effect in effects}
    found = [s for own in tried.values() if not isinstance(own, ModelError) for s in own]
    return found, {n: own.what for n, own in tried.items() if isinstance(own, ModelError)}


# ---- Free shapes over the angle: what a form that is somewhat wrong could leave of an effect.


#: nodes of free shapes over the wheel's angle [rad]: 3 degrees apart about the patch, 10 beyond;
#: half as many lose the edges of the patch, twice as many measure noise
ANGLES = np.r_[-180:-60:10.0, -60:60:3.0, 60:181:10.0] * (np.pi / 180.0)


def hats_on(x: FloatArray, nodes: FloatArray, period: float | None = None) -> FloatArray:
    """Linear B-splines on nodes (k,), at x (...): (..., k); nothing outside the nodes."""
    if period is not None:
        x = (x - nodes[0]) % period + nodes[0]
    out = np.zeros((*x.shape, nodes.size))
    inside = (x >= nodes[0]) & (x <= nodes[-1])
    i = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, nodes.size - 2)
    share = (x - nodes[i]) / (nodes[i + 1] - nodes[i])
    np.put_along_axis(out, i[..., None], np.where(inside, 1.0 - share, 0.0)[..., None], -1)
    np.put_along_axis(out, (i + 1)[..., None], np.where(inside, share, 0.0)[..., None], -1)
    return out


def hats(phi: FloatArray) -> FloatArray:
    """Free shapes over the angle, (C, m) to (C, m, k): hats all around the wheel."""
    found = hats_on(np.nan_to_num(phi), ANGLES, 2.0 * np.pi)
    found[..., 0] += found[..., -1]  # half a turn before the patch and after it are one place
    return found[..., :-1]


def freedom_of_shape(base: Base, effect_id: str) -> FloatArray:
    """Columns (C, m, k): an effect's size per cell times free shapes over the angle.

    A form that is somewhat wrong keeps its symmetry: if the effect's own contribution is even
    (or odd) about the patch centre, so are the shapes.
    """
    if base.channels:
        parts = bases_by_observable(base)
        each = [
            embedded(base.cells, i, freedom_of_shape(part, effect_id))
            for i, part in enumerate(parts)
            for e in part.model.effects
            if e.id == effect_id and part.model.acts_on(e.effect, part.cells.observable)
        ]
        if all(part.cells.member for part in parts):  # the tire's shape is one to all
            return np.asarray(sum(each), dtype=np.float64)
        return np.concatenate(each, axis=-1)
    weight, phi = base.plain.weights, base.cells.phi
    contribution = np.nan_to_num(_contribution(base, effect_id)) * weight
    size, strength, shape = np.linalg.svd(contribution, full_matrices=False)
    loading = size[:, 0] * strength[0] / np.maximum(weight.max(axis=1), 1e-300)
    here, even = hats(phi), even_share(shape[0], np.nanmean(phi, axis=0))
    # share of a contribution's energy that makes it even, or odd: the other part is a quarter as
    # large at most; with twice the rest, a third
    if max(even, 1.0 - even) > 0.95:
        here += np.sign(even - 0.5) * hats(-phi)
        here = here[..., : here.shape[-1] // 2 + 1]  # symmetric pairs once
    loading /= max(float(np.abs(loading).max()), 1e-300)
    return np.asarray(loading[:, None, None] * here)


def _contribution(base: Base, effect_id: str) -> FloatArray:
    """What an effect of the fitted model adds, (C, m); its tangent if nothing holds without it."""
    others = tuple(e for e in base.model.effects if e.id != effect_id)
    lost = change_to(base, replace(base.model, effects=others))
    if not isinstance(lost, ModelError):
        return -lost
    (own,) = (e for e in base.model.effects if e.id == effect_id)
    strengths = [f"{effect_id}.{name}" for name in own.effect.strength]
    values = [base.model.values[n] * (n in strengths) for n in base.fit.names]
    return np.asarray(base.fit.jacobian @ np.array(values))


def even_share(shape: FloatArray, phi: FloatArray) -> float:
    """Share of the energy of a shape (m,) at angles (m,) that is even about zero."""
    mirrored = np.interp(-phi, phi, shape, period=2.0 * np.pi)
    return float((((shape + mirrored) / 2.0) ** 2).sum() / ((shape**2).sum() + 1e-300))


# ---- All candidates against one fitted model: statistic, family-wise p, held-out gain, size.
#
# Base, signatures
#     -> whitened, base Jacobian and offsets projected out -> scores by manoeuvre -> `selection`
#     -> held-out losses with the candidate's columns added
#        -> gain (whitened) and removal (mean square)


# ---- Whether an effect is there: significance, held-out gain and size.
#
# Joint sign flips of manoeuvres with the maximum over candidates, leave-one-manoeuvre-out gain, and
# the size rule.
#
#     scores (M, k) of each candidate: inner product of its projected signature with the projected
#         residual, manoeuvre by manoeuvre
#     T = | L^-1 sum of scores |, L L' = Gram of the projected signature (one column: sum / norm;
#     only
#         its sign if one is physical)
#     the same signs for all candidates flip a manoeuvre as a whole; p of a candidate = share of
#     flips
#         whose *largest* T reaches its T
#
# If nothing is missing a manoeuvre's scores are as likely to point one way as the other, whatever
# the
# correlation inside the manoeuvre: the rate of false alarms over all candidates is p. The
# smallest p
# that M manoeuvres allow is 2^-M, or 2^(1-M) if both signs count.


#: up to so many manoeuvres all patterns of signs are tried, 2^13; each more doubles the time
_EXACT = 13
#: and beyond them so many random ones, some at a time: they tell a p of ALARM_P to 8 % of it; twice
#: as many to 5.5 %
_RANDOM = 16383
#: patterns of signs that are drawn at a time, in so much less memory
_BLOCK = 1024


@dataclass(frozen=True)
class Scores:
    """One signature's evidence: scores (M, k), Gram (k, k).

    `one_sided` if only a positive strength is physical (k = 1).
    """

    scores: FloatArray
    gram: FloatArray
    one_sided: bool = False

    @classmethod
    def of(
        cls, base: Base, left: FloatArray, residual: FloatArray, one_sided: bool = False
    ) -> Scores:
        """Of whitened columns (C, m, k) and residual (C, m), both with the base taken out."""
        by_cell = (np.swapaxes(left, 1, 2) @ residual[..., None])[..., 0]
        flat = stacked(left)
        return cls(per_group(by_cell, base.cells.manoeuvre), flat.T @ flat, one_sided)

    def root(self) -> FloatArray:
        """(k, r) W with T = | scores W |.

        The inverse root of the Gram matrix on its support, whatever units the strengths have.
        """
        length = np.sqrt(np.diag(self.gram))
        length = np.where(length > 0.0, length, np.inf)
        values, vectors = np.linalg.eigh(self.gram / length[:, None] / length)
        keep = values > 1e-8 * max(float(values[-1]), 1e-300)
        return np.asarray(vectors[:, keep] / np.sqrt(values[keep]) / length[:, None])

    def step(self) -> FloatArray:
        """The strengths (k,) of the linear fit."""
        root = self.root()
        return np.asarray(root @ (root.T @ self.scores.sum(axis=0)))


def least_p(manoeuvres: int) -> float:
    """The smallest p that the test can give for a one-sided question.

    What is within twice of it is "at most" that.
    """
    return 0.5**manoeuvres if manoeuvres <= _EXACT else 1.0 / (_RANDOM + 1)


def flip_signs(manoeuvres: int) -> FloatArray:
    """Sign patterns of the manoeuvres, (F, M) of +-1.

    All of them up to 13 manoeuvres, else random ones; the first is what was measured.
    """
    if manoeuvres <= _EXACT:
        bits = (np.arange(2**manoeuvres)[:, None] >> np.arange(manoeuvres)) & 1
        return np.asarray(1.0 - 2.0 * bits, dtype=np.float64)
    random, signs = np.random.default_rng(0), np.empty((_RANDOM + 1, manoeuvres))
    for block in np.split(signs, (_RANDOM + 1) // _BLOCK):
        block[:] = random.integers(0, 2, block.shape) * 2.0 - 1.0
    signs[0] = 1.0
    return signs


def statistics(candidates: Sequence[Scores], signs: FloatArray) -> FloatArray:
    """T of every candidate under every flip, (F, K)."""
    result = np.zeros((signs.shape[0], len(candidates)))
    for i, candidate in enumerate(candidates):
        root = candidate.root()
        flipped = signs @ (candidate.scores @ root)
        if candidate.one_sided and root.size:
            result[:, i] = np.maximum(np.sign(root[0, 0]) * flipped[:, 0], 0.0)
        else:
            result[:, i] = np.linalg.norm(flipped, axis=1)
    return result


def flip_test(candidates: Sequence[Scores], manoeuvres: int) -> tuple[FloatArray, FloatArray]:
    """(T (K,), family-wise p (K,)) of the candidates."""
    all_t = statistics(candidates, flip_signs(manoeuvres))
    largest = np.sort(all_t.max(axis=1, initial=0.0))
    reached = largest.size - np.searchsorted(largest, all_t[0] * (1.0 - 1e-9), side="left")
    return all_t[0], reached / largest.size


def surely_gains(gain: float, error: float, p: float, share: float) -> bool:
    """Is a held-out gain more than the scatter of manoeuvres?

    `p` of what gains, family-wise; `share` of the excess that it removes held out. What can be
    gained differs with what each manoeuvre is driven under: of an effect of few of them the gains
    scatter by as much as they are. If their signs agree beyond doubt and most of the excess goes,
    that scatter is no doubt.
    """
    return gain > GAIN_SIGMAS * error or (p <= BEYOND_DOUBT_P and share >= MOST)


def gain_and_error(before: FloatArray, after: FloatArray) -> tuple[float, float]:
    """Held-out gain, summed over manoeuvres (M,), and its standard error from their scatter.

    Any two gains share all training manoeuvres but one each, so they are not independent: to the
    variance 1 / M of a mean comes test over training, 1 / (M - 1) (Nadeau and Bengio, Machine
    Learning 52 (2003) 239).
    """
    gain, M = before - after, before.size
    if M < 2:
        return float(gain.sum()), float("inf")
    error = M * np.sqrt(1.0 / M + 1.0 / (M - 1.0)) * gain.std(ddof=1)
    return float(gain.sum()), float(error)


def mean_drop(base: Base, after: FloatArray) -> float:
    """What goes of the held-out mean square [unit^2] with the losses `after` (M,)."""
    return float((base.held_plain - after).sum()) / base.plain.weight


def gain_sigmas(before: FloatArray, after: FloatArray) -> float:
    """A held-out gain in its standard errors; 0 without an error."""
    gain, error = gain_and_error(before, after)
    return gain / error if error > 0.0 else 0.0


def beside_base(base: Base, more: FloatArray | None = None) -> tuple[Offsets, FloatArray]:
    """(what the base takes out, the whitened residual (C, m) that it leaves).

    Its Jacobian, logs' offsets and `more` (C, m, k), in the observable's unit.
    """
    parts = [base.fit.moving] if more is None else [base.fit.moving, more]
    taken = Offsets.of(base.cells, base.white).beside(side_by_side(base.white, parts))
    measured = np.isfinite(base.cells.values)
    left = np.where(measured, base.cells.values - base.fit.prediction, 0.0)
    return taken, taken.without(base.white(left))


def assess(base: Base, signatures: Sequence[Variant]) -> tuple[list[Variant], dict[str, str]]:
    """Every candidate's best variant, by falling statistic; and why some show nothing."""
    kept, scores, reasons = scores_of(base, signatures)
    statistic, p = flip_test(scores, base.cells.manoeuvres)
    best, found = dict[str, int](), []
    for i, name in enumerate(signature.id for signature in kept):
        best[name] = max(best.get(name, i), i, key=lambda at: statistic[at])
    columns = [[kept[i].columns] for i in best.values()]
    losses = held_out_losses_with(base.cells, base.white, base.plain, base.fit, columns)
    for i, (white, plain) in zip(best.values(), losses, strict=True):
        gain, error = gain_and_error(base.held_white, white)
        found.append(
            replace(
                kept[i],
                statistic=float(statistic[i]),
                p=float(p[i]),
                step=scores[i].step(),
                gain=gain,
                gain_error=error,
                removed=mean_drop(base, plain),
            )
        )
    untested = {name: why for name, why in reasons.items() if name not in best}
    return sorted(found, key=lambda a: -a.statistic), untested


def least_left(base: Base, assessed: Sequence[Variant]) -> float:
    """Held-out mean square [unit^2] above the floor, with one or all of the candidates.

    Linear fits, whichever leaves less: of all at once, columns may be too many for the manoeuvres.
    """
    if not assessed:
        return base.excess
    columns = [[a.columns for a in assessed]]
    ((_, held),) = held_out_losses_with(base.cells, base.white, base.plain, base.fit, columns)
    return base.excess - max(mean_drop(base, held), *(a.removed for a in assessed))


def scores_of(
    base: Base, signatures: Sequence[Variant], more: FloatArray | None = None
) -> tuple[list[Variant], list[Scores], dict[str, str]]:
    """The signatures that show something of their own, their scores, and why others do not."""
    taken, residual = beside_base(base, more)
    kept, scores, reasons = [], [], dict[str, str]()
    for signature in signatures:
        white = base.white(signature.columns)
        left = taken.without(white)
        visible = np.linalg.norm(stacked(left), axis=0) / np.linalg.norm(stacked(white), axis=0)
        # a projected signature with less than this share of its norm left shows nothing of its own:
        # the effect would have to be a thousand times as large as what is seen of it; twice as much
        # refuses effects that are seen to a five hundredth
        if not np.any(visible > 1e-3):
            reasons[signature.id] = (
                "cannot be separated from the model's own parameters in these logs"
            )
            continue
        left[..., visible <= 1e-3] = 0.0  # of a strength that shows nothing rounding is left
        kept.append(signature)
        scores.append(Scores.of(base, left, residual, signature.one_sided))
    return kept, scores, reasons


# ---- Where logs or fitted numbers leave the ranges in which a model's effects are valid.


# ---- Whether what a model leaves is the noise floor.


def at_noise_floor(base: Base, floor_square: float) -> bool:
    """Is what the model leaves the noise floor?  By the held-out error and by chi-square.

    Of a held-out error goes what chance adds to it, since few manoeuvres decide the parameters, and
    of a chi-square: that of the 64 values of a number per revolution is above 1.2 in one of eight
    logs in which nothing is missing. Of several observables each has to be at its own: the mean of
    three hides what one is above it.
    """
    if base.channels and not all(
        at_noise_floor(part, part.floor.square)
        for part in bases_by_observable(base, held_by_all=True)
    ):
        return False
    if base.reduced_chi2 > QUIET_CHI2 + ERROR_SIGMAS * np.sqrt(2.0 / base.fit.freedom):
        return False
    above = base.square_held - QUIET_FLOORS**2 * floor_square
    if above <= 0.0:
        return True
    mean, spread = base.of_errors
    return above <= mean + ERROR_SIGMAS * spread


def quiet_waveforms(base: Base) -> bool:
    """Is what the model leaves of the waveforms the noise floor?

    Of a number per revolution it may be more: no nuisance of wheel, road or day acts on one.
    """
    parts = bases_by_observable(base, held_by_all=True)
    waveforms = [part for part in parts if part.cells.phi.shape[1] > 1]
    if len(waveforms) == len(parts):
        return at_noise_floor(base, base.floor.square)
    return all(at_noise_floor(part, part.floor.square) for part in waveforms)


def out_of_range(base: Base) -> list[str]:
    """A remark for each range of an effect of the fitted model that is left; none if it is off.

    A log's conditions are judged by the means of similar revolutions, which are fitted; one
    that is not known leaves no range.
    """
    model, cells, said = base.model, base.cells, []
    for entry in model.effects:
        effect, values = entry.effect, entry.values(model.values)
        is_on = effect.is_on(values, steady_carcass(model.carcass))
        for name, (low, high) in effect.valid_range.items() if is_on else ():
            condition = CONDITIONS.get(name)
            if condition is None:
                unit = next(p.unit for p in entry.parameters if p.name == name)
                if not low <= values[name] <= high:
                    said.append(
                        f"{effect.id} is valid for {name} {_range(low, high, unit)}; "
                        f"its value is {values[name]:.4g}"
                    )
                continue
            x = getattr(cells.conditions, name)
            outside = int(cells.revolutions[(x < low) | (x > high)].sum())
            if outside:
                said.append(
                    f"{effect.id} is valid for {condition.name} "
                    f"{_range(low, high, condition.unit)}; {outside} of "
                    f"{int(cells.revolutions.sum())} revolutions are outside, by means of "
                    "similar ones"
                )
    return said


def _range(low: float, high: float, unit: str) -> str:
    """`from 2 to 40 m/s`, or one bound if there is no other."""
    after = "" if unit == "1" else f" {unit}"
    if np.isinf(low):
        return f"up to {high:g}{after}"
    return f"from {low:g}{after}" if np.isinf(high) else f"from {low:g} to {high:g}{after}"
