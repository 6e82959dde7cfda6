"""What each candidate would do to the waveforms of these cells.

Columns (C, m, k), and which candidates cannot be tested, and why.

A signature is the change of the fitted model's prediction when the effect is switched on at its
probe strength, per unit of strength, one column per strength parameter. If an effect has shape
parameters besides (the width of a pulse, a time constant), it is tried at a few of them, one at a
time: variants, of which the one with the largest statistic stands for the effect (all take part in
the family-wise maximum).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from tirelog.errors import ModelError, or_refusal
from tirelog.inference.base import Base, JointBase, bases_by_observable, change_to
from tirelog.inference.cells.cells import Cells
from tirelog.inference.cells.joint import embedded, lacking, rows_by_observable
from tirelog.inference.nuisances import FORM
from tirelog.physics.carcass.numbers import steady_carcass
from tirelog.physics.effects import BY_ID, Effect, readers
from tirelog.physics.model.model import Model, ModelEffect, why_idle
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import OWN_ZERO

#: shape parameters are tried at these factors of their probe
_FACTORS = (0.5, 2.0)
#: what differs by less than this share of a change within a log is its zero; a tenth of it is what
#: a pressure moves while the tire warms in a minute, and twice as much decides nothing
_SAME = 0.05
#: a change below this share of the waveform is rounding; doubling it decides nothing, since what
#: acts at its probe strength does far more
_NOTHING = 1e-9


@dataclass(frozen=True)
class Signature:
    """What each strength of an effect would do to the observable.

    `columns` (C, m, k) in the observable's unit per unit of each of `strengths`; `shape` the
    shape parameters it holds at.
    """

    effect: Effect
    strengths: tuple[str, ...]
    shape: Mapping[str, float]
    columns: FloatArray
    one_sided: bool


def candidate_effects(
    model: Model, extra: Iterable[Effect] = (), *, tried: bool = True
) -> list[Effect]:
    """The catalogue and the user's own effects, for this observable and carcass.

    Without what the model holds already, and what acts on nothing in it. Those that a search does
    not try, if `tried` is False.
    """
    beside = [held.effect for held in model.effects]
    held = {effect.id for effect in beside}
    known = {**BY_ID, **{effect.id: effect for effect in extra}}
    return [
        effect
        for effect in known.values()
        if effect.id not in {*held, FORM}
        and effect.tried == tried
        and model.acted_on_by(effect, beside)
        and not (effect.id == "ring_curvature" and steady_carcass(model.carcass) == "ring")
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
    moved = [
        {**start, p.name: float(np.clip(f * p.probe, p.min, p.max))}
        for p in shapes
        for f in _FACTORS
    ]
    return [start, *(m for m in moved if m != start)]


def with_candidate(model: Model, effect: Effect, values: Mapping[str, float]) -> Model:
    """The model with the effect at these values, clipped to the bounds.

    Strengths that are not given are zero.
    """
    zero = dict.fromkeys(effect.strength, 0.0)
    clipped = {}
    for p in effect.parameters:
        if p.name in {**zero, **values}:
            clipped[p.name] = float(np.clip({**zero, **values}[p.name], p.min, p.max))
    return model.with_effect(ModelEffect.of(effect), **clipped)


@or_refusal
def signatures_of(base: Base, effect: Effect) -> list[Signature] | ModelError:
    """All variants of one candidate, or why it cannot be tested on these cells."""
    cells, model = base.cells, base.model
    missing = lacking(effect, model, cells)
    if missing:
        raise ModelError(f"needs {', '.join(missing)}")
    refuse_stand_in(effect, model, cells)
    own = {p.name: p for p in effect.parameters}
    result = []
    size = float(np.nanmax(np.abs(base.fit.prediction)))
    for shape in variants(effect):
        columns, names = [], []
        for name in effect.strength:
            added = with_candidate(model, effect, {**shape, name: own[name].probe})
            change = change_to(base, added.resolved(cells.conditions))
            if isinstance(change, ModelError):
                return change
            if np.nanmax(np.abs(change)) > _NOTHING * size:
                columns.append(change / own[name].probe)
                names.append(name)
        several = np.unique(cells.log).size > 1
        if columns and several and all(_moves_zeros_alone(cells, x) for x in columns):
            raise ModelError(
                "differs from log to log alone, and each log counts the "
                f"{' and '.join(OWN_ZERO)} from a zero of its own"
            )
        if columns:
            single = len(names) == 1 and own[names[0]].min >= 0.0 and own[names[0]].probe > 0
            result.append(
                Signature(effect, tuple(names), shape, np.stack(columns, axis=-1), single)
            )
    if not result:
        raise ModelError(
            "does nothing under these conditions (a quantity it follows is zero or does not vary)"
        )
    return result


def refuse_stand_in(effect: Effect, model: Model, cells: Cells) -> None:
    """ModelError if the effect stands for what is measured, in all observables that it acts on."""
    names: dict[str, None] = {}
    for observable, rows in rows_by_observable(cells).items():
        if not model.acts_on(effect, observable):
            continue
        own = effect.stands_for.get(observable, ())
        known = [np.isfinite(getattr(cells.conditions, name)[rows]).all() for name in own]
        if not known or not all(known):
            return
        names |= dict.fromkeys(own)
    if names:
        raise ModelError(f"stands for {' and '.join(names)}, which is measured")


def _moves_zeros_alone(cells: Cells, change: FloatArray) -> bool:
    """True if a change (C, m) is the same all along each log, of what has a zero of its own."""
    moved = change.copy()
    for observable, rows in rows_by_observable(cells).items():
        if observable in OWN_ZERO:
            for log in np.unique(cells.log[rows]):
                own = rows[cells.log[rows] == log]
                moved[own] -= np.nanmean(change[own])
    return bool(np.nanmax(np.abs(moved)) < _SAME * np.nanmax(np.abs(change)))


def all_signatures(base: Base, effects: Iterable[Effect]) -> tuple[list[Signature], dict[str, str]]:
    """Signatures of all candidates, and the reasons of those that are not tested."""
    found: list[Signature] = []
    reasons: dict[str, str] = {}
    for effect in effects:
        own = signatures_of(base, effect)
        if isinstance(own, ModelError):
            reasons[effect.id] = own.what
        else:
            found += own
    return found, reasons


# ---- Free shapes over the angle: what a form that is somewhat wrong could leave of an effect.


#: nodes of free shapes over the wheel's angle [rad]: 3 degrees apart about the patch, 10 beyond;
#: half as many lose the edges of the patch, twice as many measure noise
ANGLES = np.r_[-180:-60:10.0, -60:60:3.0, 60:181:10.0] * (np.pi / 180.0)
#: share of a contribution's energy that makes it even, or odd: the other part is a quarter as large
#: at most; with twice the rest, a third
_SYMMETRIC = 0.95


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
    if isinstance(base, JointBase):
        each = [
            embedded(base.cells, i, freedom_of_shape(part, effect_id))
            for i, part in enumerate(bases_by_observable(base))
            if _acts_in(part, effect_id)
        ]
        if all(
            part.cells.member for part in bases_by_observable(base)
        ):  # the tire's shape is one to all
            return np.asarray(sum(each), dtype=np.float64)
        return np.concatenate(each, axis=-1)
    weight = base.plain.weights
    contribution = np.nan_to_num(_contribution(base, effect_id)) * weight
    size, strength, shape = np.linalg.svd(contribution, full_matrices=False)
    loading = size[:, 0] * strength[0] / np.maximum(weight.max(axis=1), 1e-300)
    phi = base.cells.phi
    here = hats(phi)
    even = even_share(shape[0], np.nanmean(phi, axis=0))
    if even > _SYMMETRIC:
        here += hats(-phi)
    elif even < 1.0 - _SYMMETRIC:
        here -= hats(-phi)
    if not 1.0 - _SYMMETRIC <= even <= _SYMMETRIC:
        here = _independent(here)
    columns: FloatArray = loading[:, None, None] * here
    columns /= max(float(np.abs(loading).max()), 1e-300)
    return columns


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


def _acts_in(part: Base, effect_id: str) -> bool:
    """Does an effect of the model act on this observable?"""
    held = [entry.effect for entry in part.model.effects]
    return any(e.id == effect_id and part.model.acts_on(e, part.cells.observable) for e in held)


def even_share(shape: FloatArray, phi: FloatArray) -> float:
    """Share of the energy of a shape (m,) at angles (m,) that is even about zero."""
    mirrored = np.interp(-phi, phi, shape, period=2.0 * np.pi)
    return float((((shape + mirrored) / 2.0) ** 2).sum() / ((shape**2).sum() + 1e-300))


def _independent(columns: FloatArray) -> FloatArray:
    """Symmetric pairs once: the first half of the hats' columns and the one at zero."""
    half = columns.shape[-1] // 2 + 1
    return columns[..., :half]
