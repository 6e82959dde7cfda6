"""Contiguous stretches of one regime: the unit of replication.

    speed (n,), time (n,) of one log's revolutions -> acceleration (n,) -> regime (n,)
        -> manoeuvre (n,) 0, 1, 2, ...

Neighbouring revolutions share road, load and warmth; a test that flips their signs one by one
raises alarms on nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel, Conditions, Recording, Stack
from tirelog.errors import TirelogError, UsageError
from tirelog.strain.slip import slip_of
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.conditions import CONDITIONS, SETUP_KEYS
from tirelog.vocabulary.quality import OK, Quality, Use, good, having

# ---- What each revolution was driven under: the setup's constants, or a channel's mean over it.


def conditions_of(
    recording: Recording, centre_s: FloatArray, speed_m_s: FloatArray, acceleration_m_s2: FloatArray
) -> Conditions:
    """The conditions that each revolution was driven under.

    The setup's constants, or a channel's mean over the revolution if there is one; slip from the
    wheel's encoder and the vehicle's speed.
    """
    given = recording.setup.conditions
    values: dict[str, FloatArray | float] = {
        name: float("nan") if getattr(given, name) is None else getattr(given, name)
        for name in SETUP_KEYS
    }
    for name, condition in CONDITIONS.items():
        for kind in condition.kinds:
            for channel in recording.of_kind(kind)[:1]:
                mean = _channel_mean(channel, centre_s)
                if np.isfinite(mean).all():
                    values[name] = mean - mean[0] if kind in condition.from_start else mean
    values["slip"] = measured_slip(recording, centre_s)
    return Conditions.of(
        centre_s.size,
        speed_m_s=speed_m_s,
        acceleration_m_s2=acceleration_m_s2,
        time_s=centre_s,
        **values,
    )


def measured_slip(recording: Recording, centre_s: FloatArray) -> FloatArray:
    """Slip by P2 (14) at each passage, (n,), braking positive; NaN if the log does not tell one.

    From an encoder and the vehicle's speed (`tirelog slip`). A log whose slip does not stand out of
    its errors tells none: then an effect of slip goes by the acceleration, as without the channels.
    """
    unknown = np.full(centre_s.size, np.nan)
    if not (recording.of_kind("wheel_encoder") and recording.of_kind("vehicle_speed")):
        return unknown
    try:
        columns = next(slip_of(recording)).columns
    except TirelogError:
        return unknown
    time_s, slip, own, late = (
        np.asarray(columns[name]) for name in ("time_s", "slip", "slip_se", "slip_delay_se")
    )
    error = np.hypot(own, late)
    good = (np.asarray(columns["quality"]) == OK) & np.isfinite(slip) & np.isfinite(error)
    # a slip is known if it varies by more than so many of its standard errors, which then take a
    # sixteenth of what follows it; with half as many a quarter
    if good.sum() < 2 or np.std(slip[good]) < 4.0 * np.median(error[good]):
        return unknown
    return np.asarray(np.interp(centre_s, time_s[good], slip[good]), dtype=np.float64)


def _channel_mean(channel: Channel, centre_s: FloatArray) -> FloatArray:
    """Mean of a channel around each passage, half a period to either side, (n,).

    A revolution without samples takes its neighbours'.
    """
    half = 0.5 * np.gradient(centre_s) if centre_s.size > 1 else np.full(1, 0.05)
    edges = np.stack([centre_s - half, centre_s + half])
    # number and sum of the samples that are earlier than each edge, as the channel goes by
    count, total = np.zeros(edges.shape, np.int64), np.zeros(edges.shape)
    between = np.full(centre_s.size, np.nan)
    last = np.zeros(0), np.zeros(0)
    for start, values in channel.blocks():
        good = np.isfinite(values)
        if not good.any():
            continue
        time_s, values = channel.axis.time(start, start + values.size)[good], values[good]
        place = np.searchsorted(time_s, edges)
        count += place
        total += np.cumsum(np.append(0.0, values))[place]
        time_s, values = np.append(last[0], time_s), np.append(last[1], values)
        here = np.isnan(between) & (centre_s <= time_s[-1])
        between[here] = np.interp(centre_s[here], time_s, values)
        last = time_s[-1:], values[-1:]
    if not last[0].size:
        return between
    between[np.isnan(between)] = last[1][0]
    inside = count[1] - count[0]
    return np.where(inside > 0, (total[1] - total[0]) / np.maximum(inside, 1), between)


#: size of the acceleration [m/s^2] below which a stretch is a cruise; twice as much calls a gentle
#: coasting down a cruise
CRUISE_M_S2 = 0.2
#: deceleration [m/s^2] from which it is braking rather than coasting; twice as much calls ordinary
#: braking coasting
BRAKE_M_S2 = 1.5
#: a stretch shorter than this many revolutions belongs to its neighbour; twice as many join short
#: brakings to what is beside them
SHORTEST = 4
#: revolutions to either side over which an acceleration is the slope of the speed; twice as many
#: tell it to a third of the error, and round its steps off over twice as long
_HALF_WINDOW = 3


def accelerations(time_s: FloatArray, speed_m_s: FloatArray) -> FloatArray:
    """Acceleration (n,) [m/s^2]: slope of the speed over +-3 revolutions."""
    n = time_s.size
    if n < 3:
        return np.zeros(n)
    low = np.clip(np.arange(n) - _HALF_WINDOW, 0, n - 1)
    high = np.clip(np.arange(n) + _HALF_WINDOW, 0, n - 1) + 1
    sums = [
        np.concatenate([[0.0], np.cumsum(x)])
        for x in (time_s, speed_m_s, time_s**2, time_s * speed_m_s)
    ]
    t, v, tt, tv = (s[high] - s[low] for s in sums)
    count = high - low
    spread = tt - t * t / count
    slope: FloatArray = (tv - t * v / count) / np.where(spread > 0, spread, 1.0)
    return slope


def regimes(acceleration_m_s2: FloatArray) -> NDArray[np.str_]:
    """'cruise', 'drive', 'coast' or 'brake' for each revolution."""
    a = acceleration_m_s2
    return np.select(
        [np.abs(a) < CRUISE_M_S2, a > 0, a > -BRAKE_M_S2], ["cruise", "drive", "coast"], "brake"
    ).astype(np.str_)


def bends(lateral_m_s2: FloatArray) -> NDArray[np.bool_]:
    """Whether the vehicle bends off or straightens up before each revolution, (n,).

    Never if the lateral acceleration [m/s^2] is not known.
    """
    # a lateral acceleration below 0.5 m/s^2 counts as straight on: twice as much would average
    # a gentle bend with it
    side = np.sign(np.trunc(np.nan_to_num(lateral_m_s2) / 0.5))
    return np.asarray(np.diff(side, prepend=side[:1]) != 0.0)


def segment(
    regime: NDArray[np.str_], breaks: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.str_]]:
    """The manoeuvre (n,), numbered from 0, and the regime (n,) of each revolution.

    `breaks[i]` True: a gap lies before revolution i.

    A stretch below `SHORTEST` joins the longer of its neighbours that no gap parts from it. Between
    two gaps it joins the stretch before it, and the first of a log the one after it: so few
    revolutions are no manoeuvre, and none is left out. Each joining leaves one stretch less, so it
    ends.
    """
    regime, breaks = regime.copy(), breaks.copy()
    while True:
        start = np.flatnonzero(np.r_[True, (regime[1:] != regime[:-1]) | breaks[1:]])
        length = np.diff(np.r_[start, regime.size])
        short = np.flatnonzero(length < SHORTEST)
        if not short.size or start.size == 1:
            break
        i = short[np.argmin(length[short])]
        before = length[i - 1] if i > 0 and not breaks[start[i]] else -1
        after = length[i + 1] if i + 1 < start.size and not breaks[start[i + 1]] else -1
        joins_before = before >= after if max(before, after) >= 0 else i > 0
        regime[start[i] : start[i] + length[i]] = (
            regime[start[i] - 1] if joins_before else regime[start[i + 1]]
        )
        breaks[start[i] if joins_before else start[i + 1]] = False
    return np.repeat(np.arange(start.size), length), regime


# ---- Numbers per revolution as stacks with one angle.
#
# Patch length, dissipation factor, phase shift, patch width.
#
# Recording --estimators--> a row per passage, those with nothing wrong
#     --> Stack (n, 1), the same conditions and manoeuvres as a waveform's


def scalar_stack(recording: Recording, channel: Channel, observable: str) -> tuple[Stack, str]:
    """The stack (n, 1) of one number per revolution, and '' or what is to be known of it.

    UsageError: fewer than ten revolutions have the number.
    """

    time_s, speed, value, radius, unclear = MEASURED[observable](recording, channel, observable)
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
    # a passage this much later than its neighbours' periods starts a new manoeuvre; twice as much
    # joins what a pause of up to six periods parts
    conditions = conditions_of(recording, time_s, speed, acceleration)
    breaks = np.r_[True, (period > 3.0 * np.median(period))[1:]]
    breaks |= bends(conditions.lateral_acceleration_m_s2)
    manoeuvre, regime = segment(regimes(acceleration), breaks)
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
        conditions=conditions,
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


def strain_numbers(recording: Recording, channel: Channel, observable: str) -> Numbers:
    """Patch length [m] or dissipation factor [1/m] of every passage of a strain channel."""
    from tirelog.runs.in_memory import without_spikes
    from tirelog.strain.dissipation import dissipation
    from tirelog.strain.footprint.footprint import footprint
    from tirelog.strain.passages.find import trusted_passages

    radius, channel = recording.setup.tire.radius_m, without_spikes(channel)
    passages = trusted_passages(recording, channel)
    if observable == "patch_length":
        edges = footprint(channel, passages)
        value, quality = edges.length_m, edges.quality
    else:
        lost = dissipation(channel, passages, None, passages.quality)
        value, quality = lost.factor_1_m, lost.quality
    value = np.where(good(quality, Use.COMPARISON), value, np.nan)
    unclear = having(quality, Quality.FORM_UNCLEAR)
    return passages.time_s, passages.speed_m_s, value, radius, unclear


def front_angles(recording: Recording, channel: Channel, observable: str) -> Numbers:
    """Phase shift or patch width [rad] of every passage of an accelerometer, by the encoder."""
    from tirelog.wheel.phase_shift import measure_phase_shift

    for found in measure_phase_shift(recording):
        if found.channel == channel.name:
            angle = found.shift_deg if observable == "phase_shift" else found.width_deg
            value = np.where(found.good, np.deg2rad(angle), np.nan)
            return found.time_s, found.speed_m_s, value, found.radius_m, np.zeros(value.size, bool)
    raise UsageError(
        f"no fronts in channel {channel.name}",
        allowed="an accelerometer with a patch is needed",
        do="give another",
        file=recording.log,
    )


#: observable of one number per revolution -> what measures it
MEASURED: Mapping[str, Callable[[Recording, Channel, str], Numbers]] = {
    "patch_length": strain_numbers,
    "dissipation_factor": strain_numbers,
    "phase_shift": front_angles,
    "patch_width": front_angles,
}
