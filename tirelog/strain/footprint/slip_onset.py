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

from dataclasses import dataclass

import numpy as np

from tirelog.errors import UsageError
from tirelog.strain.footprint.kernels import (
    FITTED,
    ONSET,
    TRUST,
    follow_rows,
    motion_of,
    moved_waves,
    onset_rows,
    traction_gains,
)
from tirelog.strain.footprint.learn import LEAST_SCATTER, EdgeForm
from tirelog.strain.footprint.reference import Reference
from tirelog.strain.footprint.refine import (
    ODD_SD,
    REMARKABLE,
    TABLE_POINTS,
    PatchWindows,
    grid_of,
)
from tirelog.vocabulary.arrays import BoolArray, FloatArray, Record, Records, records

#: steps of the waves that are moved per step of the form's table; what straight lines between them
#: take off is a quarter of what they do there, and twice as many take off a quarter of that
FINER = 2
#: onsets that are tried, as a share of the half length, coarse steps and fine ones between them
FIRST, LAST, COARSE, FINE = -0.8, 0.94, 22, 5
#: sliding over sticking friction of P2 Table 1 (0.6 / 0.8) and its standard deviation: from 0.6 to
#: 1.0 all are as likely; twice as much doubles the share of an onset's error by it
RATIO, RATIO_SD = 0.75, 0.13
#: change of an onset over that of the ratio, as a share of the half length: logs of simulated beams
#: have 0.15 to 0.2, of rings 0.05 to 0.1; twice as much doubles an error that covers already
BY_RATIO = 0.25
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
START_STEP = 0.05
START_SHIFTS = tuple(START_STEP * k for k in range(-6, 7))
#: onsets that are looked for everywhere, and from which those of other passages start; twice as
#: many are like more passages, and take twice as long
SEARCHED = 16
#: where a passage's onset is looked for that is like another's: number of the onset, how far the
#: traction moves the form (share of the half length)
FOLLOWED = np.dtype([("onset", "f8"), ("moved", "f8")])
#: nor better than this where a tread of more than that, or a form, makes the pressure another than
#: the parabola of P2's brush: rings by differences have onsets one to two millimetres from where
#: the brush puts them; twice as much of the first covers all of them
RING_ERROR, STIFF_TREAD = 0.03, 0.5
#: variance of an onset by what is more than noise in a row's residual, over that by noise: a misfit
#: is alike in neighbouring samples, which noise is not. Without it 86 to 90 % of onsets on rings by
#: differences lie within 1.96 errors, with it 95 %; twice as much covers 96 to 97 %
ALIKE = 2.0
#: and the error by a form that misses free passages too, as a share of the half length if it misses
#: them by far more than noise: such forms put onsets 2 to 6 mm off, whatever the noise; twice as
#: much covers all but one in a hundred
FORM_ERROR = 0.08
#: the misfit about the best onset, with the form put once, rises this many times as steeply as with
#: the form put anew for each (2 to 5 on passages of the finite-difference beam at 0.8 to 8 pm): as
#: many times is the error larger; at twice as much nine in ten are within it
STEEPER = 4.0
NO_FORM, TOO_SMALL, TOO_WIDE, AT_EDGE, NOT_ALONE = (
    "no_form",
    "slip_too_small",
    "onset_uncertain",
    "onset_at_edge",
    "onset_ambiguous",
)
#: a speed known worse than this (relative) bends the abscissa as much as a slip would the strain
SPEED_UNKNOWN, WORST_SPEED = "speed_uncertain", 0.002


#: the onset of a passage (entry -L .. exit +L) with its standard error, NaN without one; the
#: contact length with the traction taken into account, NaN if there is none; squared sigmas of
#: misfit that it leaves; the reason why there is no onset, '' if there is one
SLIP = np.dtype(
    [("onset_m", "f8"), ("onset_se_m", "f8"), ("length_m", "f8"), ("length_se_m", "f8"),
     ("left", "f8"), ("reason", "O")]
)  # fmt: skip


