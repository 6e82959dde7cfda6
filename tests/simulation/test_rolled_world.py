"""Property: a log whose tire moved says what its truth says."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from tests.simulation.worlds import instants
from tests.simulation.worlds import world as steady_world
from tirelog.simulation import scenario_of, simulate
from tirelog.simulation.rolling.world import RolledWorld
from tirelog.simulation.scenario.schema import Sensor

pytestmark = pytest.mark.xdist_group("rolled world")  # one worker makes what these tests share

CHANNELS = {
    "inner": {"kind": "strain", "angle_deg": 70.0, "surface": "inner"},
    "outer": {"kind": "fbg_strain", "angle_deg": 70.0},
    "acc": {"kind": "radial_acceleration", "angle_deg": 200.0},
    "late": {"kind": "radial_acceleration", "angle_deg": 200.0, "delay_s": 0.004},
    "encoder": {"kind": "wheel_encoder", "signal": "counter", "steps": 720},
    "load": {"kind": "vertical_load"},
    "along": {"kind": "longitudinal_force"},
    "speed": {"kind": "vehicle_speed"},
}
#: coarse, so that a test takes a second
COARSE = {"truth": "coupled_ring", "grid_points": 768, "step_s": 5e-5}
DAMPED = {"radial_damping_N_s_m2": 300.0, "tangential_damping_N_s_m2": 300.0}


def scenario(seconds=1.0, speed=15.0, file="scenario", **more):
    base: dict[str, Any] = {
        **COARSE,
        "tire": DAMPED,
        "vehicle": {"suspension_damping_N_s_m": 2000.0},
        "conditions": {"driven": False},
        "manoeuvres": [{"duration_s": seconds, "speed_m_s": speed}],
        "channels": CHANNELS,
    }
    return scenario_of({**base, **more}, file)


@cache
def cleats():
    """Three cleats within 1.2 s at 15 m/s."""
    road = {
        "kind": "cleat",
        "position_m": 6.0,
        "spacing_m": 5.0,
        "height_m": 0.006,
        "length_m": 0.04,
        "ramp_m": 0.01,
    }
    return simulate(scenario(1.2, road=road))


def world(made):
    assert isinstance(made.world, RolledWorld)
    return made.world


def test_strain_has_its_extremes_where_the_truth_has_its_passages():
    made = cleats()
    passages = made.truth["channels"]["inner"]["passages"]["time_s"]
    assert len(passages) >= 8
    for channel in ("inner", "outer", "acc", "late"):
        told = made.truth["channels"][channel]["passages"]
        assert {len(v) for v in told.values()} == {len(told["time_s"])}
        assert np.allclose(np.diff(told["wheel_angle_rad"]), 2 * np.pi, atol=2e-3)
    time = made.stamp_s["inner"]
    for name, sign in (("inner", 1.0), ("outer", -1.0)):
        signal = sign * made.channels[name]
        for passage in passages[1:-1]:
            near = np.abs(time - passage) < 0.02
            assert time[near][np.argmax(signal[near])] == pytest.approx(passage, abs=1.2e-3)
    acc, delayed = made.channels["acc"], made.channels["late"]
    assert np.abs(delayed[10:] - acc[:-10]).max() < 1e-9 * np.abs(acc).max()  # ten samples
    late = np.array(made.truth["channels"]["late"]["passages"]["time_s"])
    assert late == pytest.approx(
        np.array(made.truth["channels"]["acc"]["passages"]["time_s"][: late.size]) + 0.004
    )


def test_cleats_are_met_when_the_way_says():
    made = cleats()
    met = made.truth["coupled_ring"]["obstacles"]
    assert [each["position_m"] for each in met] == [6.0, 11.0, 16.0]
    motion, half = world(made).motion, 0.5 * made.truth["coupled_ring"]["contact_length_m"]
    for each in met[:2]:
        assert each["under_axle_s"] == pytest.approx(each["position_m"] / 15.0, abs=1e-6)
        over = np.abs(world(made).time_s - each["under_axle_s"]) < half / 15.0
        assert motion.force_z_N[over].max() > 1.2 * 3434.0


def test_the_load_has_each_cleat():
    made = cleats()
    time, load = made.stamp_s["load"], made.channels["load"]
    hit = made.truth["coupled_ring"]["obstacles"][0]["under_axle_s"]
    assert np.ptp(load[(time > hit - 0.01) & (time < hit + 0.03)]) > 1000.0
    assert np.std(load[time < hit - 0.02]) < 15.0
    assert np.std(load[(time > hit + 0.2) & (time < hit + 0.3)]) < 60.0  # it rings away
    assert load[time < 0.35].mean() == pytest.approx(3434.0, rel=2e-3)
    carried = made.truth["coupled_ring"]
    assert carried["load_carried_N"] == pytest.approx(carried["load_applied_N"], rel=5e-3)


def test_counter_counts_the_wheels_angle():
    made = cleats()
    time, count = made.stamp_s["encoder"], made.channels["encoder"]
    angle = np.array([world(made).drive.angle_at(np.array([t]))[0] for t in time[::100]])
    assert np.abs(count[::100] - 720 * angle / (2 * np.pi)).max() < 1.01
    radius = made.truth["coupled_ring"]["effective_rolling_radius_m"]
    assert radius == pytest.approx(0.305, rel=6e-3)


def test_accelerometer_feels_the_turning_belt():
    """As the steady ring of the other truth has it; nothing but gravity in the patch."""
    made = simulate(scenario(0.3, grid_points=1536, channels={"acc": CHANNELS["acc"]}))
    time, felt = made.stamp_s["acc"], made.channels["acc"]
    motion = world(made).motion
    phi = np.interp(time, world(made).time_s, motion.angle_rad) - np.radians(200.0)
    steady = steady_world(truth="ring", tire=DAMPED, grid_points=4096)
    spin = motion.spin_rad_s[world(made).time_s < 0.3].mean()
    wave = steady.waveform(
        steady.solve(instants(speed=spin * 0.305)), Sensor("radial_acceleration")
    )[0]
    exact = np.interp(
        (phi + np.pi) % (2 * np.pi) - np.pi, steady.ring.xi_m / 0.305, wave
    ) / 9.80665 - np.cos(phi)
    assert np.std(felt - exact) < 0.02 * np.std(exact)
    assert np.abs((felt + 1.0)[np.cos(phi) > np.cos(0.05)]).max() < 0.08 * np.abs(exact).max()


def driven(*manoeuvres):
    """A wheel that is driven, on a grippier tread than the papers', so that slip stays small."""
    tire = {**DAMPED, "bristle_stiffness_N_m2": 2e7, "friction": 1.0}
    more = {"manoeuvres": list(manoeuvres), "conditions": {"driven": True}, "rounding_s": 0.2}
    return simulate(scenario(tire=tire, **more))


