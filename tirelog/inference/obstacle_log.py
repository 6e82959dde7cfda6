"""A log that met an obstacle.

What its steady revolutions look like, what repeats in them, and where something else happened.

    Recording with a [road] + Stack
        --`transient_log`--> TransientLog: samples, steady waveform T(phi), rough times of the hits
    Stack --`steady_revolutions`--> the revolutions off the obstacle, for the steady comparison

An obstacle shows as samples that leave T(phi) by far more than the steady revolutions do. Times of
hits are rough here, within a revolution; `diagnosis.obstacles` refines them with the model's
answer. Passages that an obstacle disturbs do not tell the wheel's angle: it is drawn smoothly
through those before and after.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import uniform_filter1d

from tirelog.data.recording import Channel, Conditions, Recording, Stack
from tirelog.data.setup import RoadSetup
from tirelog.errors import UsageError
from tirelog.inference.stacks.align import PassageAngle, split_turns, template
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2

#: A hit is compared for this long [s] after the obstacle was reached. Twice as long takes more
#: revolutions after each hit from the steady ones.
WINDOW_S = 0.5
#: Mean square over this time [s] that is so many times its median is no steady rolling. Twice as
#: many leave obstacles in the steady rolling that stand out 1.4 times as far.
_SMOOTH_S, _STANDS_OUT = 0.01, 8.0
#: Outbursts that are taken for hits at most, evenly over the log. Twice as many take twice as
#: long.
_MOST_HITS = 12
#: A hit closer than this [s] to an end of the log cannot be compared. Twice as much passes over
#: hits that are as near to an end.
_ROOM_S = 0.1
#: Revolutions without a passage that may be counted by the speed, and by how much of one the count
#: may be off. Twice as far, 0.5, any number of turns fits.
_LONGEST_GAP, _PLAIN = 20.0, 0.25
#: Steady rolling nearest to a hit that it is compared with [s]. Twice as much averages over twice
#: as many turns, and over twice as much of a speed that changes.
_STEADY_S = 4.0
#: Turns before and after a hit whose passages may be disturbed. Twice as far leaves fewer passages
#: to know the wheel's angle by.
DISTURBED = (-0.3, 1.2)
#: Steady revolutions that are needed to know what repeats. Twice as many refuse logs with fewer
#: than ten beside the obstacles.
_FEWEST_STEADY = 5


@dataclass(frozen=True)
class TransientLog:
    """One channel of one log around its obstacles.

    time_s, values  (N,) samples that are there
    passages_s      (k,), turns (k,) their numbers, and wheel: theta(t) through those that no
                    obstacle disturbs
    steady          T(phi), of the observable (for an acceleration less gravity, over (Omega /
                    Omega_0)^2, Omega_0 `spin_rad_s`)
    calm            (N,) True where no obstacle disturbs; hits_s rough times, (h,)
    """

    log: str
    channel: str
    surface: str
    observable: str
    radius_m: float
    road: RoadSetup
    folder: str
    conditions: Conditions
    time_s: FloatArray
    values: FloatArray
    passages_s: FloatArray
    turns: FloatArray
    wheel: PassageAngle
    steady: CubicSpline
    spin_rad_s: float
    calm: NDArray[np.bool_]
    hits_s: FloatArray
    rate_Hz: float

    def off(self) -> FloatArray:
        """Samples less the steady waveform at the angle of the passages, (N,)."""
        return self.values - self.steady_at(
            self.wheel.theta(self.time_s), self.wheel.speed_rad_s(self.time_s)
        )

    def steady_at(self, theta_rad: FloatArray, spin_rad_s: FloatArray) -> FloatArray:
        """T at wheel angles (m,) and spins (m,)."""
        phi = split_turns(theta_rad)[1]
        wave: FloatArray = self.steady(phi)
        return (
            wave * (spin_rad_s / self.spin_rad_s) ** 2 + _gravity(phi)
            if self.observable == "radial_acceleration"
            else wave
        )


def _gravity(phi_rad: FloatArray) -> FloatArray:
    """What of an accelerometer's reading does not follow the spin, (m,)."""
    return -STANDARD_GRAVITY_M_S2 * np.cos(phi_rad)


