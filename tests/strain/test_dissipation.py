"""Closed form: dissipation by finite-difference truths, its pieces on paper, and bad input."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from tests.strain.conftest import make_drive, without_rows
from tests.strain.strain_truth import Beam, Ring
from tirelog.data.recording import Recording
from tirelog.data.setup import LogConditions, Setup, Tire
from tirelog.plots.tables import fitted_line
from tirelog.products import tables_of
from tirelog.strain.dissipation import dissipation, regression, steady_stretches
from tirelog.strain.passages.find import find_passages
from tirelog.strain.speed import speed_quality
from tirelog.vocabulary.quality import Quality, good, having

CALM = {"height": 1.0, "drift": 0.0}


def tables(channels, radius_m, load_N=None, **more):
    """The tables of the gratings `channels` on a tire of P1's strip."""
    tire = {"section_height_m": 0.018, "width_m": 0.215, "viscosity_Pa_s": 2e3} | more
    setup = Setup(Tire(rolling_radius_m=radius_m, **tire), LogConditions(load_N=load_N))
    return list(tables_of(Recording("a.csv", channels, setup), {"dissipation": {}}))


def measured(radius_m, truth, speed, seconds=30, **more):
    """(drive, passages, energy, factor over the true one) of a drive at one speed."""
    if isinstance(truth, Beam):
        truth = replace(truth, speeds=(speed, speed), _cache={})
    made = make_drive([0, seconds], [speed, speed], pulse=truth, **CALM | more)
    return made, *energy_of(made.channel, radius_m, truth.dissipation_factor(speed))


def energy_of(channel, radius_m, true):
    passages = find_passages(channel, radius_m)
    found = dissipation(channel, passages, 1e-3, speed_quality(passages))
    return passages, found, found.factor_1_m / true


@pytest.mark.parametrize(
    ("truth", "speed", "rate_Hz", "off"),
    [*((Beam(), speed, 2500.0, 0.001) for speed in (6.0, 11.0, 17.0, 24.0))]
    + [(Beam(), speed, 25_000.0, 0.001) for speed in (6.0, 24.0)]
    # with humps at its edges
    + [(Ring(), speed, 2500.0, 0.004) for speed in (6.0, 24.0)],
)
def test_the_factor_of_a_carcass(radius_m, truth, speed, rate_Hz, off):
    seconds = 30 if rate_Hz < 1e4 else 6
    ratio = measured(radius_m, truth, speed, seconds, seed=1700, rate_Hz=rate_Hz)[3][1:-1]
    assert np.median(ratio) == pytest.approx(1.0, abs=off)
    assert ratio.std() < 0.005


@pytest.mark.parametrize(("rows_missing", "seed"), [(1, 1760), (2, 1761), (40, 1762)])
def test_gaps_are_bridged_or_said(radius_m, rows_missing, seed):
    made, *_ = measured(radius_m, Beam(), 10.0, 40, seed=seed)
    kept, rng = np.ones(made.values.size, bool), np.random.default_rng(seed)
    for first in rng.integers(500, made.values.size - 500, 150):
        kept[first : first + rows_missing] = False
    gapped = without_rows(made, kept)
    passages, found, ratio = energy_of(gapped, radius_m, Beam().dissipation_factor(10.0))
    clean = good(found.quality)
    assert clean.sum() > 30
    np.testing.assert_allclose(ratio[clean], 1.0, atol=0.02)
    gap = having(found.quality, Quality.GAP)
    assert gap[np.abs(ratio - 1.0) > 0.02].all()
    # a lone sample spoils no more revolutions than those in whose patch it lies
    if rows_missing == 1:
        np.testing.assert_array_equal(gap, having(passages.quality, Quality.GAP))


def test_noise_brings_no_bias_and_the_errors_cover(radius_m):
    inside, medians = [], []
    for seed in range(1710, 1716):
        _, _, found, ratio = measured(radius_m, Beam(), 10.0, seed=seed, noise_pm=6.0)
        error = found.factor_se_1_m * ratio / found.factor_1_m
        inside.append(np.mean(np.abs(ratio - 1.0)[1:-1] < error[1:-1]))
        medians.append(np.median(ratio[1:-1]))
    assert np.mean(inside) == pytest.approx(0.68, abs=0.05)
    assert np.mean(medians) == pytest.approx(1.0, abs=0.002)


def test_lost_samples_and_a_spike_are_bridged(radius_m):
    made, *_ = measured(radius_m, Beam(), 12.0, 20, seed=1720)
    values, rng = made.values.copy(), np.random.default_rng(1720)
    values[rng.choice(values.size, 40, replace=False)] = np.nan
    values[rng.choice(values.size, 5, replace=False)] += 4e-3
    true = Beam().dissipation_factor(12.0)
    ratio = energy_of(made.with_values(values), radius_m, true)[2]
    assert ratio.size == made.time_s.size
    assert np.nanmedian(ratio) == pytest.approx(1.0, abs=0.001)
    assert np.nanmax(ratio[1:-1]) < 1.1


