"""Faults: lost samples, gaps, spikes, jumps, clipping, and logs with next to nothing in them."""

from __future__ import annotations

import numpy as np
import pytest

from tests.strain.conftest import without_rows
from tirelog.data.recording import Channel, TimeAxis
from tirelog.strain.passages.find import find_passages
from tirelog.vocabulary.quality import Quality, good, having

DRIVE = ([0, 2, 8, 16, 19, 24, 40], [6, 6, 25, 25, 12, 12, 20])


@pytest.fixture(scope="module")
def steady(drive):
    return drive(*DRIVE, seed=1101)


def assert_all_found(found, truth, worst_s=2e-4):
    assert truth.nearest(found.time_s).tolist() == list(range(len(truth.time_s)))
    off = found.time_s - truth.time_s
    clean = good(found.quality)
    assert np.abs(off - np.median(off))[clean].max(initial=0.0) < worst_s


def rows_with_lost(values, truth, index, window_s):
    """Rows whose true centre has a lost sample within the window."""
    lost = np.flatnonzero(np.isnan(values)) / 2500.0
    return np.array(
        [np.any(np.abs(lost - t) < w) for t, w in zip(truth.time_s, window_s, strict=True)]
    )


@pytest.mark.parametrize("share", [0.005, 0.1])
def test_lost_samples_are_flagged_where_they_are(steady, radius_m, share):
    values = steady.values.copy()
    values[
        np.random.default_rng(1101).choice(values.size, int(share * values.size), replace=False)
    ] = np.nan
    found = find_passages(steady.with_values(values), radius_m)
    assert_all_found(found, steady)
    window_s = found.window_rad / found.omega_rad_s
    flagged = having(found.quality, Quality.LOST_PEAK)
    # at the very border of the window either answer will do
    assert flagged[rows_with_lost(values, steady, found.index, 0.97 * window_s)].all()
    assert not flagged[~rows_with_lost(values, steady, found.index, 1.03 * window_s)].any()


def test_a_passage_in_lost_samples_keeps_its_row(steady, radius_m):
    values = steady.values.copy()
    for k in (100, 150, 151):
        middle = int(steady.time_s[k] * 2500)
        values[middle - 50 : middle + 50] = np.nan
    found = find_passages(steady.with_values(values), radius_m)
    assert_all_found(found, steady)
    assert np.flatnonzero(~found.measured).tolist() == [100, 150, 151]
    assert (found.quality[[100, 150, 151]] == Quality.LOST_PEAK).all()
    assert np.abs(found.time_s - steady.time_s)[[100, 150, 151]].max() < 2e-3
    others = np.delete(np.arange(len(found)), [100, 150, 151])
    assert not found.quality[others].any()


def test_spikes_of_any_size_are_ignored_and_said(steady, radius_m):
    rng = np.random.default_rng(1102)
    values, where = steady.values.copy(), rng.choice(steady.values.size, 300, replace=False)
    values[where] += rng.choice([-1, 1], 300) * rng.uniform(2e-4, 5e-3, 300)
    found = find_passages(steady.with_values(values), radius_m)
    assert_all_found(found, steady)
    assert (
        np.abs(found.time_s - steady.time_s - np.median(found.time_s - steady.time_s)).max() < 2e-4
    )
    middle = np.array([np.abs(where / 2500.0 - t).min() for t in steady.time_s]) < 0.03 / np.abs(
        steady.speed_m_s
    )
    assert having(found.quality, Quality.SPIKE)[middle].all()


@pytest.mark.parametrize("seed", [1103, 1104, 1105])
def test_mode_hops_as_high_as_the_patch_invent_nothing(steady, radius_m, seed):
    rng = np.random.default_rng(seed)
    values = steady.values.copy()
    for start in rng.choice(values.size - 20, 12, replace=False):
        values[start : start + rng.integers(3, 12)] += rng.choice([-1, 1]) * 1e-3
    assert_all_found(find_passages(steady.with_values(values), radius_m), steady)


def test_clipped_patches_are_timed_by_their_flanks(steady, radius_m):
    found = find_passages(steady.with_values(np.maximum(steady.values, -6e-4)), radius_m)
    assert_all_found(found, steady)
    assert (found.quality == Quality.CLIPPED).all()
    off = found.time_s - steady.time_s
    assert np.abs(off - np.median(off)).max() < 2e-5


