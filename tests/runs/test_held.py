"""Closed form: values of a known rate, each written several times by a faster logger."""

import numpy as np
import pytest

import tirelog
from tirelog.data.recording import Scaled, TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.runs.in_memory import sample_and_hold
from tirelog.runs.ingest import open_recording, write_run

RATE = 2000.0


def signal(values, seed=0):
    """A patch 8 times a second at 1 kHz, [microstrain] of two decimals."""
    phase = (np.arange(values) * 8e-3) % 1.0 - 0.5
    noise = np.random.default_rng(seed).standard_normal(values)
    return np.round(3.0 * noise - 1000.0 * np.exp(-((phase / 0.03) ** 2)), 2)


def held_in(values, axis=None, **more):
    """(places of the values, their axis, rows of each), None if all rows are values."""
    stored = Scaled(lambda start, stop: values[start:stop], 1.0, 0.0)
    return sample_and_hold(stored, axis or TimeAxis.uniform(values.size, RATE), **more)


@pytest.mark.parametrize("every", [2, 3, 7])
@pytest.mark.parametrize("phase", [0, 1])
def test_each_value_is_taken_once_be_it_held_or_between_blanks(every, phase):
    held = np.repeat(signal(6000), every)[phase:]
    blank = np.full(6000 * every, np.nan)
    blank[phase::every] = signal(6000)
    blank[phase + 40 * every :: 97 * every] = np.nan  # lost by the instrument
    assert held_in(blank) is None
    for values, first in ((held, (every - phase) % every), (blank, phase)):
        at, axis, *most = held_in(values, held=values is held)
        assert most == [every, every]
        assert at.tolist() == list(range(first, values.size, every))
        np.testing.assert_allclose(axis.time(), at / RATE, rtol=0, atol=1e-12)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.6])
def test_values_lost_by_chance_leave_no_other_rate(share):
    values = signal(9000)
    values[np.random.default_rng(3).random(9000) < share] = np.nan
    assert held_in(values, held=False) is None


def test_a_log_of_two_instruments_has_the_rate_of_each(tmp_path):
    values = [f"{value:.2f}" for value in signal(6000)]
    rows = (f"{k / 2000.0:.4f},{640 if k % 2 else ''},{'' if k % 2 else values[k // 2]}"
            for k in range(12_000))  # fmt: skip
    (tmp_path / "log.csv").write_text("\n".join(["time_s,rpm,strain", *rows]))
    (tmp_path / "log.toml").write_text(
        "[tire]\nrolling_radius_m = 0.3\n"
        '[channels.s]\nkind = "strain"\nsource = "strain"\nunit = "microstrain"\n'
    )
    with tirelog.open_log(tmp_path / "log.csv") as log:
        channel, (remark,) = log.channels["s"], log.remarks
    assert (channel.size, channel.axis.rate_Hz) == (6000, pytest.approx(1000.0))
    assert "a value every 2 rows, blanks between" in remark


