"""The coupled ring in time.

A symmetric step of kicks (road, sidewall) and an exact step of the belt's modes between them.

Scenario -> `stepped_motion` -> `RingMotion`, columns over time.  One step h:

    half kick   road and sidewall act on velocities and spin
    drift       rigid parts move on; every mode takes the exact step of  m V'' + (c + 2 i gamma
                Omega) V' + (Z + i n Omega c) V = 0
    half kick   with the forces of the new place

The kicks on a mode are not h / 2 m but beta and beta', chosen such that a load at rest in space
holds the mode at E_n / (Z_n + i n Omega c_n) to the last bit: steady rolling is the steady ring at
any h, and error is left for transients only (second order in h). The spin's momentum J_r Omega + P
is what is integrated, so that energy and angular momentum pass between belt and spin as the
equations say. Without damping all energy stays to some 1e-6 over 10 s of rolling; of the energy of
the vibration alone a few percent come and go at h = 1e-4 and one at 5e-5, since nodes that touch
and leave give the force a kink which no order of the step smooths.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from tirelog.errors import ModelError
from tirelog.physics.moving.contact import RoadForces, Tread, steady_rolling
from tirelog.physics.moving.ring import CoupledRing
from tirelog.physics.moving.road import FlatRoad, RoadProfile, check_climbable
from tirelog.physics.spectral import ComplexArray
from tirelog.vocabulary.arrays import FloatArray

#: Spin [rad/s] by which the belt's exact step may be out of date. Twice as much renews it half as
#: often, and leaves up to twice the error of its phase.
_STALE = 1e-3
_COLUMNS = (
    "time_s",
    "force_s_N",
    "force_z_N",
    "spindle_s_N",
    "spindle_z_N",
    "omega_rad_s",
    "psi_rad",
    "hub_z_m",
    "energy_J",
)


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
    def rolling(
        cls, tire: CoupledRing, load_N: float, speed_m_s: float, *, height_m: float = 0.0
    ) -> State:
        """Free, steady rolling on a flat road of that height, at x = 0 (`steady_rolling`)."""
        tire.check_speed(speed_m_s)
        steady = steady_rolling(tire, load_N, speed_m_s)
        centre, a, omega = 1j * (steady.centre_m + height_m), steady.displacement, steady.omega
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
            steady.V,
            np.zeros_like(steady.V),
        )


@dataclass(frozen=True)
class HubMotion:
    """What is done to the hub, as functions of time [s].

    Load [N] downwards, speed [m/s] (None: free), torque [N m] with the spin.
    """

    load_N: Callable[[float], float]
    speed_m_s: Callable[[float], float] | None = None
    torque_N_m: Callable[[float], float] = field(default=lambda time: 0.0)


@dataclass(frozen=True)
class RingMotion:
    """Forces, spin and belt over time as columns, each (k,) or (k, N - 1).

    The forces are those of the road and of the spindle.

    force_s_N, force_z_N  of the road on the tire, s backwards; spindle_s_N, spindle_z_N  of the
                          sidewall on the hub
    hub_rate, centre_rate  velocities (k,) of hub and ring, s + i z
    """

    tire: CoupledRing
    time_s: FloatArray
    force_s_N: FloatArray
    force_z_N: FloatArray
    spindle_s_N: FloatArray
    spindle_z_N: FloatArray
    omega_rad_s: FloatArray
    psi_rad: FloatArray
    hub_z_m: FloatArray
    energy_J: FloatArray
    V: ComplexArray
    V_rate: ComplexArray
    hub_rate: ComplexArray
    centre_rate: ComplexArray

    def strain(self, theta_rad: float, lever_m: float) -> FloatArray:
        """Strain (k,) at the belt's own angle theta.

        (y / R^2) (w + w''), w outward (errata); `lever_m` toward the axle is positive.
        """
        n = self.tire.n
        turn = np.exp(1j * np.outer(self.psi_rad + theta_rad, n))
        return np.asarray(
            lever_m
            / self.tire.R**2
            * 2.0
            * np.sum(-1j * n * (1.0 - n**2) * self.V * turn, axis=1).real
        )


class Stepper:
    """Moves a `State` on in steps of `step_s`.

    ModelError if such a step is unstable, or the motion leaves what the ring can do.
    """

    def __init__(
        self,
        tire: CoupledRing,
        state: State,
        drive: HubMotion,
        road: RoadProfile | None = None,
        *,
        step_s: float = 1e-4,
        nodes: int = 1536,
    ) -> None:
        self.tire, self.state, self.drive, self.step_s = tire, state, drive, step_s
        self.tread = Tread(tire, road or FlatRoad(), nodes)
        self.time_s = 0.0
        speed = abs(state.omega) * tire.R
        tire.check_speed(speed)
        check_climbable(self.tread.road, tire.R)
        if not 0.0 < step_s <= tire.largest_step_s(speed):
            raise ModelError(
                f"step of {step_s:g} s is not stable for this tire",
                allowed=f"above zero and up to {tire.largest_step_s(speed):.3g} s is allowed",
                do="give a shorter step or fewer modes",
            )
        self._belt_at = np.nan
        self._before = self._after = np.zeros_like(state.V)
        self._damped = tire.c_w > 0.0 or tire.c_v > 0.0
        self._swing = tire.gamma_n / tire.m_n
        self._carried = 4.0 * np.pi * tire.R * tire.gamma_n * self._swing
        self._momentum = tire.J_r * state.omega + tire.gyroscopic_momentum(state.V, state.V_rate)
        self.road_forces: RoadForces = self._touch()

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
        self.road_forces = self._touch()
        self._kick(0.5 * h, self._after)
        self._damp(0.5 * h)

    def _drag(self) -> float:
        s = self.state
        return self.tire.belt_drag(s.V, s.V_rate, s.omega) if self._damped else 0.0

    def _touch(self) -> RoadForces:
        s = self.state
        return self.tread.forces(s.centre, s.psi, s.V)

    def _belt(self) -> None:
        """The modes' exact flow over h at this spin, and the kicks.

        The kicks keep a steady load's answer exact.
        """
        tire, omega, h = self.tire, self.state.omega, self.step_s
        if abs(omega - self._belt_at) < _STALE:
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
        """Impulses of road, springs and what the drive applies, over h.

        The modes take theirs by `beta`.
        """
        s, tire, drive, road = self.state, self.tire, self.drive, self.road_forces
        spring = tire.k_s * (s.centre - s.hub)
        wound = tire.k_theta * (s.psi - s.psi_hub)
        s.centre_rate += h / tire.m_r * (road.force - spring)
        s.hub_rate += h / tire.m_h * (spring - 1j * drive.load_N(self.time_s))
        if drive.speed_m_s is not None:
            s.hub_rate = complex(-drive.speed_m_s(self.time_s), s.hub_rate.imag)
        s.omega_hub += h / tire.J_h * (wound + drive.torque_N_m(self.time_s))
        s.V_rate = s.V_rate + beta * road.modes
        self._momentum += h * (road.torque - wound)
        self._respin()

    def _damp(self, h: float) -> None:
        """The dampers of sidewall and suspension over h, exact for velocities.

        What the sidewall's take from the ring they give to the hub.
        """
        s, tire = self.state, self.tire
        if tire.c_h > 0.0:
            s.hub_rate = complex(
                s.hub_rate.real, s.hub_rate.imag * math.exp(-tire.c_h / tire.m_h * h)
            )
        if not self._damped:
            return
        across = 1j * (s.centre - s.hub)
        sliding = s.centre_rate - s.hub_rate - s.omega_hub * across
        free = 1.0 / tire.m_r + 1.0 / tire.m_h
        held = free if self.drive.speed_m_s is None else 1.0 / tire.m_r
        impulse = complex(
            sliding.real * math.expm1(-tire.c_s * held * h) / held,
            sliding.imag * math.expm1(-tire.c_s * free * h) / free,
        )
        s.centre_rate += impulse / tire.m_r
        s.hub_rate -= (impulse if self.drive.speed_m_s is None else 1j * impulse.imag) / tire.m_h
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

    def energy(self) -> float:
        """Kinetic and elastic energy [J] of tire, hub and tread, without the load's potential."""
        s, tire = self.state, self.tire
        rigid = (
            tire.m_r * abs(s.centre_rate) ** 2
            + tire.m_h * abs(s.hub_rate) ** 2
            + tire.k_s * abs(s.centre - s.hub) ** 2
        )
        spin = (
            tire.J_r * s.omega**2
            + tire.J_h * s.omega_hub**2
            + tire.k_theta * (s.psi - s.psi_hub) ** 2
        )
        return (
            0.5 * (rigid + spin)
            + tire.belt_energy(s.V, s.V_rate, s.omega)
            + self.road_forces.energy
        )

    def spindle(self) -> complex:
        """Force [N] of the sidewall on the hub, along s and (imaginary) z."""
        s, tire = self.state, self.tire
        a = s.centre - s.hub
        return tire.k_s * a + tire.c_s * (s.centre_rate - s.hub_rate - 1j * s.omega_hub * a)


