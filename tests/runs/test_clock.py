"""Closed form: stamps made from a known clock, one of wandering rate too, and their axis."""

import numpy as np
import pytest

from tirelog.errors import ReadError, SetupError
from tirelog.runs.clock import ClockFit
from tirelog.vocabulary.quality import Quality

N = 50_000
row = np.arange(N)


def fit(stamps=None, numbers=None, size=None, block=777, **clock):
    made = ClockFit(**clock)
    n = size or len(stamps if stamps is not None else numbers)
    for start in range(0, n, block):
        stop = min(start + block, n)
        part = [None if x is None else np.asarray(x, float)[start:stop] for x in (stamps, numbers)]
        made.add(*part, stop - start)
    assert made.axis.size == n
    return made


def tells(made, times=None, atol=1e-9, *, rate=None, first=(0,), **repairs):
    """That a clock has these times, this rate, segments that begin there, and these repairs."""
    assert made.axis.first.tolist() == list(first)
    assert rate is None or made.axis.rate_Hz == pytest.approx(rate, rel=1e-12)
    assert made.repairs == repairs
    if times is not None:
        np.testing.assert_allclose(made.axis.time(), times, rtol=0, atol=atol)


def noise(seed, size=N):
    return np.random.default_rng(seed).standard_normal(size)


@pytest.mark.parametrize(
    ("rate", "decimals"), [(2500.0, 4), (3000.0, 4), (1000.0, 3), (2500.0, 9), (104.0, 2), (7.0, 6)]
)
def test_uniform_stamps_give_a_uniform_axis(rate, decimals):
    resolution = 10.0**-decimals
    made = fit(np.round(row / rate, decimals), resolution_s=resolution)
    tells(made, row / rate, 0.51 * resolution, rate=rate)


@pytest.mark.parametrize("chunk", [700, 10**6])
@pytest.mark.parametrize("block", [1, 1000, 10**6])
def test_the_axis_does_not_depend_on_the_block_size(block, chunk, monkeypatch):
    monkeypatch.setattr("tirelog.runs.stamps._CHUNK", chunk)
    monkeypatch.setattr("tirelog.runs.stamps._IN_MEMORY", chunk)
    k = np.arange(3000) + 7 * (np.arange(3000) > 1234)
    made = fit(np.round(k / 2500.0, 4), block=block, resolution_s=1e-4)
    tells(made, k / 2500.0, rate=2500.0, first=(0, 1235), gaps=1, lost_samples=7)


@pytest.mark.parametrize("jitter", [0.02, 0.09, 0.5])
def test_the_rate_of_jittered_stamps_to_a_millionth(jitter):
    """And exactly, if it is the declared one."""
    rate, times = 2499.3456, row + jitter * noise(11)
    made = fit(times / rate, setup_rate_Hz=2500.0, resolution_s=1e-6)
    assert made.axis.rate_Hz == pytest.approx(rate, rel=1e-6)
    assert made.axis.first.tolist() == [0]
    assert made.repairs["clock_drift_ppm"] == pytest.approx(262, abs=1)
    assert fit(times / 2500.0, setup_rate_Hz=2500.0, resolution_s=1e-6).axis.rate_Hz == 2500.0


@pytest.mark.parametrize("jitter", [0.0, 0.05, 0.15])
def test_gaps_are_found_at_their_sample(jitter):
    k = row + 7 * (row >= 20_000) + 2 * (row >= 30_000) + 40_000 * (row >= 49_000)
    made = fit((k + jitter * noise(13)) / 2500.0, setup_rate_Hz=2500.0, resolution_s=1e-9)
    first = (0, 20_000, 30_000, 49_000)
    atol = max(0.01, 0.2 * jitter) / 2500.0
    tells(made, k / 2500.0, atol, first=first, gaps=3, lost_samples=40_009)
    assert (19_999, 20_001, Quality.GAP) in made.flags


