"""Forms and plain edges of all passages, window by window: the inside of `footprint`.

Channel + Passages + Learnt
    --windows, block by block; rows of one speed, averaging and form together-->
    Measured, a row per passage
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel
from tirelog.strain.footprint.fit import FormTables, PassageFits, fit_edges
from tirelog.strain.footprint.learn import ENOUGH_STEADY, FREE_ROLLING_M_S2, Learnt
from tirelog.strain.footprint.plain_edges import DENSE, SEARCH, Edges, find_edges
from tirelog.strain.footprint.slip_onset import (
    ASKED,
    FINE,
    FOLLOWED,
    NO_FORM,
    SEARCHED,
    SPEED_UNKNOWN,
    TOO_SMALL,
    WORST_SPEED,
    SlipOnset,
    Tractions,
    Usual,
    form_error,
    traction_table,
)
from tirelog.strain.footprint.windows import PatchWindows, gather_windows
from tirelog.strain.passages.find import Passages
from tirelog.vocabulary.arrays import FloatArray, IntArray, Records
from tirelog.vocabulary.quality import good

#: a slower wheel's windows are not cut out (its passage takes seconds); twice as much leaves out
#: wheels that creep up to 0.6 m/s
LEAST_SPEED_M_S = 0.3
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
    edges: dict[str, FloatArray]
    fits: PassageFits
    slip: SlipOnset
    driven: NDArray[np.bool_]
    usual: Usual | None = None

    @classmethod
    def empty(cls, n: int) -> Measured:
        """`n` rows, nothing known."""
        edges = {f.name: np.full(n, np.nan) for f in fields(Edges)}
        return cls(
            np.full(n, np.nan), edges, PassageFits.empty(n), SlipOnset.none(n), np.zeros(n, bool)
        )


class Forms:
    """The log's form at the knots of speed.

    Tables of the fit, and of the traction (made when first asked for).
    """

    def __init__(self, learnt: Learnt, speed_m_s: FloatArray) -> None:
        reference = learnt.reference
        self.reference = reference.at_speeds(
            reference.knots(float(speed_m_s.min()), float(speed_m_s.max()))
        )
        self.tables = FormTables.of(self.reference, learnt.half_window_m)
        self._half_window_m, self._form_error = learnt.half_window_m, form_error(learnt)
        self._tractions: dict[tuple[int, int], Tractions] = {}

    def nearest(self, speed_m_s: FloatArray) -> IntArray:
        """Number of the form for each speed."""
        number: IntArray = np.argmin(
            np.abs(np.nan_to_num(speed_m_s[:, None]) ** 2 - self.reference.speed_m_s**2), axis=1
        )
        return number

    def traction(self, number: int, every: int = 1) -> Tractions:
        """What slip onsets are looked for with at knot `number`, with `every`-th of them."""
        key = number, every
        if key not in self._tractions:
            tables = self.tables
            self._tractions[key] = Tractions(
                tables.columns[number],
                tables.grids[number],
                traction_table(self.reference, number, self._half_window_m, every),
                float(tables.half_length_m[number]),
                self._form_error,
            )
        return self._tractions[key]


def measure_windows(
    channel: Channel,
    passages: Passages,
    learnt: Learnt,
    cutoff_Hz: FloatArray,
    work: Measured,
    block_samples: int,
) -> Look | None:
    """What `find_onsets` takes, after filling all of `work` but slip onsets.

    Filled are the rows whose speed is known; None without such rows. `cutoff_Hz` (n,) of the plain
    edges' low-pass.
    """
    rate, speed = channel.axis.rate_Hz, passages.speed_m_s
    rows = np.flatnonzero((speed > LEAST_SPEED_M_S) & np.isfinite(passages.time_s))
    if not rows.size:
        return None
    motion = speed, np.nan_to_num(passages.acceleration_m_s2)
    vague = ~(passages.speed_se_m_s < WORST_SPEED * speed)
    forms = Forms(learnt, speed[rows])
    number = forms.nearest(speed)
    half_length = forms.tables.half_length_m[number]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = (
            np.maximum(1.02 * learnt.half_window_m, SEARCH * half_length + 2.5 * speed / cutoff_Hz)
            / speed
            * rate
            + 2.0
        )
        for_fit = _power_of_two(FIT_STEP * half_length * rate / speed)
        for_search = _power_of_two(ROUGH_STEP * half_length * rate / speed)
        for_plain = _power_of_two(rate / (PLAIN_OVERSAMPLING * cutoff_Hz))
        upsample = np.where(rate / for_plain < DENSE * cutoff_Hz, 2, 1)
    work.inside[rows] = (2.0 * half_length * rate / speed)[rows]
    for windows in gather_windows(
        channel, passages.sign, passages.index, reach, rows, block_samples
    ):
        for averaged, part in _alike(windows, for_fit):
            _fit_alike(
                part.reduced(averaged), passages.noise, motion, vague, forms, number[part.row], work
            )
        for key, part in _alike(windows, 8 * for_plain + upsample):
            plain = part.reduced(key // 8)
            for low in range(0, len(plain.row), ROWS):
                _edges_alike(
                    plain.take(slice(low, low + ROWS)),
                    passages.noise,
                    motion,
                    cutoff_Hz,
                    half_length,
                    key % 8,
                    work,
                )
    look = Look(channel, passages, forms, motion, number, reach, for_fit, for_search, block_samples)
    _seek_driven(look, rows[~vague[rows] & np.isfinite(work.fits.length_m[rows])], work)
    return look


@dataclass(frozen=True)
class Look:
    """Windows of some rows for the tractions: what `measure_windows` knows of all rows (n,)."""

    channel: Channel
    passages: Passages
    forms: Forms
    motions: Motions
    number: IntArray
    reach: FloatArray
    averaged: IntArray
    roughly: IntArray
    block_samples: int

    def alike(self, rows: IntArray) -> Iterator[tuple[PatchWindows, Records, float, int]]:
        """Windows, motion, noise of a value and form's number of `rows`, alike ones together."""
        gathered = gather_windows(
            self.channel,
            self.passages.sign,
            self.passages.index,
            self.reach,
            rows,
            self.block_samples,
        )
        for windows in gathered:
            for key, part in _alike(
                windows, self.averaged * len(self.forms.reference.shapes) + self.number
            ):
                averaged, knot = divmod(key, len(self.forms.reference.shapes))
                kept = part.reduced(averaged)
                yield (
                    kept,
                    kept.motion(*self.motions),
                    self.passages.noise / np.sqrt(kept.averaged),
                    knot,
                )


