"""From an encoder's samples to the times at which its teeth pass, block by block.

    samples (size,) --probe------> what kind of signal it is, its amplitude and its noise (a few short pieces of the log)
                    --crossings--> sub-sample indices (n,) of the passages through the middle level, rising and falling in turn

A tooth passage is found by hysteresis around a tracked middle level and placed by a sine: the samples within a third of a half period
have the sum, and the difference between the later and the earlier ones, that a sine through that place would have.  That window has
nearly the least variance (white noise: 4 % above the bound of the half period), and sums over windows cost one cumulative sum.

Indices are fractional samples from the start of the channel.  The result does not depend on the size of the blocks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from tirelog.recording import FloatArray, IntArray

#: samples whose extremes are taken together
CHUNK = 64
#: samples a block: small enough for the second-level cache
BLOCK = 1 << 17
#: the middle level and the amplitude follow the signal within this time; a slower tooth counts as standstill
FOLLOW_S = 0.3
#: longer where the amplitude does not follow the speed, so that a wheel that begins to turn shows a whole swing
FOLLOW_STEADY_S = 1.2
#: half of the hysteresis, as a share of the amplitude: a noise of 10 % never bridges it twice
HYSTERESIS = 0.4
#: a signal whose range is within so many standard deviations of its noise does not move
STILL_SIGMA = 6.0
#: amplitudes of a log's pieces closer together than this do not follow the speed (a Hall sensor)
STEADY_AMPLITUDE = 0.6
#: half width of the window, in half periods (the least variance of a sum's zero is at tan m = 2 m, m = 1.17 rad)
WINDOW = 0.35

Read = Callable[[int, int], FloatArray]
#: whole numbers of whatever size
Integers = NDArray[np.integer[Any]]
Singles = NDArray[np.float32]


@dataclass(frozen=True)
class Probe:
    """What a few pieces of an encoder channel show.

    `form`: 'sine', 'square' (two levels), 'counter' (monotone whole numbers, or an angle) or 'dead' (no teeth).
    `amplitude` is half of the range, `noise` the standard deviation of one sample, in the channel's unit.  A swing below `least` is
    no tooth: noise at a standstill, or part of a period where the sensor's amplitude does not follow the speed.  Levels are taken
    from a window of `follow_s`.
    """

    form: str
    amplitude: float
    noise: float
    least: float = 0.0
    follow_s: float = 0.3


@dataclass(frozen=True)
class Crossings:
    """Tooth passages: `index` (n,) fractional sample, `rising` (n,) direction of the signal, `breaks` (m,) sample indices of holes
    in the signal, longer than a few samples, over which a tooth may have gone unseen."""

    index: FloatArray
    rising: np.ndarray
    breaks: IntArray


def probe(read: Read, size: int, pieces: int = 24, length: int = 4096) -> Probe:
    """Form, amplitude and noise of a channel of `size` samples, from `pieces` short pieces of it, evenly spread."""
    starts = np.unique(np.linspace(0, max(size - length, 0), pieces).astype(np.int64))
    amplitudes, noises, squares, monotone = [], [], [], []
    for start in starts:
        x = read(int(start), int(min(start + length, size)))
        x = x[np.isfinite(x)]
        if x.size < 16:
            continue
        low, high = float(x.min()), float(x.max())
        amplitudes.append((high - low) / 2)
        noises.append(float(np.median(np.abs(np.diff(x, 4)))) / (0.6745 * np.sqrt(70.0)))
        squares.append(float(np.mean(np.abs(x - (high + low) / 2) > 0.8 * (high - low) / 2)) if high > low else 0.0)
        if high > low:
            monotone.append(float(np.mean(np.diff(x) >= 0)))
    if not amplitudes:
        return Probe("dead", 0.0, 0.0)
    amplitude, noise = float(np.quantile(amplitudes, 0.9)), float(np.quantile(noises, 0.2))
    if monotone and float(np.median(monotone)) > 0.998:
        return Probe("counter", amplitude, noise)
    if amplitude <= STILL_SIGMA * noise or amplitude == 0:
        return Probe("dead", amplitude, noise)
    moving = np.array(amplitudes) > 0.3 * amplitude
    usual = float(np.quantile(np.array(amplitudes)[moving], 0.25))
    steady = usual > STEADY_AMPLITUDE * amplitude
    least = max(STILL_SIGMA * noise, 0.7 * usual if steady else 0.01 * amplitude)
    form = "square" if np.median(np.array(squares)[moving]) > 0.7 else "sine"
    return Probe(form, amplitude, noise, least, FOLLOW_STEADY_S if steady else FOLLOW_S)


def crossings(read: Read, size: int, rate_Hz: float, found: Probe, block: int | None = None) -> Crossings:
    """Tooth passages of a 'sine' or 'square' channel of `size` samples at `rate_Hz`."""
    # eight slow half periods, half of the time that the levels follow, and the chunks in which spikes are sought
    margin = CHUNK * (int((0.6 + 0.5 * found.follow_s) * rate_Hz) // CHUNK + 8)
    block = max((block or BLOCK) // CHUNK, 1) * CHUNK
    indices, rising, breaks = [], [], []
    last: tuple[int, int] | None = None
    for start in range(0, size, block):
        low, stop = max(start - margin, 0), min(start + block, size)
        x, holes = _filled(read(low, min(stop + margin, size)))
        before, after, up, last = _changes(x, low, (start, stop), rate_Hz, found, last)
        place = _places(x, before - low, after - low, up, rate_Hz, found.form == "square") + low
        core = (after >= start) & (after < stop)
        indices.append(place[core])
        rising.append(up[core])
        breaks.append(holes[(holes >= start - low) & (holes < stop - low)] + low)
    empty = np.zeros(0)
    return Crossings(
        np.concatenate([empty, *indices]), np.concatenate([empty.astype(bool), *rising]), np.concatenate([empty.astype(np.int64), *breaks])
    )


def _filled(x: FloatArray) -> tuple[FloatArray, IntArray]:
    """`x` with lost samples bridged by straight lines, and the first index of every hole of more than eight samples."""
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


def _extremes(chunks: Singles, choose: np.ufunc) -> Singles:
    """Extremes of the rows (c, CHUNK) by halving: a reduction over rows this short is ten times slower."""
    while chunks.shape[1] > 1:
        half = chunks.shape[1] // 2
        chunks = choose(chunks[:, :half], chunks[:, half:])
    return np.ascontiguousarray(chunks[:, 0])


def _without_spikes(high: Singles) -> Singles:
    """Maxima of chunks, none above all of the chunks two and three places away: a glitch lies in one chunk or two, not so a tooth."""
    far = np.pad(high, 3, mode="edge")
    return np.minimum(high, np.maximum(np.maximum(far[:-6], far[1:-5]), np.maximum(far[5:-1], far[6:])))


def _levels(x: Singles, rate_Hz: float, found: Probe) -> tuple[Singles, Singles, Singles]:
    """`x` as chunks (c, CHUNK), its middle level (c,) and its half hysteresis (c,), infinite where the signal does not move."""
    pad = -x.size % CHUNK
    chunks = (np.concatenate([x, np.full(pad, x[-1])]) if pad else x).reshape(-1, CHUNK)
    span = 2 * int(np.ceil(0.5 * found.follow_s * rate_Hz / CHUNK)) + 1
    high = maximum_filter1d(_without_spikes(_extremes(chunks, np.maximum)), span, mode="nearest")
    low = -maximum_filter1d(_without_spikes(-_extremes(chunks, np.minimum)), span, mode="nearest")
    half = (high - low) / 2
    moving = half > found.least
    hysteresis = np.where(moving, np.float32(HYSTERESIS) * half, np.float32(np.inf)).astype(np.float32)
    return chunks, (high + low) / np.float32(2), hysteresis


def _changes(
    x: FloatArray, low: int, core: tuple[int, int], rate_Hz: float, found: Probe, last: tuple[int, int] | None
) -> tuple[IntArray, IntArray, np.ndarray, tuple[int, int] | None]:
    """Every change of side: last sample on the old side, first on the new one, and whether it rises; and the core's last (index, side).

    `last` is what the block before ended with, for a wheel that stood still longer than a block's margin.
    """
    # single precision is enough to tell the sides apart, and twice as fast
    chunks, middle, half = _levels(x.astype(np.float32), rate_Hz, found)
    side = (chunks > (middle + half)[:, None]).view(np.int8) - (chunks < (middle - half)[:, None]).view(np.int8)
    side = side.ravel()[: x.size]
    starts = np.concatenate([[0], np.flatnonzero(side[1:] != side[:-1]) + 1])
    ends, value = np.concatenate([starts[1:], [x.size]]) - 1, side[starts]
    sure = value != 0
    starts, ends, value = starts[sure] + low, ends[sure] + low, value[sure]
    if last is not None and (starts.size == 0 or last[0] < starts[0]):
        starts, ends, value = (np.concatenate([[a], b]) for a, b in ((last[0], starts), (last[0], ends), (last[1], value)))
    inside = np.flatnonzero(starts < core[1])
    if inside.size:
        last = (int(min(ends[inside[-1]], core[1] - 1)), int(value[inside[-1]]))
    change = np.flatnonzero(value[1:] != value[:-1])
    return ends[change], starts[change + 1], value[change + 1] > 0, last


def _places(x: FloatArray, before: IntArray, after: IntArray, up: np.ndarray, rate_Hz: float, square: bool) -> FloatArray:
    """Fractional index in `x` of each change of side between the samples `before` and `after`."""
    if before.size == 0:
        return np.zeros(0)
    held = np.maximum(before, 0)
    low, high = x[held], x[after]
    coarse = np.where(before < 0, after - 0.5, 0.5 * (before + after))
    near = after - before < 0.5 * FOLLOW_S * rate_Hz
    if square or before.size < 4:
        return np.where(near, coarse, after - 0.5)
    total = np.concatenate([[0.0], np.cumsum(x)])
    level = _middle(total, coarse, held, after, rate_Hz, 0.5 * (low + high))
    step = (high - low) * (high != low) + (high == low)
    rough = np.where(near, np.clip(before + (level - low) / step * (after - before), before, after), after - 0.5)
    half, sure = _half_period(rough, rate_Hz)
    return np.where(sure & near, _sine_places(x, total, rough, level, half), rough)


def _middle(total: FloatArray, coarse: FloatArray, before: IntArray, after: IntArray, rate_Hz: float, otherwise: FloatArray) -> FloatArray:
    """Middle level at each crossing: the mean over the four whole periods around it, `otherwise` where they are slow."""
    n = coarse.size
    first, last = np.maximum(np.arange(n) - 4, 0), np.minimum(np.arange(n) + 4, n - 1)
    last -= (last - first) % 2
    spans = coarse[last] - coarse[first]
    place = coarse + 0.5
    whole = np.minimum(place.astype(np.int64), total.size - 2)
    below = total[whole] + (place - whole) * (total[whole + 1] - total[whole])
    area = below[last] - below[first]
    return np.where((spans > 0) & (spans < 4 * FOLLOW_S * rate_Hz), area / np.maximum(spans, 1.0), otherwise)


def _half_period(rough: FloatArray, rate_Hz: float) -> tuple[FloatArray, np.ndarray]:
    """Half period [samples] at each crossing from its neighbours, and where it is short enough to be trusted."""
    steps = np.diff(rough)
    left, right = np.concatenate([steps[:1], steps]), np.concatenate([steps, steps[-1:]])
    least = np.minimum(left, right)
    half = np.where(np.maximum(left, right) > 1.8 * least, least, 0.5 * (left + right))
    return half, (half > 2.0) & (half < 0.5 * FOLLOW_S * rate_Hz)


def _sine_places(x: FloatArray, total: FloatArray, rough: FloatArray, level: FloatArray, half: FloatArray) -> FloatArray:
    """The zero of the sine of half period `half` whose samples around `rough` have the same sum, and the same difference between the
    k samples after the middle one and the k before it, as `x - level`.

    For A sin(omega (i - t)) the sum over the sum's own factor is A sin, the difference over its factor A cos of omega (centre - t); the
    quotient of the factors is 2 / (cot(k omega / 2) + cot((k + 1) omega / 2)).
    """
    centre = np.rint(rough).astype(np.int64)
    k = np.maximum(WINDOW * half, 1.0).astype(np.int64)
    edge = (centre < k) | (centre > x.size - 1 - k)
    if edge.any():
        centre, k = np.where(edge, x.size // 2, centre), np.where(edge, 1, k)
    first, middle, last = total[centre - k], total[centre], total[centre + k + 1]
    after = total[centre + 1]
    area = last - first - (2 * k + 1) * level
    rise = last - after - middle + first
    omega = np.pi / half
    near, far = np.tan(0.5 * omega * k), np.tan(0.5 * omega * (k + 1))
    shift = np.arctan(area / np.where(rise == 0, np.inf, rise) * (2 * near * far / (near + far))) / omega
    return np.where(~edge & (np.abs(shift) < 0.5 * half), centre - shift, rough)
