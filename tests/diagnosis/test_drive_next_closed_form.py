"""Closed form: how much surer a verdict gets by a stretch, and how long the stretch takes."""

import math

import pytest

from tirelog.diagnosis.candidates.separation import (
    ALLOWED,
    drive_sentences,
    expected_gain,
    probability_after,
)

BY_NAME = {manoeuvre.name: manoeuvre for manoeuvre in ALLOWED}


def test_of_two_as_likely_the_right_one_is_told_as_two_normals_part():
    for sigma, p in ((0.0, 0.5), (2.0, 0.841345), (6.0, 0.998650)):
        assert probability_after(0.0, sigma) == pytest.approx(p, abs=1e-6)
    # nothing is lost by driving, and in the end all is known
    assert probability_after(math.log(9.0), 0.0) == pytest.approx(0.9)
    assert probability_after(math.log(9.0), 1e-3) == pytest.approx(0.9)
    assert probability_after(-math.log(9.0), 30.0) == pytest.approx(1.0)


def test_a_gain_is_the_share_of_the_two():
    # a set of two that is right in 90 of 100: 45 points are to be won at most
    assert expected_gain(0.45, 0.45, 40.0) == pytest.approx(0.45)
    assert expected_gain(0.45, 0.45, 2.0) == pytest.approx(0.9 * 0.841345 - 0.45, abs=1e-5)
    assert expected_gain(0.9, 0.05, 0.0) == pytest.approx(0.0, abs=1e-12)
    assert expected_gain(0.9, 0.0, 5.0) == 0.0


def test_minutes_of_a_stretch():
    turn = 2.0 * math.pi * 0.3  # m
    assert BY_NAME["cruise at 15 m/s"].minutes(0.3) == pytest.approx((20 + 40 * turn / 15) / 60)
    assert BY_NAME["cruise at 15 m/s"].minutes(0.3, 3) == pytest.approx((20 + 40 * turn / 15) / 20)
    assert BY_NAME["coast down 25 to 9 m/s"].minutes(0.3) == pytest.approx((20 + 32) / 60)
    loaded = BY_NAME["cruise at 15 m/s with 40 % more load"]
    assert loaded.minutes(0.3) == pytest.approx((600 + 20 + 40 * turn / 15) / 60)


def test_a_row_as_a_sentence():
    row = {
        "manoeuvre": "cruise at 8 m/s", "repeats": 2, "minutes": 1.25, "gain": 0.25,
        "gain_per_minute": 0.2, "separates": [["wear", "traction"], ["wear", "drift"]],
        "calibrated": False,
    }  # fmt: skip
    assert drive_sentences([row]) == [
        "To be surer, drive: cruise at 8 m/s, 2 times (1.2 min). It tells wear from traction; wear "
        "from drift; of 100 such verdicts 25.0 more would be right (20 per minute, counted from "
        "even odds)."
    ]
