"""Faults: footprint and dissipation lose no row; each fault has its own word."""

import numpy as np
import pytest

from tests.strain.conftest import make_drive
from tests.strain.strain_truth import Beam
from tirelog.dsp.filters import Cutoff
from tirelog.runs.in_memory import without_spikes
from tirelog.strain.dissipation import dissipation
from tirelog.strain.footprint.footprint import footprint
from tirelog.strain.passages.find import find_passages
from tirelog.strain.speed import speed_quality
from tirelog.vocabulary.quality import Quality, good, having

pytestmark = pytest.mark.xdist_group("footprint rows")  # one worker makes what these tests share

TRUTH = Beam(speeds=(6.0, 20.0))
CALM = {"height": 1.0, "drift": 0.0}


@pytest.fixture(scope="module")
def made():
    return make_drive([0, 12, 16, 30], [8, 8, 18, 18], seed=1500, pulse=TRUTH, **CALM)


def of(channel, radius_m, cutoff="auto"):
    passages = find_passages(channel, radius_m)
    return passages, footprint(channel, passages, Cutoff.parse(cutoff))


@pytest.fixture(scope="module")
def measured(made, radius_m):
    """Passages and footprint of the drive."""
    return of(made.channel, radius_m)


@pytest.mark.parametrize("blocks", [4096, 50_001])
def test_the_same_rows_for_any_block_size(made, measured, blocks, monkeypatch):
    passages, whole = measured
    monkeypatch.setattr("tirelog.strain.footprint.learn.BLOCK_SAMPLES", blocks)
    pieces = footprint(made.channel, passages)
    names = ("length_m", "length_se_m", "length_d2_m", "length_d1_m", "edge_asymmetry")
    for name in (*names, "entry_time_s", "exit_time_s"):
        one, other = getattr(pieces, name), getattr(whole, name)
        np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-12, err_msg=name)
    np.testing.assert_array_equal(pieces.quality, whole.quality)
    words, spiked = speed_quality(passages), made.values.copy()
    borders = blocks * np.arange(2, spiked.size // blocks)  # a spike about each of them
    spiked[borders + np.arange(borders.size) % 29 - 14] += np.nanmax(spiked)
    for channel in (made.channel, made.with_values(spiked)):
        with monkeypatch.context() as whole_log:
            whole_log.setattr("tirelog.strain.dissipation.MOST_AT_ONCE", 1 << 20)
            one = dissipation(channel, passages, 1e-3, words)
        with monkeypatch.context() as in_blocks:
            in_blocks.setattr("tirelog.strain.dissipation.MOST_AT_ONCE", blocks)
            many = dissipation(channel, passages, 1e-3, words)
        np.testing.assert_allclose(many.factor_1_m, one.factor_1_m, rtol=1e-9)


def test_an_ordinary_log_is_ok_and_its_edges_are_half_a_length_from_the_middle(measured):
    passages, found = measured
    assert np.mean(good(found.quality)) > 0.95
    assert np.isfinite(found.length_m).all()
    way = (found.exit_time_s - found.entry_time_s) * passages.speed_m_s
    calm = np.abs(passages.acceleration_m_s2) < 0.5
    np.testing.assert_allclose(way[calm], found.length_m[calm], rtol=1e-3)


def test_bursts_leave_other_rows_as_they_were(made, measured, radius_m):
    """The rows that follow the burst's own differ by what the form is learnt from."""
    passages, found = measured
    hit, time, rate_Hz = made.values.copy(), made.time_s, made.channel.axis.rate_Hz
    inside, outside = int(rate_Hz * time[30]), int(rate_Hz * (0.7 * time[51] + 0.3 * time[50]))
    hit[inside - 1 : inside + 2] += 0.08
    hit[outside : outside + 3] += 4.0
    own = without_spikes(made.with_values(hit))
    now, length = of(own, radius_m)
    assert np.nanmax(np.abs(length.length_m - found.length_m)) < 3e-4
    before, after = (
        dissipation(channel, rows, None, rows.quality)
        for channel, rows in ((made.channel, passages), (own, now))
    )
    assert np.nanmax(np.abs(after.factor_1_m / before.factor_1_m - 1)) < 0.02
    # the burst between two passages is in the turn of the second
    assert having(after.quality, Quality.SPIKE).nonzero()[0].tolist() == [30, 51]


@pytest.mark.parametrize(
    ("word", "hit", "beside", "bad", "off"),
    [(Quality.LOST_PEAK, 20, (0, 3), np.nan, 0.01), (Quality.SPIKE, 25, (4,), 3e-3, 0.2)],
)
def test_a_fault_inside_the_patch_is_said_in_its_row(made, radius_m, word, hit, beside, bad, off):
    values, rate_Hz = made.values.copy(), made.channel.axis.rate_Hz
    values[np.round(made.time_s[hit] * rate_Hz).astype(int) + np.array(beside)] += bad
    passages, found = of(made.with_values(values), radius_m)
    row = int(np.argmin(np.abs(passages.time_s - made.time_s[hit])))
    assert len(passages) == made.time_s.size
    assert having(found.quality, word)[row]
    assert having(found.quality, word).sum() <= 2
    assert abs(found.length_m[row] / 0.11 - 1) < off


@pytest.mark.parametrize(
    ("word", "share", "clip", "cutoff", "more"),
    [
        (Quality.CLIPPED, 0.9, 0.02, "auto", {}),
        (Quality.CUTOFF, 1.0, 0.0, "2kHz", {}),  # above what is sampled
        (Quality.PATCH_SHORT, 1.0, 0.0, "auto", {"rate_Hz": 600.0}),  # of less than four samples
    ],
)
def test_what_all_passages_share_is_said_in_their_rows(radius_m, word, share, clip, cutoff, more):
    d = make_drive([0, 20], [24, 24], seed=1501, pulse=TRUTH, **CALM, **more)
    clipped = d.with_values(np.maximum(d.values, np.quantile(d.values, clip)))
    passages, found = of(clipped, radius_m, cutoff)
    assert len(passages) == d.time_s.size
    assert np.mean(having(found.quality, word)) >= share
    assert np.isfinite(found.length_m).mean() > 0.9 or word == Quality.PATCH_SHORT


@pytest.mark.parametrize("rate_Hz", [100.0, 300.0])
@pytest.mark.parametrize("noise_pm", [0.8, 80.0])
def test_a_log_of_few_samples_a_passage_has_its_rows(radius_m, rate_Hz, noise_pm):
    few = {"rate_Hz": rate_Hz, "noise_pm": noise_pm, **CALM}
    made = make_drive([0, 12], [14, 14], seed=7, pulse=TRUTH, **few)
    passages, found = of(made.channel, radius_m)
    assert len(found.length_m) == len(passages)
    assert not (good(found.quality) & ~having(found.quality, Quality.PATCH_SHORT)).any()


def test_cutoffs_as_the_papers_give_them(radius_m):
    speed = np.array([5.0, 20.0])
    turns = 40 * speed / (2 * np.pi * radius_m)
    for text, frequency in (("400 Hz", 400.0), ("0.4kHz", 400.0), ("40x", turns)):
        found = Cutoff.parse(text).frequency(speed, radius_m, 1.0)
        np.testing.assert_allclose(found, frequency)
