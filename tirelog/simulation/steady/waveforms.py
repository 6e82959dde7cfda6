"""The drive, and the truth at its instants.

Conditions, the carcass's solution, and what a sensor reads round the wheel.

Drive --instants--> Instants (b,) --loads, carcass--> w (b, points)
    --sensor--> strain or acceleration (b, points)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import zip_longest
from typing import Any, TypeAlias

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from tirelog.errors import UsageError
from tirelog.simulation.scenario.schema import BENDING_N_M2, Planted, Scenario
from tirelog.simulation.steady.carcass import (
    FlatRoadContact,
    carcass,
    curvature_operator,
)
from tirelog.simulation.steady.loads import (
    ComplexArray,
    Instants,
    Ring,
    delaying,
    extra_strain,
    friction,
    instants_of,
    on_grid,
    pressure,
    seen_by,
    true_parabola,
    with_columns,
)
from tirelog.storage.schema import Record
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.kinds import STRAIN_KINDS
from tirelog.vocabulary.units import STANDARD_GRAVITY_M_S2

# ---- The drive: manoeuvres become speed, wheel angle and conditions at every instant.
#
#     manoeuvres --rounded corners--> TrueDrive on a 2 ms grid
#         --quintic in time--> angle(t), speed(t), acceleration(t) at any sample
#     road, scatter ----------------> load(t) slow, roughness(distance) fast
#
# The speed is that of the tread through the patch, c = Omega R_e. The wheel angle is its integral
# over R_e, zero at the log's start.

#: what the load varies by, relative and with zero mean, over times [s] or distances [m], (n,)
Fluctuation: TypeAlias = Callable[[FloatArray], FloatArray]
#: step of the drive's own grid [s]
STEP_S = 0.002
#: time constant of the body's pitch in the other form of the load transfer [s], and of a load that
#: steps between manoeuvres
PITCH_S, SETTLING_S = 0.35, 0.15
#: step of the wandering's knots [s]: an exact Ornstein-Uhlenbeck sequence at these, smooth between
#: them, so that the waveform's own knots (`Scenario.knot_s`) see all of it
WANDER_STEP_S = 0.1


def drive_stretches(scenario: Scenario, random: np.random.Generator) -> list[dict[str, Any]]:
    """The manoeuvres as driven, as the truth lists them.

    Start and end in the log, regime (`Manoeuvre`), speeds, and the load's factor, which is drawn.
    """
    out: list[dict[str, Any]] = []
    start, speed = 0.0, scenario.manoeuvres[0].speed_m_s
    if scenario.manoeuvres[0].regime in ("drive", "standstill"):
        speed = 0.0
    for manoeuvre in scenario.manoeuvres:
        acceleration = (manoeuvre.speed_m_s - speed) / manoeuvre.duration_s
        factor = 1.0 + scenario.road.load_scatter * float(random.standard_normal())
        regime = manoeuvre.regime
        if regime is None:
            regime = "cruise" if manoeuvre.speed_m_s > 0 else "standstill"
            if abs(acceleration) >= 0.15:
                slower = "coast" if acceleration > -1.5 else "brake"
                regime = "drive" if acceleration > 0 else slower
        end, faster = start + manoeuvre.duration_s, manoeuvre.speed_m_s
        out.append(
            {
                "start_s": start,
                "end_s": end,
                "regime": regime,
                "speed_start_m_s": speed,
                "speed_end_m_s": faster,
                "load_factor": factor,
            }
        )
        start, speed = end, faster
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

    Speed [m/s], acceleration, relative load, the manoeuvres as `drive_stretches`; `radius_m` the
    rolling radius at rest, `grows` how it grows with speed; `lateral_m_s2` (n,) in curves.
    """

    time_s: FloatArray
    speed: CubicSpline
    angle: CubicSpline
    load_factor: FloatArray
    coasting: FloatArray
    parts: list[dict[str, Any]]
    radius_m: float
    grows: Record
    lateral_m_s2: FloatArray

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
        return _of_the_body(self.acceleration_at(self.time_s))

    @cached_property
    def roll_acceleration(self) -> FloatArray:
        """The lateral acceleration behind the body's roll, likewise."""
        return _of_the_body(self.lateral_m_s2)

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


