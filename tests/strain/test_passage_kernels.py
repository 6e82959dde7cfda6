"""Closed form: the compiled loops of the passages against plain numpy, written another way.

Seeds from 1000: none was used for tuning.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tirelog.data.recording import Channel, TimeAxis
from tirelog.dsp.filters import (
    DIFFERENCE_GAIN,
    DIFFERENCE_ORDER,
    NORMAL_MEDIAN,
    PIECE_SAMPLES,
    white_noise,
)
from tirelog.strain.passages.match import Signal, curve_sums, fit_passages, gather
from tirelog.strain.passages.search import (
    PULSE,
    bucket_medians,
    decimate,
    half_level,
    running_medians,
    turning_points,
    usual,
)
from tirelog.strain.passages.template import INTERVALS, MOST_SAMPLES, ROW, TABLE, Template
from tirelog.vocabulary.arrays import records


def holed(rng, size, share):
    values = rng.normal(size=size)
    values[rng.random(size) < share] = np.nan
    return values


@pytest.mark.parametrize("bucket", [4, 8, 32])
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 1.0])
def test_medians_of_buckets(bucket, share):
    values = holed(np.random.default_rng(1800), 40 * bucket + 3 * bucket // 4 + 1, share)
    medians = np.empty(41, np.float32)
    bucket_medians(values, bucket, -1.0, medians)
    means = (
        np.pad(values, (0, -values.size % bucket), constant_values=np.nan)
        .reshape(-1, 4, bucket // 4)
        .mean(axis=2)
    )
    expected = [
        -np.median(row[~np.isnan(row)]) if not np.isnan(row).all() else np.nan for row in means
    ]
    np.testing.assert_allclose(medians, expected, rtol=1e-6)


@pytest.mark.parametrize("rate_Hz", [1000.0, 2500.0])
@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_extremes_are_those_of_all_samples(rate_Hz, share):
    values = holed(np.random.default_rng(8010), 3 * PIECE_SAMPLES + 5, share)
    found = decimate(
        Channel.of_array("c", "strain", values, TimeAxis.uniform(values.size, rate_Hz)),
        -1.0,
        PIECE_SAMPLES,
    )
    assert found.extremes == (
        (np.nanmin(values), np.nanmax(values)) if share < 1.0 else (np.inf, -np.inf)
    )


def test_one_infinite_sample_does_not_matter_to_a_bucket():
    medians = np.empty(1, np.float32)
    bucket_medians(np.array([1.0, np.inf, 4.0, 2.0]), 4, 1.0, medians)
    assert medians.tolist() == [3.0]


def test_running_medians_leave_ends_and_neighbours_of_lost_samples():
    values = holed(np.random.default_rng(1801), 300, 0.05)
    medians = np.empty(296, np.float32)
    running_medians(values, 2, 1.0, medians[:-1])
    expected = values.copy()
    for i in range(1, values.size - 1):
        three = values[i - 1 : i + 2]
        expected[i] = values[i] if np.isnan(three).any() else np.median(three)
    np.testing.assert_array_equal(medians[:-1], expected[2:297].astype(np.float32))
    running_medians(values[-3:], 2, 1.0, medians[-1:])
    np.testing.assert_array_equal(medians[-1], values[-1].astype(np.float32))


def swings_removed(values, least):
    """The alternating extremes left when the smallest swing between neighbours goes, again and
    again, until none is below `least`.
    """
    at = [
        0,
        *(
            i
            for i in range(1, len(values) - 1)
            if (values[i] - values[i - 1]) * (values[i + 1] - values[i]) < 0
        ),
        len(values) - 1,
    ]
    while len(at) > 1:
        swings = [abs(values[b] - values[a]) for a, b in pairwise(at)]
        k = int(np.argmin(swings))
        if swings[k] >= least:
            break
        # at an end only the end goes: what is beside it is an extreme of what is left
        at = at[1:] if k == 0 else at[:-1] if k == len(swings) - 1 else at[:k] + at[k + 2 :]
    return at if len(at) > 1 else []


@settings(deadline=None)  # the first call loads the kernel
@given(st.integers(0, 10_000), st.integers(2, 60), st.floats(0.1, 6.0))
def test_turning_points_are_what_is_left_of_the_swings(seed, size, least):
    values = np.random.default_rng(seed).normal(size=size).cumsum().astype(np.float32)
    points = np.empty(size + 1, np.int32)
    count = turning_points(values, least, points)
    assert points[:count].tolist() == swings_removed(values.astype(float), least)


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


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
@pytest.mark.filterwarnings("ignore:All-NaN")
def test_medians_around(share):
    values = holed(np.random.default_rng(1802), 50, share)
    np.testing.assert_array_equal(
        usual(values), [np.nanmedian(values[max(i - 3, 0) : i + 4]) for i in range(50)]
    )


@pytest.mark.parametrize("size", [4096, 4095, 7])
def test_white_noise_is_the_median_of_sixth_differences(size):
    values = np.random.default_rng(1803).normal(size=size)
    values[size // 2 + 5 :: 97] = np.nan
    sizes = np.abs(np.diff(values, DIFFERENCE_ORDER))
    expected = np.median(sizes[np.isfinite(sizes)]) / NORMAL_MEDIAN / DIFFERENCE_GAIN
    assert white_noise(values) == pytest.approx(expected, rel=1e-12)


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
        ROW, time_s=axis.at(index), index=index, omega_rad_s=OMEGA, alpha_rad_s2=alpha, stretch=0.1
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
    windows = gather(signal_of(values, axis, sign), start, TEMPLATE.window_rad)
    found = fit_passages(windows, TEMPLATE, start, np.ones(5))
    np.testing.assert_allclose(found["height"], height, rtol=2e-3)
    np.testing.assert_allclose(found["offset"], offset, atol=2e-3)
    np.testing.assert_allclose(found["omega_rad_s"], OMEGA * (1 + stretch), rtol=2e-3)
    np.testing.assert_allclose(
        (found["time_s"] - start["time_s"]) * OMEGA, shift / (1 + stretch), atol=2e-4
    )
    assert not (
        found["holds_lost"] | found["holds_spike"] | found["holds_clipped"] | found["outside"]
    ).any()


def reference_step(values, weight, tau, omega, alpha, height, stretch):
    """Solution and covariance of one linearised step by a weighted least squares of rows with a
    prior row for the stretch.
    """
    phi = (omega + 0.5 * alpha * tau) * tau
    shape, slope = np.interp(phi, PHI, TEMPLATE.values), np.interp(phi, PHI, TEMPLATE.slope)
    design = np.column_stack([np.ones(phi.size), shape, slope, phi * slope])[weight]
    prior = np.array([[0, 0, 0, NOISE / (height * stretch)]])
    rows, wanted = np.vstack([design, prior]), np.append(values[weight], 0.0)
    return np.linalg.lstsq(rows, wanted, rcond=None)[0], np.linalg.inv(rows.T @ rows)


def test_the_fit_is_two_steps_of_least_squares_with_the_cramer_rao_bound():
    axis = TimeAxis.uniform(1000, RATE_HZ)
    values, start, *_ = passages_of_the_template(1811, axis)
    values += np.random.default_rng(1811).normal(0, NOISE, values.size)
    values[[310, 502]] = np.nan
    values[505] += 0.5
    held = 2e-3
    start["stretch"] = held
    windows = gather(signal_of(values, axis), start, TEMPLATE.window_rad)
    found = fit_passages(windows, TEMPLATE, start, np.ones(5))
    assert found["holds_lost"].tolist() == [False, True, True, False, False]
    assert found["holds_spike"].tolist() == [False, False, True, False, False]
    for k in range(5):
        at = np.arange(windows.spans["first"][k], windows.spans["stop"][k])
        weight = np.isfinite(values[at]) & (at != 505)
        time_s, omega, height = start["time_s"][k], start["omega_rad_s"][k], 1.0
        for _ in range(2):
            solution, covariance = reference_step(
                values[at],
                weight,
                at / RATE_HZ - time_s,
                omega,
                start["alpha_rad_s2"][k],
                height,
                held,
            )
            height = solution[1]
            time_s, omega = (
                time_s - solution[2] / height / omega,
                omega * (1 + solution[3] / height),
            )
        assert found["used"][k] == weight.sum()
        assert found["time_s"][k] == pytest.approx(time_s, abs=1e-9)
        assert found["omega_rad_s"][k] == pytest.approx(omega, rel=1e-6)
        assert found["height"][k] == pytest.approx(height, rel=1e-6)
        assert found["offset"][k] == pytest.approx(solution[0], abs=1e-6)
        assert found["time_se_s"][k] == pytest.approx(
            NOISE * np.sqrt(covariance[2, 2]) / (height * omega), rel=1e-5
        )
        assert found["omega_se_rad_s"][k] == pytest.approx(
            NOISE * np.sqrt(covariance[3, 3]) / height * omega, rel=1e-5
        )


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_windows_that_are_clipped_outside_or_empty_say_so(sign):
    axis = TimeAxis.uniform(1000, RATE_HZ)
    values, start, height, *_ = passages_of_the_template(1812, axis)
    values[:400] = np.nan
    top = np.max(values[400:600]) - 0.2 * height[2]
    values[400:600] = np.minimum(values[400:600], top)
    values[600:] = np.minimum(values[600:], top - 1e-6)
    start["index"][4] = 999.0
    found = fit_passages(
        gather(signal_of(values, axis, sign), start, TEMPLATE.window_rad), TEMPLATE, start, height
    )
    assert found["holds_clipped"].tolist()[:4] == [False, False, True, False]
    assert found["outside"].tolist() == [False, False, False, False, True]
    assert found["holds_lost"].tolist()[:4] == [True, True, False, False]
    assert found["used"].tolist()[:2] == [0, 0]
    np.testing.assert_allclose(found["time_s"][:2], start["time_s"][:2])


def test_a_long_window_is_thinned():
    axis = TimeAxis.uniform(20_000, 50_000.0)
    values, start, height, *_ = passages_of_the_template(1813, axis, n=2)
    found = fit_passages(
        gather(signal_of(values, axis), start, TEMPLATE.window_rad), TEMPLATE, start, height
    )
    assert (found["used"] <= MOST_SAMPLES).all()
    assert (found["used"] > MOST_SAMPLES // 2).all()
    np.testing.assert_allclose(found["height"], height, rtol=2e-3)


def test_the_sums_of_a_template_are_those_of_a_spline_of_order_four():
    from scipy.interpolate import BSpline

    axis = TimeAxis.uniform(1000, RATE_HZ)
    values, start, height, offset, *_ = passages_of_the_template(1814, axis)
    values[450] = np.nan
    window = 0.35
    summed = curve_sums(gather(signal_of(values, axis), start, 0.4), start, offset, height, window)
    knots = (np.arange(-3, INTERVALS + 4) - INTERVALS / 2) * (2 * window / INTERVALS)
    normal, right, count = np.zeros((INTERVALS + 3,) * 2), np.zeros(INTERVALS + 3), 0
    for k, rough in enumerate(start["time_s"]):
        at = np.arange(200 * k, 200 * (k + 1))
        tau = at / RATE_HZ - rough
        phi = (start["omega_rad_s"][k] + 0.5 * start["alpha_rad_s2"][k] * tau) * tau
        good = np.isfinite(values[at]) & (np.abs(phi) < window)
        basis = BSpline.design_matrix(phi[good], knots, 3).toarray()
        normal += basis.T @ basis
        right += basis.T @ ((values[at][good] - offset[k]) / height[k])
        count += int(good.sum())
    assert summed[2] == count
    np.testing.assert_allclose(np.triu(summed[0]), np.triu(normal), atol=1e-9)
    np.testing.assert_allclose(summed[1], right, atol=1e-9)
    assert np.count_nonzero(np.tril(summed[0], -1)) == 0
