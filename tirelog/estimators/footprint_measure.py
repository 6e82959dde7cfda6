"""Forms and plain edges of all passages, window by window: the inside of `footprint`.

Channel + Passages + Learnt --windows, block by block; rows of one speed, averaging and form together--> Measured, a row a passage
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from tirelog.estimators.edges import DENSE, SEARCH, Edges, find_edges
from tirelog.estimators.footprint_fit import FormTables, PassageFits, fit
from tirelog.estimators.footprint_learn import Learnt
from tirelog.estimators.footprint_windows import PatchWindows, gather_windows
from tirelog.estimators.passages import Passages
from tirelog.estimators.slip_onset import (
    LEAST_GAIN,
    NO_FORM,
    SPEED_UNKNOWN,
    TOO_SMALL,
    WORST_SPEED,
    SlipOnset,
    Tractions,
    traction_table,
    worth_a_look,
)
from tirelog.recording import Channel, FloatArray, IntArray

#: a slower wheel's windows are not cut out (its passage takes seconds)
LEAST_SPEED_M_S = 0.3
#: samples are averaged while they lie closer than this share of the half length, for the fit
FIT_STEP = 1.0 / 36.0
#: the low-pass needs this many samples a period of its cut-off; above, samples are averaged
PLAIN_OVERSAMPLING = 10.0
#: rows whose plain edges are worked on at once
ROWS = 256

#: speed and acceleration at the passages of a log, (n,) each
Motions = tuple[FloatArray, FloatArray]


@dataclass
class Measured:
    """What is filled row by row, a row a passage; `inside`: samples between the edges, (n,)."""

    inside: FloatArray
    edges: dict[str, FloatArray]
    fits: PassageFits
    slip: SlipOnset

    @classmethod
    def empty(cls, n: int) -> Measured:
        """`n` rows, nothing known."""
        return cls(np.full(n, np.nan), {f.name: np.full(n, np.nan) for f in fields(Edges)}, PassageFits.empty(n), SlipOnset.none(n))


class Forms:
    """The log's form at the knots of speed: tables of the fit, and of the traction (made when first asked for)."""

    def __init__(self, learnt: Learnt, speed_m_s: FloatArray) -> None:
        reference = learnt.reference
        self.reference = reference.at_speeds(reference.knots(float(speed_m_s.min()), float(speed_m_s.max())))
        self.tables = FormTables.of(self.reference, learnt.half_window_m)
        self.scatter = learnt.scatter(np.array([reference.misfit]))
        self._half_window_m = learnt.half_window_m
        self._tractions: dict[int, Tractions] = {}

    def nearest(self, speed_m_s: FloatArray) -> IntArray:
        """Number of the form for each speed."""
        return np.argmin(np.abs(np.nan_to_num(speed_m_s[:, None]) ** 2 - self.reference.speed_m_s**2), axis=1)

    def traction(self, number: int) -> Tractions:
        """What slip onsets are looked for with at knot `number`."""
        if number not in self._tractions:
            waves, tables = traction_table(self.reference, number, self._half_window_m), self.tables
            half_length_m = float(tables.half_length_m[number])
            self._tractions[number] = Tractions(tables.columns[number], tables.grids[number], waves, half_length_m, self.scatter)
        return self._tractions[number]


def measure(channel: Channel, passages: Passages, learnt: Learnt, cutoff_Hz: FloatArray, work: Measured, block_samples: int) -> None:
    """Fill `work` for all rows whose speed is known; `cutoff_Hz` (n,) of the plain edges' low-pass."""
    rate, speed = channel.axis.rate_Hz, passages.speed_m_s
    rows = np.flatnonzero((speed > LEAST_SPEED_M_S) & np.isfinite(passages.time_s))
    if not rows.size:
        return
    motion = speed, np.nan_to_num(passages.acceleration_m_s2)
    vague = ~(passages.speed_se_m_s < WORST_SPEED * speed)
    forms = Forms(learnt, speed[rows])
    number = forms.nearest(speed)
    half_length = forms.tables.half_length_m[number]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.maximum(1.02 * learnt.half_window_m, SEARCH * half_length + 2.5 * speed / cutoff_Hz) / speed * rate + 2.0
        for_fit = _power_of_two(FIT_STEP * half_length * rate / speed)
        for_plain = _power_of_two(rate / (PLAIN_OVERSAMPLING * cutoff_Hz))
        upsample = np.where(rate / for_plain < DENSE * cutoff_Hz, 2, 1)
    work.inside[rows] = (2.0 * half_length * rate / speed)[rows]
    for windows in gather_windows(channel, passages.sign, passages.index, reach, rows, block_samples):
        for averaged, part in _alike(windows, for_fit):
            _fit_alike(part.reduced(averaged), passages.noise, motion, vague, forms, number[part.row], work)
        for key, part in _alike(windows, 8 * for_plain + upsample):
            plain = part.reduced(key // 8)
            for low in range(0, len(plain.row), ROWS):
                _edges_alike(plain.take(slice(low, low + ROWS)), passages.noise, motion, cutoff_Hz, half_length, key % 8, work)


def _alike(windows: PatchWindows, keys: IntArray) -> Iterator[tuple[int, PatchWindows]]:
    """The rows of `windows` in groups of equal `keys` (a row a passage)."""
    own = keys[windows.row]
    for key in np.unique(own):
        alike = own == key
        yield int(key), windows if alike.all() else windows.take(alike)


def _power_of_two(values: FloatArray) -> IntArray:
    """The largest power of two not above each value, at least 1 and at most 1024."""
    return (2.0 ** np.floor(np.log2(np.clip(np.nan_to_num(values, nan=1.0), 1.0, 1024.0)))).astype(np.int64)


def _fit_alike(
    windows: PatchWindows, noise: float, motions: Motions, vague: NDArray[np.bool_], forms: Forms, number: IntArray, work: Measured
) -> None:
    """Fits and slip onsets of rows that share averaging; `number` (rows,) of their forms, `vague` (n,) where the speed is."""
    row = windows.row
    motion = windows.motion(*motions)
    fits = fit(windows, motion, forms.tables, number, noise)
    work.fits.put(row, fits)
    known = np.isfinite(fits.length_m)
    work.slip.reason[row] = np.where(known, np.where(vague[row], SPEED_UNKNOWN, TOO_SMALL), NO_FORM)
    look = np.flatnonzero(worth_a_look(fits, forms.scatter) & ~vague[row])
    sigma = noise / np.sqrt(windows.averaged)
    for knot in np.unique(number[look]):
        traction = forms.traction(int(knot))
        which = look[number[look] == knot]
        which = which[traction.gains(windows.take(which), motion[which], sigma) > LEAST_GAIN]
        if which.size:
            shift = np.nan_to_num(fits.shift_m[which] - forms.tables.shift_m[knot])
            work.slip.put(row[which], traction.onsets(windows.take(which), motion[which], shift, sigma))


def _edges_alike(
    windows: PatchWindows, noise: float, motions: Motions, cutoff_Hz: FloatArray, half_length_m: FloatArray, upsample: int, work: Measured
) -> None:
    """Plain edges of rows that share averaging."""
    row = windows.row
    speed, acceleration = motions[0][row], motions[1][row]
    middle = windows.centre + np.nan_to_num(work.fits.shift_m[row]) / speed * windows.rate_Hz
    sigma = noise / np.sqrt(windows.averaged)
    found = find_edges(windows.values, windows.rate_Hz, middle, speed, acceleration, cutoff_Hz[row], half_length_m[row], sigma, upsample)
    for name, column in work.edges.items():
        column[row] = getattr(found, name)
