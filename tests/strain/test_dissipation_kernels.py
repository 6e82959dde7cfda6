"""Closed form: the compiled loops of the dissipation against plain numpy, written another way.

Seeds from 1000: none was used for tuning.
"""

from __future__ import annotations

import numpy as np
import pytest

from tirelog.dsp.filters import bridged, differentiator
from tirelog.strain.dissipation import ENERGY, revolution_sums


@pytest.mark.parametrize("half", [10, 13, 3])
@pytest.mark.parametrize("cut", [2000, 700])
def test_sums_are_those_of_the_filtered_gradient_wherever_the_values_are_cut(half, cut):
    rng = np.random.default_rng(1830)
    values, side = rng.normal(size=2000).cumsum(), rng.normal(size=half)
    low, high = np.array([0, 300, 690, 1501, 1990]), np.array([300, 691, 1202, 1703, 2000])
    kernel = np.concatenate([side[::-1], [0.0], -side])
    slope = np.pad(np.convolve(values, kernel, "valid"), half)
    change = np.gradient(slope)
    expected = [
        [np.sum(slope[a:b] ** 2), np.sum(change[a:b] ** 2)] for a, b in zip(low, high, strict=True)
    ]
    sums = summed(values, side, low, high, cut)
    np.testing.assert_allclose(sums[[6, 5, 4, 3, 1]], expected, rtol=1e-12)
    assert np.count_nonzero(sums[[0, 2]]) == 0
    np.testing.assert_array_equal(sums, summed(values, side, low, high, 92))


def summed(values, side, low, high, cut):
    """The sums of five rows among seven, some values at a time."""
    sums, reach = np.zeros(7, ENERGY), side.size + 3
    rows = np.array([6, 5, 4, 3, 1])
    for start in range(0, 2000, cut):
        first, stop = max(start - reach, 0), min(start + cut, 2000)
        part = values[first : min(stop + reach, 2000)]
        begin, end = np.maximum(low, start) - first, np.minimum(high, stop) - first
        revolution_sums(part, side, rows, begin, end, sums)
    return sums.view(float).reshape(7, 2)


def test_values_shorter_than_the_filter_have_no_energy():
    sums = np.zeros(1, ENERGY)
    revolution_sums(
        np.arange(15.0),
        np.ones(10),
        np.array([0]),
        np.array([0]),
        np.array([15]),
        sums,
    )
    assert sums.tolist() == [(0.0, 0.0)]


def test_the_side_is_the_half_of_the_filter_that_reaches_ahead():
    how = differentiator(1000.0, 200.0)
    half = how.size // 2
    sums = np.zeros(1, ENERGY)
    values = 3.0 * np.arange(100.0) / 1000.0
    side = how[:half][::-1].copy()
    revolution_sums(values, side, np.array([0]), np.array([40]), np.array([60]), sums)
    np.testing.assert_allclose(sums.view(float), [20 * 9.0, 0.0], rtol=1e-3, atol=1e-9)


def plainly_bridged(values, wild):
    """By its words: which samples go, then each replaced."""
    bend = np.zeros(values.size)
    for i in range(2, values.size - 2):
        bend[i] = abs(
            values[i] - (4 * (values[i - 1] + values[i + 1]) - values[i - 2] - values[i + 2]) / 6
        )
    bend = np.nan_to_num(bend)
    lost = np.isnan(values)
    around = np.pad(bend, 1)
    lost |= (bend > wild) & (bend >= around[:-2]) & (bend >= around[2:])
    if lost.all():
        return np.zeros_like(values)
    known = np.flatnonzero(~lost)
    filled = values.copy()
    for i in np.flatnonzero(lost):
        near = [i - 2, i - 1, i + 1, i + 2]
        if near[0] >= 0 and near[-1] < values.size and not lost[near].any():
            filled[i] = np.polyval(np.polyfit([-2, -1, 1, 2], values[near], 3), 0.0)
        else:
            filled[i] = np.interp(i, known, values[known])
    return filled


@pytest.mark.parametrize("share", [0.0, 0.01, 0.2, 0.9])
@pytest.mark.parametrize("size", [3, 6, 400])
def test_bridging(size, share):
    rng = np.random.default_rng(1831)
    values = rng.normal(0, 0.01, size).cumsum()
    values[rng.random(size) < 0.02] += 1.0
    values[rng.random(size) < share] = np.nan
    np.testing.assert_allclose(bridged(values, 0.2), plainly_bridged(values, 0.2), atol=1e-12)


def test_runs_at_both_ends_and_nothing_left():
    values = np.array([np.nan, np.nan, 1.0, 2.0, np.nan, np.nan, 5.0, 5.0, np.nan])
    assert bridged(values, 10.0).tolist() == [1.0, 1.0, 1.0, 2.0, 3.0, 4.0, 5.0, 5.0, 5.0]
    assert bridged(np.full(6, np.nan), 1.0).tolist() == [0.0] * 6


def test_good_values_are_not_copied():
    values = np.random.default_rng(1832).normal(size=100)
    assert bridged(values, 100.0) is values
