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

import io
import os
import tempfile
import weakref
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from tirelog.data.recording import Channel, Conditions, Recording, Scaled, Stack
from tirelog.errors import OutputError, UsageError
from tirelog.inference.stacks.align import (
    PassageAngle,
    Samples,
    by_bin,
    refine_passages,
    step_of,
    turned,
)
from tirelog.inference.stacks.hum import Line, lines_said, without_hum
from tirelog.inference.stacks.manoeuvres import (
    SHORTEST,
    accelerations,
    bends,
    conditions_of,
    regimes,
    scalar_stack,
    segment,
)
from tirelog.process_pool import shared_out
from tirelog.runs.in_memory import readable_apart, without_spikes
from tirelog.strain.passages.find import (
    Passages,
    refuse_swapped_surface,
    trusted_passages,
)
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.observables import OBSERVABLES, SCALARS, STRAIN
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2
from tirelog.wheel.pulses import patch_sign

# ---- The stacks of several logs, numbered through.
#
# In memory while they are few, then in a temporary file, one at a time in memory again.
#
#     stretches of a log (`cut.stretches_of`, at most some MB each) --add--> Stacks
#         --one at a time--> Stack, equal to the bit
#
# A usual log is one stack. A long one is several, one after the other, cut between manoeuvres if
# these are short enough; a manoeuvre that had to be cut keeps its number. What has a value
# per revolution stays in memory, the waveforms (32 bytes per bin) are put aside.


#: bytes of waveforms that are kept in memory
IN_MEMORY = 3 << 23
_WAVEFORMS = ("values", "phi_mean", "phi_variance", "count")
_NUMBERS = ("noise", "log", "manoeuvre", "revolution", "regime")


class Stacks(Sequence[Stack]):
    """Stacks on the same angles.

    `logs` names all logs, and each stack's `log` and `manoeuvre` count through them.

    `notes`: sentences on what was set apart of them.
    """

    def __init__(self, in_memory: int | None = None) -> None:
        self.logs: tuple[str, ...] = ()
        self.notes: tuple[str, ...] = ()
        self._stacks: list[Stack] = []  # without their waveforms, which are in the file
        self._places: list[tuple[int, int]] = []  # from where to where in it
        most = IN_MEMORY if in_memory is None else in_memory
        self._file = tempfile.SpooledTemporaryFile(max(most, 1), prefix="tirelog-")  # noqa: SIM115
        weakref.finalize(self, self._file.close)

    def add(self, log: str, stretches: Iterable[Stack]) -> None:
        """One more log.

        OutputError: the folder for temporary files is full or cannot be written.
        """
        first = 1 + max((int(stack.manoeuvre.max()) for stack in self._stacks), default=-1)
        for stretch in stretches:
            if len(stretch):
                number = np.full(len(stretch), len(self.logs))
                self._keep(replace(stretch, log=number, manoeuvre=stretch.manoeuvre + first))
        self.logs = (*self.logs, log)

    def note(self, *sentences: str) -> None:
        """Sentences that whoever reads a result of these stacks must see, each once."""
        self.notes = tuple(dict.fromkeys((*self.notes, *sentences)))

    def place(self, angle_rad: float) -> None:
        """They are those of one of several gratings, at this angle on the wheel [rad]."""
        self._stacks = [replace(stack, place_rad=angle_rad) for stack in self._stacks]

    def outlines(self) -> list[Stack]:
        """The stacks without their waveforms."""
        return list(self._stacks)

    def __len__(self) -> int:
        return len(self._stacks)

    def __getitem__(self, index: Any) -> Any:
        """The stack of a number, with its waveforms; of a slice there is none."""
        first, stop = self._places[index]
        if self._file.name is None or not hasattr(os, "pread"):  # in memory, or on Windows
            self._file.seek(first)
            content = self._file.read(stop - first)
        else:  # without the file's own place: processes may read side by side
            content = os.pread(self._file.fileno(), stop - first, first)
        data = io.BytesIO(content)
        waveforms: dict[str, Any] = {name: np.load(data, allow_pickle=False) for name in _WAVEFORMS}
        return replace(self._stacks[index], logs=self.logs, **waveforms)

    def _keep(self, stack: Stack) -> None:
        """A stack as the last one, its waveforms at the end of the file."""
        try:
            place = self._file.seek(0, 2)
            for name in _WAVEFORMS:
                np.save(self._file, getattr(stack, name), allow_pickle=False)
            self._file.flush()
        except OSError as problem:
            size = sum(int(getattr(stack, name).nbytes) for name in _WAVEFORMS)
            raise OutputError(
                f"the revolutions of long logs cannot be put aside ({problem.strerror or problem})",
                allowed="the folder for temporary files has to hold them, "
                f"{size / len(stack) / 1000.0:.0f} kB each",
                do="make room or set TMPDIR to another folder",
                file=tempfile.tempdir or os.environ.get("TMPDIR"),
            ) from problem
        self._places.append((place, self._file.tell()))
        empty: Any = np.empty((len(stack), 0))
        self._stacks.append(replace(stack, **dict.fromkeys(_WAVEFORMS, empty)))


