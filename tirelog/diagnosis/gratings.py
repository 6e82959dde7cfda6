"""Which grating says what: to road, wheel or one grating alone belongs what repeats.

    residual and slopes of each grating, whitened -> normal equations by manoeuvre with free shapes
        over the road's angle (0 at the patch) and the wheel's (that plus the grating's place)
        -> sign flips of manoeuvres with the maximum over {road, wheel, each grating alone}
        -> the largest comes in, and the rest is asked again: what each frame holds
    the same with one strength of an effect for each grating -> its strengths, and whether they
        differ by more than chance (Q, by the same flips)

For one grating road and wheel are the same function of the angle; several at other places see a
wheel's shape shifted and a road's not. What a single grating shows and no other does is not the
tire's: its bonding, its channel.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from tirelog.diagnosis.beside import with_nuisances_on
from tirelog.diagnosis.compare import start_from
from tirelog.diagnosis.free_shapes import hats
from tirelog.diagnosis.rules import ALARM_P, LEAST_SHARE_OF_FLOOR
from tirelog.diagnosis.sign_flips import Scores, flip_test
from tirelog.inference.base import Base, TogetherBase, apart
from tirelog.inference.cells.levers import ratio_of
from tirelog.inference.cells.together import PiecesTogether
from tirelog.inference.fit.cells import Problem, finish
from tirelog.inference.floor import Plain
from tirelog.inference.metric.offsets import Offsets
from tirelog.inference.metric.whitening import Whitener
from tirelog.inference.nuisances import shared_effects
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: gratings that effects are searched on if there are more: a wheel's three harmonics are parted
#: from the road by four places; three would take a third less, and five add what all say again
MOST_SEARCHED = 4
#: means of like revolutions that a search of them takes, or as many as one grating has: a search
#: takes 0.2 to 0.4 s for each
_ENOUGH = 120
ROAD, WHEEL, _EFFECT = "road", "wheel", " effect"
#: eigenvalues of the normal equations below this share of the largest are rounding
_RANK = 1e-10


@dataclass(frozen=True)
class Frame:
    """What repeats in one frame: road, wheel, or the one grating named.

    size  squared noise floors (of that grating; else the mean of all) that a free shape takes
    p     how often chance alone takes as much, over all frames that were asked
    """

    frame: str
    size: float
    p: float

    @property
    def matters(self) -> bool:
        """More than chance does, and enough to matter."""
        return self.p <= ALARM_P and self.size > LEAST_SHARE_OF_FLOOR


@dataclass(frozen=True)
class Strengths:
    """An effect's strength as each grating has it, everything else one to all.

    values, errors (n,) of the gratings in `unit`;  q, freedom, p  of their differences
    size  squared noise floors that strengths of their own take beyond one for all
    """

    parameter: str
    unit: str
    values: tuple[float, ...]
    errors: tuple[float, ...]
    q: float
    freedom: int
    p: float
    size: float

    @property
    def contradicts(self) -> bool:
        """Do the gratings differ, by more than chance does and enough to matter?"""
        return self.p <= ALARM_P and self.size > LEAST_SHARE_OF_FLOOR


@dataclass(frozen=True)
class GratingsFound:
    """Which grating says what.

    names, angles_deg (n,)  of all gratings;  frames: what repeats, by frame, the largest first
    alone      gratings that show what no other does;  left_out: those without which the rest was
               asked
    strengths  of each effect that was named, of the gratings in `asked`
    searched   those on which effects were searched, if not all that were asked
    """

    names: tuple[str, ...]
    angles_deg: tuple[float, ...]
    frames: tuple[Frame, ...]
    left_out: tuple[str, ...]
    asked: tuple[str, ...] = ()
    searched: tuple[str, ...] = ()
    strengths: tuple[Strengths, ...] = ()

    @property
    def alone(self) -> tuple[str, ...]:
        return tuple(f.frame for f in self.frames if f.matters and f.frame in self.names)

    def to_json(self) -> dict[str, Any]:
        """Each grating by its name, the frames, and the effects' strengths."""
        by_frame = {f.frame: f for f in self.frames}

        def of(name: str) -> dict[str, Any]:
            own = by_frame.get(name)
            return {
                "alone_size": own.size if own else 0.0,
                "alone_p": own.p if own else None,
                "contradicts": name in self.alone,
                "left_out": name in self.left_out,
                "strengths": {
                    s.parameter: {"value": s.values[i], "se": s.errors[i], "unit": s.unit}
                    for s in self.strengths
                    for i in [self.asked.index(name)]
                    if name in self.asked
                }
                if name in self.asked
                else {},
            }

        return {
            "gratings": {
                name: {"angle_deg": angle} | of(name)
                for name, angle in zip(self.names, self.angles_deg, strict=True)
            },
            "frames": [{"frame": f.frame, "size": f.size, "p": f.p} for f in self.frames],
            "heterogeneity": [
                {
                    "parameter": s.parameter, "q": s.q, "freedom": s.freedom, "p": s.p,
                    "size": s.size, "contradicts": s.contradicts,
                }
                for s in self.strengths
            ],
            "searched_on": list(self.searched or self.asked),
            "sentence": " ".join(self.sentences()),
        }  # fmt: skip

    def sentences(self) -> list[str]:
        """What the gratings say together, in words."""
        said = []
        for frame in self.frames:
            if not frame.matters:
                continue
            size = f"{frame.size:.2g} squared floors"
            if frame.frame == ROAD:
                said.append(f"Fixed to the road, the same in all gratings: {size}.")
            elif frame.frame == WHEEL:
                said.append(f"Fixed to the wheel, shifted by each grating's angle: {size}.")
            else:
                said.append(
                    f"{frame.frame} alone shows {size} that no other grating does: its bonding, "
                    "its channel or its place across the tread, not the tire."
                )
        if self.left_out:
            one = len(self.left_out) == 1
            said.append(f"What follows is without {'it' if one else ', '.join(self.left_out)}.")
        elif self.alone and len(self.names) == 2:
            said.append("Of two gratings nothing tells which is right; a third would.")
        if self.searched:
            said.append(
                f"Effects are searched on {', '.join(self.searched)}, on some of their revolutions "
                "each; every grating is asked what it says."
            )
        for s in self.strengths:
            if s.contradicts:
                told = ", ".join(
                    f"{name} {value:.3g} ± {error:.2g}"
                    for name, value, error in zip(self.asked, s.values, s.errors, strict=True)
                )
                unit = f" [{s.unit}]" if s.unit != "1" else ""
                said.append(
                    f"The gratings contradict each other on {s.parameter}{unit}: {told} (Q "
                    f"{s.q:.3g} of {s.freedom})."
                )
        return said


