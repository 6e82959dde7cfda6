"""The physical shape of one patch passage in the strain.

A carcass pressed one-sidedly onto a flat road through its tread.

    EdgeShape (a handful of numbers)
        --spectrum over the tire's own wave numbers--> strain and its derivatives on a grid of xi

One family holds both carcasses of the papers. A bending line with tension on a foundation, EJ w''''
- T w'' + k w = p, is P1's and P2's beam if T = -mu c^2 (errata: alpha^2 = -tension / 2), and
P3's ring if T is the hoop tension p0 b R. The contact pressure is what tread springs give on a
flat road, p = k_t (delta - xi^2 / (2 R) - w) and zero outside the patch: for soft tread it is the
parabola of P2 (12) on a beam, for stiff tread it is the one-sided contact of P3. So the contact
length needs no choice of a carcass.

The pressure is a series in (1 - x^2) P'_{n+1}(x), x = xi / L, which vanishes at the edges; tested
with Legendre polynomials the contact condition is a small linear system for a *given* length (the
approach delta falls out of the equation that is not used). Lengths in m. xi grows in the direction
in which tread passes: entry edge at -L, exit edge at +L, so xi grows with time.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tirelog.data.setup import FORM_BELLS, FORM_WAVES
from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray

# ---- Compiled: what the pressure's terms are at each wave number.
#
# A Legendre polynomial's transform over the patch is 2 i^n j_n(z), z = kappa L, a spherical Bessel
# function, so nothing is integrated numerically.


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


@compiled
def spherical_bessel(z: float, out: FloatArray) -> None:
    """Fills `out` (ORDERS,) with the spherical Bessel functions j_0 .. j_(ORDERS - 1) of `z` > 0.

    By their recurrence (DLMF 10.51.1), upwards if that is stable, else downwards (Miller).
    """
    by_z = 1.0 / z
    first = np.sin(z) * by_z
    second = (first - np.cos(z)) * by_z
    if z > _STABLE:
        out[0], out[1] = first, second
        for n in range(1, ORDERS - 1):
            out[n + 1] = (2 * n + 1) * by_z * out[n] - out[n - 1]
        return
    above, here = 0.0, 1e-250
    for n in range(_DEEP, 0, -1):
        above, here = here, (2 * n + 1) * by_z * here - above
        if n <= ORDERS:
            out[n - 1] = here
    # scaled by whichever of the first two is not near a zero of its own
    scale = first / out[0] if abs(first) > abs(second) else second / out[1]
    for n in range(ORDERS):
        out[n] *= scale


@compiled
def transforms(kappa: FloatArray, L: float, waves: FloatArray, slopes: FloatArray) -> None:
    """Fills `waves` and `slopes`: transforms at each wave number, and their derivatives by L.

    `kappa` (n,) [1/m], `L` [m]. Derivatives of Bessel functions by DLMF 10.51.2. Rows: tests
    P_2, P_4, ... | terms (1 - x^2) P'_(n+1) | x (1 - x^2), P_5 - P_3, P_1 without their -1j, shape
    (2 TERMS + 3, n).
    """
    j, by_z = np.empty(ORDERS), np.empty(ORDERS - 1)
    for k in range(kappa.size):
        spherical_bessel(kappa[k] * L, j)
        by_z[0] = -j[1]
        for n in range(1, ORDERS - 1):
            by_z[n] = (n * j[n - 1] - (n + 1) * j[n + 1]) / (2 * n + 1)
        for values, source, factor in ((waves, j, 1.0), (slopes, by_z, kappa[k])):
            sign = 2.0 * factor
            for m in range(TERMS):
                n = 2 * m
                values[m, k] = -sign * source[n + 2]
                # (1 - x^2) P'_(n+1) = (n+1)(n+2)/(2n+3) (P_n - P_(n+2))
                size = (n + 1.0) * (n + 2.0) / (2.0 * n + 3.0)
                values[TERMS + m, k] = sign * size * (source[n] + source[n + 2])
                sign = -sign
            values[2 * TERMS, k] = 0.8 * factor * (source[1] + source[3])
            values[2 * TERMS + 1, k] = 2.0 * factor * (source[3] + source[5])
            values[2 * TERMS + 2, k] = 2.0 * factor * source[1]


ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class EdgeShape:
    """The form of a passage; its height and offset are linear and kept apart.

    half_length_m     L
    bending_length_m  (EJ / k)^(1/4)
    tension           T / sqrt(EJ k), above -2 (the critical speed); negative for a beam at speed,
                      positive for a ring under pressure
    tread             log(1 + k_t / k): 0 is P2's parabola
    damping           d of the term d (EJ / k)^(1/4) k w': odd about the patch centre, positive as
                      in the errata's equation
    tilt              p (1 - tilt xi / L): positive is heavier towards the entry
    """

    half_length_m: float
    bending_length_m: float
    tension: float = 0.0
    tread: float = 0.0
    damping: float = 0.0
    tilt: float = 0.0

    def array(self) -> FloatArray:
        """The parameters in the order of the fields, shape (6,)."""
        return np.array([getattr(self, field.name) for field in fields(self)])

    @classmethod
    def of(cls, values: FloatArray) -> EdgeShape:
        return cls(*(float(v) for v in values))


#: what a parameter may be, in the order and units of the fields: lengths in m, the rest are ratios;
#: the tension stays above the critical speed's -2. A form at a bound is unclear (`EdgeForm`)
LOWEST = np.array([0.008, 0.004, -1.97, -0.2, -1.5, -1.5])
HIGHEST = np.array([0.30, 0.30, 60.0, 9.0, 1.5, 1.5])


#: logarithm of the waves in a turn about which a tire's own stiffness bends; numbers of its form
BELLS = np.linspace(np.log(FORM_WAVES[0]), np.log(FORM_WAVES[1]), FORM_BELLS)
OWN_FORM = SHAPES + BELLS.size


@lru_cache(maxsize=1)
def _mass() -> FloatArray:
    """<P_(2i + 2), (1 - x^2) P'_(2n + 1)> over the patch, shape (TERMS, TERMS)."""
    order = 2.0 * np.arange(TERMS)
    # (1 - x^2) P'_{n+1} = (n+1)(n+2)/(2n+3) (P_n - P_{n+2}), and <P_n, P_n> = 2 / (2n + 1)
    factor = (order + 1.0) * (order + 2.0) / (2.0 * order + 3.0)
    return np.asarray(
        np.diag((2.0 * factor / (2.0 * order + 1.0))[1:], 1)
        - np.diag(2.0 * factor / (2.0 * order + 5.0))
    )


