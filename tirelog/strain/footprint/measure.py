"""Forms and plain edges of all passages, window by window: the inside of `footprint`.

Channel + Passages + EdgeForm
    --windows, block by block; rows of one speed, averaging and form together-->
    Measured, a row per passage
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tirelog.data.recording import Channel
from tirelog.dsp.filters import derivatives, window_spectra
from tirelog.kernels import compiled
from tirelog.strain.footprint.kernels import OWN, distance_along, motion_of
from tirelog.strain.footprint.learn import (
    ENOUGH_STEADY,
    FREE_ROLLING_M_S2,
    LEAST_SPEED_M_S,
    EdgeForm,
)
from tirelog.strain.footprint.refine import (
    FITS,
    FormTables,
    PatchWindows,
    fit_edges,
    gather_windows,
)
from tirelog.strain.footprint.slip_onset import (
    ASKED,
    FINE,
    LEAST_SHARE,
    NO_FORM,
    ONSETS,
    RATIO,
    SEARCHED,
    SLIP,
    SPEED_UNKNOWN,
    TOO_SMALL,
    WORST_SPEED,
    FreeRollingReference,
    FrictionRatio,
    Tractions,
    TractionWaves,
    form_error,
    onset_starts,
    slip_onsets,
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


@compiled
def _along(
    first_s: float, second_s: float, time: float, speed: float, acceleration: float
) -> tuple[float, float]:
    """First and second derivative along the tread out of those in time.

    `time`: from the patch centre.
    """
    now = max(speed + acceleration * time, 0.05 * abs(speed) + 1e-9)
    first = first_s / now
    return first, (second_s - acceleration * first) / now**2


def along_tread(
    windows: FloatArray,
    rate_Hz: float,
    centre: FloatArray,
    speed_m_s: FloatArray,
    acceleration_m_s2: FloatArray,
    cutoff_Hz: FloatArray,
    upsample: int = 2,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Low-passed derivatives along the tread, (n, m x upsample); arguments as of `find_edges`.

    Abscissae from the patch centre [m], first and second derivative by them [1/m, 1/m^2].
    """
    count, spectra = windows.shape[1], window_spectra(windows)
    first_s, second_s, _ = derivatives(spectra, rate_Hz, cutoff_Hz, count, upsample)
    speed, acceleration = speed_m_s[:, None], acceleration_m_s2[:, None]
    time = (np.arange(count * upsample) / upsample - centre[:, None]) / rate_Hz
    now = np.maximum(speed + acceleration * time, 0.05 * np.abs(speed) + 1e-9)
    first = first_s / now
    second = (second_s - acceleration * first) / now**2
    return distance_along(time, speed, acceleration), first, second


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
    first, second, noises = derivatives(
        window_spectra(windows), rate_Hz, cutoff_Hz, windows.shape[1], upsample
    )
    # an extremum moves by the noise of the next derivative
    wiggle = noise * noises
    motion = motion_of(centre, rate_Hz, speed_m_s, acceleration_m_s2)
    found = np.empty(centre.size, EDGES)
    edge_rows(first, second, motion, SEARCH * half_length_m, wiggle, upsample, found)
    return found


