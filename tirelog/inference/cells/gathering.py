"""The pieces of all logs under one limit, `MOST_PIECES`.

What works on them takes the same memory however long and many the logs are.

    Stacks of one log, each in its turn in memory --pieces_of--> their pieces under each other
    more than `MOST_PIECES` of them: manoeuvres of one regime, a few neighbours together --groups-->
        pieces of one group in one band of speed --> one Piece: joined as revolutions are in
                                                     `pieces` (coefficients out, the rest averaged)
    the pieces of several logs, more than `MOST_PIECES` together
        --share_out--> each log's share of them, evenly over its speeds

Within a log no revolution is left out: each counts in its piece's mean, noise and coefficients, and
`cell` knows its piece. To all that follows a group is one manoeuvre: replicates are fewer, and no
more correlated than manoeuvres are. Of many logs pieces are left out instead, since gathering them
further would make one manoeuvre of what repeats. `notes` of the pieces say both.

`diagnose` of logs does both steps at once; a campaign's workers do the first and its models the
second, with the same numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tirelog.data.recording import Conditions, Stack
from tirelog.inference.cells.pieces import (
    BAND_M_S,
    Pieces,
    assign_pieces,
    concatenated_pieces,
    one_waveform,
    pieces_of,
)
from tirelog.inference.stacks.cut import ANGLES
from tirelog.inference.stacks.spooled import Stacks, outlines
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: pieces that all logs together may have (an hour of mixed driving), in `diagnose` as in campaigns:
#: a diagnosis takes 0.35 MB for each beside 240 MB, so it stays below 1 GB, and twice as many would
#: take 1.5 GB. Gathering costs what error bars rest on: with loads that scatter by 1 %, three
#: manoeuvres as one raised reduced chi-square from 1.0 to 2.0
MOST_PIECES = 1800
#: pieces that a log gives at least; if there are so many logs that they have no room, only some of
#: the logs, evenly; with twice as many, half as many logs have a part
LEAST_SHARE = 2


def pieces_of_logs(stacks: Sequence[Stack], most: int = MOST_PIECES) -> Pieces:
    """The pieces of all logs of the stacks, at most `most`.

    Each log is gathered by itself; several share the room.
    """
    outline = outlines(stacks)
    most = room(outline[0].phi_rad.size, most)
    parts: list[Pieces] = []
    for places in _places_of_logs(outline):
        part = _pieces((stacks[i] for i in places), [outline[i] for i in places], most)
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


def pieces_of_all(stacks: Sequence[Stack], most: int = MOST_PIECES) -> Pieces:
    """The pieces of stacks that are numbered through.

    They are `most` or fewer if manoeuvres can be gathered so far.
    """
    pieces = _pieces(stacks, outlines(stacks), most)
    return replace(pieces, notes=(*_notes(stacks), *pieces.notes))


def _notes(stacks: Sequence[Stack]) -> tuple[str, ...]:
    return stacks.notes if isinstance(stacks, Stacks) else ()


def _pieces(stacks: Iterable[Stack], outline: Sequence[Stack], most: int) -> Pieces:
    """`pieces_of_all` of stacks as they come; `outline` the same without waveforms."""
    groups = _groups(outline, most)
    parts: list[Pieces] = []
    for stack in stacks:
        parts.append(pieces_of(stack))
        if groups is not None and sum(len(part) for part in parts) > 2 * most:
            parts = [_gathered(concatenated_pieces(parts), groups)]
    pieces = concatenated_pieces(parts)
    if groups is None:
        return pieces
    before = np.unique(np.concatenate([stack.manoeuvre for stack in outline])).size
    pieces = _gathered(pieces, groups)
    manoeuvre = groups[pieces.manoeuvre]
    said = (
        f"{', '.join(pieces.logs[i] for i in np.unique(pieces.log))}: {before} manoeuvres are "
        "taken together as "
        f"{np.unique(manoeuvre).size}, some neighbours of one regime as one; scatter between "
        "those counts as the model's error"
    )
    return replace(pieces, manoeuvre=manoeuvre, notes=(said,))


def _groups(stacks: Sequence[Stack], most: int) -> IntArray | None:
    """The group of each manoeuvre, by its number.

    None if there are few pieces, or numbers per revolution, which take no room.
    """
    if (
        stacks[0].phi_rad.size == 1
        or sum(int(assign_pieces(stack).max()) + 1 for stack in stacks) <= most
    ):
        return None
    manoeuvre, first = np.unique(
        np.concatenate([stack.manoeuvre for stack in stacks]), return_index=True
    )
    log = np.concatenate([stack.log for stack in stacks])[first]
    regime = np.unique(
        np.concatenate([stack.regime for stack in stacks])[first], return_inverse=True
    )[1]
    band = [_bands(stack.conditions.speed_m_s) for stack in stacks]
    places = np.unique(
        np.stack([np.concatenate([stack.manoeuvre for stack in stacks]), np.concatenate(band)]),
        axis=1,
    )
    kind = np.unique(np.stack([log, regime]), axis=1, return_inverse=True)[1].ravel()
    order = np.zeros(manoeuvre.size, np.int64)  # of a manoeuvre among those of its kind
    for k in np.unique(kind):
        order[kind == k] = np.arange((kind == k).sum())
    groups = np.zeros(int(manoeuvre.max()) + 1, np.int64)
    for together in range(2, int(order.max()) + 2):
        label = np.stack([kind, order // together])
        _, begun, number = np.unique(label, axis=1, return_index=True, return_inverse=True)
        groups[manoeuvre] = np.argsort(np.argsort(begun))[number.ravel()]  # in the order of driving
        if np.unique(np.stack([groups[places[0]], places[1]]), axis=1).shape[1] <= most:
            break
    return groups


def _bands(speed_m_s: FloatArray) -> IntArray:
    return np.floor(speed_m_s / BAND_M_S).astype(np.int64)


def _gathered(pieces: Pieces, groups: IntArray) -> Pieces:
    """Pieces of one group in one band of speed as one; it has the manoeuvre of its first."""
    keys = np.stack([groups[pieces.manoeuvre], _bands(pieces.conditions.speed_m_s)])
    number = np.unique(keys, axis=1, return_inverse=True)[1].ravel()
    coefficients = np.split(pieces.coefficients, np.cumsum(pieces.number)[:-1])
    made = [
        _together(pieces, np.flatnonzero(number == k), coefficients)
        for k in range(int(number.max()) + 1)
    ]
    return replace(concatenated_pieces(made), cell=number[pieces.cell])


def _together(pieces: Pieces, rows: IntArray, coefficients: Sequence[FloatArray]) -> Pieces:
    """The pieces `rows` as one, without the cells of its revolutions."""
    if rows.size == 1:
        return pieces.take(rows)
    weight = pieces.number[rows]
    conditions = Conditions(
        **{
            name: np.average(getattr(pieces.conditions, name)[rows], weights=weight)[None]
            for name in Conditions.__dataclass_fields__
        }
    )
    about = (pieces.conditions.speed_m_s[rows] - conditions.speed_m_s)[:, None]
    count = pieces.count[rows]
    share = count / np.maximum(count.sum(axis=0), 1e-12)
    mean, square = pieces.speed_mean[rows], pieces.speed_square[rows]
    part = one_waveform(
        pieces.mean[rows],
        pieces.phi[rows],
        pieces.variance[rows],
        count,
        pieces.conditions.speed_m_s[rows],
        weight,
    )
    apart = np.where(count > 0, pieces.phi[rows] - part.phi, 0.0)
    between = _without_trend(part.coefficients, pieces.conditions.speed_m_s[rows])
    changed: dict[str, Any] = {
        "residual_ss": part.residual_ss + pieces.residual_ss[rows].sum(axis=0),
        "freedom": part.freedom + pieces.freedom[rows].sum(axis=0),
        "still": (share * pieces.still[rows]).sum(axis=0),
        "speed_mean": (share * (mean + about)).sum(axis=0),
        "speed_square": (share * (square + 2.0 * about * mean + about**2)).sum(axis=0),
        "speed_angle": (share * (pieces.speed_angle[rows] + (mean + about) * apart)).sum(axis=0),
    }
    names = ("mean", "phi", "variance", "count", "random", "shift", "scatter")
    whole = {name: getattr(part, name) for name in names} | changed
    one = pieces.take(rows[:1])
    return replace(
        one,
        number=weight.sum(keepdims=True),
        coefficients=np.concatenate(
            [
                _scattered(coefficients[row]) + moved
                for row, moved in zip(rows, between, strict=True)
            ]
        ),
        conditions=conditions,
        **{name: value[None] for name, value in whole.items()},
    )


def _without_trend(x: FloatArray, along: FloatArray) -> FloatArray:
    """x (k, 3) about its line along (k,), of so few about its mean."""
    k = along.size
    design = np.stack([np.ones(k), along - along.mean()], axis=1)[:, : 2 if k >= 4 else 1]
    left: FloatArray = x - design @ np.linalg.lstsq(design, x, rcond=None)[0]
    return left


def _scattered(coefficients: FloatArray) -> FloatArray:
    """The coefficients of a piece's revolutions about their trend.

    The trend is in the order of driving, as `cells` takes their scatter; the size counts what the
    trend took. Beside those of other manoeuvres the trend would be taken for scatter.
    """
    k = len(coefficients)
    left = _without_trend(coefficients, np.arange(float(k)))
    scaled: FloatArray = left * np.sqrt(k / max(k - (2 if k >= 4 else 1), 1))
    return scaled
