"""One-sided contact with a flat road of a ring that takes power in rolling.

What damps a ring makes its answer to a load lag behind it: the yield under pressure is no longer
alike to both sides, so the pressure leans towards the entry edge, and more than what the same loss
does to the ring under a given pressure.

    carcass, losses, F --solve_lossy--> pressure at the angles that touch --.slopes--> derivatives

The law of contact is that of `contact`; the angles of both halves are unknown here, and active sets
begin with those of the ring without losses.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.fft import irfft, rfft
from scipy.linalg import lu_factor, lu_solve

from tirelog.errors import ModelError
from tirelog.physics.carcass.contact import NODES, REACH, by_stiffness, solve_contact
from tirelog.physics.carcass.ring import RingCarcass, modal_impedance
from tirelog.physics.spectral import GRID, STEP, ComplexArray
from tirelog.vocabulary.arrays import FloatArray

#: what losses are made of, each a strength at a speed: of the radial and the tangential foundation
#: in proportion to the wave's frequency [N/m^2], of the radial one the same at every frequency
#: [N/m^2], and of the belt in bending in proportion to it [N m^2]
LOSSES = ("radial_rate", "tangential_rate", "radial", "bending_rate")
NONE = (0.0,) * len(LOSSES)
#: angles beyond those that touch without losses, as a share of these and at least so many, among
#: which an edge is looked for; twice as many take twice as long, and it is asked beyond them too
_MARGIN, _LEAST_MARGIN = 0.25, 12
#: steps of the search for the angles that touch; it takes some three. Twice as many change nothing
#: that converges
_MOST_STEPS = 50
_WAVES = np.arange(GRID // 2 + 1, dtype=np.float64)


def loss_shapes(n: FloatArray, R: float) -> FloatArray:
    """Im Z_n (4, k) per strength of each of `LOSSES`, of Z_n of `ring.modal_impedance`."""
    return np.stack([n**3, n, n**2, n**3 * (1.0 - n**2) ** 2 / R**4])


@dataclass(frozen=True)
class LossyContact:
    """A solved contact: pressure [N/m] at the grid's angles `on` (k,) of -NODES ... NODES.

    Half length [m] of the patch; `factors` those of the equations for pressure and drop, `edges`
    what each edge is told by: depth [m] of the last angle that touches and of the next one, and how
    the next one yields under pressure (k,).
    """

    carcass: RingCarcass
    losses: tuple[float, ...]
    on: NDArray[np.int64]
    pressure_N_m: FloatArray
    half_length_m: float
    factors: tuple[FloatArray, NDArray[np.int32]]
    edges: tuple[tuple[float, float, FloatArray], ...]

    @property
    def slopes(self) -> tuple[FloatArray, FloatArray]:
        """Derivatives of pressure (10, k) and half length (10,), while the same angles touch.

        By EI, k_w, k_v, k_t, p0 b and the load, as of `contact`, and by each of the losses.
        """
        carcass, p, on = self.carcass, self.pressure_N_m, self.on
        changes = np.concatenate([by_stiffness(_WAVES, carcass.R) + 0j, _imaginary(carcass.R)])
        inverse = -changes / _impedance(carcass, self.losses) ** 2
        outer = np.array([on[0] - 1, on[-1] + 1])
        yields = _under(_spectra(inverse), on, p, np.append(on, outer))
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


def _imaginary(R: float) -> ComplexArray:
    return np.asarray(1j * loss_shapes(_WAVES, R), dtype=np.complex128)


def _spectra(inverse: ComplexArray) -> ComplexArray:
    """1 / Z_n, i n / Z_n and n^2 / Z_n (3, ..., K), by which the ring yields."""
    return np.stack([inverse, 1j * _WAVES * inverse, _WAVES**2 * inverse])


def _under(
    spectra: ComplexArray, on: NDArray[np.int64], p: FloatArray, at: NDArray[np.int64]
) -> FloatArray:
    """How far the angles `at` yield upwards [m] under p (k,) at the angles `on`, (..., j)."""
    loads = np.zeros((2, GRID))
    loads[0, on], loads[1, on] = np.cos(on * STEP) * p, np.sin(on * STEP) * p
    a, b, d = spectra
    cp, sp = rfft(loads, axis=-1)
    along_cos, along_sin = irfft(np.stack([d * cp + b * sp, a * sp - b * cp]), GRID, axis=-1)
    yielded: FloatArray = (
        np.cos(at * STEP) * along_cos[..., at] + np.sin(at * STEP) * along_sin[..., at]
    )
    return yielded


@lru_cache(maxsize=256)
def solve_lossy(carcass: RingCarcass, losses: tuple[float, ...], load_N: float) -> LossyContact:
    """The contact of a ring with these losses at the load F [N].

    ModelError if the load is not above zero or the patch grows beyond REACH.
    """
    plain = solve_contact(carcass, load_N)
    last = round(float(plain.phi_rad[-1]) / STEP)
    spectra = _spectra(1.0 / _impedance(carcass, losses))
    kernels = irfft(spectra, GRID, axis=-1)
    farthest = last + max(_LEAST_MARGIN, int(_MARGIN * last))
    while True:
        farthest = min(farthest, NODES)
        found = _balance(carcass, losses, load_N, spectra, kernels, last, farthest)
        if found is not None:
            return found
        if farthest == NODES:
            raise ModelError(
                f"at {load_N:g} N the contact with the flat road found no balance within "
                f"{REACH:g} rad to either side",
                allowed="a shorter patch is allowed",
                do="give less damping, a stiffer foundation or a lower load",
            )
        farthest *= 2


def _balance(
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
    for _ in range(_MOST_STEPS):
        on = np.flatnonzero(active)
        system = np.zeros((on.size + 1, on.size + 1))
        system[:-1, :-1] = yields[np.ix_(on, on)]
        system[np.arange(on.size), np.arange(on.size)] += 1.0 / carcass.k_t
        system[:-1, -1], system[-1, :-1] = -1.0, h
        factors = lu_factor(system, overwrite_a=True, check_finite=False)
        solution = lu_solve(factors, np.append(-shape[on], load_N), check_finite=False)
        p, drop = solution[:-1], float(solution[-1])
        depth = drop - shape - yields[:, on] @ p
        pressing = depth > 0.0
        if pressing[0] or pressing[-1] or not pressing.any():
            return None
        if np.array_equal(pressing, active):
            break
        active = pressing
    else:
        return None
    if on[-1] - on[0] + 1 != on.size or _touches_beyond(carcass, spectra, nodes[on], p, drop):
        return None
    edges = tuple(
        (float(depth[inner]), float(depth[outer]), yields[outer, on])
        for inner, outer in ((on[0], on[0] - 1), (on[-1], on[-1] + 1))
    )
    beyond = sum(inner / (inner - outer) for inner, outer, _ in edges)
    half = 0.5 * h * (on.size - 1 + beyond)
    return LossyContact(carcass, losses, nodes[on], p, half, factors, edges)


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
    depth = depth - _under(spectra, on, p, everywhere)
    depth[on + NODES] = 0.0
    return bool(depth.max() > 1e-12)
