"""Property: a comparison remarks when a log or a number leaves the range of an effect."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from tests.diagnosis.toy import stack
from tirelog.data.recording import Conditions
from tirelog.diagnosis.candidates.assessment import out_of_range
from tirelog.diagnosis.compare import compare
from tirelog.physics import Model


def remarks(model: Model, revolutions: tuple[int, ...], **conditions: object) -> list[str]:
    n = len(revolutions)
    cells = SimpleNamespace(
        conditions=Conditions.of(n, **conditions), revolutions=np.array(revolutions)
    )
    return out_of_range(SimpleNamespace(model=model, cells=cells))  # type: ignore[arg-type]


def test_revolutions_outside_are_counted() -> None:
    model = Model.new("beam", "phase_shift").with_effect("speed_trend", linear_rad=0.01)
    speed = np.array([8.0, 10.0, 25.0, 30.0])
    assert remarks(model, (5, 30, 38, 7), speed_m_s=speed) == [
        "speed_trend is valid for speed from 10 to 25 m/s; 12 of 80 revolutions are outside, by "
        "means of similar ones"
    ]
    assert remarks(model, (5, 7), speed_m_s=np.array([10.0, 25.0])) == []


def test_what_is_off_or_not_known_leaves_no_range() -> None:
    speed = np.array([8.0, 30.0])
    off = Model.new("beam", "phase_shift").with_effect("speed_trend")
    assert remarks(off, (5, 5), speed_m_s=speed) == []
    worn = Model.new("beam").with_effect("wear", amplitude=0.3)
    assert remarks(worn, (5, 5), speed_m_s=speed) == []
    said = remarks(worn, (5, 5), speed_m_s=speed, distance_km=np.array([1e3, 5e4]))
    assert len(said) == 1
    assert said[0].startswith("wear is valid for tread distance from 0 to 40000 km; 5 of 10")


def test_a_parameter_outside_is_said() -> None:
    model = Model.new("beam").with_effect("hysteresis", loss_factor=0.7)
    assert remarks(model, (5,), speed_m_s=10.0) == [
        "hysteresis is valid for loss_factor from 0 to 0.5; its value is 0.7"
    ]
    mild = model.with_values({"hysteresis.loss_factor": 0.5})
    assert remarks(mild, (5,), speed_m_s=10.0) == []


def test_compare_says_it() -> None:
    measured = stack(3, manoeuvres=3, m=64)
    conditions = replace(measured.conditions, distance_km=np.full(len(measured), 5e4))
    model = Model.new("beam").with_effect("wear", amplitude=0.3)
    held = {name: p.fixed() for name, p in model.parameters.items() if name != "lever_arm_m"}
    result = compare([replace(measured, conditions=conditions)], model.with_parameters(held))
    found = [r for r in result.remarks if r.startswith("wear is valid")]
    assert len(found) == 1
    assert "36 of 36 revolutions are outside" in found[0]
