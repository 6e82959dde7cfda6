"""Property: `tirelog model forces`, and `model predict` of several conditions, from the outside."""

import pytest

from tests.physics.commands import rows, status
from tirelog.cli import run
from tirelog.physics import CATALOGUE
from tirelog.physics.model.file import load_model


@pytest.fixture(autouse=True)
def presets(here):
    for preset, name in (("P3", "ring"), ("P2", "beam")):
        assert status(f"model new --preset {preset} -o {name}.toml --quiet") == 0


def test_each_speed_is_taken_with_each_load(here, capsys):
    found = rows(capsys, "model forces ring.toml --speed 5:15:5 --load 1000,2000")
    driven = [(row["speed_m_s"], row["load_N"]) for row in found]
    assert driven == [(v, F) for v in (5.0, 10.0, 15.0) for F in (1000.0, 2000.0)]
    assert all(row["hub_vertical_N"] == pytest.approx(row["load_N"]) for row in found)
    assert all(row["speed_ratio"] is None for row in found)


def test_several_revolutions_stand_one_after_the_other(here, capsys):
    found = rows(capsys, "model predict beam.toml --speed 10,20 --points 8")
    assert [row["speed_m_s"] for row in found] == [10.0] * 8 + [20.0] * 8
    assert {"strain_slope_1_m", "strain_curvature_1_m2", "xi_m"} <= set(found[0])
    # of a beam a displacement along itself is not known
    assert {row["tangential_displacement_m"] for row in found} == {None}


def test_a_standing_wheel_has_no_rolling_resistance(here, capsys):
    (row,) = rows(capsys, "model forces beam.toml --speed 0")
    assert row["rolling_resistance_N"] is None
    assert row["dissipated_power_W"] == 0.0


def test_a_page_of_a_beam_tells_its_critical_speed(here, capsys):
    assert status("model show beam.toml") == 0
    page = capsys.readouterr().out
    assert "critical_speed  86.73" in page
    assert "lambda" in page
    assert status("model show ring.toml") == 0
    assert "critical" not in capsys.readouterr().out


def test_a_worn_tread_is_stiffer_and_nearer_to_the_grating(here, capsys):
    made = ["model", "worn", "ring.toml", "--new-depth", "0.008", "--depth", "0.004"]
    assert run([*made, "-o", "worn.toml"]) == 0
    assert "lever_arm_m 0.005 -> 0.003" in capsys.readouterr().err
    new, worn = (load_model(here / f"{name}.toml").values for name in ("ring", "worn"))
    assert worn["tread_stiffness_N_m2"] == 2.0 * new["tread_stiffness_N_m2"]
    assert {k: v for k, v in worn.items() if new[k] != v} == {
        "tread_stiffness_N_m2": 1.75e8,
        "lever_arm_m": pytest.approx(0.003),
    }


def test_a_point_load_keeps_its_place_in_the_file(here, capsys):
    made = ["model", "new", "--preset", "P1", "--observable", "strain", "--contact", "point"]
    assert run([*made, "-o", "point.toml"]) == 0
    assert load_model(here / "point.toml").contact == "point"
    assert not load_model(here / "point.toml").parameters["patch_half_length_m"].free
    assert status("model show point.toml") == 0
    assert "under a point load" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("observable", "column"),
    [
        ("phase_shift", "phase_shift_deg"),
        ("patch_width", "patch_width_deg"),
        ("patch_length", "patch_length_m"),
        ("dissipation_factor", "dissipation_factor_1_m"),
    ],
)
def test_a_model_of_a_number_gives_that_number_of_each_condition(here, capsys, observable, column):
    assert status(f"model new --carcass ring --observable {observable} -o m.toml --quiet") == 0
    if observable == "phase_shift":
        words = ["model", "add", "m.toml", "telemetry_delay", "--set", "delay_s=0.0004"]
        assert run([*words, "-o", "late.toml"]) == 0
        found = rows(capsys, "model predict late.toml --speed 10,20")
        assert found[1][column] == pytest.approx(2.0 * found[0][column])
        assert found[0][column] > 0.1
    else:
        found = rows(capsys, "model predict m.toml --speed 10,20")
        assert found[0][column] > 0.0
    assert [row["speed_m_s"] for row in found] == [10.0, 20.0]
    assert "strain" not in found[0]
    (one, *more) = rows(capsys, "model predict m.toml --speed 10 --all --points 8")
    assert "strain" in one  # the waveform beside it
    assert len(more) == 7


CHOICES = [(e.id, k, word) for e in CATALOGUE for k, words in e.options.items() for word in words]


@pytest.mark.parametrize(("effect", "choice", "word"), CHOICES)
def test_a_choice_of_an_effect_is_set_as_its_numbers_are(here, capsys, effect, choice, word):
    words = ["model", "add", "beam.toml", effect, "--set"]
    assert run([*words, f"{choice}={word}", "-o", "chosen.toml", "--quiet"]) == 0
    (entry,) = load_model(here / "chosen.toml").effects
    assert entry.options[choice] == word
