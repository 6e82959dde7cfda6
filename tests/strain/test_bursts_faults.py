"""Faults: bursts of bad samples, jumps and rails take no row but their own."""

from __future__ import annotations

import numpy as np
import pytest

from tirelog.data.recording import Channel, TimeAxis
from tirelog.runs.in_memory import without_spikes
from tirelog.strain.dissipation import dissipation
from tirelog.strain.footprint.footprint import footprint
from tirelog.strain.passages.find import find_passages
from tirelog.vocabulary.quality import Quality, having

RADIUS_M = 0.305
TURN_M = 2 * np.pi * RADIUS_M
RATE_HZ = 2500.0
REFERENCE_NM = 1550.0
#: nothing is told of a passage at the border of a window
BORDER = 0.03


def drive(seconds: float = 16.0) -> tuple[np.ndarray, np.ndarray]:
    """Wavelengths [nm] of a grating in the groove from 9 to 25 m/s, and its passages' times [s].

    A flat-topped pulse of 1.2 nm with shoulders, 1 pm of noise, recorded to 0.1 pm.
    """
    time = np.arange(0.0, seconds, 1 / RATE_HZ)
    distance = 0.7 + 9.0 * time + 8.0 * time**2 / seconds
    xi = (distance + 0.5 * TURN_M) % TURN_M - 0.5 * TURN_M
    pulse = 0.5 * (np.tanh((xi + 0.055) / 0.02) - np.tanh((xi - 0.055) / 0.02))
    pulse -= 0.3 * np.exp(-(((xi + 0.105) / 0.035) ** 2))
    pulse -= 0.22 * np.exp(-(((xi - 0.11) / 0.04) ** 2))
    noise = np.random.default_rng(4401).normal(0.0, 1e-3, time.size)
    turns = np.arange(1, int(distance[-1] / TURN_M) + 1)
    return np.round(REFERENCE_NM - 1.2 * pulse + noise, 4), np.interp(
        turns * TURN_M, distance, time
    )


def channel(wavelength_nm: np.ndarray) -> Channel:
    strain = (wavelength_nm - REFERENCE_NM) / REFERENCE_NM / 1.27
    return Channel.of_array("grating", "strain", strain, TimeAxis.uniform(strain.size, RATE_HZ))


@pytest.fixture(scope="module")
def clean():
    return drive()


def bad_samples(kind: str, count: int) -> np.ndarray:
    """What an instrument may write in place of `count` samples [nm]."""
    k = np.arange(count)
    sizes = np.random.default_rng(4402).uniform(1.5, 6.0, count)
    return {
        "30 nm": np.full(count, 1580.0),
        "code": np.full(count, 9999.0),
        "zero": np.zeros(count),
        "huge": np.full(count, -1e18),
        "either sign": REFERENCE_NM + 30.0 * (-1.0) ** k,
        "any": REFERENCE_NM + (-1.0) ** k * 10.0**sizes,
    }[kind]


@pytest.mark.parametrize("kind", ["30 nm", "code", "zero", "huge", "either sign", "any"])
@pytest.mark.parametrize("count", [1, 2, 3, 10, 20])
def test_a_burst_takes_no_row_but_its_own(clean, kind, count):
    wavelength, truth = clean
    before = find_passages(channel(wavelength), RADIUS_M)
    between = [int(RATE_HZ * 0.5 * (truth[k] + truth[k + 1])) for k in (20, 41)]
    inside = [int(RATE_HZ * truth[k]) for k in (30, 60)]
    hit = wavelength.copy()
    bad = np.zeros(hit.size, bool)
    for first in (0, *between, *inside, hit.size - count):
        hit[first : first + count] = bad_samples(kind, count)
        bad[first : first + count] = True
    found = find_passages(channel(hit), RADIUS_M)
    assert not found.doubt
    assert len(found) == len(before)
    reach = found.window_rad / found.omega_rad_s
    off = np.abs(np.flatnonzero(bad) / RATE_HZ - found.time_s[:, None]).min(axis=1)
    said = having(found.quality, Quality.SPIKE | Quality.LOST_PEAK)
    assert said[off < (1 - BORDER) * reach].all()
    assert not said[off > (1 + BORDER) * reach].any()
    # the template is learnt without the rows that were hit, and moves by less than it is known to
    moved = np.abs(found.time_s - before.time_s) / before.time_se_s
    assert moved[~said].max() < 1.0


def test_bursts_leave_the_other_tables_as_they_were(clean):
    """The rows that follow the burst's own differ by what the form is learnt from."""
    wavelength, truth = clean
    hit = wavelength.copy()
    first = int(RATE_HZ * truth[30]) - 1
    hit[first : first + 3] = 1700.0
    outside = int(RATE_HZ * 0.3 * (truth[50] - truth[51])) + int(RATE_HZ * truth[51])
    hit[outside : outside + 3] = 9999.0
    both = []
    for values in (wavelength, hit):
        own = without_spikes(channel(values))
        passages = find_passages(own, RADIUS_M)
        both.append(
            (
                footprint(own, passages).length_m,
                dissipation(own, passages, None, passages.quality),
            )
        )
    (length, factor), (length_hit, factor_hit) = both
    assert np.nanmax(np.abs(length_hit - length)) < 3e-4
    assert np.nanmax(np.abs(factor_hit.factor_1_m / factor.factor_1_m - 1)) < 0.02
    # the burst between two passages is in the turn of the second
    assert having(factor_hit.quality, Quality.SPIKE).nonzero()[0].tolist() == [30, 51]


