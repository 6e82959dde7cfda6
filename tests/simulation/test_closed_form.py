"""Closed form: the truth's ring as a sum, its contact and friction against the papers' numbers; a
torque in the air and the road under a tire in motion.
"""

from dataclasses import replace

import numpy as np
import pytest

from tirelog.simulation.scenario.schema import Planted
from tirelog.simulation.steady.carcass import FlatRoadContact, carcass
from tirelog.simulation.steady.loads import Ring, friction, true_parabola

from .rolls import K_V, LINE_MASS, RADIUS, belt, orders, rolling
from .worlds import instants, scenario

R = 0.305
TRACTION = Planted("traction", "exact", {"slip_per_g": 0.0, "lever_m": 0.018})


def test_ring_under_a_point_load_by_its_modes():
    """Sum over n of the errata's modal stiffness; inextensible, so the mean of w vanishes; n = 1
    has the stiffness k_v + k_w.
    """
    damped = {"radial_damping_N_s_m2": 200.0, "tangential_damping_N_s_m2": 90.0}
    made, ring = scenario(truth="ring", tire=damped), Ring(2048, 2.0 * np.pi * R)
    speed, load = 18.0, 1000.0
    w = carcass(made, ring, instants(speed)).displacement(
        ring.point_load(np.zeros(1), np.array([load]))
    )[0]
    n = np.arange(1.0, 700.0)
    tire, spin = made.tire, speed / R
    hoop = made.conditions.inflation_pressure_Pa * tire.width_belt_m / R
    z = 2.0 / R**4 * n**2 * (1 - n**2) ** 2 + hoop * n**2 * (n**2 - 1) + 6.3e5 + 6.3e5 * n**2
    z = z + 1j * n * spin * (90.0 + 200.0 * n**2)
    phi = ring.xi_m[:, None] / R
    exact = (load / (np.pi * R) * (n**2 / z * np.exp(1j * n * phi)).real).sum(axis=1)
    assert np.abs(w - exact).max() < 1e-5 * np.abs(exact).max()
    assert abs(w.mean()) < 1e-12


def test_contact_of_the_errata_s_tire():
    """Table 2 of P3: half angles of 4.6 degrees at 1000 N and 11.3 at 3500 N by the errata (loads
    radial there, vertical here: 5 %).
    """
    tire = {"rolling_radius_m": 0.3, "flexural_stiffness_N_m2": 2.0}
    made = scenario(truth="ring", tire=tire, conditions={"inflation_pressure_Pa": 1.2e5})
    road = FlatRoadContact(made, Ring(2048, 2 * np.pi * 0.3))
    for load, degrees in ((1000.0, 4.6), (3500.0, 11.3)):
        _, entry_m, exit_m = road.touch(instants(0.0, load))
        assert np.degrees((exit_m - entry_m)[0] / 0.6) == pytest.approx(degrees, rel=0.05)


def test_slip_onset_of_the_literature():
    """P2 (15): x_s = 35.0 mm at sigma = 0.15, L = 50 mm; the friction's radial load has no
    resultant (errata).
    """
    ring = Ring(8192, 2 * np.pi * R)
    at = instants(11.11, 400 * 9.81, 0.05, 0.15)
    tangential, radial, onset_m = friction(
        ring, TRACTION, true_parabola(ring, at.half_length, at.load), at
    )
    assert onset_m[0] == pytest.approx(0.035, abs=2e-5)
    assert abs(radial.sum() * ring.step_m) < 1e-9
    assert tangential.max() > 0  # braking: towards the exit
    assert tangential.min() >= 0
    driving, _, _ = friction(
        ring, TRACTION, true_parabola(ring, at.half_length, at.load), replace(at, slip=-at.slip)
    )
    assert np.array_equal(driving, -tangential)


def test_a_road_of_low_grip_slips_sooner():
    """As stiff a tread, f_s 0.3 in place of 0.8: x_s = L (1 - 2 sigma 0.8 / 0.3), f_d behind."""
    ring = Ring(8192, 2 * np.pi * R)
    at = instants(11.11, 400 * 9.81, 0.05, 0.1)
    icy = {"static_friction": 0.3, "sliding_friction": 0.2, "lever_m": 0.018}
    icy["slip_stiffness_ratio"] = 0.8 / 0.3
    pressure = true_parabola(ring, at.half_length, at.load)
    tangential, _, onset_m = friction(ring, Planted("traction", "exact", icy), pressure, at)
    assert onset_m[0] == pytest.approx(0.05 * (1.0 - 2.0 * 0.1 * 0.8 / 0.3), abs=3e-5)
    slides = (ring.xi_m > 0.03) & (ring.xi_m < 0.048)
    assert tangential[0, slides] == pytest.approx(0.2 * pressure[0, slides], rel=0.01)


HUB_INERTIA = 0.8
RING_MASS = 2.0 * np.pi * RADIUS * LINE_MASS


def test_a_torque_in_the_air_winds_up_and_spins():
    of = belt(64, tangential_damping_N_s_m2=2000.0)
    tire = rolling(of, speed=5.0, load=0.0, start=(np.zeros(64), 1.0, 0.0))
    tire.run(orders(8000, speed=5.0, load=0.0, torque=30.0))
    whole = HUB_INERTIA + RING_MASS * RADIUS**2
    assert tire.state["spin_rad_s"] == pytest.approx(5.0 / RADIUS + 30.0 * 0.2 / whole, rel=1e-3)
    # the belt lags: its share of the torque over the wind-up stiffness
    lag = 30.0 * RING_MASS * RADIUS**2 / whole / (2 * np.pi * RADIUS**2 * K_V)
    assert tire.v.mean() == pytest.approx(-lag, rel=2e-2)