def test_specific_power_power_and_rolling_resistance(radius_m):
    made, *_ = measured(radius_m, Beam(), 12.0, 12, seed=1721)
    (table,) = tables({"s": made.channel}, radius_m, load_N=3600.0)
    c = table.columns
    expected = 12.0**2 * 0.018 * 0.215 * c["dissipation_factor_1_m"]
    np.testing.assert_allclose(c["specific_power_m3_s2"], expected, rtol=2e-3)
    np.testing.assert_allclose(c["strip_power_W"], 2e3 * c["specific_power_m3_s2"])
    resistance_N = c["strip_rolling_resistance_N"]
    np.testing.assert_allclose(resistance_N * c["speed_m_s"], c["strip_power_W"])
    np.testing.assert_allclose(c["strip_rolling_resistance_coefficient"] * 3600.0, resistance_N)
    assert any("0.00387" in remark for remark in table.remarks)
    assert any("strip under the grating" in remark for remark in table.remarks)


@pytest.mark.parametrize(
    ("surface", "words"),
    [("inner", ("liner", "three times too much")), ("outer", ("groove", "too little", "5.2 mm"))],
)
def test_the_remark_on_bending_is_of_the_grating_s_own_surface(radius_m, surface, words):
    """P1 (25) without stretch over (27): 12 (y/h)^2, 3 on the liner and 1/33 at P2's y."""
    channel = make_drive([0, 2], [12, 12], seed=1722, surface=surface).channel
    table, again = tables({"one": channel, "more": channel}, radius_m)
    (remark,) = (remark for remark in table.remarks if "in pure bending" in remark)
    assert all(word in remark for word in words)
    assert not any("in pure bending" in remark for remark in again.remarks)


def test_constant_speed_is_told_by_the_size_of_the_step():
    """P1 prints the step without its absolute value: braking would always pass."""
    speed = np.array([10.0, 10.05, 10.0, 9.5, 9.0, 8.5, 8.45, 8.44, 8.44])
    known = np.ones(speed.size, bool)
    assert steady_stretches(speed, known).tolist() == [0, 0, 0, -1, -1, 1, 1, 1, 1]
    assert steady_stretches(speed, known, 0.6).tolist() == [0] * 9
    known[6] = False  # the next passage is not known to be one turn away
    assert steady_stretches(speed, known).tolist() == [0, 0, 0, -1, -1, 1, 1, 2, 2]


@pytest.mark.parametrize(("stretches", "between"), [(3, 0.0), (3, 1e-5), (5, 1e-6), (12, 1e-5)])
def test_the_interval_of_a_slope_covers_it(stretches, between):
    """With and without what the revolutions of a stretch share."""
    rng = np.random.default_rng(1732)
    covered = []
    for _ in range(200):
        rows = rng.integers(5, 60, stretches)
        speed = np.repeat(np.linspace(6, 24, stretches), rows)
        own = np.repeat(rng.normal(0, between, stretches), rows)
        values = 4e-4 - 5e-6 * speed + own + rng.normal(0, 3e-6, speed.size)
        line = regression("q", speed, values, np.repeat(np.arange(stretches), rows))
        covered.append(line["slope_lower"] < -5e-6 < line["slope_upper"])
    assert 0.90 <= np.mean(covered) <= 0.98
    assert regression("q", np.full(20, 9.0), np.ones(20), np.zeros(20, int)) is None
    assert regression("q", speed, values, np.full(speed.size, -1)) is None


def line_of(*means, scatter=1e-7):
    """A regression through stretches of ten revolutions: `means` at speeds 4 m/s apart."""
    rng = np.random.default_rng(1733)
    number = np.repeat(np.arange(len(means)), 10)
    values = np.repeat(means, 10) + rng.normal(0, scatter, number.size)
    return regression("q", 6.0 + 4.0 * number, values, number)


def test_what_is_said_of_a_line():
    """A line through two or three speeds is not tested."""
    two, three, bent = line_of(1.0, 3.0), line_of(1.0, 2.0, 3.0), line_of(1.0, 2.0, 3.5)
    assert (two["degrees_of_freedom"], two["judgement"]) == (0, "2 speeds: a line is not tested")
    assert np.isnan([two["slope_se"], two["curvature"]]).all()
    untested = "3 speeds: a line is not tested"
    assert (three["degrees_of_freedom"], three["judgement"]) == (1, untested)
    assert bent["judgement"].startswith(f"{untested}; the line misses a mean by")
    assert bent["miss_sigmas"] > 4
    assert "doubtful" in fitted_line("x", 0, bent).name  # in its picture, too
    assert "±" not in fitted_line("x", 0, two).name
    five = line_of(1.0, 4.0, 9.0, 16.0, 25.0)
    assert "parabola follows" in five["judgement"]
    assert five["doubtful"]
    assert five["curvature"] == pytest.approx(1 / 16, rel=1e-4)
    ends = np.polynomial.polynomial.polyval([6.0, 22.0], five["parabola"])
    np.testing.assert_allclose(ends, [1.0, 25.0], rtol=1e-4)
    straight = line_of(1.0, 2.0, 3.0, 4.0)
    assert (straight["judgement"], straight["doubtful"]) == ("", False)
    assert not line_of(1.0, 2.1, 2.9, 4.05, 4.98)["doubtful"]


