"""The foundation that hardens: the extra load k k3 w^3, by Newton's method with few slopes.

    w <- w + (1 + 3 s H [w0^2 .])^-1 (H (p - s w^3) - w)

A slope, that at w0, serves several steps: each leaves a tenth of the error or less. It couples the
longest waves of w alone; the shorter ones, which H makes small, have its diagonal. w falls off as
n^-6: an eighth of the modes carries it to 1e-7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.fft import irfft, rfft

from tirelog.errors import ModelError
from tirelog.physics.spectral import MODES, ComplexArray
from tirelog.vocabulary.arrays import FloatArray

# ---- The beam on an elastic foundation under a moving load, P1 (2) and P2 (1).
#
# Steady, and closed to the tread's circumference.
#
#     EJ w'''' + (mu c^2 - T) w'' + 2 mu omega_d c w' + k w = p(xi)          w inward, xi in the
#         direction of passing (errata)
#
# Strain at the signed lever arm y (positive toward the axle) is -y w'' (errata to P2 (11)).
# `impedance` is the same line in Fourier modes.


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
        limit = np.sqrt((2.0 * np.sqrt(EJ * k) + hoop_N + mu * speed_m_s**2) / mu).min()
        raise ModelError(
            f"speed {float(speed_m_s.max()):.4g} m/s reaches the beam's critical speed "
            f"{float(limit):.4g} m/s",
            allowed="below it a steady wave exists",
            do="take a stiffer or lighter beam (EJ, k, mu), the effect belt_tension, or carcass = "
            '"ring"',
        )


#: modes of w, and points of the grid on which w^3 is taken: four for a mode, so that what the cube
#: adds beyond the grid's last mode does not fold back onto these
_MODES = 128
_GRID = 512
#: modes that a slope couples; with twice as many a step takes longer and hardly one is saved
_COUPLED = 32


#: what rows take for the inverse of their slopes: matrices (n, 2 K, 2 K) that act on real beside
#: imaginary parts of the K longest waves; factors of the others
Slopes: TypeAlias = tuple[FloatArray, ComplexArray]
#: a deflection that was found, modes (n, all) [m], and the slopes that led to it
Balance: TypeAlias = tuple[ComplexArray, Slopes]


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
    known = start is not None and start[0].shape == P.shape
    modes, slopes = start if start is not None and known else (_soft(P * H, H, s), None)
    for step in range(80):  # far more than what converges takes
        w = irfft(modes, _GRID, axis=1, norm="forward")
        if slopes is None or (step and step % 8 == 0):
            _refuse_giving_way(w, H, s)
            slopes = _slopes(w, H, s)
        reaction = s * rfft(w * w * w, axis=1, norm="forward")[:, :_MODES]
        missed = H * (P - reaction) - modes
        coupled, short = slopes
        parts = np.hstack([missed[:, :_COUPLED].real, missed[:, :_COUPLED].imag])
        parts = (coupled @ parts[..., None])[..., 0]
        long = parts[:, :_COUPLED] + 1j * parts[:, _COUPLED:]
        change = np.hstack([long, missed[:, _COUPLED:] * short])
        modes, farthest = modes + change, np.max(np.abs(change))
        # a change below this share of the largest mode is the last; twice as much is as far below
        # what a log tells
        if farthest < 1e-11 * np.max(np.abs(modes)):
            _refuse_giving_way(w, H, s)
            hardened = np.array(p, dtype=np.complex128)
            hardened[:, :_MODES] -= reaction
            return hardened, (modes, slopes)
        # a change above so many of the soft foundation's largest mode leads nowhere; twice as many
        # only take longer to fail
        if not farthest < 1e3 * np.max(np.abs(P * H)):
            break
    raise ModelError(
        "the hardened foundation found no balance",
        allowed="k3 w^2 up to about 10 is allowed",
        do="lower stiffening.cubic_1_m2",
    )


def _soft(modes: ComplexArray, H: ComplexArray, s: FloatArray) -> ComplexArray:
    """Deflection of the soft foundation (n, all), the smallest in balance.

    g w, with g + b g^3 = 1: b is what H s w^3 has of w.
    """
    w = irfft(modes, _GRID, axis=1, norm="forward")
    cubed = H * rfft(w * w * w, axis=1, norm="forward")[:, :_MODES]
    size = np.maximum(np.sum(np.abs(modes) ** 2, axis=1, keepdims=True), 1e-300)
    b = s * np.sum((np.conj(modes) * cubed).real, axis=1, keepdims=True) / size
    b = np.maximum(b, 0.0)
    g = np.ones_like(b)
    # Newton's steps for the size of the first w; it need not be exact, twice as many change nothing
    for _ in range(8):
        g = g - (g + b * g**3 - 1.0) / (1.0 + 3.0 * b * g**2)
    return np.asarray(g * modes)


def _slopes(w: FloatArray, H: ComplexArray, s: FloatArray) -> Slopes:
    """1 + 3 s H [w^2 .] of each row, inverted."""
    square = rfft(w * w, axis=1, norm="forward")
    n = np.arange(_COUPLED)
    apart, near = n[:, None] - n, square[:, np.abs(n[:, None] - n)]
    before = np.where(apart < 0, np.conj(near), near)
    after = square[:, n[:, None] + n] * (n > 0)  # times the conjugate modes, n < 0
    gain = 3.0 * s[..., None] * H[:, :_COUPLED, None]
    same, mirrored = gain * before, gain * after
    coupled = np.block(
        [
            [(same + mirrored).real, (mirrored - same).imag],
            [(same + mirrored).imag, (same - mirrored).real],
        ]
    )
    inverse = np.linalg.inv(np.eye(2 * _COUPLED) + coupled)
    short = 1.0 / (1.0 + 1.5 * s * H[:, _COUPLED:] * np.max(w * w, axis=1, keepdims=True))
    return inverse, np.asarray(short, np.complex128)


def _refuse_giving_way(w: FloatArray, H: ComplexArray, s: FloatArray) -> None:
    """ModelError if a softening foundation gives way: 1 - 3 k3 w^2."""
    if np.any(s < 0.0) and np.any(
        1.0 + 3.0 * (s * np.max(w * w, axis=1, keepdims=True) * H).real <= 0.0
    ):
        raise ModelError(
            "the softened foundation gives way",
            allowed="k3 w^2 below about 1/3 is allowed",
            do="lower stiffening.cubic_1_m2 or the load",
        )


# ---- The flexible ring on a viscoelastic foundation (P3, with the errata).
#
# Steady rolling, in complex modes.
#
#     v = sum V_n e^(i n phi),  w_out = sum -i n V_n e^(i n phi),   Z_n V_n = Q_v,n + i n Q_w,n
#     Z_n = EI/R^4 n^2 (1-n^2)^2 + (p0 b/R) n^2 (n^2-1) + k_v + k_w n^2 + i n Omega (c_v + c_w n^2)
#
# Rotation has cancelled: centrifugal pre-tension, centrifugal and Coriolis terms and inertia of the
# wave sum to zero in every mode (errata). The pipeline knows one load per length, positive inward,
# and one inward displacement. So the ring's loads are brought into an equivalent inward load E_n
# = i
# (Q_v,n + i n Q_w,n) / n and W_n = E_n / (Z_n / n^2); the belt is inextensible, so W_0 = 0. Road
# pressure p acts vertically: Q_w = -p cos phi, Q_v = p sin phi, friction tau along the road: Q_w =
# tau sin phi, Q_v = tau cos phi. (P3 prints the pressure radially, p / cos phi; it carries the same
# load and differs from this by phi^2, 1 % at the edges.)


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


#: n, and (1 + 1/n) / 2 and (1 - 1/n) / 2 for n = 1, 2, ...
_N = np.arange(MODES, dtype=np.float64)
_BEHIND, _AHEAD = (0.5 * (1.0 + sign / _N[1:]) for sign in (1.0, -1.0))


def equivalent_load(pressure: ComplexArray, traction: ComplexArray | None = None) -> ComplexArray:
    """Inward load on a belt without tangential freedom: E_n = i (Q_v + i n Q_w) / n, E_0 = 0.

    The loads of the road, with their equal terms taken together:
    E_n = (1 + 1/n) / 2 (p + i tau)_(n-1) + (1 - 1/n) / 2 (p - i tau)_(n+1).
    """
    behind = pressure if traction is None else pressure + 1j * traction
    ahead = pressure if traction is None else pressure - 1j * traction
    load = np.empty_like(behind)
    load[:, 0] = 0.0
    np.multiply(behind[:, :-1], _BEHIND, out=load[:, 1:])
    load[:, 1:-1] += ahead[:, 2:] * _AHEAD[:-1]
    return load


def ring_hub_forces(
    pressure: ComplexArray,
    traction: ComplexArray | None,
    carcass: RingCarcass,
    omega_rad_s: FloatArray | float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """(F_x, F_z) [N] that the foundation hands to the hub, each (n,).

    F_z is up, F_x in the direction of passing (errata to P3).

    F = R int (k_w w + c_w w_t) e_r + (k_v v + c_v v_t) e_t; only n = 1 has a resultant, and
    Q_v,1 + i Q_w,1 is tau_0 - i p_0.
    """
    load = -1j * pressure[:, 0] if traction is None else traction[:, 0] - 1j * pressure[:, 0]
    v1 = load / modal_impedance(np.array([1.0]), carcass, omega_rad_s)
    radial = (carcass.k_w + 1j * omega_rad_s * carcass.c_w) * (-1j * v1)
    tangential = (carcass.k_v + 1j * omega_rad_s * carcass.c_v) * v1
    # e_r = (sin, -cos), e_t = (cos, sin) in (along passing, up) at the angle phi from the patch
    # centre
    f_x = 2.0 * np.pi * carcass.R * (-radial.imag + tangential.real)
    f_z = 2.0 * np.pi * carcass.R * (-radial.real - tangential.imag)
    return f_x, f_z