def outlines(stacks: Sequence[Stack]) -> Sequence[Stack]:
    """The stacks; of those in a file what has a value per revolution, nothing is read."""
    return stacks.outlines() if isinstance(stacks, Stacks) else stacks


def joined(stacks: Iterable[Stack]) -> Stack:
    """Several stacks on the same angles as one."""
    parts = list(stacks)
    if len(parts) == 1:
        return parts[0]
    rows: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in (*_WAVEFORMS, *_NUMBERS)
    }
    return replace(
        parts[0], conditions=Conditions.concatenate([part.conditions for part in parts]), **rows
    )


# ---- What an accelerometer's channel must be to be held against a model.
#
# Outward positive, and with its mean level.
#
#     Channel --`outward`--> Channel whose patch is a maximum, and a sentence if it had to be
#                            turned round
#     Stack, Stack, ... --`with_level`--> the same; UsageError if the level outside the patch is
#                                         none of a turning sensor
#
# A model predicts -v^2 / R outside the patch and about nothing in it (errata). Which way a sensor
# is
# glued in shows in the log; a level that was taken out (AC coupling, a piezo element, a mean
# removed)
# cannot be put back.


#: level outside the patch over -v^2 / R: radii and gains are known to 10 %.  Twice as wide would
#: let a level of half the size pass
LEVEL_OFF = 0.3


def outward(channel: Channel) -> tuple[Channel, str]:
    """The channel with outward positive, and '' or what was done.

    Other kinds of channel come back as they are.
    """
    if channel.kind != "radial_acceleration" or patch_sign(channel) > 0.0:
        return channel, ""
    stored = channel.samples
    turned = replace(channel, samples=lambda start, stop: -stored(start, stop), stored=None)
    if isinstance(stored, Scaled):
        samples = replace(stored, scale=-stored.scale, offset=-stored.offset)
        turned = replace(turned, samples=samples)
    return (
        turned,
        f"{channel.name} was recorded inward positive (a minimum in the patch); "
        "its sign was turned",
    )


def with_level(stretches: Iterable[Stack], log: str) -> Iterator[Stack]:
    """The stacks of one log as they come.

    UsageError: the median level of an acceleration outside the patch is not about -v^2 / R.
    """
    for stack in stretches:
        if stack.observable == "radial_acceleration":
            turning = stack.conditions.speed_m_s**2 / stack.radius_m
            full = np.isfinite(stack.values).any(axis=1, keepdims=True)
            with np.errstate(invalid="ignore"):
                level = np.nanmedian(np.where(full, stack.values, 0.0), axis=1)
            usual, off = float(np.median(turning)), float(np.median(level + turning))
            # and how far off it may be whatever the speed [m/s^2], for a sensor's own zero; twice
            # as much would hide 4 g, all of it at 4 m/s
            if abs(off) > max(LEVEL_OFF * usual, (2.0 * STANDARD_GRAVITY_M_S2)):
                raise UsageError(
                    f"channel {stack.channel} reads {off - usual:.4g} m/s^2 outside the patch "
                    f"(median) and a turning sensor reads -v^2/R = {-usual:.4g} m/s^2",
                    allowed=f"allowed is {100 * LEVEL_OFF:g} % off: the mean level was removed "
                    "(AC coupling, a piezo element), or the unit is wrong",
                    do="mend unit, scale or offset, or give the model coupling_Hz, the sensor's "
                    "high-pass",
                    file=log,
                )
        yield stack


