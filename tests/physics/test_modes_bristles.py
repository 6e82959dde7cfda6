"""Property: modes on a road with friction agree with the motion in time, whose bristles, contact
and steps are its own; what friction does.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from tests.physics.coupled_tire import TIRE as ROLLING
from tests.physics.coupled_tire import course
from tirelog.physics import Model
from tirelog.physics.moving.ring import first_order, natural_modes, of_model
from tirelog.physics.moving.transient import State, Stepper, stepped_motion

TIRE = replace(ROLLING, modes=20, mu=50.0)
LOAD, STEP, WOUND = 3000.0, 5e-5, 2e-4


@pytest.mark.parametrize("speed", [0.0, 20.0])
def test_a_small_wind_up_swings_as_the_linear_system_says(speed):
    """Within 4 %; on a road free of friction the swing would be off by 40 % and more."""
    spins = []
    for wound in (0.0, WOUND):
        start = State.rolling(TIRE, LOAD, speed)
        start.psi_hub += wound
        spins.append(
            stepped_motion(
                Stepper(TIRE, start, course(LOAD), step_s=STEP), 0.05, every=1
            ).omega_rad_s
        )
    swing = spins[1] - spins[0]

    def linear(tire):
        system, M = first_order(tire, spins[0][0], LOAD)
        state, onward, said = np.zeros(system.shape[0]), expm(STEP * system), []
        state[4] = WOUND
        for _ in swing:
            state = onward @ state
            said.append(state[M.size + 5])
        return np.array(said)

    assert np.std(swing - linear(TIRE)) < 0.045 * np.std(swing)
    assert np.std(swing - linear(replace(TIRE, mu=0.0))) > 0.3 * np.std(swing)


def test_the_road_holds_the_rotation():
    """At rest hub and ring swing against the bristles: a mode more below the free ones."""
    clinging, free = (
        natural_modes(replace(TIRE, mu=mu), load_N=LOAD, to_Hz=60.0) for mu in (0.8, 0.0)
    )
    assert [mode.shape for mode in free] == ["rigid vertical"]
    assert [mode.shape for mode in clinging] == ["rigid vertical", "rotational"]


def test_a_ring_without_bristles_stands_free_of_friction():
    ring, coupled = (of_model(Model.new(name).values) for name in ("ring", "coupled_ring"))
    assert ring.c_x == 0.0
    assert coupled.c_x == 1.9e6