def transient_log(recording: Recording, channel: Channel, stack: Stack) -> TransientLog:
    """The log around its obstacles.

    UsageError if fewer than five steady revolutions, or no obstacle, are in it.

    stack  the channel's own revolutions of this log
    """
    time_s, values = channel.axis.time(), channel.read()
    good = np.isfinite(values)
    time_s, values = time_s[good], values[good]
    passages, turns = _numbered(stack)
    wheel = PassageAngle.through(passages, turns)
    inside = (time_s >= wheel.centre_s[0]) & (time_s <= wheel.centre_s[-1])
    time_s, values = time_s[inside], values[inside]
    spin = float(np.median(stack.conditions.speed_m_s)) / stack.radius_m
    made = TransientLog(
        log=recording.log,
        channel=channel.name,
        surface=channel.surface,
        observable=stack.observable,
        radius_m=stack.radius_m,
        road=recording.setup.road,
        folder=recording.setup.file or "",
        conditions=stack.conditions,
        time_s=time_s,
        values=values,
        passages_s=passages,
        turns=turns,
        wheel=wheel,
        steady=CubicSpline([0.0, 1.0], [0.0, 0.0]),
        spin_rad_s=spin,
        calm=np.ones(time_s.size, bool),
        hits_s=np.zeros(0),
        rate_Hz=channel.axis.rate_Hz,
    )
    made = _with_steady(made)
    for _ in range(2):  # the first steady waveform still holds the obstacles
        made = _with_steady(_calmed(made, _hits(made)))
    return made


def _numbered(stack: Stack) -> tuple[FloatArray, FloatArray]:
    """Times and numbers of passages, (k,) each.

    They go through stretches where an obstacle hid some: their number follows from the speed. If
    that is not plain (the wheel stood, or a long gap) the longest stretch is taken.
    """
    time = stack.conditions.time_s
    rate = stack.conditions.speed_m_s / (2.0 * np.pi * stack.radius_m)
    passed = np.diff(time) * 0.5 * (rate[1:] + rate[:-1])
    plain = (np.abs(passed - np.round(passed)) < _PLAIN) & (passed < _LONGEST_GAP)
    runs = np.split(np.arange(time.size), np.flatnonzero(~plain) + 1)
    longest = max(runs, key=len)
    steps = np.round(passed[longest[:-1]])
    return time[longest], np.concatenate([[0.0], np.cumsum(steps)])


def _with_steady(log: TransientLog) -> TransientLog:
    """The log with T from the calm samples.

    Bin medians would need more revolutions; means do after two rounds.
    """
    theta = log.wheel.theta(log.time_s[log.calm])
    turn, phi = split_turns(theta)
    values = log.values[log.calm]
    if log.observable == "radial_acceleration":
        values = (values - _gravity(phi)) * (
            log.spin_rad_s / log.wheel.speed_rad_s(log.time_s[log.calm])
        ) ** 2
    turns = np.unique(turn).size
    if turns < _FEWEST_STEADY:
        raise UsageError(
            f"{turns} steady revolutions beside the obstacles of channel {log.channel}",
            allowed=f"{_FEWEST_STEADY} or more are needed to know what the obstacle adds",
            do="give a log that rolls on before or after it",
            file=log.log,
        )
    return replace(log, steady=template(phi, values))


def around(log: TransientLog, time_s: float) -> TransientLog:
    """The log with the calm samples nearest to a time alone, and their T.

    What speed and torque are there, the steady waveform knows.
    """
    calm = np.flatnonzero(log.calm)
    nearest = np.argsort(np.abs(log.time_s[calm] - time_s), kind="stable")[
        : round(_STEADY_S * log.rate_Hz)
    ]
    near = np.zeros(log.time_s.size, bool)
    near[calm[nearest]] = True
    return _with_steady(replace(log, calm=near))


