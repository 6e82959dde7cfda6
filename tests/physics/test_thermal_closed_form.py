"""Closed form: a tire that warms up by what its model dissipates."""

from io import StringIO

import numpy as np
import pandas as pd
import pytest

from benchmarks.goldens import SAMPLES, tirelog
from tirelog.api.models import steady_drive, warm
from tirelog.data.recording import Conditions
from tirelog.physics.model.file import preset_model, save_model

DAMPED = preset_model("P2").with_effect("viscous_damping", damping_rate_1_s=150.0)
#: heat capacity [J/K] and cooling [W/K]
C, G = 15000.0, 12.0


def test_constant_losses_warm_it_up_to_power_over_cooling(tmp_path):
    save_model(DAMPED, tmp_path / "m.toml")
    asked = ("--speed", "20", "--duration", "3600", "--heat-capacity", "15000", "--cooling", "12")
    done = tirelog(tmp_path, "model", "warm", "m.toml", *asked)
    assert done.status == 0, done.err
    rows = pd.read_csv(StringIO(done.out))
    power = rows["dissipated_power_W"]
    assert np.ptp(power) < 1e-6 * power[0]  # nothing of this model follows temperature
    rise = power[0] / G * (1.0 - np.exp(-rows["time_s"] * G / C))
    np.testing.assert_allclose(rows["temperature_K"], rise, rtol=1e-6, atol=1e-9)
    assert "time constant 1250 s" in done.err


def test_losses_that_fall_with_temperature_end_where_both_balance():
    """In the end G T = P_0 exp(-b T), of a loss factor that falls with T; small, so P is linear."""
    lossy = preset_model("P2").with_effect("warm_hysteresis", loss_factor=0.01, fall_1_K=0.02)
    columns, _ = warm(lossy, steady_drive(None, 20.0 * C / G, 20.0), heat_capacity=C, cooling=G)
    end, power = columns["temperature_K"][-1], columns["dissipated_power_W"]
    assert end > 1.0
    assert G * end == pytest.approx(power[-1], rel=1e-3)
    assert power[-1] == pytest.approx(power[0] * np.exp(-0.02 * end), rel=1e-3)


def test_the_air_in_a_ring_is_a_gas_of_constant_volume():
    ring = preset_model("P3").with_effect("hysteresis", loss_factor=0.2)
    drive = steady_drive(None, 3600.0, 20.0, 1000.0)
    columns, _ = warm(ring, drive, heat_capacity=C, cooling=G)
    absolute = columns["inflation_pressure_Pa"] + 1.013e5
    rise = columns["temperature_K"]
    assert rise[-1] > 5.0
    np.testing.assert_allclose(absolute / absolute[0], 1.0 + rise / 293.0, rtol=1e-5)


def drive_of(rng, noise_K, temperature):
    """Half an hour at changing speeds, with a measured temperature whose noise hangs together."""
    time_s = np.linspace(0.0, 1800.0, 161)
    speed = 12.0 + 8.0 * np.sin(time_s / 150.0)
    wander = np.zeros(time_s.size)
    for i in range(1, time_s.size):
        wander[i] = 0.6 * wander[i - 1] + rng.normal(0.0, noise_K)
    drive = {"speed_m_s": speed, "time_s": time_s, "acceleration_m_s2": 0.0}
    return Conditions.of(time_s.size, **drive, temperature_K=temperature(drive) + wander)


@pytest.mark.slow
@pytest.mark.parametrize("start_K", [0.0, 6.0])
def test_capacity_and_cooling_are_found_within_their_errors(start_K):
    """Of 40 drives whose temperature wanders, begun cold or warm: two thirds within one error."""

    def true(drive):
        columns, _ = warm(DAMPED, Conditions.of(161, **drive), heat_capacity=C, cooling=G)
        cold = np.interp(drive["time_s"], columns["time_s"], columns["temperature_K"])
        return cold + start_K * np.expm1(-drive["time_s"] * G / C)

    rng, off = np.random.default_rng(3), []
    for _ in range(40):
        _, remarks = warm(DAMPED, drive_of(rng, 0.05, true), heat_capacity=None, cooling=None)
        values = [remark.split()[-4:-1:2] for remark in remarks[:2]]
        for (value, error), truth in zip(np.array(values, float), (C, G), strict=True):
            assert error < 0.2 * truth
            off.append((value - truth) / error)
    assert 0.5 < np.mean(np.abs(off) < 1.0) < 0.85
    assert np.mean(np.abs(off) < 2.0) > 0.85


def test_a_log_gives_its_own_speeds_and_temperature(tmp_path):
    """Forty seconds do not determine a time constant of minutes, which is refused."""
    save_model(DAMPED, tmp_path / "m.toml")
    asked = ("model", "warm", "m.toml", "--log", str(SAMPLES / "drive.csv.gz"))
    done = tirelog(tmp_path, *asked, "--heat-capacity", "9000", "--cooling", "12")
    rows = pd.read_csv(StringIO(done.out))
    assert rows["measured_temperature_K"].iloc[-1] > 5.0
    assert rows["speed_m_s"].max() == pytest.approx(17.0, abs=0.05)
    done = tirelog(tmp_path, *asked)
    assert done.status == 2
    assert "a temperature that does not determine heat_capacity and cooling" in done.err
