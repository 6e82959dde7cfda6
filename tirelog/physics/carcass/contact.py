"""One-sided contact of the ring's tread with a flat road at a given load.

The contact algorithm that P3 describes.

The tread is a layer of springs k_t [N/m^2]; it presses where the deformed ring would go below the
road and never pulls:

    p = k_t max(0, delta - R (1 - cos phi) - u(phi)),   u = A p,   sum p h = F

with u the ring's vertical yield. Solved by active sets (Newton's method on the max), on the
waveform's grid; the load is a row of the linear system, so it is carried to rounding. The solution
is the one of the undamped ring with all its tension, that of effects too, and even about the patch
centre; `LossyContact` is the one of a ring that takes power, `pressure_modes` the modes of both.
What a user's own effects on the foundation change in the pressure is left out.

    carcass, F --solve_contact--> pressure at the angles that touch --moved--> its derivatives

This file is longer than others: contacts without losses and with them, and the modes between them,
share grid, yields and derivatives.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.fft import irfft, rfft
from scipy.linalg import lu_factor, lu_solve
from scipy.linalg.lapack import dpotrf, dpotrs, dtrtrs

from tirelog.errors import ModelError
from tirelog.physics.carcass.structures import RingCarcass, modal_impedance
from tirelog.physics.spectral import GRID, MODES, STEP, ComplexArray, to_modes
from tirelog.vocabulary.arrays import FloatArray

#: Farthest angle from the patch centre [rad] that may touch the road. Half of it, 0.4, is a patch
#: of 12 cm to either side at 0.3 m; twice as much doubles the nodes.
REACH = 0.8
NODES = int(REACH / STEP)
#: The angles of one half of the patch: the undamped ring's contact is even about its centre.
_PHI = np.arange(NODES + 1) * STEP
_COS, _SIN = np.cos(_PHI), np.sin(_PHI)
#: Their sums.
_LAG = np.arange(2 * _PHI.size - 1) * STEP
#: How often each of them stands in the whole patch.
_TWICE = np.where(_PHI > 0.0, 2.0, 1.0)
#: Steps of the search for the angles that touch; from anywhere it takes some six. Twice as many
#: change nothing that converges. It begins with those up to so many [rad], which changes no digit.
_MOST_STEPS = 100
_BEGIN = 0.15
#: the waves of the grid
_WAVES = np.arange(GRID // 2 + 1, dtype=np.float64)
#: What a contact moves with: these constants of the carcass, p0 b and the load.
STIFFNESSES = ("EI", "k_w", "k_v", "k_t")
BY = len(STIFFNESSES) + 2
#: Those of them that are the sidewalls'.
SIDEWALLS = ("k_w", "k_v")
#: Angles of a half among which a contact is looked for first; a usual one, of 5 cm at 0.3 m, has
#: 80. Twice as many take four times as long.
_SIZES = (128, 256, _PHI.size)
#: Beyond these, where a usual tire is far above the road, every so manieth angle is asked whether
#: it touches too: 2.5 mm apart at 0.3 m. Twice as many take a third longer.
_SPARSE = 4


@dataclass(frozen=True)
class Contact:
    """A solved contact: pressure [N/m] at angles, patch and hub drop.

    Pressure [N/m] at `phi_rad` (both (j,)), half length [m] of the patch, and the hub's drop delta
    [m].
    """

    phi_rad: FloatArray
    pressure_N_m: FloatArray
    half_length_m: float
    drop_m: float


@dataclass(frozen=True)
class _Yield:
    """A of one carcass: how far the ring yields upwards [m] under vertical pressure [N/m].

    With the lag k = i - j of two angles and c = cos phi, s = sin phi

        A_ij h = c_i c_j d_k + s_i s_j a_k + (c_i s_j - s_i c_j) b_k

    where a, b, d have the modes 1 / Z_n, i n / Z_n, n^2 / Z_n: `spectra` (3, GRID / 2 + 1) of them.
    By sums of angles it is f_k + g_k cos(phi_i + phi_j), with

        f_k = (d_k + a_k) cos(phi_k) / 2 - b_k sin(phi_k),    g_k = (d_k - a_k) / 2

    both even: `by_difference` are f, g and cos (3, j, j) at i - j, `by_sum` at i + j (views).
    """

    spectra: ComplexArray
    by_difference: FloatArray
    by_sum: FloatArray

    def of_first(self, at: slice, size: int) -> FloatArray:
        """A h at some angles of the half patch from its first ones, (k, size)."""
        f, g, cos = self.by_difference[:, at, :size]
        f_far, g_far, cos_far = self.by_sum[:, at, :size]
        matrix: FloatArray = g * cos_far
        mirrored = g_far * cos
        matrix += f
        mirrored += f_far
        matrix[:, 1:] += mirrored[:, 1:]  # the angle zero has no other half
        return matrix


def _under(spectra: ComplexArray, on: NDArray[np.int64], p: FloatArray) -> FloatArray:
    """u [m] at all angles of the half patch under p (k,) at some and the same beyond, (..., j).

    By `spectra` (3, ..., GRID / 2 + 1) as of `_Yield`.
    """
    whole = np.concatenate([-on, on])  # an angle zero stands twice, and is set twice
    return _yields_at(spectra, whole, np.concatenate([p, p]), np.arange(_PHI.size))


@lru_cache(maxsize=8)
def _yield(carcass: RingCarcass) -> _Yield:
    inverse = 1.0 / modal_impedance(_WAVES, carcass).real
    spectra = _spectra(inverse)
    a, b, d = irfft(spectra, GRID, axis=-1)[:, : _LAG.size]
    cos, sin = np.cos(_LAG), np.sin(_LAG)
    by_lag = np.stack([0.5 * (d + a) * cos - b * sin, 0.5 * (d - a), cos])
    size = _PHI.size
    there_and_back = np.concatenate([by_lag[:, size - 1 : 0 : -1], by_lag[:, :size]], axis=1)
    by_difference = sliding_window_view(there_and_back, size, axis=1)[:, ::-1]
    return _Yield(spectra, by_difference, sliding_window_view(by_lag, size, axis=1))


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
    for size in _SIZES:
        nested = _nested(carcass, size)
        found = None if nested is None else _widened(nested, carcass.R, load_N)
        if found is not None:
            return found
    wide = _searched(carcass, NONE, load_N, int(_BEGIN / STEP))
    phi = np.asarray(wide.on * STEP, dtype=np.float64)
    return Contact(phi, wide.pressure_N_m, wide.half_length_m, wide.drop_m)


@dataclass(frozen=True)
class _Nested:
    """The contacts of one carcass at all loads, if each is one stretch about the middle.

    With the matrix of the first angles Cholesky's factor C of any fewer of them is known too: its
    first rows and columns; and so are C^-1 of a unit drop and of the road's shape, `drop` and
    `shape` (k,), with the sums of their products over the first angles. `yields` (k, k): how far
    these angles yield under pressure at them, and `beyond` (j, k) some of those beyond.
    """

    factor: FloatArray
    drop: FloatArray
    shape: FloatArray
    drop_drop: FloatArray
    drop_shape: FloatArray
    yields: FloatArray
    beyond: FloatArray


@lru_cache(maxsize=16)
def _nested(carcass: RingCarcass, size: int) -> _Nested | None:
    """The contacts that touch fewer than `size` angles of a half; None if no spring has hold."""
    yields, twice = _yield(carcass).of_first(slice(size), size), _TWICE[:size]
    beyond = _yield(carcass).of_first(slice(size, None, _SPARSE), size)
    matrix = yields * twice[:, None]
    matrix[np.diag_indices(size)] += twice / carcass.k_t
    factor, failed = dpotrf(matrix, lower=1, clean=1)
    if failed:
        return None
    right = np.stack([twice, twice * (carcass.R * (1.0 - _COS[:size]))], axis=1)
    drop, shape = dtrtrs(factor, right, lower=1)[0].T
    return _Nested(factor, drop, shape, np.cumsum(drop**2), np.cumsum(drop * shape), yields, beyond)


def _widened(nested: _Nested, R: float, load_N: float) -> Contact | None:
    """The contact widened angle by angle until it carries the load.

    None if it is wider than these angles, or another angle would touch too.
    """
    drops = (load_N / (R * STEP) + nested.drop_shape) / nested.drop_drop
    presses = drops * nested.drop > nested.shape  # the last of so many angles
    # the first of these contacts beside which the next angle does not press
    closed = presses[:-1] & (drops[:-1] * nested.drop[1:] <= nested.shape[1:])
    if not closed.any():
        return None
    count = int(np.argmax(closed)) + 1
    drop = float(drops[count - 1])
    right = np.zeros(nested.drop.size)
    right[:count] = drop * nested.drop[:count] - nested.shape[:count]
    p = dtrtrs(nested.factor, right, lower=1, trans=1)[0][:count]
    above = R * (1.0 - _COS)
    depth = drop - above[: right.size] - nested.yields[:, :count] @ p
    beyond = drop - above[right.size :: _SPARSE] - nested.beyond[:, :count] @ p
    if p.min() <= 0.0 or max(depth[count:].max(), beyond.max(initial=-1.0)) > 0.0:
        return None
    # the edge lies where the depth crosses zero beyond the last node that presses
    edge = float(_PHI[count - 1] + STEP * depth[count - 1] / (depth[count - 1] - depth[count]))
    phi = np.concatenate([-_PHI[1:count][::-1], _PHI[:count]])
    return Contact(phi, np.concatenate([p[1:][::-1], p]), R * edge, drop)


def by_stiffness(n: FloatArray, R: float) -> FloatArray:
    """Derivatives of Z_n by EI, k_w, k_v and p0 b, (4, k)."""
    return np.stack(
        [n**2 * (1.0 - n**2) ** 2 / R**4, n**2, np.ones_like(n), n**2 * (n**2 - 1.0) / R]
    )


def moved(
    carcass: RingCarcass, load_N: float
) -> tuple[NDArray[np.int64], FloatArray, float, FloatArray, FloatArray] | None:
    """A contact and its derivatives by STIFFNESSES, p0 b and the load.

    The grid's angles that touch (k,), pressure there (k,), half length; derivatives (6, k) of the
    pressure, (6,) of the half length. None if the contact is not one stretch about the middle.
    """
    contact = solve_contact(carcass, load_N)
    count = (contact.phi_rad.size + 1) // 2
    nested = _nested(carcass, next(size for size in _SIZES if size > count))
    if nested is None or contact.phi_rad[-1] != _PHI[count - 1]:
        return None
    change, half = _moved(nested, carcass, contact.pressure_N_m[count - 1 :])
    both = np.concatenate([change[:, :0:-1], change], axis=1)
    return np.arange(1 - count, count), contact.pressure_N_m, contact.half_length_m, both, half


def _moved(nested: _Nested, carcass: RingCarcass, p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Derivatives (6, k) of the pressure at the angles of one half, (6,) of the half length.

    From (A + 1 / k_t) p = delta - shape and sum p h = F at the angles that touch.
    """
    R, k_t, count = carcass.R, carcass.k_t, p.size
    on, twice = np.arange(count), _TWICE[:count]
    inverse = -by_stiffness(_WAVES, R) / modal_impedance(_WAVES, carcass).real ** 2
    spectra = _spectra(inverse)
    yields = np.zeros((BY, count + 1))
    EI, k_w, k_v, pb = _under(spectra, on, p)[:, : count + 1]
    yields[:3], yields[3, :count], yields[4] = (EI, k_w, k_v), -p / k_t**2, pb
    right = np.concatenate([-yields[:, :count], np.ones((1, count))]) * twice
    found, _ = dpotrs(nested.factor[:count, :count], right.T, lower=1)
    by_drop = found[:, -1]
    carried = np.zeros(BY)
    carried[5] = 1.0 / (R * STEP)
    drop = (carried - twice @ found[:, :-1]) / (twice @ by_drop)
    moved = (found[:, :-1] + by_drop[:, None] * drop).T
    # the edge lies where the depth crosses zero, between the last angle and the next
    last, after = p[-1] / k_t, -_beside(nested, carcass, p)
    of_last = moved[:, -1] / k_t
    of_last[3] -= p[-1] / k_t**2
    of_after = drop - yields[:, count] - moved @ nested.yields[count, :count]
    return moved, R * STEP * (last * of_after + after * of_last) / (last + after) ** 2


