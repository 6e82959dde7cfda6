"""Closed form: a fit finds the tire also from a start that the physics does not compute."""

from dataclasses import replace

import pytest

import tirelog
from tests.diagnosis.planted import MODEL, stack
from tirelog.inference.measured import MeasuredLogs


def test_a_start_beyond_its_critical_speed_is_fitted() -> None:
    """0.1 N m^2 on 1e5 N/m^2 carry no steady wave above 6.7 m/s; the log goes up to 24 m/s."""
    names = ("flexural_stiffness_N_m2", "foundation_stiffness_N_m2")
    free = {name: replace(MODEL.parameters[name], free=True) for name in names}
    soft = MODEL.with_parameters(free).with_values(dict(zip(names, (0.1, 1e5), strict=True)))
    found = tirelog.compare(MeasuredLogs([stack(manoeuvres=6, m=64)]), soft)
    assert found.rmse == pytest.approx(found.noise_floor, rel=0.05)
