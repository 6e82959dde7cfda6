"""Where adhesion turns to slip inside the patch (P2 3.1, 4.2.1): the abscissa of the jump in the strain's slope between the edges.

    a passage's residual beside its own height, offset, shift, length, damping and tilt
        --matched filters of P2's brush friction with its onset at many abscissae--> how much misfit one removes
        --enough of it?--> form and friction together for each onset --least misfit--> onset with error, or a reason

The brush (P2 13, 15, 18, errata): traction grows straight from the entry edge to f_s p(x_s) at the onset and is f_d p beyond; the beam
feels h d tau / d xi, and at the onset, where tau jumps, h (f_d - f_s) p(x_s) as a point load: it is the point load that bends the slope
of the strain.  The size (lever, sign of the slip) is free: drive and brake, and a lever of either sign, look the same but for it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tirelog.estimators.edge_shapes import EdgeFamily, EdgeShape
from tirelog.estimators.footprint_fit import (
    HEIGHT,
    LENGTH,
    LINEAR,
    OFFSET,
    SHIFT,
    TABLE_POINTS,
    FormTable,
    Normal,
    PassageFits,
    Solution,
    quadratic,
    solve,
)
from tirelog.estimators.footprint_reference import Reference
from tirelog.recording import FloatArray, IntArray

#: onsets that are tried, as a share of the half length, coarse steps and fine ones between them
FIRST, LAST, COARSE, FINE = -0.8, 0.94, 22, 5
#: friction coefficients of P2 Table 1, adhesion and sliding: only their ratio matters
STATIC, SLIDING = 0.8, 0.6
#: an onset must remove this much of the misfit (squared sigmas): noise alone does so in far less than one passage of a hundred
LEAST_GAIN = 20.0
#: rows whose misfit lies less than this above what noise leaves are not looked at
LEAST_EXCESS = 5.0
#: a traction of which the passage's other columns leave less than this share cannot be told from them
LEAST_OWN = 1e-5
#: weak knowledge of damping and tilt beside a traction; turns of the joint fit (each puts the form anew) and of its quadratic terms
JOINT_ODD_SD, TURNS, JOINT_ROUNDS = (0.1, 0.1), 4, 5
#: where the form is put first, as shares of the half length beside its fit without traction
START_SHIFTS = (-0.16, -0.08, 0.0, 0.08, 0.16)
#: an onset is not told better than this share of the half length
LEAST_ERROR = 0.015
#: and its standard error must be below this share of the half length
WORST_ERROR = 0.35
NO_FORM, TOO_SMALL, TOO_WIDE, AT_EDGE = "no_form", "slip_too_small", "onset_uncertain", "onset_at_edge"
#: a speed known worse than this (relative) bends the abscissa as much as a slip would the strain
SPEED_UNKNOWN, WORST_SPEED = "speed_uncertain", 0.002


@dataclass(frozen=True)
class SlipOnset:
    """One row a passage, shape (n,): `onset_m` (entry -L .. exit +L) and `onset_se_m`, NaN without one; `reason` why not, '' where there is
    one; `length_m`: the contact length with the traction taken into account, NaN where there is none to see."""

    onset_m: FloatArray
    onset_se_m: FloatArray
    length_m: FloatArray
    reason: NDArray[np.object_]

    @classmethod
    def none(cls, n: int, reason: str = NO_FORM) -> SlipOnset:
        return cls(np.full(n, np.nan), np.full(n, np.nan), np.full(n, np.nan), np.full(n, reason, object))

    def put(self, rows: IntArray, other: SlipOnset) -> None:
        """Write the rows of `other` at the ordinals `rows`."""
        for f in fields(self):
            getattr(self, f.name)[rows] = getattr(other, f.name)


def onset_grid(half_length_m: float) -> FloatArray:
    """The onsets that are tried [m]; every FINE-th is coarse."""
    return half_length_m * np.linspace(FIRST, LAST, (COARSE - 1) * FINE + 1)


def traction_spectrum(family: EdgeFamily, shape: EdgeShape, onset_m: FloatArray) -> NDArray[np.complex128]:
    """Strain spectra of the traction with onsets `onset_m` (c,) on the carcass of `shape`, shape (n, c); size of the order of one."""
    L, kappa = shape.half_length_m, family.kappa_1_m[:, None]
    at_onset, at_entry, at_exit = np.exp(-1j * kappa * onset_m), np.exp(1j * kappa * L), np.exp(-1j * kappa * L)
    adhering = STATIC * (L - onset_m) / L * (at_entry - at_onset) / (1j * kappa)
    # the integral of xi exp(-i kappa xi) is (1 + i kappa xi) exp(-i kappa xi) / kappa^2
    first_moment = ((1.0 + 1j * kappa * L) * at_exit - (1.0 + 1j * kappa * onset_m) * at_onset) / kappa**2
    sliding = -2.0 * SLIDING / L * first_moment
    point = (SLIDING - STATIC) * (L - onset_m**2 / L) * at_onset
    return family.receptance(shape)[:, None] * (adhering + sliding + point) / L


def traction_table(reference: Reference, number: int, half_window_m: float, *, fine: bool) -> FormTable:
    """Waves of the traction at speed `number` of `reference`, a column an onset of `onset_grid`, or a coarse one of it."""
    shape = reference.shapes[number]
    waves = traction_spectrum(reference.family, shape, onset_grid(shape.half_length_m)[:: 1 if fine else FINE])
    xi, columns = reference.family.on_grid(waves, TABLE_POINTS, 1.02 * half_window_m)
    return FormTable(
        reference.speed_m_s[number], shape.half_length_m, reference.shifts_m[number], float(xi[0]), float(xi[1] - xi[0]), columns
    )


def _waves(table: FormTable, normal: Normal, which: IntArray) -> FloatArray:
    """The traction's waves at the samples of `normal` for the onsets `which`, (c,) for all rows or (n, c) of each; shape (n, m, c)."""
    place = np.clip((normal.xi_m - table.first_m) / table.step_m, 0.0, table.columns.shape[0] - 1.001)
    low = place.astype(np.int64)[..., None]
    share = place[..., None] - low
    picked = which if which.ndim == 1 else which[:, None, :]
    return (table.columns[low, picked] * (1.0 - share) + table.columns[low + 1, picked] * share) * normal.columns[..., [OFFSET]]


