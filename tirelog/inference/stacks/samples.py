"""A channel's samples by time, in chunks of whole turns: nothing in it has the length of the log.

    Channel, passages (n,) [s] --chunks--> Chunk: some turns, the samples that hold them
        --read--> times, values --angle--> turn, phi

A turn lies in one chunk, so sums over a revolution do not know of the chunks; sums over the log
(the template's) are added up chunk by chunk.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tirelog.data.recording import Channel
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: samples per chunk, about: what a dozen arrays of it take stays near the processor
CHUNK_SAMPLES = 1 << 16
#: of the times of an axis every so many are kept, to find the others
_STRIDE = 1 << 13
#: turns to either side of a chunk whose samples are looked at too: what a refined passage moves is
#: far less
_MARGIN = 1
#: a channel's step is looked for in so many of its samples, in so many runs from all over it;
#: twice as many look twice as long
_LOOKED_AT, _RUNS = 4096, 8
#: fewest different values, and how far from whole steps they may lie [steps]: by chance values
#: without steps do it once in 1e20; twice as far from whole ones, chance does it once in 1e16
_FEWEST_VALUES, _OFF_STEP = 12, 0.01


@dataclass(frozen=True)
class TurnChunk:
    """Turns [first, stop) of a run of passages.

    All their samples are among [low, high).
    """

    first: int
    stop: int
    low: int
    high: int


def step_of(channel: Channel) -> tuple[float, float]:
    """The step in which a channel's values come and one of them [SI].

    A step of 0.0 if none is seen. A step that is fine against the noise leaves values of its own
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
        return 0.0, 0.0
    step = float(apart.min())
    step = float(np.median(apart[apart < 1.5 * step]))
    steps = apart / step
    if float(np.abs(steps - np.round(steps)).max()) >= _OFF_STEP:
        return 0.0, 0.0
    # one ruler through all values: that of neighbours alone would slip over thousands of steps
    number = np.round((values - values[0]) / step)
    step = float(np.polyfit(number, values - values[0], 1)[0])
    if float(np.abs((values - values[0]) / step - number).max()) >= _OFF_STEP:
        return 0.0, 0.0
    return step, float(values[0])


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

        A chunk has about CHUNK_SAMPLES. The first turn's samples begin one period before its
        passage, the last one's end one after, if the run ends there.
        """
        spent = (centre_s[first:stop] - centre_s[first]) * self.channel.axis.rate_Hz
        cuts = first + np.flatnonzero(np.diff(spent // CHUNK_SAMPLES)) + 1
        edges = np.array([first, *cuts, stop])
        around = np.concatenate(
            [[2 * centre_s[0] - centre_s[1]], centre_s, [2 * centre_s[-1] - centre_s[-2]]]
        )
        low = np.maximum(edges[:-1] - _MARGIN, 0)
        high = np.minimum(edges[1:] + 1 + _MARGIN, around.size - 1)
        low, high = self.before(around[low]), self.before(around[high])
        return [
            TurnChunk(*(int(x) for x in row))
            for row in zip(edges[:-1], edges[1:], low, high, strict=True)
        ]

    def read(self, chunk: TurnChunk) -> tuple[FloatArray, FloatArray]:
        """Times and values of a chunk's samples."""
        time_s = self.channel.axis.time(chunk.low, chunk.high)
        return time_s, self.channel.read(chunk.low, chunk.high)
