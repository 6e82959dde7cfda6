"""A channel thinned for the search of passages: medians of short buckets.

    channel
        --block by block, buckets at fixed samples--> Decimated (float32, 1 byte per sample of the
                                                      log), noise and extremes beside

The median of a bucket ignores a single wild sample; a bucket that is lost is bridged by a straight
line, which has no extreme.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel
from tirelog.dsp.noise import PIECE_SAMPLES, SampleNoise
from tirelog.strain.passages.search_kernels import bucket_medians, fill_lost, running_medians
from tirelog.vocabulary.arrays import FloatArray, IntArray

#: samples read at once: they stay in the cache until they are done with
AT_ONCE = 1 << 17
#: length of a bucket [s]: at 25 m/s a patch of 0.1 m takes 4 ms; buckets twice as long leave one
#: in a patch at 30 m/s
BUCKET_S = 1.6e-3


@dataclass(frozen=True)
class Decimated:
    """The medians of buckets of a channel's samples, patch upward.

    `values` (m,): of buckets of `bucket` samples; none if the whole channel is lost.

    `parts`: number of the bucket with which each gapless segment begins; `extremes`: least and
    largest sample of the channel, as recorded; `noise`: sigma of one sample (NaN: not known).
    """

    values: NDArray[np.float32]
    bucket: int
    parts: IntArray
    extremes: tuple[float, float]
    noise: float

    def index(self, bucket: IntArray | FloatArray) -> FloatArray:
        """The middle of buckets [samples], by their numbers."""
        return np.asarray(bucket * float(self.bucket) + 0.5 * (self.bucket - 1), dtype=np.float64)


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
    step = -(-block_samples // PIECE_SAMPLES) * PIECE_SAMPLES
    margin = 1 if bucket == 1 else 0
    noise = SampleNoise(channel.size, channel.resolution)
    medians = np.empty(-(-channel.size // bucket), np.float32)
    low, high = np.inf, -np.inf
    for start in range(0, channel.size, step):
        first, stop = max(start - margin, 0), min(start + step, channel.size)
        values = np.ascontiguousarray(
            channel.read(first, min(stop + margin, channel.size)), dtype=np.float64
        )
        noise.take(start, values[start - first : stop - first])
        low, high = np.fmin.reduce(values, initial=low), np.fmax.reduce(values, initial=high)
        own = medians[start // bucket : -(-stop // bucket)]
        if bucket == 1:
            running_medians(values, start - first, sign, own)
        else:
            bucket_medians(values, bucket, sign, own)
    parts = np.ceil((channel.axis.first[1:] - 0.5 * (bucket - 1)) / bucket).astype(np.int64)
    return Decimated(
        _bridged(medians),
        bucket,
        np.concatenate([[0], parts]),
        (float(low), float(high)),
        noise.sigma(),
    )


def _bridged(medians: NDArray[np.float32]) -> NDArray[np.float32]:
    """Lost buckets filled by straight lines, at the ends by the nearest.

    Nothing at all if all are lost.
    """
    return medians if fill_lost(medians) else medians[:0]
