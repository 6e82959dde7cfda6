"""Closed form: each nuisance alone comes out of the simulated log with the size that was stated."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy import signal

from tests.simulation.worlds import instants, scenario, world
from tirelog.simulation import setup_text, simulate
from tirelog.simulation.scenario.schema import Sensor
from tirelog.simulation.sensors.sampling import noise_of
from tirelog.simulation.steady.loads import with_columns
from tirelog.simulation.steady.waveforms import WANDER_STEP_S, wander_of

COARSE = {"grid_points": 512}
CHANNELS = {
    "s": {"kind": "fbg_strain", "angle_deg": 70.0, "sampling_rate_Hz": 1000.0},
    "f": {"kind": "vertical_load", "sampling_rate_Hz": 1000.0},
}
FASTER = [{"duration_s": 1.0, "speed_m_s": 9.0}, {"duration_s": 3.0, "speed_m_s": 21.0}]
SIZES, PHASES = [30.0, 12.0, 5.0], [20.0, 110.0, 290.0]


def driven(**more):
    """Four seconds from 9 to 21 m/s."""
    return simulate(scenario(**{"channels": CHANNELS, "manoeuvres": FASTER, **COARSE, **more}))


def microstrain(made):
    return 1.27e6 * (made.channels["s"] / 1550.0 - 1.0)


def harmonics(made, values):
    """Complex amplitudes of the wheel's first four harmonics in `values` (n,), by least squares."""
    angle = made.world.drive.angle_at(made.stamp_s["s"])
    columns = [f(h * angle) for h in range(1, 5) for f in (np.cos, np.sin)]
    fitted = np.linalg.lstsq(np.stack([np.ones(angle.size), *columns], 1), values, rcond=None)[0]
    return fitted[1::2] + 1j * fitted[2::2]


def stated(sizes):
    """a cos(h angle - phase) has the amplitude a (cos(phase) + i sin(phase))."""
    return np.append(np.array(sizes) * np.exp(1j * np.radians(PHASES)), 0.0)


@pytest.mark.parametrize("truth", ["beam", "ring"])
def test_run_out_is_a_strain_of_the_wheel_s_angle(truth):
    table = {"run_out": {"amplitudes_microstrain": SIZES, "phases_deg": PHASES}}
    more = {"truth": truth, "tire": {"contact": "parabola"}}
    bare, bent = driven(**more), driven(**more, nuisances=table)
    added = microstrain(bent) - microstrain(bare)
    assert np.abs(harmonics(bent, added) - stated(SIZES)).max() < 1e-6
    assert np.array_equal(bare.channels["f"], bent.channels["f"])


def test_run_out_is_late_and_less_by_the_sensor_s_lag():
    """At one speed the h-th harmonic is divided by 1 + i h spin lag."""
    lagging = {"s": {**CHANNELS["s"], "lag_s": 2e-3}, "f": CHANNELS["f"]}
    one = {"channels": lagging, "manoeuvres": [{"duration_s": 2.0, "speed_m_s": 18.0}]}
    table = {"run_out": {"amplitudes_microstrain": SIZES, "phases_deg": PHASES}}
    bare, bent = driven(**one), driven(**one, nuisances=table)
    passed = 1.0 + 1j * np.arange(1, 5) * 18.0 / 0.305 * 2e-3
    # a cos(x - phase) has the complex amplitude a e^(i phase): the conjugate of what turns
    wanted = np.conj(np.conj(stated(SIZES)) / passed)
    added = harmonics(bent, microstrain(bent) - microstrain(bare))
    assert np.abs(added - wanted).max() < 1e-4


