"""Closed form: the search for passages and their fit on pulses that are known.

Seeds from 1000: none was used for tuning.
"""

from __future__ import annotations

import numpy as np
import pytest

from tirelog.data.recording import Channel, TimeAxis
from tirelog.dsp.filters import (
    white_noise,
)
from tirelog.strain.passages.match import Signal, fit
from tirelog.strain.passages.template import MOST_SAMPLES, ROW, TABLE, Template
from tirelog.vocabulary.arrays import records
from tirelog.wheel.pulses import (
    PULSE,
    bucket_medians,
    half_level,
    turning_points,
)


@pytest.mark.parametrize(
    ("values", "median"),
    [
        ([1.0, np.inf, 4.0, 2.0], 3.0),
        ([1.0, np.nan, 4.0, np.nan], 2.5),
        ([np.nan, np.nan, 4.0, np.nan], 4.0),
        ([np.nan] * 4, np.nan),
    ],
)
def test_a_bucket_is_the_median_of_what_is_there(values, median):
    medians = np.empty(1, np.float32)
    bucket_medians(np.array(values), 4, 1.0, medians)
    np.testing.assert_array_equal(medians, [median])


def test_a_plateau_is_one_turning_point_and_still_values_are_none():
    points = np.empty(9, np.int32)
    assert points[
        : turning_points(np.array([0, 1, 1, 1, 0, 0, 2, 2], np.float32), 0.5, points)
    ].tolist() == [0, 1, 4, 6]
    assert turning_points(np.ones(8, np.float32), 0.0, points) == 0


def test_half_level_crossings_of_triangles():
    values = np.array([0, 1, 2, 3, 4, 2, 0, 1, 3, 5, 4, 3, 2, 1], np.float32)
    pulses = np.empty(2, PULSE)
    half_level(values, np.array([4, 9]), np.array([0, 6]), np.array([6, 13]), pulses)
    # base 0, level 2: from 2 to 5; base 1 (the higher valley), level 3: from 8 to 11
    expected = [[3.5, 3.0, 4.0, 0.0], [9.5, 3.0, 4.0, 1.0]]
    np.testing.assert_allclose(pulses.view(float).reshape(2, 4), expected)


def test_white_noise_is_told_beside_a_drift_and_lost_samples():
    values = np.random.default_rng(1803).normal(0.0, 2.0, 40_000) + 0.01 * np.arange(40_000)
    values[5::97] = np.nan
    assert white_noise(values) == pytest.approx(2.0, rel=0.03)


def test_white_noise_of_too_few_samples_is_not_known():
    assert np.isnan(white_noise(np.arange(6.0)))
    assert np.isnan(white_noise(np.full(100, np.nan)))


PHI = np.linspace(-0.4, 0.4, TABLE)
TEMPLATE = Template(
    PHI, np.exp(-((PHI / 0.15) ** 2)), -2 * PHI / 0.15**2 * np.exp(-((PHI / 0.15) ** 2)), 0.4, 0.12
)
OMEGA, RATE_HZ, NOISE = 40.0, 2500.0, 1e-3


def passages_of_the_template(seed, axis, n=5):
    """Samples that are the template at known times, each with its own offset, height and speed, and
    starts beside them.
    """
    rng = np.random.default_rng(seed)
    every = axis.size // n
    index = every * (np.arange(n) + 0.5) + rng.uniform(-3, 3, n)
    alpha = rng.normal(0, 5, n)
    start = records(
        ROW,
        time_s=axis.at(index),
        index=index,
        omega_rad_s=OMEGA,
        alpha_rad_s2=alpha,
        stretch=0.1,
        height=1.0,
    )
    shift, stretch = rng.normal(0, 0.01, n), rng.normal(0, 0.01, n)
    height, offset = rng.uniform(0.5, 2, n), rng.normal(size=n)
    time = axis.time()
    values = np.empty(axis.size)
    for k in range(n):
        own = slice(k * every, (k + 1) * every)
        tau = time[own] - start["time_s"][k]
        phi = (OMEGA + 0.5 * start["alpha_rad_s2"][k] * tau) * tau
        values[own] = offset[k] + height[k] * np.exp(
            -(((phi * (1 + stretch[k]) - shift[k]) / 0.15) ** 2)
        )
    return values, start, height, offset, shift, stretch


def signal_of(values, axis, sign=1.0):
    return Signal(
        Channel.of_array("s", "strain", sign * values, axis),
        sign,
        NOISE,
        (np.nanmin(sign * values), np.nanmax(sign * values)),
    )


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("kind", ["uniform", "stamped", "with a gap"])
def test_the_fit_finds_shift_stretch_height_and_offset(sign, kind):
    axis = TimeAxis.uniform(1000, RATE_HZ)
    if kind == "stamped":
        axis = TimeAxis.of_times(axis.time() + 1e-5 * np.sin(np.arange(1000)))
    elif kind == "with a gap":
        # in the middle of the third window
        axis = TimeAxis(
            1000,
            RATE_HZ,
            np.array([0, 503]),
            np.array([0.0, 503 / RATE_HZ + 0.01]),
            np.full(2, 1 / RATE_HZ),
        )
    values, start, height, offset, shift, stretch = passages_of_the_template(1810, axis)
    found = fit(signal_of(values, axis, sign), TEMPLATE, start)
    np.testing.assert_allclose(found["height"], height, rtol=2e-3)
    np.testing.assert_allclose(found["offset"], offset, atol=2e-3)
    np.testing.assert_allclose(found["omega_rad_s"], OMEGA * (1 + stretch), rtol=2e-3)
    np.testing.assert_allclose(
        (found["time_s"] - start["time_s"]) * OMEGA, shift / (1 + stretch), atol=2e-4
    )
    assert not (
        found["holds_lost"] | found["holds_spike"] | found["holds_clipped"] | found["outside"]
    ).any()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_windows_that_are_clipped_outside_or_empty_say_so(sign):
    axis = TimeAxis.uniform(1000, RATE_HZ)
    values, start, height, *_ = passages_of_the_template(1812, axis)
    values[:400] = np.nan
    top = np.max(values[400:600]) - 0.2 * height[2]
    values[400:600] = np.minimum(values[400:600], top)
    values[600:] = np.minimum(values[600:], top - 1e-6)
    start["index"][4] = 999.0
    found = fit(signal_of(values, axis, sign), TEMPLATE, start)
    assert found["holds_clipped"].tolist()[:4] == [False, False, True, False]
    assert found["outside"].tolist() == [False, False, False, False, True]
    assert found["holds_lost"].tolist()[:4] == [True, True, False, False]
    assert found["used"].tolist()[:2] == [0, 0]
    np.testing.assert_allclose(found["time_s"][:2], start["time_s"][:2])


def test_a_long_window_is_thinned():
    axis = TimeAxis.uniform(20_000, 50_000.0)
    values, start, height, *_ = passages_of_the_template(1813, axis, n=2)
    found = fit(signal_of(values, axis), TEMPLATE, start)
    assert (found["used"] <= MOST_SAMPLES).all()
    assert (found["used"] > MOST_SAMPLES // 2).all()
    np.testing.assert_allclose(found["height"], height, rtol=2e-3)
