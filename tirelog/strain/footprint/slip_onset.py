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
from tirelog.strain.footprint.family import HALF_LENGTH, TREAD
from tirelog.strain.footprint.kernels import (
    FITTED,
    follow_rows,
    seek_rows,
)
from tirelog.strain.footprint.learn import (
    REMARKABLE,
    EdgeForm,
    PatchWindows,
    grid_of,
)
from tirelog.strain.footprint.reference import Reference
from tirelog.vocabulary.arrays import BoolArray, FloatArray, Record, Records, records

#: onsets that are tried, as a share of the half length, coarse steps and fine ones between them
FIRST, LAST, COARSE, FINE = -0.8, 0.94, 22, 5
#: sliding over sticking friction of P2 Table 1 (0.6 / 0.8) and its standard deviation: from 0.6 to
#: 1.0 all are as likely; twice as much doubles the share of an onset's error by it
RATIO, RATIO_SD = 0.75, 0.13
#: free passages that are asked what a traction removes from them, and rows with less than this
#: share of the gain beyond what free ones leave are not looked at; twice as many are good to 0.7 of
#: the scatter, in twice the time
ASKED, LEAST_SHARE = 96, 0.5
#: an onset is alone if others this far from it (share of the half length) leave so many more
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
#: first places of the form, as shares of the half length beside its fit without traction, and how
#: far a solution is trusted about where the form was put; twice as far follows solutions that the
#: next start is nearer to
START_STEP, TRUST = 0.05, 0.025
#: onsets that are looked for everywhere, and from which those of other passages start; twice as
#: many are like more passages, and take twice as long
SEARCHED = 16
#: nor better than this where a tread of more than that, or a form, makes the pressure another than
#: the parabola of P2's brush: rings by differences have onsets one to two millimetres from where
#: the brush puts them; twice as much of the first covers all of them
RING_ERROR, STIFF_TREAD = 0.03, 0.5
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


def traction_waves(
    reference: Reference, number: int, half_window_m: float, ratio: float, every: int = 1
) -> FloatArray:
    """Waves (g, c) of tractions at speed `number` of `reference`, on its form's grid.

    A column per onset, every `every`-th of `onset_grid`; `ratio` of sliding to sticking friction.
    The size is of the order of one.
    """
    family, form = reference.family, reference.forms[number : number + 1]
    L, turning = float(form[0, HALF_LENGTH]), 1j * family.kappa_1_m[:, None]
    onset = onset_grid(L)[::every]
    adhering, slide = (L - onset) / L, 2.0 * ratio / L
    by_point = family.receptance(form)[0, :, None] / L
    # loads as powers of xi that begin at the entry edge or at the onset, or end at the exit, and
    # the point load at the onset. Adhering: steps at both ends; sliding: the integral of xi
    # exp(-i kappa xi) from the onset to the exit is (1 + i kappa xi) exp(-i kappa xi) / kappa^2
    # between them
    load = adhering / turning * np.exp(turning * L)
    load = load + slide / turning**2 * (1.0 + turning * L) * np.exp(-turning * L)
    point = (ratio - 1.0) * (L - onset**2 / L) - (adhering + slide * onset) / turning
    load += (point - slide / turning**2) * np.exp(-turning * onset)
    return grid_of(reference, number, half_window_m, by_point * load)[0]


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


def sought_onsets(
    windows: PatchWindows, rough: PatchWindows, form: tuple[FloatArray, Record], waves: FloatArray,
    found: Records, sigma: float, scatter: float,
) -> None:  # fmt: skip
    """Fills `found` (n,) of ONSET with starts, each row's looked for everywhere, and follows them.

    `rough`: averages of the windows' neighbours; `form`: its columns (g, FITTED) and grid; `waves`
    (g, c); `sigma`: noise of a value; `scatter`: how much larger than that residuals are.
    """
    L = float(found["half_length_m"][0])
    grid, starts = onset_grid(L), START_STEP * L * np.arange(-6.0, 7.0)
    seek_rows(
        rough.values, rough.motion, *form, waves, FINE, starts, TRUST * L, TURNS,
        sigma * np.sqrt(windows.averaged / rough.averaged), JOINT_ODD_SD, ENOUGH * scatter**2,
        int(APART * L / (grid[1] - grid[0])), found,
    )  # fmt: skip
    _follow(windows, form, waves, found, sigma)


