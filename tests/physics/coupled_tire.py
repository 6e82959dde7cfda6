"""What the tests of the coupled ring share: a tire, what it is driven over, a sensor's strain."""

from collections.abc import Callable

import numpy as np

from tirelog.data.road import RoadProfile, road_of
from tirelog.data.setup import RoadSetup
from tirelog.physics.moving.ring import CoupledRing
from tirelog.physics.moving.transient import Course, Schedule, Stepper

TIRE = CoupledRing(
    EI=2.0,
    k_w=6.3e5,
    k_v=5.1e5,
    c_w=60.0,
    c_v=60.0,
    pb=1.2e5 * 0.14,
    R=0.3,
    k_t=8.75e7,
    rho_A=3.15,
    modes=40,
)

FLAT = RoadProfile()


def obstacle(kind: str, at_m: float, **numbers: float) -> RoadProfile:
    return road_of(RoadSetup(kind=kind, **numbers), at_m)


def course(
    load: float | Callable[[float], float],
    speed: float | None = None,
    road: RoadProfile = FLAT,
    torque: float | Callable[[float], float] = 0.0,
) -> Course:
    """The course of a `Stepper`; without a speed its hub is free."""
    held, turned = (v if callable(v) else Schedule.constant(v) for v in (load, torque))
    driven = Schedule.constant(speed or 0.0)
    return Course(driven, held, road, 0.0, turned, free=speed is None)


def energy_J(stepper: Stepper) -> float:
    """Kinetic and elastic energy of tire, hub and springs of the tread, by the Lagrangian."""
    s, tire, tread = stepper.state, stepper.tire, stepper.tread
    kinetic = tire.m_r * abs(s.centre_rate) ** 2 + tire.m_h * abs(s.hub_rate) ** 2
    kinetic += tire.J_r * s.omega**2 + tire.J_h * s.omega_hub**2
    wound = tire.k_s * abs(s.centre - s.hub) ** 2 + tire.k_theta * (s.psi - s.psi_hub) ** 2
    waves = np.sum(tire.m_n * np.abs(s.V_rate) ** 2 + tire.Z_n * np.abs(s.V) ** 2)
    momentum = 2.0 * np.sum(tire.gamma_n * (s.V_rate * s.V.conj()).imag)
    seen = tread._was["call"] == tread._now
    pressed = np.maximum(tread._was["depth_m"][seen], 0.0)
    springs = 0.5 * tire.k_t * 2.0 * np.pi * tire.R / tread.nodes * np.sum(pressed**2)
    belt = 2.0 * np.pi * tire.R * (waves + s.omega * momentum)
    return float(0.5 * (kinetic + wound) + belt + springs)


def strain(tire: CoupledRing, motion, theta_rad: float, lever_m: float) -> np.ndarray:
    """Strain (k,) at the belt's own angle: (y / R^2) (w + w''), w outward, y toward the axle."""
    n = tire.n
    turn = np.exp(1j * np.outer(motion.psi_rad + theta_rad, n))
    return lever_m / tire.R**2 * 2.0 * np.sum(-1j * n * (1.0 - n**2) * motion.V * turn, axis=1).real