def _beside(nested: _Nested, carcass: RingCarcass, p: FloatArray) -> float:
    """Depth [m] of the first angle that does not touch, at or below zero."""
    count = p.size
    drop = p[0] / carcass.k_t + nested.yields[0, :count] @ p
    return float(drop - carcass.R * (1.0 - _COS[count]) - nested.yields[count, :count] @ p)


# ---- One-sided contact with a flat road of a ring that takes power in rolling.
#
# What damps a ring makes its answer to a load lag behind it: the yield under pressure is no longer
# alike to both sides, so the pressure leans towards the entry edge, and more than what the same
# loss
# does to the ring under a given pressure.
#
#     carcass, losses, F --solve_lossy--> pressure at the angles that touch --.slopes--> derivatives
#
# The law of contact is that of `contact`; the angles of both halves are unknown here, and active
# sets
# begin with those of the ring without losses.


#: what losses are made of, each a strength at a speed: of the radial and the tangential foundation
#: in proportion to the wave's frequency [N/m^2], of the radial one the same at every frequency
#: [N/m^2], and of the belt in bending in proportion to it [N m^2]
LOSSES = ("radial_rate", "tangential_rate", "radial", "bending_rate")
NONE = (0.0,) * len(LOSSES)
#: angles beyond those that touch without losses, as a share of these and at least so many, among
#: which an edge is looked for; twice as many take twice as long, and it is asked beyond them too
_MARGIN, _LEAST_MARGIN = 0.25, 12