def onset_grid(half_length_m: float) -> FloatArray:
    """The onsets that are tried [m]; every FINE-th is coarse."""
    return half_length_m * np.linspace(FIRST, LAST, (COARSE - 1) * FINE + 1)


@dataclass(frozen=True)
class TractionWaves:
    """What the waves of all tractions at one speed are made of.

    The load of a traction is made of powers of xi that begin at the entry edge or at the onset, and
    of the point load there. So few waves, moved along the tread, make those of all onsets: `fixed`
    (g, 2) of the edges on the grid of the form's table, those of the onset on one FINER times as
    fine, whose points are `step_m` apart: `phases` (FINER, 3, G), every FINER-th of them from each
    of the first ones on, `spare` zeros behind the last; half of the form's length.
    """

    fixed: FloatArray
    phases: FloatArray
    spare: int
    step_m: float
    half_length_m: float

    @classmethod
    def of(cls, reference: Reference, number: int, half_window_m: float) -> TractionWaves:
        """At speed `number` of `reference`."""
        family, shape = reference.family, reference.shapes[number]
        L, kappa = shape.half_length_m, family.kappa_1_m
        by_point = family.receptance(shape) / L
        by_step, by_ramp = by_point / (1j * kappa), by_point / kappa**2
        at_entry, at_exit = np.exp(1j * kappa * L), np.exp(-1j * kappa * L)
        fixed, _ = grid_of(
            reference,
            number,
            half_window_m,
            np.column_stack([by_step * at_entry, (1.0 + 1j * kappa * L) * at_exit * by_ramp]),
        )
        xi, moving = family.on_grid(
            np.column_stack([by_point, by_step, by_ramp]),
            TABLE_POINTS,
            1.02 * half_window_m + L,
            FINER,
        )
        spare = -len(moving) % FINER
        padded = np.concatenate([moving.T, np.zeros((moving.shape[1], spare))], axis=1)
        phases = np.ascontiguousarray(padded.reshape(len(padded), -1, FINER).transpose(2, 0, 1))
        return cls(fixed, phases, spare, float(xi[1] - xi[0]), L)

    def table(self, ratio: float, every: int = 1) -> FloatArray:
        """Waves (g, c) of tractions on the grid of the form's table, a column per onset.

        `ratio` of sliding to sticking friction. The onsets are every `every`-th of `onset_grid`,
        the size is of the order of one.
        """
        L, fixed = self.half_length_m, self.fixed
        onset = onset_grid(L)[::every]
        # adhering: steps at both ends; sliding: the integral of xi exp(-i kappa xi) from the onset
        # to the exit is (1 + i kappa xi) exp(-i kappa xi) / kappa^2 between them
        adhering = (L - onset) / L
        made = adhering[:, None] * fixed[:, 0] - (2.0 * ratio / L) * fixed[:, 1]
        factors = np.array(
            [
                (ratio - 1.0) * (L - onset**2 / L),
                -adhering - 2.0 * ratio / L * onset,
                np.full(onset.size, 2.0 * ratio / L),
            ]
        )
        reach = self.phases.shape[2] * FINER - self.spare
        place = reach // 2 - FINER * (len(fixed) // 2) - onset / self.step_m
        first = np.floor(place).astype(np.int64)
        moved_waves(self.phases, first, place - first, factors, made)
        return np.ascontiguousarray(made.T)


@dataclass(frozen=True)
class FrictionRatio:
    """Sliding over sticking friction of the tread, and its standard error."""

    value: float = RATIO
    se: float = RATIO_SD

    @classmethod
    def given(cls, ratio: float | None) -> FrictionRatio:
        """The exact one of a setup or an option; None gives the usual one.

        UsageError for a ratio that no tread has.
        """
        if ratio is None:
            return cls()
        if not 0.2 <= ratio <= 1.2:
            raise UsageError(
                f"ratio of sliding to sticking friction {ratio:g}",
                allowed="0.2 to 1.2 is allowed",
                do="correct friction_ratio, --friction-ratio or --sliding-friction",
            )
        return cls(ratio, 0.0)


