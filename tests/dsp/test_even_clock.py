"""Property: only even samples get even stamps; sliding windows are scipy.ndimage's."""

import numpy as np
import pytest
from scipy.ndimage import median_filter, uniform_filter1d

from tests.strain.conftest import RADIUS_M, make_drive
from tirelog.data.recording import TimeAxis
from tirelog.dsp.filters import ROWS, even_axis, sliding_mean, sliding_median, stamp_scatter
from tirelog.strain.dissipation import dissipation
from tirelog.strain.passages.find import find_passages
from tirelog.strain.speed import speed_quality
from tirelog.vocabulary.quality import good

RATE_HZ, FINE_HZ, SECONDS = 2500.0, 50_000.0, 20.0


@pytest.fixture(scope="module")
def fine():
    return make_drive([0, 5, 15, 20], [8, 8, 16, 16], seed=1301, rate_Hz=FINE_HZ, noise_pm=0.0)


def sampled(fine, periods, *, even):
    """A channel whose stamps scatter by so many periods; the samples are `even` or lie at them."""
    random = np.random.default_rng(1302)
    time = np.arange(100.0, RATE_HZ * SECONDS - 100.0) / RATE_HZ
    stamps = np.sort(time + periods / RATE_HZ * random.standard_normal(time.size))
    at = time if even else stamps
    values = np.interp(at * FINE_HZ, np.arange(fine.values.size), fine.values)
    return fine.with_values(values + random.normal(0.0, 4e-7, time.size), TimeAxis.of_times(stamps))


@pytest.mark.parametrize("periods", [0.05, 0.3, 1.0])
def test_even_samples_have_even_times(fine, periods):
    axis = even_axis(sampled(fine, periods, even=True))
    assert axis is not None
    assert axis.rate_Hz == pytest.approx(RATE_HZ, rel=1e-5)
    assert float(axis.at(0.0)) == pytest.approx(100.0 / RATE_HZ, abs=0.05 / RATE_HZ)


@pytest.mark.parametrize("periods", [0.05, 0.3, 1.0])
def test_samples_at_their_stamps_keep_them(fine, periods):
    channel = sampled(fine, periods, even=False)
    assert even_axis(channel) is None
    assert stamp_scatter(channel.axis) == pytest.approx(periods, rel=0.5)


def test_slopes_of_uneven_samples_are_no_dissipation_that_is_ok(fine):
    channel = sampled(fine, 0.3, even=False)
    passages = find_passages(channel, RADIUS_M)
    found = dissipation(channel, passages, None, speed_quality(passages))
    assert not good(found.quality).any()


@pytest.mark.parametrize("size", [1, 5, 100, ROWS + 3])
@pytest.mark.parametrize("width", [1, 2, 3, 9, 20])
def test_means_and_medians_are_scipys(size, width):
    x = 1e3 + np.random.default_rng(size).standard_normal(size)
    np.testing.assert_allclose(
        sliding_mean(x, width), uniform_filter1d(x, width, mode="reflect"), rtol=1e-12
    )
    if width % 2:
        assert np.array_equal(sliding_median(x, width), median_filter(x, width, mode="reflect"))
