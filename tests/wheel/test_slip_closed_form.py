"""Closed form: slip by P2 (14) of a wheel whose angle and whose vehicle's speed are known."""

import numpy as np
import pytest

import tirelog
from tirelog.data.recording import Channel, Recording, TimeAxis
from tirelog.data.setup import parse_setup
from tirelog.errors import UsageError
from tirelog.inference.stacks.manoeuvres import conditions_of

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


KINDS = ("wheel_encoder", "vehicle_speed")


def drive(
    *, stretches=STRETCHES, noise=0.0, radius="", kinds=KINDS, growth=0.0, late_s=0.0, hold=1,
    step_m_s=0.0,
):  # fmt: skip
    """A wheel that slips while its vehicle speeds up and brakes; its slip at a time [s]."""
    rate = 4000.0
    time = np.arange(int(8.0 * len(stretches) * rate)) / rate
    part = np.minimum((time / 8.0).astype(int), len(stretches) - 1)
    acceleration, slip = np.array(stretches).T
    speed = 15.0 + np.cumsum(acceleration[part]) / rate
    radius_m = R * (1.0 + growth * (speed / 25.0) ** 2)
    turned = np.cumsum(speed * (1.0 - slip[part]) / radius_m) / rate
    rng = np.random.default_rng(3)
    slow = slice(None, None, 40)
    told = np.interp(time[slow] - late_s, time, speed) + rng.normal(0.0, noise, time[slow].size)
    told = np.repeat(told[::hold], hold)[: told.size]
    told = np.round(told / step_m_s) * step_m_s if step_m_s else told
    axes = TimeAxis.uniform(time.size, rate), TimeAxis.uniform(told.size, rate / 40)
    teeth = np.sin(TEETH * turned)
    channels = {
        "e": Channel.of_array("e", kinds[0], teeth, axes[0], settings={"steps": TEETH}),
        "v": Channel.of_array("v", kinds[1], told, axes[1]),
    }
    setup = parse_setup(SETUP.format(radius=radius))
    return Recording("log", channels, setup), lambda t: slip[np.minimum((t / 8.0).astype(int), 4)]


def off_borders(table):
    """The rows of turns that are in one stretch alone."""
    return table[np.abs((table.time_s + 4.0) % 8.0 - 4.0) > 0.3]


def test_slip_is_that_of_the_wheel_and_positive_in_braking():
    recording, true = drive()
    whole = off_borders(tirelog.slip(recording))
    assert len(whole) > 150
    np.testing.assert_allclose(whole.slip, true(whole.time_s.to_numpy()), atol=3e-4)
    for begin_s, slip in ((25, 0.03), (9, -0.02)):
        own = whole.slip[whole.time_s.between(begin_s, begin_s + 6)]
        assert own.median() == pytest.approx(slip, abs=1e-4)
    rolled = whole.vehicle_speed_m_s * (1.0 - whole.slip)
    np.testing.assert_allclose(rolled, whole.speed_m_s, rtol=4e-3)


def test_a_belt_that_grows_with_the_speed_is_no_slip():
    """R by the speed squared: one radius for all speeds would be off by 0.4 % at either end."""
    recording, true = drive(growth=0.01, noise=0.02)
    whole = off_borders(tirelog.slip(recording))
    error = whole.slip - true(whole.time_s.to_numpy())
    assert np.ptp(whole.speed_m_s) > 10.0
    for begin_s, most in ((0, 3e-4), (16, 3e-4), (24, 5e-4)):
        assert abs(error[whole.time_s.between(begin_s, begin_s + 8)].mean()) < most


def pulls(table, true):
    """Errors of the slip over their standard errors, of rows with nothing wrong off the borders."""
    whole = off_borders(table[table.quality == "ok"])
    error = whole.slip - true(whole.time_s.to_numpy())
    return whole, (error / np.hypot(whole.slip_se, whole.slip_delay_se)).to_numpy()


