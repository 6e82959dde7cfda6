"""Closed form: tooth passages and counted teeth of a sine whose phase is known."""

import numpy as np
import pytest

from tirelog.data.recording import Channel, TimeAxis
from tirelog.dsp.teeth import count_teeth, crossings, probe, teeth_of_counter

RATE, STEPS = 10_000.0, 48


def channel(values):
    axis = TimeAxis.uniform(values.size, RATE)
    return Channel.of_array("e", "wheel_encoder", values.astype(float), axis)


def passages(values):
    signal = channel(values)
    return np.concatenate(list(crossings(signal, probe(signal))))


def teeth(values):
    signal = channel(values)
    return np.concatenate(list(count_teeth(signal, probe(signal), STEPS)))


def wheel(seconds=20.0, turns_s=5.0, sweep=0.0):
    """(time, angle [turns]) of a wheel whose speed changes by `sweep` turns/s^2."""
    time = np.arange(0, seconds, 1 / RATE)
    return time, turns_s * time + 0.5 * sweep * time**2


def sine(turns, noise=0.0, seed=1):
    """A tooth's sine of a wheel, with noise."""
    white = np.random.default_rng(seed).standard_normal(turns.size)
    return np.sin(2 * np.pi * STEPS * turns) + noise * white


def half_teeth(found, turns):
    """The true half teeth that had passed at each tooth found."""
    return 2 * STEPS * np.interp(found["index"], np.arange(turns.size), turns)


def test_no_tooth_is_lost_at_a_tenth_of_noise():
    _, turns = wheel(60.0, 2.0, 0.15)
    found = teeth(sine(turns, 0.1, 1002))
    off = half_teeth(found, turns) - found["count"]
    assert np.ptp(np.rint(off)) == 0
    assert np.abs(off - np.rint(off)).max() < 0.25


@pytest.mark.parametrize("kind", ["glitch", "flat", "doubled"])
def test_repairs_keep_the_count(kind):
    random = np.random.default_rng(3)
    _, turns = wheel()
    values = sine(turns)
    if kind == "doubled":
        tooth = np.floor(STEPS * turns) % STEPS
        values = np.where(tooth == 7, np.sin(4 * np.pi * STEPS * turns), values)
    count, level = {"glitch": (4, -1.6), "flat": (60, 0.0), "doubled": (0, 0.0)}[kind]
    for start in random.integers(2000, values.size - 2000, 25):
        values[start : start + count] = level
    found = teeth(values + 0.02 * random.standard_normal(values.size))
    off = half_teeth(found, turns) - found["count"]
    off -= np.median(off)
    assert np.mean(np.abs(off) < 0.2) > 0.97
    assert abs(off[-1]) < 0.2
    assert found["extra"].sum() + (kind != "doubled") * found["missing"].sum() > 0


@pytest.mark.parametrize("start", [0.1, 0.25, 0.75, 0.85])
def test_a_turning_point_away_from_the_peak_is_inferred(start):
    """A wheel stops, rolls back 5 turns and comes forward again."""
    time = np.arange(0, 32, 1 / RATE)
    turns = np.cumsum(np.interp(time, [0, 6, 9, 12, 15, 18, 32], [5, 5, 0, -1.6, 0, 5, 5])) / RATE
    turns += (start - (2 * STEPS * turns[90_000]) % 1) / (2 * STEPS)
    found = teeth(sine(turns, 0.01, 5))
    back = found["time_s"][~found["forward"]]
    assert back.size > 2 * STEPS * 3
    assert back.min() > 8.7
    assert back.max() < 15.5


@pytest.mark.parametrize(
    ("form", "signal"),
    [
        ("dead", lambda turns, random: np.full(turns.size, 1.3)),
        ("dead", lambda turns, random: 1.3 + 0.01 * random.standard_normal(turns.size)),
        # a converter that flickers between two codes
        ("dead", lambda turns, random: np.where(random.random(turns.size) < 0.5, 5e-3, 0.0)),
        ("dead", lambda turns, random: np.where(random.random(turns.size) < 0.1, 5e-3, 0.0)),
        ("sine", lambda turns, random: sine(turns)),
        ("square", lambda turns, random: np.where(sine(turns) > 0, 5.0, 0.0)),
        ("counter", lambda turns, random: np.floor(turns * STEPS)),
    ],
)
def test_forms_are_told_apart(form, signal):
    found = probe(channel(signal(wheel()[1], np.random.default_rng(9))))
    assert found.form == form


@pytest.mark.parametrize("half", [2.6, 3.1, 4.0, 5.5, 9.98, 400.0, 9000.0])
def test_pulses_of_any_length_are_square_and_all_found(half):
    """Pulses that last `half` samples; a piece that is probed has from 700 to none."""
    edges = np.floor((np.arange(200_000) + 0.3) / half)
    values = 5.0 * np.mod(edges, 2)
    assert probe(channel(values)).form == "square"
    assert passages(values).size == pytest.approx(edges[-1], abs=1)


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
    time, turns = wheel(60.0, 25.0)
    signal = channel(count(np.floor(turns * STEPS)))
    assert probe(signal).form == "counter"
    found, turn = teeth_of_counter(signal, STEPS)
    error = found["count"] / turn - np.interp(found["time_s"], time, turns)
    assert found["forward"].all()
    assert np.ptp(error) < 1.01 * 25.0 / RATE
