"""Property: a nuisance changes nothing but what it says, and the seed decides it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from tirelog.simulation import Scenario, Simulated, scenario_of, simulate
from tirelog.simulation.sensors.sampling import tread_angle

from .worlds import tables

ALL: dict[str, Any] = {
    "run_out": {"amplitudes_microstrain": [30.0, 15.0, 8.0], "phases_deg": [10.0, 200.0]},
    "force_variation": {"shares": [0.012, 0.006, 0.004]},
    "load_wander": {"share": 0.03},
    "warming": {"stiffness_per_K": 0.002, "bending_per_K": -0.002, "strain_per_K": 1e-7},
    "rolling_radius": {"error": -0.015, "growth": 0.02},
}


def made_of(truth: str = "beam", noise: float = 0.0008, **more: Any) -> Scenario:
    given = {
        "grid_points": 512,
        "truth": truth,
        "seed": 4,
        "road": {"roughness": 0.01, "load_scatter": 0.01},
        "conditions": {"warm_up_K": 20.0},
        "manoeuvres": [
            {"duration_s": 1.0, "speed_m_s": 9.0},
            {"duration_s": 1.0, "speed_m_s": 19.0},
        ],
        "channels": {
            "s": {"kind": "fbg_strain", "sampling_rate_Hz": 1000.0, "noise": noise},
            "e": {"kind": "vehicle_speed", "sampling_rate_Hz": 100.0, "noise": 0.1},
        },
    }
    return scenario_of(tables(**{**given, **more}))


def values(made: Simulated) -> np.ndarray:
    return made.channels["s"]


@pytest.mark.parametrize("truth", ["beam", "ring"])
@pytest.mark.parametrize("name", ALL)
def test_nuisance_of_size_zero_is_none(truth: str, name: str) -> None:
    sizes = {k: [] if isinstance(v, list) else 0.0 for k, v in ALL[name].items()}
    none = simulate(made_of(truth))
    zero = simulate(made_of(truth, nuisances={name: sizes}))
    some = simulate(made_of(truth, nuisances={name: ALL[name]}))
    assert np.array_equal(values(none), values(zero))
    # a hundredth of a picometre is what a text holds
    assert np.abs(values(none) - values(some)).max() > 1e-5


@pytest.mark.parametrize(
    "more",
    [
        {"effects": [{"name": "splice"}]},
        *({"nuisances": {name: ALL[name]}} for name in ("run_out", "load_wander", "warming")),
    ],
)
def test_what_is_added_changes_neither_noise_nor_the_other_channels(more: dict[str, Any]) -> None:
    """The seed draws road, scatter and noise as without it."""
    (bare, changed), still = (
        [simulate(made_of(noise=noise, **m)) for m in ({}, more)] for noise in (0.0008, 0.0)
    )
    noise = [values(a) - values(b) for a, b in zip((bare, changed), still, strict=True)]
    assert noise[0] == pytest.approx(noise[1], abs=1e-9)
    assert noise[0].std() == pytest.approx(0.0008, rel=0.1)
    assert np.array_equal(bare.channels["e"], changed.channels["e"])


@pytest.mark.parametrize("truth", ["beam", "ring"])
@pytest.mark.parametrize(
    ("more", "limit"),
    [
        ({}, 2e-5),
        ({"road": {"roughness": 0.015}}, 2e-5),
        ({"effects": [{"name": "traction"}]}, 1.2e-4),
        ({"effects": [{"name": "load_transfer"}]}, 2e-5),
        *(
            ({"nuisances": {name: ALL[name]}}, limit)
            for name, limit in (
                ("force_variation", 3e-4),
                ("load_wander", 1e-4),
                ("rolling_radius", 2e-5),
                ("warming", 2e-5),
            )
        ),
    ],
)
def test_samples_are_what_is_true_at_their_instant(
    truth: str, more: dict[str, Any], limit: float
) -> None:
    """Knots and the parabola in the load against solutions at the very instant, over the peak."""
    made = simulate(made_of(truth, **{"grid_points": 2048, "noise": 0.0, "road": {}, **more}))
    w, sensor = made.world, made.scenario.channels["s"]
    time = made.stamp_s["s"][300:-200:41]
    waves = w.waveform(w.solve(w.instants(time, 1.0 + w.fluctuation(time))), sensor)
    turns = np.angle(np.exp(1j * tread_angle(w, sensor, time))) / (2.0 * np.pi)
    place = turns * w.ring.circumference_m
    grid = np.append(w.ring.xi_m, -w.ring.xi_m[0])
    exact = [
        CubicSpline(grid, np.append(wave, wave[0]), bc_type="periodic")(x)
        for wave, x in zip(waves, place, strict=True)
    ] + w.baseline(time, sensor)
    strain = 1.27 * (values(made)[300:-200:41] / 1550.0 - 1.0)
    assert np.abs(strain - exact).max() < limit * np.abs(waves).max()


def test_truth_says_what_was_a_nuisance() -> None:
    assert "nuisances" not in simulate(made_of()).truth
    said = simulate(made_of(nuisances=ALL)).truth["nuisances"]
    assert said["run_out"]["amplitudes_microstrain"] == (30.0, 15.0, 8.0)
    assert said["rolling_radius"]["error"] == -0.015


def test_the_seed_decides_how_a_load_wanders() -> None:
    made = made_of(nuisances={"load_wander": {"share": 0.03}})
    first, again, other = (
        simulate(replace(made, seed=seed)).world.wander(np.arange(2.0)) for seed in (4, 4, 5)
    )
    assert np.array_equal(first, again)
    assert not np.isclose(first, other).any()
