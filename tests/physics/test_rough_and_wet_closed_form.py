"""Closed form: asperities one by one, water by Reynolds' equation, tread that wears."""

import numpy as np
import pytest
from scipy.integrate import quad

from tirelog.api.models import forces, revolutions
from tirelog.errors import ModelError
from tirelog.physics.model.file import preset_model
from tirelog.physics.model.forces import worn_model

BEAM = preset_model("P2")
R, L0 = (BEAM.values[name] for name in ("radius_m", "patch_half_length_m"))
LOAD = BEAM.values["reference_load_N"]
TREAD, HEIGHT = 8.75e7, 2e-4
DRIVEN = {"speed_m_s": 15.0, "load_N": LOAD}


def parabola(xi):
    return 0.75 * LOAD / L0**3 * (L0**2 - xi**2)


def test_pressure_on_asperities_is_the_mean_over_their_heights():
    rough = BEAM.with_effect("asperities", height_m=HEIGHT, tread_stiffness_N_m2=TREAD)
    told = revolutions(rough, DRIVEN, points=1024)
    heights = HEIGHT * np.linspace(-8, 8, 4001)[:, None]
    weight = np.exp(-0.5 * (heights / HEIGHT) ** 2)
    depth = parabola(told["xi_m"]) / TREAD
    mean = TREAD * (weight * np.maximum(depth - heights, 0)).sum(axis=0) / weight.sum()
    mean *= LOAD / (mean.sum() * (told["xi_m"][1] - told["xi_m"][0]))  # the load is carried
    off = told["contact_pressure_N_m"] - mean
    assert np.sqrt(np.mean(off**2)) < 2e-5 * mean.max()
    assert np.abs(off).max() < 3e-4 * mean.max()


def test_asperities_matter_less_at_high_load():
    def share(load):
        driven = {**DRIVEN, "load_N": load}
        rough = BEAM.with_effect("asperities", height_m=HEIGHT)
        waves = [revolutions(m, driven)["strain"] for m in (BEAM, rough)]
        return float(np.ptp(waves[1] - waves[0]) / np.ptp(waves[0]))

    assert share(2 * LOAD) < 0.75 * share(LOAD)


def wet_model(width=0.15, film_mm=0.1):
    return BEAM.with_effect("water_wedge", width_m=width, film_mm=film_mm)


def reynolds(ahead, depth, speed, width, film):
    """Pressure [N/m] so far ahead of the edge, by quadrature of the equation itself."""

    def rise(s):
        h = film + s**2 / (2 * R)
        return 12e-3 * width * speed * (h - film) / h**3

    inlet = np.sqrt(2 * R * (depth - film))
    return quad(rise, ahead, inlet, epsabs=0.0)[0] if ahead < inlet else 0.0


def test_water_s_pressure_solves_reynolds_equation():
    wet = {**DRIVEN, "water_depth_mm": 0.6}
    told = revolutions(wet_model(), wet, points=2048)
    xi = told["xi_m"]
    water = [reynolds(max(-L0 - x, 0.0), 6e-4, 15.0, 0.15, 1e-4) for x in xi]
    truth = np.where(xi < 0, np.maximum(parabola(xi), water), np.maximum(parabola(xi), 0.0))
    truth *= LOAD / (truth.sum() * (xi[1] - xi[0]))
    off = told["contact_pressure_N_m"] - truth  # 1024 waves ring where the slope jumps
    assert np.sqrt(np.mean(off**2)) < 2e-4 * truth.max()
    assert np.abs(off).max() < 4e-3 * truth.max()
    edge = reynolds(0.0, 6e-4, 15.0, 0.15, 1e-4)
    assert edge > 0.05 * parabola(0.0)
    dry = L0 * (1 + np.sqrt(1 - edge / parabola(0.0)))
    assert forces(wet_model(), wet)["dry_length_m"][0] == pytest.approx(dry, rel=1e-9)


def test_water_lifts_in_proportion_to_speed_and_fills_with_its_depth():
    def lost(speed, depth):
        """What of the patch's first half is afloat, as a pressure."""
        told = forces(wet_model(), {**DRIVEN, "speed_m_s": speed, "water_depth_mm": depth})
        return float(1 - (told["dry_length_m"][0] / L0 - 1) ** 2)

    assert lost(20.0, 0.6) == pytest.approx(2 * lost(10.0, 0.6), rel=1e-9)
    assert 0.0 == lost(10.0, 0.1) < lost(10.0, 0.2) < lost(10.0, 0.6) < lost(10.0, 5.0)
    flooded = 12e-3 * 0.15 * 10.0 * np.sqrt(2 * R) * 1e-4**-1.5 * np.pi / 16
    assert lost(10.0, 20.0) == pytest.approx(flooded / parabola(0.0), rel=1e-3)


def test_a_tire_that_floats_is_refused():
    with pytest.raises(ModelError, match="floats"):
        revolutions(
            wet_model(width=0.6), {"speed_m_s": 60.0, "load_N": LOAD, "water_depth_mm": 5.0}
        )


def test_tread_worn_off_with_the_distance_is_the_worn_model_s_lever_arm():
    new = BEAM.with_values({"lever_arm_m": 4e-3})
    worn = new.with_effect("tread_depth", worn_mm=4.0)
    told = revolutions(worn, {**DRIVEN, "distance_km": 2e4}, surface="inner")["strain"]
    same, _ = worn_model(new, 8e-3, 6e-3)
    truth = revolutions(same, DRIVEN, surface="inner")["strain"]
    assert np.abs(told - truth).max() < 1e-12
    assert np.ptp(truth) > 0.0
