"""What makes an encoder or an accelerometer doubtful.

Swapped channels, a wrong number of steps, a wrong sampling rate or unit, saturation.

channels, WheelAngle, Fronts --> sentences on the whole channel, or a SetupError that says what to
mend
"""

from __future__ import annotations

import numpy as np

from tirelog.data.plausibility import implausible
from tirelog.data.recording import Channel, Recording
from tirelog.dsp.encoder.signal import crossings, probe
from tirelog.errors import SetupError
from tirelog.wheel.angle import Radius, WheelAngle
from tirelog.wheel.fronts.fronts import Fronts, patch_turn

#: times between swings more alike than this (shorter over longer, median) are an encoder's; twice
#: as far from one, 0.4, is still far above the 0.05 of passages and the rest of their turns
EVEN = 0.7
#: the patch comes this near to once per turn, as a share; twice as much takes 47 steps for 48
OFF_TURN = 0.01


def refuse_swapped(recording: Recording, accelerometer: Channel, encoder: Channel) -> None:
    """SetupError if accelerometer and encoder are swapped.

    The accelerometer's channel swings like an encoder, evenly, and the encoder's does not.
    """
    if _evenness(accelerometer) > EVEN > _evenness(encoder):
        raise SetupError(
            f"{accelerometer.name} swings like an encoder and {encoder.name} does not: the "
            "channels look swapped",
            allowed="an encoder swings evenly, `steps` times a turn",
            do="exchange their sources in the setup",
            file=recording.log,
        )


def _evenness(channel: Channel) -> float:
    """How like each other the times between a channel's swings are, up to 1.

    The shorter over the longer of two neighbours, the median; 0 if it does not swing. A passage of
    the patch and the rest of its turn are 1 to 20.
    """
    found = probe(channel.read, channel.size)
    if found.form not in ("sine", "square"):
        return 0.0
    pieces = list(crossings(channel.read, min(channel.size, 1 << 20), channel.axis.rate_Hz, found))
    steps = np.diff(np.concatenate([piece.index for piece in pieces]))
    if steps.size < 20:
        return 0.0
    return float(
        np.median(
            np.minimum(steps[1:], steps[:-1]) / np.maximum(np.maximum(steps[1:], steps[:-1]), 1e-9)
        )
    )


def refuse_steps(recording: Recording, wheel: WheelAngle, turn_rad: float) -> None:
    """SetupError if the patch does not come once per turn, but every `turn_rad` of wheel angle."""
    turns = turn_rad / (2 * np.pi)
    if not abs(turns - 1) > OFF_TURN:
        return
    steps = wheel.steps * turns
    table = (
        ", and the learnt pitch table does not repeat"
        if any("does not repeat" in remark for remark in wheel.remarks)
        else ""
    )
    raise SetupError(
        f"channel {wheel.channel}: the patch comes every {steps:.2f} steps, not every "
        f"{wheel.steps}{table}",
        allowed="the setup's steps must be those of a whole turn",
        do=f"write steps = {round(steps)}",
        file=recording.log,
    )


def refuse_steps_by_patch(recording: Recording, wheel: WheelAngle) -> None:
    """`refuse_steps` by the first accelerometer that shows the patch, for who needs no fronts.

    It reads as much of a log as shows a few passages, most often its first hundred turns.
    """
    for channel in recording.of_kind("radial_acceleration"):
        turn = patch_turn(channel, wheel)
        if np.isfinite(turn):
            refuse_steps(recording, wheel, turn)
            return


def doubts(
    recording: Recording,
    channel: Channel,
    wheel: WheelAngle,
    fronts: Fronts,
    radius: Radius,
    share: float,
) -> list[str]:
    """Sentences on the whole channel.

    SetupError: the patch does not come once in `steps` steps, or its level is no rotation's.
    """
    said: list[str] = []
    refuse_steps(recording, wheel, fronts.turn_rad)
    ratio = fronts.level_m / radius.radius_m
    what = (
        f"the level outside the patch is {ratio:.3g} times Omega^2 R, as of a sampling rate wrong "
        f"by a factor {abs(ratio) ** 0.5:.3g} or a unit by {ratio:.3g}"
    )
    do = "check unit and scale, the sampling rate, the steps of the encoder and the radius"
    problem = implausible(recording, "level_to_rotation", ratio, what, channel=channel, do=do)
    if problem is not None and share < 0.01:
        raise problem
    if share > 1e-4:
        said.append(
            f"channel {channel.name}: {100 * share:.2g} % of the samples stand at its limits "
            "(clipped)"
        )
    outward = "outward" if fronts.sign < 0 else "inward"
    gravity = "with" if fronts.gravity else "without"
    said.append(
        f"channel {channel.name}: {outward} positive by its level outside the patch, {gravity} "
        "gravity"
    )
    return said