def test_speed_ramp_is_driven_by_its_torque():
    made = driven(
        {"duration_s": 0.5, "speed_m_s": 12.0},
        {"duration_s": 1.0, "speed_m_s": 14.0, "regime": "drive"},
    )
    motion = world(made).motion
    speed = np.interp(0.9, world(made).time_s, motion.spin_rad_s) * 0.305
    # bristles creep: force over 2 C_x L^2, some 2 %
    assert 1.005 < speed / float(world(made).drive.speed_at(np.array(0.9))) < 1.03
    steady = (world(made).time_s > 0.8) & (world(made).time_s < 1.2)
    # half of what the vehicle needs: mass and drag
    needs = 0.5 * (1500.0 * 2.0 + 0.012 * 1500.0 * 9.80665 + 0.4 * 13.0**2)
    assert motion.force_x_N[steady].mean() == pytest.approx(needs, rel=0.02)
    time, along = made.stamp_s["along"], made.channels["along"]
    assert along[(time > 0.8) & (time < 1.2)].mean() == pytest.approx(needs, rel=0.03)
    # drive winds the hub ahead of the belt
    shift = made.truth["channels"]["inner"]["passages"]["phase_shift_deg"]
    assert shift[-3] > shift[1] + 0.1


def test_sensor_lag_and_gauge_length():
    plain = simulate(scenario(0.4, channels={"s": CHANNELS["inner"]})).channels["s"]
    gauge = {**CHANNELS["inner"], "gauge_length_m": 0.05}
    averaged = simulate(scenario(0.4, channels={"s": gauge})).channels["s"]
    assert np.ptp(averaged) < 0.96 * np.ptp(plain)
    lagged = simulate(scenario(0.4, channels={"s": {**CHANNELS["inner"], "lag_s": 2e-3}})).channels[
        "s"
    ]
    again = lagged + 2e-3 * np.gradient(lagged, 4e-4)
    assert np.std((again - plain)[5:-5]) < 0.05 * np.std(plain)
    assert np.ptp(lagged) < 0.9 * np.ptp(plain)


