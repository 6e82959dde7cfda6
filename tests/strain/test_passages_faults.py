"""Faults: lost samples, gaps, bursts, jumps, rails and clipping take no row but their own."""

from dataclasses import replace

import numpy as np
import pytest

from tests.strain.conftest import make_drive, without_rows
from tirelog.runs.in_memory import without_spikes
from tirelog.strain.passages.find import find_passages
from tirelog.strain.speed import speed_quality
from tirelog.vocabulary.quality import Quality, good, having

RATE_HZ = 2500.0
REFERENCE_NM, GAIN = 1550.0, 1.27
BREAKS = Quality.STANDSTILL | Quality.REVERSING


def strain_of(wavelength_nm):
    return (wavelength_nm - REFERENCE_NM) / REFERENCE_NM / GAIN


@pytest.fixture(scope="module")
def steady():
    return make_drive([0, 2, 8, 16, 19, 24, 40], [6, 6, 25, 25, 12, 12, 20], seed=1101)


@pytest.fixture(scope="module")
def recorded():
    """A drive in steps of 0.1 pm, as an instrument writes it."""
    made = make_drive([0, 16], [9, 25], seed=1104, height=6e-4, drift=0.0)
    step = strain_of(REFERENCE_NM + 1e-4)
    return replace(made, values=np.round(made.values / step) * step)


def samples(seconds):
    """The sample nearest to each time."""
    return np.round(np.asarray(seconds) * RATE_HZ).astype(int)


def rows_of_all(found, truth, worst_s=2e-4):
    """Asserts a row for each true passage, in order, and times of good rows; returns errors [s]."""
    assert not found.doubt
    assert truth.nearest(found.time_s).tolist() == list(range(len(truth.time_s)))
    off = found.time_s - truth.time_s
    off -= np.median(off)
    assert np.abs(off)[good(found.quality)].max(initial=0.0) < worst_s
    return off


def assert_marked(found, bad_s, word, border=0.03):
    """A row has the word if something bad lies in its window, and only then."""
    reach = found.window_rad / found.omega_rad_s
    off = np.abs(np.asarray(bad_s) - found.time_s[:, None]).min(axis=1)
    marked = having(found.quality, word)
    assert marked[off < (1 - border) * reach].all()
    assert not marked[off > (1 + border) * reach].any()


@pytest.mark.parametrize("share", [0.005, 0.1])
def test_lost_samples_are_flagged_where_they_are(steady, radius_m, share):
    values = steady.values.copy()
    lost = np.random.default_rng(1101).choice(values.size, int(share * values.size), replace=False)
    values[lost] = np.nan
    found = find_passages(steady.with_values(values), radius_m)
    rows_of_all(found, steady)
    assert_marked(found, lost / RATE_HZ, Quality.LOST_PEAK)


@pytest.mark.parametrize(("share", "seed"), [(0.003, 1205), (0.01, 1206), (0.03, 1207)])
def test_missing_rows_hide_no_passage(radius_m, share, seed):
    d = make_drive([0, 20], [6, 15], seed=seed)
    kept = np.random.default_rng(seed).random(d.values.size) >= share
    kept[[0, -1]] = True
    found = find_passages(without_rows(d, kept), radius_m)
    rows_of_all(found, d, 1e-3)
    assert_marked(found, np.flatnonzero(~kept) / RATE_HZ, Quality.GAP, 0.05)
    clean = (speed_quality(found) == 0) & np.isfinite(found.speed_m_s)
    assert clean.sum() > 20
    np.testing.assert_allclose(found.speed_m_s[clean], d.speed_m_s[clean], rtol=2e-3)


