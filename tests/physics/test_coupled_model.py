"""Property: `carcass = "coupled_ring"` in model files is the ring where it rolls steadily, with a
hub of its own beside.
"""

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.errors import ModelError
from tirelog.physics import Model
from tirelog.physics.model.file import load_model, parse_model, save_model

RING = {"radial_damping_N_s_m2": 60.0, "tangential_damping_N_s_m2": 60.0}


@pytest.mark.parametrize("observable", ["strain", "radial_acceleration", "patch_length"])
def test_steady_rolling_is_the_ring(observable):
    phi = None if observable == "patch_length" else np.linspace(-np.pi, np.pi, 400)
    conditions = Conditions.of(
        3, speed_m_s=[5.0, 20.0, 30.0], load_N=[2000.0, 3000.0, 4000.0], temperature_K=20.0
    )
    ring, coupled = (Model.new(name, observable, **RING) for name in ("ring", "coupled_ring"))
    for effect in (None, "viscous_damping", "pressure_offset", "gauge_length"):
        if effect is not None and observable != "patch_length":
            own = {
                "viscous_damping": {"damping_rate_1_s": 20.0},
                "pressure_offset": {"offset": 0.2},
                "gauge_length": {"length_m": 0.02},
            }
            ring, coupled = (m.with_effect(effect, **own[effect]) for m in (ring, coupled))
        assert np.array_equal(ring.predict(conditions, phi), coupled.predict(conditions, phi))


def test_the_file_keeps_it(tmp_path):
    model = Model.new("coupled_ring", hub_mass_kg=31.0, friction=0.6)
    save_model(model, tmp_path / "m.toml")
    again = load_model(tmp_path / "m.toml")
    assert again.carcass == "coupled_ring"
    assert again.values == model.values
    assert again.free == model.free


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("hub_mass_kg = 0.0", r"hub_mass_kg = 0 kg lies outside its bounds; allowed is \[0.001"),
        ("line_mass_kg_m = 0.0", "line_mass_kg_m = 0 kg/m lies outside its bounds"),
        ("hub_mas_kg = 3.0", "nearest: hub_mass_kg"),
        ("patch_half_length_m = 0.05", "unknown key 'patch_half_length_m'|stands on its tread"),
        ('contact = "prescribed"', "stands on its tread; .*flat_road.* is allowed"),
    ],
)
def test_files_that_cannot_be(line, said):
    text = "\n".join(
        f"{name} = {p.value}"
        for name, p in Model.new("coupled_ring").parameters.items()
        if not line.startswith(name)
    )
    with pytest.raises(ModelError, match=said):
        parse_model(
            f'[model]\nobservable = "strain"\ncarcass = "coupled_ring"\n[parameters]\n{text}\n'
            f"{line}\n"
        )


def test_a_coupled_ring_is_a_ring_to_the_catalogue():
    with pytest.raises(ModelError, match="the carcass is a ring already"):
        Model.new("coupled_ring").with_effect("ring_curvature")
    with pytest.raises(ModelError, match="stands on its tread"):
        Model.new("coupled_ring", contact="prescribed")
