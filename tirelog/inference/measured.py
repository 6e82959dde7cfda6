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

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from tirelog.data.recording import Channel, Recording, Stack, TimeAxis
from tirelog.errors import UsageError
from tirelog.inference.obstacle_log import TransientLog, steady_revolutions, transient_log
from tirelog.inference.stacks.cut import STRETCH, observe_channel, stacks_from_logs, stretches_of
from tirelog.inference.stacks.outward import outward
from tirelog.inference.stacks.spooled import Stacks, joined
from tirelog.vocabulary.observables import WAVEFORMS, waveform_of


@dataclass(frozen=True)
class MeasuredLogs:
    """Steady revolutions of all logs; beside them the logs that met an obstacle.

    `notes`: what a reader must know of both.
    """

    stacks: Stacks
    obstacles: tuple[TransientLog, ...] = ()

    @property
    def notes(self) -> tuple[str, ...]:
        return self.stacks.notes


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
    if not kept:
        return MeasuredLogs(stacks)
    return _parted(stacks, kept)


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
    for note in stacks.notes:
        steady.note(note)
    for number, log in enumerate(stacks.logs):
        recording = kept.get(log)
        if recording is None:
            steady.add(log, stacks.of_log(number))
            continue
        stack = joined(stacks.of_log(number))  # its samples are in memory as a whole too
        source = recording.channels[stack.channel]
        found = transient_log(recording, source, _waveforms(recording, source, stack))
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
    steady.number_through()  # a manoeuvre may have gone with its revolutions
    return MeasuredLogs(steady, tuple(obstacles))


def _waveforms(recording: Recording, source: Channel, stack: Stack) -> Stack:
    """The stack itself, or that of the channel from which its numbers per revolution come.

    An obstacle shows in a waveform.
    """
    if stack.observable in WAVEFORMS:
        return stack
    observable = waveform_of([source.kind])
    return joined(stretches_of(recording, source, observable))