@compiled
def least(row: FloatArray, low: float, high: float) -> tuple[float, float, float]:
    """Place, height and curvature of the least value of `row` between two columns.

    Between `low` and `high`, of the quartic through five columns: place in columns (NaN if it lies
    at the border of its range), height, curvature per column^2 (NaN if it is no minimum).

    At six columns per period of the low-pass' cut-off, a place in a passage is true to 0.02 columns
    (rms); a parabola through three: 0.1.
    """
    count = row.size
    first, last = max(int(np.ceil(low)), 0), min(int(np.floor(high)), count - 1)
    index = first
    for k in range(first, last + 1):
        if row[k] < row[index]:
            index = k
    safe = min(max(index, 2), count - 3)
    a, b, c, d, e = row[safe - 2], row[safe - 1], row[safe], row[safe + 1], row[safe + 2]
    # derivatives in the middle by central differences
    slope, bend = (a - e + 8.0 * (d - b)) / 12.0, (16.0 * (b + d) - 30.0 * c - a - e) / 12.0
    third, fourth = (e - a + 2.0 * (b - d)) / 2.0, a + e - 4.0 * (b + d) + 6.0 * c
    shift = float(index - safe)
    for _ in range(STEPS):
        curvature = bend + shift * (third + 0.5 * shift * fourth)
        if not curvature > 0.0:
            return np.nan, row[index], np.nan
        shift -= (slope + shift * (bend + shift * (0.5 * third + shift * fourth / 6.0))) / curvature
        shift = min(max(shift, index - safe - FARTHEST), index - safe + FARTHEST)
    curvature = bend + shift * (third + 0.5 * shift * fourth)
    height = c + shift * (
        slope + shift * (0.5 * bend + shift * (third / 6.0 + shift * fourth / 24.0))
    )
    inner = np.ceil(low) < index < np.floor(high) and 0 < index < count - 1
    return safe + shift if inner else np.nan, height, curvature if curvature > 0.0 else np.nan


