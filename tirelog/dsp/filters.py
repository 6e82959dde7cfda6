"""A band-limited differentiator for whole channels.

With it its response, and what white noise brings through it.

    samples, block by block --lost and wild samples bridged-->
                            --FIR, zero-phase (`differentiator`)--> time derivative

The filter is antisymmetric, so it has no delay.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from math import comb

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from tirelog.data.recording import Channel, TimeAxis
from tirelog.errors import UsageError
from tirelog.vocabulary.arrays import BoolArray, FloatArray, IntArray
from tirelog.vocabulary.quality import Quality, QualityFlags, good, none_of

# ---- Low-passed time derivatives of windows around the passages, by their spectra.
#
#     windows (n, m) --lost samples bridged, ends brought to zero, FFT--> spectra (n, m // 2 + 1)
#                    --gain x (2 pi i f)^k, zero-padded inverse--> both derivatives (n, m x
#                    upsample)
#
# A row's result depends on its own samples only.


ComplexArray = NDArray[np.complex128]


def closed(windows: FloatArray) -> FloatArray:
    """`windows` (n, m) with NaN bridged, closed without a step.

    Bridged by straight lines (the nearest sample at the ends); less the line through the means of
    the first and the last m / 32, so that they close. Rows that are all NaN become 0.
    """
    out, place = windows.copy(), np.arange(windows.shape[1])
    lost = np.isnan(out)
    for row in np.flatnonzero(lost.any(axis=1)):
        known = place[~lost[row]]
        out[row] = np.interp(place, known, out[row, known]) if known.size else 0.0
    edge = max(place.size // 32, 1)
    first, last = out[:, :edge].mean(axis=1), out[:, -edge:].mean(axis=1)
    out -= first[:, None] + np.multiply.outer(last - first, place / (place.size - 1))
    return out


def window_spectra(windows: FloatArray) -> ComplexArray:
    """FFT of the rows of `windows`, closed."""
    return np.fft.rfft(closed(windows), axis=1)


def derivatives(
    spectra: ComplexArray, rate_Hz: float, cutoff_Hz: FloatArray, count: int, upsample: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """First and second time derivative of rows, low-passed at `cutoff_Hz` (n,); what noise does.

    Of rows of `count` samples with `spectra`, at `upsample` x `count` points, (n, m) each; standard
    deviations (n, 2) of the second and of the third derivative, for noise of one per sample.
    """
    turning = 2.0 * np.pi * np.fft.rfftfreq(count, 1.0 / rate_Hz)
    passed = _passed(rate_Hz, cutoff_Hz, count)
    power = (passed * turning**2) ** 2
    noise = np.stack([power.sum(axis=1), power @ turning**2], axis=1)
    first = upsample * passed * turning * spectra
    second = -turning * first
    if count % 2 == 0:  # the highest frequency has no phase, and two halves between samples
        first[:, -1] = 0.0
        second[:, -1] *= 0.5 if upsample > 1 else 1.0
    slope, bend = (np.fft.irfft(one, n=count * upsample, axis=1) for one in (1j * first, second))
    return slope, bend, np.sqrt(2.0 / count * noise)


def _passed(rate_Hz: float, cutoff_Hz: FloatArray, count: int) -> FloatArray:
    """Gain of the low-pass at the frequencies of rows of `count` samples, (n, count // 2 + 1).

    A Butterworth filter of order 4, which acts forwards and backwards.
    """
    ratio = np.fft.rfftfreq(count, 1.0 / rate_Hz) / cutoff_Hz[:, None]
    # squares of squares are quicker than a power of floats
    return np.asarray(1.0 / (1.0 + np.square(np.square(np.square(ratio)))))


def lowpassed(
    spectra: ComplexArray, rate_Hz: float, cutoff_Hz: FloatArray, count: int, upsample: int
) -> FloatArray:
    """The rows of `spectra` low-passed, (n, m), arguments as of `derivatives`."""
    shaped = spectra * (upsample * _passed(rate_Hz, cutoff_Hz, count))
    if count % 2 == 0:
        shaped[:, -1] *= 0.5 if upsample > 1 else 1.0
    return np.fft.irfft(shaped, n=count * upsample, axis=1)


def averaging_gain(omega: FloatArray, averaged: int) -> FloatArray:
    """Gain of the mean of `averaged` samples at `omega` [rad per mean] of the means' own rate."""
    fine = np.asarray(omega, float) / averaged
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(
            fine == 0, 1.0, np.sin(0.5 * averaged * fine) / (averaged * np.sin(0.5 * fine))
        )


def differentiator(rate_Hz: float, edge_Hz: float, averaged: int = 1) -> FloatArray:
    """Coefficients of the derivative [1/s] of what lies below `edge_Hz`, (2 k + 1,).

    np.convolve(values, coefficients, 'valid') is the derivative.

    Least squares: relative error in the pass band, size in the stop band. `averaged`: `values` are
    means of so many samples, whose droop is made up for.
    """
    # ten half periods of the pass edge, within bounds [samples]
    half = int(np.clip(np.ceil(10.0 * rate_Hz / (2.0 * edge_Hz)), 10, 400))
    place = np.arange(1, half + 1)
    edge = 2.0 * np.pi * edge_Hz / rate_Hz
    passed = (np.arange(8 * half) + 0.5) / (8 * half) * edge
    # the stop band begins at this multiple of the pass edge; its weight against the pass band's
    # relative error
    stopped = np.linspace(min(1.3 * edge, np.pi), np.pi, 8 * half, endpoint=False)
    passing = 2.0 * np.sin(np.multiply.outer(passed, place)) / passed[:, None]
    stopping = 2.0 * 0.02 / edge * np.sin(np.multiply.outer(stopped, place))
    design = np.vstack([passing, stopping])
    wanted = np.concatenate([1.0 / averaging_gain(passed, averaged), np.zeros(stopped.size)])
    side = np.linalg.lstsq(design, wanted, rcond=None)[0] * rate_Hz
    return np.concatenate([side[::-1], [0.0], -side])


def bridged(values: FloatArray, wild: float) -> FloatArray:
    """`values` (n,) with lost and wild samples replaced.

    Wild are such as leave the cubic through their four neighbours by more than `wild` and more than
    those leave theirs. Replaced by that cubic if the neighbours are there, else linearly. `values`
    themselves if all are good; zeros if all are lost.
    """
    bend = np.zeros(values.size)
    bend[2:-2] = np.nan_to_num(np.abs(np.diff(values, 4))) / 6.0
    lost = np.isnan(values)
    if bend.max(initial=0.0) > wild:
        around = np.pad(bend, 1)
        lost |= (bend > wild) & (bend >= around[:-2]) & (bend >= around[2:])
    gaps, known = np.flatnonzero(lost), np.flatnonzero(~lost)
    if not gaps.size:
        return values
    if not known.size:
        return np.zeros_like(values)
    filled = values.copy()
    filled[gaps] = np.interp(gaps, known, values[known])
    beside = lost[:-4] | lost[1:-3] | lost[3:-1] | lost[4:]
    alone = 2 + np.flatnonzero(lost[2:-2] & ~beside)
    near, far = values[alone - 1] + values[alone + 1], values[alone - 2] + values[alone + 2]
    filled[alone] = (4.0 * near - far) / 6.0
    return filled


# ---- The cut-off of the footprint's zero-phase low-pass, as the user says it.
#
# Its gain is in `derivatives`.
#
#     "auto" | "rest" | "400Hz" | "40x" --parse--> Cutoff
#         --speed of each passage--> cut-off [Hz], shape (n,)
#
# P2 used 400 Hz (and 300), "roughly 40 times the wheel frequency", chosen from the spectrum of the
# log at rest; that multiple holds near 70 km/h only (errata), so the unit is part of the setting.
# `rest` chooses as P2 did, by `least_error_cutoff`.


def least_error_cutoff(passing: FloatArray, resting: FloatArray, rate_Hz: float) -> float:
    """Cut-off [Hz] at which the second derivative of a low-passed passage is nearest to the truth.

    `passing` (n, m) are windows of passages, `resting` (k, m) of what the grating reads at rest.
    Of the powers P and N of their spectra, the noise N passes below the cut-off and the signal
    P - N is lost above it. Both count with f^4, as a second derivative has them:

        sum f^4 N (below) + sum f^4 (P - N) (above), least where the sum of f^4 (2 N - P) is

    N is by the median, so a wheel that moves once does not matter. (P2 4.3 gives no rule.)
    """
    count = passing.shape[1]
    taper = np.hanning(count)
    passed = np.abs(np.fft.rfft(taper * closed(passing), axis=1)) ** 2
    rested = np.abs(np.fft.rfft(taper * closed(resting), axis=1)) ** 2
    noise = np.median(rested, axis=0) / np.log(2.0)  # a power's median is ln 2 of its mean
    frequency = np.fft.rfftfreq(count, 1.0 / rate_Hz)
    lost = np.cumsum(frequency**4 * (2.0 * noise - passed.mean(axis=0)))
    return float(frequency[max(int(np.argmin(lost)), 1)])


@dataclass(frozen=True)
class Cutoff:
    """A cut-off setting.

    `unit` 'Hz' (value in Hz), 'x' (multiples of the wheel frequency), 'auto' or 'rest' (the log's
    spectrum at rest gives the value in Hz).
    """

    unit: str = "auto"
    value: float = float("nan")

    @classmethod
    def parse(cls, text: str) -> Cutoff:
        """`text` as the command line has it.

        UsageError: neither auto nor rest nor a number with Hz or x.
        """
        word = text.strip().lower()
        if word in ("auto", "rest"):
            return cls(word)
        found = re.fullmatch(r"([0-9]*\.?[0-9]+(?:e[0-9]+)?)\s*(hz|khz|x)", word)
        if not found or float(found[1]) <= 0:
            raise UsageError(
                f"cut-off {text!r}",
                allowed="allowed are auto, rest, hertz (400Hz) and multiples of the wheel "
                "frequency, as 40x",
                do="mend it",
            )
        unit, times = {"x": ("x", 1.0), "hz": ("Hz", 1.0), "khz": ("Hz", 1e3)}[found[2]]
        return cls(unit, times * float(found[1]))

    def frequency(
        self, speed_m_s: FloatArray, radius_m: float, wave_number_1_m: float
    ) -> FloatArray:
        """The cut-off [Hz] at each speed.

        `wave_number_1_m` is what `auto` found in the log (a cut-off along the tread).
        """
        if self.unit == "Hz":
            return np.full(np.shape(speed_m_s), self.value)
        per_metre = wave_number_1_m if self.unit == "auto" else self.value / radius_m
        return np.abs(speed_m_s) * per_metre / (2.0 * np.pi)

    def __str__(self) -> str:
        return self.unit if self.unit in ("auto", "rest") else f"{self.value:g}{self.unit}"


# ---- The noise of one sample, from the log itself.
#
#     a channel's samples
#         --sixth differences of pieces spread over the log--> sigma [unit of the channel]
#
# Sixth differences remove what the tire does, even a patch of ten samples; the median of their size
# ignores spikes and steps. The pieces lie at fixed places of the log, so the answer does not depend
# on how the log is read.


#: median of |x| of a normal variable, in standard deviations
NORMAL_MEDIAN = 0.6744897501960817
#: pieces that are looked at, and samples per piece; a piece starts at a multiple of its length
PIECES, PIECE_SAMPLES = 64, 4096


def white_noise(values: FloatArray) -> float:
    """Standard deviation of the white noise on `values`, shape (n,), NaN allowed.

    NaN if fewer than 7 samples stand in a row.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        sizes = np.abs(np.diff(values, 6))
    sizes = sizes[np.isfinite(sizes)]
    # those of white noise have sqrt(binomial(12, 6)) standard deviations
    return float(np.median(sizes) / NORMAL_MEDIAN / comb(12, 6) ** 0.5) if sizes.size else np.nan


def step_of(values: FloatArray) -> float:
    """The step in which a source gives its `values` (n,); 0 if they are finer than their noise."""
    changes = np.abs(np.diff(values))
    changes = changes[np.isfinite(changes)]
    moved = changes[changes > 0.0]
    # share of the samples that are not the one before, up to which the least change is the step of
    # the source; noise of a standard deviation of a step repeats 0.27 of them
    repeated = moved.size < 0.8 * changes.size
    return float(moved.min()) if repeated and moved.size else 0.0


def rounding(channel: Channel) -> float:
    """Standard deviation of what the source of a channel rounds, if its samples show its step.

    The median of sixteen pieces, before another channel was subtracted.
    """
    recorded = channel.recorded or channel
    starts = np.linspace(0, max(recorded.size - PIECE_SAMPLES, 0), 16).astype(np.int64).tolist()
    steps = [step_of(recorded.read(first, first + PIECE_SAMPLES)) for first in starts]
    return float(np.median(steps)) / 12**0.5


def sample_noise(channel: Channel) -> float:
    """Standard deviation of the noise of one sample of a channel, from pieces all over it.

    The median over the pieces, never below the rounding of the source, which is its resolution over
    sqrt(12); NaN if all is lost or too short.
    """
    spread = np.linspace(0, max(channel.size - PIECE_SAMPLES, 0), PIECES).astype(np.int64)
    starts = np.unique(spread // PIECE_SAMPLES * PIECE_SAMPLES).tolist()
    sigmas = np.array([white_noise(channel.read(s, s + PIECE_SAMPLES)) for s in starts])
    finite = sigmas[np.isfinite(sigmas)]
    return max(float(np.median(finite)), channel.resolution / 12**0.5) if finite.size else np.nan


# ---- Whether stamps that scatter are those of the samples.
#
#     stamps and values of steep places
#         --both less the cubic through their neighbours--> do values follow the stamps' scatter?
#
# A logger that stamps late and early what an instrument samples evenly makes a patch shorter.


def even_axis(channel: Channel) -> TimeAxis | None:
    """The even time axis of a channel whose stamps scatter and whose samples do not.

    None if it has no stamps of its own, the values follow them, or they leave their line.
    """
    axis, size = channel.axis, channel.size
    if axis.explicit is None or size < 2 * PIECE_SAMPLES:
        return None
    starts = np.linspace(0, size - PIECE_SAMPLES, PIECES).astype(np.int64)
    stop = starts + PIECE_SAMPLES
    times, values = (
        np.stack([read(*ends) for ends in zip(starts.tolist(), stop.tolist(), strict=True)])
        for read in (axis.time, channel.read)
    )
    middles = 0.5 * (starts + stop - 1.0)
    means = times.mean(axis=1)
    period, begin = np.polyfit(middles, means, 1)
    # means of the stamps of an even clock without a gap leave their line by less than a sample
    if not period > 0.0 or np.ptp(means - begin - period * middles) > period:
        return None
    # less the cubic through four neighbours
    slope, off = 0.25 * (values[:, 4:] - values[:, :-4]), np.diff(values, 4) / 6.0
    late = slope * np.diff(times / period, 4) / 6.0
    known = np.isfinite(late + off)
    follows, squares = float(late[known] @ off[known]), float(late[known] @ late[known])
    # standard deviation of white noise less the cubic through its neighbours
    noises = [white_noise(piece) for piece in values]
    error = float(np.nanmedian(noises)) * (70.0 / 36.0) ** 0.5
    # share of the stamps' scatter that values of scattered samples follow is one, of even ones
    # none; it must be known to so many of its errors
    if 0.5 * np.sqrt(squares) < 5.0 * error or follows > 0.5 * squares:
        return None
    return TimeAxis.uniform(size, float(1.0 / period), float(begin))


def stamp_scatter(axis: TimeAxis) -> float:
    """Standard deviation of a sample's time about an even clock, in periods; 0 of an even axis."""
    if axis.explicit is None:
        return 0.0
    starts = np.linspace(0, max(axis.size - PIECE_SAMPLES, 0), PIECES).astype(np.int64).tolist()
    sigmas = [white_noise(axis.time(s, s + PIECE_SAMPLES)) for s in starts]
    return float(np.median(sigmas)) * axis.rate_Hz


#: longest running mean that is looked for [samples], and the shortest that third differences show
LONGEST_MEAN, SHORTEST_MEAN = 32, 4


def running_mean_of(channel: Channel) -> int:
    """How many samples the instrument of a channel averages into each; 1 if its noise is white."""
    starts = np.linspace(0, max(channel.size - PIECE_SAMPLES, 0), 16).astype(np.int64).tolist()
    totals = np.zeros(LONGEST_MEAN + 1)
    for first in starts:
        values = channel.read(first, first + PIECE_SAMPLES)
        moves = np.nan_to_num(np.diff(values, 3))
        noise = white_noise(values)
        if moves.size <= 4 * LONGEST_MEAN or not noise > step_of(values):
            continue
        loud = sliding_mean(np.abs(moves), 2 * LONGEST_MEAN + 1)
        # share of a log that is quiet: no patch and no shoulder
        quiet = np.where(loud <= np.quantile(loud, 0.4), moves, 0.0)
        quiet /= max(float(np.std(quiet)), 1e-300)
        used = (quiet != 0.0).astype(float)
        # loud samples leave fewer pairs the further these are apart
        totals += [
            float(quiet[lag:] @ quiet[: quiet.size - lag])
            / max(float(used[lag:] @ used[: quiet.size - lag]), 1.0)
            for lag in range(totals.size)
        ]
    most = SHORTEST_MEAN + int(np.argmin(totals[SHORTEST_MEAN:]))
    # a hum comes back again and again
    other = np.abs(np.delete(totals, slice(most - 3, most + 4)))[SHORTEST_MEAN:]
    alone = -totals[most] > 2.0 * other.max(initial=0.0)
    # of a running mean half of the third differences come back the other way after as many samples,
    # of white noise none; noise that a filter has made smooth does so at the next sample too
    opposite = -0.3 * totals[0]
    return most if alone and max(totals[1], totals[most]) < opposite else 1


# ---- Means and medians over sliding windows: x (n,), width --> (n,), the array reflected at its
# ends.
#
# What scipy.ndimage does too, at 20 MB and a fifth of a second of import for whoever needs nothing
# else of it.


def runs(mask: BoolArray) -> tuple[IntArray, IntArray]:
    """[start, stop) of the runs of True in `mask` (n,), (k,) each."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    return edges[::2], edges[1::2]


#: windows sorted at once
ROWS = 1 << 12


def sliding_mean(x: FloatArray, width: int) -> FloatArray:
    """Mean over `width` values around each of x, shape (n,)."""
    with np.errstate(
        over="ignore", invalid="ignore"
    ):  # values of 1e308 have sums beyond the floats
        middle = float(np.mean(x))  # small sums keep their digits
        total = np.cumsum(np.concatenate([[0.0], _reflected(x - middle, width)]))
        return np.asarray((total[width:] - total[:-width]) / width + middle)


def sliding_median(x: FloatArray, width: int) -> FloatArray:
    """Median of `width` values around each of x, shape (n,)."""
    windows = sliding_window_view(_reflected(x, width), width)
    return np.concatenate(
        [np.median(windows[start : start + ROWS], axis=1) for start in range(0, x.size, ROWS)]
    )


#: values on either side whose median says what is usual, whatever two of them are
BESIDE = 5
#: share of its speed by which a wheel is unlike the turns around; one turn's acceleration is less
UNLIKE_SPEED = 0.02


def unlike_neighbours(
    values: FloatArray, quality: QualityFlags, least: FloatArray | float
) -> QualityFlags:
    """Flags (n,) of the good rows whose `values` (n,) are outliers among those of the good rows.

    By `least` so much, (n,) or one for all.
    """
    rows = np.flatnonzero(good(quality) & np.isfinite(values))
    flags = none_of(values.size)
    off = outliers(values[rows], np.broadcast_to(least, values.shape)[rows])
    flags[rows[off]] = Quality.UNLIKE_NEIGHBOURS
    return flags


def outliers(x: FloatArray, least: FloatArray | float) -> BoolArray:
    """Which of x (n,) leave the values before and those after, the same way; shape (n,).

    By more than their neighbours do, and at `least` so much. A trend leaves the two sides in
    opposite ways, and a step or a kink leaves one of them.
    """
    if x.size <= BESIDE:
        return np.zeros(x.size, bool)
    before, after = (x - side for side in medians_beside(x))
    usual = sliding_median(np.maximum(np.abs(before), np.abs(after)), 2 * BESIDE + 1)
    off = np.where(before * after > 0.0, np.minimum(np.abs(before), np.abs(after)), 0.0)
    # an outlier leaves them by so many of the usual distances
    return np.asarray(off > 8.0 * usual + least)


def medians_beside(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Medians of the BESIDE values before each of x (n,), and of those after it, (n,) each."""
    medians = np.median(sliding_window_view(np.pad(x, BESIDE, mode="reflect"), BESIDE), axis=1)
    return medians[: x.size], medians[BESIDE + 1 : BESIDE + 1 + x.size]


def widened(x: FloatArray, error: FloatArray, quality: QualityFlags) -> FloatArray:
    """The `error` (n,) of each of x, as much larger as good rows scatter about their neighbours.

    White noise has its error in each row; a hum does not.
    """
    rows, out = np.flatnonzero(good(quality) & np.isfinite(x + error)), error.copy()
    # fewer values do not tell by their scatter whether their errors hold: half as many tell it to a
    # factor of two
    if rows.size < 8:
        return out
    value, own = x[rows], error[rows]
    off = value[1:-1] - 0.5 * (value[2:] + value[:-2])
    expected = np.sqrt(own[1:-1] ** 2 + 0.25 * (own[2:] ** 2 + own[:-2] ** 2))
    share = np.pad(np.abs(off) / np.maximum(expected, 1e-300), 1, mode="edge")
    factor = sliding_median(share, min(41, rows.size)) / NORMAL_MEDIAN
    # a hum of the log hides where it goes with the wheel
    usual = float(np.median(factor))
    # of errors that hold, one window in a hundred is beyond 1.5; forces that change from turn to
    # turn, which are no error, reach 1.8 in a part of a log
    factor[factor < 2.5] = 1.0
    out[rows] = own * np.maximum(factor, usual if usual > 1.5 else 1.0)
    return out


def of_the_log(rows: BoolArray, share: float) -> BoolArray:
    """The `rows` (n,), or all if they are more than this `share`: what they have is the log's."""
    return np.full(rows.size, True) if rows.size and np.mean(rows) > share else rows


def _reflected(x: FloatArray, width: int) -> FloatArray:
    return np.pad(x, (width // 2, (width - 1) // 2), mode="symmetric")
