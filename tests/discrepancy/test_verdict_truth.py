"""A verdict is true as a sentence: "the noise floor" only where held-out error and chi-square say so.  Truth by `simulate`."""

from dataclasses import replace

import numpy as np
import pytest

from tirelog.discrepancy import diagnose, stacks_from_logs
from tirelog.discrepancy.comparison import start
from tirelog.discrepancy.selection import least_p
from tirelog.discrepancy.separation import ALLOWED, driven
from tirelog.discrepancy.wording import probability
from tirelog.physics.model import Model
from tirelog.simulation import simulate, to_recording
from tirelog.simulation.scenario import Road, TrueConditions
from tirelog.simulation.scenarios import Case, case, planted

MODEL = Model.new("beam", radius_m=0.305)


def stacks(scenarios):
    return stacks_from_logs([to_recording(simulate(log), f"log_{i}") for i, log in enumerate(scenarios)])


@pytest.fixture(scope="module")
def two_pressures():
    """A patch that shrinks with the pressure, which no part of the model does."""
    logs = case((), seed=211, how=Case(plan="short", logs=2))
    return stacks(
        replace(
            log,
            conditions=TrueConditions(inflation_pressure_Pa=pressure),
            tire=replace(log.tire, patch_half_length_m=half),
        )
        for log, pressure, half in zip(logs, (2.2e5, 1.6e5), (0.0564, 0.0620), strict=True)
    )


def test_a_patch_that_follows_the_pressure_is_not_the_noise_floor(two_pressures):
    result = diagnose(two_pressures, MODEL)
    assert result.verdict == "unknown"
    assert result.unexplained["follows"] == "pressure"
    assert "noise floor" not in result.sentence
    assert "First check what the setups say of load, pressure" in result.sentence


def test_a_load_that_wanders_on_the_road_is_scatter_and_said_with_its_size():
    logs = case((), seed=212, how=Case(plan="short", logs=2))
    result = diagnose(stacks(replace(log, road=Road(roughness=0.03, correlation_m=48.0)) for log in logs), MODEL)
    assert result.selected == ()
    assert result.verdict in ("nothing_missing", "scatter")
    quiet = result.rmse_heldout_before <= 1.05 * result.noise_floor and result.reduced_chi2_before <= 1.2
    assert (result.verdict == "nothing_missing") == quiet
    if result.verdict == "scatter":
        assert result.unexplained["scatter"]["size"] > 0.0
        assert "microstrain" in result.sentence
        assert "noise floor" not in result.sentence


def test_tension_over_inertia_is_found_and_what_stands_at_a_bound_stays_there():
    tight = planted({"belt_tension": {"tension_mass_kg_m": 9.0, "stretch_s2_m2": 0.0}})
    measured = stacks(replace(log, effects=tight) for log in case((), seed=213, how=Case(plan="short", logs=2)))
    base = start(measured, MODEL)
    assert "flexural_stiffness_N_m2" in base.fit.held
    assert base.square_held > 0.98 * base.square_fit  # left out, the data fit no better than when they are in
    result = diagnose(measured, MODEL)
    assert result.verdict in ("missing", "partial", "ambiguous", "unknown")
    assert set(result.selected) <= {"belt_tension"}
    shown = {c.effect: c for c in result.effects}
    assert shown["belt_tension"].excess_removed > 0.9
    assert not set(shown) & set(result.not_tested)


def test_tension_of_inflation_grows_with_the_pressure_of_the_log(two_pressures):
    conditions = start(two_pressures, MODEL).cells.conditions.take(np.arange(2))
    tight = MODEL.with_effect("belt_tension", tension_N=1000.0)
    phi = np.linspace(-0.5, 0.5, 64)
    soft = replace(conditions, inflation_pressure_Pa=np.full(2, 1.1e5))
    assert tight.predict(soft, phi) == pytest.approx(MODEL.with_effect("belt_tension", tension_N=500.0).predict(conditions, phi), rel=1e-12)


def test_what_the_logs_hold_is_not_advised(two_pressures):
    base = start(two_pressures, MODEL)
    speeds = base.cells.conditions.speed_m_s
    near = {m.name: driven(base, m) for m in ALLOWED}
    assert near["cruise at 15 m/s"] == bool(np.any((np.abs(speeds - 15.0) < 1.5) & (np.abs(base.cells.conditions.acceleration_m_s2) < 0.2)))
    assert not near["brake 25 to 9 m/s at 4 m/s^2"]
    assert not near["cruise at 15 m/s with 40 % more load"]
    assert not near["cruise at 15 m/s after ten minutes"]


def test_a_probability_at_its_least_is_at_most_that():
    assert least_p(8) == 2.0**-8
    assert probability(2.0**-8, 8) == "<= 0.0039"
    assert probability(1.0 / 16384, 40) == "<= 6.1e-05"
    assert probability(0.02, 40) == "0.02"
