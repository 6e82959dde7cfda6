"""Closed form: the curve of an effect that is linear in its one parameter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.diagnosis.planted import MODEL, stack
from tirelog.diagnosis.compare import start
from tirelog.diagnosis.results import effect_curves
from tirelog.physics import Model
from tirelog.physics.model.user_effects import effect_by_expression
from tirelog.physics.spectral import Parameter
from tirelog.vocabulary.arrays import FloatArray

SIZE = 3e-5


def hump(xi: FloatArray, speed: FloatArray) -> FloatArray:
    return (speed / 20.0) * np.exp(-(((xi - 0.1) / 0.02) ** 2))


def model(*names: str) -> Model:
    size = Parameter("A", "1", "size", 1e-5, -1e-3, 1e-3, 1e-5)
    text = "A * (speed / 20) * exp(-((xi - 0.1) / 0.02) * ((xi - 0.1) / 0.02))"
    found = MODEL
    for name in names:
        found = found.with_effect(effect_by_expression(name, "strain", text, (size,)))
    return found


def test_the_curve_is_the_form_times_its_size_and_the_band_its_error() -> None:
    base = start([stack(lambda xi, v: SIZE * hump(xi, v), manoeuvres=9, m=96)], model("hump"))
    (curve,) = effect_curves(base, ["hump"])
    fitted = base.model.parameters["hump.A"]
    fastest = int(np.argmax(base.cells.conditions.speed_m_s))
    speed = base.cells.conditions.speed_m_s[fastest]
    form = hump(0.3 * base.cells.phi[fastest], speed)
    assert curve.label == f"{speed:.1f} m/s, cruise, made"
    assert fitted.value == pytest.approx(SIZE, abs=5.0 * fitted.se)
    # a mean of samples at several speeds and angles is a little off the form at their mean
    tolerance = 1e-3 * np.abs(form).max()
    np.testing.assert_allclose(curve.added / fitted.value, form, atol=tolerance)
    np.testing.assert_allclose(curve.error / fitted.se, np.abs(form), atol=tolerance)
    left = curve.measured - curve.added
    assert np.sqrt(np.mean((left / curve.floor) ** 2)) < 1.5
    assert np.abs(curve.measured).max() == pytest.approx(SIZE * form.max(), rel=0.1)


def test_what_the_data_do_not_tell_has_no_band() -> None:
    base = start(
        [stack(lambda xi, v: SIZE * hump(xi, v), manoeuvres=9, m=96)], model("hump", "twin")
    )
    curves = effect_curves(base, ["hump", "twin"])
    assert [curve.effect for curve in curves] == ["hump", "twin"]
    assert all(np.isnan(curve.error).all() for curve in curves)


def test_a_model_without_it_that_cannot_be_computed_has_no_curve() -> None:
    base = start([stack(manoeuvres=9, m=96)], model("hump"))
    lone = replace(base, fit=replace(base.fit, model=MODEL))
    assert effect_curves(lone, ["hump"]) == []
