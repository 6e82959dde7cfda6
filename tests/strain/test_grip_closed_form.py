"""Closed form: grip from the slip onset, width and shift of a patch, the wheel's angle."""

import numpy as np
import pytest

from tests.strain.strain_truth import Beam
from tirelog.data.recording import Channel, Recording, TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.errors import UsageError
from tirelog.strain.slip import (
    EXPONENT_SD,
    grip_columns,
    strain_shift_of,
)
from tirelog.wheel.phase_shift import wheel_angle_of

ONE = np.ones((1, 1))
BRAKES = np.array([-3.0, -3.0, -0.3])


def grip(onset_m, stiffness=1.0, load_N=None):
    """The grip of three rows of a footprint table, the first without an onset."""
    n = 3
    rows = {name: np.full(n, "a", object) for name in ("log", "channel", "slip_onset_reason")}
    rows |= {
        "revolution": np.arange(n), "time_s": np.arange(n) * 0.1, "speed_m_s": np.full(n, 20.0),
        "length_m": np.array([0.1, 0.1, 0.101]), "length_se_m": np.full(n, 1e-4),
        "slip_onset_m": np.array([np.nan, onset_m, onset_m]), "slip_onset_se_m": np.full(n, 1e-3),
        "quality": np.full(n, "ok", object),
    }  # fmt: skip
    return grip_columns(rows, 0.8, 0.6, stiffness, 0.5, load_N, BRAKES)


def test_an_onset_tells_slip_friction_and_what_is_left():
    """P2: x_s = 35 mm for L = 50 mm is a slip of 0.15."""
    told = grip(0.035, load_N=3924.0)
    assert told["adhesion_share"][1] == pytest.approx(0.85)
    assert told["brush_slip"][1] == pytest.approx(0.15)
    assert told["friction_used"][1] * 3924.0 == pytest.approx(1163.66, rel=1e-4)
    assert told["longitudinal_force_N"][1] == pytest.approx(-1163.66, rel=1e-4)
    assert np.isnan(told["longitudinal_force_N"][2])  # as slow as on a grade of 3 %
    assert told["vertical_force_N"][2] == pytest.approx(3924.0 * 1.01**2)
    assert 0.0 < told["grip_left"][1] < 1.0
    assert np.isnan([told[n][0] for n in ("adhesion_share", "friction_used", "grip_left")]).all()
    # the error of the share: 1 mm of 100, the length's share small beside it
    assert told["adhesion_share_se"][1] == pytest.approx(0.01, rel=0.01)
    # noise 1e-4 / 0.1 through 1 / 0.5; 1 % of length through an exponent known to 0.15
    noise, law = 2e-3, np.log(1.01) * EXPONENT_SD / 0.5**2
    assert told["vertical_force_se_N"][1] == pytest.approx(3924.0 * noise)
    longer = 3924.0 * 1.01**2 * np.hypot(noise / 1.01, law)
    assert told["vertical_force_se_N"][2] == pytest.approx(longer)
    stiffer = grip(0.035, stiffness=10.0)
    assert stiffer["brush_slip"][1] == pytest.approx(0.015)
    assert "vertical_force_N" not in stiffer
    assert grip(-0.049)["grip_left"][1] == 0.0  # beyond the peak


SETUP = """
[tire]
unloaded_radius_m = 0.32
rolling_radius_m = 0.3
[channels.s]
kind = "strain"
source = "s"
surface = "inner"
[channels.e]
kind = "wheel_encoder"
source = "e"
unit = "rad"
"""
RADIUS_M, RATE_HZ, SPEED_M_S = 0.3, 2500.0, 12.0


@pytest.fixture(scope="module")
def driven():
    """40 turns: the sensor half a degree later in wheel angle from the 21st on."""
    t = np.arange(int(40 * 2 * np.pi * RADIUS_M / SPEED_M_S * RATE_HZ)) / RATE_HZ
    angle = SPEED_M_S / RADIUS_M * t
    turned = angle / (2.0 * np.pi)
    later = np.where(turned > 20.0, np.radians(0.5), 0.0)
    x = RADIUS_M * (np.mod(angle - later, 2.0 * np.pi) - np.pi)
    xi, wave = Beam().wave(SPEED_M_S)
    noise = np.random.default_rng(9).normal(0.0, 3e-7, t.size)
    axis = TimeAxis.uniform(t.size, RATE_HZ)
    channels = {
        "s": Channel.of_array("s", "strain", np.interp(x, xi, wave, 0.0, 0.0) + noise, axis),
        "e": Channel.of_array("e", "wheel_encoder", angle, axis),
    }
    return Recording("made", channels, parse_setup(SETUP))


def test_strain_edges_tell_width_and_shift_in_wheel_angle(driven):
    (found,) = strain_shift_of(driven)
    told = found.columns
    good = told["quality"] == "ok"
    assert good.sum() > 30
    width = np.degrees(2.0 * 0.055 / RADIUS_M)
    assert np.median(told["patch_width_deg"][good]) == pytest.approx(width, rel=0.01)
    shift, turn = told["phase_shift_deg"], told["revolution"]
    assert np.median(shift[good & (turn < 18)]) == pytest.approx(0.0, abs=0.01)
    assert np.median(shift[good & (turn > 22)]) == pytest.approx(0.5, abs=0.02)
    # the phonic wheel beside the passages' own speed
    assert np.median(told["wheel_speed_m_s"][good]) == pytest.approx(SPEED_M_S, rel=1e-4)


def test_the_wheel_s_angle_is_told_sample_by_sample(driven):
    (found,) = wheel_angle_of(driven, 1.0, 1.2, 10)
    told = found.columns
    turned = np.radians(told["turned_deg"]) - SPEED_M_S / RADIUS_M * told["time_s"]
    # as an angle channel is recorded from its first sample on
    assert np.ptp(np.degrees(np.angle(np.exp(1j * turned)))) < 0.01
    assert told["speed_m_s"] == pytest.approx(np.full(50, SPEED_M_S), rel=1e-4)
    with pytest.raises(UsageError, match="hold 0 samples"):
        list(wheel_angle_of(driven, 1e6, 2e6))
