"""The strain channels of a recording with their passages, for the tables that are made of them."""

from __future__ import annotations

from collections.abc import Iterator

from tirelog.data.recording import Channel, Recording
from tirelog.errors import UsageError
from tirelog.runs.in_memory import held
from tirelog.strain.passages.find import Passages
from tirelog.strain.passages.surface import passages_of
from tirelog.vocabulary.kinds import STRAIN_KINDS


def strain_channels(recording: Recording) -> list[Channel]:
    """The strain channels.  UsageError where there is none."""
    channels = recording.of_kind(*STRAIN_KINDS)
    if not channels:
        have = ", ".join(f"{c.name} ({c.kind})" for c in recording.channels.values()) or "none"
        raise UsageError(
            f"no strain channel; allowed are channels of kind {' and '.join(STRAIN_KINDS)}, the "
            f"log has {have}; name one in the setup",
            file=recording.log,
        )
    return channels


def rotating(recording: Recording) -> Iterator[tuple[Channel, Passages]]:
    """The strain channels with their passages.

    UsageError, before the first is given: none of them passes the patch, or a setup names the wrong
    surface.
    """
    channels = strain_channels(recording)
    if len(channels) == 1:
        channels = [held(channels[0])]  # gone through once more by whoever takes it
    found = [passages_of(recording, channel) for channel in channels]
    if not any(len(passages) for passages in found):
        raise not_turning(recording)
    for stored, passages in zip(channels, found, strict=True):
        yield held(stored), passages  # one after the other: each takes memory


def not_turning(recording: Recording) -> UsageError:
    """The error of a command that needs passages on a log without any."""
    return UsageError(
        "the wheel does not turn in this log: no grating passes the patch; allowed are logs with "
        "at least one passage; "
        "for a static test use `tirelog inflation`, and give the inked length as "
        "static_footprint_length_m under [tire]",
        file=recording.log,
    )