def followed_onsets(
    windows: PatchWindows, form: tuple[FloatArray, Record], waves: FloatArray, found: Records,
    like: Records, sigma: float, scatter: float,
) -> None:  # fmt: skip
    """Fills `found` (n,) of ONSET with each row's onset from that of a passage `like` it (n,).

    No onset (NaN) if the row is not like the other, or leaves more than can be believed: it has to
    be looked for everywhere. The rest as of `sought_onsets`.
    """
    L = float(found["half_length_m"][0])
    moved = (like["shift"] - like["without_m"]) / like["half_length_m"]
    start = found["without_m"] + moved * L
    found["best"], found["shift"], found["rival"] = like["best"], start, np.inf
    _follow(windows, form, waves, found, sigma)
    with np.errstate(invalid="ignore"):
        alike = (
            (found["best"] == found["middle"])
            & (np.abs(found["best"] - like["best"]) <= FINE)
            & (np.abs(found["shift"] - start) < START_STEP * L)
            & (np.abs(found["to_go"]) < TRUST * L)
            & (_scale(found, scatter) <= WORST_LEFT * scatter**2)
        )
    found["best"] = np.where(alike, found["best"], np.nan)


def _follow(
    windows: PatchWindows, form: tuple[FloatArray, Record], waves: FloatArray, found: Records,
    sigma: float,
) -> None:  # fmt: skip
    """Follows the starts of `found` with the windows' own samples."""
    trust_m = TRUST * float(found["half_length_m"][0])
    follow_rows(
        windows.values, windows.motion, *form, waves, FINE, trust_m, LAST_TURNS, sigma,
        JOINT_ODD_SD, found,
    )  # fmt: skip


def as_starts(found: Records, told: Records, scatter: float) -> BoolArray:
    """Which of the onsets `found` others may start from, (n,).

    Their rivals are worse by far more than is required; their answers give no `reason` against.
    """
    with np.errstate(invalid="ignore"):
        # others start from an onset that is alone by so many times what is asked of each; half
        # as many would tell onsets beside which others are nearly as good
        alone = found["rival"] - found["chi2"] > 3.0 * ALONE * _scale(found, scatter)
    return np.asarray(alone & (told["reason"] == ""))


def slip_onsets(
    found: Records, form_error: float, friction: FrictionRatio, scatter: float
) -> Records:
    """Onsets with their errors, or why not: (n,) of SLIP, of `found` (n,) of ONSET.

    `form_error` of an onset as a share of the half length; that of `friction` adds to it;
    `scatter`: how much larger residuals of free passages are than the noise.
    """
    L, onsets = found["half_length_m"], onset_grid(1.0)
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
    # the misfit about the best onset, with the form put once, rises this many times as steeply as
    # with the form put anew for each (2 to 5 on passages of the finite-difference beam at 0.8 to 8
    # pm): as many times is the error larger; at twice as much nine in ten are within it
    own = 4.0 * step * np.sqrt(2.0 * scale / bend)
    # what is left beyond noise is a misfit of form or traction
    # variance of an onset by what is more than noise in a row's residual, over that by noise: a
    # misfit is alike in neighbouring samples, which noise is not. Without it 86 to 90 % of onsets
    # on rings by differences lie within 1.96 errors, with it 95 %; twice as much covers 96 to 97 %
    missed = np.sqrt(1.0 + 2.0 * np.maximum(1.0 - 1.0 / scale, 0.0))
    # an onset is not surer than this share of the half length, which adds to its error; twice
    # as much covers errors of two millimetres that nothing shows
    # change of an onset over that of the ratio, as a share of the half length: logs of simulated
    # beams have 0.15 to 0.2, of rings 0.05 to 0.1; twice as much doubles an error that covers
    # already
    shared = np.hypot(np.hypot(0.015, form_error), 0.25 * friction.se)
    error = np.hypot(own * missed, shared * L)
    reason = np.full(best.size, "", object)
    reason[rival - left < ALONE * scale] = NOT_ALONE
    # an onset whose error is above this share of the half length is not given: at twice as much one
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
    # and the error by a form that misses free passages too, as a share of the half length if it
    # misses them by far more than noise: such forms put onsets 2 to 6 mm off, whatever the noise;
    # twice as much covers all but one in a hundred
    missed = 0.08 * float(np.sqrt(max(1.0 - REMARKABLE / learnt.reference.misfit, 0.0)))
    reference = learnt.reference
    other = reference.family.own.any() or (reference.forms[:, TREAD] > STIFF_TREAD).any()
    return float(np.hypot(missed, RING_ERROR if other else 0.0))


def _scale(found: Records, scatter: float) -> FloatArray:
    """Square of how much larger the rows' residuals are than the noise, (n,); `found` of ONSET.

    What a row's residual is beyond the log's usual one widens its own error.
    """
    scale: FloatArray = np.maximum(
        found["chi2"] / np.maximum(found["used"] - FITTED, 1.0), scatter**2
    )
    return scale
