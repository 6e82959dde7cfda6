"""Recordings to stacks: one channel cut into revolutions and laid on one grid of angle bins, raw, with what each was driven under.

    Recording --find_passages--> passage times --`align.refine`--> theta(t) --bins--> Stack (n, m)

Bin means are raw (no amplitude, shift or baseline is taken out here: `cells` does that and keeps account of it), at the angles the samples
really have.  The first and last revolution of an unbroken run of passages are left out, since half of their angle is extrapolated.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.discrepancy.align import WheelAngle, refine, split_turns
from tirelog.discrepancy.manoeuvres import accelerations, regimes, segment
from tirelog.discrepancy.scalars import SCALARS, SOURCES, scalar_stack
from tirelog.errors import UsageError
from tirelog.estimators.passages import Passages, find_passages
from tirelog.recording import Channel, Conditions, Recording, Stack

FloatArray = NDArray[np.float64]

ANGLES = 256
#: observable -> kinds of channel that measure it
KINDS = {"strain": ("fbg_strain", "strain"), "radial_acceleration": ("radial_acceleration",), **SOURCES}
_SHORTEST_RUN = 5
_CONDITION_KINDS = {
    "vertical_load": "load_N",
    "inflation_pressure": "inflation_pressure_Pa",
    "temperature": "temperature_K",
    "fbg_temperature": "temperature_K",
}


@dataclass(frozen=True)
class Turns:
    """The revolutions of one unbroken run: ordinal of each passage in the log (k,), refined times (k,) and the angle between them."""

    ordinal: NDArray[np.int64]
    angle: WheelAngle


def observe_channel(recording: Recording, observable: str, name: str | None = None) -> Channel:
    """The channel of the recording that measures the observable: the named one, or the first.  UsageError where there is none."""
    if name is not None and name in recording.channels:
        return recording.channels[name]
    found = recording.of_kind(*KINDS.get(observable, ()))
    if name is not None or not found:
        have = ", ".join(f"{c.name} ({c.kind})" for c in recording.channels.values()) or "none"
        wanted = name or f"of the observable {observable} ({' or '.join(KINDS.get(observable, (observable,)))})"
        raise UsageError(f"no channel {wanted}; the log has {have}; take a model for what is measured, or another log", file=recording.log)
    return found[0]


def stacks_from_logs(
    recordings: Iterable[Recording], observable: str = "strain", channel: str | None = None, *, angles: int = ANGLES
) -> list[Stack]:
    """One stack per recording, manoeuvres numbered through all of them; UsageError where a log holds fewer than ten whole revolutions."""
    parts: list[Stack] = []
    for recording in recordings:
        source = observe_channel(recording, observable, channel)
        if observable in SCALARS:
            part = scalar_stack(recording, source, observable)
        else:
            part = stack_channel(recording, source, observable, angles=angles)
        first = 1 + int(parts[-1].manoeuvre.max()) if parts else 0
        parts.append(replace(part, log=np.full(len(part), len(parts)), manoeuvre=part.manoeuvre + first))
    logs = tuple(part.logs[0] for part in parts)
    return [replace(part, logs=logs) for part in parts]


def stack_channel(recording: Recording, channel: Channel, observable: str, *, angles: int = ANGLES) -> Stack:
    """The stack of one channel of one recording."""
    radius = recording.setup.tire.radius_m
    passages = find_passages(channel, radius)
    time_s, values = channel.axis.time(), channel.read()
    rows = [_rows(turns, time_s, values, angles) for turns in _runs(passages, time_s, values)]
    n = sum(part[0].size for part in rows)
    if n < 10:
        refuse_swapped_surface(recording, channel, radius)
        raise UsageError(
            f"{n} whole revolutions in channel {channel.name}; at least ten are needed to see what repeats; give a longer log",
            file=recording.log,
        )
    ordinal, centre, speed, mean, phi_mean, phi_variance, count = (np.concatenate(x) for x in zip(*rows, strict=True))
    acceleration = np.concatenate([accelerations(part[1], part[2] * radius) for part in rows])
    breaks = np.concatenate([np.r_[True, np.zeros(part[0].size - 1, bool)] for part in rows])
    manoeuvre, regime = segment(regimes(acceleration), breaks)
    grid = np.asarray((np.arange(angles) + 0.5) * (2.0 * np.pi / angles) - np.pi, dtype=np.float64)
    return Stack(
        observable=observable,
        channel=channel.name,
        surface=channel.surface,
        radius_m=radius,
        values=mean,
        phi_rad=grid,
        phi_mean=phi_mean,
        phi_variance=phi_variance,
        count=count,
        noise=np.full(n, passages.noise),
        conditions=conditions_of(recording, centre, speed * radius, acceleration),
        log=np.zeros(n, np.int64),
        manoeuvre=manoeuvre,
        revolution=ordinal,
        regime=regime,
        logs=(recording.log,),
    )


def refuse_swapped_surface(recording: Recording, channel: Channel, radius: float) -> None:
    """UsageError where the patch is found once the channel is taken for one of the other surface."""
    other = {"outer": "inner", "inner": "outer"}[channel.surface]
    if channel.kind == "radial_acceleration" or len(find_passages(replace(channel, surface=other), radius)) < 10:
        return
    extremum = "a minimum, as the outer surface (groove)" if other == "outer" else "a maximum, as the inner surface (liner)"
    raise UsageError(
        f"channel {channel.name} shows {extremum} does in the patch, and its setup says {channel.surface}; the two must agree; "
        f'write surface = "{other}"',
        file=recording.log,
    )


def _runs(passages: Passages, time_s: FloatArray, values: FloatArray) -> Iterable[Turns]:
    """Unbroken runs of passages one turn apart, refined by the matched filter."""
    known = np.flatnonzero(np.isfinite(passages.time_s))
    cut = np.flatnonzero(~(passages.turn_after[known[:-1]] & (np.diff(known) == 1))) + 1
    for index in np.split(known, cut):
        if index.size < _SHORTEST_RUN:
            continue
        centre = passages.time_s[index]
        ends = (2 * centre[0] - centre[1], 2 * centre[-1] - centre[-2])
        low, high = np.searchsorted(time_s, ends)
        yield Turns(index, WheelAngle.through(refine(time_s[low:high], values[low:high], centre)))


def _rows(turns: Turns, time_s: FloatArray, values: FloatArray, m: int) -> tuple[NDArray, ...]:
    """Ordinals, times and angular speeds (k - 2,), then bin means, mean angles, variances and counts (k - 2, m), without the two ends."""
    centre = turns.angle.centre_s
    low, high = np.searchsorted(time_s, [centre[0], centre[-1]])
    t, y = time_s[low:high], values[low:high]
    t, y = t[np.isfinite(y)], y[np.isfinite(y)]
    turn, phi = split_turns(turns.angle.theta(t))
    inside = (turn >= 1) & (turn < centre.size - 1)
    n = centre.size - 2
    y, phi = y[inside], phi[inside]
    cell = (turn[inside] - 1) * m + np.minimum(((phi + np.pi) * (m / (2.0 * np.pi))).astype(np.int64), m - 1)
    count = np.bincount(cell, minlength=n * m)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.bincount(cell, y, n * m) / count
        angle = np.bincount(cell, phi, n * m) / count
        variance = np.bincount(cell, (phi - angle[cell]) ** 2, n * m) / count
    shape = (n, m)
    return (
        turns.ordinal[1:-1],
        centre[1:-1],
        turns.angle.speed_rad_s(centre[1:-1]),
        mean.reshape(shape),
        angle.reshape(shape),
        variance.reshape(shape),
        count.reshape(shape),
    )


def conditions_of(recording: Recording, centre_s: FloatArray, speed_m_s: FloatArray, acceleration_m_s2: FloatArray) -> Conditions:
    """What each revolution was driven under: the setup's constants, or a channel's mean over the revolution where there is one."""
    given = recording.setup.conditions
    values: dict[str, FloatArray | float] = {
        name: float("nan") if getattr(given, name) is None else getattr(given, name)
        for name in ("load_N", "inflation_pressure_Pa", "distance_km", "water_depth_mm")
    }
    for kind, name in _CONDITION_KINDS.items():
        for channel in recording.of_kind(kind)[:1]:
            mean = _channel_mean(channel, centre_s)
            if np.isfinite(mean).all():
                values[name] = mean - mean[0] if kind == "temperature" else mean
    return Conditions.of(centre_s.size, speed_m_s=speed_m_s, acceleration_m_s2=acceleration_m_s2, time_s=centre_s, **values)


def _channel_mean(channel: Channel, centre_s: FloatArray) -> FloatArray:
    """Mean of a channel around each passage, half a period to either side, (n,); a revolution without samples takes its neighbours'."""
    half = 0.5 * np.gradient(centre_s) if centre_s.size > 1 else np.full(1, 0.05)
    values = channel.read()
    good = np.isfinite(values)
    if not good.any():
        return np.full(centre_s.size, np.nan)
    time_s = channel.axis.time()[good]
    total = np.r_[0.0, np.cumsum(values[good])]
    low, high = np.searchsorted(time_s, centre_s - half), np.searchsorted(time_s, centre_s + half)
    count = high - low
    mean = (total[high] - total[low]) / np.maximum(count, 1)
    return np.where(count > 0, mean, np.interp(centre_s, time_s, values[good]))


def joined(stacks: Sequence[Stack]) -> Stack:
    """Several stacks on the same angles as one."""
    names = ("values", "phi_mean", "phi_variance", "count", "noise", "log", "manoeuvre", "revolution", "regime")
    rows: dict[str, Any] = {name: np.concatenate([getattr(stack, name) for stack in stacks]) for name in names}
    return replace(stacks[0], conditions=Conditions.concatenate([stack.conditions for stack in stacks]), **rows)
