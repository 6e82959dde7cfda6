"""The passages of a channel of a recording, of the right surface.

They are refused if they show that its setup names the wrong surface.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tirelog.data.bounds import PLAUSIBLE
from tirelog.data.plausibility import doubt_of_rate, doubt_of_vehicle, implausible
from tirelog.data.recording import Channel, Recording
from tirelog.errors import SetupError, UsageError
from tirelog.strain.passages.find import Passages, find_passages, without_speeds
from tirelog.vocabulary.quality import Quality

#: whole turns that must be found on the other surface before the setup's is called wrong; with
#: one, a kink of a static test would do; twice as many would let a swapped surface pass in logs of
#: a few turns
FEWEST_TURNS = 3
#: passages at which the motion is judged; twice as many find the same
_LOOKED_AT = 64
#: readings of a rolling vehicle that tell a radius; with one, a single wild one would
_FEWEST_READINGS = 3
#: acceleration [m/s^2] beyond which gravity, twice 9.8 per turn, changes it by a fifth at most
_STRONG_M_S2 = 100.0
#: what makes an accelerometer contradict the wheel, if no unit does
_TURNING = "check unit and scale, the sampling rate, the steps of the encoder and the radius"


def passages_of(recording: Recording, channel: Channel) -> Passages:
    """The passages of one channel, without speeds if these are no tire's.

    UsageError if its setup names the wrong surface.
    """
    radius = recording.setup.tire.radius_m
    passages = find_passages(channel, radius)
    if passages.doubt:
        refuse_swapped_surface(recording, channel, radius)
        return passages
    problem = implausible_motion(recording, channel, passages)
    if problem is None:
        return passages
    return without_speeds(passages, problem.message, Quality.IMPLAUSIBLE)


def trusted_passages(recording: Recording, channel: Channel) -> Passages:
    """The passages of one channel for a comparison.  UsageError if they are no tire's."""
    passages = passages_of(recording, channel)
    if passages.doubt:
        raise UsageError(passages.doubt, file=recording.log)
    return passages


def implausible_motion(
    recording: Recording, channel: Channel, passages: Passages
) -> SetupError | None:
    """The error of passages whose rate, speed, radius or acceleration is no tire's; None if not.

    The radius is what `vehicle_speed` travels per radian. An accelerometer's step from the level
    outside into the patch is about Omega^2 R; the level itself may be lost (piezo elements).
    """
    known = np.flatnonzero(np.isfinite(passages.omega_rad_s))
    if not known.size:
        return None
    some = known[np.unique(np.linspace(0, known.size - 1, _LOOKED_AT).astype(np.int64))]
    speed, omega = passages.speed_m_s[some], passages.omega_rad_s[some]
    # stop-and-go has many slow turns: the fast ones are too slow if the time is wrong
    slowest, middle = PLAUSIBLE["speed_m_s"].low, float(np.median(speed))
    fast = float(np.quantile(speed, 0.9))
    problem = doubt_of_rate(recording, channel, fast if fast < slowest else middle)
    for reference in recording.of_kind("vehicle_speed")[:1]:
        index = np.rint(reference.axis.index(passages.time_s[some])).astype(np.int64)
        reading = np.array([reference.read(one, one + 1)[0] for one in index.tolist()])
        rolls = np.abs(reading) > slowest  # a vehicle on a drum reads nothing
        if rolls.sum() >= _FEWEST_READINGS:
            radius = float(np.median(reading[rolls] / omega[rolls]))
            problem = problem or doubt_of_vehicle(recording, reference, radius)
    if problem is not None or channel.kind != "radial_acceleration":
        return problem
    turning = omega**2 * passages.radius_m
    strong = np.maximum(turning, passages.height[some]) > _STRONG_M_S2
    if not strong.any():
        return None
    ratio = float(np.nanmedian((passages.height[some] / turning)[strong]))
    what = f"the step into the patch is {ratio:.3g} times Omega^2 R"
    return implausible(recording, "step_to_rotation", ratio, what, channel=channel, do=_TURNING)


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