def _of_the_body(acceleration: FloatArray) -> FloatArray:
    """An acceleration on the drive's grid as a body on its springs follows it."""
    share = STEP_S / (PITCH_S + STEP_S)
    return np.asarray(lfilter([share], [1.0, share - 1.0], acceleration))


def drive_of(scenario: Scenario, random: np.random.Generator) -> TrueDrive:
    """The scenario's manoeuvres as a Drive."""
    parts = drive_stretches(scenario, random)
    radius = scenario.tire.rolling_radius_m
    time = np.arange(0.0, parts[-1]["end_s"] + STEP_S, STEP_S)
    corners = np.array([0.0, *(p["end_s"] for p in parts)])
    speeds = np.array([parts[0]["speed_start_m_s"], *(p["speed_end_m_s"] for p in parts)])
    speed = np.maximum(_rounded(np.interp(time, corners, speeds), scenario.rounding_s), 0.0)
    which = np.clip(np.searchsorted(corners, time, side="right") - 1, 0, len(parts) - 1)
    factor = _rounded(np.array([p["load_factor"] for p in parts])[which], 4 * SETTLING_S)
    coasting = _rounded(
        np.array([float(p["regime"] == "coast") for p in parts])[which], scenario.rounding_s
    )
    spline = CubicSpline(time, speed)
    grows = scenario.nuisances.rolling_radius
    spinning = CubicSpline(time, speed / stretch_of(grows, speed)) if grows.growth else spline
    angle = spinning.antiderivative()
    angle.c /= radius
    across = np.array([m.lateral_m_s2 for m in scenario.manoeuvres])[which]
    lateral = _rounded(across, scenario.rounding_s)
    return TrueDrive(time, spline, angle, factor, coasting, parts, radius, grows, lateral)


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


# ---- A static test: the tire at rest is inflated (P2 4.1, Fig. 15).
#
# With stops at which the gauge is read and some air leaks.
#
# Ramp --pressure(t)--> pressure [Pa]; strain of every grating grows with it


def ramp_pressure(ramp: Record, time_s: FloatArray) -> FloatArray:
    """Inflation pressure [Pa] at `time_s`: constant, a steady rise with stops in it, constant.

    Each stop loses `leak_Pa`.
    """
    corners, values = [ramp.begin_s], [ramp.start_Pa]
    stops = sorted(ramp.stops_s)
    rising = ramp.end_s - ramp.begin_s - len(stops) * ramp.stop_length_s
    rate = (ramp.end_Pa - ramp.start_Pa + len(stops) * ramp.leak_Pa) / rising
    for stop in stops:
        held = values[-1] + rate * (stop - corners[-1])
        corners += [stop, stop + ramp.stop_length_s]
        values += [held, held - ramp.leak_Pa]
    return np.asarray(np.interp(time_s, [*corners, ramp.end_s], [*values, ramp.end_Pa]), float)


def strain(ramp: Record, time_s: FloatArray) -> FloatArray:
    """Strain against the start of the ramp.

    Slope times the pressure's rise, and its square by `bend_1_Pa`.
    """
    rise = ramp_pressure(ramp, time_s) - ramp.start_Pa
    return ramp.strain_per_Pa * rise * (1.0 + ramp.bend_1_Pa * rise)


#: the gravity in the catalogue's forms of load transfer and slip
CATALOGUE_GRAVITY_M_S2 = 9.81
#: of the forms "apart": pitch of the tread's blocks [m], speed at which a wheel out of balance hops
#: (13 Hz) [m/s], warming in which a soft adhesive grows e times softer [K], time in which a belt's
#: textile cords creep [s]
PITCH_M, HOP_M_S, SOFTENING_K, CREEP_S = 0.035, 25.0, 8.0, 20.0


