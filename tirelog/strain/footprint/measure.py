"""Forms and plain edges of all passages, window by window: the inside of `footprint`.

Channel + Passages + EdgeForm
    --windows, block by block; rows of one speed, averaging and form together-->
    Measured, a row per passage
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tirelog.data.recording import BLOCK_SAMPLES, Channel
from tirelog.dsp.filters import derivatives, window_spectra
from tirelog.strain.footprint.family import HALF_LENGTH
from tirelog.strain.footprint.kernels import (
    FIT,
    ONSET,
    OWN,
    distance_along,
    fit_rows,
    traction_gains,
)
from tirelog.strain.footprint.learn import (
    ENOUGH_STEADY,
    FIT_STEP,
    FREE_ROLLING_M_S2,
    LEAST_SCATTER,
    LEAST_SPEED_M_S,
    ODD_SD,
    EdgeForm,
    PatchWindows,
    form_table,
    gather_windows,
)
from tirelog.strain.footprint.slip_onset import (
    ASKED,
    FINE,
    LEAST_SHARE,
    NO_FORM,
    RATIO,
    SEARCHED,
    SLIP,
    SPEED_UNKNOWN,
    TOO_SMALL,
    WORST_SPEED,
    FrictionRatio,
    as_starts,
    followed_onsets,
    form_error,
    slip_onsets,
    sought_onsets,
    traction_waves,
)
from tirelog.strain.passages.find import Passages
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Records, records
from tirelog.vocabulary.quality import good

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

#: a passage's edges, NaN if an extremum was not found: lengths, abscissae of the second
#: derivative's extrema, and their sizes there [1/m^2 of strain]
EDGES = np.dtype(
    [("length_d2_m", "f8"), ("length_d2_se_m", "f8"), ("length_d1_m", "f8"),
     ("length_d1_se_m", "f8"), ("entry_m", "f8"), ("exit_m", "f8"), ("entry_height", "f8"),
     ("exit_height", "f8")]
)  # fmt: skip

#: edges are looked for out to this multiple of the expected half length
SEARCH = 2.1
#: steps towards an extremum, which lies no farther than this many columns from the column that is
#: least; twice as far reaches the next column's own extremum
STEPS, FARTHEST = 4, 0.75
#: samples per period of the low-pass' cut-off that need none between them to find an extremum;
#: twice as many put one between the samples of logs up to twice the rate
DENSE = 8.0


def along_tread(
    windows: FloatArray,
    rate_Hz: float,
    centre: FloatArray,
    speed_m_s: FloatArray,
    acceleration_m_s2: FloatArray,
    cutoff_Hz: FloatArray,
    upsample: int = 2,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Low-passed derivatives along the tread, (n, m x upsample); arguments as of `find_edges`.

    Abscissae from the patch centre [m], first and second derivative by them [1/m, 1/m^2]; noises
    (n, 2) as of `derivatives`.
    """
    first_s, second_s, noises = derivatives(
        window_spectra(windows), rate_Hz, cutoff_Hz, windows.shape[1], upsample
    )
    time = (np.arange(first_s.shape[1]) / upsample - centre[:, None]) / rate_Hz
    speed, acceleration = speed_m_s[:, None], acceleration_m_s2[:, None]
    now = np.maximum(speed + acceleration * time, 0.05 * np.abs(speed) + 1e-9)
    first = first_s / now
    second = (second_s - acceleration * first) / now**2
    return distance_along(time, speed, acceleration), first, second, noises


