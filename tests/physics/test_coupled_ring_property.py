"""Property: what holds for every motion of the coupled ring (energy, friction's limit, the answer
to a cleat), and that steps converge.
"""

from dataclasses import replace

import numpy as np
import pytest

from tests.physics.coupled_tire import TIRE, course, obstacle
from tirelog.physics.moving.contact import RoadProfile
from tirelog.physics.moving.ring import CoupledRing
from tirelog.physics.moving.transient import State, Stepper, stepped_motion

LOAD, SPEED = 1000.0, 20.0
CLEAT = obstacle("cleat", 0.5, height_m=0.01, length_m=0.03)


@pytest.mark.slow
def test_energy_stays_for_ten_seconds_without_damping():
    """A rolling tire that bounces, twists and whirls, its load a weight: kinetic, elastic and
    potential energy together.
    """
    tire = replace(TIRE, c_w=0.0, c_v=0.0, c_x=0.0, modes=20)
    start = State.rolling(tire, LOAD, SPEED)
    start.hub, start.centre = start.hub + 0.001j, start.centre + 0.0005 + 0.001j
    start.omega, start.psi_hub = start.omega + 0.3, 0.002
    stepper = Stepper(tire, start, course(LOAD), step_s=1.5e-4, nodes=768)
    begun = stepper.energy() + LOAD * start.hub.imag
    motion = stepped_motion(stepper, 10.0, every=37)
    total = motion.energy_J + LOAD * motion.hub_z_m
    assert np.ptp(motion.force_z_N) > 300.0
    assert np.abs(total - begun).max() < 1e-4 * begun


def test_what_spin_and_belt_exchange_is_accounted_for():
    """A thousandth of the vibration's 1 J at a short step: without P or the belt's share of the
    road's torque it is a sixth.
    """
    tire = replace(TIRE, c_w=0.0, c_v=0.0, c_x=0.0, modes=20)
    start = State.rolling(tire, LOAD, SPEED)
    start.hub, start.centre = start.hub + 0.0005j, start.centre + 0.001 + 0.0005j
    start.omega, start.psi_hub = start.omega + 0.3, 0.002
    stepper = Stepper(tire, start, course(LOAD), step_s=2.5e-5)
    begun = stepper.energy() + LOAD * start.hub.imag
    motion = stepped_motion(stepper, 0.15, every=5)
    total = motion.energy_J + LOAD * motion.hub_z_m
    assert np.ptp(motion.hub_z_m) * LOAD > 0.9
    assert np.abs(total - begun).max() < 1e-3


def test_damping_only_takes():
    start = State.rolling(TIRE, LOAD, 0.0)
    start.hub, start.centre = start.hub + 0.004j, start.centre + 0.004j
    motion = stepped_motion(Stepper(TIRE, start, course(LOAD), step_s=5e-5), 0.2)
    total = motion.energy_J + LOAD * motion.hub_z_m
    assert total[-1] < total[0] - 0.5
    assert np.diff(total).max() < 1e-3


def passage(step_s: float, road=CLEAT, duration: float = 0.2, tire: CoupledRing = TIRE):
    start = State.rolling(tire, LOAD, SPEED)
    stepper = Stepper(tire, start, course(LOAD, SPEED, road), step_s=step_s)
    return stepped_motion(stepper, duration, every=round(1e-3 / step_s))


def test_a_cleat_pushes_up_and_back_and_is_left_behind():
    motion = passage(1e-4)
    before = motion.time_s < 0.015
    assert motion.force_z_N[before] == pytest.approx(np.full(before.sum(), LOAD), rel=5e-3)
    assert motion.force_z_N.max() > 1.5 * LOAD
    assert motion.spindle_s_N.max() > 200.0
    assert motion.hub_z_m.max() - motion.hub_z_m[0] < 0.01


def test_half_the_step_gives_the_same_passage():
    coarse, fine = (passage(h).spindle_z_N for h in (1e-4, 5e-5))
    assert np.abs(coarse - fine).max() < 0.02 * np.ptp(fine)


def test_a_step_lifts_the_tire_by_its_height():
    light = replace(TIRE, m_h=1.0, c_w=600.0, c_v=600.0)
    motion = passage(1e-4, obstacle("step", 0.3, height_m=0.012), 0.6, light)
    before, after = motion.hub_z_m[motion.time_s < 0.01], motion.hub_z_m[-50:]
    assert after.mean() - before.mean() == pytest.approx(0.012, abs=1e-4)


def test_friction_stays_within_its_limit():
    drive = course(LOAD, SPEED, torque=lambda time: -600.0 * min(time / 0.05, 1.0))
    stepper = Stepper(TIRE, State.rolling(TIRE, LOAD, SPEED), drive, step_s=1e-4)
    motion = stepped_motion(stepper, 0.2)
    assert np.all(np.abs(motion.force_s_N) <= TIRE.mu * motion.force_z_N * (1.0 + 1e-9))
    assert motion.force_s_N[-10:] == pytest.approx(TIRE.mu * motion.force_z_N[-10:], rel=1e-2)
    assert motion.omega_rad_s[-1] < 0.9 * SPEED / TIRE.R


def test_a_long_wave_is_followed():
    motion = passage(1e-4, RoadProfile(amplitude_m=0.01, wavelength_m=8.0), 0.4)
    assert np.ptp(motion.hub_z_m) == pytest.approx(0.02, rel=0.15)
