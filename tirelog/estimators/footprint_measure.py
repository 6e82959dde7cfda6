"""Forms and plain edges of all passages, window by window: the inside of `footprint`.

Channel + Passages + Learnt --windows, block by block; rows of one speed, averaging and form together--> Measured, a row a passage
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import partial

import numpy as np

from tirelog.estimators.edges import SEARCH, Edges, find_edges
from tirelog.estimators.footprint_fit import FormTable, Normal, PassageFits, Solution, described, form_table, normal_equations, solve
from tirelog.estimators.footprint_learn import Learnt
from tirelog.estimators.footprint_reference import Reference
from tirelog.estimators.footprint_windows import PatchWindows, gather_windows
from tirelog.estimators.passages import Passages
from tirelog.estimators.slip_onset import (
    LEAST_GAIN,
    NO_FORM,
    SPEED_UNKNOWN,
    TOO_SMALL,
    WORST_SPEED,
    SlipOnset,
    find_onsets,
    gains,
    traction_table,
    worth_a_look,
)
from tirelog.recording import Channel, FloatArray

#: a slower wheel's windows are not cut out (its passage takes seconds)
LEAST_SPEED_M_S = 0.3
#: samples are averaged while they lie closer than this share of the half length, for the fit
FIT_STEP = 1.0 / 36.0
#: the low-pass needs this many samples a period of its cut-off; above, samples are averaged
PLAIN_OVERSAMPLING = 10.0
#: rows worked on at once, and rows of which slip onsets are tried at once
ROWS, LOOKED_AT = 512, 256


@dataclass
class Measured:
    """What is filled row by row, a row a passage."""

    edges: dict[str, FloatArray]
    fits: PassageFits
    slip: SlipOnset

    @classmethod
    def empty(cls, n: int) -> Measured:
        """`n` rows, nothing known."""
        return cls({f.name: np.full(n, np.nan) for f in fields(Edges)}, PassageFits.empty(n), SlipOnset.none(n))


@dataclass(frozen=True)
class Forms:
    """The log's form at the knots of speed: tables of the fit, and of the traction (made when first asked for)."""

    reference: Reference
    half_window_m: float
    scatter: float
    tables: tuple[FormTable, ...]
    tractions: dict[tuple[int, bool], FormTable]

    @classmethod
    def of(cls, learnt: Learnt, speed_m_s: FloatArray) -> Forms:
        """The forms for passages of `speed_m_s`."""
        reference = learnt.reference.at_speeds(learnt.reference.knots(float(speed_m_s.min()), float(speed_m_s.max())))
        window = learnt.half_window_m
        tables = tuple(form_table(reference, k, window) for k in range(len(reference.shapes)))
        return cls(reference, window, learnt.scatter(np.array([learnt.reference.misfit])), tables, {})

    def traction(self, number: int, *, fine: bool) -> FormTable:
        """The traction's table at knot `number`."""
        if (number, fine) not in self.tractions:
            self.tractions[number, fine] = traction_table(self.reference, number, self.half_window_m, fine=fine)
        return self.tractions[number, fine]


def measure(channel: Channel, passages: Passages, learnt: Learnt, cutoff_Hz: FloatArray, work: Measured, block_samples: int) -> None:
    """Fill `work` for all rows whose speed is known; `cutoff_Hz` (n,) of the plain edges' low-pass."""
    rate, speed = channel.axis.rate_Hz, passages.speed_m_s
    rows = np.flatnonzero((speed > LEAST_SPEED_M_S) & np.isfinite(passages.time_s))
    if not rows.size:
        return
    forms = Forms.of(learnt, speed[rows])
    reference = forms.reference
    number = np.argmin(np.abs(np.nan_to_num(speed[:, None]) ** 2 - reference.speed_m_s**2), axis=1)
    half_length = np.array([shape.half_length_m for shape in reference.shapes])[number]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.maximum(1.02 * learnt.half_window_m, SEARCH * half_length + 2.5 * speed / cutoff_Hz) / speed * rate + 2.0
        for_fit = _power_of_two(FIT_STEP * half_length * rate / speed)
        for_plain = _power_of_two(rate / (PLAIN_OVERSAMPLING * cutoff_Hz))
    work.fits.inside[rows] = (2.0 * half_length * rate / speed)[rows]
    fine = rate / for_plain < 8.0 * cutoff_Hz
    for windows in gather_windows(channel, passages.sign, passages.index, reach, rows, block_samples):
        for key, part in _alike(windows, np.column_stack([for_fit, number])):
            _fit_alike(part.reduced(int(key[0])), passages, forms, int(key[1]), work)
        for key, part in _alike(windows, np.column_stack([for_plain, fine])):
            plain = part.reduced(int(key[0]))
            for low in range(0, len(plain.row), ROWS):
                _edges_alike(plain.take(slice(low, low + ROWS)), passages, cutoff_Hz, half_length, 4 if key[1] else 2, work)


