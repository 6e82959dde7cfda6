"""Fourier coefficients of the shapes that a contact pressure is made of.

Every function returns P_n = (1 / C) int p(xi) exp(-i q_n xi) d xi, shape (n, K) from columns of
shape (n, 1), in closed form: sampling the parabola on a grid would miss its slope jump at the edges
by 1e-4. C = 2 pi R. P_0 C is the force.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.special import spherical_jn

from tirelog.data.bounds import FORM_DEGREES
from tirelog.physics.spectral import MODES, ComplexArray, powers
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


def legendre_modes(half_length_m: FloatArray, radius_m: float) -> FloatArray:
    """Spherical Bessel functions j_n(q L), n = 1 ... 14, (14, n, K).

    (-i)^n j_n are the modes of the Legendre polynomial P_n(xi / L) on the patch, times C / (2 L).
    Beyond x = q L = 10 they follow from each other, j_(n+1) = (2 n + 1) / x j_n - j_(n-1), in a
    tenth of the time.
    """
    x = half_length_m / radius_m * np.arange(MODES)
    near = min(int(np.ceil(10.0 * radius_m / half_length_m.min())) + 1, MODES)
    degrees = np.arange(1, FORM_DEGREES + 1)
    waves = np.empty((FORM_DEGREES, *x.shape))
    waves[..., :near] = spherical_jn(degrees[:, None, None], x[:, :near])
    per_x, turn = 1.0 / x[:, near:], powers(half_length_m / radius_m)[:, near:]
    before = turn.imag * per_x
    own = before * per_x - turn.real * per_x
    for n in degrees:
        waves[n - 1, :, near:] = own
        before, own = own, (2 * n + 1) * per_x * own - before
    return waves


def bell(
    height: FloatArray, centre_m: FloatArray, width_m: FloatArray, radius_m: float
) -> ComplexArray:
    """height exp(-((xi - centre) / width)^2 / 2)."""
    q = np.arange(MODES) / radius_m
    size = height * width_m * (np.sqrt(2.0 * np.pi) / (2.0 * np.pi * radius_m))
    bell: ComplexArray = (size * np.exp(-0.5 * (q * width_m) ** 2)) * powers(-centre_m / radius_m)
    return bell


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
