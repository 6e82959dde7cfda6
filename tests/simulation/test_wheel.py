"""Closed form: signs and sizes of encoder, accelerometer and wheel forces, by P4 and the errata."""

import numpy as np
import pytest

from tests.simulation.worlds import scenario, tables, world
from tirelog.simulation import scenario_of, simulate
from tirelog.simulation.sensors.sampling import phase_shift, tread_angle

R = 0.305
#: cruise, drive, cruise, brake, coast
PLAN = [
    {"duration_s": 3.0, "speed_m_s": 10.0},
    {"duration_s": 4.0, "speed_m_s": 22.0},
    {"duration_s": 3.0, "speed_m_s": 22.0},
    {"duration_s": 2.0, "speed_m_s": 14.0},
    {"duration_s": 6.0, "speed_m_s": 10.0, "regime": "coast"},
]
DRIVE_S, BRAKE_S, COAST_S = np.array([5.0]), np.array([11.0]), np.array([15.0])


def plan(**more):
    return {"manoeuvres": PLAN, "tire": {"torsional_stiffness_N_m2": 1.5e5}, **more}


def test_driven_wheel_winds_forward_in_drive_and_back_in_braking():
    driven, free = (
        world(**plan(conditions={"driven": True})),
        world(**plan(conditions={"driven": False})),
    )
    assert phase_shift(driven, DRIVE_S)[0] > np.radians(0.3)
    assert phase_shift(driven, BRAKE_S)[0] < -np.radians(0.3)
    assert phase_shift(free, DRIVE_S)[0] == 0.0
    assert phase_shift(free, BRAKE_S)[0] < -np.radians(0.3)
    assert abs(driven.longitudinal_force(COAST_S)[0]) < 1e-9
    # n = 0 part of the wind-up (errata): F_x / (2 pi R^2 k_v)
    expected = driven.longitudinal_force(DRIVE_S) / (2 * np.pi * R**2 * 1.5e5)
    assert phase_shift(driven, DRIVE_S) == pytest.approx(expected, rel=1e-12)


def encoder(**more):
    return tables(
        channels={"e": {"kind": "wheel_encoder", "sampling_rate_Hz": 10000.0, **more}},
        manoeuvres=PLAN,
    )


def rising(values):
    """Fractional indices of upward zero crossings."""
    at = np.flatnonzero((values[:-1] <= 0) & (values[1:] > 0))
    return at - values[at] / (values[at + 1] - values[at])


def test_encoder_teeth_stand_where_the_pitch_table_says():
    made, other = (
        simulate(scenario_of(encoder(pitch_error_deg=0.5) | {"seed": seed})) for seed in (1, 2)
    )
    assert made.truth["pitch_error_deg"] == other.truth["pitch_error_deg"]  # of one wheel
    table = np.radians(made.truth["pitch_error_deg"]["e"])
    assert np.abs(table).max() == pytest.approx(np.radians(0.5), rel=1e-6)
    assert abs(table.mean()) < np.radians(0.2)
    crossing = rising(made.channels["e"])
    angle = made.world.drive.angle_at(crossing / 10000.0)
    count = np.arange(crossing.size) + round(float(angle[0] * 48 / (2 * np.pi)))
    expected = 2 * np.pi * count / 48 + table[count % 48]
    assert np.abs(angle - expected).max() < np.radians(0.01)


def test_encoder_amplitude_grows_with_speed_and_varies_over_the_turn():
    values = simulate(scenario_of(encoder(offset=0.2))).channels["e"] - 0.2
    slow, fast = np.abs(values[2000:20000]).max(), np.abs(values[75000:95000]).max()
    assert fast > 1.05 * slow
    spread = [
        np.abs(block).max() for block in np.array_split(values[75000 : 75000 + 871], 12)
    ]  # about one turn at 22 m/s
    assert max(spread) > 1.2 * min(spread)


@pytest.mark.parametrize("truth", ["beam", "ring"])
def test_a_driven_wheel_turns_faster_than_it_rolls_by_the_force_over_the_slip_stiffness(truth):
    """P2 (14): omega R / V = 1 + F_x / C_x, in drive above one and in braking below."""
    slow = {"sampling_rate_Hz": 100.0}
    given = encoder() | {"truth": truth, "tire": {"slip_stiffness_N": 5e4}}
    given["channels"] |= {
        "v": {"kind": "vehicle_speed", **slow},
        "f": {"kind": "longitudinal_force", **slow},
    }
    made = simulate(scenario_of(given)).channels
    teeth = rising(made["e"]) / 10000.0
    middle, spin = 0.5 * (teeth[1:] + teeth[:-1]), 2.0 * np.pi / 48 / np.diff(teeth)
    time = np.arange(made["v"].size) / 100.0
    ratio = spin * R / np.interp(middle, time, made["v"])
    expected = 1.0 + np.interp(middle, time, made["f"]) / 5e4
    inside = (middle > 0.1) & (middle < 17.9)
    assert expected.max() > 1.02
    assert expected.min() < 0.98
    # a tooth of 2 ms is read to half a microsecond by the chord between two samples
    assert ratio[inside] == pytest.approx(expected[inside], abs=3e-4)


