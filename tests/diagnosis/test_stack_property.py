"""Property: from samples to cells what was put in comes back; hum goes, and nothing else."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.diagnosis.toy import stack_of
from tirelog.data.recording import Conditions
from tirelog.inference.stacks.hum import lines_said, without_hum
from tirelog.inference.stacks.manoeuvres import SHORTEST, accelerations, regimes, segment


def test_a_drive_falls_into_its_regimes():
    time = np.arange(0.0, 40.0, 0.1)
    speed = np.interp(time, [0, 10, 15, 25, 30, 40], [10, 10, 20, 20, 8, 8])
    number, regime = segment(regimes(accelerations(time, speed)), np.r_[True, np.zeros(399, bool)])
    found = [regime[number == k][0] for k in np.unique(number)]
    assert found == ["cruise", "drive", "cruise", "brake", "cruise"]
    coasting = accelerations(time, 30.0 - 0.6 * time)
    assert set(regimes(coasting)) == {"coast"}


def test_short_stretches_join_their_neighbours_and_gaps_part():
    regime = np.repeat(["cruise", "drive", "cruise"], [10, 2, 10])
    for gaps, last in (([0], 0), ([0, 16], 1)):
        assert segment(regime, np.isin(np.arange(22), gaps))[0].max() == last
    # a standing start before a gap goes with what follows
    started = np.repeat(["drive", "cruise"], [3, 20])
    number, found = segment(started, np.isin(np.arange(23), [0, 3]))
    assert set(number) == {0}
    assert set(found) == {"cruise"}


@settings(deadline=None, max_examples=200)
@given(
    st.lists(
        st.tuples(
            st.integers(1, 9), st.sampled_from(["cruise", "drive", "coast", "brake"]), st.booleans()
        ),
        min_size=1,
        max_size=12,
    )
)
def test_every_revolution_is_in_one_manoeuvre_however_short_the_stretches(stretches):
    regime = np.repeat([word for _, word, _ in stretches], [n for n, _, _ in stretches])
    first = np.cumsum([0, *(n for n, _, _ in stretches[:-1])])
    breaks = np.zeros(regime.size, bool)
    breaks[first[[gap for _, _, gap in stretches]]] = True
    breaks[0] = stretches[0][2]  # a log may begin with a gap or without
    given_regime, given_breaks = regime.copy(), breaks.copy()
    number, found = segment(regime, breaks)
    assert number[0] == 0
    assert set(np.diff(number)) <= {0, 1}  # contiguous: each revolution in one, numbered through
    counts = np.bincount(number)
    assert counts.min() >= min(SHORTEST, regime.size)
    assert all(np.unique(found[number == k]).size == 1 for k in range(counts.size))
    np.testing.assert_array_equal(regime, given_regime)
    np.testing.assert_array_equal(breaks, given_breaks)


RADIUS, BINS, NOISE = 0.3, 64, 1e-6


def a_stack(hum=0.0, frequency=50.0, wander=0.0, seed=1):
    """(stack, times (n, m), waveforms without hum): 12 s at 10 turns a second, then faster."""
    random = np.random.default_rng(seed)
    rate = np.concatenate([np.full(120, 10.0), np.linspace(10.0, 13.0, 150), np.full(80, 13.07)])
    start = np.concatenate([[0.0], np.cumsum(1.0 / rate)])
    phi = (np.arange(BINS) + 0.5) * 2.0 * np.pi / BINS - np.pi
    time_s = start[:-1, None] + (phi + np.pi) / (2.0 * np.pi) / rate[:, None]
    wave = 3e-4 * np.exp(-((phi / 0.3) ** 2)) * (rate[:, None] / 10.0)
    turn = 2.0 * np.pi * frequency * time_s + wander * np.sin(2.0 * np.pi * time_s / 40.0)
    clean = wave + NOISE * random.standard_normal(wave.shape)
    speed = 2.0 * np.pi * RADIUS * rate
    stack = stack_of(
        channel="g1",
        surface="inner",
        radius_m=RADIUS,
        values=clean + hum * np.sin(turn),
        noise=NOISE,
        conditions=Conditions.of(len(rate), speed_m_s=speed),
        manoeuvre=np.repeat([0, 1, 2], [120, 150, 80]),
        logs=("a.csv",),
    )
    return stack, time_s, clean


@pytest.mark.parametrize(
    ("frequency", "wander"), [(50.0, 0.0), (49.93, 0.0), (60.02, 0.0), (50.0, 0.6)]
)
def test_a_line_of_the_supply_goes_also_at_a_whole_fraction_of_it(frequency, wander):
    stack, time_s, clean = a_stack(hum=2.0 * NOISE, frequency=frequency, wander=wander)
    values, lines = without_hum(stack, time_s)
    assert [frequency for frequency, _ in lines] == pytest.approx([frequency], abs=0.05)
    assert lines[0][1] == pytest.approx(2.0 * NOISE, rel=0.1)
    assert (values - clean)[120:].std() < 0.2 * NOISE
    # at 10 turns a second the mean over the manoeuvre holds hum of 50 Hz as large as it is; a grid
    # that wanders meanwhile is followed from outside of the manoeuvre alone
    before, after = ((x - clean)[:120].mean(axis=0).std() for x in (stack.values, values))
    assert before > NOISE or frequency != 50.0
    assert after < (0.25 if not wander else 0.8) * max(before, NOISE)


@pytest.mark.parametrize("wander_Hz", [0.005, 0.02, 0.05])
def test_hum_of_a_grid_that_wanders_is_never_made_more(wander_Hz):
    """Its phase walks at random and its size breathes; for 12 s the wheel hides it."""
    for seed in range(6):
        stack, time_s, clean = a_stack(seed=seed)
        random = np.random.default_rng(900 + seed)
        at = np.arange(0.0, time_s.max() + 1.0, 0.05)
        walk = wander_Hz * np.cumsum(random.standard_normal(at.size)) * (0.05 / 20.0) ** 0.5
        turn = 2.0 * np.pi * np.cumsum(50.0 + random.uniform(-0.05, 0.05) + walk) * 0.05
        size = 3.0 * NOISE * (1.0 + 0.3 * np.sin(2.0 * np.pi * at / 11.0))
        stack.values[:] += np.interp(time_s, at, size) * np.sin(np.interp(time_s, at, turn))
        values, lines = without_hum(stack, time_s)
        assert len(lines) == 1
        before, after = (x - clean for x in (stack.values, values))
        assert after.std() < before.std()
        assert after[120:].std() < 0.2 * before[120:].std()


def test_hum_is_seen_where_samples_are_lost_at_flanks():
    """A bin of a flank with one of its samples reads hundreds of microstrain beside its place."""
    stack, time_s, clean = a_stack(hum=2.0 * NOISE)
    random = np.random.default_rng(5)
    flank = np.abs(np.abs(stack.phi_rad) - 0.5) < 0.4
    lost = random.uniform(size=clean.shape) < 0.04 * flank
    stack.values[lost] += random.uniform(-600e-6, 600e-6, lost.sum())
    values, lines = without_hum(stack, time_s)
    assert [round(frequency) for frequency, _ in lines] == [50]
    assert (values - clean)[:, ~flank].std() < 0.3 * NOISE


def test_a_log_without_hum_stays_as_it_is():
    for seed in range(20):
        stack, time_s, _ = a_stack(seed=seed)
        values, lines = without_hum(stack, time_s)
        assert not lines
        assert values is stack.values


def test_hum_is_found_across_a_standstill_in_little_memory():
    stack, time_s, clean = a_stack(hum=2.0 * NOISE)
    late = time_s.copy()
    late[175:] += 900.0
    stack.values[:] += 2.0 * NOISE * (np.sin(314.15927 * late) - np.sin(314.15927 * time_s))
    tracemalloc.start()
    try:
        values, lines = without_hum(stack, late)
        assert tracemalloc.get_traced_memory()[1] < 30e6
    finally:
        tracemalloc.stop()
    assert [round(frequency) for frequency, _ in lines] == [50]
    assert (values - clean).std() < 0.7 * (stack.values - clean).std()


def test_what_rings_with_the_wheel_is_not_hum():
    """50 Hz after each passage, anew in each revolution: the tire, at any speed."""
    stack, time_s, _ = a_stack()
    since = time_s - time_s[:, :1]
    stack.values[:] += 2e-5 * np.exp(-since / 0.05) * np.sin(2.0 * np.pi * 50.0 * since)
    values, lines = without_hum(stack, time_s)
    assert not lines
    assert values is stack.values


def test_the_second_multiple_goes_with_the_first():
    stack, time_s, clean = a_stack(hum=2.0 * NOISE)
    stack.values[:] += NOISE * np.sin(2.0 * np.pi * 100.0 * time_s)
    values, lines = without_hum(stack, time_s)
    assert [round(frequency) for frequency, _ in lines] == [50, 100]
    assert (values - clean).std() < 0.2 * NOISE
    said = lines_said([(50.0, 2e-6), (100.02, 1e-6), (50.0, 1e-9)], "strain")
    assert said == (
        "lines that keep the frequency, as hum does, taken out of the waveforms: "
        "50 Hz (2 microstrain) and 100 Hz (1 microstrain)"
    )


def test_few_revolutions_and_bins_without_samples_are_no_obstacle():
    stack, time_s, clean = a_stack(hum=2.0 * NOISE)
    stack.values[::7, 5] = np.nan
    time_s[::7, 5] = np.nan
    values, lines = without_hum(stack, time_s)
    assert len(lines) == 1
    assert np.array_equal(np.isnan(values), np.isnan(stack.values))
    assert np.nanstd(values - clean) < 0.2 * NOISE
    values, lines = without_hum(stack.take(slice(0, 10)), time_s[:10])
    assert not lines
