"""Closed form: tooth passages, counted teeth and the pitch table of a sine whose phase is known."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from tirelog.data.recording import Channel, TimeAxis
from tirelog.dsp.encoder import AngleFunction, counter_knots, without_spikes
from tirelog.dsp.pitch import (
    MOST_REACH,
    SLOPE,
    VALUE,
    KnotBuilder,
    PitchLearner,
    angle_function,
)
from tirelog.dsp.teeth import Crossings, count_teeth, crossings, probe

RATE, STEPS = 10_000.0, 48


def reader(values):
    return lambda start, stop: values[max(start, 0) : stop]


def passages(values, **more):
    found = probe(reader(values), values.size)
    pieces = list(crossings(reader(values), values.size, RATE, found, **more))
    return found, Crossings(*(np.concatenate(part) for part in zip(*pieces, strict=True)))


def teeth(values):
    found = probe(reader(values), values.size)
    pieces = list(
        count_teeth(
            reader(values), found, crossings(reader(values), values.size, RATE, found), RATE, STEPS
        )
    )
    rows = np.concatenate(pieces)
    columns = {name: rows[name] for name in ("index", "count", "stretch", "forward")}
    return SimpleNamespace(**columns, missing=rows["missing"].sum(), extra=rows["extra"].sum())


def learn(time, count):
    """The table of one stretch, given in pieces."""
    learner = PitchLearner(STEPS)
    for piece in np.array_split(np.arange(count.size), 7):
        learner.add(time[piece], count[piece], np.zeros(piece.size, int), np.ones(piece.size, bool))
    return learner.table(learner.placings())


def wheel(seconds=20.0, turns_s=5.0, sweep=0.0):
    """(time, angle [turns]) of a wheel whose speed changes by `sweep` turns/s^2."""
    time = np.arange(0, seconds, 1 / RATE)
    return time, turns_s * time + 0.5 * sweep * time**2


def test_pure_sine_is_placed_to_a_thousandth_of_a_tooth():
    time, turns = wheel()
    _, seen = passages(3.0 + 0.7 * np.sin(2 * np.pi * STEPS * turns))
    phase = 2 * STEPS * np.interp(seen.index, np.arange(time.size), turns)
    assert seen.index.size == pytest.approx(2 * STEPS * turns[-1], abs=2)
    assert np.abs(phase - np.rint(phase)).max() < 1e-3


def test_result_does_not_depend_on_the_blocks():
    random = np.random.default_rng(1)
    _, turns = wheel(sweep=0.1)
    values = np.sin(2 * np.pi * STEPS * turns) + 0.05 * random.standard_normal(turns.size)
    whole, parts = passages(values, block=1 << 22)[1], passages(values, block=30_000)[1]
    assert np.array_equal(whole.rising, parts.rising)
    np.testing.assert_allclose(whole.index, parts.index, atol=1e-6)


def test_no_tooth_is_lost_at_a_tenth_of_noise():
    random = np.random.default_rng(1002)
    _, turns = wheel(60.0, 2.0, 0.15)
    found = teeth(np.sin(2 * np.pi * STEPS * turns) + 0.1 * random.standard_normal(turns.size))
    true = 2 * STEPS * np.interp(found.index, np.arange(turns.size), turns)
    assert np.ptp(np.rint(true - found.count)) == 0
    assert np.abs(true - found.count - np.rint(true - found.count)).max() < 0.25


@pytest.mark.parametrize("kind", ["glitch", "flat", "doubled"])
def test_repairs_keep_the_count(kind):
    random = np.random.default_rng(3)
    _, turns = wheel()
    values = np.sin(2 * np.pi * STEPS * turns)
    if kind == "doubled":
        tooth = np.floor(STEPS * turns) % STEPS
        values = np.where(tooth == 7, np.sin(4 * np.pi * STEPS * turns), values)
    else:
        for start in random.integers(2000, values.size - 2000, 25):
            values[start : start + (4 if kind == "glitch" else 60)] = (
                -1.6 if kind == "glitch" else 0.0
            )
    found = teeth(values + 0.02 * random.standard_normal(values.size))
    true = 2 * STEPS * np.interp(found.index, np.arange(turns.size), turns)
    offset = np.median(true - found.count)
    assert np.mean(np.abs(true - found.count - offset) < 0.2) > 0.97
    assert abs((true - found.count - offset)[-1]) < 0.2
    assert (found.extra if kind == "doubled" else found.missing + found.extra) > 0


def test_standstill_begins_a_new_stretch_and_keeps_the_parity():
    time = np.arange(0, 20, 1 / RATE)
    speed = np.interp(time, [0, 5, 8, 12, 15, 20], [5, 5, 0, 0, 5, 5])
    turns = np.cumsum(speed) / RATE
    found = teeth(
        np.sin(2 * np.pi * STEPS * turns)
        + 0.02 * np.random.default_rng(4).standard_normal(time.size)
    )
    assert found.stretch[-1] >= 1
    true = 2 * STEPS * np.interp(found.index, np.arange(turns.size), turns)
    error = true - found.count
    assert abs(error[-100:].mean() - error[:100].mean()) < 0.1


@pytest.mark.parametrize("start", [0.1, 0.25, 0.75, 0.85])
def test_a_turning_point_away_from_the_peak_is_inferred(start):
    """A wheel that stops, rolls back 5 turns and comes forward again, turning at the share `start`
    of a half tooth, then at another.
    """
    time = np.arange(0, 32, 1 / RATE)
    speed = np.interp(time, [0, 6, 9, 12, 15, 18, 32], [5, 5, 0, -1.6, 0, 5, 5])
    turns = np.cumsum(speed) / RATE
    turns += (start - (2 * STEPS * turns[90_000]) % 1) / (2 * STEPS)
    found = teeth(
        np.sin(2 * np.pi * STEPS * turns)
        + 0.01 * np.random.default_rng(5).standard_normal(time.size)
    )
    back = found.index[~found.forward] / RATE
    assert back.size > 2 * STEPS * 3
    assert back.min() > 8.7
    assert back.max() < 15.5


def test_a_hole_is_told():
    _, turns = wheel()
    values = np.sin(2 * np.pi * STEPS * turns)
    values[100_000:100_400] = np.nan
    assert passages(values)[1].breaks.tolist() == [100_000]


@pytest.mark.parametrize(
    "values", [np.full(50_000, 1.3), 1.3 + 0.01 * np.random.default_rng(6).standard_normal(50_000)]
)
def test_a_signal_without_teeth_is_dead(values):
    assert probe(reader(values), values.size).form == "dead"


@pytest.mark.parametrize("share", [0.5, 0.1])
def test_a_converter_that_flickers_between_two_codes_is_dead(share):
    values = np.where(np.random.default_rng(9).random(200_000) < share, 5e-3, 0.0)
    assert probe(reader(values), values.size).form == "dead"


@pytest.mark.parametrize("half", [2.6, 3.1, 4.0, 5.5, 9.98, 400.0, 9000.0])
def test_pulses_of_any_length_are_square_and_all_found(half):
    """Pulses that last `half` samples; a piece that is probed has from 700 to none."""
    edges = np.floor((np.arange(200_000) + 0.3) / half)
    values = 5.0 * np.mod(edges, 2)
    assert probe(reader(values), values.size).form == "square"
    assert passages(values)[1].index.size == pytest.approx(edges[-1], abs=1)


@pytest.mark.parametrize(
    "count",
    [
        lambda n: -n,
        lambda n: 80_000 - n,
        lambda n: np.mod(-n, 256),
        lambda n: np.mod(-n, 65_536),
        lambda n: np.mod(n + 32_768, 65_536) - 32_768,
    ],
)
def test_counters_that_fall_or_have_a_sign_climb_with_the_wheel(count):
    _, turns = wheel(60.0, 25.0)
    values = count(np.floor(turns * STEPS)).astype(float)
    assert probe(reader(values), values.size).form == "counter"
    axis = TimeAxis.uniform(values.size, RATE)
    time, found, backward = counter_knots(
        Channel.of_array("e", "wheel_encoder", values, axis), STEPS, False
    )
    error = found - np.interp(time, axis.time(), turns)
    assert not backward.any()
    assert np.ptp(error) < 1.01 * 25.0 / RATE


def test_forms_are_told_apart():
    _, turns = wheel()
    sine = np.sin(2 * np.pi * STEPS * turns)
    assert probe(reader(sine), sine.size).form == "sine"
    assert probe(reader(np.where(sine > 0, 5.0, 0.0)), sine.size).form == "square"
    assert probe(reader(np.floor(turns * STEPS)), sine.size).form == "counter"


def test_pitch_table_is_found_on_a_changing_speed():
    random = np.random.default_rng(7)
    error = np.deg2rad(0.4) * random.uniform(-1, 1, 2 * STEPS)
    error -= error.mean()
    count = np.arange(2 * STEPS * 200)
    angle = count * np.pi / STEPS + error[count % (2 * STEPS)]
    # angle = 30 t + 0.4 t^2 solved for the time
    time = (-30 + np.sqrt(900 + 1.6 * angle)) / 0.8
    table = learn(time, count)
    np.testing.assert_allclose(table.error_rad, error, atol=np.deg2rad(2e-4))
    assert table.repeats > 0.99


def test_motions_of_the_third_order_are_no_pitch_errors():
    """A wheel whose time is a cubic of its count, within 12 turns from 6 to 12 turns a second:
    nothing of it is left in the table.
    """
    count = np.arange(2 * STEPS * 12)
    turns = count / (2 * STEPS)
    table = learn(turns / 6 - 0.006 * turns**2 + 1e-4 * turns**3, count)
    assert table.turns >= 8
    assert table.scatter_rad < np.deg2rad(1e-4)
    assert np.abs(table.error_rad).max() < np.deg2rad(1e-4)


def test_pitch_of_white_noise_is_within_its_error_of_nothing():
    random = np.random.default_rng(1008)
    count = np.arange(2 * STEPS * 200)
    time = (count * np.pi / STEPS + np.deg2rad(0.02) * random.standard_normal(count.size)) / 30
    table = learn(time, count)
    assert 0.7 < np.std(table.error_rad) / table.se_rad < 1.3
    assert table.repeats < 0.1


def test_the_angle_function_is_exact_for_a_cubic_motion_and_its_inverse():
    count = np.arange(4000)
    time = np.linspace(0, 10, count.size)
    uneven = time + 1e-4 * time**2 + 1e-6 * time**3
    builder = KnotBuilder(0.05, 1)
    for piece in np.array_split(count, 5):
        builder.add(uneven[piece], piece, np.zeros(piece.size, int), np.ones(piece.size, bool))
    one = np.ones(1, int)
    function = angle_function(builder.knots(), np.zeros(1), one, 0 * one, 0.05, 1e-4)
    at = np.linspace(0.1, 9.9, 1234)
    angle = 0.05 * (count.size - 1) / 10 * at
    np.testing.assert_allclose(function.at(at + 1e-4 * at**2 + 1e-6 * at**3), angle, atol=1e-9)
    np.testing.assert_allclose(function.time_at(function.at(at)), at, atol=1e-9)
    assert np.isnan(function.at(np.array([-1.0, 100.0]))).all()


def test_a_glitch_is_no_extreme_and_a_tooth_is():
    high = np.full(40, 1.0)
    high[10], high[20:26] = 5.0, 2.0
    clean = without_spikes(high)
    assert clean[10] == 1.0
    assert clean[20:26].tolist() == [2.0] * 6


@pytest.mark.parametrize("order", ["ascending", "any"])
def test_the_angle_is_the_spline_through_the_knots(order):
    random = np.random.default_rng(5)
    time = np.linspace(0, 10, 200) + random.uniform(-0.01, 0.01, 200)
    count = np.cumsum(random.integers(0, 5, 200)).astype(np.int32)
    rate = random.uniform(10, 60, 200).astype(np.float32)
    function = AngleFunction(time, count, 0.07, rate, np.zeros(200, np.int32), 1e-4)
    at = random.uniform(time[0], time[-1], 3000)
    at = np.sort(at) if order == "ascending" else at
    np.testing.assert_allclose(
        function.at(at), CubicHermiteSpline(time, 0.07 * count, rate.astype(float))(at), atol=1e-8
    )
    outside = function.at(np.array([time[0] - 1e-9, time[0], time[-1], time[-1] + 1e-9, np.nan]))
    assert np.isfinite(outside).tolist() == [False, True, True, False, False]


def test_the_local_cubics_weights_reproduce_cubics_and_no_more():
    place = np.arange(-MOST_REACH, MOST_REACH + 1.0)
    for value, slope in zip(VALUE[3:], SLOPE[3:], strict=True):
        for power, (true_value, true_slope) in enumerate([(1, 0), (0, 1), (0, 0), (0, 0)]):
            assert value @ place**power == pytest.approx(true_value, abs=1e-9)
            assert slope @ place**power == pytest.approx(true_slope, abs=1e-9)
    # Savitzky and Golay's numbers for seven points
    np.testing.assert_allclose(
        21 * VALUE[3, MOST_REACH - 3 : MOST_REACH + 4], [-2, 3, 6, 7, 6, 3, -2], atol=1e-9
    )
