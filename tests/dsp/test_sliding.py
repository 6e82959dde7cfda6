"""Property: sliding windows give what scipy.ndimage gives."""

import numpy as np
import pytest
from scipy.ndimage import median_filter, uniform_filter1d

from tirelog.dsp.filters import ROWS, sliding_mean, sliding_median


@pytest.mark.parametrize("size", [1, 5, 100, ROWS + 3])
@pytest.mark.parametrize("width", [1, 2, 3, 9, 20])
def test_means_and_medians_are_scipys(size, width):
    x = 1e3 + np.random.default_rng(size).standard_normal(size)
    np.testing.assert_allclose(
        sliding_mean(x, width), uniform_filter1d(x, width, mode="reflect"), rtol=1e-12
    )
    if width % 2:
        assert np.array_equal(sliding_median(x, width), median_filter(x, width, mode="reflect"))