@pytest.mark.parametrize(
    "road",
    [
        {"kind": "step", "position_m": 3.0, "height_m": 0.004, "ramp_m": 0.05},
        {"kind": "sine", "amplitude_m": 0.002, "wavelength_m": 3.0},
        {"kind": "profile", "file": "road.txt"},
    ],
)
def test_other_roads(road, tmp_path):
    points = "# distance, height\n0 0\n3.0, 0.0\n3.2 0.004\n9 0.004\n"
    (tmp_path / "road.txt").write_text(points, encoding="utf-8")
    damped = {"suspension_damping_N_s_m": 4000.0}
    drive = {"road": road, "vehicle": damped, "channels": {"s": {"kind": "strain"}}}
    made = simulate(scenario(0.6, 10.0, file=str(tmp_path / "s.toml"), **drive))
    begin, end = np.interp([0.05, 0.58], world(made).time_s, world(made).motion.hub_z_m)
    sine = 0.002 * (1 - np.cos(2 * np.pi * 5.8 / 3.0))
    assert end - begin == pytest.approx(sine if road["kind"] == "sine" else 0.004, abs=4e-4)


def test_load_follows_planted_effects():
    """`aero_load` F (1 + a (v/30)^2): carried by the road, seen by the hub."""
    channels = {"load": CHANNELS["load"]}
    made = simulate(
        scenario(0.4, 24.0, channels=channels, effects=[{"name": "aero_load", "coefficient": 0.25}])
    )
    expected = 3434.0 * (1.0 + 0.25 * (24.0 / 30.0) ** 2)
    assert made.channels["load"].mean() == pytest.approx(expected, rel=2e-3)
    assert made.truth["coupled_ring"]["load_carried_N"] == pytest.approx(expected, rel=2e-3)
    assert [effect["name"] for effect in made.truth["effects"]] == ["aero_load"]


def test_standing_start_and_stop():
    """The wheel stands, is driven off, brakes and stands again, wound up a little."""
    made = driven(
        {"duration_s": 0.3, "speed_m_s": 0.0, "regime": "standstill"},
        {"duration_s": 1.0, "speed_m_s": 2.0, "regime": "drive"},
        {"duration_s": 1.0, "speed_m_s": 0.0, "regime": "brake"},
        {"duration_s": 0.4, "speed_m_s": 0.0},
    )
    motion = world(made).motion
    turned = np.interp([0.0, 0.1, 2.6], world(made).time_s, motion.angle_rad) * 0.305
    assert turned[0] == pytest.approx(turned[1], abs=1e-4)
    assert turned[2] - turned[0] == pytest.approx(
        float(world(made).distance(np.array([2.6]))[0]), rel=0.02
    )
    assert np.abs(motion.spin_rad_s[(world(made).time_s > 2.6)]).max() < 0.1


def test_an_undamped_tire_begins_quietly():
    """The log begins after a settling in which belt and hub are damped."""
    motion = world(
        simulate(
            scenario(0.3, tire={}, vehicle={}, grid_points=1536, channels={"s": CHANNELS["inner"]})
        )
    ).motion
    assert motion.force_z_N.std() < 1.5e-3 * 3434.0
    assert motion.force_z_N.mean() == pytest.approx(3434.0, rel=1e-3)
