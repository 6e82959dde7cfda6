"""Property: what `tirelog model` and `tirelog effects` write, print and refuse."""

import json

import numpy as np
import pytest

from tests.physics.commands import status
from tests.physics.conftest import SETUP
from tirelog.cli import run
from tirelog.physics import CATALOGUE
from tirelog.physics.model.file import load_model


def test_new_takes_what_the_setup_knows(here, capsys):
    assert status("model new --carcass ring --setup s.toml -o r.toml") == 0
    ring = load_model(here / "r.toml")
    assert ring.contact == "flat_road"
    assert {ring.values[n] for n in ("load_N", "inflation_pressure_Pa", "width_m", "radius_m")} == {
        3434.0,
        2.2e5,
        0.215,
        0.305,
    }
    assert status("model new --setup s.toml --set line_mass_kg_m=5 -o b.toml") == 0
    beam = load_model(here / "b.toml")
    assert beam.values["patch_half_length_m"] == 0.063
    assert beam.values["reference_load_N"] == 3434.0
    assert beam.values["line_mass_kg_m"] == 5.0
    assert "next: tirelog" in capsys.readouterr().err


def test_add_remove_and_show(here, capsys):
    status("model new --setup s.toml -o b.toml")
    assert status("model add b.toml viscous_damping --set damping_rate_1_s=30 -o b2.toml") == 0
    assert load_model(here / "b2.toml").values["viscous_damping.damping_rate_1_s"] == 30.0
    assert status("model add b2.toml gauge_length --setup s.toml -o b3.toml") == 0
    gauge = load_model(here / "b3.toml").parameters["gauge_length.length_m"]
    assert gauge.value == 0.02
    assert not gauge.free
    assert status("model remove b2.toml viscous_damping -o b4.toml") == 0
    assert (here / "b4.toml").read_text() == (here / "b.toml").read_text()
    capsys.readouterr()
    assert status("model show b2.toml") == 0
    assert "viscous_damping: damping of the foundation" in capsys.readouterr().out
    assert status("model show b2.toml -o p.json") == 0
    rows = json.loads((here / "p.json").read_text())
    assert [r["value"] for r in rows if r["parameter"] == "viscous_damping.damping_rate_1_s"] == [
        30.0
    ]
    assert status("model show b2.toml --against b.toml") == 0
    assert "difference_sigma" in capsys.readouterr().out


def test_predict_gives_the_contracts_columns(here):
    status("model new --setup s.toml -o b.toml")
    assert status("model predict b.toml --setup s.toml --speed 14 -o w.csv") == 0
    header, *lines = (here / "w.csv").read_text().splitlines()
    assert header == (
        "xi_m,phi_deg,displacement_m,strain,radial_acceleration_m_s2,contact_pressure_N_m,"
        "shear_traction_N_m"
    )
    table = np.array([[float(x) for x in line.split(",")] for line in lines])
    assert np.all(np.diff(table[:, 1]) > 0)
    assert abs(table[np.argmax(table[:, 3]), 0]) < 0.063  # inner surface: a maximum in the patch
    assert np.allclose(table[:, 0], 0.305 * np.radians(table[:, 1]))
    assert table[:, 5].mean() * 2 * np.pi * 0.305 == pytest.approx(3434.0, rel=1e-5)


def test_new_says_what_it_had_to_guess(here, capsys):
    status("model new -o b.toml")
    assert (
        "neither the setup nor --set gives load_N = 3600, radius_m = 0.3126: a guess"
        in capsys.readouterr().err
    )
    status("model new --carcass ring --setup s.toml -o r.toml")
    status("model new --set load_N=3000 --set radius_m=0.3 -o c.toml")
    assert "guess" not in capsys.readouterr().err


def test_new_says_that_a_beam_does_not_lie_flat_under_an_accelerometer(here, capsys):
    for carcass in ("beam", "ring"):
        made = ["--observable", "radial_acceleration", "--carcass", carcass, "-o", "a.toml"]
        status("model new --setup s.toml", *made)
        told = capsys.readouterr().err
        assert ("does not lie flat" in told) == (carcass == "beam")


def test_new_predicts_what_the_setups_channels_measure(here):
    wheel = (
        SETUP[: SETUP.index("[channels")]
        + '[channels.a]\nkind = "radial_acceleration"\nsource = "a"\nunit = "g"\n'
    )
    (here / "wheel.toml").write_text(wheel)
    status("model new --setup wheel.toml -o a.toml --quiet")
    status("model new --setup wheel.toml --observable strain -o s1.toml --quiet")
    status("model new --setup s.toml -o s2.toml --quiet")
    assert [load_model(here / f).observable for f in ("a.toml", "s1.toml", "s2.toml")] == [
        "radial_acceleration",
        "strain",
        "strain",
    ]


def test_effects_lists_the_catalogue(here, capsys):
    assert run(["effects"]) == 0
    out = capsys.readouterr().out
    assert all(f"{e.id}: " in out for e in CATALOGUE)
    assert status("effects wear") == 0
    assert "distance_km" in capsys.readouterr().out
    assert status("effects -o e.json") == 0
    assert [row["effect"] for row in json.loads((here / "e.json").read_text())] == [
        e.id for e in CATALOGUE
    ]
    pytest.importorskip("matplotlib")
    assert status("effects traction --plot t.png") == 0
    assert (here / "t.png").read_bytes().startswith(b"\x89PNG")
