"""The form of this log's passages, from averages.

mean passages by class of speed (`learn`)
    --Gauss-Newton with the physical family--> what they share, with or without the tire's own form
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from tirelog.data.setup import FORM_PRESSURE, FORM_STIFFNESS, share_of_degree
from tirelog.strain.footprint.family import (
    BELLS,
    BENDING,
    DAMPING,
    HALF_LENGTH,
    HIGHEST,
    LOWEST,
    OWN_FORM,
    SHAPES,
    TENSION,
    TILT,
    TREAD,
    EdgeFamily,
)
from tirelog.vocabulary.arrays import FloatArray

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
#: shares of a step and its damping that are tried one after the other with a form: shorter steps go
#: on along bent valleys, damped ones lead to them
TRIALS = ((1.0, 0.0), (0.4, 0.0), (1.0, 1e-4), (1.0, 1e-2), (1.0, 1.0))
#: a mean length that is held is held to this
_HELD = 1e-4


@dataclass(frozen=True)
class Average:
    """Mean passage at one speed, in cells along the tread (`cell_centres`).

    `values` (cells,) means, height about one and patch downward, `weight` (cells,) their inverse
    variances (0 if a cell holds nothing).
    """

    speed_m_s: float
    values: FloatArray
    weight: FloatArray


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
        self, reference: Reference, averages: list[Average], half_window_m: float, *, own: bool
    ) -> None:
        self.family, self.averages, self.own = reference.family.up_to(HIGHEST_SHARE), averages, own
        self.basis = cell_basis(self.family.radius_m, self.family.kappa_1_m.size, half_window_m)
        squares = np.array([one.speed_m_s**2 for one in averages])
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
            shift, root = theta[first + 3], np.sqrt(self.trust * one.weight)
            columns = np.column_stack([spectra, -turning * spectra[:, 0]])
            columns *= np.exp(-turning * shift)[:, None]
            waves = self.basis @ np.vstack([columns.real, columns.imag])
            design = np.column_stack([waves[:, 0], np.ones(root.size)]) * root[:, None]
            linear = np.linalg.solve(design.T @ design, design.T @ (one.values * root))
            theta[first + 4 : first + 6] = linear
            left.append(root * one.values - design @ linear)
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
        for share, damping in TRIALS:
            damped = before.normal + np.diag(damping * np.diag(before.normal))
            step = np.linalg.solve(damped, before.gradient)
            out = (before.theta + step < low) | (before.theta + step > high)
            if out.any():  # what is at a bound stays there, and the others know it
                kept = ~out
                step[out] = (np.clip(before.theta + step, low, high) - before.theta)[out]
                right = before.gradient[kept] - damped[np.ix_(kept, out)] @ step[out]
                step[kept] = np.linalg.solve(damped[np.ix_(kept, kept)], right)
            share /= max(1.0, float(np.max(np.abs(step[:_SHARED]) / _MOST_STEP)))
            moved = np.clip(before.theta + share * step, low, high)
            trial = judged(problem, moved, size, length)
            if trial.cost < before.cost:
                here = trial
                break
        if before.cost - here.cost < GOOD_ENOUGH:
            break
    return replace(here, gain=first.cost - here.cost)
