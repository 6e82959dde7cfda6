"""Closed form: slip by P2 (14) of a wheel whose angle and whose vehicle's speed are known."""

import numpy as np
import pytest

import tirelog
from tirelog.data.recording import Channel, Recording, TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.errors import UsageError
from tirelog.inference.stacks.conditions import conditions_of

R, TEETH = 0.31, 48
SETUP = """[tire]
unloaded_radius_m = 0.32
{radius}
[channels.e]
kind = "wheel_encoder"
source = "e"
steps = 48
[channels.v]
kind = "vehicle_speed"
source = "v"
"""
#: acceleration [m/s^2] and slip in stretches of eight seconds
STRETCHES = ((0.0, 0.0), (1.5, -0.02), (0.0, 0.0), (-1.4, 0.03), (0.0, 0.0))


def drive(
    *,
    stretches=STRETCHES,
    noise=0.0,
    radius="",
    kinds=("wheel_encoder", "vehicle_speed"),
    growth=0.0,
):
    """A wheel that slips while its vehicle speeds up and brakes; its slip at a time [s].

    `growth`: how much longer the belt is at 25 m/s.
    """
    rate = 4000.0
    time = np.arange(int(8.0 * len(stretches) * rate)) / rate
    part = np.minimum((time / 8.0).astype(int), len(stretches) - 1)
    acceleration, slip = np.array(stretches).T
    speed = 15.0 + np.cumsum(acceleration[part]) / rate
    turned = (
        np.cumsum(speed * (1.0 - slip[part]) / (R * (1.0 + growth * (speed / 25.0) ** 2))) / rate
    )
    rng = np.random.default_rng(3)
    slow = slice(None, None, 40)
    channels = {
        "e": Channel.of_array(
            "e",
            kinds[0],
            np.sin(TEETH * turned),
            TimeAxis.uniform(time.size, rate),
            settings={"steps": TEETH},
        ),
        "v": Channel.of_array(
            "v",
            kinds[1],
            speed[slow] + rng.normal(0.0, noise, speed[slow].size),
            TimeAxis.uniform(speed[slow].size, rate / 40),
        ),
    }
    setup = parse_setup(SETUP.format(radius=radius))
    return Recording("log", channels, setup), lambda t: slip[np.minimum((t / 8.0).astype(int), 4)]


def test_slip_is_that_of_the_wheel_and_positive_in_braking():
    recording, true = drive()
    table = tirelog.slip(recording)
    # a turn over the border of two stretches has some of both
    whole = table[np.abs((table.time_s + 4.0) % 8.0 - 4.0) > 0.3]
    assert len(whole) > 150
    np.testing.assert_allclose(whole.slip, true(whole.time_s.to_numpy()), atol=3e-4)
    assert whole.slip[whole.time_s.between(25, 31)].median() == pytest.approx(0.03, abs=1e-4)
    assert whole.slip[whole.time_s.between(9, 15)].median() == pytest.approx(-0.02, abs=1e-4)
    np.testing.assert_allclose(
        whole.vehicle_speed_m_s * (1.0 - whole.slip), whole.speed_m_s, rtol=4e-3
    )


def test_a_belt_that_grows_with_the_speed_is_no_slip():
    """R by the speed squared: one radius for all speeds would be off by 0.4 % at either end."""
    recording, true = drive(growth=0.01, noise=0.02)
    table = tirelog.slip(recording)
    whole = table[np.abs((table.time_s + 4.0) % 8.0 - 4.0) > 0.3]
    error = whole.slip - true(whole.time_s.to_numpy())
    assert np.ptp(whole.speed_m_s) > 10.0
    assert abs(error[whole.time_s < 8].mean()) < 3e-4
    assert abs(error[whole.time_s.between(16, 24)].mean()) < 3e-4
    assert abs(error[whole.time_s.between(24, 32)].mean()) < 5e-4


def test_revolutions_know_the_slip_that_encoder_and_vehicle_tell():
    recording, true = drive(noise=0.02)
    time_s = np.array([4.0, 12.0, 20.0, 28.0, 36.0])
    found = conditions_of(recording, time_s, np.full(5, 15.0), np.zeros(5)).slip
    np.testing.assert_allclose(found, true(time_s), atol=2e-3)


@pytest.mark.parametrize(
    "given",
    [
        {"kinds": ("wheel_encoder", "signal")},
        {"kinds": ("signal", "vehicle_speed")},
        {"stretches": ((0.0, 0.0),) * 5, "noise": 0.1},
    ],
)
def test_revolutions_know_no_slip_that_the_log_does_not_tell(given):
    """No vehicle speed, no encoder, or a wheel that rolls freely: its slip is noise."""
    recording, _ = drive(**given)
    found = conditions_of(recording, np.array([4.0, 20.0]), np.full(2, 15.0), np.zeros(2)).slip
    assert np.isnan(found).all()


def test_its_error_is_that_of_the_speed():
    recording, _ = drive(noise=0.2)
    table = tirelog.slip(recording)
    rolls = table[table.time_s.between(1, 7) & (table.quality == "ok")]
    assert np.sqrt(np.mean(rolls.slip_se**2)) == pytest.approx(rolls.slip.std(), rel=0.35)


def test_without_free_rolling_the_setup_has_to_say_the_radius():
    pulling = ((1.0, -0.02), (1.0, -0.02))
    with pytest.raises(UsageError, match="no rolling radius"):
        tirelog.slip(drive(stretches=pulling)[0])
    given = tirelog.slip(drive(stretches=pulling, radius="rolling_radius_m = 0.31")[0])
    assert given.slip.median() == pytest.approx(-0.02, abs=2e-4)


def test_a_log_without_the_vehicles_speed_is_refused():
    with pytest.raises(UsageError, match="no vehicle speed"):
        tirelog.slip(drive(kinds=("wheel_encoder", "signal"))[0])
