"""Closed form: friction from how slip grows with force, against a brush's own."""

import json
from pathlib import Path

import numpy as np
import pytest

from tirelog.cli import run
from tirelog.physics.pressure import Grip, forces
from tirelog.strain.slip import slip_slope

LOAD, HALF, R = 3434.0, 0.058, 0.305


def brushed(friction, ratio, most):
    """(mu, slip) of a brush up to a share `most` of force over load, either sign, (n,)."""
    slip = np.linspace(-0.3, 0.3, 801)[:, None] / ratio
    one, grip = np.ones_like(slip), Grip(friction, 0.75 * friction, ratio)
    mu = forces(LOAD * one, HALF * one, slip, 0.0, 0.0, R, grip)[0][:, 0] / LOAD
    used = np.abs(mu) < most
    return mu[used], slip[used, 0]


@pytest.mark.parametrize(("friction", "ratio"), [(0.8, 1.0), (0.8, 10.0), (0.4, 10.0)])
def test_slope_of_a_brush(friction, ratio):
    mu, slip = brushed(friction, ratio, 0.2)
    told = slip_slope(mu, slip + 2e-3, np.full(mu.size, 1e-5), 10.0 + 0.0 * mu, 0.0 * mu)
    right = pytest.approx(1.0, rel=0.015 if friction > 0.5 else 0.08)
    assert told["slip_slope"] / (3.0 * friction * ratio) == right
    assert told["friction_by_slope"] / (friction * ratio) == right


def test_errors_are_those_of_draws():
    """Noise of slip, a delay that makes slip as the force does, and a radius that grew."""
    rng = np.random.default_rng(2)
    mu, speed = rng.uniform(-0.3, 0.3, 300), rng.uniform(8.0, 25.0, 300)
    z, sizes = [], []
    for _ in range(200):
        late = 2e-4 * np.sign(mu)
        slip = mu / 24.0 + 3e-4 * rng.standard_normal(mu.size) + late * rng.standard_normal()
        slip += 1e-6 * speed**2 * rng.standard_normal()
        told = slip_slope(mu, slip, np.full(mu.size, 3e-4), speed, late)
        z.append((told["slip_slope"] - 24.0) / told["slip_slope_se"])
        sizes.append(told["slip_slope_se"])
    assert 0.85 < np.std(z) < 1.15
    assert abs(np.mean(z)) < 0.25
    assert np.median(sizes) < 2.0


SCENARIO = """
seed = 8
truth = "beam"
[tire]
slip_stiffness_N = 80000.0
[conditions]
load_N = 3434.0
driven = true
[channels.encoder]
kind = "wheel_encoder"
source = "e"
sampling_rate_Hz = 10000.0
[channels.gps]
kind = "vehicle_speed"
source = "v"
sampling_rate_Hz = 100.0
noise = 0.003
[channels.fx]
kind = "longitudinal_force"
source = "fx"
sampling_rate_Hz = 100.0
noise = 30.0
"""


def test_a_log_tells_the_slope_of_its_tire(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    drive = [(6, 12), (8, 16), (4, 16), (8, 20), (4, 20), (5, 8), (4, 8), (10, 16), (6, 6)]
    steps = "".join(f"[[manoeuvres]]\nduration_s = {t}\nspeed_m_s = {v}\n" for t, v in drive)
    Path("road.toml").write_text(SCENARIO + steps)
    assert run(["simulate", "road.toml", "-o", "log.h5", "--quiet"]) == 0
    capsys.readouterr()
    assert run(["slip", "log.h5", "--fit", "--format", "json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)
    off = row["slip_slope"] - 80000.0 / 3434.0
    assert abs(off) < 2.5 * row["slip_slope_se"] < 0.25 * row["slip_slope"]
