"""Closed form: what pictures of revolutions show of waveforms that are known, a panel per log."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from tests.cli.conftest import folder, tirelog
from tests.diagnosis.toy import stack_of
from tirelog.data.recording import Conditions, Stack
from tirelog.plots.record import picture
from tirelog.plots.turns import (
    KINDS,
    TurnsSketch,
    around_the_wheel,
    speed_classes,
)
from tirelog.vocabulary.arrays import FloatArray
from tirelog.vocabulary.tables import LOG_PICTURES

__all__ = ["folder", "tirelog"]

PHI = np.linspace(-np.pi, np.pi, 128, endpoint=False) + np.pi / 128
RADIUS_M = 0.3


def sketch(log: str = "a.csv", turns: int = 60) -> TurnsSketch:
    """Revolutions at 10 and at 20 m/s, twice as high at 20: 100 cos(phi) microstrain at 10."""
    speed = np.where(np.arange(turns) < turns // 2, 10.0, 20.0)
    scatter = np.random.default_rng(2).normal(0.0, 1e-3, turns)
    found: Any = SimpleNamespace(
        found=SimpleNamespace(
            length_m=0.12 + scatter,
            length_se_m=np.full(turns, 1e-3),
            form_se_m=np.full(turns, 3e-3),
            quality=np.zeros(turns, np.int64),
        ),
        passages=SimpleNamespace(speed_m_s=speed, time_s=np.arange(turns)),
        channel=SimpleNamespace(name="strain_1"),
    )
    tire = SimpleNamespace(static_footprint_length_m=0.13)
    recording: Any = SimpleNamespace(log=log, setup=SimpleNamespace(tire=tire))
    noise = np.random.default_rng(1).normal(0.0, 1e-6, (turns, PHI.size))
    values = 1e-5 * speed[:, None] * np.cos(PHI) + noise
    return TurnsSketch(recording, found, turns_of(values, speed, 0.1 * np.arange(turns)), 1)


def turns_of(values: FloatArray, speed_m_s: FloatArray, time_s: FloatArray) -> Stack:
    """Revolutions as they are cut out of a log."""
    conditions = Conditions.of(len(values), speed_m_s=speed_m_s, time_s=time_s)
    numbers = np.arange(len(values))
    return stack_of(values=values, noise=1e-6, conditions=conditions, manoeuvre=numbers)


def test_revolutions_of_like_speed_are_taken_together() -> None:
    slow, fast = speed_classes(sketch().turns)
    assert [slow[:2], fast[:2]] == [(10.0, 30), (20.0, 30)]
    assert slow[2] == pytest.approx(1e-4 * np.cos(PHI), abs=1e-6)
    assert fast[2] == pytest.approx(2e-4 * np.cos(PHI), abs=1e-6)
    assert np.median(fast[3]) == pytest.approx(1e-6, rel=0.1)


def test_a_contact_length_has_the_error_that_all_passages_share() -> None:
    length, se, scatter = sketch(turns=600).length
    assert length == pytest.approx(0.12, abs=2e-4)
    assert scatter == pytest.approx(1e-3, rel=0.15)
    assert se == pytest.approx(3e-3, rel=0.01)  # the scatter alone would leave 0.05 mm


def test_around_the_wheel_zero_is_a_circle_and_the_patch_is_below() -> None:
    turns = sketch().turns
    wave = np.where(np.abs(PHI) < 0.2, -1500e-6, 500e-6)
    marks = around_the_wheel([(10.0, 3, wave, 0 * wave)], turns, 0.2)
    zero, low, high, arc, ring = (np.hypot(mark.x, mark.y) for mark in marks if mark.kind == "line")
    assert np.ptp(zero) == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(ring[:-1], zero[0] + 1e6 * wave)
    assert (low[0], high[0]) == pytest.approx((zero[0] - 1500.0, zero[0] + 500.0))
    assert ring.min() > 0.0
    below = next(mark for mark in marks if mark.style.get("width") == 6.0)
    assert arc.min() > high[0]
    assert np.max(below.y) < 0.0  # the road is below, and the entry at the right
    assert below.x[0] == pytest.approx(arc[0] * np.sin(0.2))


def test_few_revolutions_of_many_speeds_are_one_class() -> None:
    speed = np.linspace(10.0, 20.0, 7)
    turns = turns_of(np.ones((7, PHI.size)), speed, np.arange(7.0))
    assert [found[:2] for found in speed_classes(turns)] == [(15.0, 7)]


@pytest.mark.parametrize("kind", [kind for kind in LOG_PICTURES if kind != "signal"])
def test_each_log_has_its_panel_or_colour_in_microstrain(kind: str) -> None:
    figure = picture(KINDS[kind]([sketch("a.csv"), sketch("b.csv")]))
    figure.draw_without_rendering()
    words = [a.get_title(place) for a in figure.axes for place in ("left", "center")]
    words += [t.get_text() for a in figure.axes if a.get_legend() for t in a.get_legend().texts]
    assert all(any(log in text for text in words) for log in ("a.csv", "b.csv"))
    words += [a.get_xlabel() + a.get_ylabel() for a in figure.axes]
    words += [t.get_text() for a in figure.axes for t in a.texts]
    said = " ".join(words)
    assert "microstrain" in said
    assert "µ" not in said