@compiled
def edge_rows(
    first_s: FloatArray,
    second_s: FloatArray,
    motion: Records,
    reach_m: FloatArray,
    wiggle: FloatArray,
    upsample: int,
    found: Records,
) -> None:
    """Fills `found` (n,) of EDGES out of derivatives in time.

    The derivatives (n, m x upsample) are looked at within `reach_m` (n,) of the centre; rows move
    as `motion` (n,) says; `wiggle` (n, 2): standard deviations of the second and third derivative's
    noise.
    """
    n, count = first_s.shape
    fall, rise, bend = np.empty(count), np.empty(count), np.empty(count)
    place, squares, heights = np.empty(4), np.empty(4), np.empty(4)
    for row in range(n):
        rate, speed = motion[row]["rate_Hz"] * upsample, motion[row]["speed_m_s"]
        acceleration, middle = motion[row]["acceleration_m_s2"], motion[row]["centre"] * upsample
        reach = reach_m[row] / speed * rate
        for k in range(max(int(middle - reach) - 2, 0), min(int(middle + reach) + 3, count)):
            fall[k], bend[k] = _along(
                first_s[row, k], second_s[row, k], (k - middle) / rate, speed, acceleration
            )
            rise[k] = -fall[k]
        low, high = middle - reach, middle + reach
        for e in range(4):  # steepest fall and rise, then the sharpest bends outside of them
            if e < 2:
                least_of = least(rise if e else fall, middle if e else low, high if e else middle)
            else:
                steepest = middle if np.isnan(place[e - 2]) else place[e - 2]
                least_of = least(bend, steepest if e == 3 else low, high if e == 3 else steepest)
            place[e], heights[e] = least_of[0], least_of[1]
            squares[e] = (wiggle[row, e // 2] / speed ** (e // 2 + 1) / rate**2 / least_of[2]) ** 2
        for e in range(4):
            time = (place[e] - middle) / rate
            place[e] = time * (speed + 0.5 * acceleration * time)
        edges = found[row]
        edges["length_d2_m"] = place[3] - place[2]
        edges["length_d2_se_m"] = np.sqrt(squares[2] + squares[3]) * speed
        edges["length_d1_m"] = place[1] - place[0]
        edges["length_d1_se_m"] = np.sqrt(squares[0] + squares[1]) * speed
        edges["entry_m"], edges["exit_m"] = place[2], place[3]
        edges["entry_height"], edges["exit_height"] = -heights[2], -heights[3]


#: samples are averaged while they lie closer than this share of the half length, for the fit
FIT_STEP = 1.0 / 36.0
#: the same, while the rough place of a slip onset is looked for; twice as coarse, it has half of
#: the samples and may begin beside the onset
ROUGH_STEP = 1.0 / 9.0
#: the gain of a traction is asked for at every so many-th onset: every other coarse one; twice as
#: far apart, an onset between two loses more of its gain
GAIN_EVERY = 2 * FINE
#: rows whose plain edges are worked on at once
ROWS = 256

#: speed and acceleration at the passages of a log, (n,) each
Motions = tuple[FloatArray, FloatArray]


#: what is filled row by row, one row per passage: samples between the edges, whether a traction is
#: seen, edges, fit of the form, and slip onset
MEASURED = np.dtype(
    [("inside", "f8"), ("driven", "?"), ("edges", EDGES), ("fits", FITS), ("slip", SLIP)]
)


def nothing_measured(n: int) -> Records:
    """`n` rows of MEASURED, nothing known."""
    work = np.full(n, np.nan, MEASURED)
    work["driven"], work["slip"]["reason"] = False, NO_FORM
    return work


class Forms:
    """The log's form at the knots of speed.

    Tables of the fit, and of the traction (made when first asked for).
    """

    def __init__(self, learnt: EdgeForm, speed_m_s: FloatArray) -> None:
        reference = learnt.reference
        self.reference = reference.at_speeds(
            reference.knots(float(speed_m_s.min()), float(speed_m_s.max()))
        )
        self.tables = FormTables.of(self.reference, learnt.half_window_m)
        self._half_window_m, self.form_error = learnt.half_window_m, form_error(learnt)
        self._waves: dict[int, TractionWaves] = {}
        self._tractions: dict[tuple[int, int, float], Tractions] = {}

    def nearest(self, speed_m_s: FloatArray) -> IntArray:
        """Number of the form for each speed."""
        number: IntArray = np.argmin(
            np.abs(np.nan_to_num(speed_m_s[:, None]) ** 2 - self.reference.speed_m_s**2), axis=1
        )
        return number

    def traction(self, number: int, every: int = 1, ratio: float = RATIO) -> Tractions:
        """What slip onsets are looked for with at knot `number`, with `every`-th of them.

        `ratio` of sliding to sticking friction.
        """
        key = number, every, ratio
        if key not in self._tractions:
            tables = self.tables
            if number not in self._waves:
                self._waves[number] = TractionWaves.of(self.reference, number, self._half_window_m)
            self._tractions[key] = Tractions(
                tables.columns[number],
                tables.grids[number],
                self._waves[number].table(ratio, every),
                float(tables.half_length_m[number]),
            )
        return self._tractions[key]


@dataclass(frozen=True)
class WindowPlan:
    """What windows of some rows are looked at with: what is known of all passages of a channel.

    `rows` (k,): passages whose speed is known; of all (n,): `motions`, the forms' `number`, whether
    the speed is `vague`, samples that are `averaged` for the fit and `roughly`, and `reach`, half
    of the window that a fit needs [samples].
    """

    channel: Channel
    passages: Passages
    forms: Forms
    rows: IntArray
    motions: Motions
    number: IntArray
    vague: BoolArray
    reach: FloatArray
    averaged: IntArray
    roughly: IntArray
    block_samples: int

    @classmethod
    def of(
        cls,
        channel: Channel,
        passages: Passages,
        learnt: EdgeForm,
        block_samples: int,
        forms: Forms | None = None,
    ) -> WindowPlan:
        """The plan of passages that `learnt` was learnt from: the speed of some is known.

        `forms`: those of `learnt`, if they are at hand.
        """
        rate, speed = channel.axis.rate_Hz, passages.speed_m_s
        rows = np.flatnonzero((speed > LEAST_SPEED_M_S) & np.isfinite(passages.time_s))
        forms = forms or Forms(learnt, speed[rows])
        number = forms.nearest(speed)
        half_length = forms.tables.half_length_m[number]
        with np.errstate(divide="ignore", invalid="ignore"):
            reach = 1.02 * learnt.half_window_m / speed * rate + 2.0
            averaged = _power_of_two(FIT_STEP * half_length * rate / speed)
            roughly = _power_of_two(ROUGH_STEP * half_length * rate / speed)
        return cls(
            channel,
            passages,
            forms,
            rows,
            (speed, np.nan_to_num(passages.acceleration_m_s2)),
            number,
            ~(passages.speed_se_m_s < WORST_SPEED * speed),
            reach,
            averaged,
            roughly,
            block_samples,
        )

    def gathered(self, rows: IntArray, reach: FloatArray | None = None) -> Iterator[PatchWindows]:
        """Windows of `rows`, many at a time, of a fit's `reach` if no other is given."""
        return gather_windows(
            self.channel,
            self.passages.sign,
            self.passages.index,
            self.reach if reach is None else reach,
            rows,
            self.block_samples,
        )

    def by_form(self, windows: PatchWindows) -> Iterator[tuple[PatchWindows, Records, float, int]]:
        """Rows of `windows`, motion, noise of a value and number of each form, a form at a time."""
        for knot, part in _alike(windows, self.number):
            noise = self.passages.noise / np.sqrt(part.averaged)
            yield part, part.motion(*self.motions), noise, knot

    def alike(self, rows: IntArray) -> Iterator[tuple[PatchWindows, Records, float, int]]:
        """As `by_form`, of windows of `rows` that are averaged as a fit's."""
        for windows in self.gathered(rows):
            for averaged, part in _alike(windows, self.averaged):
                yield from self.by_form(part.reduced(averaged))

    def seek_driven(
        self, windows: PatchWindows, fits: Records, work: Records, usual: FreeRollingReference
    ) -> None:
        """Fill `driven` of the rows of `windows`, which are averaged as a fit's.

        Driven are rows that show a traction beyond what the form misses of free ones. `fits`:
        theirs, row by row; `usual`: what free ones leave.
        """
        known = ~self.vague[windows.row] & np.isfinite(fits["length_m"])
        # no row with less misfit than that can hold an onset
        misfit = (fits["chi2"] - usual.scatter**2) * np.maximum(fits["used"] - OWN, 1.0)
        asked = np.flatnonzero(known & (misfit > LEAST_SHARE * usual.gain))
        if not asked.size:
            return
        for part, motion, sigma, knot in self.by_form(windows.take(asked)):
            gains = self.forms.traction(knot, GAIN_EVERY).gains(part, motion, sigma)
            work["driven"][part.row] = gains > usual.gain


def look_at_some(
    look: WindowPlan, most: int, rolls: BoolArray | None = None
) -> tuple[IntArray, Records, FreeRollingReference | None]:
    """Fits of at most so many rows, evenly, what free ones of them leave, and which are driven.

    The rows, what was measured of them, and what free ones leave, None if there are none to ask.
    `rolls` (n,): those known to roll freely.
    """
    work = nothing_measured(len(look.passages))
    rows, kept = _spread(look.rows, most), []
    for windows in look.gathered(rows):
        for averaged, part in _alike(windows, look.averaged):
            reduced = part.reduced(averaged)
            kept.append((reduced, _fit(look, reduced, work)))
    known = rows[~look.vague[rows] & np.isfinite(work["fits"]["length_m"][rows])]
    free = _free(look, known) if rolls is None else known[rolls[known]]
    if not free.size:
        return rows, work, None
    gains = []
    among = np.zeros(len(look.passages), bool)
    among[_spread(free, ASKED)] = True
    for windows, _ in kept:
        for part, motion, sigma, knot in look.by_form(windows.take(among[windows.row])):
            gains.append(look.forms.traction(knot, GAIN_EVERY).gains(part, motion, sigma))
    usual = FreeRollingReference.of(work["fits"]["chi2"][free], np.concatenate(gains))
    for windows, fits in kept:
        look.seek_driven(windows, fits, work, usual)
    return rows, work, usual


def measure_windows(
    look: WindowPlan,
    cutoff_Hz: FloatArray,
    clear: BoolArray,
    work: Records,
    usual: FreeRollingReference | None,
    rows: IntArray,
) -> None:
    """Fill all of `work` but slip onsets, of the `rows`, whose speed is known.

    `cutoff_Hz` (n,) of the plain edges' low-pass. Driven rows are sought if `usual` is known,
    where the form is `clear` (n,): beside one that is none of a tire a traction is no sign of slip.
    """
    rate, speed = look.channel.axis.rate_Hz, look.passages.speed_m_s
    half_length = look.forms.tables.half_length_m[look.number]
    with np.errstate(divide="ignore", invalid="ignore"):
        # the low-pass needs this many samples per period of its cut-off; above, samples are
        # averaged; twice as many take twice as long
        for_plain = _power_of_two(rate / (10.0 * cutoff_Hz))
        upsample = np.where(rate / for_plain < DENSE * cutoff_Hz, 2, 1)
        reach = (SEARCH * half_length + 2.5 * speed / cutoff_Hz) / speed * rate + 2.0
    work["inside"][rows] = (2.0 * half_length * rate / speed)[rows]
    for windows in look.gathered(rows, np.maximum(look.reach, reach)):
        for averaged, part in _alike(windows, look.averaged):
            reduced = part.reduced(averaged)
            fits = _fit(look, reduced, work)
            sought = clear[part.row]
            if usual is not None and sought.any():
                look.seek_driven(reduced.take(sought), fits[sought], work, usual)
        for key, part in _alike(windows, 8 * for_plain + upsample):
            plain = part.reduced(key // 8)
            for low in range(0, len(plain.row), ROWS):
                rows_alike = plain.take(slice(low, low + ROWS))
                row, per_s = rows_alike.row, rows_alike.rate_Hz
                shift_s = np.nan_to_num(work["fits"]["shift_m"][row]) / speed[row]
                work["edges"][row] = find_edges(
                    rows_alike.values,
                    per_s,
                    rows_alike.centre + shift_s * per_s,
                    speed[row],
                    look.motions[1][row],
                    cutoff_Hz[row],
                    half_length[row],
                    look.passages.noise / np.sqrt(rows_alike.averaged),
                    key % 8,
                )
    unsought = ~clear & (work["slip"]["reason"] == TOO_SMALL)
    work["slip"]["reason"][unsought] = NO_FORM


def find_onsets(
    look: WindowPlan, work: Records, usual: FreeRollingReference, friction: FrictionRatio
) -> None:
    """Slip onsets of the rows of `work` that are driven, by the brush of this `friction`.

    Some are looked for everywhere. Others start from that of a passage whose length is nearest to
    theirs, as the fit without traction tells it; of those that are unlike theirs again some are
    looked for everywhere and the others start from these, and so on.
    """
    scatter, rest = usual.scatter, np.flatnonzero(work["driven"])
    while rest.size:
        asked = _spread(rest, SEARCHED)
        known, starts = _searched(look, work, asked, friction, scatter)
        rest = np.setdiff1d(rest, asked, assume_unique=True)
        other = (
            _followed(look, work, rest, known, starts, friction, scatter) if known.size else rest
        )
        # onsets that start from others are given up if more than this share is unlike; what is then
        # looked for everywhere takes five times as long
        if other.size > 0.7 * rest.size:  # these are not alike
            _searched(look, work, other, friction, scatter)
            return
        rest = other


def _spread(rows: IntArray, most: int) -> IntArray:
    """At most so many of `rows`, evenly."""
    return rows[np.linspace(0, rows.size - 1, min(most, rows.size)).astype(np.int64)]


def _form_shift(look: WindowPlan, work: Records, windows: PatchWindows, knot: int) -> FloatArray:
    """Where the fits of `windows` put the form, beside its own place at a `knot` [m]."""
    shift_m: FloatArray = work["fits"]["shift_m"][windows.row] - look.forms.tables.shift_m[knot]
    return np.nan_to_num(shift_m)


def _searched(
    look: WindowPlan, work: Records, rows: IntArray, friction: FrictionRatio, scatter: float
) -> tuple[IntArray, Records]:
    """Fill the onsets of `rows`, looked for everywhere; those that others may start from.

    Their rows (k,), and the starts, (k,) of FOLLOWED.
    """
    further, parts = look.roughly // look.averaged, [np.empty(0, ONSETS)]
    for windows, _, sigma, knot in look.alike(rows):
        tractions = look.forms.traction(knot, ratio=friction.value)
        for times, part in _alike(windows, further):
            shift, motion = _form_shift(look, work, part, knot), part.motion(*look.motions)
            found = tractions.onsets(part, motion, part.reduced(times), shift, sigma, scatter)
            L = tractions.half_length_m
            parts.append(records(ONSETS, row=part.row, found=found, half_length_m=L, shift_m=shift))
    onsets = np.concatenate(parts)
    told = slip_onsets(onsets, look.forms.form_error, friction, scatter)
    work["slip"][onsets["row"]] = told
    worth, starts = onset_starts(onsets, told, scatter)
    return onsets["row"][worth], starts[worth]


def _followed(
    look: WindowPlan,
    work: Records,
    rows: IntArray,
    known: IntArray,
    starts: Records,
    friction: FrictionRatio,
    scatter: float,
) -> IntArray:
    """Fill the onsets of `rows` that are like those of the rows `known`; the other rows."""
    length, parts = work["fits"]["length_m"], [np.empty(0, ONSETS)]
    for windows, motion, sigma, knot in look.alike(rows):
        tractions = look.forms.traction(knot, ratio=friction.value)
        nearest = np.argmin(np.abs(length[windows.row][:, None] - length[known]), axis=1)
        shift = _form_shift(look, work, windows, knot)
        found = tractions.followed(windows, motion, shift, starts[nearest], sigma, scatter)
        L = tractions.half_length_m
        parts.append(records(ONSETS, row=windows.row, found=found, half_length_m=L, shift_m=shift))
    onsets = np.concatenate(parts)
    alike = np.isfinite(onsets["found"]["best"])
    kept = onsets[alike]
    work["slip"][kept["row"]] = slip_onsets(kept, look.forms.form_error, friction, scatter)
    return np.sort(onsets["row"][~alike])


def _free(look: WindowPlan, rows: IntArray) -> IntArray:
    """Those of `rows` that no quality word spoils and that are at steady speed.

    All clean ones, or all of `rows`, if those are too few.
    """
    clean = rows[good(look.passages.quality[rows])]
    steady = clean[np.abs(look.motions[1][clean]) < FREE_ROLLING_M_S2]
    return next((some for some in (steady, clean) if some.size >= ENOUGH_STEADY), rows)


def _alike(windows: PatchWindows, keys: IntArray) -> Iterator[tuple[int, PatchWindows]]:
    """The rows of `windows` in groups of equal `keys` (one row per passage)."""
    own = keys[windows.row]
    for key in np.unique(own):
        alike = own == key
        yield int(key), windows if alike.all() else windows.take(alike)


def _power_of_two(values: FloatArray) -> IntArray:
    """The largest power of two not above each value, at least 1 and at most 1024."""
    return (2.0 ** np.floor(np.log2(np.clip(np.nan_to_num(values, nan=1.0), 1.0, 1024.0)))).astype(
        np.int64
    )


def _fit(look: WindowPlan, windows: PatchWindows, work: Records) -> Records:
    """Fill the fits of rows that share averaging, which are given back row by row."""
    row = windows.row
    fits = fit_edges(
        windows,
        windows.motion(*look.motions),
        look.forms.tables,
        look.number[row],
        look.passages.noise,
    )
    work["fits"][row] = fits
    known = np.isfinite(fits["length_m"])
    work["slip"]["reason"][row] = np.where(
        known, np.where(look.vague[row], SPEED_UNKNOWN, TOO_SMALL), NO_FORM
    )
    return fits
