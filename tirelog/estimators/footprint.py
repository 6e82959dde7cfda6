"""Contact length, edges and slip onset of every passage of a strain grating (P2, errata).

    Channel --find_passages--> centres, speeds --some passages--> averages by speed --physical form--> Reference
            --windows around every passage, block by block--> plain edges (P2 3.2) and fits of the form --> Footprint, a row a passage

`length_m` comes from the fits, `length_d2_m` and `length_d1_m` are the papers' own measures after the low-pass.  Everything runs along
the tread, xi = v t + a t^2 / 2, entry edge at -L, exit edge at +L.  A row depends on its passage and on the log's Reference only.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from tirelog.dsp.lowpass import Cutoff
from tirelog.estimators.edges import SEARCH, Edges, find_edges
from tirelog.estimators.footprint_fit import FormTable, PassageFits, fit_passages, form_table
from tirelog.estimators.footprint_learn import Learnt, learn_reference
from tirelog.estimators.footprint_windows import PatchWindows, gather_windows
from tirelog.estimators.passages import Passages
from tirelog.recording import BLOCK_SAMPLES, Channel, FloatArray

#: fewer samples between the edges than this cannot tell a length
LEAST_SAMPLES = 4
#: a slower wheel's windows are not cut out (its passage takes seconds)
LEAST_SPEED_M_S = 0.3
#: samples are averaged while they lie closer than this share of the half length, for the fit
FIT_STEP = 1.0 / 36.0
#: the low-pass needs this many samples a period of its cut-off; above, samples are averaged
PLAIN_OVERSAMPLING = 10.0


@dataclass(frozen=True)
class Footprint:
    """One row a passage, shape (n,): the columns of the table `footprint`, and what pictures show.  Lengths in m, NaN where unknown.

    `edge_asymmetry`: (exit - entry) / (exit + entry) of the sizes of the second derivative's extrema: positive where the exit edge is
    the sharper one.  `learnt` holds the log's form, `cutoff_Hz` what the low-pass used, `form_se_m` the share of the error of `length_m`
    that comes from not knowing the carcass: one number for the log, the same sign in all rows.
    """

    length_m: FloatArray
    length_se_m: FloatArray
    form_se_m: FloatArray
    length_d2_m: FloatArray
    length_d2_se_m: FloatArray
    length_d1_m: FloatArray
    length_d1_se_m: FloatArray
    entry_time_s: FloatArray
    exit_time_s: FloatArray
    edge_asymmetry: FloatArray
    fits: PassageFits
    cutoff_Hz: FloatArray
    learnt: Learnt | None
    quality: tuple[frozenset[str], ...]


@dataclass
class _Work:
    """What is filled row by row."""

    edges: dict[str, FloatArray]
    fits: PassageFits

    @classmethod
    def empty(cls, n: int) -> _Work:
        return cls({f.name: np.full(n, np.nan) for f in fields(Edges)}, PassageFits.empty(n))


def footprint(channel: Channel, passages: Passages, cutoff: Cutoff | None = None, block_samples: int = BLOCK_SAMPLES) -> Footprint:
    """The footprint at each of `passages` of the strain `channel`; `cutoff` of the low-pass (auto)."""
    cutoff = cutoff or Cutoff()
    n = len(passages)
    speed, acceleration = passages.speed_m_s, np.nan_to_num(passages.acceleration_m_s2)
    learnt = learn_reference(channel, passages, block_samples)
    work = _Work.empty(n)
    nyquist = 0.5 * channel.axis.rate_Hz
    if learnt is None:
        asked = np.full(n, np.nan)
    else:
        asked = cutoff.frequency(speed, passages.radius_m, learnt.wave_number_1_m)
        if cutoff.unit == "auto":
            asked = np.minimum(asked, 0.9 * nyquist)
        _measure(channel, passages, learnt, np.minimum(asked, 0.98 * nyquist), work, block_samples)
    return _assembled(passages, learnt, work, asked, nyquist, speed, acceleration)


def _measure(channel: Channel, passages: Passages, learnt: Learnt, cutoff_Hz: FloatArray, work: _Work, block_samples: int) -> None:
    """Fill `work` for all rows whose speed is known."""
    rate = channel.axis.rate_Hz
    speed = passages.speed_m_s
    rows = np.flatnonzero((speed > LEAST_SPEED_M_S) & np.isfinite(passages.time_s))
    if not rows.size:
        return
    reference = learnt.reference.at_speeds(learnt.reference.knots(float(speed[rows].min()), float(speed[rows].max())))
    number = np.argmin(np.abs(np.nan_to_num(speed[:, None]) ** 2 - reference.speed_m_s**2), axis=1)
    half_length = np.array([shape.half_length_m for shape in reference.shapes])[number]
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.maximum(1.02 * learnt.half_window_m, SEARCH * half_length + 2.5 * speed / cutoff_Hz) / speed * rate + 2.0
        for_fit = _power_of_two(FIT_STEP * half_length * rate / speed)
        for_plain = _power_of_two(rate / (PLAIN_OVERSAMPLING * cutoff_Hz))
    tables = [form_table(reference, k, learnt.half_window_m) for k in range(len(reference.shapes))]
    fine = rate / for_plain < 8.0 * cutoff_Hz
    for windows in gather_windows(channel, passages.sign, passages.index, reach, rows, block_samples):
        keys = np.column_stack([for_fit, for_plain, number, fine])[windows.row].astype(np.int64)
        for key in np.unique(keys, axis=0):
            some = np.flatnonzero((keys == key).all(axis=1))
            part = PatchWindows(windows.row[some], windows.values[some], windows.centre[some], windows.rate_Hz)
            _measure_alike(part, passages, tables[key[2]], learnt, cutoff_Hz, half_length, key, work)


def _power_of_two(values: FloatArray) -> FloatArray:
    """The largest power of two not above each value, at least 1 and at most 1024."""
    return 2.0 ** np.floor(np.log2(np.clip(np.nan_to_num(values, nan=1.0), 1.0, 1024.0)))


def _measure_alike(
    windows: PatchWindows,
    passages: Passages,
    table: FormTable,
    learnt: Learnt,
    cutoff_Hz: FloatArray,
    half_length_m: FloatArray,
    key: FloatArray,
    work: _Work,
) -> None:
    """Plain edges and fits of rows that share form and averaging."""
    row = windows.row
    speed, acceleration = passages.speed_m_s[row], np.nan_to_num(passages.acceleration_m_s2[row])
    fits = fit_passages(windows.reduced(int(key[0])), table, learnt.half_window_m, speed, acceleration, passages.noise)
    step_m = speed / windows.rate_Hz
    work.fits.put(row, fits)
    work.fits.inside[row] = 2.0 * half_length_m[row] / step_m
    plain = windows.reduced(int(key[1]))
    middle = plain.centre + np.nan_to_num(fits.shift_m) / speed * plain.rate_Hz
    edges = find_edges(
        plain.values,
        plain.rate_Hz,
        middle,
        speed,
        acceleration,
        cutoff_Hz[row],
        half_length_m[row],
        passages.noise / np.sqrt(plain.averaged),
        upsample=4 if key[3] else 2,
    )
    for name, column in work.edges.items():
        column[row] = getattr(edges, name)


def _time_at(xi_m: FloatArray, speed_m_s: FloatArray, acceleration_m_s2: FloatArray) -> FloatArray:
    """Time from the patch centre at which the distance is `xi_m`; NaN where the wheel stops before."""
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(speed_m_s**2 + 2.0 * acceleration_m_s2 * xi_m)
        return 2.0 * xi_m / (speed_m_s + root)


def _assembled(
    passages: Passages,
    learnt: Learnt | None,
    work: _Work,
    asked_Hz: FloatArray,
    nyquist: float,
    speed: FloatArray,
    acceleration: FloatArray,
) -> Footprint:
    """Rows of the table out of what was measured."""
    fits, edges = work.fits, work.edges
    n = len(passages)
    scatter, reference_se, form_se = 1.0, np.zeros(n), np.zeros(n)
    if learnt is not None and n:
        scatter = learnt.scatter(fits.chi2)
        reference_se, form_se = learnt.length_errors(speed)
    noise_se = np.sqrt(
        (fits.length_se_m * scatter) ** 2 + reference_se**2 + (fits.length_m * np.nan_to_num(passages.speed_se_m_s / speed)) ** 2
    )
    half = 0.5 * fits.length_m
    with np.errstate(invalid="ignore"):
        entry = passages.time_s + _time_at(fits.shift_m - half, speed, acceleration)
        leave = passages.time_s + _time_at(fits.shift_m + half, speed, acceleration)
        asymmetry = (edges["exit_height"] - edges["entry_height"]) / (edges["exit_height"] + edges["entry_height"])
    known = np.where(np.isfinite(fits.length_m), 1.0, np.nan)
    return Footprint(
        fits.length_m,
        noise_se,
        form_se * known,
        edges["length_d2_m"],
        edges["length_d2_se_m"],
        edges["length_d1_m"],
        edges["length_d1_se_m"],
        entry,
        leave,
        asymmetry,
        fits,
        asked_Hz,
        learnt,
        tuple(_words(passages, work, asked_Hz, nyquist, row) for row in range(n)),
    )


def _words(passages: Passages, work: _Work, asked_Hz: FloatArray, nyquist: float, row: int) -> frozenset[str]:
    """Quality words of a row: the passage's own, and what the footprint adds."""
    words = set(passages.quality[row])
    if asked_Hz[row] > nyquist:
        words.add("cutoff")
    if work.fits.inside[row] < LEAST_SAMPLES:
        words.add("patch_short")
    if not np.isfinite(work.fits.length_m[row]):
        words.add("no_length")
    elif not np.isfinite(work.edges["length_d2_m"][row]) and "cutoff" not in words:
        words.add("edge_unclear")
    return frozenset(words)