def gains(table: FormTable, normal: Normal, solution: Solution, sigma: float) -> FloatArray:
    """Squared sigmas of misfit that a small traction with each onset of the coarse `table` removes, shape (n, COARSE)."""
    waves = _waves(table, normal, np.arange(COARSE))
    residual = normal.values - np.einsum("nmi,ni->nm", normal.columns, solution.whole)
    along = np.swapaxes(normal.columns[..., :LINEAR], 1, 2) @ waves
    own = np.einsum("nmc,nmc->nc", waves, waves)
    free = own - np.einsum("njc,njc->nc", along, solution.inverse @ along)
    right = np.einsum("nmc,nm->nc", waves, residual)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(free > LEAST_OWN * own, right**2 / free, 0.0) / sigma**2


@dataclass(frozen=True)
class _Joint:
    """Form and traction together, for each onset tried: `whole` (n, c, 9) coefficients (the form's eight, the traction), `chi2` (n, c)."""

    whole: FloatArray
    chi2: FloatArray


def _joint(table: FormTable, normal: Normal, which: IntArray, sigma: float) -> _Joint:
    """Least squares of form and traction for the onsets `which`, the form's quadratic terms in turns as in `solve`."""
    waves = _waves(table, normal, which)
    base = solve(normal, JOINT_ODD_SD)
    along = np.swapaxes(normal.columns, 1, 2) @ waves
    own = np.einsum("nmc,nmc->nc", waves, waves)
    right = np.einsum("nmc,nm->nc", waves, normal.values)
    linear = along[:, :LINEAR]
    moved = base.inverse @ linear
    free = np.maximum(own - np.einsum("njc,njc->nc", linear, moved), LEAST_OWN * own + 1e-300)
    straight = np.einsum("nij,nj->ni", base.inverse, normal.right[:, :LINEAR])
    bends = np.einsum("nij,njk->nik", base.inverse, normal.gram[:, :LINEAR, LINEAR:])
    rough = np.repeat(np.abs(straight[:, [HEIGHT]]), own.shape[1], axis=1)
    curved = np.zeros((*own.shape, 2))
    for _ in range(JOINT_ROUNDS):
        without = straight[:, None, :] - np.einsum("nik,nck->nci", bends, curved)
        left = right - np.einsum("nkc,nck->nc", along[:, LINEAR:], curved)
        size = (left - np.einsum("njc,ncj->nc", linear, without)) / free
        solution = without - np.swapaxes(moved, 1, 2) * size[..., None]
        curved = quadratic(solution, rough)
    whole = np.concatenate([solution, curved, size[..., None]], axis=2)
    form = whole[..., : LINEAR + 2]
    chi2 = (normal.values**2).sum(axis=1)[:, None] - 2.0 * (form @ normal.right[..., None])[..., 0] - 2.0 * size * right
    chi2 += np.einsum("nci,nij,ncj->nc", form, normal.gram, form) + size**2 * own
    chi2 += 2.0 * size * np.einsum("nic,nci->nc", along, form)
    return _Joint(whole, chi2 / sigma**2)


