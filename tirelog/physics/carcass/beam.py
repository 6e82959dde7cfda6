"""The beam on an elastic foundation under a moving load, P1 (2) and P2 (1).

Steady, and closed to the tread's circumference.

    EJ w'''' + (mu c^2 - T) w'' + 2 mu omega_d c w' + k w = p(xi)          w inward, xi in the
        direction of passing (errata)

Strain at the signed lever arm y (positive toward the axle) is -y w'' (errata to P2 (11)).
`impedance` is the same line in Fourier modes.
"""

from __future__ import annotations

import numpy as np

from tirelog.errors import ModelError
from tirelog.physics.spectral import ComplexArray
from tirelog.vocabulary.arrays import FloatArray


def critical_speed(
    flexural_stiffness_N_m2: float,
    foundation_stiffness_N_m2: float,
    line_mass_kg_m: float,
    tension_N: float = 0.0,
) -> float:
    """c_cr [m/s], above which no steady wave without radiation exists: mu c^2 = 2 sqrt(EJ k) + T.

    Without tension P1 (5): 2 lambda sqrt(EJ / mu) with lambda^4 = k / (4 EJ).
    """
    return float(
        np.sqrt(
            (2.0 * np.sqrt(flexural_stiffness_N_m2 * foundation_stiffness_N_m2) + tension_N)
            / line_mass_kg_m
        )
    )


def refuse_supercritical(
    speed_m_s: FloatArray, hoop_N: FloatArray, EJ: float, k: FloatArray | float, mu: float
) -> None:
    """ModelError if EJ q^4 + (T - mu c^2) q^2 + k has no lower bound above zero.

    `hoop_N` is T - mu c^2, shape (n, 1).
    """
    if np.any(-hoop_N >= 2.0 * np.sqrt(EJ * k)):
        tension = np.broadcast_to(
            hoop_N + mu * speed_m_s**2, np.broadcast_shapes(hoop_N.shape, speed_m_s.shape)
        )
        limit = np.sqrt((2.0 * np.sqrt(EJ * k) + tension) / mu).min()
        raise ModelError(
            f"speed {float(speed_m_s.max()):.4g} m/s reaches the beam's critical speed "
            f"{float(limit):.4g} m/s",
            allowed="below it a steady wave exists",
            do="take a stiffer or lighter beam (EJ, k, mu), the effect belt_tension, or carcass = "
            '"ring"',
        )


def impedance(
    q: FloatArray, EJ: float, k: FloatArray | float, hoop_N: FloatArray, drag: FloatArray
) -> FloatArray | ComplexArray:
    """Impedance Z(q) [N/m^2] of the beam: EJ q^4 + hoop q^2 + k + i q drag.

    `hoop_N` = T - mu c^2 and `drag` = 2 mu omega_d c, both (n, 1). Real if nothing dissipates (half
    the work).
    """
    real = EJ * q**4 + hoop_N * q**2 + k
    return real + 1j * (q * drag) if np.any(drag) else real
