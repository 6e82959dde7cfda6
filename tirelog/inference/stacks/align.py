"""The wheel's angle at every sample.

Passages refined by a matched filter, and a smooth course between them.

    passage times (n,) [s] -> WheelAngle: theta(t) with theta(t_i) = 2 pi i, an interpolating cubic
                              spline (its slope is the speed)
    samples at theta, chunk by chunk -> sums by angle -> template T(phi)
    the same once more -> sums by revolution  y = b + a [T(phi) - s T'(phi)]  -> t_i moved by s

The matched filter uses the whole front around the patch, not its peak: a peak would follow whatever
an odd effect does to it. What is left of a shift is a nuisance of every cell (`cells`), so nothing
is learnt from absolute position.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, CubicSpline
from scipy.linalg import cho_factor, cho_solve

from tirelog.data.recording import Channel
from tirelog.kernels import compiled
from tirelog.process_pool import shared_out
from tirelog.runs.in_memory import readable_apart
from tirelog.vocabulary.arrays import FloatArray, IntArray

# ---- A channel's samples by time, in chunks of whole turns: nothing in it has the length of the
# log.
#
#     Channel, passages (n,) [s] --chunks--> Chunk: some turns, the samples that hold them
#         --read--> times, values --angle--> turn, phi
#
# A turn lies in one chunk, so sums over a revolution do not know of the chunks; sums over the log
# (the template's) are added up chunk by chunk.


#: of the times of an axis every so many are kept, to find the others
_STRIDE = 1 << 13
#: a channel's step is looked for in so many of its samples, in so many runs from all over it;
#: twice as many look twice as long
_LOOKED_AT, _RUNS = 4096, 8
#: fewest different values, and how far from whole steps they may lie [steps]: by chance values
#: without steps do it once in 1e20; twice as far from whole ones, chance does it once in 1e16
_FEWEST_VALUES, _OFF_STEP = 12, 0.01


#: some turns of a run of passages, and the samples among which all of theirs are
TurnChunk = tuple[slice, slice]


def step_of(channel: Channel) -> float:
    """The step in which a channel's values come [SI]; 0.0 if none is seen.

    A step that is fine against the noise leaves values of its own
    to few samples and is not seen; it does no harm either.
    """
    size = min(_LOOKED_AT // _RUNS, channel.size)
    starts = (
        np.unique(np.linspace(0, channel.size - size, _RUNS).astype(np.int64)).tolist()
        if size
        else []
    )
    parts = [np.zeros(0), *(channel.read(start, start + size) for start in starts)]
    some = np.concatenate(parts)
    values = np.unique(some[np.isfinite(some)])
    apart = np.diff(values)
    apart = apart[apart > 1e-12 * np.abs(values).max(initial=0.0)]
    if apart.size + 1 < _FEWEST_VALUES:
        return 0.0
    step = float(apart.min())
    step = float(np.median(apart[apart < 1.5 * step]))
    # one ruler through all values: that of neighbours alone would slip over thousands of steps
    number = np.round((values - values[0]) / step)
    step = float(np.polyfit(number, values - values[0], 1)[0])
    if float(np.abs((values - values[0]) / step - number).max()) >= _OFF_STEP:
        return 0.0
    return step


class Samples:
    """The samples of one channel, found by their times."""

    def __init__(self, channel: Channel) -> None:
        self.channel = channel
        axis = channel.axis
        self._coarse = np.array([axis.time(i, i + 1)[0] for i in range(0, axis.size, _STRIDE)])

    def before(self, time_s: FloatArray) -> IntArray:
        """How many samples are earlier than each time, (k,)."""
        place = np.zeros(time_s.size, np.int64)
        block = np.maximum(np.searchsorted(self._coarse, time_s) - 1, 0)
        for number in np.unique(block) if self._coarse.size else ():
            mine = block == number
            low = int(number) * _STRIDE
            place[mine] = low + np.searchsorted(
                self.channel.axis.time(low, low + _STRIDE), time_s[mine]
            )
        return place

    def chunks(self, centre_s: FloatArray, first: int, stop: int) -> list[TurnChunk]:
        """Turns [first, stop) of the run of passages `centre_s` (n,), chunk by chunk.

        The first turn's samples begin one period before its
        passage, the last one's end one after, if the run ends there.
        """
        spent = (centre_s[first:stop] - centre_s[first]) * self.channel.axis.rate_Hz
        # samples per chunk, about: what a dozen arrays of it take stays near the processor
        cuts = first + np.flatnonzero(np.diff(spent // (1 << 16))) + 1
        edges = np.array([first, *cuts, stop])
        around = np.concatenate(
            [[2 * centre_s[0] - centre_s[1]], centre_s, [2 * centre_s[-1] - centre_s[-2]]]
        )
        # and a turn to either side: what a refined passage moves is far less
        low = np.maximum(edges[:-1] - 1, 0)
        high = np.minimum(edges[1:] + 2, around.size - 1)
        low, high = self.before(around[low]), self.before(around[high])
        return [
            (slice(int(first), int(stop)), slice(int(start), int(end)))
            for first, stop, start, end in zip(edges[:-1], edges[1:], low, high, strict=True)
        ]

    def read(self, chunk: TurnChunk) -> tuple[FloatArray, FloatArray]:
        """Times and values of a chunk's samples."""
        rows = chunk[1]
        return self.channel.axis.time(rows.start, rows.stop), self.channel.read(
            rows.start, rows.stop
        )


