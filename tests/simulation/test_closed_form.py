"""Closed form: the truth's ring, contact, friction, torque and uncatalogued effects."""

import numpy as np
import pytest

from tests.simulation.rolls import K_V, LINE_MASS, RADIUS, belt, orders, rolling
from tests.simulation.worlds import instants, scenario, world
from tirelog.data.road import RoadProfile
from tirelog.simulation import simulate
from tirelog.simulation.rolling import step_kernel as kernel
from tirelog.simulation.scenario.schema import PLANTABLE, Planted, Sensor
from tirelog.simulation.sensors.sampling import passages, tread_angle
from tirelog.simulation.steady.carcass import FlatRoadContact, carcass
from tirelog.simulation.steady.loads import Ring, friction, true_parabola, with_columns

R = 0.305
TRACTION = Planted("traction", "exact", {**PLANTABLE["traction"].parameters, "lever_m": 0.018})


def test_ring_under_a_point_load_by_its_modes():
    """Sum over n of the errata's modal stiffness."""
    damped = {"radial_damping_N_s_m2": 200.0, "tangential_damping_N_s_m2": 90.0}
    made, ring = scenario(truth="ring", tire=damped), Ring(2048, 2.0 * np.pi * R)
    speed, load = 18.0, 1000.0
    w = carcass(made, ring, instants(speed)).displacement(
        ring.point_load(np.zeros(1), np.array([load]))
    )[0]
    n = np.arange(1.0, 700.0)
    tire, spin = made.tire, speed / R
    hoop = made.conditions.inflation_pressure_Pa * tire.width_belt_m / R
    z = 2.0 / R**4 * n**2 * (1 - n**2) ** 2 + hoop * n**2 * (n**2 - 1) + 6.3e5 + 6.3e5 * n**2
    z = z + 1j * n * spin * (90.0 + 200.0 * n**2)
    phi = ring.xi_m[:, None] / R
    exact = (load / (np.pi * R) * (n**2 / z * np.exp(1j * n * phi)).real).sum(axis=1)
    assert np.abs(w - exact).max() < 1e-5 * np.abs(exact).max()
    assert abs(w.mean()) < 1e-12


def test_contact_of_the_errata_s_tire():
    """Table 2 of P3 by the errata (loads radial there, vertical here: 5 %)."""
    tire = {"rolling_radius_m": 0.3, "flexural_stiffness_N_m2": 2.0}
    made = scenario(truth="ring", tire=tire, conditions={"inflation_pressure_Pa": 1.2e5})
    road = FlatRoadContact(made, Ring(2048, 2 * np.pi * 0.3))
    for load, degrees in ((1000.0, 4.6), (3500.0, 11.3)):
        _, entry_m, exit_m = road.touch(instants(0.0, load))
        assert np.degrees((exit_m - entry_m)[0] / 0.6) == pytest.approx(degrees, rel=0.05)


def test_slip_onset_of_the_literature():
    """P2 (15): x_s = 35.0 mm at sigma = 0.15, L = 50 mm."""
    ring = Ring(8192, 2 * np.pi * R)
    at = instants(11.11, 400 * 9.81, 0.05, 0.15)
    tangential, radial, onset_m = friction(
        ring, TRACTION, true_parabola(ring, at.half_length, at.load), at
    )
    assert onset_m[0] == pytest.approx(0.035, abs=2e-5)
    assert abs(radial.sum() * ring.step_m) < 1e-9
    assert tangential.max() > 0  # braking: towards the exit
    assert tangential.min() >= 0
    driving, _, _ = friction(
        ring,
        TRACTION,
        true_parabola(ring, at.half_length, at.load),
        with_columns(at, slip=-at.slip),
    )
    assert np.array_equal(driving, -tangential)


def test_a_road_of_low_grip_slips_sooner():
    """As stiff a tread, f_s 0.3 in place of 0.8: x_s = L (1 - 2 sigma 0.8 / 0.3), f_d behind."""
    ring = Ring(8192, 2 * np.pi * R)
    at = instants(11.11, 400 * 9.81, 0.05, 0.1)
    icy = {"static_friction": 0.3, "sliding_friction": 0.2, "lever_m": 0.018}
    icy["slip_stiffness_ratio"] = 0.8 / 0.3
    pressure = true_parabola(ring, at.half_length, at.load)
    tangential, _, onset_m = friction(ring, Planted("traction", "exact", icy), pressure, at)
    assert onset_m[0] == pytest.approx(0.05 * (1.0 - 2.0 * 0.1 * 0.8 / 0.3), abs=3e-5)
    slides = (ring.xi_m > 0.03) & (ring.xi_m < 0.048)
    assert tangential[0, slides] == pytest.approx(0.2 * pressure[0, slides], rel=0.01)


HUB_INERTIA = 0.8
RING_MASS = 2.0 * np.pi * RADIUS * LINE_MASS


def test_a_torque_in_the_air_winds_up_and_spins():
    of = belt(64, tangential_damping_N_s_m2=2000.0)
    tire = rolling(of, speed=5.0, load=0.0, start=(np.zeros(64), 1.0, 0.0))
    tire.run(orders(8000, speed=5.0, load=0.0, torque=30.0))
    whole = HUB_INERTIA + RING_MASS * RADIUS**2
    assert tire.state["spin_rad_s"] == pytest.approx(5.0 / RADIUS + 30.0 * 0.2 / whole, rel=1e-3)
    # the belt lags: its share of the torque over the wind-up stiffness
    lag = 30.0 * RING_MASS * RADIUS**2 / whole / (2 * np.pi * RADIUS**2 * K_V)
    assert tire.v.mean() == pytest.approx(-lag, rel=2e-2)


OUTSIDE = [name for name, known in PLANTABLE.items() if not known.in_catalogue]