@dataclass(frozen=True)
class Solution:
    """The carcass at b knots and one load.

    Displacement `w` (b, points), contact edges (b,), slip onset (b,); `between` (b, points) the
    curvature between blocks of the tread that press with cos of their pitch.
    """

    w: FloatArray
    at: Instants
    entry_m: FloatArray
    exit_m: FloatArray
    onset_m: FloatArray
    between: FloatArray | None = None


class World:
    """One scenario with its drawn road: gives instants, solutions and waveforms."""

    def __init__(
        self,
        scenario: Scenario,
        drive: TrueDrive,
        roughness: Fluctuation,
        wander: Fluctuation = np.zeros_like,
    ) -> None:
        self.scenario, self.drive = scenario, drive
        self.roughness, self.wander = roughness, wander
        self.ring = Ring(scenario.grid_points, 2.0 * np.pi * scenario.tire.rolling_radius_m)
        self.curvature = curvature_operator(scenario, self.ring)
        flat = scenario.truth == "ring" and scenario.tire.contact == "flat_road"
        self.road = FlatRoadContact(scenario, self.ring) if flat else None

    # ---- conditions ------------------------------------------------------------------------------

    def load(self, time_s: FloatArray) -> FloatArray:
        """Load without its variation within the turn [N].

        Scatter of the manoeuvres, wandering, load transfer, air.
        """
        drive, scenario = self.drive, self.scenario
        load = scenario.conditions.load_N * np.interp(time_s, drive.time_s, drive.load_factor)
        load = load * (1.0 + self.wander(time_s))
        transfer, air = scenario.planted("load_transfer"), scenario.planted("aero_load")
        if transfer is not None:
            pitch = drive.acceleration_at(time_s)
            if transfer.other:
                pitch = np.interp(time_s, drive.time_s, drive.pitch_acceleration)
            load = load * (1.0 + transfer["coefficient"] * pitch / CATALOGUE_GRAVITY_M_S2)
        if air is not None:
            speed = drive.speed_at(time_s) / 30.0
            load = load * (1.0 + air["coefficient"] * (0.8 * speed**1.6 if air.other else speed**2))
        heavy = scenario.planted("imbalance")
        if heavy is not None:
            load = load + heavy["force_N"] * _of_imbalance(heavy, drive.speed_at(time_s))
        return load

    def distance(self, time_s: FloatArray) -> FloatArray:
        """The way driven from the log's start [m]."""
        return self.drive.distance_at(time_s)

    def fluctuation(self, time_s: FloatArray) -> FloatArray:
        """Load variation within the turn over the load: of the road and of the wheel."""
        total = np.zeros_like(time_s)
        if self.scenario.road.roughness:
            total = self.roughness(self.distance(time_s))
        force = self.scenario.nuisances.force_variation
        if any(force.shares):
            angle = self.drive.angle_at(time_s)
            total = total + wheel_harmonics(angle, force.shares, force.phases_deg).real
        return total

    def run_out(self, time_s: FloatArray, sensor: Record) -> FloatArray:
        """The strain that goes round with the wheel, as the sensor's lag and bandwidth pass it."""
        run_out = self.scenario.nuisances.run_out
        if not any(run_out.amplitudes_microstrain):
            return np.zeros_like(time_s)
        angle, speed = self.drive.angle_at(time_s), self.drive.speed_at(time_s)
        _, lag = self.sensor_effects(sensor)
        tau = lag["lag_s"] if lag is not None else 0.0
        spin = speed / self.drive.radius_at(speed)
        total = np.zeros_like(time_s)
        for order, size in enumerate(run_out.amplitudes_microstrain, 1):
            only = [0.0] * (order - 1) + [1e-6 * size]
            wave = wheel_harmonics(angle, only, run_out.phases_deg)
            wave = wave / delaying(lag, 1j * order * spin * tau)
            if sensor.bandwidth_Hz is not None:
                frequency = order * spin / (2.0 * np.pi)
                wave = wave / np.sqrt(1.0 + (frequency / sensor.bandwidth_Hz) ** 4)
            total += wave.real
        return total

    def longitudinal_force(self, time_s: FloatArray) -> FloatArray:
        """Longitudinal force of the road on the wheel [N], drive positive."""
        vehicle, drive = self.scenario.vehicle, self.drive
        speed = drive.speed_at(time_s)
        moving = np.clip(speed / 0.5, 0.0, 1.0)
        drag = (
            vehicle.rolling_drag * vehicle.mass_kg * STANDARD_GRAVITY_M_S2 * moving
            + vehicle.air_drag_kg_m * speed**2
        )
        demand = vehicle.mass_kg * drive.acceleration_at(time_s) + drag
        demand = demand * (1.0 - np.interp(time_s, drive.time_s, drive.coasting))
        share = 0.5 if self.scenario.conditions.driven else 0.0
        return np.where(demand > 0, share, vehicle.brake_share) * demand

    def slip(self, time_s: FloatArray) -> FloatArray:
        """Longitudinal slip, braking positive: sigma = 1 - omega R / V (P2 (14)).

        -F_x / C_x if the tire has a slip stiffness, else -a acceleration/g if traction is planted,
        else zero. The tread passes at omega R, so that the vehicle is slower in drive.
        """
        stiffness = self.scenario.tire.slip_stiffness_N
        if stiffness is not None:
            return np.clip(-self.longitudinal_force(time_s) / stiffness, -0.95, 0.95)
        effect = self.scenario.planted("traction")
        if effect is None:
            return np.zeros_like(time_s)
        return np.clip(
            -effect["slip_per_g"] * self.drive.acceleration_at(time_s) / CATALOGUE_GRAVITY_M_S2,
            -0.95,
            0.95,
        )

    def warmed(self, time_s: FloatArray) -> FloatArray:
        """The planted drift's course.

        Share of the final warming (0 to 1), or the warming in K if the temperature varies.
        """
        effect = self.scenario.planted("thermal_drift")
        if effect is None:
            return np.zeros_like(time_s)
        if self.scenario.conditions.warm_up_K:
            rise = self.temperature(time_s)
            return (
                rise * (0.7 + 0.6 * rise / self.scenario.conditions.warm_up_K)
                if effect.other
                else rise
            )
        u = time_s / effect["time_constant_s"]
        return (
            1.0 - 0.6 * np.exp(-2.2 * u) - 0.4 * np.exp(-0.45 * u)
            if effect.other
            else -np.expm1(-u)
        )

    def temperature(self, time_s: FloatArray) -> FloatArray:
        """Rise of the tire's temperature since the log's start [K]."""
        conditions = self.scenario.conditions
        return -conditions.warm_up_K * np.expm1(-time_s / conditions.warm_up_time_s)

    def pressure(self, time_s: FloatArray) -> FloatArray:
        """Inflation pressure [Pa]; the tire's warmth raises it."""
        per_K = self.scenario.nuisances.warming.pressure_per_K
        cold = self.scenario.conditions.inflation_pressure_Pa
        return cold * (1.0 + per_K * self.temperature(time_s))

    def _crept_pressure(self, time_s: FloatArray) -> FloatArray:
        """The inflation pressure as cords that creep have followed it, CREEP_S late [Pa]."""
        conditions, late = self.scenario.conditions, CREEP_S
        warm = conditions.warm_up_time_s
        if abs(warm - late) < 1e-3 * late:
            late = 1.01 * late
        course = 1.0 - (warm * np.exp(-time_s / warm) - late * np.exp(-time_s / late)) / (
            warm - late
        )
        per_K = self.scenario.nuisances.warming.pressure_per_K
        return conditions.inflation_pressure_Pa * (1.0 + per_K * conditions.warm_up_K * course)

    def half_length(self, load: FloatArray, time_s: FloatArray | float = 0.0) -> FloatArray:
        """Prescribed half length of the patch [m] at a load and the tire's temperature.

        And at the pressure, if `inflation` is planted.
        """
        tire, inflation = self.scenario.tire, self.scenario.planted("inflation")
        length = (
            tire.patch_half_length_m * (load / tire.reference_load_N) ** tire.patch_load_exponent
        )
        per_K = self.scenario.nuisances.warming.patch_length_per_K
        if per_K:
            length = length * (1.0 + per_K * self.temperature(np.asarray(time_s)))
        if inflation is not None:
            # over the reference pressure of the planted effect [Pa]
            ratio, power = self.pressure(np.asarray(time_s)) / 2.0e5, inflation["exponent"]
            length = length * (
                1.0 - 1.3 * power * (ratio - 1.0) if inflation.other else ratio**-power
            )
        return length

    def across(self, time_s: FloatArray, lateral_m: float) -> FloatArray:
        """Load of the tread at a place across it, over that of the middle (b,).

        A belt that leans is deeper in the road there, and meets it on a longer chord of its circle;
        a strip of it carries load as the square of its chord.
        """
        roll, radius = self.scenario.vehicle.roll_deg_per_g, self.drive.radius_m
        if not roll or not lateral_m:
            return np.ones_like(time_s)
        in_g = np.interp(time_s, self.drive.time_s, self.drive.roll_acceleration)
        leans = np.radians(roll) * in_g / STANDARD_GRAVITY_M_S2
        half = self.half_length(self.load(time_s), time_s)
        deep = radius - np.sqrt(radius**2 - half**2)
        deeper = deep + lateral_m * np.sin(leans)
        if np.any(deeper < 0.1 * deep):
            raise UsageError(
                f"the belt leans so far that the tread at {lateral_m:g} m leaves the road",
                allowed="allowed is a lean that leaves it a tenth of its depth",
                do="lower roll_deg_per_g or lateral_m_s2",
            )
        return np.asarray((2.0 * radius * deeper - deeper**2) / half**2)

    def instants(self, time_s: FloatArray, load_factor: Any = 1.0) -> Instants:
        """Conditions at `time_s` (b,), the load times `load_factor`."""
        load = self.load(time_s) * load_factor
        conditions = self.scenario.conditions
        speed = self.drive.speed_at(time_s)
        return instants_of(
            time_s=time_s,
            speed=speed,
            acceleration=self.drive.acceleration_at(time_s),
            load=load,
            half_length=self.half_length(load, time_s),
            slip=self.slip(time_s),
            warmed=self.warmed(time_s),
            distance_km=conditions.distance_km,
            water_depth_mm=conditions.water_depth_mm,
            reference_load=self.scenario.tire.reference_load_N,
            temperature_K=self.temperature(time_s),
            stretch=stretch_of(self.drive.grows, speed),
        )

    # ---- solutions -------------------------------------------------------------------------------

    def solve(self, at: Instants, start: FloatArray | None = None) -> Solution:
        """The carcass at these instants; the patch in lengths of the road."""
        scenario, ring, stretch = self.scenario, self.ring, at.stretch
        at = on_grid(at)
        entry, exit_ = -at.half_length, at.half_length
        if self.road is not None:
            base, entry, exit_ = self.road.touch(at)
            at = with_columns(at, half_length=0.5 * (exit_ - entry))
        else:
            base = true_parabola(ring, at.half_length, at.load)
        p = pressure(ring, scenario.effects, base, at)
        traction = scenario.planted("traction")
        dragged, bent, onset = np.zeros_like(p), np.zeros_like(p), np.full(len(at), np.nan)
        if traction is not None:
            dragged, bent, onset = friction(ring, traction, p, at)
            # a slope along the grid is steeper than along the belt
            bent = bent / stretch[:, None]
        radial, along = p + bent, None
        if scenario.truth != "beam":  # the road's force is vertical, not radial
            angle = ring.xi_m / scenario.tire.rolling_radius_m
            radial = p * np.cos(angle) + bent - dragged * np.sin(angle)
            along = p * np.sin(angle) + dragged * np.cos(angle)
        belt = carcass(scenario, ring, at)
        w = belt.displacement(radial, along, start)
        blocks = scenario.planted("tread_pitch")
        between = None
        if blocks is not None and blocks.apart:
            # the pattern turns with the sensor: a p cos(Q (xi' - xi)) at the place xi' is
            # a cos(Q xi') p cos(Q xi) + a sin(Q xi') p sin(Q xi) at the sensor's xi
            turn = np.exp(2j * np.pi * ring.xi_m / PITCH_M)
            between = sum(
                part
                * self.ring.inverse(
                    self.curvature * self.ring.transform(belt.displacement(p * part, None))
                )
                for part in (turn.real, turn.imag)
            )
        return Solution(w, at, entry * stretch, exit_ * stretch, onset * stretch, between)

    # ---- what sensors read -----------------------------------------------------------------------

    def strain(self, solution: Solution, sensor: Record) -> ComplexArray:
        """Transform of the tire's strain at the sensor's surface (b, m).

        Before the sensor itself, without baseline.
        """
        stretch = solution.at.stretch
        bent = self.curvature * self.ring.transform(solution.w)
        bent = bent / stretch[:, None] ** 2
        exit_m = solution.exit_m / stretch
        behind = self.behind_first(sensor)
        extra = extra_strain(self.ring, self.scenario, solution.at, exit_m, behind)
        lever = self.lever(sensor)
        blocks = self.scenario.planted("tread_pitch")
        if solution.between is not None and blocks is not None:
            # a y of a pressure a p cos(2 pi s / P), by the strain per line load that it makes [m]
            bending = self.scenario.tire.flexural_stiffness_N_m2
            bending = bending or BENDING_N_M2[self.scenario.truth]
            share = blocks["strain_m_N"] * bending * (2.0 * np.pi / PITCH_M) ** 2
            bent = bent + share / lever * self.ring.transform(solution.between)
        return lever * bent if extra is None else lever * bent + self.ring.transform(extra)

    def behind_first(self, sensor: Record) -> float:
        """Angle [rad] on the tire between a sensor and the first.

        Zero unless something is fixed to the tire.
        """
        if self.scenario.planted("splice") is None:
            return 0.0
        riding = [s for s in self.scenario.channels.values() if s.kind in STRAIN_KINDS]
        if sensor not in riding:  # another sensor is at the place of the first
            return 0.0
        return float(np.radians(sensor.angle_deg - riding[0].angle_deg))

    def lever(self, sensor: Record) -> float:
        """Signed lever arm [m], positive on the inner surface; shorter with wear."""
        worn, conditions = self.scenario.planted("wear"), self.scenario.conditions
        shorter = 1.0 - (
            worn["lever_loss"] * conditions.distance_km / 40000.0 if worn is not None else 0.0
        )
        return (
            self.scenario.tire.lever_arm_m * shorter * (1.0 if sensor.surface == "inner" else -1.0)
        )

    def waveform(self, solution: Solution, sensor: Record) -> FloatArray:
        """What the sensor reads round the wheel, (b, points).

        Strain, or radial acceleration outwards [m/s^2] without gravity.
        """
        at, radius = solution.at, self.drive.radius_m
        along = at.speed / at.stretch  # along the grid; a gauge is as long as its piece of the belt
        gauge, lag = self.sensor_effects(sensor)
        if sensor.kind == "radial_acceleration":
            spectrum = self.ring.transform(solution.w)
            spin2 = (along[:, None] / radius) ** 2
            spectrum = (
                -spin2
                * (radius**2 * self.ring.derivatives[2] + self.ring.derivatives[0])
                * spectrum
            )
            tilt = self.tilt(at.speed)
            if tilt is not None:  # of a belt that keeps its length a_t is -i / n times a_r
                n = np.arange(spectrum.shape[-1])
                spectrum = spectrum * (1.0 - 1j * tilt[:, None] / np.maximum(n, 1) * (n > 1))
            seen = seen_by(self.ring, spectrum, along, None, lag, sensor.bandwidth_Hz)
            wave = self.ring.inverse(seen) - spin2 * radius * at.stretch[:, None]
            return self.gain(at.temperature_K)[:, None] * wave
        spectrum = self.strain(solution, sensor)
        seen = seen_by(self.ring, spectrum, along, gauge, lag, sensor.bandwidth_Hz)
        return self.gain(at.temperature_K)[:, None] * self.ring.inverse(seen)

    def gain(self, rise_K: FloatArray) -> FloatArray:
        """Factor on the sensor's reading if the tire is warmer by `rise_K` (b,).

        1 + a dT; apart: an adhesive that softens the faster the warmer it is.
        """
        effect = self.scenario.planted("warm_gain")
        if effect is None:
            return np.ones_like(rise_K)
        course = SOFTENING_K * np.expm1(rise_K / SOFTENING_K) if effect.apart else rise_K
        return 1.0 + effect["gain_1_K"] * course

    def tilt(self, speed: FloatArray) -> FloatArray | None:
        """Tilt of an accelerometer (b,) [rad]; apart: of a mount that yields under its own weight.

        With the square of the speed. None if none is planted.
        """
        effect = self.scenario.planted("sensor_tilt")
        if effect is None:
            return None
        course = (speed / 20.0) ** 2 if effect.apart else np.ones_like(speed)
        return effect["tilt_rad"] * course

    def sensor_effects(self, sensor: Record) -> tuple[Planted | None, Planted | None]:
        """(gauge length, lag): what is planted, else the sensor's own (known) number, else None."""
        own_gauge = Planted("gauge_length", parameters={"length_m": sensor.gauge_length_m})
        own_lag = Planted("sensor_lag", parameters={"lag_s": sensor.lag_s})
        return (
            self.scenario.planted("gauge_length") or (own_gauge if sensor.gauge_length_m else None),
            self.scenario.planted("sensor_lag") or (own_lag if sensor.lag_s else None),
        )

    def baseline(self, time_s: FloatArray, sensor: Record) -> FloatArray:
        """The strain's slow baseline.

        The sensor's own, inflation, tension's stretch, thermal drift, warming, run-out.
        """
        total = np.full_like(time_s, sensor.baseline)
        if self.scenario.ramp is not None:
            total = total + strain(self.scenario.ramp, time_s)
        tension, drift = (
            self.scenario.planted("belt_tension"),
            self.scenario.planted("thermal_drift"),
        )
        if tension is not None:
            total = total + tension["stretch_s2_m2"] * self.drive.speed_at(time_s) ** 2
        if drift is not None:
            total = total + drift["drift"] * self.warmed(time_s)
        stretched = self.scenario.planted("belt_extension")
        if stretched is not None:
            air = self._crept_pressure(time_s) if stretched.apart else self.pressure(time_s)
            more = air - stretched["reference_pressure_Pa"]
            total = total + stretched["strain_1_Pa"] * more
        if self.scenario.nuisances.warming.strain_per_K:
            rise = self.temperature(time_s)
            total = total + self.scenario.nuisances.warming.strain_per_K * rise
        return total + self.run_out(time_s, sensor)


