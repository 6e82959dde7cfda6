"""Property: what a new model frees is seen in what it predicts."""

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.physics import Model
from tirelog.vocabulary.observables import OBSERVABLES, WAVEFORMS

CONDITIONS = Conditions.of(
    2, speed_m_s=np.array([12.0, 25.0]), acceleration_m_s2=np.array([-1.0, 2.0]), time_s=1.0,
    load_N=np.array([3500.0, 3900.0]), inflation_pressure_Pa=2.2e5,
)  # fmt: skip
PHI = np.linspace(-np.pi, np.pi, 181)


@pytest.mark.parametrize("carcass", ["beam", "ring"])
@pytest.mark.parametrize("observable", OBSERVABLES)
def test_every_free_parameter_changes_the_prediction(carcass: str, observable: str) -> None:
    model = Model.new(carcass, observable)
    angles = PHI if observable in WAVEFORMS else None
    slopes = model.linearised(CONDITIONS, angles, model.free)[1]
    moved = np.abs(slopes).max(axis=(1, 2))
    assert [name for name, move in zip(model.free, moved, strict=True) if move == 0.0] == []
