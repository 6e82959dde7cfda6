"""Brush friction with adhesion and slip on a parabolic pressure (P2 3, (13)-(18), with the errata).

tau = sigma C_x (xi + L) up to f_s p at x_s, then sign(sigma) f_d p to the exit edge; braking > 0,
towards the exit. By (15) x_s = L - |sigma| C_x / (gamma f_s), and with C_x = 2 gamma L f_s (17), of
which a tread may have a multiple, L (1 - 2 |sigma|). On the beam the traction acts as a couple with
the lever h: p_fri = h d tau / d xi, with the jump of tau at x_s.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tirelog.physics.spectral import MODES, ComplexArray, powers
from tirelog.vocabulary.arrays import FloatArray

#: friction of a tread that adheres and of one that slides [N/N]; by (17) C_x is proportional to the
#: first: doubling it doubles the traction of the same slip as far as x_s, which stays
STATIC_FRICTION = 0.8
SLIDING_FRICTION = 0.6


@dataclass(frozen=True)
class Grip:
    """What holds a tread on the road: friction that adheres and that slides [N/N], and how many
    times stiffer the tread is than (17) has it, which it must be if all slides before slip 1.
    """

    static_friction: float = STATIC_FRICTION
    sliding_friction: float = SLIDING_FRICTION
    stiffness_ratio: float = 1.0


def slip_stiffness(
    load_N: FloatArray, half_length_m: FloatArray, static_friction: float = STATIC_FRICTION
) -> FloatArray:
    """C_x [N/m^2] by P2 (17)."""
    gamma = 0.75 * load_N / half_length_m**3
    return 2.0 * gamma * half_length_m * static_friction


def transition(
    slip: FloatArray, half_length_m: FloatArray, stiffness_ratio: float = 1.0
) -> FloatArray:
    """Place x_s [m] at which adhesion ends and slip begins; not below -L.

    P2 (15) with (17), or that times a ratio: L (1 - 2 ratio |sigma|).
    """
    return half_length_m * np.maximum(1.0 - 2.0 * stiffness_ratio * np.abs(slip), -1.0)


def traction(
    xi_m: FloatArray,
    load_N: FloatArray,
    half_length_m: FloatArray,
    slip: FloatArray,
    grip: Grip = Grip(),
) -> FloatArray:
    """tau(xi) [N/m], positive in braking; P2 (13)."""
    gamma = 0.75 * load_N / half_length_m**3
    stiffness = grip.stiffness_ratio * slip_stiffness(load_N, half_length_m, grip.static_friction)
    stick = slip * stiffness * (xi_m + half_length_m)
    slide = np.sign(slip) * grip.sliding_friction * gamma * (half_length_m**2 - xi_m**2)
    tau = np.where(xi_m < transition(slip, half_length_m, grip.stiffness_ratio), stick, slide)
    return np.where(np.abs(xi_m) < half_length_m, tau, 0.0)


def traction_modes(
    load_N: FloatArray,
    half_length_m: FloatArray,
    slip: FloatArray,
    radius_m: float,
    grip: Grip = Grip(),
) -> ComplexArray:
    """Fourier coefficients of tau(xi) [N/m], columns (n, 1) to (n, K); closed form."""
    L, x_s = half_length_m, transition(slip, half_length_m, grip.stiffness_ratio)
    gamma = 0.75 * load_N / L**3
    stick = slip * (grip.stiffness_ratio * slip_stiffness(load_N, L, grip.static_friction))
    slide = np.sign(slip) * grip.sliding_friction * gamma
    # int f exp(-i q xi) = exp(-i q xi) (i f / q + f' / q^2 - i f'' / q^3), at the ends of each
    # piece: what stands at -L, x_s and L, by powers of 1 / q
    inverse = radius_m / np.arange(1, MODES)
    square, cube = inverse**2, inverse**3
    at_x_s, at_end = powers(-x_s / radius_m)[:, 1:], powers(-L / radius_m)[:, 1:]
    steps = stick * (x_s + L) - slide * (L**2 - x_s**2)
    factor = np.empty((steps.shape[0], MODES - 1), dtype=np.complex128)
    factor.real = (stick + 2.0 * slide * x_s) * square
    factor.imag = steps * inverse - 2.0 * slide * cube
    modes = np.empty((steps.shape[0], MODES), dtype=np.complex128)
    modes[:, :1] = 0.5 * stick * (x_s + L) ** 2 + slide * (L**2 * (L - x_s) - (L**3 - x_s**3) / 3.0)
    np.multiply(at_x_s, factor, out=modes[:, 1:])
    factor.real = -2.0 * L * slide * square
    factor.imag = 2.0 * slide * cube
    factor *= at_end
    factor -= at_end.conj() * (stick * square)
    modes[:, 1:] += factor
    return modes / (2.0 * np.pi * radius_m)


def forces(
    load_N: FloatArray,
    half_length_m: FloatArray,
    slip: FloatArray,
    slip_angle_rad: float,
    camber_rad: float,
    radius_m: float,
    grip: Grip = Grip(),
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(F_x [N], positive in braking, F_y [N], M_z [N m], which turns the slip angle back).

    Columns (n, 1) in and out. P2's bristles in the plane of the road: a bristle that adheres is
    carried along by sigma and tan(slip angle) per length from the entry edge, and sideways by the
    wheel's camber, whose path on the road is bent by sin(camber) / R:

        d = ((xi + L) sigma, (xi + L) tan(slip angle) + sin(camber) (L^2 - xi^2) / (2 R))

    with C_x both ways up to f_s p; from there to the exit edge f_d p against the motion. The
    carcass is taken to be stiff sideways. Without angles it is `traction`, summed.
    """
    steps = 2000
    u = (np.arange(steps) + 0.5) * (2.0 / steps) - 1.0  # (xi / L), middles of the steps
    L = half_length_m
    xi = L * u
    p = 0.75 * load_N / L**3 * (L**2 - xi**2)
    stiffness = grip.stiffness_ratio * slip_stiffness(load_N, L, grip.static_friction)
    along = stiffness * slip * (xi + L)
    across = stiffness * (
        np.tan(slip_angle_rad) * (xi + L) + np.sin(camber_rad) * (L**2 - xi**2) / (2.0 * radius_m)
    )
    size = np.hypot(along, across)
    slides = np.maximum.accumulate(size > grip.static_friction * p, axis=1)
    factor = np.where(slides, grip.sliding_friction * p / np.where(size > 0.0, size, 1.0), 1.0)
    step = L * (2.0 / steps)
    f_x, f_y, m_z = (
        (q * factor * step).sum(axis=1, keepdims=True) for q in (along, across, xi * across)
    )
    return f_x, f_y, m_z