def _alike(windows: PatchWindows, keys: FloatArray) -> Iterator[tuple[FloatArray, PatchWindows]]:
    """The rows of `windows` in groups of equal `keys` (a row a passage)."""
    own = keys[windows.row].astype(np.int64)
    for key in np.unique(own, axis=0):
        yield key, windows.take((own == key).all(axis=1))


def _power_of_two(values: FloatArray) -> FloatArray:
    """The largest power of two not above each value, at least 1 and at most 1024."""
    return 2.0 ** np.floor(np.log2(np.clip(np.nan_to_num(values, nan=1.0), 1.0, 1024.0)))


def _fit_alike(windows: PatchWindows, passages: Passages, forms: Forms, number: int, work: Measured) -> None:
    """Fits and slip onsets of rows that share a form, a few thousand at a time."""
    table = forms.tables[number]
    for low in range(0, len(windows.row), ROWS):
        some = windows.take(slice(low, low + ROWS))
        row = some.row
        speed, acceleration = passages.speed_m_s[row], np.nan_to_num(passages.acceleration_m_s2[row])
        normal = normal_equations(some, table, forms.half_window_m, speed, acceleration, passages.noise)
        solution = solve(normal)
        fits = described(normal, solution, table)
        inside = work.fits.inside[row]
        work.fits.put(row, fits)
        work.fits.inside[row] = inside
        work.slip.reason[row] = np.where(np.isfinite(fits.length_m), TOO_SMALL, NO_FORM)
        _onsets(some, passages, forms, number, normal, solution, fits, work)


def _onsets(
    windows: PatchWindows,
    passages: Passages,
    forms: Forms,
    number: int,
    normal: Normal,
    solution: Solution,
    fits: PassageFits,
    work: Measured,
) -> None:
    """Slip onsets of those of the rows whose residual has room for one."""
    row = windows.row
    vague = ~(passages.speed_se_m_s[row] < WORST_SPEED * passages.speed_m_s[row])
    work.slip.reason[row[vague & np.isfinite(fits.length_m)]] = SPEED_UNKNOWN
    look = np.flatnonzero(worth_a_look(fits, forms.scatter) & ~vague)
    for first in range(0, look.size, LOOKED_AT):
        which = look[first : first + LOOKED_AT]
        coarse = forms.traction(number, fine=False)
        gain = gains(coarse, normal.take(which), solution.take(which), normal.sigma * forms.scatter)
        which = which[gain.max(axis=1, initial=0.0) > LEAST_GAIN]
        if not which.size:
            continue
        some = windows.take(which)
        speed, acceleration = passages.speed_m_s[some.row], np.nan_to_num(passages.acceleration_m_s2[some.row])
        form = forms.tables[number]
        refer = partial(normal_equations, some, form, forms.half_window_m, speed, acceleration, passages.noise)
        slip = find_onsets(refer, np.nan_to_num(fits.shift_m[which] - form.shift_m), form, forms.traction(number, fine=True), forms.scatter)
        work.slip.put(some.row, slip)


def _edges_alike(
    windows: PatchWindows, passages: Passages, cutoff_Hz: FloatArray, half_length_m: FloatArray, upsample: int, work: Measured
) -> None:
    """Plain edges of rows that share averaging."""
    row = windows.row
    speed, acceleration = passages.speed_m_s[row], np.nan_to_num(passages.acceleration_m_s2[row])
    middle = windows.centre + np.nan_to_num(work.fits.shift_m[row]) / speed * windows.rate_Hz
    noise = passages.noise / np.sqrt(windows.averaged)
    found = find_edges(windows.values, windows.rate_Hz, middle, speed, acceleration, cutoff_Hz[row], half_length_m[row], noise, upsample)
    for name, column in work.edges.items():
        column[row] = getattr(found, name)
