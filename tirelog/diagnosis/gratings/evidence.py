"""Flips over normal equations by manoeuvre: in which frame something repeats, and how strongly.

Columns of each grating: those of the fit, an effect, free shapes over the road's angle and over the
wheel's, its lever arm. Blocks of them, tied across gratings or one's own, are asked beside others.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from tirelog.diagnosis.candidates.free_shapes import hats
from tirelog.diagnosis.candidates.sign_flips import Scores, flip_test
from tirelog.diagnosis.gratings.found import ROAD, WHEEL, Frame, Strengths
from tirelog.diagnosis.gratings.members import Member
from tirelog.inference.base import Base
from tirelog.inference.cells.levers import LEVER, ratio_name
from tirelog.inference.floor import Plain
from tirelog.inference.metric.offsets import Offsets
from tirelog.inference.metric.whitening import Whitener
from tirelog.inference.nuisances import shared_effects
from tirelog.vocabulary.arrays import FloatArray, IntArray

_EFFECT, _LEVER = " effect", " lever arm"
#: share of the largest frame that its free shape may leave, since its nodes are 3 to 10 degrees
#: apart: a splice of 6 degrees leaves 3 %. Twice as much would hide a bad grating beside an effect
#: of eight times its size
_FORM = 0.06
#: shapes are asked as they are and growing with the speed, from this one on: what an effect of
#: v^2, a lag or a bandwidth leaves at one speed is not what it leaves at another.  Another speed
#: spans the same columns
_SPEED_M_S = 15.0
#: a column of which less than this share is left beside the others is one of them
_NOTHING = 1e-9
#: eigenvalues of the normal equations below this share of the largest are rounding
_RANK = 1e-10


@dataclass(frozen=True)
class _Part:
    """Normal equations of one grating: by manoeuvre gram (M, P, P), right (M, P).

    The first columns are those of `base`, then one of an effect if there is one, then the road's
    shapes and the wheel's, and the grating's lever arm. `size_gram` (P, P), `size_right` (P,): in
    squared floors, of all manoeuvres. `weight`: the values that a mean square of it is over.
    """

    name: str
    gram: FloatArray
    right: FloatArray
    size_gram: FloatArray
    size_right: FloatArray
    weight: float
    base: IntArray
    effect: IntArray
    road: IntArray
    wheel: IntArray
    lever: IntArray


@dataclass(frozen=True)
class _Ground:
    """Base and blocks beside it, of all gratings, and what they explain of the residual.

    `where` (parts) of each grating its columns among these, `local` (parts) among its own.
    """

    where: list[IntArray]
    local: list[IntArray]
    found: FloatArray
    inverse: FloatArray
    left: FloatArray
    gram: FloatArray
    size_gram: FloatArray
    size_left: FloatArray


@dataclass(frozen=True)
class _Asked:
    """The evidence for some columns beside others, and their size in squared floors."""

    scores: Scores
    size: float


def frames_of(members: Iterable[Member]) -> tuple[Frame, ...]:
    """What repeats beside a fitted model, by frame: all that matters, or the largest of nothing."""
    parts, prior = _parts(members, shapes=True)
    manoeuvres = max(part.gram.shape[0] for part in parts)
    names = [part.name for part in parts]
    taken: list[str] = []
    found: list[Frame] = []
    while len(taken) < len(names) + 2:
        frames = [frame for frame in (ROAD, WHEEL, *names) if frame not in taken]
        ground = _ground(parts, prior, taken)
        asked = [_asked(parts, ground, [frame]) for frame in frames]
        statistic, p = flip_test([one.scores for one in asked], manoeuvres)
        rows = [Frame(f, asked[i].size, float(p[i])) for i, f in enumerate(frames)]
        least = _FORM * max((frame.size for frame in found), default=0.0)
        largest = [
            i for i in np.argsort(-statistic).tolist() if rows[i].matters and rows[i].size > least
        ]
        if not largest:
            return tuple(found) or (rows[int(np.argmax(statistic))],)
        found.append(rows[largest[0]])
        taken.append(frames[largest[0]])
    return tuple(found)


def strengths_of(
    members: Iterable[Member], fitted: Base, effects: Sequence[str]
) -> tuple[Strengths, ...]:
    """The first strength of each of these effects of a fitted model, grating by grating."""
    entries = {e.id: f"{e.id}.{e.effect.strength[0]}" for e in fitted.model.effects}
    asked = [entries[e] for e in effects if e in entries and entries[e] in fitted.fit.names]
    if not asked:
        return ()
    seen, found = list(members), []
    for name in asked:
        parts, prior = _parts(seen, effect=name)
        own = [f"{_EFFECT} {part.name}" for part in parts]
        each = _asked(parts, _ground(parts, prior, []), own).scores
        differing = _asked(parts, _ground(parts, prior, [_EFFECT]), own[1:])
        root = each.root()
        step = root @ (root.T @ each.scores.sum(axis=0))
        scale = max(1.0, fitted.fit.reduced_chi2)
        errors = np.sqrt((root**2).sum(axis=1) * scale)
        statistic, p = flip_test([differing.scores], each.scores.shape[0])
        parameter = fitted.model.parameters[name]
        found.append(
            Strengths(
                name,
                parameter.unit,
                tuple((parameter.value + step).tolist()),
                tuple(errors.tolist()),
                float(statistic[0] ** 2) / scale,
                len(own) - 1,
                float(p[0]),
                differing.size,
            )
        )
    return tuple(found)


def _parts(
    members: Iterable[Member], *, effect: str = "", shapes: bool = False
) -> tuple[list[_Part], FloatArray]:
    """The normal equations of each grating, and the prior precision of the base's columns."""
    found, prior, lever = [], np.zeros(0), 0.0
    for member in members:
        fit, cells = member.channel.fit, member.channel.cells
        moving, of_lever = fit.moving, (LEVER, ratio_name(member.name))
        kept = [
            k
            for k, name in enumerate(fit.names)
            if name not in (effect, LEVER) and not name.startswith(ratio_name(""))
        ]
        prior = np.concatenate([np.zeros(len(kept)), np.ones(member.shared.shape[-1])])
        own = [k for k, name in enumerate(fit.names) if name in of_lever][:1]
        blocks: list[list[FloatArray]] = [[moving[..., kept], member.shared], [], [], []]
        blocks.append([moving[..., own]])
        if effect:
            blocks[1].append(moving[..., [fit.names.index(effect)]])
        if shapes:
            ratio = fit.model.values.get(LEVER, 1.0) / (lever or fit.model.values.get(LEVER, 1.0))
            lever = lever or fit.model.values.get(LEVER, 1.0)
            faster = (cells.conditions.speed_m_s / _SPEED_M_S - 1.0)[:, None, None]
            for block, angle in ((2, cells.phi), (3, cells.phi + member.place_rad)):
                still = ratio * hats(angle)
                blocks[block] += [still, still * faster]
            wheel = None if member.wheel else shared_effects(cells, fit, WHEEL)
            if wheel is not None:
                blocks[3].append(wheel.columns * wheel.sd)
        found.append(_normal(member, blocks))
    return found, prior


