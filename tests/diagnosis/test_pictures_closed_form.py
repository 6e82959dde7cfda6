"""Closed form: what the pictures of `compare` and `diagnose` show of a result made by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from tests.diagnosis.planted import MODEL, stack
from tirelog.data.recording import Conditions
from tirelog.diagnosis.compare import compare as compare_logs
from tirelog.diagnosis.results import Candidate, Map, Waveforms
from tirelog.physics.model.model import Model
from tirelog.plots import answers
from tirelog.plots.answers import coloured
from tirelog.plots.record import COLOURS, Panel, draw_panel
from tirelog.report.page import figure, log_colours
from tirelog.report.sections.models import styles

PHI = np.linspace(-np.pi, np.pi, 64, endpoint=False)


def map_of(size):
    values = size * np.exp(-((PHI / 0.3) ** 2)) * np.array([[1.0], [-1.0], [0.5]])
    return Map(np.array([10.0, 15.0, 20.0]), "speed_m_s", PHI, values, values / 1e-7)


def comparison(size, held_out):
    return SimpleNamespace(
        parts=(), observable="strain", unit="strain", by_speed=map_of(size), half_angle_rad=0.2,
        noise_floor=1e-6, rmse=held_out, rmse_heldout=held_out,
    )  # fmt: skip


RESULT = SimpleNamespace(
    before=comparison(4e-5, 9e-6),
    after=comparison(1e-6, 1.1e-6),
    sentence="water_film is missing: it removes 99 % of the excess.",
    effects=(
        Candidate("water_film", 1, 0.99, 2e-4, True, (), 9.0),
        Candidate("wear", 2, 0.1, 0.3, False, ("aero_load",), 1.0),
    ),
)


def test_1_and_40_are_told_on_one_scale():
    axes = Figure().add_subplot()
    mark = coloured(map_of(40.0), map_of(40.0).residual, "microstrain", 1.0, 40.0)
    mesh = draw_panel(axes, Panel(marks=[mark]))
    at = mesh.norm(np.array([-40.0, -1.0, 0.0, 1.0, 40.0]))
    assert at[0] == pytest.approx(0.0)
    assert at[2] == pytest.approx(0.5)
    assert at[4] == pytest.approx(1.0)
    assert 0.6 < at[3] < 0.85  # linear colours would give it 0.51
    assert at[1] == pytest.approx(1.0 - at[3])
    lone = Map(np.array([10.0]), "speed_m_s", PHI, map_of(1.0).residual[:1], PHI[None])
    assert [mark.kind for mark in answers.residual_map(lone, RESULT.before).marks] == ["dots"]


def test_before_and_after_have_one_scale_and_the_ranking_its_order(tmp_path):
    made = answers.diagnose_figure(RESULT)
    titles = {axes.get_title(loc="left"): axes for axes in made.axes}
    maps = {title: axes for title, axes in titles.items() if title.startswith(("before", "after"))}
    assert list(maps) == [
        "before: held-out error 9 microstrain",
        "after: held-out error 1.1 microstrain",
    ]
    limits = [axes.collections[0].get_clim() for axes in maps.values()]
    assert limits[0] == limits[1] == pytest.approx((-40.0, 40.0), rel=0.01)
    bars = titles["candidates; full colour: selected"]
    assert [label.get_text() for label in bars.get_yticklabels()] == ["water_film", "wear"]
    assert [bar.get_width() for bar in bars.patches] == pytest.approx([99.0, 10.0])
    assert [text.get_text() for text in bars.texts] == ["p < 0.001", "p = 0.3, or aero_load"]
    assert bars.patches[0].get_facecolor() != bars.patches[1].get_facecolor()
    assert answers.draw_diagnose(RESULT, tmp_path / "d.svg") == []
    assert b"<svg" in (tmp_path / "d.svg").read_bytes()


def with_waveforms(observable="strain"):
    """A comparison of a beam: predicted is measured less 5 microstrain behind the exit edge."""
    model = Model.new("beam")
    conditions = Conditions.of(2, speed_m_s=[10.0, 20.0], load_N=[3000.0, 4000.0])
    measured = model.predict(conditions, PHI)
    waves = Waveforms(
        np.stack([PHI, PHI]),
        measured,
        measured - 5e-6 * (PHI > 0.2),
        np.full((2, PHI.size), 1e-6),
        ("10 m/s, a.csv", "20 m/s, b.csv"),
        ("a.csv", "b.csv"),
        conditions,
    )
    given = comparison(1e-5, 1e-6)
    given.__dict__.update(waveforms=waves, model=model, observable=observable)
    return given


def test_logs_whose_names_hold_commas_are_two_on_the_page():
    given = with_waveforms()
    waves = replace(
        given.waveforms,
        labels=("10 m/s, steady, dry, a.csv", "20 m/s, steady, wet, a.csv"),
        logs=("dry, a.csv", "wet, a.csv"),
    )
    given.__dict__.update(waveforms=waves)
    colours = log_colours(["other.csv", "wet, a.csv"])
    panel = answers.waveforms(given, styles(waves.logs, colours))
    traces = figure("waveforms", "", "", panel).traces
    measured = [trace for trace in traces if trace["name"].startswith("measured, ")]
    assert [trace["name"] for trace in measured] == [f"measured, {one}" for one in waves.labels]
    assert [trace["marker"]["color"] for trace in measured] == [COLOURS[2], COLOURS[1]]


def test_waveforms_show_what_is_left_behind_the_exit():
    drawn = answers.differences(with_waveforms())
    first = next(mark for mark in drawn.marks if mark.kind == "line")
    assert drawn.y == "residual [microstrain]"
    assert first.y[first.x > np.degrees(0.2)] == pytest.approx(5.0)
    assert np.abs(first.y[first.x < np.degrees(0.2)]).max() < 1e-9
    floors = next(mark for mark in drawn.marks if mark.kind == "band")
    np.testing.assert_allclose([floors.y[0], floors.other[0]], [-2.0, 2.0])


def test_logs_one_after_the_other_are_parted():
    axes = Figure().add_subplot()
    map_ = replace(map_of(1.0), axis_name="time_s", begins=(12.0,))
    draw_panel(axes, answers.residual_map(map_, RESULT.before))
    assert axes.get_ylabel() == "time [s], logs one after the other"
    assert [12.0, 12.0] in [list(line.get_ydata()) for line in axes.lines]


def test_what_scatter_alone_leaves_is_about_one_standard_error():
    made = stack(seed=5)
    size = 1.0 + 0.01 * np.random.default_rng(6).standard_normal(15)  # each manoeuvre its own
    told = compare_logs([replace(made, values=size[made.manoeuvre, None] * made.values)], MODEL)
    patch = np.abs(told.by_speed.phi_rad) < told.half_angle_rad
    for map_ in (told.by_speed, told.by_time):
        assert 0.5 < np.sqrt(np.nanmean(map_.whitened[:, patch] ** 2)) < 1.5
    more = 3e-4 * np.exp(-((made.phi_mean - 0.3) ** 2) / 0.005)
    found = compare_logs([replace(made, values=made.values + more)], MODEL)
    assert np.nanmax(np.abs(found.by_speed.whitened)) > 10.0


def test_the_least_probability_of_a_ladder_is_an_upper_limit():
    step = {"effect": "base", "decision": "start", "outcome": "start", "p_adjusted": None}
    step |= {"rmse_heldout": 9e-6, "rmse_fit": 8e-6, "noise_floor": 1e-6}
    found = step | {"effect": "wear", "decision": "added", "outcome": "added"}
    steps = [step, found | {"p_adjusted": 2.0**-9}, found | {"p_adjusted": 0.01}]
    climbed = {"observable": "strain", "unit": "1", "steps": steps, "manoeuvres": 10}
    texts = [mark.name for mark in answers.climbed_panel(climbed).marks[3:]]
    assert texts == ["start", "added\np <= 0.002", "added\np = 0.01"]
