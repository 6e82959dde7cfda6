"""Property: what holds for every motion of the coupled ring (energy, friction's limit), and that
modes on a road with friction agree with the motion in time, whose bristles, contact and steps are
its own.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from tests.physics.coupled_tire import TIRE, course, energy_J
from tirelog.physics.moving.ring import first_order, natural_modes
from tirelog.physics.moving.transient import State, Stepper, stepped_motion

LOAD, SPEED = 1000.0, 20.0


def test_what_spin_and_belt_exchange_is_accounted_for():
    """A thousandth of the vibration's 1 J at a short step: without P or the belt's share of the
    road's torque it is a sixth.
    """
    tire = replace(TIRE, c_w=0.0, c_v=0.0, c_x=0.0, modes=20)
    start = State.rolling(tire, LOAD, SPEED)
    start.hub, start.centre = start.hub + 0.0005j, start.centre + 0.001 + 0.0005j
    start.omega, start.psi_hub = start.omega + 0.3, 0.002
    stepper = Stepper(tire, start, course(LOAD), step_s=2.5e-5)
    total, heights = [], []
    for _ in range(1200):
        total.append(energy_J(stepper) + LOAD * start.hub.imag)
        heights.append(start.hub.imag)
        for _ in range(5):
            stepper.step()
    assert np.ptp(heights) * LOAD > 0.9
    assert np.ptp(total) < 1e-3


def test_friction_stays_within_its_limit():
    drive = course(LOAD, SPEED, torque=lambda time: -600.0 * min(time / 0.05, 1.0))
    stepper = Stepper(TIRE, State.rolling(TIRE, LOAD, SPEED), drive, step_s=1e-4)
    motion = stepped_motion(stepper, 0.2)
    assert np.all(np.abs(motion.force_s_N) <= TIRE.mu * motion.force_z_N * (1.0 + 1e-9))
    assert motion.force_s_N[-10:] == pytest.approx(TIRE.mu * motion.force_z_N[-10:], rel=1e-2)
    assert motion.omega_rad_s[-1] < 0.9 * SPEED / TIRE.R


CLINGING = replace(TIRE, modes=20, mu=50.0)
PRESSED, STEP, WOUND = 3000.0, 5e-5, 2e-4


@pytest.mark.parametrize("speed", [0.0, 20.0])
def test_a_small_wind_up_swings_as_the_linear_system_says(speed):
    """Within 4 %; on a road free of friction the swing would be off by 40 % and more."""
    spins = []
    for wound in (0.0, WOUND):
        start = State.rolling(CLINGING, PRESSED, speed)
        start.psi_hub += wound
        spins.append(
            stepped_motion(
                Stepper(CLINGING, start, course(PRESSED), step_s=STEP), 0.05, every=1
            ).omega_rad_s
        )
    swing = spins[1] - spins[0]

    def linear(tire):
        system, M = first_order(tire, spins[0][0], PRESSED)
        state, onward, said = np.zeros(system.shape[0]), expm(STEP * system), []
        state[4] = WOUND
        for _ in swing:
            state = onward @ state
            said.append(state[M.size + 5])
        return np.array(said)

    assert np.std(swing - linear(CLINGING)) < 0.045 * np.std(swing)
    assert np.std(swing - linear(replace(CLINGING, mu=0.0))) > 0.3 * np.std(swing)


def test_the_road_holds_the_rotation():
    """At rest hub and ring swing against the bristles: a mode more below the free ones."""
    clinging, free = (
        natural_modes(replace(CLINGING, mu=mu), load_N=PRESSED, to_Hz=60.0) for mu in (0.8, 0.0)
    )
    assert [mode.shape for mode in free] == ["rigid vertical"]
    assert [mode.shape for mode in clinging] == ["rigid vertical", "rotational"]
