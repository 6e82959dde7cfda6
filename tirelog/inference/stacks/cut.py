"""Recordings to stacks.

One channel cut into revolutions and laid on one grid of angle bins, raw, with what each was driven
under.

    Recording --trusted_passages--> passage times --`align.refine_passages`--> theta(t)
        (all revolutions of the log, small arrays)
        --speeds, accelerations, manoeuvres, conditions--> stretches of some 1000 revolutions
        --bins--> Stack (n, m) each
    several Recordings --> `Stacks`

The log is in memory as counts at most (`runs.in_memory`); its times, angles and waveforms are there
for a chunk or a stretch at a time.

Bin means are raw (no amplitude, shift or baseline is taken out here: `cells` does that and keeps
account of it), at the angles the samples really have. The first and last revolution of an unbroken
run of passages are left out, since half of their angle is extrapolated.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.apart import shared_out, shares
from tirelog.data.recording import Channel, Recording, Stack
from tirelog.errors import UsageError
from tirelog.inference.stacks.align import PassageAngle, refine_passages, turned
from tirelog.inference.stacks.conditions import conditions_of
from tirelog.inference.stacks.hum import Line, lines_said, without_hum
from tirelog.inference.stacks.manoeuvres import accelerations, regimes, segment
from tirelog.inference.stacks.numbers import scalar_stack
from tirelog.inference.stacks.outward import outward, with_level
from tirelog.inference.stacks.samples import Samples, TurnChunk, step_of
from tirelog.inference.stacks.spooled import Stacks
from tirelog.inference.stacks.turn_kernels import by_bin
from tirelog.runs.bursts import mended
from tirelog.runs.in_memory import readable_apart
from tirelog.strain.passages.find import Passages
from tirelog.strain.passages.surface import refuse_swapped_surface, trusted_passages
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import OBSERVABLES, SCALARS, STRAIN

#: bins of the angle over a revolution; twice as many need twice the samples per revolution to be
#: filled
ANGLES = 256
#: revolutions that are in memory at a time, 8 kB each
STRETCH = 1024
#: whole revolutions of a log: what repeats is told from what does not by their scatter, which six
#: tell to 30 %.  Twelve would tell it to 20 % and refuse a recording of a second
FEWEST = 6
#: passages that an unbroken run has at least: three whole revolutions; twice as many leave out
#: unbroken runs of up to seven
_SHORTEST_RUN = 5


@dataclass(frozen=True)
class Turns:
    """The revolutions of one unbroken run.

    Ordinal of each passage in the log (k,), refined times (k,) and the angle between them. Its k -
    2 whole revolutions are the turns 1 ... k - 2.
    """

    ordinal: NDArray[np.int64]
    angle: PassageAngle

    def __len__(self) -> int:
        return int(self.ordinal.size) - 2


def observe_channel(recording: Recording, observable: str, name: str | None = None) -> Channel:
    """The channel of the recording that measures the observable: the named one, or the first.

    UsageError: there is none.
    """
    known = OBSERVABLES.get(observable)
    kinds = (observable,) if known is None else known.kinds
    found = recording.of_kind(*kinds)
    if name is not None and name in recording.channels:
        channel = recording.channels[name]
        if channel.kind in kinds:
            return channel
        fits = ", ".join(c.name for c in found) or "none of this log"
        raise UsageError(
            f"channel {name} is of the kind {channel.kind}, the model predicts {observable}",
            allowed=f"channels of the kind {' or '.join(kinds)} are allowed: {fits}",
            do=f"name one of them, or take a model for {channel.kind}",
            file=recording.log,
        )
    if name is not None or not found:
        have = ", ".join(f"{c.name} ({c.kind})" for c in recording.channels.values()) or "none"
        wanted = name or f"of the observable {observable} ({' or '.join(kinds)})"
        raise UsageError(
            f"no channel {wanted}",
            allowed=f"the log has {have}",
            do="take a model for what is measured, or another log",
            file=recording.log,
        )
    return found[0]


def stacks_from_logs(
    recordings: Iterable[Recording],
    observable: str = "strain",
    channel: str | None = None,
    *,
    angles: int = ANGLES,
    most: int = STRETCH,
    level: bool = True,
) -> Stacks:
    """The stacks of the recordings, manoeuvres numbered through all.

    One each, or several if there are more than `most` revolutions. UsageError if a log holds fewer
    than FEWEST whole revolutions, or an acceleration without its mean level, unless it needs
    no `level`.
    """
    stacks = Stacks()
    for recording in recordings:
        source = observe_channel(recording, observable, channel)
        others = [c.name for c in recording.of_kind(source.kind) if c.name != source.name]
        if channel is None and others:
            stacks.note(
                f"{source.name} is one of {1 + len(others)} channels of {observable}; left out: "
                f"{', '.join(others)} (--channel NAME takes another one"
                f"{', --channel all fits them together' if observable == STRAIN else ''})"
            )
        if observable in SCALARS:
            stack, said = scalar_stack(recording, source, observable)
            stacks.add(recording.log, [stack])
        else:
            source, said = outward(source)
            heard: list[Line] = []
            stretches = stretches_of(
                recording, source, observable, angles=angles, most=most, heard=heard
            )
            stacks.add(recording.log, with_level(stretches, recording.log) if level else stretches)
            if heard:
                stacks.note(f"{recording.log}: {source.name}: {lines_said(heard, observable)}")
        if said:
            stacks.note(f"{recording.log}: {said}")
    return stacks


def stretches_of(
    recording: Recording,
    channel: Channel,
    observable: str,
    *,
    angles: int = ANGLES,
    most: int = STRETCH,
    heard: list[Line] | None = None,
) -> Iterator[Stack]:
    """The stacks of one channel of one recording, at most `most` revolutions each.

    Manoeuvres and conditions are those of the whole log. Hum of the supply is taken out; its lines
    are added to what was `heard`.
    """
    radius = recording.setup.tire.radius_m
    channel = mended(channel)
    passages = trusted_passages(recording, channel)
    samples = Samples(channel)
    runs = list(_runs(passages, samples))
    n = sum(len(run) for run in runs)
    if n < FEWEST:
        refuse_swapped_surface(recording, channel, radius)
        seen = int(np.isfinite(passages.time_s).sum())
        raise UsageError(
            f"{seen} passage{'' if seen == 1 else 's'} in channel {channel.name}"
            + (f", {n} usable revolutions among them" if seen >= FEWEST + 2 else ""),
            allowed=f"at least {FEWEST + 2} in a row are needed to see what repeats",
            do="give a longer log",
            file=recording.log,
        )
    course = _course(recording, channel, observable, runs, passages.noise, angles)
    cuts = list(_cuts(course.manoeuvre, most))

    def raw(number: int) -> Stack:
        rows = cuts[number]
        return replace(course.take(rows), **_waveforms(samples, runs, rows, angles))

    def cleared(number: int, stack: Stack) -> tuple[FloatArray, list[Line]]:
        return without_hum(stack, _times(runs, cuts[number], stack.phi_mean))

    def without_values(number: int) -> tuple[FloatArray | None, list[Line]]:
        values, lines = cleared(number, raw(number))
        return (values if lines else None), lines

    # hum takes most of the time, and is seldom there: bins made here too are sooner at hand than
    # those of another process, 8 MB a stretch
    elsewhere = (
        shared_out(len(cuts), without_values)
        if readable_apart(channel) and shares(len(cuts))
        else None
    )
    for number in range(len(cuts)):
        stack = raw(number)
        values, lines = cleared(number, stack) if elsewhere is None else next(elsewhere)
        if heard is not None:
            heard += lines
        yield stack if values is None else replace(stack, values=values)


def _course(
    recording: Recording,
    channel: Channel,
    observable: str,
    runs: Sequence[Turns],
    noise: float,
    angles: int,
) -> Stack:
    """The stack of all revolutions of a log, its waveforms still without a bin.

    It holds what a revolution has one value of.
    """
    radius = recording.setup.tire.radius_m
    times = [run.angle.centre_s[1:-1] for run in runs]
    speeds = [run.angle.speed_rad_s(time) for run, time in zip(runs, times, strict=True)]
    acceleration = np.concatenate(
        [accelerations(time, speed * radius) for time, speed in zip(times, speeds, strict=True)]
    )
    breaks = np.concatenate([np.r_[True, np.zeros(len(run) - 1, bool)] for run in runs])
    manoeuvre, regime = segment(regimes(acceleration), breaks)
    centre, speed = np.concatenate(times), np.concatenate(speeds)
    n = centre.size
    none = np.empty((n, 0))
    step, step_from = step_of(channel)
    return Stack(
        observable=observable,
        channel=channel.name,
        surface=channel.surface,
        radius_m=radius,
        values=none,
        phi_rad=np.asarray(
            (np.arange(angles) + 0.5) * (2.0 * np.pi / angles) - np.pi, dtype=np.float64
        ),
        phi_mean=none,
        phi_variance=none,
        count=np.empty((n, 0), np.int64),
        noise=np.full(n, noise),
        conditions=conditions_of(recording, centre, speed * radius, acceleration),
        log=np.zeros(n, np.int64),
        manoeuvre=manoeuvre,
        revolution=np.concatenate([run.ordinal[1:-1] for run in runs]),
        regime=regime,
        logs=(recording.log,),
        step=step,
        step_from=step_from,
    )


def _cuts(manoeuvre: NDArray[np.int64], most: int) -> Iterator[slice]:
    """The stretches of a log, at most `most` revolutions each.

    The log is cut where a manoeuvre begins, and within one only if it is longer than half of that;
    then no part of it is shorter than a quarter.
    """
    starts = np.flatnonzero(np.diff(manoeuvre)) + 1
    low, n = 0, manoeuvre.size
    while n - low > most:
        last = int(np.searchsorted(starts, low + most, side="right")) - 1
        high = (
            int(starts[last])
            if last >= 0 and starts[last] > low + most // 2
            else low + 3 * most // 4
        )
        yield slice(low, high)
        low = high
    yield slice(low, n)


def _runs(passages: Passages, samples: Samples) -> Iterator[Turns]:
    """Unbroken runs of passages one turn apart, refined by the matched filter."""
    known = np.flatnonzero(np.isfinite(passages.time_s))
    cut = np.flatnonzero(~(passages.turn_after[known[:-1]] & (np.diff(known) == 1))) + 1
    for index in np.split(known, cut):
        if index.size >= _SHORTEST_RUN:
            yield Turns(
                index, PassageAngle.through(refine_passages(samples, passages.time_s[index]))
            )


def _waveforms(samples: Samples, runs: Sequence[Turns], rows: slice, m: int) -> dict[str, Any]:
    """Bin means, mean angles, variances and counts (k, m) of the k revolutions `rows` of a log."""
    k = rows.stop - rows.start
    values, phi_mean, phi_variance = np.empty((k, m)), np.empty((k, m)), np.empty((k, m))
    count = np.empty((k, m), np.int64)
    before = 0
    for run in runs:
        first, stop = max(rows.start - before, 0), min(rows.stop - before, len(run))
        for chunk in (
            samples.chunks(run.angle.centre_s, first + 1, stop + 1) if first < stop else ()
        ):
            low = before + chunk.first - 1 - rows.start
            here = slice(low, low + chunk.stop - chunk.first)
            values[here], phi_mean[here], phi_variance[here], count[here] = _binned(
                samples, run.angle, chunk, m
            )
        before += len(run)
    return {"values": values, "phi_mean": phi_mean, "phi_variance": phi_variance, "count": count}


def _times(runs: Sequence[Turns], rows: slice, phi: FloatArray) -> FloatArray:
    """The times [s] of angles phi (k, m) of the k revolutions `rows` of a log."""
    times, before = [], 0
    for run in runs:
        first, stop = max(rows.start - before, 0), min(rows.stop - before, len(run))
        if first < stop:
            here = slice(before + first - rows.start, before + stop - rows.start)
            turn = 2.0 * np.pi * np.arange(first + 1, stop + 1)
            times.append(run.angle.time_s(turn[:, None] + phi[here]))
        before += len(run)
    return np.concatenate(times)


def _binned(
    samples: Samples, angle: PassageAngle, chunk: TurnChunk, m: int
) -> tuple[NDArray[Any], ...]:
    """The same of the turns of a chunk."""
    turn, phi, y = turned(samples, angle, chunk)
    n = chunk.stop - chunk.first
    count, (mean, mean_angle, variance) = np.zeros((n, m), np.int64), np.zeros((3, n, m))
    by_bin(turn, phi, y, count, mean, mean_angle, variance)
    return mean, mean_angle, variance, count
