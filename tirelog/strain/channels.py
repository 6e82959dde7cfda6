"""The strain channels of a recording, and the refusal of a log whose wheel does not turn."""

from __future__ import annotations

from tirelog.data.recording import Channel, Recording
from tirelog.errors import UsageError
from tirelog.vocabulary.kinds import STRAIN_KINDS


def strain_channels(recording: Recording) -> list[Channel]:
    """The strain channels.  UsageError if there is none."""
    channels = recording.of_kind(*STRAIN_KINDS)
    if not channels:
        wanted = f"channels of kind {' and '.join(STRAIN_KINDS)}"
        raise no_channel(recording, "no strain channel", wanted)
    return channels


def no_channel(recording: Recording, what: str, wanted: str) -> UsageError:
    """The error of a log without a channel that is needed; it tells those that there are."""
    have = ", ".join(f"{c.name} ({c.kind})" for c in recording.channels.values()) or "none"
    return UsageError(
        what,
        allowed=f"allowed are {wanted}, the log has {have}",
        do="name one in the setup",
        file=recording.log,
    )


def not_turning(recording: Recording) -> UsageError:
    """The error of a command that needs passages on a log without any."""
    return UsageError(
        "the wheel does not turn in this log: no grating passes the patch",
        allowed="allowed are logs with at least one passage",
        do="for a static test use `tirelog inflation`, and give the inked length as "
        "static_footprint_length_m under [tire]",
        file=recording.log,
    )
