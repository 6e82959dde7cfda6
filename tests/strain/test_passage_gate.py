"""Property: what is no tire pass is said to be none, and no log of a rolling tire is."""

import numpy as np
import pytest

from tests.strain.conftest import make_drive
from tirelog.data.recording import Channel, TimeAxis
from tirelog.strain.passages.find import find_passages
from tirelog.strain.speed import speed_columns
from tirelog.vocabulary.quality import Quality, having

RATE_HZ = 1000.0
TIME_S = np.arange(int(20 * RATE_HZ)) / RATE_HZ


def white(rng, size=1.0):
    return size * rng.normal(size=TIME_S.size)


def coloured(rng, power):
    """Noise whose spectrum falls with frequency to this power, standard deviation 1."""
    frequency = np.maximum(np.fft.rfftfreq(TIME_S.size), 1.0 / TIME_S.size)
    values = np.fft.irfft(np.fft.rfft(white(rng)) * frequency ** (-power / 2), TIME_S.size)
    return values / values.std()


def rim(rng):
    """Gravity on a rim that turns 1 to 3 times a second, and the road's noise."""
    rate = np.interp(TIME_S, np.linspace(0, 20, 6), rng.uniform(1, 3, 6))
    turned = 2 * np.pi * np.cumsum(rate) / RATE_HZ
    return np.cos(turned) + 0.1 * coloured(rng, 1.0) + white(rng, 0.05)


def bursts(rng):
    """Ringing at 200 Hz at random times, as of a piezo element."""
    values = white(rng, 0.02)
    for at in rng.uniform(0, 20, 60):
        ringing = np.sin(2 * np.pi * 200 * (TIME_S - at) + rng.uniform(0, 6))
        values += np.exp(-(((TIME_S - at) / 0.02) ** 2)) * ringing
    return values


def bent(rng):
    """A bench that is loaded and let go, each time as long."""
    return (np.sin(2 * np.pi * 0.4 * TIME_S) > 0) + white(rng, 0.01)


SIGNALS = {
    "white": white,
    "slow white": lambda rng: np.convolve(white(rng), np.hanning(40), "same"),
    "road": lambda rng: coloured(rng, 1.0),
    "rough road": lambda rng: coloured(rng, 2.0),
    "sine": lambda rng: np.sin(2 * np.pi * rng.uniform(0.5, 90) * TIME_S) + white(rng, 0.02),
    "telegraph": lambda rng: np.cumsum(rng.random(TIME_S.size) < 0.008) % 2 + white(rng, 0.01),
    "ramp": lambda rng: 0.1 * TIME_S + white(rng, 0.01),
    "rim": rim,
    "bursts": bursts,
    "bent": bent,
}


@pytest.mark.parametrize("kind", ["strain", "radial_acceleration"])
@pytest.mark.parametrize("name", SIGNALS)
def test_what_is_no_tire_pass_gives_no_speed(name, kind):
    rows = 0
    for seed in (1000, 1001):
        values = SIGNALS[name](np.random.default_rng(seed)) * (1e-4 if kind == "strain" else 100.0)
        axis = TimeAxis.uniform(values.size, RATE_HZ)
        found = find_passages(Channel.of_array("c", kind, values, axis), 0.3)
        rows += len(found)
        columns = speed_columns("a.csv", found)
        assert "ok" not in columns["quality"]
        assert np.isnan(columns["speed_m_s"]).all()
        if len(found):
            assert having(found.quality, Quality.NOT_A_PASSAGE).all()
            assert "not a patch signal?" in found.doubt
            # the number that is told is that of the table's rows
            assert f" {len(found)} " in found.doubt.split("pulses found")[0]
            assert not found.turn_after.any()
    assert rows > 0 or name in ("white", "ramp")


def test_lost_samples_between_many_passages_are_no_doubt(radius_m):
    """The instrument reads four passages of every eight."""
    d = make_drive([0, 20], [15, 15], seed=1003)
    values = d.values.copy()
    values[(d.channel.axis.time() * 15 / (2 * np.pi * radius_m)) % 8 > 4.2] = np.nan
    found = find_passages(d.with_values(values), radius_m)
    assert found.measured.sum() > 70
    assert found.doubt == ""


def test_a_long_standstill_before_the_start_does_not_turn_the_patch_over(radius_m):
    """The level outside follows the square of the speed; most of the log is at rest."""
    made = make_drive([0, 60, 63, 70], [0, 0, 20, 20], seed=1004, noise_pm=0.0, drift=0.0)
    speed = np.interp(made.channel.axis.time(), [0, 60, 63, 70], [0, 0, 20, 20])
    outside = 1.0 + made.values / 8e-4
    noise = np.random.default_rng(1004).normal(0.0, 3.0, speed.size)
    values = -(speed**2) / radius_m * outside + noise
    kind = {"name": "z", "kind": "radial_acceleration"}
    found = find_passages(made.with_values(values, **kind), radius_m)
    assert found.sign == 1.0
    assert found.doubt == ""
    assert np.isfinite(found.speed_m_s).sum() > 60