def loss_shapes(n: FloatArray, R: float) -> FloatArray:
    """Im Z_n (4, k) per strength of each of `LOSSES`, of Z_n of `ring.modal_impedance`."""
    return np.stack([n**3, n, n**2, n**3 * (1.0 - n**2) ** 2 / R**4])


@dataclass(frozen=True)
class LossyContact:
    """A solved contact: pressure [N/m] at the grid's angles `on` (k,) of -NODES ... NODES.

    Half length [m] of the patch and the hub's drop [m]; `factors` of the equations for pressure and
    drop; `edges` what each edge is told by: depth [m] of the last angle that touches and of the
    next one, and how the next one yields under pressure (k,).
    """

    carcass: RingCarcass
    losses: tuple[float, ...]
    on: NDArray[np.int64]
    pressure_N_m: FloatArray
    half_length_m: float
    drop_m: float
    factors: tuple[FloatArray, NDArray[np.int32]]
    edges: tuple[tuple[float, float, FloatArray], ...]

    @property
    def slopes(self) -> tuple[FloatArray, FloatArray]:
        """Derivatives of pressure (10, k) and half length (10,), while the same angles touch.

        By EI, k_w, k_v, k_t, p0 b and the load, as of `contact`, and by each of the losses.
        """
        carcass, p, on = self.carcass, self.pressure_N_m, self.on
        lossy = 1j * loss_shapes(_WAVES, carcass.R)
        changes = np.concatenate([by_stiffness(_WAVES, carcass.R) + 0j, lossy])
        inverse = -changes / _impedance(carcass, self.losses) ** 2
        outer = np.array([on[0] - 1, on[-1] + 1])
        yields = _yields_at(_spectra(inverse), on, p, np.append(on, outer))
        EI, k_w, k_v, pb = yields[:4]
        none = np.zeros_like(EI)
        by_tread = none.copy()
        by_tread[: on.size] = -p / carcass.k_t**2
        right = -np.stack([EI, k_w, k_v, by_tread, pb, none, *yields[4:]])
        load = np.zeros(right.shape[0])
        load[5] = 1.0
        found = lu_solve(self.factors, np.column_stack([right[:, : on.size], load]).T).T
        moved, drop = found[:, :-1], found[:, -1]
        half = np.zeros(right.shape[0])
        for (last, after, under), at, beyond in zip(
            self.edges, (0, -1), right[:, on.size :].T, strict=True
        ):
            of_last = moved[:, at] / carcass.k_t
            of_last[3] -= p[at] / carcass.k_t**2
            of_after = drop + beyond - moved @ under
            half += (
                0.5 * carcass.R * STEP * (last * of_after - after * of_last) / (last - after) ** 2
            )
        return moved, half


