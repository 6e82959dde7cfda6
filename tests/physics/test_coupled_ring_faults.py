"""Faults: what the coupled ring cannot take is refused, with what is allowed."""

from dataclasses import replace

import numpy as np
import pytest

from tests.physics.coupled_tire import FLAT, course, obstacle
from tests.physics.coupled_tire import TIRE as PASSENGER_TIRE
from tirelog.data.road import RoadProfile, load_road
from tirelog.errors import ModelError
from tirelog.physics.moving.transient import State, Stepper, stepped_motion

TIRE = replace(PASSENGER_TIRE, modes=30)


def stepper(tire=TIRE, speed=20.0, road=FLAT, **more):
    return Stepper(tire, State.rolling(tire, 1000.0, speed), course(1000.0, speed, road), **more)


@pytest.mark.parametrize("name", ["rho_A", "m_h", "J_h", "EI", "k_w", "k_t", "R", "c_w"])
@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, np.inf])
def test_what_has_no_mass_or_stiffness_does_not_move(name, value):
    if (name, value) == ("c_w", 0.0):
        return  # no damping is one
    with pytest.raises(ModelError, match=rf"{name} = .*; .*allowed; "):
        replace(TIRE, **{name: value})


def test_an_obstacle_larger_than_the_tire_takes():
    """Of a cleat and of a step: `test_coupled_command.py`."""
    with pytest.raises(ModelError, match=r"rises .* m within one tire diameter; up to .*; give a"):
        stepper(road=RoadProfile(amplitude_m=0.05, wavelength_m=0.7))
    with pytest.raises(ModelError, match="ramps"):
        obstacle("cleat", 1.0, height_m=0.01, length_m=0.02, ramp_m=0.02)


def test_profile_files(tmp_path):
    path = tmp_path / "road.txt"
    path.write_text("# distance, height\n0, 0\n1.0, 0.01  # bump\n\n2.0 0\n")
    height, slope = load_road(path).profile(np.array([-1.0, 0.5, 1.5, 3.0]))
    assert height == pytest.approx([0.0, 0.005, 0.005, 0.0])
    assert slope == pytest.approx([0.0, 0.01, -0.01, 0.0])
    path.write_text("0, 0\n1, bump\n")
    with pytest.raises(ModelError, match=r"road\.txt: .*cannot be read"):
        load_road(path)
    for text in ("0 0\n0 1\n", "0 0\n", ""):
        path.write_text(text)
        with pytest.raises(ModelError, match=r"road\.txt: .*whose distances grow"):
            load_road(path)
    path.write_bytes(b"\xff\xfe\x00")
    for file in (path, tmp_path / "none.txt"):
        with pytest.raises(ModelError, match="cannot be read"):
            load_road(file)


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
