"""Forms and plain edges of all passages, window by window: the inside of `footprint`.

Channel + Passages + EdgeForm
    --windows, block by block; rows of one speed, averaging and form together-->
    Measured, a row per passage
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from tirelog.data.recording import Channel
from tirelog.dsp.filters import derivatives, window_spectra
from tirelog.errors import UsageError
from tirelog.strain.footprint.kernels import (
    FIT,
    FITTED,
    ONSET,
    OWN,
    distance_along,
    fit_rows,
    follow_rows,
    seek_rows,
    traction_gains,
)
from tirelog.strain.footprint.learn import (
    ENOUGH_STEADY,
    FIT_STEP,
    FREE_ROLLING_M_S2,
    LEAST_SCATTER,
    LEAST_SPEED_M_S,
    ODD_SD,
    REMARKABLE,
    EdgeForm,
    PatchWindows,
    form_table,
    gather_windows,
    grid_of,
)
from tirelog.strain.footprint.reference import HALF_LENGTH, TREAD, Reference
from tirelog.strain.passages.find import Passages
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Record, Records, records
from tirelog.vocabulary.quality import good

# ---- Where adhesion turns to slip inside the patch (P2 3.1, 4.2.1).
#
# The abscissa of the jump in the strain's slope between the edges.
#
#     a passage's residual beside its own height, offset, shift, length, damping and tilt
#         --matched filters of P2's brush friction with its onset at many abscissae-->
#         how much misfit one removes
#         --enough of it?--> form and friction together for each onset
#             --least misfit--> onset with error, or a reason
#
# The brush (P2 13, 15, 18, errata): traction grows straight from the entry edge to f_s p(x_s) at
# the onset and is f_d p beyond; the beam feels h d tau / d xi, and at the onset, where tau jumps, h
# (f_d - f_s) p(x_s) as a point load: it is the point load that bends the slope of the strain. The
# size (lever, sign of the slip) is free: drive and brake, and a lever of either sign, look the same
# but for it.

#: onsets that are tried, as a share of the half length, coarse steps and fine ones between them
FIRST, LAST, COARSE, FINE = -0.8, 0.94, 22, 5
#: sliding over sticking friction of P2 Table 1 (0.6 / 0.8) and its standard deviation: from 0.6 to
#: 1.0 all are as likely; twice as much doubles the share of an onset's error by it
RATIO, RATIO_SD = 0.75, 0.13
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


def friction_of(ratio: float | None) -> tuple[float, float]:
    """Ratio of sliding to sticking friction and its standard error, by a setup or an option.

    None gives the usual one.  UsageError for a ratio that no tread has.
    """
    if ratio is None:
        return RATIO, RATIO_SD
    if not 0.2 <= ratio <= 1.2:
        raise UsageError(
            f"ratio of sliding to sticking friction {ratio:g}",
            allowed="0.2 to 1.2 is allowed",
            do="correct friction_ratio, --friction-ratio or --sliding-friction",
        )
    return ratio, 0.0


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


def slip_onsets(found: Records, form_error: float, friction_se: float, scatter: float) -> Records:
    """Onsets with their errors, or why not: (n,) of SLIP, of `found` (n,) of ONSET.

    `form_error` of an onset as a share of the half length; that of the frictions' ratio adds to it;
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
    shared = np.hypot(np.hypot(0.015, form_error), 0.25 * friction_se)
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
    # nor is it better than this where a tread of more than 0.5, or a form, makes the pressure
    # another than the parabola of P2's brush: rings by differences have onsets one to two
    # millimetres from where the brush puts them; twice as much of the first covers all of them
    other = reference.family.own.any() or (reference.forms[:, TREAD] > 0.5).any()
    return float(np.hypot(missed, 0.03 if other else 0.0))


def _scale(found: Records, scatter: float) -> FloatArray:
    """Square of how much larger the rows' residuals are than the noise, (n,); `found` of ONSET.

    What a row's residual is beyond the log's usual one widens its own error.
    """
    scale: FloatArray = np.maximum(
        found["chi2"] / np.maximum(found["used"] - FITTED, 1.0), scatter**2
    )
    return scale


# ---- The papers' own footprint.
#
# The edges by the extrema of the strain's first and second derivative along the tread (P2 3.2,
# 4.3).
#
#     windows (n, m) of strain, patch downward
#         --low-pass, derivatives, upsampled--> d/d xi and d2/d xi2 through the passage's kinematics
#         --extrema on either side of the centre, sub-sample--> Edges: times from the centre,
# lengths,
#                                                               standard errors
#
# Distance runs by the passage's own speed and acceleration, xi = v t + a t^2 / 2, so an extremum of
# d
# eps / d xi is one along the tread.