def test_force_variation_is_in_the_load_and_in_the_patch():
    shares = [0.03, 0.02, 0.01]
    table = {"force_variation": {"shares": shares, "phases_deg": PHASES}}
    bare, bent = driven(), driven(nuisances=table)
    more = bent.channels["f"] / bare.channels["f"] - 1.0
    assert np.abs(harmonics(bent, more) - stated(shares)).max() < 1e-9
    # where the sensor meets the road the wheel stands at the sensor's angle
    angle = np.radians(70.0)
    there = sum(a * np.cos(h * angle - np.radians(p)) for h, a, p in zip((1, 2, 3), shares, PHASES))
    before, after = (made.truth["channels"]["s"]["passages"] for made in (bare, bent))
    ratio = np.array(after["contact_length_m"]) / np.array(before["contact_length_m"])
    assert ratio == pytest.approx(np.sqrt(1.0 + there), rel=1e-7)
    # and so does the strain: as under that load all the time
    steady = driven(conditions={"load_N": 3434.0 * (1.0 + there)})
    spot = np.searchsorted(bent.stamp_s["s"], np.array(after["time_s"])[2:-2])
    away = microstrain(bare)[spot] - microstrain(steady)[spot]
    assert np.abs(microstrain(bent)[spot] - microstrain(steady)[spot]).max() < (
        0.15 * np.abs(away).max()
    )


def test_wandering_has_its_size_and_forgets_in_its_time():
    made = scenario(
        nuisances={"load_wander": {"share": 0.03, "time_constant_s": 4.0}},
        manoeuvres=[{"duration_s": 2_000.0, "speed_m_s": 10.0}],
    )
    time = np.arange(0.0, 2_000.0, WANDER_STEP_S)
    values = np.array([wander_of(made, np.random.default_rng(s))(time) for s in range(10)])
    # 5,000 time constants: the deviation's own is 1/sqrt(5,000) = 1.4 %, the correlation's 0.02
    assert values.std() == pytest.approx(0.03, rel=0.05)
    for seconds in (2.0, 4.0, 8.0):
        shift = round(seconds / WANDER_STEP_S)
        before, after = values[:, :-shift].ravel(), values[:, shift:].ravel()
        known = np.corrcoef(before, after)[0, 1]
        assert known == pytest.approx(np.exp(-seconds / 4.0), abs=0.06)


def test_load_wanders_and_the_patch_with_it():
    made = driven(nuisances={"load_wander": {"share": 0.05, "time_constant_s": 1.0}})
    load = made.channels["f"]
    assert np.ptp(load) > 0.03 * 3434.0
    passed = made.truth["channels"]["s"]["passages"]
    by_load = 0.116 * np.sqrt(np.array(passed["load_N"]) / 3434.0)
    assert passed["contact_length_m"] == pytest.approx(by_load, rel=1e-7)
    there = np.interp(passed["time_s"], made.stamp_s["f"], load)
    assert passed["load_N"] == pytest.approx(there, rel=1e-4)


def test_revolutions_times_the_true_circumference_are_the_way():
    table = {"rolling_radius": {"error": -0.015, "growth": 0.02, "at_speed_m_s": 25.0}}
    made = driven(nuisances=table)
    drive = made.world.drive
    time = np.linspace(0.0, 4.0, 40_001)
    speed, angle = drive.speed_at(time), drive.angle_at(time)
    radius = 0.305 * 0.985 * (1.0 + 0.02 * (speed / 25.0) ** 2)
    middle = 0.5 * (radius[1:] + radius[:-1])
    assert middle @ np.diff(angle) == pytest.approx(np.trapezoid(speed, time), rel=1e-7)
    assert drive.distance_at(time)[-1] == pytest.approx(np.trapezoid(speed, time), rel=1e-7)
    inside = slice(100, -100)
    slope, wanted = np.gradient(speed, time)[inside], drive.acceleration_at(time)[inside]
    assert np.abs(slope - wanted).max() < 1e-3
    # what the setup says, and what is true
    assert "rolling_radius_m = 0.305\n" in setup_text(made.scenario, {"s": "s", "f": "f"})
    assert made.truth["tire"]["rolling_radius_m"] == pytest.approx(0.305 * 0.985)


