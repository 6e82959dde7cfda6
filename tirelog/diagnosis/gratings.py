"""Which grating says what: to road, wheel or one grating alone belongs what repeats.

    residual and slopes of each grating, whitened --> normal equations by manoeuvre with free shapes
        over the road's angle (0 at the patch) and the wheel's (that plus the grating's place)
        --> sign flips of manoeuvres with the maximum over {road, wheel, each grating alone}
        --> the largest comes in, and the rest is tested again: what each frame holds

For one grating road and wheel are the same function of the angle; several at other places see a
wheel's shape shifted and a road's not. What a single grating shows and no other does is not the
tire's: its bonding, its channel.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from tirelog.diagnosis.candidates.assessment import Scores, flip_test, hats
from tirelog.diagnosis.compare import manoeuvres_of, start_from
from tirelog.diagnosis.rules import ALARM_P, LEAST_SHARE_OF_FLOOR
from tirelog.inference.base import Base, bases_by_observable, fit_together
from tirelog.inference.cells.cells import (
    LEVER,
    cells_of,
    model_of,
    ratio_name,
    without_ratios,
)
from tirelog.inference.cells.pieces import Pieces
from tirelog.inference.fit.cells import Problem, finish
from tirelog.inference.metric import Normal, Offsets, Whitener
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
class GratingsFound:
    """Which grating says what.

    names, angles_deg (n,)  of all gratings;  frames: what repeats, by frame, the largest first
    alone      gratings that show what no other does;  set_apart: those without which the rest was
               asked
    agreeing   gratings that showed what no other does until an effect was named
    searched   those on which effects were searched, if not all that were asked
    """

    names: tuple[str, ...]
    angles_deg: tuple[float, ...]
    frames: tuple[Frame, ...]
    set_apart: tuple[str, ...]
    asked: tuple[str, ...] = ()
    searched: tuple[str, ...] = ()
    agreeing: tuple[str, ...] = ()

    @property
    def alone(self) -> tuple[str, ...]:
        return tuple(
            f.frame
            for f in self.frames
            if f.matters and f.frame in self.names and f.frame not in self.agreeing
        )

    def to_json(self) -> dict[str, Any]:
        """Each grating by its name, and the frames."""
        alone = {f.frame: {"alone_size": f.size, "alone_p": f.p} for f in self.frames}
        nothing = {"alone_size": 0.0, "alone_p": None}
        gratings: dict[str, dict[str, Any]] = {
            name: {"angle_deg": angle}
            | alone.get(name, nothing)
            | {"contradicts": name in self.alone, "set_apart": name in self.set_apart}
            for name, angle in zip(self.names, self.angles_deg, strict=True)
        }
        return {
            "gratings": gratings,
            "frames": [vars(f) for f in self.frames],
            "searched_on": list(self.searched or self.asked),
            "sentence": " ".join(self.sentences()),
        }

    def sentences(self) -> list[str]:
        """What the gratings say together, in words."""
        words = {
            ROAD: "Fixed to the road, the same in all gratings: {size}.",
            WHEEL: "Fixed to the wheel, shifted by each grating's angle: {size}.",
        }
        for name in self.agreeing:
            words[name] = (
                f"{name} seemed to show {{size}} of its own; beside what is named it says what the "
                "others do."
            )
        for name in self.alone:
            words[name] = (
                f"{name} alone shows {{size}} that no other grating does: its bonding, its channel "
                "or its place across the tread, not the tire."
            )
        matter = [frame for frame in self.frames if frame.matters]
        said = [words[f.frame].replace("{size}", f"{f.size:.2g} squared floors") for f in matter]
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
        return said


# ---- Each grating of several at the parameters of one fit, fitted or held to it.

#: one grating at the parameters of a fit to several: its cells, whose manoeuvres are numbered
#: through all gratings, metric, floor, and the fit, whose residual is without what is `beside`;
#: columns (C, m, K) of the random effects that all gratings share, each as large as its standard
#: deviation; and whether what is beside the model holds the wheel's nuisance
Member = tuple[Base, FloatArray, bool]


def members_of(base: Base) -> Iterator[Member]:
    """The gratings of one fit, one after the other."""
    cells, shared = base.cells, base.cells.shared
    for i, part in enumerate(bases_by_observable(base)):
        if not part.cells.member:
            continue
        rows = np.flatnonzero(cells.part == i)
        columns = np.zeros((*part.cells.phi.shape, 0))
        if shared is not None:
            width = part.cells.phi.shape[1]
            columns = shared.columns[rows, :width] * (shared.sd * cells.scales[i])
        own = replace(part.cells, manoeuvre=cells.manoeuvre[rows])
        wheel = shared is not None and WHEEL in shared.groups
        yield replace(part, cells=own), columns, wheel


def members_held(pieces: Sequence[Pieces], fitted: Base) -> Iterator[Member]:
    """More gratings than were fitted, one after the other, held to what the fit says.

    Its parameters and what its nuisances do are as they are; each grating has its own lever arm.
    """
    shared = fitted.cells.shared
    groups, names = ((), ()) if shared is None else (shared.groups, shared.names)
    found = dict(zip(names, fitted.fit.amplitudes, strict=True))
    model = without_ratios(fitted.model)
    model = replace(model, nuisances=tuple(n.used("auto") for n in model.nuisances))
    free = [name for name in model.free if name != LEVER]
    held = model.with_parameters({name: model.parameters[name].fixed() for name in free})
    # similar revolutions' means that each grating is asked on: thirty tell a twentieth of a squared
    # floor and take a third of a second; twice as many tell no more that matters
    rows = [np.linspace(0, len(p) - 1, min(30, len(p))).round() for p in pieces]
    parts = [p.take(np.unique(r.astype(int))) for p, r in zip(pieces, rows, strict=True)]
    numbers = manoeuvres_of(parts)
    for part in parts:
        if not part.member:
            continue
        cells = replace(cells_of(part), member="")  # its lever arm is the model's
        one = model_of(held, part.observable)
        (channel,) = fit_together([cells], one, several=False)
        beside = shared_by(channel.cells, channel.fit, groups)
        if beside is not None:  # baselines of single gratings are in no other's
            does = beside.columns @ np.array([found.get(own, 0.0) for own in beside.names])
            cells = replace(cells, values=cells.values - does)
            (channel,) = fit_together([cells], one, several=False)
        known = channel.model.parameters
        anew = channel.model.with_parameters({n: replace(known[n], free=True) for n in free})
        moved = tuple(n for n in (*free, LEVER) if n in anew.parameters)
        (fit,) = finish(Problem([(channel.cells, channel.white)], anew, moved), anew, True)
        number = np.searchsorted(numbers, part.manoeuvre)
        own = replace(fit.cells, member=part.member, manoeuvre=number)
        yield replace(channel, fit=fit, cells=own), np.zeros((*own.phi.shape, 0)), WHEEL in groups


# ---- Flips over normal equations by manoeuvre: in which frame something repeats.
#
# Columns of each grating: those of the fit, free shapes over the road's angle and over
# the
# wheel's, its lever arm. Blocks of them, tied across gratings or one's own, are asked beside
# others.


_BASE, _LEVER = " base", " lever arm"


@dataclass(frozen=True)
class _Part:
    """Normal equations of one grating: gram (M + 1, P, P), right (M + 1, P).

    By manoeuvre, and last those of all manoeuvres in squared floors. `weight`: the values that a
    mean square of these is over. `columns`: those that a block of all gratings has here.
    """

    name: str
    gram: FloatArray
    right: FloatArray
    weight: float
    columns: Mapping[str, IntArray]


def frames_of(members: Iterable[Member]) -> tuple[Frame, ...]:
    """What repeats beside a fitted model, by frame: all that matters, or the largest of nothing."""
    parts, prior = _parts(members)
    manoeuvres = max(len(part.gram) for part in parts) - 1
    every = [ROAD, WHEEL, *(part.name for part in parts)]
    found: list[Frame] = []
    while len(found) < len(every):
        taken = [frame.frame for frame in found]
        frames = [frame for frame in every if frame not in taken]
        asked = [_evidence(parts, prior, taken, [frame]) for frame in frames]
        statistic, p = flip_test([scores for scores, _ in asked], manoeuvres)
        rows = [Frame(f, asked[i][1], float(p[i])) for i, f in enumerate(frames)]
        # share of the largest frame that its free shape may leave, since its nodes are 3 to 10
        # degrees apart: a splice of 6 degrees leaves 3 %. Twice as much would hide a bad grating
        # beside an effect of eight times its size
        least = 0.06 * max((frame.size for frame in found), default=0.0)
        order = np.argsort(-statistic).tolist()
        large = [rows[i] for i in order if rows[i].matters and rows[i].size > least]
        if not large:
            return tuple(found) or (rows[int(np.argmax(statistic))],)
        found.append(large[0])
    return tuple(found)


def _parts(members: Iterable[Member]) -> tuple[list[_Part], FloatArray]:
    """The normal equations of each grating, and the prior precision of the base's columns."""
    found, prior, lever = [], np.zeros(0), 0.0
    for channel, shared, has_wheel in members:
        fit, cells = channel.fit, channel.cells
        number = {name: k for k, name in enumerate(fit.names)}
        of_levers = [n for n in number if n == LEVER or n.startswith(ratio_name(""))]
        kept = [k for name, k in number.items() if name not in of_levers]
        prior = np.concatenate([np.zeros(len(kept)), np.ones(shared.shape[-1])])
        own = [number[n] for n in of_levers if n in (LEVER, ratio_name(cells.member))][:1]
        blocks: dict[str, list[FloatArray]] = {
            _BASE: [fit.moving[..., kept], shared],
            ROAD: [],
            WHEEL: [],
            _LEVER: [fit.moving[..., own]],
        }
        lever = lever or fit.model.values.get(LEVER, 1.0)
        ratio = fit.model.values.get(LEVER, 1.0) / lever
        # shapes are asked as they are and growing with the speed, from this one on: what an effect
        # of v^2, a lag or a bandwidth leaves at one speed is not what it leaves at another.
        # Another speed spans the same columns
        faster = (cells.conditions.speed_m_s / 15.0 - 1.0)[:, None, None]
        for block, angle in ((ROAD, cells.phi), (WHEEL, cells.phi + cells.place_rad)):
            still = ratio * hats(angle)
            blocks[block] += [still, still * faster]
        wheel = None if has_wheel else shared_effects(cells, fit, WHEEL)
        blocks[WHEEL] += [] if wheel is None else [wheel.columns * wheel.sd]
        found.append(_normal(channel, blocks))
    return found, prior


