"""The drive: manoeuvres become speed, wheel angle and conditions at every instant.

    manoeuvres --rounded corners--> Drive on a 2 ms grid
        --quintic in time--> angle(t), speed(t), acceleration(t) at any sample
    road, scatter ----------------> load(t) slow, roughness(distance) fast

The speed is that of the tread through the patch, c = Omega R_e. The wheel angle is its integral
over R_e, zero at the log's start.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from tirelog.simulation.scenario.schema import Scenario
from tirelog.storage.schema import Record
from tirelog.vocabulary.arrays import FloatArray

#: what the load varies by, relative and with zero mean, over times [s] or distances [m], (n,)
Fluctuation: TypeAlias = Callable[[FloatArray], FloatArray]
#: step of the drive's own grid [s]
STEP_S = 0.002
#: below this acceleration a manoeuvre without a regime of its own is a cruise; above the second
#: (downwards) it is braking
CRUISE_M_S2, BRAKE_M_S2 = 0.15, -1.5
#: time constant of the body's pitch in the other form of the load transfer [s], and of a load that
#: steps between manoeuvres
PITCH_S, SETTLING_S = 0.35, 0.15
#: step of the wandering's knots [s]: an exact Ornstein-Uhlenbeck sequence at these, smooth between
#: them, so that the waveform's own knots (`Scenario.knot_s`) see all of it
WANDER_STEP_S = 0.1


@dataclass(frozen=True)
class Stretch:
    """One manoeuvre as driven.

    Start and end in the log, regime, speeds and load factor (scatter between manoeuvres).
    """

    start_s: float
    end_s: float
    regime: str
    speed_start_m_s: float
    speed_end_m_s: float
    load_factor: float


def drive_stretches(scenario: Scenario, random: np.random.Generator) -> list[Stretch]:
    """The manoeuvres in order, regimes named, load scatter drawn."""
    out: list[Stretch] = []
    start, speed = 0.0, scenario.manoeuvres[0].speed_m_s
    if scenario.manoeuvres[0].regime in ("drive", "standstill"):
        speed = 0.0
    for manoeuvre in scenario.manoeuvres:
        acceleration = (manoeuvre.speed_m_s - speed) / manoeuvre.duration_s
        factor = 1.0 + scenario.road.load_scatter * float(random.standard_normal())
        regime = manoeuvre.regime
        if regime is None:
            regime = "cruise" if manoeuvre.speed_m_s > 0 else "standstill"
            if abs(acceleration) >= CRUISE_M_S2:
                slower = "coast" if acceleration > BRAKE_M_S2 else "brake"
                regime = "drive" if acceleration > 0 else slower
        out.append(
            Stretch(start, start + manoeuvre.duration_s, regime, speed, manoeuvre.speed_m_s, factor)
        )
        start, speed = start + manoeuvre.duration_s, manoeuvre.speed_m_s
    return out


def _rounded(values: FloatArray, width_s: float) -> FloatArray:
    """`values` on the drive's grid, smoothed twice by a box.

    Steps become smooth ramps, straight lines stay as they are.
    """
    half = max(1, round(width_s / STEP_S / 4))
    for _ in range(2):
        padded = np.concatenate((np.full(half, values[0]), values, np.full(half, values[-1])))
        total = np.concatenate(([0.0], np.cumsum(padded)))
        values = (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)
    return values


@dataclass(frozen=True)
class TrueDrive:
    """Everything that moves, on the grid `time_s` (n,).

    Speed [m/s], acceleration, relative load, regimes as stretches; `radius_m` the rolling radius
    at rest, `grows` how it grows with speed.
    """

    time_s: FloatArray
    speed: CubicSpline
    angle: CubicSpline
    load_factor: FloatArray
    coasting: FloatArray
    parts: tuple[Stretch, ...]
    radius_m: float
    grows: Record

    def radius_at(self, speed_m_s: FloatArray) -> FloatArray:
        """The rolling radius [m] at a speed: way per angle of the wheel."""
        return self.radius_m * stretch_of(self.grows, speed_m_s)

    def speed_at(self, time_s: FloatArray) -> FloatArray:
        """Speed of the tread through the patch [m/s], never negative."""
        return np.asarray(np.maximum(self.speed(np.clip(time_s, 0.0, self.time_s[-1])), 0.0))

    def acceleration_at(self, time_s: FloatArray) -> FloatArray:
        return np.asarray(self.speed(np.clip(time_s, 0.0, self.time_s[-1]), 1))

    def angle_at(self, time_s: FloatArray) -> FloatArray:
        """Wheel angle [rad], growing in the direction of rolling.

        Before and after the log it goes on at the speed of the end.
        """
        end = self.time_s[-1]
        inside = np.clip(time_s, 0.0, end)
        over = np.asarray(time_s) - inside
        speed = self.speed_at(inside)
        return np.asarray(self.angle(inside) + over * speed / self.radius_at(speed))

    @cached_property
    def pitch_acceleration(self) -> FloatArray:
        """The acceleration behind the body's pitch: a first-order lag [m/s^2], on the grid."""
        share = STEP_S / (PITCH_S + STEP_S)
        return np.asarray(lfilter([share], [1.0, share - 1.0], self.acceleration_at(self.time_s)))

    def distance_at(self, time_s: FloatArray) -> FloatArray:
        """Way of the tread through the patch since the log's start [m]."""
        if not self.grows.growth:
            return self.angle_at(time_s) * self.radius_m
        inside = np.clip(time_s, 0.0, self.time_s[-1])
        return np.asarray(self._way(inside) + (time_s - inside) * self.speed_at(inside))

    @cached_property
    def _way(self) -> CubicSpline:
        return self.speed.antiderivative()

    def times_of_angle(self, angle_rad: FloatArray) -> FloatArray:
        """Times [s] at which the wheel angle is `angle_rad` (within the log), to 1e-9 s."""
        grid = self.angle_at(self.time_s)
        rising = np.concatenate(([True], np.diff(np.maximum.accumulate(grid)) > 0))
        time = np.interp(angle_rad, grid[rising], self.time_s[rising])
        for _ in range(4):
            speed = np.maximum(self.speed_at(time), 1e-3)
            radius = self.radius_at(speed)
            time = np.clip(
                time - (self.angle_at(time) - angle_rad) * radius / speed,
                0.0,
                self.time_s[-1],
            )
        return time


