"""Closed form: the cut-off by the spectrum at rest, of a bell in noise of a known size."""

from __future__ import annotations

import numpy as np
import pytest

from tirelog.dsp.filters import least_error_cutoff

RATE_HZ, COUNT = 2500.0, 400


@pytest.mark.parametrize("noise", [1e-2, 1e-3, 1e-4])
def test_a_bell_sinks_into_white_noise_where_its_transform_says(noise):
    """|A s sqrt(2 pi) rate e^(-2 pi^2 f^2 s^2)|^2 is the noise's power, sum h^2 sigma^2."""
    rng, width_s = np.random.default_rng(4600), 1.5e-3
    time = (np.arange(COUNT) - 0.5 * (COUNT - 1)) / RATE_HZ
    bell = np.exp(-0.5 * (time / width_s) ** 2)
    passing = bell + rng.normal(0.0, noise, (200, COUNT))
    resting = rng.normal(0.0, noise, (200, COUNT))
    power = (width_s * np.sqrt(2 * np.pi) * RATE_HZ) ** 2
    floor = noise**2 * np.sum(np.hanning(COUNT) ** 2)
    expected = np.sqrt(np.log(power / floor)) / (2 * np.pi * width_s)
    found = least_error_cutoff(passing, resting, RATE_HZ)
    assert found == pytest.approx(expected, abs=1.5 * RATE_HZ / COUNT)


def test_a_hum_at_rest_keeps_the_low_pass_below_it():
    """Noise at rest above 250 Hz, stronger than the bell there: the cut-off is at its edge."""
    rng = np.random.default_rng(4601)
    time = (np.arange(COUNT) - 0.5 * (COUNT - 1)) / RATE_HZ
    bell = np.exp(-0.5 * (time / 1e-3) ** 2)

    def hum(rows):
        spectrum = np.fft.rfft(rng.normal(0.0, 1e-5, (rows, COUNT)), axis=1)
        spectrum[:, np.fft.rfftfreq(COUNT, 1 / RATE_HZ) > 250.0] *= 1e5
        return np.fft.irfft(spectrum, n=COUNT, axis=1)

    found = least_error_cutoff(bell + hum(200), hum(40), RATE_HZ)
    assert 225.0 < found < 255.0
