"""Property: a row's waveform depends on its conditions alone, not on its neighbours."""

from dataclasses import replace

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.errors import ModelError
from tirelog.physics import Model
from tirelog.physics.effects import BY_ID, Structure
from tirelog.physics.model import laws, stages
from tirelog.physics.model.model import ModelEffect
from tirelog.physics.spectral import Angles

HERE = {
    "speed_m_s": 15.0, "acceleration_m_s2": 1.0, "time_s": 20.0, "load_N": 3300.0,
    "inflation_pressure_Pa": 2.2e5, "temperature_K": 8.0, "distance_km": 9000.0,
    "water_depth_mm": 0.6, "slip": 0.02, "lateral_acceleration_m_s2": 2.0,
}  # fmt: skip
PHI = np.linspace(-np.pi, np.pi, 181)
#: what is looked for at one row's losses alone, and found for others by derivatives
LAGGING = ("viscous_damping", "belt_viscosity", "warm_hysteresis")
EFFECTS = [
    name
    for name, effect in BY_ID.items()
    if "radial_acceleration" in effect.observables and name not in ("ring_curvature", *LAGGING)
]


@pytest.mark.parametrize("carcass", ["ring", "beam"])
@pytest.mark.parametrize("name", EFFECTS)
@pytest.mark.parametrize("observable", ["strain", "radial_acceleration"])
def test_a_row_is_the_same_alone_and_among_others(carcass, name, observable):
    """One condition after the other is changed, beside rows that stay as they were."""
    model = Model.new(carcass, observable)
    if not model.acted_on_by(BY_ID[name], ()):
        pytest.skip("does nothing to this observable")
    strengths = {p.name: p.probe for p in BY_ID[name].parameters if p.name in BY_ID[name].strength}
    model = model.with_effect(name, **strengths)
    for changed, value in HERE.items():
        rows = {key: [x, x, x] for key, x in HERE.items()}
        rows[changed] = [value, 1.1 * value, value]
        conditions = Conditions.of(3, **rows)
        model = model.resolved(conditions)
        together = model.predict(conditions, PHI)
        for i in (0, 1):
            alone = model.predict(conditions.take(slice(i, i + 1)), PHI)[0]
            assert np.abs(together[i] - alone).max() < 1e-9 * np.ptp(alone), changed


def test_an_effect_of_the_user_is_asked_in_every_row():
    """Nobody knows what it reads."""
    own = replace(
        BY_ID["stiffening"],
        id="mine",
        follows=(),
        structure=lambda v, drive: Structure(added_stiffness=v["cubic_1_m2"] * drive.distance_km),
    )
    model = Model.new("ring").with_effect(ModelEffect.of(own), cubic_1_m2=50.0)
    conditions = Conditions.of(2, speed_m_s=15.0, distance_km=[1000.0, 9000.0])
    first, second = model.predict(conditions, PHI)
    assert np.abs(first - second).max() > 1e-3 * np.ptp(first)


N = 90
RNG = np.random.default_rng(5)
SPEED = RNG.uniform(8.0, 20.0, N)
ANGLES = np.linspace(-np.pi, np.pi, 64, endpoint=False) + 0.01 * RNG.standard_normal((N, 64))
SPREAD = np.full((N, 64), 1e-4)


def conditions(**known):
    return Conditions.of(N, **{"speed_m_s": SPEED, "time_s": np.arange(float(N))} | known)


def alone(model, given, **how):
    """The same row by row."""
    rows = [np.array([i]) for i in range(N)]
    return np.concatenate(
        [model.predict(given.take(r), Angles(ANGLES[r], SPREAD[r]), **how) for r in rows]
    )


@pytest.fixture
def computed(monkeypatch):
    """How many rows each waveform was computed of."""
    counts = []
    whole = stages.load_on_carcass

    def counted(task):
        modes = whole(task)
        counts.append(max(modes.shape[0], task.drive.speed_m_s.shape[0]))
        return modes

    monkeypatch.setattr(stages, "load_on_carcass", counted)
    return counts


MODELS = {
    "beam": Model.new("beam"),
    "hardened": Model.new("beam").with_effect("stiffening", cubic_1_m2=3e3),
    "damped": Model.new("beam").with_effect("viscous_damping", damping_rate_1_s=20.0),
    "tense": Model.new("beam").with_effect("belt_tension", tension_N=500.0, tension_mass_kg_m=0.4),
    "late": Model.new("beam").with_effect("sensor_lag", lag_s=4e-4),
    "film": Model.new("beam").with_effect("water_film", amplitude=0.1),
    "ring": Model.new("ring").with_effect("gauge_length", length_m=0.01),
}


@pytest.mark.parametrize("name", MODELS)
def test_rows_of_few_speeds_are_what_they_are_alone(name, computed):
    model, given = MODELS[name], conditions(water_depth_mm=0.5)
    many = model.predict(given, Angles(ANGLES, SPREAD))
    assert max(computed) < N // 2
    one = alone(model, given)
    assert np.abs(many - one).max() < 1e-8 * np.abs(one).max()


@pytest.mark.parametrize("name", ["tread_pitch", "standing_wave", "cavity_resonance"])
def test_so_are_those_that_a_strain_is_added_to_angle_by_angle(name):
    model, given = Model.new("beam").with_effect(name), conditions()
    strengths = {f"{name}.{p}": q.probe for p, q in _parameters(model, name).items()}
    model = model.with_values(strengths)
    one = alone(model, given)
    assert np.abs(model.predict(given, Angles(ANGLES, SPREAD)) - one).max() < 1e-8


def _parameters(model, name):
    (entry,) = [e for e in model.effects if e.id == name]
    return {p.name: p for p in entry.parameters if p.name in entry.effect.strength}


def test_so_are_their_derivatives(monkeypatch):
    model = MODELS["hardened"]
    names = ("foundation_stiffness_N_m2", "patch_half_length_m", "stiffening.cubic_1_m2")
    given = conditions()
    few = model.linearised(given, Angles(ANGLES, SPREAD), names)
    monkeypatch.setattr("tirelog.physics.model.laws.COUNTS", (N,))
    each = model.linearised(given, Angles(ANGLES, SPREAD), names)
    for a, b in zip([few[0], *few[1]], [each[0], *each[1]], strict=True):
        assert np.abs(a - b).max() < 1e-5 * np.abs(b).max()


def test_a_speed_near_the_critical_one_takes_more_speeds_and_one_above_is_refused(computed):
    model, given = Model.new("beam"), conditions(speed_m_s=np.linspace(8.0, 34.5, N))
    many, one = model.predict(given, Angles(ANGLES, SPREAD)), alone(model, given)
    assert np.abs(many - one).max() < 1e-8 * np.abs(one).max()
    assert max(computed) > laws.COUNTS[0]
    above = np.append(SPEED[1:], 60.0)
    with pytest.raises(ModelError):
        model.predict(conditions(speed_m_s=above), ANGLES)