def test_a_slow_coast_down_is_more_than_one_point():
    """A stretch whose speed moves by small steps is cut: its mean alone would forget its slope."""
    speed = np.linspace(10.0, 20.0, 200)
    line = regression("q", speed, 2.0 * speed, np.zeros(200, int))
    assert (line["stretches"], line["points"]) == (1, 10)
    assert line["slope"] == pytest.approx(2.0, rel=1e-6)
    assert line["slope_se"] < 1e-6


@pytest.mark.parametrize("seconds", [0.15, 0.3, 0.5, 0.8, 3.0])
def test_a_log_of_few_revolutions_has_all_its_rows(radius_m, seconds):
    """Where the log cuts a patch off the factor is NaN, and never a part of it."""
    made, *_ = measured(radius_m, Beam(), 10.0, seconds, seed=1740)
    (table,) = tables({"s": made.channel}, radius_m)
    factor = table.columns["dissipation_factor_1_m"]
    assert factor.size == len(table.found.passages) > 0
    known = np.isfinite(factor)
    np.testing.assert_allclose(factor[known], Beam().dissipation_factor(10.0), rtol=0.01)
    assert "ok" not in table.columns["quality"][~known]


def loosened(values):
    """From the middle on a half of what the grating should show."""
    return np.where(np.arange(values.size) < values.size // 2, values, 0.5 * values)


def averaged(values, samples=7):
    """An instrument that gives the mean of so many samples."""
    return np.convolve(values, np.ones(samples) / samples, "same")


def interpolated(values):
    """Holes of 2 to 10 ms that the logger filled by straight lines."""
    out, random = values.copy(), np.random.default_rng(1771)
    for first in random.integers(100, values.size - 100, 60):
        stop = first + int(random.integers(5, 26))
        out[first:stop] = np.linspace(out[first], out[stop], stop - first, endpoint=False)
    return out


@pytest.mark.parametrize("change", [loosened, averaged, interpolated])
def test_what_sensor_and_logger_do_gives_no_factor_that_is_ok(radius_m, change):
    drive = make_drive([0, 6, 10, 16], [10, 10, 18, 18], seed=1770)
    changed = drive.with_values(change(drive.values))
    clean, found = (energy_of(channel, radius_m, 1.0)[1] for channel in (drive.channel, changed))
    assert good(clean.quality)[1:-1].all()
    ok, off = good(found.quality), np.abs(found.factor_1_m - clean.factor_1_m)
    wrong = (off > 5.0 * found.factor_se_1_m) & (off > 0.02 * clean.factor_1_m)
    assert wrong.any()
    assert not (ok & wrong).any()


@pytest.mark.parametrize(("samples", "cutoff_Hz"), [(4, 0), (16, 0), (32, 0), (1, 200), (1, 400)])
def test_a_mean_of_samples_leaves_no_factor_that_is_ok_and_a_low_pass_does(
    radius_m, samples, cutoff_Hz
):
    drive = make_drive([0, 10], [10, 10], seed=1772)
    values = averaged(drive.values, samples)
    if cutoff_Hz:
        values = sosfiltfilt(butter(4, cutoff_Hz, fs=2500.0, output="sos"), values)
    ok = good(energy_of(drive.with_values(values), radius_m, 1.0)[1].quality)
    assert ok[1:-1].all() if cutoff_Hz else not ok.any()


def test_a_disturbance_in_the_patch_is_no_change_of_load(radius_m):
    """Loads scatter by 4 % from turn to turn, and change the patch as a whole."""
    drive, random = make_drive([0, 20], [10, 10], seed=5), np.random.default_rng(3)
    time = np.arange(drive.values.size) / 2500.0
    loads = 1.0 + 0.04 * random.standard_normal(drive.time_s.size)
    turn = np.argmin(np.abs(time[:, None] - drive.time_s), axis=1)
    level = np.median(drive.values)
    values = level + (drive.values - level) * loads[turn]
    hit = random.choice(np.arange(12, drive.time_s.size - 12), 10, replace=False)
    at = drive.time_s[hit, None] + 0.018
    changed = values + np.sum(160e-6 * np.exp(-0.5 * ((time - at) / 0.003) ** 2), axis=0)
    passages, found, *_ = energy_of(drive.with_values(changed), radius_m, 1.0)
    rows = [int(np.argmin(np.abs(passages.time_s - t))) for t in drive.time_s[hit]]
    assert not good(found.quality)[rows].any()
    calm = np.setdiff1d(np.arange(1, found.quality.size - 1), np.add.outer(rows, [-1, 0, 1]))
    assert good(found.quality)[calm].mean() > 0.9