def _own_shift(whole: FloatArray) -> FloatArray:
    """How far a joint solution (n, 9) moves the form on."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.clip(np.nan_to_num(whole[:, SHIFT] / whole[:, HEIGHT]), -0.01, 0.01)


def _rough_shift(
    refer: Callable[[FloatArray], Normal], shift_m: FloatArray, table: FormTable, which: IntArray, scatter: float
) -> FloatArray:
    """Where a strong traction lets the form stand: the best of several shifts about `shift_m` (n,), each with its best onset."""
    least, best = np.full(shift_m.size, np.inf), shift_m
    for share in START_SHIFTS:
        trial = share * table.half_length_m + shift_m
        normal = refer(trial)
        joint = _joint(table, normal, which, normal.sigma * scatter)
        top = np.argmin(joint.chi2, axis=1)
        row = np.arange(shift_m.size)
        better = joint.chi2[row, top] < least
        least = np.where(better, joint.chi2[row, top], least)
        best = np.where(better, trial + _own_shift(joint.whole[row, top]), best)
    return best


def find_onsets(refer: Callable[[FloatArray], Normal], shift_m: FloatArray, form: FormTable, table: FormTable, scatter: float) -> SlipOnset:
    """Slip onsets of rows whose residual has room for one; `refer` gives their normal equations with the form put at shifts (n,), `shift_m`
    where their fits put it; `form`, `table`: form and traction at their speed; `scatter`: how much larger this log's residuals are than
    the noise tells."""
    onsets, n = onset_grid(table.half_length_m), shift_m.size
    row = np.arange(n)
    which: IntArray = np.arange(COARSE) * FINE
    shift_m = _rough_shift(refer, shift_m, table, which, scatter)
    for turn in range(TURNS):
        normal = refer(shift_m)
        joint = _joint(table, normal, which, normal.sigma * scatter)
        top = np.argmin(joint.chi2, axis=1)
        whole = joint.whole[row, top]
        best = which[top] if which.ndim == 1 else which[row, top]
        if turn < TURNS - 1:
            shift_m = shift_m + _own_shift(whole)
            which = np.clip(best[:, None] + np.arange(-FINE, FINE + 1), 0, onsets.size - 1)
    middle = np.clip(top, 1, 2 * FINE - 1)
    a, b, c = (joint.chi2[row, middle + k] for k in (-1, 0, 1))
    step, bend = onsets[1] - onsets[0], np.maximum(a - 2.0 * b + c, 1e-300)
    onset = onsets[which[row, middle]] + np.clip(0.5 * (a - c) / bend, -0.5, 0.5) * step
    error = np.maximum(step * np.sqrt(2.0 / bend), LEAST_ERROR * table.half_length_m)
    height = whole[:, HEIGHT]
    with np.errstate(divide="ignore", invalid="ignore"):
        length = 2.0 * (form.half_length_m + whole[:, LENGTH] / height)
    reason = np.full(n, "", object)
    reason[error > WORST_ERROR * table.half_length_m] = TOO_WIDE
    reason[(best == 0) | (best == onsets.size - 1)] = AT_EDGE
    reason[~(height > 0)] = NO_FORM
    nan = np.where(reason == "", 1.0, np.nan)
    return SlipOnset(onset * nan, error * nan, length, reason)


def worth_a_look(fits: PassageFits, scatter: float) -> NDArray[np.bool_]:
    """Rows whose misfit is larger than noise usually leaves: no other can hold an onset."""
    free = np.maximum(fits.used - LINEAR, 1.0)
    with np.errstate(invalid="ignore"):
        return fits.chi2 * free / scatter**2 > free + LEAST_EXCESS
