"""The strain channels of a recording, and the refusal of a log whose wheel does not turn."""

from __future__ import annotations

from tirelog.data.recording import Channel, Recording
from tirelog.errors import UsageError
from tirelog.vocabulary.kinds import STRAIN_KINDS


def strain_channels(recording: Recording) -> list[Channel]:
    """The strain channels.  UsageError if there is none."""
    channels = recording.of_kind(*STRAIN_KINDS)
    if not channels:
        have = ", ".join(f"{c.name} ({c.kind})" for c in recording.channels.values()) or "none"
        raise UsageError(
            "no strain channel",
            allowed=f"allowed are channels of kind {' and '.join(STRAIN_KINDS)}, the log has "
            f"{have}",
            do="name one in the setup",
            file=recording.log,
        )
    return channels


def not_turning(recording: Recording) -> UsageError:
    """The error of a command that needs passages on a log without any."""
    return UsageError(
        "the wheel does not turn in this log: no grating passes the patch",
        allowed="allowed are logs with at least one passage",
        do="for a static test use `tirelog inflation`, and give the inked length as "
        "static_footprint_length_m under [tire]",
        file=recording.log,
    )