def test_a_log_without_bursts_is_read_as_it_was(clean):
    own = without_spikes(channel(clean[0]))
    assert own.flags == ()
    assert np.array_equal(own.read(), channel(clean[0]).read())


@pytest.mark.parametrize("code", [9999.0, 0.0, -1e6])
@pytest.mark.parametrize("length_s", [0.012, 0.05, 0.3])
def test_a_code_is_lost_however_long(clean, code, length_s):
    values, times = clean
    hit, begins = values.copy(), np.arange(1.3, 15.0, max(1.0, 6 * length_s))
    held = np.zeros(values.size, bool)
    for begin in begins:
        held[int(begin * RATE_HZ) : int((begin + length_s) * RATE_HZ)] = True
    hit[held] = code
    assert np.array_equal(np.isnan(without_spikes(channel(hit)).read()), held)
    found, before = (find_passages(channel(x), RADIUS_M) for x in (hit, values))
    far = np.min(np.abs(times[:, None] - begins - 0.5 * length_s), axis=1) > 0.5 * length_s + 0.3
    for time in times[far]:  # within a fortieth of a sample
        i, j = (np.argmin(np.abs(some.time_s - time)) for some in (found, before))
        assert abs(found.time_s[i] - before.time_s[j]) < 1e-5


def test_limits_of_a_signal_are_no_codes(clean):
    """Clipped at a third of its height, in coarse steps, or at rest for most of the time."""
    values = clean[0]
    clipped = np.maximum(values, REFERENCE_NM - 0.4)
    coarse = REFERENCE_NM + 0.4 * np.round((values - REFERENCE_NM) / 0.4)
    resting = np.where(values < REFERENCE_NM - 0.6, REFERENCE_NM - 1.2, REFERENCE_NM)
    for some in (clipped, coarse, resting):
        assert np.array_equal(without_spikes(channel(some)).read(), channel(some).read())
    assert without_spikes(channel(coarse)).flags == without_spikes(channel(resting)).flags == ()


@pytest.mark.parametrize("share", [0.3, 0.5, 0.75])
def test_a_signal_at_the_end_of_its_range_is_marked_in_all_passages(clean, share):
    """Where all are clipped alike, so is the form that they are compared with."""
    own = without_spikes(channel(np.maximum(clean[0], REFERENCE_NM - 1.2 * share)))
    found = find_passages(own, RADIUS_M)
    inside = (found.time_s > 0.3) & (found.time_s < 15.7)
    assert inside.sum() > 100
    assert having(found.quality, Quality.CLIPPED)[inside].all()


def test_a_lonely_slow_passage_is_no_burst():
    """A wheel that is pushed past its patch once, at 3 m/s, and stands before and after."""
    time = np.arange(0.0, 20.0, 1 / RATE_HZ)
    xi = np.clip(3.0 * (time - 10.0), -0.5, 0.5)
    wavelength = REFERENCE_NM - 0.6 * (np.tanh((xi + 0.055) / 0.02) - np.tanh((xi - 0.055) / 0.02))
    wavelength += np.random.default_rng(4403).normal(0.0, 1e-3, time.size)
    assert without_spikes(channel(wavelength)).flags == ()


def jumped(wavelength: np.ndarray, kind: str) -> tuple[np.ndarray, slice]:
    """The log with a fault that lasts, and where it is good."""
    hit, n = wavelength.copy(), wavelength.size
    middle = n // 2
    good = slice(0, n)
    if kind == "step":
        hit[middle:] -= 100.0
    elif kind == "two steps":
        hit[n // 3 :] += 40.0
        hit[middle:] -= 80.0
    elif kind == "railed from half way":
        hit[middle:], good = 1700.0, slice(0, middle)
    elif kind == "stuck from half way":
        hit[middle:], good = hit[middle], slice(0, middle)
    elif kind == "zero for a second":
        hit[middle : middle + 2500], good = 0.0, slice(0, middle)
    elif kind == "rail at the beginning":
        hit[:2500], good = 1700.0, slice(2500, n)
    elif kind == "code for 50 ms":
        hit[middle : middle + 125], good = 9999.0, slice(0, middle)
    return hit, good


@pytest.mark.parametrize(
    "kind",
    [
        "step",
        "two steps",
        "railed from half way",
        "stuck from half way",
        "zero for a second",
        "rail at the beginning",
        "code for 50 ms",
    ],
)
def test_a_jump_takes_no_row_of_the_rest(clean, kind):
    wavelength, truth = clean
    hit, good = jumped(wavelength, kind)
    found = find_passages(channel(hit), RADIUS_M)
    assert not found.doubt
    inside = truth[(truth > good.start / RATE_HZ + 0.1) & (truth < good.stop / RATE_HZ - 0.1)]
    off = np.abs(found.time_s[:, None] - inside).min(axis=0)
    assert off.max() < 1e-3
