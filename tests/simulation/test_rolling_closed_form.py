"""Closed form: a torque in the air, and the road under the belt of finite elements.

Its waves, rest and steps are held by the models' coupled ring, which shares no formula with it
(`tests/physics/test_coupled_truth.py`).
"""

from __future__ import annotations

import numpy as np
import pytest

from tirelog.simulation.rolling import step_kernel as kernel
from tirelog.simulation.rolling.world import TrueProfile

from .rolls import K_V, LINE_MASS, RADIUS, belt, orders, rolling

HUB_INERTIA = 0.8
RING_MASS = 2.0 * np.pi * RADIUS * LINE_MASS
CLEAT = TrueProfile(np.array([1.0, 1.01, 1.03, 1.04]), np.array([0.0, 0.01, 0.01, 0.0]))
SINE = TrueProfile(np.array([0.0, 1.0]), np.zeros(2), 0.004, 0.8)


def test_a_torque_in_the_air_winds_up_and_spins() -> None:
    of = belt(64, tangential_damping_N_s_m2=2000.0)
    tire = rolling(of, speed=5.0, load=0.0, start=(np.zeros(64), 1.0, 0.0))
    tire.run(orders(8000, speed=5.0, load=0.0, torque=30.0))
    whole = HUB_INERTIA + RING_MASS * RADIUS**2
    assert tire.state["spin_rad_s"] == pytest.approx(5.0 / RADIUS + 30.0 * 0.2 / whole, rel=1e-3)
    # the belt lags: its share of the torque over the wind-up stiffness
    lag = 30.0 * RING_MASS * RADIUS**2 / whole / (2 * np.pi * RADIUS**2 * K_V)
    assert tire.v.mean() == pytest.approx(-lag, rel=2e-2)


@pytest.mark.parametrize(
    ("profile", "x", "height", "slope"),
    [
        (CLEAT, 1.005, 0.005, 1.0),
        (CLEAT, 1.02, 0.01, 0.0),
        (CLEAT, 2.0, 0.0, 0.0),
        (SINE, 0.2, 0.004, 0.004 * 2 * np.pi / 0.8),
        (SINE, -0.2, 0.0, 0.0),
    ],
)
def test_road_at_a_distance(profile: TrueProfile, x: float, height: float, slope: float) -> None:
    constants = rolling(
        belt(64), speed=0.0, load=0.0, start=(np.zeros(64), 1.0, 0.0), profile=profile
    ).constants
    found = kernel.road_at(x, profile.corner_m, profile.height_m, constants)
    assert found == pytest.approx((height, slope), abs=1e-12)
