"""A channel whose logger repeats each value, as the values that its instrument took.

    stored numbers, axis --some places: does a change follow a change?--> no: the channel as it is
        --all of it: places where the value changes--> every how many samples a value is new
        --the first sample of each value--> SampleAndHold: places, and a time axis of their own

A logger that is faster than its instrument writes each value several times. Such a staircase has
no derivative, and its noise is not a sample's. Changes are compared on the stored numbers, so it
does not matter which format they came in, and a channel is asked for itself: others of its log may
be as fast as the logger.

If each value stands equally often, all changes lie at multiples of that number: one change
elsewhere and it is none, so values that are alike by chance and the rounding of a signal do not
matter. If the numbers of samples vary (2, 3, 2, 3: the two clocks are no multiples), they have to
be neighbours nearly everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel, Scaled, TimeAxis
from tirelog.vocabulary.arrays import IntArray
from tirelog.vocabulary.kinds import ACCELERATION_KINDS, STRAIN_KINDS
from tirelog.vocabulary.quality import Doubt

#: samples looked at at once, and places of a channel that are looked at before all of it is
_PIECE, _PLACES = 4096, 16
#: changes that tell something; with half as many a quantised signal's changes could be multiples
#: of two once in 1e15, twice as many need a probe of faster signals
_FEWEST = 100
#: share of changes that may follow each other at once: rows that a log has lost; twice as many
#: lets rounded signals be looked at as a whole
_SINGLE = 0.02
#: share of a channel's samples that must lie between changes as far apart as usual, or a sample
#: nearer or further; a rounded signal stands still for most of a turn; with more, values that are
#: alike by chance speak against it
_COVERED = 0.9
#: places of new values lie on one line if they leave it by this many samples of the logger in all:
#: one is the logger's own rounding; twice as many put an instrument that slips on one line
_EVEN = 2.0


@dataclass(frozen=True)
class SampleAndHold:
    """`at` (m,): the first sample of each value; `axis`: their times; `least` and `most` samples
    that a value stands, as a rule.
    """

    at: IntArray
    axis: TimeAxis
    least: int
    most: int

    @property
    def remark(self) -> str:
        """What is said of it, after the channel's name."""
        often = f"{self.least}" if self.least == self.most else f"{self.least} to {self.most}"
        return (
            f"the log repeats each value {often} times: it was taken once, at its first time, "
            f"{self.axis.rate_Hz:.4g} values per second"
        )


def without_repeats(channel: Channel, quiet: Channel) -> tuple[Channel, str]:
    """(the channel with each value that is held once, what is to be said of it; '' if none is).

    Asked of channels in which a patch is found, and whose samples are `Scaled`. `quiet` is the same
    channel, of whose losses nobody hears.
    """
    stored, looked_at = channel.samples, quiet.samples
    if channel.kind not in (*STRAIN_KINDS, *ACCELERATION_KINDS):
        return channel, ""
    if not isinstance(stored, Scaled) or not isinstance(looked_at, Scaled):
        return channel, ""
    found = sample_and_hold(looked_at, channel.axis)
    if found is None:
        return channel, ""
    at, raw = found.at, stored.raw

    def once(start: int, stop: int) -> NDArray[Any]:
        some = at[start:stop]
        return raw(int(some[0]), int(some[-1]) + 1)[some - some[0]] if some.size else raw(0, 0)

    samples = replace(stored, raw=once)
    flags = tuple(_moved(doubt, at) for doubt in channel.flags)
    return replace(channel, samples=samples, axis=found.axis, flags=flags), found.remark


def _moved(doubt: Doubt, at: IntArray) -> Doubt:
    """A doubt on samples as one on the values that they hold."""
    start, stop, word = doubt
    first, last = np.searchsorted(at, [start, max(stop - 1, start)], side="right") - 1
    return max(int(first), 0), max(int(last), 0) + 1, word