@pytest.mark.parametrize(("digits", "samples"), [(1.0, 2), (2.0, 1), (2.5, 1), (2.5, 7)])
@pytest.mark.parametrize("lost", [70, N // 2, N - 70])
def test_lost_samples_show_in_stamps_of_few_digits_a_period(digits, samples, lost):
    k = row + samples * (row >= lost)
    made = fit(np.round(k * digits * 1e-4, 4), resolution_s=1e-4)
    tells(made, rate=1e4 / digits, first=(0, lost), gaps=1, lost_samples=samples)
    assert made.axis.start_s[1] == pytest.approx((lost + samples) * digits * 1e-4, abs=0.51e-4)


@pytest.mark.parametrize("digits", [1.0, 1.0003, 1.3, 2.0003, 2.5])
def test_rounding_to_few_digits_a_period_is_no_gap(digits):
    """Nor is it in a clock that drifts and trembles."""
    tells(fit(np.round(row * digits * 1e-4, 4), resolution_s=1e-4), row * digits * 1e-4, 1e-4)
    times = row * round(digits) * (1 + 2e-4)  # it passes a digit's edge every 5000 samples or fewer
    for seed in range(2):
        made = fit(np.round(1e-4 * (times + 0.3 * noise(seed)), 4), resolution_s=1e-4)
        assert made.axis.first.tolist() == [0]
        np.testing.assert_allclose(made.axis.time(), 1e-4 * times, rtol=0, atol=1e-4)


@pytest.mark.parametrize(("step", "origin"), [(1, 0), (10, 3)])
def test_a_missing_sample_number_is_a_gap_and_a_counter_that_begins_again_none(step, origin):
    number = np.arange(1000) + 5 * (np.arange(1000) >= 400)
    made = fit(None, number * step + origin, setup_rate_Hz=100.0)
    tells(made, number / 100.0, first=(0, 400), gaps=1, lost_samples=5)
    tells(fit(None, np.arange(1000) % 256 * step, setup_rate_Hz=100.0))


@pytest.mark.parametrize("ragged", [0.0, 0.04])
def test_stamps_of_one_second_count_by_line_and_what_they_lack_is_counted(ragged):
    k = np.arange(12_000)
    tells(fit(np.floor(k / 20 + 0.013), k + 1, resolution_s=1.0, counted=True), k / 20, rate=20.0)
    k = np.delete(k, 7013)
    stamps = np.floor(k / 20 + 0.013 + ragged * np.random.default_rng(17).random(k.size))
    stamps, numbers = np.maximum.accumulate(stamps), np.arange(k.size) + 1
    made = fit(stamps, numbers, resolution_s=1.0, counted=True)
    assert (made.axis.rate_Hz, made.repairs["lost_samples"]) == (20.0, 1)


def test_a_pause_shows_through_stamps_of_one_second():
    k = np.arange(6000) + 200 * (np.arange(6000) >= 3000)
    made = fit(np.floor(k / 20 + 0.013), np.arange(6000), resolution_s=1.0, counted=True)
    axis = made.axis
    assert made.repairs["gaps"] == 1
    assert abs(int(axis.first[1]) - 3000) <= 20
    assert axis.rate_Hz == pytest.approx(20.0, rel=1e-4)
    assert axis.gaps()[0][1] == pytest.approx(10.05, abs=0.2)


def test_buffers_that_arrive_in_bunches():
    rng, rate = np.random.default_rng(14), 2499.3456
    arrival = (np.arange(N // 25) + 1) * 25 / rate + rng.exponential(2e-4, N // 25)
    stamps = np.repeat(arrival, 25) + 1e-6 * np.tile(np.arange(25), N // 25)
    axis = fit(stamps, setup_rate_Hz=2500.0, resolution_s=1e-6).axis
    assert axis.rate_Hz == pytest.approx(rate, rel=3e-6)
    assert axis.first.tolist() == [0]


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.9])
def test_a_log_that_begins_in_the_midst_of_a_tick_has_no_gap_there(phase):
    axis = fit(np.floor(row / 3.0 * (1 + 2e-5) + phase) * 1e-3, resolution_s=1e-3).axis
    assert axis.first.tolist() == [0]
    assert axis.rate_Hz == pytest.approx(3000.0, rel=5e-5)


#: wrong stamps [s]: zero, as of a row that was never filled, and what a flipped bit makes
WRONG = [0.0, -1e5, -1e18, -1e300, 3.4e9, 1e18, 1e300]


@pytest.mark.parametrize("decimals", [4, 9])
@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize("where", [slice(-1, None), slice(-3, None), slice(0, 1), slice(0, 3)])
def test_wrong_stamps_at_an_end_are_repaired(decimals, wrong, where):
    begin = 1.7e9 if decimals == 4 else 1000.0
    good = begin + (row + 0.02 * noise(20) * (decimals == 9)) / 2500.0
    stamps = np.round(good, decimals)
    stamps[where] = wrong
    made = fit(stamps, setup_rate_Hz=2500.0, resolution_s=10.0**-decimals)
    tells(made, good, 1e-4, stamps_repaired=len(stamps[where]))


@pytest.mark.parametrize("wrong", [3.4e9, 1e300])
@pytest.mark.parametrize("ticks", range(2496, 2513, 5))
def test_a_wrong_last_stamp_of_whole_seconds(wrong, ticks):
    k = np.arange(20 * ticks)
    made = fit(np.r_[np.floor(k / 20 + 0.013)[:-1], wrong], resolution_s=1.0)
    tells(made, k / 20, stamps_repaired=1)
    assert made.remarks == []


def test_lost_samples_before_the_last_stamps_are_a_gap():
    k = row + 7 * (row >= N - 2)
    tells(fit((k + 0.02 * noise(21)) / 2500.0), first=(0, N - 2), gaps=1, lost_samples=7)


@pytest.mark.parametrize("rate", [200.0, 1234.5, 2000.0, 10_000.0])
@pytest.mark.parametrize(("kind", "origin"), [("f2", 0.0), ("f4", 1e5), ("f4", 1e7), ("f4", 1e8)])
@pytest.mark.parametrize("seconds", [10.0, 30.0, 60.0])
def test_stamps_of_few_bits_tell_the_rate_to_their_step_over_the_span(rate, kind, origin, seconds):
    true = np.arange(int(rate * seconds)) / rate
    stamps = (origin + true).astype(kind).astype(float) - origin
    made = ClockFit()
    made.add(stamps, None, true.size)
    if origin == 1e8 and seconds == 10.0:  # steps of 8 s
        with pytest.raises(ReadError, match="rise once"):
            _ = made.axis
        return
    axis, ends = made.axis, np.array([0, true.size - 1])
    assert axis.explicit is None
    span = np.ptp([axis.at(int(end)) for end in ends])
    assert abs(span / true[-1] - 1.0) < max(1e-4, axis.rate_error)


def test_a_rate_that_stamps_tell_to_more_than_a_hundredth_is_refused():
    stamps = np.floor((np.arange(100) + 0.5) / 30.0)  # three seconds of 30 samples
    with pytest.raises(ReadError, match=r"stamps of 1 s, too coarse for a rate .an error of 1.7%."):
        _ = fit(stamps, resolution_s=1.0).axis
    assert fit(stamps, resolution_s=1.0, setup_rate_Hz=30.0).axis.rate_Hz == 30.0


@pytest.mark.parametrize(
    ("rate_Hz", "digit_s", "size"), [(49.37, 0.01, 300), (10.37, 0.1, 50), (1234.56, 1e-3, 900)]
)
def test_a_round_rate_near_any_other_is_none_that_is_known(rate_Hz, digit_s, size):
    stamps = np.round(np.arange(size) / rate_Hz / digit_s) * digit_s
    axis = fit(stamps, resolution_s=digit_s).axis
    assert abs(axis.rate_Hz / rate_Hz - 1.0) < axis.rate_error


def test_stamps_that_are_all_equal_tell_no_rate():
    made = fit(np.full(N, 1.0), setup_rate_Hz=2500.0, resolution_s=0.1)
    np.testing.assert_allclose(made.axis.time(), row / 2500.0, rtol=0, atol=1e-9)
    assert "do not rise" in made.remarks[0]
    with pytest.raises(ReadError, match="stamps that do not rise and no rate"):
        fit(np.full(N, 1.0), resolution_s=0.1)


@pytest.mark.parametrize("jitter", [0.0, 1e-4])
def test_stamps_that_fall_throughout_are_no_clock(jitter):
    stamps = row[::-1] / 1000 + jitter * noise(2)
    with pytest.raises(ReadError, match=r"the rows run backwards in time; .*; sort them"):
        fit(stamps, resolution_s=1e-6, setup_rate_Hz=1000.0)


@pytest.mark.parametrize(
    ("wrong", "repairs", "flags"),
    [
        (
            np.where((row >= 3000) & (row < 3100), 1.0, -5.0 * (row == 7000)),
            {"stamps_repaired": 101},
            [],
        ),
        (-5.0 * (row >= 3000), {"clock_set_back": 1}, [(2999, 3001, Quality.CLOCK_SET_BACK)]),
        (np.where(row % 7 == 0, np.nan, 0.0), {}, []),
    ],
    ids=["late", "set back", "unknown"],
)
def test_a_clock_runs_on_through_wrong_stamps(wrong, repairs, flags):
    made = fit(np.round(row / 2500.0, 4) + wrong, resolution_s=1e-4)
    tells(made, row / 2500.0, **repairs)
    assert made.flags == flags
    assert ["go back by 5 s at sample 3000" in one for one in made.remarks] == [True] * len(flags)


def test_a_repeated_row_stands_between_its_neighbours():
    stamps = np.insert(np.round(np.arange(5000) / 2500.0, 4), 1000, 999 / 2500.0)
    made = fit(stamps, resolution_s=1e-4)
    times = made.axis.time()
    np.testing.assert_allclose(np.delete(times, 1000), np.arange(5000) / 2500.0, atol=1e-9)
    assert times[1000] == pytest.approx(999.5 / 2500.0)
    assert made.flags == [(1000, 1001, Quality.REPEATED_STAMP)]


def irregular(seed, size=4000):
    """Stamps of samples that come by chance, a hundred a second."""
    return np.cumsum(np.random.default_rng(seed).exponential(0.01, size))


def test_samples_without_a_clock_keep_their_stamps():
    stamps = irregular(15)
    made = fit(stamps, resolution_s=1e-9)
    assert made.axis.explicit is not None
    np.testing.assert_array_equal(made.axis.time(100, 200), stamps[100:200])
    assert "no clock of their own" in made.remarks[0]


def test_stamps_that_stray_by_a_quarter_period_are_a_clock_only_where_a_rate_is_declared():
    stamps = (np.arange(5000) + 0.25 * noise(18, 5000)) / 83.0
    assert fit(stamps, resolution_s=1e-9).axis.explicit is not None
    declared = fit(stamps, setup_rate_Hz=83.0, resolution_s=1e-9).axis
    assert (declared.rate_Hz, declared.first.tolist()) == (83.0, [0])


def test_irregular_stamps_that_fall_are_made_to_rise():
    stamps = irregular(16)
    stamps[100] = stamps[99] - 0.001
    stamps[200] = stamps[0] = stamps[-1] = np.nan
    made = fit(stamps, resolution_s=1e-9)
    times = made.axis.time()
    assert (np.diff(times) > 0).all()
    assert times[100] == pytest.approx((stamps[99] + stamps[101]) / 2)
    assert made.repairs["stamps_repaired"] == 4


def test_a_pause_of_irregular_stamps_is_a_gap():
    stamps = irregular(19)
    stamps[2345:] += 3.0
    stamps[999:1002] = np.nan
    made = fit(stamps, resolution_s=1e-9)
    times, good = made.axis.time(), ~np.isnan(stamps)
    np.testing.assert_array_equal(times[good], stamps[good])
    assert (np.diff(times) > 0).all()
    assert made.axis.rate_Hz == pytest.approx(100.0, rel=0.05)
    assert made.flags == [(2344, 2346, Quality.GAP)]


def test_numbers_that_leap_all_the_time_are_not_used():
    numbers = np.cumsum(1 + 3 * (np.arange(400_000) % 3 == 0))
    made = fit(None, numbers, block=50_000, setup_rate_Hz=100.0)
    assert made.axis.first.tolist() == [0]
    assert "leap too often" in made.remarks[0]


def test_a_rate_that_the_stamps_contradict():
    stamps = np.round(row / 2500.0, 4)
    made = fit(stamps, setup_rate_Hz=2450.0, resolution_s=1e-4)
    assert made.axis.rate_Hz == 2500.0
    assert "2450 Hz, the stamps say 2500 Hz" in made.remarks[0]
    with pytest.raises(SetupError, match="sampling_rate_Hz = 1000, but the stamps say 2500 Hz"):
        fit(stamps, setup_rate_Hz=1000.0, resolution_s=1e-4)


def test_without_stamps_a_rate_must_be_declared():
    assert fit(size=10, setup_rate_Hz=5.0).axis.time(9) == pytest.approx([1.8])
    assert fit(size=10, file_rate_Hz=5.0).axis.rate_Hz == 5.0
    with pytest.raises(ReadError, match="no stamps and no rate"):
        fit(size=10)


@pytest.mark.parametrize(
    "stamps", [[0.0], [0.0, 1.0], [0.0, 0.5, 0.5], [0.0, 0.5, 1.0, 9.0], [np.nan, np.nan, 1.0]]
)
def test_few_stamps(stamps):
    axis = fit(stamps, setup_rate_Hz=2.0 if len(stamps) > 2 else 1.0, resolution_s=0.1).axis
    assert np.isfinite(axis.time()).all()


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
    """Where in its tick a gap lies is not told."""
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
