"""Property: from samples to cells, angles, manoeuvres and scatter are those that were put in."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.diagnosis.toy import channel, make_cells, stack, waveform
from tirelog.inference.stacks.align import PassageAngle, Samples, refine_passages
from tirelog.inference.stacks.manoeuvres import SHORTEST, accelerations, regimes, segment


@pytest.mark.parametrize("seed", [1, 2])
def test_matched_filter_finds_passages_to_a_thousandth_of_the_width(seed):
    toy, truth = channel(seed)
    random = np.random.default_rng(seed)
    found = refine_passages(Samples(toy), truth + 1e-3 * random.standard_normal(truth.size))
    error = (found - truth)[2:-2] * PassageAngle.through(truth).speed_rad_s(truth)[2:-2]
    assert np.std(error) < 2.5e-3


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


def test_scatter_of_revolutions_comes_back_as_it_was_put_in():
    cells = make_cells(
        stack(3, manoeuvres=8, revolutions=40, amplitude=0.02, baseline=0.0, noise=0.01)
    )
    single = cells.random_cov[0, 0, 0] * cells.revolutions[0]
    assert np.sqrt(single) == pytest.approx(0.02, rel=0.25)
    assert np.nanmedian(cells.sd * np.sqrt(cells.revolutions)[:, None]) == pytest.approx(
        0.01, rel=0.05
    )


def test_cell_means_lie_on_the_waveform_at_their_own_angles():
    cells = make_cells(stack(4, noise=1e-4, amplitude=0.01, baseline=0.0))
    good = np.isfinite(cells.values)
    left = np.where(good, cells.values - waveform(cells.phi), 0.0)
    columns = np.concatenate([cells.random, cells.shift[..., None]], axis=-1)
    for c in range(len(cells)):
        rest = left[c] - columns[c] @ np.linalg.lstsq(columns[c], left[c], rcond=None)[0]
        assert np.sqrt(np.mean(rest**2)) < 5e-4


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