def drive_of(scenario: Scenario, random: np.random.Generator) -> TrueDrive:
    """The scenario's manoeuvres as a Drive."""
    parts = drive_stretches(scenario, random)
    radius = scenario.tire.rolling_radius_m
    time = np.arange(0.0, parts[-1].end_s + STEP_S, STEP_S)
    corners = np.array([0.0, *(p.end_s for p in parts)])
    speeds = np.array([parts[0].speed_start_m_s, *(p.speed_end_m_s for p in parts)])
    speed = np.maximum(_rounded(np.interp(time, corners, speeds), scenario.rounding_s), 0.0)
    which = np.clip(np.searchsorted(corners, time, side="right") - 1, 0, len(parts) - 1)
    factor = _rounded(np.array([p.load_factor for p in parts])[which], 4 * SETTLING_S)
    coasting = _rounded(
        np.array([float(p.regime == "coast") for p in parts])[which], scenario.rounding_s
    )
    spline = CubicSpline(time, speed)
    grows = scenario.nuisances.rolling_radius
    spinning = CubicSpline(time, speed / stretch_of(grows, speed)) if grows.growth else spline
    angle = spinning.antiderivative()
    angle.c /= radius
    return TrueDrive(time, spline, angle, factor, coasting, tuple(parts), radius, grows)


def stretch_of(grows: Record, speed_m_s: FloatArray) -> FloatArray:
    """1 + growth (v/v_ref)^2: how much longer the belt is at a speed than at rest."""
    return 1.0 + grows.growth * (speed_m_s / grows.at_speed_m_s) ** 2


def wander_of(scenario: Scenario, random: np.random.Generator) -> Fluctuation:
    """The load's slow wandering by grade and wind, drawn for the scenario; over the time [s].

    At the start it has its full spread; at the log's ends it stays.
    """
    wander = scenario.nuisances.load_wander
    if not wander.share:
        return np.zeros_like
    count = int(scenario.duration_s / WANDER_STEP_S) + 8
    kept = np.exp(-WANDER_STEP_S / wander.time_constant_s)
    white = random.standard_normal(count) * np.sqrt(1.0 - kept**2)
    white[0] /= np.sqrt(1.0 - kept**2)
    values = wander.share * lfilter([1.0], [1.0, -kept], white)
    curve = CubicSpline(WANDER_STEP_S * np.arange(count), values)
    return lambda time_s: np.asarray(curve(np.clip(time_s, 0.0, curve.x[-1])))


def roughness_of(scenario: Scenario, distance_m: float, random: np.random.Generator) -> Fluctuation:
    """The load's fluctuation along the road, drawn for the scenario; over the distance [m].

    A Gaussian process of two cascaded first-order filters, so that its slope is finite; scaled
    to the scenario's standard deviation. Linear between knots an eighth of the correlation apart.
    """
    step = scenario.road.correlation_m / 8
    count = int(distance_m / step) + 64
    share = np.exp(-step / scenario.road.correlation_m * 2)
    white = random.standard_normal(count + 200)
    values = lfilter([1 - share], [1.0, -share], lfilter([1 - share], [1.0, -share], white))[200:]
    # variance of a white sequence after two equal first-order filters
    variance = (1 - share) ** 4 * (1 + share**2) / (1 - share**2) ** 3
    places = np.arange(values.size) * step
    sizes = scenario.road.roughness * values / np.sqrt(variance)
    return lambda distance_m: np.interp(distance_m, places, sizes)