def _normal(member: Member, blocks: Sequence[Sequence[FloatArray]]) -> _Part:
    """The normal equations of one grating, its logs' offsets taken out."""
    channel, manoeuvre = member.channel, member.manoeuvre
    cells = replace(channel.cells, shared=None)
    good = np.isfinite(cells.values)[..., None]
    columns = np.concatenate([x for block in blocks for x in block], axis=-1)
    columns = np.where(good, columns, 0.0)
    left = np.where(good[..., 0], cells.values - channel.fit.prediction, 0.0)
    many = columns.shape[-1]

    def without_own(metric: Whitener | Plain) -> tuple[FloatArray, FloatArray]:
        own = Offsets.of(cells, metric)
        return own.without(metric(columns)), own.without(metric(left))

    slopes, residual = without_own(channel.white)
    total = int(manoeuvre.max()) + 1
    gram, right = np.zeros((total, many, many)), np.zeros((total, many))
    for number in np.unique(manoeuvre):
        rows = manoeuvre == number
        flat = slopes[rows].reshape(-1, many)
        gram[number], right[number] = flat.T @ flat, flat.T @ residual[rows].ravel()
    slopes, residual = without_own(channel.plain)
    flat = slopes.reshape(-1, many)
    ends = np.cumsum([0, *(sum(x.shape[-1] for x in block) for block in blocks)])
    return _Part(
        member.name,
        gram,
        right,
        flat.T @ flat / channel.floor.square,
        flat.T @ residual.ravel() / channel.floor.square,
        channel.plain.weight,
        *(np.arange(a, b) for a, b in pairwise(ends)),
    )


def _local(part: _Part, block: str) -> IntArray:
    """The columns of a grating that a block of all is made of; none if it has no part in it."""
    if block.startswith(_EFFECT):
        return part.effect if block in (_EFFECT, f"{_EFFECT} {part.name}") else part.effect[:0]
    if block.startswith(_LEVER):
        return part.lever if block == f"{_LEVER} {part.name}" else part.lever[:0]
    if block == WHEEL:
        return part.wheel
    return part.road if block in (ROAD, part.name) else part.road[:0]


