"""Closed form: what a plan of tests knows of one free number."""

import json

import numpy as np
import pytest

from benchmarks.goldens import tirelog
from tirelog.api.models import load_model, modes, predict

PHI = 2.0 * np.pi * ((np.arange(64) + 0.5) / 64 - 0.5)


@pytest.fixture
def planned(tmp_path):
    """The row of the one free number of a model, by its name."""

    def row(preset, name, *asked):
        tirelog(tmp_path, "model", "new", "--preset", preset, "-o", "m.toml")
        model = load_model(tmp_path / "m.toml")
        fixed = [f"{other}=fixed" for other in model.free if other != name]
        tirelog(tmp_path, "model", "set", "m.toml", *fixed)
        done = tirelog(tmp_path, "model", "plan", "m.toml", *asked, "--format", "json")
        assert done.status == 0, done.err
        (found,) = json.loads(done.out)
        return model, found, done.err

    return row


def test_an_amplitude_is_known_as_well_as_the_readings_are(planned):
    model, row, said = planned("P2", "lever_arm_m", "--speed", "10", "--load", "3000")
    number = model.parameters["lever_arm_m"]
    before = (number.max - number.min) / np.sqrt(12.0)
    assert row["se_bounds"] == row["se_static"] == row["se_cleat"] == pytest.approx(before)
    read = predict(model, {"speed_m_s": 10.0, "load_N": 3000.0}, PHI)[0]
    read = read - read.mean()
    # a scale: its share is known to 1 % of the largest, over the root of the sum of squares
    alone = number.value * 0.01 * np.abs(read).max() / np.sqrt((read**2).sum())
    assert row["se_driving"] == pytest.approx((before**-2 + alone**-2) ** -0.5, rel=1e-5)
    assert row["determined_by"] == "driving"
    assert "modal: no such test of this model" in said


def test_a_patch_is_measured_under_five_loads(planned):
    """Lengths in proportion to a root of the load, each to 1 mm; the beam has no hub."""
    model, row, _ = planned("P2", "patch_half_length_m")
    loads = np.linspace(0.5, 1.5, 5)
    exponent = model.values["patch_load_exponent"]
    alone = 1e-3 / np.sqrt((4.0 * (loads ** (2.0 * exponent))).sum())
    assert row["se_static"] == pytest.approx((row["se_bounds"] ** -2 + alone**-2) ** -0.5, rel=1e-3)
    assert row["se_driving"] < row["se_static"]


def test_a_stiffness_that_frequencies_follow_is_known_to_their_error(planned):
    """Of one free number: 1 / se^2 = sum (d ln f / d k)^2 / 0.005^2, by the frequencies' table."""
    model, row, _ = planned("P3", "tangential_stiffness_N_m2")
    k = model.values["tangential_stiffness_N_m2"]

    low, high = (
        np.array(modes(model.with_values({"tangential_stiffness_N_m2": k * s}))["frequency_Hz"])
        for s in (0.9999, 1.0001)
    )
    slopes = np.log(high / low) / (2e-4 * k)
    # pairs in the air count once
    information = ((slopes[np.append(True, np.abs(np.diff(low)) > 1e-4)] / 0.005) ** 2).sum()
    of_stage = row["se_modal"] ** -2 - row["se_static"] ** -2
    assert of_stage == pytest.approx(information, rel=1e-3)
    assert row["determined_by"] == "static"
