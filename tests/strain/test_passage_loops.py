"""Closed form: loops of the search for passages say what numpy's plain ways say."""

import numpy as np
import pytest

from tirelog.data.recording import Channel, TimeAxis
from tirelog.strain.passages.match import Signal, fit_passages, gather, residuals
from tirelog.strain.passages.search import _bridged
from tirelog.strain.passages.template import ROW, Template
from tirelog.vocabulary.arrays import records

SHARES = (0.0, 0.02, 0.5, 0.98)


@pytest.mark.parametrize("share", SHARES)
@pytest.mark.parametrize("seed", range(3))
def test_lost_buckets_lie_on_straight_lines(share, seed):
    rng = np.random.default_rng(seed)
    values = rng.normal(size=400).astype(np.float32)
    values[rng.uniform(size=400) < share] = np.nan
    kept = np.flatnonzero(np.isfinite(values))
    wanted = np.interp(np.arange(400), kept, values[kept])
    np.testing.assert_allclose(_bridged(values), wanted, rtol=1e-6, atol=1e-6)


def test_nothing_is_filled_if_all_is_lost():
    assert not _bridged(np.full(9, np.nan, np.float32)).size


def test_what_a_template_leaves_is_the_rest_of_least_squares():
    """Against numpy's own, row by row, with lost samples and an offset."""
    rng = np.random.default_rng(7)
    rate_Hz, omega, window_rad = 800.0, 45.0, 0.45
    phi = np.linspace(-window_rad, window_rad, 121)
    bump = np.exp(-((phi / 0.13) ** 2))
    template = Template(phi, bump, -2.0 * phi / 0.13**2 * bump, window_rad, 0.12)
    centres = np.array([0.3, 0.9, 1.7])
    time_s = np.arange(2000) / rate_Hz
    values = 0.3 + 0.01 * rng.normal(size=time_s.size)
    for centre in centres:
        values += 1.9 * np.interp(omega * (time_s - centre), phi, bump, 0.0, 0.0)
    values[[238, 725]] = np.nan
    channel = Channel.of_array("c", "strain", values, TimeAxis.uniform(time_s.size, rate_Hz))
    signal = Signal(channel, 1.0, 0.01, (-1e9, 1e9))
    none = np.zeros(3)
    index = centres * rate_Hz
    start = records(ROW, time_s=centres, index=index, omega_rad_s=omega, stretch=0.01)
    windows = gather(signal, start, window_rad)
    found = fit_passages(windows, template, start, none + 1.9)
    angles, left = residuals(windows, template, found, none, np.arange(3))
    wanted = []
    for k in range(3):
        turned = found["omega_rad_s"][k] * (time_s - found["time_s"][k])
        inside = (np.abs(turned) <= window_rad) & np.isfinite(values)
        columns = [np.interp(turned[inside], phi, y) for y in (template.values, template.slope)]
        design = np.column_stack([np.ones(inside.sum()), *columns])
        solved = np.linalg.lstsq(design, values[inside], rcond=None)[0]
        wanted.append((values[inside] - design @ solved) / found["height"][k])
    assert angles.size == left.size
    np.testing.assert_allclose(left, np.concatenate(wanted), atol=1e-9)