@dataclass(frozen=True)
class _Part:
    """Normal equations of one grating: by manoeuvre gram (M, P, P), right (M, P).

    The first columns are those of `base`, then one of an effect if there is one, then the road's
    shapes and the wheel's. `size_gram` (P, P), `size_right` (P,): in squared floors, of all.
    `weight`: the values that a mean square of it is over.
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


@dataclass(frozen=True)
class Gathered:
    """Several gratings as they are asked: all that agree, and what effects are searched on.

    `base`: the model fitted to what is `searched`, which is all `pieces` if they are few.
    """

    pieces: PiecesTogether
    searched: PiecesTogether
    base: TogetherBase
    found: GratingsFound

    def with_strengths(self, result: TogetherBase, selected: Sequence[str]) -> GratingsFound:
        """What was found, and each selected effect's strength as every grating has it."""
        if not selected:
            return self.found
        whole = result if self.searched is self.pieces else held_to(self.pieces, result)
        return replace(self.found, strengths=strengths_of(whole, selected))


def gathered(pieces: PiecesTogether, model: Model) -> Gathered:
    """What is to be asked of several gratings: those that no other contradicts.

    A grating that shows what no other does is left out if most remain, two at least.
    """
    names = tuple(name for name in pieces.members if name)
    places = [np.degrees(p) % 360.0 for p in pieces.places if np.isfinite(p)]
    searched, base = _searched(pieces, model)
    frames = frames_of(base if searched is pieces else held_to(pieces, base))
    found = GratingsFound(names, tuple(float(p) for p in places), frames, ())
    out = found.alone
    if out and len(names) - len(out) >= max(2, len(out) + 1):
        found = replace(found, left_out=out)
        pieces = pieces.without(out)
        searched, base = _searched(pieces, model)
    found = replace(
        found,
        asked=tuple(name for name in names if name not in found.left_out),
        searched=() if searched is pieces else searched.members,
    )
    return Gathered(pieces, searched, base, found)


