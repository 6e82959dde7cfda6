"""What the tests of the coupled ring share: a tire, what it is driven over, a sensor's strain."""

from collections.abc import Callable

import numpy as np

from tirelog.data.road import RoadProfile, road_of
from tirelog.data.setup import RoadSetup
from tirelog.physics.moving.ring import CoupledRing
from tirelog.physics.moving.transient import Course, Schedule

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


def strain(tire: CoupledRing, motion, theta_rad: float, lever_m: float) -> np.ndarray:
    """Strain (k,) at the belt's own angle: (y / R^2) (w + w''), w outward, y toward the axle."""
    n = tire.n
    turn = np.exp(1j * np.outer(motion.psi_rad + theta_rad, n))
    return lever_m / tire.R**2 * 2.0 * np.sum(-1j * n * (1.0 - n**2) * motion.V * turn, axis=1).real
