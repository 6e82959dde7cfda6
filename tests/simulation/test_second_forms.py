"""Property: a form "apart" is really another shape, also of what a fitted model leaves of it."""

from pathlib import Path

import numpy as np
import pytest

from benchmarks.forms import nearest, table
from tests.simulation.test_against_models import modelled
from tests.simulation.worlds import instants, world
from tirelog.data.recording import Conditions
from tirelog.simulation.scenario.schema import PLANTABLE, Sensor

pytestmark = pytest.mark.xdist_group("second forms")  # one worker makes what these tests share

PAGE = Path(__file__).resolve().parents[2] / "docs" / "second_forms.md"


@pytest.fixture(scope="module")
def told():
    return table()


def test_a_form_apart_leaves_another_shape(told):
    apart = {one.name: one.left for one in told if one.form == "apart"}
    assert len(apart) == 12
    assert {name: left for name, left in apart.items() if abs(left) > 0.97} == {}


def test_the_page_shows_what_is_computed(told):
    first = PAGE.read_text().split("What the forms")[0]
    shown = [line for line in first.splitlines() if line.startswith("| `")]
    cells = [[c.strip() for c in line.strip("|").split("|")] for line in shown]
    assert [row[:2] for row in cells] == [[f"`{one.name}`", one.form] for one in told]
    for row, one in zip(cells, told, strict=True):
        np.testing.assert_allclose([*map(float, row[2:])], [one.as_planted, one.left], atol=0.011)


def test_the_page_shows_what_is_nearest():
    shown = [line for line in PAGE.read_text().splitlines() if line.count("`") == 4]
    cells = [[c.strip() for c in line.strip("|").split("|")] for line in shown]
    cells = [row for row in cells if len(row) == 4]
    told = nearest()
    assert [(row[0], row[2]) for row in cells] == [(f"`{n.name}`", f"`{n.tried}`") for n in told]
    for row, one in zip(cells, told, strict=True):
        np.testing.assert_allclose(
            [float(row[1]), float(row[3])], [one.left, one.cosine], atol=0.011
        )


def test_a_tilted_accelerometer_is_that_of_the_catalogue():
    """Of the belt: what gravity does beside it is added where a sensor's samples are made."""
    w, plain = world(effects=[{"name": "sensor_tilt"}], grid_points=4096), world(grid_points=4096)
    sensor, at = Sensor("radial_acceleration"), instants(speed=15.0)
    truth = w.waveform(w.solve(at), sensor)[0] - plain.waveform(plain.solve(at), sensor)[0]
    tilted, model = (modelled(one, "radial_acceleration") for one in (w, plain))
    drive = Conditions.of(1, speed_m_s=15.0, acceleration_m_s2=0.0, load_N=float(at.load[0]))
    phi = w.ring.xi_m / w.scenario.tire.rolling_radius_m
    told = (tilted.predict(drive, phi) - model.predict(drive, phi))[0]
    told = told - 0.05 * 9.80665 * np.sin(phi)
    assert np.abs(truth - told).max() < 2e-3 * np.abs(truth).max()
    assert PLANTABLE["sensor_tilt"].forms == ("exact", "apart")
