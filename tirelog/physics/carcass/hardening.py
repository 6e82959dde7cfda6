"""The foundation that hardens: the extra load k k3 w^3 by fixed point.

(Z + s m) w = p - s (w^3 - m w) with m = 1.5 max w^2: the right side's slope lies between -s m and s
m where w is, so the iteration contracts whatever the strength. w falls off as n^-6: an eighth of
the modes carries it to 1e-7.
"""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, rfft

from tirelog.errors import ModelError
from tirelog.physics.spectral import ComplexArray
from tirelog.vocabulary.arrays import FloatArray

#: modes of w, and points of the grid on which w^3 is taken: four for a mode, so that what the cube
#: adds beyond the grid's last mode does not fold back onto these
_MODES = 128
_GRID = 512
#: steps at most (then ModelError), past steps that a secant goes through, steps until m stays;
#: twice as many of the first only take longer to fail; a longer past costs memory alone
_STEPS = 200
_DEPTH = 2
_SETTLED = 3
#: a change below this share of the largest w is the last; twice as much is as far below what a log
#: tells
_TOLERANCE = 1e-11


def hardened_load(
    load: ComplexArray,
    compliance: ComplexArray | FloatArray,
    stiffness: FloatArray | float,
    start_m: FloatArray | None = None,
) -> tuple[ComplexArray, FloatArray]:
    """(The load less the hardened foundation's extra reaction (n, K), w on a grid [m]).

    `stiffness` is k k3 [N/m^4], column or number. `start_m`: a w to start from, as one that was
    found with nearly the same numbers; else that of the soft foundation.
    """
    rows = np.broadcast_shapes(load.shape, compliance.shape)[0]
    p = np.broadcast_to(load, (rows, load.shape[1]))
    P, H = p[:, :_MODES], np.broadcast_to(compliance, (rows, load.shape[1]))[:, :_MODES]
    s = np.broadcast_to(np.asarray(stiffness, dtype=np.float64), (rows, 1))
    w = irfft(P * H, _GRID, axis=1, norm="forward")
    if start_m is not None and start_m.shape == w.shape:
        w = start_m
    past: list[tuple[FloatArray, FloatArray]] = []
    for step in range(_STEPS):
        if step < _SETTLED:  # then it stays, so that the secants see one map
            m = 1.5 * np.max(w * w, axis=1, keepdims=True)
            if np.any(1.0 + 2.0 * (s * m * H).real <= 0.0):  # 1 - 3 k3 w^2: nothing holds it
                raise ModelError(
                    "the softened foundation gives way",
                    allowed="k3 w^2 below about 1/3 is allowed",
                    do="lower stiffening.cubic_1_m2 or the load",
                )
            soft, past = H / (1.0 + s * m * H), []
        rest = rfft(w * (w * w - m), axis=1, norm="forward")[:, :_MODES]
        new = irfft((P - s * rest) * soft, _GRID, axis=1, norm="forward")
        change = new - w
        if np.max(np.abs(change)) < _TOLERANCE * np.max(np.abs(new)):
            hardened = np.array(p, dtype=np.complex128)
            hardened[:, :_MODES] -= s * rfft(new**3, axis=1, norm="forward")[:, :_MODES]
            return hardened, new
        w = _hurried(new, change, past)
        past = [*past[1 - _DEPTH :], (new, change)]
    raise ModelError(
        "the hardened foundation found no balance",
        allowed="k3 w^2 up to about 10 is allowed",
        do="lower stiffening.cubic_1_m2",
    )


def _hurried(
    new: FloatArray, change: FloatArray, past: list[tuple[FloatArray, FloatArray]]
) -> FloatArray:
    """The next trial by the secants through the last steps, row by row.

    Anderson's mixing: it takes a third of the steps.
    """
    if not past:
        return new
    turns = np.stack([change - old for _, old in past], axis=1)
    gram = np.einsum("nkm,nlm->nkl", turns, turns)
    gram += (1e-12 * np.trace(gram, axis1=1, axis2=2) + 1e-300)[:, None, None] * np.eye(len(past))
    share = np.linalg.solve(gram, np.einsum("nkm,nm->nk", turns, change)[..., None])[..., 0]
    mixed: FloatArray = new - np.einsum(
        "nk,nkm->nm", share, np.stack([new - old for old, _ in past], axis=1)
    )
    return mixed
