"""Property: every transient of a coupled ring is the steady ring where nothing happens."""

import numpy as np
import pytest

from tirelog.data.recording import Conditions
from tirelog.data.road import RoadProfile, road_of
from tirelog.data.setup import RoadSetup
from tirelog.physics import Model
from tirelog.physics.moving.transient import Course, Schedule, driven

SPEED, LOAD = 20.0, 3434.0
MODEL = Model.new(
    "coupled_ring", load_N=LOAD, radius_m=0.305, inflation_pressure_Pa=2.2e5, width_m=0.215
)
AT_20 = Conditions.of(1, speed_m_s=SPEED)
CLEAT = road_of(RoadSetup(kind="cleat", height_m=0.008, length_m=0.04), 0.5)


def course(road=None, duration=0.12, speed=SPEED, load=LOAD):
    schedules = (
        value if isinstance(value, Schedule) else Schedule.constant(value)
        for value in (speed, load)
    )
    return Course(*schedules, road or RoadProfile(), duration)


def steady_at(transient, model, theta, observable):
    phi = np.mod(transient.motion.psi_rad + theta + np.pi, 2.0 * np.pi) - np.pi
    return model.predict(AT_20, phi, observable=observable)[0]


@pytest.mark.parametrize("observable", ["strain", "radial_acceleration", "patch_length"])
def test_steady_rolling_is_the_ring(observable):
    phi = None if observable == "patch_length" else np.linspace(-np.pi, np.pi, 400)
    conditions = Conditions.of(3, speed_m_s=[5.0, 20.0, 30.0], load_N=[2000.0, 3000.0, 4000.0])
    damped = {"radial_damping_N_s_m2": 60.0, "tangential_damping_N_s_m2": 60.0}
    pair = [Model.new(name, observable, **damped) for name in ("ring", "coupled_ring")]
    effects = {
        "viscous_damping": {"damping_rate_1_s": 20.0},
        "pressure_offset": {"offset": 0.2},
        "gauge_length": {"length_m": 0.02},
    }
    for name, values in ({} if phi is None else effects).items():
        pair = [model.with_effect(name, **values) for model in pair]
    assert np.array_equal(*(model.predict(conditions, phi) for model in pair))


def test_a_flat_road_gives_the_steady_ring():
    """4e-5 of the waveform's range rms."""
    model = MODEL.with_effect("pressure_offset", offset=0.1)
    transient = driven(model, AT_20, course())
    read, steady = transient.sensed("strain", -1.2), steady_at(transient, model, -1.2, "strain")
    assert np.ptp(steady) > 5e-4
    assert np.std(read - steady) < 1e-4 * np.ptp(steady)
    assert np.abs(read - steady).max() < 2e-4 * np.ptp(steady)
    assert transient.remarks == (
        "pressure_offset acts on the steady waveform alone; what the road adds is computed "
        "without it",
    )
    read = transient.sensed("radial_acceleration", -1.2)
    steady = steady_at(transient, model, -1.2, "radial_acceleration")
    assert np.std(read - steady) < 2e-3 * np.ptp(steady)


def test_acceleration_is_the_motion_of_the_sensor():
    """Second differences of r = C + (R + w) e_r + v e_t, less those of steady rolling."""
    transient = driven(MODEL, AT_20, course(CLEAT), step_s=5e-5)
    m, n, R, theta = transient.motion, transient.tire.n, 0.305, -1.0
    phi = m.psi_rad + theta
    e_r, e_t = np.sin(phi) - 1j * np.cos(phi), np.cos(phi) + 1j * np.sin(phi)
    turn = np.exp(1j * np.outer(phi, n))
    v = 2.0 * np.sum(m.V * turn, axis=1).real
    w = 2.0 * np.sum(-1j * n * m.V * turn, axis=1).real
    dt = m.time_s[1] - m.time_s[0]
    centre = np.concatenate([[0.0], np.cumsum(0.5 * (m.centre_rate[1:] + m.centre_rate[:-1]) * dt)])
    place = centre + (R + w) * e_r + v * e_t
    felt = np.diff(place, 2) / dt**2
    along = (felt * np.conj(e_r[1:-1])).real
    read = transient.sensed("radial_acceleration", theta)[1:-1]
    smooth = np.ones(15) / 15.0  # V'' is taken over two steps of the grid
    read, along = (np.convolve(x, smooth, "valid") for x in (read, along))
    assert np.ptp(along) > 2000.0
    assert np.std(read - along) < 0.05 * np.std(along)


def test_a_ramp_of_speed_spins_the_wheel():
    faster = Schedule((0.0, 0.1, 0.3), (SPEED, SPEED, 22.0))
    transient = driven(MODEL, AT_20, course(duration=0.7, speed=faster))
    omega = transient.motion.omega_rad_s
    assert omega[-1] / omega[0] == pytest.approx(1.1, rel=2e-3)
    level = np.abs(transient.sensed("radial_acceleration", 3.0))
    late, early = (np.median(level[s]) for s in (slice(-900, None), slice(0, 900)))
    assert late / early == pytest.approx(1.21, rel=0.03)
    pulled = (transient.motion.time_s > 0.15) & (transient.motion.time_s < 0.3)
    # the road turns the free wheel, J Omega' / R, against what the tire's drag takes
    J = 0.8 + transient.tire.J_r
    assert transient.motion.force_s_N[pulled].mean() == pytest.approx(J * 10.0 / 0.305**2, rel=0.15)


def sensed(road=None, **effects):
    """Strain at -1.7 rad with a sensor's effects, of a course over a road."""
    model = MODEL
    for name, value in effects.items():
        model = model.with_effect(name, **value)
    return driven(model, AT_20, course(road)).sensed("strain", -1.7)


def test_sensor_effects_act_on_the_whole_reading():
    gauge, lag = {"gauge_length": {"length_m": 0.06}}, {"sensor_lag": {"lag_s": 1e-3}}
    plain, long, late = (sensed(CLEAT, **effects) for effects in ({}, gauge, lag))
    added = np.abs(plain - sensed()).max()
    assert added > 5e-5
    assert 0.2 * added < np.abs(long - sensed(**gauge)).max() < 0.95 * added
    alike = np.correlate(late - late.mean(), plain - plain.mean(), "full")
    shift = np.argmax(alike) - (plain.size - 1)
    assert 0 < shift * 2e-4 < 2e-3


def test_a_longer_lag_is_no_echo_from_the_end():
    lag = {"sensor_lag": {"lag_s": 5e-3}}
    late, flat = sensed(CLEAT, **lag), sensed(**lag)
    assert np.abs(late - flat)[:50].max() < 1e-3 * np.ptp(flat)


def test_effects_on_the_structure_change_the_tire_that_moves():
    damped = MODEL.with_effect("viscous_damping", damping_rate_1_s=50.0)
    tight = MODEL.with_effect("belt_tension", tension_N=500.0)
    plain = driven(MODEL, AT_20, course()).tire
    assert driven(damped, AT_20, course()).tire.c_w == pytest.approx(60.0 + 2.0 * 3.15 * 50.0)
    assert driven(tight, AT_20, course()).tire.pb == pytest.approx(plain.pb + 500.0 / 0.305)
