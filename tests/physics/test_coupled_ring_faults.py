"""Faults: what the coupled ring cannot take is refused, with what is allowed."""

from dataclasses import replace

import numpy as np
import pytest

from tests.physics.coupled_tire import FLAT, course
from tests.physics.coupled_tire import TIRE as PASSENGER_TIRE
from tirelog.data.road import load_road
from tirelog.errors import ModelError
from tirelog.physics.moving.transient import State, Stepper, stepped_motion

TIRE = replace(PASSENGER_TIRE, modes=30)


def stepper(tire=TIRE, speed=20.0, road=FLAT, **more):
    return Stepper(tire, State.rolling(tire, 1000.0, speed), course(1000.0, speed, road), **more)


def test_a_profile_from_a_file(tmp_path):
    """What is none is golden: tests/golden/mistakes.toml."""
    path = tmp_path / "road.txt"
    path.write_text("# distance, height\n0, 0\n1.0, 0.01  # bump\n\n2.0 0\n")
    height, slope = load_road(path).profile(np.array([-1.0, 0.5, 1.5, 3.0]))
    assert height == pytest.approx([0.0, 0.005, 0.005, 0.0])
    assert slope == pytest.approx([0.0, 0.01, -0.01, 0.0])


def test_a_ring_torn_from_its_sidewall():
    torn = stepper(step_s=1e-4)
    torn.state.hub_rate = 3000j
    with pytest.raises(ModelError, match="left its sidewall"):
        stepped_motion(torn, 0.1)


def test_a_road_that_comes_up_to_the_axle():
    sunk = stepper(step_s=1e-4)
    sunk.state.centre -= 0.1j
    sunk.state.hub -= 0.1j
    with pytest.raises(ModelError, match=r"reaches the tire beyond .* rad"):
        sunk.step()