def _layout(parts: Sequence[_Part], blocks: Sequence[str], first: int) -> tuple[Any, Any, int]:
    """(columns of each grating in `blocks` under each other from `first`, its own, how many)."""
    widths = [max(_local(part, block).size for part in parts) for block in blocks]
    begins = first + np.cumsum([0, *widths])
    where, local = [], []
    for part in parts:
        owns = [_local(part, block) for block in blocks]
        places = [np.arange(b, b + own.size) for b, own in zip(begins, owns, strict=False)]
        where.append(np.concatenate([np.zeros(0, np.int64), *places]))
        local.append(np.concatenate([np.zeros(0, np.int64), *owns]))
    return where, local, int(begins[-1])


def _ground(parts: Sequence[_Part], prior: FloatArray, beside: Sequence[str]) -> _Ground:
    """Base and the blocks `beside` it, as all gratings have them."""
    levers = [f"{_LEVER} {part.name}" for part in parts]
    where, local, many = _layout(parts, [*levers, *beside], prior.size)
    where = [np.concatenate([np.arange(prior.size), own]) for own in where]
    local = [np.concatenate([part.base, own]) for part, own in zip(parts, local, strict=True)]
    total = max(part.gram.shape[0] for part in parts)
    gram, right = np.zeros((total, many, many)), np.zeros((total, many))
    size_gram, size_right = np.zeros((many, many)), np.zeros(many)
    for part, b, a in zip(parts, where, local, strict=True):
        turns = np.arange(part.gram.shape[0])
        gram[np.ix_(turns, b, b)] += part.gram[np.ix_(turns, a, a)]
        right[np.ix_(turns, b)] += part.right[np.ix_(turns, a)]
        size_gram[np.ix_(b, b)] += part.size_gram[np.ix_(a, a)]
        size_right[b] += part.size_right[a]
    whole = gram.sum(axis=0)
    whole[np.diag_indices(prior.size)] += prior
    inverse = _inverse(whole)
    found = inverse @ right.sum(axis=0)
    left = right - gram @ found
    return _Ground(
        where, local, found, inverse, left, gram.sum(axis=0), size_gram,
        size_right - size_gram @ found,
    )  # fmt: skip


def _asked(parts: Sequence[_Part], ground: _Ground, tested: Sequence[str]) -> _Asked:
    """The `tested` blocks, with the ground projected out."""
    where, local, many = _layout(parts, tested, 0)
    total, n = ground.left.shape
    right, square = np.zeros((total, many)), np.zeros((many, many))
    cross, size_gram = np.zeros((n, many)), np.zeros((many, many))
    size_right, size_cross = np.zeros(many), np.zeros((n, many))
    for part, s, own, b, a in zip(parts, where, local, ground.where, ground.local, strict=True):
        if not s.size:
            continue
        turns = np.arange(part.gram.shape[0])
        between = part.gram[np.ix_(turns, own, a)]
        seen = part.right[np.ix_(turns, own)] - between @ ground.found[b]
        right[np.ix_(turns, s)] += seen
        square[np.ix_(s, s)] += part.gram[np.ix_(turns, own, own)].sum(axis=0)
        cross[np.ix_(b, s)] += between.sum(axis=0).T
        size_gram[np.ix_(s, s)] += part.size_gram[np.ix_(own, own)]
        size_cross[np.ix_(b, s)] += part.size_gram[np.ix_(a, own)]
        size_right[s] += part.size_right[own] - part.size_gram[np.ix_(own, a)] @ ground.found[b]
    turn = ground.inverse @ cross
    scores = right - ground.left @ turn
    left = square - cross.T @ turn
    seen_of = np.diag(left) > _NOTHING * np.diag(square)
    left, scores = left * seen_of * seen_of[:, None], scores * seen_of
    evidence = Scores(scores, 0.5 * (left + left.T))
    root = evidence.root()
    step = root @ (root.T @ scores.sum(axis=0))
    back = -turn @ step
    removed = 2.0 * (back @ ground.size_left + step @ size_right) - (
        back @ ground.size_gram @ back + 2.0 * back @ size_cross @ step + step @ size_gram @ step
    )
    own = [part.weight for part in parts if part.name in tested]
    return _Asked(evidence, float(removed) / (sum(own) or sum(part.weight for part in parts)))


def _inverse(whole: FloatArray) -> FloatArray:
    """The inverse of normal equations, whatever units their columns have."""
    size = np.sqrt(np.maximum(np.diag(whole), 1e-300))
    scaled = np.linalg.pinv(whole / size[:, None] / size, rcond=_RANK, hermitian=True)
    return np.asarray(scaled / size[:, None] / size, dtype=np.float64)
