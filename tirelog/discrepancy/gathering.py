"""The pieces of all stacks; those of long logs gathered, so that what works on them takes the same memory however long the logs are.

    Stacks, one after the other, each in its turn in memory --pieces_of--> their pieces under each other
    more than `MOST_PIECES` of them: manoeuvres of one log and one regime, a few neighbours together --groups-->
        pieces of one group in one band of speed --> one Piece: joined as revolutions are in `pieces` (coefficients out, the rest averaged)

No revolution is left out: each counts in its piece's mean, noise and coefficients, and `cell` knows its piece.  To all that follows a
group is one manoeuvre: replicates are fewer, and no more correlated than manoeuvres are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.discrepancy.pieces import BAND_M_S, Pieces, assign, concatenated, one_waveform, pieces_of
from tirelog.discrepancy.stacks import outlines
from tirelog.recording import Conditions, Stack

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: pieces that all stacks together may have (25 minutes of mixed driving): a diagnosis takes 0.4 MB for each beside 240 MB.  Gathering more
#: would cost what error bars rest on: with loads that scatter by 1 %, three manoeuvres as one raised reduced chi-square from 1.0 to 2.0
MOST_PIECES = 360


def pieces_of_all(stacks: Sequence[Stack], most: int = MOST_PIECES) -> Pieces:
    """The pieces of stacks that are numbered through, `most` or fewer where manoeuvres can be gathered so far."""
    groups = _groups(outlines(stacks), most)
    parts: list[Pieces] = []
    for stack in stacks:
        parts.append(pieces_of(stack))
        if groups is not None and sum(len(part) for part in parts) > 2 * most:
            parts = [_gathered(concatenated(parts), groups)]
    pieces = concatenated(parts)
    if groups is None:
        return pieces
    pieces = _gathered(pieces, groups)
    return replace(pieces, manoeuvre=groups[pieces.manoeuvre])


def _groups(stacks: Sequence[Stack], most: int) -> IntArray | None:
    """The group of each manoeuvre, by its number; None where there are few pieces, or numbers per revolution, which take no room."""
    if stacks[0].phi_rad.size == 1 or sum(int(assign(stack).max()) + 1 for stack in stacks) <= most:
        return None
    manoeuvre, first = np.unique(np.concatenate([stack.manoeuvre for stack in stacks]), return_index=True)
    log = np.concatenate([stack.log for stack in stacks])[first]
    regime = np.unique(np.concatenate([stack.regime for stack in stacks])[first], return_inverse=True)[1]
    band = [_bands(stack.conditions.speed_m_s) for stack in stacks]
    places = np.unique(np.stack([np.concatenate([stack.manoeuvre for stack in stacks]), np.concatenate(band)]), axis=1)
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
    made = [_together(pieces, np.flatnonzero(number == k), coefficients) for k in range(int(number.max()) + 1)]
    return replace(concatenated(made), cell=number[pieces.cell])


def _together(pieces: Pieces, rows: IntArray, coefficients: Sequence[FloatArray]) -> Pieces:
    """The pieces `rows` as one, without the cells of its revolutions."""
    if rows.size == 1:
        return pieces.take(rows)
    weight = pieces.number[rows]
    conditions = Conditions(
        **{name: np.average(getattr(pieces.conditions, name)[rows], weights=weight)[None] for name in Conditions.__dataclass_fields__}
    )
    about = (pieces.conditions.speed_m_s[rows] - conditions.speed_m_s)[:, None]
    count = pieces.count[rows]
    share = count / np.maximum(count.sum(axis=0), 1e-12)
    mean, square = pieces.speed_mean[rows], pieces.speed_square[rows]
    part = one_waveform(pieces.mean[rows], pieces.phi[rows], pieces.variance[rows], count, pieces.conditions.speed_m_s[rows], weight)
    between = _without_trend(part.coefficients, pieces.conditions.speed_m_s[rows])
    changed: dict[str, Any] = {
        "residual_ss": part.residual_ss + pieces.residual_ss[rows].sum(axis=0),
        "freedom": part.freedom + pieces.freedom[rows].sum(axis=0),
        "speed_mean": (share * (mean + about)).sum(axis=0),
        "speed_square": (share * (square + 2.0 * about * mean + about**2)).sum(axis=0),
    }
    names = ("mean", "phi", "variance", "count", "random", "shift", "scatter")
    whole = {name: getattr(part, name) for name in names} | changed
    one = pieces.take(rows[:1])
    return replace(
        one,
        number=weight.sum(keepdims=True),
        coefficients=np.concatenate([_scattered(coefficients[row]) + moved for row, moved in zip(rows, between, strict=True)]),
        conditions=conditions,
        **{name: value[None] for name, value in whole.items()},
    )


def _without_trend(x: FloatArray, along: FloatArray) -> FloatArray:
    """x (k, 3) about its line along (k,), of so few about its mean."""
    k = along.size
    design = np.stack([np.ones(k), along - along.mean()], axis=1)[:, : 2 if k >= 4 else 1]
    return x - design @ np.linalg.lstsq(design, x, rcond=None)[0]


def _scattered(coefficients: FloatArray) -> FloatArray:
    """The coefficients of a piece's revolutions about their trend in the order of driving, as `cells` takes their scatter, at the size that
    counts what the trend took: beside those of other manoeuvres the trend would be taken for scatter."""
    k = len(coefficients)
    left = _without_trend(coefficients, np.arange(float(k)))
    return left * np.sqrt(k / max(k - (2 if k >= 4 else 1), 1))