def test_a_coarse_scale_is_not_clipping(steady, radius_m):
    step = 10 * 1.27e-3 / 1550.0
    found = find_passages(
        steady.with_values(np.round(steady.values / step) * step, resolution=step), radius_m
    )
    assert_all_found(found, steady)
    assert not having(found.quality, Quality.CLIPPED).any()


@pytest.mark.parametrize("seconds", [0.04, 0.5, 10.0])
def test_gaps_break_the_turns_and_lose_only_what_they_hold(steady, radius_m, seconds):
    cut, gap = 40_000, int(seconds * 2500)
    kept = np.ones(steady.values.size, bool)
    kept[cut : cut + gap] = False
    found = find_passages(without_rows(steady, kept), radius_m)
    reach = 0.17 / np.abs(steady.speed_m_s)
    begin, end = cut / 2500, (cut + gap) / 2500
    touched = (steady.time_s + reach > begin) & (steady.time_s - reach < end)
    assert set(np.flatnonzero(~touched)) <= set(steady.nearest(found.time_s))
    assert len(set(steady.nearest(found.time_s))) == len(found)
    gaps = having(found.break_after, Quality.GAP).sum()
    assert gaps == 1 if touched.any() and seconds > 0.1 else gaps <= 1


def test_doubts_of_the_reader_reach_their_rows_only(steady, radius_m):
    middle = int(steady.time_s[60] * 2500)
    channel = Channel.of_array(
        "grating",
        "strain",
        steady.values,
        steady.channel.axis,
        flags=((middle, middle + 2, Quality.SPURIOUS_PEAK),),
    )
    found = find_passages(channel, radius_m)
    assert np.flatnonzero(having(found.quality, Quality.SPURIOUS_PEAK)).tolist() == [60]


@pytest.mark.parametrize("share", [-0.2, -0.1, 0.1, 0.2])
def test_speeds_beside_a_clock_set_back_are_those_of_their_own_side(steady, radius_m, share):
    """A share of a turn lacks or stands twice, and the time runs on; 25 m/s from 8 s to 16 s."""
    turn = 2 * np.pi * radius_m / 25.0
    before = steady.time_s[(steady.time_s > 12.0)][0]
    cut, shift = round((before + 0.4 * turn) * 2500), round(share * turn * 2500)
    values = np.concatenate([steady.values[:cut], steady.values[cut - shift :]])
    axis = TimeAxis.uniform(values.size, 2500.0)
    doubt = (cut - 1, cut + 1, Quality.CLOCK_SET_BACK)
    channel = Channel.of_array("grating", "strain", values, axis, flags=(doubt,))
    found = find_passages(channel, radius_m)
    cruise = (found.time_s > 9.0) & (found.time_s < 15.0)
    assert np.abs(found.speed_m_s[cruise] / 25.0 - 1.0).max() < 0.002
    beside = np.flatnonzero(cruise & (found.sides < 2))
    assert np.abs(found.time_s[beside] - before - [0.0, (1.0 + share) * turn]).max() < 1e-3
    assert having(found.break_after, Quality.GAP).sum() == 1


@pytest.mark.parametrize("samples", [0, 1, 2, 3, 5, 7, 100])
@pytest.mark.parametrize("fill", [0.0, np.nan])
def test_next_to_nothing_gives_no_rows(radius_m, samples, fill):
    channel = Channel.of_array(
        "grating", "strain", np.full(samples, fill), TimeAxis.uniform(samples, 2500.0)
    )
    assert len(find_passages(channel, radius_m)) == 0


@pytest.mark.parametrize("samples", [2, 4, 6])
def test_a_jump_inside_the_patch_does_not_make_two_of_it(steady, radius_m, samples):
    values = steady.values.copy()
    for k in (20, 21, 90, 200):
        middle = int(steady.time_s[k] * 2500)
        values[middle - samples // 2 : middle - samples // 2 + samples] += 1.2e-3
    found = find_passages(steady.with_values(values), radius_m)
    assert_all_found(found, steady)
    assert having(found.quality, Quality.SPIKE)[[20, 21, 90, 200]].all()
