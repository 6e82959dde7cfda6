"""The passages of a channel of a recording, of the right surface.

They are refused if they show that its setup names the wrong surface.
"""

from __future__ import annotations

from dataclasses import replace

from tirelog.data.recording import Channel, Recording
from tirelog.errors import UsageError
from tirelog.strain.passages.find import Passages, find_passages

#: whole turns that must be found on the other surface before the setup's is called wrong; with
#: one, a kink of a static test would do; twice as many would let a swapped surface pass in logs of
#: a few turns
FEWEST_TURNS = 3


def passages_of(recording: Recording, channel: Channel) -> Passages:
    """The passages of one channel.  UsageError if its setup names the wrong surface."""
    radius = recording.setup.tire.radius_m
    passages = find_passages(channel, radius)
    if passages.doubt:
        refuse_swapped_surface(recording, channel, radius)
    return passages


def refuse_swapped_surface(recording: Recording, channel: Channel, radius: float) -> None:
    """UsageError if the patch is found once the channel is taken for one of the other surface."""
    if channel.kind == "radial_acceleration":
        return
    other = {"outer": "inner", "inner": "outer"}[channel.surface]
    turned = find_passages(replace(channel, surface=other), radius)
    if turned.doubt or turned.turn_after.sum() < FEWEST_TURNS:
        return
    extremum = (
        "a minimum, as the outer surface (groove)"
        if other == "outer"
        else "a maximum, as the inner surface (liner)"
    )
    raise UsageError(
        f"channel {channel.name} shows {extremum} does in the patch, and its setup says "
        f"{channel.surface}",
        allowed="the two must agree",
        do=f'write surface = "{other}"',
        file=recording.log,
    )