def find_edges(
    windows: FloatArray,
    rate_Hz: float,
    centre: FloatArray,
    speed_m_s: FloatArray,
    acceleration_m_s2: FloatArray,
    cutoff_Hz: FloatArray,
    half_length_m: FloatArray,
    noise: float,
    upsample: int = 2,
) -> Records:
    """Edges (n,) of EDGES of passages in `windows` (n, m), patch downward, NaN where lost.

    `centre` (n,): column of the patch centre; `half_length_m` (n,): what half of the patch is
    expected to be, to look for extrema; `noise`: standard deviation of a sample; `upsample`: points
    per sample, 2 unless samples are DENSE.
    """
    _, first, second, noises = along_tread(
        windows, rate_Hz, centre, speed_m_s, acceleration_m_s2, cutoff_Hz, upsample
    )
    rate, middle = rate_Hz * upsample, centre * upsample
    reach = SEARCH * half_length_m / speed_m_s * rate
    low, high = middle - reach, middle + reach
    # steepest fall and rise, then the sharpest bends outside of them
    fall, rise = least(first, low, middle), least(-first, middle, high)
    steepest = [np.where(np.isnan(one[0]), middle, one[0]) for one in (fall, rise)]
    entry, leave = least(second, low, steepest[0]), least(second, steepest[1], high)
    times = [(one[0] - middle) / rate for one in (fall, rise, entry, leave)]
    places = [distance_along(time, speed_m_s, acceleration_m_s2) for time in times]
    # an extremum moves by the noise of the next derivative
    wiggle = noise * noises.T / [speed_m_s, speed_m_s**2] / rate**2 * speed_m_s
    return records(
        EDGES,
        length_d2_m=places[3] - places[2],
        length_d2_se_m=np.hypot(wiggle[1] / entry[2], wiggle[1] / leave[2]),
        length_d1_m=places[1] - places[0],
        length_d1_se_m=np.hypot(wiggle[0] / fall[2], wiggle[0] / rise[2]),
        entry_m=places[2],
        exit_m=places[3],
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
    for _ in range(STEPS + 1):
        place = shift
        curvature = bend + place * (third + 0.5 * place * fourth)
        curvature = np.where(curvature > 0.0, curvature, np.nan)
        steep = slope + place * (bend + place * (0.5 * third + place * fourth / 6.0))
        shift = np.clip(place - steep / curvature, begin - FARTHEST, begin + FARTHEST)
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
    block_samples: int

    @classmethod
    def of(
        cls,
        channel: Channel,
        passages: Passages,
        learnt: EdgeForm,
        block_samples: int = BLOCK_SAMPLES,
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
        return cls(channel, passages, forms, rows, motions, work, block_samples)

    def gathered(self, rows: IntArray, reach: FloatArray | None = None) -> Iterator[PatchWindows]:
        """Windows of `rows`, many at a time, of a fit's `reach` if no other is given."""
        return gather_windows(
            self.channel,
            self.passages.sign,
            self.passages.index,
            self.motions,
            self.work["reach"] if reach is None else reach,
            rows,
            self.block_samples,
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
        asked = ~work["vague"] & np.isfinite(fits["length_m"]) & (misfit > LEAST_SHARE * gain)
        for part, sigma, knot in self.by_form(windows.take(asked)):
            self.work["driven"][part.row] = self.forms.gains(knot, part, sigma) > gain


def look_at_some(
    look: PassageForms, most: int, rolls: BoolArray | None = None
) -> tuple[IntArray, float, float]:
    """Fits of at most so many rows, evenly, and which are driven: the rows, scatter, least gain.

    `scatter` is how much larger the residuals of free rows are than the noise of a sample tells;
    a traction that is more than what the form misses of all passages removes the `gain`, in squared
    sigmas of misfit: infinite if there are no free rows. `rolls` (n,): those known to roll freely.
    """
    work, rows = look.work, _spread(look.rows, most)
    kept = list(look.averaged(rows))
    for windows in kept:
        look.fit(windows)
    known = rows[~work["vague"][rows] & np.isfinite(work["fits"]["length_m"][rows])]
    free = _free(look, known) if rolls is None else known[rolls[known]]
    if not free.size:
        return rows, 1.0, np.inf
    among = np.zeros(len(look.passages), bool)
    among[_spread(free, ASKED)] = True
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
            row, motion = plain.row, plain.motion
            shift_s = np.nan_to_num(work["fits"]["shift_m"][row]) / speed[row]
            work["edges"][row] = find_edges(
                plain.values,
                plain.rate_Hz,
                motion["centre"] + shift_s * plain.rate_Hz,
                motion["speed_m_s"],
                motion["acceleration_m_s2"],
                cutoff_Hz[row],
                half_length[row],
                look.passages.noise / np.sqrt(plain.averaged),
                key % 8,
            )
    unsought = ~clear & (work["slip"]["reason"] == TOO_SMALL)
    work["slip"]["reason"][unsought] = NO_FORM


def find_onsets(look: PassageForms, friction: FrictionRatio, scatter: float) -> None:
    """Slip onsets of the rows that are driven, by the brush of this `friction`.

    Some are looked for everywhere. Others start from that of a passage whose length is nearest to
    theirs, as the fit without traction tells it; those that are unlike theirs are looked for
    everywhere, too.
    """
    driven = np.flatnonzero(look.work["driven"])
    if not driven.size:
        return
    first = _spread(driven, SEARCHED)
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
    friction: FrictionRatio,
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
                waves = forms.traction(knot, ratio=friction.value)
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
    work["slip"][of_row] = slip_onsets(told, forms.form_error, friction, scatter)
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