def _of_imbalance(effect: Planted, speed: FloatArray) -> FloatArray:
    """m r omega^2 at the patch, in its size at 20 m/s; apart: as a wheel passes it on that hops.

    A mass on tire and damper: the part in phase with the force, largest below the hop and against
    it above.
    """
    force = (speed / 20.0) ** 2
    if not effect.apart:
        return np.asarray(force, np.float64)
    r = speed / HOP_M_S
    return np.asarray(force * (1.0 - r**2) / ((1.0 - r**2) ** 2 + (0.4 * r) ** 2), np.float64)


def wheel_harmonics(
    angle_rad: FloatArray, sizes: Sequence[float], phases_deg: Sequence[float]
) -> ComplexArray:
    """Sum of size e^(i (h angle - phase)) over the wheel's harmonics h = 1, 2, ...

    The real part is the wave; a phase that is not given is zero.
    """
    total = np.zeros(np.shape(angle_rad), complex)
    for order, (size, phase) in enumerate(zip_longest(sizes, phases_deg, fillvalue=0.0), 1):
        total += size * np.exp(1j * (order * angle_rad - np.radians(phase)))
    return total


# ---- When the waveform is solved anew, and the solutions, chunk by chunk.
#
# drive --plan--> chunks of equal steps: the scenario's knot_s, or QUICK_STEP_S if the load changes
#                 within tenths of a second
#       --World.solve--> solutions at one load, or at three on a rough road

