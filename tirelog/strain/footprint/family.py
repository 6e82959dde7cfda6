"""The physical shape of one patch passage in the strain.

A carcass pressed one-sidedly onto a flat road through its tread.

    EdgeShape (a handful of numbers)
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

from dataclasses import dataclass, fields, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from tirelog.data.setup import FORM_BELLS, FORM_WAVES
from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray

# ---- Compiled: the spectrum of a patch passage and its derivatives.
#
# By the form's six parameters and the tire's own pressure (the equations of `family`).
#
#     wave numbers, EdgeShape
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
def inverted(matrix: FloatArray) -> FloatArray:
    """The inverse of a small square `matrix`, which is overwritten.

    By elimination with row pivots.
    """
    size = matrix.shape[0]
    inverse = np.zeros((size, size))
    for k in range(size):
        inverse[k, k] = 1.0
    for k in range(size):
        top = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[top, k]):
                top = i
        pivot = 1.0 / matrix[top, k]
        for j in range(size):
            here, there = matrix[k, j], inverse[k, j]
            matrix[k, j], inverse[k, j] = pivot * matrix[top, j], pivot * inverse[top, j]
            if top != k:
                matrix[top, j], inverse[top, j] = here, there
        for i in range(size):
            factor = matrix[i, k]
            if i != k and factor != 0.0:
                for j in range(size):
                    matrix[i, j] -= factor * matrix[k, j]
                    inverse[i, j] -= factor * inverse[k, j]
    return inverse


@compiled
def _transforms(kappa: FloatArray, L: float, waves: FloatArray, slopes: FloatArray) -> None:
    """Fills `waves` and `slopes`: transforms at each wave number, and their derivatives by L.

    `kappa` (n,) [1/m], `L` [m]. Derivatives of Bessel functions by DLMF 10.51.2. Columns: tests
    P_2, P_4, ... | terms (1 - x^2) P'_(n+1) | x (1 - x^2), P_5 - P_3, P_1 without their -1j, shape
    (n, 2 TERMS + 3).
    """
    j, by_z = np.empty(ORDERS), np.empty(ORDERS - 1)
    for k in range(kappa.size):
        spherical_bessel(kappa[k] * L, j)
        by_z[0] = -j[1]
        for n in range(1, ORDERS - 1):
            by_z[n] = (n * j[n - 1] - (n + 1) * j[n + 1]) / (2 * n + 1)
        for values, source, factor in ((waves[k], j, 1.0), (slopes[k], by_z, kappa[k])):
            sign = factor
            for m in range(TERMS):
                n = 2 * m
                values[m] = -2.0 * sign * source[n + 2]
                # (1 - x^2) P'_(n+1) = (n+1)(n+2)/(2n+3) (P_n - P_(n+2))
                values[TERMS + m] = (
                    2.0
                    * sign
                    * (n + 1.0)
                    * (n + 2.0)
                    / (2.0 * n + 3.0)
                    * (source[n] + source[n + 2])
                )
                sign = -sign
            values[2 * TERMS] = 0.8 * factor * (source[1] + source[3])
            values[2 * TERMS + 1] = 2.0 * factor * (source[3] + source[5])
            values[2 * TERMS + 2] = 2.0 * factor * source[1]


@compiled
def form_spectra(
    kappa: FloatArray,
    radius: float,
    shape: FloatArray,
    mass: FloatArray,
    own: FloatArray,
    stiffer: FloatArray,
) -> NDArray[np.complex128]:
    """Spectrum of `shape` (the fields of EdgeShape) and its derivatives, (n, 7 + SHAPES).

    At the wave numbers `kappa` (n,) [1/m]; `radius` [m]; `mass` (TERMS, TERMS): <test, term>. The
    parameters are an axis that fits step along, in the order of the fields, so they are counted and
    not named. Behind them come the shapes of the tire's own pressure, which has `own` (SHAPES,) of
    them in mean pressures; `stiffer` (n,): what its own stiffness is over bending and foundation,
    less one.
    Neither is part of the contact that gives the series.
    """
    L, ell, tension, ratio, damping, tilt = (
        shape[0],
        shape[1],
        shape[2],
        np.exp(shape[3]) - 1.0,
        shape[4],
        shape[5],
    )
    count = kappa.size
    waves, slopes = np.empty((count, 2 * TERMS + 3)), np.empty((count, 2 * TERMS + 3))
    _transforms(kappa, L, waves, slopes)
    reach = L / (np.pi * radius)
    stiffness, by_ell, by_tension = np.empty(count), np.empty(count), np.empty(count)
    contact = mass.copy()
    for k in range(count):
        q = (ell * kappa[k]) ** 2
        by_ell[k], by_tension[k] = (4.0 * q + 2.0 * tension) * q / ell, q
        stiffness[k] = (q + tension) * q + 1.0
        for i in range(TERMS):
            test = ratio * reach / stiffness[k] * waves[k, i]
            for n in range(TERMS):
                contact[i, n] += test * waves[k, TERMS + n]
    inverse = inverted(contact)
    pressure, load = np.empty(TERMS), np.zeros((TERMS, 4))
    for n in range(TERMS):
        pressure[n] = inverse[n, 0] * (-4.0 / 15.0)  # <P_2, -x^2>
    even, even_slope = np.zeros(count), np.zeros(count)
    for k in range(count):
        for n in range(TERMS):
            even[k] += waves[k, TERMS + n] * pressure[n]
            even_slope[k] += slopes[k, TERMS + n] * pressure[n]
        weight = reach / stiffness[k]
        loaded = weight * even[k]
        for i in range(TERMS):
            test = waves[k, i]
            load[i, 0] -= ratio * (
                test * (loaded / L + weight * even_slope[k]) + slopes[k, i] * loaded
            )
            load[i, 1] += ratio * test * loaded * by_ell[k] / stiffness[k]
            load[i, 2] += ratio * test * loaded * by_tension[k] / stiffness[k]
            load[i, 3] -= (1.0 + ratio) * test * loaded
    moved = np.zeros((TERMS, 4))
    for i in range(TERMS):
        for n in range(TERMS):
            for c in range(4):
                moved[i, c] += inverse[i, n] * load[n, c]
    # mean pressure (2/3 of the parabola's top) of each shape over that of its wave
    over = np.full(SHAPES, 2.0 / 3.0)
    for n in range(1, TERMS):
        over[n - 1] *= (4.0 * n + 3.0) / ((2.0 * n + 1.0) * (2.0 * n + 2.0))
    out = np.empty((count, 7 + SHAPES), np.complex128)
    for k in range(count):
        odd, odd_slope = tilt * waves[k, 2 * TERMS], tilt * slopes[k, 2 * TERMS]
        mine, mine_slope = 0.0, 0.0
        for i in range(TERMS):
            place = TERMS + 1 + i if i < TERMS - 1 else 0
            mine += own[i] * over[i] * waves[k, place]
            mine_slope += own[i] * over[i] * slopes[k, place]
        for i in range(TERMS, SHAPES):
            odd += own[i] * over[i] * waves[k, TERMS + 1 + i]
            odd_slope += own[i] * over[i] * slopes[k, TERMS + 1 + i]
        q, more = (ell * kappa[k]) ** 2, stiffer[k]
        by_ell[k] += 4.0 * more * q * q / ell
        total = stiffness[k] + more * (q * q + 1.0)
        compliance = 1.0 / complex(total, damping * kappa[k] * ell)
        # height: a curvature of the order of 1 / bending length^2 is divided out, so that heights
        # stay comparable while a fit walks
        response = -(kappa[k] ** 2) * ell * reach * compliance
        # the tilt is carried by the parabola of the same load
        spectrum = response * complex(even[k] + pressure[0] * mine, pressure[0] * odd)
        out[k, 0] = spectrum
        for c in range(4):
            by = moved[0, c] * mine
            for n in range(TERMS):
                by += waves[k, TERMS + n] * moved[n, c]
            out[k, 1 + c] = response * complex(by, odd * moved[0, c])
        slope = complex(even_slope[k] + pressure[0] * mine_slope, pressure[0] * odd_slope)
        out[k, 1] += response * slope + spectrum / L
        out[k, 2] += spectrum * (1.0 / ell - complex(by_ell[k], damping * kappa[k]) * compliance)
        out[k, 3] -= spectrum * by_tension[k] * compliance
        out[k, 5] = spectrum * complex(0.0, -kappa[k] * ell) * compliance
        out[k, 6] = response * complex(0.0, pressure[0] * waves[k, 2 * TERMS])
        for i in range(SHAPES):
            place = TERMS + 1 + i if i != TERMS - 1 else 0
            size = pressure[0] * over[i] * waves[k, place]
            out[k, 7 + i] = response * (complex(size, 0.0) if i < TERMS else complex(0.0, size))
    return out


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
        return form_spectra(
            self.kappa_1_m,
            self.radius_m,
            shape.array(),
            _mass(),
            self.own[:SHAPES],
            self._stiffer,
        )

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