@pytest.mark.parametrize(
    ("truth", "contact", "effects"),
    [
        ("beam", "flat_road", ()),
        ("ring", "flat_road", ()),
        ("beam", "flat_road", ("belt_tension", "hysteresis", "ring_down", "rough_contact")),
        ("ring", "parabola", ("stiffening",)),
    ],
)
def test_log_at_one_speed_is_that_of_a_larger_tire(truth, contact, effects):
    """Samples, and all that the truth says of the passages."""
    one = {"truth": truth, "manoeuvres": [{"duration_s": 0.6, "speed_m_s": 25.0}]}
    one["effects"] = [{"name": name} for name in effects]
    lagging = {"angle_deg": 70.0, "sampling_rate_Hz": 1000.0, "lag_s": 3e-4}
    kinds = {"s": "fbg_strain", "a": "radial_acceleration"}
    one["channels"] = {name: {"kind": kind, **lagging} for name, kind in kinds.items()}
    tire: dict[str, Any] = {"contact": contact}
    growing = {"rolling_radius": {"error": 0.01, "growth": 0.02}}
    grown = driven(**one, tire=tire, nuisances=growing)
    larger = driven(**one, tire={**tire, "rolling_radius_m": 0.305 * 1.01 * 1.02})
    for name, limit in (("s", 1e-9), ("a", 1e-6)):
        assert grown.channels[name] == pytest.approx(larger.channels[name], rel=0.0, abs=limit)
    said, wanted = (made.truth["channels"]["s"]["passages"] for made in (grown, larger))
    assert len(said["time_s"]) > 5
    for name in ("time_s", "contact_length_m", "patch_width_deg", "dissipation_factor_1_m"):
        assert said[name] == pytest.approx(wanted[name], rel=1e-7), name


