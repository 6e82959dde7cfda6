"""The log's own form: which passages it is learnt from, their averages by speed, and what is known of its error.

    Passages --clean ones, preferably at steady speed, by classes of speed, in clusters--> a few hundred windows
             --scaled by each passage's height, cells along xi--> averages --form--> heights, shifts by that form
             --cells again--> averages --both members of the family--> Learnt
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from tirelog.estimators.footprint_fit import FormTable, fit_passages, form_table
from tirelog.estimators.footprint_reference import Average, Reference, average, fit_reference
from tirelog.estimators.footprint_windows import PatchWindows, gather_windows
from tirelog.estimators.passages import Passages
from tirelog.recording import BLOCK_SAMPLES, Channel, FloatArray, IntArray

#: half of the contact length over half of the width at half level, roughly, for both carcasses
LENGTH_TO_WIDTH = 1.25
#: window of averages and fits in half lengths
WINDOW = 2.7
#: classes of speed: at most, each no narrower than this ratio; passages of each, in clusters of neighbours
CLASSES, CLASS_RATIO, LEARNT_FROM, CLUSTERS = 8, 1.12, 200, 8
#: samples are averaged while they lie closer than this share of the half length
STEP = 1.0 / 36.0
#: free rolling, as far as the acceleration tells [m/s^2]
FREE_ROLLING_M_S2 = 0.6
#: the form's own error is this many times the difference between the family's two members
FORM_FACTOR = 2.0


@dataclass(frozen=True)
class Learnt:
    """`reference`: the member of the family (straight line, closed ring) that fits better; `other`: the one that fits worse.

    `half_window_m`: what averages and fits look at; `wave_number_1_m`: where a passage's spectrum sinks into the noise, the `auto` cut-off;
    `free_rolling`: whether it was learnt from passages at steady speed.
    """

    reference: Reference
    other: Reference
    half_window_m: float
    wave_number_1_m: float
    free_rolling: bool

    def length_errors(self, speed_m_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Standard errors [m] of the full length at each speed that all rows share: from the averages' noise, and from the form."""
        best = 2.0 * np.array([s.half_length_m for s in self.reference.shapes])
        worse = 2.0 * np.array([s.half_length_m for s in self.other.shapes])
        excess = max(self.reference.misfit - 1.0, 0.0)
        gap = max(self.other.misfit - self.reference.misfit, 0.0)
        weight = np.sqrt(excess / (excess + gap)) if excess > 0 else 0.0
        at = self.reference.speed_m_s
        return np.interp(speed_m_s, at, self.reference.length_se_m), np.interp(speed_m_s, at, FORM_FACTOR * weight * np.abs(best - worse))

    def scatter(self, chi2: FloatArray) -> FloatArray:
        """How much larger the passages' residuals are than the noise of a sample tells, at least 1; one number for the log, as an array."""
        known = chi2[np.isfinite(chi2)]
        return np.full(chi2.shape, np.sqrt(max(1.0, float(np.median(known)))) if known.size else 1.0)


def _usable(passages: Passages) -> IntArray:
    """Ordinals of passages without a quality word and with a neighbour at a turn on either side."""
    clean = np.array([not words for words in passages.quality], dtype=bool)
    both = passages.turn_before & passages.turn_after & np.isfinite(passages.time_s)
    for good in (clean & both, clean & (passages.turn_before | passages.turn_after), clean, np.isfinite(passages.time_s)):
        rows = np.flatnonzero(good & (passages.speed_m_s > 0.5))
        if rows.size:
            return rows
    return np.zeros(0, np.int64)


def _classes(speed_m_s: FloatArray) -> IntArray:
    """Class of each speed: equal steps of its logarithm."""
    low, high = float(speed_m_s.min()), float(speed_m_s.max())
    count = int(np.clip(np.floor(np.log(high / low) / np.log(CLASS_RATIO)) + 1, 1, CLASSES))
    return np.minimum((np.log(speed_m_s / low) / np.log(high / low * (1 + 1e-9)) * count).astype(np.int64), count - 1) if count > 1 else (
        np.zeros(speed_m_s.size, np.int64)
    )


def _chosen(rows: IntArray) -> IntArray:
    """At most LEARNT_FROM of `rows`, as clusters of neighbours spread over them."""
    if rows.size <= LEARNT_FROM:
        return rows
    size = LEARNT_FROM // CLUSTERS
    firsts = np.linspace(0, rows.size - size, CLUSTERS).astype(np.int64)
    return np.unique(np.concatenate([rows[k : k + size] for k in firsts]))