@pytest.mark.parametrize("slips", [0.0, 1.0])
@pytest.mark.parametrize(
    "reading",
    [
        {"late_s": 0.1},
        {"late_s": 0.5, "noise": 0.05},
        {"late_s": 0.2, "hold": 10},
        {"late_s": 0.2, "hold": 10, "step_m_s": 0.1 / 3.6},
        {"step_m_s": 0.1 / 3.6},
    ],
)
def test_a_speed_that_comes_late_is_no_slip_and_hides_none(slips, reading):
    """A delay of 0.5 s at 1.5 m/s^2 and 15 m/s looks like a slip of 0.05."""
    stretches = tuple((a, slips * slip) for a, slip in STRETCHES)
    recording, true = drive(stretches=stretches, **reading)
    table = tirelog.slip(recording)
    whole, off = pulls(table, true)
    assert len(whole) > 0.85 * len(table)
    assert np.abs(off).max() < 5.0
    assert np.sqrt(np.mean(off**2)) < 1.5
    drives = whole[whole.time_s.between(9, 15)]
    assert drives.slip.median() == pytest.approx(-0.02 * slips, abs=2.5e-3)


def test_a_delay_that_the_speeds_do_not_tell_from_slip_is_said():
    """Between 15 and 15.8 m/s a / v is as good as a: either may be the delay's or the slip's."""
    gentle = ((0.0, 0.0), (0.25, -0.01), (0.0, 0.0), (-0.25, 0.01), (0.0, 0.0))
    recording, true = drive(stretches=gentle, late_s=0.3, noise=0.05)
    table = tirelog.slip(recording)
    pulling = table[table.time_s.between(9, 15) | table.time_s.between(25, 31)]
    assert (pulling.slip_delay_se > 0.003).all()
    assert np.abs(pulls(table, true)[1]).max() < 5.0
    short = ((0.0, 0.0), (0.4, -0.01), (0.0, 0.0))
    table = tirelog.slip(drive(stretches=short, noise=0.3, late_s=0.3)[0])
    assert table.quality[table.time_s.between(9, 15)].eq("delay_unknown").mean() > 0.5
    assert table.quality[table.time_s.between(1, 7)].eq("ok").mean() > 0.9


def test_speed_and_slip_go_by_one_radius():
    """An accelerating turn counts for neither. (A row's speed is that of its middle: 1e-4.)"""
    recording, _ = drive(stretches=STRETCHES[:3], late_s=0.3, hold=10, step_m_s=0.1 / 3.6)
    speed, slip = tirelog.speed(recording, calibrate_radius=True), tirelog.slip(recording)
    cruise = slip.time_s.between(1, 7) | slip.time_s.between(17, 23)
    ratio = speed.speed_m_s / (slip.vehicle_speed_m_s * (1.0 - slip.slip))
    assert ratio[cruise].median() == pytest.approx(1.0, abs=1e-4)
    turned = 2 * np.pi / speed.period_s * R
    error = (speed.speed_m_s.to_numpy() / turned - 1.0)[cruise]
    assert np.abs(np.median(error)) < 3.0 * np.median(speed.speed_se_m_s / speed.speed_m_s)


@pytest.mark.parametrize(
    ("given", "known"),
    [
        ({"noise": 0.02}, True),
        # no vehicle speed, no encoder, or a wheel that rolls freely: its slip is noise
        ({"kinds": ("wheel_encoder", "signal")}, False),
        ({"kinds": ("signal", "vehicle_speed")}, False),
        ({"stretches": ((0.0, 0.0),) * 5, "noise": 0.1}, False),
    ],
)
def test_revolutions_know_the_slip_that_the_log_tells(given, known):
    recording, true = drive(**given)
    time_s = np.array([4.0, 12.0, 20.0, 28.0, 36.0])
    found = conditions_of(recording, time_s, np.full(5, 15.0), np.zeros(5)).slip
    np.testing.assert_allclose(found, true(time_s) if known else np.full(5, np.nan), atol=2e-3)


def test_its_error_is_that_of_the_speed():
    recording, _ = drive(noise=0.2)
    table = tirelog.slip(recording)
    rolls = table[table.time_s.between(1, 7) & (table.quality == "ok")]
    assert np.sqrt(np.mean(rolls.slip_se**2)) == pytest.approx(rolls.slip.std(), rel=0.35)


PULLS = ((1.0, -0.02), (1.0, -0.02))


def test_a_wheel_of_an_unknown_radius_tells_no_slip():
    with pytest.raises(UsageError, match="no rolling radius"):
        tirelog.slip(drive(stretches=PULLS)[0])


def test_without_free_rolling_the_setups_radius_counts():
    given = tirelog.slip(drive(stretches=PULLS, radius="rolling_radius_m = 0.31")[0])
    assert given.slip.median() == pytest.approx(-0.02, abs=2e-4)
