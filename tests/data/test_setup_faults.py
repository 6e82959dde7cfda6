"""Faults: a setup file that is wrong is refused: what is wrong, where, and what is allowed."""

import pytest

from tests.data.good_setup import GOOD
from tirelog.data.setup import load_setup, parse_setup
from tirelog.errors import SetupError

BAD = [
    ("strain_gain", "strian_gain", 15, r"unknown key 'strian_gain'.*nearest: strain_gain"),
    ('kind = "fbg_strain"', 'kind = "fbg_strian"', 11, r"nearest: fbg_strain"),
    ('unit = "nm"', 'unit = "nanobar"', 13, r"unit 'nanobar' is not one of m, mm"),
    ('unit = "nm"', 'unit = "bar"', 13, r"unit 'bar' is not one of"),
    ("load_N = 3434.0", "load_N = 0", 7, r"a number above 0"),
    ("load_N = 3434.0", "load_N = nan", 7, r"a number above 0"),
    ("load_N = 3434.0", "load_N = true", 7, r"a number above 0"),
    ("steps = 48", "steps = 48.5", 26, r"whole"),
    ('surface = "inner"', 'surface = "iner"', 17, r"allowed are outer, inner"),
    ("[1549.0, 1551.5]", "[1551.5, 1549.0]", 18, r"pair \[low, high\]"),
    ('"temp_1"', '"temp_2"', 16, r"not another channel.*nearest: temp_1"),
    ("reference_wavelength_nm = 1550.0\n", "", 10, r"a grating needs its wavelength at rest"),
    ("driven = true", "driven = 1", 9, r"true or false"),
    # what is no tire's
    ("distance_km = 0", "inflation_pressure_Pa = 2.2", 8, r"2\.2 bar would be 220000"),
    ("distance_km = 0", "inflation_pressure_Pa = 32", 8, r"32 psi would be 220632"),
    ("load_N = 3434.0", "load_N = 3.4", 7, r"3\.4 kN would be 3400"),
    ("load_N = 3434.0", "load_N = -3434.0", 7, r"a number above 0"),
    ("radius_m = 0.3126", "radius_m = 3.126", 3, r"allowed for a tire is 0\.04 to 2\.5"),
    ("section_height_m = 0.018", "rolling_radius_m = 0.2", 4, r"36 % smaller than .* 0\.85 to 1"),
    ("section_height_m = 0.018", "rolling_radius_m = 0.35", 4, r"12 % larger than the unloaded"),
    ("width_m = 0.215", "width_m = 0.002", 5, r"allowed for a tire is 0\.01 to 2"),
    ("nm = 1550.0", "nm = 155.0", 14, r"allowed for a tire is 400 to 2500"),
]


@pytest.mark.parametrize(("old", "new", "line", "message"), BAD)
def test_a_bad_setup_is_refused_with_file_line_and_advice(old, new, line, message):
    with pytest.raises(SetupError, match=message) as caught:
        parse_setup(GOOD.replace(old, new, 1), "s.toml")
    assert caught.value.line == line
    assert str(caught.value).startswith(f"s.toml:{line}: ")


@pytest.mark.parametrize(
    ("content", "said"), [(b"\xff\xfe\x00", "is not UTF-8"), (b"x" * (2 << 20), "larger than")]
)
def test_what_is_no_setup_at_all(tmp_path, content, said):
    (tmp_path / "s.toml").write_bytes(content)
    with pytest.raises(SetupError, match=said):
        load_setup(tmp_path / "s.toml")


def test_no_channels():
    with pytest.raises(SetupError, match="at least one"):
        parse_setup("[tire]\nname='x'\n")
