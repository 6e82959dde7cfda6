"""Closed form: the coupled ring in time, by torque and by power."""

from dataclasses import replace

import numpy as np
import pytest

from tests.physics.coupled_tire import TIRE as PASSENGER
from tests.physics.coupled_tire import course
from tirelog.physics.moving.transient import State, Stepper, stepped_motion

TIRE = replace(PASSENGER, c_w=600.0, c_v=600.0, m_h=1.0, J_h=0.1, c_x=1.9e6)
LOAD, SPEED = 1000.0, 20.0


def rolled(torque=0.0):
    """The tire after half a second at constant speed."""
    drive = course(LOAD, SPEED, torque=torque)
    stepper = Stepper(TIRE, State.rolling(TIRE, LOAD, SPEED), drive, step_s=1e-4, nodes=1536)
    stepped_motion(stepper, 0.5)
    return stepper


def test_a_brake_torque_is_the_road_force_times_the_radius_of_a_belt_that_does_not_stretch():
    free, braked = rolled(), rolled(-60.0)
    forces = [stepped_motion(s, 0.05, every=1).force_s_N.mean() for s in (free, braked)]
    assert forces[1] - forces[0] == pytest.approx(60.0 / TIRE.R, rel=5e-3)
    assert braked.state.omega * TIRE.R < free.state.omega * TIRE.R < SPEED


def test_what_tows_the_tire_is_what_it_dissipates():
    """The road's torque turns the ring against belt and sidewall, its force gives that and slip."""
    stepper, torque = rolled(), []
    motion = stepped_motion(stepper, 0.1, every=1)
    for _ in range(1000):
        stepper.step()
        torque.append(stepper.road_torque)
    omega, V = motion.omega_rad_s.mean(), motion.V.mean(axis=0)
    a = stepper.state.centre - stepper.state.hub
    belt = 4.0 * np.pi * TIRE.R * omega**2 * np.sum(TIRE.n**2 * TIRE.c_n * np.abs(V) ** 2)
    sidewall = TIRE.c_s * omega**2 * abs(a) ** 2
    slip = motion.force_s_N.mean() * SPEED - np.mean(torque) * omega
    assert belt > 50.0
    assert 0.0 < slip < 0.1 * belt
    assert motion.spindle_s_N.mean() * SPEED == pytest.approx(belt + sidewall + slip, rel=2e-3)
