"""Forms and plain edges of all passages, window by window: the inside of `footprint`.

Channel + Passages + EdgeForm
    --windows, block by block; rows of one speed, averaging and form together-->
    Measured, a row per passage
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel
from tirelog.strain.footprint.learn import (
    ENOUGH_STEADY,
    FREE_ROLLING_M_S2,
    LEAST_SPEED_M_S,
    EdgeForm,
)
from tirelog.strain.footprint.plain_edges import DENSE, SEARCH, Edges, find_edges
from tirelog.strain.footprint.refine import (
    FormTables,
    PassageFits,
    PatchWindows,
    fit_edges,
    gather_windows,
)
from tirelog.strain.footprint.slip_onset import (
    ASKED,
    FINE,
    NO_FORM,
    RATIO,
    SEARCHED,
    SPEED_UNKNOWN,
    TOO_SMALL,
    WORST_SPEED,
    FoundOnsets,
    FreeRollingReference,
    FrictionRatio,
    SlipOnset,
    Tractions,
    TractionWaves,
    form_error,
)
from tirelog.strain.passages.find import Passages
from tirelog.vocabulary.arrays import FloatArray, IntArray, Records
from tirelog.vocabulary.quality import good

#: samples are averaged while they lie closer than this share of the half length, for the fit
FIT_STEP = 1.0 / 36.0
#: the same, while the rough place of a slip onset is looked for; twice as coarse, it has half of
#: the samples and may begin beside the onset
ROUGH_STEP = 1.0 / 9.0
#: the gain of a traction is asked for at every so many-th onset: every other coarse one; twice as
#: far apart, an onset between two loses more of its gain
GAIN_EVERY = 2 * FINE
#: the low-pass needs this many samples per period of its cut-off; above, samples are averaged;
#: twice as many take twice as long
PLAIN_OVERSAMPLING = 10.0
#: onsets that start from others are given up if more than this share is unlike; what is then looked
#: for everywhere takes five times as long
FOLLOWING = 0.7
#: rows whose plain edges are worked on at once
ROWS = 256

#: speed and acceleration at the passages of a log, (n,) each
Motions = tuple[FloatArray, FloatArray]


@dataclass
class Measured:
    """What is filled row by row, one row per passage.

    `inside`: samples between the edges, (n,); `driven`: whether a traction is seen, (n,); `usual`:
    what free passages leave, None if there are none to ask.
    """

    inside: FloatArray
    edges: Edges
    fits: PassageFits
    slip: SlipOnset
    driven: NDArray[np.bool_]
    usual: FreeRollingReference | None = None

    @classmethod
    def empty(cls, n: int) -> Measured:
        """`n` rows, nothing known."""
        return cls(
            np.full(n, np.nan),
            Edges.empty(n),
            PassageFits.empty(n),
            SlipOnset.none(n),
            np.zeros(n, bool),
        )

    def take(self, rows: IntArray) -> Measured:
        """The passages `rows` alone."""
        return Measured(
            self.inside[rows],
            self.edges.take(rows),
            self.fits.take(rows),
            self.slip.take(rows),
            self.driven[rows],
            self.usual,
        )

    def put(self, rows: IntArray, other: Measured) -> None:
        """Write the passages of `other` at the ordinals `rows`."""
        self.inside[rows], self.driven[rows] = other.inside, other.driven
        self.edges.put(rows, other.edges)
        self.fits.put(rows, other.fits)
        self.slip.put(rows, other.slip)


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
    vague: NDArray[np.bool_]
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
    ) -> WindowPlan | None:
        """None if no passage's speed is known. `forms`: those of `learnt`, if they are at hand."""
        rate, speed = channel.axis.rate_Hz, passages.speed_m_s
        rows = np.flatnonzero((speed > LEAST_SPEED_M_S) & np.isfinite(passages.time_s))
        if not rows.size:
            return None
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

    def seek_driven(self, windows: PatchWindows, fits: PassageFits, work: Measured) -> None:
        """Fill `driven` of the rows of `windows`, which are averaged as a fit's.

        Driven are rows that show a traction beyond what the form misses of free ones. `fits`:
        theirs, row by row; `work.usual` is known.
        """
        assert work.usual is not None
        known = ~self.vague[windows.row] & np.isfinite(fits.length_m)
        asked = np.flatnonzero(known & work.usual.worth_a_look(fits))
        if not asked.size:
            return
        for part, motion, sigma, knot in self.by_form(windows.take(asked)):
            gains = self.forms.traction(knot, GAIN_EVERY).gains(part, motion, sigma)
            work.driven[part.row] = gains > work.usual.gain