#: bins of the angle over a revolution; twice as many need twice the samples per revolution to be
#: filled
ANGLES = 256
#: revolutions that are in memory at a time, 8 kB each
STRETCH = 1024
#: whole revolutions of a log: their scatter separates what repeats from what does not, which six
#: tell to 30 %.  Twelve would tell it to 20 % and refuse a recording of a second
FEWEST = 6


#: one unbroken run: the ordinals in the log of its passages (k,), and the wheel's angle through
#: them; its k - 2 whole revolutions are the turns 1 ... k - 2
Run = tuple[NDArray[np.int64], PassageAngle]


def observe_channel(recording: Recording, observable: str, name: str | None = None) -> Channel:
    """The channel of the recording that measures the observable: the named one, or the first.

    UsageError: there is none.
    """
    kinds, channels = OBSERVABLES[observable].kinds, recording.channels
    found = [c for c in recording.of_kind(*kinds) if name in (None, c.name)]
    if not found:
        have = ", ".join(f"{c.name} ({c.kind})" for c in channels.values()) or "none"
        wanted = name or f"of the observable {observable} ({' or '.join(kinds)})"
        other = f"channel {name} is of another kind than {observable} ({' or '.join(kinds)})"
        raise UsageError(
            other if name in channels else f"no channel {wanted}",
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
) -> Stacks:
    """The stacks of the recordings, manoeuvres numbered through all.  UsageError: see `add_log`."""
    stacks = Stacks()
    for recording in recordings:
        add_log(stacks, recording, observable, channel, angles=angles, most=most)
    return stacks


def add_log(
    stacks: Stacks,
    recording: Recording,
    observable: str,
    channel: str | None = None,
    *,
    angles: int = ANGLES,
    most: int = STRETCH,
    level: bool = True,
) -> None:
    """Adds the revolutions of a recording to the stacks, at most `most` of them in one.

    UsageError if it holds fewer than FEWEST whole revolutions, or an acceleration without its mean
    level, unless it needs no `level`.
    """
    source = observe_channel(recording, observable, channel)
    others = [c.name for c in recording.of_kind(source.kind) if c.name != source.name]
    if channel is None and others:
        stacks.note(
            f"{source.name} is one of {1 + len(others)} channels of {observable}; left out: "
            f"{', '.join(others)} (--channel NAME takes another one"
            f"{', --channel all fits them together' if observable == STRAIN else ''})"
        )
    heard: list[Line] = []
    if observable in SCALARS:
        stack, said = scalar_stack(recording, source, observable)
        stacks.add(recording.log, [stack])
    else:
        source, said = outward(source)
        stretches = stretches_of(recording, source, observable, heard, angles=angles, most=most)
        stacks.add(recording.log, with_level(stretches, recording.log) if level else stretches)
    hum = f"{source.name}: {lines_said(heard, observable)}" if heard else ""
    stacks.note(*(f"{recording.log}: {note}" for note in (hum, said) if note))


def stretches_of(
    recording: Recording,
    channel: Channel,
    observable: str,
    heard: list[Line],
    *,
    angles: int = ANGLES,
    most: int = STRETCH,
) -> Iterator[Stack]:
    """The stacks of one channel of one recording, at most `most` revolutions each.

    Manoeuvres and conditions are those of the whole log. Hum of the supply is taken out; its lines
    are added to what was `heard`.
    """
    radius = recording.setup.tire.radius_m
    channel = without_spikes(channel)
    passages = trusted_passages(recording, channel)
    samples = Samples(channel)
    runs = list(_runs(passages, samples))
    n = sum(ordinal.size - 2 for ordinal, _ in runs)
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

    def stretch(number: int) -> tuple[Stack, list[Line]]:
        rows = cuts[number]
        stack = replace(course.take(rows), **_waveforms(samples, runs, rows, angles))
        values, lines = without_hum(stack, _times(runs, rows, stack.phi_mean))
        return replace(stack, values=values), lines

    for stack, lines in shared_out(len(cuts), stretch, readable_apart(channel)):
        heard += lines
        yield stack