# ---- Compiled passes over the samples of some turns: each goes through them once.
#
#     times, values --turns_of--> turn, phi, value of each sample
#         --by_angle--> sums of the log by angle
#         --by_front--> sums of each turn against a template near the patch
#         --by_bin--> means of each turn's bins
#
# numpy takes a dozen arrays of the samples' length for each. Refining the passages of an hour of
# one
# grating at 10 kHz takes 6.2 s of CPU in place of 12.3, 26,300 passages at 1 kHz 1.2 in place of
# 1.5
# (three rounds each; 23 November 2026, two cores, Python 3.11).


#: a turn of the wheel [rad]
TURN = math.tau


@compiled
def turns_of(
    time_s: FloatArray,
    values: FloatArray,
    passages_s: FloatArray,
    pieces: FloatArray,
    end_speeds: FloatArray,
    first: int,
    stop: int,
    turn: IntArray,
    phi: FloatArray,
    kept: FloatArray,
) -> int:
    """The samples (N,) of the turns [first, stop) that are there; how many.

    Fills `turn` after the first, `phi` in [-pi, pi) and the value, (N,) each, from the front.

    time_s      ascending
    passages_s  (n,) times at which the wheel's angle is 2 pi 0, 1, 2 ...
    pieces      (4, n - 1) cubics of the angle between them, highest power first
    end_speeds  (2,) [rad/s] with which it goes on before the first and after the last
    """
    count, last = 0, passages_s.size - 1
    piece = min(max(first - 1, 0), last - 1)
    for i in range(time_s.size):
        value = values[i]
        if not np.isfinite(value):
            continue
        time = time_s[i]
        inside = min(max(time, passages_s[0]), passages_s[last])
        while piece + 1 < last and inside >= passages_s[piece + 1]:
            piece += 1
        while piece > 0 and inside < passages_s[piece]:
            piece -= 1
        since = inside - passages_s[piece]
        power = since * since
        theta = pieces[3, piece] + pieces[2, piece] * since
        theta += pieces[1, piece] * power
        theta += pieces[0, piece] * (power * since)
        if inside != time:
            theta += (time - inside) * end_speeds[0 if time < inside else 1]
        number = np.floor(theta / TURN + 0.5)
        if first <= number < stop:
            turn[count] = np.int64(number) - first
            phi[count] = theta - TURN * number
            kept[count] = value
            count += 1
    return count


@compiled
def by_angle(
    phi: FloatArray, values: FloatArray, count: IntArray, angle: FloatArray, value: FloatArray
) -> None:
    """Adds samples (N,) to the sums of bins round the turn, (k,) each."""
    bins = count.size
    for i in range(phi.size):
        place = np.int64((phi[i] + np.pi) * (bins / TURN)) % bins
        count[place] += 1
        angle[place] += phi[i]
        value[place] += values[i]


