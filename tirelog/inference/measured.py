"""The one door from logs to measured revolutions.

For fit, compare, diagnose, ladder, report and campaign.

    recordings --stacks_from_logs--> revolutions of all logs
        --obstacles of logs with a [road] found--> MeasuredLogs: the revolutions off them, and the
                                                   obstacles beside

`measured_pieces` makes of it the means of similar revolutions that every question is asked of,
under one limit of memory. What was set apart, taken together or left out on the way is in
`notes`, and goes with the revolutions into every answer.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import uniform_filter1d

from tirelog.data.recording import Channel, Conditions, Recording, Stack
from tirelog.data.setup import RoadSetup
from tirelog.errors import UsageError, nearest
from tirelog.inference.shared_samples import once_each
from tirelog.inference.stacks.align import PassageAngle, split_turns, template
from tirelog.inference.stacks.cut import (
    STRETCH,
    Stacks,
    add_log,
    joined,
    outlines,
    outward,
    places_of,
    stretches_of,
)
from tirelog.physics.carcass.numbers import MOTION
from tirelog.physics.model.model import Model
from tirelog.tables.writer import document, table
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import STRAIN_KINDS
from tirelog.vocabulary.observables import (
    OBSERVABLES,
    STRAIN,
    WAVEFORMS,
    together,
    waveform_of,
)
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2

# ---- A log that met an obstacle: what repeats in it, and where something else happened.
#
#     Recording with a [road] + Stack
#         --`transient_log`--> TransientLog: samples, steady waveform T(phi), rough times of hits
#     Stack --`steady_revolutions`--> the revolutions off the obstacle, for the steady comparison
#
# An obstacle shows as samples that leave T(phi) by far more than the steady revolutions do. Times
# of hits are rough here, within a revolution; `diagnosis.obstacles` refines them with the model's
# answer. Passages that an obstacle disturbs do not tell the wheel's angle: it is drawn smoothly
# through those before and after.


#: A hit is compared for this long [s] after the obstacle was reached. Twice as long takes more
#: revolutions after each hit from the steady ones.
WINDOW_S = 0.5
#: A hit closer than this [s] to an end of the log cannot be compared. Twice as much passes over
#: hits that are as near to an end.
_ROOM_S = 0.1
#: Turns before and after a hit whose passages may be disturbed. Twice as far leaves fewer passages
#: to know the wheel's angle by.
DISTURBED = (-0.3, 1.2)
#: Steady revolutions that are needed to know what repeats. Twice as many refuse logs with fewer
#: than ten beside the obstacles.
_FEWEST_STEADY = 5


@dataclass(frozen=True)
class TransientLog:
    """One channel of one log around its obstacles.

    time_s, values  (N,) samples that are there
    passages_s      (k,), turns (k,) their numbers, and wheel: theta(t) through those that no
                    obstacle disturbs
    steady          T(phi), of the observable (for an acceleration less gravity, over (Omega /
                    Omega_0)^2, Omega_0 `spin_rad_s`)
    calm            (N,) True where no obstacle disturbs; hits_s rough times, (h,)
    """

    log: str
    channel: str
    surface: str
    observable: str
    radius_m: float
    road: RoadSetup
    folder: str
    conditions: Conditions
    time_s: FloatArray
    values: FloatArray
    passages_s: FloatArray
    turns: FloatArray
    wheel: PassageAngle
    steady: CubicSpline
    spin_rad_s: float
    calm: NDArray[np.bool_]
    hits_s: FloatArray
    rate_Hz: float

    def off(self) -> FloatArray:
        """Samples less the steady waveform at the angle of the passages, (N,)."""
        return self.values - self.steady_at(
            self.wheel.theta(self.time_s), self.wheel.speed_rad_s(self.time_s)
        )

    def steady_at(self, theta_rad: FloatArray, spin_rad_s: FloatArray) -> FloatArray:
        """T at wheel angles (m,) and spins (m,)."""
        phi = split_turns(theta_rad)[1]
        wave: FloatArray = self.steady(phi)
        return (
            wave * (spin_rad_s / self.spin_rad_s) ** 2 + _gravity(phi)
            if self.observable == "radial_acceleration"
            else wave
        )


def _gravity(phi_rad: FloatArray) -> FloatArray:
    """What of an accelerometer's reading does not follow the spin, (m,)."""
    return -STANDARD_GRAVITY_M_S2 * np.cos(phi_rad)


