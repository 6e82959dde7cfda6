"""Closed form: the truth's carcasses against solutions that are known on paper or as sums."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tirelog.simulation.scenario.schema import Planted, Sensor
from tirelog.simulation.steady.carcass import FlatRoadContact, carcass, curvature_operator
from tirelog.simulation.steady.loads import Ring, friction, true_parabola

from .worlds import instants, scenario, world

EJ, K, MU, R = 4.0, 2.0e6, 4.5, 0.305
TRACTION = Planted("traction", "exact", {"slip_per_g": 0.0, "lever_m": 0.018})


@pytest.fixture(scope="module")
def ring() -> Ring:
    return Ring(2048, 2.0 * np.pi * R)


@pytest.mark.parametrize("speed", [0.0, 10.0, 20.0])
def test_undamped_beam_under_a_point_load(ring: Ring, speed: float) -> None:
    """P2 (9) with alpha = c/(2 lambda) sqrt(mu/EJ) (errata); the images of the closed circumference
    are below 1e-6.
    """
    load = 1000.0
    w = carcass(scenario(), ring, instants(speed)).displacement(
        ring.point_load(np.zeros(1), np.array([load]))
    )[0]
    lam = (K / (4 * EJ)) ** 0.25
    alpha = speed / (2 * lam) * np.sqrt(MU / EJ)
    a, b, s = np.sqrt(1 + alpha**2), np.sqrt(1 - alpha**2), lam * np.abs(ring.xi_m)
    exact = (
        load * lam / (2 * K) * np.exp(-b * s) * (a * np.cos(a * s) + b * np.sin(a * s)) / (a * b)
    )
    assert np.abs(w - exact).max() < 1e-6 * exact.max()


def test_damped_beam_by_the_roots_of_its_own_equation(ring: Ring) -> None:
    """EJ w'''' + mu c^2 w'' + 2 mu omega_d c w' + k w = P delta: exponentials of the four roots,
    jump of w''' at the load.
    """
    speed, rate, load = 14.0, 80.0, 1000.0
    planted = [{"name": "viscous_damping", "damping_rate_1_s": rate}]
    w = carcass(scenario(effects=planted), ring, instants(speed)).displacement(
        ring.point_load(np.zeros(1), np.array([load]))
    )[0]
    roots = np.roots([EJ, 0.0, MU * speed**2, 2 * MU * rate * speed, K])
    behind, ahead = roots[roots.real < 0], roots[roots.real > 0]
    powers = np.arange(4)[:, None]
    system = np.hstack([behind[None, :] ** powers, -(ahead[None, :] ** powers)])
    c = np.linalg.solve(system, np.array([0, 0, 0, load / EJ]))
    xi = ring.xi_m[:, None]
    late = (c[:2] * np.exp(np.minimum(behind * np.maximum(xi, 0), 50))).sum(axis=1)
    early = (c[2:] * np.exp(ahead * np.minimum(xi, 0))).sum(axis=1)
    exact = np.where(ring.xi_m >= 0, late, early).real
    assert np.abs(w - exact).max() < 1e-6 * np.abs(exact).max()
    # it dissipates: the tread lies deeper behind the load's centre than ahead of it, and the load
    # is late
    assert np.sum(w * ring.xi_m) > 0


def test_beam_carries_the_load_on_its_foundation() -> None:
    solved = world()
    solution = solved.solve(instants(speed=20.0))
    assert K * solution.w.sum() * solved.ring.step_m == pytest.approx(3434.0, rel=1e-10)


def test_parabola_carries_the_load_whatever_its_length(ring: Ring) -> None:
    for half_length in (0.04, 0.0581, 0.0587):
        p = true_parabola(ring, np.array([half_length]), np.array([3000.0]))[0]
        assert p.sum() * ring.step_m == pytest.approx(3000.0, rel=1e-12)
        middle = 0.75 * 3000.0 / half_length
        assert p[ring.points // 2] == pytest.approx(middle, rel=1e-4)


def test_ring_under_a_point_load_by_its_modes(ring: Ring) -> None:
    """Sum over n of the errata's modal stiffness; inextensible, so the mean of w vanishes; n = 1
    has the stiffness k_v + k_w.
    """
    damped = {"radial_damping_N_s_m2": 200.0, "tangential_damping_N_s_m2": 90.0}
    made = scenario(truth="ring", tire=damped)
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


@pytest.mark.parametrize("load", [1000.0, 3500.0])
def test_contact_carries_the_load_and_never_pulls(load: float) -> None:
    made = scenario(truth="ring", tire={"radial_damping_N_s_m2": 150.0})
    ring = Ring(made.grid_points, 2 * np.pi * R)
    pressure, entry_m, exit_m = FlatRoadContact(made, ring).touch(instants(18.0, load))
    assert pressure.min() == 0.0
    assert pressure.sum() * ring.step_m == pytest.approx(load, rel=1e-9)
    # pressed only between the edges, and everywhere between them
    pressed = pressure[0] > 0
    assert np.array_equal(pressed, (ring.xi_m > entry_m) & (ring.xi_m < exit_m))
    # damping presses the entry side more
    assert np.sum(pressure[0] * ring.xi_m) < 0


def test_contact_of_the_errata_s_tire() -> None:
    """Table 2 of P3: half angles of 4.6 degrees at 1000 N and 11.3 at 3500 N by the errata (loads
    radial there, vertical here: 5 %).
    """
    tire = {"rolling_radius_m": 0.3, "flexural_stiffness_N_m2": 2.0}
    made = scenario(truth="ring", tire=tire, conditions={"inflation_pressure_Pa": 1.2e5})
    road = FlatRoadContact(made, Ring(2048, 2 * np.pi * 0.3))
    for load, degrees in ((1000.0, 4.6), (3500.0, 11.3)):
        _, entry_m, exit_m = road.touch(instants(0.0, load))
        assert np.degrees((exit_m - entry_m)[0] / 0.6) == pytest.approx(degrees, rel=0.05)


def test_undamped_ring_has_no_speed_trend() -> None:
    solved = world(truth="ring")
    slow, fast = (solved.solve(instants(v)).w for v in (2.0, 60.0))
    assert np.abs(slow - fast).max() < 1e-12


def test_slip_onset_of_the_literature() -> None:
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


def test_a_road_of_low_grip_slips_sooner() -> None:
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


def test_strain_signs_and_surfaces() -> None:
    """Groove (outer) a minimum in the patch, liner (inner) a maximum, of equal size."""
    for truth in ("beam", "ring"):
        solved = world(truth=truth)
        solution = solved.solve(instants())
        outer = solved.waveform(solution, Sensor("fbg_strain", surface="outer"))[0]
        inner = solved.waveform(solution, Sensor("fbg_strain", surface="inner"))[0]
        assert np.array_equal(outer, -inner)
        middle = solved.ring.points // 2
        assert abs(int(np.argmin(outer)) - middle) * solved.ring.step_m < 0.058
        assert outer.min() < -5e-4


def test_radial_acceleration_of_a_rigid_circle_and_of_the_patch(ring: Ring) -> None:
    """-Omega^2 R far from the patch; inside a long patch the belt runs straight, so that the
    acceleration almost vanishes.
    """
    solved = world(truth="ring")
    solution = solved.solve(instants(20.0))
    a = solved.waveform(solution, Sensor("radial_acceleration"))[0]
    level = -(20.0**2) / R
    assert a[0] == pytest.approx(level, rel=0.03)
    middle = np.abs(solved.ring.xi_m) < 0.02
    assert np.abs(a[middle]).max() < 0.25 * abs(level)
    assert a.min() < 1.2 * level  # the bends before and behind the patch
    assert curvature_operator(solved.scenario, ring).shape == (1025,)
