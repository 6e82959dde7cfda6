"""Closed form: a setup gives what stands in it, in SI, and belongs to the log that it is beside."""

from pathlib import Path

import pytest

from tests.data.good_setup import GOOD
from tirelog.data.setup import parse_setup, setup_beside
from tirelog.errors import SetupError
from tirelog.runs.temporary import scaled_to_si


def test_a_good_setup() -> None:
    setup = parse_setup(GOOD)
    assert list(setup.channels) == ["strain_1", "temp_1", "encoder"]
    assert setup.channels["strain_1"].window_nm == (1549.0, 1551.5)
    assert setup.channels["encoder"].steps == 48
    assert setup.tire.radius_m == 0.3126
    assert setup.tire.area_m2 == pytest.approx(0.018 * 0.215)
    assert setup.conditions.distance_km == 0.0
    assert setup.conditions.driven is True


def test_strain_is_p1_equation_1() -> None:
    factor, offset = scaled_to_si(parse_setup(GOOD).channels["strain_1"])
    assert factor * 1551.55 + offset == pytest.approx(1.27 * 1.55 / 1550.0, rel=1e-12)


def test_strain_from_picometres() -> None:
    channel = parse_setup(GOOD.replace('unit = "nm"', 'unit = "pm"')).channels["strain_1"]
    factor, offset = scaled_to_si(channel)
    assert factor * 1551550.0 + offset == pytest.approx(1.27e-3, rel=1e-11)


def test_temperature_change_of_the_twin() -> None:
    factor, offset = scaled_to_si(parse_setup(GOOD).channels["temp_1"])
    assert factor * 1542.05 + offset == pytest.approx(5.0, rel=1e-9)


@pytest.mark.parametrize("name", ["drive.toml", "drive.csv.toml"])
def test_the_setup_beside_a_compressed_log(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text(GOOD)
    assert setup_beside(tmp_path / "drive.csv.gz") == tmp_path / name
    assert setup_beside(tmp_path / "other.csv") is None


def test_the_road_of_a_log() -> None:
    road = parse_setup(
        GOOD + '[road]\nkind = "cleat"\nheight_m = 0.01\nlength_m = 0.04\nposition_m = 12.5\n'
    ).road
    assert (road.kind, road.height_m, road.length_m, road.position_m, road.time_s) == (
        "cleat",
        0.01,
        0.04,
        12.5,
        None,
    )
    assert parse_setup(GOOD).road.kind == "flat"
    for text, said in (
        ('kind = "cleet"', "nearest: cleat"),
        ("heigth_m = 0.1", "nearest: height_m"),
        ("length_m = 0.0", "above 0"),
    ):
        with pytest.raises(SetupError, match=said):
            parse_setup(f"{GOOD}[road]\n{text}\n")