@dataclass(frozen=True)
class FreeRollingReference:
    """What passages that roll freely leave in this log.

    `scatter`, how much larger their residuals are than the noise of a sample tells, and `gain`,
    squared sigmas of misfit that a traction must remove from a row to be more than what the form
    misses of all passages.
    """

    scatter: float
    gain: float

    @classmethod
    def of(cls, chi2: FloatArray, gains: FloatArray) -> FreeRollingReference:
        """From what free passages leave, and the gains of a traction in some of them.

        Chi-square per degree of freedom (n,) of the passages; `gains` (k,).
        """
        scatter = float(np.sqrt(max(LEAST_SCATTER, np.median(chi2))))
        return cls(scatter, max(LEAST_GAIN * scatter**2, TIMES_USUAL * float(np.median(gains))))


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
    ) -> Records:
        """The onset of each row, looked for everywhere: (n,) of ONSET.

        `rough`: averages of the windows' neighbours; `shift_m` (n,): where their fits put the form
        beside its own place; `scatter` of the log (`FreeRollingReference`).
        """
        L, found = self.half_length_m, np.full(len(shift_m), np.nan, ONSET)
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
            np.array(START_SHIFTS) * L,
            TURNS,
            LAST_TURNS,
            sigma,
            sigma * np.sqrt(windows.averaged / rough.averaged),
            JOINT_ODD_SD,
            ENOUGH * scatter**2,
            int(APART * L / self.step_m),
            found,
        )
        return found

    def followed(
        self, windows: PatchWindows, motion: Records, shift_m: FloatArray, like: Records,
        sigma: float, scatter: float,
    ) -> Records:  # fmt: skip
        """The onset of each row from that of another passage, `like` (n,) of FOLLOWED.

        (n,) of ONSET, NaN if the row is not like the other or leaves more than can be believed: it
        has to be looked for everywhere.
        """
        L, found = self.half_length_m, np.full(len(shift_m), np.nan, ONSET)
        start, trust_m = shift_m + like["moved"] * L, TRUST * START_STEP * L
        follow_rows(
            windows.values,
            motion,
            self.table,
            self.grid,
            self.waves,
            FINE,
            like["onset"].astype(np.int64),
            start,
            trust_m,
            LAST_TURNS - 1,
            sigma,
            JOINT_ODD_SD,
            found,
        )
        with np.errstate(invalid="ignore"):
            alike = (
                (found["best"] == found["middle"])
                & (np.abs(found["best"] - like["onset"]) <= FINE)
                & (np.abs(found["shift"] - start) < START_STEP * L)
                & (np.abs(found["to_go"]) < trust_m)
                & (_scale(found, scatter) <= WORST_LEFT * scatter**2)
            )
        found[~alike] = np.nan
        found["rival"][alike] = np.inf
        return found

    @property
    def step_m(self) -> float:
        """From one onset that is tried to the next."""
        onsets = onset_grid(self.half_length_m)
        return float(onsets[1] - onsets[0])


#: what was found of a row's onset: ordinal of the passage, ONSET, half length of its form, and
#: where its fit without traction puts the form beside its own place
ONSETS = np.dtype([("row", "i8"), ("found", ONSET), ("half_length_m", "f8"), ("shift_m", "f8")])


def onset_starts(onsets: Records, told: Records, scatter: float) -> tuple[BoolArray, Records]:
    """Which of the `onsets`, as `told`, others may start from, (n,), and the starts (FOLLOWED).

    They stand alone far more clearly than is asked for.
    """
    found = onsets["found"]
    moved = (found["shift"] - onsets["shift_m"]) / onsets["half_length_m"]
    with np.errstate(invalid="ignore"):
        lead = found["rival"] - found["chi2"]
        # others start from an onset that stands alone by so many times what is asked of each; half
        # as many would tell onsets beside which others are nearly as good
        alone = lead > 3.0 * ALONE * _scale(found, scatter)
    return alone & (told["reason"] == ""), records(FOLLOWED, onset=found["best"], moved=moved)


