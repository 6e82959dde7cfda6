"""Closed form: contact length of an accelerometer whose fronts are known, without an encoder."""

import numpy as np
import pytest
from scipy.special import erf

from tirelog.data.recording import Channel, Recording, TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.errors import UsageError
from tirelog.products import tables_of

R, RATE_HZ, G = 0.31, 10_000.0, 9.80665
SETUP = """[tire]
unloaded_radius_m = 0.31
rolling_radius_m = 0.31
[channels.a]
kind = "radial_acceleration"
source = "a"
"""
#: angles of the fronts [rad], and how far each is smeared
ENTRY, EXIT, SMEARED = np.radians(-11.0), np.radians(9.5), np.radians([1.2, 0.8])


def log_of(*, seconds=6.0, speed=18.0, gains=0.0, sign=1.0, coupled=False, noise=2.0, lost=()):
    """A sensor that reads -Omega^2 R, nothing in the patch, and gravity."""
    time = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    omega = (speed + gains * time) / R
    turned = (speed * time + 0.5 * gains * time**2) / R + 2.0
    phi = np.mod(turned + np.pi, 2 * np.pi) - np.pi
    inside = 0.5 * (erf((phi - ENTRY) / SMEARED[0]) - erf((phi - EXIT) / SMEARED[1]))
    values = -(omega**2) * R * (1.0 - inside) + G * np.cos(phi)
    if coupled:
        values = values - values.mean()
    values = sign * values + np.random.default_rng(5).normal(0.0, noise, time.size)
    values[list(lost)] = np.nan
    return values


def table(values, kind="radial_acceleration"):
    channel = Channel.of_array("a", kind, values, TimeAxis.uniform(values.size, RATE_HZ))
    recording = Recording("log", {"a": channel}, parse_setup(SETUP))
    (part,) = tables_of(recording, {"footprint": {}})
    return part.columns, np.array(part.columns["quality"]), part.remarks


@pytest.mark.parametrize(
    "given",
    [{}, {"sign": -1.0}, {"coupled": True}, {"gains": 1.5, "speed": 12.0}],
    ids=["as it is", "turned round", "AC-coupled", "speeding up"],
)
def test_the_length_is_the_way_between_the_fronts(given):
    columns, words, remarks = table(log_of(**given))
    good = words == "ok"
    assert good.sum() >= good.size - 3
    true = R * (EXIT - ENTRY)
    length = columns["length_m"][good]
    assert np.median(length) == pytest.approx(true, rel=4e-3)
    assert np.abs(length - true).max() < 0.02 * true
    told = columns["exit_time_s"] - columns["entry_time_s"]
    np.testing.assert_allclose((told * columns["speed_m_s"])[good], length, rtol=2e-3)
    assert np.median(columns["edge_asymmetry"][good]) > 0.05  # the exit is the sharper one
    assert np.isnan(columns["length_d2_m"]).all()
    assert "half of the step" in " ".join(remarks)


def test_the_errors_cover_the_noise():
    """They hold what a cubic misses of a flank besides, so they are somewhat larger."""
    columns, words, _ = table(log_of(noise=16.0, seconds=12.0))
    length, se = columns["length_m"][words == "ok"], columns["length_se_m"][words == "ok"]
    assert 1.0 < np.sqrt(np.mean(se**2)) / np.std(length) < 2.0


def test_what_is_lost_in_a_passage_costs_that_passage_alone():
    whole, _, _ = table(log_of())
    middle = int((whole["entry_time_s"][20]) * RATE_HZ)
    columns, marks, _ = table(log_of(lost=range(middle - 20, middle + 20)))
    assert np.isnan(columns["length_m"][20])
    assert marks[20] != "ok"
    assert (marks[10:15] == "ok").all()


def test_a_log_of_neither_strain_nor_acceleration_says_what_it_lacks():
    with pytest.raises(UsageError, match="no strain channel"):
        table(log_of(), kind="signal")