#: knots of an ordinary chunk, and steps of the cells that are quick or not as a whole
CHUNK, CELL = 96, 12
#: step if loads that follow the acceleration change with it [s], and the jerk above which they
#: do [m/s^3]
QUICK_STEP_S, QUICK_JERK_M_S3 = 0.01, 0.05
#: relative step of the load between the three solutions; twice as far apart, a parabola through
#: the three is off by eight times as much between them
LOAD_STEP = 0.03


#: from when to when in the log [s], in how many equal steps
Span: TypeAlias = tuple[float, float, int]


def plan_knots(
    drive: TrueDrive, step_s: float, quick: bool, start_s: float, end_s: float
) -> list[Span]:
    """The spans from start_s to end_s, in order.

    They are finer if `quick` and the acceleration changes.
    """
    cell = CELL * step_s
    cells = np.arange(np.floor(start_s / cell), np.ceil(end_s / cell) + 1).astype(int)
    near = np.linspace(cells[:-1] - 0.1, cells[1:] + 0.1, 80) * cell
    jerks = np.abs(drive.speed(np.clip(near, 0.0, drive.time_s[-1]), 2)).max(axis=0)
    fine = (jerks > QUICK_JERK_M_S3) & (quick and step_s > QUICK_STEP_S)
    spans: list[Span] = []
    grows = False
    for number, finer in zip(cells[:-1].tolist(), fine.tolist(), strict=True):
        end = (number + 1) * cell
        if grows and not finer and spans[-1][2] < CHUNK:
            spans[-1] = spans[-1][0], end, spans[-1][2] + CELL
        else:
            spans.append((number * cell, end, round(cell / QUICK_STEP_S) if finer else CELL))
        grows = not finer
    return spans


def chunks(
    world: World, start_s: float, end_s: float, lateral_m: float = 0.0
) -> Iterator[tuple[Span, list[Solution]]]:
    """Every span of the plan with its solutions at knots, of the tread at `lateral_m` across it.

    The span's samples lie between these knots: the first is one step before the span, the last two
    steps behind. Solutions at the loads 1, 1 + LOAD_STEP, 1 - LOAD_STEP; the first alone on a
    smooth road.
    """
    scenario = world.scenario
    quick = (
        scenario.planted("traction") is not None or scenario.planted("load_transfer") is not None
    )
    varies = scenario.road.roughness or any(scenario.nuisances.force_variation.shares)
    factors = (1.0, 1.0 + LOAD_STEP, 1.0 - LOAD_STEP) if varies else (1.0,)  # within the turn
    for span in plan_knots(world.drive, scenario.knot_s, quick, start_s, end_s):
        begin, end, steps = span
        times = np.asarray(begin + np.arange(-1, steps + 2) * ((end - begin) / steps), float)
        across = world.across(times, lateral_m)
        middle = world.solve(world.instants(times, across))
        rest = [world.solve(world.instants(times, f * across), middle.w * f) for f in factors[1:]]
        yield span, [middle, *rest]