def sample_and_hold(stored: Scaled, axis: TimeAxis) -> SampleAndHold | None:
    """How the values of a channel are held; None if they are not."""
    if not _likely(stored, axis.size):
        return None
    changes = _all_changes(stored, axis.size)
    if changes is None:
        return None
    segments = list(pairwise([*(axis.first.tolist() or [0]), axis.size]))
    own = [changes[(changes > first) & (changes < end)] for first, end in segments]
    steps = np.concatenate([np.diff(some) for some in own])
    if steps.size < _FEWEST:
        return None
    every = int(np.gcd.reduce(steps))
    if every > 1:
        parts = [
            np.arange(first + (int(some[0]) - first if some.size else 0) % every, end, every)
            for (first, end), some in zip(segments, own, strict=True)
        ]
        return SampleAndHold(np.concatenate(parts), _axis(axis, parts, float(every)), every, every)
    usual = int(np.bincount(steps[steps <= _PIECE]).argmax())
    near = steps[np.abs(steps - usual) <= 1]
    if usual < 2 or near.sum() < _COVERED * steps.sum():
        return None
    period = float(near.mean())
    parts = [
        _places(np.unique([first, *some.tolist(), end]), period)
        for (first, end), some in zip(segments, own, strict=True)
    ]
    common = np.flatnonzero(np.bincount(near) > _SINGLE * near.size)
    at = np.concatenate(parts)
    return SampleAndHold(at, _axis(axis, parts, period), int(common[0]), int(common[-1]))


def _likely(stored: Scaled, size: int) -> bool:
    """Whether the first place at which the signal moves looks held."""
    starts = np.linspace(0, max(size - _PIECE, 0), _PLACES).astype(np.int64)
    for start in np.unique(starts).tolist():
        steps = np.diff(_changes(stored, start, min(start + _PIECE, size)))
        if steps.size >= _FEWEST:
            return bool(np.count_nonzero(steps == 1) <= _SINGLE * steps.size)
    return False


def _all_changes(stored: Scaled, size: int) -> IntArray | None:
    """The places of all changes; None if too many follow each other."""
    parts, single, count = [], 0, 0
    for start in range(0, size, 16 * _PIECE):
        some = _changes(stored, max(start - 1, 0), min(start + 16 * _PIECE, size))
        single += int(np.count_nonzero(np.diff(some) == 1))
        count += some.size
        parts.append(some)
        if single > _SINGLE * max(count, _FEWEST):
            return None
    return np.concatenate(parts)


def _changes(stored: Scaled, start: int, stop: int) -> IntArray:
    """Places in [start, stop) of known values that differ from a known one before."""
    raw = stored.raw(start, stop)
    known = np.isfinite(raw) if stored.lost is None else raw != stored.lost
    changed: IntArray = np.flatnonzero((raw[1:] != raw[:-1]) & known[1:] & known[:-1])
    return start + 1 + changed


def _places(edges: IntArray, period: float) -> IntArray:
    """First samples of the values between `edges`, of which each stands for some `period`."""
    steps = np.diff(edges)
    values = np.maximum(np.rint(steps / period), 1.0).astype(np.int64)
    within = np.arange(int(values.sum())) - np.repeat(np.cumsum(values) - values, values)
    whole = np.repeat(steps, values) * within // np.repeat(values, values)
    return np.repeat(edges[:-1], values) + whole


def _axis(axis: TimeAxis, parts: list[IntArray], period: float) -> TimeAxis:
    """The times of the samples `parts`, one array for each segment of `axis`.

    Even ones, if they leave the line of one `period` [samples] by no more than a sample's rounding;
    a value was new up to a sample before it was first written.
    """
    parts = [part for part in parts if part.size]
    at = np.concatenate(parts)
    if axis.explicit is not None:
        return TimeAxis.of_times(axis.time()[at])
    longest = max(parts, key=lambda part: part.size)
    if np.ptp(longest - period * np.arange(longest.size)) > 0.0:
        period = float(np.polyfit(np.arange(longest.size), longest, 1)[0])
    off = [part - period * np.arange(part.size) for part in parts]
    if max(float(np.ptp(some)) for some in off) > _EVEN:
        return TimeAxis.of_times(axis.at(at.astype(float)))
    sizes = [part.size for part in parts]
    begin = np.array([float(some.mean()) for some in off])
    segment = np.searchsorted(axis.first, [int(part[0]) for part in parts], side="right") - 1
    start_s = axis.start_s[segment] + (begin - axis.first[segment]) * axis.period_s[segment]
    return TimeAxis(
        sum(sizes),
        axis.rate_Hz / period,
        np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64),
        start_s,
        axis.period_s[segment] * period,
    )
