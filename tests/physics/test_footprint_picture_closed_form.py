"""Closed form: a model with a footprint's measured pressure is a beam under that pressure."""

from __future__ import annotations

import numpy as np
import pytest

from tests.strain.strain_truth import Beam
from tirelog.cli import run
from tirelog.data.recording import Conditions
from tirelog.physics.model.file import load_model

HALF_M, PITCH_M, LOAD_N = 0.055, 0.005, 3600.0


def picture(power: float, saddle: float) -> np.ndarray:
    """Lines of a mat along the tread with a rib on either side, in kPa, and bare lines about it."""
    edges = np.linspace(-HALF_M, HALF_M, 2 * round(HALF_M / PITCH_M) + 1)
    x = 0.5 * (edges[1:] + edges[:-1]) / HALF_M
    along = (1 - np.abs(x) ** power) * (1 + saddle * x**2)
    bare = np.zeros(3)
    return np.outer(np.r_[bare, along, bare], [200.0, 250.0, 0.0, 300.0])


@pytest.fixture
def beam(tmp_path, monkeypatch):
    """A beam in a file, beside which pictures are made."""
    monkeypatch.chdir(tmp_path)
    numbers = {"flexural_stiffness_N_m2": 4, "foundation_stiffness_N_m2": 2e6}
    numbers |= {"line_mass_kg_m": 4.5, "lever_arm_m": 3e-4, "load_N": 3600, "radius_m": 0.305}
    asked = [word for name, x in numbers.items() for word in ("--set", f"{name}={x}")]
    assert run(["model", "new", "--carcass", "beam", "-o", "beam.toml", *asked]) == 0


def made(*more: str) -> int:
    asked = ["model", "pressure", "beam.toml", "mat.csv", "--pitch", f"{PITCH_M}"]
    return run([*asked, "--load", f"{LOAD_N}", "-o", "measured.toml", *more])


@pytest.mark.parametrize(("power", "saddle"), [(2.0, 0.0), (6.0, 0.0), (4.0, 1.0)])
def test_the_strain_is_that_of_a_beam_under_the_measured_pressure(beam, power, saddle):
    np.savetxt("mat.csv", picture(power, saddle), delimiter=",")
    assert made() == 0
    model = load_model("measured.toml")
    assert model.values["patch_half_length_m"] == pytest.approx(HALF_M)
    truth = Beam(power=power, saddle=saddle)
    xi, strain = truth.wave(12.0)
    phi = np.linspace(-0.7, 0.7, 801)
    driven = Conditions.of(1, speed_m_s=12.0, acceleration_m_s2=0.0, time_s=0.0, load_N=LOAD_N)
    own = model.predict(driven, phi, surface="inner")[0]
    assert np.abs(own + np.interp(0.305 * phi, xi, strain)).max() < 0.02 * np.ptp(strain)