def slip_onsets(
    row_onsets: Records, form_error: float, friction: FrictionRatio, scatter: float
) -> Records:
    """Onsets with their errors, or why not: (n,) of SLIP, of `row_onsets` (n,) of ONSETS.

    `form_error` of an onset as a share of the half length; that of `friction` adds to it;
    `scatter` of the log (`FreeRollingReference`).
    """
    found, L, onsets = row_onsets["found"], row_onsets["half_length_m"], onset_grid(1.0)
    step = (onsets[1] - onsets[0]) * L
    best, middle, rival = (found[n] for n in ("best", "middle", "rival"))
    a, b, c = found["chi2_before"], found["chi2_middle"], found["chi2_after"]
    shorter, longer = found["length_before"], found["length_after"]
    left, length, length_se = found["chi2"], found["length"], found["length_se"]
    scale, known = _scale(found, scatter), np.isfinite(best)
    bend = np.maximum(a - 2.0 * b + c, 1e-300)
    onset = (
        onsets[np.where(known, middle, 0.0).astype(int)] * L
        + np.clip(0.5 * (a - c) / bend, -0.5, 0.5) * step
    )
    own = STEEPER * step * np.sqrt(2.0 * scale / bend)
    # what is left beyond noise is a misfit of form or traction
    missed = np.sqrt(1.0 + ALIKE * np.maximum(1.0 - 1.0 / scale, 0.0))
    # an onset is not told better than this share of the half length, which adds to its error; twice
    # as much covers errors of two millimetres that nothing shows
    shared = np.hypot(np.hypot(0.015, form_error), BY_RATIO * friction.se)
    error = np.hypot(own * missed, shared * L)
    reason = np.full(best.size, "", object)
    reason[rival - left < ALONE * scale] = NOT_ALONE
    # an onset whose error is above this share of the half length is not told: at twice as much one
    # in twenty is off by 5 mm or more
    reason[(own > 0.05 * L) | (scale > WORST_LEFT * scatter**2)] = TOO_WIDE
    reason[(best == 0) | (best == onsets.size - 1)] = AT_EDGE
    reason[~known] = NO_FORM
    nan = np.where(reason == "", 1.0, np.nan)
    # beside an onset at the edge lies nothing that would tell how the length goes with it
    apiece = np.where(reason == AT_EDGE, 0.0, 0.5 * (longer - shorter) / step)
    length_se = np.hypot(scatter * length_se, np.where(apiece == 0.0, 0.0, error) * apiece)
    return records(
        SLIP,
        onset_m=onset * nan,
        onset_se_m=error * nan,
        length_m=2.0 * (L + length),
        length_se_m=2.0 * length_se,
        left=left / scatter**2,
        reason=reason,
    )


def form_error(learnt: EdgeForm) -> float:
    """Error of an onset by what the form and its brush are not, as a share of the half length."""
    missed = FORM_ERROR * float(np.sqrt(max(1.0 - REMARKABLE / learnt.reference.misfit, 0.0)))
    reference = learnt.reference
    other = reference.family.own.any() or max(s.tread for s in reference.shapes) > STIFF_TREAD
    return float(np.hypot(missed, RING_ERROR if other else 0.0))


def _scale(found: Records, scatter: float) -> FloatArray:
    """Square of how much larger the rows' residuals are than the noise, (n,); `found` of ONSET.

    What a row's residual is beyond the log's usual one widens its own error.
    """
    scale: FloatArray = np.maximum(
        found["chi2"] / np.maximum(found["used"] - FITTED, 1.0), scatter**2
    )
    return scale
