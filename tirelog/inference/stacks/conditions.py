"""What each revolution was driven under: the setup's constants, or a channel's mean over it."""

from __future__ import annotations

import numpy as np

from tirelog.data.recording import Channel, Conditions, Recording
from tirelog.errors import TirelogError
from tirelog.strain.slip import slip_of
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.conditions import CONDITIONS, SETUP_KEYS
from tirelog.vocabulary.quality import OK

#: a slip is told if it varies by more than so many of its standard errors, which then take a
#: sixteenth of what follows it; with half as many a quarter
_SLIPS = 4.0


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
    if good.sum() < 2 or np.std(slip[good]) < _SLIPS * np.median(error[good]):
        return unknown
    return np.asarray(np.interp(centre_s, time_s[good], slip[good]), dtype=np.float64)


def _channel_mean(channel: Channel, centre_s: FloatArray) -> FloatArray:
    """Mean of a channel around each passage, half a period to either side, (n,).

    A revolution without samples takes its neighbours'.
    """
    half = 0.5 * np.gradient(centre_s) if centre_s.size > 1 else np.full(1, 0.05)
    below = [_Below(centre_s - half), _Below(centre_s + half)]
    between = np.full(centre_s.size, np.nan)
    last = np.zeros(0), np.zeros(0)
    for start, values in channel.blocks():
        time_s = channel.axis.time(start, start + values.size)
        good = np.isfinite(values)
        if not good.any():
            continue
        for edge in below:
            edge.pass_by(time_s[good], values[good])
        time_s, values = np.append(last[0], time_s[good]), np.append(last[1], values[good])
        here = np.isnan(between) & (centre_s <= time_s[-1])
        between[here] = np.interp(centre_s[here], time_s, values)
        last = time_s[-1:], values[-1:]
    if not last[0].size:
        return between
    between[np.isnan(between)] = last[1][0]
    count = below[1].count - below[0].count
    mean = (below[1].total - below[0].total) / np.maximum(count, 1)
    return np.where(count > 0, mean, between)


class _Below:
    """Number and sum of the samples that are earlier than each of some times, (n,).

    They are taken as a channel goes by.
    """

    def __init__(self, time_s: FloatArray) -> None:
        self._time_s = time_s
        self.count, self.total = np.zeros(time_s.size, np.int64), np.zeros(time_s.size)
        self._count, self._total = 0, 0.0

    def pass_by(self, time_s: FloatArray, values: FloatArray) -> None:
        """The next samples; what no sample reaches has all of them below it."""
        total = np.cumsum(np.append(self._total, values))
        later = self._time_s > (time_s[0] if self._count else -np.inf)
        place = np.searchsorted(time_s, self._time_s[later])
        self.count[later], self.total[later] = self._count + place, total[place]
        self._count, self._total = self._count + values.size, float(total[-1])