def _seek_driven(look: Look, rows: IntArray, work: Measured) -> None:
    """Fill `driven` and `usual` of `work` for `rows` (m,).

    Driven are rows that show a traction beyond what the form misses of free ones.
    """
    free = _free(look, rows)
    if not free.size:
        return
    asked = _spread(free, ASKED)
    gains = [
        look.forms.traction(knot, GAIN_EVERY).gains(windows, motion, sigma)
        for windows, motion, sigma, knot in look.alike(asked)
    ]
    usual = Usual.of(work.fits.chi2[free], np.concatenate(gains))
    for windows, motion, sigma, knot in look.alike(rows[usual.worth_a_look(work.fits)[rows]]):
        work.driven[windows.row] = (
            look.forms.traction(knot, GAIN_EVERY).gains(windows, motion, sigma) > usual.gain
        )
    work.usual = usual


def find_onsets(look: Look, work: Measured, clear: NDArray[np.bool_]) -> None:
    """Slip onsets of the rows of `work` that are driven, where their form is `clear` (n,).

    Some are looked for everywhere. Others start from that of a passage whose length is nearest to
    theirs, as the fit without traction tells it, and are looked for everywhere if theirs is unlike.
    """
    if work.usual is None:
        return
    work.slip.reason[work.driven & ~clear] = NO_FORM
    rows = np.flatnonzero(work.driven & clear)
    asked = _spread(rows, SEARCHED)
    known, starts = _searched(look, work, asked, work.usual.scatter)
    rest = np.setdiff1d(rows, asked, assume_unique=True)
    if known.size:
        rest = _followed(look, work, rest, known, starts, work.usual.scatter)
    _searched(look, work, rest, work.usual.scatter)


def _spread(rows: IntArray, most: int) -> IntArray:
    """At most so many of `rows`, evenly."""
    return rows[np.linspace(0, rows.size - 1, min(most, rows.size)).astype(np.int64)]


def _form_shift(look: Look, work: Measured, windows: PatchWindows, knot: int) -> FloatArray:
    """Where the fits of `windows` put the form, beside its own place at a `knot` [m]."""
    shift_m: FloatArray = work.fits.shift_m[windows.row] - look.forms.tables.shift_m[knot]
    return np.nan_to_num(shift_m)


def _searched(
    look: Look, work: Measured, rows: IntArray, scatter: float
) -> tuple[IntArray, Records]:
    """Fill the onsets of `rows`, looked for everywhere; those that others may start from.

    Their rows (k,), and the starts, (k,) of FOLLOWED.
    """
    further = look.roughly // look.averaged
    known, starts = [rows[:0]], [np.empty(0, FOLLOWED)]
    for windows, _, sigma, knot in look.alike(rows):
        tractions = look.forms.traction(knot)
        for times, part in _alike(windows, further):
            shift, motion = _form_shift(look, work, part, knot), part.motion(*look.motions)
            found = tractions.onsets(part, motion, part.reduced(times), shift, sigma, scatter)
            work.slip.put(part.row, tractions.told(found, scatter))
            worth, start = tractions.worth_following(found, shift, scatter)
            known.append(part.row[worth])
            starts.append(start[worth])
    return np.concatenate(known), np.concatenate(starts)


def _followed(
    look: Look, work: Measured, rows: IntArray, known: IntArray, starts: Records, scatter: float
) -> IntArray:
    """Fill the onsets of `rows` that are like those of the rows `known`; the other rows."""
    other = [rows[:0]]
    for windows, motion, sigma, knot in look.alike(rows):
        tractions, length = look.forms.traction(knot), work.fits.length_m
        nearest = np.argmin(np.abs(length[windows.row][:, None] - length[known]), axis=1)
        shift = _form_shift(look, work, windows, knot)
        found = tractions.followed(windows, motion, shift, starts[nearest], sigma, scatter)
        alike = np.isfinite(found["best"])
        work.slip.put(windows.row[alike], tractions.told(found[alike], scatter))
        other.append(windows.row[~alike])
    return np.sort(np.concatenate(other))


def _free(look: Look, rows: IntArray) -> IntArray:
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


def _fit_alike(
    windows: PatchWindows,
    noise: float,
    motions: Motions,
    vague: NDArray[np.bool_],
    forms: Forms,
    number: IntArray,
    work: Measured,
) -> None:
    """Fill the fits of rows that share averaging.

    `number` (rows,) of their forms; `vague` (n,): whether a passage's speed is vague.
    """
    row = windows.row
    fits = fit_edges(windows, windows.motion(*motions), forms.tables, number, noise)
    work.fits.put(row, fits)
    known = np.isfinite(fits.length_m)
    work.slip.reason[row] = np.where(known, np.where(vague[row], SPEED_UNKNOWN, TOO_SMALL), NO_FORM)


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
    for name, column in work.edges.items():
        column[row] = getattr(found, name)
