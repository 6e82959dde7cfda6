"""Dissipation of every revolution from the strain's own time derivative (P1 27-29, errata).

    Channel
        --means of some samples, lost ones bridged, differentiator, square-->
        energy of each revolution, block by block
            --minus noise, as it is opposite to the patch, over the speed-->
            factor, specific power, standard error, a row per passage
            --stretches of constant speed--> moving averages

    p_d = int eps'^2 ds = (1 / v) int (d eps / dt)^2 dt over one revolution
    P_d = v^2 A p_d, with v = R Omega

A revolution runs from half a turn before the patch centre to half a turn after. Noise adds to each
squared derivative, white noise of sigma as much as sigma^2 x (sum of the squared filter). The
filter passes what a patch's strain holds along the tread, up to PASS / L at the log's top speed. So
its own bias is below 1e-3 (0.3e-3 on a stiff-treaded ring) as long as the sampling allows.

The file is longer than others: estimate, doubts, table and regressions are of one number.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from tirelog.data.recording import Channel, Recording
from tirelog.dsp.filters import (
    BESIDE,
    averaging_gain,
    bridged,
    differentiator,
    medians_beside,
    of_the_log,
    outliers,
    rounding,
    running_mean_of,
    sliding_median,
    stamp_scatter,
)
from tirelog.kernels import compiled
from tirelog.runs.in_memory import released
from tirelog.strain.passages.find import Passages
from tirelog.strain.passages.passage_flags import doubted, in_gap
from tirelog.strain.passages.template import LENGTH_TO_WIDTH
from tirelog.strain.speed import PassageRows, identity_columns, speed_quality
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, records
from tirelog.vocabulary.quality import Quality, QualityFlags, good, having, marked, quality_column


@compiled
def derivative(values: FloatArray, side: FloatArray, slope: FloatArray) -> None:
    """Fills `slope` (n,) with the derivative of `values` (n,) by an antisymmetric filter.

    `side` (half,) are the filter's coefficients on one side: slope[i] = sum over k of
    side[k - 1] (values[i + k] - values[i - k]), 0 if that leaves `values`.
    """
    half, n = side.size, values.size
    slope[:] = 0.0
    # so many samples at a time stay in the fastest cache while all coefficients pass over them
    for begin in range(half, n - half, 512):
        end = min(begin + 512, n - half)
        out = slope[begin:end]
        for k in range(1, half + 1):
            factor, after, before = (
                side[k - 1],
                values[begin + k : end + k],
                values[begin - k : end - k],
            )
            for i in range(out.size):
                out[i] += factor * (after[i] - before[i])


def sums_within(values: FloatArray, low: IntArray, high: IntArray) -> FloatArray:
    """Sums (k,) of `values` (n,) over the places [low, high) (k,), which lie within it."""
    edges = np.stack([low, high], axis=1).ravel()
    return np.where(high > low, np.add.reduceat(values, edges)[::2], 0.0)


#: pass edge of the differentiator, in half lengths: wave number x half length
PASS = 20.0
#: the patch with its shoulders, in half windows of the passages
SHOULDERS = 1.6
#: parts of a revolution, each judged beside the same part of the turns around
PARTS = 24
#: so many turns are those around; a part is far off by FAR of its usual distances and LEAST_OFF of
#: the usual factor; a turn is unlike those around if its patch is off by UNLIKE of it at least, or
#: the parts that are far off by PARTS_UNLIKE
TURNS, FAR, LEAST_OFF, UNLIKE, PARTS_UNLIKE = 9, 12.0, 0.0025, 0.02, 0.01
#: samples worked on at once
MOST_AT_ONCE = 1 << 16
#: constant speed: the step from one revolution to the next (P1 4) [m/s], and revolutions of a
#: moving average; twice the step takes gentle braking for a constant speed
STEADY_STEP_M_S, AVERAGED = 0.08, 9


#: the dissipation at a passage: factor p_d [1/m] with its standard error, specific power P_d
#: [m^3/s^2] (NaN without an area); whether the speed is constant there: only such stretches have
#: moving averages (else NaN); number of the stretch, -1 outside; flags
DISSIPATION = np.dtype(
    [("factor_1_m", "f8"), ("factor_se_1_m", "f8"), ("specific_power_m3_s2", "f8"),
     ("steady", "?"), ("factor_mean_1_m", "f8"), ("specific_power_mean_m3_s2", "f8"),
     ("stretch", "i8"), ("quality", "u4")]
)  # fmt: skip


def _filter(channel: Channel, passages: Passages) -> tuple[FloatArray, int, bool]:
    """The differentiator for the fastest passage: coefficients, averaged samples, limited.

    The coefficients hold on means of so many samples; limited: the sampling is too coarse for the
    patch, or uneven.
    """
    rate = channel.axis.rate_Hz
    half_width = passages.template.half_width_rad if passages.template is not None else 0.12
    half_length = LENGTH_TO_WIDTH * half_width * passages.radius_m
    wanted = PASS / half_length * float(np.nanmax(passages.speed_m_s)) / (2.0 * np.pi)
    # means are taken of as many samples as leave this many per period of the pass edge; twice as
    # many take twice as long and change what the filter passes no more
    averaged = int(2 ** np.floor(np.log2(max(rate / (4.0 * wanted), 1.0))))
    # nearer to the Nyquist frequency than this share the filter needs many more coefficients
    edge = min(wanted, 0.8 * 0.5 * rate / averaged)
    # below this share of the wanted edge, 6 half lengths, the derivative itself is lost; what an
    # instrument that averages must leave of these waves; and the scatter of the samples' times
    # about even ones, in periods, beyond which slopes from sample to sample are wrong: a tenth
    # makes 1 %
    least = 6.0 / PASS * wanted
    mean = running_mean_of(channel.recorded or channel)
    passed = float(averaging_gain(np.array(2.0 * np.pi * least / rate * mean), mean))
    limited = edge < least or passed < 0.995 or stamp_scatter(channel.axis) > 0.05
    return differentiator(rate / averaged, edge, averaged), averaged, limited


class _Filled:
    """A channel with the samples that are missing in its gaps laid out as lost ones.

    They are bridged like these, so that a gap of a few samples costs a revolution nothing. Longer
    gaps than what is worked on at once stay out.
    """

    def __init__(self, channel: Channel) -> None:
        axis = channel.axis
        #: first sample of each segment and the place that it is laid out at, (k,)
        self._first = np.append(0, axis.first[1:])
        missing = np.rint(np.append(0.0, axis.missing[1:])).astype(np.int64)
        long = missing > MOST_AT_ONCE
        self._place = self._first + np.cumsum(np.where(long, 0, missing))
        self._channel, self.rate_Hz = channel, axis.rate_Hz
        self.size = channel.size + int(self._place[-1] - self._first[-1])
        #: places with which the recording goes on after a gap that is not laid out
        self.breaks = self._place[long]

    def place(self, index: FloatArray) -> FloatArray:
        """The place of a fractional sample index, (n,)."""
        segment = np.searchsorted(self._first[1:], index, side="right")
        return np.asarray(index + (self._place - self._first)[segment], np.float64)

    def read(self, start: int, stop: int) -> FloatArray:
        """Values of the places [start, stop) as far as there are, NaN where lost or missing."""
        stop = min(stop, self.size)
        low, high = self._samples(start), self._samples(stop)
        values = np.asarray(self._channel.read(low, high), dtype=np.float64)
        if values.size == stop - start:
            return values
        filled = np.full(stop - start, np.nan)
        filled[self.place(np.arange(low, high, dtype=np.float64)).astype(np.int64) - start] = values
        return filled

    def _samples(self, place: int) -> int:
        """How many samples lie before a place."""
        segment = int(np.searchsorted(self._place, place, side="right")) - 1
        ends = np.append(self._first[1:], self._channel.size)
        return int(min(place - self._place[segment] + self._first[segment], ends[segment]))


def _bounds(passages: Passages, index: FloatArray) -> tuple[FloatArray, FloatArray]:
    """First and last sample (fractional) of each passage's revolution, whose centre is at `index`.

    Half way to a neighbour that is one turn away, else half a turn.
    """
    step = np.diff(index)
    before = np.where(passages.turn_before, np.concatenate([[np.nan], step]), np.nan)
    after = np.where(passages.turn_after, np.concatenate([step, [np.nan]]), np.nan)
    turn_s = 2.0 * np.pi / passages.omega_rad_s
    per_second = np.nanmedian(step / np.diff(passages.time_s)) if len(passages) > 1 else np.nan
    usual = turn_s * per_second
    return index - 0.5 * np.where(np.isfinite(before), before, usual), index + 0.5 * np.where(
        np.isfinite(after), after, usual
    )


def _edges(
    passages: Passages, filled: _Filled, bounds: list[FloatArray], averaged: int
) -> FloatArray:
    """Edges (n, PARTS + 1) [means] of the parts of each revolution, which are alike in angle.

    A parabola on either side of the patch centre, with the wheel's speed there, ends at the
    revolution's `bounds`, two of (n,) [means].
    """
    side = np.linspace(-1.0, 1.0, PARTS + 1)
    half = (np.pi / passages.omega_rad_s * filled.rate_Hz / averaged)[:, None]
    middle = (filled.place(passages.index) / averaged)[:, None]
    begins, ends = (bound[:, None] for bound in bounds)
    curve = np.where(side < 0.0, begins - middle + half, ends - middle - half)
    return np.maximum.accumulate(np.rint(middle + half * side + curve * side**2), axis=1)


def _energies(
    channel: Channel,
    passages: Passages,
    coefficients: FloatArray,
    averaged: int,
    near: BoolArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sums over each revolution: energy (n, PARTS), bend (n,), and how many means (n, PARTS).

    The squared derivative of each part; its own squared slope in the patch (for the error), whose
    parts are `near` (PARTS,).
    """
    filled = _Filled(channel)
    bounds = [np.round(b / averaged) for b in _bounds(passages, filled.place(passages.index))]
    last = filled.size // averaged
    known = np.isfinite(bounds[0]) & np.isfinite(bounds[1])
    low, high = (np.clip(np.where(known, b, 0.0), 0, last).astype(np.int64) for b in bounds)
    # a sample off its neighbours' cubic by more than these many sigmas and this share of the
    # passages' height is bridged; twice as much of either leaves spikes in that are half as large
    # as what counts
    wild = max(
        10.0 * passages.noise / np.sqrt(averaged),
        0.06 * float(np.nanmedian(np.abs(passages.height))),
    )
    half = coefficients.size // 2
    side = coefficients[:half][::-1].copy()
    step = max(MOST_AT_ONCE // averaged, 4 * coefficients.size)
    entry, leave = np.flatnonzero(np.diff(near, prepend=False, append=False))
    parts = _edges(passages, filled, bounds, averaged)
    parts = np.clip(np.where(known[:, None], parts, 0.0), 0, last).astype(np.int64)
    energy, bend = np.zeros((len(passages), PARTS)), np.zeros(len(passages))
    breaks = np.concatenate([[0], filled.breaks // averaged, [last]])
    # rows are in order, and their revolutions nearly so: those of a block stand together
    furthest, nearest = (
        np.maximum.accumulate(high),
        np.minimum.accumulate(np.where(known, low, last)[::-1])[::-1],
    )
    for begin, end in pairwise(breaks.tolist()):
        for start in range(begin, end, step):
            stop = min(start + step, end)
            rows = np.arange(
                np.searchsorted(furthest, start, "right"), np.searchsorted(nearest, stop)
            )
            if rows.size and end - begin > 1:  # a mean alone has no change
                # a place more for changes, and `bridged` judges a sample by three on either side
                first, final = max(start - half - 4, begin), min(stop + half + 4, end)
                raw = filled.read(first * averaged, final * averaged)
                whole = raw[: raw.size // averaged * averaged].reshape(-1, averaged)
                means = bridged(whole.mean(axis=1) if averaged > 1 else whole[:, 0].copy(), wild)
                slope = np.empty(means.size)
                derivative(means, side, slope)
                edges = np.clip(parts[rows], start, stop) - first
                edges = np.clip(edges, 1, means.size - 1)
                of_parts = sums_within(slope**2, edges[:, :-1].ravel(), edges[:, 1:].ravel())
                energy[rows] += of_parts.reshape(-1, PARTS)
                bend[rows] += sums_within(np.gradient(slope) ** 2, edges[:, entry], edges[:, leave])
    return energy, bend, np.diff(parts).astype(np.float64)


def _factors(
    parts: FloatArray, sizes: FloatArray, white: float, near: BoolArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """(factor, the noise's share, subtracted from it, whether it is unlike others), (n,) each.

    `parts` (n, PARTS) of each revolution's factor with its noise [1/m], their `sizes` (n, PARTS) to
    which noise is proportional, by `white` at least; `near` (PARTS,): the parts of the patch with
    its shoulders. The half of the revolution that is opposite to the patch does not bend: its
    median is the noise. A part that is far off the same part of the turns around holds a
    disturbance, or a hit of the road; away from the patch only if it is above it.
    """
    opposite = np.abs(np.arange(PARTS) + 0.5 - 0.5 * PARTS) > 0.25 * PARTS
    share = np.median(parts[:, opposite] / np.maximum(sizes[:, opposite], 1e-300), axis=1)
    floor = sliding_median(share, TURNS)[:, None]
    # rounding shows where the strain changes, and opposite to the patch it may not
    floors = sizes * np.where(near, np.maximum(floor, white), floor)
    parts = parts - floors
    usual = _medians_over_turns(parts)
    middle = float(np.median(parts.sum(axis=1)))
    of_patch = parts[:, near].sum(axis=1)
    unlike = outliers(of_patch, UNLIKE * middle)
    # a load changes the patch as a whole, and what is no tire's a part of it
    load = of_patch / np.maximum(usual[:, near].sum(axis=1), 1e-300)
    off = np.abs(parts - usual * np.where(near, load[:, None], 1.0))
    far = off > FAR * _medians_over_turns(off) + LEAST_OFF * middle
    unlike |= np.where(far & (near | (parts > usual)), off, 0.0).sum(axis=1) > PARTS_UNLIKE * middle
    return parts.sum(axis=1), floors.sum(axis=1), unlike


def _loose(height: FloatArray, factor: FloatArray) -> BoolArray:
    """Which turns (n,) a sensor that has come loose shows smaller than they are.

    The height of its pulses falls or rises from one turn to the next for good, and the dissipation
    with its square: a load changes the form as well.
    """
    rows = np.flatnonzero(np.isfinite(height + factor) & (height * factor != 0.0))
    loose = np.zeros(height.size, bool)
    if rows.size <= 2 * BESIDE:
        return loose
    level = np.log(np.abs(height[rows]))
    form = np.log(np.abs(factor[rows])) - 2.0 * level
    (before, after), forms = medians_beside(level), medians_beside(form)
    step = np.abs(after - before)
    # step in the height (logarithm) that no road, load or speed makes from one turn to the next
    loose_step = 0.22
    if np.any((step > loose_step) & (np.abs(forms[1] - forms[0]) < step)):
        loose[rows] = 0.5 * (before + after) < np.quantile(level, 0.9) - loose_step
    return loose


def _medians_over_turns(parts: FloatArray) -> FloatArray:
    """The median of each part over the TURNS around, (n, PARTS)."""
    return np.stack([sliding_median(part, TURNS) for part in parts.T], axis=1)


def _in_long_gap(channel: Channel, passages: Passages, averaged: int) -> BoolArray:
    """Whether a gap is too long to be bridged in each passage's revolution, (n,)."""
    axis, index = channel.axis, passages.index
    turn = 2.0 * np.pi / passages.omega_rad_s * axis.rate_Hz
    shoulders = SHOULDERS * passages.window_rad / (2.0 * np.pi) * turn
    # a gap in the patch with its shoulders is bridged up to so many means, half a period of the
    # pass edge; twice as many bridge a whole period, whose slope is lost
    near = in_gap(axis, index, shoulders, 2.0 * averaged)
    low, high = index - 0.5 * turn, index + 0.5 * turn
    missing = axis.missing_before(high) - axis.missing_before(low)
    # elsewhere up to this share of a turn; twice the share bridges half a turn
    return np.asarray(near | (missing > 0.25 * turn))


def steady_stretches(
    speed_m_s: FloatArray, next_known: BoolArray, step_m_s: float = STEADY_STEP_M_S
) -> IntArray:
    """Number of the stretch of constant speed of each row, -1 outside, shape (n,).

    A stretch: two or more rows in a row, each one turn after the one before (`next_known`), whose
    speeds step by less than `step_m_s` in size (errata: P1 prints the step without its absolute
    value, and braking would always pass).
    """
    with np.errstate(invalid="ignore"):
        joined = (np.abs(np.diff(speed_m_s)) < step_m_s) & next_known[:-1]
    after, before = np.append(joined, False), np.append(False, joined)
    return np.where(after | before, np.cumsum(after & ~before) - 1, -1)[: speed_m_s.size]


def moving_average(values: FloatArray, stretch: IntArray) -> FloatArray:
    """Centred mean over AVERAGED rows within each stretch, narrower at its ends.

    NaN outside of stretches. NaN values are left out.
    """
    row = np.arange(values.size)
    known = np.isfinite(values)
    total = np.append(0.0, np.cumsum(np.where(known, values, 0.0)))
    count = np.append(0, np.cumsum(known))
    edges = np.concatenate([[0], np.flatnonzero(np.diff(stretch)) + 1, [row.size]])
    run = np.searchsorted(edges, row, side="right") - 1
    reach = np.minimum(AVERAGED // 2, np.minimum(row - edges[run], edges[run + 1] - 1 - row))
    low, high = row - reach, row + reach + 1
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = (total[high] - total[low]) / (count[high] - count[low])
    return np.where(stretch >= 0, mean, np.nan)


def dissipation(
    channel: Channel,
    passages: Passages,
    area_m2: float | None,
    quality: QualityFlags,
    *,
    steady_step_m_s: float = STEADY_STEP_M_S,
) -> Any:
    """The dissipation in each revolution of the strain `channel`, (n,) of DISSIPATION.

    Its columns are attributes.

    `area_m2` of the section (None: no specific power); `quality` (n,): the flags that the speeds
    already have.
    """
    n = len(passages)
    if not np.isfinite(passages.speed_m_s).any():
        nan = np.full(n, np.nan)
        return records(
            DISSIPATION, factor_1_m=nan, factor_se_1_m=nan, specific_power_m3_s2=nan,
            factor_mean_1_m=nan, specific_power_mean_m3_s2=nan, stretch=-1, quality=quality,
        ).view(np.recarray)  # fmt: skip
    coefficients, of_each, limited = _filter(channel, passages)
    near = np.abs(np.arange(PARTS) + 0.5 - 0.5 * PARTS) < 0.5 + (
        SHOULDERS * passages.window_rad * PARTS / (2.0 * np.pi)
    )
    energy, bend, of_parts = _energies(channel, passages, coefficients, of_each, near)
    speed, means = passages.speed_m_s, of_parts.sum(axis=1)
    step = of_each / channel.axis.rate_Hz
    # a revolution whose patch the log cuts off has no energy of its own
    reach = (
        SHOULDERS * passages.window_rad / passages.omega_rad_s * channel.axis.rate_Hz
        + (coefficients.size // 2 + 2) * of_each
    )
    whole = (means > 0) & (passages.index - reach >= 0) & (passages.index + reach <= channel.size)
    rows = np.flatnonzero(whole & np.isfinite(speed))
    factor, floor = np.full((2, n), np.nan)
    unlike = np.zeros(n, bool)
    sigma2 = max(passages.noise, rounding(channel)) ** 2 / of_each
    with np.errstate(invalid="ignore", divide="ignore"):
        # white noise, which has the rounding in it
        square = sigma2 * float((coefficients**2).sum())
        scale, white = step / speed, means * square
        factor[rows], floor[rows], unlike[rows] = _factors(
            energy[rows] * scale[rows, None], of_parts[rows] * scale[rows, None], square, near
        )
        beyond = np.maximum(floor / scale - white, 0.0)
        lags = np.correlate(coefficients, coefficients, "full")
        # the slope's own noise is in `bend` too, and does not belong there
        curved = float((np.convolve(coefficients, (0.5, 0.0, -0.5)) ** 2).sum())
        bend = np.maximum(bend - near.mean() * means * sigma2 * curved, 0.0)
        variance = 4.0 * sigma2 * bend / step**2
        variance += 2.0 * sigma2**2 * means * float((lags**2).sum())
        # slower noise adds to the slope over as many means as the filter's edge is slow, and all of
        # it may be the tire's own; half of the patch's noise may be none, if it is rounding
        variance += (0.5 * near.mean() * white) ** 2
        signal = np.maximum(factor, 0.0) / scale
        variance += beyond / means * signal * coefficients.size + beyond**2
        error = np.hypot(np.sqrt(variance) * step / speed, factor * passages.speed_se_m_s / speed)
        known = np.abs(factor[np.isfinite(factor)])
        # a standard error above so many factors, the row's or the log's usual one, tells nothing
        # and is left blank; half of it would blank rows of very noisy logs, twice as much no row
        # that this does not
        absurd = error > 10.0 * np.maximum(
            np.abs(factor), np.median(known) if known.size else np.inf
        )
    error = np.where(absurd, np.nan, error)
    bursts = doubted(channel, Quality.SPIKE, *_bounds(passages, passages.index))
    # share of a log's turns with bursts from which all have them, seen or not
    bursts = of_the_log(bursts | having(quality, Quality.SPIKE), 0.5)
    share = passages.misfit / np.abs(passages.height)
    # a patch that its form leaves over by so many times the usual; of clean logs it is 1.5 at most
    unlike |= share > 4.0 * sliding_median(share, min(TURNS, n))
    quality = (
        quality
        | marked(absurd, Quality.ERROR_UNKNOWN)
        | marked(bursts, Quality.SPIKE)
        | marked(unlike, Quality.UNLIKE_NEIGHBOURS)
        | marked(_loose(passages.height, factor), Quality.IMPLAUSIBLE)
        | marked(_in_long_gap(channel, passages, of_each), Quality.GAP)
        | marked(np.full(n, limited), Quality.CUTOFF)
    )
    power = speed**2 * area_m2 * factor if area_m2 is not None else np.full(n, np.nan)
    stretch = steady_stretches(speed, passages.turn_after, steady_step_m_s)
    clean = good(quality)
    return records(
        DISSIPATION,
        factor_1_m=factor,
        factor_se_1_m=error,
        specific_power_m3_s2=power,
        steady=stretch >= 0,
        factor_mean_1_m=moving_average(np.where(clean, factor, np.nan), stretch),
        specific_power_mean_m3_s2=moving_average(np.where(clean, power, np.nan), stretch),
        stretch=stretch,
        quality=quality,
    ).view(np.recarray)


# ---- Regressions of the dissipation on speed, through the means of the stretches of constant
# speed.
#
# rows of constant speed --cut when the speed has moved on, mean of each piece--> points
#     --line, weights from the scatter within and between stretches (Paule, Mandel), t quantiles-->
#     Regression
#
# Revolutions of one stretch share its road, temperature and load, so they are no independent
# witnesses of a line: a stretch counts once, and the error of the slope is what the means of the
# stretches scatter about the line.


#: the sentence on a line whose errors hold although its means lie far off
SCATTERED = "stretches scatter more than their revolutions, which the errors count"


#: the line quantity = intercept + slope x speed, and what is known of it:
#:   rows, stretches, points, speeds   it goes through the means of `points` pieces of stretches
#:   intercept, slope    with standard errors from the scatter of the means about the line, NaN if
#:                       there are no `degrees_of_freedom` (points - 2)
#:   slope_lower, slope_upper   the slope lies between them with 95 %
#:   scatter             standard deviation of the revolutions about the line
#:   slowest_m_s, fastest_m_s   of the rows
#:   miss, miss_sigmas   largest distance of a mean from the line, also in the mean's own errors
#:   parabola            coefficients (3,) of 1, speed, speed^2 through the same means; `curvature`
#:                       the last one with its error; NaN with fewer than three speeds
#:   judgement           what is known; `doubtful`: it is not tested, or misses its means
#:   speed_m_s, means, mean_se   the means themselves, (points,)
Regression = dict[str, Any]
#: columns of the table that stand in a Regression
COLUMNS = (
    "quantity", "intercept", "intercept_se", "slope", "slope_se", "slope_lower", "slope_upper",
    "scatter", "rows", "stretches", "points", "speeds", "degrees_of_freedom", "slowest_m_s",
    "fastest_m_s", "miss", "miss_sigmas", "curvature", "curvature_se", "judgement",
)  # fmt: skip


def _reach(free: int) -> float:
    """Half of the 95 % interval in standard errors: the t quantile for `free` degrees."""
    from scipy.special import stdtrit  # a tenth of a second that the table alone does without

    return float(stdtrit(max(free, 1), 0.975))


def pieces(speed_m_s: FloatArray, stretch: IntArray) -> IntArray:
    """Number of the piece of each row of sorted `stretch` (n,).

    A piece is a stretch, cut when its speed has moved by 1 m/s: a slow coast-down is no single
    speed; twice as much halves the points of such a stretch and leaves others alone.
    """
    out, number, low, high = np.zeros(stretch.size, np.int64), 0, speed_m_s[0], speed_m_s[0]
    for row in range(1, stretch.size):
        low, high = min(low, speed_m_s[row]), max(high, speed_m_s[row])
        if stretch[row] != stretch[row - 1] or high - low > 1.0:
            number, low, high = number + 1, speed_m_s[row], speed_m_s[row]
        out[row] = number
    return out


def _through(
    design: FloatArray, means: FloatArray, variance: FloatArray
) -> tuple[FloatArray, FloatArray, int]:
    """(coefficients, covariance, degrees of freedom): `means` (m,) on `design` (m, k).

    Least squares; `variance` (m,): of each mean, from the scatter within its stretch. The
    covariance is NaN without a degree of freedom.

    The scatter between stretches is what makes the weighted residuals as large as their degrees of
    freedom (Paule, Mandel); the covariance is scaled by those residuals (Knapp, Hartung), so that
    with a t quantile its intervals hold for few means.
    """
    free = means.size - design.shape[1]

    def solved(between: float) -> tuple[FloatArray, FloatArray, float]:
        weight = 1.0 / (variance + between)
        inverse = np.asarray(np.linalg.inv(design.T @ (weight[:, None] * design)), dtype=np.float64)
        found = inverse @ (design.T @ (weight * means))
        return found, inverse, float((weight * (means - design @ found) ** 2).sum())

    if free < 1:
        found, inverse, _ = solved(0.0)
        return found, np.full_like(inverse, np.nan), 0
    low, high = 0.0, float(np.ptp(means)) ** 2 if solved(0.0)[2] > free else 0.0
    # halvings of the interval that holds the scatter between stretches
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if solved(middle)[2] > free else (low, middle)
    found, inverse, left = solved(high)
    return found, inverse * (left / free), free


def regression(
    quantity: str, speed_m_s: FloatArray, values: FloatArray, stretch: IntArray
) -> Regression | None:
    """The line of `values` on `speed_m_s` (n,) through the means of the stretches.

    None if rows are too few or of one speed. `stretch` (n,): number of each row's stretch of
    constant speed; rows outside of stretches have -1 and are left out.
    """
    good = (stretch >= 0) & np.isfinite(values) & np.isfinite(speed_m_s)
    v, y, group = speed_m_s[good], values[good], stretch[good]
    # rows of constant speed that a regression needs; half as many would leave a parabola one degree
    # of freedom, twice as many refuse short tests
    if v.size < 8:
        return None
    order = np.argsort(group, kind="stable")
    v, y, group = v[order], y[order], group[order]
    piece = pieces(v, group)
    count = np.bincount(piece)
    speed, means = np.bincount(piece, v) / count, np.bincount(piece, y) / count
    # means nearer than this are of one speed [m/s]: under one speed's scatter from stretch to
    # stretch, above the steps of a test plan; twice as much takes steps of less than 1 m/s for one
    # speed
    speeds = 1 + int((np.diff(np.sort(speed)) > 0.5).sum())
    if speeds < 2:
        return None
    within = float(((y - means[piece]) ** 2).sum()) / max(v.size - count.size, 1)
    # rounding alone is no scatter, and weights need one
    variance = np.maximum(within, (1e-12 * float(np.abs(means).max())) ** 2 + 1e-300) / count
    middle = float(speed.mean())
    powers = np.vander(speed - middle, 3, increasing=True)
    line, covariance, free = _through(powers[:, :2], means, variance)
    to_zero = np.array([1.0, -middle])
    slope, slope_se = float(line[1]), float(np.sqrt(covariance[1, 1]))
    reach = slope_se * _reach(free)
    left = np.abs(means - powers[:, :2] @ line)
    parabola, curvature_se, bent = (float("nan"),) * 3, float("nan"), False
    if speeds >= 3:
        (a, b, c), of_curve, spare = _through(powers, means, variance)
        parabola = float(a - b * middle + c * middle**2), float(b - 2.0 * c * middle), float(c)
        curvature_se = float(np.sqrt(of_curve[2, 2]))
        bent = spare > 0 and abs(c) > curvature_se * _reach(spare)
    sigmas = float((left / np.sqrt(variance)).max())
    about = y - (line[0] + slope * (v - middle))
    judgement = _judgement(speeds, free, bent, sigmas)
    return {
        "quantity": quantity,
        "intercept": float(to_zero @ line),
        "intercept_se": float(np.sqrt(to_zero @ covariance @ to_zero)),
        "slope": slope,
        "slope_se": slope_se,
        "slope_lower": slope - reach,
        "slope_upper": slope + reach,
        "scatter": float(np.sqrt((about**2).sum() / (v.size - 2))),
        "rows": int(v.size),
        "stretches": int(np.unique(group).size),
        "points": int(count.size),
        "speeds": speeds,
        "degrees_of_freedom": free,
        "slowest_m_s": float(v.min()),
        "fastest_m_s": float(v.max()),
        "miss": float(left.max()),
        "miss_sigmas": sigmas,
        "parabola": parabola,
        "curvature": parabola[2],
        "curvature_se": curvature_se,
        "judgement": judgement,
        "doubtful": bool(judgement) and not judgement.startswith(SCATTERED),
        "speed_m_s": speed,
        "means": means,
        "mean_se": np.sqrt(variance),
    }


def _judgement(speeds: int, free: int, bent: bool, sigmas: float) -> str:
    """Why a line through means at some `speeds` is doubtful.

    Empty if nothing speaks against it.
    """
    # a line misses a mean that lies further off than this many of the mean's own standard
    # errors: by noise alone one line in a thousand does; at twice as many only a line that is
    # visibly wrong
    far = f"the line misses a mean by {sigmas:.0f} of its errors" if sigmas > 4.0 else ""
    if speeds < 3 or free <= 1:
        untested = f"{speeds} speeds: a line is not tested"
        return f"{untested}; {far}, a parabola may follow them" if free > 0 and far else untested
    if bent:
        return "the line misses the means, a parabola follows them" + (f"; {far}" if far else "")
    return f"{SCATTERED} ({far})" if far else ""


# ---- The tables of the command `dissipation`.
#
# A row per revolution, its moving averages sorted by speed, and the regressions on speed.
#
# Recording --passages, dissipation--> columns
#     --power, force, coefficient if the setup gives what they need--> table
# rows of constant speed
#     --`regression`: lines through the means of their stretches--> regressions


def dissipation_of_channel(
    recording: Recording,
    channel: Channel,
    passages: Passages,
    steady_step_m_s: float = STEADY_STEP_M_S,
) -> PassageRows:
    """The dissipation of one strain channel of `recording`."""
    found = dissipation(
        channel,
        passages,
        recording.setup.tire.area_m2,
        speed_quality(passages),
        steady_step_m_s=steady_step_m_s,
    )
    columns = identity_columns(recording.log, passages) | {
        "dissipation_factor_1_m": found.factor_1_m,
        "dissipation_factor_se_1_m": found.factor_se_1_m,
        "specific_power_m3_s2": found.specific_power_m3_s2,
        "steady": found.steady,
        "dissipation_factor_mean_1_m": found.factor_mean_1_m,
        "specific_power_mean_m3_s2": found.specific_power_mean_m3_s2,
    }
    columns |= _with_viscosity(recording, found, passages.speed_m_s)
    columns["quality"] = quality_column(found.quality)
    remarks = (passages.doubt,) if passages.doubt else _remarks(recording, channel.surface)
    return PassageRows(columns, remarks, released(channel), passages, found)


def _with_viscosity(
    recording: Recording, found: Any, speed_m_s: FloatArray
) -> dict[str, FloatArray]:
    """Power eta P_d of the strip under the grating, and that over speed and over load.

    No columns without viscosity and area; the last one only if the load is known.

    P1 (27) is the power of one strip of the belt, of the given section and viscosity, under one
    grating. Of a whole tire's rolling resistance (some 1 % of the load) it is a part. Its share is
    known only with the true section, viscosity and lever arm.
    """
    tire, load = recording.setup.tire, recording.setup.conditions.load_N
    if tire.viscosity_Pa_s is None or tire.area_m2 is None:
        return {}
    power = tire.viscosity_Pa_s * found.specific_power_m3_s2
    with np.errstate(invalid="ignore", divide="ignore"):
        force = power / speed_m_s
    more = {"strip_power_W": power, "strip_rolling_resistance_N": force}
    return more | (
        {"strip_rolling_resistance_coefficient": force / load} if load is not None else {}
    )


def _remarks(recording: Recording, surface: str | None) -> tuple[str, ...]:
    """What the setup left open, and what a power in watts holds for."""
    tire = recording.setup.tire
    remarks = []
    if tire.area_m2 is None:
        remarks.append(
            "no section area in the setup: no specific power; give section_area_m2, or "
            "section_height_m and width_m, under [tire]"
        )
    elif tire.section_area_m2 is None:
        remarks.append(
            f"section area taken as section height x width = {tire.area_m2:.4g} m^2; "
            "section_area_m2 under [tire] overrides it"
        )
    if tire.viscosity_Pa_s is not None and tire.area_m2 is not None:
        remarks.append(
            "powers in W and resistances in N are of the strip under the grating alone, with the "
            "setup's viscosity"
        )
        remarks.append(_in_bending(surface, tire.section_height_m))
    return tuple(remarks)


def _in_bending(surface: str | None, height_m: float | None) -> str:
    """What P1 (27) reads of a strip that bends and does not stretch.

    For a strip of height h: 12 (y / h)^2 of its power, y off the neutral axis.

    The strain at z is then z / y times the grating's, and P1 (25) becomes

    eta A h^2 / (12 y^2) int (d eps_m / ds)^2 ds; (27) leaves the factor h^2 / (12 y^2) out.
    """
    text = "the power is that of pure stretching; in pure bending a grating "
    if surface == "inner":
        return text + "on the liner reads three times too much"
    # where 12 (y / h)^2 is 1
    right = (
        "0.29 of the strip's height" if height_m is None else f"{1e3 * height_m / 12.0**0.5:.1f} mm"
    )
    return text + (
        f"in a groove reads right {right} from the neutral axis, too little nearer to it "
        "(docs: dissipation)"
    )


def regressions(log: str, rows: PassageRows) -> tuple[dict[str, Any] | None, tuple[str, ...]]:
    """(regressions of factor and specific power on speed, why there are none).

    The regressions are rows of a table; None if there are too few revolutions.
    """
    stretch = np.where(good(rows.found.quality), rows.found.stretch, -1)
    lines = [
        regression(name, rows.passages.speed_m_s, rows.columns[name], stretch)
        for name in ("dissipation_factor_1_m", "specific_power_m3_s2")
    ]
    kept = [line for line in lines if line is not None]
    if not kept:
        return None, (
            f"{rows.channel.name}: no regression: too few revolutions of constant speed, "
            "or one speed",
        )
    columns = {name: np.array([line[name] for line in kept]) for name in COLUMNS}
    return {"log": log, "channel": rows.channel.name} | columns, ()
