"""Closed form: what `compare` says of a beam with something planted."""

from dataclasses import replace

import numpy as np
import pytest

import tirelog
from tests.diagnosis.planted import MODEL, stack
from tests.diagnosis.test_together_closed_form import F, R, several
from tirelog.cli.pages import print_answer
from tirelog.diagnosis.compare import compare
from tirelog.inference.measured import MeasuredLogs
from tirelog.physics.model.model import Model

LENGTH = MODEL.parameters["patch_half_length_m"]
WRONG = MODEL.with_parameters({LENGTH.name: replace(LENGTH, value=1.3 * LENGTH.value).fixed()})


def measured():
    return MeasuredLogs([stack(manoeuvres=6, m=64)])


def test_what_ranks_models_does_not_depend_on_them(capsys):
    bad, good = (tirelog.compare(measured(), model) for model in (WRONG, MODEL))
    assert good.noise_floor_within == bad.noise_floor_within
    assert good.noise_floor_between != bad.noise_floor_between
    for one in (good.to_json(), bad.to_json()):
        for error, above in (("rmse", "excess_within"), ("rmse_heldout", "excess_heldout_within")):
            square = one[above] ** 2 + one["noise_floor_within"] ** 2
            assert square == pytest.approx(one[error] ** 2)
    print_answer(bad.page())
    page = capsys.readouterr().out
    assert page.index("above scatter") < page.index("floor")
    assert "do not rank models by excess" in page


def test_errors_by_angle_add_up_to_that_of_all():
    found = tirelog.compare(measured(), WRONG)
    of_angle = np.digitize(found.by_speed.phi_rad / found.half_angle_rad, [-1.5, -0.5, 0.5, 1.5])
    before, entry, patch, exit_, behind = np.bincount(of_angle, minlength=5).tolist()
    number = {"entry": entry, "patch": patch, "exit": exit_, "away": before + behind}
    rows = found.tables["angle"]
    square = [row["rmse"] ** 2 for row in rows]
    whole = np.average(square, weights=[number[row["angle"]] for row in rows])
    assert np.sqrt(whole) == pytest.approx(found.rmse)


def test_models_are_ranked_on_the_same_logs_above_the_same_scatter():
    asked = tirelog.compare(measured(), WRONG, [MODEL])
    best, worse = asked.to_json()["ranking"]
    assert (best["free"], worse["free"]) == (worse["free"] + 1, best["free"] - 1)
    assert worse["rmse_heldout"] == asked.rmse_heldout
    assert best["sigmas"] == 0.0 < 2.0 < worse["sigmas"]
    for one in (best, worse):
        above = one["rmse_heldout"] ** 2 - asked.noise_floor_within**2
        assert one["above_scatter"] == pytest.approx(np.sqrt(max(above, 0.0)))
    assert asked.wrongness()[0].rows[0][-1] == best["free"]
    assert tirelog.compare(measured(), WRONG).ranking == ()


def test_several_observables_with_nothing_free_are_compared():
    names = ("strain", "radial_acceleration")
    model = Model.new("beam", names, radius_m=R, load_N=F)
    held = model.with_parameters({name: p.fixed() for name, p in model.parameters.items()})
    found = compare(several(3, *names), held)
    assert found.agreement.startswith("No parameter is known by more than one observable")
    assert min(part.rmse for part in found.parts) > 0.0


def test_a_start_beyond_its_critical_speed_is_fitted():
    """0.1 N m^2 on 1e5 N/m^2 carry no steady wave above 6.7 m/s; the log goes up to 24 m/s."""
    names = ("flexural_stiffness_N_m2", "foundation_stiffness_N_m2")
    free = {name: replace(MODEL.parameters[name], free=True) for name in names}
    soft = MODEL.with_parameters(free).with_values(dict(zip(names, (0.1, 1e5), strict=True)))
    found = tirelog.compare(measured(), soft)
    assert found.rmse == pytest.approx(found.noise_floor, rel=0.05)
