"""What an accelerometer's channel must be to be held against a model.

Outward positive, and with its mean level.

    Channel --`outward`--> Channel whose patch is a maximum, and a sentence if it had to be
                           turned round
    Stack, Stack, ... --`with_level`--> the same; UsageError if the level outside the patch is
                                        none of a turning sensor

A model predicts -v^2 / R outside the patch and about nothing in it (errata). Which way a sensor is
glued in shows in the log; a level that was taken out (AC coupling, a piezo element, a mean removed)
cannot be put back.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from tirelog.data.recording import Channel, Scaled, Stack
from tirelog.errors import UsageError
from tirelog.strain.passages.find import patch_sign
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2

#: level outside the patch over -v^2 / R: radii and gains are known to 10 %.  Twice as wide would
#: let a level of half the size pass
LEVEL_OFF = 0.3
#: and how far off it may be whatever the speed [m/s^2], for a sensor's own zero; twice as much
#: would hide 4 g, all of it at 4 m/s
ZERO_M_S2 = 2.0 * STANDARD_GRAVITY_M_S2


def outward(channel: Channel) -> tuple[Channel, str]:
    """The channel with outward positive, and '' or what was done.

    Other kinds of channel come back as they are.
    """
    if channel.kind != "radial_acceleration" or patch_sign(channel) > 0.0:
        return channel, ""
    stored = channel.samples
    if isinstance(stored, Scaled):
        turned = replace(
            channel, samples=replace(stored, scale=-stored.scale, offset=-stored.offset)
        )
    else:
        turned = replace(channel, samples=lambda start, stop: -stored(start, stop))
    return (
        turned,
        f"{channel.name} was recorded inward positive (a minimum in the patch); "
        "its sign was turned",
    )


def with_level(stretches: Iterable[Stack], log: str) -> Iterator[Stack]:
    """The stacks of one log as they come.

    UsageError: an acceleration without the level of a turning sensor.
    """
    for stack in stretches:
        if stack.observable == "radial_acceleration":
            _check_level(stack, log)
        yield stack


def _check_level(stack: Stack, log: str) -> None:
    """UsageError if the median level outside the patch is not about -v^2 / R."""
    turning = stack.conditions.speed_m_s**2 / stack.radius_m
    with np.errstate(invalid="ignore"):
        level = np.nanmedian(
            np.where(np.isfinite(stack.values).any(axis=1, keepdims=True), stack.values, 0.0),
            axis=1,
        )
    usual, off = float(np.median(turning)), float(np.median(level + turning))
    if abs(off) <= max(LEVEL_OFF * usual, ZERO_M_S2):
        return
    raise UsageError(
        f"channel {stack.channel} reads {off - usual:.4g} m/s^2 outside the patch (median) and a "
        f"turning sensor reads -v^2/R = {-usual:.4g} m/s^2",
        allowed=f"allowed is {100 * LEVEL_OFF:g} % off: the mean level was removed (AC coupling, "
        "a piezo element), or the unit is wrong",
        do="mend unit, scale or offset, or give the model coupling_Hz, the sensor's high-pass",
        file=log,
    )
