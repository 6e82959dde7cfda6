"""Closed form: L = L0 (F / F0)^n (p / p0)^-m with n and m free, from lengths alone."""

from dataclasses import replace

import numpy as np
import pytest

from tests.diagnosis.toy import stack_of
from tirelog.data.recording import Conditions
from tirelog.diagnosis.compare import compare
from tirelog.errors import ModelError
from tirelog.physics import Model
from tirelog.physics.model.file import as_toml, parse_model

TRUE = {"patch_half_length_m": 0.06, "patch_load_exponent": 0.63, "patch_pressure_exponent": 0.37}
LOADS, PRESSURES, NOISE = (2800.0, 3600.0, 4400.0), (1.6e5, 2.0e5, 2.4e5), 4e-4


def lengths(seed):
    """Nine logs of twenty revolutions, a load and a pressure each."""
    rng, stacks = np.random.default_rng(seed), []
    drives = [(load, pressure) for load in LOADS for pressure in PRESSURES]
    logs = tuple(f"{load:.0f}_{pressure:.0f}.csv" for load, pressure in drives)
    half, n, m = TRUE.values()
    for number, (load, pressure) in enumerate(drives):
        true = 2.0 * half * (load / 3600.0) ** n * (pressure / 2.0e5) ** -m
        drive = Conditions.of(
            20, speed_m_s=15.0, acceleration_m_s2=0.0, time_s=np.arange(20) * 0.1, load_N=load,
            inflation_pressure_Pa=pressure,
        )  # fmt: skip
        values, own = true + rng.normal(0.0, NOISE, (20, 1)), np.full(20, number)
        named = {"observable": "patch_length", "radius_m": 0.31, "log": own, "logs": logs}
        stacks.append(stack_of(values, drive, own, NOISE, **named))
    return stacks


def law(*free):
    """A beam of patch lengths in which these numbers are free."""
    model = Model.new("beam", "patch_length", reference_load_N=3600.0, reference_pressure_Pa=2.0e5)
    parameters = model.parameters
    return model.with_parameters({n: replace(p, free=n in free) for n, p in parameters.items()})


def test_both_exponents_come_back_within_their_errors():
    found = compare(lengths(31), law(*TRUE))
    for name, true in TRUE.items():
        told = found.parameters[name]
        assert abs(told["value"] - true) < 3.0 * told["se"], name
        assert told["se"] < 0.06 * true, name
    assert found.reduced_chi2 == pytest.approx(1.0, abs=0.3)
    # without the pressure the lengths do not follow
    blind = compare(lengths(31), law("patch_half_length_m", "patch_load_exponent"))
    assert blind.rmse > 5.0 * NOISE
    pressures = {"inflation_pressure_Pa": np.array([1.6e5, 2.0e5])}
    low, high = found.model.half_length_m(
        Conditions.of(2, speed_m_s=15.0, load_N=3600.0, **pressures)
    )
    assert low / high == pytest.approx(0.8 ** -TRUE["patch_pressure_exponent"], rel=5e-3)


def test_an_unknown_pressure_is_that_of_the_reference():
    model = law().with_values(TRUE)
    known, unknown = (
        model.half_length_m(Conditions.of(1, speed_m_s=15.0, load_N=3600.0, **given))
        for given in ({"inflation_pressure_Pa": 2.0e5}, {})
    )
    assert known == unknown == pytest.approx(TRUE["patch_half_length_m"])


def test_both_stand_in_a_model_file_with_bounds():
    again = parse_model(as_toml(law(*TRUE)))
    assert set(TRUE) <= set(again.free)
    text = as_toml(law()).replace("patch_pressure_exponent = 0.0", "patch_pressure_exponent = 3.0")
    with pytest.raises(ModelError, match="patch_pressure_exponent"):
        parse_model(text)