def look_at_some(
    look: WindowPlan, most: int, rolls: NDArray[np.bool_] | None = None
) -> tuple[IntArray, Measured]:
    """Fits of at most so many rows, evenly, what free ones of them leave, and which are driven.

    The rows, and what was measured of them. `rolls` (n,): those known to roll freely.
    """
    work = Measured.empty(len(look.passages))
    rows, kept = _spread(look.rows, most), []
    for windows in look.gathered(rows):
        for averaged, part in _alike(windows, look.averaged):
            reduced = part.reduced(averaged)
            kept.append((reduced, _fit(look, reduced, work)))
    known = rows[~look.vague[rows] & np.isfinite(work.fits.length_m[rows])]
    free = _free(look, known) if rolls is None else known[rolls[known]]
    if not free.size:
        return rows, work
    gains = []
    among = np.zeros(len(look.passages), bool)
    among[_spread(free, ASKED)] = True
    for windows, _ in kept:
        for part, motion, sigma, knot in look.by_form(windows.take(among[windows.row])):
            gains.append(look.forms.traction(knot, GAIN_EVERY).gains(part, motion, sigma))
    work.usual = FreeRollingReference.of(work.fits.chi2[free], np.concatenate(gains))
    for windows, fits in kept:
        look.seek_driven(windows, fits, work)
    return rows, work