def _calmed(log: TransientLog, hits_s: FloatArray) -> TransientLog:
    """The log with these hits: what they leave calm, the wheel's angle by passages off them."""
    turn = 2.0 * np.pi / log.spin_rad_s
    kept = _off(log.passages_s, hits_s, DISTURBED[0] * turn, DISTURBED[1] * turn)
    wheel = log.wheel
    if kept.sum() >= _FEWEST_STEADY:
        wheel = PassageAngle.through(log.passages_s[kept], log.turns[kept])
    calm = _off(log.time_s, hits_s, -turn, WINDOW_S + turn)
    return replace(log, calm=calm, hits_s=hits_s, wheel=wheel)


def _off(
    time_s: FloatArray, hits_s: FloatArray, low_s: FloatArray | float, high_s: FloatArray | float
) -> NDArray[np.bool_]:
    """Which times (n,) are in no hit's stretch, from `low_s` to `high_s` after it."""
    off = np.ones(time_s.size, bool)
    for hit in hits_s:
        off &= (time_s < hit + low_s) | (time_s > hit + high_s)
    return off


def _hits(log: TransientLog) -> FloatArray:
    """Rough times of the hits.

    What the setup says, else the times at which the samples leave the steady waveform.
    """
    road, found = log.road, np.zeros(0)
    if road.time_s is not None:
        found = np.array([road.time_s])
    elif road.position_m is not None:
        driven = log.radius_m * (log.wheel.theta(log.time_s) - log.wheel.theta(log.time_s[:1]))
        driven = driven + log.radius_m * log.wheel.speed_rad_s(log.time_s[:1]) * log.time_s[0]
        found = np.interp([road.position_m], driven, log.time_s, left=np.nan, right=np.nan)
    else:
        found = _outbursts(log)
    found = found[np.isfinite(found)]
    placed = road.time_s is not None or road.position_m is not None
    if road.spacing_m and placed and found.size:
        period = road.spacing_m / (log.radius_m * log.spin_rad_s)
        found = found[0] + period * np.arange(np.floor((log.time_s[-1] - found[0]) / period) + 1)
        # the way driven is known to a percent: what stands out nearby tells better
        seen = _outbursts(log)
        nearest = (
            seen[np.argmin(np.abs(seen[None, :] - found[:, None]), axis=1)] if seen.size else found
        )
        found = np.where(np.abs(nearest - found) < np.pi / log.spin_rad_s, nearest, found)
    found = found[(found > log.time_s[0] + _ROOM_S) & (found < log.time_s[-1] - _ROOM_S)]
    if not found.size:
        raise UsageError(
            f"no obstacle in channel {log.channel} where the setup's [road] says {road.kind}",
            allowed="one that stands out of the steady revolutions is needed",
            do="give time_s or position_m, or leave [road] out",
            file=log.log,
        )
    kept: FloatArray = found[
        np.unique(np.linspace(0, found.size - 1, min(found.size, _MOST_HITS)).round().astype(int))
    ]
    return kept


def _outbursts(log: TransientLog) -> FloatArray:
    """Times at which the samples begin to leave the steady waveform, in order.

    There their mean square off it begins to stand out; the strongest stretches are taken.
    """
    width = max(round(_SMOOTH_S * log.rate_Hz), 3)
    power = uniform_filter1d(log.off() ** 2, width)
    # where the sensor passes the patch more is off, also when nothing happens
    phase = (split_turns(log.wheel.theta(log.time_s))[1] + np.pi) * (64 / (2.0 * np.pi))
    bins = phase.astype(np.int64) % 64
    usual = np.array(
        [np.median(power[bins == b]) if np.any(bins == b) else np.inf for b in range(64)]
    )
    above = power / np.maximum(usual, np.median(usual) * 0.1)[bins]
    times: list[float] = []
    quiet_until = -np.inf
    threshold = max(_STANDS_OUT, 0.02 * float(above.max()))
    for index in np.flatnonzero(above > threshold):
        if log.time_s[index] >= quiet_until:
            times.append(float(log.time_s[index]))
            quiet_until = log.time_s[index] + WINDOW_S
    return np.array(times)


def steady_revolutions(stack: Stack, hits_s: FloatArray) -> Stack:
    """The revolutions that no obstacle disturbs."""
    turn = 2.0 * np.pi * stack.radius_m / stack.conditions.speed_m_s
    return stack.take(_off(stack.conditions.time_s, hits_s, -turn, WINDOW_S + turn))
