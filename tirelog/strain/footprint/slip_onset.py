"""Where adhesion turns to slip inside the patch (P2 3.1, 4.2.1).

The abscissa of the jump in the strain's slope between the edges.

    a passage's residual beside its own height, offset, shift, length, damping and tilt
        --matched filters of P2's brush friction with its onset at many abscissae-->
        how much misfit one removes
        --enough of it?--> form and friction together for each onset
            --least misfit--> onset with error, or a reason

The brush (P2 13, 15, 18, errata): traction grows straight from the entry edge to f_s p(x_s) at the
onset and is f_d p beyond; the beam feels h d tau / d xi, and at the onset, where tau jumps, h (f_d
- f_s) p(x_s) as a point load: it is the point load that bends the slope of the strain. The size
(lever, sign of the slip) is free: drive and brake, and a lever of either sign, look the same but
for it.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tirelog.strain.footprint.family import EdgeFamily, EdgeShape
from tirelog.strain.footprint.fit import ODD_SD, PassageFits, grid_of
from tirelog.strain.footprint.kernels import FITTED, OWN, motion_of
from tirelog.strain.footprint.learn import LEAST_SCATTER
from tirelog.strain.footprint.onset_kernels import ONSET, onset_rows, traction_gains
from tirelog.strain.footprint.reference import Reference
from tirelog.strain.footprint.windows import PatchWindows
from tirelog.vocabulary.arrays import FloatArray, IntArray, Record, Records

#: onsets that are tried, as a share of the half length, coarse steps and fine ones between them
FIRST, LAST, COARSE, FINE = -0.8, 0.94, 22, 5
#: friction coefficients of P2 Table 1, adhesion and sliding: only their ratio matters
STATIC, SLIDING = 0.8, 0.6
#: a traction must remove this much of the misfit (squared sigmas, if free passages leave noise):
#: noise alone does so in far less than one passage of a hundred; twice as much loses the faintest
#: tenth of the slips
LEAST_GAIN = 20.0
#: and this many times what it usually removes from passages that roll freely, whose form the learnt
#: one misses: of those that pass fewer than one in ten thousand has no slip, at half of it one in a
#: hundred of the worst logs
TIMES_USUAL = 10.0
#: free passages that are asked for that, and rows with less than this share of the gain beyond
#: what free ones leave are not looked at; twice as many are told to 0.7 of the scatter, in twice
#: the time
ASKED, LEAST_SHARE = 96, 0.5
#: an onset stands alone if others this far from it (share of the half length) leave so many more
#: squared sigmas; half as many keep a hundredth more of the onsets
APART, ALONE = 0.28, 20.0
#: weak knowledge of damping and tilt beside a traction; turns of the joint fit (each puts the form
#: anew) with averages of the samples, and with the samples themselves from where those end (half
#: as many of the first lose one onset in a hundred)
JOINT_ODD_SD, TURNS, LAST_TURNS = 0.1, 4, 2
#: squared sigmas per sample that a joint fit may leave before another start is followed, and up to
#: which its onset is believed; twice as much follows fewer starts, and believes onsets beside what
#: a form does not describe
ENOUGH, WORST_LEFT = 1.0, 4.0
#: first places of the form, as shares of the half length beside its fit without traction
START_SHIFTS = tuple(0.05 * k for k in range(-6, 7))
#: an onset is not told better than this share of the half length
LEAST_ERROR = 0.015
#: the misfit about the best onset, with the form put once, rises this many times as steeply as with
#: the form put anew for each (2 to 5 on passages of the finite-difference beam at 0.8 to 8 pm): as
#: many times is the error larger; at twice as much nine in ten are within it
STEEPER = 4.0
#: an onset whose error is above this share of the half length is not told: at twice as much one in
#: twenty is off by 5 mm or more
WORST_ERROR = 0.05
NO_FORM, TOO_SMALL, TOO_WIDE, AT_EDGE, NOT_ALONE = (
    "no_form",
    "slip_too_small",
    "onset_uncertain",
    "onset_at_edge",
    "onset_ambiguous",
)
#: a speed known worse than this (relative) bends the abscissa as much as a slip would the strain
SPEED_UNKNOWN, WORST_SPEED = "speed_uncertain", 0.002


@dataclass(frozen=True)
class SlipOnset:
    """One row per passage, shape (n,): the onset or the reason why there is none.

    `onset_m` (entry -L .. exit +L) and `onset_se_m`, NaN without one; `reason` why not, '' if there
    is one; `length_m`, `length_se_m`: the contact length with the traction taken into account, NaN
    if there is none to see; `left`: squared sigmas of misfit that it leaves.
    """

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


def traction_spectrum(
    family: EdgeFamily, shape: EdgeShape, onset_m: FloatArray
) -> NDArray[np.complex128]:
    """Strain spectra of the traction with onsets `onset_m` (c,), shape (n, c).

    On the carcass of `shape`; size of the order of one.
    """
    L, kappa = shape.half_length_m, family.kappa_1_m[:, None]
    at_onset, at_entry, at_exit = (
        np.exp(-1j * kappa * onset_m),
        np.exp(1j * kappa * L),
        np.exp(-1j * kappa * L),
    )
    adhering = STATIC * (L - onset_m) / L * (at_entry - at_onset) / (1j * kappa)
    # the integral of xi exp(-i kappa xi) is (1 + i kappa xi) exp(-i kappa xi) / kappa^2
    first_moment = (
        (1.0 + 1j * kappa * L) * at_exit - (1.0 + 1j * kappa * onset_m) * at_onset
    ) / kappa**2
    sliding = -2.0 * SLIDING / L * first_moment
    point = (SLIDING - STATIC) * (L - onset_m**2 / L) * at_onset
    answer: NDArray[np.complex128] = (
        family.receptance(shape)[:, None] * (adhering + sliding + point) / L
    )
    return answer


def traction_table(
    reference: Reference, number: int, half_window_m: float, every: int = 1
) -> FloatArray:
    """Waves of the traction at speed `number` of `reference`, one column per onset.

    The onsets are every `every`-th of `onset_grid`, the grid that of the form's table.
    """
    shape = reference.shapes[number]
    onsets = onset_grid(shape.half_length_m)[::every]
    spectra = traction_spectrum(reference.family, shape, onsets)
    return grid_of(reference, number, half_window_m, spectra)[0]


@dataclass(frozen=True)
class Usual:
    """What passages that roll freely leave in this log.

    `scatter`, how much larger their residuals are than the noise of a sample tells, and `gain`,
    squared sigmas of misfit that a traction must remove from a row to be more than what the form
    misses of all passages.
    """

    scatter: float
    gain: float

    @classmethod
    def of(cls, chi2: FloatArray, gains: FloatArray) -> Usual:
        """From what free passages leave, and the gains of a traction in some of them.

        Chi-square per degree of freedom (n,) of the passages; `gains` (k,).
        """
        scatter = float(np.sqrt(max(LEAST_SCATTER, np.median(chi2))))
        return cls(scatter, max(LEAST_GAIN * scatter**2, TIMES_USUAL * float(np.median(gains))))

    def worth_a_look(self, fits: PassageFits) -> NDArray[np.bool_]:
        """Rows with misfit enough for such a gain: no other can hold an onset."""
        free = np.maximum(fits.used - OWN, 1.0)
        with np.errstate(invalid="ignore"):
            return (fits.chi2 - self.scatter**2) * free > LEAST_SHARE * self.gain


@dataclass(frozen=True)
class Tractions:
    """What slip onsets are looked for with at one speed.

    `table` (g, 8) and `grid` (one GRID) of the form, `waves` (g, c) of the traction, half of the
    form's length.
    """

    table: FloatArray
    grid: Record
    waves: FloatArray
    half_length_m: float

    def gains(self, windows: PatchWindows, motion: Records, sigma: float) -> FloatArray:
        """Squared sigmas of misfit that a small traction removes from the fit of each row.

        That of the best of its onsets.
        """
        return traction_gains(
            windows.values, motion, self.table, self.grid, self.waves, sigma, ODD_SD
        )

    def onsets(
        self,
        windows: PatchWindows,
        motion: Records,
        rough: PatchWindows,
        shift_m: FloatArray,
        sigma: float,
        scatter: float,
    ) -> SlipOnset:
        """Slip onsets of rows whose residual has room for one.

        `rough`: averages of the windows' neighbours; `shift_m` (n,): where their fits put the form
        beside its own place; `scatter` of the log (`Usual`).
        """
        L, onsets = self.half_length_m, onset_grid(self.half_length_m)
        step, starts = onsets[1] - onsets[0], np.array(START_SHIFTS) * L
        found = np.full(len(shift_m), np.nan, ONSET)
        rough_motion = motion_of(
            rough.centre, rough.rate_Hz, motion["speed_m_s"], motion["acceleration_m_s2"]
        )
        onset_rows(
            windows.values,
            motion,
            rough.values,
            rough_motion,
            self.table,
            self.grid,
            self.waves,
            FINE,
            shift_m,
            starts,
            TURNS,
            LAST_TURNS,
            sigma,
            sigma * np.sqrt(windows.averaged / rough.averaged),
            JOINT_ODD_SD,
            ENOUGH * scatter**2,
            int(APART * L / step),
            found,
        )
        best, middle, used, rival = (found[n] for n in ("best", "middle", "used", "rival"))
        a, b, c = found["chi2_before"], found["chi2_middle"], found["chi2_after"]
        shorter, longer = found["length_before"], found["length_after"]
        left, length, length_se = found["chi2"], found["length"], found["length_se"]
        # what a row's residual is beyond the log's usual one widens its own error
        scale = np.maximum(left / np.maximum(used - FITTED, 1.0), scatter**2)
        known = np.isfinite(best)
        bend = np.maximum(a - 2.0 * b + c, 1e-300)
        onset = (
            onsets[np.where(known, middle, 0.0).astype(int)]
            + np.clip(0.5 * (a - c) / bend, -0.5, 0.5) * step
        )
        error = np.maximum(STEEPER * step * np.sqrt(2.0 * scale / bend), LEAST_ERROR * L)
        reason = np.full(best.size, "", object)
        reason[rival - left < ALONE * scale] = NOT_ALONE
        reason[(error > WORST_ERROR * L) | (scale > WORST_LEFT * scatter**2)] = TOO_WIDE
        reason[(best == 0) | (best == onsets.size - 1)] = AT_EDGE
        reason[~known] = NO_FORM
        nan = np.where(reason == "", 1.0, np.nan)
        # beside an onset at the edge lies nothing that would tell how the length goes with it
        apiece = np.where(reason == AT_EDGE, 0.0, 0.5 * (longer - shorter) / step)
        length_se = np.hypot(scatter * length_se, np.where(apiece == 0.0, 0.0, error) * apiece)
        return SlipOnset(
            onset * nan, error * nan, 2.0 * (L + length), 2.0 * length_se, left / scatter**2, reason
        )