def _normal(channel: Base, blocks: Mapping[str, Sequence[FloatArray]]) -> _Part:
    """The normal equations of one grating, its logs' offsets taken out."""
    cells = replace(channel.cells, shared=None)
    good, name = np.isfinite(cells.values), cells.member
    columns = np.concatenate([x for block in blocks.values() for x in block], axis=-1)
    columns = np.where(good[..., None], columns, 0.0)
    left = np.where(good, cells.values - channel.fit.prediction, 0.0)

    def equations(metric: Whitener, group: IntArray) -> tuple[FloatArray, FloatArray]:
        own = Offsets.of(cells, metric)
        return Normal.of(own.without(metric(columns)), own.without(metric(left)), group)[:2]

    each = equations(channel.white, cells.manoeuvre)
    of_all = equations(channel.plain, np.zeros_like(cells.manoeuvre))
    gram, right = (
        np.concatenate([one, whole / channel.floor.square])
        for one, whole in zip(each, of_all, strict=True)
    )
    ends = np.cumsum([0, *(sum(x.shape[-1] for x in block) for block in blocks.values())])
    own = {block: np.arange(a, b) for block, (a, b) in zip(blocks, pairwise(ends), strict=True)}
    own |= {name: own[ROAD], f"{_LEVER} {name}": own[_LEVER]}
    return _Part(name, gram, right, channel.plain.weight, own)


