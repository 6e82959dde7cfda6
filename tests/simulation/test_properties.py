"""Property: zero is off, forms differ, samples are what is true, seeds decide everything."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from benchmarks.cases import IN_CATALOGUE, OUTSIDE, Case, case
from tests.simulation.worlds import instants, scenario, world
from tirelog.simulation import simulate
from tirelog.simulation.scenario.schema import PLANTABLE, Sensor
from tirelog.simulation.sensors.sampling import tread_angle
from tirelog.simulation.steady.loads import with_columns
from tirelog.simulation.steady.waveforms import roughness_of

DRIVE = [
    {"duration_s": 1.5, "speed_m_s": 9.0},
    {"duration_s": 3.0, "speed_m_s": 21.0},
    {"duration_s": 2.0, "speed_m_s": 14.0},
]
#: parameters whose zero means off, where the first alone does not
SIZES = {
    "belt_tension": ("tension_N", "tension_mass_kg_m", "stretch_s2_m2"),
    "wear": ("amplitude", "lever_loss"),
    "thermal_drift": ("drift", "stiffness"),
}
NOT_IN_A_STRAIN = {
    "speed_trend", "load_crosstalk", "telemetry_delay", "tooth_pitch", "inflation",
    "rough_contact", "gauge_length", "sensor_tilt",
}  # fmt: skip
STRAIN_EFFECTS = [name for name in PLANTABLE if name not in NOT_IN_A_STRAIN]
#: effects of the catalogue whose other form is another waveform (not another course in time or
#: speed)
SHAPED = [
    n
    for n in STRAIN_EFFECTS
    if "other" in PLANTABLE[n].forms and n not in ("load_transfer", "aero_load", "thermal_drift")
]


def strain(made):
    return 1.27 * (made.channels["s"] / 1550.0 - 1.0)


def clean(**more):
    return scenario(manoeuvres=DRIVE, **more)


def test_same_seed_same_log_other_seed_other_log():
    noisy = {"s": {"kind": "fbg_strain", "noise": 0.0008, "lost_fraction": 0.01}}
    road, wander = {"roughness": 0.01, "load_scatter": 0.01}, {"load_wander": {"share": 0.03}}
    made = clean(seed=4, channels=noisy, road=road, nuisances=wander)
    logs = [simulate(s) for s in (made, made, replace(made, seed=5))]
    first, again, other = (log.channels["s"] for log in logs)
    assert np.array_equal(first, again, equal_nan=True)
    assert not np.array_equal(first, other, equal_nan=True)
    assert 0.003 < np.isnan(first).mean() < 0.03
    first, again, other = (log.world.wander(np.arange(2.0)) for log in logs)
    assert np.array_equal(first, again)
    assert not np.isclose(first, other).any()


@pytest.mark.parametrize(
    ("name", "form"), [(n, f) for n in STRAIN_EFFECTS for f in PLANTABLE[n].forms]
)
def test_strength_zero_is_the_base(name, form):
    sizes = SIZES.get(name, (next(iter(PLANTABLE[name].parameters)),))
    conditions = {"distance_km": 20000.0, "water_depth_mm": 1.0, "warm_up_K": 40.0}
    conditions["inflation_pressure_Pa"] = 2.5e5
    sensor, time, planted = Sensor("fbg_strain"), np.array([3.0]), {"name": name, "form": form}
    waves = []
    for effects in ([], [planted | dict.fromkeys(sizes, 0.0)], [planted]):
        w = world(conditions=conditions, manoeuvres=DRIVE, effects=effects)
        waves.append(w.waveform(w.solve(w.instants(time)), sensor)[0] + w.baseline(time, sensor))
    peak = np.abs(waves[0]).max()
    assert np.abs(waves[1] - waves[0]).max() < 1e-12 * peak + 1e-18
    assert np.abs(waves[2] - waves[0]).max() > 1e-3 * peak


@pytest.mark.parametrize("name", SHAPED)
def test_other_form_is_another_shape_of_like_size(name):
    conditions = {"distance_km": 20000.0, "water_depth_mm": 1.0}
    at = with_columns(instants(slip=0.06), distance_km=20000.0, water_depth_mm=1.0)
    base, exact, other = (
        w.waveform(w.solve(at), Sensor("fbg_strain"))[0]
        for w in (
            world(conditions=conditions, effects=e)
            for e in ([], [{"name": name}], [{"name": name, "form": "other"}])
        )
    )
    size, change = np.std(exact - base), np.std(other - exact)
    assert 0.6 < np.std(other - base) / size < 1.6
    assert change < 0.5 * size
    assert change > (0.02 if name == "sensor_lag" else 0.15) * size


def test_roughness_has_its_size_and_reach():
    made = scenario(
        manoeuvres=[{"duration_s": 400.0, "speed_m_s": 20.0}], road={"roughness": 0.02}, seed=3
    )
    rough = roughness_of(made, 8000.0, np.random.default_rng(3))
    distance = np.arange(0.0, 7990.0, 0.25)
    values = rough(distance)
    assert values.std() == pytest.approx(0.02, rel=0.06)
    correlation = [np.corrcoef(values[:-lag], values[lag:])[0, 1] for lag in (4, 40)]  # 1 m, 10 m
    assert 0.6 < correlation[0] < 0.95
    assert abs(correlation[1]) < 0.15


def test_dissipation_factor_is_the_time_integral():
    """int eps'^2 ds = (1/c) int (d eps/dt)^2 dt over a revolution (errata)."""
    made = simulate(scenario(channels={"s": {"kind": "fbg_strain", "sampling_rate_Hz": 25000.0}}))
    times = np.array(made.truth["channels"]["s"]["passages"]["time_s"])
    stamps, rate = made.stamp_s["s"], np.gradient(strain(made), 1 / 25000.0)
    middle = 0.5 * (times[:-1] + times[1:])
    inside = (stamps >= middle[3]) & (stamps < middle[4])
    integral = (rate[inside] ** 2).sum() / 25000.0 / 18.0
    assert made.truth["channels"]["s"]["passages"]["dissipation_factor_1_m"][4] == pytest.approx(
        integral, rel=2e-3
    )


