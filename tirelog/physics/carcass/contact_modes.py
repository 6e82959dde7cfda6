"""Modes of the contact pressure for the rows of a prediction, between solved contacts.

    ContactState --pressure_modes--> L, modes of p
                 --pressure_modes_near--> the same a small step away, by derivatives: the angles
                                          that touch stay, and of them all is linear

Loads and tensions are few or nodes of a table. Losses follow the speed and are small beside the
ring's stiffness: contacts are solved with those of one row between, and the other rows are a step
away by derivatives.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from tirelog.physics.carcass.contact import (
    BY,
    LOSSES,
    NONE,
    SIDEWALLS,
    STIFFNESSES,
    moved,
    solve_contact,
    solve_lossy,
)
from tirelog.physics.carcass.structures import RingCarcass
from tirelog.physics.spectral import GRID, MODES, STEP, ComplexArray, to_modes
from tirelog.vocabulary.arrays import FloatArray

#: Loads that differ are solved one by one up to this number, else on as many Chebyshev nodes as
#: _TABLE and interpolated. Twice as many nodes take twice as long for errors far below the
#: solution's own.
_FEW, _TABLE = 4, 8
#: The same of tensions, which differ by less from log to log and with the speed. Twice as many
#: take twice as long.
_FEW_TENSIONS, _TENSIONS = 4, 4
#: Nodes are laid over a range that is widened to whole steps of this share of it, at most, so that
#: sensors which passed the patch at nearly the same speeds ask for the same contacts; twice as much
#: widens it by up to a quarter
_RANGE_STEP = 1.0 / 16.0
#: Losses that differ are solved for at one of so many values per octave, for the same reason; half
#: as many leave a step of up to a fifth to derivatives, which is right to the square of it
_PER_OCTAVE = 4.0


@dataclass(frozen=True)
class ContactState:
    """What a contact is solved for: the carcass, and columns of load and p0 b (n or 1, 1).

    p0 b with what other tension there is, over R, in place of the carcass's own. `losses`: columns
    (n or 1, 4) of the strengths of `contact.LOSSES`; `stiffer` (n or 1, 1): what the
    carcass's k_w and k_v are multiplied by.
    """

    carcass: RingCarcass
    load_N: FloatArray
    pb_N_m: FloatArray
    losses: FloatArray = field(default_factory=lambda: np.zeros((1, len(LOSSES))))
    stiffer: FloatArray = field(default_factory=lambda: np.ones((1, 1)))

    def at(self, stiffer: float, pb_N_m: float) -> RingCarcass:
        """The carcass with so much stiffer sidewalls, at that tension."""
        own = self.carcass
        return replace(own, k_w=own.k_w * stiffer, k_v=own.k_v * stiffer, pb=pb_N_m)


#: solved contacts: carcass, losses, loads
_Solved = tuple[RingCarcass, tuple[float, ...], tuple[float, ...]]


def pressure_modes(
    state: ContactState, *, tilted: bool
) -> tuple[FloatArray, ComplexArray, ComplexArray | None]:
    """(L, modes of p, if asked for modes of p xi / L), between solved loads and tensions."""
    solved, share = _solved_at(state, state)
    half, modes = _tables(solved, tilted)
    if (share == 1.0).any(axis=1).all():  # each row is at a node
        which = share.argmax(axis=1)
        half, modes = half[which], modes[which]
    else:
        half, modes = share @ half, share @ modes
    steps = state.losses - np.array(solved[0][1])
    if np.any(steps):
        of_losses = [_Step(0.0, step) for step in steps.T[..., None]]
        moved = _stepped(solved, share, [_Step(0.0, 0.0)] * BY + of_losses, tilted)
        half, modes = half + moved[:, :1], modes + moved[:, 1:]
    return half, *_as_modes(modes, tilted)


def pressure_modes_near(
    near: ContactState, state: ContactState, *, tilted: bool
) -> tuple[FloatArray, ComplexArray, ComplexArray | None] | None:
    """`pressure_modes` of a state a small step from another, by the derivatives there.

    None if a step of the radius parts them, or one of the contacts has no derivatives.
    """
    if near.carcass.R != state.carcass.R:
        return None
    solved, share = _solved_at(near, state)
    there = share @ np.concatenate(_tables(solved, tilted), axis=1)
    at = [carcass for carcass, _, loads_N in solved for _ in loads_N]
    before, after = near.carcass, state.carcass
    # a solved one moves by its own constants, as far as its sidewalls are stiffer; a row between
    # the solved ones has moved along with its share
    stiffer = np.array([carcass.k_w for carcass in at])[:, None] / before.k_w
    stiffened: FloatArray | float = 0.0
    if np.any(state.stiffer != 1.0) or np.any(near.stiffer != 1.0):
        stiffened = state.stiffer - share @ stiffer
    steps = [
        _Step(
            (getattr(after, name) - getattr(before, name))
            * (stiffer if name in SIDEWALLS else 1.0),
            getattr(after, name) * stiffened if name in SIDEWALLS else 0.0,
        )
        for name in STIFFNESSES
    ]
    steps += [
        _Step(0.0, column - share @ np.array(nodes)[:, None])
        for column, nodes in (
            (state.pb_N_m, [carcass.pb for carcass in at]),
            (state.load_N, [load_N for _, _, loads_N in solved for load_N in loads_N]),
        )
    ]
    steps += [_Step(0.0, step) for step in (state.losses - np.array(solved[0][1])).T[..., None]]
    try:
        there = there + _stepped(solved, share, steps, tilted)
    except _NoSlopes:
        return None
    return there[:, :1], *_as_modes(there[:, 1:], tilted)


class _Step(NamedTuple):
    """How far a constant moves: of each solved contact (k, 1), and of each row besides (n, 1)."""

    of_node: FloatArray | float
    of_row: FloatArray | float


class _NoSlopes(Exception):
    """One of the contacts is not one stretch about the middle."""


def _stepped(
    solved: list[_Solved], share: FloatArray, steps: Sequence[_Step], tilted: bool
) -> FloatArray:
    """What steps by stiffnesses, p0 b, load and losses do to L and the modes."""
    total: FloatArray = np.zeros((share.shape[0], 1))
    lossy = any(bool(np.any(step.of_row)) for step in steps[BY:])
    for i, step in enumerate(steps):
        if not (np.any(step.of_node) or np.any(step.of_row)):
            continue
        slopes = [_slopes(*contacts, tilted, lossy) for contacts in solved]
        if any(slope is None for slope in slopes):
            raise _NoSlopes
        slope = np.concatenate([x[i] for x in slopes if x is not None])
        total = total + share @ (step.of_node * slope) + step.of_row * (share @ slope)
    return total


def _as_modes(pairs: FloatArray, tilted: bool) -> tuple[ComplexArray, ComplexArray | None]:
    modes = np.ascontiguousarray(pairs).view(np.complex128)
    return modes[:, :MODES], modes[:, MODES:] if tilted else None


def _solved_at(state: ContactState, rows_of: ContactState) -> tuple[list[_Solved], FloatArray]:
    """The contacts at which a state is solved, and the shares (n, k) in them.

    In those of the first carcass, then of the second, ...; the shares of the rows of this state or
    of one a small step away. All have the same losses.
    """
    load, pb, stiff, load_there, pb_there, stiff_there = (
        x[:, 0]
        for x in np.broadcast_arrays(
            *(x for one in (state, rows_of) for x in (one.load_N, one.pb_N_m, one.stiffer)),
            state.losses[:, :1],
        )[:6]
    )
    losses = _between(state.losses)
    solved, columns = [], []
    for stiffer, of_stiff in _shared(stiff, stiff_there):
        alike = np.flatnonzero(of_stiff)
        for tension, of_tension in _shared(pb[alike], pb_there[alike]):
            rows, share = alike[of_tension != 0.0], of_tension[of_tension != 0.0]
            nodes, weights = _nodes(load[rows], load_there[rows], _FEW, _TABLE)
            solved.append((state.at(stiffer, tension), losses, tuple(nodes.tolist())))
            column = np.zeros((load.size, nodes.size))
            column[rows] = weights * (share * of_stiff[rows])[:, None]
            columns.append(column)
    return solved, np.hstack(columns)


def _shared(values: FloatArray, there: FloatArray) -> Iterator[tuple[float, FloatArray]]:
    """`_nodes` of tensions or stiffnesses, one by one: a value to solve at, its weights (n,)."""
    nodes, weights = _nodes(values, there, _FEW_TENSIONS, _TENSIONS)
    yield from zip(nodes.tolist(), weights.T)


def _between(losses: FloatArray) -> tuple[float, ...]:
    """Losses between those of the rows (n, 4), at round values unless all rows have the same."""
    if not np.any(losses):
        return NONE
    mean, differ = losses.mean(axis=0), np.ptp(losses, axis=0) > 0.0
    size = np.maximum(np.abs(mean), 1e-300)
    rounded = np.sign(mean) * 2.0 ** (np.round(_PER_OCTAVE * np.log2(size)) / _PER_OCTAVE)
    return tuple(np.where(differ, rounded, mean).tolist())


def _tables(solved: list[_Solved], tilted: bool) -> tuple[FloatArray, FloatArray]:
    """Those of all solved contacts under each other."""
    half, modes = (
        np.concatenate(parts) for parts in zip(*(_table(*one, tilted) for one in solved))
    )
    return half, modes


@lru_cache(maxsize=128)
def _table(
    carcass: RingCarcass, losses: tuple[float, ...], loads_N: tuple[float, ...], tilted: bool
) -> tuple[FloatArray, FloatArray]:
    """What `pressure_modes` gives at k loads, (k, 1), and modes as pairs of numbers (k, ...)."""
    half = np.empty((len(loads_N), 1))
    grid = np.zeros((len(loads_N), 2 if tilted else 1, GRID))
    for row, load_N in enumerate(loads_N):
        if losses == NONE:
            contact = solve_contact(carcass, load_N)
            on, p = np.round(contact.phi_rad / STEP).astype(int), contact.pressure_N_m
            half[row] = contact.half_length_m
        else:
            lossy = solve_lossy(carcass, losses, load_N)
            on, p, half[row] = lossy.on, lossy.pressure_N_m, lossy.half_length_m
        grid[row, 0, on] = p
        if tilted:
            grid[row, 1, on] = p * (on * STEP) * (carcass.R / half[row])
    return half, _pairs(grid)


def _pairs(grid: FloatArray) -> FloatArray:
    """Modes of what stands on the grid (k, ..., GRID), as pairs of numbers one after the other."""
    modes = np.ascontiguousarray(to_modes(grid)).view(np.float64)
    return modes.reshape(grid.shape[0], -1)


@lru_cache(maxsize=16)
def _slopes(
    carcass: RingCarcass,
    losses: tuple[float, ...],
    loads_N: tuple[float, ...],
    tilted: bool,
    lossy: bool,
) -> FloatArray | None:
    """Derivatives of `_table` side by side, by each of STIFFNESSES, by p0 b, by the load.

    (6, k, 1 + ...), or (10, k, 1 + ...) with those by each of the losses; None if a contact is not
    one stretch about the middle.
    """
    number = BY + len(LOSSES) if lossy or losses != NONE else BY
    half = np.empty((number, len(loads_N), 1))
    grid = np.zeros((number, len(loads_N), 2 if tilted else 1, GRID))
    for row, load_N in enumerate(loads_N):
        if number > BY:
            contact = solve_lossy(carcass, losses, load_N)
            on, p, length = contact.on, contact.pressure_N_m, contact.half_length_m
            change, half[:, row, 0] = contact.slopes
        else:
            found = moved(carcass, load_N)
            if found is None:
                return None
            on, p, length, change, half[:, row, 0] = found
        grid[:, row, 0, on] = change
        if tilted:
            along = (on * STEP) * (carcass.R / length)
            grid[:, row, 1, on] = (change - half[:, row] / length * p) * along
    modes = _pairs(grid.reshape(number * len(loads_N), -1, GRID)).reshape(number, len(loads_N), -1)
    return np.concatenate([half, modes], axis=-1)


def _nodes(
    values: FloatArray, there: FloatArray, few: int, table: int
) -> tuple[FloatArray, FloatArray]:
    """Values to solve at, (k,), and weights (n, k) that interpolate from them to others `there`.

    Few values are solved at themselves; those that are near to one have the weights of it alone.
    """
    distinct, inverse = np.unique(values, return_inverse=True)
    if distinct.size <= few:
        return distinct, np.eye(distinct.size)[inverse]
    step = _RANGE_STEP * 2.0 ** np.floor(np.log2(distinct[-1] - distinct[0]))
    low, high = step * np.floor(distinct[0] / step), step * np.ceil(distinct[-1] / step)
    angle = (np.arange(table) + 0.5) * np.pi / table
    nodes = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(angle)
    barycentric = (-1.0) ** np.arange(table) * np.sin(angle)
    distance = there[:, None] - nodes
    exact = distance == 0.0
    ratio = barycentric / np.where(exact, 1.0, distance)
    weights = np.where(
        exact.any(axis=1, keepdims=True),
        exact.astype(float),
        ratio / ratio.sum(axis=1, keepdims=True),
    )
    return nodes, weights
