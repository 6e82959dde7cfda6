"""Property: a comparison remarks when a log or a number leaves the range of an effect."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.toy import stack
from tirelog.data.recording import Conditions
from tirelog.diagnosis.candidates.assessment import out_of_range
from tirelog.diagnosis.compare import compare
from tirelog.physics import Model


def remarks(model, revolutions, **conditions):
    n = len(revolutions)
    cells = SimpleNamespace(
        conditions=Conditions.of(n, **conditions), revolutions=np.array(revolutions)
    )
    return out_of_range(SimpleNamespace(model=model, cells=cells))  # type: ignore[arg-type]


TREND = Model.new("beam", "phase_shift").with_effect("speed_trend", linear_rad=0.01)
OFF = Model.new("beam", "phase_shift").with_effect("speed_trend")
WORN = Model.new("beam").with_effect("wear", amplitude=0.3)
LOSSY = Model.new("beam").with_effect("hysteresis", loss_factor=0.7)


@pytest.mark.parametrize(
    ("model", "revolutions", "conditions", "said"),
    [
        (TREND, (5, 30, 38, 7), {"speed_m_s": [8.0, 10.0, 25.0, 30.0]},
         "speed_trend is valid for speed from 10 to 25 m/s; 12 of 80 revolutions are outside, by "
         "means of similar ones"),
        (TREND, (5, 7), {"speed_m_s": [10.0, 25.0]}, ""),
        (OFF, (5, 5), {"speed_m_s": [8.0, 30.0]}, ""),
        (WORN, (5, 5), {"speed_m_s": [8.0, 30.0]}, ""),  # at distances that are not known
        (WORN, (5, 5), {"speed_m_s": [8.0, 30.0], "distance_km": [1e3, 5e4]},
         "wear is valid for tread distance from 0 to 40000 km; 5 of 10"),
        (LOSSY, (5,), {"speed_m_s": 10.0},
         "hysteresis is valid for loss_factor from 0 to 0.5; its value is 0.7"),
        (LOSSY.with_values({"hysteresis.loss_factor": 0.5}), (5,), {"speed_m_s": 10.0}, ""),
    ],
)  # fmt: skip
def test_what_is_outside_is_said(model, revolutions, conditions, said):
    known = {name: np.array(values) for name, values in conditions.items()}
    found = remarks(model, revolutions, **known)
    assert len(found) == bool(said)
    assert not said or found[0].startswith(said)


def test_compare_says_it():
    measured = stack(3, manoeuvres=3, m=64)
    conditions = replace(measured.conditions, distance_km=np.full(len(measured), 5e4))
    model = Model.new("beam").with_effect("wear", amplitude=0.3)
    held = {name: p.fixed() for name, p in model.parameters.items() if name != "lever_arm_m"}
    result = compare([replace(measured, conditions=conditions)], model.with_parameters(held))
    found = [r for r in result.remarks if r.startswith("wear is valid")]
    assert len(found) == 1
    assert "36 of 36 revolutions are outside" in found[0]