@dataclass(frozen=True)
class _Sample:
    """Some windows of one class of speed: `xi_m`, `values` (n, m), and each row's `offset`, `height`, `shift_m` (n,)."""

    windows: PatchWindows
    speed_m_s: FloatArray
    acceleration_m_s2: FloatArray
    offset: FloatArray
    height: FloatArray
    shift_m: FloatArray

    def average(self, noise: float, half_window_m: float) -> Average:
        """Mean passage of the rows, each moved and scaled by its own fit."""
        xi = self.windows.distance_m(self.speed_m_s, self.acceleration_m_s2) - self.shift_m[:, None]
        height = self.height[:, None]
        values = (self.windows.values - self.offset[:, None]) / height
        speed = float(np.sqrt(np.mean(self.speed_m_s**2)))
        return average(xi, values, np.broadcast_to(noise / height, values.shape), speed, half_window_m)

    def refitted(self, table: FormTable, noise: float, half_window_m: float) -> _Sample:
        """The same windows with offset, height and shift by the form of `table`; rows that do not fit it are left out."""
        fits = fit_passages(self.windows, table, half_window_m, self.speed_m_s, self.acceleration_m_s2, noise)
        keep = np.isfinite(fits.height)
        keep &= fits.chi2 < 9.0 * max(float(np.nanmedian(fits.chi2)), 1.0)
        if not keep.any():
            return self
        windows = replace(self.windows, row=self.windows.row[keep], values=self.windows.values[keep], centre=self.windows.centre[keep])
        height = fits.height[keep] / table.height
        return _Sample(
            windows, self.speed_m_s[keep], self.acceleration_m_s2[keep], fits.offset[keep], height, fits.shift_m[keep] + table.shift_m
        )


def _samples(
    channel: Channel, passages: Passages, rows: IntArray, classes: IntArray, half_window_m: float, block_samples: int
) -> list[_Sample]:
    """Windows of each class of speed out of the passages `rows`, offset and height as the passages' template has them."""
    speed, acceleration = passages.speed_m_s, np.nan_to_num(passages.acceleration_m_s2)
    out = []
    for number in np.unique(classes):
        chosen = _chosen(rows[classes == number])
        reach = 1.02 * half_window_m / float(speed[chosen].min()) * channel.axis.rate_Hz + 1.0
        fewer = 2 ** int(np.log2(max(STEP * half_window_m / WINDOW * channel.axis.rate_Hz / float(speed[chosen].max()), 1.0)))
        same = np.full(len(passages), reach)
        parts = [w.reduced(fewer) for w in gather_windows(channel, passages.sign, passages.index, same, chosen, block_samples)]
        row = np.concatenate([part.row for part in parts])
        windows = replace(
            parts[0], row=row, values=np.concatenate([p.values for p in parts]), centre=np.concatenate([p.centre for p in parts])
        )
        height = np.maximum(np.abs(passages.height[row]), 1e-300)
        out.append(_Sample(windows, speed[row], acceleration[row], -passages.offset[row], height, np.zeros(row.size)))
    return out


def _wave_number(reference: Reference, rate_Hz: float, half_window_m: float, noise: float) -> float:
    """The highest wave number [1/m] at which a passage's spectrum stands above the noise of a sample (height one), at the middle speed."""
    number = len(reference.shapes) // 2
    speed = float(reference.speed_m_s[number])
    family = reference.family
    spectrum = np.abs(family.spectrum(reference.shapes[number])) * abs(reference.heights[number])
    signal = np.pi * family.radius_m * spectrum * rate_Hz / speed
    floor = noise * np.sqrt(2.0 * half_window_m * rate_Hz / speed)
    above = np.flatnonzero(signal > floor)
    return float(family.kappa_1_m[above[-1]]) if above.size else float(2.0 * np.pi / half_window_m)


def learn_reference(channel: Channel, passages: Passages, block_samples: int = BLOCK_SAMPLES) -> Learnt | None:
    """The form of the passages of `channel`; None where the log has none to learn from."""
    if passages.template is None or not len(passages):
        return None
    rows = _usable(passages)
    steady = rows[np.abs(np.nan_to_num(passages.acceleration_m_s2[rows])) < FREE_ROLLING_M_S2]
    free = steady.size >= min(24, rows.size)
    rows = steady if free else rows
    if not rows.size:
        return None
    rough = LENGTH_TO_WIDTH * passages.template.half_width_rad * passages.radius_m
    window = min(WINDOW * rough, 2.9 * passages.radius_m)
    samples = _samples(channel, passages, rows, _classes(passages.speed_m_s[rows]), window, block_samples)
    samples.sort(key=lambda sample: float(np.mean(sample.speed_m_s**2)))
    reference = fit_reference([s.average(passages.noise, window) for s in samples], passages.radius_m, rough)
    tables = [form_table(reference, k, window, with_residual=False) for k in range(len(samples))]
    samples = [s.refitted(t, passages.noise, window) for s, t in zip(samples, tables, strict=True)]
    averages = [s.average(passages.noise, window) for s in samples]
    both = [fit_reference(averages, passages.radius_m, rough, closed=closed, start=reference) for closed in (False, True)]
    both.sort(key=lambda r: r.misfit)
    height = float(np.median(np.abs(passages.height[rows])))
    wave_number = _wave_number(both[0], channel.axis.rate_Hz, window, passages.noise / max(height, 1e-300))
    return Learnt(both[0], both[1], window, wave_number, free)
