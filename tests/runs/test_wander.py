"""Closed form: a clock of known wandering rate, seen through whole seconds."""

import numpy as np
import pytest

from tirelog.runs.clock import ClockFit


def clocked(period_s, lost=slice(0)):
    """(true times, the fitted clock) of samples with these steps, some of them lost."""
    times = np.concatenate([[0.0], np.cumsum(period_s)[:-1]])
    times = np.delete(times, lost)
    clock = ClockFit(resolution_s=1.0)
    for part in np.array_split(np.floor(times + 0.3), 5):
        clock.add(part, None, part.size)
    return times, clock


def wavy(share, samples=12000):
    k = np.arange(samples)
    return (1.0 + share * np.sin(2.0 * np.pi * k / 7000.0)) / 9.4


@pytest.mark.parametrize("share", [0.0, 0.01, 0.08])
def test_times_follow_a_wandering_rate(share):
    times, clock = clocked(wavy(share))
    got = clock.axis.time()
    assert np.abs(got - times).max() < 0.15  # a constant rate is off by seconds
    assert (np.diff(got) > 0.0).all()
    assert clock.repairs == {}
    assert ["wanders" in remark for remark in clock.remarks] == [True] * (share > 0.0)
    assert (clock.axis.explicit is None) == (share == 0.0)
    slow, fast = 9.4 / (1.0 + share), 9.4 / (1.0 - share)
    assert slow * 0.99 < clock.axis.rate_Hz < fast * 1.01


def test_a_gap_in_a_wandering_clock_is_a_gap():
    times, clock = clocked(wavy(0.03), slice(6000, 6100))
    assert np.abs(clock.axis.time() - times).max() < 0.25
    assert clock.repairs["gaps"] == 1
    # the rate about the gap, and so what it would have held, is known to some percent
    assert abs(clock.repairs["lost_samples"] - 100) <= 6


@pytest.mark.parametrize("seed", range(3))
def test_gaps_of_a_steady_clock_are_found_by_what_ticks_lack(seed):
    """Where in its tick a gap lies is not told; elsewhere times are off by some periods at most,
    where few ticks lie between two gaps.
    """
    rng = np.random.default_rng(100 + seed)
    rate = rng.uniform(10.0, 100.0)
    period = np.full(int(400 * rate), 1.0 / rate)
    firsts = np.sort(rng.choice(period.size - 1000, 3, replace=False))
    lost = np.concatenate([np.arange(first, first + n) for first, n in zip(firsts, (40, 90, 300))])
    times, clock = clocked(period, np.unique(lost))
    times = times - times[0]
    error = np.abs(clock.axis.time() - times)
    assert np.mean(error > 6.0 / rate) < 0.01
    assert np.median(error) < 1.0 / rate
    assert clock.axis.explicit is None
    assert clock.remarks == []
    assert clock.axis.rate_Hz == pytest.approx(rate, rel=5e-4)


def test_a_declared_rate_is_kept_and_the_stamps_word_said():
    _, clock = clocked(wavy(0.002))
    declared = ClockFit(resolution_s=1.0, setup_rate_Hz=9.4)
    assert clock.axis.explicit is None  # it strays by less than two ticks
    times = np.concatenate([[0.0], np.cumsum(wavy(0.03))[:-1]])
    declared.add(np.floor(times + 0.3), None, times.size)
    assert declared.axis.explicit is None
    assert "are followed" in declared.remarks[0]