def stepped_motion(stepper: Stepper, duration_s: float, *, every: int = 10) -> RingMotion:
    """The motion over `duration_s`, every `every`-th step kept.

    ModelError if the ring turns inside out or flies apart.
    """
    rows: list[list[float]] = []
    shapes: list[tuple[Any, ...]] = []
    for index in range(max(round(duration_s / stepper.step_s), 1)):
        stepper.step()
        if index % every:
            continue
        s, force, spindle = stepper.state, stepper.road_forces.force, stepper.spindle()
        if not (np.isfinite(s.omega) and abs(s.centre - s.hub) < 0.5 * stepper.tire.R):
            raise ModelError(
                f"the ring left its sidewall at {stepper.time_s:.4g} s",
                allowed="displacements below half of the radius are allowed",
                do="lower the load, the obstacle or the step",
            )
        hub = (s.omega, s.psi, s.hub.imag, stepper.energy())
        rows.append([stepper.time_s, force.real, force.imag, spindle.real, spindle.imag, *hub])
        shapes.append((s.V, s.V_rate, s.hub_rate, s.centre_rate))
    columns = dict(zip(_COLUMNS, np.array(rows).T))
    V, V_rate, hub_rate, centre_rate = (np.array(each) for each in zip(*shapes))
    return RingMotion(
        stepper.tire, V=V, V_rate=V_rate, hub_rate=hub_rate, centre_rate=centre_rate, **columns
    )
