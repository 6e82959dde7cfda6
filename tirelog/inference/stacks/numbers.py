"""Numbers per revolution as stacks with one angle.

Patch length, dissipation factor, phase shift, patch width.

Recording --estimators--> a row a passage, those with nothing wrong
    --> Stack (n, 1), the same conditions and manoeuvres as a waveform's
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel, Recording, Stack
from tirelog.errors import UsageError
from tirelog.inference.stacks.manoeuvres import accelerations, regimes, segment
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import Quality, Use, good, having

SCALARS = ("patch_length", "dissipation_factor", "phase_shift", "patch_width")
#: kinds of channel from which each number comes
SOURCES = {
    "patch_length": ("fbg_strain", "strain"),
    "dissipation_factor": ("fbg_strain", "strain"),
    "phase_shift": ("radial_acceleration",),
    "patch_width": ("radial_acceleration",),
}
#: a passage this much later than its neighbours' periods starts a new manoeuvre
_GAP = 3.0


def scalar_stack(recording: Recording, channel: Channel, observable: str) -> tuple[Stack, str]:
    """The stack (n, 1) of one number per revolution, and '' or what is to be known of it.

    UsageError: fewer than ten revolutions have the number.
    """
    from tirelog.inference.stacks.conditions import conditions_of

    if observable in ("patch_length", "dissipation_factor"):
        time_s, speed, value, radius, unclear = _of_strain(recording, channel, observable)
    else:
        time_s, speed, value, radius = _of_fronts(recording, channel, observable)
        unclear = np.zeros(value.size, bool)
    ordinal = np.flatnonzero(np.isfinite(value) & np.isfinite(speed) & np.isfinite(time_s))
    n = ordinal.size
    if n < 10:
        raise UsageError(
            f"{n} revolutions with a {observable} in channel {channel.name}; at least ten are "
            "needed; give a longer log",
            file=recording.log,
        )
    time_s, speed, value = time_s[ordinal], speed[ordinal], value[ordinal]
    acceleration = accelerations(time_s, speed)
    period = np.diff(time_s, prepend=time_s[0])
    manoeuvre, regime = segment(
        regimes(acceleration), np.r_[True, (period > _GAP * np.median(period))[1:]]
    )
    zero = np.zeros((n, 1))
    doubted = int(unclear[ordinal].sum())
    said = (
        f"{doubted} of {n} lengths are marked {Quality.FORM_UNCLEAR.word}: "
        "they may all be off by the same share"
        if doubted
        else ""
    )
    stack = Stack(
        observable=observable,
        channel=channel.name,
        surface=channel.surface,
        radius_m=radius,
        values=value[:, None],
        phi_rad=np.zeros(1),
        phi_mean=zero,
        phi_variance=zero,
        count=np.ones((n, 1), np.int64),
        noise=np.full(n, float(np.median(np.abs(np.diff(value))) / (0.6745 * np.sqrt(2.0)))),
        conditions=conditions_of(recording, time_s, speed, acceleration),
        log=np.zeros(n, np.int64),
        manoeuvre=manoeuvre,
        revolution=ordinal,
        regime=regime,
        logs=(recording.log,),
    )
    return stack, said


def _of_strain(
    recording: Recording, channel: Channel, observable: str
) -> tuple[FloatArray, FloatArray, FloatArray, float, NDArray[np.bool_]]:
    """Times, speeds and values of every passage, NaN if something is wrong with it; the rolling
    radius; lengths of unclear form.
    """
    from tirelog.strain.dissipation import dissipation
    from tirelog.strain.footprint.footprint import footprint
    from tirelog.strain.passages.find import find_passages

    radius = recording.setup.tire.radius_m
    passages = find_passages(channel, radius)
    if observable == "patch_length":
        found = footprint(channel, passages)
        value, quality = found.length_m, found.quality
    else:
        energy = dissipation(channel, passages, None, passages.quality)
        value, quality = energy.factor_1_m, energy.quality
    value = np.where(good(quality, Use.COMPARISON), value, np.nan)
    unclear = having(quality, Quality.FORM_UNCLEAR)
    return passages.time_s, passages.speed_m_s, value, radius, unclear


def _of_fronts(
    recording: Recording, channel: Channel, observable: str
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """The same from the fronts of an accelerometer against the encoder."""
    from tirelog.wheel.phase_shift import measure

    for found in measure(recording):
        if found.channel == channel.name:
            value = found.shift_deg if observable == "phase_shift" else found.width_deg
            return (
                found.time_s,
                found.speed_m_s,
                np.where(found.good, np.deg2rad(value), np.nan),
                found.radius_m,
            )
    raise UsageError(
        f"no fronts in channel {channel.name}; an accelerometer with a patch is needed; "
        "give another",
        file=recording.log,
    )
