"""The table `slip`: longitudinal slip of every turn of the wheel, from the vehicle's speed.

    turns of the wheel (encoder, else passages) --distance of the vehicle in each--> metres per turn
        --`wheel.rolling`--> delay of the vehicle's speed, rolling radius R of free rolling
        --> sigma = 1 - omega R / V (P2 (14))

Over whole turns omega R / V is 2 pi R over the distance of one. Positive slip is braking. A radius
that is off by 1 % is a slip of 0.01, as much as hard braking makes: so R is what the vehicle
travels per turn while nothing pulls, in this log, and what a tire slips then counts for none. A
belt is longer at speed: R follows the speed squared if the turns of free rolling surely say so. A
speed that comes late by d is a slip of -d a / v, which the same turns tell and is taken off.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tirelog.data.recording import Channel, Recording
from tirelog.errors import UsageError
from tirelog.strain.passages.kinematics import TURN_RAD
from tirelog.strain.passages.surface import trusted_passages
from tirelog.strain.speed import speed_channels, speed_columns, turns_around
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import Quality, marked, quality_column
from tirelog.wheel.rolling import FREE_M_S2, LEAST_TURNS, Rolling, WheelTurns, rolling

#: slip that the delay's standard error may make of a row before it is marked: a quarter of what
#: moderate braking makes; doubled, rows are `ok` of which half may be the delay
_DELAYED = 0.005


@dataclass(frozen=True)
class SlipOfChannel:
    """The turns that one channel tells: the table's columns, sentences on them."""

    columns: dict[str, Any]
    remarks: tuple[str, ...]


def slip_of(recording: Recording) -> Iterator[SlipOfChannel]:
    """The slip of every turn.

    UsageError: no vehicle speed, nothing that tells the turns, or no radius to go by.
    """
    references = recording.of_kind("vehicle_speed")
    if not references:
        raise UsageError(
            "the log has no vehicle speed, without which no slip is told",
            allowed="allowed is a log with a channel of kind vehicle_speed",
            do="add it to the setup",
            file=recording.log,
        )
    for columns, wheel, remarks in _turns(recording):
        yield _slip(recording, references[0], columns, wheel, remarks)


def _turns(recording: Recording) -> Iterator[tuple[Mapping[str, Any], WheelTurns, Sequence[str]]]:
    """(columns of the table `speed`, its turns, remarks) of each channel that tells the turns."""
    channels = speed_channels(recording)
    if not channels or recording.of_kind("wheel_encoder"):
        from tirelog.wheel.speed_table import encoder_speed  # only here: it needs more of scipy

        yield encoder_speed(recording)
        return
    for channel in channels:
        passages = trusted_passages(recording, channel)
        yield speed_columns(recording.log, passages), turns_around(passages), []


def _slip(
    recording: Recording,
    reference: Channel,
    columns: Mapping[str, Any],
    wheel: WheelTurns,
    remarks: Sequence[str],
) -> SlipOfChannel:
    found = rolling(reference, wheel)
    radius, radius_se, said = _radius(recording, reference, found)
    with np.errstate(invalid="ignore", divide="ignore"):
        period = (wheel.end_s - wheel.begin_s) / wheel.turns
        slip = 1.0 - TURN_RAD * radius / found.metres
        share = np.abs(1.0 - slip)
        error = np.hypot(found.metres_se / found.metres, radius_se / radius) * share
        delayed = np.abs(found.change_m_s) * found.delay_se_s / found.metres * share
    begin, end = (at + found.delay_s for at in (wheel.begin_s, wheel.end_s))
    outside = (begin < reference.axis.at(0.0)) | (end > reference.axis.at(reference.size - 1.0))
    lost = (wheel.turns > 0) & ~np.isfinite(found.metres)
    quality = (
        wheel.quality
        | marked(delayed > _DELAYED, Quality.DELAY_UNKNOWN)
        | marked(lost & outside, Quality.EDGE_OF_LOG)
        | marked(lost & ~outside, Quality.GAP)
    )
    table = {name: columns[name] for name in ("log", "channel", "revolution", "time_s")} | {
        "speed_m_s": columns["speed_m_s"],
        "vehicle_speed_m_s": found.metres / period,
        "slip": slip,
        "slip_se": error,
        "slip_delay_se": delayed,
        "quality": quality_column(quality),
    }
    late = f"{reference.name} late by {found.delay_s:.3f} +- {found.delay_se_s:.3f} s, taken off"
    return SlipOfChannel(table, (*remarks, said, late))


def _radius(
    recording: Recording, reference: Channel, found: Rolling
) -> tuple[FloatArray | float, FloatArray | float, str]:
    """(rolling radius, its standard error [m], what was done)."""
    tire, count = recording.setup.tire, int(found.free.sum())
    if np.isfinite(found.mean_radius_m):
        ends = found.radius_m[found.free]
        radii = (
            f"{ends.min():.5f} to {ends.max():.5f} m per radian, by the speed squared,"
            if found.grows
            else f"{found.mean_radius_m:.5f} m per radian"
        )
        return (
            found.radius_m,
            found.radius_se_m,
            f"slip against {reference.name}: {radii} in {count} turns of free rolling, whose slip "
            "counts as none",
        )
    if tire.rolling_radius_m is None:
        raise UsageError(
            f"{count} turns below {FREE_M_S2:g} m/s^2, and the setup has no rolling radius: "
            "no slip can be told",
            allowed=f"allowed are {LEAST_TURNS} turns of free rolling, or rolling_radius_m",
            do="give a log with a cruise, or the radius in the setup",
            file=recording.log,
        )
    return (
        tire.rolling_radius_m,
        0.0,
        f"slip against {reference.name} by the setup's rolling radius, for want of free rolling: "
        "a radius off by 1 % is a slip of 0.01",
    )
