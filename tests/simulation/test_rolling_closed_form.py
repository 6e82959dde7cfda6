"""Closed form: the belt of finite elements and its compiled step against what can be written down.

A ring that does not stretch, from P3 (with its errata: sigma A = p b R + rho A R^2 W^2, a missing
A), in a frame that turns with W:

    rho A (1 + n^2) w^2 - 4 rho A n W w - k_n = 0,
    k_n = (EI/R^4 n^2 + sigma A/R^2)(1 - n^2)^2 - (p b/R)(1 - n^2)
          + k_v + k_w n^2 - rho A (1 + n^2) W^2
"""

from __future__ import annotations

import numpy as np
import pytest

from tirelog.simulation.rolling import step_kernel as kernel
from tirelog.simulation.rolling.world import TrueProfile, tire_at_rest

from .rolls import EI, K_V, K_W, LINE_MASS, PB, RADIUS, belt, moved, orders, rolling, strain_rider

HUB_MASS, HUB_INERTIA = 20.0, 0.8
RING_MASS = 2.0 * np.pi * RADIUS * LINE_MASS


def stiffness(n: int, spin: float) -> float:
    hoop = PB * RADIUS + LINE_MASS * RADIUS**2 * spin**2
    bent = (EI / RADIUS**4 * n**2 + hoop / RADIUS**2) * (1 - n**2) ** 2
    return bent - PB / RADIUS * (1 - n**2) + K_V + K_W * n**2 - LINE_MASS * (1 + n**2) * spin**2


def waves(n: int, spin: float) -> np.ndarray:
    """The two frequencies that the turning belt feels [rad/s], with the rotation's sign."""
    return np.sort(
        np.roots([LINE_MASS * (1 + n**2), -4.0 * LINE_MASS * n * spin, -stiffness(n, spin)])
    )


def test_natural_frequencies_at_rest() -> None:
    found = belt().natural_frequencies()
    by_lobes = {n: [f["frequency_Hz"] for f in found if f["lobes"] == n] for n in range(10)}
    translation = np.sqrt(np.pi * RADIUS * (K_W + K_V) * (1 / HUB_MASS + 1 / RING_MASS)) / (
        2 * np.pi
    )
    wind_up = np.sqrt(
        2 * np.pi * RADIUS**3 * K_V * (1 / HUB_INERTIA + 1 / (RING_MASS * RADIUS**2))
    ) / (2 * np.pi)
    assert by_lobes[0] == pytest.approx([wind_up], rel=1e-9)
    assert by_lobes[1] == pytest.approx([translation] * 2, rel=1e-9)
    for n in range(2, 9):
        assert by_lobes[n] == pytest.approx([waves(n, 0.0)[1] / (2 * np.pi)] * 2, rel=2e-6)


@pytest.mark.parametrize("speed", [10.0, 40.0])
def test_rotation_splits_the_travelling_waves(speed: float) -> None:
    spin = speed / RADIUS
    values, shapes = belt(64).vibrations(spin)
    for n in range(1, 9):
        # a harmonic e^(i n theta) with e^(i w t)
        share = np.abs(np.fft.fft(shapes, axis=0)[n]) / np.linalg.norm(
            np.fft.fft(shapes, axis=0), axis=0
        )
        pair = np.sort(values[share > 0.9].imag)
        assert pair == pytest.approx(waves(n, spin), rel=2e-5)


def test_steps_in_time_ring_as_the_turning_belt_does() -> None:
    """Three lobes pressed in by 0.1 mm and let go in the air at 20 m/s: the sum of two travelling
    waves.
    """
    spin, n, h = 20.0 / RADIUS, 3, 2.5e-5
    of = belt(64)
    # spline coefficients of cos(3 theta)
    wave = (
        np.cos(n * of.splines.middle_rad)
        * (n * of.splines.step_rad / 2 / np.sin(n * of.splines.step_rad / 2)) ** 6
    )
    tire = rolling(of, speed=20.0, load=0.0, start=(1e-4 * wave, 1.0, 0.0), step=h)
    tire.u[:] = 0.0
    tire.state["momentum_N_m_s"] = tire._momentum()
    _, read = tire.run(
        orders(4000, speed=20.0, load=0.0, step=h),
        riders=(strain_rider(of, 0.4, lever_m=RADIUS**2),),
    )
    slow, fast = waves(n, spin)
    # v = Re (A e^(i slow t) + B e^(i fast t)) e^(i n theta), at rest at first
    a, b = fast / (fast - slow), -slow / (fast - slow)
    time = h * np.arange(4000)
    exact = 1e-4 * (
        (a * np.exp(1j * slow * time) + b * np.exp(1j * fast * time)) * np.exp(1j * n * 0.4)
    )
    strain = (-1j * n * (1 - n**2) * exact).real
    assert np.abs(read[:, 0] - strain).max() < 2e-3 * np.abs(strain).max()


def test_standing_tire_carries_its_load() -> None:
    """The sidewall's springs hand on what the road carries; the belt's centre is lifted against the
    hub by load over stiffness.
    """
    of = belt()
    stood = tire_at_rest(of, 3000.0)
    lifted = of.carried / of.mass_kg * stood[0] @ np.sin(of.splines.middle_rad)
    assert lifted == pytest.approx(3000.0 / (np.pi * RADIUS * (K_W + K_V)), rel=1e-9)
    tire = rolling(of, speed=0.0, load=3000.0, start=stood)
    motion = moved(tire, tire.run(orders(2, speed=0.0, load=3000.0)))
    assert motion.force_z_N[0] == pytest.approx(3000.0, rel=1e-9)
    assert motion.spindle_z_N[0] == pytest.approx(3000.0, rel=1e-9)
    assert motion.force_x_N[0] == pytest.approx(0.0, abs=1e-6)


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
        (
            TrueProfile(np.array([1.0, 1.01, 1.03, 1.04]), np.array([0.0, 0.01, 0.01, 0.0])),
            1.005,
            0.005,
            1.0,
        ),
        (
            TrueProfile(np.array([1.0, 1.01, 1.03, 1.04]), np.array([0.0, 0.01, 0.01, 0.0])),
            1.02,
            0.01,
            0.0,
        ),
        (
            TrueProfile(np.array([1.0, 1.01, 1.03, 1.04]), np.array([0.0, 0.01, 0.01, 0.0])),
            2.0,
            0.0,
            0.0,
        ),
        (
            TrueProfile(np.array([0.0, 1.0]), np.zeros(2), 0.004, 0.8),
            0.2,
            0.004,
            0.004 * 2 * np.pi / 0.8,
        ),
        (TrueProfile(np.array([0.0, 1.0]), np.zeros(2), 0.004, 0.8), -0.2, 0.0, 0.0),
    ],
)
def test_road_at_a_distance(profile: TrueProfile, x: float, height: float, slope: float) -> None:
    constants = rolling(
        belt(64), speed=0.0, load=0.0, start=(np.zeros(64), 1.0, 0.0), profile=profile
    ).constants
    found = kernel.road_at(x, profile.corner_m, profile.height_m, constants)
    assert found == pytest.approx((height, slope), abs=1e-12)
