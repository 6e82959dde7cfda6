"""The foundation that hardens: the extra load k k3 w^3 by fixed point.

(Z + s m) w = p - s (w^3 - m w) with m = 1.5 max w^2: the right side's slope lies between -s m and s m where w is, so the
iteration contracts whatever the strength.  w falls off as n^-6: a fifth of the modes carries it to 1e-9.
"""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, rfft

from tirelog.errors import ModelError
from tirelog.physics.spectral import ComplexArray, FloatArray

_MODES = 192
_GRID = 768
_STEPS = 200
_TOLERANCE = 1e-12


def hardened_load(load: ComplexArray, compliance: ComplexArray | FloatArray, stiffness: FloatArray | float) -> ComplexArray:
    """The load less the hardened foundation's extra reaction, (n, K); `stiffness` is k k3 [N/m^4], column or number."""
    rows = np.broadcast_shapes(load.shape, compliance.shape)[0]
    p = np.broadcast_to(load, (rows, load.shape[1]))
    P, H = p[:, :_MODES], np.broadcast_to(compliance, (rows, load.shape[1]))[:, :_MODES]
    s = np.broadcast_to(np.asarray(stiffness, dtype=np.float64), (rows, 1))
    w = irfft(P * H, _GRID, axis=1, norm="forward")
    for _ in range(_STEPS):
        m = 1.5 * np.max(w * w, axis=1, keepdims=True)
        rest = rfft(w * (w * w - m), axis=1, norm="forward")[:, :_MODES]
        new = irfft((P - s * rest) * H / (1.0 + s * m * H), _GRID, axis=1, norm="forward")
        change = np.max(np.abs(new - w)) / np.max(np.abs(new))
        w = new
        if change < _TOLERANCE:
            reaction = s * rfft(w**3, axis=1, norm="forward")[:, :_MODES]
            hardened = np.array(p, dtype=np.complex128)
            hardened[:, :_MODES] -= reaction
            return hardened
    raise ModelError("the hardened foundation found no balance; k3 w^2 up to about 10 is allowed; lower stiffening.cubic_1_m2")
