"""The pieces of all logs under two limits: `LOG_PIECES` of each log, `MOST_PIECES` of all.

What works on them takes the same time and memory however long and many the logs are.

    Stacks of one log, each in its turn in memory
    more than `LOG_PIECES` of them: manoeuvres, evenly over the speeds of each regime, and of
        conditions that few of them have
        --pieces_of--> their pieces under each other
    the pieces of several logs, more than `MOST_PIECES` together
        --share_out--> each log's share of them, evenly over its speeds

Manoeuvres are left out whole: they are what repeats, and what stays of them scatters as it did. To
average several as one instead would take the scatter between them for the model's error: with loads
that scatter by 1 %, three as one raised reduced chi-square from 1.0 to 2.0. `notes` of the pieces
say what was left out; `cell` knows of each revolution its piece, or the one nearest in speed.

`diagnose` of logs does both steps at once; a campaign's workers do the first and its models the
second, with the same numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tirelog.apart import shared_out
from tirelog.data.recording import Conditions, Stack
from tirelog.inference.cells.pieces import (
    Pieces,
    assign_pieces,
    concatenated_pieces,
    pieces_of,
)
from tirelog.inference.stacks.cut import ANGLES
from tirelog.inference.stacks.spooled import Stacks, outlines
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: pieces of one log (ten minutes of mixed driving): its sixty manoeuvres tell by sign flips what a
#: verdict asks for, and what it calls too small to matter does not shrink with more of them.
#: Twice as many take up to twice the time, and tell strengths to 0.7 of their errors
LOG_PIECES = 160
#: a side of a condition's range with less than this share of the manoeuvres has a share of its own;
#: twice as much shares out halves, which are used alike without
RARE = 0.25
#: pieces that all logs together may have, in `diagnose` as in campaigns: a diagnosis takes 0.35 MB
#: for each beside 240 MB, so it stays below 1 GB, and twice as many would take 1.5 GB
MOST_PIECES = 1800
#: pieces that a log gives at least; if there are so many logs that they have no room, only some of
#: the logs, evenly; with twice as many, half as many logs have a part
LEAST_SHARE = 2


def pieces_of_logs(stacks: Sequence[Stack], most: int = MOST_PIECES) -> Pieces:
    """The pieces of all logs of the stacks, at most `most`.

    Each log is gathered by itself; several share the room.
    """
    outline = outlines(stacks)
    of_log = room(outline[0].phi_rad.size, min(most, LOG_PIECES))
    most = room(outline[0].phi_rad.size, most)
    parts: list[Pieces] = []
    for places in _places_of_logs(outline):
        part = _pieces(stacks, places, outline, of_log)
        first = parts[-1].manoeuvre.max() + 1 if parts else 0
        parts.append(
            replace(part, manoeuvre=np.unique(part.manoeuvre, return_inverse=True)[1] + first)
        )
    chosen = chosen_logs(len(parts), most)
    shares = dict(zip(chosen, share_out([len(parts[i]) for i in chosen], most), strict=True))
    kept, cells, before = [], [], 0
    for number, part in enumerate(parts):
        share = shares.get(number, 0)
        rows = part.spread(share, chosen.index(number)) if share else np.zeros(0, np.int64)
        if rows.size:
            kept.append(part if rows.size == len(part) else part.take(rows))
        cells.append(_nearest(part, rows, before))
        before += rows.size
    said = left_out(before, sum(len(parts[i]) for i in chosen), len(kept), len(parts))
    notes = (*_notes(stacks), *(note for part in kept for note in part.notes), *said)
    return replace(concatenated_pieces(kept), cell=np.concatenate(cells), notes=notes)


def room(angles: int, most: int = MOST_PIECES) -> int:
    """The number of pieces that there is room for.

    `most` waveforms; numbers per revolution take next to none.
    """
    return most if angles > 1 else most * ANGLES


def chosen_logs(logs: int, most: int = MOST_PIECES) -> list[int]:
    """The logs that give pieces: all, or evenly some of them if they have no room."""
    return sorted(
        {int(i) for i in np.linspace(0, logs - 1, min(logs, max(most // LEAST_SHARE, 1))).round()}
    )


def share_out(sizes: Sequence[int], most: int = MOST_PIECES) -> list[int]:
    """How many pieces each log gives, of `sizes` that they have.

    Short logs give all of theirs, longer ones equally many, `most` together.
    """
    highest = max(sizes, default=0)
    while highest > LEAST_SHARE and sum(min(size, highest) for size in sizes) > most:
        highest -= 1
    return [min(size, highest) for size in sizes]


def left_out(used: int, of: int, logs_used: int, logs: int) -> tuple[str, ...]:
    """The sentence on what many logs have no room for, if anything."""
    if used == of and logs_used == logs:
        return ()
    return (
        f"{used} of {of} means of like revolutions are used, spread over the speeds of "
        f"{logs_used} of {logs} logs; more have no room",
    )


def _places_of_logs(stacks: Sequence[Stack]) -> list[list[int]]:
    """The stacks of each log, by their place; all together if one stack holds several logs."""
    logs = [np.unique(stack.log) for stack in stacks]
    if any(names.size > 1 for names in logs):
        return [list(range(len(stacks)))]
    return [
        [i for i, names in enumerate(logs) if names[0] == log]
        for log in dict.fromkeys(int(names[0]) for names in logs)
    ]


def _nearest(part: Pieces, kept: IntArray, before: int) -> IntArray:
    """The piece of each revolution of a log, numbered on from `before`.

    `kept` pieces of the log are left: a revolution has its own, or the one nearest in speed; -1 if
    none is left.
    """
    if not kept.size:
        return np.full(part.cell.size, -1)
    if kept.size == len(part):
        return part.cell + before
    speed = part.conditions.speed_m_s
    nearest = np.abs(speed[:, None] - speed[kept]).argmin(axis=1)
    nearest[kept] = np.arange(kept.size)
    gathered: IntArray = before + nearest[part.cell]
    return gathered


def pieces_of_all(stacks: Sequence[Stack], most: int = LOG_PIECES) -> Pieces:
    """The pieces of stacks that are numbered through, about `most` of each log at most."""
    outline = outlines(stacks)
    pieces = _pieces(stacks, range(len(stacks)), outline, room(outline[0].phi_rad.size, most))
    return replace(pieces, notes=(*_notes(stacks), *pieces.notes))


def _notes(stacks: Sequence[Stack]) -> tuple[str, ...]:
    return stacks.notes if isinstance(stacks, Stacks) else ()


def _pieces(
    stacks: Sequence[Stack], places: Sequence[int], outline: Sequence[Stack], most: int
) -> Pieces:
    """`pieces_of_all` of the stacks at `places`; `outline` all stacks without waveforms.

    Those of which no manoeuvre is used are not read.
    """
    own = [outline[i] for i in places]
    manoeuvre = np.concatenate([stack.manoeuvre for stack in own])
    kept, some = _kept_manoeuvres(own, manoeuvre, most)
    parts: list[Pieces] = []
    cell = np.full(manoeuvre.size, -1)
    used = [np.flatnonzero(np.isin(outline[i].manoeuvre, kept)) for i in places]
    read = [k for k, rows in enumerate(used) if rows.size]

    def part_of(number: int) -> Pieces:
        stack, rows = stacks[places[read[number]]], used[read[number]]
        return pieces_of(stack if rows.size == len(stack) else stack.take(rows))

    before = np.cumsum([0, *(len(stack) for stack in own)])
    for k, part in zip(read, shared_out(len(read), part_of), strict=True):
        cell[before[k] + used[k]] = part.cell + sum(len(one) for one in parts)
        parts.append(part)
    pieces = concatenated_pieces(parts)
    log = np.concatenate([stack.log for stack in own])
    speed = np.concatenate([stack.conditions.speed_m_s for stack in own])
    for number in np.unique(log[cell < 0]):
        rows, there = np.flatnonzero((cell < 0) & (log == number)), pieces.log == number
        cell[rows] = np.flatnonzero(there)[
            _nearest_in_speed(speed[rows], pieces.conditions.speed_m_s[there])
        ]
    notes = (
        f"{pieces.logs[number]}: {used} of {of} manoeuvres are used, spread over the speeds of "
        "each regime; errors are those of what is used"
        for number, (used, of) in some.items()
    )
    return replace(pieces, cell=cell, notes=tuple(notes))


def _nearest_in_speed(speed_m_s: FloatArray, among: FloatArray) -> IntArray:
    """Which of the speeds `among` is nearest to each, (n,)."""
    order = np.argsort(among, kind="stable")
    middle = 0.5 * (among[order][1:] + among[order][:-1])
    nearest: IntArray = order[np.searchsorted(middle, speed_m_s)]
    return nearest


def _kept_manoeuvres(
    outline: Sequence[Stack], manoeuvre: IntArray, most: int
) -> tuple[IntArray, dict[int, tuple[int, int]]]:
    """The manoeuvres that are used, ascending; of logs with others: how many, and of how many.

    About `most` pieces of a log, shared out over its regimes, and in these over manoeuvres under
    conditions that few others have; of each kind its manoeuvres evenly by their mean speed.
    """
    log = np.concatenate([stack.log for stack in outline])
    regime = np.concatenate([stack.regime for stack in outline])
    speed = np.concatenate([stack.conditions.speed_m_s for stack in outline])
    names, first, which = np.unique(manoeuvre, return_index=True, return_inverse=True)

    def mean_of(x: FloatArray) -> FloatArray:
        mean: FloatArray = np.bincount(which, x) / np.bincount(which)
        return mean

    mean = mean_of(speed)
    conditions = [
        np.concatenate([getattr(stack.conditions, name) for stack in outline])
        for name in Conditions.__dataclass_fields__
        if name not in ("speed_m_s", "acceleration_m_s2")  # these make the regimes
    ]
    pieces = np.zeros(names.size, np.int64)
    for stack in outline:
        own = np.unique(np.stack([stack.manoeuvre, assign_pieces(stack)]), axis=1)[0]
        pieces += np.bincount(np.searchsorted(names, own), minlength=names.size)
    kept, used = np.ones(names.size, bool), dict[int, tuple[int, int]]()
    for number in np.unique(log):
        of_log = np.flatnonzero(log[first] == number)
        if pieces[of_log].sum() <= most:
            continue
        rare = np.array([_rare(mean_of(x)[of_log]) for x in conditions])
        regimes = np.unique(regime[first][of_log], return_inverse=True)[1]
        label = np.unique(np.vstack([regimes, rare]), axis=1, return_inverse=True)[1].ravel()
        kinds = [of_log[label == kind] for kind in np.unique(label)]
        shares = share_out([int(pieces[kind].sum()) for kind in kinds], most)
        for kind, share in zip(kinds, shares, strict=True):
            kept[kind] = False
            kept[_spread(kind[np.argsort(mean[kind], kind="stable")], pieces, share)] = True
        used[int(number)] = int(kept[of_log].sum()), of_log.size
    return names[kept], used


def _rare(mean: FloatArray) -> NDArray[np.bool_]:
    """Manoeuvres (n,) on the side of a condition's range that few are on; none if it is not known.

    A wet lap in a dry hour tells what the dry ones cannot.
    """
    known: NDArray[np.bool_] = np.isfinite(mean)
    if not known.any():
        return known
    high: NDArray[np.bool_] = known & (mean > 0.5 * (mean[known].min() + mean[known].max()))
    for side in (high, known & ~high):
        if np.count_nonzero(side) < RARE * np.count_nonzero(known):
            return side
    return np.zeros(mean.size, np.bool_)


def _spread(of_kind: IntArray, pieces: IntArray, most: int) -> IntArray:
    """Evenly some of the manoeuvres `of_kind`, with `most` pieces together, or one of them."""
    for count in range(of_kind.size, 1, -1):
        place = ((np.arange(count) + 0.5) / count * of_kind.size).astype(np.int64)
        if pieces[of_kind[place]].sum() <= most:
            return of_kind[place]
    return of_kind[of_kind.size // 2 : of_kind.size // 2 + 1]
