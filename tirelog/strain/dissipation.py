"""Dissipation of every revolution from the strain's own time derivative (P1 27-29, errata).

    Channel
        --means of some samples, lost ones bridged, differentiator, square-->
        energy of each revolution, block by block
            --minus what the noise brings, over the speed-->
            factor, specific power, standard error, a row per passage
            --stretches of constant speed--> moving averages

    p_d = int eps'^2 ds = (1 / v) int (d eps / dt)^2 dt over one revolution
    P_d = v^2 A p_d, with v = R Omega

A revolution runs from half a turn before the patch centre to half a turn after. White noise of
sigma adds sigma^2 x (sum of the squared filter) to each squared derivative: it is taken off. The
filter passes what a patch's strain holds along the tread, up to PASS / L at the log's top speed, so
that its own bias is below 1e-3 (0.3e-3 on a stiff-treaded ring) as long as the sampling allows.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from tirelog.data.recording import BLOCK_SAMPLES, Channel
from tirelog.dsp.filters import bridged, differentiator
from tirelog.kernels import compiled
from tirelog.strain.passages.find import Passages
from tirelog.strain.passages.passage_flags import doubted, in_gap
from tirelog.strain.passages.template import LENGTH_TO_WIDTH
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray, Records
from tirelog.vocabulary.quality import Quality, QualityFlags, good, marked

# Samples to the energy of their derivative in each revolution, in one pass.
#
# values (n,) --antisymmetric FIR--> slope (n,)
#     --square, and square of its own change--> sums over each row's samples

#: a row's sums: of the squared slope, and of its squared change from one place to the next
ENERGY = np.dtype([("slope2", "f8"), ("change2", "f8")])


@compiled
def revolution_sums(
    values: FloatArray, side: FloatArray, rows: IntArray, low: IntArray, high: IntArray,
    sums: Records,
) -> None:  # fmt: skip
    """Adds to `sums` the squared derivative of `values`, and its squared changes.

    `sums` (m,) of ENERGY, of the `rows` (k,): the squared derivative of `values` (n,) over their
    places [low, high) (k,), and its squared change from one place to the next. `side` (half,) are
    the filter's coefficients on one side; `values` reach a place more than those beyond the places.

    derivative[i] = sum over k of side[k - 1] (values[i + k] - values[i - k]), 0 if that leaves
    `values`.
    """
    slope = _derivative(values, side)
    for j in range(rows.size):
        row = sums[rows[j]]
        energy, bend = row["slope2"], row["change2"]
        for i in range(max(low[j], 1), min(high[j], values.size - 1)):
            change = 0.5 * (slope[i + 1] - slope[i - 1])
            energy += slope[i] * slope[i]
            bend += change * change
        row["slope2"], row["change2"] = energy, bend


@compiled
def _derivative(values: FloatArray, side: FloatArray) -> FloatArray:
    """The derivative of `values` (n,), shape (n,)."""
    half, n, slope = side.size, values.size, np.zeros(values.size)
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
    return slope


#: pass edge of the differentiator, in half lengths: wave number x half length
PASS = 20.0
#: and at most this share of the Nyquist frequency; below LEAST the derivative itself is lost;
#: nearer to one, the filter needs many more coefficients
SHARE_OF_NYQUIST, LEAST = 0.8, 6.0
#: the patch with its shoulders, in half windows of the passages
SHOULDERS = 1.6
#: a gap in the patch with its shoulders is bridged up to so many means, half a period of the pass
#: edge, and elsewhere up to this share of a turn; twice as many means bridge a whole period, whose
#: slope is lost, and twice the share half a turn
BRIDGED_MEANS, BRIDGED_TURNS = 2.0, 0.25
#: samples worked on at once
MOST_AT_ONCE = 1 << 16
#: constant speed: the step from one revolution to the next (P1 4) [m/s], and revolutions of a
#: moving average; twice the step takes gentle braking for a constant speed
STEADY_STEP_M_S, AVERAGED = 0.08, 9


@dataclass(frozen=True)
class Dissipation:
    """One row per passage, shape (n,): the dissipation factor and what follows from it.

    Factor p_d [1/m] with its standard error, specific power P_d [m^3/s^2] (NaN without an area),
    whether the speed is constant there, and the moving averages in such stretches (NaN elsewhere);
    `stretch`: number of the stretch, -1 outside; `quality`: flags.
    """

    factor_1_m: FloatArray
    factor_se_1_m: FloatArray
    specific_power_m3_s2: FloatArray
    steady: BoolArray
    factor_mean_1_m: FloatArray
    specific_power_mean_m3_s2: FloatArray
    stretch: IntArray
    quality: QualityFlags


@dataclass(frozen=True)
class _Filter:
    """How the derivative is taken.

    Coefficients on means of `averaged` samples, with `rate_Hz` means per second; `limited`: the
    sampling is too coarse for the patch.
    """

    coefficients: FloatArray
    averaged: int
    rate_Hz: float
    limited: bool


def _filter(channel: Channel, passages: Passages) -> _Filter:
    """The differentiator for the fastest passage."""
    rate = channel.axis.rate_Hz
    half_width = passages.template.half_width_rad if passages.template is not None else 0.12
    half_length = LENGTH_TO_WIDTH * half_width * passages.radius_m
    top = float(np.nanmax(passages.speed_m_s))
    wanted = PASS / half_length * top / (2.0 * np.pi)
    # means are taken of as many samples as leave this many per period of the pass edge; twice as
    # many take twice as long and change what the filter passes no more
    averaged = int(2 ** np.floor(np.log2(max(rate / (4.0 * wanted), 1.0))))
    edge = min(wanted, SHARE_OF_NYQUIST * 0.5 * rate / averaged)
    return _Filter(
        differentiator(rate / averaged, edge, averaged),
        averaged,
        rate / averaged,
        edge < LEAST / PASS * wanted,
    )


class _Filled:
    """A channel with the samples that are missing in its gaps laid out as lost ones.

    They are bridged like these, so that a gap of a few samples costs a revolution nothing. Longer
    gaps than what is worked on at once stay out.
    """

    def __init__(self, channel: Channel) -> None:
        axis = channel.axis
        missing = np.rint(axis.missing).astype(np.int64)
        self._channel = channel
        #: samples laid out before each segment, (k,)
        self._before = np.cumsum(np.where(missing > MOST_AT_ONCE, 0, missing))
        self._first = axis.first
        self.size = channel.size + int(self._before[-1] if self._before.size else 0)
        #: places with which the recording goes on after a gap that is not laid out
        self.breaks = (axis.first + self._before)[missing > MOST_AT_ONCE]

    def place(self, index: FloatArray) -> FloatArray:
        """The place of a fractional sample index, (n,)."""
        segment = np.searchsorted(self._first[1:], index, side="right")
        place: FloatArray = index + (self._before[segment] if self._before.size else 0)
        return place

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
        if not self._before.size:
            return place
        first = self._first + self._before
        segment = max(int(np.searchsorted(first, place, side="right")) - 1, 0)
        ends = np.append(self._first[1:], self._channel.size)
        return int(min(place - self._before[segment], ends[segment]))


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


def _means(values: FloatArray, averaged: int) -> FloatArray:
    """Means of `averaged` neighbours, NaN if any of them is lost."""
    return (
        values
        if averaged == 1
        else values[: values.size // averaged * averaged].reshape(-1, averaged).mean(axis=1)
    )


def _energies(
    channel: Channel, passages: Passages, how: _Filter, block_samples: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sums over each revolution: energy, bend, and how many means; (n,) each.

    The squared derivative, and its own squared slope (for the error).
    """
    filled = _Filled(channel)
    bounds = [np.round(b / how.averaged) for b in _bounds(passages, filled.place(passages.index))]
    last = filled.size // how.averaged
    known = np.isfinite(bounds[0]) & np.isfinite(bounds[1])
    low, high = (np.clip(np.where(known, b, 0.0), 0, last).astype(np.int64) for b in bounds)
    # a sample off its neighbours' cubic by more than these many sigmas and this share of the
    # passages' height is bridged; twice as much of either leaves spikes in that are half as large
    # as what counts
    wild = max(
        10.0 * passages.noise / np.sqrt(how.averaged),
        0.06 * float(np.nanmedian(np.abs(passages.height))),
    )
    half = how.coefficients.size // 2
    side = how.coefficients[:half][::-1].copy()
    step = max(min(block_samples, MOST_AT_ONCE) // how.averaged, 4 * how.coefficients.size)
    sums = np.zeros(len(passages), ENERGY)
    breaks = np.concatenate([[0], filled.breaks // how.averaged, [last]])
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
            if rows.size:
                # a place more for changes, and `bridged` judges a sample by three on either side
                first, final = max(start - half - 4, begin), min(stop + half + 4, end)
                raw = filled.read(first * how.averaged, final * how.averaged)
                means = bridged(np.ascontiguousarray(_means(raw, how.averaged)), wild)
                within = np.maximum(low[rows], start), np.minimum(high[rows], stop)
                revolution_sums(means, side, rows, within[0] - first, within[1] - first, sums)
    return sums["slope2"], sums["change2"], (high - low).astype(float) * known


def _in_long_gap(channel: Channel, passages: Passages, how: _Filter) -> BoolArray:
    """Whether a gap is too long to be bridged in each passage's revolution, (n,)."""
    axis, index = channel.axis, passages.index
    turn = 2.0 * np.pi / passages.omega_rad_s * axis.rate_Hz
    shoulders = SHOULDERS * passages.window_rad / (2.0 * np.pi) * turn
    near = in_gap(axis, index, shoulders, BRIDGED_MEANS * how.averaged)
    low, high = index - 0.5 * turn, index + 0.5 * turn
    missing = axis.missing_before(high) - axis.missing_before(low)
    return np.asarray(near | (missing > BRIDGED_TURNS * turn))


def steady_stretches(
    speed_m_s: FloatArray, next_known: BoolArray, step_m_s: float = STEADY_STEP_M_S
) -> IntArray:
    """Number of the stretch of constant speed of each row, -1 outside, shape (n,).

    A stretch: two or more rows in a row, each one turn after the one before (`next_known`), whose
    speeds step by less than `step_m_s` in size (errata: P1 prints the step without its absolute
    value, and braking would always pass).
    """
    n = speed_m_s.size
    if n < 2:
        return np.full(n, -1)
    with np.errstate(invalid="ignore"):
        joined = (np.abs(np.diff(speed_m_s)) < step_m_s) & next_known[:-1]
    inside = np.concatenate([joined, [False]]) | np.concatenate([[False], joined])
    starts = inside & ~np.concatenate([[False], joined])
    return np.where(inside, np.cumsum(starts) - 1, -1)


def moving_average(values: FloatArray, stretch: IntArray, width: int = AVERAGED) -> FloatArray:
    """Centred mean over `width` rows within each stretch, narrower at its ends.

    NaN outside of stretches. NaN values are left out.
    """
    n = values.size
    good = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(good, values, 0.0))])
    count = np.concatenate([[0], np.cumsum(good)])
    row = np.arange(n)
    edges = np.concatenate([[0], np.flatnonzero(np.diff(stretch)) + 1, [n]])
    run = np.searchsorted(edges, row, side="right") - 1
    reach = np.minimum(width // 2, np.minimum(row - edges[run], edges[run + 1] - 1 - row))
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
    averaged: int = AVERAGED,
    block_samples: int = BLOCK_SAMPLES,
) -> Dissipation:
    """The dissipation in each revolution of the strain `channel`.

    `area_m2` of the section (None: no specific power); `quality` (n,): the flags that the speeds
    already have; `averaged`: revolutions of a moving average.
    """
    n = len(passages)
    if not np.isfinite(passages.speed_m_s).any():
        nan = np.full(n, np.nan)
        return Dissipation(nan, nan, nan, np.zeros(n, bool), nan, nan, np.full(n, -1), quality)
    how = _filter(channel, passages)
    energy, bend, means = _energies(channel, passages, how, block_samples)
    speed = passages.speed_m_s
    sigma2 = passages.noise**2 / how.averaged
    per_mean = sigma2 * float((how.coefficients**2).sum())
    step = 1.0 / how.rate_Hz
    lags = np.correlate(how.coefficients, how.coefficients, "full")
    # the slope's own noise is in `bend` too, and does not belong there
    bend = np.maximum(
        bend - means * sigma2 * float((np.convolve(how.coefficients, (0.5, 0.0, -0.5)) ** 2).sum()),
        0.0,
    )
    variance = 4.0 * sigma2 * bend * how.rate_Hz**2 + 2.0 * sigma2**2 * means * float(
        (lags**2).sum()
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        # a revolution whose patch the log cuts off has no energy of its own
        reach = (
            SHOULDERS * passages.window_rad / passages.omega_rad_s * channel.axis.rate_Hz
            + (how.coefficients.size // 2 + 2) * how.averaged
        )
        whole = (
            (means > 0) & (passages.index - reach >= 0) & (passages.index + reach <= channel.size)
        )
        factor = np.where(whole, (energy - means * per_mean) * step / speed, np.nan)
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
    quality = quality | marked(absurd, Quality.ERROR_UNKNOWN) | marked(bursts, Quality.SPIKE)
    quality = quality | marked(_in_long_gap(channel, passages, how), Quality.GAP)
    power = speed**2 * area_m2 * factor if area_m2 is not None else np.full(n, np.nan)
    stretch = steady_stretches(speed, passages.turn_after, steady_step_m_s)
    clean = good(quality)
    return Dissipation(
        factor,
        error,
        power,
        stretch >= 0,
        moving_average(np.where(clean, factor, np.nan), stretch, averaged),
        moving_average(np.where(clean, power, np.nan), stretch, averaged),
        stretch,
        quality | np.uint32(Quality.CUTOFF) if how.limited else quality,
    )


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


#: a stretch is cut when its speed has moved by this much [m/s]: a slow coast-down is no single
#: speed; twice as much halves the points of such a stretch and leaves others alone
PIECE_M_S = 1.0
#: probability that an interval covers; and the one of the test whether a parabola is needed; half
#: the rest, 0.975, makes intervals a seventh wider
COVERED = 0.95
#: said of a line whose errors hold although its means lie far off
SCATTERED = "stretches scatter more than their revolutions, which the errors count"


#: the line quantity = intercept + slope x speed, and what can be said of it:
#:   rows, stretches, points, speeds   it goes through the means of `points` pieces of stretches
#:   intercept, slope    with standard errors from the scatter of the means about the line, NaN if
#:                       there are no `degrees_of_freedom` (points - 2)
#:   slope_lower, slope_upper   the slope lies between them with 95 %
#:   scatter             standard deviation of the revolutions about the line
#:   slowest_m_s, fastest_m_s   of the rows
#:   miss, miss_sigmas   largest distance of a mean from the line, also in the mean's own errors
#:   parabola            coefficients (3,) of 1, speed, speed^2 through the same means; `curvature`
#:                       the last one with its error; NaN with fewer than three speeds
#:   judgement           what can be said; `doubtful`: it is not tested, or misses its means
#:   speed_m_s, means, mean_se   the means themselves, (points,)
Regression = dict[str, Any]
#: columns of the table that stand in a Regression
COLUMNS = (
    "quantity", "intercept", "intercept_se", "slope", "slope_se", "slope_lower", "slope_upper",
    "scatter", "rows", "stretches", "points", "speeds", "degrees_of_freedom", "slowest_m_s",
    "fastest_m_s", "miss", "miss_sigmas", "curvature", "curvature_se", "judgement",
)  # fmt: skip


def _reach(free: int) -> float:
    """Half of the COVERED interval in standard errors: the t quantile for `free` degrees."""
    from scipy.special import stdtrit  # a tenth of a second that the table alone does without

    return float(stdtrit(max(free, 1), 0.5 + 0.5 * COVERED))


def pieces(speed_m_s: FloatArray, stretch: IntArray) -> IntArray:
    """Number of the piece of each row of sorted `stretch` (n,).

    A piece is a stretch, cut when its speed has moved by PIECE_M_S.
    """
    out, number, low, high = np.zeros(stretch.size, np.int64), 0, speed_m_s[0], speed_m_s[0]
    for row in range(1, stretch.size):
        low, high = min(low, speed_m_s[row]), max(high, speed_m_s[row])
        if stretch[row] != stretch[row - 1] or high - low > PIECE_M_S:
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
    low, high = 0.0, float(np.ptp(means)) ** 2
    if solved(low)[2] > free:
        # halvings of the interval that holds the scatter between stretches
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if solved(middle)[2] > free else (low, middle)
    else:
        high = 0.0
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
    left = means - powers[:, :2] @ line
    to_zero = np.array([1.0, -middle])
    slope, slope_se = float(line[1]), float(np.sqrt(covariance[1, 1]))
    reach = slope_se * _reach(free)
    parabola, curvature_se, bent = (float("nan"),) * 3, float("nan"), False
    if speeds >= 3:
        curve, of_curve, spare = _through(powers, means, variance)
        a, b, c = (float(x) for x in curve)
        parabola, curvature_se = (
            (a - b * middle + c * middle**2, b - 2.0 * c * middle, c),
            float(np.sqrt(of_curve[2, 2])),
        )
        bent = spare > 0 and abs(c) > curvature_se * _reach(spare)
    sigmas = np.abs(left) / np.sqrt(variance)
    about = y - (line[0] + slope * (v - middle))
    judgement = _judgement(speeds, free, bent, float(sigmas.max()))
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
        "miss": float(np.abs(left).max()),
        "miss_sigmas": float(sigmas.max()),
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
    """What can be said of a line through means at some `speeds`.

    Empty if nothing speaks against it.
    """
    # a line is said to miss a mean that lies further off than this many of the mean's own standard
    # errors: by noise alone one line in a thousand does; at twice as many only a line that is
    # visibly wrong
    far = f"the line misses a mean by {sigmas:.0f} of its errors" if sigmas > 4.0 else ""
    if speeds < 3 or free <= 1:
        untested = f"{speeds} speeds: a line is not tested"
        return f"{untested}; {far}, a parabola may follow them" if free > 0 and far else untested
    if bent:
        return "the line misses the means, a parabola follows them" + (f"; {far}" if far else "")
    return f"{SCATTERED} ({far})" if far else ""
