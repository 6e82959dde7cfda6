"""Fourier coefficients of the shapes that a contact pressure is made of.

Every function returns P_n = (1 / C) int p(xi) exp(-i q_n xi) d xi, shape (n, K), from columns of
shape (n, 1). They are in closed form, because sampling the parabola on a grid would miss its slope
jump at the edges by 1e-4. C = 2 pi R. P_0 C is the force.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import ndtr, spherical_jn

from tirelog.data.setup import FORM_DEGREES
from tirelog.errors import ModelError
from tirelog.physics.spectral import MODES, ComplexArray, grid_angles, powers, to_modes
from tirelog.vocabulary.arrays import FloatArray

_N = np.arange(1, MODES, dtype=np.float64)


def parabola(load_N: FloatArray, half_length_m: FloatArray, radius_m: float) -> FloatArray:
    """Parabolic pressure P2 (12): p = gamma (L^2 - xi^2), gamma = 3 F / (4 L^3).

    An even function has real coefficients.
    """
    x = half_length_m / radius_m * _N
    turn = powers(half_length_m / radius_m)[:, 1:]
    shape = np.empty((x.shape[0], MODES))
    shape[:, :1] = 1.0
    shape[:, 1:] = 3.0 * (turn.imag - x * turn.real) / x**3
    return (load_N / (2.0 * np.pi * radius_m)) * shape


def line(load_N: FloatArray, half_length_m: FloatArray, radius_m: float) -> FloatArray:
    """Pressure of a load on one line across the tread, P delta(xi) of P1 (2), without a length."""
    return (load_N / (2.0 * np.pi * radius_m)) * np.ones((1, MODES))


def tilted_parabola(load_N: FloatArray, half_length_m: FloatArray, radius_m: float) -> ComplexArray:
    """The parabola times xi / L (it carries no load)."""
    x = half_length_m / radius_m * _N
    turn = powers(half_length_m / radius_m)[:, 1:]
    shape = np.zeros((x.shape[0], MODES), dtype=np.complex128)
    shape[:, 1:] = -3j * ((3.0 / x**2 - 1.0) * turn.imag / x - 3.0 * turn.real / x**2) / x
    return (load_N / (2.0 * np.pi * radius_m)) * shape


def saddled_parabola(load_N: FloatArray, half_length_m: FloatArray, radius_m: float) -> FloatArray:
    """The parabola times xi^2 / L^2 - 1/5 (it carries no load either)."""
    x = half_length_m / radius_m * _N
    turn = powers(half_length_m / radius_m)[:, 1:]
    sine, cosine = turn.imag, turn.real
    whole = -3.2 * cosine / x**2 + 19.2 * sine / x**3 + 48.0 * cosine / x**4 - 48.0 * sine / x**5
    # of long waves that is a difference of large numbers: three terms of the series
    series = x**2 * (-16.0 / 525.0 + x**2 * (8.0 / 4725.0 - x**2 * (2.0 / 51975.0)))
    shape = np.zeros((x.shape[0], MODES))
    shape[:, 1:] = 0.75 * np.where(x < 0.3, series, whole)
    return (load_N / (2.0 * np.pi * radius_m)) * shape


_FORM_ORDERS = np.arange(1, FORM_DEGREES + 1)
#: step of a table of spherical Bessel functions: cubics between its values are off by 1e-11; with
#: twice the step by sixteen times as much
_TABLE_STEP = 0.01


@cache
def _bessel_table(end: int) -> tuple[FloatArray, FloatArray]:
    """j_n at 0, step ... end and n = 1 ... 14, and its slope times the step, (k, 14) each."""
    x = _TABLE_STEP * np.arange(end / _TABLE_STEP + 2.0)[:, None]
    return spherical_jn(_FORM_ORDERS, x), _TABLE_STEP * spherical_jn(_FORM_ORDERS, x, True)


def _near_bessel(x: FloatArray) -> FloatArray:
    """j_n(x) (..., 14) for n = 1 ... 14, by cubics through a table."""
    values, slopes = _bessel_table(10 * math.ceil(x.max() / 10.0))
    place = (x / _TABLE_STEP).astype(np.int64)
    t = (x / _TABLE_STEP - place)[..., None]
    here, there, low, high = values[place], values[place + 1], slopes[place], slopes[place + 1]
    bend, turn = 3.0 * (there - here) - 2.0 * low - high, 2.0 * (here - there) + low + high
    return np.asarray(here + t * (low + t * (bend + t * turn)), dtype=np.float64)


def legendre_modes(half_length_m: FloatArray, radius_m: float) -> FloatArray:
    """Spherical Bessel functions j_n(q L), n = 1 ... 14, (14, n, K).

    (-i)^n j_n are the modes of the Legendre polynomial P_n(xi / L) on the patch, times C / (2 L).
    Up to x = q L = 10 they are read from a table; beyond it they follow from each other,
    j_(n+1) = (2 n + 1) / x j_n - j_(n-1).
    """
    x = half_length_m / radius_m * np.arange(MODES)
    near = min(int(np.ceil(10.0 * radius_m / half_length_m.min())) + 1, MODES)
    waves = np.empty((FORM_DEGREES, *x.shape))
    waves[..., :near] = np.moveaxis(_near_bessel(x[:, :near]), -1, 0)
    per_x, turn = 1.0 / x[:, near:], powers(half_length_m / radius_m)[:, near:]
    before = turn.imag * per_x
    own = before * per_x - turn.real * per_x
    for n in _FORM_ORDERS:
        waves[n - 1, :, near:] = own
        before, own = own, (2 * n + 1) * per_x * own - before
    return waves


def bell(
    height: FloatArray, centre_m: FloatArray, width_m: FloatArray, radius_m: float
) -> ComplexArray:
    """height exp(-((xi - centre) / width)^2 / 2)."""
    q = np.arange(MODES) / radius_m
    size = height * width_m * (np.sqrt(2.0 * np.pi) / (2.0 * np.pi * radius_m))
    return np.asarray((size * np.exp(-0.5 * (q * width_m) ** 2)) * powers(-centre_m / radius_m))


def wedge(
    height: FloatArray, edge_m: FloatArray, length_m: FloatArray, radius_m: float
) -> ComplexArray:
    """height u exp(1 - u) ahead of the edge: u = (edge - xi) / length > 0."""
    q = np.arange(MODES) / radius_m
    size = height * length_m * (math.e / (2.0 * math.pi * radius_m))
    return size / (1.0 - 1j * q * length_m) ** 2 * powers(-edge_m / radius_m)


def smear(length_m: FloatArray, radius_m: float) -> FloatArray:
    """Transfer of the convolution with exp(-|xi| / length) / (2 length), shape (n, K)."""
    return 1.0 / (1.0 + (np.arange(MODES) / radius_m * length_m) ** 2)


def _on_grid(
    load_N: FloatArray, half_length_m: FloatArray, radius_m: float
) -> tuple[FloatArray, FloatArray]:
    """(xi [m] of the grid, the parabola P2 (12) there, below zero outside of the patch [N/m])."""
    xi = radius_m * grid_angles()
    return xi, 0.75 * load_N / half_length_m**3 * (half_length_m**2 - xi**2)


def rough(
    load_N: FloatArray,
    half_length_m: FloatArray,
    radius_m: float,
    height_m: float,
    tread_stiffness_N_m2: float,
) -> ComplexArray:
    """What a road of Gaussian heights adds to the parabola (Greenwood and Williamson 1966).

    A tread of independent springs k_t meets asperities of rms height h. Where it would lie a depth
    d = p / k_t below the mean plane it presses, on average, with

        k_t E[max(d - z, 0)] = k_t h (g(d / h) + d / h G(d / h))       g, G: Gauss's law, its sum

    Beside the edge the tread's distance from the road goes on as the parabola does.
    """
    flat = _on_grid(load_N, half_length_m, radius_m)[1]
    depth = flat / (tread_stiffness_N_m2 * height_m)
    bell_curve = np.exp(-0.5 * depth**2) / math.sqrt(2.0 * math.pi)
    pressed = tread_stiffness_N_m2 * height_m * (bell_curve + depth * ndtr(depth))
    # sampled alike, the two differ by nothing where the rounding is narrower than the grid
    return to_modes(pressed - np.maximum(flat, 0.0))


# ---- Water that the tread runs onto: Reynolds' wedge ahead of the entry edge.
#
# Tread and road run together at v, and the gap ahead of the edge is h = h_0 + s^2 / 2R, filled up
# to the depth D. The film h_0 goes through the patch, so that (Grubin's inlet)
#
#     -dp/ds = 12 eta v (h - h_0) / h^3,      p = 0 where h = D
#     p(s) = 12 eta v sqrt(2R) h_0^-3/2 (I(t_D) - I(t)),  tan t = s / sqrt(2R h_0),
#     I(t) = t / 8 - sin(4t) / 32
#
# Per width; the tread presses on water over the width b. At the edge p is what the water holds, and
# the tread touches the road only where the pressure of the contact is above it.


def filled_wedge(
    speed_m_s: FloatArray, depth_m: FloatArray, width_m: float, film_m: float, radius_m: float
) -> tuple[FloatArray, FloatArray]:
    """(Pressure [N/m] per unit of I, the angle t [rad] up to which the gap is filled), columns."""
    viscosity = 1.0e-3  # of water at 20 degC [Pa s]
    size = 12.0 * viscosity * width_m * speed_m_s * math.sqrt(2.0 * radius_m) / film_m**1.5
    return size, np.arctan(np.sqrt(np.maximum(depth_m / film_m - 1.0, 0.0)))


def _wedge_integral(angle: FloatArray) -> FloatArray:
    return np.asarray(angle / 8.0 - np.sin(4.0 * angle) / 32.0)


def dry_length(
    load_N: FloatArray, half_length_m: FloatArray, size_N_m: FloatArray, filled_rad: FloatArray
) -> FloatArray:
    """Length [m] of the patch that touches the road behind a `filled_wedge`, column.

    ModelError: at this speed the water carries the tire.
    """
    left = 1.0 - size_N_m * _wedge_integral(filled_rad) / (0.75 * load_N / half_length_m)
    if not np.all(left > 0.0):
        raise ModelError(
            "the tire floats: the water's pressure at the entry edge is that of the patch's middle",
            allowed="a speed below that of full aquaplaning is allowed",
            do="lower the speed or water_wedge.width_m, or raise water_wedge.film_mm",
        )
    return np.asarray(half_length_m * (1.0 + np.sqrt(left)))


def water(
    load_N: FloatArray,
    half_length_m: FloatArray,
    radius_m: float,
    size_N_m: FloatArray,
    filled_rad: FloatArray,
    film_m: float,
) -> ComplexArray:
    """What a `filled_wedge` adds to the parabola: the pressure ahead of it, and that on the part of
    the patch that it holds off the road. ModelError as `dry_length`.
    """
    L = half_length_m
    touches = dry_length(load_N, L, size_N_m, filled_rad) - L
    xi, flat = _on_grid(load_N, L, radius_m)
    scale = math.sqrt(2.0 * radius_m * film_m)
    angle = np.arctan(np.maximum(-L - xi, 0.0) / scale)
    lift = size_N_m * (_wedge_integral(filled_rad) - _wedge_integral(angle))
    wet = np.where(xi < 0.0, np.maximum(lift - np.maximum(flat, 0.0), 0.0), 0.0)
    # the slope jumps where the water begins, at the entry edge, and where the tread touches
    inlet = size_N_m * (np.sin(filled_rad) * np.cos(filled_rad) ** 2) ** 2 / scale
    begin, slope = -L - scale * np.tan(filled_rad), 1.5 * load_N / L**3
    kinks = ((begin, inlet), (-L, -slope * L), (-touches, slope * touches))
    return _kinked(wet, kinks, radius_m)


def _kinked(
    values: FloatArray, kinks: Sequence[tuple[FloatArray, FloatArray]], radius_m: float
) -> ComplexArray:
    """Modes of values on the grid (n, GRID) whose slope jumps: (place [m], jump) columns.

    What jumps is taken out of the samples and put back in closed form: as samples it would be off
    by what the grid's points happen to see of it.
    """
    around = 2.0 * math.pi * radius_m
    spectrum = np.append(around / 12.0, -(radius_m**2) / (around * _N**2))
    modes = np.zeros((values.shape[0], MODES), np.complex128)
    for place, jump in kinks:
        away = np.abs((radius_m * grid_angles() - place + 0.5 * around) % around - 0.5 * around)
        values = values - jump * (0.5 * away - away**2 / (2.0 * around))
        modes = modes + jump * spectrum * powers(-place / radius_m)
    return np.asarray(modes + to_modes(values))


# ---- Brush friction with adhesion and slip on a parabolic pressure (P2 3, (13)-(18), with the
# errata).
#
# tau = sigma C_x (xi + L) up to f_s p at x_s, then sign(sigma) f_d p to the exit edge; braking > 0,
# towards the exit. By (15) x_s = L - |sigma| C_x / (gamma f_s), and with C_x = 2 gamma L f_s
# (17), of
# which a tread may have a multiple, L (1 - 2 |sigma|). On the beam the traction acts as a couple
# with
# the lever h: p_fri = h d tau / d xi, with the jump of tau at x_s.


#: friction of a tread that adheres and of one that slides [N/N]; by (17) C_x is proportional to the
#: first: doubling it doubles the traction of the same slip as far as x_s, which stays
STATIC_FRICTION = 0.8
SLIDING_FRICTION = 0.6


@dataclass(frozen=True)
class Grip:
    """What holds a tread on the road: friction that adheres and that slides [N/N].

    `stiffness_ratio`: the tread's stiffness over that of P2 (17), above 1 if all slides before
    slip 1.
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
    # piece: the terms at -L, x_s and L, by powers of 1 / q
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
    slip_angle_rad: float | FloatArray,
    camber_rad: float | FloatArray,
    radius_m: float,
    grip: Grip = Grip(),
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(F_x [N], positive in braking, F_y [N], M_z [N m], which turns the slip angle back).

    Columns (n, 1) in and out. P2's bristles in the plane of the road. A bristle that adheres is
    carried along by sigma and tan(slip angle) per length from the entry edge. Camber carries it
    sideways, because the wheel's path on the road is bent by sin(camber) / R:

        d = ((xi + L) sigma, (xi + L) tan(slip angle) + sin(camber) (L^2 - xi^2) / (2 R))

    with C_x both ways up to f_s p; from there to the exit edge f_d p against the motion. The
    carcass is taken to be stiff sideways. Without angles it is P2 (13), summed.
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
