"""The rolling radius from a vehicle's own speed.

Errata, Speed: R_e is a setting, or calibrated with a speed reference.

    vehicle_speed Channel --distance travelled at the passages' times--> distance a turn
        --ratio over pieces of the log--> radius, error

The distance over whole turns does not depend on where in a turn the speed was sampled; noise and
lag of the reference average out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tirelog.data.bounds import doubt_of_radius
from tirelog.data.recording import BLOCK_SAMPLES, Channel
from tirelog.errors import UsageError
from tirelog.strain.passages.find import Passages
from tirelog.strain.passages.kinematics import TURN_RAD
from tirelog.vocabulary.arrays import FloatArray

#: turns are used up to this acceleration [m/s^2], where there are enough of them: the tire slips
#: under torque
FREE_ROLLING_M_S2 = 1.0
#: pieces of the log whose scatter gives the error, and the least number of turns
PIECES, LEAST_TURNS = 40, 10


@dataclass(frozen=True)
class RadiusCalibration:
    """Rolling radius and its standard error [m] from so many turns; `channel` is the reference's
    name.
    """

    radius_m: float
    radius_se_m: float
    turns: int
    channel: str

    def __str__(self) -> str:
        return (
            f"rolling radius {self.radius_m:.5f} +- {self.radius_se_m:.5f} m, calibrated against "
            f"{self.channel} over {self.turns} turns"
        )


def travelled(speed: Channel, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(distance [m], number of holes before) at ascending times, shape (n,) each: the speed
    integrated, straight lines between samples.

    NaN outside of the channel and in its holes. Between two times with another number of holes
    samples are missing, and their distance is not known.
    """
    distance = np.full(time_s.size, np.nan)
    hole = np.zeros(time_s.size)
    total, holes = 0.0, 0
    longest = 5.0 / speed.axis.rate_Hz
    for start in range(0, max(speed.size - 1, 0), BLOCK_SAMPLES):
        stop = min(start + BLOCK_SAMPLES + 1, speed.size)
        values, times = speed.read(start, stop), speed.axis.time(start, stop)
        good = np.isfinite(values)
        values, times = values[good], times[good]
        if values.size < 2:
            holes += 1
            continue
        step = np.diff(times)
        run = total + np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * step)])
        broken = holes + np.concatenate([[0], np.cumsum(step > longest)])
        inside = np.flatnonzero((time_s >= times[0]) & (time_s <= times[-1]))
        at = time_s[inside]
        low = np.clip(np.searchsorted(times, at, side="right") - 1, 0, times.size - 2)
        rise = at - times[low]
        slope = (values[low + 1] - values[low]) / step[low]
        distance[inside] = np.where(
            step[low] > longest, np.nan, run[low] + values[low] * rise + 0.5 * slope * rise**2
        )
        hole[inside] = broken[low]
        total, holes = float(run[-1]), int(broken[-1])
    return distance, hole


def calibrate_radius(
    speed: Channel, wheels: Sequence[Passages], unloaded_m: float | None = None
) -> RadiusCalibration:
    """The rolling radius from the reference `speed` [m/s] and the passages of one wheel's channels.

    UsageError where fewer than LEAST_TURNS whole turns lie within the reference, or the radius
    cannot go with the unloaded one.
    """
    radii, errors, turns = [], [], 0
    for passages in wheels:
        distance, holes = travelled(speed, passages.time_s)
        length = np.diff(distance)
        whole = passages.turn_after[:-1] & np.isfinite(length) & (np.diff(holes) == 0)
        slow = (
            np.abs(0.5 * (passages.acceleration_m_s2[1:] + passages.acceleration_m_s2[:-1]))
            < FREE_ROLLING_M_S2
        )
        free = whole & slow
        length = length[free if free.sum() >= LEAST_TURNS else whole]
        if length.size >= LEAST_TURNS:
            means = np.array(
                [piece.mean() for piece in np.array_split(length, min(PIECES, length.size // 2))]
            )
            radii.append(length.mean() / TURN_RAD)
            errors.append(means.std(ddof=1) / np.sqrt(means.size) / TURN_RAD)
            turns += length.size
    if not radii:
        raise UsageError(
            f"--calibrate-radius: fewer than {LEAST_TURNS} whole turns lie within {speed.name}; "
            "allowed is a log with more; give a longer one, or rolling_radius_m in the setup"
        )
    # the gratings of a wheel share the reference's errors, so more of them do not make the mean
    # better
    found = RadiusCalibration(float(np.mean(radii)), float(np.mean(errors)), turns, speed.name)
    strange = doubt_of_radius(found.radius_m, unloaded_m)
    if strange:
        raise UsageError(
            f"--calibrate-radius: against {speed.name} {strange}; check unit, source and delay "
            f"of {speed.name} in the setup"
        )
    return found
