"""Property: rows that are alike to belt and load are computed once, and what a row's waveform is
depends on that row's conditions alone, whatever the rows beside it.
"""

from dataclasses import replace

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.physics import Model
from tirelog.physics.effects import BY_ID, Structure
from tirelog.physics.model.model import ModelEffect

HERE = {
    "speed_m_s": 15.0, "acceleration_m_s2": 1.0, "time_s": 20.0, "load_N": 3300.0,
    "inflation_pressure_Pa": 2.2e5, "temperature_K": 8.0, "distance_km": 9000.0,
    "water_depth_mm": 0.6, "slip": 0.02,
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