def transient_log(recording: Recording, channel: Channel, stack: Stack) -> TransientLog:
    """The log around its obstacles.

    UsageError if fewer than five steady revolutions, or no obstacle, are in it.

    stack  the channel's own revolutions of this log
    """
    time_s, values = channel.axis.time(), channel.read()
    good = np.isfinite(values)
    time_s, values = time_s[good], values[good]
    passages, turns = _numbered(stack)
    wheel = PassageAngle.through(passages, turns)
    inside = (time_s >= wheel.centre_s[0]) & (time_s <= wheel.centre_s[-1])
    time_s, values = time_s[inside], values[inside]
    spin = float(np.median(stack.conditions.speed_m_s)) / stack.radius_m
    made = TransientLog(
        log=recording.log,
        channel=channel.name,
        surface=channel.surface,
        observable=stack.observable,
        radius_m=stack.radius_m,
        road=recording.setup.road,
        folder=recording.setup.file or "",
        conditions=stack.conditions,
        time_s=time_s,
        values=values,
        passages_s=passages,
        turns=turns,
        wheel=wheel,
        steady=CubicSpline([0.0, 1.0], [0.0, 0.0]),
        spin_rad_s=spin,
        calm=np.ones(time_s.size, bool),
        hits_s=np.zeros(0),
        rate_Hz=channel.axis.rate_Hz,
    )
    made = _with_steady(made)
    for _ in range(2):  # the first steady waveform still holds the obstacles
        made = _with_steady(_calmed(made, _hits(made)))
    return made


def _numbered(stack: Stack) -> tuple[FloatArray, FloatArray]:
    """Times and numbers of passages, (k,) each.

    They go through stretches where an obstacle hid some: their number follows from the speed. If
    that is not plain (the wheel stood, or a long gap) the longest stretch is taken.
    """
    time = stack.conditions.time_s
    rate = stack.conditions.speed_m_s / (2.0 * np.pi * stack.radius_m)
    passed = np.diff(time) * 0.5 * (rate[1:] + rate[:-1])
    # revolutions without a passage are counted by the speed, up to so many, if the count is off by
    # no more than this share of one: twice as far, 0.5, any number of turns fits
    plain = (np.abs(passed - np.round(passed)) < 0.25) & (passed < 20.0)
    runs = np.split(np.arange(time.size), np.flatnonzero(~plain) + 1)
    longest = max(runs, key=len)
    steps = np.round(passed[longest[:-1]])
    return time[longest], np.concatenate([[0.0], np.cumsum(steps)])


def _with_steady(log: TransientLog) -> TransientLog:
    """The log with T from the calm samples.

    Bin medians would need more revolutions; means do after two rounds.
    """
    theta = log.wheel.theta(log.time_s[log.calm])
    turn, phi = split_turns(theta)
    values = log.values[log.calm]
    if log.observable == "radial_acceleration":
        values = (values - _gravity(phi)) * (
            log.spin_rad_s / log.wheel.speed_rad_s(log.time_s[log.calm])
        ) ** 2
    turns = np.unique(turn).size
    if turns < _FEWEST_STEADY:
        raise UsageError(
            f"{turns} steady revolutions beside the obstacles of channel {log.channel}",
            allowed=f"{_FEWEST_STEADY} or more are needed to know what the obstacle adds",
            do="give a log that rolls on before or after it",
            file=log.log,
        )
    return replace(log, steady=template(phi, values))


