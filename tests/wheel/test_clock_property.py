"""Property: a clock that runs wrong is told from an instrument that changes its rate."""

import numpy as np
import pytest

from tirelog.data.recording import TimeAxis
from tirelog.wheel.rolling import off_clock

TURN_M = 2.0
#: the jump is while the wheel gains or loses speed
SECONDS, JUMP_S = 40.0, 35.0


def turns(knots_s, speeds_m_s):
    """Ends of the turns [s] of a wheel that drives so."""
    fine = np.arange(0.0, SECONDS, 1e-3)
    turned = np.cumsum(np.interp(fine, knots_s, speeds_m_s)) * 1e-3 / TURN_M
    return np.interp(np.arange(1, int(turned[-1])), turned, fine)


def marked(stamps_s, ends_s):
    return off_clock(TimeAxis.of_times(stamps_s), ends_s[:-1], ends_s[1:])


DRIVES = {
    "constant": ([0, 40], [10, 10]),
    "faster": ([0, 32, 38, 40], [6, 6, 16, 16]),
    "slower": ([0, 32, 38, 40], [16, 16, 6, 6]),
}


@pytest.mark.parametrize("drive", DRIVES)
def test_a_clock_that_runs_slow_is_found_and_no_instrument_that_is_slower(drive):
    """Whatever the wheel does."""
    true, ends = np.arange(SECONDS * 2500.0) / 2500.0, turns(*DRIVES[drive])
    slower = np.concatenate([true[true < JUMP_S], np.arange(JUMP_S, SECONDS, 1.0 / 2400.0)])
    assert not marked(slower, ends).any()
    stamps = np.where(true < JUMP_S, true, JUMP_S + 1.06 * (true - JUMP_S))
    late, found = ends[:-1] > JUMP_S, marked(stamps, np.interp(ends, true, stamps))
    assert found[late][1:].all()
    assert not found[~late][:-1].any()


@pytest.mark.parametrize(("first", "stop"), [(0, 1), (0, 2), (-3, -1), (-2, -1), (20, 24)])
def test_a_clock_that_runs_slow_for_a_turn_or_two_is_found_at_the_ends_too(first, stop):
    true, ends = np.arange(SECONDS * 2500.0) / 2500.0, turns(*DRIVES["constant"])
    begin_s, end_s = ends[first], ends[stop]
    stamps = true + 0.1 * (np.clip(true, begin_s, end_s) - begin_s)
    found = marked(stamps, np.interp(ends, true, stamps))
    late = (ends[:-1] > begin_s - 1e-9) & (ends[1:] < end_s + 1e-9)
    np.testing.assert_array_equal(found, late)