def test_square_and_counter_say_the_same_angle():
    square = simulate(scenario_of(encoder(signal="square"))).channels["e"]
    assert set(np.unique(square)) == {0.0, 1.0}
    count = simulate(scenario_of(encoder(signal="counter"))).channels["e"]
    assert set(np.unique(np.diff(count))) == {0.0, 1.0}
    made = simulate(scenario_of(encoder()))
    assert (
        count[-1]
        == np.floor(made.world.drive.angle_at(made.stamp_s["e"][-1:]) * 48 / (2 * np.pi))[0]
    )


def accelerometer(**more):
    channels = {
        "a": {"kind": "radial_acceleration", "sampling_rate_Hz": 10000.0, "angle_deg": 40.0, **more}
    }
    return tables(channels=channels, manoeuvres=[{"duration_s": 2.0, "speed_m_s": 15.0}])


def test_accelerometer_reads_centripetal_and_gravity():
    """Outwards positive: -Omega^2 R far from the patch."""
    made = simulate(scenario_of(accelerometer()))
    angle = np.angle(
        np.exp(1j * tread_angle(made.world, made.scenario.channels["a"], made.stamp_s["a"]))
    )
    values = made.channels["a"] * 9.80665
    top, side = values[np.abs(angle) > 3.1].mean(), values[np.abs(angle - 1.9) < 0.05].mean()
    level = -(15.0**2) / R
    assert top == pytest.approx(level + 9.81, abs=0.3)
    assert side == pytest.approx(level + 9.81 * -np.cos(1.9), abs=2.0)


def test_telemetry_delay_moves_the_signal_and_its_passages():
    prompt, late = (
        simulate(scenario_of(accelerometer(**more))) for more in ({}, {"delay_s": 0.0005})
    )
    assert np.abs(late.channels["a"][2005:15005] - prompt.channels["a"][2000:15000]).max() < 1e-6
    passages = [np.array(m.truth["channels"]["a"]["passages"]["time_s"]) for m in (prompt, late)]
    assert np.abs(passages[1] - passages[0] - 0.0005).max() < 1e-8


def test_bandwidth_digits_and_range():
    sharp, soft = (
        simulate(scenario_of(accelerometer(**m))).channels["a"]
        for m in ({}, {"bandwidth_Hz": 60.0})
    )
    assert np.ptp(soft) < 0.97 * np.ptp(sharp)
    digital = simulate(scenario_of(accelerometer(range=60.0, bits=10))).channels["a"]
    step = 120.0 / 1024
    assert np.abs(digital / step - np.round(digital / step)).max() < 1e-9
    assert np.abs(digital).max() <= 60.0
    assert (np.abs(digital) == 60.0).any()


def test_vehicle_runs_ahead_of_the_tread_in_braking_slip():
    channels = {"v": {"kind": "vehicle_speed", "sampling_rate_Hz": 100.0}}
    made = simulate(
        scenario(**plan(channels=channels, effects=[{"name": "traction", "slip_per_g": 0.2}]))
    )
    tread = made.world.drive.speed_at(made.stamp_s["v"])
    ratio = made.channels["v"] / tread
    assert ratio[1100] > 1.05
    assert ratio[500] < 0.97
    assert ratio[100] == pytest.approx(1.0, abs=1e-9)


def test_other_forms_of_what_moves_the_phase():
    """Cross-talk, trend and inflation bend in their other form; zero stays zero."""
    hard = np.array([1.5, 5.0, 11.0])
    transfer = {"name": "load_transfer", "coefficient": 0.4}
    for name, limit in (("load_crosstalk", 0.4), ("speed_trend", 0.4)):
        exact, other = (
            phase_shift(
                world(manoeuvres=PLAN, effects=[transfer, {"name": name, "form": form}]), hard
            )
            for form in ("exact", "other")
        )
        assert (
            0.01 * np.abs(exact).max() < np.abs(other - exact).max() < limit * np.abs(exact).max()
        )
    low = {"inflation_pressure_Pa": 1.6e5}
    lengths = [
        world(conditions=low, effects=[{"name": "inflation", "form": form}]).half_length(
            np.array([3434.0])
        )[0]
        for form in ("exact", "other")
    ]
    assert lengths[0] == pytest.approx(0.058 * 0.8**-0.3)
    assert lengths[1] == pytest.approx(lengths[0], rel=0.03)
    assert lengths[1] != lengths[0]
