"""Property: `compare` finds the hits in logs of a tire moved by finite elements."""

import json

import pytest

from tirelog.cli import run
from tirelog.simulation import scenario_of, simulate, write_log

TIRE = {"radial_damping_N_s_m2": 200.0, "tangential_damping_N_s_m2": 200.0}
#: numbers that the model has as the truth has them
KNOWN = {"line_mass_kg_m": 4.5, "width_m": 0.14, "suspension_damping_N_s_m": 1500, **TIRE}


def status(words, folder, *more):
    """The exit status of a command; what has a suffix is a file of the folder."""
    typed = [str(folder / word) if "." in word else word for word in words.split()]
    return run([*typed, *more, "--quiet"])


def scenario(**road):
    return scenario_of(
        {
            "seed": 431,
            "truth": "coupled_ring",
            "tire": TIRE,
            "vehicle": {"suspension_damping_N_s_m": 1500.0},
            "road": {
                "kind": "cleat",
                "height_m": 0.008,
                "length_m": 0.04,
                "position_m": 31.0,
                **road,
            },
            "manoeuvres": [{"duration_s": 4.5, "speed_m_s": 15.0}],
            "channels": {"groove": {"kind": "strain", "angle_deg": 70.0}},
        }
    )


pytestmark = pytest.mark.xdist_group("cleat")  # one worker makes the log and the answer


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("cleat")
    write_log(simulate(scenario(spacing_m=24.5)), path / "log.csv")
    sets = [word for known in KNOWN.items() for word in ("--set", "{}={}".format(*known))]
    assert status("model new --carcass coupled_ring --setup log.toml -o m.toml", path, *sets) == 0
    return path


@pytest.fixture(scope="module")
def answer(folder):
    assert status("compare log.csv --model m.toml -o answer.json --plot compare.png", folder) == 0
    assert (folder / "compare_transient.png").stat().st_size > 20_000
    return json.loads((folder / "answer.json").read_text())


def test_the_hits_are_found_where_they_were(answer):
    hits = answer["transients"]["hits"]
    found = [hit["time_s"] for hit in hits]
    assert found == pytest.approx([31.0 / 15.0, 55.5 / 15.0], abs=5e-4)
    assert {hit["quality"] for hit in hits} == {"ok"}


def test_the_answer_is_covered_and_the_errors_stand_in_order(answer):
    total = answer["transients"]
    assert total["covered"] > 0.9
    assert total["noise_floor"] < total["missed"] < 0.35 * total["added"]
    assert total["rmse_steady"] < total["rmse"]
    assert total["excess"] == pytest.approx((total["rmse"] ** 2 - total["noise_floor"] ** 2) ** 0.5)
    assert total["nuisance_parameters"] == 8
    assert (
        answer["rmse"] < 0.2 * total["added"]
    )  # the revolutions on the obstacle are not among the steady ones


def test_another_carcass_leaves_the_obstacle_alone(folder, capfd):
    assert status("model new --carcass ring --setup log.toml -o ring.toml", folder) == 0
    words = ["compare", str(folder / "log.csv"), "--model", str(folder / "ring.toml")]
    assert run([*words, "--format", "json"]) == 0
    said = capfd.readouterr()
    assert "2 hits on an obstacle" in said.err
    assert 'carcass = "coupled_ring" does' in said.err
    assert "transients" not in json.loads(said.out)
    assert run([*words, "--by", "hit", "--quiet"]) == 2
    assert "--by hit is for a coupled_ring model" in capfd.readouterr().err
