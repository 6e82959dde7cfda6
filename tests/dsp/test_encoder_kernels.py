"""Closed form: the compiled kernels against a plain reference that shares nothing with them (loops,
scipy's filters, root finding, splines).
"""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline
from scipy.ndimage import maximum_filter1d
from scipy.optimize import brentq

from tirelog.dsp import teeth as encoder_signal
from tirelog.dsp.encoder import (
    CHUNK,
    WINDOW,
    AngleFunction,
    extremes,
    sliding_maximum,
    without_spikes,
)
from tirelog.dsp.pitch import MOST_REACH, SLOPE, VALUE

RATE = 10_000.0


def reader(values):
    return lambda start, stop: values[max(start, 0) : stop]


def drive():
    """A sine that quickens, with noise, drift, a growing amplitude and a few glitches."""
    random = np.random.default_rng(21)
    time = np.arange(0, 2.0, 1 / RATE)
    values = (1 + 0.2 * time) * np.sin(2 * np.pi * (150 * time + 60 * time**2)) + 0.3 * time
    values += 0.05 * random.standard_normal(time.size)
    glitches = random.integers(1000, time.size - 1000, 5)
    values[glitches] += 4.0
    return values, glitches


def thresholds(x, found):
    """Upper and lower level of every sample, by the definition: extremes of chunks without
    glitches, over the time that is followed.
    """
    count = -(-x.size // CHUNK)
    reach = int(np.ceil(0.5 * found.follow_s * RATE / CHUNK))
    levels = []
    for sign in (1, -1):
        top = np.array([(sign * x[c * CHUNK : (c + 1) * CHUNK]).max() for c in range(count)])
        far = [top[np.clip(np.arange(count) + k, 0, count - 1)] for k in (-3, -2, 2, 3)]
        top = np.minimum(top, np.max(far, axis=0))
        levels.append(sign * maximum_filter1d(top, 2 * reach + 1, mode="nearest"))
    middle, half = (
        (levels[0] + levels[1]) / 2,
        encoder_signal.HYSTERESIS * (levels[0] - levels[1]) / 2,
    )
    return (np.repeat(level, CHUNK)[: x.size] for level in (middle + half, middle - half))


def plain_crossings(x, found):
    """(before, after) of every change of side."""
    upper, lower = thresholds(x, found)
    changes, side, at = [], 0, -1
    for i, value in enumerate(x):
        now = 1 if value > upper[i] else -1 if value < lower[i] else 0
        if now * side < 0:
            changes.append((at, i))
        if now:
            side, at = now, i
    return changes


def plain_places(x, changes):
    """Each change placed by the sine whose samples have the measured ratio of sum to difference,
    found by bisection.
    """
    coarse = np.array([(a + b) / 2 for a, b in changes])
    area = np.concatenate([[0], np.cumsum(x)])
    rough, levels = [], []
    for k, (a, b) in enumerate(changes):
        first, last = max(k - 4, 0), min(k + 4, len(changes) - 1)
        last -= (last - first) % 2
        below = np.interp(coarse[[first, last]] + 0.5, np.arange(area.size), area)
        level = (below[1] - below[0]) / (coarse[last] - coarse[first])
        levels.append(level)
        rough.append(a + np.clip((level - x[a]) / (x[b] - x[a]), 0, 1) * (b - a))
    places = []
    for k, start in enumerate(rough):
        steps = np.diff(rough[max(k - 1, 0) : k + 2])
        half = steps.min() if steps.max() > 1.8 * steps.min() else steps.mean()
        centre, reach = int(start + 0.5), max(int(WINDOW * half), 1)
        near = np.arange(-reach, reach + 1)
        y = x[centre + near] - levels[k]

        def mismatch(shift, near=near, half=half, y=y):
            sine = np.sin(np.pi * (near + shift) / half)
            return sine.sum() * (np.sign(near) @ y) - y.sum() * (np.sign(near) @ sine)

        places.append(centre - brentq(mismatch, -0.45 * half, 0.45 * half, xtol=1e-12))
    return np.array(places)


def test_crossings_are_those_of_the_plain_reference():
    values, glitches = drive()
    found = encoder_signal.probe(reader(values), values.size)
    pieces = list(encoder_signal.crossings(reader(values), values.size, RATE, found, block=6000))
    index = np.concatenate([piece.index for piece in pieces])
    rising = np.concatenate([piece.rising for piece in pieces])
    changes = plain_crossings(values, found)
    assert index.size == len(changes) > 1000
    assert rising.tolist() == [bool(values[after] > values[before]) for before, after in changes]
    inner = np.abs(index[:, None] - glitches).min(axis=1) > 100  # beside a glitch there is no sine
    inner[[0, -1]] = False  # at the ends the one neighbour's half period is taken twice
    np.testing.assert_allclose(
        index[inner], plain_places(values, changes)[inner], rtol=0, atol=1e-8
    )


@pytest.mark.parametrize("size", [1, 63, 64, 65, 1000])
def test_extremes_of_chunks(size):
    x = np.random.default_rng(size).standard_normal(size)
    high, low = extremes(x)
    parts = [x[start : start + CHUNK] for start in range(0, size, CHUNK)]
    assert high.tolist() == [part.max() for part in parts]
    assert low.tolist() == [part.min() for part in parts]


@pytest.mark.parametrize("reach", [1, 3, 24, 500])
def test_sliding_maximum(reach):
    x = np.random.default_rng(reach).standard_normal(777)
    assert np.array_equal(
        sliding_maximum(x, reach), maximum_filter1d(x, 2 * reach + 1, mode="nearest")
    )


def test_a_glitch_is_no_extreme_and_a_tooth_is():
    high = np.full(40, 1.0)
    high[10], high[20:26] = 5.0, 2.0
    clean = without_spikes(high)
    assert clean[10] == 1.0
    assert clean[20:26].tolist() == [2.0] * 6


@pytest.mark.parametrize("order", ["ascending", "any"])
def test_the_angle_is_the_spline_through_the_knots(order):
    random = np.random.default_rng(5)
    time = np.linspace(0, 10, 200) + random.uniform(-0.01, 0.01, 200)
    count = np.cumsum(random.integers(0, 5, 200)).astype(np.int32)
    rate = random.uniform(10, 60, 200).astype(np.float32)
    function = AngleFunction(time, count, 0.07, rate, np.zeros(200, np.int32), 1e-4)
    at = random.uniform(time[0], time[-1], 3000)
    at = np.sort(at) if order == "ascending" else at
    np.testing.assert_allclose(
        function.at(at), CubicHermiteSpline(time, 0.07 * count, rate.astype(float))(at), atol=1e-8
    )
    outside = function.at(np.array([time[0] - 1e-9, time[0], time[-1], time[-1] + 1e-9, np.nan]))
    assert np.isfinite(outside).tolist() == [False, True, True, False, False]


def test_the_local_cubics_weights_reproduce_cubics_and_no_more():
    place = np.arange(-MOST_REACH, MOST_REACH + 1.0)
    for value, slope in zip(VALUE[3:], SLOPE[3:], strict=True):
        for power, (true_value, true_slope) in enumerate([(1, 0), (0, 1), (0, 0), (0, 0)]):
            assert value @ place**power == pytest.approx(true_value, abs=1e-9)
            assert slope @ place**power == pytest.approx(true_slope, abs=1e-9)
    # Savitzky and Golay's numbers for seven points
    np.testing.assert_allclose(
        21 * VALUE[3, MOST_REACH - 3 : MOST_REACH + 4], [-2, 3, 6, 7, 6, 3, -2], atol=1e-9
    )