def _searched(pieces: PiecesTogether, model: Model) -> tuple[PiecesTogether, TogetherBase]:
    """What effects are searched on, and the model fitted to it."""
    some = spread_out(pieces)
    base = start_from(some, model)
    assert isinstance(base, TogetherBase)
    return some, base


def spread_out(pieces: PiecesTogether) -> PiecesTogether:
    """The pieces themselves if they are of few gratings; of more those at the most distant angles.

    Of each of these every other piece or so, in turn, so that each manoeuvre is seen by several.
    """
    gratings = [i for i, name in enumerate(pieces.members) if name]
    if len(gratings) < MOST_SEARCHED:
        return pieces
    place = np.array(pieces.places)
    chosen = gratings[:1]
    while len(chosen) < MOST_SEARCHED:
        off = np.abs(np.angle(np.exp(1j * (place[gratings][:, None] - place[chosen]))))
        chosen.append(gratings[int(off.min(axis=1).argmax())])
    rest = [pieces.members[i] for i in gratings if i not in chosen]
    some = pieces.without(rest) if rest else pieces
    total = sum(len(part) for part in some.parts)
    every = int(np.clip(np.ceil(total / _ENOUGH), 1, MOST_SEARCHED))
    kept = [(np.arange(len(part)) + i) % every == 0 for i, part in enumerate(some.parts)]
    return some.take(np.concatenate(kept)) if every > 1 else some


def held_to(pieces: PiecesTogether, fitted: TogetherBase) -> TogetherBase:
    """A fitted model against more gratings: its parameters as they are, their own free.

    Slopes are by all parameters.
    """
    model = with_nuisances_on(fitted)
    held = model.with_parameters({name: p.fixed() for name, p in model.parameters.items()})
    base = start_from(pieces, held, several=False)
    assert isinstance(base, TogetherBase)
    free = {name: p for name, p in model.parameters.items() if p.free}
    names = (*free, *base.fit.names)
    anew = base.model.with_parameters(
        {name: replace(base.model.parameters[name], free=True) for name in free}
    )
    (fit,) = finish([Problem(base.cells, base.white)], anew, names, base.fit.settled)
    return replace(base, fit=fit)


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


def frames_of(base: TogetherBase) -> tuple[Frame, ...]:
    """What repeats beside a fitted model, by frame: all that matters, or the largest of nothing."""
    parts, prior = _parts(base, shapes=True)
    names = [part.name for part in parts]
    taken: list[str] = []
    found: list[Frame] = []
    while len(taken) < len(names) + 2:
        frames = [frame for frame in (ROAD, WHEEL, *names) if frame not in taken]
        ground = _ground(parts, prior, taken)
        asked = [_asked(parts, ground, [frame]) for frame in frames]
        statistic, p = flip_test([one.scores for one in asked], base.cells.manoeuvres)
        rows = [Frame(f, asked[i].size, float(p[i])) for i, f in enumerate(frames)]
        largest = [i for i in np.argsort(-statistic).tolist() if rows[i].matters]
        if not largest:
            return tuple(found) or (rows[int(np.argmax(statistic))],)
        found.append(rows[largest[0]])
        taken.append(frames[largest[0]])
    return tuple(found)


