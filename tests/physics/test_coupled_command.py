"""Property: `tirelog model predict` of a coupled ring driven in time, from the outside."""

import io

import numpy as np
import pandas
import pytest

from tests.physics.commands import status
from tests.physics.conftest import SETUP

CLEAT = ("--road", "cleat,height_m=0.008,length_m=0.04,position_m=0.5", "--duration", "0.1")


@pytest.fixture
def folder(here):
    assert status("model new --carcass coupled_ring --setup s.toml -o m.toml --quiet") == 0
    return here


def table(capsys, *arguments, speed="20"):
    capsys.readouterr()
    assert status("model predict m.toml --setup s.toml --speed", speed, *arguments) == 0
    return pandas.read_csv(io.StringIO(capsys.readouterr().out))


def test_without_a_road_it_is_one_steady_revolution(folder, capsys):
    one = table(capsys)
    assert list(one)[:2] == ["xi_m", "phi_deg"]
    assert one.strain.max() > 3.0 * abs(one.strain.min())  # the liner, as the setup says


def test_a_cleat(folder, capsys):
    passed = table(capsys, *CLEAT, "--sensor", "90", "--sensor", "180")
    assert list(passed) == [
        "sensor_deg", "time_s", "distance_m", "speed_m_s", "load_N", "wheel_angle_deg",
        "hub_displacement_m", "road_vertical_N", "road_longitudinal_N", "spindle_vertical_N",
        "spindle_longitudinal_N", "strain", "radial_acceleration_m_s2",
    ]  # fmt: skip
    assert set(passed.sensor_deg) == {90.0, 180.0}
    one = passed[passed.sensor_deg == 90.0]
    calm = one.distance_m < 0.4
    assert one.road_vertical_N[calm].to_numpy() == pytest.approx(3434.0, rel=1e-3)
    assert one.road_vertical_N.max() > 1.3 * 3434.0
    assert one.distance_m.to_numpy() == pytest.approx(20.0 * one.time_s.to_numpy(), abs=1e-9)
    assert np.ptp(one.hub_displacement_m) > 1e-4


def test_the_road_of_the_setup_and_of_a_file(folder, capsys):
    (folder / "bump.txt").write_text("0 0\n0.02 0.008\n0.04 0.0\n")
    (folder / "s.toml").write_text(
        SETUP + '[road]\nkind = "profile"\nfile = "bump.txt"\nposition_m = 0.5\n'
    )
    by_setup = table(capsys, "--road", "setup", "--duration", "0.05")
    by_words = table(capsys, "--road", "profile,file=bump.txt,position_m=0.5", "--duration", "0.05")
    assert by_setup.equals(by_words)
    assert by_setup.road_vertical_N.max() > 3600.0


def test_a_step_of_load(folder, capsys):
    both = table(capsys, "--load-step", "0.05:4000", "--duration", "0.15")
    assert both.load_N.iloc[0] == 3434.0
    assert both.load_N.iloc[-1] == 4000.0
    assert both.spindle_vertical_N.max() > 4000.0
