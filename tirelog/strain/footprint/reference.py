"""The form of this log's passages, from averages.

mean passages by class of speed (`learn`)
    --Gauss-Newton with the physical family--> what they share, with or without the tire's own form
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.data.setup import (
    FORM_BELLS,
    FORM_PRESSURE,
    FORM_STIFFNESS,
    FORM_WAVES,
    share_of_degree,
)
from tirelog.vocabulary.arrays import FloatArray, Records

# ---- The physical shape of one patch passage in the strain.
#
# A carcass pressed one-sidedly onto a flat road through its tread.
#
#     a form (a handful of numbers)
#         --spectrum over the tire's own wave numbers--> strain and its derivatives on a grid of xi
#
# One family holds both carcasses of the papers. It is a bending line with tension on a foundation:
# EJ w'''' - T w'' + k w = p. This is P1's and P2's beam if T = -mu c^2 (errata: alpha^2 = -tension
# / 2), and P3's ring if T is the hoop tension p0 b R. The contact pressure is what tread springs
# give on a flat road, p = k_t (delta - xi^2 / (2 R) - w) and zero outside the patch: for soft tread
# it is the parabola of P2 (12) on a beam, for stiff tread it is the one-sided contact of P3. So the
# contact length needs no choice of a carcass.
#
# The pressure is a series in (1 - x^2) P'_{n+1}(x), x = xi / L, which vanishes at the edges. Tested
# with Legendre polynomials, the contact condition is a small linear system for a *given* length.
# The approach delta follows from the equation that is not used. Lengths in m. xi grows in the
# direction in which tread passes: entry edge at -L, exit edge at +L, so xi grows with time.

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
    # the order that the downward recurrence starts at; twice as deep a start takes twice as long
    # for the same digits
    steps = (2.0 * np.arange(44 + 1.0)[:, None, None] + 1.0) / z
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
    # above this argument the upward one is stable
    return np.where(z > 16.0, upward, found).swapaxes(0, 1)


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


# ---- The form of a log's passages, from averages.
#
#     mean passages by class of speed (`learn`)
#         --Gauss-Newton with the family--> what they share, with or without the tire's own form

#: cells along xi over the window; twice as many have half of the samples each and take twice as
#: long
CELLS = 120
#: a fit is good enough if the next step gains less of the squared misfit; twice as much leaves up
#: to that much more
GOOD_ENOUGH = 0.3
#: averages are fitted up to this share of it; they hold nothing above their noise beyond
HIGHEST_SHARE = 0.6
#: what averages share: bending length (logarithm, over the half length of a reference), tension at
#: rest, inertia x squared top speed, tread; behind them comes the tire's own form, whose numbers
#: have a mean of zero
_SHARED = 4 + OWN_FORM
#: the same about a reference, without a form and beside one that takes what they would
_WIDE_SD, _NEAR_SD = np.array([2.0, 30.0, 1.0, 30.0]), np.array([0.1, 0.3, 1.0, 30.0])
#: ordinary sizes of a tire's own form, as the models have them: shapes of these degrees, then bells
_DEGREES = (3, 5, 7, 9, 11, 13, 2, 4, 1)
_OWN_SD = np.array(
    [FORM_PRESSURE * share_of_degree(n) for n in _DEGREES] + [FORM_STIFFNESS] * BELLS.size
)
#: then for each average logarithm of the half length, damping, tilt, shift, height, offset; and
#: what is weakly known of damping and tilt
_APIECE = 6
#: a step changes the shared ones by no more than this; twice as much overshoots in bent valleys
_MOST_STEP = np.r_[0.3, 2.0, 2.0, 1.5, np.full(SHAPES, 0.5), np.full(OWN_FORM - SHAPES, 0.3)]
#: the road does not pull: standard deviation of a pressure below zero, in mean pressures, at some
#: places x of the patch; with five times as much flat pressures end up 0.4 % longer
_PULL = 0.02
_PLACES = np.cos(np.pi * (np.arange(24) + 0.5) / 24)
_P = [np.ones_like(_PLACES), _PLACES]
for _n in range(1, 14):  # Legendre polynomials (DLMF 18.9.1); `numpy.polynomial` is slow to load
    _P.append(((2 * _n + 1) * _PLACES * _P[_n] - _n * _P[_n - 1]) / (_n + 1))
_ON_PATCH = np.column_stack(
    [*(_P[_n] - _P[_n + 2] for _n in range(2, 13, 2)), _P[2], _P[3] - _P[5], -_P[1]]
)
#: a mean length that is held is held to this
_HELD = 1e-4


#: mean passage at one speed, in cells along the tread (`cell_centres`): means, height about one and
#: patch downward, and their inverse variances (0 if a cell holds nothing)
AVERAGE = np.dtype([("speed_m_s", "f8"), ("values", "f8", CELLS), ("weight", "f8", CELLS)])


def cell_centres(half_window_m: float) -> FloatArray:
    """Abscissae of the CELLS of a window [m]."""
    return (np.arange(float(CELLS)) + 0.5) * (2.0 * half_window_m / CELLS) - half_window_m


@lru_cache(maxsize=8)
def cell_basis(radius_m: float, waves: int, half_window_m: float) -> FloatArray:
    """Waves at the CELLS of a window by real and imaginary spectrum, (CELLS, 2 waves)."""
    angle = np.multiply.outer(cell_centres(half_window_m) / radius_m, np.arange(1.0, waves + 1.0))
    return np.hstack([np.cos(angle), -np.sin(angle)])


@dataclass(frozen=True)
class Reference:
    """The log's form at some speeds.

    `speed_m_s` (k,) ascending, `forms` (k, 6) at each, `shifts_m` (k,) of the form behind the
    passages' centres; `inertia`: fall of the tension with the squared speed [s^2/m^2]; `heights`
    (k,) of the passages it was learnt from. After learning: `length_se_m` (k,), the error of a full
    length from not knowing the form's parameters better; `misfit`, squared residual per degree of
    freedom; `residuals` (k, CELLS), what the form leaves of the passages over
    their height (None if that is noise); `form_share`: error of all lengths together by what the
    tire's own form may be (`learn.learn_form`), as a share.
    """

    family: EdgeFamily
    speed_m_s: FloatArray
    forms: FloatArray
    shifts_m: FloatArray
    inertia: float
    heights: FloatArray
    length_se_m: FloatArray
    misfit: float = float("nan")
    residuals: FloatArray | None = None
    form_share: float = 0.0

    def at_speeds(self, speed_m_s: FloatArray) -> Reference:
        """The same reference at other speeds (ascending).

        Tension by the inertia, the rest linear between its own speeds.
        """
        own, at_rest = self.speed_m_s, self.forms.copy()
        at_rest[:, TENSION] += self.inertia * own**2
        forms = np.column_stack([np.interp(speed_m_s, own, column) for column in at_rest.T])
        forms[:, TENSION] -= self.inertia * speed_m_s**2
        left = self.residuals
        if left is not None:
            left = np.column_stack([np.interp(speed_m_s, own, column) for column in left.T])
        shifts, heights, errors = (
            np.interp(speed_m_s, own, column)
            for column in (self.shifts_m, self.heights, self.length_se_m)
        )
        return replace(
            self,
            speed_m_s=speed_m_s,
            forms=np.clip(forms, LOWEST, HIGHEST),
            shifts_m=shifts,
            residuals=left,
            heights=heights,
            length_se_m=errors,
        )

    def knots(self, slowest_m_s: float, fastest_m_s: float) -> FloatArray:
        """Speeds from slowest to fastest, close enough for straight lines between them.

        Form and tension are straight in the squared speed from one to the next.
        """
        fall = abs(self.inertia) * (fastest_m_s**2 - slowest_m_s**2)
        ends = self.at_speeds(np.array([slowest_m_s, fastest_m_s]))
        longer = abs(float(np.diff(np.log(ends.forms[:, HALF_LENGTH]))[0]))
        # forms are tabled at speeds between which tension (over sqrt(EJ k)) and length (its
        # logarithm) change by no more than this, at so many speeds at most; twice as coarse, half
        # as many forms are tabled, and more lies between them
        count = int(
            np.clip(
                np.ceil(max(fall / 0.08, longer / 0.02)),
                1,
                16,
            )
        )
        squares = slowest_m_s**2 + (np.arange(count) + 0.5) / count * (
            fastest_m_s**2 - slowest_m_s**2
        )
        return np.sqrt(squares)


class AverageFit:
    """Averages of some speeds, which share a tire, against a vector of parameters.

    Those that are shared, and _APIECE for each average, beginning at those of `reference`. With
    `own` the tire's own form is free, and the tread, which it replaces, is not.
    """

    def __init__(
        self, reference: Reference, averages: Records, half_window_m: float, *, own: bool
    ) -> None:
        self.family, self.averages, self.own = reference.family.up_to(HIGHEST_SHARE), averages, own
        self.basis = cell_basis(self.family.radius_m, self.family.kappa_1_m.size, half_window_m)
        squares = averages["speed_m_s"] ** 2
        self.relative, self.trust = squares / squares[-1], 1.0
        self._last: tuple[Any, tuple[float, FloatArray, FloatArray]] | None = None
        forms, inertia = reference.forms, reference.inertia * reference.speed_m_s[-1] ** 2
        self.scale_m = float(forms[0, HALF_LENGTH])
        #: the parameters of the reference, whose speeds are those of the averages
        self.start = np.zeros(_SHARED + _APIECE * len(averages))
        at_rest = forms[0, TENSION] + inertia * self.relative[0]
        self.start[:4] = np.log(forms[0, BENDING] / self.scale_m), at_rest, inertia, forms[0, TREAD]
        self.start[4:_SHARED] = reference.family.own
        apiece = self.start[_SHARED:].reshape(-1, _APIECE)
        apiece[:, 0] = np.log(forms[:, HALF_LENGTH] / self.scale_m)
        apiece[:, 1:3] = forms[:, [DAMPING, TILT]]

    def forms(self, theta: FloatArray) -> FloatArray:
        """The forms of the averages, (k, 6)."""
        apiece = theta[_SHARED:].reshape(-1, _APIECE)
        forms = np.empty((len(apiece), HIGHEST.size))
        forms[:, HALF_LENGTH] = self.scale_m * np.exp(apiece[:, 0])
        forms[:, BENDING] = self.scale_m * np.exp(theta[0])
        forms[:, TENSION] = theta[1] - theta[2] * self.relative
        forms[:, TREAD], forms[:, [DAMPING, TILT]] = theta[3], apiece[:, 1:3]
        return np.clip(forms, LOWEST, HIGHEST)

    def reference(self, theta: FloatArray, before: Reference) -> Reference:
        """`before` with the parameters `theta`, whose shifts are beside its own."""
        return replace(
            before,
            family=before.family.with_own(theta[4:_SHARED]) if self.own else before.family,
            forms=self.forms(theta),
            shifts_m=before.shifts_m + theta[_SHARED + 3 :: _APIECE],
            inertia=float(theta[2]) / before.speed_m_s[-1] ** 2,
        )

    def length(self, theta: FloatArray) -> float:
        """Mean of the logarithms of the half lengths, over the scale."""
        return float(theta[_SHARED::_APIECE].mean())

    def lengths(self, normal: FloatArray) -> FloatArray:
        """Covariance of the logarithms of the half lengths by the `normal` matrix, (k, k)."""
        places = slice(_SHARED, None, _APIECE)
        return np.asarray(np.linalg.inv(normal)[places, places])

    def known(self, size: float) -> tuple[FloatArray, FloatArray]:
        """Means and weights of what is known before; the form is of `size` times the ordinary."""
        odd = np.array([0.0, 0.4**-2.0, 0.5**-2.0, 0.0, 0.0, 0.0])  # weakly known
        mean = np.r_[self.start[:4], np.zeros(OWN_FORM + _APIECE * len(self.averages))]
        shared = _NEAR_SD if self.own else _WIDE_SD
        weights = shared**-2.0, (size * _OWN_SD) ** -2.0, np.tile(odd, len(self.averages))
        return mean, np.concatenate(weights)

    def sums(self, theta: FloatArray, length: float | None) -> tuple[float, FloatArray, FloatArray]:
        """Squared residual, normal matrix and right side at `theta`, kept until it is another."""
        if self._last is None or self._last[0] != (theta.tobytes(), self.trust, length):
            left, slopes = self.at(theta, length)
            sums = float(left @ left), slopes.T @ slopes, slopes.T @ left
            self._last = (theta.tobytes(), self.trust, length), sums
        return self._last[1]

    def at(self, theta: FloatArray, length: float | None) -> tuple[FloatArray, FloatArray]:
        """Weighted residuals (m,) and what they fall by with the parameters, (m, parameters).

        Heights and offsets in `theta` become those that fit best: they are linear, and leaving them
        to the steps bends the valley.

        Of the averages, of a pressure below zero, and of the mean of the logarithms of the lengths
        from `length`, if that is given.
        """
        family, turning = self.family.with_own(theta[4:_SHARED]), 1j * self.family.kappa_1_m
        left, slopes = [], []
        forms = self.forms(theta)
        every = family.spectra(forms)[:, :, : None if self.own else 7]
        for number, one in enumerate(self.averages):
            first, spectra = _SHARED + number * _APIECE, every[number]
            shift, root = theta[first + 3], np.sqrt(self.trust * one["weight"])
            columns = np.column_stack([spectra, -turning * spectra[:, 0]])
            columns *= np.exp(-turning * shift)[:, None]
            waves = self.basis @ np.vstack([columns.real, columns.imag])
            design = np.column_stack([waves[:, 0], np.ones(root.size)]) * root[:, None]
            linear = np.linalg.solve(design.T @ design, design.T @ (one["values"] * root))
            theta[first + 4 : first + 6] = linear
            left.append(root * one["values"] - design @ linear)
            block = np.zeros((root.size, theta.size))
            by_shared = waves[:, [2, 3, 3, 4]]
            block[:, :4] = by_shared * [forms[number, BENDING], 1.0, -self.relative[number], 1.0]
            if self.own:
                block[:, 4:_SHARED] = waves[:, 7:-1]
            block[:, first : first + 4] = waves[:, [1, 5, 6, -1]]
            block[:, first] *= forms[number, HALF_LENGTH]
            block *= linear[0] * root[:, None]
            block[:, first + 4 : first + 6] = design
            slopes.append(block)
        pressure = 1.5 * (1.0 - _PLACES**2) + _ON_PATCH @ theta[4 : 4 + SHAPES]
        pulls = np.zeros((_PLACES.size + 1, theta.size))
        pulls[:-1, 4 : 4 + SHAPES] = _ON_PATCH * (pressure < 0.0)[:, None] / _PULL
        held = 0.0
        if length is not None:
            pulls[-1, _SHARED::_APIECE] = 1.0 / (_HELD * len(self.averages))
            held = length / _HELD - float(pulls[-1] @ theta)
        left.append(np.r_[np.maximum(-pressure, 0.0) / _PULL, held])
        return np.concatenate(left), np.vstack([*slopes, pulls])


@dataclass(frozen=True)
class Descent:
    """Where a fit to averages has come to.

    `theta` (n,), `cost` (with what is known before), `misfit` of the averages alone, `normal`
    (n, n), `gradient` (n,), `narrow`: logarithm of how much the form is known before; `gain`: what
    the cost has fallen by.
    """

    theta: FloatArray
    cost: float
    misfit: float
    normal: FloatArray
    gradient: FloatArray
    narrow: float
    gain: float = 0.0

    @property
    def evidence(self) -> float:
        """Logarithm, but for a constant, of the evidence of the form's size."""
        return 0.5 * (self.narrow - self.cost - float(np.linalg.slogdet(self.normal)[1]))

    @property
    def promise(self) -> float:
        """What a further step would add to that."""
        return 0.5 * float(self.gradient @ np.linalg.solve(self.normal, self.gradient))


