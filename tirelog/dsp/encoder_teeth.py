"""From tooth passages to counted teeth: what is missing, what is too many, where the count was lost.

    indices (n,) --without_extra--> indices without pairs that no smooth motion explains
                 --counted--------> Teeth: indices (n,), counts (n,) in half teeth, stretches between losses of the count

A passage through the middle level is half a tooth; a rising one has an even count.  Rising and falling passages take turns, so an
interval is an odd number of half teeth.  A one-track encoder does not show direction: a turning point is inferred where the
signal comes back from less than its peak, and the stretch after it is counted downwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from tirelog.dsp.encoder_signal import FOLLOW_S, Crossings, Probe, Read
from tirelog.recording import FloatArray, IntArray

#: a turning wheel shows less than this share of the peak between two passages of the same tooth flank
TURNING_PEAK = 0.8
#: passages on each side that predict an interval
NEIGHBOURS = 3


@dataclass(frozen=True)
class Teeth:
    """Counted tooth passages.

    index    (n,) fractional sample of the passage, ascending
    count    (n,) position in half teeth, even where the signal rises; falls while the wheel rolls backwards
    stretch  (n,) number of the stretch without a loss of the count; between stretches any whole number of teeth may be missing
    forward  (n,) False where the wheel was inferred to roll backwards
    missing, extra  passages that were filled in and left out
    """

    index: FloatArray
    count: IntArray
    stretch: IntArray
    forward: np.ndarray
    missing: int
    extra: int


def count_teeth(read: Read, found: Probe, passages: Crossings, rate_Hz: float, steps: int) -> Teeth:
    """Teeth from the `passages` of an encoder of `steps` teeth a turn; `read` gives the signal again, around standstills only."""
    index, rising, extra = _without_extra(passages.index, passages.rising)
    n = index.size
    if n < 2:
        return Teeth(index, np.zeros(n, np.int64), np.zeros(n, np.int64), np.ones(n, bool), 0, extra)
    halves = _half_teeth(np.diff(index), 2 * steps)
    still = np.diff(index) > 0.5 * FOLLOW_S * rate_Hz
    hole = np.zeros(n - 1, bool)
    if passages.breaks.size:
        broken = np.clip(np.searchsorted(index, passages.breaks) - 1, 0, n - 2)
        hole[broken[halves[broken] != 1]] = True
    halves[still] = 1
    lost = still | hole | (halves > 2 * steps)
    sign = np.ones(n - 1, np.int64)
    turned = _turning_points(read, found, index, np.flatnonzero(still))
    direction = 1
    for at in turned:
        direction = -direction
        sign[at:] = direction
        halves[at] = 0
    count = np.concatenate([[0], np.cumsum(halves * sign)]) + (0 if rising[0] else 1)
    stretch = np.concatenate([[0], np.cumsum(lost)])
    forward = np.concatenate([[True], sign > 0])
    return Teeth(index, count, stretch, forward, int(np.sum((halves[~lost] - 1) // 2)), extra)


def _without_extra(index: FloatArray, rising: np.ndarray) -> tuple[FloatArray, np.ndarray, int]:
    """Passages without the pairs that a glitch adds: a short interval whose removal leaves a regular one."""
    removed = 0
    for _ in range(4):
        steps = np.diff(index)
        if steps.size < 12:
            break
        local = median_filter(steps, 9, mode="nearest")
        joined = np.full(steps.size, np.inf)
        joined[1:-1] = np.abs((steps[:-2] + steps[1:-1] + steps[2:]) / local[1:-1] - 1.0)
        cost = np.where((steps < 0.6 * local) & (joined < 0.35), joined, np.inf)
        best = np.isfinite(cost)
        for shift in (1, 2):
            best[shift:] &= cost[shift:] <= cost[:-shift]
            best[:-shift] &= cost[:-shift] < cost[shift:]
        pairs = np.flatnonzero(best)
        if pairs.size == 0:
            break
        keep = np.ones(index.size, bool)
        keep[pairs] = keep[pairs + 1] = False
        index, rising, removed = index[keep], rising[keep], removed + 2 * pairs.size
    return index, rising, removed


def _half_teeth(steps: FloatArray, turn: int) -> IntArray:
    """Half teeth in each interval: 1, or an odd number more where the intervals on both sides agree that it is too long."""
    halves = np.ones(steps.size, np.int64)
    if steps.size < 2 * NEIGHBOURS + 1:
        return halves
    middle = median_filter(steps, NEIGHBOURS, mode="nearest")
    left = np.concatenate([np.full(2, np.inf), middle[:-2]])
    right = np.concatenate([middle[2:], np.full(2, np.inf)])
    left[:NEIGHBOURS], right[-NEIGHBOURS:] = np.inf, np.inf
    agreed = np.maximum(left, right) < 1.6 * np.minimum(left, right)
    long = agreed & (steps > 2.0 * np.maximum(left, right))
    halves[long] = 2 * np.rint((steps[long] / (0.5 * (left + right))[long] - 1) / 2).astype(np.int64) + 1
    return np.minimum(halves, 2 * turn + 1)


def _turning_points(read: Read, found: Probe, index: FloatArray, still: IntArray) -> list[int]:
    """The intervals of `still` in which the signal came back without having passed its peak.

    Nothing is inferred where the amplitude falls with speed (an inductive sensor): there the peak says nothing.
    """
    turned = []
    for at in still:
        before, after = int(index[max(at - 1, 0)]), int(index[min(at + 2, index.size - 1)]) + 1
        stop = min(after, before + (1 << 20))
        x = read(before, stop)
        edges = (np.array([index[at], index[at + 1]]) - before).astype(np.int64)
        if edges[1] >= x.size or edges[0] < 2 or edges[1] + 3 > x.size:
            continue
        inner, left, right = x[edges[0] : edges[1]], x[: edges[0]], x[edges[1] :]
        around = np.concatenate([left, right])
        middle = 0.5 * float(np.nanmax(x) + np.nanmin(x))
        peak = float(np.nanmax(np.abs(around - middle)))
        if peak > 0.7 * found.amplitude and np.nanmax(np.abs(inner - middle)) < TURNING_PEAK * peak:
            turned.append(int(at))
    return turned
