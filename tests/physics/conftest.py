"""A folder with a setup, as the tests of the model's commands have it."""

import pytest

SETUP = """
[tire]
unloaded_radius_m = 0.3126
rolling_radius_m = 0.305
width_m = 0.215
static_footprint_length_m = 0.126
[conditions]
load_N = 3434.0
inflation_pressure_Pa = 2.2e5
[channels.strain_1]
kind = "fbg_strain"
source = "CH1"
unit = "nm"
reference_wavelength_nm = 1550.0
surface = "inner"
gauge_length_m = 0.02
"""


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The working folder, with s.toml."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(SETUP)
    return tmp_path