@pytest.mark.parametrize("how", ["lost", "missing"])
@pytest.mark.parametrize("speeds", [(3, 6), (6, 15), (8, 25)])
def test_passages_in_lost_samples_keep_their_rows(radius_m, speeds, how):
    """Below 7.8 m/s a wheel may have stopped in between."""
    d = make_drive([0, 120 / speeds[0]], speeds, seed=1208)
    kept = np.ones(d.values.size, bool)
    gone = [7, 12, 13, 20, 21, 22]
    for first, last in ((7, 7), (12, 13), (20, 22)):
        reach = 0.2 / d.speed_m_s[first]
        kept[slice(*samples([d.time_s[first] - reach, d.time_s[last] + reach]))] = False
    word, channel = Quality.GAP | Quality.LOST_PEAK, without_rows(d, kept)
    if how == "lost":
        word, channel = Quality.LOST_PEAK, d.with_values(np.where(kept, d.values, np.nan))
    found = find_passages(channel, radius_m)
    off = rows_of_all(found, d)
    assert np.flatnonzero(~found.measured).tolist() == gone
    assert (found.quality[gone] == word).all()
    assert np.abs(off[gone]).max() < 5e-3
    assert not np.delete(found.quality, gone).any()
    assert not having(speed_quality(found), BREAKS).any()
    np.testing.assert_allclose(found.speed_m_s, d.speed_m_s, rtol=5e-3)


@pytest.mark.parametrize("seed", [1203, 1204])
def test_a_fast_wheel_does_not_stand_still_if_no_patch_is_seen(radius_m, seed):
    d = make_drive([0, 10], [40, 40], seed=seed, rate_Hz=5000.0)
    values, rng = d.values.copy(), np.random.default_rng(seed)
    blind = np.sort(rng.choice(np.arange(3, len(d.time_s) - 3), 20, replace=False))
    for time_s in d.time_s[blind]:
        middle, reach = int(time_s * 5000.0), int(0.2 / 40.0 * 5000.0)
        values[middle - reach : middle + reach] = values[middle - reach]
    found = find_passages(d.with_values(values), radius_m)
    rows_of_all(found, d)
    assert np.flatnonzero(~found.measured).tolist() == blind.tolist()
    words = speed_quality(found)
    assert having(words, Quality.LOST_PEAK)[blind].all()
    assert not having(words, BREAKS).any()
    np.testing.assert_allclose(found.speed_m_s[1:-1], 40.0, rtol=5e-3)


def test_doubts_of_the_reader_reach_their_rows_only(steady, radius_m):
    middle = samples(steady.time_s[60])
    doubt = (middle, middle + 2, Quality.SPURIOUS_PEAK)
    found = find_passages(steady.with_values(steady.values, flags=(doubt,)), radius_m)
    assert np.flatnonzero(having(found.quality, Quality.SPURIOUS_PEAK)).tolist() == [60]


@pytest.mark.parametrize("seconds", [0.04, 0.5, 10.0])
def test_gaps_break_the_turns_and_lose_only_what_they_hold(steady, radius_m, seconds):
    begin, end = 16.0, 16.0 + seconds
    kept = np.ones(steady.values.size, bool)
    kept[slice(*samples([begin, end]))] = False
    found = find_passages(without_rows(steady, kept), radius_m)
    reach = 0.17 / np.abs(steady.speed_m_s)
    touched = (steady.time_s + reach > begin) & (steady.time_s - reach < end)
    seen = steady.nearest(found.time_s).tolist()
    assert set(np.flatnonzero(~touched)) <= set(seen)
    assert len(set(seen)) == len(seen)
    gaps = having(found.break_after, Quality.GAP).sum()
    assert gaps == 1 if touched.any() and seconds > 0.1 else gaps <= 1


@pytest.mark.parametrize("share", [-0.2, -0.1, 0.1, 0.2])
def test_speeds_beside_a_clock_set_back_are_those_of_their_own_side(steady, radius_m, share):
    """A share of a turn lacks or stands twice, and the time runs on; 25 m/s from 8 s to 16 s."""
    turn = 2 * np.pi * radius_m / 25.0
    before = steady.time_s[(steady.time_s > 12.0)][0]
    cut, shift = samples([before + 0.4 * turn, share * turn])
    values = np.concatenate([steady.values[:cut], steady.values[cut - shift :]])
    doubt = (cut - 1, cut + 1, Quality.CLOCK_SET_BACK)
    found = find_passages(steady.with_values(values, flags=(doubt,)), radius_m)
    cruise = (found.time_s > 9.0) & (found.time_s < 15.0)
    assert np.abs(found.speed_m_s[cruise] / 25.0 - 1.0).max() < 0.002
    beside = np.flatnonzero(cruise & (found.sides < 2))
    assert np.abs(found.time_s[beside] - before - [0.0, (1.0 + share) * turn]).max() < 1e-3
    assert having(found.break_after, Quality.GAP).sum() == 1


