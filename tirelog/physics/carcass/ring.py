"""The flexible ring on a viscoelastic foundation (P3, with the errata).

Steady rolling, in complex modes.

    v = sum V_n e^(i n phi),  w_out = sum -i n V_n e^(i n phi),   Z_n V_n = Q_v,n + i n Q_w,n
    Z_n = EI/R^4 n^2 (1-n^2)^2 + (p0 b/R) n^2 (n^2-1) + k_v + k_w n^2 + i n Omega (c_v + c_w n^2)

Rotation has cancelled: centrifugal pre-tension, centrifugal and Coriolis terms and inertia of the
wave sum to zero in every mode (errata). The pipeline knows one load per length, positive inward,
and one inward displacement. So the ring's loads are brought into an equivalent inward load E_n = i
(Q_v,n + i n Q_w,n) / n and W_n = E_n / (Z_n / n^2); the belt is inextensible, so W_0 = 0. Road
pressure p acts vertically: Q_w = -p cos phi, Q_v = p sin phi, friction tau along the road: Q_w =
tau sin phi, Q_v = tau cos phi. (P3 prints the pressure radially, p / cos phi; it carries the same
load and differs from this by phi^2, 1 % at the edges.)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tirelog.physics.spectral import MODES, ComplexArray
from tirelog.vocabulary.arrays import FloatArray


@dataclass(frozen=True)
class RingCarcass:
    """The ring's constants.

    EI [N m^2], k_w, k_v [N/m^2], c_w, c_v [N s/m^2], p0 b [N/m], R [m], tread k_t [N/m^2].
    """

    EI: float
    k_w: float
    k_v: float
    c_w: float
    c_v: float
    pb: float
    R: float
    k_t: float = np.inf


def modal_impedance(
    n: FloatArray, carcass: RingCarcass, omega_rad_s: FloatArray | float = 0.0
) -> ComplexArray:
    """Impedance Z_n [N/m^2] of the modes at wheel speed Omega, shape of `n`.

    Without damping, Z_1 = k_v + k_w and Z_0 = k_v.
    """
    c = carcass
    stiff = (
        c.EI / c.R**4 * n**2 * (1.0 - n**2) ** 2
        + c.pb / c.R * n**2 * (n**2 - 1.0)
        + c.k_v
        + c.k_w * n**2
    )
    return stiff + 1j * n * omega_rad_s * (c.c_v + c.c_w * n**2)


def road_loads(
    pressure: ComplexArray, traction: ComplexArray | None = None
) -> tuple[ComplexArray, ComplexArray]:
    """Modes (Q_v, Q_w) of the road's load on the ring, each (n, K).

    They come from the modes of the vertical pressure and of the traction along the road.
    """
    ahead, behind = _neighbours(pressure)
    q_w, q_v = -0.5 * (behind + ahead), -0.5j * (behind - ahead)
    if traction is not None:
        ahead, behind = _neighbours(traction)
        q_v, q_w = q_v + 0.5 * (behind + ahead), q_w - 0.5j * (behind - ahead)
    return q_v, q_w


#: n, and (1 + 1/n) / 2 and (1 - 1/n) / 2 for n = 1, 2, ...
_N = np.arange(MODES, dtype=np.float64)
_BEHIND, _AHEAD = (0.5 * (1.0 + sign / _N[1:]) for sign in (1.0, -1.0))


def equivalent_load(pressure: ComplexArray, traction: ComplexArray | None = None) -> ComplexArray:
    """Inward load on a belt without tangential freedom: E_n = i (Q_v + i n Q_w) / n, E_0 = 0.

    Of `road_loads`, with what stands there twice taken together:
    E_n = (1 + 1/n) / 2 (p + i tau)_(n-1) + (1 - 1/n) / 2 (p - i tau)_(n+1).
    """
    behind = pressure if traction is None else pressure + 1j * traction
    ahead = pressure if traction is None else pressure - 1j * traction
    load = np.empty_like(behind)
    load[:, 0] = 0.0
    np.multiply(behind[:, :-1], _BEHIND, out=load[:, 1:])
    load[:, 1:-1] += ahead[:, 2:] * _AHEAD[:-1]
    return load


def _neighbours(modes: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
    """Coefficients n + 1 and n - 1 of a real function."""
    ahead, behind = np.zeros_like(modes), np.empty_like(modes)
    ahead[:, :-1] = modes[:, 1:]
    behind[:, 1:] = modes[:, :-1]
    behind[:, 0] = np.conj(modes[:, 1])
    return ahead, behind


def ring_hub_forces(
    pressure: ComplexArray,
    traction: ComplexArray | None,
    carcass: RingCarcass,
    omega_rad_s: FloatArray | float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """(F_x, F_z) [N] that the foundation hands to the hub, each (n,).

    F_z is up, F_x in the direction of passing (errata to P3).

    F = R int (k_w w + c_w w_t) e_r + (k_v v + c_v v_t) e_t; only n = 1 has a resultant.
    """
    q_v, q_w = road_loads(pressure, traction)
    v1 = (q_v[:, 1] + 1j * q_w[:, 1]) / modal_impedance(np.array([1.0]), carcass, omega_rad_s)
    radial = (carcass.k_w + 1j * omega_rad_s * carcass.c_w) * (-1j * v1)
    tangential = (carcass.k_v + 1j * omega_rad_s * carcass.c_v) * v1
    # e_r = (sin, -cos), e_t = (cos, sin) in (along passing, up) at the angle phi from the patch
    # centre
    f_x = 2.0 * np.pi * carcass.R * (-radial.imag + tangential.real)
    f_z = 2.0 * np.pi * carcass.R * (-radial.real - tangential.imag)
    return f_x, f_z
