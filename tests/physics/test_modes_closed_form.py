"""Closed form: natural frequencies of the coupled ring against textbooks and P3's turning frame."""

from dataclasses import replace

import numpy as np
import pytest

from tests.physics.coupled_tire import TIRE as DAMPED
from tirelog.physics.carcass import contact
from tirelog.physics.moving.ring import natural_modes

TIRE = replace(DAMPED, c_w=0.0, c_v=0.0, modes=60)
TWO_PI = 2.0 * np.pi


def by_shape(modes, shape):
    return [mode for mode in modes if mode.shape == shape]


def test_rigid_modes_are_two_masses_on_the_sidewall():
    modes = natural_modes(TIRE, to_Hz=200.0)
    ring = TWO_PI * 0.3 * 3.15
    vertical = np.sqrt(np.pi * 0.3 * (6.3e5 + 5.1e5) * (1.0 / ring + 1.0 / 20.0)) / TWO_PI
    turning = np.sqrt(TWO_PI * 0.3**3 * 5.1e5 * (1.0 / (ring * 0.3**2) + 1.0 / 0.8)) / TWO_PI
    for shape, expected in (
        ("rigid vertical", vertical),
        ("rigid longitudinal", vertical),
        ("rotational", turning),
    ):
        found = [mode.frequency_Hz for mode in by_shape(modes, shape)]
        assert found == pytest.approx([expected], rel=1e-6)


def test_a_bare_ring_rings_as_hoppe_and_love_say():
    """omega^2 = EI / (rho A R^4) n^2 (n^2 - 1)^2 / (n^2 + 1), in pairs."""
    bare = replace(TIRE, EI=100.0, k_w=1e-6, k_v=1e-6, pb=0.0)
    modes = natural_modes(bare, to_Hz=300.0)
    for n in range(2, 6):
        expected = np.sqrt(100.0 / (3.15 * 0.3**4) * n**2 * (n**2 - 1) ** 2 / (n**2 + 1)) / TWO_PI
        assert [m.frequency_Hz for m in by_shape(modes, f"{n}-lobe")] == pytest.approx(
            [expected, expected], rel=1e-6
        )


@pytest.mark.parametrize("speed", [5.0, 40.0])
def test_a_turning_ring_splits_as_in_the_papers_own_frame(speed):
    """m nu^2 - 4 rho A n Omega nu = k_n with P3's k_n (errata) on the belt."""
    omega, R, rho_A = speed / 0.3, 0.3, 3.15
    modes = natural_modes(TIRE, speed_m_s=speed, to_Hz=300.0)
    for n in (2.0, 3.0, 5.0):
        sigma_a = TIRE.pb * R + rho_A * R**2 * omega**2
        k_n = (
            (TIRE.EI / R**4 * n**2 + sigma_a / R**2) * (1 - n**2) ** 2
            - TIRE.pb / R * (1 - n**2)
            + TIRE.k_v
            + TIRE.k_w * n**2
        )
        k_n -= rho_A * (1 + n**2) * omega**2
        nu = np.roots([-rho_A * (1 + n**2), 4 * rho_A * n * omega, k_n])
        seen = nu - n * omega
        expected = {"with": -seen.min() / TWO_PI, "against": seen.max() / TWO_PI}
        found = {mode.direction: mode.frequency_Hz for mode in by_shape(modes, f"{n:.0f}-lobe")}
        for direction, frequency in expected.items():
            if frequency < 300.0:
                assert found[direction] == pytest.approx(frequency, rel=1e-6)


def test_damping_of_a_rigid_mode_is_that_of_a_damped_oscillator():
    held = replace(TIRE, m_h=1e9, J_h=1e9, c_w=30.0, c_v=20.0)
    (vertical,) = by_shape(natural_modes(held, to_Hz=200.0), "rigid vertical")
    ring, k, c = TWO_PI * 0.3 * 3.15, np.pi * 0.3 * (6.3e5 + 5.1e5), np.pi * 0.3 * 50.0
    assert vertical.damping_ratio == pytest.approx(c / (2.0 * np.sqrt(k * ring)), rel=1e-6)


def test_the_critical_speed_is_where_the_whirl_loses_its_damping():
    held = replace(TIRE, m_h=1e9, c_w=30.0, c_v=20.0)
    below, near = (
        [
            m
            for m in natural_modes(held, speed_m_s=share * held.critical_speed_m_s, to_Hz=300.0)
            if m.shape == "rigid whirl" and m.direction == "with"
        ]
        for share in (0.5, 0.9999)
    )
    assert below[0].damping_ratio > 0.0
    assert abs(near[0].damping_ratio) < 1e-4 * below[0].damping_ratio * 10.0


def test_on_the_road_a_load_on_a_stiff_belt_bounces_on_tread_and_sidewall_in_series():
    """The slowest upright mode is the mass of all on 1/k_s + 1/(tread under the patch)."""
    stiff = replace(TIRE, EI=1e7, rho_A=1e-3)
    patch = contact.solve_contact(stiff, 1000.0).phi_rad.size * contact.STEP * 0.3 * stiff.k_t
    series = 1.0 / (1.0 / stiff.k_s + 1.0 / patch)
    slowest = next(
        mode
        for mode in natural_modes(stiff, load_N=1000.0, to_Hz=100.0)
        if mode.shape == "rigid vertical"
    )
    assert slowest.frequency_Hz == pytest.approx(np.sqrt(series / 20.0) / TWO_PI, rel=1e-3)
