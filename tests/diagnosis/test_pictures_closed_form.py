"""The pictures of `compare` and `diagnose`: what stands in them, by a result made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from tirelog.diagnosis.results import Map
from tirelog.plots import diagnose
from tirelog.plots.compare import coloured

PHI = np.linspace(-np.pi, np.pi, 64, endpoint=False)


def map_of(size):
    values = size * np.exp(-((PHI / 0.3) ** 2)) * np.array([[1.0], [-1.0], [0.5]])
    return Map(np.array([10.0, 15.0, 20.0]), "speed_m_s", PHI, values, values / 1e-7)


def comparison(size, held_out):
    return SimpleNamespace(
        parts=(),
        observable="strain",
        unit="strain",
        by_speed=map_of(size),
        half_angle_rad=0.2,
        noise_floor=1e-6,
        rmse=held_out,
        rmse_heldout=held_out,
    )


RESULT = SimpleNamespace(
    before=comparison(4e-5, 9e-6),
    after=comparison(1e-6, 1.1e-6),
    sentence="water_film is missing: it removes 99 % of the excess.",
    effects=(
        SimpleNamespace(
            effect="water_film", excess_removed=0.99, p_adjusted=2e-4, selected=True, group=()
        ),
        SimpleNamespace(
            effect="wear", excess_removed=0.1, p_adjusted=0.3, selected=False, group=("aero_load",)
        ),
    ),
)


def test_1_and_40_are_told_on_one_scale():
    axes = Figure().add_subplot()
    mesh = coloured(axes, map_of(40.0), map_of(40.0).residual, 1.0, 40.0)
    at = mesh.norm(np.array([-40.0, -1.0, 0.0, 1.0, 40.0]))
    assert at[0] == pytest.approx(0.0)
    assert at[2] == pytest.approx(0.5)
    assert at[4] == pytest.approx(1.0)
    assert 0.6 < at[3] < 0.85  # linear colours would give it 0.51
    assert at[1] == pytest.approx(1.0 - at[3])
    lone = Map(np.array([10.0]), "speed_m_s", PHI, map_of(1.0).residual[:1], PHI[None])
    assert coloured(axes, lone, lone.residual, 1.0, 2.0) is None


def test_before_and_after_have_one_scale_and_the_ranking_its_order(tmp_path):
    made = diagnose.figure(RESULT)
    maps = [axes for axes in made.axes if axes.get_title().startswith(("before", "after"))]
    assert [axes.get_title() for axes in maps] == [
        "before: held-out error 9 microstrain",
        "after: held-out error 1.1 microstrain",
    ]
    limits = [axes.collections[0].get_clim() for axes in maps]
    assert limits[0] == limits[1] == pytest.approx((-40.0, 40.0))
    (bars,) = (axes for axes in made.axes if axes.get_title().startswith("candidates"))
    assert [label.get_text() for label in bars.get_yticklabels()] == ["water_film", "wear"]
    assert [bar.get_width() for bar in bars.patches] == pytest.approx([99.0, 10.0])
    assert [text.get_text() for text in bars.texts] == ["p < 0.001", "p = 0.3, or aero_load"]
    assert bars.patches[0].get_facecolor() != bars.patches[1].get_facecolor()
    assert diagnose.draw(RESULT, tmp_path / "d.svg") == []
    assert b"<svg" in (tmp_path / "d.svg").read_bytes()