def test_contact_forgets_nothing_that_matters():
    """A ring solved at several instants at once is what it is at each alone."""
    sizes = {"warming": {"stiffness_per_K": 0.004, "pressure_per_K": 0.0034}}
    made = {"truth": "ring", "nuisances": sizes, "manoeuvres": FASTER, **COARSE}
    made["conditions"] = {"warm_up_K": 20.0, "warm_up_time_s": 2.0}
    times = np.array([0.5, 2.0, 3.5])
    together = world(**made)
    found = together.solve(together.instants(times))
    for row, time in enumerate(times):
        alone = world(**made)
        solved = alone.solve(alone.instants(np.array([time])))
        assert found.w[row] == pytest.approx(solved.w[0], rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("truth", ["beam", "ring"])
def test_warm_tire_is_one_with_warm_numbers(truth):
    sizes = {"stiffness_per_K": 0.004, "bending_per_K": -0.003, "pressure_per_K": 0.0034}
    sizes |= {"patch_length_per_K": -0.002} if truth == "beam" else {}
    rise = 12.0
    warm = world(truth=truth, nuisances={"warming": sizes}, **COARSE)
    cold = {
        "flexural_stiffness_N_m2": 4.0 if truth == "beam" else 2.0,
        "foundation_stiffness_N_m2": 2.0e6,
        "radial_stiffness_N_m2": 6.3e5,
        "tangential_stiffness_N_m2": 6.3e5,
    }
    hot = {k: v * (1 + rise * (-0.003 if "flex" in k else 0.004)) for k, v in cold.items()}
    other = world(
        truth=truth,
        tire=hot,
        conditions={"inflation_pressure_Pa": 2.2e5 * (1 + rise * 0.0034)},
        **COARSE,
    )
    at = with_columns(instants(), half_length=np.array([0.058 * (1 - rise * 0.002)]))
    waves = [
        w.waveform(w.solve(with_columns(at, temperature_K=np.array([r]))), Sensor("fbg_strain"))
        for w, r in ((warm, rise), (other, 0.0), (warm, 0.0))
    ]
    assert np.abs(waves[0] - waves[1]).max() < 1e-9 * np.abs(waves[1]).max()
    assert np.abs(waves[2] - waves[1]).max() > 1e-3 * np.abs(waves[1]).max()


def test_warming_shows_in_patch_pressure_and_temperature():
    """Channels follow; the setup has what was true when the log began."""
    gauges = {
        "p": {"kind": "inflation_pressure", "sampling_rate_Hz": 1000.0},
        "t": {"kind": "temperature", "sampling_rate_Hz": 1000.0},
    }
    made = driven(
        channels={"s": CHANNELS["s"], **gauges},
        conditions={"warm_up_K": 20.0, "warm_up_time_s": 2.0},
        nuisances={
            "warming": {
                "patch_length_per_K": -0.002,
                "pressure_per_K": 0.0034,
                "strain_per_K": 1e-7,
            }
        },
    )
    rise = 20.0 * -np.expm1(-made.stamp_s["p"] / 2.0)
    assert made.channels["t"] == pytest.approx(20.0 + rise, rel=1e-9)
    assert made.channels["p"] == pytest.approx(2.2e5 * (1.0 + 0.0034 * rise), rel=1e-9)
    assert "inflation_pressure_Pa = 220000.0" in setup_text(
        made.scenario, {"s": "s", "p": "p", "t": "t"}
    )
    passed = made.truth["channels"]["s"]["passages"]
    warm = 20.0 * -np.expm1(-np.array(passed["time_s"]) / 2.0)
    assert passed["contact_length_m"] == pytest.approx(0.116 * (1.0 - 0.002 * warm), rel=1e-8)
    baseline = made.world.baseline(np.array([4.0]), Sensor("fbg_strain"))
    assert baseline[0] == pytest.approx(1e-7 * 20.0 * -np.expm1(-2.0))


def test_coloured_noise_has_the_size_of_white_and_remembers():
    sensor = Sensor("fbg_strain", noise=0.8, noise_correlation=0.9)
    values = noise_of(sensor, 400_000, np.random.default_rng(2))
    assert values.std() == pytest.approx(0.8, rel=0.02)
    for shift in (1, 5):
        known = np.corrcoef(values[:-shift], values[shift:])[0, 1]
        assert known == pytest.approx(0.9**shift, abs=0.01)


def test_hum_is_a_line_and_half_of_it_at_the_double():
    sensor = Sensor("fbg_strain", sampling_rate_Hz=2500.0, hum=3.0, hum_Hz=50.0)
    values = noise_of(sensor, 25_000, np.random.default_rng(2))
    lines = np.abs(np.fft.rfft(values)) / 12_500.0
    assert lines[[500, 1000]] == pytest.approx([3.0, 1.5], rel=1e-9)
    assert np.delete(lines, [500, 1000]).max() < 1e-9


def test_flicker_falls_as_one_over_the_frequency():
    sensor = Sensor("fbg_strain", sampling_rate_Hz=1000.0, flicker=4.0)
    values = noise_of(sensor, 2**19, np.random.default_rng(2))
    assert values.std() == pytest.approx(4.0, rel=1e-9)
    frequency, power = signal.welch(values, 1000.0, nperseg=2**13)
    some = (frequency > 2.0) & (frequency < 300.0)
    slope = np.polyfit(np.log(frequency[some]), np.log(power[some]), 1)[0]
    assert slope == pytest.approx(-1.0, abs=0.05)


def test_peaks_are_lost_at_the_flanks_alone():
    steep = {"s": {**CHANNELS["s"], "lost_at_flanks": 0.3}, "f": CHANNELS["f"]}
    made, whole = driven(channels=steep), driven()
    speed = made.world.drive.speed_at(made.stamp_s["s"])
    slope = np.abs(np.gradient(microstrain(whole))) / speed
    flank = slope > 0.5 * np.quantile(slope, 0.999)
    lost = np.isnan(made.channels["s"])
    assert not lost[~flank].any()
    # 3 deviations of a share of so many
    assert lost[flank].mean() == pytest.approx(0.3, abs=3.0 * np.sqrt(0.21 / flank.sum()))
    assert flank.sum() > 100
