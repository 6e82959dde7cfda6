"""Faults and closed form: the setup file says what is wrong, where, and what is allowed."""

from pathlib import Path

import pytest

from tirelog.data.setup import load_setup, parse_setup, setup_beside
from tirelog.errors import SetupError
from tirelog.runs.column import scaled_to_si

GOOD = """[tire]
name = "215/45 R17"
unloaded_radius_m = 0.3126
section_height_m = 0.018
width_m = 0.215
[conditions]
load_N = 3434.0
distance_km = 0
driven = true
[channels.strain_1]
kind = "fbg_strain"
source = "CH1"
unit = "nm"
reference_wavelength_nm = 1550.0
strain_gain = 1.27
temperature_channel = "temp_1"
surface = "inner"
window_nm = [1549.0, 1551.5]
[channels.temp_1]
kind = "fbg_temperature"
source = "CH2"
reference_wavelength_nm = 1542.0
[channels.encoder]
kind = "wheel_encoder"
source = "/e"
steps = 48
"""


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


BAD = [
    (
        "strain_gain",
        "strian_gain",
        15,
        r"unknown key 'strian_gain'.*nearest: strain_gain.*allowed are kind, source",
    ),
    ('kind = "fbg_strain"', 'kind = "fbg_strian"', 11, r"nearest: fbg_strain"),
    ('unit = "nm"', 'unit = "nanobar"', 13, r"unit 'nanobar' is not one of m, mm"),
    ('unit = "nm"', 'unit = "bar"', 13, r"unit 'bar' is not one of"),
    ("load_N = 3434.0", "load_N = 0", 7, r"a number above 0"),
    ("load_N = 3434.0", "load_N = nan", 7, r"a number above 0"),
    ("load_N = 3434.0", "load_N = true", 7, r"a number above 0"),
    ("steps = 48", "steps = 48.5", 26, r"whole"),
    ('surface = "inner"', 'surface = "iner"', 17, r"allowed are outer, inner"),
    ("[1549.0, 1551.5]", "[1551.5, 1549.0]", 18, r"pair \[low, high\]"),
    ('"temp_1"', '"temp_2"', 16, r"no other channel.*nearest: temp_1"),
    ("[conditions]", "[condition]", 6, r"unknown table \[condition\].*nearest: conditions"),
    ("reference_wavelength_nm = 1550.0\n", "", 10, r"a grating needs its wavelength at rest"),
    ("driven = true", "driven = 1", 9, r"true or false"),
]


@pytest.mark.parametrize(("old", "new", "line", "message"), BAD)
def test_a_bad_setup_is_refused_with_file_line_and_advice(
    old: str, new: str, line: int, message: str
) -> None:
    with pytest.raises(SetupError, match=message) as caught:
        parse_setup(GOOD.replace(old, new, 1), "s.toml")
    assert caught.value.line == line
    assert str(caught.value).startswith(f"s.toml:{line}: ")


def test_broken_toml_says_the_line(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text("[tire]\nname = \n")
    with pytest.raises(SetupError, match="not TOML"):
        load_setup(tmp_path / "s.toml")


@pytest.mark.parametrize("content", [b"\xff\xfe\x00", b"x" * (2 << 20)])
def test_what_is_no_setup_at_all(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "s.toml").write_bytes(content)
    with pytest.raises(SetupError, match=r"UTF-8|larger than"):
        load_setup(tmp_path / "s.toml")


def test_no_channels() -> None:
    with pytest.raises(SetupError, match="at least one"):
        parse_setup("[tire]\nname='x'\n")


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