def strengths_of(base: TogetherBase, effects: Sequence[str]) -> tuple[Strengths, ...]:
    """The first strength of each of these effects of the base's model, grating by grating."""
    found = []
    for effect in effects:
        entry = next((e for e in base.model.effects if e.id == effect), None)
        name = f"{effect}.{entry.effect.strength[0]}" if entry is not None else ""
        if name not in base.fit.names:
            continue
        parts, prior = _parts(base, effect=name)
        own = [f"{_EFFECT} {part.name}" for part in parts]
        each = _asked(parts, _ground(parts, prior, []), own).scores
        differing = _asked(parts, _ground(parts, prior, [_EFFECT]), own[1:])
        root = each.root()
        step = root @ (root.T @ each.scores.sum(axis=0))
        scale = max(1.0, base.fit.reduced_chi2)
        errors = np.sqrt((root**2).sum(axis=1) * scale)
        statistic, p = flip_test([differing.scores], base.cells.manoeuvres)
        parameter = base.model.parameters[name]
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
    base: TogetherBase, *, effect: str = "", shapes: bool = False
) -> tuple[list[_Part], FloatArray]:
    """The normal equations of each grating, and the prior precision of the base's columns."""
    cells, shared = base.cells, base.cells.shared
    layout = cells.together
    assert layout is not None
    kept = [k for k, name in enumerate(base.fit.names) if name != effect]
    prior = np.concatenate([np.zeros(len(kept)), np.ones(0 if shared is None else len(shared))])
    held = () if shared is None else shared.groups
    wheel = shared_effects(cells, base.fit, WHEEL) if shapes and WHEEL not in held else None
    found = []
    for i, part in enumerate(apart(base)):
        if not part.cells.member:
            continue
        rows, unit, width = np.flatnonzero(cells.part == i), layout.scales[i], layout.widths[i]

        moving = part.fit.moving
        blocks: list[list[FloatArray]] = [[moving[..., kept]], [], [], []]
        if shared is not None:
            blocks[0].append(shared.columns[rows][:, :width] * shared.sd * unit)
        if effect:
            blocks[1].append(moving[..., [base.fit.names.index(effect)]])
        if shapes:
            ratio = ratio_of(base.model, part.cells.member)
            blocks[2].append(ratio * hats(part.cells.phi))
            blocks[3].append(ratio * hats(part.cells.phi + part.cells.place_rad))
            if wheel is not None:
                blocks[3].append(wheel.columns[rows][:, :width] * wheel.sd * unit)
        found.append(_normal(part, blocks, cells.manoeuvre[rows]))
    return found, prior


def _normal(part: Base, blocks: Sequence[Sequence[FloatArray]], manoeuvre: IntArray) -> _Part:
    """The normal equations of one grating, its logs' offsets taken out."""
    cells = replace(part.cells, shared=None)
    good = np.isfinite(cells.values)[..., None]
    columns = np.concatenate([x for block in blocks for x in block], axis=-1)
    columns = np.where(good, columns, 0.0)
    left = np.where(good[..., 0], cells.values - part.fit.prediction, 0.0)
    many = columns.shape[-1]

    def without_offsets(metric: Whitener | Plain) -> tuple[FloatArray, FloatArray]:
        offsets = Offsets.of(cells, metric)
        return offsets.without(metric(columns)), offsets.without(metric(left))

    slopes, residual = without_offsets(part.white)
    total = int(manoeuvre.max()) + 1
    gram, right = np.zeros((total, many, many)), np.zeros((total, many))
    for number in np.unique(manoeuvre):
        rows = manoeuvre == number
        flat = slopes[rows].reshape(-1, many)
        gram[number], right[number] = flat.T @ flat, flat.T @ residual[rows].ravel()
    slopes, residual = without_offsets(part.plain)
    flat = slopes.reshape(-1, many)
    ends = np.cumsum([0, *(sum(x.shape[-1] for x in block) for block in blocks)])
    return _Part(
        cells.member,
        gram,
        right,
        flat.T @ flat / part.floor.square,
        flat.T @ residual.ravel() / part.floor.square,
        part.plain.weight,
        *(np.arange(a, b) for a, b in pairwise(ends)),
    )


def _local(part: _Part, block: str) -> IntArray:
    """The columns of a grating that a block of all is made of; none if it has no part in it."""
    if block.startswith(_EFFECT):
        return part.effect if block in (_EFFECT, f"{_EFFECT} {part.name}") else part.effect[:0]
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
    where, local, many = _layout(parts, beside, prior.size)
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
