"""The beam under a parabolic pressure by its four roots; the package solves it in Fourier modes."""

import numpy as np

from tirelog.vocabulary.arrays import FloatArray


def exact_displacement(
    xi_m: FloatArray,
    *,
    load_N: float,
    half_length_m: float,
    circumference_m: float,
    flexural_stiffness_N_m2: float,
    foundation_stiffness_N_m2: float,
    line_mass_kg_m: float,
    speed_m_s: float,
    damping_rate_1_s: float = 0.0,
    derivative: int = 0,
) -> FloatArray:
    """Exact displacement w(xi) [m], or a derivative, under the parabolic pressure P2 (12), (m,)."""
    EJ, k, mu, c = flexural_stiffness_N_m2, foundation_stiffness_N_m2, line_mass_kg_m, speed_m_s
    roots = np.roots([EJ, 0.0, mu * c**2, 2.0 * mu * damping_rate_1_s * c, k])
    gamma, L = 0.75 * load_N / half_length_m**3, half_length_m
    total = np.zeros(xi_m.shape, dtype=np.complex128)
    turns = 1 + int(np.ceil(40.0 / (np.abs(roots.real).min() * circumference_m)))
    for xi in (xi_m + image * circumference_m for image in range(-turns, turns + 1)):
        for r in roots:
            slope = 4.0 * EJ * r**3 + 2.0 * mu * c**2 * r + 2.0 * mu * damping_rate_1_s * c
            # a root that decays with xi is excited by the load already passed, [-L, xi]; one that
            # grows by the load to come, [xi, L]
            reached = xi > -L if r.real < 0 else xi < L
            x = xi[reached]
            start = np.full_like(x, -L if r.real < 0 else L)
            total[reached] += (
                gamma
                * r**derivative
                / slope
                * (_moment(r, x, np.clip(x, -L, L), L) - _moment(r, x, start, L))
            )
    return total.real


def _moment(r: complex, xi: FloatArray, s: FloatArray, L: float) -> FloatArray:
    """The antiderivative of exp(r (xi - s)) (L^2 - s^2) by s."""
    moment: FloatArray = -np.exp(r * (xi - s)) * ((L**2 - s**2) / r - 2.0 * s / r**2 - 2.0 / r**3)
    return moment
