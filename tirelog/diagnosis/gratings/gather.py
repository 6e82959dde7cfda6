"""Several gratings as they are asked: those that agree, and what effects are searched on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tirelog.diagnosis.compare import start_from
from tirelog.diagnosis.gratings.evidence import frames_of, strengths_of
from tirelog.diagnosis.gratings.found import GratingsFound
from tirelog.diagnosis.gratings.members import members_held, members_of
from tirelog.inference.base import TogetherBase
from tirelog.inference.cells.together import PiecesTogether
from tirelog.physics.model.model import Model

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

    every: PiecesTogether
    pieces: PiecesTogether
    searched: PiecesTogether
    base: TogetherBase
    found: GratingsFound

    def with_strengths(self, result: TogetherBase, selected: Sequence[str]) -> GratingsFound:
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


def gathered(pieces: PiecesTogether, model: Model) -> Gathered:
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