def around(log: TransientLog, time_s: float) -> TransientLog:
    """The log with the calm samples nearest to a time alone, and their T.

    What speed and torque are there, the steady waveform knows.
    """
    calm = np.flatnonzero(log.calm)
    # Steady rolling nearest to a hit that it is compared with [s]. Twice as much averages over
    # twice as many turns, and over twice as much of a speed that changes.
    nearest = np.argsort(np.abs(log.time_s[calm] - time_s), kind="stable")[
        : round(4.0 * log.rate_Hz)
    ]
    near = np.zeros(log.time_s.size, bool)
    near[calm[nearest]] = True
    return _with_steady(replace(log, calm=near))


def _calmed(log: TransientLog, hits_s: FloatArray) -> TransientLog:
    """The log with these hits: what they leave calm, the wheel's angle by passages off them."""
    turn = 2.0 * np.pi / log.spin_rad_s
    kept = _off(log.passages_s, hits_s, DISTURBED[0] * turn, DISTURBED[1] * turn)
    wheel = log.wheel
    if kept.sum() >= _FEWEST_STEADY:
        wheel = PassageAngle.through(log.passages_s[kept], log.turns[kept])
    calm = _off(log.time_s, hits_s, -turn, WINDOW_S + turn)
    return replace(log, calm=calm, hits_s=hits_s, wheel=wheel)


def _off(
    time_s: FloatArray, hits_s: FloatArray, low_s: FloatArray | float, high_s: FloatArray | float
) -> NDArray[np.bool_]:
    """Which times (n,) are in no hit's stretch, from `low_s` to `high_s` after it."""
    off = np.ones(time_s.size, bool)
    for hit in hits_s:
        off &= (time_s < hit + low_s) | (time_s > hit + high_s)
    return off


def _hits(log: TransientLog) -> FloatArray:
    """Rough times of the hits.

    What the setup says, else the times at which the samples leave the steady waveform.
    """
    road, found = log.road, np.zeros(0)
    if road.time_s is not None:
        found = np.array([road.time_s])
    elif road.position_m is not None:
        driven = log.radius_m * (log.wheel.theta(log.time_s) - log.wheel.theta(log.time_s[:1]))
        driven = driven + log.radius_m * log.wheel.speed_rad_s(log.time_s[:1]) * log.time_s[0]
        found = np.interp([road.position_m], driven, log.time_s, left=np.nan, right=np.nan)
    else:
        found = _outbursts(log)
    found = found[np.isfinite(found)]
    placed = road.time_s is not None or road.position_m is not None
    if road.spacing_m and placed and found.size:
        period = road.spacing_m / (log.radius_m * log.spin_rad_s)
        found = found[0] + period * np.arange(np.floor((log.time_s[-1] - found[0]) / period) + 1)
        # the way driven is known to a percent: what exceeds its neighbours tells better
        seen = _outbursts(log)
        nearest = (
            seen[np.argmin(np.abs(seen[None, :] - found[:, None]), axis=1)] if seen.size else found
        )
        found = np.where(np.abs(nearest - found) < np.pi / log.spin_rad_s, nearest, found)
    found = found[(found > log.time_s[0] + _ROOM_S) & (found < log.time_s[-1] - _ROOM_S)]
    if not found.size:
        raise UsageError(
            f"no obstacle in channel {log.channel} where the setup's [road] says {road.kind}",
            allowed="a clear pulse above the steady revolutions is needed",
            do="give time_s or position_m, or leave [road] out",
            file=log.log,
        )
    # Outbursts that are taken for hits at most, evenly over the log. Twice as many take twice as
    # long.
    kept: FloatArray = found[
        np.unique(np.linspace(0, found.size - 1, min(found.size, 12)).round().astype(int))
    ]
    return kept


