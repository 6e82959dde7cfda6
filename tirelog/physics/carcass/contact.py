"""One-sided contact of the ring's tread with a flat road at a given load.

The contact algorithm that P3 describes.

The tread is a layer of springs k_t [N/m^2]; it presses where the deformed ring would go below the
road and never pulls:

    p = k_t max(0, delta - R (1 - cos phi) - u(phi)),   u = A p,   sum p h = F

with u the ring's vertical yield. Solved by active sets (Newton's method on the max), on the
waveform's grid; the load is a row of the linear system, so it is carried to rounding. The ring has
all its tension, that of effects too. Without losses it is even about the patch centre, and one half
is solved for. Damping delays the ring's response to a load: the yield is no longer even, and the
pressure leans towards the entry edge. It leans more than under a given pressure with the same loss.
A user's own effects on the foundation do not change the pressure.

    carcass, F, losses --solve_contact--> pressure at the angles that touch --.slopes--> derivatives
    ContactState --pressure_modes--> modes of the pressure, for rows of loads, tensions and losses
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.fft import irfft, rfft
from scipy.linalg.lapack import dgetrf, dgetrs

from tirelog.errors import ModelError
from tirelog.physics.carcass.structures import RingCarcass, modal_impedance
from tirelog.physics.spectral import (
    GRID,
    MODES,
    STEP,
    ComplexArray,
    interpolation_shares,
    to_modes,
)
from tirelog.vocabulary.arrays import FloatArray

#: Farthest angle from the patch centre [rad] that may touch the road. Half of it, 0.4, is a patch
#: of 12 cm to either side at 0.3 m; twice as much doubles the nodes.
REACH = 0.8
NODES = int(REACH / STEP)
#: the waves of the grid
_WAVES = np.arange(GRID // 2 + 1, dtype=np.float64)
#: What a contact moves with: these constants of the carcass, p0 b and the load.
STIFFNESSES = ("EI", "k_w", "k_v", "k_t")
BY = len(STIFFNESSES) + 2
#: Those of them that are the sidewalls'.
SIDEWALLS = ("k_w", "k_v")
#: what losses are made of, each a strength at a speed: of the radial and the tangential foundation
#: in proportion to the wave's frequency [N/m^2], of the radial one the same at every frequency
#: [N/m^2], and of the belt in bending in proportion to it [N m^2]
LOSSES = ("radial_rate", "tangential_rate", "radial", "bending_rate")

#: the factors of `dgetrf`
_Factors = tuple[FloatArray, NDArray[np.int32]]


@dataclass(frozen=True)
class Contact:
    """A solved contact: pressure [N/m] at the grid's angles `on` (k,) of -NODES ... NODES.

    Half length [m] of the patch and the hub's drop [m]. `solved` (k,): the number of each angle's
    pressure in the equations, of which an even contact has one for two angles; `factors` of these
    for pressure and drop; `edges` what places each edge: the last angle that touches, its depth
    [m] and that of the next one, and how the next one yields under the pressures.
    """

    carcass: RingCarcass
    losses: tuple[float, ...]
    on: NDArray[np.int64]
    pressure_N_m: FloatArray
    half_length_m: float
    drop_m: float
    solved: NDArray[np.int64]
    factors: _Factors
    edges: tuple[tuple[int, float, float, FloatArray], ...]

    @property
    def phi_rad(self) -> FloatArray:
        return np.asarray(self.on * STEP, dtype=np.float64)

    @property
    def slopes(self) -> tuple[FloatArray, FloatArray]:
        """Derivatives of pressure (6, k) and half length (6,), while the same angles touch.

        By EI, k_w, k_v, k_t, p0 b and the load; of a contact with losses also by each of these,
        (10, ...).
        """
        carcass, p, on = self.carcass, self.pressure_N_m, self.on
        lossy = 1j * loss_shapes(_WAVES, carcass.R)[: len(self.losses)]
        changes = np.concatenate([by_stiffness(_WAVES, carcass.R) + 0j, lossy])
        inverse = -changes / _impedance(carcass, self.losses) ** 2
        outer = [on[0] - 1, on[-1] + 1][-len(self.edges) :]
        yields = _yields_at(_spectra(inverse), on, p, np.append(on, outer))
        by_tread, by_load = np.zeros((2, yields.shape[1]))
        by_tread[: on.size] = -p / carcass.k_t**2
        right = -np.stack([*yields[:3], by_tread, yields[3], by_load, *yields[4:]])
        carries = carcass.R * STEP * np.bincount(self.solved)
        own = right[:, on.size - carries.size : on.size]  # what is before it is a mirror image
        found, _ = dgetrs(*self.factors, np.vstack([own, np.ones(carries.size)]).T)
        load = np.zeros(right.shape[0])
        load[5] = 1.0
        drop = (load - carries @ found[:, :-1]) / (carries @ found[:, -1])
        moved = (found[:, :-1] + np.outer(found[:, -1], drop)).T
        half = np.zeros(right.shape[0])
        for (at, last, after, under), beyond in zip(self.edges, right[:, on.size :].T, strict=True):
            of_last = moved[:, at] / carcass.k_t
            of_last[3] -= p[at] / carcass.k_t**2
            of_after = drop + beyond - moved @ under
            half += (last * of_after - after * of_last) / (last - after) ** 2
        return moved[:, self.solved], carcass.R * STEP / len(self.edges) * half


def by_stiffness(n: FloatArray, R: float) -> FloatArray:
    """Derivatives of Z_n by EI, k_w, k_v and p0 b, (4, k)."""
    return np.stack(
        [n**2 * (1.0 - n**2) ** 2 / R**4, n**2, np.ones_like(n), n**2 * (n**2 - 1.0) / R]
    )


def loss_shapes(n: FloatArray, R: float) -> FloatArray:
    """Im Z_n (4, k) per strength of each of `LOSSES`, of Z_n of `structures.modal_impedance`."""
    return np.stack([n**3, n, n**2, n**3 * (1.0 - n**2) ** 2 / R**4])


def _impedance(carcass: RingCarcass, losses: tuple[float, ...]) -> ComplexArray:
    lost = np.array(losses) @ loss_shapes(_WAVES, carcass.R)[: len(losses)]
    return np.asarray(modal_impedance(_WAVES, carcass).real + 1j * lost, dtype=np.complex128)


def _spectra(inverse: ComplexArray) -> ComplexArray:
    """1 / Z_n, i n / Z_n and n^2 / Z_n (3, ..., K), by which the ring yields."""
    return np.stack([inverse, 1j * _WAVES * inverse, _WAVES**2 * inverse])


@lru_cache(maxsize=16)
def _yields(carcass: RingCarcass, losses: tuple[float, ...]) -> ComplexArray:
    """`_spectra` of a carcass."""
    return _spectra(1.0 / _impedance(carcass, losses))


def _yields_at(
    spectra: ComplexArray, on: NDArray[np.int64], p: FloatArray, at: NDArray[np.int64]
) -> FloatArray:
    """How far the angles `at` yield upwards [m] under p (k,) at the angles `on`, (..., j)."""
    loads = np.zeros((2, GRID))
    loads[0, on], loads[1, on] = np.cos(on * STEP) * p, np.sin(on * STEP) * p
    a, b, d = spectra
    cp, sp = rfft(loads, axis=-1)
    along_cos, along_sin = irfft(np.stack([d * cp + b * sp, a * sp - b * cp]), GRID, axis=-1)
    return np.asarray(
        np.cos(at * STEP) * along_cos[..., at] + np.sin(at * STEP) * along_sin[..., at]
    )


def check_load(load_N: float) -> None:
    """ModelError for a load that is not above zero."""
    if not load_N > 0.0:
        raise ModelError(
            f"load {load_N:g} N does not press the tire on the road",
            allowed="a load above zero is allowed",
            do="correct load_N or the effects on load",
        )


@lru_cache(maxsize=384)
def solve_contact(carcass: RingCarcass, load_N: float, losses: tuple[float, ...] = ()) -> Contact:
    """The contact at the load F [N] of a ring with these losses; without any it is even.

    ModelError if the load is not above zero or the patch grows beyond REACH.
    """
    check_load(load_N)
    # the search begins with the angles up to 0.2 rad, which changes no digit, and looks for an edge
    # among a quarter more; twice as many take twice as long, and it is asked beyond them too
    last = int(solve_contact(carcass, load_N).on[-1]) if losses else int(0.2 / STEP)
    farthest = last + max(12, last // 4)
    for wide in sorted({min(farthest << k, NODES) for k in range(NODES.bit_length())}):
        found = _contact_within(carcass, losses, load_N, last, wide)
        if found is not None:
            return found
    raise ModelError(
        f"at {load_N:g} N the patch grows beyond {REACH:g} rad to either side, or its contact with "
        "the flat road finds no balance",
        allowed="a shorter patch is allowed",
        do="give a stiffer foundation, less damping or a lower load",
    )


def _contact_within(
    carcass: RingCarcass,
    losses: tuple[float, ...],
    load_N: float,
    last: int,
    farthest: int,
) -> Contact | None:
    """The contact among the angles up to `farthest`; None if it reaches beyond them.

    Sought from those up to the number `last` on.
    """
    even, spectra = not losses, _yields(carcass, losses)
    nodes = np.arange(0 if even else -farthest, farthest + 1)
    yields = _among(carcass, losses, farthest)
    carries = carcass.R * STEP * np.where((nodes > 0) & even, 2.0, 1.0)
    shape = carcass.R * (1.0 - np.cos(nodes * STEP))
    found = balance(yields, shape, carries, carcass.k_t, load_N, np.abs(nodes) <= last)
    if found is None:
        return None
    at, p, drop, depth, factors = found
    on = nodes[at]
    if even:
        on = np.concatenate([-on[on > 0][::-1], on])
    solved = np.searchsorted(nodes[at], np.abs(on) if even else on)
    # would an angle within reach that does not press lie below the road?
    everywhere = np.arange(-NODES, NODES + 1)
    beyond = drop - carcass.R * (1.0 - np.cos(everywhere * STEP))
    beyond -= _yields_at(spectra, on, p[solved], everywhere)
    beyond[on + NODES] = 0.0
    if beyond.max() > 1e-12:
        return None
    ends = [(0, at[0], at[0] - 1), (-1, at[-1], at[-1] + 1)][-1 if even else 0 :]
    edges = tuple(
        (end, float(depth[inner]), float(depth[outer]), yields[outer, at])
        for end, inner, outer in ends
    )
    # an edge lies where the depth crosses zero beyond the last angle that presses
    more = np.mean([inner / (inner - outer) for _, inner, outer, _ in edges])
    half = carcass.R * STEP * (0.5 * (on[-1] - on[0]) + more)
    return Contact(carcass, losses, on, p[solved], float(half), drop, solved, factors, edges)


def balance(
    yields: FloatArray,
    shape: FloatArray,
    carries: FloatArray,
    k_t: float,
    load_N: float,
    active: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], FloatArray, float, FloatArray, _Factors] | None:
    """(Angles that touch, pressure there, drop, depth of all angles, factors), or None.

    By active sets from those that are `active` (j,). `yields` (j, j) [m per N/m], `shape` (j,) how
    high the road's tangent is below each angle, `carries` (j,) the load per pressure [m]. None too
    if an angle at an end touches.
    """
    for _ in range(100):  # from anywhere it takes some six
        on = np.flatnonzero(active)
        system = np.asfortranarray(yields[np.ix_(on, on)])
        system[np.diag_indices(on.size)] += 1.0 / k_t
        *factors, _ = dgetrf(system, overwrite_a=1)
        by_drop, by_shape = dgetrs(*factors, np.stack([np.ones(on.size), shape[on]], axis=1))[0].T
        drop = float((load_N + carries[on] @ by_shape) / (carries[on] @ by_drop))
        p = drop * by_drop - by_shape
        depth = drop - shape - yields[:, on] @ p
        pressing = depth > 0.0
        if np.array_equal(pressing, active):
            ends = pressing[-1] or (pressing[0] and shape[0] > 0.0)  # the middle is no end
            return None if ends else (on, p, drop, depth, (factors[0], factors[1]))
        if not pressing.any():
            return None
        active = pressing
    return None


@lru_cache(maxsize=16)
def _among(carcass: RingCarcass, losses: tuple[float, ...], farthest: int) -> FloatArray:
    """How far each angle up to the `farthest` yields under pressure at each of them, (j, j).

    Without losses those of one half, under the same pressure at the other.
    """
    nodes = np.arange(-farthest, farthest + 1)
    lags, first = np.arange(1 - nodes.size, nodes.size) % GRID, 0 if losses else farthest
    a, b, d = (
        sliding_window_view(kernel[lags], nodes.size)[first:, ::-1]
        for kernel in irfft(_yields(carcass, losses), GRID, axis=-1)
    )
    cos, sin = np.cos(nodes * STEP), np.sin(nodes * STEP)
    matrix: FloatArray = cos[first:, None] * (d * cos + b * sin)
    matrix += sin[first:, None] * (a * sin - b * cos)
    if losses:
        return matrix
    half = matrix[:, farthest:]
    half[:, 1:] += matrix[:, farthest - 1 :: -1]  # the angle zero has no other half
    return half


# ---- Modes of the contact pressure for the rows of a prediction, between solved contacts.
#
#     ContactState --pressure_modes--> L, modes of p; a small step away by derivatives: the angles
#                                      that touch stay, and of them all is linear
#
# Loads and tensions are few or nodes of a table. Losses follow the speed and are small beside the
# ring's stiffness: contacts are solved with those of one row between, and the other rows are a step
# away by derivatives.

#: Values that differ are solved one by one up to this number, else on Chebyshev nodes between which
#: is interpolated: twice as many for loads, and as many for tensions, which differ by less. With
#: twice as many nodes it takes twice as long for errors far below the solution's own.
_FEW = 4


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
    losses: FloatArray
    stiffer: FloatArray

    def at(self, stiffer: float, pb_N_m: float) -> RingCarcass:
        """The carcass with stiffer sidewalls at another tension."""
        own = self.carcass
        return replace(own, k_w=own.k_w * stiffer, k_v=own.k_v * stiffer, pb=pb_N_m)


#: solved contacts: carcass, losses, loads
_Solved = tuple[RingCarcass, tuple[float, ...], tuple[float, ...]]


def pressure_modes(
    state: ContactState, near: ContactState | None = None, *, tilted: bool
) -> tuple[FloatArray, ComplexArray, ComplexArray | None]:
    """(L, modes of p, if asked for modes of p xi / L), between solved loads and tensions.

    Of a state a small step from another, `near`, the contacts are those of this one, moved on by
    their derivatives; unless a step of the radius parts them.
    """
    stepped = near is not None and near.carcass.R == state.carcass.R
    around = near if near is not None and stepped else state
    solved, share = _solved_at(around, state)
    found = share @ np.concatenate([_table(*one, tilted) for one in solved])
    moves = _moves(around, state, solved, share)
    lossy = any(bool(np.any(far)) for _, far in moves[BY:])
    for i, (unit, far) in enumerate(moves):
        if np.any(far) and (stepped or i >= BY):
            slope = np.concatenate([_slopes(*one, tilted, lossy)[i] for one in solved])
            found = found + far * (share @ (unit * slope))
    tilt = found[:, MODES + 1 :]
    return found[:, :1].real, found[:, 1 : MODES + 1], tilt if tilt.size else None


def _moves(
    near: ContactState, state: ContactState, solved: list[_Solved], share: FloatArray
) -> list[tuple[FloatArray | float, FloatArray | float]]:
    """How far each of STIFFNESSES, p0 b, the load and the losses moves from the solved contacts.

    As (its unit, steps of each row in that unit (n, 1)); a stiffness moves in units of itself, so
    that a row between contacts of stiffer and softer sidewalls moves along with its share of them.
    """
    own = [carcass for carcass, _, loads_N in solved for _ in loads_N]
    before, after = near.carcass, state.carcass
    stiffer = np.array([[carcass.k_w / before.k_w] for carcass in own])
    sidewalls = state.stiffer / (1.0 + share @ (stiffer - 1.0))
    moves: list[tuple[FloatArray | float, FloatArray | float]] = []
    for name in STIFFNESSES:
        ratio = getattr(after, name) / getattr(before, name)
        unit = np.array([[getattr(carcass, name)] for carcass in own])
        moves.append((unit, ratio * (sidewalls if name in SIDEWALLS else 1.0) - 1.0))
    loads = [[load_N] for _, _, loads_N in solved for load_N in loads_N]
    moves.append((1.0, state.pb_N_m - share @ np.array([[carcass.pb] for carcass in own])))
    moves.append((1.0, state.load_N - share @ np.array(loads)))
    return moves + [(1.0, step) for step in (state.losses - np.array(solved[0][1])).T[..., None]]


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
            nodes, weights = _nodes(load[rows], load_there[rows], 2 * _FEW)
            solved.append((state.at(stiffer, tension), losses, tuple(nodes.tolist())))
            column = np.zeros((load.size, nodes.size))
            column[rows] = weights * (share * of_stiff[rows])[:, None]
            columns.append(column)
    return solved, np.hstack(columns)


def _shared(values: FloatArray, there: FloatArray) -> Iterator[tuple[float, FloatArray]]:
    """`_nodes` of tensions or stiffnesses, one by one: a value to solve at, its weights (n,)."""
    nodes, weights = _nodes(values, there, _FEW)
    yield from zip(nodes.tolist(), weights.T)


def _between(losses: FloatArray) -> tuple[float, ...]:
    """Losses between those of the rows (n, 4), four values an octave unless all have the same."""
    if not np.any(losses):
        return (0.0,) * len(LOSSES)
    mean, differ = losses.mean(axis=0), np.ptp(losses, axis=0) > 0.0
    size = np.maximum(np.abs(mean), 1e-300)
    rounded = np.sign(mean) * 2.0 ** (np.round(4.0 * np.log2(size)) / 4.0)
    return tuple(np.where(differ, rounded, mean).tolist())


@lru_cache(maxsize=128)
def _table(
    carcass: RingCarcass, losses: tuple[float, ...], loads_N: tuple[float, ...], tilted: bool
) -> ComplexArray:
    """Results of `pressure_modes` at k loads, side by side (k, 1 + ...)."""
    half = np.empty((len(loads_N), 1))
    grid = np.zeros((len(loads_N), 2 if tilted else 1, GRID))
    for row, load_N in enumerate(loads_N):
        found = solve_contact(carcass, load_N, losses if any(losses) else ())
        on, p, half[row] = found.on, found.pressure_N_m, found.half_length_m
        grid[row, 0, on] = p
        if tilted:
            grid[row, 1, on] = p * (on * STEP) * (carcass.R / half[row])
    return np.hstack([half, to_modes(grid).reshape(len(loads_N), -1)])


@lru_cache(maxsize=16)
def _slopes(
    carcass: RingCarcass,
    losses: tuple[float, ...],
    loads_N: tuple[float, ...],
    tilted: bool,
    lossy: bool,
) -> ComplexArray:
    """Derivatives of `_table` by each of STIFFNESSES, by p0 b, by the load, (6, k, 1 + ...).

    (10, k, 1 + ...) with those by each of the losses.
    """
    own = losses if lossy or any(losses) else ()
    size = (BY + len(own), len(loads_N))
    half, grid = np.empty((*size, 1)), np.zeros((*size, 2 if tilted else 1, GRID))
    for row, load_N in enumerate(loads_N):
        found = solve_contact(carcass, load_N, own)
        on, p, length = found.on, found.pressure_N_m, found.half_length_m
        change, half[:, row, 0] = found.slopes
        grid[:, row, 0, on] = change
        if tilted:
            along = (on * STEP) * (carcass.R / length)
            grid[:, row, 1, on] = (change - half[:, row] / length * p) * along
    return np.concatenate([half, to_modes(grid).reshape(*size, -1)], axis=-1)


def _nodes(values: FloatArray, there: FloatArray, table: int) -> tuple[FloatArray, FloatArray]:
    """Values to solve at, (k,), and weights (n, k) that interpolate from them to others `there`.

    Few values are solved at themselves; those that are near to one have the weights of it alone.
    """
    distinct, inverse = np.unique(values, return_inverse=True)
    if distinct.size <= _FEW:
        return distinct, np.eye(distinct.size)[inverse]
    # over a range of whole steps, a sixteenth of it at most: sensors that passed the patch at about
    # the same speeds ask for the same contacts
    step = 2.0 ** np.floor(np.log2(distinct[-1] - distinct[0])) / 16.0
    low, high = step * np.floor(distinct[0] / step), step * np.ceil(distinct[-1] / step)
    angle = (np.arange(table) + 0.5) * np.pi / table
    nodes = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(angle)
    weights = np.where(np.arange(table) % 2 == 0, 1.0, -1.0) * np.sin(angle)
    return nodes, interpolation_shares(nodes, weights, there)