#: a passage's edges, NaN if an extremum was not found: lengths, and how large the second derivative
#: is at its extrema [1/m^2 of strain]
EDGES = np.dtype(
    [("length_d2_m", "f8"), ("length_d2_se_m", "f8"), ("length_d1_m", "f8"),
     ("length_d1_se_m", "f8"), ("entry_height", "f8"), ("exit_height", "f8")]
)  # fmt: skip

#: edges are looked for out to this multiple of the expected half length
SEARCH = 2.1
#: samples per period of the low-pass' cut-off that need none between them to find an extremum;
#: twice as many put one between the samples of logs up to twice the rate
DENSE = 8.0


def along_tread(
    windows: PatchWindows, cutoff_Hz: FloatArray, upsample: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Low-passed derivatives along the tread at `upsample` points per sample, (n, m) each.

    Abscissae from the patch centre [m], first and second derivative by them [1/m, 1/m^2]; noises
    (n, 2) as of `derivatives`. `cutoff_Hz` (n,).
    """
    values, rate_Hz = windows.values, windows.rate_Hz
    first_s, second_s, noises = derivatives(
        window_spectra(values), rate_Hz, cutoff_Hz, values.shape[1], upsample
    )
    centre, speed, acceleration = (
        windows.motion[name][:, None] for name in ("centre", "speed_m_s", "acceleration_m_s2")
    )
    time = (np.arange(first_s.shape[1]) / upsample - centre) / rate_Hz
    now = np.maximum(speed + acceleration * time, 0.05 * np.abs(speed) + 1e-9)
    first = first_s / now
    second = (second_s - acceleration * first) / now**2
    return distance_along(time, speed, acceleration), first, second, noises


def find_edges(
    windows: PatchWindows,
    cutoff_Hz: FloatArray,
    half_length_m: FloatArray,
    noise: float,
    upsample: int,
) -> Records:
    """Edges (n,) of EDGES of the passages in `windows`, NaN where lost.

    `half_length_m` (n,): what half of the patch is expected to be, to look for extrema; `noise`:
    standard deviation of a value; `upsample`: points per sample, 2 unless samples are DENSE.
    """
    _, first, second, noises = along_tread(windows, cutoff_Hz, upsample)
    speed, acceleration = windows.motion["speed_m_s"], windows.motion["acceleration_m_s2"]
    rate, middle = windows.rate_Hz * upsample, windows.motion["centre"] * upsample
    reach = SEARCH * half_length_m / speed * rate
    low, high = middle - reach, middle + reach
    # steepest fall and rise, then the sharpest bends outside of them
    fall, rise = least(first, low, middle), least(-first, middle, high)
    steepest = [np.where(np.isnan(one[0]), middle, one[0]) for one in (fall, rise)]
    entry, leave = least(second, low, steepest[0]), least(second, steepest[1], high)
    times = [(one[0] - middle) / rate for one in (fall, rise, entry, leave)]
    places = [distance_along(time, speed, acceleration) for time in times]
    # an extremum moves by the noise of the next derivative
    wiggle = noise * noises.T / [speed, speed**2] / rate**2 * speed
    return records(
        EDGES,
        length_d2_m=places[3] - places[2],
        length_d2_se_m=np.hypot(wiggle[1] / entry[2], wiggle[1] / leave[2]),
        length_d1_m=places[1] - places[0],
        length_d1_se_m=np.hypot(wiggle[0] / fall[2], wiggle[0] / rise[2]),
        entry_height=-entry[1],
        exit_height=-leave[1],
    )


def least(
    rows: FloatArray, low: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Place, height and curvature of the least value of each of the `rows` (n, m), (n,) each.

    Between the columns `low` and `high` (n,), of the quartic through five columns: place in columns
    (NaN if it lies at the border of its range), height, curvature per column^2 (NaN if it is no
    minimum).

    At six columns per period of the low-pass' cut-off, a place in a passage is true to 0.02 columns
    (rms); a parabola through three: 0.1.
    """
    count = rows.shape[1]
    column = np.arange(count)
    inside = (column >= low[:, None]) & (column <= high[:, None])
    index = np.argmin(np.where(inside, rows, np.inf), axis=1)
    safe = np.clip(index, 2, count - 3)
    a, b, c, d, e = np.take_along_axis(rows, safe[:, None] + np.arange(-2, 3), axis=1).T
    # derivatives in the middle by central differences
    slope, bend = (a - e + 8.0 * (d - b)) / 12.0, (16.0 * (b + d) - 30.0 * c - a - e) / 12.0
    third, fourth = (e - a + 2.0 * (b - d)) / 2.0, a + e - 4.0 * (b + d) + 6.0 * c
    begin = (index - safe).astype(np.float64)
    shift = begin
    # steps towards an extremum, which lies no farther than this many columns from the column that
    # is least; twice as far reaches the next column's own extremum
    for _ in range(5):
        place = shift
        curvature = bend + place * (third + 0.5 * place * fourth)
        curvature = np.where(curvature > 0.0, curvature, np.nan)
        steep = slope + place * (bend + place * (0.5 * third + place * fourth / 6.0))
        shift = np.clip(place - steep / curvature, begin - 0.75, begin + 0.75)
    height = c + place * (
        slope + place * (0.5 * bend + place * (third / 6.0 + place * fourth / 24.0))
    )
    height = np.where(np.isnan(height), rows[np.arange(len(rows)), index], height)
    inner = (index > np.ceil(low)) & (index < np.floor(high)) & (index > 0) & (index < count - 1)
    return np.where(inner, safe + place, np.nan), height, curvature


#: the fit of a passage: height and offset (patch downward), shift of the patch's middle behind the
#: passage's centre, full contact length with its standard error, damping and tilt beside the
#: reference's, chi-square per degree of freedom, samples used
FITS = np.dtype(
    [("height", "f8"), ("offset", "f8"), ("shift_m", "f8"), ("length_m", "f8"), ("damping", "f8"),
     ("tilt", "f8"), ("length_se_m", "f8"), ("chi2", "f8"), ("used", "f8")]
)  # fmt: skip
#: how a passage is looked at, a row of each: number of its form, whether its speed is vague,
#: samples that are averaged for the fit and roughly, half of the window that a fit needs [samples];
#: then what is filled: samples between the edges, whether a traction is seen, edges, fit of the
#: form, and slip onset
MEASURED = np.dtype(
    [("number", "i8"), ("vague", "?"), ("averaged", "i8"), ("roughly", "i8"), ("reach", "f8"),
     ("inside", "f8"), ("driven", "?"), ("edges", EDGES), ("fits", FITS), ("slip", SLIP)]
)  # fmt: skip


def nothing_measured(n: int) -> Records:
    """`n` rows of MEASURED, nothing known."""
    work = np.zeros(n, MEASURED)
    for name in ("inside", "edges", "fits", "slip"):
        work[name] = np.full(n, np.nan, MEASURED[name])
    work["slip"]["reason"] = NO_FORM
    return work


class Forms:
    """The log's form at the knots of speed: columns of fits, and waves of tractions.

    `columns` (k, g, FITTED) on `grids` (k,) of GRID, `half_length_m` and `shift_m` behind the
    passages' centres (k,); waves are made when they are first asked for.
    """

    def __init__(self, learnt: EdgeForm, speed_m_s: FloatArray) -> None:
        knots = learnt.reference.knots(float(speed_m_s.min()), float(speed_m_s.max()))
        self.reference = learnt.reference.at_speeds(knots)
        self._half_window_m, self.form_error = learnt.half_window_m, form_error(learnt)
        made = [form_table(self.reference, k, learnt.half_window_m) for k in range(knots.size)]
        self.columns, self.grids = (np.stack(part) for part in zip(*made, strict=True))
        self.half_length_m = self.reference.forms[:, HALF_LENGTH]
        self.shift_m = self.reference.shifts_m
        self._tractions: dict[tuple[int, int, float], FloatArray] = {}

    def nearest(self, speed_m_s: FloatArray) -> IntArray:
        """Number of the form for each speed."""
        number: IntArray = np.argmin(
            np.abs(np.nan_to_num(speed_m_s[:, None]) ** 2 - self.reference.speed_m_s**2), axis=1
        )
        return number

    def traction(self, number: int, every: int = 1, ratio: float = RATIO) -> FloatArray:
        """Waves (g, c) of the tractions at knot `number`, with `every`-th of the onsets.

        `ratio` of sliding to sticking friction.
        """
        key = number, every, ratio
        if key not in self._tractions:
            self._tractions[key] = traction_waves(
                self.reference, number, self._half_window_m, ratio, every
            )
        return self._tractions[key]

    def gains(self, knot: int, windows: PatchWindows, sigma: float) -> FloatArray:
        """Squared sigmas of misfit that a small traction removes from the fit of each row.

        That of the best of its onsets.
        """
        # every other coarse onset; twice as far apart, one between two loses more of its gain
        waves = self.traction(knot, 2 * FINE)
        return traction_gains(
            windows.values, windows.motion, self.columns[knot], self.grids[knot], waves, sigma,
            ODD_SD,
        )  # fmt: skip

    def fit(self, windows: PatchWindows, number: IntArray, noise: float) -> Records:
        """The fits of the rows of `windows`, each against its form `number`: (n,) of FITS.

        `noise`: standard deviation of a sample of the log.
        """
        sigma = noise / np.sqrt(windows.averaged)
        found = np.full(number.size, np.nan, FIT)
        fit_rows(
            windows.values, windows.motion, number, self.columns, self.grids, sigma, ODD_SD, found,
            np.zeros((2, 0)),
        )  # fmt: skip
        height, used = found["height"], found["used"]
        with np.errstate(divide="ignore", invalid="ignore"):
            relative = {name: found[name] / height for name in FIT.names or ()}
            nan = np.where(height > 0, 1.0, np.nan)
        return records(
            FITS,
            height=height * nan,
            offset=found["offset"] * nan,
            shift_m=(self.shift_m[number] + relative["shift"]) * nan,
            length_m=2.0 * (self.half_length_m[number] + relative["length"]) * nan,
            damping=relative["damping"] * nan,
            tilt=relative["tilt"] * nan,
            length_se_m=2.0 * sigma * relative["length_se"] * nan,
            chi2=found["chi2"] / np.maximum(used - OWN, 1) * nan,
            used=used,
        )


@dataclass(frozen=True)
class PassageForms:
    """The passages of a channel beside the forms of their speeds, and what is measured of them.

    `rows` (k,): passages whose speed is known; `motions`: of all; `work` (n,) of MEASURED.
    """

    channel: Channel
    passages: Passages
    forms: Forms
    rows: IntArray
    motions: tuple[FloatArray, FloatArray]
    work: Records

    @classmethod
    def of(
        cls,
        channel: Channel,
        passages: Passages,
        learnt: EdgeForm,
        forms: Forms | None = None,
    ) -> PassageForms:
        """Those of passages that `learnt` was learnt from: the speed of some is known.

        `forms`: those of `learnt`, if they are at hand.
        """
        rate, speed = channel.axis.rate_Hz, passages.speed_m_s
        rows = np.flatnonzero((speed > LEAST_SPEED_M_S) & np.isfinite(passages.time_s))
        forms, work = forms or Forms(learnt, speed[rows]), nothing_measured(len(passages))
        work["number"] = forms.nearest(speed)
        half_length = forms.half_length_m[work["number"]]
        with np.errstate(divide="ignore", invalid="ignore"):
            work["reach"] = 1.02 * learnt.half_window_m / speed * rate + 2.0
            work["averaged"] = _power_of_two(FIT_STEP * half_length * rate / speed)
            # four times as many while the rough place of a slip onset is looked for; twice as
            # coarse, it may begin beside the onset
            work["roughly"] = _power_of_two(4.0 * FIT_STEP * half_length * rate / speed)
        work["vague"] = ~(passages.speed_se_m_s < WORST_SPEED * speed)
        motions = speed, np.nan_to_num(passages.acceleration_m_s2)
        return cls(channel, passages, forms, rows, motions, work)

    def gathered(self, rows: IntArray, reach: FloatArray | None = None) -> Iterator[PatchWindows]:
        """Windows of `rows`, many at a time, of a fit's `reach` if no other is given."""
        return gather_windows(
            self.channel,
            self.passages.sign,
            self.passages.index,
            self.motions,
            self.work["reach"] if reach is None else reach,
            rows,
        )

    def by_form(self, windows: PatchWindows) -> Iterator[tuple[PatchWindows, float, int]]:
        """Rows of `windows`, noise of a value and number of each form, a form at a time."""
        for knot, part in windows.alike(self.work["number"]):
            yield part, self.passages.noise / np.sqrt(part.averaged), knot

    def averaged(self, rows: IntArray) -> Iterator[PatchWindows]:
        """Windows of `rows`, averaged as a fit needs them."""
        for windows in self.gathered(rows):
            for averaged, part in windows.alike(self.work["averaged"]):
                yield part.reduced(averaged)

    def fit(self, windows: PatchWindows) -> None:
        """Fill the fits of rows that share averaging."""
        row = windows.row
        fits = self.forms.fit(windows, self.work["number"][row], self.passages.noise)
        self.work["fits"][row] = fits
        reason = np.where(self.work["vague"][row], SPEED_UNKNOWN, TOO_SMALL)
        self.work["slip"]["reason"][row] = np.where(np.isfinite(fits["length_m"]), reason, NO_FORM)

    def seek_driven(self, windows: PatchWindows, scatter: float, gain: float) -> None:
        """Fill `driven` of the rows of `windows`, which are averaged and fitted.

        Driven are rows in which a traction removes more than `gain` squared sigmas of misfit;
        `scatter` of what free rows leave.
        """
        work = self.work[windows.row]
        fits = work["fits"]
        # no row with less misfit than that can hold an onset
        misfit = (fits["chi2"] - scatter**2) * np.maximum(fits["used"] - OWN, 1.0)
        asked = ~work["vague"] & np.isfinite(fits["length_m"]) & (misfit > 0.5 * gain)
        for part, sigma, knot in self.by_form(windows.take(asked)):
            self.work["driven"][part.row] = self.forms.gains(knot, part, sigma) > gain


def look_at_some(look: PassageForms, most: int) -> tuple[IntArray, float, float]:
    """Fits of at most so many rows, evenly, and which are driven: the rows, scatter, least gain.

    `scatter` is how much larger the residuals of free rows are than the noise of a sample tells;
    a traction that is more than what the form misses of all passages removes the `gain`, in squared
    sigmas of misfit: infinite if there are no free rows.
    """
    work, rows = look.work, _spread(look.rows, most)
    kept = list(look.averaged(rows))
    for windows in kept:
        look.fit(windows)
    free = _free(look, rows[~work["vague"][rows] & np.isfinite(work["fits"]["length_m"][rows])])
    if not free.size:
        return rows, 1.0, np.inf
    among = np.zeros(len(look.passages), bool)
    # passages that are asked what a traction removes from them; twice as many are good to 0.7 of
    # the scatter, in twice the time
    among[_spread(free, 96)] = True
    gains = [
        look.forms.gains(knot, part, sigma)
        for windows in kept
        for part, sigma, knot in look.by_form(windows.take(among[windows.row]))
    ]
    scatter = float(np.sqrt(max(LEAST_SCATTER, np.median(work["fits"]["chi2"][free]))))
    usual = float(np.median(np.concatenate(gains)))
    # a traction must remove so much of the misfit (squared sigmas, if free passages leave noise):
    # noise alone does so in far less than one passage of a hundred; twice as much loses the
    # faintest tenth of the slips. And so many times what it usually removes from free passages: of
    # those that pass fewer than one in ten thousand has no slip, at half of it one in a hundred of
    # the worst logs
    gain = max(20.0 * scatter**2, 10.0 * usual)
    for windows in kept:
        look.seek_driven(windows, scatter, gain)
    return rows, scatter, gain


def measure_windows(
    look: PassageForms,
    cutoff_Hz: FloatArray,
    clear: BoolArray,
    usual: tuple[float, float],
    rows: IntArray,
) -> None:
    """Fill all that is measured but slip onsets, of the `rows`, whose speed is known.

    `cutoff_Hz` (n,) of the plain edges' low-pass. Driven rows are sought by the `usual` scatter and
    gain where the form is `clear` (n,): beside one that is none of a tire a traction is no sign of
    slip.
    """
    rate, speed, work = look.channel.axis.rate_Hz, look.passages.speed_m_s, look.work
    half_length = look.forms.half_length_m[work["number"]]
    with np.errstate(divide="ignore", invalid="ignore"):
        # the low-pass needs this many samples per period of its cut-off; above, samples are
        # averaged; twice as many take twice as long
        for_plain = _power_of_two(rate / (10.0 * cutoff_Hz))
        upsample = np.where(rate / for_plain < DENSE * cutoff_Hz, 2, 1)
        reach = (SEARCH * half_length + 2.5 * speed / cutoff_Hz) / speed * rate + 2.0
    work["inside"][rows] = (2.0 * half_length * rate / speed)[rows]
    for windows in look.gathered(rows, np.maximum(work["reach"], reach)):
        for averaged, part in windows.alike(work["averaged"]):
            reduced = part.reduced(averaged)
            look.fit(reduced)
            look.seek_driven(reduced.take(clear[part.row]), *usual)
        for key, part in windows.alike(8 * for_plain + upsample):
            plain = part.reduced(key // 8)
            row, motion = plain.row, plain.motion.copy()
            shift_s = np.nan_to_num(work["fits"]["shift_m"][row]) / speed[row]
            motion["centre"] += shift_s * plain.rate_Hz
            work["edges"][row] = find_edges(
                replace(plain, motion=motion),
                cutoff_Hz[row],
                half_length[row],
                look.passages.noise / np.sqrt(plain.averaged),
                key % 8,
            )
    work["slip"]["reason"][~clear & (work["slip"]["reason"] == TOO_SMALL)] = NO_FORM


def find_onsets(look: PassageForms, friction: tuple[float, float], scatter: float) -> None:
    """Slip onsets of the rows that are driven, by the brush of this `friction`.

    Some are looked for everywhere. Others start from that of a passage whose length is nearest to
    theirs, as the fit without traction tells it; those that are unlike theirs are looked for
    everywhere, too.
    """
    driven = np.flatnonzero(look.work["driven"])
    if not driven.size:
        return
    # twice as many starts are like more passages, and take twice as long
    first = _spread(driven, 16)
    found = _onsets(look, first, None, friction, scatter)
    starts = found[as_starts(found, look.work["slip"][first], scatter)]
    rest = np.setdiff1d(driven, first, assume_unique=True)
    if starts.size and rest.size:
        found = _onsets(look, rest, starts, friction, scatter)
        rest = rest[np.isnan(found["best"])]
    if rest.size:
        _onsets(look, rest, None, friction, scatter)


def _spread(rows: IntArray, most: int) -> IntArray:
    """At most so many of `rows`, evenly."""
    return rows[np.linspace(0, rows.size - 1, min(most, rows.size)).astype(np.int64)]


def _onsets(
    look: PassageForms,
    rows: IntArray,
    starts: Records | None,
    friction: tuple[float, float],
    scatter: float,
) -> Records:
    """Fill the onsets of the `rows`, ascending: what was found of them, (k,) of ONSET.

    Looked for everywhere, or from those of the `starts` whose lengths are nearest; then rows that
    are unlike these keep what they had, and no onset is found.
    """
    work, forms, parts = look.work, look.forms, [np.empty(0, ONSET)]
    length = work["fits"]["length_m"]
    further = work["roughly"] // work["averaged"]
    for gathered in look.averaged(rows):
        for times, alike in gathered.alike(further):
            for windows, sigma, knot in look.by_form(alike):
                found = np.full(windows.row.size, np.nan, ONSET)
                found["row"], found["half_length_m"] = windows.row, forms.half_length_m[knot]
                shift = work["fits"]["shift_m"][windows.row] - forms.shift_m[knot]
                found["without_m"] = np.nan_to_num(shift)
                form = forms.columns[knot], forms.grids[knot]
                waves = forms.traction(knot, ratio=friction[0])
                if starts is None:
                    rough = windows.reduced(times)
                    sought_onsets(windows, rough, form, waves, found, sigma, scatter)
                else:
                    away = length[windows.row][:, None] - length[starts["row"].astype(np.int64)]
                    like = starts[np.argmin(np.abs(away), axis=1)]
                    followed_onsets(windows, form, waves, found, like, sigma, scatter)
                parts.append(found)
    onsets = np.concatenate(parts)
    onsets = onsets[np.argsort(onsets["row"])]
    told = onsets if starts is None else onsets[np.isfinite(onsets["best"])]
    of_row = told["row"].astype(np.int64)
    work["slip"][of_row] = slip_onsets(told, forms.form_error, friction[1], scatter)
    return onsets


def _free(look: PassageForms, rows: IntArray) -> IntArray:
    """Those of `rows` that no quality word spoils and that are at steady speed.

    All clean ones, or all of `rows`, if those are too few.
    """
    clean = rows[good(look.passages.quality[rows])]
    steady = clean[np.abs(look.motions[1][clean]) < FREE_ROLLING_M_S2]
    return next((some for some in (steady, clean) if some.size >= ENOUGH_STEADY), rows)


def _power_of_two(values: FloatArray) -> IntArray:
    """The largest power of two not above each value, at least 1 and at most 1024."""
    return (2.0 ** np.floor(np.log2(np.clip(np.nan_to_num(values, nan=1.0), 1.0, 1024.0)))).astype(
        np.int64
    )
