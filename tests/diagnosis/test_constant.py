"""Closed form: what logs do not vary is said, with the effects that follow it."""

from dataclasses import replace

import numpy as np

from tirelog.data.recording import Conditions
from tirelog.diagnosis.answer import not_varied
from tirelog.physics.effects import BY_ID


def conditions(**values: object) -> Conditions:
    return Conditions.of(
        4, **{"inflation_pressure_Pa": 2.2e5, "distance_km": 100.0, "water_depth_mm": 0.5, **values}
    )


def test_the_same_and_the_unknown_are_said_apart() -> None:
    said = not_varied(
        conditions(load_N=3434.0, water_depth_mm=np.nan),
        [BY_ID["stiffening"], BY_ID["water_film"], BY_ID["viscous_damping"]],
    )
    assert said.startswith(
        "The same throughout: load 3434 N; not known: water depth. What follows them "
        "(stiffening, water_film)"
    )


def test_what_varies_and_what_nothing_follows_is_not_said() -> None:
    varied = conditions(
        load_N=np.array([3000.0, 3100.0, 3300.0, 3434.0]),
        water_depth_mm=np.array([0.0, 0.0, 0.0, 1.0]),
    )
    assert (
        not_varied(varied, [BY_ID["stiffening"], BY_ID["water_film"], BY_ID["viscous_damping"]])
        == ""
    )
    assert "load" in not_varied(
        conditions(load_N=np.array([3400.0, 3410.0, 3420.0, 3434.0])), [BY_ID["stiffening"]]
    )


def test_an_effect_that_follows_the_inflation_pressure_is_named_by_any_of_its_names() -> None:
    same = conditions(load_N=np.array([3000.0, 3400.0, 3500.0, 3600.0]))
    for effect in (BY_ID["inflation"], replace(BY_ID["inflation"], follows="inflation pressure")):
        assert not_varied(same, [effect]).startswith(
            "The same throughout: inflation pressure 220000 Pa. What follows them (inflation)"
        )