@compiled
def by_front(
    turn: IntArray,
    phi: FloatArray,
    values: FloatArray,
    reach_rad: float,
    knots: FloatArray,
    pieces: FloatArray,
    gram: FloatArray,
    right: FloatArray,
    used: IntArray,
) -> None:
    """Adds up each turn's normal equations of y = b + a T(phi) - a s T'(phi) within the reach.

    gram    (n, 3, 3), right (n, 3), used (n,) samples; all begin at 0
    knots   (k,) ascending, around the reach; pieces (4, k - 1): cubics of T, highest power first
    """
    piece = 0
    for i in range(phi.size):
        if not abs(phi[i]) < reach_rad:
            continue
        while piece + 2 < knots.size and phi[i] >= knots[piece + 1]:
            piece += 1
        while piece > 0 and phi[i] < knots[piece]:
            piece -= 1
        at = phi[i] - knots[piece]
        c3, c2, c1 = pieces[0, piece], pieces[1, piece], pieces[2, piece]
        shape = pieces[3, piece] + at * (c1 + at * (c2 + at * c3))
        slope = -(c1 + at * (2.0 * c2 + at * (3.0 * c3)))
        own, y, k = gram[turn[i]], values[i], turn[i]
        own[0, 1] += shape
        own[0, 2] += slope
        own[1, 1] += shape * shape
        own[1, 2] += shape * slope
        own[2, 2] += slope * slope
        right[k, 0] += y
        right[k, 1] += shape * y
        right[k, 2] += slope * y
        used[k] += 1
    for k in range(used.size):
        own = gram[k]
        own[0, 0] = used[k]
        own[1, 0], own[2, 0], own[2, 1] = own[0, 1], own[0, 2], own[1, 2]


@compiled
def by_bin(
    turn: IntArray,
    phi: FloatArray,
    values: FloatArray,
    count: IntArray,
    mean: FloatArray,
    angle: FloatArray,
    variance: FloatArray,
) -> None:
    """Fills each turn's bins, (n, m) each: samples, mean value, mean and variance of the angle.

    A bin without a sample has NaN; all of them begin at 0.
    """
    m = count.shape[1]
    for i in range(phi.size):
        k, place = turn[i], min(np.int64((phi[i] + np.pi) * (m / TURN)), m - 1)
        count[k, place] += 1
        mean[k, place] += values[i]
        angle[k, place] += phi[i]
    for k in range(count.shape[0]):
        for place in range(m):
            if count[k, place] == 0:
                mean[k, place], angle[k, place], variance[k, place] = np.nan, np.nan, np.nan
            else:
                mean[k, place] /= count[k, place]
                angle[k, place] /= count[k, place]
    for i in range(phi.size):
        k, place = turn[i], min(np.int64((phi[i] + np.pi) * (m / TURN)), m - 1)
        variance[k, place] += (phi[i] - angle[k, place]) ** 2
    for k in range(count.shape[0]):
        for place in range(m):
            if count[k, place] > 0:
                variance[k, place] /= count[k, place]


#: bins round the turn of the matched filter's template, and its knots at most
_TEMPLATE_POINTS = 512
#: fewest chunks that processes share: less is done sooner than processes are begun; at twice as
#: many a log of ten minutes is passed over
_SHARED = 8


@dataclass(frozen=True)
class PassageAngle:
    """The wheel's angle theta(t) through the passages `centre_s` (n,).

    It is 2 pi i at the i-th; outside of them it goes on at the speed of the end.
    """

    centre_s: FloatArray
    spline: CubicSpline

    @classmethod
    def through(cls, centre_s: FloatArray, turns: FloatArray | None = None) -> PassageAngle:
        """Through passages of these `turns` (n,), or of one after the other."""
        number = np.arange(centre_s.size) if turns is None else turns
        return cls(centre_s, CubicSpline(centre_s, 2.0 * np.pi * number, bc_type="natural"))

    def theta(self, time_s: FloatArray) -> FloatArray:
        """Angle [rad] at times [s], any shape."""
        first, last = self.centre_s[0], self.centre_s[-1]
        inside = np.clip(time_s, first, last)
        theta: FloatArray = self.spline(inside)
        beyond = inside != time_s
        if beyond.any():
            theta[beyond] += (time_s[beyond] - inside[beyond]) * self.spline(inside[beyond], 1)
        return theta

    def time_s(self, theta: FloatArray) -> FloatArray:
        """The time [s] of angles [rad], any shape, to some microseconds."""
        turns = 2.0 * np.pi * np.arange(self.centre_s.size)
        return np.asarray(CubicSpline(turns, self.centre_s, bc_type="natural")(theta))

    def speed_rad_s(self, time_s: FloatArray) -> FloatArray:
        rate: FloatArray = self.spline(np.clip(time_s, self.centre_s[0], self.centre_s[-1]), 1)
        return rate


