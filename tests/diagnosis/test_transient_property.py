"""Property: hits on an obstacle and masses are found within their errors."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from tests.diagnosis.toy import stack_of
from tirelog.data.recording import Channel, Conditions, Recording, TimeAxis
from tirelog.data.setup import RoadSetup, Setup
from tirelog.diagnosis.obstacles import compare_transients, fit_hit, learn_motion, motion_at
from tirelog.errors import UsageError
from tirelog.inference.measured import (
    TransientLog,
    around,
    motion_names,
    steady_revolutions,
    transient_log,
    without_motion_parameters,
)
from tirelog.inference.stacks.align import PassageAngle
from tirelog.physics import Model

pytestmark = pytest.mark.xdist_group("a hit")  # one worker makes what these tests share

RATE, SPIN, NOISE = 2500.0, 50.0, 1e-6
MODEL = Model.new(
    "coupled_ring", load_N=3434.0, radius_m=0.305, inflation_pressure_Pa=2.2e5, width_m=0.14,
    lever_arm_m=3e-4, radial_damping_N_s_m2=150.0, tangential_damping_N_s_m2=150.0,
)  # fmt: skip
ROAD = RoadSetup(kind="cleat", height_m=0.006, length_m=0.04)


def made(hit_s, seed):
    """A log of the model itself: 3.5 s at constant spin, a hit at `hit_s`, white noise."""
    still = noiseless(hit_s)
    values = still.values + np.random.default_rng(seed).normal(0.0, NOISE, still.values.size)
    return around(replace(still, values=values), hit_s)


@cache
def noiseless(hit_s, phase=0.7):
    """The log before the noise; solved once for all seeds."""
    time = np.arange(round(3.5 * RATE)) / RATE
    passages = (np.arange(30) * 2.0 * np.pi + phase) / SPIN
    conditions = Conditions.of(passages.size, speed_m_s=0.305 * SPIN, load_N=3434.0)
    conditions = replace(conditions, time_s=passages)
    flat = TransientLog(
        "made.csv", "groove", "outer", "strain", 0.305, ROAD, "", conditions, time,
        np.zeros(time.size), passages, np.arange(passages.size) * 1.0,
        PassageAngle.through(passages), CubicSpline([0.0, 1.0], [0.0, 0.0]), SPIN,
        np.ones(time.size, bool), np.array([hit_s]),
        RATE,
    )  # fmt: skip
    transient, reached = motion_at(flat, MODEL, hit_s, 0.5)
    motion, when = transient.motion, time - hit_s + reached
    theta = SPIN * hit_s - phase - np.interp(reached, motion.time_s, motion.psi_rad)
    # the wheel turns steadily, swings as the motion does, and turns steadily on
    first, last = motion.time_s[[0, -1]]
    steady = np.minimum(when - first, 0.0) + np.maximum(when - last, 0.0)
    angle = np.interp(when, motion.time_s, motion.psi_rad) + theta + SPIN * steady
    passages = np.interp(
        2.0 * np.pi * np.arange(np.ceil(angle[0] / 6.3), np.floor(angle[-1] / 6.3)), angle, time
    )
    values = MODEL.predict(transient.conditions, np.mod(angle + np.pi, 2.0 * np.pi) - np.pi)[0]
    inside = (when >= first) & (when <= last)
    values[inside] = transient.sensed("strain", theta, when[inside])
    flat = replace(
        flat,
        passages_s=passages,
        turns=np.arange(passages.size) * 1.0,
        wheel=PassageAngle.through(passages),
    )
    calm = (time < hit_s - 0.15) | (time > hit_s + 0.65)
    return replace(flat, values=values, calm=calm)


@pytest.mark.slow
def test_a_hit_that_was_put_in_is_found_with_the_error_that_is_said():
    misses = []
    for seed in range(3):
        true = 1.5 + 0.0137 * seed
        log = made(true, seed)
        hit = fit_hit(log, MODEL, true + 0.004 * (seed - 3))
        misses.append((hit.time_s - true) / hit.time_se_s)
        assert hit.time_s == pytest.approx(true, abs=5e-6)
        assert abs(hit.phase_rad) < 3e-4
        assert np.std(hit.missed) < 1.3 * NOISE < 0.1 * np.std(hit.added)
    assert (
        np.sqrt(np.mean(np.square(misses))) < 4.0
    )  # the wheel's swing is not the motion's to the last


def test_what_the_model_covers_and_the_floor():
    log = made(1.61, 11)
    result = compare_transients([log], MODEL, unit="1")
    (row,) = result.rows()
    assert row["covered"] > 0.97
    assert row["noise_floor"] == pytest.approx(NOISE, rel=0.1)
    assert row["rmse_steady"] == pytest.approx(NOISE, rel=0.15)
    other = MODEL.with_values({"tangential_stiffness_N_m2": 2.0e6, "radial_stiffness_N_m2": 1.2e6})
    (worse,) = compare_transients([log], other, unit="1").rows()
    assert worse["missed"] > 3.0 * row["missed"]
    assert worse["covered"] < row["covered"] - 0.2


@pytest.mark.slow
def test_another_event_is_said_to_be_unlike():
    log = made(1.55, 4)
    rng = np.random.default_rng(5)
    burst = (log.time_s > 1.55) & (log.time_s < 1.7)
    quiet = made(3.2, 4)
    values = np.where(burst, quiet.values + 5e-5 * rng.normal(size=log.time_s.size), quiet.values)
    strange = around(replace(quiet, values=values, calm=log.calm, hits_s=np.array([1.55])), 1.55)
    result = compare_transients([strange], MODEL, unit="1")
    assert result.rows()[0]["quality"] == "unlike"
    assert "little of what happened at" in result.remarks[0]


def recording(values, road):
    channel = Channel.of_array("groove", "strain", values, TimeAxis.uniform(values.size, RATE))
    passages = (np.arange(27) * 2.0 * np.pi + 0.7) / SPIN
    n = passages.size
    conditions = Conditions.of(n, speed_m_s=0.305 * SPIN, load_N=3434.0)
    stack = stack_of(
        channel="groove",
        radius_m=0.305,
        values=np.zeros((n, 4)),
        noise=1.0,
        conditions=replace(conditions, time_s=passages),
        manoeuvre=np.zeros(n, int),
        logs=("made.csv",),
    )
    return Recording("made.csv", {"groove": channel}, Setup(road=road)), channel, stack


def test_outbursts_are_seen_in_the_log_and_their_revolutions_kept_apart():
    log = made(1.61, 21)
    found = transient_log(*recording(log.values, ROAD))
    assert found.hits_s == pytest.approx([1.61], abs=0.03)
    stack = recording(log.values, ROAD)[2]
    left = steady_revolutions(stack, found.hits_s).conditions.time_s
    assert left.size > 15
    assert not np.any((left > 1.6) & (left < 2.1))


def test_a_place_that_the_setup_gives_is_taken():
    log = made(1.61, 22)
    for road in (replace(ROAD, time_s=1.0), replace(ROAD, position_m=1.0 * SPIN * 0.305)):
        assert transient_log(*recording(log.values, road)).hits_s == pytest.approx([1.0], abs=1e-3)
    twice = transient_log(
        *recording(log.values, replace(ROAD, time_s=0.81, spacing_m=0.8 * SPIN * 0.305))
    ).hits_s
    assert twice == pytest.approx([0.81, 1.61, 2.41], abs=0.03)


def test_a_log_without_an_obstacle_or_without_calm():
    calm = made(3.3, 23).values[: round(3.0 * RATE)]
    with pytest.raises(
        UsageError, match=r"no obstacle in channel groove .*cleat; .*needed; give time_s"
    ):
        transient_log(*recording(calm, ROAD))
    log = made(1.61, 24)
    with pytest.raises(
        UsageError, match=r"steady revolutions beside the obstacles .*needed .*; give a log"
    ):
        transient_log(
            *recording(log.values, replace(ROAD, time_s=0.3, spacing_m=0.55 * SPIN * 0.305))
        )


def test_passages_that_an_obstacle_hid_are_counted_on():
    log = made(1.61, 31)
    recorded, channel, stack = recording(log.values, ROAD)
    hidden = (stack.conditions.time_s > 1.6) & (stack.conditions.time_s < 2.2)
    found = transient_log(recorded, channel, stack.take(~hidden))
    assert np.diff(found.turns).max() == 1 + hidden.sum()
    assert found.wheel.theta(np.array([0.7 / SPIN, 2.9]))[1] == pytest.approx(
        2.9 * SPIN - 0.7, abs=1e-6
    )
    assert found.hits_s == pytest.approx([1.61], abs=0.03)


def freed(*names):
    return MODEL.with_parameters(
        {name: replace(MODEL.parameters[name], free=True) for name in names}
    )


@pytest.mark.slow
def test_a_line_mass_that_is_off_is_found():
    start = freed("line_mass_kg_m").with_values(
        {"line_mass_kg_m": 1.08 * MODEL.values["line_mass_kg_m"]}
    )
    learned = learn_motion([made(1.61, 3)], start)
    mass = learned.model.parameters["line_mass_kg_m"]
    assert learned.names == ("line_mass_kg_m",)
    assert mass.value == pytest.approx(MODEL.values["line_mass_kg_m"], rel=2e-3)
    assert mass.se is not None
    assert abs(mass.value - MODEL.values["line_mass_kg_m"]) < 6.0 * mass.se
    assert learned.after < 1.3 * NOISE < 0.2 * learned.before


def test_the_steady_waveform_is_fitted_without_them():
    model = freed("line_mass_kg_m", "hub_mass_kg", "radial_damping_N_s_m2")
    assert set(motion_names(model)) == {"line_mass_kg_m", "hub_mass_kg", "radial_damping_N_s_m2"}
    assert without_motion_parameters(model).free == MODEL.free
    assert motion_names(MODEL) == ()


def test_nothing_free_is_said():
    with pytest.raises(
        UsageError,
        match=r"no free parameter that a motion tells; allowed are hub_mass_kg.*; free one",
    ):
        learn_motion([], MODEL)
