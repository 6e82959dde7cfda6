"""Closed form: forces, losses and derivatives that a model tells, against their integrals."""

from dataclasses import replace

import numpy as np
import pytest

from tests.physics.brush_shear import traction
from tirelog.api.models import angles, forces, revolutions
from tirelog.data.recording import Conditions
from tirelog.data.setup import parse_setup
from tirelog.errors import ModelError
from tirelog.physics import BY_ID, Model, ModelEffect
from tirelog.physics.model.file import preset_model

DAMPED = preset_model("P2").with_effect("viscous_damping", damping_rate_1_s=150.0)
STRIP = """
[tire]
unloaded_radius_m = 0.3126
section_height_m = 0.018
width_m = 0.0342
viscosity_Pa_s = 2000.0
[channels.a]
kind = "strain"
source = "a"
"""


def test_a_beam_dissipates_what_its_foundation_takes():
    """2 mu omega_d int (c w')^2 dxi, by a sum over the circumference."""
    model, speed = DAMPED, 20.0
    told = forces(model, {"speed_m_s": speed})
    phi = angles(8192)
    w = model.predict(Conditions.of(1, speed_m_s=speed), phi, observable="displacement")[0]
    step = model.values["radius_m"] * (phi[1] - phi[0])
    slope = (np.roll(w, -1) - np.roll(w, 1)) / (2.0 * step)
    drained = 2.0 * model.values["line_mass_kg_m"] * 150.0 * ((speed * slope) ** 2).sum() * step
    assert told["dissipated_power_W"][0] == pytest.approx(drained, rel=1e-3)
    assert told["rolling_resistance_N"][0] == pytest.approx(drained / speed, rel=1e-3)
    moment = told["rolling_resistance_moment_N_m"][0]
    assert moment == pytest.approx(drained * model.values["radius_m"] / speed, rel=1e-3)


def test_the_hub_carries_the_load_and_the_traction():
    """Errata to P3: a road load of 1000 N gives (0, 1000), where (-500, 500) would be printed."""
    ring = preset_model("P3")
    free = forces(ring, {"speed_m_s": 10.0})
    assert free["hub_vertical_N"][0] == pytest.approx(1000.0, rel=1e-9)
    assert abs(free["hub_longitudinal_N"][0]) < 1e-9
    pulled = forces(ring.with_effect("traction", lever_m=0.0), {"speed_m_s": 10.0, "slip": 0.1})
    assert pulled["hub_longitudinal_N"][0] == pytest.approx(pulled["road_longitudinal_N"][0], 2e-3)


def test_the_brush_without_angles_is_p2_s_and_adheres_as_15_says():
    model = preset_model("P2").with_effect("traction", lever_m=0.018)
    told = forces(model, {"speed_m_s": 11.11, "slip": np.array([0.0, 0.15, 1.0])})
    assert told["adhesion_share"] == pytest.approx([1.0, 0.85, 0.0])
    one = np.ones((1, 1))
    x = np.linspace(-0.05, 0.05, 20001)[None, :]
    tau = traction(x, 3924.0 * one, 0.05 * one, 0.15 * one)[0]
    assert told["road_longitudinal_N"][1] == pytest.approx(tau.sum() * (x[0, 1] - x[0, 0]), 1e-3)
    assert told["road_longitudinal_N"][2] == pytest.approx(0.6 * 3924.0, rel=1e-4)
    assert np.isnan(told["road_lateral_N"]).all()


def test_a_small_slip_angle_pulls_a_sixth_of_the_patch_behind_its_centre():
    """2 C L^2 alpha with the pneumatic trail L / 3; camber pushes with no moment."""
    model, alpha = preset_model("P2"), 0.01
    told = forces(model, {"speed_m_s": 10.0}, slip_angle_deg=alpha)
    stiffness = 2.0 * 1.88352e6 * 0.05**2
    assert told["road_lateral_N"][0] == pytest.approx(stiffness * np.radians(alpha), rel=1e-3)
    trail = told["aligning_moment_N_m"][0] / told["road_lateral_N"][0]
    assert trail == pytest.approx(0.05 / 3.0, rel=2e-3)
    leaned = forces(model, {"speed_m_s": 10.0}, camber_deg=1.0)
    thrust = 1.88352e6 * np.sin(np.radians(1.0)) / (2 * 0.3126) * 4.0 / 3.0 * 0.05**3
    assert leaned["road_lateral_N"][0] == pytest.approx(thrust, rel=1e-4)
    assert abs(leaned["aligning_moment_N_m"][0]) < 1e-9
    with pytest.raises(ModelError, match="camber of 80 degrees"):
        forces(model, {"speed_m_s": 10.0}, camber_deg=80.0)


