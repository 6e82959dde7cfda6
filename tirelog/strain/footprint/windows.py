"""Rectangular windows of a channel around its passages.

With the distance of every sample along the tread.

    Channel + Passages
        --passages of like window length, read one stretch of the log at a time-->
        PatchWindows (rows x columns)
        --neighbouring samples averaged if they lie closer than needed-->
        PatchWindows, fewer columns

A row's window depends on its own passage only (its length is the next power of two above what its
speed needs), so rows do not change with the blocks that are read. Values are turned so that the
patch is a minimum, whatever the surface.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from tirelog.data.recording import BLOCK_SAMPLES, Channel
from tirelog.kernels import compiled
from tirelog.strain.footprint.kernels import motion_of
from tirelog.strain.footprint.plain_edges import distance_along
from tirelog.vocabulary.arrays import FloatArray, IntArray, Records

#: numbers in the windows that are given at a time: what works on them does so without leaving the
#: processor's cache
_AT_ONCE = 1 << 17


@dataclass(frozen=True)
class PatchWindows:
    """Windows of some passages: rows of samples with the patch downward.

    `row` (n,): ordinals of the passages; `values` (n, m): strain, patch downward, NaN where lost or
    beyond a gap; `centre` (n,): column of the patch centre; `rate_Hz`: columns per second;
    `averaged`: samples per column.
    """

    row: IntArray
    values: FloatArray
    centre: FloatArray
    rate_Hz: float
    averaged: int = 1

    def take(self, which: Any) -> PatchWindows:
        """The rows `which` (mask, slice or indices)."""
        return PatchWindows(
            self.row[which], self.values[which], self.centre[which], self.rate_Hz, self.averaged
        )

    def motion(self, speed_m_s: FloatArray, acceleration_m_s2: FloatArray) -> Records:
        """How each row moves, (n,) of MOTION, for the kernels.

        `speed_m_s` and `acceleration_m_s2`: of all passages of the log.
        """
        return motion_of(
            self.centre, self.rate_Hz, speed_m_s[self.row], acceleration_m_s2[self.row]
        )

    def distance_m(self, motion: Records) -> FloatArray:
        """Distance of each sample from the patch centre along the tread, shape (n, m)."""
        rows = motion[:, None]
        time = (np.arange(self.values.shape[1]) - rows["centre"]) / rows["rate_Hz"]
        return distance_along(time, rows["speed_m_s"], rows["acceleration_m_s2"])

    def reduced(self, averaged: int) -> PatchWindows:
        """The same windows with `averaged` neighbouring columns as one."""
        if averaged <= 1:
            return self
        count = self.values.shape[1] // averaged
        parts = self.values[:, : count * averaged].reshape(len(self.row), count, averaged)
        lost = np.isnan(parts)
        if lost.any():
            kept = (~lost).sum(axis=2)
            mean = np.where(
                kept == averaged, np.where(lost, 0.0, parts).sum(axis=2) / averaged, np.nan
            )
        else:
            mean = parts.mean(axis=2)
        return PatchWindows(
            self.row,
            mean,
            (self.centre - 0.5 * (averaged - 1)) / averaged,
            self.rate_Hz / averaged,
            self.averaged * averaged,
        )


def window_class(reach_samples: FloatArray) -> IntArray:
    """Half window [samples] of each passage.

    `reach_samples` rounded up to 2^k or 3 x 2^k, at least 8 (quick lengths of an FFT).

    A passage whose speed is unknown has no reach; it gets the least window, and nothing is cut out
    for it.
    """
    reach = np.fmax(reach_samples, 8.0)
    two = 2.0 ** np.ceil(np.log2(reach))
    return np.where(reach <= 0.75 * two, 0.75 * two, two).astype(np.int64)


def gather_windows(
    channel: Channel,
    sign: float,
    index: FloatArray,
    reach_samples: FloatArray,
    rows: IntArray,
    block_samples: int = BLOCK_SAMPLES,
) -> Iterator[PatchWindows]:
    """Windows around `index` of the passages `rows`, many of one length at a time.

    `index`: fractional samples, NaN is left out. `sign`: +1 if the patch is a maximum of the
    recorded signal; `reach_samples` (n,): half of the window that each passage needs. The channel
    is read in blocks of about `block_samples`.
    """
    rows = rows[np.isfinite(index[rows])]
    half = window_class(np.minimum(reach_samples, channel.size))
    block = np.floor(index[rows] / max(block_samples, 1)).astype(np.int64)
    waiting: dict[int, list[PatchWindows]] = {}
    for number in np.unique(block):
        inside = rows[block == number]
        nearest = np.round(index[inside]).astype(np.int64)
        low = max(int((nearest - half[inside]).min()), 0)
        high = min(int((nearest + half[inside]).max()) + 1, channel.size)
        samples = np.ascontiguousarray(channel.read(low, high), np.float64)
        for size in np.unique(half[inside]).tolist():
            some = half[inside] == size
            held = waiting.setdefault(size, [])
            held.append(
                _cut(
                    channel,
                    -sign,
                    samples,
                    low,
                    index[inside[some]],
                    nearest[some],
                    size,
                    inside[some],
                )
            )
            if sum(part.values.size for part in held) >= _AT_ONCE:
                yield joined_windows(waiting.pop(size))
    for held in waiting.values():
        yield joined_windows(held)


def joined_windows(parts: list[PatchWindows]) -> PatchWindows:
    """One set of windows from several of the same length and rate."""
    if len(parts) == 1:
        return parts[0]
    row, values, centre = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("row", "values", "centre")
    )
    return replace(parts[0], row=row, values=values, centre=centre)


def _cut(
    channel: Channel,
    turned: float,
    samples: FloatArray,
    low: int,
    index: FloatArray,
    nearest: IntArray,
    size: int,
    rows: IntArray,
) -> PatchWindows:
    """Windows of half length `size` out of `samples`.

    These start at sample `low` of the channel and are `turned` patch downward.
    """
    begins, ends = np.zeros(nearest.size, np.int64), np.full(nearest.size, channel.size)
    first = channel.axis.first
    if channel.axis.explicit is None and first.size > 1:
        part = np.searchsorted(first, nearest, side="right")
        begins, ends = (
            first[part - 1].astype(np.int64),
            np.append(first, channel.size)[part].astype(np.int64),
        )
    values = _cut_out(samples, low, nearest - size, 2 * size, begins, ends, turned)
    return PatchWindows(rows, values, index - nearest + size, channel.axis.rate_Hz)


@compiled
def _cut_out(
    samples: FloatArray,
    low: int,
    starts: IntArray,
    count: int,
    begins: IntArray,
    ends: IntArray,
    turned: float,
) -> FloatArray:
    """`count` samples from each of `starts` (n,) on, times `turned`.

    Shape (n, count); NaN outside of `begins` (n,) to `ends` (n,) and of `samples`, which are
    numbered from `low` on. `turned`: 1 or -1.
    """
    out = np.empty((starts.size, count))
    for row in range(starts.size):
        begin, end = max(begins[row], low), min(ends[row], low + samples.size)
        for k in range(count):
            at = starts[row] + k
            out[row, k] = turned * samples[at - low] if begin <= at < end else np.nan
    return out