def _outbursts(log: TransientLog) -> FloatArray:
    """Times at which the samples begin to leave the steady waveform, in order.

    There their mean square off it begins to stand out; the strongest stretches are taken.
    """
    # mean square over 10 ms that is eight times its median is no steady rolling. Twice as many
    # leave obstacles in the steady rolling that stand out 1.4 times as far
    width = max(round(0.01 * log.rate_Hz), 3)
    power = uniform_filter1d(log.off() ** 2, width)
    # where the sensor passes the patch more is off, also when nothing happens
    phase = (split_turns(log.wheel.theta(log.time_s))[1] + np.pi) * (64 / (2.0 * np.pi))
    bins = phase.astype(np.int64) % 64
    usual = np.array(
        [np.median(power[bins == b]) if np.any(bins == b) else np.inf for b in range(64)]
    )
    above = power / np.maximum(usual, np.median(usual) * 0.1)[bins]
    times: list[float] = []
    quiet_until = -np.inf
    threshold = max(8.0, 0.02 * float(above.max()))
    for index in np.flatnonzero(above > threshold):
        if log.time_s[index] >= quiet_until:
            times.append(float(log.time_s[index]))
            quiet_until = log.time_s[index] + WINDOW_S
    return np.array(times)


def steady_revolutions(stack: Stack, hits_s: FloatArray) -> Stack:
    """The revolutions that no obstacle disturbs."""
    turn = 2.0 * np.pi * stack.radius_m / stack.conditions.speed_m_s
    return stack.take(_off(stack.conditions.time_s, hits_s, -turn, WINDOW_S + turn))


# ---- The door.


@dataclass(frozen=True)
class MeasuredLogs:
    """Steady revolutions of all logs; beside them the logs that met an obstacle.

    `beside`: those of further observables, or gratings, which are fitted together with the first.
    `notes`: what a reader must know of them.
    """

    stacks: Stacks
    obstacles: tuple[TransientLog, ...] = ()
    beside: tuple[Stacks, ...] = ()

    @property
    def revolutions(self) -> tuple[Sequence[Stack], ...]:
        """What a question is asked of: the stacks of each observable or grating."""
        return (self.stacks, *self.beside)

    @property
    def gratings(self) -> tuple[str, ...]:
        """The gratings, if there are several."""
        return tuple(one[0].member for own in self.revolutions if (one := outlines(own))[0].member)

    def __repr__(self) -> str:
        found = ", ".join(
            f"{sum(len(stack) for stack in stacks.outlines())} revolutions of "
            f"{stacks.outlines()[0].observable if len(stacks) else 'nothing'}"
            for stacks in (self.stacks, *self.beside)
        )
        hits = f", {len(self.obstacles)} logs with obstacles" if self.obstacles else ""
        return f"{found}{hits}"

    def _repr_html_(self) -> str:
        """The revolutions by log, as a notebook shows them."""
        rows = []
        for stacks in (self.stacks, *self.beside):
            for number, log in enumerate(stacks.logs):
                own = [stack for stack in stacks.outlines() if stack.log[0] == number]
                speed = np.concatenate([[np.nan], *(s.conditions.speed_m_s for s in own)])
                span = (np.nanmin(speed), np.nanmax(speed)) if own else (None, None)
                manoeuvres = {int(n) for stack in own for n in np.unique(stack.manoeuvre)}
                kind = own[0].observable if own else ""
                rows.append((log, kind, sum(map(len, own)), len(manoeuvres), *span))
        names = ["log", "observable", "revolutions", "manoeuvres", "from m/s", "to m/s"]
        return document(repr(self), [table(names, rows)], self.notes)

    @property
    def notes(self) -> tuple[str, ...]:
        said = [note for stacks in (self.stacks, *self.beside) for note in stacks.notes]
        return tuple(dict.fromkeys(said))


#: the word for every grating that all logs have
ALL_CHANNELS = "all"


def several_channels(channel: str | None) -> tuple[str, ...]:
    """The channels that a --channel names if it names several, or all; none if it names one."""
    names = tuple(dict.fromkeys(name.strip() for name in (channel or "").split(",")))
    return names if len(names) > 1 or names == (ALL_CHANNELS,) else ()


