"""Property: power = moment x angular speed = load x offset, for every effect and every carcass."""

import numpy as np
import pytest

from tirelog.api.models import forces, revolutions
from tirelog.errors import ModelError
from tirelog.physics import BY_ID
from tirelog.physics.model.file import preset_model

DRIVEN = {
    "speed_m_s": 20.0, "load_N": 3000.0, "acceleration_m_s2": 2.0, "water_depth_mm": 1.0,
    "lateral_acceleration_m_s2": 2.0,
    "distance_km": 2e4, "temperature_K": 10.0, "time_s": 10.0, "inflation_pressure_Pa": 1.3e5,
}  # fmt: skip
RING, BEAM = preset_model("P3"), preset_model("P2")
CARCASSES = {
    "beam": BEAM,
    "damped beam": BEAM.with_effect("viscous_damping", damping_rate_1_s=150.0),
    "ring": RING,
    "damped ring": RING.with_values({"radial_damping_N_s_m2": 200.0}),
}
ON_PRESSURE = {e.id for e in BY_ID.values() if "contact_pressure" in e.acts_on} - {"traction"}
#: their yield is not in the contact with the road, which is that of the linear ring
OUT_OF_CONTACT = {"stiffening", "belt_shear", "form", "traction"}


def with_effect(model, effect):
    """The model with the effect at the size that diagnose tries; None if it cannot have it."""
    if any(e.effect.id == effect.id for e in model.effects):
        return model
    sizes = {p.name: p.probe for p in effect.parameters if p.name in effect.strength and p.probe}
    try:
        return model.with_effect(effect.id, **sizes)
    except ModelError:  # it does nothing to strain, or the carcass is a ring already
        return None


def moment_in_space(model):
    """-int p x dxi with x = (R - w) sin phi + v cos phi [N m]."""
    rows, R = revolutions(model, DRIVEN, points=3072), model.values["radius_m"]
    phi = np.radians(rows["phi_deg"])
    inward, along = rows["displacement_m"], rows["tangential_displacement_m"]
    x = (R - inward) * np.sin(phi) + along * np.cos(phi)
    return float(-(rows["contact_pressure_N_m"] * x).sum() * R * (phi[1] - phi[0]))


@pytest.mark.parametrize("carcass", CARCASSES)
def test_power_moment_and_offset_are_one(carcass):
    model, tried = CARCASSES[carcass], 0
    R, lossless = model.values["radius_m"], "damped" not in carcass
    for effect in BY_ID.values():
        changed = with_effect(model, effect)
        if changed is None:
            continue
        tried += 1
        told = {name: column[0] for name, column in forces(changed, DRIVEN).items()}
        spin, scale = DRIVEN["speed_m_s"] / R, 1e-9 * told["load_N"] * DRIVEN["speed_m_s"]
        power, moment = told["dissipated_power_W"], told["rolling_resistance_moment_N_m"]
        assert power == pytest.approx(moment * spin, abs=scale), effect.id
        offset = -told["pressure_centre_m"] * told["load_N"]
        assert offset == pytest.approx(moment, abs=scale), effect.id
        assert told["rolling_resistance_N"] * DRIVEN["speed_m_s"] == pytest.approx(power, abs=scale)
        parts = told["carcass_power_W"] + told["tread_power_W"]
        assert parts == pytest.approx(power, abs=scale), effect.id
        # a carcass takes power and gives none; without losses it takes none
        losses = {"viscous_damping", "hysteresis", "warm_hysteresis", "belt_viscosity"}
        assert told["carcass_power_W"] > -scale, effect.id
        if lossless and effect.id not in losses:
            assert told["carcass_power_W"] == pytest.approx(0.0, abs=scale), effect.id
        if effect.id not in ON_PRESSURE:
            assert told["tread_power_W"] == 0.0, effect.id
        assert told["sliding_power_W"] >= 0.0
        assert (told["sliding_power_W"] > 0.0) == (effect.id == "traction")
    assert tried > 20


@pytest.mark.parametrize("carcass", ["ring", "damped ring"])
@pytest.mark.parametrize(
    "effect", [*sorted(ON_PRESSURE - OUT_OF_CONTACT), "hysteresis", "belt_tension", None]
)
def test_the_offset_is_where_the_pressure_acts_in_space(carcass, effect):
    """To a micrometre, as the edge of the contact lies somewhere between two angles of its grid."""
    model = CARCASSES[carcass]
    changed = model if effect is None else with_effect(model, BY_ID[effect])
    moment = forces(changed, DRIVEN)["rolling_resistance_moment_N_m"][0]
    assert moment_in_space(changed) == pytest.approx(moment, abs=1e-6 * DRIVEN["load_N"])


def test_a_hub_comes_nearer_by_belt_and_tread():
    """R (1 - cos(edge)) is what the hub came down, less the belt's yield at the edge."""
    rows = revolutions(RING, DRIVEN, points=3072)
    told = {name: column[0] for name, column in forces(RING, DRIVEN).items()}
    edge = told["patch_length_m"] / 2.0 / RING.values["radius_m"]
    inward, along = (
        np.interp(edge, np.radians(rows["phi_deg"]), rows[name])
        for name in ("displacement_m", "tangential_displacement_m")
    )
    drop = RING.values["radius_m"] * (1.0 - np.cos(edge))
    yields = inward * np.cos(edge) + along * np.sin(edge)
    assert told["hub_approach_m"] == pytest.approx(drop + yields, rel=2e-3)
    assert told["hub_approach_m"] > told["belt_deflection_m"]
    assert np.isnan(forces(BEAM, DRIVEN)["hub_approach_m"]).all()
