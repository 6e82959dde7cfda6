"""Closed form: models are ranked by their error above the scatter that the data alone tell."""

from dataclasses import replace

import pytest

import tirelog
from tests.diagnosis.planted import MODEL, stack
from tirelog.cli.pages import print_answer
from tirelog.inference.measured import MeasuredLogs


def test_what_ranks_models_does_not_depend_on_them(capsys: pytest.CaptureFixture[str]) -> None:
    measured = MeasuredLogs([stack(manoeuvres=6, m=64)])
    length = MODEL.parameters["patch_half_length_m"]
    wrong = replace(length, value=1.3 * length.value).fixed()
    bad = tirelog.compare(measured, MODEL.with_parameters({length.name: wrong}))
    good = tirelog.compare(measured, MODEL)
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
