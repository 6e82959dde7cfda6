"""A coupled ring model driven over a road, and what a sensor on its belt reads meanwhile.

    Model, Conditions (1,), Course --`driven`--> Transient: motion on a grid in time, and strain or
                                                radial acceleration of a sensor

A reading is the steady waveform of `Model.predict` at the conditions of the start, with all of the
model's effects, plus what V - V_0 adds. These are the motion's N modes less those of steady
rolling. On a flat road at constant speed and load nothing is added, and the reading is the steady
ring's.

Effects: what changes the structure changes the tire that moves; sensor effects act on the whole
reading. Effects on the contact pressure, the baseline and user strains act on the steady waveform
alone (`Transient.remarks`); a loss that is the same at every rate and a foundation that hardens
have no linear motion in time and are refused.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from tirelog.data.recording import Conditions
from tirelog.data.road import RoadProfile, road_of
from tirelog.data.setup import RoadSetup
from tirelog.errors import ModelError, UsageError
from tirelog.physics.model.laws import lever_arm
from tirelog.physics.model.model import Model
from tirelog.physics.model.stages import Task, gain, lever_factor, loaded_site, loads, structure
from tirelog.physics.moving.contact import Tread, steady_rolling
from tirelog.physics.moving.ring import CoupledRing, of_model
from tirelog.physics.spectral import ComplexArray
from tirelog.vocabulary.arrays import FloatArray

#: Belt modes and tread nodes of a motion, its longest step [s] and the grid on which it is kept
#: [s].
MODES, NODES = 40, 2304
KEEP_S = 1e-4
_STEADY_ONLY = ("tilt", "pressure", "kernel", "traction", "strain", "acceleration")


@dataclass(frozen=True)
class Schedule:
    """A value over time [s]: straight between its points, level outside."""

    time_s: tuple[float, ...]
    value: tuple[float, ...]

    @classmethod
    def constant(cls, value: float) -> Schedule:
        return cls((0.0,), (value,))

    def __call__(self, time_s: float) -> float:
        return (
            self.value[0]
            if len(self.value) == 1
            else float(np.interp(time_s, self.time_s, self.value))
        )

    def scaled(self, factor: float) -> Schedule:
        return replace(self, value=tuple(factor * v for v in self.value))


@dataclass(frozen=True)
class Course:
    """What is driven for `duration_s`: axle speed [m/s] and load [N] downwards over time.

    The road's x = 0 is where the wheel starts. A torque [N m] on the hub acts with the spin; a
    `free` hub rolls as it is pushed, and not at that speed.
    """

    speed_m_s: Schedule
    load_N: Schedule
    road: RoadProfile
    duration_s: float
    torque_N_m: Schedule = Schedule((0.0,), (0.0,))
    free: bool = False


@dataclass(frozen=True)
class Transient:
    """A tire's motion (`stepped_motion`) and what it started from.

    The start is modes V_0 (N - 1,) and conditions of steady rolling; `remarks` say what is not in
    it.
    """

    model: Model
    conditions: Conditions
    course: Course
    tire: CoupledRing
    motion: Any
    steady: ComplexArray
    task: Task
    remarks: tuple[str, ...]

    def sensed(
        self,
        observable: str,
        theta_rad: float,
        time_s: FloatArray | None = None,
        *,
        surface: str = "outer",
    ) -> FloatArray:
        """Reading (m,) of a sensor at times [s] (default the motion's).

        It sits at the belt's own angle theta (0 under the wheel at the start).

        strain, or radial_acceleration [m/s^2], outward positive; NaN outside of the motion.
        """
        when = self.motion.time_s if time_s is None else np.asarray(time_s, dtype=np.float64)
        return self.at(
            observable,
            np.interp(when, self.motion.time_s, self.motion.psi_rad) + theta_rad,
            when,
            surface=surface,
        )

    def at(
        self, observable: str, phi_rad: FloatArray, time_s: FloatArray, *, surface: str = "outer"
    ) -> FloatArray:
        """Reading (m,) of a sensor at phi (m,), any whole turns, at times (m,)."""
        grid = self.motion.time_s
        phi = np.mod(phi_rad + np.pi, 2.0 * np.pi) - np.pi
        reading = self.model.predict(self.conditions, phi, surface=surface, observable=observable)[
            0
        ]
        if observable == "radial_acceleration":
            omega = np.interp(time_s, grid, self.motion.omega_rad_s)
            # gravity does not follow the spin, and the vehicle's acceleration is in what the motion
            # adds
            frame = self.model.predict(self.conditions, phi, observable="frame_acceleration")[0]
            still = replace(self.conditions, acceleration_m_s2=np.zeros(1))
            gravity = self.model.predict(still, phi, observable="frame_acceleration")[0]
            reading = (reading - frame) * (
                omega / self.conditions.speed_m_s[0] * self.tire.R
            ) ** 2 + gravity
        reading = reading + self.added(observable, phi, time_s, surface=surface)
        return np.where((time_s < grid[0] - KEEP_S) | (time_s > grid[-1]), np.nan, reading)

    def added(
        self, observable: str, phi_rad: FloatArray, time_s: FloatArray, *, surface: str = "outer"
    ) -> FloatArray:
        """What the road adds to the steady waveform at phi (m,) and times (m,).

        Before and after the motion it is as at the motion's ends.
        """
        when = np.clip(time_s, self.motion.time_s[0], self.motion.time_s[-1])
        turn = np.exp(1j * phi_rad)
        # exp(i n phi), n = 1 ... N, by products
        turns = np.cumprod(np.broadcast_to(turn[:, None], (turn.size, self.tire.modes)), axis=1)[
            :, 1:
        ]
        if observable == "radial_acceleration":
            # C'' [m/s^2], s + i z
            lift = np.gradient(self.motion.centre_rate, self.motion.time_s)
            lifted = np.interp(when, self.motion.time_s, lift)
            rigid = lifted.real * np.sin(phi_rad) - lifted.imag * np.cos(phi_rad)
            waves: FloatArray = (
                2.0 * np.einsum("mn,mn->m", self._acceleration(when), turns).real + rigid
            )
            return np.asarray(waves * np.asarray(gain(self.task)).item())
        lever = lever_arm(self.task, surface) * lever_factor(self.task) * gain(self.task)
        strain = np.einsum("mn,mn->m", self._curvature(when), turns).real
        return np.asarray(2.0 * np.asarray(lever).item() * strain)

    @cached_property
    def _curvature(self) -> CubicSpline:
        """Modes of (w + w'') / R^2 of V - V_0 over time, as the sensor hands them on (k, N - 1)."""
        n = self.tire.n
        return self._handed_on(
            -1j * n * (1.0 - n**2) / self.tire.R**2 * (self.motion.V - self.steady)
        )

    @cached_property
    def _acceleration(self) -> CubicSpline:
        """Modes of D^2 w - 2 Omega D v - Omega^2 w - Omega' v, handed on likewise.

        They are those of V - V_0, with D = d/dt + i n Omega.
        """
        m, n = self.motion, self.tire.n
        V, rate = m.V - self.steady, m.V_rate
        onward = np.gradient(rate, m.time_s, axis=0)
        omega, spun = m.omega_rad_s[:, None], np.gradient(m.omega_rad_s, m.time_s)[:, None]
        D = rate + 1j * n * omega * V
        D2 = onward + 2j * n * omega * rate - (n * omega) ** 2 * V + 1j * n * spun * V
        return self._handed_on(-1j * n * D2 - 2.0 * omega * D + 1j * n * omega**2 * V - spun * V)

    def _handed_on(self, modes: ComplexArray) -> CubicSpline:
        """Modes (k, N - 1) in space after the sensor.

        A grating's length acts by wave number, lags by frequency on the belt.
        """
        m, n = self.motion, self.tire.n
        gauge = self.task.values_of("gauge_length")
        if gauge is not None:
            modes = modes * np.sinc(n / self.tire.R * (gauge["length_m"] / (2.0 * np.pi)))
        late = self.task.hooks(lambda effect: effect.transfer)
        late.pop("gauge_length", None)
        if late:
            turned = np.exp(1j * np.outer(m.psi_rad, n))
            belt = modes * turned
            site = loaded_site(self.task)[0]
            for transfer in late.values():
                belt = self._lagged(belt, np.asarray(transfer(site))[0])
            modes = belt * turned.conj()
        return CubicSpline(m.time_s, modes)

    def _lagged(self, belt: ComplexArray, transfer: ComplexArray) -> ComplexArray:
        """After a sensor's transfer, given at the frequencies n Omega, (k, N - 1)."""
        m, size = self.motion, belt.shape[0]
        turns = (
            np.arange(transfer.size) * self.conditions.speed_m_s[0] / (2.0 * np.pi * self.tire.R)
        )
        frequency = np.fft.fftfreq(
            2 * size, m.time_s[1] - m.time_s[0]
        )  # twice: no reading comes round to the other end
        smooth = CubicSpline(turns, transfer)(np.minimum(np.abs(frequency), turns[-1]))
        answer = np.where(frequency < 0.0, smooth.conj(), smooth)
        return np.fft.ifft(np.fft.fft(belt, 2 * size, axis=0) * answer[:, None], axis=0)[:size]


def driven(
    model: Model,
    conditions: Conditions,
    course: Course,
    *,
    step_s: float | None = None,
) -> Transient:
    """The model's motion over the course.

    `conditions` (1,) hold at the start, speed and load as in the course.

    ModelError: not a coupled ring; an effect without a motion; an unstable step; a speed beyond the
    critical one; a road that the tire cannot climb, or that begins under it.
    """
    if model.carcass != "coupled_ring":
        raise ModelError(
            f"a {model.carcass} does not move in time",
            allowed='carcass = "coupled_ring" is allowed',
            do="make one with `tirelog model new --carcass coupled_ring`",
        )
    conditions = replace(
        conditions,
        speed_m_s=np.array([course.speed_m_s(0.0)]),
        load_N=np.array([course.load_N(0.0)]),
    )
    task = next(model._tasks(conditions, model.values))[1]
    tire = tire_of(task)
    # the start rolls on a flat road; twice as much would ask for a longer way to an obstacle
    clear_m = 0.35 * tire.R
    height, _ = course.road.profile(np.linspace(-clear_m, clear_m, 101))
    if np.any(height != 0.0):
        raise ModelError(
            "road that begins under the standing tire",
            allowed=f"{clear_m:.3g} m ahead of its centre or farther is allowed",
            do="give a larger position_m",
        )
    load = loads(task).item()
    start = State.rolling(tire, load, conditions.speed_m_s[0])
    steady = start.V
    if step_s is None:
        step_s = min(1e-4, 0.9 * tire.largest_step_s(max(course.speed_m_s.value)))
    pressed = replace(course, load_N=course.load_N.scaled(load / conditions.load_N[0]))
    stepper = Stepper(tire, start, pressed, step_s=step_s, nodes=NODES)
    tire.check_speed(max(course.speed_m_s.value, key=abs))
    if not min(course.load_N.value) >= 0.0:
        raise ModelError(
            f"load of {min(course.load_N.value):g} N on the axle",
            allowed="zero and above is allowed",
            do="correct the load",
        )
    motion = stepped_motion(stepper, course.duration_s, every=max(round(KEEP_S / step_s), 1))
    remarks = tuple(
        f"{effect.id} acts on the steady waveform alone; what the road adds is computed without it"
        for effect, _ in task.having(*_STEADY_ONLY)
    )
    return Transient(model, conditions, course, tire, motion, steady, task, remarks)


def free_rolling_radius(model: Model, conditions: Conditions) -> float:
    """v / Omega [m] of the model that rolls freely under the one set of conditions."""
    task = next(model._tasks(conditions, model.values))[1]
    speed = float(conditions.speed_m_s[0])
    return speed / steady_rolling(tire_of(task), loads(task).item(), speed)[3]


def tire_of(task: Task) -> CoupledRing:
    """The tire that moves: the model's numbers with what its effects do to the structure."""
    s = structure(task)
    for effect, own in task.hooks(lambda effect: effect.structure).items():
        done = own()
        bent = np.any(done.loss) or np.any(done.cubic)
        if bent or np.any(done.retardation) or np.any(done.shear):
            what = "has no linear motion in time" if bent else "is not in the motion in time"
            raise ModelError(
                f"effect {effect!r} {what}",
                allowed="viscous_damping and stiffness that does not follow the deflection are "
                "allowed for transients",
                do="leave it out with `tirelog model remove`",
            )
    b, R = dict(task.base), task.base["radius_m"]
    soft = 1.0 + float(np.mean(s.stiffening))
    b["radial_stiffness_N_m2"] = b["radial_stiffness_N_m2"] * soft + float(
        np.mean(s.added_stiffness)
    )
    b["tangential_stiffness_N_m2"] *= soft
    b["radial_damping_N_s_m2"] += 2.0 * b["line_mass_kg_m"] * float(np.mean(s.damping_rate))
    known = task.drive.inflation_pressure_Pa
    b["inflation_pressure_Pa"] = float(
        np.where(np.isfinite(known), known, b["inflation_pressure_Pa"]).mean()
    )
    tire = of_model(b)
    return replace(tire, pb=tire.pb + float(np.mean(s.tension)) / R, modes=MODES)


# ---- What a coupled ring is driven over, put together from events, and its passage as rows of a
# table.
#
# road, speed, load, load steps --`course_of`--> Course --`driven`--> Transient
# --`passage_columns`--> a row per sensor and time


def course_of(
    road: RoadSetup,
    folder: Path | None,
    speed_m_s: float,
    load_N: float,
    loads: Sequence[tuple[float, float]] = (),
    duration_s: float | None = None,
) -> Course:
    """The course of a drive at `speed_m_s` that begins under `load_N`.

    folder      where a road profile's file lies
    loads       (time [s], load [N]) of each step, in the order of time
    duration_s  None: half a second past the last event
    UsageError  nothing to drive, or more than 100 s
    """
    # Where an obstacle begins that names no place [m], and how long is driven after it [s]. Twice
    # as much drives that much longer.
    at = 0.5 if road.position_m is None else road.position_m
    if road.time_s is not None:
        at = road.time_s * speed_m_s
    # a step of the load takes so long [s]: far less than a step of the motion; twice as long is
    # still a hundredth of it at most
    steps = [(time, time + 1e-6, value) for time, value in loads]
    load, speed = _schedule(load_N, steps), _schedule(speed_m_s, ())
    if duration_s is None:
        reached = at / speed_m_s if road.kind != "flat" and speed_m_s > 0.0 else 0.0
        duration_s = max(reached, load.time_s[-1]) + 0.5
    if not 0.0 < duration_s <= 100.0:
        raise UsageError(
            f"{duration_s:g} s to drive",
            allowed="above zero and up to 100 s is allowed",
            do="give --duration or a nearer obstacle",
        )
    return Course(speed, load, road_of(road, at, folder=folder), duration_s)


def _schedule(first: float, changes: Sequence[tuple[float, float, float]]) -> Schedule:
    """A value that begins so, and its changes (from [s], to [s], value)."""
    times, values = [0.0], [first]
    for begin, end, value in changes:
        times += [begin, end]
        values += [values[-1], value]
    return Schedule(tuple(times), tuple(values))


def passage_columns(transient: Transient, sensors_deg: list[float], surface: str) -> dict[str, Any]:
    """The table's columns: the passage once for each sensor.

    Sensors are at `sensors_deg` on the belt ahead of the patch centre at the start.
    """
    m, course = transient.motion, transient.course
    speed = np.array([course.speed_m_s(t) for t in m.time_s])
    passage = {
        "time_s": m.time_s,
        "distance_m": np.concatenate(
            [[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(m.time_s))]
        )
        + speed[0] * m.time_s[0],
        "speed_m_s": speed,
        "load_N": np.array([course.load_N(t) for t in m.time_s]),
        "wheel_angle_deg": np.degrees(m.psi_rad),
        "hub_displacement_m": m.hub_z_m - m.hub_z_m[0],
        "road_vertical_N": m.force_z_N,
        "road_longitudinal_N": m.force_s_N,
        "spindle_vertical_N": m.spindle_z_N,
        "spindle_longitudinal_N": m.spindle_s_N,
    }
    size = m.time_s.size
    columns: dict[str, Any] = {"sensor_deg": np.repeat(np.asarray(sensors_deg, float), size)}
    columns |= {name: np.tile(values, len(sensors_deg)) for name, values in passage.items()}
    for name, observable in (
        ("strain", "strain"),
        ("radial_acceleration_m_s2", "radial_acceleration"),
    ):
        readings = [
            transient.sensed(observable, np.radians(angle), surface=surface)
            for angle in sensors_deg
        ]
        columns[name] = np.concatenate(readings)
    return columns


# ---- The coupled ring in time.
#
# A symmetric step of kicks (road, sidewall) and an exact step of the belt's modes between them.
#
# Course -> `Stepper` -> `stepped_motion`, columns over time.  One step h:
#
#     half kick   road and sidewall act on velocities and spin
#     drift       rigid parts move on; every mode takes the exact step of  m V'' + (c + 2 i gamma
#                 Omega) V' + (Z + i n Omega c) V = 0
#     half kick   with the forces of the new place
#
# The kicks on a mode are not h / 2 m but beta and beta', chosen such that a load at rest in space
# holds the mode at E_n / (Z_n + i n Omega c_n) to the last bit: steady rolling is the steady ring
# at any h, and error is left for transients only (second order in h). The spin's momentum J_r Omega
# + P is what is integrated, so that energy and angular momentum pass between belt and spin as the
# equations say. Without damping all energy stays to some 1e-6 over 10 s of rolling; of the energy
# of the vibration alone a few percent come and go at h = 1e-4 and one at 5e-5, since nodes that
# touch and leave give the force a kink which no order of the step smooths.

#: a motion's columns of numbers: forces of the road on the tire, s backwards, and of the sidewall
#: on the hub, spin, place; and of complex ones, s + i z: velocities of hub and ring
_NUMBERS = (
    "time_s",
    "force_s_N",
    "force_z_N",
    "spindle_s_N",
    "spindle_z_N",
    "omega_rad_s",
    "psi_rad",
    "hub_z_m",
)
_RATES = ("hub_rate", "centre_rate")


@dataclass
class State:
    """Place and velocity of the tire's parts.

    Hub H and ring C [m] as s + i z, angles [rad], spins [rad/s], modes V (N - 1,) [m], and their
    rates.
    """

    hub: complex
    centre: complex
    hub_rate: complex
    centre_rate: complex
    psi: float
    psi_hub: float
    omega: float
    omega_hub: float
    V: ComplexArray
    V_rate: ComplexArray

    @classmethod
    def rolling(cls, tire: CoupledRing, load_N: float, speed_m_s: float) -> State:
        """Free, steady rolling on a flat road, at x = 0 (`steady_rolling`)."""
        tire.check_speed(speed_m_s)
        V, centre_m, a, omega = steady_rolling(tire, load_N, speed_m_s)
        centre = 1j * centre_m
        # what the sidewall's damping takes from the hub is held by the wind-up
        wound = tire.c_s * omega * abs(a) ** 2 / tire.k_theta
        rate = complex(-speed_m_s)
        return cls(
            centre - a,
            centre,
            rate,
            rate,
            wound,
            0.0,
            omega,
            omega,
            V,
            np.zeros_like(V),
        )


class Stepper:
    """Moves a `State` on in steps of `step_s`.

    ModelError if such a step is unstable, or the motion leaves what the ring can do.
    """

    def __init__(
        self,
        tire: CoupledRing,
        state: State,
        course: Course,
        *,
        step_s: float = 1e-4,
        nodes: int = 1536,
    ) -> None:
        self.tire, self.state, self.course, self.step_s = tire, state, course, step_s
        self.tread = Tread(tire, course.road, nodes)
        self.time_s = 0.0
        speed = abs(state.omega) * tire.R
        self.tread.road.check_climbable(tire.R)
        if not 0.0 < step_s <= tire.largest_step_s(speed):
            raise ModelError(
                f"step of {step_s:g} s is not stable for this tire",
                allowed=f"above zero and up to {tire.largest_step_s(speed):.3g} s is allowed",
                do="give a shorter step or fewer modes",
            )
        self._belt_at = np.nan
        self._before = self._after = np.zeros_like(state.V)
        self._swing = tire.gamma_n / tire.m_n
        self._carried = 4.0 * np.pi * tire.R * tire.gamma_n * self._swing
        self._momentum = tire.J_r * state.omega + tire.gyroscopic_momentum(state.V, state.V_rate)
        self._touch()

    # ---- one step --------------------------------------------------------------------------------

    def step(self) -> None:
        """Move the state on by one step."""
        s, h = self.state, self.step_s
        self._belt()
        self._damp(0.5 * h)
        self._kick(0.5 * h, self._before)
        drag = self._drag()
        a, b, c, d = self._flow
        s.V, s.V_rate = a * s.V + b * s.V_rate, c * s.V + d * s.V_rate
        self._momentum += 0.5 * h * (drag + self._drag())
        s.hub += h * s.hub_rate
        s.centre += h * s.centre_rate
        s.psi += h * s.omega
        s.psi_hub += h * s.omega_hub
        self.time_s += h
        self._touch()
        self._kick(0.5 * h, self._after)
        self._damp(0.5 * h)

    def _drag(self) -> float:
        s = self.state
        return self.tire.belt_drag(s.V, s.V_rate, s.omega)

    def _touch(self) -> None:
        s = self.state
        self.road_force, self.road_torque, self.road_load = self.tread.forces(s.centre, s.psi, s.V)

    def _belt(self) -> None:
        """The modes' exact flow over h at this spin, and the kicks.

        The kicks keep a steady load's answer exact.
        """
        tire, omega, h = self.tire, self.state.omega, self.step_s
        # Spin [rad/s] by which the belt's exact step may be out of date. Twice as much renews it
        # half as often, and leaves up to twice the error of its phase.
        if abs(omega - self._belt_at) < 1e-3:
            return
        self._belt_at = omega
        K: ComplexArray = tire.Z_n + 1j * tire.n * omega * tire.c_n
        half = ((tire.c_n + 2j * tire.gamma_n * omega) / (2.0 * tire.m_n)).astype(np.complex128)
        root: ComplexArray = np.sqrt(half**2 - K / tire.m_n)
        p, q = -half + root, -half - root
        e_p: ComplexArray = np.exp(p * h)
        e_q: ComplexArray = np.exp(q * h)
        b: ComplexArray = (e_p - e_q) / (p - q)
        a: ComplexArray = (p * e_q - q * e_p) / (p - q)
        d: ComplexArray = (p * e_p - q * e_q) / (p - q)
        c: ComplexArray = -p * q * b
        self._flow = a, b, c, d
        self._before = (1.0 - a) / (K * b)
        self._after = -c / K - d * self._before

    def _kick(self, h: float, beta: ComplexArray) -> None:
        """Impulses of road, springs and what the course applies, over h.

        The modes take theirs by `beta`.
        """
        s, tire, course = self.state, self.tire, self.course
        spring = tire.k_s * (s.centre - s.hub)
        wound = tire.k_theta * (s.psi - s.psi_hub)
        s.centre_rate += h / tire.m_r * (self.road_force - spring)
        s.hub_rate += h / tire.m_h * (spring - 1j * course.load_N(self.time_s))
        if not course.free:
            s.hub_rate = complex(-course.speed_m_s(self.time_s), s.hub_rate.imag)
        s.omega_hub += h / tire.J_h * (wound + course.torque_N_m(self.time_s))
        s.V_rate = s.V_rate + beta * self.road_load
        self._momentum += h * (self.road_torque - wound)
        self._respin()

    def _damp(self, h: float) -> None:
        """The dampers of sidewall and suspension over h, exact for velocities.

        What the sidewall's take from the ring they give to the hub.
        """
        s, tire = self.state, self.tire
        kept = math.exp(-tire.c_h / tire.m_h * h)
        s.hub_rate = complex(s.hub_rate.real, s.hub_rate.imag * kept)
        across = 1j * (s.centre - s.hub)
        sliding = s.centre_rate - s.hub_rate - s.omega_hub * across
        free = 1.0 / tire.m_r + 1.0 / tire.m_h
        held = free if self.course.free else 1.0 / tire.m_r
        impulse = complex(
            sliding.real * math.expm1(-tire.c_s * held * h) / held,
            sliding.imag * math.expm1(-tire.c_s * free * h) / free,
        )
        s.centre_rate += impulse / tire.m_r
        s.hub_rate -= (impulse if self.course.free else 1j * impulse.imag) / tire.m_h
        inverse = 1.0 / tire.J_r + 1.0 / tire.J_h
        turn = (s.omega - s.omega_hub) * math.expm1(-tire.c_theta * inverse * h) / inverse
        s.omega_hub -= (turn + (impulse.conjugate() * across).real) / tire.J_h
        s.omega += turn / tire.J_r
        self._momentum += turn

    def _respin(self) -> None:
        """The spin that belongs to the momentum; the belt's canonical momenta stay as they are."""
        s, tire = self.state, self.tire
        carried = float(np.dot(self._carried, s.V.real**2 + s.V.imag**2))
        change = (self._momentum - tire.J_r * s.omega - tire.gyroscopic_momentum(s.V, s.V_rate)) / (
            tire.J_r - carried
        )
        s.omega += change
        s.V_rate = s.V_rate - (1j * change) * self._swing * s.V

    # ---- what there is to see --------------------------------------------------------------------

    def spindle(self) -> complex:
        """Force [N] of the sidewall on the hub, along s and (imaginary) z."""
        s, tire = self.state, self.tire
        a = s.centre - s.hub
        return tire.k_s * a + tire.c_s * (s.centre_rate - s.hub_rate - 1j * s.omega_hub * a)


def stepped_motion(stepper: Stepper, duration_s: float, *, every: int = 10) -> Any:
    """The motion over `duration_s` as a table (k,), every `every`-th step kept.

    Its columns are attributes: _NUMBERS, _RATES, and the modes V and V_rate (k, N - 1). ModelError
    if the ring turns inside out or flies apart.
    """
    rows: list[tuple[Any, ...]] = []
    for index in range(max(round(duration_s / stepper.step_s), 1)):
        stepper.step()
        if index % every:
            continue
        s, force, spindle = stepper.state, stepper.road_force, stepper.spindle()
        if not (np.isfinite(s.omega) and abs(s.centre - s.hub) < 0.5 * stepper.tire.R):
            raise ModelError(
                f"the ring left its sidewall at {stepper.time_s:.4g} s",
                allowed="displacements below half of the radius are allowed",
                do="lower the load, the obstacle or the step",
            )
        hub = (s.omega, s.psi, s.hub.imag, s.hub_rate, s.centre_rate)
        forces = (force.real, force.imag, spindle.real, spindle.imag)
        rows.append((stepper.time_s, *forces, *hub, s.V, s.V_rate))
    waves = [(name, "c16", stepper.tire.n.size) for name in ("V", "V_rate")]
    columns = [*((name, "f8") for name in _NUMBERS), *((name, "c16") for name in _RATES), *waves]
    return np.array(rows, np.dtype(columns)).view(np.recarray)
