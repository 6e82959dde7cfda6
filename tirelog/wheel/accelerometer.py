"""What an accelerometer channel has to be cleared of before its fronts are sought.

channel --values held by a radio that has lost its carrier become NaN--> channel
channel --the log's extremes, if samples pile up there--> limits of the sensor or of the converter
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tirelog.data.recording import Channel
from tirelog.vocabulary.arrays import FloatArray

#: so many equal samples in a row do not happen under noise: with EQUAL_SHARE of equal neighbours
#: once in 3e8 samples.  Twice as many would take held values of up to 11 samples for measured
HELD = 6
#: a channel with more equal neighbours than this has no noise to tell by; with twice as many equal
#: ones HELD of them would happen by chance once in 1e7 samples
EQUAL_SHARE = 0.02
#: samples read at once (1 MB)
PIECE = 1 << 17
#: samples at the extreme of a log that clips, at least; twice as many miss clips of up to
#: eleven
PILED_UP = 6


def without_held(channel: Channel, low: float, high: float) -> Channel:
    """The channel with runs of HELD or more equal samples lost.

    Runs at its limits `low` and `high` stay; as it is if the channel has too little noise to tell.
    """
    starts = np.unique(np.linspace(0, max(channel.size - 4096, 0), 32).astype(np.int64))
    pieces = [channel.read(int(s), int(s) + 4096) for s in starts]
    pieces = [p[(p > low) & (p < high)] for p in pieces]
    shares = [float(np.mean(np.diff(p) == 0)) for p in pieces if p.size > 1]
    if not shares or np.median(shares) > EQUAL_SHARE:
        return channel

    def read(start: int, stop: int) -> FloatArray:
        first = max(start - HELD, 0)
        values = channel.read(first, stop + HELD)
        equal = (np.diff(values) == 0) & (values[1:] > low) & (values[1:] < high)
        if equal.any():
            edges = np.flatnonzero(np.diff(np.concatenate([[0], equal.view(np.int8), [0]])))
            runs = [
                (a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= HELD - 1
            ]
            if runs:
                values = values.copy()
            for a, b in runs:
                values[a : b + 1] = np.nan
        return values[start - first : stop - first]

    return replace(channel, samples=read)


def limits(channel: Channel) -> tuple[float, float, float]:
    """(lower limit, upper limit, share of all samples there).

    Infinite if the extreme of the log is not a pile of equal samples.
    """
    extremes = [np.inf, -np.inf]
    counts, known = [0, 0], 0
    for _, block in channel.blocks(PIECE):
        x = block[np.isfinite(block)]
        known += x.size
        if x.size == 0:
            continue
        for side, (value, further) in enumerate(((float(x.min()), -1), (float(x.max()), 1))):
            if further * (value - extremes[side]) > 0:
                extremes[side], counts[side] = value, 0
            if value == extremes[side]:
                counts[side] += int(np.sum(x == value))
    low, high = (
        e if n >= PILED_UP else s * np.inf
        for e, n, s in zip(extremes, counts, (-1, 1), strict=True)
    )
    share = sum(n for n in counts if n >= PILED_UP) / max(known, 1)
    return low, high, share
