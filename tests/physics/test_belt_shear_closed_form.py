"""Closed form: the belt in shear by Timoshenko's equations, and pulled along by traction."""

import numpy as np
import pytest
from scipy.sparse import bmat, diags
from scipy.sparse.linalg import spsolve

from tests.physics.brush_shear import traction
from tirelog.api.models import forces, given_conditions, revolutions
from tirelog.data.recording import Conditions
from tirelog.data.setup import Tire
from tirelog.physics import Model
from tirelog.physics.model.file import preset_model
from tirelog.physics.model.forces import force_columns

EJ, K, MU, HALF, LEVER, LOAD, R = 4.0, 7.8e6, 0.676, 0.058, 3e-4, 3434.0, 0.305


def timoshenko(shear_length, speed, points=8192):
    """(angles, strain of the inner surface) of GA (w' - t)' - mu c^2 w'' - k w + p = 0 and
    EJ t'' + GA (w' - t) = 0; w, t on a staggered closed grid."""
    step = 2 * np.pi * R / points
    place = (np.arange(points) - points // 2) * step
    force = EJ / shear_length**2  # G A
    edges = np.clip((place[:, None] + [[-step / 2, step / 2]]) / HALF, -1.0, 1.0)
    p = np.diff(LOAD * (0.75 * edges - 0.25 * edges**3), axis=1)[:, 0] / step
    one = np.ones(points)
    ahead = diags([-one, one[1:], one[:1]], [0, 1, 1 - points]) / step  # from w to t's places
    back = -ahead.T
    both = bmat(
        [
            [(force - MU * speed**2) * (back @ ahead) - K * diags(one), -force * back],
            [force * ahead, EJ * (ahead @ back) - force * diags(one)],
        ],
        format="csc",
    )
    turned = spsolve(both, np.concatenate([-p, 0 * p]))[points:]
    return place / R, -LEVER * (back @ turned)


def model():
    return Model.new(
        "beam",
        flexural_stiffness_N_m2=EJ,
        foundation_stiffness_N_m2=K,
        line_mass_kg_m=MU,
        patch_half_length_m=HALF,
        reference_load_N=LOAD,
        lever_arm_m=LEVER,
        radius_m=R,
    )


@pytest.mark.parametrize(("length", "speed"), [(0.01, 1.0), (0.02, 20.0)])
def test_strain_of_a_belt_that_yields_in_shear(length, speed):
    drive = Conditions.of(1, speed_m_s=speed, load_N=LOAD)
    angles, truth = timoshenko(length, speed)
    told = (
        model().with_effect("belt_shear", length_m=length).predict(drive, angles, surface="inner")
    )
    plain = model().predict(drive, angles, surface="inner")
    assert np.abs(told[0] - truth).max() < 2e-3 * np.abs(truth).max()
    assert np.abs(plain[0] - truth).max() > 2e-2 * np.abs(truth).max()


@pytest.mark.parametrize("length", [0.01, 0.02, 0.1])
def test_its_critical_speed_is_that_of_its_slowest_wave(length):
    """The least speed of a wave, by trying waves."""
    q = np.geomspace(1.0, 1e5, 200_000)
    slowest = np.sqrt((EJ * q**2 / (1 + (length * q) ** 2) + K / q**2).min() / MU)
    told = forces(model().with_effect("belt_shear", length_m=length), {"speed_m_s": 2.0})
    assert 2.0 / told["speed_ratio"][0] == pytest.approx(slowest, rel=1e-4)


COMPLIANCE, K_V, SLIP, SPEED = 1e-6, 3e5, 0.3, 15.0
DRIVEN = {"speed_m_s": SPEED, "load_N": 3400.0, "slip": SLIP}
ETA, HEIGHT, WIDTH = 2e3, 0.018, 0.2


def stretched(lever_arm_m=0.004, compliance=COMPLIANCE):
    braked = preset_model("P2").with_values({"lever_arm_m": lever_arm_m}).with_effect("traction")
    if not compliance:
        return braked
    return braked.with_effect(
        "belt_stretch", compliance_1_N=compliance, tangential_stiffness_N_m2=K_V
    )


def pulled(place_m):
    """u [m] by the line force's answer on a closed belt, summed over the brush's traction."""
    values = stretched().values
    L, around = values["patch_half_length_m"], 2 * np.pi * values["radius_m"]
    L *= (DRIVEN["load_N"] / values["reference_load_N"]) ** values["patch_load_exponent"]
    reach = 1 / np.sqrt(COMPLIANCE * K_V)
    at = L * ((np.arange(20_000) + 0.5) / 10_000 - 1)
    tau = traction(at, np.array(DRIVEN["load_N"]), np.array(L), np.array(SLIP)) * (at[1] - at[0])
    away = np.abs(place_m[:, None] - at) % around
    one = COMPLIANCE * reach / 2 * np.cosh((around / 2 - away) / reach)
    one /= np.sinh(around / 2 / reach)
    return np.asarray(one @ tau)


def test_tangential_displacement_is_that_of_a_bar_held_by_springs():
    told = revolutions(stretched(), DRIVEN, points=512)
    truth = pulled(told["xi_m"])
    assert np.abs(told["tangential_displacement_m"] - truth).max() < 1e-5 * truth.max()


def test_its_slope_is_the_strain_of_every_fibre_of_the_section():
    for surface in ("inner", "outer"):
        with_it, without = (
            revolutions(stretched(compliance=c), DRIVEN, points=2048, surface=surface)
            for c in (COMPLIANCE, 0.0)
        )
        xi, step = with_it["xi_m"], 1e-5
        truth = (pulled(xi + step) - pulled(xi - step)) / (2 * step)
        more = with_it["strain"] - without["strain"]
        assert np.abs(more - truth).max() < 2e-3 * np.abs(truth).max()
    assert np.isnan(without["tangential_displacement_m"]).all()


def powers(stretched):
    tire = Tire(viscosity_Pa_s=ETA, section_height_m=HEIGHT, width_m=WIDTH)
    told = force_columns(stretched, given_conditions(DRIVEN), tire)
    names = ("bending_power_W", "stretching_power_W", "strip_power_W")
    return tuple(float(told[name][0]) for name in names)


def test_p1_27_is_exact_for_the_neutral_axis_alone():
    bending, stretching, strip = powers(stretched(lever_arm_m=0.0))
    assert strip == pytest.approx(stretching, rel=1e-12)
    rows = revolutions(stretched(lever_arm_m=0.0), DRIVEN, points=8192)
    step = rows["xi_m"][1] - rows["xi_m"][0]
    integral = (rows["strain_slope_1_m"] ** 2).sum() * step
    assert stretching == pytest.approx(ETA * HEIGHT * WIDTH * SPEED**2 * integral, rel=5e-5)
    assert bending > 0.1 * stretching


def test_p1_25_is_the_mean_of_27_over_the_section():
    """Fibre by fibre, at Gauss's places of the section."""
    bending, stretching, _ = powers(stretched())
    places, weights = np.polynomial.legendre.leggauss(4)
    total = 0.0
    for place, weight in zip(places, weights, strict=True):
        rows = revolutions(
            stretched(lever_arm_m=abs(place) * HEIGHT / 2), DRIVEN, points=8192,
            surface="inner" if place > 0 else "outer",
        )  # fmt: skip
        step = rows["xi_m"][1] - rows["xi_m"][0]
        total += 0.5 * weight * (rows["strain_slope_1_m"] ** 2).sum() * step
    whole = ETA * HEIGHT * WIDTH * SPEED**2 * total
    assert bending + stretching == pytest.approx(whole, rel=5e-5)
