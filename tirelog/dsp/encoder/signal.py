"""From an encoder's samples to the times at which its teeth pass, block by block.

    samples (size,) --probe------> what kind of signal it is, its amplitude and its noise (a few
                                   short pieces of the log)
                    --crossings--> sub-sample indices (n,) of the passages through the middle level,
                                   rising and falling in turn, a piece for every block of samples

A tooth passage is found by hysteresis around a tracked middle level and placed by a sine: the
samples within a third of a half period have the sum, and the difference between the later and the
earlier ones, that a sine through that place would have. That window has nearly the least variance
(white noise: 4 % above the bound of the half period).

Indices are fractional samples from the start of the channel. The result does not depend on the size
of the blocks.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.dsp.encoder.kernels import (
    AROUND,
    CHUNK,
    changes,
    extremes,
    finite,
    places,
    sides,
    sliding_maximum,
    without_spikes,
)
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: samples per block: small enough for the second-level cache
BLOCK = 1 << 17
#: changes of side on each side that the place of one depends on
BESIDE = 2 * AROUND + 2
#: the middle level and the amplitude follow the signal within this time; a slower tooth counts as
#: standstill; twice as long counts slower teeth, and follows a wandering level half as well
FOLLOW_S = 0.3
#: longer if the amplitude does not follow the speed, so that a wheel that begins to turn shows a
#: whole swing; twice as long follows half as well
FOLLOW_STEADY_S = 1.2
#: half of the hysteresis, as a share of the amplitude: a noise of 10 % never bridges it twice
HYSTERESIS = 0.4
#: a signal whose range is within so many standard deviations of its noise does not move; twice as
#: many call a weak signal standstill, half as many take noise for teeth
STILL_SIGMA = 6.0
#: amplitudes of a log's pieces, those with so many swings, closer together than this do not follow
#: the speed (a Hall sensor); nearer to one, a Hall sensor whose teeth differ counts as an
#: inductive one
STEADY_AMPLITUDE, LEAST_SWINGS = 0.6, 6
#: samples this near to the upper or the lower level, in half ranges, are on it; a signal with more
#: than this share of its samples there is square. Twice the distance takes a sine for one
ON_LEVEL, SQUARE_SHARE = 0.2, 0.7
#: so many of a square's levels may last one sample only, as a share: pulses last for two and more,
#: a converter that flickers between two codes changes at every other one; half of it refuses a
#: wheel whose pulses last two samples and a half
SHORT_LEVELS = 0.25
#: a count goes one way in more than this share of a piece's samples, and over more than so many of
#: its own steps in the log; twice as many do not know a counter that has just begun
ONE_WAY, COUNTED_STEPS = 0.998, 2.5

Read = Callable[[int, int], FloatArray]
#: whole numbers of whatever size
Integers = NDArray[np.integer[Any]]


@dataclass(frozen=True)
class Probe:
    """What a few pieces of an encoder channel show.

    `form`: 'sine', 'square' (two levels), 'counter' (whole numbers that climb or fall, or an angle)
    or 'dead' (no teeth). `amplitude` is half of the range, `noise` the standard deviation of one
    sample, in the channel's unit. A swing below `least` is no tooth: noise at a standstill, or part
    of a period if the sensor's amplitude does not follow the speed. Levels are taken from a window
    of `follow_s`.
    """

    form: str
    amplitude: float
    noise: float
    least: float = 0.0
    follow_s: float = 0.3


@dataclass(frozen=True)
class Crossings:
    """Tooth passages of one block.

    `index` (n,) fractional sample, `rising` (n,) direction of the signal, `breaks` (m,) sample
    indices of holes in the signal, longer than a few samples, over which a tooth may have gone
    unseen.
    """

    index: FloatArray
    rising: np.ndarray
    breaks: IntArray

    @property
    def parts(self) -> tuple[FloatArray, np.ndarray, IntArray]:
        return self.index, self.rising, self.breaks

    @property
    def size(self) -> int:
        return int(self.index.size)

    def since(self, index: float) -> Crossings:
        """Those from `index` on."""
        first = int(np.searchsorted(self.index, index))
        return Crossings(self.index[first:], self.rising[first:], self.breaks[self.breaks >= index])


def probe(read: Read, size: int, pieces: int = 24, length: int = 2048) -> Probe:
    """Form, amplitude and noise of a channel of `size` samples.

    From `pieces` short pieces of it, evenly spread.
    """
    starts = np.unique(np.linspace(0, max(size - length, 0), pieces).astype(np.int64))
    amplitudes, noises, squares, swings, steps = [], [], [], [], []
    ways: list[tuple[float, float]] = []
    lowest, highest = np.inf, -np.inf
    for start in starts:
        x = read(int(start), int(min(start + length, size)))
        x = x[np.isfinite(x)]
        if x.size < 16:
            continue
        low, high = float(x.min()), float(x.max())
        lowest, highest = min(low, lowest), max(high, highest)
        amplitudes.append((high - low) / 2)
        square = _level_share(x, low, high)
        squares.append(square)
        noises.append(_noise(x, square > SQUARE_SHARE))
        swings.append(_swings(x, low, high))
        if high > low:
            change = np.diff(x)
            ways.append((float(np.mean(change >= 0)), float(np.mean(change <= 0))))
            steps.append(float(np.median(np.abs(change[change != 0]))))
    if not amplitudes:
        return Probe("dead", 0.0, 0.0)
    amplitude, noise = float(np.quantile(amplitudes, 0.9)), float(np.quantile(noises, 0.2))
    # slow pulses also go one way within a piece, but never on from there
    if (
        ways
        and float(np.median(ways, axis=0).max()) > ONE_WAY
        and highest - lowest > COUNTED_STEPS * float(np.median(steps))
    ):
        return Probe("counter", amplitude, noise)
    if (
        not np.isfinite(amplitude) or not amplitude > STILL_SIGMA * noise
    ):  # also numbers too large to be squared
        return Probe("dead", amplitude, noise)
    # a piece with several swings shows a whole one, however slowly the wheel turns
    turning = (np.array(swings) >= LEAST_SWINGS) & (np.array(amplitudes) > STILL_SIGMA * noise)
    moving = turning if turning.any() else np.array(amplitudes) > 0.3 * amplitude
    usual = float(np.quantile(np.array(amplitudes)[moving], 0.25))
    steady = float(np.min(np.array(amplitudes)[moving])) > STEADY_AMPLITUDE * amplitude
    least = max(STILL_SIGMA * noise, 0.7 * usual if steady else 0.01 * amplitude)
    form = "square" if np.median(np.array(squares)[moving]) > SQUARE_SHARE else "sine"
    return Probe(form, amplitude, noise, least, FOLLOW_STEADY_S if steady else FOLLOW_S)


def _level_share(x: FloatArray, low: float, high: float) -> float:
    """Share of the samples (n,) that are on the levels `low` or `high`; 0 if these are equal."""
    half = 0.5 * (high - low)
    return float(np.mean(np.abs(x - low - half) > (1 - ON_LEVEL) * half)) if half > 0 else 0.0


def _noise(x: FloatArray, square: bool) -> float:
    """Standard deviation of one sample of `x` (n,), from its fourth differences.

    Of a `square` signal about its two levels: if pulses last a few samples the differences see
    edges only. All of it is noise if it changes at every other sample.
    """
    if not square:
        return float(np.median(np.abs(np.diff(x[: x.size // 2], 4))) / (0.6745 * np.sqrt(70.0)))
    low, high = float(x.min()), float(x.max())
    upper = x > 0.5 * (low + high)
    lasting = np.diff(np.flatnonzero(upper[1:] != upper[:-1]))
    if lasting.size and float(np.mean(lasting == 1)) > SHORT_LEVELS:
        return 0.5 * (high - low)
    away = np.abs(x - np.where(upper, np.median(x[upper]), np.median(x[~upper])))
    return float(np.median(away) / 0.6745)


def _swings(x: FloatArray, low: float, high: float) -> int:
    """How often the signal goes from the upper to the lower quarter of its range and back."""
    side = np.sign(x - 0.5 * (high + low)) * (np.abs(x - 0.5 * (high + low)) > 0.25 * (high - low))
    side = side[side != 0]
    return int(np.sum(side[1:] != side[:-1]))


def crossings(
    read: Read, size: int, rate_Hz: float, found: Probe, block: int | None = None
) -> Iterator[Crossings]:
    """Tooth passages of a 'sine' or 'square' channel, block by block.

    Of `size` samples at `rate_Hz`.
    """
    # eight slow half periods, half of the time that the levels follow, and the chunks in which
    # spikes are sought
    margin = CHUNK * (int((0.6 + 0.5 * found.follow_s) * rate_Hz) // CHUNK + 8)
    block = max((block or BLOCK) // CHUNK, 1) * CHUNK
    slow = 0.5 * FOLLOW_S * rate_Hz
    at, last = -1, 0  # the last change: a wheel may stand longer than a block's margin
    for start in range(0, size, block):
        low, stop = max(start - margin, 0), min(start + block, size)
        x, holes = _filled(read(low, min(stop + margin, size)))
        side = sides(x, *_hysteresis(x, rate_Hz, found))
        before, after = changes(side, min(at - low, -1), last if at < low else 0)
        rising = side[after] > 0
        first, end = np.searchsorted(after, [start - low, stop - low])
        near = slice(max(first - BESIDE, 0), end + BESIDE)
        place = places(x, before[near], after[near], slow, found.form == "square")[
            first - near.start : end - near.start
        ]
        core = slice(first, end)
        if after[core].size:
            at, last = int(after[core][-1]) + low, 1 if rising[core][-1] else -1
        yield Crossings(
            place + low, rising[core], holes[(holes >= start - low) & (holes < stop - low)] + low
        )


def _filled(x: FloatArray) -> tuple[FloatArray, IntArray]:
    """`x` with lost samples bridged, and the first index of every longer hole.

    By straight lines; longer is more than eight samples.
    """
    x = finite(x)
    if np.isfinite(x.sum()):
        return x, np.zeros(0, np.int64)
    lost = ~np.isfinite(x)
    if not lost.any():
        return x, np.zeros(0, np.int64)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], lost.view(np.int8), [0]])))
    starts, stops = edges[::2], edges[1::2]
    known = np.flatnonzero(~lost)
    if known.size == 0:
        return np.zeros_like(x), starts
    return np.interp(np.arange(x.size), known, x[known]), starts[stops - starts > 8]


def _hysteresis(x: FloatArray, rate_Hz: float, found: Probe) -> tuple[FloatArray, FloatArray]:
    """Levels above and below which a sample is sure of its side, for every chunk.

    Infinite if the signal does not move.
    """
    reach = int(np.ceil(0.5 * found.follow_s * rate_Hz / CHUNK))
    high, low = extremes(x)
    high, low = (
        sliding_maximum(without_spikes(high), reach),
        -sliding_maximum(without_spikes(-low), reach),
    )
    half, middle = (high - low) / 2, (high + low) / 2
    half = np.where(half > found.least, HYSTERESIS * half, np.inf)
    return middle + half, middle - half