def _impedance(carcass: RingCarcass, losses: tuple[float, ...]) -> ComplexArray:
    lost = np.array(losses) @ loss_shapes(_WAVES, carcass.R)
    return np.asarray(modal_impedance(_WAVES, carcass).real + 1j * lost, dtype=np.complex128)


def _spectra(inverse: ComplexArray | FloatArray) -> ComplexArray:
    """1 / Z_n, i n / Z_n and n^2 / Z_n (3, ..., K), by which the ring yields."""
    return np.stack([inverse + 0j, 1j * _WAVES * inverse, _WAVES**2 * inverse + 0j])


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


@lru_cache(maxsize=256)
def solve_lossy(carcass: RingCarcass, losses: tuple[float, ...], load_N: float) -> LossyContact:
    """The contact of a ring with these losses at the load F [N].

    ModelError if the load is not above zero or the patch grows beyond REACH.
    """
    plain = solve_contact(carcass, load_N)
    return _searched(carcass, losses, load_N, round(float(plain.phi_rad[-1]) / STEP))


def _searched(
    carcass: RingCarcass, losses: tuple[float, ...], load_N: float, last: int
) -> LossyContact:
    """The contact by any angles that touch, sought from those up to the number `last` on."""
    spectra = _spectra(1.0 / _impedance(carcass, losses))
    kernels = irfft(spectra, GRID, axis=-1)
    farthest = last + max(_LEAST_MARGIN, int(_MARGIN * last))
    while True:
        farthest = min(farthest, NODES)
        found = _lossy_balance(carcass, losses, load_N, spectra, kernels, last, farthest)
        if found is not None:
            return found
        if farthest == NODES:
            raise ModelError(
                f"at {load_N:g} N the patch grows beyond {REACH:g} rad to either side, or its "
                "contact with the flat road finds no balance",
                allowed="a shorter patch is allowed",
                do="give a stiffer foundation, less damping or a lower load",
            )
        farthest *= 2