def _course(
    recording: Recording,
    channel: Channel,
    observable: str,
    runs: Sequence[Run],
    noise: float,
    angles: int,
) -> Stack:
    """The stack of all revolutions of a log, its waveforms still without a bin.

    It holds what a revolution has one value of.
    """
    radius = recording.setup.tire.radius_m
    times = [angle.centre_s[1:-1] for _, angle in runs]
    speeds = [angle.speed_rad_s(angle.centre_s[1:-1]) for _, angle in runs]
    acceleration = np.concatenate(
        [accelerations(time, speed * radius) for time, speed in zip(times, speeds, strict=True)]
    )
    breaks = np.concatenate([np.arange(time.size) == 0 for time in times])
    centre, speed = np.concatenate(times), np.concatenate(speeds)
    conditions = conditions_of(recording, centre, speed * radius, acceleration)
    breaks |= bends(conditions.lateral_acceleration_m_s2)
    manoeuvre, regime = segment(regimes(acceleration), breaks)
    n = centre.size
    none = np.empty((n, 0))
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
        conditions=conditions,
        log=np.zeros(n, np.int64),
        manoeuvre=manoeuvre,
        revolution=np.concatenate([ordinal[1:-1] for ordinal, _ in runs]),
        regime=regime,
        logs=(recording.log,),
        step=step_of(channel),
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


def _runs(passages: Passages, samples: Samples) -> Iterator[Run]:
    """Unbroken runs of passages one turn apart, refined by the matched filter."""
    known = np.flatnonzero(np.isfinite(passages.time_s))
    cut = np.flatnonzero(~(passages.turn_after[known[:-1]] & (np.diff(known) == 1))) + 1
    for index in np.split(known, cut):
        # passages that an unbroken run has at least: three whole revolutions; twice as many leave
        # out unbroken runs of up to seven
        if index.size >= 5:
            refined = refine_passages(samples, passages.time_s[index])
            yield index, PassageAngle.through(refined)


def _of_runs(runs: Sequence[Run], rows: slice) -> Iterator[tuple[PassageAngle, int, int, int]]:
    """Of the revolutions `rows` of a log those of each run.

    Items: the run's angle, their first turn, the turn after their last, and the number of a turn
    minus that of its row.
    """
    before = 0
    for ordinal, angle in runs:
        turns = ordinal.size - 2
        first, stop = max(rows.start - before, 0), min(rows.stop - before, turns)
        if first < stop:
            yield angle, first + 1, stop + 1, rows.start + 1 - before
        before += turns


def _waveforms(samples: Samples, runs: Sequence[Run], rows: slice, m: int) -> dict[str, Any]:
    """Bin means, mean angles, variances and counts (k, m) of the k revolutions `rows` of a log."""
    k = rows.stop - rows.start
    count, (mean, phi, variance) = np.zeros((k, m), np.int64), np.zeros((3, k, m))
    for angle, first, stop, more in _of_runs(runs, rows):
        for chunk in samples.chunks(angle.centre_s, first, stop):
            here = slice(chunk[0].start - more, chunk[0].stop - more)
            bins = (count[here], mean[here], phi[here], variance[here])
            by_bin(*turned(samples, angle, chunk), *bins)
    return {"values": mean, "phi_mean": phi, "phi_variance": variance, "count": count}


def _times(runs: Sequence[Run], rows: slice, phi: FloatArray) -> FloatArray:
    """The times [s] of angles phi (k, m) of the k revolutions `rows` of a log."""
    return np.concatenate(
        [
            angle.time_s(
                2.0 * np.pi * np.arange(first, stop)[:, None] + phi[first - more : stop - more]
            )
            for angle, first, stop, more in _of_runs(runs, rows)
        ]
    )


# ---- Where gratings stand on the wheel: by the setup, or by the delay between their passages.
#
#     passages of the first grating -> theta(t), a spline through whole turns
#     passages of another at times t -> theta(t) modulo a turn: by so much it is behind the
#     first
#
# Both pass the same patch, so that wind-up and whatever moves the patch's centre cancel.


