"""Closed form: what of the patch the width between an accelerometer's fronts is, by a ring (P4)."""

import json

import numpy as np
import pytest

import tirelog
from tests.sources import ROOT
from tirelog.api.models import forces, predict
from tirelog.cli import run
from tirelog.physics.model.file import preset_model

SAMPLES = ROOT / "sample_data"


def test_the_fronts_are_at_half_of_the_level_beside_the_patch():
    ring = preset_model("P3")
    told = forces(ring, {"speed_m_s": 15.0, "load_N": 1000.0})
    phi = np.linspace(-np.pi, np.pi, 20001)
    read = -predict(
        ring, {"speed_m_s": 15.0, "load_N": 1000.0}, phi, observable="radial_acceleration"
    )[0]
    read -= 9.80665 * np.cos(phi)  # less gravity
    aside = (np.abs(phi) > np.radians(30.0)) & (np.abs(phi) < np.radians(130.0))
    above = phi[(read > 0.5 * read[aside].mean()) & (phi > 0.0)].min()
    assert told["patch_width_deg"][0] == pytest.approx(2 * np.degrees(above), rel=0.01)
    patch = told["patch_length_m"][0] / ring.values["radius_m"]
    assert told["contact_width_deg"][0] == pytest.approx(np.degrees(patch), rel=1e-12)


def test_a_fitted_ring_calibrates_the_width(tmp_path, monkeypatch, capsys):
    """Within 2 %, where the fronts are a quarter off."""
    monkeypatch.chdir(tmp_path)
    log, setup = str(SAMPLES / "encoder.h5"), str(SAMPLES / "encoder.toml")
    ring = ("--carcass", "ring", "--observable", "radial_acceleration", "--setup", setup)
    assert run(["model", "new", *ring, "-o", "m.toml", "--quiet"]) == 0
    assert run(["model", "fit", log, "--model", "m.toml", "-o", "f.toml", "--quiet"]) == 0
    capsys.readouterr()
    asked = ("--speed", "22", "--setup", setup, "--format", "json")
    assert run(["model", "forces", "f.toml", *asked]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    table = tirelog.phase_shift(log)
    steady = (table.speed_m_s - 22.0).abs() < 0.1
    fronts = float(table.patch_width_deg[steady].median())
    passed = json.loads((SAMPLES / "encoder.h5.truth.json").read_text())["channels"]
    (passages,) = (c["passages"] for c in passed.values() if "passages" in c)
    speed, width = (np.array(passages[n]) for n in ("speed_m_s", "patch_width_deg"))
    true = float(np.median(width[np.abs(speed - 22.0) < 0.1]))
    assert fronts < 0.8 * true
    told = fronts * row["contact_width_deg"] / row["patch_width_deg"]
    assert told == pytest.approx(true, rel=0.02)
