"""The foundation that hardens: the extra load k k3 w^3, by Newton's method with few slopes.

    w <- w + (1 + 3 s H [w0^2 .])^-1 (H (p - s w^3) - w)

Rows (conditions) differ little, so the slope is that of one of them, w0, for all or for a group of
neighbours: a step leaves a tenth of the error or less. It couples the longest waves of w alone; the
shorter ones, which H makes small, have its diagonal. w falls off as n^-6: an eighth of the modes
carries it to 1e-7.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, rfft

from tirelog.errors import ModelError
from tirelog.physics.spectral import ComplexArray
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: modes of w, and points of the grid on which w^3 is taken: four for a mode, so that what the cube
#: adds beyond the grid's last mode does not fold back onto these
_MODES = 128
_GRID = 512
#: modes that a slope couples; with twice as many a step takes longer and hardly one is saved
_COUPLED = 32
#: steps at most (then ModelError), and steps with the same slopes; twice as many steps only take
#: longer to fail, twice as many with the same slopes take longer if rows lie far apart
_STEPS = 80
_SAME_SLOPES = 8
#: rows share a slope if theirs are within this ratio, and within its root each time that slopes
#: are made anew: with 2 rows are off by 1.4 at most, and a step leaves at most 0.4 of the error;
#: doubling it takes half as many slopes and more steps
_ALIKE = 2.0
#: a change above so many of the soft foundation's largest mode leads nowhere; twice as many only
#: take longer to fail
_FARTHEST = 1e3
#: a change below this share of the largest mode is the last; twice as much is as far below what a
#: log tells
_TOLERANCE = 1e-11
#: Newton's steps for the size of the first w; it need not be exact, twice as many change nothing
_SIZINGS = 8


@dataclass(frozen=True)
class Slope:
    """What a group of `rows` takes for the inverse of its slope.

    `coupled` (2 K, 2 K) acts on real beside imaginary parts of the K longest waves, `short` on
    the others.
    """

    rows: IntArray | slice
    coupled: FloatArray
    short: ComplexArray

    def __call__(self, modes: ComplexArray) -> ComplexArray:
        """The inverse times modes (n, all)."""
        parts = np.hstack([modes[:, :_COUPLED].real, modes[:, :_COUPLED].imag]) @ self.coupled.T
        long = parts[:, :_COUPLED] + 1j * parts[:, _COUPLED:]
        solved: ComplexArray = np.hstack([long, modes[:, _COUPLED:] * self.short])
        return solved


@dataclass(frozen=True)
class Balance:
    """A deflection that was found, modes (n, all) [m], and the slopes that led to it."""

    modes: ComplexArray
    slopes: tuple[Slope, ...]


def hardened_load(
    load: ComplexArray,
    compliance: ComplexArray | FloatArray,
    stiffness: FloatArray | float,
    start: Balance | None = None,
) -> tuple[ComplexArray, Balance]:
    """(The load less the hardened foundation's extra reaction (n, K), the deflection).

    `stiffness` is k k3 [N/m^4], column or number. `start`: a deflection to start from, as one that
    was found with nearly the same numbers; else that of the soft foundation, in its size.
    ModelError: the foundation gives way, or there is no balance.
    """
    rows = np.broadcast_shapes(load.shape, compliance.shape)[0]
    p = np.broadcast_to(load, (rows, load.shape[1]))
    P = p[:, :_MODES]
    H = np.broadcast_to(np.asarray(compliance, np.complex128), p.shape)[:, :_MODES]
    s = np.broadcast_to(np.asarray(stiffness, dtype=np.float64), (rows, 1))
    slopes: tuple[Slope, ...] = ()
    if start is not None and start.modes.shape == P.shape:
        modes, slopes = start.modes, start.slopes
    else:
        modes = _soft(P * H, H, s)
    ratio = _ALIKE
    for step in range(_STEPS):
        w = irfft(modes, _GRID, axis=1, norm="forward")
        if not slopes or (step and step % _SAME_SLOPES == 0):
            _refuse_giving_way(w, H, s)
            slopes, ratio = _slopes(w, H, s, ratio), np.sqrt(ratio)
        reaction = s * rfft(w * w * w, axis=1, norm="forward")[:, :_MODES]
        missed = H * (P - reaction) - modes
        change = np.empty_like(missed)
        for slope in slopes:
            change[slope.rows] = slope(missed[slope.rows])
        modes, farthest = modes + change, np.max(np.abs(change))
        if farthest < _TOLERANCE * np.max(np.abs(modes)):
            _refuse_giving_way(w, H, s)
            hardened = np.array(p, dtype=np.complex128)
            hardened[:, :_MODES] -= reaction
            return hardened, Balance(modes, slopes)
        if not farthest < _FARTHEST * np.max(np.abs(P * H)):
            break
    raise ModelError(
        "the hardened foundation found no balance",
        allowed="k3 w^2 up to about 10 is allowed",
        do="lower stiffening.cubic_1_m2",
    )


def _soft(modes: ComplexArray, H: ComplexArray, s: FloatArray) -> ComplexArray:
    """The soft foundation's deflection (n, all), made as small as balances it in its own shape.

    g w, with g + b g^3 = 1: b is what H s w^3 has of w.
    """
    w = irfft(modes, _GRID, axis=1, norm="forward")
    cubed = H * rfft(w * w * w, axis=1, norm="forward")[:, :_MODES]
    size = np.maximum(np.sum(np.abs(modes) ** 2, axis=1, keepdims=True), 1e-300)
    b = s * np.sum((np.conj(modes) * cubed).real, axis=1, keepdims=True) / size
    b = np.maximum(b, 0.0)
    g = np.ones_like(b)
    for _ in range(_SIZINGS):
        g = g - (g + b * g**3 - 1.0) / (1.0 + 3.0 * b * g**2)
    sized: ComplexArray = g * modes
    return sized


def _slopes(w: FloatArray, H: ComplexArray, s: FloatArray, ratio: float) -> tuple[Slope, ...]:
    """The slopes of groups of rows, each of the middle one: alike are slopes within the `ratio`."""
    steep = np.log1p(np.abs(3.0 * s * np.max(w * w, axis=1, keepdims=True) * H).max(axis=1))
    group = np.floor((steep - steep.min()) / np.log(ratio))
    found = []
    for g in np.unique(group):
        rows = np.flatnonzero(group == g)
        i = rows[np.argsort(steep[rows], kind="stable")[rows.size // 2]]
        every = slice(None) if rows.size == len(w) else rows
        found.append(_slope(every, w[i], H[i], float(s[i, 0])))
    return tuple(found)


def _slope(rows: IntArray | slice, w: FloatArray, H: ComplexArray, s: float) -> Slope:
    """1 + 3 s H [w^2 .] of one row, inverted."""
    square = rfft(w * w, norm="forward")
    n = np.arange(_COUPLED)
    apart = n[:, None] - n
    before = np.where(apart < 0, np.conj(square[np.abs(apart)]), square[np.abs(apart)])
    after = square[n[:, None] + n] * (n > 0)  # times the conjugate modes, n < 0
    gain = 3.0 * s * H[:_COUPLED, None]
    same, mirrored = gain * before, gain * after
    coupled = np.block(
        [
            [(same + mirrored).real, (mirrored - same).imag],
            [(same + mirrored).imag, (same - mirrored).real],
        ]
    )
    inverse = np.linalg.inv(np.eye(2 * _COUPLED) + coupled)
    short = 1.0 / (1.0 + 1.5 * s * H[_COUPLED:] * np.max(w * w))
    return Slope(rows, inverse, np.asarray(short, np.complex128))


def _refuse_giving_way(w: FloatArray, H: ComplexArray, s: FloatArray) -> None:
    """ModelError if nothing holds a softening foundation: 1 - 3 k3 w^2."""
    if np.any(s < 0.0) and np.any(
        1.0 + 3.0 * (s * np.max(w * w, axis=1, keepdims=True) * H).real <= 0.0
    ):
        raise ModelError(
            "the softened foundation gives way",
            allowed="k3 w^2 below about 1/3 is allowed",
            do="lower stiffening.cubic_1_m2 or the load",
        )
