"""Literature: the presets of `model new` hold the papers' tables and give what the papers show."""

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.physics.carcass.structures import critical_speed
from tirelog.physics.model.file import PRESETS, preset_model
from tirelog.physics.pressure import slip_stiffness, transition

TURN = np.linspace(-np.pi, np.pi, 4097)[:-1]

BEAM = {
    "flexural_stiffness_N_m2": 5e7 * 1.66e-8,
    "foundation_stiffness_N_m2": 7.790e6,
    "patch_half_length_m": 0.05,
    "load_N": 400 * 9.81,
    "reference_load_N": 400 * 9.81,
    "radius_m": 0.3126,
}
TABLES = {
    "P1": {**BEAM, "lever_arm_m": 0.018 / 2},
    "P2": {**BEAM, "lever_arm_m": 0.1 * 0.018 / 2},
    "P3": {
        "flexural_stiffness_N_m2": 2.0,
        "line_mass_kg_m": 3.15,
        "radial_stiffness_N_m2": 6.3e5,
        "tangential_stiffness_N_m2": 6.3e5,
        "radial_damping_N_s_m2": 0.0,
        "tangential_damping_N_s_m2": 0.0,
        "inflation_pressure_Pa": 1.2e5,
        "width_m": 0.14,
        "lever_arm_m": 0.01 / 2,
        "radius_m": 0.3,
    },
}


def test_every_preset_is_looked_at():
    assert sorted(TABLES) == sorted(PRESETS)


@pytest.mark.parametrize("name", TABLES)
def test_the_numbers_are_the_table_s(name):
    values = preset_model(name).values
    assert {key: values[key] for key in TABLES[name]} == pytest.approx(TABLES[name])


def test_the_beam_s_critical_speed_of_table_1():
    """mu = 1100 kg/m is the rubber's density."""
    for name in ("P1", "P2"):
        v = preset_model(name).values
        names = ("flexural_stiffness_N_m2", "foundation_stiffness_N_m2", "line_mass_kg_m")
        assert critical_speed(*(v[n] for n in names)) == pytest.approx(86.7, abs=0.1)
    assert 11.11 / critical_speed(0.83, 7.79e6, 0.676) == pytest.approx(0.128, abs=5e-4)
    assert 11.11 / critical_speed(0.83, 7.79e6, 1100.0) == pytest.approx(5.2, abs=0.05)


def test_p2_s_patch_and_brush():
    """C_x of (17), x_s of (15); the strain's steepest places at +-35.6 mm for L = 50 mm."""
    model = preset_model("P2")
    one = np.ones((1, 1))
    stiffness = slip_stiffness(model.values["load_N"] * one, 0.05 * one).item()
    assert stiffness == pytest.approx(1.8835e6, rel=1e-4)
    assert transition(0.15 * one, 0.05 * one).item() == pytest.approx(0.0350, abs=5e-5)
    rolling, phi = Conditions.of(1, speed_m_s=11.11), np.linspace(-0.3, 0.3, 60001)
    x = model.values["radius_m"] * phi
    slope = np.gradient(model.predict(rolling, phi, surface="outer")[0], x)
    inside = np.abs(x) < 0.05
    assert x[inside][np.argmax(slope[inside])] == pytest.approx(0.0356, abs=1e-4)
    assert x[inside][np.argmin(slope[inside])] == pytest.approx(-0.0356, abs=1e-4)


def test_p2_s_displacement_rolling_and_braked():
    """Fig. 11: 6.6 mm pressed in, 7.1 mm at a slip of 0.15."""
    model = preset_model("P2").with_effect("traction", lever_m=0.018)
    drive = Conditions.of(2, speed_m_s=11.11, slip=[0.0, 0.15])
    pressed = model.predict(drive, np.linspace(-0.3, 0.3, 2001), observable="displacement")
    assert pressed.max(axis=1) == pytest.approx([6.6e-3, 7.1e-3], abs=5e-5)


@pytest.mark.parametrize(("load_N", "depth_mm"), [(250.0, 1.42), (1000.0, 5.56), (3500.0, 17.0)])
def test_p3_s_ring_is_pressed_in_and_stays_even(load_N, depth_mm):
    """Depths of the re-derived ring (errata); Fig. 7 says that a higher load does the contrary."""
    phi = np.linspace(-0.5, 0.5, 2001)
    drive = Conditions.of(1, speed_m_s=10.0, load_N=load_N)
    pressed = preset_model("P3").predict(drive, phi, observable="displacement")[0]
    assert pressed.max() == pytest.approx(1e-3 * depth_mm, rel=0.005)
    assert np.abs(pressed - pressed[::-1]).max() < 1e-3 * pressed.max()


def p3_ring(load_N, half_angle_deg):
    """P3's ring on a patch of that half angle."""
    ring = preset_model("P3", contact="prescribed")
    half = 0.3 * np.radians(half_angle_deg)
    return ring.with_values(
        {"load_N": load_N, "reference_load_N": load_N, "patch_half_length_m": half}
    )


def test_p3_s_ring_is_stretched_at_the_patch_centre_and_rings_with_few_modes():
    """Fig. 3, F_z = 1000 N, inside: 10 waves ripple far from the patch, 100 do not."""
    model, drive = p3_ring(1000.0, 4.6), Conditions.of(1, speed_m_s=10.0)
    whole, ten, hundred = (
        model.predict(drive, TURN, surface="inner", modes=n)[0] for n in (None, 10, 100)
    )
    assert np.argmax(whole) == pytest.approx(TURN.size / 2, abs=1)
    assert whole.max() > 0
    ripple = [np.ptp(wave[np.abs(TURN) > 1.5]) / np.ptp(whole) for wave in (whole, ten, hundred)]
    assert ripple[1] > 0.03
    assert ripple[2] < 1.5 * ripple[0] + 1e-4


def test_p3_s_wear_sets_the_trailing_edge_apart():
    """Figs. 5 and 6: the edges' difference grows with wear, the strain shrinks."""
    model = p3_ring(1000.0, 4.6).with_effect("wear", amplitude=0.5, lever_loss=0.2)
    drive = Conditions.of(3, speed_m_s=10.0, distance_km=[0.0, 20000.0, 40000.0])
    strain = model.predict(drive, TURN, surface="inner")
    edges = model.predict(drive, np.radians([-4.6, 4.6]), surface="inner")
    gaps = (edges[:, 1] - edges[:, 0]) / np.ptp(strain, axis=1)
    assert abs(gaps[0]) < 1e-9
    assert gaps[2] > gaps[1] > 0.01
    assert np.ptp(strain[2]) < np.ptp(strain[0])


def test_p3_s_strain_per_newton_falls_with_the_load():
    """Fig. 7, three loads on a flat road: a longer patch shares the load."""
    model = preset_model("P3")
    drive = Conditions.of(3, speed_m_s=10.0, load_N=[500.0, 1000.0, 3500.0])
    per_newton = np.ptp(model.predict(drive, TURN), axis=1) / drive.load_N
    assert np.all(np.diff(per_newton) < 0.0)
    assert np.all(np.diff(model.half_length_m(drive)) > 0.0)