def test_spikes_of_any_size_are_ignored_and_said(steady, radius_m):
    rng = np.random.default_rng(1102)
    values, where = steady.values.copy(), rng.choice(steady.values.size, 300, replace=False)
    values[where] += rng.choice([-1, 1], 300) * rng.uniform(2e-4, 5e-3, 300)
    found = find_passages(steady.with_values(values), radius_m)
    assert np.abs(rows_of_all(found, steady)).max() < 2e-4
    inside = np.abs(where / RATE_HZ - steady.time_s[:, None]).min(axis=1) < 0.03 / steady.speed_m_s
    assert having(found.quality, Quality.SPIKE)[inside].all()


@pytest.mark.parametrize("count", [2, 4, 6])
def test_jumps_as_high_as_the_patch_invent_nothing_and_do_not_make_two_of_it(
    steady, radius_m, count
):
    values, hit, rng = steady.values.copy(), [20, 21, 90, 200], np.random.default_rng(1103 + count)
    for start in rng.choice(values.size - 20, 12, replace=False):
        values[start : start + rng.integers(3, 12)] += rng.choice([-1, 1]) * 1e-3
    for first in samples(steady.time_s[hit]) - count // 2:
        values[first : first + count] += 1.2e-3
    found = find_passages(steady.with_values(values), radius_m)
    rows_of_all(found, steady)
    assert having(found.quality, Quality.SPIKE)[hit].all()


#: what an instrument may write in place of samples [nm], over and over
SIZES = 10.0 ** np.random.default_rng(4402).uniform(1.5, 6.0, 20)
BAD = {
    "30 nm": [1580.0],
    "code": [9999.0],
    "zero": [0.0],
    "huge": [-1e18],
    "either sign": [1580.0, 1520.0],
    "any": REFERENCE_NM + SIZES * np.resize([1.0, -1.0], 20),
}


@pytest.mark.parametrize("kind", BAD)
@pytest.mark.parametrize("count", [1, 2, 3, 20])
def test_a_burst_takes_no_row_but_its_own(recorded, radius_m, kind, count):
    before = find_passages(recorded.with_values(recorded.values), radius_m)
    time, hit = recorded.time_s, recorded.values.copy()
    between, inside = 0.5 * (time[[20, 41]] + time[[21, 42]]), time[[30, 60]]
    first = np.array([0, *samples([*between, *inside]), hit.size - count])
    bad = (first[:, None] + np.arange(count)).ravel()
    hit[bad] = strain_of(np.tile(np.resize(BAD[kind], count), first.size))
    found = find_passages(recorded.with_values(hit), radius_m)
    rows_of_all(found, recorded)
    assert_marked(found, bad / RATE_HZ, Quality.SPIKE | Quality.LOST_PEAK)
    # the template is learnt without the rows that were hit, and moves by less than it is known to
    moved = np.abs(found.time_s - before.time_s) / before.time_se_s
    assert moved[~having(found.quality, Quality.SPIKE | Quality.LOST_PEAK)].max() < 1.0


@pytest.mark.parametrize("code", [9999.0, 0.0, -1e6])
@pytest.mark.parametrize("length_s", [0.012, 0.05, 0.3])
def test_a_code_is_lost_however_long(recorded, radius_m, code, length_s):
    hit, begins = recorded.values.copy(), np.arange(1.3, 15.0, max(1.0, 6 * length_s))
    held = np.zeros(hit.size, bool)
    for begin in begins:
        held[int(begin * RATE_HZ) : int((begin + length_s) * RATE_HZ)] = True
    hit[held] = strain_of(code)
    channel = recorded.with_values(hit)
    assert np.array_equal(np.isnan(without_spikes(channel).read()), held)
    before = find_passages(recorded.with_values(recorded.values), radius_m)
    found, times = find_passages(channel, radius_m), recorded.time_s
    far = np.abs(times[:, None] - begins - 0.5 * length_s).min(axis=1) > 0.5 * length_s + 0.3
    for time in times[far]:  # within a fortieth of a sample
        i, j = (np.argmin(np.abs(some.time_s - time)) for some in (found, before))
        assert abs(found.time_s[i] - before.time_s[j]) < 1e-5