def measured_gratings(recordings: Iterable[Recording], names: Sequence[str]) -> MeasuredLogs:
    """The revolutions of several gratings of one tire, and the place of each on the wheel.

    names       of the channels, or ALL_CHANNELS
    UsageError  as `measured`, and if a log lacks one, they are on both surfaces, or fewer than two
                are left
    """
    found: dict[str, Stacks] = {}
    given: dict[str, float] = {}
    for recording in recordings:
        own = [channel.name for channel in recording.of_kind(*STRAIN_KINDS)]
        # those of the first log are asked of all
        asked = list(found) or (own if names == (ALL_CHANNELS,) else list(names))
        lacking = [name for name in asked if name not in own]
        if lacking or len(asked) < 2:
            raise UsageError(
                f"no grating {', '.join(lacking)}" if lacking else "one grating only",
                allowed=f"the log's gratings are {', '.join(own) or 'none'}; several are needed, "
                "the same in all logs",
                do="name those that all logs have, or one alone" if lacking else "name it",
                file=recording.log,
            )
        if recording.setup.road.kind != "flat":
            raise UsageError(
                "a log with a [road] and several gratings",
                allowed="an obstacle is compared with one grating",
                do="name one channel, or leave the log out",
                file=recording.log,
            )
        for name in asked:
            add_log(found.setdefault(name, Stacks()), recording, STRAIN, name)
            channel = recording.setup.channels.get(name)
            if channel is not None and channel.angle_deg is not None:
                given.setdefault(name, float(np.radians(channel.angle_deg)))
    surfaces = {name: outlines(stacks)[0].surface for name, stacks in found.items()}
    if len(set(surfaces.values())) > 1:
        raise UsageError(
            "gratings on both surfaces: "
            + ", ".join(f"{name} {surface}" for name, surface in surfaces.items()),
            allowed="one fit takes gratings of one surface",
            do="name those of one",
        )
    first, *others = found.values()
    angles, said = places_of(found, given)
    for stacks, angle in zip(found.values(), angles, strict=True):
        stacks.place(angle)
    first.note(*said)
    return MeasuredLogs(first, (), tuple(others))


def measured_together(
    recordings: Iterable[Recording],
    observables: Sequence[str],
    channel: str | None = None,
    *,
    level: bool = True,
) -> MeasuredLogs:
    """The revolutions of each of several observables, from logs that each measure some of them.

    channel     the one to take where its kind measures an observable; elsewhere the first that does
    UsageError  as `measured`, and if no log measures one of the observables, or the channel none
    """
    found = [Stacks() for _ in observables]
    obstacles: list[TransientLog] = []
    named = channel is None
    for recording in recordings:
        own = None if channel is None else recording.channels.get(channel)
        for stacks, observable in zip(found, observables, strict=True):
            if not _measures(recording, observable):
                stacks.note(f"{recording.log}: measures no {observable}")
                continue
            fits = own is not None and own.kind in OBSERVABLES[observable].kinds
            named = named or fits
            own_name = channel if fits else None
            obstacles += _add_steady(stacks, recording, observable, own_name, level=level)
    for stacks, observable in zip(found, observables, strict=True):
        if not len(stacks):
            known = OBSERVABLES[observable]
            needs = " and ".join([" or ".join(known.kinds), *known.beside])
            raise UsageError(
                f"no log measures {observable}",
                allowed=f"it needs a channel of the kind {needs}",
                do="give such a log too, or take the observable out of the model",
            )
    if not named:
        raise UsageError(
            f"no log has a channel {channel} that measures one of {', '.join(observables)}",
            allowed="a channel of one of these kinds is allowed",
            do="name one, or none",
        )
    return MeasuredLogs(found[0], tuple(obstacles), tuple(found[1:]))


