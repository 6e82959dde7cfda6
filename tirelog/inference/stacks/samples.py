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

#: samples a chunk, about: what a dozen arrays of it take stays near the processor
CHUNK_SAMPLES = 1 << 16
#: of the times of an axis every so many are kept, to find the others
_STRIDE = 1 << 13
#: turns to either side of a chunk whose samples are looked at too: what a refined passage moves is
#: far less
_MARGIN = 1


@dataclass(frozen=True)
class Chunk:
    """Turns [first, stop) of a run of passages, and samples [low, high) among which all of theirs
    are.
    """

    first: int
    stop: int
    low: int
    high: int


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

    def chunks(
        self, centre_s: FloatArray, first: int, stop: int, size: int | None = None
    ) -> list[Chunk]:
        """Turns [first, stop) of the run of passages `centre_s` (n,), about `size` samples at a
        time.

        The first turn's samples begin one period before its passage, the last one's end one after,
        where the run ends there.
        """
        spent = (centre_s[first:stop] - centre_s[first]) * self.channel.axis.rate_Hz
        cuts = first + np.flatnonzero(np.diff(spent // (size or CHUNK_SAMPLES))) + 1
        edges = np.array([first, *cuts, stop])
        around = np.concatenate(
            [[2 * centre_s[0] - centre_s[1]], centre_s, [2 * centre_s[-1] - centre_s[-2]]]
        )
        low = np.maximum(edges[:-1] - _MARGIN, 0)
        high = np.minimum(edges[1:] + 1 + _MARGIN, around.size - 1)
        low, high = self.before(around[low]), self.before(around[high])
        return [
            Chunk(*(int(x) for x in row))
            for row in zip(edges[:-1], edges[1:], low, high, strict=True)
        ]

    def read(self, chunk: Chunk) -> tuple[FloatArray, FloatArray]:
        """Times and values of a chunk's samples that are there."""
        values = self.channel.read(chunk.low, chunk.high)
        time_s = self.channel.axis.time(chunk.low, chunk.high)
        good = np.isfinite(values)
        return (time_s, values) if good.all() else (time_s[good], values[good])