@pytest.mark.parametrize("kind", ["as it is", "coarse", "at rest mostly", "clipped", "pushed once"])
def test_a_tire_s_own_samples_are_no_codes_and_no_burst(recorded, kind):
    """Coarse, at rest mostly, clipped at a third, pushed past its patch once at 3 m/s."""
    values, third = recorded.values, 0.33 * recorded.values.min()
    xi = np.clip(3.0 * (np.arange(0.0, 20.0, 1 / RATE_HZ) - 10.0), -0.5, 0.5)
    noise = np.random.default_rng(4403).normal(0.0, 1e-3, xi.size)
    pulse = np.tanh((xi + 0.055) / 0.02) - np.tanh((xi - 0.055) / 0.02)
    values = {
        "as it is": values,
        "coarse": third * np.round(values / third),
        "at rest mostly": np.where(values < 1.5 * third, 3.0 * third, 0.0),
        "clipped": np.maximum(values, third),
        "pushed once": strain_of(REFERENCE_NM - 0.6 * pulse + noise),
    }[kind]
    own = without_spikes(recorded.with_values(values))
    assert np.array_equal(own.read(), values)
    assert own.flags == () or kind == "clipped"


@pytest.mark.parametrize(("share", "within_m"), [(0.3, 6e-3), (0.5, 4e-3), (0.75, 1e-4)])
def test_clipped_patches_are_marked_and_timed_by_their_flanks(steady, radius_m, share, within_m):
    """Where all are clipped alike, so is the form that they are compared with."""
    values = np.maximum(steady.values, -share * 8e-4)
    found = find_passages(without_spikes(steady.with_values(values)), radius_m)
    off = rows_of_all(found, steady)
    assert having(found.quality, Quality.CLIPPED)[1:-1].all()
    assert np.abs(off * steady.speed_m_s).max() < within_m


def test_a_coarse_scale_is_not_clipping(steady, radius_m):
    step = strain_of(REFERENCE_NM + 0.01)
    coarse = np.round(steady.values / step) * step
    found = find_passages(steady.with_values(coarse, resolution=step), radius_m)
    rows_of_all(found, steady)
    assert not having(found.quality, Quality.CLIPPED).any()


HALF, THIRD, SECOND = 20_000, 13_333, 2500
#: fault that lasts: first and last sample, its value [nm] or None for the last good one, shift
#: [nm] in its place; samples that are good
JUMPS = {
    "step": ((HALF, None), -100.0, "shift", (0, None)),
    "two steps": ((THIRD, HALF), 40.0, "shift", (0, None)),
    "railed from half way": ((HALF, None), 1700.0, "value", (0, HALF)),
    "stuck from half way": ((HALF, None), None, "value", (0, HALF)),
    "zero for a second": ((HALF, HALF + SECOND), 0.0, "value", (0, HALF)),
    "rail at the beginning": ((0, SECOND), 1700.0, "value", (SECOND, None)),
    "code for 50 ms": ((HALF, HALF + 125), 9999.0, "value", (0, HALF)),
}


@pytest.mark.parametrize("kind", JUMPS)
def test_a_jump_takes_no_row_of_the_rest(recorded, radius_m, kind):
    where, nm, how, whole = JUMPS[kind]
    hit, part = recorded.values.copy(), slice(*where)
    if how == "shift":
        hit[part] += nm / REFERENCE_NM / GAIN
    else:
        hit[part] = hit[where[0]] if nm is None else strain_of(nm)
    found = find_passages(recorded.with_values(hit), radius_m)
    assert not found.doubt
    begin, end = whole[0] / RATE_HZ, (whole[1] or hit.size) / RATE_HZ
    inside = recorded.time_s[(recorded.time_s > begin + 0.1) & (recorded.time_s < end - 0.1)]
    assert np.abs(found.time_s[:, None] - inside).min(axis=0).max() < 1e-3


@pytest.mark.parametrize("count", [0, 1, 2, 3, 5, 7, 100])
@pytest.mark.parametrize("fill", [0.0, np.nan])
def test_next_to_nothing_gives_no_rows(steady, radius_m, count, fill):
    assert len(find_passages(steady.with_values(np.full(count, fill)), radius_m)) == 0