def added(name, speed, **parameters):
    """(xi [m], what the effect adds to the strain of an outer grating) at one speed."""
    w = world(effects=[{"name": name, **parameters}])
    base = world()
    at, sensor = instants(speed), Sensor("fbg_strain")
    return w.ring.xi_m, w.waveform(w.solve(at), sensor)[0] - base.waveform(base.solve(at), sensor)[
        0
    ]


@pytest.mark.parametrize("name", OUTSIDE)
@pytest.mark.parametrize("exponent", [0.0, 1.0, 2.0])
def test_size_follows_the_stated_exponent(name, exponent):
    """The size of the strain at two low speeds, where the beam itself hardly answers to speed."""
    size = []
    for speed in (2.0, 4.0):
        # a resonance that rings as far along the tread at both speeds
        along = (
            {"frequency_Hz": 8.0 * speed, "decay_s": 0.06 / speed} if name == "ring_down" else {}
        )
        wave = added(name, speed, speed_exponent=exponent, **along)[1]
        size.append(np.abs(wave).max())
    assert np.log2(size[1] / size[0]) == pytest.approx(exponent, abs=0.02)


def moments(name):
    """(place: mean xi of the squared strain [m], share of it that is even)."""
    xi, wave = added(name, 15.0)
    even = 0.5 * (wave[1:] + wave[1:][::-1])
    return float((xi * wave**2).sum() / (wave**2).sum()), float(
        (even**2).sum() / (wave[1:] ** 2).sum()
    )


def test_places_and_parities():
    half = 0.058
    for name in ("pressure_saddle", "even_bulge"):
        place, even = moments(name)
        assert abs(place) < 1e-3
        assert even > 0.999
    place, even = moments("torsion")
    assert abs(place) < 1e-3
    assert even < 1e-3
    for name in ("ring_down", "standing_wave", "exit_suction"):
        place, even = moments(name)
        assert place > 0.3 * half
        assert 0.1 < even < 0.9
    assert moments("splice")[0] > 5 * half


def test_ring_down_keeps_its_frequency_at_every_speed():
    for speed in (8.0, 16.0):
        xi, wave = added("ring_down", speed, frequency_Hz=90.0)
        behind = (xi > 0.065) & (xi < 0.065 + 0.05 * speed) & (xi < 0.5)
        signs = np.sign(wave[behind])
        crossing = xi[behind][:-1][np.diff(signs) != 0] / speed
        assert np.diff(crossing).mean() == pytest.approx(0.5 / 90.0, rel=0.02)


def test_each_grating_sees_the_splice_from_its_own_place():
    channels = {f"g{a}": {"kind": "fbg_strain", "angle_deg": a} for a in (70.0, 130.0)}
    spliced, plain = world(channels=channels, effects=[{"name": "splice"}]), world()
    seen = []
    for sensor in spliced.scenario.channels.values():
        wave = spliced.waveform(spliced.solve(instants(12.0)), sensor)[0]
        wave = wave - plain.waveform(plain.solve(instants(12.0)), sensor)[0]
        seen.append(float(np.degrees(spliced.ring.xi_m[np.argmax(wave)] / 0.305)))
    assert seen == pytest.approx([100.0, 40.0], abs=0.3)


def test_stiffening_of_the_other_form_hardens_with_the_deflection_itself():
    """k (1 + k3 0.008 |w|) w in place of k (1 + k3 w^2) w, which is compared with the models'."""
    w = world(effects=[{"name": "stiffening", "cubic_1_m2": 3000.0, "form": "other"}])
    at, ring = instants(), w.ring
    solution = w.solve(at).w[0]
    linear = ring.transform(solution[None]) / carcass(w.scenario, ring, at).radial
    force = ring.inverse(linear)[0] + 2.0e6 * 3000.0 * 0.008 * np.abs(solution) * solution
    p = true_parabola(ring, at.half_length, at.load)[0]
    smooth = ring.kernel(np.exp(-0.5 * (ring.xi_m / 0.004) ** 2))
    assert np.abs(ring.inverse(ring.transform(force - p) * smooth)).max() < 1e-5 * p.max()


def test_passages_know_the_wind_up():
    """Once a turn, at the minimum of an undamped outer grating, in hard braking too."""
    drive = [{"duration_s": 1.0, "speed_m_s": 20.0}, {"duration_s": 2.0, "speed_m_s": 8.0}]
    made = simulate(scenario(manoeuvres=drive, tire={"torsional_stiffness_N_m2": 5e4}))
    sensor = made.scenario.channels["s"]
    time = passages(made.world, sensor, 3.0)
    turns = tread_angle(made.world, sensor, time) / (2 * np.pi)
    assert np.abs(turns - np.round(turns)).max() < 1e-8
    assert np.array_equal(np.diff(np.round(turns)), np.ones(time.size - 1))
    stamps, values = made.stamp_s["s"], made.channels["s"]
    for passage in time[2:-2:5]:
        near = np.abs(stamps - passage) < 0.004
        assert abs(stamps[near][np.argmin(values[near])] - passage) < 0.001
    assert min(made.truth["channels"]["s"]["passages"]["phase_shift_deg"]) < -1.0


def test_a_wavy_road_at_a_distance():
    waves = RoadProfile(amplitude_m=0.004, wavelength_m=0.8)
    start = (np.zeros(64), 1.0, 0.0)
    tire = rolling(belt(64), speed=0.0, load=0.0, start=start, profile=waves)
    road = tire.corner_m, tire.height_m, tire.constants
    found = [kernel.road_at(x, *road) for x in (0.2, 0.4, -1)]
    np.testing.assert_allclose(found, [(0.004, 0.01 * np.pi), (0.008, 0.0), (0.0, 0.0)], atol=1e-12)
