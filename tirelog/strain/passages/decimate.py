"""A channel thinned for the search of passages: medians of short buckets.

    channel
        --block by block, buckets at fixed samples--> Decimated (float32, 1 byte per sample of the
                                                      log), noise and extremes beside
        --shorter buckets in some stretches (`refined`)--> Decimated

The median of a bucket ignores a single wild sample; a bucket that is lost is bridged by a straight
line, which has no extreme.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel, TimeAxis
from tirelog.dsp.noise import PIECE_SAMPLES, SampleNoise
from tirelog.strain.passages.search_kernels import bucket_medians, fill_lost, running_medians
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: samples read at once: they stay in the cache until they are done with
AT_ONCE = 1 << 17
#: length of a bucket [s], before any is made shorter: at 25 m/s a patch of 0.1 m takes 4 ms;
#: buckets twice as long need shorter ones from half the speed on
BUCKET_S = 1.6e-3
#: shorter buckets have this share of the samples: twice as much takes two rounds for what is four
#: times as fast
SHORTER = 4
#: a recording that is interrupted for longer [s] goes on as another part, as its level may have
#: drifted meanwhile; twice as long takes a drift of twice the size for a pulse's rise or fall
INTERRUPTED_S = 1.0


@dataclass(frozen=True)
class Decimated:
    """The medians of buckets of a channel's samples, patch upward.

    `values` (m,): of buckets; none if the whole channel is lost.

    The buckets of a piece are equally long: `bucket` (p,) samples each, from bucket number
    `begin` (p,) on, which starts at the sample `first` (p,).

    `parts`: number of the bucket with which the recording begins, and goes on after each long
    interruption; `extremes`: least and largest sample of the channel, as recorded; `noise`: sigma
    of one sample (NaN: not known).
    """

    values: NDArray[np.float32]
    bucket: IntArray
    begin: IntArray
    first: IntArray
    parts: IntArray
    extremes: tuple[float, float]
    noise: float

    def samples(self, place: IntArray | FloatArray) -> IntArray:
        """Samples of the buckets at these places (n,)."""
        return self.bucket[self._piece(place)]

    def index(self, place: IntArray | FloatArray) -> FloatArray:
        """The middle of buckets [samples], by their numbers `place` (n,)."""
        piece = self._piece(place)
        bucket = self.bucket[piece].astype(np.float64)
        middle: FloatArray = (place - self.begin[piece]) * bucket + 0.5 * (bucket - 1)
        return self.first[piece] + middle

    def _piece(self, place: IntArray | FloatArray) -> IntArray:
        return np.searchsorted(self.begin[1:], place, side="right")


def bucket_samples(rate_Hz: float) -> int:
    """Samples a bucket: 1, 4, 8, 16 ..."""
    samples = BUCKET_S * rate_Hz
    return 1 << int(np.log2(samples)) if samples >= 4 else 1


def decimate(channel: Channel, sign: float, block_samples: int = AT_ONCE) -> Decimated:
    """The channel by buckets, times `sign`.

    The buckets lie at fixed samples, whatever `block_samples`.

    A bucket is the median of its four quarters' means, of those that are not lost; a bucket of one
    sample is the median with its neighbours.
    """
    bucket = bucket_samples(channel.axis.rate_Hz)
    noise = SampleNoise(channel.size, channel.resolution)
    medians = np.empty(-(-channel.size // bucket), np.float32)
    low, high = np.inf, -np.inf
    for start, values in _median_blocks(channel, sign, bucket, 0, medians, block_samples):
        noise.take(start, values)
        low, high = np.fmin.reduce(values, initial=low), np.fmax.reduce(values, initial=high)
    buckets, zero = np.array([bucket]), np.zeros(1, np.int64)
    parts = _parts(channel.axis, buckets, zero, zero)
    extremes = float(low), float(high)
    return Decimated(_bridged(medians), buckets, zero, zero, parts, extremes, noise.sigma())


def refined(channel: Channel, data: Decimated, sign: float, stretches: IntArray) -> Decimated:
    """`data` of `channel` with shorter buckets in the `stretches`, samples [from, to), (n, 2).

    Buckets of one sample stay.
    """
    values: list[NDArray[np.float32]] = []
    pieces: list[tuple[int, int, int]] = []
    begin = 0
    ends = np.append(data.begin[1:], data.values.size)
    for bucket, place, first, end in zip(data.bucket, data.begin, data.first, ends, strict=True):
        within = np.clip((stretches - first) / bucket, 0, end - place)
        cuts = np.stack([np.floor(within[:, 0]), np.ceil(within[:, 1])], axis=1).astype(np.int64)
        cuts = cuts[(cuts[:, 1] > cuts[:, 0]) & (bucket > 1)]
        edges = np.concatenate([[0], cuts.ravel(), [end - place]])
        for k, (low, high) in enumerate(pairwise(edges.tolist())):
            if high <= low:
                continue
            own, shorter = data.values[place + low : place + high], int(bucket)
            start = int(first + low * bucket)
            if k % 2:  # every second piece is a stretch
                shorter = shorter // SHORTER if shorter >= 4 * SHORTER else 1
                stop = min(int(first + high * bucket), channel.size)
                own = np.empty(-(-(stop - start) // shorter), np.float32)
                for _ in _median_blocks(channel, sign, shorter, start, own, AT_ONCE):
                    pass
            values.append(own)
            pieces.append((shorter, begin, start))
            begin += own.size
    buckets, begins, firsts = np.array(pieces, np.int64).T
    return replace(
        data,
        values=_bridged(np.concatenate(values)),
        bucket=buckets,
        begin=begins,
        first=firsts,
        parts=_parts(channel.axis, buckets, begins, firsts),
    )


def _median_blocks(
    channel: Channel,
    sign: float,
    bucket: int,
    begin: int,
    medians: NDArray[np.float32],
    block_samples: int,
) -> Iterator[tuple[int, FloatArray]]:
    """Fills `medians` (m,) with the buckets from the sample `begin` on.

    Yields (first sample, samples) of each block that it goes through.
    """
    step = -(-block_samples // PIECE_SAMPLES) * PIECE_SAMPLES
    margin = 1 if bucket == 1 else 0
    end = min(begin + bucket * medians.size, channel.size)
    for start in range(begin, end, step):
        first, stop = max(start - margin, 0), min(start + step, end)
        values = np.ascontiguousarray(
            channel.read(first, min(stop + margin, channel.size)), dtype=np.float64
        )
        own = medians[(start - begin) // bucket : -(-(stop - begin) // bucket)]
        if bucket == 1:
            running_medians(values, start - first, sign, own)
        else:
            bucket_medians(values, bucket, sign, own)
        yield start, values[start - first : stop - first]


def _parts(axis: TimeAxis, bucket: IntArray, begin: IntArray, first: IntArray) -> IntArray:
    """Numbers of the buckets with which the recording begins and goes on, by the pieces (p,)."""
    behind = axis.first[1:][axis.missing[1:] > INTERRUPTED_S * axis.rate_Hz]
    piece = np.searchsorted(first[1:], behind, side="right")
    place = np.ceil((behind - first[piece] - 0.5 * (bucket[piece] - 1)) / bucket[piece])
    return np.concatenate([[0], begin[piece] + place.astype(np.int64)])


def _bridged(medians: NDArray[np.float32]) -> NDArray[np.float32]:
    """Lost buckets filled by straight lines, at the ends by the nearest.

    Nothing at all if all are lost.
    """
    return medians if fill_lost(medians) else medians[:0]
