"""The one door from logs to measured revolutions.

For fit, compare, diagnose, ladder, report and campaign.

    recordings --stacks_from_logs--> revolutions of all logs
        --obstacles of logs with a [road] found--> MeasuredLogs: the revolutions off them, and the
                                                   obstacles beside

`measured_pieces` makes of it the means of like revolutions that every question is asked of, under
one limit of memory. What was set apart, taken together or left out on the way is in `notes`, and
goes with the revolutions into every answer.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tirelog.data.recording import Channel, Recording, TimeAxis
from tirelog.errors import UsageError, nearest
from tirelog.inference.cells.joint import JointStacks
from tirelog.inference.obstacle_log import TransientLog, steady_revolutions, transient_log
from tirelog.inference.shared_samples import once_each
from tirelog.inference.stacks.cut import (
    STRETCH,
    Stacks,
    joined,
    observe_channel,
    outward,
    places_of,
    stacks_from_logs,
    stretches_of,
)
from tirelog.physics.carcass.numbers import MOTION
from tirelog.physics.model.model import Model
from tirelog.tables.writer import document, table
from tirelog.vocabulary.kinds import STRAIN_KINDS
from tirelog.vocabulary.observables import (
    OBSERVABLES,
    STRAIN,
    WAVEFORMS,
    together,
    waveform_of,
)


@dataclass(frozen=True)
class MeasuredLogs:
    """Steady revolutions of all logs; beside them the logs that met an obstacle.

    `beside`: those of further observables, or gratings, which are fitted together with the first;
    `places`: of gratings the angle of each on the wheel [rad]. `notes`: what a reader must know of
    them.
    """

    stacks: Stacks
    obstacles: tuple[TransientLog, ...] = ()
    beside: tuple[Stacks, ...] = ()
    places: tuple[float, ...] = ()

    @property
    def revolutions(self) -> Stacks | JointStacks:
        """What a question is asked of: the stacks, of several observables those of each."""
        if not self.beside:
            return self.stacks
        return JointStacks((self.stacks, *self.beside), self.places)

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


def measured_gratings(
    recordings: Iterable[Recording], names: Sequence[str], *, most: int = STRETCH
) -> MeasuredLogs:
    """The revolutions of several gratings of one tire, and where each stands on the wheel.

    names       of the channels, or ALL_CHANNELS
    UsageError  as `measured`, and if a log lacks one, they are on both surfaces, or fewer than two
                are left
    """
    found: dict[str, Stacks] = {}
    given: dict[str, float] = {}
    surfaces: dict[str, str] = {}
    for number, recording in enumerate(recordings):
        own = [channel.name for channel in recording.of_kind(*STRAIN_KINDS)]
        asked = list(names)
        if names == (ALL_CHANNELS,):
            asked = own if number == 0 else list(found)
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
            one = measured([recording], STRAIN, name, most=most)
            stacks = found.setdefault(name, Stacks())
            stacks.add(recording.log, one.stacks.of_log(0))
            stacks.note(*one.notes)
            channel = recording.setup.channels.get(name)
            if channel is not None and channel.angle_deg is not None:
                given.setdefault(name, float(np.radians(channel.angle_deg)))
            surfaces[name] = recording.channels[name].surface
    if len(set(surfaces.values())) > 1:
        raise UsageError(
            "gratings on both surfaces: "
            + ", ".join(f"{name} {surface}" for name, surface in surfaces.items()),
            allowed="one fit takes gratings of one surface",
            do="name those of one",
        )
    first, *others = found.values()
    angles, said = places_of(found, given)
    first.note(*said)
    return MeasuredLogs(first, (), tuple(others), angles)


def measured_together(
    recordings: Iterable[Recording],
    observables: Sequence[str],
    channel: str | None = None,
    *,
    most: int = STRETCH,
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
            one = measured(
                [recording], observable, channel if fits else None, most=most, level=level
            )
            stacks.add(recording.log, one.stacks.of_log(0))
            obstacles += one.obstacles
            stacks.note(*one.notes)
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
    kept: dict[str, Recording] = {}
    stacks = stacks_from_logs(
        _watched(recordings, observable, channel, kept),
        observable,
        channel,
        most=most,
        level=level,
    )
    return _parted(stacks, kept) if kept else MeasuredLogs(stacks)


def _watched(
    recordings: Iterable[Recording],
    observable: str,
    channel: str | None,
    kept: dict[str, Recording],
) -> Iterator[Recording]:
    """The recordings as they come.

    Of those that met an obstacle the observed channel is kept in memory, by log.
    """
    for recording in recordings:
        if recording.setup.road.kind != "flat":
            source, _ = outward(observe_channel(recording, observable, channel))
            axis = replace(TimeAxis.of_times(source.axis.time()), rate_Hz=source.axis.rate_Hz)
            copy = Channel.of_array(
                source.name, source.kind, source.read(), axis, surface=source.surface
            )
            kept[recording.log] = replace(recording, channels={source.name: copy})
        yield recording


def _parted(stacks: Stacks, kept: dict[str, Recording]) -> MeasuredLogs:
    """The stacks without the revolutions that an obstacle disturbs, and the logs that met one."""
    obstacles: list[TransientLog] = []
    steady = Stacks()
    steady.note(*stacks.notes)
    for number, log in enumerate(stacks.logs):
        recording = kept.get(log)
        if recording is None:
            steady.add(log, stacks.of_log(number))
            continue
        stack = joined(stacks.of_log(number))  # its samples are in memory as a whole too
        source = recording.channels[stack.channel]
        waveforms = stack  # an obstacle shows in those of which numbers per revolution are made
        if stack.observable not in WAVEFORMS:
            waveforms = joined(stretches_of(recording, source, waveform_of([source.kind])))
        found = transient_log(recording, source, waveforms)
        rest = steady_revolutions(stack, found.hits_s)
        if not len(rest):
            raise UsageError(
                f"every revolution of channel {stack.channel} is on an obstacle",
                allowed="steady ones are needed beside it",
                do="give a log that rolls on before or after it",
                file=log,
            )
        steady.add(log, [rest])
        steady.note(
            f"{log}: {found.hits_s.size} hits on an obstacle; {len(stack) - len(rest)} of "
            f"{len(stack)} revolutions are disturbed by them and kept apart from the steady ones"
        )
        if stack.observable in WAVEFORMS:
            obstacles.append(found)
    return MeasuredLogs(steady, tuple(obstacles))


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
