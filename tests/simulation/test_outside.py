"""Closed form: each effect that no catalogue has is where, of the parity, exponent and frequency
that its truth states.
"""

import numpy as np
import pytest

from tirelog.simulation import simulate
from tirelog.simulation.scenario.schema import PLANTABLE, Sensor
from tirelog.simulation.sensors.sampling import passages, tread_angle
from tirelog.simulation.steady.carcass import carcass
from tirelog.simulation.steady.loads import true_parabola

from .worlds import instants, scenario, world

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
    """The size of the strain at two low speeds, where the beam itself hardly answers to speed; a
    resonance by its first peak.
    """
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
    """In hard braking the sensor arrives early, and the passage is where its place is in the patch
    centre all the same: once a turn, at the minimum of an undamped outer grating.
    """
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
