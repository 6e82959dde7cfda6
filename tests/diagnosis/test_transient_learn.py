"""Property: masses and damping that were put in are found in the answer to an obstacle, from a
start that is off.
"""

from dataclasses import replace

import pytest

from tests.diagnosis.test_transient_property import MODEL, NOISE, made
from tirelog.diagnosis.obstacles import learn_motion
from tirelog.errors import UsageError
from tirelog.inference.measured import motion_names, without_motion_parameters


def freed(*names):
    return MODEL.with_parameters(
        {name: replace(MODEL.parameters[name], free=True) for name in names}
    )


@pytest.mark.slow
def test_a_line_mass_that_is_off_is_found():
    start = freed("line_mass_kg_m").with_values(
        {"line_mass_kg_m": 1.08 * MODEL.values["line_mass_kg_m"]}
    )
    learned = learn_motion([made(1.61, 3)], start)
    mass = learned.model.parameters["line_mass_kg_m"]
    assert learned.names == ("line_mass_kg_m",)
    assert mass.value == pytest.approx(MODEL.values["line_mass_kg_m"], rel=2e-3)
    assert mass.se is not None
    assert abs(mass.value - MODEL.values["line_mass_kg_m"]) < 6.0 * mass.se
    assert learned.after < 1.3 * NOISE < 0.2 * learned.before


def test_the_steady_waveform_is_fitted_without_them():
    model = freed("line_mass_kg_m", "hub_mass_kg", "radial_damping_N_s_m2")
    assert set(motion_names(model)) == {"line_mass_kg_m", "hub_mass_kg", "radial_damping_N_s_m2"}
    assert without_motion_parameters(model).free == MODEL.free
    assert motion_names(MODEL) == ()


def test_nothing_free_is_said():
    with pytest.raises(
        UsageError,
        match=r"no free parameter that a motion tells; allowed are hub_mass_kg.*; free one",
    ):
        learn_motion([], MODEL)
