"""Closed form: the low-pass's cut-off from the spectrum at rest, of signals whose band is known."""

from __future__ import annotations

import numpy as np
import pytest

from tirelog.data.recording import Channel, TimeAxis
from tirelog.dsp.lowpass import Cutoff
from tirelog.errors import UsageError
from tirelog.strain.footprint.at_rest import WINDOW, cutoff_at_rest, cutoff_between

RATE_HZ = 2500.0


class At:
    """Passages at these times, as far as a cut-off asks for them."""

    def __init__(self, time_s):
        self.time_s = np.asarray(time_s, float)


def band_limited(n, highest_Hz, rng):
    """Noise of 20 times the unit's size up to a frequency, and none above."""
    spectrum = np.fft.rfft(rng.normal(0.0, 20.0, n))
    spectrum[np.fft.rfftfreq(n, 1.0 / RATE_HZ) > highest_Hz] = 0.0
    return np.fft.irfft(spectrum, n)


@pytest.mark.parametrize("highest_Hz", [120.0, 400.0])
def test_the_cut_off_is_where_the_signal_ends(highest_Hz):
    rng = np.random.default_rng(11)
    rest = rng.normal(0.0, 1.0, (60, WINDOW))
    signal = band_limited(60 * WINDOW, highest_Hz, rng).reshape(60, WINDOW)
    found = cutoff_between(rest, rest[::-1] + signal, RATE_HZ)
    # four frequencies of the median, two of the taper
    assert found == pytest.approx(highest_Hz, abs=7 * RATE_HZ / WINDOW)


@pytest.mark.parametrize("stands", ["before", "between", "after"])
def test_the_standstill_is_found_wherever_it_is(stands):
    rng = np.random.default_rng(12)
    seconds = {"before": (6.0, 14.0), "between": None, "after": (0.0, 8.0)}[stands]
    t = np.arange(int(14.0 * RATE_HZ)) / RATE_HZ
    rolls = (t < 4.0) | (t > 10.0) if seconds is None else (t > seconds[0]) & (t < seconds[1])
    values = rng.normal(0.0, 1.0, t.size) + rolls * band_limited(t.size, 200.0, rng)
    channel = Channel.of_array("s", "strain", values, TimeAxis.uniform(t.size, RATE_HZ))
    passed = np.arange(0.1, 14.0, 0.2)
    passed = passed[rolls[(passed * RATE_HZ).astype(int)]]
    assert cutoff_at_rest(channel, At(passed)) == pytest.approx(200.0, abs=40.0)


def test_a_log_that_never_stands_is_refused():
    values = np.random.default_rng(13).normal(size=int(4 * RATE_HZ))
    channel = Channel.of_array("s", "strain", values, TimeAxis.uniform(values.size, RATE_HZ))
    with pytest.raises(UsageError, match="--cutoff rest"):
        cutoff_at_rest(channel, At(np.arange(0.0, 4.0, 0.1)))


def test_the_word_is_taken_and_others_are_not():
    assert str(Cutoff.parse("rest")) == "rest"
    with pytest.raises(UsageError, match="rest"):
        Cutoff.parse("quiet")
