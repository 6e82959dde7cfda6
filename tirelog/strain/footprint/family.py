"""The physical shape of one patch passage in the strain.

A carcass pressed one-sidedly onto a flat road through its tread.

    a form (a handful of numbers)
        --spectrum over the tire's own wave numbers--> strain and its derivatives on a grid of xi

One family holds both carcasses of the papers. It is a bending line with tension on a foundation: EJ
w'''' - T w'' + k w = p. This is P1's and P2's beam if T = -mu c^2 (errata: alpha^2 = -tension / 2),
and P3's ring if T is the hoop tension p0 b R. The contact pressure is what tread springs give on a
flat road, p = k_t (delta - xi^2 / (2 R) - w) and zero outside the patch: for soft tread it is the
parabola of P2 (12) on a beam, for stiff tread it is the one-sided contact of P3. So the contact
length needs no choice of a carcass.

The pressure is a series in (1 - x^2) P'_{n+1}(x), x = xi / L, which vanishes at the edges. Tested
with Legendre polynomials, the contact condition is a small linear system for a *given* length. The
approach delta follows from the equation that is not used. Lengths in m. xi grows in the direction
in which tread passes: entry edge at -L, exit edge at +L, so xi grows with time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.data.setup import FORM_BELLS, FORM_WAVES
from tirelog.vocabulary.arrays import FloatArray

ComplexArray = NDArray[np.complex128]

# The form of a passage, (6,); its height and offset are linear and kept apart.
#
#     HALF_LENGTH  L [m]
#     BENDING      (EJ / k)^(1/4) [m]
#     TENSION      T / sqrt(EJ k), above -2 (the critical speed); negative for a beam at speed,
#                  positive for a ring under pressure
#     TREAD        log(1 + k_t / k): 0 is P2's parabola
#     DAMPING      d of the term d (EJ / k)^(1/4) k w': odd about the patch centre, positive as in
#                  the errata's equation
#     TILT         p (1 - tilt xi / L): positive is heavier towards the entry
#: what a parameter may be, in their order and units: lengths in m, the rest are ratios;
#: the tension stays above the critical speed's -2. A form at a bound is unclear (`EdgeForm`)
LOWEST = np.array([0.008, 0.004, -1.97, -0.2, -1.5, -1.5])
HIGHEST = np.array([0.30, 0.30, 60.0, 9.0, 1.5, 1.5])
HALF_LENGTH, BENDING, TENSION, TREAD, DAMPING, TILT = range(LOWEST.size)


# ---- The spectrum of a patch passage and its derivatives.
#
# By the form's six parameters and the tire's own pressure.
#
#     wave numbers, form
#         --Legendre transforms = spherical Bessel functions j_n(kappa L)-->
#         contact conditions (TERMS x TERMS)
#         --solved--> pressure series, and the tire's own --response-->
#         spectrum and slopes, (n, 7 + SHAPES)
#
# A Legendre polynomial's transform over the patch is 2 i^n j_n(z), z = kappa L, so nothing is
# integrated numerically.


#: terms of the pressure series, orders 0, 2, ... 2 (TERMS - 1); twice as many take four times as
#: long per contact condition
TERMS = 7
#: shapes of the tire's own pressure: the terms of the series but the first, the step P_2, and of
#: odd ones P_3 - P_5 and the step P_1
SHAPES = TERMS - 1 + 3
#: orders of the Bessel functions: up to that of the last test, and one more for its slope
ORDERS = 2 * TERMS + 2
#: start of a downward recurrence (order), and the argument above which the upward one is stable;
#: twice as deep a start takes twice as long for the same digits
_DEEP, _STABLE = 44, 16.0


def _series() -> tuple[FloatArray, FloatArray, FloatArray]:
    """What the pressure series has for n = 0, 2, ... 2 (TERMS - 1).

    factor  (TERMS,): (1 - x^2) P'_(n+1) = factor (P_n - P_(n+2))
    mass    (TERMS, TERMS): <P_(2i + 2), (1 - x^2) P'_(2n + 1)>, with <P_n, P_n> = 2 / (2n + 1)
    over    (SHAPES,): a shape's mean pressure, 2/3 of the parabola's top, over that of its wave
    """
    n = 2.0 * np.arange(TERMS)
    factor = (n + 1.0) * (n + 2.0) / (2.0 * n + 3.0)
    above, below = 2.0 * factor / (2.0 * n + 1.0), 2.0 * factor / (2.0 * n + 5.0)
    over = 2.0 / 3.0 * np.append(1.0 / factor[1:], np.ones(3))
    return factor, np.diag(above[1:], 1) - np.diag(below), over


_FACTOR, _MASS, _OVER = _series()


def spherical_bessels(z: FloatArray) -> FloatArray:
    """Spherical Bessel functions j_0 .. j_(ORDERS - 1) of `z` (k, n) > 0, shape (k, ORDERS, n).

    By their recurrence (DLMF 10.51.1), upwards if that is stable, else downwards (Miller).
    """
    first = np.sin(z) / z
    steps = (2.0 * np.arange(_DEEP + 1.0)[:, None, None] + 1.0) / z
    upward = [first, (first - np.cos(z)) / z]
    for step in steps[1 : ORDERS - 1]:
        upward.append(step * upward[-1] - upward[-2])
    downward = [np.zeros_like(z), np.full_like(z, 1e-250)]
    for step in steps[:0:-1]:
        downward.append(step * downward[-1] - downward[-2])
    found = np.array(downward[: -ORDERS - 1 : -1])
    # scaled by whichever of the first two is not near a zero of its own
    larger = np.abs(upward[0]) > np.abs(upward[1])
    found *= np.where(larger, upward[0], upward[1]) / np.where(larger, found[0], found[1])
    return np.where(z > _STABLE, upward, found).swapaxes(0, 1)


def _transforms(j: FloatArray) -> FloatArray:
    """Waves of tests and terms of the pressure, (k, 2 TERMS + 3, n), of Bessel functions `j`.

    Rows: tests P_2, P_4, ... | terms (1 - x^2) P'_(n+1) | x (1 - x^2), P_5 - P_3, P_1 without
    their -1j.
    """
    sign, even = (2.0 * (-1.0) ** np.arange(TERMS))[:, None], j[:, : 2 * TERMS + 1 : 2]
    terms = sign * _FACTOR[:, None] * (even[:, :-1] + even[:, 1:])
    odd = np.array([[0.8, 0.8, 0.0], [0.0, 2.0, 2.0], [2.0, 0.0, 0.0]]) @ j[:, 1:6:2]
    return np.concatenate([-sign * even[:, 1:], terms, odd], axis=1)


def form_spectra(
    kappa: FloatArray, radius: float, forms: FloatArray, own: FloatArray, stiffer: FloatArray
) -> ComplexArray:
    """Spectrum of each of the `forms` (k, 6) and its derivatives, (k, n, 7 + SHAPES).

    At the wave numbers `kappa` (n,) [1/m]; `radius` [m]. By the parameters, then by the shapes of
    the tire's own pressure, which has `own` (SHAPES,) of them in mean pressures; `stiffer` (n,):
    what its own stiffness is over bending and foundation, less one.
    Neither is part of the contact that gives the series.
    """
    L, ell, tension, tread, damping, tilt = forms.T[:, :, None]
    ratio, j = np.expm1(tread), spherical_bessels(kappa * L)
    # derivatives of Bessel functions by DLMF 10.51.2
    order = np.arange(1.0, ORDERS - 1)[:, None]
    by_z = (order * j[:, :-2] - (order + 1.0) * j[:, 2:]) / (2.0 * order + 1.0)
    by_z = np.concatenate([-j[:, 1:2], by_z], axis=1)
    waves, slopes = _transforms(j), kappa * _transforms(by_z)
    tests, terms, reach = waves[:, :TERMS], waves[:, TERMS : 2 * TERMS], L / (np.pi * radius)
    q = (ell * kappa) ** 2
    stiffness = (q + tension) * q + 1.0
    by_ell = (4.0 * q + 2.0 * tension) * q / ell
    weight = reach / stiffness
    contact = _MASS + (ratio * weight)[:, None] * tests @ terms.swapaxes(1, 2)
    inverse = np.linalg.inv(contact)
    pressure = inverse[:, None, :, 0] * (-4.0 / 15.0)  # <P_2, -x^2>
    even, even_slope = (pressure @ some for some in (terms, slopes[:, TERMS : 2 * TERMS]))
    even, even_slope = even[:, 0], even_slope[:, 0]
    loaded = weight * even
    by_contact = [loaded / L + weight * even_slope, loaded, loaded, loaded]
    by_contact[1] = -loaded * by_ell / stiffness
    by_contact[2] = -loaded * q / stiffness
    load = tests @ np.stack(by_contact, axis=-1)
    load[:, :, :1] += slopes[:, :TERMS] @ loaded[:, :, None]
    moved = inverse @ (load * (np.array([0.0, 0.0, 0.0, -1.0]) - ratio)[:, None])
    places = [*range(TERMS + 1, 2 * TERMS), 0, 2 * TERMS + 1, 2 * TERMS + 2]
    shapes, of_shapes = (_OVER[:, None] * some[:, places] for some in (waves, slopes))
    mine, mine_slope = own[:TERMS] @ shapes[:, :TERMS], own[:TERMS] @ of_shapes[:, :TERMS]
    odd = tilt * waves[:, 2 * TERMS] + own[TERMS:] @ shapes[:, TERMS:]
    odd_slope = tilt * slopes[:, 2 * TERMS] + own[TERMS:] @ of_shapes[:, TERMS:]
    by_ell = by_ell + 4.0 * stiffer * q**2 / ell
    lost = 1j * damping * kappa
    compliance = 1.0 / (stiffness + stiffer * (q**2 + 1.0) + lost * ell)
    # height: a curvature of the order of 1 / bending length^2 is divided out, so that heights
    # stay comparable while a fit walks
    response = -(kappa**2) * ell * reach * compliance
    # the tilt is carried by the parabola of the same load
    top = pressure[:, 0, :1]
    spectrum = response * (even + top * mine + 1j * top * odd)
    by = moved.swapaxes(1, 2) @ terms + moved[:, 0, :, None] * (mine + 1j * odd)[:, None]
    by = response[:, None] * by
    by[:, 0] += response * (even_slope + top * (mine_slope + 1j * odd_slope)) + spectrum / L
    by[:, 1] += spectrum * (1.0 / ell - (by_ell + lost) * compliance)
    by[:, 2] -= spectrum * q * compliance
    by_damping = -1j * kappa * ell * compliance * spectrum
    by_tilt = 1j * top * response * waves[:, 2 * TERMS]
    by_shapes = (top * response)[:, None] * shapes * np.append(np.ones(TERMS), [1j, 1j])[:, None]
    alone = (one[:, None] for one in (by_damping, by_tilt))
    return np.concatenate([spectrum[:, None], by, *alone, by_shapes], axis=1).swapaxes(1, 2)


#: logarithm of the waves in a turn about which a tire's own stiffness bends; numbers of its form
BELLS = np.linspace(np.log(FORM_WAVES[0]), np.log(FORM_WAVES[1]), FORM_BELLS)
OWN_FORM = SHAPES + BELLS.size


class EdgeFamily:
    """The family on one tire: wave numbers n / R up to `highest_1_m`, n = 1, 2, ...

    `own` (OWN_FORM,): the tire's own form. It has SHAPES of pressure, in mean pressures. Bells over
    the logarithm of the waves in a turn are what its stiffness (bending, foundation) has more.
    """

    def __init__(
        self,
        radius_m: float,
        highest_1_m: float,
        own: FloatArray | None = None,
    ) -> None:
        self.radius_m, self.highest_1_m = radius_m, highest_1_m
        self.own: FloatArray = np.zeros(OWN_FORM) if own is None else own
        order = np.arange(1.0, max(int(np.ceil(highest_1_m * radius_m)), 8) + 1)
        self.kappa_1_m: FloatArray = order / radius_m
        waves = np.clip(np.log(order), BELLS[0], BELLS[-1])
        self._bells = np.exp(-0.5 * ((waves[:, None] - BELLS) / (BELLS[1] - BELLS[0])) ** 2)
        self._stiffer = self._bells @ self.own[SHAPES:]

    def with_own(self, own: FloatArray) -> EdgeFamily:
        """The same on a tire of another form, (OWN_FORM,)."""
        return EdgeFamily(self.radius_m, self.highest_1_m, own)

    def up_to(self, share: float) -> EdgeFamily:
        """The same up to this `share` of the highest wave number."""
        return EdgeFamily(self.radius_m, share * self.highest_1_m, self.own)

    def spectra(self, forms: FloatArray) -> ComplexArray:
        """Complex amplitudes of an outer grating's strain, (k, n, 7 + OWN_FORM) of `forms` (k, 6).

        At each wave number, height of the order of one. Then the derivatives by the six parameters
        and by the tire's own form.
        """
        own = self.own[:SHAPES]
        spectra = form_spectra(self.kappa_1_m, self.radius_m, forms, own, self._stiffer)
        static = (self.kappa_1_m * forms[:, BENDING, None]) ** 4 + 1.0
        softer = -spectra[:, :, 0] * static / self._stiffness(forms)
        return np.concatenate([spectra, softer[:, :, None] * self._bells], axis=2)

    def _stiffness(self, forms: FloatArray) -> ComplexArray:
        """What resists a displacement at each wave number, over the foundation, (k, n)."""
        wave = self.kappa_1_m * forms[:, BENDING, None]
        static = (1.0 + self._stiffer) * (wave**4 + 1.0)
        lost = 1j * forms[:, DAMPING, None] * wave
        return np.asarray(static + forms[:, TENSION, None] * wave**2 + lost, complex)

    def receptance(self, forms: FloatArray) -> ComplexArray:
        """Strain per load at each wave number, shape (k, n).

        A load's transform along xi times this is a spectrum.
        """
        height = -(self.kappa_1_m**2) * forms[:, BENDING, None] / (np.pi * self.radius_m)
        return np.asarray(height / self._stiffness(forms), complex)

    def on_grid(
        self, spectra: ComplexArray, points: int, half_window_m: float
    ) -> tuple[FloatArray, FloatArray]:
        """Waves of `spectra` (n, c) on an even grid: abscissae (g,), waves (g, c).

        The grid has `points` per revolution and reaches to +-`half_window_m`. What straight lines
        between its points take off on average, sinc^2(kappa step / 2), is made up for.
        """
        kept = min(self.kappa_1_m.size, points // 2)
        straightened = np.sinc(np.arange(1, kept + 1) / points) ** 2
        padded = np.zeros((spectra.shape[1], points // 2 + 1), complex)
        padded[:, 1 : kept + 1] = spectra[:kept].T * (0.5 * points / straightened)
        step = 2.0 * np.pi * self.radius_m / points
        reach = min(int(np.ceil(half_window_m / step)), points // 2 - 1)
        values = np.fft.irfft(padded, points, axis=1)
        around = np.concatenate([values[:, -reach:], values[:, : reach + 1]], axis=1)
        return np.arange(-reach, reach + 1.0) * step, np.ascontiguousarray(around.T)