ALL = {
    "run_out": {"amplitudes_microstrain": [30.0, 15.0, 8.0], "phases_deg": [10.0, 200.0]},
    "force_variation": {"shares": [0.012, 0.006, 0.004]},
    "load_wander": {"share": 0.03},
    "warming": {"stiffness_per_K": 0.002, "bending_per_K": -0.002, "strain_per_K": 1e-7},
    "rolling_radius": {"error": -0.015, "growth": 0.02},
}


def made_of(truth="beam", noise=0.0008, **more):
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
    return scenario(**{**given, **more})


def values(made):
    return made.channels["s"]


@pytest.mark.parametrize("truth", ["beam", "ring"])
@pytest.mark.parametrize("name", ALL)
def test_nuisance_of_size_zero_is_none(truth, name):
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
def test_what_is_added_changes_neither_noise_nor_the_other_channels(more):
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
def test_samples_are_what_is_true_at_their_instant(truth, more, limit):
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
    assert np.abs(strain(made)[300:-200:41] - exact).max() < limit * np.abs(waves).max()


def test_truth_says_what_was_a_nuisance():
    assert "nuisances" not in simulate(made_of()).truth
    said = simulate(made_of(nuisances=ALL)).truth["nuisances"]
    assert said["run_out"]["amplitudes_microstrain"] == (30.0, 15.0, 8.0)
    assert said["rolling_radius"]["error"] == -0.015


@pytest.mark.parametrize("name", [*IN_CATALOGUE, *OUTSIDE])
def test_every_effect_shows_and_is_told(name):
    """It moves the strain by more than its noise somewhere, in both forms."""
    for form in PLANTABLE[name].forms:
        how = Case(plan="short", logs=2, form=form, noise_nm=0.0, roughness=0.0, duration=0.35)
        with_effect, without = (simulate(case(e, seed=8, how=how)[1]) for e in ((name,), ()))
        change = 1.27 / 1550.0 * (with_effect.channels["strain_1"] - without.channels["strain_1"])
        assert 4e-6 < change.std() < 2e-4
        told = with_effect.truth["effects"]
        assert [(e["name"], e["form"], e["in_catalogue"]) for e in told] == [
            (name, form, name in IN_CATALOGUE)
        ]
        planted = with_effect.scenario.effects[0]
        assert told[0]["strength"] == planted[next(iter(planted.parameters))]
        if name in OUTSIDE:
            assert told[0]["where"] in ("entry", "patch", "exit", "away")
            assert told[0]["parity"] in ("even", "odd", "mixed")
