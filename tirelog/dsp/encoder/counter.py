"""Counters and angle channels.

The wheel angle is already there, and only its steps must become knots in time.

samples (size,) of counts or angles --changes, unwrapped--> times (n,) [s] and turns (n,) [1]
"""

from __future__ import annotations

import numpy as np

from tirelog.data.recording import Channel
from tirelog.vocabulary.arrays import FloatArray

#: knots per second that an angle channel keeps; twice as many follow twice as quick a shake in
#: twice the memory
ANGLE_KNOTS_Hz = 500.0


def counter_knots(
    channel: Channel, size: float, is_angle: bool
) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """(times [s], turns, backward) of a channel that counts `size` per turn.

    Knots shape (n,), `backward` True if it rolls back.

    A counter that jumps from c to d between two samples has passed (c + d + 1) / 2 in their middle.
    A counter that jumps by more than half of the next power of two has wrapped; one that has been
    below zero has a sign, and twice as many numbers. An angle wraps at a turn.
    """
    times, counts = [], []
    wrap, offset, last = (size, 0.0, np.nan) if is_angle else (0.0, 0.0, np.nan)
    every = max(int(channel.axis.rate_Hz / ANGLE_KNOTS_Hz), 1) if is_angle else 1
    for start, block in channel.blocks():
        index: FloatArray = np.arange(start, start + block.size, dtype=np.float64)
        known = np.isfinite(block)
        x, index = block[known], index[known]
        if x.size == 0:
            continue
        if not is_angle:
            low, high = float(x.min()), float(x.max())
            bits = max(np.ceil(np.log2(max(high + 1.0, -low, 2.0))), 7 if low < 0 else 8)
            wrap = max(wrap, 2.0 ** (bits + (low < 0)))
        before = np.concatenate([[last if np.isfinite(last) else x[0]], x[:-1]])
        step = x - before
        turned = np.where(step < -wrap / 2, wrap, 0.0) - np.where(step > wrap / 2, wrap, 0.0)
        unwrapped = x + offset + np.cumsum(turned)
        offset, last = float(unwrapped[-1] - x[-1]), float(x[-1])
        if is_angle:
            pick = np.arange((-start) % every, x.size, every)
            times.append(channel.axis.at(index[pick]))
            counts.append(unwrapped[pick])
        else:
            change = np.flatnonzero(step + turned)
            times.append(channel.axis.at(np.asarray(index[change] - 0.5)))
            counts.append(unwrapped[change] - 0.5 * (step + turned)[change] + 0.5)
    if not times:
        return np.zeros(0), np.zeros(0), np.zeros(0, bool)
    time, turns = np.concatenate(times), np.concatenate(counts) / size
    if turns.size and turns[-1] < turns[0]:
        turns = -turns  # a count that falls as the wheel rolls forward
    backward = np.concatenate([[False], np.diff(turns) < 0]) if turns.size else np.zeros(0, bool)
    return time, turns, backward