def measured_for(
    recordings: Iterable[Recording],
    observables: Sequence[str],
    channel: str | None = None,
    *,
    level: bool = True,
) -> MeasuredLogs:
    """The revolutions for a model of one observable or several: of one channel, or of gratings.

    channel     one name; of strain alone also several with commas between, or ALL_CHANNELS
    UsageError  as `measured`, no such observable, several channels of another than strain, or a log
                that holds the same samples as another
    """
    for observable in observables:
        if observable not in OBSERVABLES:
            raise UsageError(
                f"no observable is called {observable!r}{nearest(observable, OBSERVABLES)}",
                allowed=f"allowed are a model and {', '.join(OBSERVABLES)}",
                do="give one of them",
            )
    names, notes = several_channels(channel), list[str]()
    recordings = once_each(recordings, observables, channel, notes)
    if names and tuple(observables) != (STRAIN,):
        raise UsageError(
            f"several channels ({channel}) of {together(observables)}",
            allowed="several are allowed of strain: gratings of one tire",
            do="name one channel, or none",
        )
    if names:
        found = measured_gratings(recordings, names)
    elif len(observables) > 1:
        found = measured_together(recordings, observables, channel, level=level)
    else:
        found = measured(recordings, observables[0], channel, level=level)
    found.stacks.note(*notes)
    return found


def _measures(recording: Recording, observable: str) -> bool:
    """Has a recording the channels for an observable?"""
    known = OBSERVABLES[observable]
    return bool(recording.of_kind(*known.kinds)) and all(
        recording.of_kind(kind) for kind in known.beside
    )


def measured(
    recordings: Iterable[Recording],
    observable: str = "strain",
    channel: str | None = None,
    *,
    most: int = STRETCH,
    level: bool = True,
) -> MeasuredLogs:
    """The revolutions of the recordings that are to be compared with a model of the observable.

    observable  what the model predicts; `channel` the name of the one to take (default: the first
                that measures it)
    most        revolutions of a log that are in memory at a time
    level       does the model need the mean level of an accelerometer
    UsageError  no such channel, fewer than six revolutions, or a [road] without an obstacle or
                steady rolling beside it
    """
    stacks, obstacles = Stacks(), list[TransientLog]()
    for recording in recordings:
        obstacles += _add_steady(stacks, recording, observable, channel, most=most, level=level)
    return MeasuredLogs(stacks, tuple(obstacles))


def _add_steady(
    stacks: Stacks,
    recording: Recording,
    observable: str,
    channel: str | None,
    *,
    most: int = STRETCH,
    level: bool,
) -> list[TransientLog]:
    """Adds a recording's revolutions that no obstacle disturbs; its waveforms about one, if any."""
    if recording.setup.road.kind == "flat":
        add_log(stacks, recording, observable, channel, most=most, level=level)
        return []
    own = Stacks()
    add_log(own, recording, observable, channel, most=most, level=level)
    stacks.note(*own.notes)
    stack = joined(own)  # the log's samples are in memory as a whole too
    source, _ = outward(recording.channels[stack.channel])
    waveforms = stack  # an obstacle shows in those of which numbers per revolution are made
    if observable not in WAVEFORMS:
        waveforms = joined(stretches_of(recording, source, waveform_of([source.kind]), []))
    found = transient_log(recording, source, waveforms)
    rest = steady_revolutions(stack, found.hits_s)
    if not len(rest):
        raise UsageError(
            f"every revolution of channel {stack.channel} is on an obstacle",
            allowed="steady ones are needed beside it",
            do="give a log that rolls on before or after it",
            file=recording.log,
        )
    stacks.add(recording.log, [rest])
    stacks.note(
        f"{recording.log}: {found.hits_s.size} hits on an obstacle; {len(stack) - len(rest)} of "
        f"{len(stack)} revolutions are disturbed by them and kept apart from the steady ones"
    )
    return [found] if observable in WAVEFORMS else []


# ---- Parameters that only a motion tells.
#
# Masses, damping and bristles of a coupled ring that meets an obstacle.


def motion_names(model: Model) -> tuple[str, ...]:
    """The free parameters that only a motion tells."""
    return tuple(name for name in model.free if name in MOTION and model.carcass == "coupled_ring")


def without_motion_parameters(model: Model) -> Model:
    """The model as the steady waveform is fitted: without what only a motion tells."""
    return model.with_parameters(
        {name: model.parameters[name].fixed() for name in motion_names(model)}
    )
