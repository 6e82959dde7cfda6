"""Numbers per revolution as stacks with one angle.

Patch length, dissipation factor, phase shift, patch width.

Recording --estimators--> a row per passage, those with nothing wrong
    --> Stack (n, 1), the same conditions and manoeuvres as a waveform's
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel, Recording, Stack
from tirelog.errors import UsageError
from tirelog.inference.stacks.manoeuvres import accelerations, regimes, segment
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import Quality, QualityFlags, Use, good, having

if TYPE_CHECKING:
    from tirelog.strain.passages.find import Passages

#: a passage this much later than its neighbours' periods starts a new manoeuvre; twice as much
#: joins what a pause of up to six periods parts
_GAP = 3.0


def scalar_stack(recording: Recording, channel: Channel, observable: str) -> tuple[Stack, str]:
    """The stack (n, 1) of one number per revolution, and '' or what is to be known of it.

    UsageError: fewer than ten revolutions have the number.
    """
    from tirelog.inference.stacks.conditions import conditions_of

    time_s, speed, value, radius, unclear = MEASURED[observable](recording, channel)
    ordinal = np.flatnonzero(np.isfinite(value) & np.isfinite(speed) & np.isfinite(time_s))
    n = ordinal.size
    if n < 10:
        raise UsageError(
            f"{n} revolutions with a {observable} in channel {channel.name}",
            allowed="at least ten are needed",
            do="give a longer log",
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


#: times [s], speeds [m/s] and values of every passage, (n,), NaN if something is wrong with it; the
#: rolling radius [m]; whether the value is of unclear form, (n,)
Numbers = tuple[FloatArray, FloatArray, FloatArray, float, NDArray[np.bool_]]


def patch_lengths(recording: Recording, channel: Channel) -> Numbers:
    """The patch length [m] of every passage of a strain channel."""
    from tirelog.runs.bursts import mended
    from tirelog.strain.footprint.footprint import footprint
    from tirelog.strain.passages.surface import trusted_passages

    radius, channel = recording.setup.tire.radius_m, mended(channel)
    passages = trusted_passages(recording, channel)
    found = footprint(channel, passages)
    return _of_passages(passages, radius, found.length_m, found.quality)


def dissipation_factors(recording: Recording, channel: Channel) -> Numbers:
    """The dissipation factor [1/m] of every passage of a strain channel."""
    from tirelog.runs.bursts import mended
    from tirelog.strain.dissipation import dissipation
    from tirelog.strain.passages.surface import trusted_passages

    radius, channel = recording.setup.tire.radius_m, mended(channel)
    passages = trusted_passages(recording, channel)
    found = dissipation(channel, passages, None, passages.quality)
    return _of_passages(passages, radius, found.factor_1_m, found.quality)


def _of_passages(
    passages: Passages, radius_m: float, value: FloatArray, quality: QualityFlags
) -> Numbers:
    value = np.where(good(quality, Use.COMPARISON), value, np.nan)
    unclear = having(quality, Quality.FORM_UNCLEAR)
    return passages.time_s, passages.speed_m_s, value, radius_m, unclear


def phase_shifts(recording: Recording, channel: Channel) -> Numbers:
    """The phase shift [rad] of every passage of an accelerometer against the encoder."""
    return _of_fronts(recording, channel, "shift_deg")


def patch_widths(recording: Recording, channel: Channel) -> Numbers:
    """The patch width [rad] of every passage of an accelerometer against the encoder."""
    return _of_fronts(recording, channel, "width_deg")


def _of_fronts(recording: Recording, channel: Channel, field: str) -> Numbers:
    from tirelog.wheel.phase_shift import measure_phase_shift

    for found in measure_phase_shift(recording):
        if found.channel == channel.name:
            value = np.where(found.good, np.deg2rad(getattr(found, field)), np.nan)
            unclear = np.zeros(value.size, bool)
            return found.time_s, found.speed_m_s, value, found.radius_m, unclear
    raise UsageError(
        f"no fronts in channel {channel.name}",
        allowed="an accelerometer with a patch is needed",
        do="give another",
        file=recording.log,
    )


#: observable of one number per revolution -> what measures it
MEASURED: Mapping[str, Callable[[Recording, Channel], Numbers]] = {
    "patch_length": patch_lengths,
    "dissipation_factor": dissipation_factors,
    "phase_shift": phase_shifts,
    "patch_width": patch_widths,
}