#: rows of `transforms` that are shapes of the tire's own pressure: even ones, then odd ones
_OWN_WAVES = [*range(TERMS + 1, 2 * TERMS), 0, 2 * TERMS + 1, 2 * TERMS + 2]


@lru_cache(maxsize=1)
def _own_sizes() -> FloatArray:
    """Mean pressure (2/3 of the parabola's top) of each own shape over its wave's, (SHAPES, 1)."""
    n = np.arange(1.0, TERMS)
    terms = (4.0 * n + 3.0) / ((2.0 * n + 1.0) * (2.0 * n + 2.0))
    return np.asarray(np.r_[terms, np.ones(SHAPES - terms.size)][:, None] * (2.0 / 3.0))


class EdgeFamily:
    """The family on one tire: wave numbers n / R up to `highest_1_m`, n = 1, 2, ...

    `own` (OWN_FORM,): the tire's own form, SHAPES of pressure in mean pressures and bells of what
    its stiffness (bending and foundation) has more, over the logarithm of the waves in a turn.
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

    def spectrum(self, shape: EdgeShape) -> ComplexArray:
        """Complex amplitude of the strain of an outer grating at each wave number, shape (n,).

        The height is of the order of one.
        """
        return self.jacobian(shape)[:, 0]

    def up_to(self, share: float) -> EdgeFamily:
        """The same up to this `share` of the highest wave number."""
        return EdgeFamily(self.radius_m, share * self.highest_1_m, self.own)

    def jacobian(self, shape: EdgeShape) -> ComplexArray:
        """The spectrum and its derivatives by the six parameters, shape (n, 7).

        In the order of the fields.
        """
        return self._spectra(shape)[:, :7]

    def by_form(self, shape: EdgeShape) -> ComplexArray:
        """As `jacobian`, and then the derivatives by the tire's own form, (n, 7 + OWN_FORM)."""
        spectra, square = self._spectra(shape), self.kappa_1_m**2 * shape.bending_length_m**2
        static = square**2 + 1.0
        softer = -spectra[:, 0] * static / self._stiffness(shape)
        return np.column_stack([spectra, softer[:, None] * self._bells])

    def _spectra(self, shape: EdgeShape) -> ComplexArray:
        """Spectrum, derivatives by the six parameters and by the own shapes, (n, 7 + SHAPES).

        The own pressure and stiffness are no part of the contact that gives the series.
        """
        kappa, L, ell = self.kappa_1_m, shape.half_length_m, shape.bending_length_m
        ratio, reach = np.exp(shape.tread) - 1.0, L / (np.pi * self.radius_m)
        waves, slopes = np.empty((2, 2 * TERMS + 3, kappa.size))
        transforms(kappa, L, waves, slopes)
        tests, terms = waves[:TERMS], waves[TERMS : 2 * TERMS]
        q = (ell * kappa) ** 2
        stiffness = (q + shape.tension) * q + 1.0
        by_ell = (4.0 * q + 2.0 * shape.tension) * q / ell
        weight = reach / stiffness
        # the contact condition, and what moves its solution
        inverse = np.linalg.inv(_mass() + ratio * (tests * weight) @ terms.T)
        pressure = inverse[:, 0] * (-4.0 / 15.0)  # <P_2, -x^2>
        top, even, even_slope = pressure[0], pressure @ terms, pressure @ slopes[TERMS : 2 * TERMS]
        loaded = weight * even
        softer = ratio * loaded / stiffness
        changes = -ratio * (loaded / L + weight * even_slope), softer * by_ell, softer * q
        load = tests @ np.stack([*changes, -(1.0 + ratio) * loaded], axis=1)
        load[:, 0] -= ratio * slopes[:TERMS] @ loaded
        moved = inverse @ load
        # the tire's own pressure; the tilt is carried by the parabola of the same load
        own = waves[_OWN_WAVES] * _own_sizes()
        sizes = self.own[:SHAPES] * _own_sizes()[:, 0]
        added, added_slope = (
            sizes[:TERMS] @ part[_OWN_WAVES[:TERMS]]
            + 1j * (sizes[TERMS:] @ part[2 * TERMS + 1 :] + shape.tilt * part[2 * TERMS])
            for part in (waves, slopes)
        )
        compliance = 1.0 / self._stiffness(shape)
        # height: a curvature of the order of 1 / bending length^2 is divided out, so that heights
        # stay comparable while a fit walks
        response = -(kappa**2) * ell * reach * compliance
        spectrum = response * (even + top * added)
        by_ell = by_ell + 4.0 * self._stiffer * q**2 / ell + 1j * shape.damping * kappa
        out = np.empty((7 + SHAPES, kappa.size), complex)
        out[0] = spectrum
        out[1:5] = response * (moved.T @ terms + np.multiply.outer(moved[0], added))
        out[1] += response * (even_slope + top * added_slope) + spectrum / L
        out[2] += spectrum * (1.0 / ell - by_ell * compliance)
        out[3] -= spectrum * q * compliance
        out[5] = spectrum * (-1j * ell) * kappa * compliance
        out[6] = response * (1j * top) * waves[2 * TERMS]
        out[7:] = (top * response) * own
        out[7 + TERMS :] *= 1j
        return out.T

    def _stiffness(self, shape: EdgeShape) -> ComplexArray:
        """What resists a displacement at each wave number, over the foundation, shape (n,)."""
        ell, square = shape.bending_length_m, self.kappa_1_m**2 * shape.bending_length_m**2
        static = (1.0 + self._stiffer) * (square**2 + 1.0)
        lost = shape.damping * self.kappa_1_m * ell
        return np.asarray(static + shape.tension * square + 1j * lost, complex)

    def receptance(self, shape: EdgeShape) -> ComplexArray:
        """Strain per load at each wave number, shape (n,).

        A load's transform along xi times this is a spectrum.
        """
        height = -(self.kappa_1_m**2) * shape.bending_length_m / (np.pi * self.radius_m)
        return np.asarray(height / self._stiffness(shape), complex)

    def second_by_length(self, shape: EdgeShape, spectra: ComplexArray) -> ComplexArray:
        """The second derivative of the spectrum by the half length, (n,); `spectra`: `jacobian`."""
        nudge = 1e-3 * shape.half_length_m
        longer = replace(shape, half_length_m=shape.half_length_m + nudge)
        return np.asarray((self.jacobian(longer)[:, 1] - spectra[:, 1]) / nudge)

    def basis(self, xi_m: FloatArray) -> ComplexArray:
        """exp(1j kappa xi), shape (len(xi), n).

        The real part of basis @ spectrum is the strain at `xi_m`.
        """
        return np.asarray(np.exp(1j * np.multiply.outer(xi_m, self.kappa_1_m)))

    def on_grid(
        self, spectra: ComplexArray, points: int, half_window_m: float, finer: int = 1
    ) -> tuple[FloatArray, FloatArray]:
        """Waves of `spectra` (n, c) on an even grid: abscissae (g,), waves (g, c).

        The grid has `points` x `finer` per revolution and reaches to +-`half_window_m`.

        What straight lines between every `finer`-th point take off on average, sinc^2(kappa step
        / 2), is made up for.
        """
        kept = min(self.kappa_1_m.size, points // 2)
        straightened = np.sinc(np.arange(1, kept + 1) / points) ** 2
        points *= finer
        padded = np.zeros((spectra.shape[1], points // 2 + 1), complex)
        padded[:, 1 : kept + 1] = spectra[:kept].T * (0.5 * points / straightened)
        step = 2.0 * np.pi * self.radius_m / points
        reach = min(int(np.ceil(half_window_m / step)), points // 2 - 1)
        values = np.fft.irfft(padded, points, axis=1)
        around = np.concatenate([values[:, -reach:], values[:, : reach + 1]], axis=1)
        return np.arange(-reach, reach + 1.0) * step, np.ascontiguousarray(around.T)