def judged(
    problem: AverageFit, theta: FloatArray, size: float, length: float | None = None
) -> Descent:
    """What the averages say at `theta`, as of `descend`."""
    (mean, known), (misfit, normal, right) = problem.known(size), problem.sums(theta, length)
    return Descent(
        theta,
        float(misfit + known @ (theta - mean) ** 2),
        misfit,
        normal + np.diag(known),
        right + known * (mean - theta),
        float(np.log(known[4:_SHARED]).sum()),
    )


def descend(
    problem: AverageFit,
    theta: FloatArray,
    size: float = 1.0,
    length: float | None = None,
    steps: int = 25,
) -> Descent:
    """A fit from `theta` with a form of `size` times the ordinary one, if one is free.

    By Gauss and Newton, with shorter steps where whole ones do harm. `length`: mean of the
    logarithms of the half lengths (over the scale), if it is held. Ends after `steps`, or with one
    that is GOOD_ENOUGH.
    """
    first = here = judged(problem, theta.copy(), size, length)
    low, high = np.full(theta.size, -np.inf), np.full(theta.size, np.inf)
    low[TREAD], high[TREAD] = theta[[TREAD] * 2] if problem.own else (LOWEST[TREAD], HIGHEST[TREAD])
    for _ in range(steps):
        before = here
        # shares of a step and its damping that are tried one after the other: shorter steps go on
        # along bent valleys, damped ones lead to them
        for share, damping in ((1.0, 0.0), (0.4, 0.0), (1.0, 1e-4), (1.0, 1e-2), (1.0, 1.0)):
            damped = before.normal + np.diag(damping * np.diag(before.normal))
            step = np.linalg.solve(damped, before.gradient)
            out = (before.theta + step < low) | (before.theta + step > high)
            if out.any():  # what is at a bound stays there, and the others know it
                kept = ~out
                step[out] = (np.clip(before.theta + step, low, high) - before.theta)[out]
                right = before.gradient[kept] - damped[np.ix_(kept, out)] @ step[out]
                step[kept] = np.linalg.solve(damped[np.ix_(kept, kept)], right)
            share /= max(1.0, float(np.max(np.abs(step[:_SHARED]) / _MOST_STEP)))
            trial = judged(problem, np.clip(before.theta + share * step, low, high), size, length)
            if trial.cost < before.cost:
                here = trial
                break
        if before.cost - here.cost < GOOD_ENOUGH:
            break
    return replace(here, gain=first.cost - here.cost)