def _evidence(
    parts: Sequence[_Part], prior: FloatArray, beside: Sequence[str], tested: Sequence[str]
) -> tuple[Scores, float]:
    """The evidence for blocks of columns beside the base and others, and its squared floors."""
    levers = [f"{_LEVER} {part.name}" for part in parts]
    blocks = [_BASE, *levers, *beside, *tested]
    none = np.zeros(0, np.int64)
    owns = [[part.columns.get(block, none) for block in blocks] for part in parts]
    ends = np.cumsum([0, *(max(own.size for own in block) for block in zip(*owns, strict=True))])
    n, many = int(ends[len(blocks) - len(tested)]), int(ends[-1])
    total = max(len(part.gram) for part in parts)
    gram, right = np.zeros((total, many, many)), np.zeros((total, many))
    for part, own in zip(parts, owns, strict=True):
        where = np.concatenate([e + np.arange(x.size) for e, x in zip(ends, own, strict=False)])
        local, turns = np.concatenate(own), np.append(np.arange(len(part.gram) - 1), total - 1)
        gram[np.ix_(turns, where, where)] += part.gram[:, local[:, None], local]
        right[np.ix_(turns, where)] += part.right[:, local]
    size_gram, size_right, gram, right = gram[-1], right[-1], gram[:-1], right[:-1]
    whole = gram.sum(axis=0) + np.diag(np.pad(prior, (0, many - prior.size)))
    inverse = inverse_of(whole[:n, :n])
    ground = inverse @ right[:, :n].sum(axis=0)
    left = right - gram[:, :, :n] @ ground
    turn = inverse @ whole[:n, n:]
    square = whole[n:, n:] - whole[:n, n:].T @ turn
    # a column of which less than this share is left beside the others is one of them
    seen = np.diag(square) > 1e-9 * np.diag(whole[n:, n:])
    square = square * seen * seen[:, None]
    evidence = Scores((left[:, n:] - left[:, :n] @ turn) * seen, 0.5 * (square + square.T))
    step = evidence.step()
    moved = np.concatenate([-turn @ step, step])
    removed = 2.0 * moved @ (size_right - size_gram[:, :n] @ ground) - moved @ size_gram @ moved
    weights = [part.weight for part in parts if part.name in tested]
    return evidence, float(removed) / (sum(weights) or sum(part.weight for part in parts))


