"""Where adhesion turns to slip inside the patch (P2 3.1, 4.2.1): the abscissa of the jump in the strain's slope between the edges.

    a passage's residual beside its own height, offset, shift, length, damping and tilt
        --matched filters of P2's brush friction with its onset at many abscissae--> how much misfit one removes
        --enough of it?--> form and friction together for each onset --least misfit--> onset with error, or a reason

The brush (P2 13, 15, 18, errata): traction grows straight from the entry edge to f_s p(x_s) at the onset and is f_d p beyond; the beam
feels h d tau / d xi, and at the onset, where tau jumps, h (f_d - f_s) p(x_s) as a point load: it is the point load that bends the slope
of the strain.  The size (lever, sign of the slip) is free: drive and brake, and a lever of either sign, look the same but for it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tirelog.estimators.edge_shapes import EdgeFamily, EdgeShape
from tirelog.estimators.footprint_fit import ODD_SD, PassageFits, grid_of
from tirelog.estimators.footprint_kernel import OWN
from tirelog.estimators.footprint_reference import Reference
from tirelog.estimators.footprint_windows import PatchWindows
from tirelog.estimators.onset_kernel import onset_rows, traction_gains
from tirelog.recording import FloatArray, IntArray

#: onsets that are tried, as a share of the half length, coarse steps and fine ones between them
FIRST, LAST, COARSE, FINE = -0.8, 0.94, 22, 5
#: friction coefficients of P2 Table 1, adhesion and sliding: only their ratio matters
STATIC, SLIDING = 0.8, 0.6
#: an onset must remove this much of the misfit (squared sigmas): noise alone does so in far less than one passage of a hundred
LEAST_GAIN = 20.0
#: rows whose misfit lies less than this above what noise leaves are not looked at
LEAST_EXCESS = 5.0
#: weak knowledge of damping and tilt beside a traction; turns of the joint fit (each puts the form anew)
JOINT_ODD_SD, TURNS = 0.1, 4
#: squared sigmas a sample that a joint fit may leave before another start is followed, and up to which its onset is believed
ENOUGH, WORST_LEFT = 1.6, 6.0
#: where the form is put first, as shares of the half length beside its fit without traction
START_SHIFTS = tuple(0.025 * k for k in range(-12, 13))
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
    one; `length_m`, `length_se_m`: the contact length with the traction taken into account, NaN where there is none to see; `left`: squared
    sigmas of misfit that it leaves."""

    onset_m: FloatArray
    onset_se_m: FloatArray
    length_m: FloatArray
    length_se_m: FloatArray
    left: FloatArray
    reason: NDArray[np.object_]

    @classmethod
    def none(cls, n: int, reason: str = NO_FORM) -> SlipOnset:
        nan = [np.full(n, np.nan) for _ in range(5)]
        return cls(nan[0], nan[1], nan[2], nan[3], nan[4], np.full(n, reason, object))

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


def traction_table(reference: Reference, number: int, half_window_m: float) -> FloatArray:
    """Waves of the traction at speed `number` of `reference`, a column an onset of `onset_grid`, on the grid of the form's table."""
    shape = reference.shapes[number]
    return grid_of(reference, number, half_window_m, traction_spectrum(reference.family, shape, onset_grid(shape.half_length_m)))[0]


@dataclass(frozen=True)
class Tractions:
    """What slip onsets are looked for with at one speed: `table` (g, 8) and `grid` (5,) of the form, `waves` (g, c) of the traction, half
    of the form's length; `scatter`: how much larger this log's residuals are than the noise of a sample tells."""

    table: FloatArray
    grid: FloatArray
    waves: FloatArray
    half_length_m: float
    scatter: float

    def gains(self, windows: PatchWindows, motion: FloatArray, sigma: float) -> FloatArray:
        """Squared sigmas of misfit that a small traction removes from the fit of each row, with its best onset of the coarse ones."""
        return traction_gains(windows.values, motion, self.table, self.grid, self.waves, FINE, sigma, ODD_SD, self.scatter)

    def onsets(self, windows: PatchWindows, motion: FloatArray, shift_m: FloatArray, sigma: float) -> SlipOnset:
        """Slip onsets of rows whose residual has room for one; `shift_m` (n,): where their fits put the form beside its own place."""
        L, onsets = self.half_length_m, onset_grid(self.half_length_m)
        starts = np.array(START_SHIFTS) * L
        found = onset_rows(
            windows.values,
            motion,
            self.table,
            self.grid,
            self.waves,
            FINE,
            shift_m,
            starts,
            TURNS,
            sigma,
            JOINT_ODD_SD,
            ENOUGH * self.scatter**2,
        ).T
        best, middle, (a, b, c), (shorter, _, longer), (left, length, length_se, used) = (
            found[0],
            found[1],
            found[2:5],
            found[5:8],
            found[8:],
        )
        a, b, c = (part / self.scatter**2 for part in (a, b, c))
        known = np.isfinite(best)
        step, bend = onsets[1] - onsets[0], np.maximum(a - 2.0 * b + c, 1e-300)
        onset = onsets[np.where(known, middle, 0.0).astype(int)] + np.clip(0.5 * (a - c) / bend, -0.5, 0.5) * step
        error = np.maximum(step * np.sqrt(2.0 / bend), LEAST_ERROR * L)
        reason = np.full(best.size, "", object)
        reason[(error > WORST_ERROR * L) | (left > WORST_LEFT * self.scatter**2 * used)] = TOO_WIDE
        reason[(best == 0) | (best == onsets.size - 1)] = AT_EDGE
        reason[~known] = NO_FORM
        nan = np.where(reason == "", 1.0, np.nan)
        length_se = np.hypot(self.scatter * length_se, error * 0.5 * (longer - shorter) / step)
        return SlipOnset(onset * nan, error * nan, 2.0 * (L + length), 2.0 * length_se, left / self.scatter**2, reason)


def worth_a_look(fits: PassageFits, scatter: float) -> NDArray[np.bool_]:
    """Rows whose misfit is larger than noise usually leaves: no other can hold an onset."""
    free = np.maximum(fits.used - OWN, 1.0)
    with np.errstate(invalid="ignore"):
        return fits.chi2 * free / scatter**2 > free + LEAST_EXCESS