def measure_windows(
    look: WindowPlan,
    cutoff_Hz: FloatArray,
    clear: NDArray[np.bool_],
    work: Measured,
    rows: IntArray,
) -> None:
    """Fill all of `work` but slip onsets, of the `rows`, whose speed is known.

    `cutoff_Hz` (n,) of the plain edges' low-pass. Driven rows are sought if `work.usual` is known,
    where the form is `clear` (n,): beside one that is none of a tire a traction is no sign of slip.
    """
    rate, speed = look.channel.axis.rate_Hz, look.passages.speed_m_s
    half_length = look.forms.tables.half_length_m[look.number]
    with np.errstate(divide="ignore", invalid="ignore"):
        for_plain = _power_of_two(rate / (PLAIN_OVERSAMPLING * cutoff_Hz))
        upsample = np.where(rate / for_plain < DENSE * cutoff_Hz, 2, 1)
        reach = (SEARCH * half_length + 2.5 * speed / cutoff_Hz) / speed * rate + 2.0
    work.inside[rows] = (2.0 * half_length * rate / speed)[rows]
    for windows in look.gathered(rows, np.maximum(look.reach, reach)):
        for averaged, part in _alike(windows, look.averaged):
            reduced = part.reduced(averaged)
            fits = _fit(look, reduced, work)
            sought = clear[part.row]
            if work.usual is not None and sought.all():
                look.seek_driven(reduced, fits, work)
            elif work.usual is not None and sought.any():
                look.seek_driven(reduced.take(sought), fits.take(sought), work)
        for key, part in _alike(windows, 8 * for_plain + upsample):
            plain = part.reduced(key // 8)
            for low in range(0, len(plain.row), ROWS):
                _edges_alike(
                    plain.take(slice(low, low + ROWS)),
                    look.passages.noise,
                    look.motions,
                    cutoff_Hz,
                    half_length,
                    key % 8,
                    work,
                )
    unsought = ~clear & (work.slip.reason == TOO_SMALL)
    work.slip.reason[unsought] = NO_FORM


def find_onsets(look: WindowPlan, work: Measured, friction: FrictionRatio) -> None:
    """Slip onsets of the rows of `work` that are driven, by the brush of this `friction`.

    Some are looked for everywhere. Others start from that of a passage whose length is nearest to
    theirs, as the fit without traction tells it; of those that are unlike theirs again some are
    looked for everywhere and the others start from these, and so on.
    """
    if work.usual is None:
        return
    scatter, rest = work.usual.scatter, np.flatnonzero(work.driven)
    while rest.size:
        asked = _spread(rest, SEARCHED)
        known, starts = _searched(look, work, asked, friction, scatter)
        rest = np.setdiff1d(rest, asked, assume_unique=True)
        other = (
            _followed(look, work, rest, known, starts, friction, scatter) if known.size else rest
        )
        if other.size > FOLLOWING * rest.size:  # these are not alike
            _searched(look, work, other, friction, scatter)
            return
        rest = other


def _spread(rows: IntArray, most: int) -> IntArray:
    """At most so many of `rows`, evenly."""
    return rows[np.linspace(0, rows.size - 1, min(most, rows.size)).astype(np.int64)]


def _form_shift(look: WindowPlan, work: Measured, windows: PatchWindows, knot: int) -> FloatArray:
    """Where the fits of `windows` put the form, beside its own place at a `knot` [m]."""
    shift_m: FloatArray = work.fits.shift_m[windows.row] - look.forms.tables.shift_m[knot]
    return np.nan_to_num(shift_m)


def _searched(
    look: WindowPlan, work: Measured, rows: IntArray, friction: FrictionRatio, scatter: float
) -> tuple[IntArray, Records]:
    """Fill the onsets of `rows`, looked for everywhere; those that others may start from.

    Their rows (k,), and the starts, (k,) of FOLLOWED.
    """
    further, parts = look.roughly // look.averaged, [FoundOnsets.none()]
    for windows, _, sigma, knot in look.alike(rows):
        tractions = look.forms.traction(knot, ratio=friction.value)
        for times, part in _alike(windows, further):
            shift, motion = _form_shift(look, work, part, knot), part.motion(*look.motions)
            found = tractions.onsets(part, motion, part.reduced(times), shift, sigma, scatter)
            parts.append(FoundOnsets(part.row, found, tractions.half_lengths_m(part), shift))
    onsets = FoundOnsets.concatenate(parts)
    told = onsets.told(look.forms.form_error, friction, scatter)
    work.slip.put(onsets.row, told)
    worth, starts = onsets.starts(told, scatter)
    return onsets.row[worth], starts[worth]


def _followed(
    look: WindowPlan,
    work: Measured,
    rows: IntArray,
    known: IntArray,
    starts: Records,
    friction: FrictionRatio,
    scatter: float,
) -> IntArray:
    """Fill the onsets of `rows` that are like those of the rows `known`; the other rows."""
    length, parts = work.fits.length_m, [FoundOnsets.none()]
    for windows, motion, sigma, knot in look.alike(rows):
        tractions = look.forms.traction(knot, ratio=friction.value)
        nearest = np.argmin(np.abs(length[windows.row][:, None] - length[known]), axis=1)
        shift = _form_shift(look, work, windows, knot)
        found = tractions.followed(windows, motion, shift, starts[nearest], sigma, scatter)
        parts.append(FoundOnsets(windows.row, found, tractions.half_lengths_m(windows), shift))
    onsets = FoundOnsets.concatenate(parts)
    alike = np.isfinite(onsets.found["best"])
    kept = onsets.take(alike)
    work.slip.put(kept.row, kept.told(look.forms.form_error, friction, scatter))
    return np.sort(onsets.row[~alike])


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


def _fit(look: WindowPlan, windows: PatchWindows, work: Measured) -> PassageFits:
    """Fill the fits of rows that share averaging, which are given back row by row."""
    row = windows.row
    fits = fit_edges(
        windows,
        windows.motion(*look.motions),
        look.forms.tables,
        look.number[row],
        look.passages.noise,
    )
    work.fits.put(row, fits)
    known = np.isfinite(fits.length_m)
    work.slip.reason[row] = np.where(
        known, np.where(look.vague[row], SPEED_UNKNOWN, TOO_SMALL), NO_FORM
    )
    return fits


def _edges_alike(
    windows: PatchWindows,
    noise: float,
    motions: Motions,
    cutoff_Hz: FloatArray,
    half_length_m: FloatArray,
    upsample: int,
    work: Measured,
) -> None:
    """Plain edges of rows that share averaging."""
    row = windows.row
    speed, acceleration = motions[0][row], motions[1][row]
    middle = windows.centre + np.nan_to_num(work.fits.shift_m[row]) / speed * windows.rate_Hz
    sigma = noise / np.sqrt(windows.averaged)
    found = find_edges(
        windows.values,
        windows.rate_Hz,
        middle,
        speed,
        acceleration,
        cutoff_Hz[row],
        half_length_m[row],
        sigma,
        upsample,
    )
    work.edges.put(row, found)
