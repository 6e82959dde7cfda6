"""A setup file that is right in every line, for tests that read or spoil it."""

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