def places_of(
    gratings: Mapping[str, Stacks], given: Mapping[str, float]
) -> tuple[tuple[float, ...], list[str]]:
    """The angle of each grating on the wheel [rad], and sentences on where each comes from.

    gratings    by name, the first one first; `given`: the angles [rad] that setups tell
    UsageError  neither the setup, which goes before the passages, nor these tell one
    """
    (name, first), *others = gratings.items()
    behind = {other: _angle_behind(stacks, first) for other, stacks in others}
    zero = given.get(name, 0.0)
    known = [other for other, one in behind.items() if other in given and np.isfinite(one[0])]
    if name not in given and known:
        zero = given[known[0]] - behind[known[0]][0]
    angles, said = [zero], []
    for other, (angle, error, passages) in behind.items():
        told = (
            f"{np.degrees(angle):.2f} ± {max(np.degrees(error), 0.01):.2f} degrees behind "
            f"{name} by {passages} passages"
        )
        if other in given:
            angles.append(given[other])
            off = np.degrees(np.angle(np.exp(1j * (given[other] - zero - angle))))
            # a setup and passages that differ by more [deg] contradict each other: passages tell
            # 0.1 degrees, a tape on the belt some millimetres, which are one; half as much would
            # doubt honest tapes
            if np.isfinite(off) and abs(off) > 3.0:
                place = np.degrees((given[other] - zero) % (2.0 * np.pi))
                said.append(
                    f"{other} is {told}, by the setup's angle_deg {place:.1f}; the setup's value "
                    "is used: mend it if the channels have one clock"
                )
        elif np.isfinite(angle):
            angles.append(zero + angle)
            said.append(f"{other} is {told}; give angle_deg in the setup if you know better")
        else:
            raise UsageError(
                f"no passage shows the angle of {other} on the wheel",
                allowed="its passages between those of the first grating tell it, or the setup",
                do=f"give angle_deg in [channels.{other}]",
            )
    return tuple(angles), said


def _angle_behind(own: Stacks, first: Stacks) -> tuple[float, float, int]:
    """Angle of a grating behind the first [rad], its standard error, passages that tell it."""
    logs = range(len(first.logs))
    of_logs = [_behind(_passages(own, k), _passages(first, k)) for k in logs]
    angles = np.concatenate([np.zeros(0), *of_logs])
    if angles.size < 2:
        return np.nan, np.nan, angles.size
    middle = float(np.angle(np.exp(1j * angles).mean()))
    off = np.angle(np.exp(1j * (angles - middle)))
    middle += float(np.median(off))
    spread = 1.4826 * float(np.median(np.abs(off - np.median(off))))
    return middle % (2.0 * np.pi), 1.2533 * spread / np.sqrt(angles.size), angles.size


def _passages(stacks: Stacks, number: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(times [s], angular speeds [rad/s], ordinals) of the passages of one log."""
    parts = [s for s in stacks.outlines() if s.log.size and s.log[0] == number]
    if not parts:
        return np.zeros(0), np.zeros(0), np.zeros(0)
    own = joined(parts)
    time, order = own.conditions.time_s, np.argsort(own.conditions.time_s)
    return (
        time[order],
        own.conditions.speed_m_s[order] / own.radius_m,
        own.revolution[order].astype(np.float64),
    )


def _behind(
    own: tuple[FloatArray, FloatArray, FloatArray], first: tuple[FloatArray, FloatArray, FloatArray]
) -> FloatArray:
    """Angle of the wheel at each passage of a grating since the first one's, [rad], (k,)."""
    time, spin, ordinal = first
    if time.size < SHORTEST:
        return np.zeros(0)
    step = np.diff(time)
    # a time between two passages that is farther than this share off what the speed says is no
    # turn; twice as much would take a turn and a half for one
    turn = (np.diff(ordinal) == 1) & (
        np.abs(step * 0.5 * (spin[1:] + spin[:-1]) / (2.0 * np.pi) - 1.0) < 0.3
    )
    found = []
    for run in np.split(np.arange(time.size), np.flatnonzero(~turn) + 1):
        if run.size < SHORTEST:
            continue
        within = own[0][(own[0] >= time[run[0]]) & (own[0] <= time[run[-1]])]
        course = CubicSpline(time[run], 2.0 * np.pi * np.arange(run.size))
        found.append(np.asarray(course(within)) % (2.0 * np.pi))
    return np.concatenate([np.zeros(0), *found])