def test_bending_takes_h_squared_over_12_y_squared_of_27():
    """Errata to P1 (27): a third on the liner, 33 times at y = 0.1 h / 2."""
    setup = parse_setup(STRIP)
    for preset, share in (("P1", 1.0 / 3.0), ("P2", 100.0 / 3.0)):
        told = forces(preset_model(preset), {"speed_m_s": 20.0}, setup=setup)
        assert told["bending_power_W"][0] / told["strip_power_W"][0] == pytest.approx(share)


def test_derivatives_and_the_belt_s_displacement_are_those_of_the_waveforms():
    model = preset_model("P3").with_effect("traction", lever_m=0.0)
    told = revolutions(model, {"speed_m_s": 10.0, "slip": 0.05}, points=4096)
    step = told["xi_m"][1] - told["xi_m"][0]

    def derived(name):
        return (np.roll(told[name], -1) - np.roll(told[name], 1)) / (2.0 * step)

    for name, by_hand in (
        ("strain_slope_1_m", derived("strain")),
        ("strain_curvature_1_m2", derived("strain_slope_1_m")),
        # outward w = -dv/d theta, inward the other sign
        ("displacement_m", model.values["radius_m"] * derived("tangential_displacement_m")),
    ):
        size = np.abs(told[name]).max()
        np.testing.assert_allclose(told[name], by_hand, atol=0.02 * size)
    wound = told["tangential_displacement_m"].mean()
    pulled = forces(model, {"speed_m_s": 10.0, "slip": 0.05})["road_longitudinal_N"][0]
    # tau cos(phi) around the ring, over the foundation k_v of the whole circumference
    assert wound == pytest.approx(pulled / (2.0 * np.pi * 0.3 * 6.3e5), rel=0.02)


def test_a_belt_s_own_viscosity_takes_what_25_says():
    """tau EJ c^2 int w'''^2 of P1 (22), (25); the same by the section, eta = E tau."""
    tau, speed = 2e-5, 20.0
    printed = preset_model("P2")
    model = printed.with_effect("belt_viscosity", retardation_s=tau)
    told = revolutions(model, {"speed_m_s": speed}, points=8192)
    third = told["strain_slope_1_m"] / model.values["lever_arm_m"]
    step = told["xi_m"][1] - told["xi_m"][0]
    drained = tau * 0.83 * speed**2 * (third**2).sum() * step
    found = forces(model, {"speed_m_s": speed})["dissipated_power_W"][0]
    assert found == pytest.approx(drained, rel=1e-3)
    assert forces(printed, {"speed_m_s": speed})["dissipated_power_W"][0] < 1e-9 * found
    ring = preset_model("P3").with_effect("belt_viscosity", retardation_s=tau)
    assert forces(ring, {"speed_m_s": speed})["dissipated_power_W"][0] > 0.0


def test_a_warm_tire_loses_less():
    model = preset_model("P2").with_effect("warm_hysteresis", loss_factor=1e-4, fall_1_K=0.02)
    warm = np.array([0.0, 30.0])
    power = forces(model, {"speed_m_s": 20.0, "temperature_K": warm})["dissipated_power_W"]
    assert power[1] / power[0] == pytest.approx(np.exp(-0.6), rel=1e-4)


def test_momentum_that_arrives_grows_with_the_square():
    model = Model.new("beam")
    entry = ModelEffect.of(BY_ID["edge_impact"])
    phi = angles(2048)
    for word, factor in (("linear", 2.0), ("squared", 4.0)):
        own = model.with_effect(replace(entry, options={"speed_law": word}), amplitude=1e-4)
        pulses = []
        for speed in (10.0, 20.0):
            drive = Conditions.of(1, speed_m_s=speed)
            shapes = [m.predict(drive, phi, observable="contact_pressure") for m in (own, model)]
            pulses.append(np.abs(shapes[0] - shapes[1]).max())
        assert pulses[1] / pulses[0] == pytest.approx(factor, rel=1e-3)


@pytest.mark.parametrize(
    ("driver", "drive", "change_Pa"),
    [
        ("pressure", {"inflation_pressure_Pa": 2.3e5}, 1e4),
        # 22 K at constant volume, from 2.2 bar above the air's 1.013 bar
        ("temperature", {"temperature_K": 22.0}, (2.2e5 + 1.013e5) * 22.0 / 293.0),
    ],
)
def test_inflation_stretches_the_belt(driver, drive, change_Pa):
    """P2 Fig. 15: 1e-8 per Pa, as the sample log of a static test has it."""
    base = Model.new("beam")
    entry = replace(ModelEffect.of(BY_ID["belt_extension"]), options={"driver": driver})
    own = base.with_effect(entry, strain_1_Pa=1e-8)
    conditions = Conditions.of(1, speed_m_s=10.0, **drive)
    raised = own.predict(conditions, angles(64)) - base.predict(conditions, angles(64))
    assert raised[0] == pytest.approx(np.full(64, 1e-8 * change_Pa), rel=1e-9)
