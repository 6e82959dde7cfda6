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

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from tirelog.diagnosis.candidates.assessment import Scores, flip_test, hats
from tirelog.diagnosis.compare import start_from
from tirelog.diagnosis.rules import ALARM_P, LEAST_SHARE_OF_FLOOR
from tirelog.inference.base import Base, FittedChannel, JointBase, bases_by_observable, fit_together
from tirelog.inference.cells.cells import cells_of
from tirelog.inference.cells.joint import LEVER, JointPieces, model_of, ratio_name, without_ratios
from tirelog.inference.fit.cells import Problem, finish
from tirelog.inference.floor import UnweightedMetric
from tirelog.inference.metric import Offsets, Whitener
from tirelog.inference.nuisances import shared_by, shared_effects
from tirelog.physics.model.model import Model
from tirelog.vocabulary.arrays import FloatArray, IntArray

# ---- What several gratings say: frozen, with its sentences and JSON.


ROAD, WHEEL = "road", "wheel"


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
    alone      gratings that show what no other does;  set_apart: those without which the rest was
               asked
    agreeing   gratings that showed what no other does until an effect was named
    strengths  of each effect that was named, of the gratings in `asked`
    searched   those on which effects were searched, if not all that were asked
    """

    names: tuple[str, ...]
    angles_deg: tuple[float, ...]
    frames: tuple[Frame, ...]
    set_apart: tuple[str, ...]
    asked: tuple[str, ...] = ()
    searched: tuple[str, ...] = ()
    strengths: tuple[Strengths, ...] = ()
    agreeing: tuple[str, ...] = ()

    @property
    def alone(self) -> tuple[str, ...]:
        return tuple(
            f.frame
            for f in self.frames
            if f.matters and f.frame in self.names and f.frame not in self.agreeing
        )

    def to_json(self) -> dict[str, Any]:
        """Each grating by its name, the frames, and the effects' strengths."""
        by_frame = {f.frame: f for f in self.frames}

        def of(name: str) -> dict[str, Any]:
            own = by_frame.get(name)
            return {
                "alone_size": own.size if own else 0.0,
                "alone_p": own.p if own else None,
                "contradicts": name in self.alone,
                "set_apart": name in self.set_apart,
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
            elif frame.frame in self.agreeing:
                said.append(
                    f"{frame.frame} seemed to show {size} of its own; beside what is named it says "
                    "what the others do."
                )
            else:
                said.append(
                    f"{frame.frame} alone shows {size} that no other grating does: its bonding, "
                    "its channel or its place across the tread, not the tire."
                )
        if self.set_apart:
            one = len(self.set_apart) == 1
            said.append(f"What follows is without {'it' if one else ', '.join(self.set_apart)}.")
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


# ---- Each grating of several at the parameters of one fit, fitted or held to it.


#: means of like revolutions that each grating is asked on: thirty tell a twentieth of a squared
#: floor and take a third of a second; twice as many tell no more that matters
_ASKED = 30


@dataclass(frozen=True)
class Member:
    """One grating at the parameters of a fit to several.

    channel    its cells, metric, floor, and the fit, whose residual is without what is `beside`
    place_rad  its angle on the wheel;  manoeuvre (C,) of its cells, numbered through all gratings
    shared     columns (C, m, K) of the random effects that all gratings share, each as large as
               its standard deviation
    wheel      does what is beside the model hold the wheel's nuisance?
    """

    name: str
    channel: FittedChannel
    place_rad: float
    manoeuvre: IntArray
    shared: FloatArray
    wheel: bool


def members_of(base: JointBase) -> Iterator[Member]:
    """The gratings of one fit, one after the other."""
    cells, shared, layout = base.cells, base.cells.shared, base.cells.together
    assert layout is not None
    for i, part in enumerate(bases_by_observable(base)):
        if not part.cells.member:
            continue
        rows = np.flatnonzero(cells.part == i)
        columns = np.zeros((*part.cells.phi.shape, 0))
        if shared is not None:
            columns = shared.columns[rows][:, : layout.widths[i]] * shared.sd * layout.scales[i]
        yield Member(
            part.cells.member,
            part,
            part.cells.place_rad,
            cells.manoeuvre[rows],
            columns,
            shared is not None and WHEEL in shared.groups,
        )


def members_held(pieces: JointPieces, fitted: JointBase) -> Iterator[Member]:
    """More gratings than were fitted, one after the other, held to what the fit says.

    Its parameters and what its nuisances do are as they are; each grating has its own lever arm.
    """
    shared = fitted.cells.shared
    groups = () if shared is None else shared.groups
    found = dict(zip(() if shared is None else shared.names, fitted.fit.amplitudes, strict=True))
    model = without_ratios(fitted.model)
    model = replace(model, nuisances=tuple(n.used("auto") for n in model.nuisances))
    free = [name for name in model.free if name != LEVER]
    held = model.with_parameters({name: model.parameters[name].fixed() for name in free})
    rows = [np.linspace(0, len(p) - 1, min(_ASKED, len(p))).round() for p in pieces.parts]
    parts = [p.take(np.unique(r.astype(int))) for p, r in zip(pieces.parts, rows, strict=True)]
    pieces = replace(pieces, parts=tuple(parts))
    number = np.unique(pieces.manoeuvre, return_inverse=True)[1]
    ends = np.cumsum([len(part) for part in pieces.parts])[:-1]
    for part, place, name, manoeuvre in zip(
        pieces.parts, pieces.places, pieces.members, np.split(number, ends), strict=True
    ):
        if not name:
            continue
        cells = replace(cells_of(part), place_rad=place)
        one = model_of(held, part.observable)
        (channel,) = fit_together([cells], one, several=False)
        beside = shared_by(channel.cells, channel.fit, groups)
        if beside is not None:  # baselines of single gratings are in no other's
            does = beside.columns @ np.array([found.get(own, 0.0) for own in beside.names])
            cells = replace(cells, values=cells.values - does)
            (channel,) = fit_together([cells], one, several=False)
        anew = channel.model.with_parameters(
            {n: replace(channel.model.parameters[n], free=True) for n in free}
        )
        names = tuple(n for n in (*free, LEVER) if n in anew.parameters)
        (fit,) = finish([Problem(channel.cells, channel.white)], anew, names, True)
        yield Member(
            name,
            replace(channel, fit=fit, cells=fit.cells),
            place,
            manoeuvre,
            np.zeros((*cells.phi.shape, 0)),
            WHEEL in groups,
        )


# ---- Flips over normal equations by manoeuvre: in which frame something repeats, and how strongly.
#
# Columns of each grating: those of the fit, an effect, free shapes over the road's angle and over
# the
# wheel's, its lever arm. Blocks of them, tied across gratings or one's own, are asked beside
# others.


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

    def without_own(metric: Whitener | UnweightedMetric) -> tuple[FloatArray, FloatArray]:
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


# ---- Several gratings as they are asked: those that agree, and what effects are searched on.


#: gratings that effects are searched on if there are more: a wheel's three harmonics are parted
#: from the road by four places; three would take a third less, and five add what all say again
MOST_SEARCHED = 4
#: means of like revolutions that a search of them takes, or as many as one grating has: a search
#: takes 0.2 to 0.4 s for each
_ENOUGH = 80
#: share of what a grating showed alone that stays with it beside a named effect: all of it if the
#: grating is bad, a tenth if it is what a free shape left of the effect
_STAYS = 0.5


@dataclass(frozen=True)
class Gathered:
    """Several gratings as they are asked: all that agree, and what effects are searched on.

    `base`: the model fitted to what is `searched`, which is all `pieces` if they are few; `every`:
    those with what others contradict.
    """

    every: JointPieces
    pieces: JointPieces
    searched: JointPieces
    base: JointBase
    found: GratingsFound

    def with_strengths(self, result: JointBase, selected: Sequence[str]) -> GratingsFound:
        """What was found, and each selected effect's strength as every grating has it.

        What one grating alone showed before anything was named may be what a free shape leaves of
        the effect: it is asked again beside it.
        """
        if not selected:
            return self.found
        found = self.found
        if found.alone:
            before = {frame.frame: _STAYS * frame.size for frame in found.frames}
            after = frames_of(members_held(self.every, result))
            still = {f.frame for f in after if f.matters and f.size > before.get(f.frame, 0.0)}
            found = replace(found, agreeing=tuple(n for n in found.alone if n not in still))
        one_fit = self.searched is self.pieces
        seen = members_of(result) if one_fit else members_held(self.pieces, result)
        own = strengths_of(seen, result, selected)
        return replace(found, strengths=own)


def gathered(pieces: JointPieces, model: Model) -> Gathered:
    """What is to be asked of several gratings: those that no other contradicts.

    A grating that shows what no other does is left out if most remain, two at least.
    """
    names = tuple(name for name in pieces.members if name)
    places = [np.degrees(p) % 360.0 for p in pieces.places if np.isfinite(p)]
    searched, base = _searched(pieces, model)
    frames = frames_of(members_of(base) if searched is pieces else members_held(pieces, base))
    found = GratingsFound(names, tuple(float(p) for p in places), frames, ())
    out, every = found.alone, pieces
    if out and len(names) - len(out) >= max(2, len(out) + 1):
        found = replace(found, set_apart=out)
        pieces = pieces.without(out)
        searched, base = _searched(pieces, model)
    found = replace(
        found,
        asked=tuple(name for name in names if name not in found.set_apart),
        searched=() if searched is pieces else searched.members,
    )
    return Gathered(every, pieces, searched, base, found)


def _searched(pieces: JointPieces, model: Model) -> tuple[JointPieces, JointBase]:
    """What effects are searched on, and the model fitted to it."""
    some = spread_out(pieces)
    base = start_from(some, model)
    assert isinstance(base, JointBase)
    return some, base


def spread_out(pieces: JointPieces) -> JointPieces:
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