def inverse_of(whole: FloatArray) -> FloatArray:
    """The inverse of normal equations, whatever units their columns have."""
    size = np.sqrt(np.maximum(np.diag(whole), 1e-300))
    # eigenvalues of the normal equations below this share of the largest are rounding
    scaled = np.linalg.pinv(whole / size[:, None] / size, rcond=1e-10, hermitian=True)
    return np.asarray(scaled / size[:, None] / size, dtype=np.float64)


# ---- Several gratings as they are asked: those that agree, and what effects are searched on.


#: gratings that effects are searched on if there are more: a wheel's three harmonics are parted
#: from the road by four places; three would take a third less, and five add what all say again
MOST_SEARCHED = 4


@dataclass(frozen=True)
class Gathered:
    """What a question is asked of: of several gratings all that agree, and those that are searched.

    `base`: the model fitted to what is `searched`, which is all `pieces` if they are few; `every`:
    those with what others contradict; `found`: what the gratings say, None of no gratings.
    """

    every: list[Pieces]
    pieces: list[Pieces]
    searched: list[Pieces]
    base: Base
    found: GratingsFound | None = None

    def beside(self, result: Base, selected: Sequence[str]) -> GratingsFound | None:
        """What was found, beside the selected effects.

        What one grating alone showed before anything was named may be what a free shape leaves of
        the effect: it is asked again beside it.
        """
        found = self.found
        if found is None or not result.channels or not (selected and found.alone):
            return found
        # share of what a grating showed alone that stays with it beside a named effect: all of it
        # if the grating is bad, a tenth if it is what a free shape left of the effect
        before = {frame.frame: 0.5 * frame.size for frame in found.frames}
        after = frames_of(members_held(self.every, result))
        still = {f.frame for f in after if f.matters and f.size > before.get(f.frame, 0.0)}
        return replace(found, agreeing=tuple(n for n in found.alone if n not in still))


def gathered(pieces: list[Pieces], model: Model) -> Gathered:
    """What is to be asked: of several gratings those that no other contradicts.

    A grating that shows what no other does is left out if most remain, two at least.
    """
    every, searched = pieces, spread_out(pieces)
    base, gratings = start_from(searched, model), [part for part in pieces if part.member]
    if not base.channels or not gratings:
        return Gathered(every, pieces, searched, base)
    names = tuple(part.member for part in gratings)
    places = tuple(float(np.degrees(part.place_rad) % 360.0) for part in gratings)
    frames = frames_of(members_of(base) if searched is pieces else members_held(pieces, base))
    found = GratingsFound(names, places, frames, ())
    out = found.alone
    if len(names) - len(out) < max(2, len(out) + 1):
        out = ()
    if out:
        pieces = [part for part in pieces if part.member not in out]
        searched = spread_out(pieces)
        base = start_from(searched, model)
    asked = tuple(name for name in names if name not in out)
    some = () if searched is pieces else tuple(part.member for part in searched)
    found = replace(found, set_apart=out, asked=asked, searched=some)
    return Gathered(every, pieces, searched, base, found)


def spread_out(pieces: list[Pieces]) -> list[Pieces]:
    """The pieces themselves if they are of few gratings; of more those at the most distant angles.

    Of each of these every other piece or so, in turn, so that each manoeuvre is seen by several.
    """
    gratings = [i for i, part in enumerate(pieces) if part.member]
    if len(gratings) < MOST_SEARCHED:
        return pieces
    place, chosen = np.array([part.place_rad for part in pieces]), gratings[:1]
    while len(chosen) < MOST_SEARCHED:
        off = np.abs(np.angle(np.exp(1j * (place[gratings][:, None] - place[chosen]))))
        chosen.append(gratings[int(off.min(axis=1).argmax())])
    some = [part for i, part in enumerate(pieces) if i in chosen or not part.member]
    # similar revolutions' means that a search takes, or as many as one grating has: a search
    # takes 0.2 to 0.4 s for each
    every = int(np.clip(np.ceil(sum(map(len, some)) / 80), 1, MOST_SEARCHED))
    if every == 1:
        return pieces if len(some) == len(pieces) else some
    return [part.take((np.arange(len(part)) + i) % every == 0) for i, part in enumerate(some)]
