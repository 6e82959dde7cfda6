"""The table `slip`: longitudinal slip of every turn of the wheel, from the vehicle's speed.

    turns of the wheel (encoder, else passages) --distance of the vehicle in each--> metres per turn
        --those of free rolling--> rolling radius R --> sigma = 1 - omega R / V (P2 (14))

Over one turn omega R / V is 2 pi R over the distance. Positive slip is braking. A radius that is
off by 1 % is a slip of 0.01, as much as hard braking makes: so R is what the vehicle travels per
turn while nothing pulls, in this log, and what a tire slips then counts for none. A belt is longer
at speed: R follows the speed squared if the turns of free rolling surely say so.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tirelog.data.recording import Channel, Recording
from tirelog.errors import UsageError
from tirelog.strain.passages.kinematics import TURN_RAD
from tirelog.strain.passages.surface import passages_of
from tirelog.strain.speed import (
    LEAST_TURNS,
    speed_by_encoder,
    speed_channels,
    speed_columns,
    travelled,
)
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.quality import OK

#: acceleration up to which a turn rolls freely [m/s^2]: at a tire's usual 0.1 of slip per g that is
#: 0.002; doubled, twice as much of it goes into the radius
FREE_M_S2 = 0.2
#: standard errors by which a radius must grow with the speed squared; half as many would let one
#: log of twenty bend by chance. And turns farther than so many standard deviations from the rest
#: are left out of it: a turn over a border of manoeuvres rolls freely for a part of it only
_SURE_SIGMAS, _OUTLYING = 4.0, 3.0


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
    for columns, remarks in _turns(recording):
        yield _slip(recording, references[0], columns, remarks)


def _turns(recording: Recording) -> Iterator[tuple[Mapping[str, Any], Sequence[str]]]:
    """(columns of the table `speed`, remarks) of each channel that tells the turns."""
    channels = speed_channels(recording)
    if not channels or recording.of_kind("wheel_encoder"):
        yield speed_by_encoder(recording)
        return
    for channel in channels:
        passages = passages_of(recording, channel)
        yield (
            speed_columns(recording.log, passages),
            [passages.doubt] if passages.doubt else [],
        )


def _slip(
    recording: Recording, reference: Channel, turns: Mapping[str, Any], remarks: Sequence[str]
) -> SlipOfChannel:
    time, period = np.asarray(turns["time_s"]), np.asarray(turns["period_s"])
    ends = [travelled(reference, time + side * period) for side in (-0.5, 0.5)]
    metres = np.where(ends[0][1] == ends[1][1], ends[1][0] - ends[0][0], np.nan)
    metres = np.where(metres > 0.0, metres, np.nan)
    good = np.asarray(turns["quality"]) == OK
    free = good & (np.abs(turns["acceleration_m_s2"]) < FREE_M_S2) & np.isfinite(metres)
    radius, radius_se, said = _radius(recording, reference, metres, period, free)
    with np.errstate(invalid="ignore"):
        slip = 1.0 - TURN_RAD * radius / metres
    error = np.hypot(_scatter(metres[good]) / metres, radius_se / radius) * np.abs(1.0 - slip)
    columns = {
        name: turns[name]
        for name in ("log", "channel", "revolution", "time_s", "speed_m_s", "quality")
    }
    columns |= {
        "vehicle_speed_m_s": metres / period,
        "slip": slip,
        "slip_se": error,
    }
    return SlipOfChannel(columns, (*remarks, said))


def _radius(
    recording: Recording,
    reference: Channel,
    metres: FloatArray,
    period: FloatArray,
    free: NDArray[np.bool_],
) -> tuple[FloatArray | float, FloatArray | float, str]:
    """(rolling radius, its standard error [m], what was done), from metres per `free` turn."""
    tire, count = recording.setup.tire, int(free.sum())
    if count >= LEAST_TURNS:
        grown = _growing(metres, metres / period, free)
        if grown is not None:
            radius, error = grown
            least, most = (float(edge(radius[free])) for edge in (np.min, np.max))
            return (
                radius,
                error,
                f"slip against {reference.name}: {least:.5f} to {most:.5f} m per radian, by the "
                f"speed squared, in {count} turns of free rolling, whose slip counts as none",
            )
        radius_m = float(np.median(metres[free])) / TURN_RAD
        return (
            radius_m,
            _scatter(metres[free]) / np.sqrt(count) / TURN_RAD,
            f"slip against {reference.name}: {radius_m:.5f} m per radian in {count} turns of "
            "free rolling, whose slip counts as none",
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


def _growing(
    metres: FloatArray, speed_m_s: FloatArray, free: NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray] | None:
    """(radius, its standard error [m]) of all turns by R = a + b V^2; None if b is not sure."""
    square = speed_m_s**2
    used = free & np.isfinite(square)
    for _ in range(2):
        design = np.stack([np.ones(int(used.sum())), square[used]], axis=1)
        if design.shape[0] < LEAST_TURNS or np.ptp(design[:, 1]) == 0.0:
            return None
        found = np.linalg.lstsq(design, metres[used], rcond=None)[0]
        left = metres - found[0] - found[1] * square
        spread = float(np.sqrt(np.mean(left[used] ** 2)))
        covariance = spread**2 * np.linalg.inv(design.T @ design)
        with np.errstate(invalid="ignore"):
            used &= np.abs(left) <= _OUTLYING * spread
    if found[1] < _SURE_SIGMAS * float(np.sqrt(covariance[1, 1])):
        return None
    at = np.stack([np.ones_like(square), square], axis=1)
    error = np.sqrt(np.einsum("ni,ij,nj->n", at, covariance, at))
    return (at @ found) / TURN_RAD, error / TURN_RAD


def _scatter(metres: FloatArray) -> float:
    """Standard deviation of one turn's distance [m], from that of neighbours."""
    change = np.abs(np.diff(metres[np.isfinite(metres)]))
    return float(np.median(change)) / (0.6745 * np.sqrt(2.0)) if change.size else float("nan")
