"""Property: model files are read as they were written, comments stay, none is left half-written."""

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.errors import OutputError
from tirelog.physics import CATALOGUE, Model
from tirelog.physics.model.file import as_toml, load_model, parse_model, save_model

CONTRACT = """
# the tire on the drum
[model]
observable = "strain"             # what the grating reads
carcass = "beam"

[parameters]                      # of the carcass
flexural_stiffness_N_m2 = { value = 4.0, min = 0.1, max = 100.0 }         # EJ
foundation_stiffness_N_m2 = { value = 2.0e6, min = 1e5, max = 1e8 }      # k
line_mass_kg_m = 4.5                                                    # mu
patch_half_length_m = { value = 0.055, min = 0.01, max = 0.2 }           # L
lever_arm_m = { value = 3e-4, min = 0.0, max = 0.02 }
load_N = 3600.0

# why: it lags
[[effects]]
name = "viscous_damping"
damping_rate_1_s = { value = 0.0, min = 0.0, max = 1e4 }   # guessed

[[effects]]                       # my own
name = "my_wedge"
acts_on = "contact_pressure"
expression = "q * (speed / 20)**2 * exp((xi + L) / 0.02) * (xi < -L)"
parameters = { q = { value = 5e3, min = -1e6, max = 1e6 } }
"""


def same(a, b):
    return a.values == b.values and [(p.min, p.max, p.free) for p in a.parameters.values()] == [
        (p.min, p.max, p.free) for p in b.parameters.values()
    ]


def test_the_contracts_example_is_read():
    model = parse_model(CONTRACT)
    assert model.free == [
        "flexural_stiffness_N_m2", "foundation_stiffness_N_m2", "patch_half_length_m",
        "lever_arm_m", "viscous_damping.damping_rate_1_s", "my_wedge.q",
    ]  # fmt: skip
    assert model.values["reference_load_N"] == 3600.0
    assert model.values["patch_load_exponent"] == 0.5


def test_what_is_not_changed_is_written_as_it_stood():
    assert as_toml(parse_model(CONTRACT)) == CONTRACT


@pytest.mark.parametrize("carcass", ["beam", "ring", "coupled_ring"])
def test_every_effect_survives_writing_and_reading(carcass):
    model = Model.new(carcass)
    for effect in CATALOGUE:
        if "strain" in effect.observables and (carcass == "beam" or not effect.beam_only):
            model = model.with_effect(effect)
            model = model.with_values({f"{effect.id}.{p.name}": p.probe for p in effect.parameters})
    again = parse_model(as_toml(model))
    assert same(again, model)
    assert (again.carcass, again.contact) == (carcass, model.contact)
    assert [e.options for e in again.effects] == [e.options for e in model.effects]
    assert as_toml(again) == as_toml(model)


def test_adding_and_removing_keeps_every_comment():
    model = parse_model(CONTRACT).with_effect("sensor_lag", lag_s=1e-3)
    text = as_toml(model)
    for comment in (
        "# the tire on the drum",
        "# EJ",
        "# why: it lags",
        "# guessed",
        "# what the grating reads",
    ):
        assert comment in text
    assert same(parse_model(text), model)
    assert as_toml(parse_model(text).without_effect("sensor_lag")).strip() == CONTRACT.strip()


def test_another_word_of_an_effect_s_choice_is_written_over_the_old_one():
    model = parse_model(as_toml(Model.new().with_effect("stiffening", cubic_1_m2=900.0)))
    assert "hardens" in as_toml(model)
    again = parse_model(as_toml(model.with_values({"stiffening.law": "softens"})))
    assert again.effects[0].options == {"law": "softens"}
    silent = parse_model(as_toml(model).replace('law = "hardens"', ""))
    assert "law" not in as_toml(silent)


def test_values_errors_and_the_users_own_effect_come_back():
    model = parse_model(CONTRACT).with_values(
        {"my_wedge.q": 7e3, "lever_arm_m": 4e-4}, se={"lever_arm_m": 1e-5}
    )
    again = parse_model(as_toml(model))
    assert again.parameters["lever_arm_m"].se == 1e-5
    assert again.parameters["my_wedge.q"].value == 7e3
    conditions = Conditions.of(2, speed_m_s=[10.0, 20.0])
    phi = np.linspace(-0.5, 0.5, 11)
    assert np.array_equal(again.predict(conditions, phi), model.predict(conditions, phi))


def test_saving_is_whole_or_not_at_all(tmp_path):
    target = tmp_path / "m.toml"
    save_model(parse_model(CONTRACT), target)
    assert load_model(target).path == target
    before = target.read_text()
    with pytest.raises(OutputError):
        save_model(parse_model(CONTRACT), tmp_path / "nowhere" / "m.toml")
    assert target.read_text() == before
    assert [p.name for p in tmp_path.iterdir()] == ["m.toml"]


def test_a_ring_names_its_contact_where_the_contract_puts_it():
    text = as_toml(Model.new("ring"))
    assert 'contact = "flat_road"' in text
    model = parse_model(text)
    held = [model.parameters[n] for n in ("radial_damping_N_s_m2", "tangential_damping_N_s_m2")]
    assert all(p.value == 0.0 and not p.free for p in held)
    assert model.free == [
        "flexural_stiffness_N_m2", "radial_stiffness_N_m2", "tangential_stiffness_N_m2",
        "tread_stiffness_N_m2", "lever_arm_m",
    ]  # fmt: skip


def test_a_ring_of_acceleration_frees_its_belt_s_width_and_is_read_without_it_as_ever():
    text = as_toml(Model.new("ring", "radial_acceleration"))
    assert parse_model(text).free == [
        "flexural_stiffness_N_m2", "radial_stiffness_N_m2", "tangential_stiffness_N_m2",
        "width_m", "tread_stiffness_N_m2",
    ]  # fmt: skip
    lines = text.splitlines()
    model = parse_model("\n".join(line for line in lines if not line.startswith("width_m")))
    width = model.parameters["width_m"]
    assert (width.value, width.free) == (0.14, False)
