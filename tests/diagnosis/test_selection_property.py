"""Property: the sign-flip test keeps its rate; what leaves an effect's range is remarked."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from tests.diagnosis.toy import stack
from tirelog.data.recording import Conditions
from tirelog.diagnosis.candidates.assessment import (
    Scores,
    flip_test,
    gain_and_error,
    out_of_range,
    surely_gains,
)
from tirelog.diagnosis.compare import compare
from tirelog.physics import Model


def scores_of(random, manoeuvres, candidates, level=0.0):
    """Candidates whose scores share what a manoeuvre does to all of them."""
    shared = random.standard_normal((manoeuvres, 1))
    own = [0.7 * shared + 0.7 * random.standard_normal((manoeuvres, 1)) for _ in range(candidates)]
    own[0] += level
    return [Scores(one, np.eye(1)) for one in own]


def test_rate_of_false_alarms_over_all_candidates_is_the_level():
    random = np.random.default_rng(3)
    alarms = sum(flip_test(scores_of(random, 10, 12), 10)[1].min() <= 0.05 for _ in range(400))
    assert 0.02 * 400 < alarms < 0.085 * 400


def test_what_repeats_in_every_manoeuvre_is_seen_and_named():
    random = np.random.default_rng(4)
    statistic, p = flip_test(scores_of(random, 14, 12, level=2.5), 14)
    assert p[0] <= 0.001
    assert np.argmax(statistic) == 0


def test_more_revolutions_of_one_manoeuvre_prove_nothing():
    scores = [Scores(np.array([[1e6]] + [[0.0]] * 7), np.eye(1))]
    assert flip_test(scores, 8)[1][0] == 1.0


def test_what_few_manoeuvres_can_show_is_sure_if_all_agree_and_most_of_the_excess_goes():
    size = np.r_[9.0, 6.0, np.full(10, 0.1)]  # two of twelve are driven so that it shows
    scores = [Scores(size[:, None] ** 2, np.array([[np.sum(size**2)]]))]
    _, p = flip_test(scores, size.size)
    gain, error = gain_and_error(size**2 + 1.0, np.ones(size.size))
    assert gain < 1.4 * error
    assert p[0] == 2.0**-11
    assert surely_gains(gain, error, p[0], share=0.99)
    assert not surely_gains(gain, error, p[0], share=0.5)
    assert not surely_gains(gain, error, 0.005, share=0.99)
    assert surely_gains(1.5 * error, error, 0.5, share=0.0)


def test_the_error_of_a_gain_allows_for_training_that_manoeuvres_share():
    """Nadeau and Bengio (2003): of means by leave-one-out the variance is s^2 (1/M + 1/(M - 1))."""
    gains = np.random.default_rng(7).normal(1.0, 2.0, 17)
    gain, error = gain_and_error(gains, np.zeros(17))
    assert gain == pytest.approx(gains.sum())
    assert (error / 17.0) ** 2 == pytest.approx(np.var(gains, ddof=1) * (1.0 / 17.0 + 1.0 / 16.0))
    assert gain_and_error(np.ones(1), np.zeros(1)) == (1.0, np.inf)


def remarks(model, revolutions, **conditions):
    n = len(revolutions)
    cells = SimpleNamespace(
        conditions=Conditions.of(n, **conditions), revolutions=np.array(revolutions)
    )
    return out_of_range(SimpleNamespace(model=model, cells=cells))  # type: ignore[arg-type]


TREND = Model.new("beam", "phase_shift").with_effect("speed_trend", linear_rad=0.01)
OFF = Model.new("beam", "phase_shift").with_effect("speed_trend")
WORN = Model.new("beam").with_effect("wear", amplitude=0.3)
LOSSY = Model.new("beam").with_effect("hysteresis", loss_factor=0.7)


@pytest.mark.parametrize(
    ("model", "revolutions", "conditions", "said"),
    [
        (TREND, (5, 30, 38, 7), {"speed_m_s": [8.0, 10.0, 25.0, 30.0]},
         "speed_trend is valid for speed from 10 to 25 m/s; 12 of 80 revolutions are outside, by "
         "means of similar ones"),
        (TREND, (5, 7), {"speed_m_s": [10.0, 25.0]}, ""),
        (OFF, (5, 5), {"speed_m_s": [8.0, 30.0]}, ""),
        (WORN, (5, 5), {"speed_m_s": [8.0, 30.0]}, ""),  # at distances that are not known
        (WORN, (5, 5), {"speed_m_s": [8.0, 30.0], "distance_km": [1e3, 5e4]},
         "wear is valid for tread distance from 0 to 40000 km; 5 of 10"),
        (LOSSY, (5,), {"speed_m_s": 10.0},
         "hysteresis is valid for loss_factor from 0 to 0.5; its value is 0.7"),
        (LOSSY.with_values({"hysteresis.loss_factor": 0.5}), (5,), {"speed_m_s": 10.0}, ""),
    ],
)  # fmt: skip
def test_what_is_outside_is_said(model, revolutions, conditions, said):
    known = {name: np.array(values) for name, values in conditions.items()}
    found = remarks(model, revolutions, **known)
    assert len(found) == bool(said)
    assert not said or found[0].startswith(said)


def test_compare_says_it():
    measured = stack(3, manoeuvres=3, m=64)
    conditions = replace(measured.conditions, distance_km=np.full(len(measured), 5e4))
    model = Model.new("beam").with_effect("wear", amplitude=0.3)
    held = {name: p.fixed() for name, p in model.parameters.items() if name != "lever_arm_m"}
    result = compare([replace(measured, conditions=conditions)], model.with_parameters(held))
    found = [r for r in result.remarks if r.startswith("wear is valid")]
    assert len(found) == 1
    assert "36 of 36 revolutions are outside" in found[0]
