"""One-sided contact of the ring's tread with a flat road at a given load.

The contact algorithm that P3 describes.

The tread is a layer of springs k_t [N/m^2]; it presses where the deformed ring would go below the
road and never pulls:

    p = k_t max(0, delta - R (1 - cos phi) - u(phi)),   u = A p,   sum p h = F

with u the ring's vertical yield. Solved by active sets (Newton's method on the max), on the
waveform's grid; the load is a row of the linear system, so it is carried to rounding. The solution
is the one of the undamped ring with its own tension: what damping and effects on the structure
change in the pressure is of second order and left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.linalg import solve

from tirelog.errors import ModelError
from tirelog.physics.carcass.ring import RingCarcass, modal_impedance
from tirelog.physics.spectral import GRID, MODES, STEP, ComplexArray, to_modes
from tirelog.vocabulary.arrays import FloatArray

#: Farthest angle from the patch centre [rad] that may touch the road.
REACH = 0.8
_NODES = int(REACH / STEP)
_PHI = np.arange(-_NODES, _NODES + 1) * STEP
#: Loads that differ are solved one by one up to this number, else on as many Chebyshev nodes as
#: _TABLE and interpolated.
_FEW, _TABLE = 4, 12


@dataclass(frozen=True)
class Contact:
    """A solved contact: pressure [N/m] at angles, patch and hub drop.

    Pressure [N/m] at `phi_rad` (both (j,)), half length [m] and centre [m] of the patch, and the
    hub's drop delta [m].
    """

    phi_rad: FloatArray
    pressure_N_m: FloatArray
    half_length_m: float
    centre_m: float
    drop_m: float


@lru_cache(maxsize=8)
def _yield_matrix(carcass: RingCarcass) -> FloatArray:
    """A h: vertical yield [m] at phi_i per pressure [N/m] at phi_j, (j, j)."""
    n = np.arange(GRID // 2 + 1, dtype=np.float64)
    inverse = 1.0 / modal_impedance(n, carcass).real
    a, b, d = (
        np.fft.irfft(x, GRID) * (GRID / (2.0 * np.pi * carcass.R))
        for x in (inverse, 1j * n * inverse, n**2 * inverse)
    )
    gap = np.arange(_PHI.size)
    difference = (gap[:, None] - gap[None, :]) % GRID
    c, s = np.cos(_PHI), np.sin(_PHI)
    yielding = np.outer(c, c) * d[difference] + np.outer(s, s) * a[difference]
    yielding += (np.outer(c, s) - np.outer(s, c)) * b[difference]
    matrix: FloatArray = yielding * (carcass.R * STEP)
    return matrix


@lru_cache(maxsize=512)
def solve_contact(carcass: RingCarcass, load_N: float) -> Contact:
    """The contact at the load F [N].

    ModelError if the load is not above zero or the patch grows beyond REACH.
    """
    if not load_N > 0.0:
        raise ModelError(
            f"load {load_N:g} N does not press the tire on the road",
            allowed="a load above zero is allowed",
            do="correct load_N",
        )
    A, h = _yield_matrix(carcass), carcass.R * STEP
    shape = carcass.R * (1.0 - np.cos(_PHI))
    active = np.abs(_PHI) <= 0.15
    for _ in range(100):
        on = np.flatnonzero(active)
        system = np.zeros((on.size + 1, on.size + 1))
        system[:-1, :-1] = A[np.ix_(on, on)]
        system[np.arange(on.size), np.arange(on.size)] += 1.0 / carcass.k_t
        system[:-1, -1], system[-1, :-1] = -1.0, h
        solution = solve(system, np.append(-shape[on], load_N))
        p, drop = solution[:-1], float(solution[-1])
        depth = drop - shape - A[:, on] @ p
        pressing = depth > 0.0
        if not pressing.any():
            pressing[np.argmax(depth)] = True
        if pressing[0] or pressing[-1]:
            raise ModelError(
                f"at {load_N:g} N the patch grows beyond {REACH:g} rad to either side",
                allowed="a shorter one is allowed",
                do="give a stiffer foundation or a lower load",
            )
        if np.array_equal(pressing, active):
            return _contact(on, p, depth, drop, carcass.R)
        active = pressing
    raise ModelError(
        "the contact with the flat road found no balance",
        do="give a smaller stiffness contrast or patch_half_length_m",
    )


def _contact(on: np.ndarray, p: FloatArray, depth: FloatArray, drop: float, R: float) -> Contact:
    """Edges where the depth crosses zero, between the last node that presses and the next one."""
    first, last = on[0], on[-1]
    entry = _PHI[first] - STEP * depth[first] / (depth[first] - depth[first - 1])
    leave = _PHI[last] + STEP * depth[last] / (depth[last] - depth[last + 1])
    return Contact(
        _PHI[on], p, 0.5 * R * float(leave - entry), 0.5 * R * float(leave + entry), drop
    )


def pressure_modes(
    carcass: RingCarcass, load_N: FloatArray, pb_N_m: FloatArray
) -> tuple[FloatArray, ComplexArray, ComplexArray]:
    """(L, modes of p, modes of p xi / L), interpolated between solved loads.

    For columns of load and inflation p0 b, (n or 1, 1) each.
    """
    load, pb = np.broadcast_arrays(load_N, pb_N_m)
    half, modes, tilted = (
        np.empty((load.shape[0], size), dtype)
        for size, dtype in ((1, float), (MODES, complex), (MODES, complex))
    )
    for value in np.unique(pb):
        rows = np.flatnonzero(pb[:, 0] == value)
        solved = replace(carcass, pb=float(value))
        nodes, weights = _nodes(load[rows, 0])
        table = [_laid_out(solve_contact(solved, float(node)), solved.R) for node in nodes]
        for target, column in zip((half, modes, tilted), zip(*table)):
            target[rows] = weights @ np.stack(column)
    return half, modes, tilted


def _laid_out(contact: Contact, R: float) -> tuple[FloatArray, ComplexArray, ComplexArray]:
    grid = np.zeros((2, GRID))
    index = np.round(contact.phi_rad / STEP).astype(int) % GRID
    grid[0, index] = contact.pressure_N_m
    grid[1, index] = contact.pressure_N_m * contact.phi_rad * (R / contact.half_length_m)
    modes = to_modes(grid)
    return np.array([contact.half_length_m]), modes[0], modes[1]


def _nodes(load: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Loads to solve, (k,), and the weights (n, k) that interpolate from them."""
    distinct, inverse = np.unique(load, return_inverse=True)
    if distinct.size <= _FEW:
        return distinct, np.eye(distinct.size)[inverse]
    low, high = distinct[0], distinct[-1]
    angle = (np.arange(_TABLE) + 0.5) * np.pi / _TABLE
    nodes = 0.5 * (low + high) + 0.5 * (high - low) * np.cos(angle)
    barycentric = (-1.0) ** np.arange(_TABLE) * np.sin(angle)
    distance = load[:, None] - nodes
    exact = distance == 0.0
    ratio = barycentric / np.where(exact, 1.0, distance)
    weights = np.where(
        exact.any(axis=1, keepdims=True),
        exact.astype(float),
        ratio / ratio.sum(axis=1, keepdims=True),
    )
    return nodes, weights