@pytest.mark.parametrize("ratio", [2.5, 2.2, 3.7])
def test_clocks_that_are_no_multiples_give_the_instrument_s_even_times(ratio):
    values = signal(9000)
    written = values[10 * np.arange(int(8000 * ratio)) // int(10 * ratio)]
    found = held_in(written)
    at, held = found[:2]
    assert held.rate_Hz == pytest.approx(RATE / ratio, rel=1e-5)
    # a value is new up to a sample of the logger before it is written first
    true = np.arange(at.size) * ratio / RATE
    late = held.time() - true
    assert late.min() > 0.0
    assert late.max() < 1.0 / RATE
    assert np.ptp(late) < 0.05 / RATE
    np.testing.assert_array_equal(written[at], values[: at.size])


def test_values_that_are_alike_by_chance_and_lost_ones_do_not_matter():
    values = np.round(signal(6000))
    assert np.mean(np.diff(values) == 0.0) > 0.05
    values[::97] = np.nan
    at = held_in(np.repeat(values, 2))[0]
    assert at.tolist() == list(range(0, 12_000, 2))


def test_each_segment_begins_a_value_of_its_own():
    values = np.repeat(signal(6000), 3)
    values = np.delete(values, np.arange(9001, 9400))
    starts_s, periods_s = np.array([0.0, 9400 / RATE]), np.full(2, 1.0 / RATE)
    parts = TimeAxis(values.size, RATE, np.array([0, 9001]), starts_s, periods_s)
    held = held_in(values, parts)[1]
    places = np.concatenate([np.arange(0, 9001, 3), np.arange(9402, 18_000, 3)])
    np.testing.assert_allclose(held.time(), places / RATE, rtol=0, atol=1e-12)


@pytest.mark.parametrize("slip", [200, 5000])
def test_rows_that_a_log_lost_without_a_gap_cost_no_more_than_themselves(slip):
    values = np.delete(np.repeat(signal(6000), 2), np.arange(101, 12_000, slip))
    at = held_in(values)[0]
    np.testing.assert_array_equal(values[at], signal(6000)[: at.size])


@pytest.mark.parametrize("step", [0.01, 1.0, 10.0, 50.0, 200.0])
@pytest.mark.parametrize("speed", [1.0, 0.1, 0.02])
def test_a_rounded_signal_is_not_held(step, speed):
    phase = (np.arange(60_000) * 8e-3 * speed) % 1.0 - 0.5
    noise = np.random.default_rng(1).standard_normal(phase.size)
    smooth = 0.5 * noise - 1000.0 * np.exp(-((phase / 0.03) ** 2))
    values = np.round(smooth / step) * step
    assert held_in(values) is None


SETUP = """[tire]
unloaded_radius_m = 0.3
[channels.slow]
kind = "strain"
source = "slow"
unit = "microstrain"
[channels.fast]
kind = "strain"
source = "fast"
unit = "microstrain"
[log]
time = "time_s"
"""


def text_log(path, slow, fast):
    rows = (f"{i / RATE:.4f},{a:.2f},{b:.2f}" for i, (a, b) in enumerate(zip(slow, fast)))
    path.write_text("\n".join(["time_s,slow,fast", *rows]) + "\n")
    return SETUP


def test_a_log_and_its_run(tmp_path):
    values, fast = signal(1500), signal(3000, 5)
    log = tmp_path / "log"
    setup = parse_setup(text_log(log, np.repeat(values, 2), fast))
    summary = write_run(str(log), setup, tmp_path / "run.h5")
    assert any("repeats each value 2 times" in remark for remark in summary.remarks)
    for path in (log, tmp_path / "run.h5"):
        with open_recording(str(path), setup) as recording:
            slow, other = recording.channels["slow"], recording.channels["fast"]
            np.testing.assert_allclose(slow.read(), 1e-6 * values, atol=1e-12)
            np.testing.assert_allclose(slow.read(7, 11), 1e-6 * values[7:11], atol=1e-12)
            assert slow.axis.rate_Hz == pytest.approx(0.5 * RATE, rel=1e-6)
            assert other.axis.rate_Hz == pytest.approx(RATE, rel=1e-6)
            assert other.size == fast.size
            said = [remark for remark in recording.remarks if "repeats each value" in remark]
            assert len(said) == 1
            assert said[0].startswith("slow: the log repeats each value 2 times")


def test_values_further_apart_than_a_block_have_no_rate_of_their_own():
    """As of a slow grating of coarse steps."""
    rows = 140_000 + np.random.default_rng(5).integers(0, 50, 110)
    assert held_in(np.repeat(np.arange(110, dtype=np.int16), rows)) is None


@pytest.mark.parametrize("levels", ["sine", "square"])
def test_an_encoder_s_held_values_are_taken_once_and_two_levels_are_none(tmp_path, levels) -> None:
    """A square wave at a constant speed changes as evenly as a value that is held."""
    teeth = np.sin(2.0 * np.pi * (np.arange(3000) + 0.5) / (37.3 if levels == "sine" else 20.0))
    values = np.repeat(np.round(teeth, 4), 4) if levels == "sine" else np.sign(teeth)
    log = tmp_path / "log.csv"
    log.write_text(
        "\n".join(["time_s,encoder", *(f"{i / RATE},{v}" for i, v in enumerate(values))])
    )
    setup = parse_setup(
        "[tire]\nrolling_radius_m = 0.3\n"
        '[channels.encoder]\nkind = "wheel_encoder"\nsource = "encoder"\nunit = "V"\n'
        'steps = 48\n[log]\ntime = "time_s"\n'
    )
    with open_recording(str(log), setup) as recording:
        rate = recording.channels["encoder"].axis.rate_Hz
    assert rate == pytest.approx(RATE / 4 if levels == "sine" else RATE)
