"""What the tests of a tire in motion share: a small tire, a level road, constant orders."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from tirelog.data.road import RoadProfile
from tirelog.simulation.rolling.belt import HALF, Belt, Splines
from tirelog.simulation.rolling.step_kernel import DRIVE, LIVING
from tirelog.simulation.rolling.world import POINTS, AtRest, RollingTire, tire_at_rest
from tirelog.simulation.scenario.schema import TrueTire
from tirelog.vocabulary.arrays import FloatArray

RADIUS, LINE_MASS, EI, K_W, K_V, PB = 0.3, 3.15, 2.0, 6.3e5, 5.1e5, 1.2e5 * 0.14
LEVEL = RoadProfile()
STEP = 2.5e-5


def belt(elements: int = 96, **more: Any) -> Belt:
    tire = TrueTire(
        rolling_radius_m=RADIUS,
        line_mass_kg_m=LINE_MASS,
        flexural_stiffness_N_m2=EI,
        radial_stiffness_N_m2=K_W,
        tangential_stiffness_N_m2=K_V,
    )
    return Belt(replace(tire, **more), PB * RADIUS, Splines(elements))


def orders(
    steps: int,
    *,
    speed: float,
    load: float,
    torque: float = 0.0,
    start_m: float = 0.0,
    step: float = STEP,
) -> np.ndarray:
    """Constant speed, load and torque, (n,) of DRIVE."""
    made = np.zeros(steps, DRIVE)
    made["distance_m"] = start_m + speed * step * np.arange(1, steps + 1)
    made["load_N"], made["torque_N_m"] = load, torque
    return made


def rolling(
    of: Belt,
    *,
    speed: float,
    load: float,
    start: AtRest | None = None,
    profile: RoadProfile = LEVEL,
    step: float = STEP,
) -> RollingTire:
    return RollingTire(
        of, profile, start or tire_at_rest(of, load), speed_m_s=speed, distance_m=0.0, step_s=step
    )


def moved(tire: RollingTire, ran: tuple[np.ndarray, np.ndarray], every: int = 1) -> Any:
    """What `RollingTire.run` gave, with its times [s] and what the riders read."""
    moments, read = ran
    times = tire.step_s * every * np.arange(moments.size)
    return SimpleNamespace(
        time_s=times, read=read, **{name: moments[name] for name in moments.dtype.names or ()}
    )


def strain_rider(of: Belt, angle_rad: float, lever_m: float = 3e-4) -> np.ndarray:
    bent = -lever_m / RADIUS**2
    return of.splines.functional(angle_rad, {1: bent, 3: bent})[None]


def energy_J(tire: RollingTire) -> float:
    """Kinetic and elastic energy [J] of belt, hub and tread springs on a level road."""
    belt, state = tire.belt, tire.state
    M, G, S, K = (
        belt.full(a) for a in (belt.inertia, belt.swirl, belt.centrifugal, belt.stiffness)
    )
    v, u, spin, rate = tire.v, tire.u, state["spin_rad_s"], state["hub_rate_m_s"]
    wave, own = (
        np.sin(belt.splines.middle_rad + state["angle_rad"]),
        np.cos(belt.splines.middle_rad + state["angle_rad"]),
    )
    turning = 0.5 * tire.constants["spin_inertia_kg_m2"] * spin**2
    turning += spin * belt.radius_m * tire.constants["mean_inertia_kg"] * float(u.sum())
    moving = 0.5 * u @ M @ u + spin * u @ G @ v + 0.5 * spin**2 * v @ S @ v
    moving += rate * belt.carried * (u @ wave + spin * v @ own)
    hub = 0.5 * (belt.tire.hub_mass_kg + belt.mass_kg) * rate**2
    pressed = np.maximum(-_heights(tire), 0.0)
    tread = (
        0.5 * belt.tire.tread_stiffness_N_m2 * tire.constants["pitch_m"] * float(pressed @ pressed)
    )
    return float(turning + moving + hub + 0.5 * v @ K @ v + tread)


def _heights(tire: RollingTire) -> FloatArray:
    """Height (points,) of the tread."""
    points, size = tire._circle.size, tire.v.size
    element = np.arange(points) // POINTS
    living = tire.v[(element[:, None] + np.arange(LIVING) - HALF) % size]
    along, slope = (np.einsum("ik,ik->i", np.tile(each, (size, 1)), living) for each in tire._basis)
    phi = (np.arange(points) + 0.5) * (2.0 * np.pi / points) + tire.state["angle_rad"]
    return np.asarray(
        tire.state["hub_z_m"] - (tire.belt.radius_m - slope) * np.cos(phi) + along * np.sin(phi),
        float,
    )
