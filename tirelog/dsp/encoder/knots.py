"""From counted passages to the knots of the wheel angle, piece by piece.

    pieces of times, counts, stretches (n,)
        --local cubic least squares--> knots, one in KNOT_STEP_S while the wheel turns quickly
        --scatter about the cubics---> noise of a passage
    knots, pitch errors learnt meanwhile --> AngleFunction

Time as a function of the count is a cubic over the passages within SPAN_S, by least squares.
Smoothing is linear in the times, so the pitch errors are taken off afterwards: what the same least
squares make of the pitch errors of those counts is the error of the knot.

An edge of a pulse is known to lie between two samples: its error is uniform, of a known size. If a
tooth takes nearly a whole number of samples the errors of neighbours are alike, and the cubic
follows them instead of averaging: what the cubics leave of that size tells how much.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.dsp.encoder.angle import AngleFunction
from tirelog.dsp.encoder.kernels import SUMS
from tirelog.dsp.encoder.signal import Integers
from tirelog.dsp.sliding import sliding_mean
from tirelog.kernels import compiled
from tirelog.vocabulary.arrays import FloatArray, IntArray, Records

#: knots lie at least so far apart while the motion is even: a cubic follows a wheel that shakes at
#: 20 Hz to a thousandth of a degree; twice as far apart, to sixteen times that
KNOT_STEP_S = 4e-3
#: the local least squares take the passages within this time, at least and at most so many on each
#: side; twice as long averages noise of the teeth over twice as many, and flattens shakes of 20 Hz
SPAN_S, LEAST_REACH, MOST_REACH = 14e-3, 3, 9
#: knots around one, with itself, whose scatter tells what the sampling grid does to it: half a
#: second; twice as many tell it to 0.7 of the error, and follow a changing speed half as well
GRID_KNOTS = 129
#: whole teeth in the window may differ by this factor, for a cubic to follow them; twice as much
#: lays cubics across starts and stops
EVEN = 2.0


def _cubic_weights() -> tuple[FloatArray, FloatArray]:
    """Weights of the least-squares cubic: its value and its slope in the middle.

    At the middle of 2 r + 1 even points, for every reach r; each shape (MOST_REACH + 1, 2
    MOST_REACH + 1), the middle at MOST_REACH. Up to LEAST_REACH the middle point itself is its
    value.
    """
    value, slope = (
        np.zeros((MOST_REACH + 1, 2 * MOST_REACH + 1)),
        np.zeros((MOST_REACH + 1, 2 * MOST_REACH + 1)),
    )
    value[:, MOST_REACH] = 1.0
    for reach in range(LEAST_REACH, MOST_REACH + 1):
        here = slice(MOST_REACH - reach, MOST_REACH + reach + 1)
        fit = np.linalg.pinv(np.vander(np.arange(-reach, reach + 1.0), 4, increasing=True))
        value[reach, here], slope[reach, here] = fit[0], fit[1]
    return value, slope


VALUE, SLOPE = _cubic_weights()
#: passages worked on at once
PIECE = 1 << 14


@compiled
def _even_runs(time: FloatArray, count: Integers, stretch: Integers) -> Integers:
    """How many passages before each one, in a row, are even with it.

    Neighbours in count and stretch, and their teeth like each other.
    """
    run = np.zeros(time.size, np.int64)
    for i in range(1, time.size):
        if stretch[i] != stretch[i - 1] or abs(count[i] - count[i - 1]) != 1:
            continue
        run[i] = run[i - 1] + 1
        if (
            i >= 3 and run[i] >= 3
        ):  # from rising to rising passage: their offset from the falling ones is no unevenness
            now, last = time[i] - time[i - 2], time[i - 1] - time[i - 3]
            if (
                not (now < EVEN * last and last < EVEN * now)
                or count[i] + count[i - 2] != 2 * count[i - 1]
            ):
                run[i] = 0
    return run


@compiled
def _local_cubics(
    time: FloatArray,
    count: Integers,
    stretch: Integers,
    unit: float,
    first: int,
    stop: int,
    last: float,
    sums: Records,
) -> tuple[IntArray, FloatArray, FloatArray, NDArray[np.int8], FloatArray]:
    """Which passages become knots (k,); their times, rates [rad/s], reaches, and lateness [s].

    Of the passages [first, stop) those KNOT_STEP_S after the one before them, which is at `last`
    [s], and all beside uneven ones. Late is the passage behind its cubic. Reach 0: no cubic could
    be laid, the rate is the neighbours', and the lateness NaN.

    `time` (n,) [s], `count` and `stretch` (n,); `unit` per count [rad]. Added to: what the cubics
    of each reach left of the passages, `sums` (MOST_REACH + 1, classes) of SUMS, by the count
    modulo the classes.
    """
    n, run, classes = time.size, _even_runs(time, count, stretch), sums.shape[1]
    knot, smooth, rate, reaches, late = (
        np.empty(stop - first, np.int64),
        np.empty(n),
        np.empty(n),
        np.zeros(n, np.int8),
        np.empty(n),
    )
    k = 0
    for i in range(first, stop):
        high = i + LEAST_REACH
        even = high < n and run[high] >= 2 * LEAST_REACH
        beside = (
            not even
            or run[i + 1 + LEAST_REACH if high + 1 < n else n - 1] < 2 * LEAST_REACH
            or run[high] == 2 * LEAST_REACH
        )
        if time[i] - last < KNOT_STEP_S and not beside:
            continue
        knot[k] = i
        reach = 0
        if even:
            pace = (time[high] - time[i - LEAST_REACH]) / (2 * LEAST_REACH)
            reach = min(max(int(0.5 * SPAN_S / pace), LEAST_REACH), MOST_REACH)
            while reach > LEAST_REACH and (i + reach >= n or run[i + reach] < 2 * reach):
                reach -= 1
            here, at, steepness = time[i], 0.0, 0.0
            for j in range(-reach, reach + 1):
                at += VALUE[reach, MOST_REACH + j] * (time[i + j] - here)
                steepness += SLOPE[reach, MOST_REACH + j] * (time[i + j] - here)
            begin, end = (
                time[i - reach + 2] - time[i - reach],
                time[i + reach] - time[i + reach - 2],
            )
            if steepness > 0 and begin < EVEN * end and end < EVEN * begin:
                smooth[k], reaches[k], late[k] = here + at, reach, -at
                rate[k] = (count[i + 1] - count[i]) * unit / steepness
                residual = -at * rate[k]
                if abs(residual) < 0.2 * unit:
                    place = count[i] % classes
                    left = sums[reach, place]
                    left["number"] += 1
                    left["total"] += residual
                    left["squares"] += residual * residual
        if reaches[k] == 0:
            before = i - 1 if i > 0 and stretch[i - 1] == stretch[i] else i
            after = i + 1 if i + 1 < n and stretch[i + 1] == stretch[i] else i
            span = time[after] - time[before]
            smooth[k], rate[k], late[k] = (
                time[i],
                (count[after] - count[before]) * unit / span if span > 0 else 0.0,
                np.nan,
            )
        last = smooth[k]
        k += 1
    return (
        knot[:k],
        smooth[:k].copy(),
        rate[:k],
        reaches[:k].copy(),
        late[:k],
    )  # views would keep the whole arrays alive


@dataclass(frozen=True)
class Knots:
    """Knots of a piece or of a log, arrays of shape (n,).

    What `Teeth` says of them, `rate_rad_s`, the `reach` of the cubic that was laid through it, 0
    for none, and how much `late_s` its passage was behind the cubic, empty if it does not matter.
    """

    time_s: FloatArray
    count: NDArray[np.int32]
    rate_rad_s: NDArray[np.float32]
    stretch: NDArray[np.int32]
    forward: NDArray[np.bool_]
    reach: NDArray[np.int8]
    late_s: NDArray[np.float32]


class KnotBuilder:
    """Takes passages piece by piece, and gives their knots.

    `unit_rad` per count and `classes` counts per turn (1 if the counts have no pitch errors);
    `edges` if the passages are edges between two samples.
    """

    def __init__(self, unit_rad: float, classes: int, edges: bool = False) -> None:
        self.unit_rad, self.classes, self.edges = unit_rad, classes, edges
        self._parts: list[Knots] = []
        self._held: tuple[Any, ...] | None = None
        self._first = 0  # of the held passages, the first that is not a knot yet
        self._last = -np.inf
        self._variance, self._freedom = 0.0, 0.0
        self._kept = np.zeros(MOST_REACH + 1)

    def add(
        self, time_s: FloatArray, count: Integers, stretch: Integers, forward: np.ndarray
    ) -> None:
        """The next passages, shape (n,) each."""
        for start in range(0, time_s.size, PIECE):
            piece = slice(start, start + PIECE)
            self._add(
                (
                    time_s[piece],
                    count[piece].astype(np.int64),
                    stretch[piece].astype(np.int64),
                    forward[piece],
                ),
                last=False,
            )

    def _add(self, new: tuple[Any, ...], last: bool) -> None:
        margin = MOST_REACH + 4
        parts: tuple[Any, ...] = (
            new
            if self._held is None
            else tuple(np.concatenate([a, b]) for a, b in zip(self._held, new, strict=True))
        )
        time, count, stretch, forward = parts
        first, stop = self._first, time.size if last else time.size - margin
        if stop <= first:
            self._held = parts
            return
        sums = np.zeros((MOST_REACH + 1, self.classes), SUMS)
        at, smooth, rate, reach, late = _local_cubics(
            time, count, stretch, self.unit_rad, first, stop, self._last, sums
        )
        self._note_scatter(sums)
        if at.size:
            self._last = float(smooth[-1])
            small = (
                count[at].astype(np.int32),
                rate.astype(np.float32),
                stretch[at].astype(np.int32),
            )
            kept = late.astype(np.float32) if self.edges else np.zeros(0, np.float32)
            self._parts.append(Knots(smooth, *small, forward[at], reach, kept))
        begin = max(stop - margin, 0)
        self._held, self._first = tuple(p[begin:] for p in parts), stop - begin

    def _note_scatter(self, sums: Records) -> None:
        """Notes what the cubics of each reach left.

        Each class of counts about its own mean: a cubic that keeps w of a passage leaves 1 - w.
        """
        number, total, squares = (sums[name].copy() for name in ("number", "total", "squares"))
        kept = VALUE[:, MOST_REACH]
        left = (squares - total**2 / np.maximum(number, 1.0)).sum(axis=1)[LEAST_REACH:]
        freedom = (number.sum(axis=1) - (number > 0).sum(axis=1))[LEAST_REACH:]
        self._variance += float(np.sum(left / (1 - kept[LEAST_REACH:])))
        self._freedom += float(freedom.sum())
        self._kept += number.sum(axis=1) * kept

    def knots(self) -> Knots:
        """All knots; nothing can be added after."""
        if self._held is not None:
            self._add(tuple(p[:0] for p in self._held), last=True)
        joined, parts = (
            [],
            [[getattr(part, name) for part in self._parts] for name in Knots.__annotations__],
        )
        self._parts = []
        while parts:  # a field's pieces go as soon as they are joined
            joined.append(np.concatenate(parts.pop(0)))
        return Knots(*joined)

    def noise_rad(self, otherwise: float) -> float:
        """Standard deviation of a knot: from what the cubics leave.

        Of a passage alone, `otherwise`, if the log is too short.
        """
        if self._freedom < 100:
            return otherwise
        number = float(
            self._kept.sum() / max(float((self._kept / VALUE[:, MOST_REACH]).sum()), 1.0)
        )
        return float(np.sqrt(self._variance / self._freedom * number))


def angle_function(
    knots: Knots,
    error_rad: FloatArray,
    sign: Integers,
    offset: Integers,
    unit_rad: float,
    noise_rad: float,
    sample_s: float = 0.0,
) -> AngleFunction:
    """The wheel angle through `knots`, whose arrays it keeps and changes.

    `error_rad` the pitch error of each count modulo its size; `sign`, `offset` of shape
    (stretches,): what makes the counts of a stretch those of the wheel; `noise_rad` standard
    deviation of a knot; `sample_s` the time between two samples, for knots of edges.
    """
    value, slope = (
        np.stack([_around(error_rad, row) for row in weights]) for weights in (VALUE, SLOPE)
    )
    time, latest = knots.time_s, -np.inf
    for start in range(0, time.size, PIECE):
        piece = slice(start, start + PIECE)
        count, rate, stretch, reach = (
            knots.count[piece],
            knots.rate_rad_s[piece],
            knots.stretch[piece],
            knots.reach[piece],
        )
        count[:] = sign[stretch] * count + offset[stretch]
        rate *= sign[stretch]
        place = np.mod(count, error_rad.size)
        pace = np.where(rate == 0, np.inf, rate)
        late = value[reach, place] / pace
        if knots.late_s.size:
            knots.late_s[piece] -= (error_rad[place] - value[reach, place]) / pace
        rate /= 1 - slope[reach, place] / unit_rad
        time[piece] = np.maximum.accumulate(np.maximum(time[piece] - late, latest))
        latest = float(time[piece][-1])
    grid = np.zeros(0, np.float32)
    if knots.late_s.size:
        grid = np.abs(knots.rate_rad_s) * _grid_s(knots, sample_s).astype(np.float32)
        noise_rad = float(np.median(grid))
    return AngleFunction(
        time, knots.count, unit_rad, knots.rate_rad_s, knots.stretch, noise_rad, grid
    )


def _grid_s(knots: Knots, sample_s: float) -> FloatArray:
    """Standard deviation [s] of the times of knots of edges, shape (n,).

    An edge is uniform between two samples: its variance is known. A cubic that keeps w of its
    middle edge leaves 1 - w of that if edges are independent, and less if neighbours are alike; the
    knot has the rest. Whatever is left, the knot has w / (1 - w) of it at least: chance of any
    other kind is independent from edge to edge.
    """
    laid = knots.reach > 0
    share = np.maximum(sliding_mean(laid.astype(np.float64), GRID_KNOTS), 0.5 / GRID_KNOTS)
    left, kept = (
        sliding_mean(np.where(laid, values, 0.0), GRID_KNOTS) / share
        for values in (knots.late_s.astype(np.float64) ** 2, VALUE[knots.reach, MOST_REACH])
    )
    alone = sample_s**2 / 12
    variance = np.maximum(alone - left, kept / (1 - kept) * left)
    return np.sqrt(np.where(laid, variance, alone))


def _around(error_rad: FloatArray, weights: FloatArray) -> FloatArray:
    """The weighted sum of the errors around each count of a turn, shape as given."""
    place = np.arange(error_rad.size)
    return np.asarray(
        sum(w * error_rad[(place + j - MOST_REACH) % error_rad.size] for j, w in enumerate(weights))
    )