def _lossy_balance(
    carcass: RingCarcass,
    losses: tuple[float, ...],
    load_N: float,
    spectra: ComplexArray,
    kernels: FloatArray,
    last: int,
    farthest: int,
) -> LossyContact | None:
    """The contact among the angles up to `farthest`; None if it reaches beyond them."""
    nodes = np.arange(-farthest, farthest + 1)
    yields, shape = _among(kernels, nodes), carcass.R * (1.0 - np.cos(nodes * STEP))
    h, active = carcass.R * STEP, np.abs(nodes) <= last
    found = balance(yields, shape, h, carcass.k_t, load_N, active)
    if found is None:
        return None
    on, p, drop, depth, factors = found
    if _touches_beyond(carcass, spectra, nodes[on], p, drop):
        return None
    edges = tuple(
        (float(depth[inner]), float(depth[outer]), yields[outer, on])
        for inner, outer in ((on[0], on[0] - 1), (on[-1], on[-1] + 1))
    )
    beyond = sum(inner / (inner - outer) for inner, outer, _ in edges)
    half = 0.5 * h * (on[-1] - on[0] + beyond)
    return LossyContact(carcass, losses, nodes[on], p, half, drop, factors, edges)


#: the factors of `lu_factor`
_Factors = tuple[FloatArray, NDArray[np.int32]]


def balance(
    yields: FloatArray,
    shape: FloatArray,
    pitch_m: float,
    k_t: float,
    load_N: float,
    active: NDArray[np.bool_],
) -> tuple[NDArray[np.int64], FloatArray, float, FloatArray, _Factors] | None:
    """(Angles that touch, pressure there, drop, depth of all angles, factors), or None.

    By active sets from those that are `active` (j,). `yields` (j, j) [m per N/m], `shape` (j,) how
    high the road's tangent is below each angle. None too if the first or last angle touches.
    """
    for _ in range(_MOST_STEPS):
        on = np.flatnonzero(active)
        system = np.zeros((on.size + 1, on.size + 1))
        system[:-1, :-1] = yields[np.ix_(on, on)]
        system[np.arange(on.size), np.arange(on.size)] += 1.0 / k_t
        system[:-1, -1], system[-1, :-1] = -1.0, pitch_m
        factors = lu_factor(system, overwrite_a=True, check_finite=False)
        solution = lu_solve(factors, np.append(-shape[on], load_N), check_finite=False)
        p, drop = solution[:-1], float(solution[-1])
        depth = drop - shape - yields[:, on] @ p
        pressing = depth > 0.0
        if np.array_equal(pressing, active):
            return on, p, drop, depth, factors
        if pressing[0] or pressing[-1] or not pressing.any():
            return None
        active = pressing
    return None


def _among(kernels: FloatArray, nodes: NDArray[np.int64]) -> FloatArray:
    """How far each of the angles yields under pressure at each of them, (k, k)."""
    size = nodes.size
    lags = np.arange(1 - size, size) % GRID
    a, b, d = (sliding_window_view(kernel[lags], size)[:, ::-1] for kernel in kernels)
    cos, sin = np.cos(nodes * STEP), np.sin(nodes * STEP)
    matrix: FloatArray = cos[:, None] * (d * cos + b * sin)
    matrix += sin[:, None] * (a * sin - b * cos)
    return matrix


def _touches_beyond(
    carcass: RingCarcass,
    spectra: ComplexArray,
    on: NDArray[np.int64],
    p: FloatArray,
    drop: float,
) -> bool:
    """Would an angle within reach that does not press lie below the road?"""
    everywhere = np.arange(-NODES, NODES + 1)
    depth = drop - carcass.R * (1.0 - np.cos(everywhere * STEP))
    depth = depth - _yields_at(spectra, on, p, everywhere)
    depth[on + NODES] = 0.0
    return bool(depth.max() > 1e-12)


# ---- Modes of the contact pressure for the rows of a prediction, between solved contacts.
#
#     ContactState --pressure_modes--> L, modes of p
#                  --pressure_modes_near--> the same a small step away, by derivatives: the angles
#                                           that touch stay, and of them all is linear
#
# Loads and tensions are few or nodes of a table. Losses follow the speed and are small beside the
# ring's stiffness: contacts are solved with those of one row between, and the other rows are a step
# away by derivatives.

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
