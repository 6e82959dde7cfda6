"""Closed form: at a known speed passages come when the wheel has made whole turns, however few
samples a patch has and wherever samples are missing.

Seeds from 1200: none was used for tuning.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests.strain.conftest import without_rows
from tirelog.strain.passages.find import find_passages
from tirelog.strain.speed import speed_quality
from tirelog.vocabulary.quality import Quality, having

BREAKS = Quality.STANDSTILL | Quality.REVERSING


def assert_one_row_each(found, truth):
    """A row for each true passage, in order."""
    assert truth.nearest(found.time_s).tolist() == list(range(len(truth.time_s)))


@pytest.mark.parametrize(
    ("rate_Hz", "speed"),
    [(2500, 50), (5000, 45), (5000, 50), (5000, 75), (10_000, 50), (10_000, 75), (20_000, 75)],
)
def test_fast_passages_are_all_found(drive, pulses, radius_m, rate_Hz, speed):
    def short_patch(xi_m, speed_m_s):  # 75 mm at half level
        return pulses["beam"](1.5 * xi_m, speed_m_s)

    d = drive(
        [0, 4.4], [speed, speed], seed=1201, rate_Hz=float(rate_Hz), pulse=short_patch, drift=0.0
    )
    found = find_passages(d.channel, radius_m)
    assert_one_row_each(found, d)
    assert not found.doubt
    assert not speed_quality(found)[1:-1].any()
    # at 2.5 kHz half of a patch has four samples, and a turn 96
    np.testing.assert_allclose(found.speed_m_s[1:-1], speed, rtol=2e-3)


def test_a_log_that_becomes_fast_keeps_every_passage(drive, radius_m):
    d = drive([0, 20], [5, 70], seed=1202, rate_Hz=5000.0)
    found = find_passages(d.channel, radius_m)
    assert_one_row_each(found, d)
    assert not having(speed_quality(found), BREAKS | Quality.LOST_PEAK).any()
    np.testing.assert_allclose(found.speed_m_s[1:-1], d.speed_m_s[1:-1], rtol=2e-3)


@pytest.mark.parametrize("seed", [1203, 1204])
def test_a_fast_wheel_does_not_stand_still_if_no_patch_is_seen(drive, radius_m, seed):
    d = drive([0, 10], [40, 40], seed=seed, rate_Hz=5000.0)
    values, rng = d.values.copy(), np.random.default_rng(seed)
    blind = np.sort(rng.choice(np.arange(3, len(d.time_s) - 3), 20, replace=False))
    for time_s in d.time_s[blind]:
        middle, reach = int(time_s * 5000.0), int(0.2 / 40.0 * 5000.0)
        values[middle - reach : middle + reach] = values[middle - reach]
    found = find_passages(d.with_values(values), radius_m)
    assert_one_row_each(found, d)
    assert np.flatnonzero(~found.measured).tolist() == blind.tolist()
    words = speed_quality(found)
    assert having(words, Quality.LOST_PEAK)[blind].all()
    assert not having(words, BREAKS).any()
    np.testing.assert_allclose(found.speed_m_s[1:-1], 40.0, rtol=5e-3)


@pytest.mark.parametrize(("share", "seed"), [(0.003, 1205), (0.01, 1206), (0.03, 1207)])
def test_missing_rows_hide_no_passage(drive, radius_m, share, seed):
    d = drive([0, 20], [6, 15], seed=seed)
    kept = np.random.default_rng(seed).random(d.values.size) >= share
    kept[[0, -1]] = True
    found = find_passages(without_rows(d, kept), radius_m)
    assert_one_row_each(found, d)
    missing_s = np.flatnonzero(~kept) / 2500.0
    near = np.abs(missing_s[:, None] - found.time_s).min(axis=0) * found.omega_rad_s
    flagged = having(found.quality, Quality.GAP)
    # at the very border of the window either answer will do
    assert flagged[near < 0.95 * found.window_rad].all()
    assert not flagged[near > 1.05 * found.window_rad].any()
    clean = (speed_quality(found) == 0) & np.isfinite(found.speed_m_s)
    assert clean.sum() > 20
    np.testing.assert_allclose(found.speed_m_s[clean], d.speed_m_s[clean], rtol=2e-3)


def test_passages_in_a_gap_count_as_turns(drive, radius_m):
    d = drive([0, 20], [6, 15], seed=1208)
    kept = np.ones(d.values.size, bool)
    for first, last in ((20, 20), (40, 41)):
        reach = int(0.2 / d.speed_m_s[first] * 2500.0)
        begin, end = (int(t * 2500.0) for t in d.time_s[[first, last]])
        kept[begin - reach : end + reach] = False
    found = find_passages(without_rows(d, kept), radius_m)
    assert_one_row_each(found, d)
    assert np.flatnonzero(~found.measured).tolist() == [20, 40, 41]
    assert (found.quality[[20, 40, 41]] == Quality.GAP | Quality.LOST_PEAK).all()
    assert np.abs(found.time_s - d.time_s)[[20, 40, 41]].max() < 3e-3