def split_turns(theta: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """(revolution, phi in [-pi, pi)) of angles theta."""
    turn = np.floor(theta / (2.0 * np.pi) + 0.5).astype(np.int64)
    return turn, theta - 2.0 * np.pi * turn


def turned(
    samples: Samples, angle: PassageAngle, chunk: TurnChunk
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """The samples of a chunk's turns: turn after the chunk's first, phi and value, (k,) each."""
    time_s, values = samples.read(chunk)
    turn, phi, kept = np.empty(values.size, np.int64), np.empty(values.size), np.empty(values.size)
    spline, ends = angle.spline, angle.centre_s[[0, -1]]
    count = turns_of(
        time_s,
        values,
        spline.x,
        spline.c,
        spline(ends, 1),
        chunk[0].start,
        chunk[0].stop,
        turn,
        phi,
        kept,
    )
    return turn[:count], phi[:count], kept[:count]


def angle_sums(phi: FloatArray, values: FloatArray) -> FloatArray:
    """Samples (N,) by angle: how many, sum of their angles, sum of their values; (3, bins)."""
    count, sums = np.zeros(_TEMPLATE_POINTS, np.int64), np.zeros((2, _TEMPLATE_POINTS))
    by_angle(phi, values, count, *sums)
    return np.stack([count, *sums])


def mean_waveform(sums: FloatArray, knots: int = _TEMPLATE_POINTS) -> CubicSpline:
    """A periodic spline through bin means at the bins' mean angles, of `angle_sums`.

    With fewer `knots` it goes nearest to them.
    """
    count, angle, mean = sums[:, sums[0] > 0]
    angle, mean = angle / count, mean / count
    if knots < _TEMPLATE_POINTS:
        return nearest_curve(angle, mean, count, knots)
    return CubicSpline(
        np.append(angle, angle[0] + 2.0 * np.pi), np.append(mean, mean[0]), bc_type="periodic"
    )


def nearest_curve(
    angle: FloatArray, mean: FloatArray, count: NDArray[Any], knots: int
) -> CubicSpline:
    """The periodic spline with even `knots` nearest to bin means (k,), angles (k,) in [-pi, pi)."""
    width = 2.0 * np.pi / knots
    grid = -np.pi + width * np.arange(-3, knots + 4)
    columns = BSpline.design_matrix(angle, grid, 3)  # four in a row
    place, value = columns.indices.reshape(-1, 4) % knots, columns.data.reshape(-1, 4)  # once round
    weighted = value * (count / count.mean())[:, None]
    pair, product = place[:, :, None] * knots + place[:, None, :], weighted[:, :, None]
    gram = np.bincount(
        pair.ravel(), (product * value[:, None, :]).ravel(), minlength=knots**2
    ).reshape(knots, knots)
    right = np.bincount(place.ravel(), (weighted * mean[:, None]).ravel(), minlength=knots)
    # weight of the third differences against the samples: it decides only between samples that lie
    # farther apart than knots
    gram += 1e-7 * np.trace(gram) / knots * _bending(knots)
    coefficients = cho_solve(cho_factor(gram, overwrite_a=True), right)
    at_knots = BSpline(grid, np.append(coefficients, coefficients[:3]), 3)(grid[3:-3])
    at_knots[-1] = at_knots[0]
    return CubicSpline(grid[3:-3], at_knots, bc_type="periodic")


@lru_cache(maxsize=4)
def _bending(knots: int) -> FloatArray:
    """Sum of squared third differences round the turn as a form (knots, knots)."""
    third = np.diff(np.eye(knots), 3, axis=0, append=np.eye(knots)[:3])
    return np.asarray(third.T @ third, dtype=np.float64)


def template(phi: FloatArray, values: FloatArray) -> CubicSpline:
    """Mean waveform of samples (N,) at angles (N,)."""
    return mean_waveform(angle_sums(phi, values))


def knots_of(samples: float) -> int:
    """How many knots a mean waveform of turns with so many `samples` may have."""
    # knots of the matched filter's template per sample of a turn.  At a constant speed the odd
    # turns' samples lie between those of the even ones; a template that bends between them follows
    # any shift of the odd turns, and none is seen.  Half and 0.9 find the same passages; from 1 on
    # the template can bend so.  And never fewer knots than a front has corners for
    return int(np.clip(0.7 * samples, 128, _TEMPLATE_POINTS))


def front_fit(
    turn: NDArray[np.int64], phi: FloatArray, values: FloatArray, shape: CubicSpline, n: int
) -> tuple[FloatArray, FloatArray]:
    """Shift [rad] (n,) and amplitude (n,) of each revolution against the template.

    By least squares near the patch; NaN if they cannot be had.
    """
    gram, right, used = np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros(n, np.int64)
    # angles [rad] that the matched filter looks at; twice as far looks at more of the turn's quiet
    # part, which says nothing of the place
    by_front(turn, phi, values, 1.0, shape.x, shape.c, gram, right, used)
    enough = used >= 8
    enough &= np.linalg.cond(np.where(enough[:, None, None], gram, np.eye(3))) < 1e16
    solution = np.full((n, 3), np.nan)
    solution[enough] = np.linalg.solve(gram[enough], right[enough][..., None])[..., 0]
    amplitude = solution[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        shift = solution[:, 2] / amplitude
    bad = ~(np.abs(shift) < 0.3) | ~(amplitude > 0.2) | ~(amplitude < 5.0)
    return np.where(bad, np.nan, shift), np.where(bad, np.nan, amplitude)


def refine_passages(samples: Samples, centre_s: FloatArray) -> FloatArray:
    """Passage times (n,) after matched filtering.

    A passage whose front cannot be fitted lies between its neighbours.
    """
    chunks = samples.chunks(centre_s, 0, centre_s.size)
    # no more knots than the samples of a turn can follow, which a twentieth of the turns may be
    # shorter than; twice as much counts the samples of a somewhat longer turn
    shortest = float(np.quantile(np.diff(centre_s), 0.05))
    knots = knots_of(samples.channel.axis.rate_Hz * shortest)
    for _ in range(3):
        angle = PassageAngle.through(centre_s)
        shift = _shifts(samples, chunks, angle, knots)
        fitted = np.isfinite(shift)
        shift = np.where(fitted, shift - np.nanmedian(shift) if fitted.any() else 0.0, 0.0)
        centre_s = _between_neighbours(centre_s + shift / angle.speed_rad_s(centre_s), fitted)
        # passages that none has moved farther are settled [rad]: the next round moves them by a
        # fiftieth of that, and noise has moved them by as much and more; with a tenth of it each
        # log takes a third round
        if np.abs(shift).max(initial=0.0) < 5e-5:
            break
    return centre_s


def _shifts(
    samples: Samples, chunks: Sequence[TurnChunk], angle: PassageAngle, knots: int
) -> FloatArray:
    """Shift [rad] of each passage (n,) against the mean waveform; NaN if it has no fit."""
    shared = len(chunks) >= _SHARED and readable_apart(samples.channel)

    def sums(number: int) -> FloatArray:
        return angle_sums(*turned(samples, angle, chunks[number])[1:])

    def shifts(number: int) -> FloatArray:
        turns = chunks[number][0]
        found = turned(samples, angle, chunks[number])
        return front_fit(*found, shape, turns.stop - turns.start)[0]

    of_log = sum(shared_out(len(chunks), sums, shared), np.zeros((3, _TEMPLATE_POINTS)))
    shape = mean_waveform(of_log, knots)
    return np.concatenate(list(shared_out(len(chunks), shifts, shared)))


def _between_neighbours(centre_s: FloatArray, fitted: NDArray[np.bool_]) -> FloatArray:
    """Passage times (n,), those not `fitted` moved onto the course through the others.

    Half a front lost can move a passage by a fifth of the patch, and the wheel's angle with it.
    """
    known = np.flatnonzero(fitted)
    # passages with a fitted front that a course is drawn through; twice as many would leave short
    # runs with their wrong passages
    if known.size < max(4, fitted.size // 2):
        return centre_s
    moved = np.flatnonzero(~fitted)
    moved = moved[
        (moved >= known[0] - 1) & (moved <= known[-1] + 1)
    ]  # one turn beyond the course at most
    centre_s = centre_s.copy()
    centre_s[moved] = CubicSpline(known, centre_s[known])(moved)
    return centre_s
