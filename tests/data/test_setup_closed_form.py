"""Closed form: a setup gives what stands in it, in SI, and belongs to the log that it is beside."""

import pytest

from tests.data.good_setup import GOOD
from tirelog.data.setup import parse_setup, setup_beside


def test_a_good_setup():
    setup = parse_setup(GOOD)
    assert list(setup.channels) == ["strain_1", "temp_1", "encoder"]
    assert setup.channels["strain_1"].window_nm == (1549.0, 1551.5)
    assert setup.channels["encoder"].steps == 48
    assert setup.tire.radius_m == 0.3126
    assert setup.tire.area_m2 == pytest.approx(0.018 * 0.215)
    assert setup.conditions.distance_km == 0.0
    assert setup.conditions.driven is True


@pytest.mark.parametrize("name", ["drive.toml", "drive.csv.toml"])
def test_the_setup_beside_a_compressed_log(tmp_path, name):
    (tmp_path / name).write_text(GOOD)
    assert setup_beside(tmp_path / "drive.csv.gz") == tmp_path / name
    assert setup_beside(tmp_path / "other.csv") is None


def test_the_road_of_a_log():
    road = parse_setup(
        GOOD + '[road]\nkind = "cleat"\nheight_m = 0.01\nlength_m = 0.04\nposition_m = 12.5\n'
    ).road
    assert (road.kind, road.height_m, road.length_m) == ("cleat", 0.01, 0.04)
    assert (road.position_m, road.time_s) == (12.5, None)
    assert parse_setup(GOOD).road.kind == "flat"


@pytest.mark.parametrize(
    ("load", "pressure", "unloaded", "rolling", "width"),
    [
        (300.0, 1.0e6, 0.34, 0.335, 0.028),
        (50_000.0, 8.5e5, 0.52, 0.5, 0.3),
        (300_000.0, 1.6e6, 0.66, 0.6, 0.5),
        (8_000.0, 4e4, 0.6, 0.55, 0.5),
    ],
    ids=["bicycle", "truck", "aircraft", "farm"],
)
def test_tires_of_all_kinds_are_allowed(load, pressure, unloaded, rolling, width):
    radii = f"{unloaded}\nrolling_radius_m = {rolling}"
    text = GOOD.replace("0.3126", radii).replace("width_m = 0.215", f"width_m = {width}")
    text = text.replace("3434.0", f"{load}\ninflation_pressure_Pa = {pressure}")
    assert parse_setup(text).conditions.load_N == load
