"""Property: every name, unit and size gives a likely kind whose unit a setup takes."""

import numpy as np
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st

from tirelog.drafts.setup import _ALONG, _WORDS, contents, guessed
from tirelog.vocabulary.kinds import KINDS
from tirelog.vocabulary.units import UNITS

NAMES = sorted({word for words, _ in _WORDS for word in words} | _ALONG | {"voltage", "W-N-01", ""})


@given(
    st.lists(st.sampled_from(NAMES), max_size=3).map("_".join),
    st.sampled_from(["", "furlong", *UNITS]),
    st.sampled_from([0.0, 1e-9, 1e-4, 0.3, 2.0, 40.0, 900.0, 1550.0, 2.2e5, 1e30]),
    st.sampled_from([0.0, 1e-6, 0.1, 3.0]),
)
@settings(max_examples=120, deadline=None)
def test_a_guess_is_a_kind_with_a_unit_of_it(name, unit, size, moves):
    samples = size * (1.0 + moves * np.sin(np.arange(50.0)))
    guess = guessed(name, unit, samples)
    KINDS[guess.kind].to_si(guess.unit)
    assert guess.reason
    lost = guessed(name, unit, np.full(5, np.nan))
    assert lost.kind == "signal"


@pytest.mark.parametrize(
    ("name", "size", "kind", "unit"),
    [
        ("acc_x_g", 30.0, "longitudinal_acceleration", "g"),
        ("acc_x_g", 150.0, "signal", "g"),  # of an accelerometer in the tread
        ("acc_y_g", 30.0, "signal", "g"),
        ("acc_y_g", 150.0, "radial_acceleration", "g"),  # its mean is that of a turning wheel
        ("lateral acceleration", 8.0, "signal", "m/s^2"),
        ("acc_radial", 3.0, "radial_acceleration", "m/s^2"),
        ("Acc_Z", 30.0, "radial_acceleration", "m/s^2"),
        ("AxialLoad_N", 30.0, "vertical_load", "N"),
        ("load", 3.4, "vertical_load", "kN"),
        ("tire_pressure", 2.2, "inflation_pressure", "bar"),
        ("tire_pressure", 220.0, "inflation_pressure", "kPa"),
        ("pressure_psi", 32.0, "inflation_pressure", "psi"),
        ("strainOuter", 900.0, "strain", "microstrain"),
        ("strain", 9e-4, "strain", "strain"),
        ("lf_ttpms_1", 2.0, "inflation_pressure", "bar"),
        ("temp_C", 60.0, "temperature", "degC"),
        ("WL 1", 1532.0, "fbg_strain", "nm"),
        ("hall", 1.0, "wheel_encoder", "1"),
        ("enc_fl", 1.0, "wheel_encoder", "1"),
        ("Dehnung_1", 900.0, "strain", "microstrain"),
        ("x", 1.0, "signal", "1"),
    ],
)
def test_names_that_loggers_give(name, size, kind, unit):
    samples = size * (1.0 + 1e-4 * np.sin(np.arange(50.0)))
    guess = guessed(name, "", samples)
    assert (guess.kind, guess.unit) == (kind, unit)


@pytest.mark.parametrize(
    ("name", "unit", "size", "kind"),
    [
        ("acc_y", "g", 8.0, "signal"),
        ("acc_z", "g", 8.0, "radial_acceleration"),
        ("acc_x", "g", 0.3, "longitudinal_acceleration"),
        ("acc_x", "g", 150.0, "signal"),
        ("Fy", "N", 900.0, "signal"),
        ("Fz", "N", 3400.0, "vertical_load"),
        ("Fx", "N", 900.0, "longitudinal_force"),
    ],
)
def test_a_unit_does_not_tell_the_direction(name, unit, size, kind):
    """Peaks of both signs at passages, as an axis across the tread has them."""
    samples = size * np.sin(np.arange(5000.0)) * (np.arange(5000) % 500 < 30)
    assert guessed(name, unit, samples).kind == kind


def test_the_name_of_a_matrix_that_holds_the_time_is_not_that_of_its_rows(tmp_path):
    t = np.arange(2000) / 2000.0
    rows = np.vstack([t, np.sin(40.0 * t), np.cos(40.0 * t)])
    scipy.io.savemat(tmp_path / "log.mat", {"accel": rows})
    found = contents(str(tmp_path / "log.mat"))
    assert found.time == "/accel[0]"
    assert {one.guess.kind for one in found.found} == {"signal"}
    scipy.io.savemat(tmp_path / "log.mat", {"accel": rows[1:]})
    kinds = {one.guess.kind for one in contents(str(tmp_path / "log.mat")).found}
    assert kinds == {"radial_acceleration"}
