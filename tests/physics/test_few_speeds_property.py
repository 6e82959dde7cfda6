"""Property: rows that differ in speed alone are what each of them is by itself, though all come of
a few speeds."""

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.errors import ModelError
from tirelog.physics import Model
from tirelog.physics.model import laws, stages
from tirelog.physics.spectral import Angles

N = 90
RNG = np.random.default_rng(5)
SPEED = RNG.uniform(8.0, 20.0, N)
PHI = np.linspace(-np.pi, np.pi, 64, endpoint=False) + 0.01 * RNG.standard_normal((N, 64))
SPREAD = np.full((N, 64), 1e-4)


def conditions(**known):
    return Conditions.of(N, **{"speed_m_s": SPEED, "time_s": np.arange(float(N))} | known)


def alone(model, given, **how):
    """The same row by row."""
    rows = [np.array([i]) for i in range(N)]
    return np.concatenate(
        [model.predict(given.take(r), PHI[r], phi_variance=SPREAD[r], **how) for r in rows]
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
    many = model.predict(given, PHI, phi_variance=SPREAD)
    assert max(computed) < N // 2
    one = alone(model, given)
    assert np.abs(many - one).max() < 1e-8 * np.abs(one).max()


@pytest.mark.parametrize("name", ["tread_pitch", "standing_wave", "cavity_resonance"])
def test_so_are_those_that_a_strain_is_added_to_angle_by_angle(name):
    model, given = Model.new("beam").with_effect(name), conditions()
    strengths = {f"{name}.{p}": q.probe for p, q in _parameters(model, name).items()}
    model = model.with_values(strengths)
    one = alone(model, given)
    assert np.abs(model.predict(given, PHI, phi_variance=SPREAD) - one).max() < 1e-8


def _parameters(model, name):
    (entry,) = [e for e in model.effects if e.id == name]
    return {p.name: p for p in entry.parameters if p.name in entry.effect.strength}


def test_so_are_their_derivatives(monkeypatch):
    model = MODELS["hardened"]
    names = ("foundation_stiffness_N_m2", "patch_half_length_m", "stiffening.cubic_1_m2")
    given = conditions()
    few = model.linearised(given, Angles(PHI, SPREAD), names)
    monkeypatch.setattr("tirelog.physics.model.laws.COUNTS", (N,))
    each = model.linearised(given, PHI, names, phi_variance=SPREAD)
    for a, b in zip([few[0], *few[1]], [each[0], *each[1]], strict=True):
        assert np.abs(a - b).max() < 1e-5 * np.abs(b).max()


def test_a_speed_near_the_critical_one_takes_more_speeds_and_one_above_is_refused(computed):
    model, given = Model.new("beam"), conditions(speed_m_s=np.linspace(8.0, 34.5, N))
    many, one = model.predict(given, PHI, phi_variance=SPREAD), alone(model, given)
    assert np.abs(many - one).max() < 1e-8 * np.abs(one).max()
    assert max(computed) > laws.COUNTS[0]
    above = np.append(SPEED[1:], 60.0)
    with pytest.raises(ModelError):
        model.predict(conditions(speed_m_s=above), PHI)
