"""Faults: clocks and values beyond all reason make no numpy warning and no false number."""

import numpy as np
import pytest

from tirelog.data.recording import TimeAxis
from tirelog.dsp.filters import sliding_mean
from tirelog.strain.passages.passage_flags import may_have_stopped

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")


def test_a_clock_beyond_all_time():
    axis = TimeAxis(10, 1.0, np.zeros(1, np.int64), np.array([1e308]), np.array([1e308]))
    assert axis.at(9.0) == np.inf
    still = TimeAxis(10, 1.0, np.zeros(1, np.int64), np.zeros(1), np.zeros(1))
    assert still.index(np.array([1.0])) == 9.0


def test_stamps_that_repeat_are_no_stop():
    assert may_have_stopped(np.zeros(9)).tolist() == [False] * 8
    assert not may_have_stopped(0.125 * np.arange(12.0)).any()  # exactly one speed
    assert may_have_stopped(np.repeat([0.0, 1.0, 1.5], 4)).shape == (11,)


def test_a_mean_of_values_beyond_all_sums():
    assert not np.isfinite(sliding_mean(np.full(9, 1e308), 3)).any()
    np.testing.assert_allclose(sliding_mean(np.full(9, 1e300), 3), 1e300)
